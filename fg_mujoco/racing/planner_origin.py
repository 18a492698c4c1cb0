"""Tells where a planner comes from and which files it reads.

    origin("gap_finder")                          # distribution, version, file and hash of its code
    planner_files(planner, {"weights": "policy.npz"})  # {"policy.npz": "3f2a..."}

A planner reads the files that its settings name, and those in its attribute `files`, a list of paths that it has when
it is built. A file that a setting names is looked for in the current folder and in that of the planner's own file. It
has changed if its contents have.
"""

from __future__ import annotations

import hashlib
import os
import sys
import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import fields, is_dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, get_origin, get_type_hints

from ..course.course import Course
from ..course.files import file_sha256, is_file, is_folder, kept_folder
from ..errors import ControllerError, is_of_planner
from ..messages import Controller
from ..simulation.settings import DriveSettings
from .planners import PLANNERS, READ, ControllerChoice, build_controller, bundled_names, file_in, find_controller

Files = dict[str, str | None]
"""SHA-256 of a file's contents, by its path; None: it is not there."""


# where a planner comes from


def origin(source: str | Controller, found: Any = None) -> dict[str, Any]:
    """Return the package, file and hash of a controller, for the summary of a run.

    Args:
      source: as of `make_controller`.
      found: its class, if it is loaded already.

    Returns:
      distribution: the installed package that it is of; None for a file or object of the user's.
      version: of that package.
      file: the file that its class is defined in; None where there is none.
      sha256: of the contents of that file.

    Raises:
      ControllerError: an unknown name, or a file or class that cannot be loaded.
    """
    if found is None:
        found = find_controller(source) if isinstance(source, str) else type(source)
    text, place, package = source_code(found), _source_file(found), distribution(found, source)
    if package is not None:
        from importlib.metadata import version
    return {
        "distribution": package,
        "version": None if package is None else version(package),
        "file": None if place is None else str(place),
        "sha256": None if text is None else hashlib.sha256(text).hexdigest(),
    }


def source_code(found: Any) -> bytes | None:
    """Return the contents of the file that a controller's class is defined in; None where there is no such file.

    Of a class that `find_controller` read from a file these are the contents that it read.
    """
    module = sys.modules.get(getattr(found, "__module__", ""))
    read: bytes | None = getattr(module, READ, None)
    place = _source_file(found)
    if read is None and place is not None and place.is_file():
        read = place.read_bytes()
    return read


def distribution(found: Any, source: str | Controller) -> str | None:
    """Return the name of the installed package of a controller's class; None of a user's own."""
    if isinstance(source, str) and source not in PLANNERS and file_in(source) is None:
        point = PLANNERS.entry_point(source)
        return point.dist.name if point.dist is not None else None
    package = str(getattr(found, "__module__", "")).partition(".")[0]
    if package == "fg_mujoco":
        return "fg-mujoco"
    if package in ("", "__main__") or getattr(sys.modules.get(package), "__spec__", None) is None:
        return None  # no module that was found by the import system, such as a user's file
    return next(iter(_distributions().get(package, ())), None)


@lru_cache(maxsize=1)  # it looks through all that is installed
def _distributions() -> Mapping[str, Sequence[str]]:
    from importlib.metadata import packages_distributions

    return packages_distributions()


def _source_file(found: Any) -> Path | None:
    path = getattr(sys.modules.get(getattr(found, "__module__", "")), "__file__", None)
    return None if path is None else Path(path)


# the files that it reads


@kept_folder()
def check_planner(choice: ControllerChoice, course: Course, drive: DriveSettings) -> Files:
    """Build a planner once, for a race on `course` with the car and the planner context of `drive`.

    Returns:
      The hashes of the files that it reads, by their paths.

    Raises:
      ControllerError: it cannot be loaded, or not with these settings, or a file of it cannot be read.
      SettingsError: a setting that is given twice.
    """
    settings = choice.settings_with(drive.planner_settings)
    context = drive.context(drive.car.parameters, course.map_line)
    return planner_files(build_controller(choice.load(), choice.source, context, settings), settings)


def planner_files(planner: Controller, settings: Mapping[str, Any], *, warn: bool = False) -> Files:
    """Return the hashes of the files that a planner reads, by their paths.

    Args:
      planner: built and not yet driven.
      settings: those that differ from its own; the others are those of its class.
      warn: leave out what cannot be read, with a warning, as a race does, which reads no results of earlier ones.

    Raises:
      ControllerError: an attribute `files` that is no list of paths, or a file that cannot be read.
    """
    found = dict.fromkeys([*(_files_attribute(planner) or ()), *_named(planner, settings)])
    hashes = Files()
    for path in found:
        try:
            hashes[path] = path_sha256(path)
        except ControllerError as error:
            if not warn:
                raise
            warnings.warn(f"controller {type(planner).__name__}: {error}", stacklevel=3)
    return hashes


