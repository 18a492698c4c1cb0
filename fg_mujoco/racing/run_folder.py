"""The run folder: what a race leaves on disk, and the proof that it can be driven again bit for bit.

    write_run(result, "runs/oval")
    report = replay("runs/oval")
    assert report.identical

    summary.json    the figures of the race, and the versions that made it
    scene.xml       the MJCF text that the raced model was compiled from; plain MuJoCo loads it
    states.npz      time (n + 1,) [s], state (n + 1, k) mjSTATE_INTEGRATION, ctrl (n, 2) [rad, m/s]: row i of ctrl is
                    held from state i to state i + 1, one tick
    telemetry.csv   one row a tick, columns named with their units; older versions wrote fewer columns
    controller.py   the source of a planner of your own, as it was read; its hash is in the summary
    failed_scan.npz where the planner failed: the scan and the odometry that it was told, see `read_failed_scan`
    trace.png       the line over the track, and the tires' work over time (needs the extra `plot`)

A folder with a summary is complete: everything is written aside, and the summary is moved in last.
"""

from __future__ import annotations

import csv
import hashlib
import json
import math
import platform
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, fields
from importlib.metadata import version
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from ..course.files import is_file, read_text, require_regular
from ..display import brief, quoted
from ..errors import FgMujocoError, RunFolderError, SettingsError, accepted_names
from ..messages import FloatArray, LaserScan, Odometry
from ..simulation.planner_failure import PlannerFailure
from ..simulation.telemetry import RECORDED_ALWAYS, TELEMETRY
from .result import RaceResult

SCHEMA = 1
"""Of the run folder; a reader refuses any other."""

# in the order they are moved in
_FILES = ("scene.xml", "states.npz", "telemetry.csv", "trace.png", "controller.py", "failed_scan.npz", "summary.json")
_SCENE, _STATES, _TELEMETRY, _TRACE, _CONTROLLER, FAILED_SCAN, SUMMARY = _FILES
_STAGING = ".partial"  # inside the folder, so that moving out of it never crosses file systems


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Run:
    """A run folder, read back. Arrays are as in RaceResult."""

    folder: Path
    summary: dict[str, Any]
    time: FloatArray = field(repr=False)  # (ticks + 1,) [s]
    states: FloatArray = field(repr=False)  # (ticks + 1, k)
    ctrl: FloatArray = field(repr=False)  # (ticks, 2)
    telemetry: FloatArray = field(repr=False)  # (ticks, len(TELEMETRY)); NaN in columns that are not in `columns`
    columns: tuple[str, ...] = field(default=TELEMETRY, repr=False)  # of TELEMETRY, those that were recorded

    def __repr__(self) -> str:
        found = {name: self.summary.get(name, "unknown") for name in ("controller", "track", "end_reason")}
        drive = f"{quoted(found['controller'])} on {quoted(found['track'])}: {found['end_reason']}"
        return brief(self, quoted(self.folder), drive, f"{len(self.ctrl)} ticks, {self.time[-1]:.2f} s")

    @property
    def scene(self) -> Path:
        """The MJCF file of the world."""
        return self.folder / _SCENE

    def column(self, name: str) -> FloatArray:
        """Return one column of the telemetry, shape (ticks,).

        Raises:
          SettingsError: there is none of that name, or an older version wrote the run without it.
        """
        if name not in self.columns:
            why = " (written by an older version)" if name in TELEMETRY else ""
            raise SettingsError(
                f"{self.folder / _TELEMETRY}{why} has no column {name!r}; {accepted_names(name, self.columns)}"
            )
        return self.telemetry[:, TELEMETRY.index(name)]


def check_run_folder(folder: str | Path) -> None:
    """Make sure that a run can be written to a folder, and leave everything as it was.

    Raises:
      RunFolderError: it is a file, is not empty, or cannot be written.
    """
    with _reserved(Path(folder), keep=False):
        pass


