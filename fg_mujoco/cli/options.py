"""Options of a Setup: each is read from the field that it sets; and messages in the words of the command line.

The option of a keyword is written at its field, by `arguments.setting`: its help, its group and what stands for its
value. This module adds how a text is read, and which names there are.
"""

from __future__ import annotations

import argparse
import copyreg
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import Field, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

from .. import from_addons
from ..course.files import kept_folder
from ..errors import FgMujocoError, SettingsError, accepted_names
from ..lidar.effects import LidarEffects
from ..racing.entries import Entry
from ..racing.planners import import_file
from ..racing.setup import CAR_KEYWORDS, FIELD_OF, Setup
from ..registry import Registry
from ..simulation.settings import Start
from ..vehicle.changes import CarChanges
from .command import Part, group, names_in, number, option, pairs, whole

_LONGEST_WORD, _LONGEST_LINE = 400, 4000  # characters of a message

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


def number_or_off(text: str) -> float:
    """Read a number, or `off`, which is infinity."""
    try:
        return math.inf if text == "off" else number(text)
    except argparse.ArgumentTypeError as error:
        raise argparse.ArgumentTypeError(f"{error}, or off") from None


_SENSOR_FILE = re.compile(r"(?:^|(?<=sensor=))[^,=]+\.py(?::\w*)?")


def sensor(text: str) -> str | dict[str, Any]:
    """Read `imu`, `path/to/file.py:Class`, or either with settings: `sensor=imu,rate=100`."""
    if "=" not in text:
        return text
    file = _SENSOR_FILE.search(text)
    return pairs(text) if file is None else pairs(text.replace(file[0], "file")) | {"sensor": file[0]}


def _with_files(sensors: Sequence[Any]) -> list[Any]:
    """Return the sensors of options, those in files by the names under which they are registered now."""
    found = []
    for each in sensors:
        given = dict(each) if isinstance(each, Mapping) else {"sensor": each}
        source = str(given.get("sensor", ""))
        path, name = (source, "") if source.endswith(".py") else source.rpartition(":")[::2]
        found.append(given | {"sensor": _registered(Path(path), name)} if path.endswith(".py") else each)
    return found


@kept_folder()
def _registered(path: Path, name: str) -> str:
    """Return the name in SENSORS of a sensor's class in a file: that under which the file registers it, or its own.

    Raises:
      ControllerError: the file does not import.
      SettingsError: it has no such sensor, or one of a bundled name.
    """
    from ..vehicle.sensors import SENSORS, Sensor

    said = f"sensor {str(path)!r}"
    module = import_file(path, said)
    own = [each for each in vars(module).values() if isinstance(each, type) and each.__module__ == module.__name__]
    found = {kind.__name__: kind for kind in own if issubclass(kind, Sensor)}
    name = next(iter(found)) if len(found) == 1 and not name else name
    if name not in found:
        listed = accepted_names(name, found) if found else "accepted: a subclass of Sensor there"
        raise SettingsError(f"{said} has no {name or 'class named behind it'}; {listed}")
    there = next((each for each in SENSORS if SENSORS.find(each) is found[name]), None)
    if there is None and name in SENSORS and SENSORS.find(name).__module__.startswith("fg_mujoco."):
        raise SettingsError(f"{said} has a class {name}, the name of a bundled sensor; accepted: another name")
    if there is None:
        SENSORS[name] = found[name]
    there = there or name
    copyreg.pickle(found[name], lambda sensor: (_unset, (path.resolve(), name, there), vars(sensor)))
    return there


def _unset(path: Path, name: str, there: str) -> Any:
    """Return a sensor of a class in a file, without values, in a process that may not know it: it travels there."""
    from ..vehicle.sensors import SENSORS

    return object.__new__(SENSORS.find(there if there in SENSORS else _registered(path, name)))


GROUPS = ("course and planner", "car", "floor", "sensors", "other cars")
"""Titles of a Setup's options in the help of a command, in their order."""

_NAMES: Registry[Any] = Registry("names", SettingsError, own={
    name: f"fg_mujoco.{place}"
    for name, place in {
        "track": "course.formats:course_names", "controller": "racing.planners:controller_names",
        "vehicle": "vehicle.vehicle:vehicle_names", "tires": "vehicle.tires:tire_names",
        "moving": "course.moving_obstacles:KINDS_THAT_MOVE",
        "lidar": "lidar.lidar:LIDARS",
        "sensors": "vehicle.sensors:SENSORS", "opponents": "racing.planners:controller_names",
        "grid": "racing.entries:GRIDS", "rules": "racing.rules:RULES",
    }.items()
})  # fmt: skip
_NAMES_OF_ADDONS: dict[str, Callable[[], tuple[str, ...]]] = {
    "floor": lambda: from_addons.floor_names(), "lidar_effects": lambda: from_addons.effect_names(),
}  # fmt: skip


