"""Telemetry: one row a tick for each car, and the running statistics of a drive."""

from __future__ import annotations

import math
from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from ..compiled.kernels import kernel
from ..errors import SettingsError, accepted_names, nearest, with_unit
from ..messages import DriveCommand, FloatArray
from ..vehicle.car import WHEELS
from ..vehicle.motion import CarArray, body_velocity, ground_speed, planar_pose, sideslip_angle
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
    *(f"friction_utilisation_{wheel}" for wheel in WHEELS),
    "sliding_steps", "steps",
    "vx_m_s", "vy_m_s", "sideslip_rad", "ax_m_s2", "ay_m_s2",
    *(f"load_{wheel}_N" for wheel in WHEELS),
    *(f"fx_{wheel}_N" for wheel in WHEELS),
    *(f"fy_{wheel}_N" for wheel in WHEELS),
    *(f"slip_angle_{wheel}_rad" for wheel in WHEELS),
    *(f"slip_ratio_{wheel}" for wheel in WHEELS),
)  # fmt: skip
"""Columns of the telemetry. A row is one tick: the state at its start and the planner's command; then, while it was
held, each tire's greatest sliding speed and friction utilisation (NaN: off the ground all the while, or a sliding speed
without a peak), and in how many of the physics steps any tire slid; then the car's motion, x forward and y to the left
of its heading, level.

`vx_m_s` and `vy_m_s` are the velocity of base_link, at the rear axle, at the start of the tick. `sideslip_rad` is the
angle from the heading to the velocity of the centre of gravity then, left positive, NaN below 0.1 m/s. `ax_m_s2` and
`ay_m_s2` are the mean acceleration of the centre of gravity over the tick, without gravity: the change of its velocity,
in the axes of the heading half-way.

The last columns are of the first physics step, at the state of the row: each tire's load, its force along its wheel's
heading and to the left of it, its slip angle and its slip ratio, as in TireSlip."""


def column_index(name: str) -> int:
    """Return the index of a column, whose unit may be left out, as in "speed"; SettingsError: there is none."""
    found = with_unit(name, TELEMETRY) if isinstance(name, str) else None
    if found is None:
        raise SettingsError(f"the telemetry has no column {name!r}; {accepted_names(name, TELEMETRY)}")
    return TELEMETRY.index(found)


def column_meant(name: str, other: str | None) -> str | None:
    """Return the attribute probably meant: `other`, the most similar one, or rather a column without its unit."""
    if other is not None and name in other:
        return other
    found = with_unit(name, TELEMETRY) or (nearest(name, TELEMETRY) if other is None else None)
    return other if found is None else f"column({found!r})"


ALWAYS_NUMBERS = tuple(
    name
    for name in TELEMETRY[: TELEMETRY.index("steps") + 1]
    if not name.startswith(("slide_", "friction_utilisation_"))
)
"""Columns that are never NaN."""


STATISTICS = np.dtype(
    [
        ("ticks", np.int64),
        ("steps", np.int64),
        ("sliding_steps", np.int64),
        ("max_slide", np.float64),  # [m/s]; this and the next are NaN of tires without a peak
        ("max_lateral_slide", np.float64),  # [m/s]
        ("speed_sum", np.float64),  # [m/s] of all ticks, without sign
        ("max_speed", np.float64),  # [m/s]
        ("touches", np.int64),  # of other cars, each at least half a second after the last of the same car
    ]
)
"""Running statistics of a drive, one row a car."""


class StatisticsFigures(TypedDict):
    """The figures of the running statistics for the summary."""

    max_slide_m_s: float
    max_lateral_slide_m_s: float
    slide_time_fraction: float
    mean_speed_m_s: float
    max_speed_m_s: float


def statistics_figures(row: Any) -> StatisticsFigures:
    """Return the summary's figures of a row of STATISTICS; how tires without a peak slid is NaN."""
    ticks, steps = int(row["ticks"]), int(row["steps"])
    slid = int(row["sliding_steps"]) / steps if steps else 0.0
    return {
        "max_slide_m_s": float(row["max_slide"]),
        "max_lateral_slide_m_s": float(row["max_lateral_slide"]),
        "slide_time_fraction": math.nan if math.isnan(row["max_slide"]) else slid,
        "mean_speed_m_s": float(row["speed_sum"]) / ticks if ticks else 0.0,
        "max_speed_m_s": float(row["max_speed"]),
    }


_SLIDE = TELEMETRY.index(f"slide_{WHEELS[0]}_m_s")
_SLIDING_STEPS = TELEMETRY.index("sliding_steps")
_LOAD = TELEMETRY.index(f"load_{WHEELS[0]}_N")
_SPEED = TELEMETRY.index("speed_m_s")
_HEADING, _YAW_RATE = TELEMETRY.index("heading_rad"), TELEMETRY.index("yaw_rate_rad_s")
_VX, _AX = TELEMETRY.index("vx_m_s"), TELEMETRY.index("ax_m_s2")
COMMAND = TELEMETRY.index("command_steering_rad")
"""Column of the commanded steering angle; the commanded speed is the one behind it."""

