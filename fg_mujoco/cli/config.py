"""Settings of a race in a file: `fg-mujoco race --config race.toml`, or `--config DIR`, a run folder, to race it again.

    track = "oval"
    laps = 2
    planner-mu = "off"
    motion-distortion = true

A planner's file that is no longer where the command is given, or was edited, is the copy that the run folder keeps.

The keys are the long options of `race`, with `-` or `_`, read off its parser; a value has the type that TOML gives it,
and paths are from the present folder, as on the command line. Options on the command line win over the file's.
"""

from __future__ import annotations

import argparse
import math
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any

from ..course.files import is_folder, read_bytes
from ..errors import FgMujocoError, RunFolderError, SettingsError, accepted_names
from ..lidar.effects import LidarEffects
from ..lidar.lidar import LIDAR_BACKENDS
from ..messages import require_whole
from ..racing.planner_choice import ControllerChoice
from ..racing.planner_sources import find_controller
from ..racing.planner_trust import controller_of, files_of, recorded_sha256, require_trusted
from ..racing.race import RaceSettings
from ..racing.race_control import find_rules
from ..racing.run_folder import SUMMARY, read_summary
from ..simulation.course_loading import load_track
from ..vehicle.tires import Tires
from ..vehicle.vehicle import DEFAULT_VEHICLE, Vehicle
from .options import number, number_or_off, whole

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

Check = Callable[[Any], object]
"""Raises an error of this package where an option cannot have a value."""

_OPTION = "--config"
_OF_THE_OUTPUT = ("out", "video", "json", "traceback")  # options that say nothing about the race itself
_MOST_BYTES, _MOST_LINES, _MOST_CHARACTERS = 2**20, 1000, 2000  # of a TOML file, the last of one line in it
_OF_THE_USER = ("help", "config", "trust", "force")  # options that no file can set


def add_config(command: argparse.ArgumentParser) -> None:
    """Give a command the option `--config`, with which `parse` sets its defaults."""
    command.add_argument(
        _OPTION, metavar="FILE", help="settings from a TOML file, or from a run folder to race it again; options win"
    )


def parse(parser: argparse.ArgumentParser, arguments: Sequence[str] | None) -> argparse.Namespace:
    """Return the options of a command line, those that it does not give from the file of its `--config`.

    Raises:
      SettingsError: a file that cannot be read, with an unknown key, or with a value that its option cannot have.
      RunFolderError: a folder that is no run's, or holds no settings.
      ControllerError: a run folder's planner that is not bundled, and not trusted or not the recorded one.
    """
    options = parser.parse_args(arguments)
    if getattr(options, "config", None) is None:
        return options
    parser = deepcopy(parser)  # the defaults of this command line are not those of the next
    options = parser.parse_args(arguments)
    given = read_config(options.config, options.command)
    options.command.set_defaults(**given)
    options = parser.parse_args(arguments)
    if is_folder(options.config) and options.controller == given.get("controller"):
        summary, where = read_summary(options.config), f"{Path(options.config) / SUMMARY}, settings"
        source = ControllerChoice.of(options.controller).source
        require_trusted(source, recorded_sha256(summary), trust=options.trust, where=where, files=files_of(summary))
        rows = (summary.get("cars") or [])[1:]
        if options.opponent == given.get("opponent") and rows:
            for text, row in zip(options.opponent or [], rows, strict=False):
                opponent = ControllerChoice.of(text).source
                require_trusted(opponent, recorded_sha256(row), trust=options.trust, where=where, files=files_of(row))
    return options


def settings_of(options: argparse.Namespace) -> dict[str, Any]:
    """Return the settings of a race among its options, as JSON has them: `planner_mu` off is "off"."""
    names = [name for name in _settable(options.command) if name not in _OF_THE_OUTPUT]
    values = {name: getattr(options, name) for name in names}
    return {name: "off" if value == math.inf else value for name, value in values.items()}


def read_config(path: str | Path, command: argparse.ArgumentParser) -> dict[str, Any]:
    """Return the values of a command's options, by name, as a TOML file or a run folder has them.

    Raises:
      SettingsError, RunFolderError: as `parse`.
    """
    path = Path(path)
    return _read_run(path, command) if is_folder(path) else _read_toml(path, command)