def _names_of(keyword: str) -> Iterable[str]:
    """Return the names that a setting takes; none where they are of an add-on that cannot be imported."""
    if keyword in _NAMES_OF_ADDONS:
        try:
            return _NAMES_OF_ADDONS[keyword]()
        except FgMujocoError:
            return ()
    found = _NAMES.find(keyword)
    names: Iterable[str] = found() if callable(found) else found
    return names


NAMES: dict[str, Callable[[], Iterable[str]]] = {
    keyword: partial(_names_of, keyword) for keyword in (*_NAMES, *_NAMES_OF_ADDONS)
}
"""Keyword of a Setup -> the names that it takes, for the help and for the shell."""

_KINDS: dict[str, type] = {"effects": LidarEffects, "start": Start, "changes": CarChanges}


def _fields() -> dict[str, Field[Any]]:
    """Return the fields that are options, by the keywords that set them."""
    found: dict[str, Field[Any]] = {}
    for field in (*fields(Setup), *fields(Entry)):
        found.setdefault(field.name, field)
    for keyword, (part, name) in FIELD_OF.items():
        found[keyword] = next(field for field in fields(_KINDS[part]) if field.name == name)
    return {name: field for name, field in found.items() if "help" in field.metadata}


def _reading(keyword: str, kind: str) -> dict[str, Any]:
    """Return how the option of a field is read; `kind` is the text of its type."""
    if keyword in _READ_AS:
        return _READ_AS[keyword]
    words = re.findall(r"\w+", kind)
    if "bool" in words:
        return {"action": "store_const", "const": True}
    return {"reads": number if "float" in words else whole if "int" in words else None}


_READ_AS: dict[str, dict[str, Any]] = {
    "planner_mu": {"reads": number_or_off},
    "patches": {"reads": pairs, "action": "append"},
    "sensors": {"reads": sensor, "action": "append"},
}
_OPTIONS: dict[str, dict[str, Any]] = {
    name: {
        "text": field.metadata["help"], "metavar": field.metadata["metavar"] or None, "title": field.metadata["group"],
        "names": NAMES.get(name), "default": argparse.SUPPRESS, **_reading(name, str(field.type)),
    }
    for name, field in _fields().items()
} | {
    "opponents": {
        "text": "cars that race against this one, by their controllers, comma between two, or again for each; vehicle "
        "and tires are the same", "metavar": "LIST", "title": "other cars", "names": NAMES["opponents"],
        "default": argparse.SUPPRESS, "reads": names_in, "action": "extend",
    }
}  # fmt: skip
"""Keyword of a Setup -> the option of the same name, as `option` takes it. Defaults are those of the Setup."""

_OF_OPPONENTS = {
    f"opponent_{name}": _OPTIONS[name] | {
        "text": f"of the opponents' cars; once for all, or once for each; default: as --{name.replace('_', '-')}",
        "title": "other cars", "default": None, "action": "append",
    }
    for name in ("max_speed", "vehicle", "tires")
}  # fmt: skip

OPPONENT_OPTIONS = tuple(_OF_OPPONENTS)
"""Options of the opponents' cars, which follow `--opponents`."""


def setup_options(*names: str, but: Sequence[str] = (), **helps: str) -> Part:
    """Return the part that adds options of a Setup, each to its group; `setup_of` reads them.

    Args:
      names: keywords of a Setup; none: all.
      but: keywords that are left out.
      helps: other help texts, by keyword.
    """
    chosen = {name: own for name, own in _OPTIONS.items() if name in (names or _OPTIONS) and name not in but}
    if "opponents" in chosen:
        chosen |= _OF_OPPONENTS
    chosen = {name: own | ({"text": helps[name]} if name in helps else {}) for name, own in chosen.items()}
    parts = [option(f"--{name.replace('_', '-')}", **own) for name, own in chosen.items()]

    def add(parser: argparse.ArgumentParser) -> None:
        for title in GROUPS:
            group(parser, title)
        for part in parts:
            part(parser)

    return add


def given_settings(options: argparse.Namespace, lists: Sequence[str] = ()) -> dict[str, Any]:
    """Return the keywords of a Setup that the options give, but those that are lists of a study."""
    return {name: getattr(options, name) for name in _OPTIONS if hasattr(options, name) and name not in lists}


def setup_of(options: argparse.Namespace, *, lists: Sequence[str] = ()) -> Setup:
    """Return the setup that options say: that of the file of `--config` with what the command line gives besides.

    Args:
      options: of a command.
      lists: names of options of which a study takes several values.

    Raises:
      SettingsError: a value that is not accepted, or values of opponents that are not one for all or one for each.
    """
    given = given_settings(options, lists)
    if "sensors" in given:
        given["sensors"] = _with_files(given["sensors"])
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
    for keyword, values in own.items():
        said = f"--{keyword.replace('_', '-')}"
        if len(values) not in (0, 1, len(names)) or (values and not names):
            raise SettingsError(
                f"{said} is given {len(values)} times for {len(names)} opponents; accepted: once, or once for each "
                "--opponents"
            )
        for car, value in zip(of_each, list(values) * (len(names) if len(values) == 1 else 1), strict=False):
            car[keyword.removeprefix("opponent_")] = value
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
