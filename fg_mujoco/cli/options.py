"""Options of the command line: texts to numbers, each refusal in the words of all others."""

from __future__ import annotations

import argparse
import math
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ..errors import MissingExtraError, SettingsError
from ..racing.entries import GRIDS, Entry
from ..simulation.settings import FASTEST
from ..vehicle.tires import tire_names
from ..vehicle.vehicle import DEFAULT_VEHICLE, vehicle_names
from ..viz.plots import require_matplotlib

DRIVE = ("vehicle", "tires", "mu", "planner_mu", "max_speed")
"""Settings that are spelt alike at every door."""

_LONGEST_WORD, _LONGEST_LINE = 400, 4000  # characters of a message

_OPTION_OF = {
    "range_noise_std": "lidar_noise", "dropout_probability": "lidar_dropout", "latency": "lidar_latency",
}  # fmt: skip
"""Field -> option that sets it, where they are spelt otherwise."""

_FIELD = re.compile(r"(?:[A-Z]\w*\.)?([a-z]\w*)(?= is )")
_FIELD_INSIDE = re.compile(r"(?<=: )[A-Z]\w*\.(?=[a-z]\w* is )")  # the class of a field, within a message


def in_options(message: str, command: argparse.ArgumentParser) -> str:
    """Return a message whose first words are a field, as "RaceSettings.mu is ...", with the option that sets it: --mu.

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
    name = _OPTION_OF.get(field[1], field[1])
    option = options.get(name) or options.get(f"{name}s")  # the command compare takes lists
    return message if option is None else f"{option}{message[field.end() :]}"


def in_one_line(message: str) -> str:
    """Return a message in one line of bounded length, without the middle of what is longer, or control characters."""
    words = (word if len(word) <= _LONGEST_WORD else f"{word[:100]}...{word[-60:]}" for word in message.split())
    words = ("".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in word) for word in words)
    line = " ".join(words)
    return line if len(line) <= _LONGEST_LINE else f"{line[: _LONGEST_LINE // 2]} ... {line[-_LONGEST_LINE // 4 :]}"


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


def add_controller_option(add: Callable[..., Any]) -> None:
    """Add the option that chooses a controller; `add` adds an option to a command."""
    add(
        "--controller", default="gap_finder",
        help="NAME, path/to/file.py:ClassName or ros:path/to/node.py, with settings NAME[SETTING=VALUE,...]; "
        "default: gap_finder",
    )  # fmt: skip


def add_trust_option(add: Callable[..., Any]) -> None:
    """Add the option that says that a recorded planner may be loaded; `add` adds an option to a command."""
    add("--trust", action="store_true", help="load the recorded planner if it is not bundled, which runs its code")


def add_drive_options(add: Callable[..., Any], *names: str, of: str = "the") -> None:
    """Add the options of which car drives and what its planner is told; `drive_options` reads them.

    Args:
      add: adds an option to a command.
      names: of DRIVE, those that the command has; none: all.
      of: whose tires `--mu` is about, "the" car's or "each" car's.
    """
    settings: dict[str, dict[str, Any]] = {
        "vehicle": {
            "default": DEFAULT_VEHICLE, "metavar": "NAME|FILE.xml",
            "help": f"{', '.join(vehicle_names())}, or the MJCF file of one; default: {DEFAULT_VEHICLE}",
        },
        "tires": {
            "metavar": "NAME|FILE.toml",
            "help": f"{', '.join(tire_names())}, or the file of a set; default: the vehicle's, coulomb",
        },
        "mu": {
            "type": number, "metavar": "MU",
            "help": f"friction coefficient of {of} car's tires, or their greatest peak; default: as published",
        },
        "planner_mu": {
            "type": number_or_off, "metavar": "MU",
            "help": "friction coefficient that the planner assumes; off: no friction limits; default: that of --mu",
        },
        "max_speed": {
            "type": number, "default": FASTEST, "metavar": "V",
            "help": f"fastest that the planner may command [m/s]; default: {FASTEST:g}",
        },
    }  # fmt: skip
    for name in names or DRIVE:
        add(f"--{name.replace('_', '-')}", **settings[name])


def add_opponent_options(add: Callable[..., Any]) -> None:
    """Add the options of a race's other cars; `opponents_of` reads them. `add` adds an option to a command."""
    add(
        "--opponent", action="append", metavar="NAME[...]",
        help="a car that races against this one, by its controller; again for each; vehicle and tires are the same",
    )  # fmt: skip
    add(
        "--opponent-max-speed", action="append", type=number, metavar="V",
        help="fastest that it may be commanded [m/s]; once for all, or once for each; default: as --max-speed",
    )  # fmt: skip
    add("--grid", default=GRIDS[0], metavar="NAME", help=f"before the start: {' or '.join(GRIDS)}; default: {GRIDS[0]}")


def opponents_of(options: argparse.Namespace, first: Entry) -> tuple[Entry, ...]:
    """Return the entries of the opponents among the options, none where there are none.

    Raises:
      SettingsError: speeds that are neither one for all nor one for each, or that no car can have.
    """
    names, speeds = options.opponent or [], options.opponent_max_speed or []
    if len(speeds) not in (0, 1, len(names)) or (speeds and not names):
        raise SettingsError(
            f"--opponent-max-speed is given {len(speeds)} times for {len(names)} opponents; accepted: once, or once "
            "for each --opponent"
        )
    given = speeds * len(names) if len(speeds) == 1 else speeds or [first.max_speed] * len(names)
    try:
        return tuple(
            replace(first.like(name, max_speed=speed), seed=first.seed + index)
            for index, (name, speed) in enumerate(zip(names, given, strict=True), start=1)
        )
    except SettingsError as error:
        raise SettingsError(f"--opponent-max-speed{str(error).removeprefix('Entry.max_speed')}") from error


def drive_options(options: argparse.Namespace, *names: str) -> dict[str, Any]:
    """Return what `add_drive_options` added, as keywords of a race."""
    return {name: getattr(options, name) for name in names or DRIVE}


def can_draw(what: str, *, several: bool = True) -> bool:
    """Say whether there is matplotlib; if not, say on stderr that `what` is left out, and how to have it."""
    try:
        require_matplotlib()
    except MissingExtraError as error:
        print(f"fg-mujoco: {what} {'are' if several else 'is'} left out; {error}", file=sys.stderr)
        return False
    return True