def path_sha256(path: str | Path) -> str | None:
    """Return the hash of a file; None: it is not there.

    Raises:
      ControllerError: it cannot be read, or is a folder.
    """
    try:
        place = Path(path).expanduser()
        if is_folder(place):
            raise ControllerError(f"{path}: is a folder; accepted: its files, one by one, in the attribute `files`")
        return file_sha256(place) if is_file(place) else None
    except (OSError, RuntimeError) as error:  # RuntimeError: no home
        reason = getattr(error, "strerror", None) or error
        raise ControllerError(f"{path}: cannot be read: {reason}; accepted: files that can be") from error


def by_name(files: Files) -> Files:
    """Return hashes by the names of the files, without their folders where that tells them apart."""
    count = Counter(Path(path).name for path in files)
    return {Path(path).name if count[Path(path).name] == 1 else path: sha256 for path, sha256 in files.items()}


def changed_file(files: Mapping[str, str | None]) -> str | None:
    """Return in words how the first file that a planner read and that is another now has changed; None: all are same.

    Raises:
      ControllerError: one cannot be read.
    """
    for path, recorded in files.items():
        now = path_sha256(path)
        if now != recorded:
            state = "is not there" if now is None else f"has sha256 {now[:12]}"
            return f"{path}, which it read, {state}, recorded is {recorded and recorded[:12]}"
    return None


def _files_attribute(planner: Controller) -> list[str] | None:
    """Return the paths in the attribute `files` of a planner; None: it has none."""
    try:
        files = getattr(planner, "files", None)
        if callable(files):
            files = files()
        if files is None:
            return None
        listed = [files] if isinstance(files, (str, os.PathLike)) else list(files)
        return [os.fsdecode(os.fspath(each)) for each in listed]
    except BaseException as error:
        if not is_of_planner(error):
            raise
        from ..simulation.planner_failure import one_line

        said = f"controller {type(planner).__name__}: its attribute files: {one_line(error)}"
        raise ControllerError(f"{said}; accepted: an attribute `files` that is a list of paths") from error


def _texts(planner: Controller, settings: Mapping[str, Any]) -> list[str]:
    """Return the settings of a planner that may name files: its texts, without words of which one is chosen."""
    values, kind = dict(settings), getattr(type(planner), "Settings", None)
    if isinstance(kind, type) and is_dataclass(kind):
        try:
            own = getattr(planner, "settings", None)
            made = own if isinstance(own, kind) else kind(**settings)
            hints = get_type_hints(kind)
            values = {f.name: getattr(made, f.name) for f in fields(kind) if get_origin(hints[f.name]) is not Literal}
        except BaseException as error:  # an object that was built with settings that nobody knows
            if not is_of_planner(error):
                raise
    return [os.fsdecode(value) for value in values.values() if isinstance(value, (str, os.PathLike)) and str(value)]


def _named(planner: Controller, settings: Mapping[str, Any]) -> list[str]:
    """Return the paths of the files that the settings of a planner name, here and beside its own file."""
    folders, own = [Path()], _source_file(type(planner))
    with suppress(OSError):
        if own is not None and not own.parent.samefile(folders[0]):
            folders.append(own.parent)
    found = []
    for text in _texts(planner, settings):
        with suppress(RuntimeError):  # no home
            places = (folder / Path(text).expanduser() for folder in folders)
            found += [str(place) for place in places if is_file(place)]
    return found


# planners that a folder names


def require_bundled(source: str, settings: Mapping[str, Any], *, where: str, option: str = "--controller") -> None:
    """Refuse a planner that a folder names and the user does not: a folder loads no planner's code and no file of it.

    Args:
      source: a name, or `path/to/file.py:ClassName`, without settings.
      settings: its own, by name.
      where: it was named, for the message.
      option: with which the user names it.

    Raises:
      ControllerError: it is not bundled, or one of its settings names a file.
    """
    if source not in bundled_names():
        said = f"{where}: planner {source!r} is not bundled, and a folder loads no planner by itself"
        raise ControllerError(f"{said}; accepted: {option} {source}, if you know its code")
    require_no_file(source, settings, where=where, option=option)


def require_no_file(source: str, settings: Mapping[str, Any], *, where: str, option: str = "--controller") -> None:
    """Refuse settings from a folder that name a file; arguments and error are those of `require_bundled`."""
    for name, value in settings.items():
        if isinstance(value, str) and is_file(value):
            said = f"{where}: planner {source!r} has {name} {value!r}, and a folder loads no file by itself"
            raise ControllerError(f"{said}; accepted: {option} {source}[{name}={value}]")
