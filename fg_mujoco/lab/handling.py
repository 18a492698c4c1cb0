"""Figures of a drive's motion: greatest lateral acceleration, sideslip and yaw rate, and what a manoeuvre is for."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ..errors import SettingsError
from ..messages import CarParameters, FloatArray
from ..racing.resimulation import load_world
from ..racing.result import RaceResult
from ..racing.run_folder import Run
from .manoeuvres import AT_ONCE, Brake, Circle, Manoeuvre, RampSteer, StepSteer, find_manoeuvre

Column = Callable[[str], FloatArray]
"""Returns a column of the telemetry by its name."""

_LEAST_ACCELERATION = 0.5  # [m/s^2] lateral; below it an understeer gradient is a quotient of two small numbers
_STANDING = 0.05  # [m/s] as in native/simulation/termination.cpp


def handling(run: RaceResult | Run) -> dict[str, float]:
    """Return the figures of a drive or a race by name, units in the names; NaN where one cannot be computed.

    All have `duration_s`, `max_lateral_acceleration_m_s2`, `max_sideslip_rad` and `max_yaw_rate_rad_s`, the greatest to
    either side. Manoeuvres add:

      understeer_gradient_rad_s2_m: of circle and ramp_steer: the steering angle beyond that of the driven curvature,
        over the lateral acceleration (ISO 4138), positive where the car understeers.
      yaw_rate_response_time_s: of step_steer: from half of the steering angle to .9 of the last yaw rate (ISO 7401).
      braking_distance_m, braking_time_s, mean_deceleration_m_s2: of brake: from its first command to standstill.

    Raises:
      SettingsError: a run that an older version wrote, without the columns of the car's motion.
      RunFolderError: a run folder whose scene cannot be read.
    """
    column = (run.car if isinstance(run, RaceResult) else run).column
    time = column("time_s")
    figures = {
        "duration_s": float(run.states[-1, 0]),  # mjSTATE_TIME comes first in a state
        "max_lateral_acceleration_m_s2": _greatest(column("ay_m_s2")),
        "max_sideslip_rad": _greatest(column("sideslip_rad")),
        "max_yaw_rate_rad_s": _greatest(column("yaw_rate_rad_s")),
    }
    manoeuvre = _manoeuvre_of(run)
    if manoeuvre is None or not len(time):
        return figures
    if isinstance(manoeuvre, (Circle, RampSteer)):
        world = run.world if isinstance(run, RaceResult) else load_world(run)
        figures["understeer_gradient_rad_s2_m"] = _understeer_gradient(column, manoeuvre, world.car.parameters)
    elif isinstance(manoeuvre, StepSteer):
        figures["yaw_rate_response_time_s"] = _response_time(column, manoeuvre)
    elif isinstance(manoeuvre, Brake):
        figures |= _braking(column, manoeuvre)
    return figures


def _manoeuvre_of(run: RaceResult | Run) -> Manoeuvre | None:
    """Return the manoeuvre that a run was driven by, or None."""
    origin = run.car.controller_origin if isinstance(run, RaceResult) else run.summary.get("controller_origin")
    try:
        return find_manoeuvre(str((origin or {}).get("commands")))
    except SettingsError:  # a planner, or a file of commands
        return None


def _greatest(values: FloatArray) -> float:
    """Return the greatest size of finite values; NaN where there is none."""
    finite = values[np.isfinite(values)]
    return float(np.abs(finite).max()) if len(finite) else math.nan


def _understeer_gradient(column: Column, manoeuvre: Manoeuvre, car: CarParameters) -> float:
    """Return the understeer gradient of the rear axle [rad s^2/m]: of a circle's last half, or the slope of a ramp."""
    speed = np.hypot(column("vx_m_s"), column("vy_m_s"))
    acceleration, time = column("ay_m_s2"), column("time_s")
    with np.errstate(divide="ignore", invalid="ignore"):
        beyond = column("steering_angle_rad") - np.arctan(car.wheelbase * column("yaw_rate_rad_s") / speed)
    greatest = _greatest(acceleration)
    if not greatest >= _LEAST_ACCELERATION:
        return math.nan
    if isinstance(manoeuvre, Circle):
        steady = time > 0.5 * (manoeuvre.begin + float(time[-1]))
        mean = float(acceleration[steady].mean())
        return float(beyond[steady].mean()) / mean if abs(mean) >= _LEAST_ACCELERATION else math.nan
    until = int(np.argmax(np.abs(acceleration) >= 0.5 * greatest))
    chosen = (time >= manoeuvre.begin) & (np.arange(len(time)) <= until) & np.isfinite(beyond)
    if chosen.sum() < 10:
        return math.nan
    return float(np.polyfit(acceleration[chosen], beyond[chosen], 1)[0])


def _response_time(column: Column, manoeuvre: StepSteer) -> float:
    """Return the time from half of the steering angle to .9 of the last yaw rate [s]."""
    time, angle, rate = (column(name) for name in ("time_s", "steering_angle_rad", "yaw_rate_rad_s"))
    steered = _first_time(time, angle / manoeuvre.angle, 0.5)
    last = float(rate[time > time[-1] - 0.25 * manoeuvre.seconds].mean())
    return _first_time(time, rate / last, 0.9) - steered if last else math.nan


def _first_time(time: FloatArray, values: FloatArray, level: float) -> float:
    """Return when values first reach a level, between two ticks by a straight line; NaN: never."""
    after = int(np.argmax(values >= level))
    if after == 0:
        return math.nan
    share = (level - values[after - 1]) / (values[after] - values[after - 1])
    return float(time[after - 1] + share * (time[after] - time[after - 1]))


def _braking(column: Column, manoeuvre: Brake) -> dict[str, float]:
    """Return how the car stopped, from the tick at which the manoeuvre begins."""
    time, speed, x, y = (column(name) for name in ("time_s", "vx_m_s", "x_m", "y_m"))
    begun = int(np.argmax(time >= manoeuvre.begin - AT_ONCE))
    stands = np.flatnonzero(speed[begun:] < _STANDING)
    names = ("braking_distance_m", "braking_time_s", "mean_deceleration_m_s2")
    if not len(stands) or stands[0] == 0:
        return dict.fromkeys(names, math.nan)
    stopped = begun + int(stands[0])
    distance = math.hypot(x[stopped] - x[begun], y[stopped] - y[begun])
    values = (distance, float(time[stopped] - time[begun]), 0.5 * float(speed[begun]) ** 2 / distance)
    return dict(zip(names, values, strict=True))
