"""Tells where a planner comes from and which files it reads, and whether one that a recorded run names may be loaded.

    origin("gap_finder")                          # distribution, version, file and hash of its code
    planner_files(planner, {"weights": "policy"})  # {"policy.npz": "3f2a..."}

Loading a planner runs the code in its file. A bundled planner may always be loaded. Any other one may if its file is
the one that was recorded, and the user trusts it or raced this very run on this machine, and has run that code already.

A file that one of a planner's settings names counts as read. A planner that reads others names them in an attribute
`files`, a list of paths that it has when it is built. Without that attribute the files that a setting names without
their ending count, too, and so does a folder that it names, unless it is the current folder or one around that. A file
is looked for in the current folder and in that of the planner's own file. It has changed if its contents have.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import fields, is_dataclass
from functools import lru_cache
from glob import escape
from pathlib import Path
from typing import Any, Literal, get_origin, get_type_hints

from ..course.course import Course
from ..course.files import file_sha256, is_file, is_folder, read_bytes
from ..errors import ControllerError
from ..messages import Controller
from ..simulation.planner_failure import is_of_planner, one_line, without_exit
from ..simulation.settings import DriveSettings
from .planners import (
    PLANNERS,
    READ,
    ControllerChoice,
    build_controller,
    bundled_names,
    code_of,
    file_in,
    find_controller,
    moved_to,
)

Files = dict[str, str | None]
"""SHA-256 of a file's contents, or of all files of a folder, by its path; None: it is not there."""

MOST_FILES = 10_000
"""In a folder."""

_BUNDLED = "fg_mujoco.controllers."


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


@without_exit()
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
    named = _files_attribute(planner)
    exact = named is not None or type(planner).__module__.startswith(_BUNDLED)
    found: dict[str, None] = dict.fromkeys(named or ())
    for text in _texts(planner, settings):
        found |= dict.fromkeys(path for folder in _folders(planner) for path in _named(text, folder, exact=exact))
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
    """Return the hash of a file, or of the names and contents of all files in a folder; None: it is not there.

    Raises:
      ControllerError: it cannot be read, or the folder has more than MOST_FILES files.
    """
    try:
        place = Path(path).expanduser()
        if is_file(place):
            return file_sha256(place)
        if not is_folder(place):
            return None
        digest = hashlib.sha256()
        for inside in _inside(place):
            digest.update(f"{inside.relative_to(place).as_posix()}\n{file_sha256(inside)}\n".encode())
        return digest.hexdigest()
    except (OSError, RuntimeError) as error:  # RuntimeError: no home
        reason = getattr(error, "strerror", None) or error
        raise ControllerError(f"{path}: cannot be read: {reason}; accepted: files that can be") from error


def by_name(files: Files) -> Files:
    """Return hashes by the names of the files, without their folders where that tells them apart."""
    count = Counter(Path(path).name for path in files)
    return {Path(path).name if count[Path(path).name] == 1 else path: sha256 for path, sha256 in files.items()}


def files_sha256(files: Files) -> str | None:
    """Return one hash of all files that a planner reads, wherever they lie; None: it reads none."""
    return hashlib.sha256(json.dumps(by_name(files)).encode()).hexdigest() if files else None


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


def _folders(planner: Controller) -> list[Path]:
    """Return the folders in which a planner may look for its files: the current one, and that of its own file."""
    here, own = Path(), _source_file(type(planner))
    with suppress(OSError):
        if own is not None and not own.parent.samefile(here):
            return [here, own.parent]
    return [here]


def _named(text: str, folder: Path, *, exact: bool) -> Iterator[str]:
    """Yield the paths of what a setting names in a folder; `exact`: only of a file with its ending."""
    try:
        place = folder / Path(text).expanduser()
    except RuntimeError:  # no home
        return
    if is_file(place):
        yield str(place)
    elif not exact:
        with suppress(OSError, ValueError):
            if is_folder(place) and not Path.cwd().is_relative_to(place.resolve()):
                yield str(place)
        if place.name:
            with suppress(OSError, ValueError):
                found = place.parent.glob(f"{escape(place.name)}.*")
                yield from sorted(str(each) for each in found if each.stem == place.name and is_file(each))


