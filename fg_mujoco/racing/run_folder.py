"""The run folder: what a race leaves on disk, and the proof that it can be driven again bit for bit.

    write_run(result, "runs/oval")
    report = replay("runs/oval")
    assert report.identical

    summary.json    the figures of the race, and the versions that made it
    scene.xml       the MJCF text that the raced model was compiled from; MuJoCo 3.16 and newer load it
    states.npz      time (n + 1,) [s], state (n + 1, k) mjSTATE_INTEGRATION, ctrl (n, 2) [rad, m/s]: row i of ctrl is
                    held from state i to state i + 1, one tick
    telemetry.csv   one row a tick, columns named with their units
    telemetry_car_1.csv, controller_car_1.py and so on, the same of the other cars of a race of several
    controller.py   the source of a planner of your own, as it was read; its hash is in the summary; of a trained
                    policy its file: controller.onnx or controller.zip
    failed_scan.npz where the planner failed: the scan and the odometry that it was given, see `read_failed_scan`
    trace.png       the line over the track, and the tires' work over time (needs the extra `plot`)

A folder with a summary is complete: everything is written aside, and the summary is moved in last. Its `files` has the
SHA-256 of each file that is read back, so that a damaged or edited one is named.
"""

from __future__ import annotations

import csv
import json
import math
import os
import re
from array import array
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import Suggesting, explain_class
from ..course.documents import read_json
from ..course.files import file_sha256, is_file, read_arrays, read_text, require_regular
from ..course.mjcf import MOST_MJCF
from ..course.writing import claimed_folder, require_writable, staged_folder, writing
from ..display import brief, quoted
from ..errors import FgMujocoError, RunFolderError, nearest
from ..messages import ODOMETRY, FloatArray, LaserScan, Odometry, Reading, Readings, shown
from ..simulation.planner_failure import PlannerFailure
from ..simulation.telemetry import ALWAYS_NUMBERS, TELEMETRY, column_index, column_meant
from .planners import POLICY_ENDINGS
from .result import RaceResult
from .run_checks import check_summary, checked_scene
from .summary import FAILED_SCAN, SCHEMA, summary_json

_MOST_SUMMARY = 2**20  # bytes
_MOST_TELEMETRY = 512 * 2**20  # bytes, of about ten hours
_MOST_STATES = 2 * 2**30  # bytes, uncompressed
_MOST_OF_A_ROW = 2000  # bytes
_MOST_FAILED_SCAN = 2**20  # bytes
_LATEST = 1e9  # [s]
_GREATEST = 1e15  # of all numbers; MuJoCo itself resets a state beyond 1e10

# in the order they are moved in
_FILES = ("scene.xml", "states.npz", "telemetry.csv", "trace.png", "controller.py", FAILED_SCAN, "summary.json")
_SCENE, _STATES, _TELEMETRY, _TRACE, _CONTROLLER, _, SUMMARY = _FILES
SCENE, STATES, TELEMETRY_FILE = _SCENE, _STATES, _TELEMETRY
_POLICIES = tuple(f"controller{ending}" for ending in POLICY_ENDINGS)  # in the place of controller.py
NOT_SIMULATED = (_TRACE, _CONTROLLER, *_POLICIES, FAILED_SCAN)
"""Files of which no replay says anything."""
_ODOMETRY = ODOMETRY.names or ()
_READING = tuple(f.name for f in fields(Reading))
_READ_BACK = (_SCENE, _STATES, _TELEMETRY, _CONTROLLER, *_POLICIES, FAILED_SCAN)  # pictures and pages can be made again


