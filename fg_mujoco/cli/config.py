"""Settings of a command in a file: `fg-mujoco race --config race.toml`, or `--config DIR`, a run folder.

    track = "oval"
    laps = 2
    planner-mu = "off"
    motion-distortion = true

The keys are the keywords of a Setup, as `Setup.read` reads them, and the other long options of the command; with `-` or
`_`. Paths are from the present folder, as on the command line. Options on the command line win over the file's.

Of a run folder, the setup is what was raced. It names bundled planners alone: any other is given on the command line.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..course.documents import TomlFile, read_toml
from ..course.files import is_folder
from ..errors import ControllerError, FgMujocoError, RunFolderError, SettingsError, accepted_names
from ..racing.planner_origin import require_bundled, require_no_file
from ..racing.planners import ControllerChoice
from ..racing.resolved import ground_of
from ..racing.run_folder import SUMMARY, read_summary
from ..racing.setup import SETUP_KEYWORDS, Setup
from .command import number, whole
from .options import OPPONENT_OPTIONS, given_settings, with_opponents

_OF_THE_USER = ("help", "config", "force")  # options that no file can set


def parse(parser: argparse.ArgumentParser, arguments: Sequence[str] | None) -> argparse.Namespace:
    """Return the options of a command line; `setup` is that of the file of its `--config`.

    Raises:
      SettingsError: a file that cannot be read, with an unknown key, or with a value that is not accepted.
      RunFolderError: a folder that is no run's, or holds no settings.
      ControllerError: a run folder's planner that is not bundled, and is not given on the command line.
    """
    options = parser.parse_args(arguments)
    if getattr(options, "config", None) is None:
        return options
    if is_folder(options.config):
        options.setup = _setup_of_run(Path(options.config), given_settings(options))
        return options
    file, command = read_toml(options.config), options.command
    values, own = _split(file, command)
    before = command._defaults.copy(), [action.default for action in command._actions]
    try:
        command.set_defaults(**own)
        options = parser.parse_args(arguments)
    finally:  # the defaults of this command line are not those of the next
        command._defaults = before[0]
        for action, default in zip(command._actions, before[1], strict=True):
            action.default = default
    options.setup = _setup_in(file, values)
    return options


def _split(file: TomlFile, command: argparse.ArgumentParser) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the keys of a file that are keywords of a Setup which the command takes, and its own options by name."""
    options = {
        action.dest: action
        for action in command._actions
        if action.option_strings and action.dest not in (*_OF_THE_USER, *OPPONENT_OPTIONS)
    }
    of_setup = {name: action for name, action in options.items() if name in SETUP_KEYWORDS}
    listed = {name for name, action in of_setup.items() if action.default != argparse.SUPPRESS}
    values: dict[str, Any] = {}
    own: dict[str, Any] = {}
    for key, value in file.values.items():
        name, where = key.replace("-", "_"), file.where(key)
        if name in values or name in own:
            raise SettingsError(f"{where}: {key!r} was given before; accepted: each setting once")
        if name in options and (name not in SETUP_KEYWORDS or name in listed):
            own[name] = _checked(options[name], value, where)
        elif name in SETUP_KEYWORDS:
            values[name] = value
        else:
            known = [each.replace("_", "-") for each in (*SETUP_KEYWORDS, *options)]
            raise SettingsError(f"{where}: {key!r} is no setting; {accepted_names(key, dict.fromkeys(known))}")
    return values, own


def _setup_in(file: TomlFile, values: Mapping[str, Any]) -> Setup:
    """Return the setup of a file; errors have the line of the key that they name."""
    try:
        setup = Setup.read(values)
        for entry in setup.entries:
            if isinstance(entry.controller, str):
                ControllerChoice.of(entry.controller).load()
        ground_of(setup)
    except FgMujocoError as error:
        message = re.sub(r"^[A-Z]\w*\.(?=[a-z]\w* is )", "", str(error))
        raise type(error)(file.located(message)) from error
    return setup


def _setup_of_run(folder: Path, given: Mapping[str, Any]) -> Setup:
    """Return what a run folder says was raced, but for the planners that are given."""
    summary = read_summary(folder)
    where = f"{folder / SUMMARY}, settings"
    settings = summary.get("settings")
    if not isinstance(settings, dict):
        said = "there are none: its course or its planner was an object"
        raise RunFolderError(f"{where}: {said}; accepted: a run of a course and planners by name")
    values = {str(name): value for name, value in settings.items() if value is not None}
    if "sensors" in given:  # of files, for example, whose names the folder cannot find
        values.pop("sensors", None)
    names, speeds = values.pop("opponents", None) or [], values.pop("opponent_max_speed", None) or []
    try:
        setup = Setup.read(values)
        setup = with_opponents(setup, names, {"opponent_max_speed": speeds}) if names else setup
        if "opponents" in given:
            setup = setup.replace(entries=setup.entries[:1])
        for index, entry in enumerate(setup.entries):
            choice, option = ControllerChoice.of(str(entry.controller)), "--opponents" if index else "--controller"
            own = dict(choice.settings) | dict(entry.planner_settings or {})
            if index or "controller" not in given:
                require_bundled(choice.source, own, where=where, option=option)
            elif not isinstance(given["controller"], str) or ControllerChoice.of(given["controller"]).settings:
                setup = setup.with_cars(planner_settings={})
            else:
                require_no_file(choice.source, entry.planner_settings or {}, where=where)
    except ControllerError:
        raise
    except FgMujocoError as error:
        raise type(error)(f"{where}: {error}") from error
    first, vehicle = setup.first, setup.first.car
    of_a_file = vehicle.source == vehicle.file  # bundled ones are those of the version
    if of_a_file and vehicle.sha256 != summary.get("vehicle_sha256"):
        raise RunFolderError(f"{where}: vehicle {vehicle.file} is another one now; accepted: the file as it was raced")
    if first.tires is not None and first.tire_set.sha256 != summary.get("tires_sha256"):
        name = first.tire_set.name
        raise RunFolderError(f"{where}: tires {name} are others now; accepted: the set as it was raced")
    return setup


def _checked(action: argparse.Action, value: Any, where: str) -> Any:
    """Return a value of a file as an option has it."""
    accepted, fits = _kind(action)
    key = action.option_strings[0].lstrip("-")
    is_list = isinstance(action, argparse._AppendAction)
    parts = value if is_list and isinstance(value, list) else [value]
    if isinstance(value, list) and not is_list and action.type not in (None, whole, number):
        return value  # of a study, which takes several
    for part in parts:
        if not fits(part):
            several = ", or a list of such" if is_list else ""
            raise SettingsError(f"{where}: {key} is {part!r}; accepted: {accepted}{several}")
        if action.choices is not None and part not in action.choices:
            raise SettingsError(f"{where}: {key} is {part!r}; {accepted_names(part, map(str, action.choices))}")
    if callable(action.type) and all(isinstance(part, str) for part in parts):
        try:
            parts = [action.type(part) for part in parts]
        except argparse.ArgumentTypeError as error:
            raise SettingsError(f"{where}: {key} is {error}") from error
    return parts if is_list else parts[0]


def _kind(action: argparse.Action) -> tuple[str, Callable[[Any], bool]]:
    """Return what a value of an option is called, and whether one is of that kind."""
    if action.nargs == 0:  # a flag
        return "true or false", lambda value: isinstance(value, bool)
    if action.type is whole:
        return "a whole number", lambda value: isinstance(value, int) and not isinstance(value, bool)
    if action.type is number:
        return "a number", lambda value: isinstance(value, (int, float)) and not isinstance(value, bool)
    return "a text in quotes", lambda value: isinstance(value, str)
