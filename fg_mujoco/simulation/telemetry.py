"""Telemetry: one row a tick for each car, and the running statistics of a drive."""

from __future__ import annotations

from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from ..kernels import kernel
from ..messages import FloatArray
from ..vehicle.car import WHEELS
from ..vehicle.motion import CarArray, ground_speed, planar_pose
from ..vehicle.tire_slip import greatest_slip

TELEMETRY = (
    "time_s", "lap", "progress_m", "offset_m", "x_m", "y_m", "heading_rad",
    "speed_m_s", "yaw_rate_rad_s", "steering_angle_rad", "command_steering_rad", "command_speed_m_s",
    *(f"slide_{wheel}_m_s" for wheel in WHEELS),
    *(f"friction_use_{wheel}" for wheel in WHEELS),
    "sliding_steps", "steps",
)  # fmt: skip
"""Columns of the telemetry. A row is one tick: the state at its start, the command that the planner then gave, and
while it was held each tire's greatest sliding speed and friction use (NaN: off the ground all the while), and in how
many of the physics steps any tire slid."""


TALLY = np.dtype(
    [
        ("ticks", np.int64),
        ("steps", np.int64),
        ("sliding_steps", np.int64),
        ("max_slide", np.float64),  # [m/s]
        ("speed_sum", np.float64),  # [m/s] of all ticks, without sign
        ("max_speed", np.float64),  # [m/s]
    ]
)
"""The figures of a race, as far as it has gone."""


class TallyFigures(TypedDict):
    """What the summary says of a tally."""

    max_slide_m_s: float
    slide_time_fraction: float
    mean_speed_m_s: float
    max_speed_m_s: float


def tally_figures(tally: Any) -> TallyFigures:
    """Return the summary's figures of a row of TALLY."""
    ticks, steps = int(tally["ticks"]), int(tally["steps"])
    return {
        "max_slide_m_s": float(tally["max_slide"]),
        "slide_time_fraction": int(tally["sliding_steps"]) / steps if steps else 0.0,
        "mean_speed_m_s": float(tally["speed_sum"]) / ticks if ticks else 0.0,
        "max_speed_m_s": float(tally["max_speed"]),
    }


_SLIDE = TELEMETRY.index(f"slide_{WHEELS[0]}_m_s")
_SPEED = TELEMETRY.index("speed_m_s")
_COMMAND = TELEMETRY.index("command_steering_rad")


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
def tally_tick(tallies: NDArray[np.void], i: int, row: FloatArray, slip: FloatArray) -> None:
    """Fill in what the tires did in the row of telemetry of a tick, and add the row to a tally.

    Args:
      tallies: (n,) of TALLY, written to.
      i: which of them.
      row: (len(TELEMETRY),), its last ten columns written to.
      slip: (4, steps, 4) of `measure_slip`.
    """
    tally = tallies[i]
    row[-2] = greatest_slip(slip, row[_SLIDE : _SLIDE + 8])
    row[-1] = slip.shape[1]
    tally.ticks += 1
    tally.steps += slip.shape[1]
    tally.sliding_steps += int(row[-2])
    for tire in range(4):
        if row[_SLIDE + tire] > tally.max_slide:
            tally.max_slide = row[_SLIDE + tire]
    tally.speed_sum += abs(row[_SPEED])
    tally.max_speed = max(tally.max_speed, abs(row[_SPEED]))


@kernel
def end_row(
    row: FloatArray,
    steering_angle: float,
    speed: float,
    slip: FloatArray,
    ctrl: FloatArray,
    ctrl_row: FloatArray,
    tally: NDArray[np.void],
) -> None:
    """Complete a row of telemetry, keep the controls, and add the row to a tally (1,)."""
    row[_COMMAND], row[_COMMAND + 1] = steering_angle, speed
    ctrl_row[:] = ctrl
    tally_tick(tally, 0, row, slip)