GREATEST_COMMAND = 1000.0
"""[rad], [m/s] Greatest size of a command in the telemetry, far beyond the limits of any car: more is kept as this, so
that whatever reads a run can work with it."""


def recorded_command(command: DriveCommand) -> DriveCommand:
    """Return a command as the telemetry keeps it."""
    angle, speed = (min(max(v, -GREATEST_COMMAND), GREATEST_COMMAND) for v in (command.steering_angle, command.speed))
    return DriveCommand(steering_angle=angle, speed=speed)


@kernel
def begin_row(
    time: float, qpos: FloatArray, qvel: FloatArray, car: CarArray, timers: NDArray[np.void], i: int, row: FloatArray
) -> None:
    """Write the state at the start of a tick, at `time` [s], with timers (n,) of LAP_TIMER, to its `row`."""
    row[0] = time
    row[1], row[2], row[3] = timers[i].laps_completed + 1, timers[i].progress, timers[i].offset
    row[4], row[5], row[6] = planar_pose(qpos, car)
    row[7] = ground_speed(qpos, qvel, car)
    row[8], row[9] = qvel[car[0].free_dof + 5], qpos[car[0].steering_qpos]
    vx, vy = body_velocity(qpos, qvel, car)
    row[_VX], row[_VX + 1], row[_VX + 2] = vx, vy, sideslip_angle(vx, vy, row[8], car)


@kernel
def end_motion(time: float, qpos: FloatArray, qvel: FloatArray, car: CarArray, row: FloatArray) -> None:
    """Write the mean acceleration over a tick, which ends at `time` [s], to its `row` (len(TELEMETRY),)."""
    lever, before = car[0].rear_axle_distance, row[_HEADING]
    vx, vy = body_velocity(qpos, qvel, car)
    _, _, heading = planar_pose(qpos, car)
    half = 0.5 * ((heading - before + math.pi) % (2.0 * math.pi) - math.pi)  # of the turn in the tick
    ahead, left = math.cos(half), math.sin(half)
    # both velocities of the centre of gravity in the axes half-way: the one turns back by half, the other on
    x0, y0 = row[_VX], row[_VX + 1] + row[_YAW_RATE] * lever
    x1, y1 = vx, vy + qvel[car[0].free_dof + 5] * lever
    lasted = time - row[0]
    if not lasted > 0.0:  # MuJoCo has reset an unstable state by itself
        row[_AX] = row[_AX + 1] = math.nan
        return
    row[_AX] = ((x1 - x0) * ahead - (y1 + y0) * left) / lasted
    row[_AX + 1] = ((y1 - y0) * ahead + (x1 + x0) * left) / lasted


@kernel
def end_row(row: FloatArray, slip: FloatArray) -> None:
    """Write to a tick's `row` (len(TELEMETRY),) what the tires did: `slip` (QUANTITIES, steps, 4) of `measure_slip`."""
    row[_SLIDING_STEPS] = greatest_slip(slip, row[_SLIDE : _SLIDE + 8])
    row[_SLIDING_STEPS + 1] = slip.shape[1]
    for tire in range(4):
        row[_LOAD + tire] = slip[NORMAL_FORCE, 0, tire]
        row[_LOAD + 4 + tire], row[_LOAD + 8 + tire] = slip[FORCE_X, 0, tire], slip[FORCE_Y, 0, tire]
        row[_LOAD + 12 + tire], row[_LOAD + 16 + tire] = slip[SLIP_ANGLE, 0, tire], slip[SLIP_RATIO, 0, tire]


@kernel
def add_row(statistics: NDArray[np.void], i: int, row: FloatArray, slip: FloatArray) -> None:
    """Add a tick's `row` to the running statistics (n,) of STATISTICS at `i`; arguments as in `end_row`."""
    so_far = statistics[i]
    so_far.ticks += 1
    so_far.steps += slip.shape[1]
    so_far.sliding_steps += int(row[_SLIDING_STEPS])
    for tire in range(4):
        if row[_SLIDE + tire] > so_far.max_slide:
            so_far.max_slide = row[_SLIDE + tire]
        elif math.isnan(row[_SLIDE + tire]) and slip[NORMAL_FORCE, 0, tire] > 0.0:  # on the ground, without a peak
            so_far.max_slide = so_far.max_lateral_slide = math.nan
    so_far.max_lateral_slide = greatest_lateral_speed(slip, so_far.max_lateral_slide)
    so_far.speed_sum += abs(row[_SPEED])
    so_far.max_speed = max(so_far.max_speed, abs(row[_SPEED]))