def write_run(
    result: RaceResult,
    folder: str | Path,
    *,
    draw: Callable[[RaceResult, Path], None] | None = None,
    settings: Mapping[str, Any] | None = None,
) -> Path:
    """Write a run folder and return its path. A failure leaves nothing behind.

    Args:
      result: of the race.
      folder: new or empty.
      draw: draws trace.png; None: without a picture. `fg_mujoco.write_run` has one.
      settings: options of the command line that drive this race again; `race --config DIR` needs them.

    Raises:
      RunFolderError: the folder is a file, is not empty, or cannot be written.
    """
    folder = Path(folder)
    with _reserved(folder, keep=True) as staging:
        (staging / _SCENE).write_text(result.world.xml, encoding="utf-8")
        time = result.states[:, 0]  # mjSTATE_TIME comes first in a state
        np.savez_compressed(staging / _STATES, time=time, state=result.states, ctrl=result.ctrl)
        _write_telemetry(result.telemetry, staging / _TELEMETRY)
        if result.controller_source is not None and result.controller_origin["distribution"] is None:
            (staging / _CONTROLLER).write_bytes(result.controller_source)
        if result.planner_failure is not None:
            _write_failed_scan(result.planner_failure, staging / FAILED_SCAN)
        if draw is not None:
            draw(result, staging / _TRACE)
        (staging / SUMMARY).write_text(summary_json(result, settings) + "\n", encoding="utf-8")
        for name in _FILES:
            if (staging / name).exists():
                (staging / name).rename(folder / name)
    return folder


def summary_json(result: RaceResult, settings: Mapping[str, Any] | None = None) -> str:
    """Return the summary, `settings` and the versions that made it as one JSON object; NaN and infinity are null."""
    versions = {
        "schema": SCHEMA,
        "fg_mujoco_version": version("fg-mujoco"),
        "mujoco_version": mujoco.__version__,
        "platform": f"{platform.system()}-{platform.machine()}",
    }
    found = result.summary()
    if found.get("planner_failure") is not None:
        found["planner_failure"]["scan"] = FAILED_SCAN
    summary = {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in (found | ({"settings": dict(settings)} if settings else {}) | versions).items()
    }
    return json.dumps(summary, indent=2, allow_nan=False)


def read_summary(folder: str | Path) -> dict[str, Any]:
    """Read the summary of a run folder.

    Raises:
      RunFolderError: it is not one, or its summary is damaged.
    """
    path = Path(folder) / SUMMARY
    if not is_file(path):
        raise RunFolderError(f"{folder}: has no {SUMMARY}; accepted: a folder that `race --out` wrote")
    with _blame(path):
        summary = json.loads(read_text(path))
        if not isinstance(summary, dict) or summary.get("schema") != SCHEMA:
            raise ValueError(f"no JSON object with schema {SCHEMA}")
    return summary


def kept_controller(folder: str | Path, summary: Mapping[str, Any]) -> Path | None:
    """Return the source of a planner of one's own that a run folder keeps; None: it keeps none.

    Args:
      folder: of the run.
      summary: of the run, which has the hash of the source.

    Raises:
      RunFolderError: the copy is not the source that was raced.
    """
    path = Path(folder) / _CONTROLLER
    if not is_file(path):
        return None
    with _blame(path):
        sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
        raced = summary["controller_origin"]["sha256"]
    if sha256 != raced:
        said = f"{path}: is another one now: its sha256 is {sha256[:12]}, recorded is {str(raced)[:12]}"
        raise RunFolderError(f"{said}; accepted with --trust: the source as it was raced")
    return path


def read_run(folder: str | Path) -> Run:
    """Read a run folder.

    Raises:
      RunFolderError: it is not one, or a file in it is missing or damaged.
    """
    folder = Path(folder)
    summary = read_summary(folder)
    for path in (folder / _SCENE, folder / _STATES, folder / _TELEMETRY):
        with _blame(path):
            require_regular(path)
    with _blame(folder / _STATES), np.load(folder / _STATES, allow_pickle=False) as arrays:
        time, states, ctrl = (np.array(arrays[name], dtype=np.float64) for name in ("time", "state", "ctrl"))
        if ctrl.shape != (len(ctrl), 2) or states.ndim != 2 or {len(time), len(states)} != {len(ctrl) + 1}:
            raise ValueError(f"shapes {time.shape}, {states.shape}, {ctrl.shape}")
    with _blame(folder / _TELEMETRY):
        telemetry, columns = _read_telemetry(folder / _TELEMETRY)
        if len(telemetry) != len(ctrl):
            raise ValueError(f"{len(telemetry)} rows for {len(ctrl)} ticks")
    for array in (time, states, ctrl, telemetry):
        array.flags.writeable = False
    return Run(
        folder=folder, summary=summary, time=time, states=states, ctrl=ctrl, telemetry=telemetry, columns=columns
    )  # fmt: skip


