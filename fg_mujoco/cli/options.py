"""Options of the command line: texts to numbers, each refusal in the words of all others; and those of a Setup."""

from __future__ import annotations

import argparse
import math
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

from ..course.random_moving import KINDS
from ..errors import MissingExtraError, SettingsError
from ..lidar.lidar import LIDAR_BACKENDS
from ..lidar.measured_errors import effect_names
from ..pictures.pages.figure_kit import require_matplotlib
from ..racing.entries import GRIDS
from ..racing.planners import read_settings_text
from ..racing.race_control import RULES
from ..racing.setup import CAR_KEYWORDS, Setup
from ..simulation.settings import FASTEST, PLANNER_OPTIONS, DriveSettings
from ..vehicle.floors import floor_names
from ..vehicle.sensors import SENSORS
from ..vehicle.tires import tire_names
from ..vehicle.vehicle import DEFAULT_VEHICLE, vehicle_names

_LONGEST_WORD, _LONGEST_LINE = 400, 4000  # characters of a message

_COMMA = re.compile(r",(?![^\[]*\])")  # outside brackets
_FIELD = re.compile(r"(?:[A-Z]\w*\.)?([a-z]\w*)(?= is )")
_FIELD_INSIDE = re.compile(r"(?<=: )[A-Z]\w*\.(?=[a-z]\w* is )")  # the class of a field, within a message


def in_options(message: str, command: argparse.ArgumentParser) -> str:
    """Return a message whose first words are a field, as "Entry.mu is ...", with the option that sets it: --mu.

    Args:
      message: of an error.
      command: whose options they are; a message about anything else stays as it is.
    """
    options = {action.dest: action.option_strings[0] for action in command._actions if action.option_strings}
    if message.startswith("randomize ") and "randomize" in options:
        return f"--{_FIELD_INSIDE.sub('', message)}"
    field = _FIELD.match(message)
    if field is None:
        return message
    option = options.get(field[1])
    return message if option is None else f"{option}{message[field.end() :]}"


def in_one_line(message: str) -> str:
    """Return a message in one line of bounded length, without the middle of what is longer, or control characters."""
    words = (word if len(word) <= _LONGEST_WORD else f"{word[:100]}...{word[-60:]}" for word in message.split())
    words = ("".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in word) for word in words)
    line = " ".join(words)
    return line if len(line) <= _LONGEST_LINE else f"{line[: _LONGEST_LINE // 2]} ... {line[-_LONGEST_LINE // 4 :]}"


def names_in(text: str) -> list[str]:
    """Read names with commas between them; a comma in brackets is part of a name."""
    names = [name.strip() for name in _COMMA.split(text)]
    if not all(names):
        raise argparse.ArgumentTypeError(f"{text!r}; accepted: names, a comma between two")
    return names


def whole(text: str) -> int:
    """Read a whole number."""
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}; accepted: a whole number") from None


def number(text: str) -> float:
    """Read a number."""
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}; accepted: a number") from None


def number_or_off(text: str) -> float:
    """Read a number, or `off`, which is infinity."""
    if text == "off":
        return math.inf
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}; accepted: a number, or off") from None


def pairs(text: str) -> dict[str, Any]:
    """Read `x=1,y=2`."""
    try:
        return read_settings_text(text)
    except SettingsError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def name_or_pairs(text: str) -> str | dict[str, Any]:
    """Read `imu`, or `sensor=imu,rate=100`."""
    return pairs(text) if "=" in text else text