@explain_class
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Run(Suggesting):
    """A run folder, read back. Arrays are as in RaceResult."""

    folder: Path
    summary: dict[str, Any]
    xml: str = field(repr=False)  # of its scene, as it was checked
    time: FloatArray = field(repr=False)  # (ticks + 1,) [s]
    states: FloatArray = field(repr=False)  # (ticks + 1, k)
    ctrl: FloatArray = field(repr=False)  # (ticks, 2 cars)
    telemetry: FloatArray = field(repr=False)  # (ticks, len(TELEMETRY))
    others: tuple[FloatArray, ...] = field(default=(), repr=False)  # telemetry of car 1, car 2 and so on

    def __repr__(self) -> str:
        found = {name: self.summary.get(name, "unknown") for name in ("controller", "track", "end_reason")}
        drive = f"{quoted(found['controller'])} on {quoted(found['track'])}: {found['end_reason']}"
        return brief(self, quoted(self.folder), drive, f"{len(self.ctrl)} ticks, {self.time[-1]:.2f} s")

    def _meant(self, name: str) -> str | None:
        found = nearest(name, self.summary)
        return column_meant(name, super()._meant(name) or (None if found is None else f"summary[{found!r}]"))

    @property
    def scene(self) -> Path:
        """The MJCF file of the world, whose text is `xml`."""
        return self.folder / _SCENE

    def column(self, name: str) -> FloatArray:
        """Return one column of the telemetry by its name, with or without its unit. Shape (ticks,).

        Raises:
          SettingsError: there is none of that name.
        """
        return self.telemetry[:, column_index(name)]


def check_run_folder(folder: str | Path) -> None:
    """Make sure that a run can be written to a folder, and leave everything as it was.

    Args:
      folder: of the run.

    Raises:
      RunFolderError: it is a file, has other files, or cannot be written.
    """
    with _reserved(Path(folder)):
        require_writable(Path(folder) / SUMMARY)


def write_run(
    result: RaceResult,
    folder: str | Path,
    *,
    draw: Callable[[RaceResult, Path], None] | None = None,
    add: Callable[[Path], Any] | None = None,
) -> Path:
    """Write a run folder and return its path. A failure leaves nothing behind.

    Args:
      result: of the race.
      folder: new or empty.
      draw: draws trace.png; None: without a picture. `fg_mujoco.write_run` has one.
      add: adds files to the run, as its report; called with the path of a folder that has all others.

    Raises:
      RunFolderError: the folder is a file, has other files, or cannot be written.
    """
    folder = Path(folder)
    with _reserved(folder), staged_folder(folder, SUMMARY) as staging:
        (staging / _SCENE).write_text(result.world.xml, encoding="utf-8")
        time = result.states[:, 0]  # mjSTATE_TIME comes first in a state
        np.savez_compressed(staging / _STATES, time=time, state=result.states, ctrl=result.ctrl)
        for index, car in enumerate(result.cars):
            _write_telemetry(car.telemetry, staging / of_car(_TELEMETRY, index))
            if car.controller_source is not None and car.controller_origin["distribution"] is None:
                kept = of_car(_kept_name(car.controller_origin["file"]), index)
                (staging / kept).write_bytes(car.controller_source)
        if result.car.planner_failure is not None:
            _write_failed_scan(result.car.planner_failure, staging / FAILED_SCAN)
        if draw is not None:
            draw(result, staging / _TRACE)
        read_back = [of_car(name, car) for car in range(len(result.cars)) for name in _READ_BACK]
        sha256s = {name: file_sha256(staging / name) for name in read_back if (staging / name).exists()}
        summary = json.loads(summary_json(result)) | {"files": sha256s}
        (staging / SUMMARY).write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
        if add is not None:
            try:
                add(staging)
            except FgMujocoError as error:
                if str(staging) not in str(error):
                    raise
                raise RunFolderError(str(error).replace(str(staging), str(folder))) from error
    return folder


def of_car(file: str, index: int) -> str:
    """Return the name of a file of a run folder for a car; car 0's are named as if it were alone."""
    name, dot, ending = file.partition(".")
    return f"{name}_car_{index}{dot}{ending}" if index else file


def read_summary(folder: str | Path) -> dict[str, Any]:
    """Read the summary of a run folder.

    Raises:
      RunFolderError: it is not one, or its summary is damaged.
    """
    if not isinstance(folder, (str, os.PathLike)):
        raise RunFolderError(f"the run is {shown(folder)}; accepted: the path of a folder that `race --out` wrote")
    path = Path(folder) / SUMMARY
    if not is_file(path):
        raise RunFolderError(f"{folder}: has no {SUMMARY}; accepted: a folder that `race --out` wrote")
    with _blame(path):
        text = read_text(path, _MOST_SUMMARY)
    try:
        summary: dict[str, Any] = read_json(text, "as `race --out` wrote it")
        if not isinstance(summary, dict) or summary.get("schema") != SCHEMA:
            raise ValueError(f"is no JSON object with schema {SCHEMA}; accepted: as `race --out` wrote it")
        check_summary(summary)
    except ValueError as error:
        raise RunFolderError(f"{path}: {error}") from error
    return summary