def _read_toml(path: Path, command: argparse.ArgumentParser) -> dict[str, Any]:
    try:
        text = read_bytes(path, _MOST_BYTES).decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise SettingsError(f"{path}: cannot be read: {reason}; accepted: a TOML file, or a run folder") from error
    _check_text(path, text)
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:  # it says which line
        raise SettingsError(f'{path}: {error}; accepted: TOML, as: track = "oval"') from error
    except (ValueError, RecursionError) as error:  # of thousands of digits or levels
        reason = "nested too deep" if isinstance(error, RecursionError) else error
        raise SettingsError(f'{path}: {reason}; accepted: TOML, as: track = "oval"') from error
    values: dict[str, Any] = {}
    for key, value in content.items():
        where = f"{path}, line {_line(text, key)}"
        name = _known(key, command, where)
        if name in values:
            raise SettingsError(f"{where}: {key!r} was given before; accepted: each setting once")
        values[name] = _checked(name, value, command, where)
    return values


def _check_text(path: Path, text: str) -> None:
    """Refuse a text that is no race's settings before it is read, which takes the square of its size."""
    lines = text.split("\n")
    if len(lines) > _MOST_LINES:
        raise SettingsError(f"{path}: {len(lines)} lines; accepted: {_MOST_LINES} at most")
    for place, line in enumerate(lines, start=1):
        if len(line) > _MOST_CHARACTERS:
            raise SettingsError(
                f"{path}, line {place}: {len(line)} characters; accepted: {_MOST_CHARACTERS} at most in a line"
            )


def _read_run(folder: Path, command: argparse.ArgumentParser) -> dict[str, Any]:
    summary = read_summary(folder)
    settings = summary.get("settings")
    where = f"{folder / 'summary.json'}, settings"
    if not isinstance(settings, dict):
        raise RunFolderError(f"{where}: there are none; accepted: a folder that `fg-mujoco race --out` wrote")
    given = {_known(key, command, where): value for key, value in settings.items() if value is not None}
    for name in given:
        if name in _OF_THE_OUTPUT:
            raise RunFolderError(f"{where}: {name!r} is set; accepted: what is written is said on the command line")
    if isinstance(given.get("controller"), str):
        given["controller"] = controller_of(folder, summary, given["controller"])
    # the planner is not loaded here: `parse` asks first whether it may be
    checks = {name: check for name, check in _CHECKS.items() if name not in ("controller", "opponent")}
    values = {name: _checked(name, value, command, where, checks) for name, value in given.items()}
    vehicle = Vehicle.load(values.get("vehicle", DEFAULT_VEHICLE))
    of_a_file = vehicle.source == vehicle.file  # bundled ones are those of the version
    if of_a_file and vehicle.sha256 != summary.get("vehicle_sha256"):
        raise RunFolderError(f"{where}: vehicle {vehicle.file} is another one now; accepted: the file as it was raced")
    if "tires" in values and Tires.load(values["tires"]).sha256 != summary.get("tires_sha256"):
        raise RunFolderError(f"{where}: tires {values['tires']} are others now; accepted: the set as it was raced")
    if values.get("mu") is not None and "planner_mu" not in values:
        told = RaceSettings(vehicle=vehicle, tires=values.get("tires"), mu=values["mu"]).assumed_mu
        if summary.get("planner_mu") not in (None, told):  # up to version 0.1.0 planners were not told of mu
            values["planner_mu"] = summary["planner_mu"]
    return values


def _line(text: str, key: str) -> int:
    """Return the line on which a top-level key of a TOML text is first given, from 1.

    A statement begins after the longest run of whole lines that can be read without it: what TOML says, without a
    second grammar of it here.
    """
    lines, begins = text.splitlines(keepends=True), 1
    for count in range(1, len(lines) + 1):
        try:
            content = tomllib.loads("".join(lines[:count]))
        except tomllib.TOMLDecodeError:  # within a value of several lines
            continue
        if key in content:
            return begins
        begins = count + 1
    return begins


def _settable(command: argparse.ArgumentParser) -> dict[str, argparse.Action]:
    """Return the options of a command that a file can set, by name."""
    return {a.dest: a for a in command._actions if a.option_strings and a.dest not in _OF_THE_USER}