_SETUP: dict[str, dict[str, Any]] = {
    "track": {
        "metavar": "TRACK",
        "help": "NAME, random:SEED[:tight], scene:NAME:SEED, file.csv or map.yaml; default: oval; names: track list, "
        "track scenes",
    },
    "controller": {
        "help": "NAME, path/to/file.py:ClassName, a policy's file or folder, or ros:path/to/node.py, with settings "
        "NAME[SETTING=VALUE,...]; "
        "default: gap_finder",
    },
    "vehicle": {
        "metavar": "NAME|FILE.xml",
        "help": f"{', '.join(vehicle_names())}, or the MJCF file of one; default: {DEFAULT_VEHICLE}",
    },
    "tires": {
        "metavar": "NAME|FILE.toml",
        "help": f"{', '.join(tire_names())}, or the file of a set; default: the vehicle's, coulomb",
    },
    "mu": {
        "type": number, "metavar": "MU",
        "help": "friction coefficient of the tires, or their greatest peak; default: as published",
    },
    "floor": {
        "metavar": "NAME|FILE.toml",
        "help": "a floor that was measured, whose friction the tires have, in place of --mu: "
        f"{', '.join(floor_names())}, or the file of one",
    },
    "planner_mu": {
        "type": number_or_off, "metavar": "MU",
        "help": "friction coefficient that the planner assumes; off: no friction limits; default: that of --mu",
    },
    "max_speed": {
        "type": number, "metavar": "V",
        "help": f"fastest that the planner may command [m/s]; default: {FASTEST:g}",
    },
    "laps": {"type": whole, "metavar": "N", "help": "default: 5; a scene is driven once"},
    "time_limit": {
        "type": number, "metavar": "S",
        "help": "of simulated time; default: what a car of 0.5 m/s needs, or the scene's",
    },
    "obstacles": {"type": whole, "metavar": "N", "help": "boxes on the track, with a way past each; default: 0"},
    "obstacle_seed": {"type": whole, "metavar": "K", "help": "of their places, and of --moving; default: 0"},
    "moving": {
        "metavar": "KIND[:N],...",
        "help": f"what moves on the track, at places that --obstacle-seed draws: {', '.join(KINDS)}; default: nothing",
    },
    "patches": {
        "type": pairs, "action": "append", "metavar": "x=X,...",
        "help": "a patch of the floor with another friction, x=1,y=2,length=3,width=1,mu=.4; again for each",
    },
    "lidar": {"metavar": "NAME", "help": f"{' or '.join(LIDAR_BACKENDS)}; default: raycast"},
    "lidar_effects": {
        "metavar": "NAME|FILE.toml",
        "help": f"noise, bias and dropouts by range and bearing as measured: {', '.join(effect_names())}, or the file "
        "that validate --beams wrote",
    },
    "lidar_noise": {"type": number, "metavar": "M", "help": "standard deviation of each range"},
    "lidar_dropout": {"type": number, "metavar": "P", "help": "probability that a beam fails"},
    "lidar_latency": {"type": number, "metavar": "S", "help": "from measurement to delivery"},
    "motion_distortion": {
        "action": "store_const", "const": True, "help": "each beam from the pose at its own time in the sweep"
    },
    "odometry_drift": {"type": number, "metavar": "D", "help": "relative error of measured speeds and yaw rate"},
    "sensors": {
        "type": name_or_pairs, "action": "append", "metavar": "NAME",
        "help": f"a sensor besides LiDAR and odometry, {', '.join(SENSORS)}, or sensor=NAME,rate=100,noise_std=.1 with "
        "settings; again for each",
    },
    "start_s": {"type": number, "metavar": "M", "help": "progress at which the car starts; default: 0"},
    "start_offset": {"type": number, "metavar": "M", "help": "how far to the left of the line it starts; default: 0"},
    "start_heading": {"type": number, "metavar": "RAD", "help": "from the line's, left positive; default: 0"},
    "start_speed": {"type": number, "metavar": "V", "help": "with wheels rolling; default: 0"},
    "mass": {"type": number, "metavar": "KG", "help": "of the whole car; default: the vehicle's"},
    "cog_height": {"type": number, "metavar": "M", "help": "of the centre of gravity; default: the vehicle's"},
    "steering_gain": {"type": number, "metavar": "K", "help": "times the stiffness of the steering servo; default: 1"},
    "speed_gain": {"type": number, "metavar": "K", "help": "times the gain of the speed servo; default: 1"},
    "command_delay": {"type": number, "metavar": "S", "help": "from a command to the servos; default: the vehicle's"},
    "seed": {"type": whole, "metavar": "N", "help": "of noise and dropouts; default: 0"},
    "opponents": {
        "action": "extend", "type": names_in, "metavar": "LIST",
        "help": "cars that race against this one, by their controllers, comma between two, or again for each; vehicle "
        "and tires are the same",
    },
    "grid": {"metavar": "NAME", "help": f"before the start: {' or '.join(GRIDS)}; default: {GRIDS[0]}"},
    "rules": {"metavar": "NAME", "help": f"of race control: {' or '.join(RULES)}; default: none"},
    "decision_limit": {
        "type": number, "metavar": "S",
        "help": "of wall time for each decision; a planner that takes longer, or never answers, ends its race",
    },
}  # fmt: skip
"""Keyword of a Setup -> the option of the same name. Options have no defaults: those are the setup's."""

