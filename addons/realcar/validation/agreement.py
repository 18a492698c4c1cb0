"""How far a model is from recordings, signal by signal."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fg_mujoco.messages import FloatArray

from .car_model import BEFORE, Task
from .windows import HOLD_SPEED, PERIOD, STEADY_SECONDS, DriveMotion, SteadyState, Window

UNITS = {
    "speed": "m/s", "yaw rate": "rad/s", "lateral acceleration": "m/s^2", "slip angle": "rad", "position": "m",
}  # fmt: skip
"""Signals that are compared, and their units."""

_OVER = 5  # periods to either side, over which a lateral acceleration is measured


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """How far a signal is from what was recorded, over some windows or steady states."""

    signal: str  # of UNITS
    rms: float  # [unit] of the error
    worst: float  # [unit] the greatest error
    share: float  # [-] rms of the error over that of the recorded signal; of the position over the way that was driven
    worst_at: str  # drive and time of the greatest error

    @property
    def unit(self) -> str:
        """Of rms and worst."""
        return UNITS[self.signal]


def task_of(motions: list[DriveMotion], windows: list[Window], *, held: bool) -> Task:
    """Return what windows ask of a model; `held`: the recorded speed is held, and not the recorded command given."""
    count = max(window.count for window in windows)
    starts = []
    steering, drive = np.zeros((2, len(windows), BEFORE + count))
    kinds = np.full(len(windows), HOLD_SPEED)
    for place, window in enumerate(windows):
        motion = motions[window.drive]
        starts.append(start_of(motion, window.first))
        rows = np.clip(np.arange(window.first - BEFORE, window.first + count), 0, len(motion.time) - 1)
        kinds[place], source = (HOLD_SPEED, motion.forward_speed) if held else motion.commanded
        steering[place], drive[place] = motion.wheel_command[rows], source[rows]
    return Task(
        starts=np.array(starts), counts=np.array([window.count for window in windows]), steering=steering, drive=drive,
        kinds=kinds,
    )  # fmt: skip


def steady_task(motions: list[DriveMotion], states: list[SteadyState]) -> Task:
    """Return what steady states ask of a model: steering and speed that are held, from the recorded state."""
    count = BEFORE + round(STEADY_SECONDS / PERIOD)
    starts = [start_of(motions[state.drive], state.first) for state in states]
    shape = (len(states), count)
    return Task(
        starts=np.array(starts), counts=np.full(len(states), count - BEFORE),
        steering=np.broadcast_to(np.array([[state.wheel_command] for state in states]), shape),
        drive=np.broadcast_to(np.array([[state.speed] for state in states]), shape),
        kinds=np.full(len(states), HOLD_SPEED),
    )  # fmt: skip


def start_of(motion: DriveMotion, row: int) -> tuple[float, ...]:
    """Return the recorded state at a row of a drive, as Task has it."""
    moving = motion.forward_speed, motion.lateral_speed, motion.yaw_rate, motion.wheel_angle
    return tuple(float(column[row]) for column in (motion.x, motion.y, motion.heading, *moving))


def joined(tasks: list[Task]) -> Task:
    """Return some tasks as one: one batch of worlds."""
    longest = max(task.steering.shape[1] for task in tasks)

    def padded(values: FloatArray) -> FloatArray:
        return np.pad(values, ((0, 0), (0, longest - values.shape[1])), mode="edge")

    return Task(
        starts=np.concatenate([task.starts for task in tasks]),
        counts=np.concatenate([task.counts for task in tasks]),
        steering=np.concatenate([padded(task.steering) for task in tasks]),
        drive=np.concatenate([padded(task.drive) for task in tasks]),
        kinds=np.concatenate([task.kinds for task in tasks]),
    )


def of_center(simulated: FloatArray, rear_axle_distance: float) -> tuple[FloatArray, FloatArray]:
    """Return slip angle [rad] and lateral acceleration [m/s^2] of the centre of gravity, of motions (n, k, 6)."""
    forward, yaw_rate = simulated[..., 3], simulated[..., 5]
    across = simulated[..., 4] + rear_axle_distance * yaw_rate
    places = np.arange(across.shape[1])
    last = np.maximum(np.isfinite(across).sum(axis=1) - 1, 0)[:, np.newaxis]
    after = np.minimum(places + _OVER, last)
    before = np.maximum(np.minimum(places - _OVER, after - 1), 0)
    change = np.take_along_axis(across, after, axis=1) - np.take_along_axis(across, before, axis=1)
    return np.arctan2(across, forward), change / (np.maximum(after - before, 1) * PERIOD) + forward * yaw_rate


def signals_of(simulated: FloatArray, rear_axle_distance: float) -> dict[str, FloatArray]:
    """Return the signals of simulated motions (n, k, 6), without the position; shape (n, k) each."""
    slip, lateral = of_center(simulated, rear_axle_distance)
    return {
        "speed": simulated[..., 3], "yaw rate": simulated[..., 5], "lateral acceleration": lateral, "slip angle": slip,
    }  # fmt: skip


def recorded_signals(motion: DriveMotion) -> dict[str, FloatArray]:
    """Return what models are compared with, (n,) each."""
    return {
        "speed": motion.speed, "yaw rate": motion.gyro, "lateral acceleration": motion.lateral_acceleration,
        "slip angle": motion.slip_angle,
    }  # fmt: skip


def agreements(
    motions: list[DriveMotion], windows: list[Window], simulated: FloatArray, rear_axle_distance: float
) -> tuple[Agreement, ...]:
    """Return how far a model was from the recordings in its windows; `simulated` as models return it."""
    found, by_model = [], signals_of(simulated, rear_axle_distance)
    parts = [slice(window.first + 1, window.first + window.count + 1) for window in windows]
    times = np.concatenate([motions[each.drive].time[part] for each, part in zip(windows, parts, strict=True)])
    drives = np.concatenate([np.full(window.count, window.drive) for window in windows])
    for signal, values in by_model.items():
        recorded = np.concatenate(
            [recorded_signals(motions[window.drive])[signal][part] for window, part in zip(windows, parts, strict=True)]
        )
        model = np.concatenate([row[1 : window.count + 1] for row, window in zip(values, windows, strict=True)])
        found.append(_agreement(signal, model - recorded, recorded, motions, drives, times))
    away, driven = [], []
    for row, window, part in zip(simulated, windows, parts, strict=True):
        motion, place = motions[window.drive], row[1 : window.count + 1]
        away.append(np.hypot(place[:, 0] - motion.x[part], place[:, 1] - motion.y[part]))
        driven.append(np.cumsum(np.abs(motion.speed[part])) * PERIOD)
    found.append(_agreement("position", np.concatenate(away), np.concatenate(driven), motions, drives, times))
    return tuple(found)


def _agreement(
    signal: str, errors: FloatArray, recorded: FloatArray, motions: list[DriveMotion], drives: FloatArray,
    times: FloatArray,
) -> Agreement:  # fmt: skip
    worst = int(np.nanargmax(np.abs(errors)))
    return Agreement(
        signal=signal, rms=rms(errors), worst=float(abs(errors[worst])), share=rms(errors) / max(rms(recorded), 1e-12),
        worst_at=f"{motions[int(drives[worst])].drive.name} at {times[worst]:.2f} s",
    )  # fmt: skip


def rms(values: FloatArray) -> float:
    """Return the root of the mean square."""
    return math.sqrt(float(np.mean(np.square(values)))) if len(values) else math.nan