def _inside(folder: Path) -> list[Path]:
    """Return the regular files of a folder and of those in it, sorted, without what Python compiles."""
    found: list[Path] = []
    for place, folders, names in os.walk(folder):
        folders[:] = sorted(name for name in folders if name != "__pycache__")
        found += [path for name in names if is_file(path := Path(place) / name)]
        if len(found) > MOST_FILES:
            said = f"{folder}: has more than {MOST_FILES} files"
            raise ControllerError(f"{said}; accepted: a planner whose attribute `files` lists its files")
    return sorted(found)


# whether it may be loaded


def require_trusted(
    source: str,
    recorded: Any,
    *,
    trust: bool,
    where: str,
    settings: Mapping[str, Any] | None = None,
) -> None:
    """Refuse a planner that a file names and that may not be loaded. Without `trust` nothing of it is imported.

    A bundled planner may be loaded. It reads a file that a setting names, such as a map, only if that is the recorded
    one.

    Args:
      source: a name, or `path/to/file.py:ClassName`, without settings.
      recorded: `controller_origin` of the run's summary, which has `sha256` of the planner's code and the `files` that
        it read; anything else: nothing was recorded.
      trust: whether the user trusts the code.
      where: the planner was named, for the message.
      settings: its own, by name.

    Raises:
      ControllerError: it is not bundled, and it is not trusted, or its file is not the one that was recorded; or a file
        that it read, or would read, is another one now; or the drive had no planner.
    """
    recorded = recorded if isinstance(recorded, Mapping) else {}
    sha256, files = recorded.get("sha256"), recorded.get("files")
    sha256 = sha256 if isinstance(sha256, str) else None
    files, said = files if isinstance(files, Mapping) else {}, f"{where}: planner {source!r}"
    if source in bundled_names():
        _require_same(files, said, "accepted: the file as it was raced")
        for name, value in (settings or {}).items():
            if isinstance(value, str) and is_file(value) and path_sha256(value) not in files.values():
                raise ControllerError(
                    f"{said} has {name} {value!r}, which it did not read as it was raced; accepted: the files that are "
                    "recorded with their SHA-256"
                )
        return
    if recorded.get("commands"):
        raise ControllerError(f"{where}: {source!r} has no planner; its commands were made beforehand")
    if not trust:
        raise ControllerError(
            f"{said} is not a bundled one, and loading it runs its code; accepted: --trust (in Python trust=True), if "
            "you know that code"
        )
    path = file_in(source)
    if path is None:  # of an installed package, whose code the user has chosen
        found = origin(source)["sha256"] if sha256 is not None else None
    elif is_file(path):
        found = ControllerChoice(source).sha256
    else:
        raise ControllerError(f"{said}: there is no file {path}; accepted with --trust: the file as it was raced")
    if found != sha256 or (path is not None and sha256 is None):
        raise ControllerError(
            f"{said} has sha256 {str(found)[:12]}, recorded is {sha256 and sha256[:12]}; accepted with --trust: the "
            "file as it was raced"
        )
    _require_same(files, said, "accepted with --trust: the file as it was raced")


def _require_same(files: Mapping[str, str | None], said: str, accepted: str) -> None:
    """Refuse a planner that would read other files now than were recorded."""
    changed = changed_file(files)
    if changed is not None:
        raise ControllerError(f"{said}: {changed}; {accepted}")


def controller_of(folder: Path, summary: Mapping[str, Any], controller: str) -> str:
    """Return the controller of a run; for a file that is not there, or was edited, the copy in the run's folder.

    Raises:
      RunFolderError: the copy is not the source that was raced.
    """
    from .run_folder import kept_controller

    source = ControllerChoice.of(controller).source
    there = file_in(source)
    kept = None if there is None else kept_controller(folder, summary)
    if there is None or kept is None or there.suffix != kept.suffix:  # of several nodes the folder keeps the text only
        return controller
    if is_file(there) and code_of(source) == read_bytes(kept):
        return controller
    return f"{moved_to(source, kept)}{controller.strip()[len(source) :]}"
