"""Telemetry: one row a tick for each car, and the running statistics of a drive; native/simulation/telemetry.cpp."""

from __future__ import annotations

import math
from typing import Any, TypedDict

import numpy as np

from ..errors import SettingsError, accepted_names, nearest, with_unit
from ..messages import DriveCommand
from ..native import core, record
from ..vehicle.car import WHEELS

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


STATISTICS = record(
    "Statistics",
    [
        ("ticks", np.int64),
        ("steps", np.int64),
        ("sliding_steps", np.int64),
        ("max_slide", np.float64),  # [m/s]; this and the next are NaN of tires without a peak
        ("max_lateral_slide", np.float64),  # [m/s]
        ("speed_sum", np.float64),  # [m/s] of all ticks, without sign
        ("max_speed", np.float64),  # [m/s]
        ("touches", np.int64),  # of other cars, each at least half a second after the last of the same car
    ],
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


COMMAND = TELEMETRY.index("command_steering_rad")
"""Column of the commanded steering angle; the commanded speed is the one behind it."""

GREATEST_COMMAND = 1000.0
"""[rad], [m/s] Greatest size of a command in the telemetry, far beyond the limits of any car: more is kept as this, so
that whatever reads a run can work with it."""


def recorded_command(command: DriveCommand) -> DriveCommand:
    """Return a command as the telemetry keeps it."""
    angle, speed = (min(max(v, -GREATEST_COMMAND), GREATEST_COMMAND) for v in (command.steering_angle, command.speed))
    return DriveCommand(steering_angle=angle, speed=speed)


end_row, add_row = core.end_row, core.add_row
"""End a tick's row (len(TELEMETRY),) with what the tires did, and add it to a row of STATISTICS; see _native.pyi."""
