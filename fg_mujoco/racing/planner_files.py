"""The files that a planner reads besides its code, such as weights or a raceline, and their hashes.

    planner_files(planner, {"weights": "policy"})    # {"policy.npz": "3f2a..."}

A file that one of the planner's settings names counts always. A planner that reads others names them in an attribute
`files`, a list of paths that it has when it is built:

    class LearnedPolicy:
        def __init__(self, settings):
            weights = Path(settings.weights).with_suffix(".npz")
            self.files = [weights]

Without that attribute the files that a setting names without their ending count, too, and so does a folder that it
names, with all that is in it, unless it is the current folder or one around that. A file is looked for in the current
folder and in that of the planner's own file. A file has changed when its contents have, whatever its time is.
"""

from __future__ import annotations

import hashlib
import json
import os
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from glob import escape
from pathlib import Path
from typing import Any, Literal, get_origin, get_type_hints

from ..course.files import file_sha256, is_file, is_folder
from ..errors import ControllerError
from ..messages import Controller
from ..simulation.planner_failure import is_of_planner, one_line
from .planner_loading import POSE_SETTINGS
from .planner_sources import source_file

Files = dict[str, str | None]
"""SHA-256 of a file's contents, or of all files of a folder, by its path; None: it is not there."""

MOST_FILES = 10_000
"""In a folder."""

_BUNDLED = "fg_mujoco.controllers."
_ACCEPTED = "an attribute `files` that is a list of paths"


def planner_files(planner: Controller, settings: Mapping[str, Any], *, warn: bool = False) -> Files:
    """Return the hashes of the files that a planner reads, by their paths.

    Args:
      planner: built and not yet driven.
      settings: those that differ from its own; the others are those of its class.
      warn: leave out what cannot be read, with a warning, as a race does, which reads no results of earlier ones.

    Raises:
      ControllerError: an attribute `files` that is no list of paths, or a file that cannot be read.
    """
    said = _said(planner)
    exact = said is not None or type(planner).__module__.startswith(_BUNDLED)
    found: dict[str, None] = dict.fromkeys(said or ())
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


def changed_file(files: Mapping[str, str | None]) -> tuple[str, str | None] | None:
    """Return the path and the hash of the first file that is another now; None: all are the same.

    Raises:
      ControllerError: one cannot be read.
    """
    for path, recorded in files.items():
        now = path_sha256(path)
        if now != recorded:
            return path, now
    return None


def _said(planner: Controller) -> list[str] | None:
    """Return the paths in the attribute `files` of a planner; None: it has none."""
    name = f"controller {type(planner).__name__}"
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
        raise ControllerError(f"{name}: its attribute files: {one_line(error)}; accepted: {_ACCEPTED}") from error


def _texts(planner: Controller, settings: Mapping[str, Any]) -> list[str]:
    """Return the settings of a planner that may name files: its texts, but for words of which one is chosen."""
    map_ = {name: value for name, value in settings.items() if name == "pose_map"}
    settings = {name: value for name, value in settings.items() if name not in POSE_SETTINGS}
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
    values |= map_
    return [os.fsdecode(value) for value in values.values() if isinstance(value, (str, os.PathLike)) and str(value)]


def _folders(planner: Controller) -> list[Path]:
    """Return the folders in which a planner may look for its files: the current one, and that of its own file."""
    here, own = Path(), source_file(type(planner))
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
        if is_folder(place) and not _is_around(place):
            yield str(place)
        if place.name:
            yield from sorted(str(each) for each in _beginning(place))


def _is_around(folder: Path) -> bool:
    """Return whether a folder is the current one or around it: a place to look in, and not a planner's data."""
    try:
        return Path.cwd().is_relative_to(folder.resolve())
    except OSError:
        return False


def _beginning(place: Path) -> list[Path]:
    """Return the files whose name without their ending is that of a path."""
    try:
        found = place.parent.glob(f"{escape(place.name)}.*")
        return [each for each in found if each.stem == place.name and is_file(each)]
    except (OSError, ValueError):
        return []


def _inside(folder: Path) -> list[Path]:
    """Return the regular files of a folder and of those in it, sorted, without what Python compiles.

    Raises:
      ControllerError: more than MOST_FILES.
    """
    found: list[Path] = []
    for place, folders, names in os.walk(folder):
        folders[:] = sorted(name for name in folders if name != "__pycache__")
        found += [path for name in names if is_file(path := Path(place) / name)]
        if len(found) > MOST_FILES:
            raise ControllerError(
                f"{folder}: has more than {MOST_FILES} files; accepted: a planner whose attribute `files` says which "
                "it reads"
            )
    return sorted(found)


def recorded_files(origin: Any) -> Files:
    """Return the files that a planner read, as the summary of its run has them; none of older versions.

    Args:
      origin: `controller_origin` of the summary.
    """
    files = origin.get("files") if isinstance(origin, dict) else None
    return files if isinstance(files, dict) else {}


def changed_text(path: str, recorded: str | None, now: str | None) -> str:
    """Return in words how a file that a planner read has changed."""
    state = "is not there" if now is None else f"has sha256 {now[:12]}"
    return f"{path}, which it read, {state}, recorded is {recorded and recorded[:12]}"
