"""Drives a planner in a new process of its own, which records its commands and nothing else.

    recorded = record("alice.py", setup)
    recorded.commands    # (n, 3): time [s], steering angle [rad], speed [m/s] of each tick

A planner's code can change all that its own process knows. So a file of numbers comes back from there, which is read as
data, and whoever grades drives the same setup again by these commands: see `RecordedCommands`.

The process is killed with all that it started when its record is there, or when it shows no progress for the limit of a
decision and 15 s more.
"""

from __future__ import annotations

import json
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO

import numpy as np

from fg_mujoco.course.files import is_file, read_arrays
from fg_mujoco.errors import ControllerError
from fg_mujoco.messages import DriveCommand, FloatArray, LaserScan, Odometry
from fg_mujoco.racing.planners import ControllerChoice, only_planner
from fg_mujoco.racing.race import RaceProgress, race_setup
from fg_mujoco.racing.setup import Setup
from fg_mujoco.rollouts.workers import PULSE, how_ended
from fg_mujoco.simulation.settings import LONGEST_RACE

from .run import why_failed

FAILED = ("planner_failed", "decision_limit", "interrupted")
"""Ends of a drive that only its planner's process knows of."""

_RECORD, _BEATS = "record.npz", "beats"
_STARTS = 60.0  # [s] that the process may take until it reads the planner's code
_SILENT = 15.0  # [s] beyond the limit of a decision: reading the code, making the world
_MOST_TICKS = int(LONGEST_RACE / 0.01)
_MOST_BYTES = 32 * _MOST_TICKS
_LONGEST = 2000  # characters of a message
_COLUMNS = ("time_s", "command_steering_rad", "command_speed_m_s")


@dataclass(frozen=True, kw_only=True)
class Recorded:
    """What the process of a planner has recorded."""

    commands: FloatArray  # (n, 3) of each tick: time [s], steering angle [rad], speed [m/s]
    failed: str | None = None  # one of FAILED, or `worker_died`; None: the planner did not fail
    message: str = ""  # why it failed


class RecordedCommands:
    """A controller that commands what was recorded, each command in its tick.

    Args:
      commands: as in Recorded.
    """

    def __init__(self, commands: FloatArray) -> None:
        self._commands = commands

    def reset(self) -> None:
        """Nothing is remembered."""

    def __call__(self, scan: LaserScan, odometry: Odometry) -> DriveCommand:
        """Return the command of this tick.

        Raises:
          ControllerError: the record has ended.
        """
        row = int(np.searchsorted(self._commands[:, 0], odometry.stamp - 1e-9))
        if row == len(self._commands):
            raise ControllerError("its record ends here")
        return DriveCommand(steering_angle=float(self._commands[row, 1]), speed=float(self._commands[row, 2]))


def record(planner: str, setup: Setup) -> Recorded:
    """Drive a setup with a planner in place of its own, in a new process.

    Args:
      planner: as `study` takes it.
      setup: of the drive.
    """
    limit = setup.decision_limit
    with TemporaryDirectory(prefix="fg_mujoco-drive-", ignore_cleanup_errors=True) as folder:
        start = f"import sys; sys.path[:] = {sys.path!r}; from {__name__} import drive; drive({folder!r})"
        process = subprocess.Popen(
            [sys.executable, "-c", start], stdin=subprocess.PIPE, stdout=2, start_new_session=True
        )  # fmt: skip
        assert process.stdin is not None
        try:
            with suppress(BrokenPipeError):
                process.stdin.write(pickle.dumps((planner, setup)))
                process.stdin.flush()
            finished = _wait(process, Path(folder), limit or 0.0)
            if is_file(Path(folder, _RECORD)):
                return _read(Path(folder, _RECORD))
        finally:  # with what it has started
            with suppress(OSError):
                os.killpg(process.pid, signal.SIGKILL) if hasattr(os, "killpg") else process.kill()
            process.wait()
            with suppress(OSError):
                process.stdin.close()
    if finished:
        return _nothing("worker_died", how_ended(process.returncode))
    return _nothing("decision_limit", f"no command within {limit or 0.0:g} s, and nothing interrupted it")