def _known(key: str, command: argparse.ArgumentParser, where: str) -> str:
    """Return the name of the option that a key means."""
    name, known = key.replace("-", "_"), _settable(command)
    if name in known:
        return name
    options = [option.replace("_", "-") for option in known]
    raise SettingsError(f"{where}: {key!r} is no setting; {accepted_names(key, options)}")


def _checked(
    name: str, value: Any, command: argparse.ArgumentParser, where: str, checks: Mapping[str, Check] | None = None
) -> Any:
    """Return a value as its option has it."""
    action = _settable(command)[name]
    if _is_list(action) and isinstance(value, list):
        return [_checked_one(name, part, command, where, checks) for part in value]
    one = _checked_one(name, value, command, where, checks)
    return [one] if _is_list(action) else one


def _checked_one(
    name: str, value: Any, command: argparse.ArgumentParser, where: str, checks: Mapping[str, Check] | None
) -> Any:
    """Return one value of an option as it has it."""
    action = _settable(command)[name]
    accepted, fits = _kind(action)
    key = name.replace("_", "-")
    if not fits(value):
        several = ", or a list of such" if _is_list(action) else ""
        raise SettingsError(f"{where}: {key} is {value!r}; accepted: {accepted}{several}")
    if action.type in (number, number_or_off):
        value = math.inf if value == "off" else float(value)
    elif action.type is not None and isinstance(value, str):
        value = action.type(value)  # type: ignore[operator]  # Path
    if action.choices is not None and value not in action.choices:
        raise SettingsError(f"{where}: {key} is {value!r}; {accepted_names(value, map(str, action.choices))}")
    try:
        (_CHECKS if checks is None else checks).get(name, _no_check)(value)
    except FgMujocoError as error:
        raise type(error)(f"{where}: {_with_key(str(error), key)}") from error
    return value


def _with_key(message: str, key: str) -> str:
    """Return a message that says which key it is about: in place of a field that it begins with, or before it."""
    field = re.match(r"(?:[A-Z]\w*\.)?[a-z]\w*(?= is )", message)
    return f"{key}: {message}" if field is None else f"{key}{message[field.end() :]}"


def _kind(action: argparse.Action) -> tuple[str, Callable[[Any], bool]]:
    """Return what a value of an option is called, and whether one is of that kind."""
    if action.nargs == 0:  # a flag
        return "true or false", lambda value: isinstance(value, bool)
    if action.type is whole:
        return "a whole number", lambda value: isinstance(value, int) and not isinstance(value, bool)
    if action.type is number:
        return "a number", _is_number
    if action.type is number_or_off:
        return 'a number, or "off"', lambda value: value == "off" or _is_number(value)
    return "a text in quotes", lambda value: isinstance(value, str)


def _is_list(action: argparse.Action) -> bool:
    """Say whether an option may be given several times."""
    return isinstance(action, argparse._AppendAction)


def _is_number(value: Any) -> bool:
    is_whole = isinstance(value, int) and not isinstance(value, bool) and abs(value) < 1e300  # else beyond floats
    return is_whole or isinstance(value, float)


def _check_backend(name: str) -> None:
    if name not in LIDAR_BACKENDS:
        raise SettingsError(f"lidar is {name!r}; {accepted_names(name, LIDAR_BACKENDS)}")


def _check_count(value: int) -> None:
    require_whole("count", value, 0)


def _no_check(value: Any) -> None:
    pass


# What the race would refuse, so that the message has the line; what depends on several settings, only it can say.
_CHECKS: dict[str, Check] = {
    "track": load_track,
    "vehicle": Vehicle.load,
    "tires": Tires.load,
    "controller": lambda text: find_controller(ControllerChoice.of(text).source),
    "opponent": lambda text: find_controller(ControllerChoice.of(text).source),
    "opponent_max_speed": lambda value: RaceSettings(max_speed=value),
    "rules": find_rules,
    "obstacles": _check_count,
    "obstacle_seed": _check_count,
    "lidar": _check_backend,
    "lidar_noise": lambda value: LidarEffects(range_noise_std=value),
    "lidar_dropout": lambda value: LidarEffects(dropout_probability=value),
    "lidar_latency": lambda value: LidarEffects(latency=value),
    **{
        name: lambda value, name=name: RaceSettings(**{name: value})  # type: ignore[misc]
        for name in ("laps", "mu", "planner_mu", "max_speed", "odometry_drift", "seed", "time_limit", "decision_limit")
    },
}