def _kept_name(file: str | None) -> str:
    """Return the name under which a run folder keeps the file of a planner."""
    ending = Path(file or "").suffix
    return f"controller{ending}" if ending in POLICY_ENDINGS else _CONTROLLER


def read_run(folder: str | Path) -> Run:
    """Read a run folder.

    Raises:
      RunFolderError: it is not one, or a file in it is missing or damaged.
    """
    summary, folder = read_summary(folder), Path(folder)
    cars = car_count(summary)
    telemetries = [folder / of_car(_TELEMETRY, index) for index in range(cars)]
    for path in (folder / _SCENE, folder / _STATES, *telemetries):
        with _blame(path):
            require_regular(path)
        _require_unchanged(path, summary)
    with _blame(folder / _SCENE):
        xml = checked_scene(read_text(folder / _SCENE, MOST_MJCF))
    with _blame(folder / _TELEMETRY):
        telemetry = _read_telemetry(folder / _TELEMETRY)
    others = []
    for path in telemetries[1:]:
        with _blame(path):
            found = _read_telemetry(path)
            if len(found) != len(telemetry):
                raise ValueError(f"{len(found)} rows; {_TELEMETRY} has {len(telemetry)}")
            others.append(found)
    with _blame(folder / _STATES):
        time, states, ctrl = _read_states(folder / _STATES, len(telemetry), cars)
    for values in (time, states, ctrl, telemetry, *others):
        values.flags.writeable = False
    return Run(
        folder=folder, summary=summary, xml=xml, time=time, states=states, ctrl=ctrl, telemetry=telemetry,
        others=tuple(others),
    )  # fmt: skip


def car_count(summary: Mapping[str, Any]) -> int:
    """Return the number of cars in a run's summary."""
    return max(len(summary.get("cars") or ()), 1)


def read_failed_scan(folder: str | Path) -> tuple[LaserScan, Odometry]:
    """Return the scan and the odometry at which the planner of a run failed.

    Raises:
      RunFolderError: the planner did not fail, or the file is damaged.
    """
    path = Path(folder) / FAILED_SCAN
    if not is_file(path):
        raise RunFolderError(f"{folder}: has no {FAILED_SCAN}; accepted: the folder of a race whose planner failed")
    summary = read_summary(folder)
    _require_unchanged(path, summary)
    with _blame(path):
        sensors = [str(each.get("name")) for each in summary.get("sensors") or ()]
        names = [f.name for f in fields(LaserScan)] + [f"odometry_{name}" for name in _ODOMETRY]
        names += [f"reading_{sensor}_{name}" for sensor in sensors for name in _READING]
        file = read_arrays(path, names, _MOST_FAILED_SCAN)
        scan = LaserScan(**{f.name: _value(file[f.name]) for f in fields(LaserScan)})
        readings = Readings()
        for sensor in sensors:
            parts = {name: _value(file[f"reading_{sensor}_{name}"]) for name in _READING}
            readings[sensor] = Reading(**parts | {"columns": tuple(map(str, parts["columns"]))})
        odometry = Odometry(**{name: _value(file[f"odometry_{name}"]) for name in _ODOMETRY}, readings=readings)
    return scan, odometry


def _value(array: Any) -> Any:
    return array if array.ndim else array.item()


def _write_failed_scan(failure: PlannerFailure, path: Path) -> None:
    """Write a scan by its fields, the odometry behind `odometry_`, and each sensor's reading behind `reading_NAME_`."""
    values = {f.name: getattr(failure.scan, f.name) for f in fields(LaserScan)}
    values |= {f"odometry_{name}": getattr(failure.odometry, name) for name in _ODOMETRY}
    for sensor, reading in failure.odometry.readings.items():
        values |= {f"reading_{sensor}_{name}": getattr(reading, name) for name in _READING}
    np.savez_compressed(path, **values)


def _write_telemetry(telemetry: FloatArray, path: Path) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(TELEMETRY)
        # repr is the shortest text that gives the same float back; NaN is an empty cell
        cells = ([repr(value).removesuffix(".0") for value in row] for row in telemetry.tolist())
        writer.writerows(["" if cell == "nan" else cell for cell in row] for row in cells)