_TYPES: dict[type, dict[str, Any]] = {
    bool: {"action": "store_const", "const": True}, int: {"type": whole, "metavar": "N"},
    float: {"type": number, "metavar": "X"}, str: {"metavar": "TEXT"},
}  # fmt: skip
for _field in fields(DriveSettings):
    if _field.name in PLANNER_OPTIONS:
        _SETUP[_field.name] = _TYPES[type(_field.default)] | {"help": _field.metadata["help"]}

GROUPS: dict[str, tuple[str, ...]] = {
    "what is driven": (
        "track", "controller", "laps", "obstacles", "obstacle_seed", "moving", "max_speed", "start_s", "start_offset",
        "start_heading", "start_speed", "seed", "time_limit", "decision_limit",
    ),
    "car": ("vehicle", "tires", "mass", "cog_height", "steering_gain", "speed_gain", "command_delay"),
    "floor": ("mu", "floor", "planner_mu", "patches"),
    "sensors": (
        "lidar", "lidar_effects", "lidar_noise", "lidar_dropout", "lidar_latency", "motion_distortion",
        "odometry_drift", "sensors", *PLANNER_OPTIONS,
    ),
    "other cars": ("opponents", "grid", "rules"),
}  # fmt: skip
"""Title in a command's help -> the keywords of a Setup below it."""
OUTPUT = "output"
"""Title of the options of what a command writes."""

CAR = (
    "vehicle", "tires", "mu", "floor", "planner_mu", "max_speed", "start_s", "start_offset", "start_heading",
    "start_speed", "mass", "cog_height", "steering_gain", "speed_gain", "command_delay", "lidar_effects", "lidar_noise",
    "lidar_dropout", "lidar_latency", "odometry_drift", "sensors", *PLANNER_OPTIONS,
)  # fmt: skip
"""Keywords of a car that every command with a planner has."""


OPPONENT_OPTIONS: dict[str, dict[str, Any]] = {
    f"opponent_{name}": {"metavar": metavar, "help": f"{text}; once for all, or once for each; default: {usual}"}
    for name, metavar, text, usual in (
        ("max_speed", "V", "fastest that it may be commanded [m/s]", "as --max-speed"),
        ("vehicle", "NAME|FILE.xml", "its vehicle", "as --vehicle"),
        ("tires", "NAME|FILE.toml", "its tires", "as --tires"),
    )
}
"""Options of the opponents' cars, which follow `--opponents`."""
OPPONENT_OPTIONS["opponent_max_speed"]["type"] = number


def group(command: argparse.ArgumentParser, title: str) -> argparse._ArgumentGroup:
    """Return the group of a command's options that has a title in its help; a new one, if there is none."""
    there = (each for each in command._action_groups if each.title == title)
    return next(there, None) or command.add_argument_group(title)


