"""Telemetry: one row a tick for each car, and the running statistics of a drive."""

from __future__ import annotations

from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from ..kernels import kernel
from ..messages import FloatArray
from ..vehicle.car import WHEELS
from ..vehicle.motion import CarArray, ground_speed, planar_pose
from ..vehicle.tire_slip import (
    FORCE_X,
    FORCE_Y,
    NORMAL_FORCE,
    SLIP_ANGLE,
    SLIP_RATIO,
    greatest_lateral_speed,
    greatest_slip,
)

TELEMETRY = (
    "time_s", "lap", "progress_m", "offset_m", "x_m", "y_m", "heading_rad",
    "speed_m_s", "yaw_rate_rad_s", "steering_angle_rad", "command_steering_rad", "command_speed_m_s",
    *(f"slide_{wheel}_m_s" for wheel in WHEELS),
    *(f"friction_use_{wheel}" for wheel in WHEELS),
    "sliding_steps", "steps",
    *(f"load_{wheel}_N" for wheel in WHEELS),
    *(f"fx_{wheel}_N" for wheel in WHEELS),
    *(f"fy_{wheel}_N" for wheel in WHEELS),
    *(f"slip_angle_{wheel}_rad" for wheel in WHEELS),
    *(f"slip_ratio_{wheel}" for wheel in WHEELS),
)  # fmt: skip
"""Columns of the telemetry. A row is one tick: the state at its start and the planner's command; then, while it was
held, each tire's greatest slip speed and friction utilisation (NaN: off the ground all the while), and in how many of
the physics steps any tire slid. The last columns are of the first of these steps, at the state of the row: each tire's
load, its force along its wheel's heading and to the left of it, its slip angle and its slip ratio, as in TireSlip."""


STATISTICS = np.dtype(
    [
        ("ticks", np.int64),
        ("steps", np.int64),
        ("sliding_steps", np.int64),
        ("max_slide", np.float64),  # [m/s]
        ("max_lateral_slide", np.float64),  # [m/s]
        ("speed_sum", np.float64),  # [m/s] of all ticks, without sign
        ("max_speed", np.float64),  # [m/s]
    ]
)
"""Running statistics of a drive, one row a car."""


class StatisticsFigures(TypedDict):
    """What the summary says of the running statistics."""

    max_slide_m_s: float
    max_lateral_slide_m_s: float
    slide_time_fraction: float
    mean_speed_m_s: float
    max_speed_m_s: float


def statistics_figures(row: Any) -> StatisticsFigures:
    """Return the summary's figures of a row of STATISTICS."""
    ticks, steps = int(row["ticks"]), int(row["steps"])
    return {
        "max_slide_m_s": float(row["max_slide"]),
        "max_lateral_slide_m_s": float(row["max_lateral_slide"]),
        "slide_time_fraction": int(row["sliding_steps"]) / steps if steps else 0.0,
        "mean_speed_m_s": float(row["speed_sum"]) / ticks if ticks else 0.0,
        "max_speed_m_s": float(row["max_speed"]),
    }


_SLIDE = TELEMETRY.index(f"slide_{WHEELS[0]}_m_s")
_SLIDING_STEPS = TELEMETRY.index("sliding_steps")
_LOAD = TELEMETRY.index(f"load_{WHEELS[0]}_N")
_SPEED = TELEMETRY.index("speed_m_s")
COMMAND = TELEMETRY.index("command_steering_rad")
"""Column of the commanded steering angle; the commanded speed is the one behind it."""


@kernel
def begin_row(
    time: float, qpos: FloatArray, qvel: FloatArray, car: CarArray, timers: NDArray[np.void], i: int, row: FloatArray
) -> None:
    """Write the first columns of a tick's row of telemetry: the state at its start.

    Args:
      time: [s].
      qpos: of the model.
      qvel: of the model.
      car: (1,) of CAR.
      timers: (n,) of LAP_TIMER.
      i: which of them is the car's.
      row: (len(TELEMETRY),), written to.
    """
    row[0] = time
    row[1], row[2], row[3] = timers[i].laps_completed + 1, timers[i].progress, timers[i].offset
    row[4], row[5], row[6] = planar_pose(qpos, car)
    row[7] = ground_speed(qpos, qvel, car)
    row[8], row[9] = qvel[car[0].free_dof + 5], qpos[car[0].steering_qpos]


@kernel
def end_row(statistics: NDArray[np.void], i: int, row: FloatArray, slip: FloatArray) -> None:
    """Fill in what the tires did in the row of telemetry of a tick, and add the row to the running statistics.

    Args:
      statistics: (n,) of STATISTICS, written to.
      i: which of them.
      row: (len(TELEMETRY),), its columns from the slides on written to.
      slip: (QUANTITIES, steps, 4) of `measure_slip`.
    """
    so_far = statistics[i]
    row[_SLIDING_STEPS] = greatest_slip(slip, row[_SLIDE : _SLIDE + 8])
    row[_SLIDING_STEPS + 1] = slip.shape[1]
    for tire in range(4):
        row[_LOAD + tire] = slip[NORMAL_FORCE, 0, tire]
        row[_LOAD + 4 + tire], row[_LOAD + 8 + tire] = slip[FORCE_X, 0, tire], slip[FORCE_Y, 0, tire]
        row[_LOAD + 12 + tire], row[_LOAD + 16 + tire] = slip[SLIP_ANGLE, 0, tire], slip[SLIP_RATIO, 0, tire]
    so_far.ticks += 1
    so_far.steps += slip.shape[1]
    so_far.sliding_steps += int(row[_SLIDING_STEPS])
    for tire in range(4):
        if row[_SLIDE + tire] > so_far.max_slide:
            so_far.max_slide = row[_SLIDE + tire]
    so_far.max_lateral_slide = greatest_lateral_speed(slip, so_far.max_lateral_slide)
    so_far.speed_sum += abs(row[_SPEED])
    so_far.max_speed = max(so_far.max_speed, abs(row[_SPEED]))
