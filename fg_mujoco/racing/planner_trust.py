"""Decides whether a planner that a recorded run names may be loaded: loading a planner runs the code in its file.

A bundled planner always may. Any other one may if its file is the one that was recorded, and the user says so, or raced
this very run on this machine: then the user has run that code already.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import mujoco

from ..course.files import is_file, read_bytes
from ..errors import ControllerError, TrackError
from ..lidar.effects import LidarEffects
from ..messages import Controller
from ..simulation.cars import car_prefix
from ..simulation.course_loading import load_track
from ..simulation.planner_adapter import start
from ..simulation.settings import DriveSettings
from ..vehicle.car import car_parameters
from .planner_choice import ControllerChoice
from .planner_files import Files, changed_file, changed_text, path_sha256, recorded_files
from .planner_loading import make_controller
from .planner_origin import origin
from .planner_sources import bundled_names
from .planner_texts import code_of, file_in, moved_to
from .run_folder import kept_controller, was_raced_here


def recorded_sha256(summary: Mapping[str, Any]) -> str | None:
    """Return the hash of the file of a run's planner, as its summary has it; None where it has none."""
    found = summary.get("controller_origin")
    sha256 = found.get("sha256") if isinstance(found, dict) else None
    return sha256 if isinstance(sha256, str) else None


def files_of(summary: Mapping[str, Any]) -> Files:
    """Return the files that a run's planner read, as its summary has them; none of older versions."""
    return recorded_files(summary.get("controller_origin"))


def require_trusted(
    source: str,
    sha256: str | None,
    *,
    trust: bool,
    where: str,
    files: Mapping[str, str | None] | None = None,
    settings: Mapping[str, Any] | None = None,
) -> None:
    """Refuse a planner that a file names and that may not be loaded. Without `trust` nothing of it is imported.

    A bundled planner may be loaded. It reads a file that a setting names, such as a map, only if that is the recorded
    one.

    Args:
      source: a name, or `path/to/file.py:ClassName`, without settings.
      sha256: of the planner's file, as it was recorded.
      trust: whether the user trusts the code.
      where: the planner was named, for the message.
      files: that it read, as they were recorded; None: it read none.
      settings: its own, by name.

    Raises:
      ControllerError: it is not bundled, and it is not trusted, or its file is not the one that was recorded; or a file
        that it read, or would read, is another one now.
    """
    if source in bundled_names():
        _require_same(source, files, where, "accepted: the file as it was raced")
        for name, value in (settings or {}).items():
            if isinstance(value, str) and is_file(value) and path_sha256(value) not in (files or {}).values():
                said = f"{where}: planner {source!r} has {name} {value!r}, which it did not read as it was raced"
                raise ControllerError(f"{said}; accepted: the files that are recorded with their SHA-256")
        return
    from ..lab.manoeuvres import is_driven_by_commands  # nobody else here needs what it imports

    if is_driven_by_commands(source):
        raise ControllerError(f"{where}: {source!r} has no planner; its commands were made beforehand")
    said = f"{where}: planner {source!r}"
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
    _require_same(source, files, where, "accepted with --trust: the file as it was raced")


def _require_same(source: str, files: Mapping[str, str | None] | None, where: str, accepted: str) -> None:
    """Refuse a planner that would read other files now than were recorded."""
    changed = changed_file(files or {})
    if changed is not None:
        path, now = changed
        raise ControllerError(
            f"{where}: planner {source!r}: {changed_text(path, (files or {})[path], now)}; {accepted}"
        )


def controller_of(folder: Path, summary: Mapping[str, Any], controller: str) -> str:
    """Return the controller of a run; for a file that is not there, or was edited, the copy in the run's folder.

    Raises:
      RunFolderError: the copy is not the source that was raced.
    """
    source = ControllerChoice.of(controller).source
    there = file_in(source)
    kept = None if there is None else kept_controller(folder, summary)
    if there is None or kept is None or there.suffix != kept.suffix:  # of several nodes the folder keeps the text only
        return controller
    if is_file(there) and code_of(source) == read_bytes(kept):
        return controller
    return f"{moved_to(source, kept)}{controller.strip()[len(source) :]}"


def recorded_planner(
    summary: Mapping[str, Any],
    model: mujoco.MjModel,
    index: int = 0,
    *,
    trust: bool,
    where: str,
    folder: Path | None = None,
) -> Controller:
    """Return the planner of a recorded run, built as it was for the race, and reset.

    Args:
      summary: of the run.
      model: of its world.
      index: of its car.
      trust: whether to load a planner that is not bundled, which runs its code, if its file is the recorded one; of a
        run in `folder` that this user raced it is loaded without.
      where: the planner was named, for the message.
      folder: of the run, whose copy of the planner is taken where its file is not there any more; None: there is none.

    Raises:
      FgMujocoError: it may not be loaded, or cannot be built.
      KeyError, TypeError, ValueError, OSError: the summary does not say how.
    """
    source = str(summary["controller"])
    trust = trust or (folder is not None and was_raced_here(folder, summary))
    if trust and folder is not None:
        source = controller_of(folder, summary, source)
    settings = summary.get("planner_settings") or {}
    require_trusted(
        source, recorded_sha256(summary), trust=trust, where=where, files=files_of(summary), settings=settings
    )  # fmt: skip
    mu = summary.get("planner_mu")
    course = None  # a user's own track or map is not found by its name, and few planners drive by a map
    with suppress(TrackError):
        course = load_track(str(summary["track"]))
    drive = DriveSettings(
        planner_mu=math.inf if mu is None else mu,
        max_speed=summary["speed_limit_m_s"],
        planner_settings=settings,
        effects=LidarEffects(**summary.get("lidar_effects", {})),
        sensors=summary.get("sensors") or (),
        seed=summary.get("seed", 0),
    )
    map_line = None if course is None else course.map_line
    context = drive.context(car_parameters(model, car_prefix(index)), map_line, model=model, index=index)
    planner = make_controller(source, context, settings=drive.planner_settings)
    start(planner)
    return planner