def add_setup_options(command: argparse.ArgumentParser, *names: str, **helps: str) -> None:
    """Add options of a Setup, each to its group; `setup_of` reads them.

    Args:
      command: that gets them.
      names: keywords of a Setup.
      helps: other help texts, by keyword.
    """
    for title, members in GROUPS.items():
        for name in [name for name in names if name in members]:
            add = group(command, title).add_argument
            own = _SETUP[name] | ({"help": helps[name]} if name in helps else {})
            add(f"--{name.replace('_', '-')}", default=argparse.SUPPRESS, **own)
            if name == "opponents":
                for option, reads in OPPONENT_OPTIONS.items():
                    add(f"--{option.replace('_', '-')}", action="append", **reads)


def given_settings(options: argparse.Namespace, lists: Sequence[str] = ()) -> dict[str, Any]:
    """Return the keywords of a Setup that the options give, but those that are lists of a study."""
    return {name: getattr(options, name) for name in _SETUP if hasattr(options, name) and name not in lists}


def setup_of(options: argparse.Namespace, *, lists: Sequence[str] = ()) -> Setup:
    """Return the setup that options say: that of the file of `--config` with what the command line gives besides.

    Args:
      options: of a command.
      lists: names of options of which a study takes several values.

    Raises:
      SettingsError: a value that is not accepted, or values of opponents that are not one for all or one for each.
    """
    given = given_settings(options, lists)
    names, own = given.pop("opponents", []), {name: getattr(options, name, None) or [] for name in OPPONENT_OPTIONS}
    among = {name: given.pop(name) for name in ("grid", "rules") if name in given}
    setup = getattr(options, "setup", None) or Setup()
    if len(setup.entries) > 1:  # of a file: an option is for all of its cars
        setup = setup.with_cars(**{name: given.pop(name) for name in list(given) if name in CAR_KEYWORDS})
    setup = setup.replace(**given)
    return with_opponents(setup, names, own, **among) if names or any(own.values()) else setup.replace(**among)


def with_opponents(setup: Setup, names: Sequence[str], own: Mapping[str, Sequence[Any]], **among: str) -> Setup:
    """Return a setup with opponents, set as the first car but for what is their own; each draws its own noise.

    Args:
      setup: of the first car.
      names: of the opponents' planners.
      own: values of their cars by name, as in OPPONENT_OPTIONS; one for all, one for each, or none.
      among: `grid` and `rules`.

    Raises:
      SettingsError: values that are neither one for all nor one for each, or that no car can have.
    """
    of_each: list[dict[str, Any]] = [{} for _ in names]
    for option, values in own.items():
        said = f"--{option.replace('_', '-')}"
        if len(values) not in (0, 1, len(names)) or (values and not names):
            raise SettingsError(
                f"{said} is given {len(values)} times for {len(names)} opponents; accepted: once, or once for each "
                "--opponents"
            )
        for car, value in zip(of_each, list(values) * (len(names) if len(values) == 1 else 1), strict=False):
            car[option.removeprefix("opponent_")] = value
    first, cars = setup.first, []
    for index, (name, car) in enumerate(zip(names, of_each, strict=True), start=1):
        try:
            cars.append(replace(first.like(name), seed=(first.seed + index) % 2**63, **car))
        except SettingsError as error:
            field = _FIELD.match(str(error))
            if field is None or field[1] not in car:
                raise
            text = str(error)[field.end() :]
            raise SettingsError(f"--opponent-{field[1].replace('_', '-')}{text}") from error
    return setup.replace(entries=(first, *cars), **among)


def add_trust_option(
    add: Callable[..., Any], text: str = "load the recorded planner if it is not bundled, which runs its code"
) -> None:
    """Add the option that says that code of a file may run; `add` adds an option to a command."""
    add("--trust", action="store_true", help=text)


def can_draw(what: str, *, several: bool = True) -> bool:
    """Return whether there is matplotlib; if not, say on stderr that `what` is left out, and how to have it."""
    try:
        require_matplotlib()
    except MissingExtraError as error:
        print(f"fg-mujoco: {what} {'are' if several else 'is'} left out; {error}", file=sys.stderr)
        return False
    return True
