"""The columns that a report draws, one value a tick: the telemetry's, and others computed from them."""

from __future__ import annotations

import numpy as np

from ...messages import CarParameters, FloatArray
from ...vehicle.car import WHEELS
from .recorded_run import RecordedRun

SPEED_FAR_ABOVE = 99.0
"""[m/s] Drawn for a limit that is higher, as that of a car that does not steer."""


def tick_columns(run: RecordedRun) -> dict[str, FloatArray]:
    """Return the columns of a report's plots, each (ticks,), by name.

    Besides those of the telemetry, with its names: `distance_m` that the rear axle drove, `limit_speed_m_s` of the law,
    `friction_use` and `slide_m_s` of the tire with the greatest, `acceleration_ahead_m_s2`, `acceleration_left_m_s2`.
    """
    own = (
        "time_s", "lap", "progress_m", "offset_m", "x_m", "y_m", "heading_rad", "speed_m_s", "yaw_rate_rad_s",
        "steering_angle_rad", "command_steering_rad", "command_speed_m_s",
        *(f"slide_{wheel}_m_s" for wheel in WHEELS), *(f"friction_use_{wheel}" for wheel in WHEELS),
        "sliding_steps", "steps",
    )  # fmt: skip
    columns = {name: run.column(name) for name in own}
    steps = np.hypot(np.diff(columns["x_m"]), np.diff(columns["y_m"]))
    columns["distance_m"] = np.concatenate(([0.0], np.cumsum(steps)))[: len(columns["x_m"])]
    columns["limit_speed_m_s"] = limit_speed(columns["steering_angle_rad"], run.car, run.mu)
    for name, form in (("friction_use", "friction_use_{}"), ("slide_m_s", "slide_{}_m_s")):
        tires = np.stack([columns[form.format(wheel)] for wheel in WHEELS])
        columns[name] = np.where(np.isnan(tires), 0.0, tires).max(axis=0)  # NaN: off the ground, and so no force
    ahead, left = accelerations(columns["time_s"], columns["speed_m_s"], columns["yaw_rate_rad_s"])
    columns["acceleration_ahead_m_s2"], columns["acceleration_left_m_s2"] = ahead, left
    return columns


def limit_speed(steering_angle: FloatArray, car: CarParameters, mu: float) -> FloatArray:
    """Return the law's greatest speed at a steering angle, sqrt(g mu b / tan|steering|), at most SPEED_FAR_ABOVE.

    Args:
      steering_angle: (n,) [rad].
      car: its wheelbase b [m] and gravity g [m/s^2].
      mu: friction coefficient of the tires [-].

    Returns:
      (n,) [m/s].
    """
    grip = car.gravity * mu * car.wheelbase
    least = grip / SPEED_FAR_ABOVE**2  # of the tangent, for which the limit is just that
    limit: FloatArray = np.sqrt(grip / np.maximum(np.tan(np.abs(steering_angle)), least))
    return limit


def accelerations(time: FloatArray, speed: FloatArray, yaw_rate: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the acceleration of the rear axle ahead, dv/dt over the tick, and to the left, v times the yaw rate.

    They leave out the lateral slip of the rear axle. In the last tick, whose end the telemetry does not have, dv/dt is
    that of the tick before.

    Args:
      time: of the starts of the ticks (n,) [s].
      speed: ahead (n,) [m/s].
      yaw_rate: (n,) [rad/s].

    Returns:
      ahead (n,) and left (n,) [m/s^2].
    """
    if len(time) < 2:
        return np.zeros(len(time)), speed * yaw_rate
    ahead = np.diff(speed) / np.diff(time)
    return np.append(ahead, ahead[-1]), speed * yaw_rate