def _wait(process: subprocess.Popen[bytes], folder: Path, limit: float) -> bool:
    """Wait for the record or the end of a process; return False if it shows no progress, or too much of it."""
    seen, since = 0, time.monotonic()
    while process.poll() is None and not is_file(folder / _RECORD):
        with suppress(subprocess.TimeoutExpired):
            process.wait(PULSE)
        beats = (folder / _BEATS).stat().st_size if is_file(folder / _BEATS) else 0
        if beats > seen:
            seen, since = beats, time.monotonic()
        silent = time.monotonic() - since
        if silent > (limit + _SILENT if seen else _STARTS) or seen > _MOST_TICKS:
            return False
    return True


def _read(path: Path) -> Recorded:
    """Return a record. Its writer may have been made to write anything."""
    try:
        found = read_arrays(path, ("commands", "end"), _MOST_BYTES)
        commands, end = found["commands"], json.loads(found["end"].tobytes())
        if commands.dtype != np.float64 or commands.ndim != 2 or commands.shape[1] != len(_COLUMNS):
            raise ValueError(f"its commands are {commands.dtype} {commands.shape}")
        if end is None:
            return Recorded(commands=commands)
        failed, message = end
        if failed not in FAILED:
            raise ValueError("its end is unknown")
        return Recorded(commands=commands, failed=failed, message=str(message)[:_LONGEST])
    except Exception as error:
        return _nothing("worker_died", f"its record cannot be read: {str(error)[:_LONGEST]}")


def _nothing(failed: str, message: str) -> Recorded:
    return Recorded(commands=np.empty((0, len(_COLUMNS))), failed=failed, message=message)


def drive(folder: str) -> None:
    """Drive what `record` asks for and write the record to a folder; called in the new process."""
    asked = os.fdopen(os.dup(0), "rb")
    with open(os.devnull, "rb") as nothing:
        os.dup2(nothing.fileno(), 0)  # of the planner
    sys.stdout = sys.stderr
    planner, setup = pickle.load(asked)
    threading.Thread(target=_end_with_parent, args=(asked,), daemon=True).start()
    beats = os.open(Path(folder, _BEATS), os.O_WRONLY | os.O_CREAT)
    os.write(beats, b".")
    recorded = _drive(planner, setup, beats)
    end = None if recorded.failed is None else (recorded.failed, recorded.message)
    aside = Path(folder, f"aside-{_RECORD}")
    np.savez(aside, commands=recorded.commands, end=np.frombuffer(json.dumps(end).encode(), np.uint8))
    aside.replace(Path(folder, _RECORD))


def _drive(planner: str, setup: Setup, beats: int) -> Recorded:
    def beat(progress: RaceProgress) -> None:
        os.write(beats, b".")

    try:
        choice = ControllerChoice.of(only_planner(planner))
        first = replace(setup.first, controller=choice.source, planner_settings=dict(choice.settings))
        setup = replace(setup, entries=(first, *setup.entries[1:]))
        car = race_setup(setup, watch=beat, each_tick=True).car
    except Exception as error:
        return _nothing("planner_failed", why_failed(error))
    commands = np.column_stack([car.column(name) for name in _COLUMNS])
    if car.end_reason not in FAILED:
        return Recorded(commands=commands)
    limit = f"no command within {setup.decision_limit or 0.0:g} s at t = {car.end_time_s:.2f} s"
    said = f"it raised KeyboardInterrupt at t = {car.end_time_s:.2f} s" if car.end_reason == "interrupted" else limit
    return Recorded(commands=commands, failed=car.end_reason, message=str(car.planner_failure or said))


def _end_with_parent(asked: IO[bytes]) -> None:
    asked.read()  # until the process that asked has ended
    os.kill(os.getpid(), signal.SIGKILL)
