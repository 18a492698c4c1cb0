"""A controller and its settings in one text, as the command line takes it: `follow_the_gap[point=middle]`."""

from __future__ import annotations

import hashlib
import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..course.course import Course
from ..course.files import LONGEST_NAME, file_sha256
from ..errors import SettingsError
from ..messages import Controller
from ..simulation.planner_failure import without_exit
from ..simulation.settings import DriveSettings
from .planner_files import Files, planner_files
from .planner_loading import build_controller
from .planner_sources import find_controller
from .planner_texts import code_of, file_in, scheme_of

Value = float | int | bool | str
"""Of a setting, as text can say it."""

_CHOICE = re.compile(r"([^\[\]]+?)\s*(?:\[([^\[\]]*)\])?")

_WORD = re.compile(r"[A-Za-z_./~][\w./+~@%# -]*|[^\[\],|:=\x00-\x1f]*/[^\[\],|:=\x00-\x1f]*")  # and paths
_WORDS: dict[str, Value] = {"true": True, "false": False, "off": math.inf, "inf": math.inf}


@dataclass(frozen=True)
class ControllerChoice:
    """A controller and those of its settings that differ from its own."""

    source: str  # a bundled name, or path/to/file.py:ClassName
    settings: tuple[tuple[str, Value], ...] = ()

    @classmethod
    def of(cls, text: str, what: str = "controller") -> ControllerChoice:
        """Read `name` or `name[setting=value,...]`; a value is a number, true, false or a word.

        `what` it is that has the name is for messages.

        Raises:
          SettingsError: a text that is neither.
        """
        if len(text) > LONGEST_NAME:
            said = f"controller {text[:60]!r}... has {len(text)} characters"
            raise SettingsError(f"{said}; accepted: {LONGEST_NAME} at most")
        match = _CHOICE.fullmatch(text.strip())
        if match is None:
            raise SettingsError(f"{what} {text!r}; accepted: NAME, or NAME[SETTING=VALUE,SETTING=VALUE]")
        source, inside = match.groups()
        try:
            settings = {} if inside is None else read_settings_text(inside)
        except SettingsError as error:
            raise SettingsError(f"{what} {text!r}: {error}") from error
        return cls(source, tuple(settings.items()))

    @property
    def label(self) -> str:
        """Its name in tables: a file without its folder."""
        return with_settings(Path(self.source).name, dict(self.settings))

    @property
    def sha256(self) -> str | None:
        """Of the file of a user's controller; None for a bundled one."""
        if scheme_of(self.source):
            return hashlib.sha256(code_of(self.source) or b"").hexdigest()
        path = file_in(self.source)
        return None if path is None else file_sha256(path)

    def settings_with(self, others: Mapping[str, Any]) -> dict[str, Any]:
        """Return the settings in its brackets and `others`, which are given outside them.

        Raises:
          SettingsError: one is given twice.
        """
        twice = [name for name, _ in self.settings if name in others]
        if twice:
            raise SettingsError(
                f"{twice[0]} is given in the brackets of controller {self.label!r} and in planner_settings; accepted: "
                "one of them"
            )
        return {**dict(self.settings), **others}

    def load(self) -> Any:
        """Return the class or function of the planner; errors are those of `find_controller`."""
        return find_controller(self.source)

    @without_exit()
    def check(self, course: Course, drive: DriveSettings) -> Files:
        """Build it once, for a race on `course` with the car and the planner context of `drive`.

        Returns:
          The hashes of the files that it reads, by their paths.

        Raises:
          ControllerError: it cannot be loaded, or not with these settings, or a file of it cannot be read.
          SettingsError: a setting that is given twice.
        """
        settings = self.settings_with(drive.planner_settings)
        context = drive.context(drive.car.parameters, course.map_line)
        planner = build_controller(find_controller(self.source), self.source, context, settings)
        return planner_files(planner, settings)


def with_settings(source: str, settings: Mapping[str, Any]) -> str:
    """Return a controller's name with settings in brackets, where there are any."""
    inside = ",".join(f"{name}={str(v).lower() if isinstance(v, bool) else v}" for name, v in settings.items())
    return source + (f"[{inside}]" if inside else "")


def split_controller(
    controller: str | Controller, planner_settings: Mapping[str, Any] | None
) -> tuple[str | Controller, dict[str, Any]]:
    """Return a controller without the settings in its brackets, and these together with `planner_settings`.

    Raises:
      SettingsError: a text that is no controller, or a setting that is given twice.
    """
    if isinstance(controller, os.PathLike):
        controller = os.fspath(controller)
    if not isinstance(controller, str):
        return controller, dict(planner_settings or {})
    choice = ControllerChoice.of(controller)
    return choice.source, choice.settings_with(planner_settings or {})


def read_settings_text(text: str) -> dict[str, Value]:
    """Return the settings in `setting=value,setting=value` by name; a value is a number, true, false or a word.

    Raises:
      SettingsError: a part that is none, or a setting that is given twice.
    """
    settings: dict[str, Value] = {}
    for part in text.split(","):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not (name and equals and value) or name in settings or set(value) & set("|:"):
            raise SettingsError(f"{part!r}; accepted: SETTING=VALUE, each setting once")
        settings[name] = read_value(value)
    return settings


def read_value(text: str) -> Value:
    """Return the number, the truth value or the word that a text is."""
    text = text.strip()
    for read in (int, float):
        try:
            return _WORDS[text] if text in _WORDS else read(text)
        except ValueError:
            continue
    if not _WORD.fullmatch(text):
        raise SettingsError(f"{text!r}; accepted: LOW:HIGH, or values A|B|C that are numbers, true, false or words")
    return text