def read_failed_scan(folder: str | Path) -> tuple[LaserScan, Odometry]:
    """Return the scan and the odometry at which the planner of a run failed.

    Raises:
      RunFolderError: the planner did not fail, or the file is damaged.
    """
    path = Path(folder) / FAILED_SCAN
    if not path.is_file():
        raise RunFolderError(f"{folder}: has no {FAILED_SCAN}; accepted: the folder of a race whose planner failed")
    with _blame(path), np.load(path, allow_pickle=False) as file:
        scan = LaserScan(**{f.name: _value(file[f.name]) for f in fields(LaserScan)})
        odometry = Odometry(**{f.name: _value(file[f"odometry_{f.name}"]) for f in fields(Odometry)})
    return scan, odometry


def _value(array: Any) -> Any:
    return array if array.ndim else array.item()


def _write_failed_scan(failure: PlannerFailure, path: Path) -> None:
    """Write the fields of a scan by their names, and those of the odometry behind `odometry_`."""
    values = {f.name: getattr(failure.scan, f.name) for f in fields(LaserScan)}
    values |= {f"odometry_{f.name}": getattr(failure.odometry, f.name) for f in fields(Odometry)}
    np.savez_compressed(path, **values)


def _write_telemetry(telemetry: FloatArray, path: Path) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(TELEMETRY)
        # repr is the shortest text that gives the same float back
        writer.writerows([repr(value).removesuffix(".0") for value in row] for row in telemetry.tolist())


def _read_telemetry(path: Path) -> tuple[FloatArray, tuple[str, ...]]:
    """Return the telemetry, NaN in the columns that are not there, and the columns that are."""
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    columns = tuple(name for name in TELEMETRY if name in header)
    if tuple(header) != columns or not set(RECORDED_ALWAYS) <= set(columns):
        raise ValueError(f"columns {', '.join(header)[:60]}")
    telemetry = np.full((len(rows), len(TELEMETRY)), np.nan)
    found = [TELEMETRY.index(name) for name in columns]
    telemetry[:, found] = np.array(rows, dtype=np.float64).reshape(-1, len(columns))
    return telemetry, columns


@contextmanager
def _reserved(folder: Path, *, keep: bool) -> Iterator[Path]:
    """Make the folder and in it one to write to; take away the latter in the end, and both unless it went well."""
    staging = folder / _STAGING
    created: list[Path] = []
    ours = kept = False
    try:
        if folder.exists() and not folder.is_dir():
            raise RunFolderError(f"{folder}: is a file; accepted: a new or empty folder")
        if folder.exists() and any(folder.iterdir()):
            raise RunFolderError(f"{folder}: is not empty; accepted: a new or empty folder")
        created = [path for path in (folder, *folder.parents) if not path.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        staging.mkdir()
        ours = True
        yield staging
        kept = keep
    except FgMujocoError:
        raise
    except OSError as error:
        reason = error.strerror or str(error)
        raise RunFolderError(f"{folder}: cannot be written: {reason}; accepted: a folder that can be") from error
    finally:
        if ours:
            shutil.rmtree(staging, ignore_errors=True)
        if ours and not kept:
            for name in _FILES:
                (folder / name).unlink(missing_ok=True)
        if not kept:
            for path in created:
                with suppress(OSError):
                    path.rmdir()


@contextmanager
def _blame(path: Path) -> Iterator[None]:
    """Turn whatever reading a file raises into one line that names it."""
    try:
        yield
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise RunFolderError(f"{path}: cannot be read: {reason}; accepted: as `race --out` wrote it") from error