def _read_telemetry(path: Path) -> FloatArray:
    """Return the telemetry, read line by line: no line and no file is longer than a race writes it."""
    require_regular(path)
    if path.stat().st_size > _MOST_TELEMETRY:
        raise ValueError(f"more than {_MOST_TELEMETRY} bytes")
    values = array("d")
    with path.open("rb") as file:
        header = file.readline(_MOST_OF_A_ROW).decode("utf-8", "replace").rstrip("\r\n")
        if header != ",".join(TELEMETRY):
            raise ValueError(f"columns {header[:60]}")
        for number, line in enumerate(iter(lambda: file.readline(_MOST_OF_A_ROW), b""), start=2):
            row = line.split(b",")
            if len(row) != len(TELEMETRY) or not line.endswith(b"\n"):
                raise ValueError(f"line {number} is torn, too long, or has not {len(TELEMETRY)} columns")
            values.extend(float(cell) if cell.strip() else math.nan for cell in row)
    table = np.array(values, dtype=np.float64).reshape(-1, len(TELEMETRY))
    known = np.isnan(table)
    known[:, [name in ALWAYS_NUMBERS for name in TELEMETRY]] = False
    if not ((np.abs(table) <= _GREATEST) | known).all():
        raise ValueError(f"a number that is none, or beyond {_GREATEST:.0e}")
    return table


def _read_states(path: Path, ticks: int, cars: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return time, states and ctrl of as many ticks as the telemetry has rows, of so many cars."""
    names = ("time", "state", "ctrl")
    time, states, ctrl = arrays = tuple(read_arrays(path, names, _MOST_STATES).values())
    if any(values.dtype != np.float64 for values in arrays):
        raise ValueError(f"numbers of {', '.join(str(values.dtype) for values in arrays)}; accepted: float64")
    if time.shape != (ticks + 1,) or ctrl.shape != (ticks, 2 * cars) or states.ndim != 2 or len(states) != ticks + 1:
        raise ValueError(f"shapes {time.shape}, {states.shape}, {ctrl.shape} for the {ticks} rows of {_TELEMETRY}")
    for name, values in zip(names, arrays, strict=True):
        if not (np.abs(values) <= _GREATEST).all():
            raise ValueError(f"{name} has a number that is none, or beyond {_GREATEST:.0e}")
    if not (np.diff(time) > 0.0).all():
        raise ValueError("time does not grow")
    if not 0.0 <= time[0] <= time[-1] <= _LATEST:
        raise ValueError(f"time goes from {time[0]:g} to {time[-1]:g} s; accepted: within 0 to {_LATEST:.0e}")
    return time, states, ctrl


def _require_unchanged(path: Path, summary: Mapping[str, Any]) -> None:
    """Make sure that a file is the one that was written; a folder of an older version does not say which it was."""
    files = summary.get("files", {})
    if not isinstance(files, dict) or not all(re.fullmatch("[0-9a-f]{64}", str(value)) for value in files.values()):
        said = f"{path.parent / SUMMARY}: files is {' '.join(str(files).split())[:60]!r}"
        raise RunFolderError(f"{said}; accepted: the SHA-256 of each file by its name")
    if path.name in files and (path.stat().st_size > _MOST_STATES or file_sha256(path) != files[path.name]):
        raise RunFolderError(f"{path}: is damaged or edited: its sha256 is another; accepted: as `race --out` wrote it")


@contextmanager
def _reserved(folder: Path) -> Iterator[None]:
    """Make a folder, or claim one that is empty; one that stays empty is removed again."""
    with writing(folder, "a folder that can be"):
        if folder.exists() and not folder.is_dir():
            raise RunFolderError(f"{folder}: is a file; accepted: a new or empty folder")
        with claimed_folder(folder):
            if any(folder.iterdir()):
                raise RunFolderError(f"{folder}: is not empty; accepted: a new or empty folder")
            yield


@contextmanager
def _blame(path: Path) -> Iterator[None]:
    """Turn whatever reading a file raises into one line that names it."""
    try:
        yield
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise RunFolderError(f"{path}: cannot be read: {reason}; accepted: as `race --out` wrote it") from error
