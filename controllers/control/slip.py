"""Slip angles: how a car is steered whose tires need them, and where it goes.

Planners think of arcs: of the steering angle d of a kinematic car, whose rear axle runs on a circle of curvature
k = tan(d) / b. A tire of rubber has a lateral force only at a slip angle. In a steady curve each axle has the force
over its load a / g, a = v^2 k, and so the slip angle of this force. To run on the arc of d the car is steered by

    d + front slip angle - rear slip angle

and its rear axle moves outwards of its heading by the rear slip angle (T. Gillespie, Fundamentals of Vehicle Dynamics,
1992, chapter 6). With these two a planner for the kinematic car drives a real one:

1. The arc's angle is made the steering angle of the command, and the measured one the angle of the arc (`steered`,
   `arc_angle`). The lead is never more than what any harder cornering needs: an axle behind that needs more than the
   one in front is left to the planner's feedback.
2. An arc is no tighter than the lock leaves, and no faster than the critical speed, at which an oversteering car turns
   in by itself: b + v^2 / g d(lead)/d(a / g) = 0 (`tightest_arc`, `fastest_on`).
3. Scan and yaw rate are taken in the velocity frame: its x axis is the direction in which the rear axle moves, not the
   heading (`to_velocity_frame`).
4. The path follows the steering over a way of its own (`path_lag`), in all that is simulated.
5. A car that brakes and has no path to follow is steered against turning in by itself (`held_arc`).

A planner knows of an axle what can be identified on a real car: cornering stiffness, peak, and the peak's slip angle.
Through these leads one Magic Formula D sin(C atan(B s)), which read backwards is s = tan(asin(u) / C) / B at the share
u of the peak, or a straight line up to the peak, as bristles have it. Tires without such parameters need no slip
angles, and all this is left out, to the bit.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import ODOMETRY, CarParameters, FloatArray

from ..perception.scan_geometry import SCAN_GEOMETRY, period_of
from .planner_settings import Record
from .steering import late_by, saturate

_MOST_USE = 0.97  # of an axle's peak: a greater force has the slip angle of this
_LAG_USE = 0.9  # of that: where the lag is taken
_LEAST_USE = 0.2  # of that, which the critical speed leaves: what a planner steers for is never nothing
_LOCK_USE = 0.5  # of the grip on an arc of full lock, below whose speed the lock slows nothing
_SLOW = 0.5  # [m/s] below it the path is the arc's
_HALVINGS = 24
_SPEEDS = 128  # of the tables
_FORCES = 64
_SHARPEST = 10.0  # [-] greatest C

_AXLE = np.dtype([("B", np.float64), ("C", np.float64), ("D", np.float64)])  # C is 0 where linear, and B the stiffness

SLIP = np.dtype(
    [
        ("needs_slip_angle", np.bool_),  # the tires need slip angles; the rest is zero where not
        ("front", _AXLE),
        ("rear", _AXLE),
        ("rear_stiffness", np.float64),  # [1/rad]
        ("most", np.float64),  # [-] greatest lateral acceleration over g that is looked at
        ("lead", np.float64, (_FORCES,)),  # [rad] by which to steer more than the arc's angle, from 0 to `most`
        ("steady", np.float64, (_FORCES,)),  # [rad] by which in a steady curve, from the lead on
        ("top_speed", np.float64),  # [m/s] last of the speeds of `tightest`
        ("tightest", np.float64, (_SPEEDS,)),  # [rad] greatest angle of an arc, by speed
        ("least_speed", np.float64),  # [m/s] to which the lock slows the car at most
        ("lag", np.float64),  # [s^2/m] of the path's way
        ("relaxation_length", np.float64),  # [m]
    ]
)
"""Type of the row that the kernels here read of a car."""

VELOCITY_FRAME = np.dtype(
    [
        ("angle", np.float64),  # [rad] from the heading to where the rear axle moves, positive to the left
        ("geometry", SCAN_GEOMETRY),  # in the velocity frame
        ("odometry", ODOMETRY),  # with the frame's own yaw rate, and the steering angle of the arc
    ]
)
"""Type of what `to_velocity_frame` keeps from tick to tick; zero at the beginning."""


def slip_row(car: CarParameters, lateral: float) -> NDArray[np.void]:
    """Return a row of type SLIP, shape (1,), of a car that corners with `lateral` [m/s^2] at most."""
    row = np.zeros(1, SLIP)
    slip = row[0]
    stiffness = min(car.front_cornering_stiffness, car.rear_cornering_stiffness)
    slip["needs_slip_angle"] = math.isfinite(stiffness)
    if not slip["needs_slip_angle"]:
        return row
    slip["front"] = _formula(car.front_cornering_stiffness, car.front_peak, car.front_peak_slip)
    slip["rear"] = _formula(car.rear_cornering_stiffness, car.rear_peak, car.rear_peak_slip)
    slip["rear_stiffness"] = car.rear_cornering_stiffness
    slip["relaxation_length"] = max(car.relaxation_length, 1e-3)  # a car that stands divides by it
    slip["most"] = most = _MOST_USE * min(car.front_peak, car.rear_peak)
    used = _LAG_USE * most
    slip["lag"] = max(slip_angle(slip[axle], used) for axle in ("front", "rear")) / (used * car.gravity)
    slip["least_speed"] = math.sqrt(_LOCK_USE * lateral * car.wheelbase / math.tan(car.max_steering_angle))
    forces = np.linspace(0.0, most, _FORCES)
    needed = np.array([slip_angle(slip["front"], u) - slip_angle(slip["rear"], u) for u in forces.tolist()])
    slip["lead"] = np.maximum(np.minimum.accumulate(needed[::-1])[::-1], 0.0)
    slip["steady"] = np.maximum(needed, slip["lead"])
    gradient = np.minimum.accumulate(np.gradient(needed, forces))
    slip["top_speed"] = car.max_speed
    for index, speed in enumerate(np.linspace(0.0, car.max_speed, _SPEEDS).tolist()):
        stable = forces[gradient >= -car.wheelbase * car.gravity / max(speed, 1e-3) ** 2]
        force = max(stable.max(initial=0.0), _LEAST_USE * most)
        lock, wheelbase, gravity = car.max_steering_angle, car.wheelbase, car.gravity
        slip["tightest"][index] = _arc_within(slip, lock, speed, lock, wheelbase, gravity, force)
    return row


def _formula(stiffness: float, peak: float, peak_slip: float) -> tuple[float, float, float]:
    """Return B, C and D of an axle; C is 0 of one whose force grows in proportion, up to a peak or without one."""
    if not math.isfinite(peak_slip) or stiffness * peak_slip < 1.001 * peak:
        return stiffness, 0.0, peak
    ratio = stiffness * peak_slip / peak  # C tan(pi / (2 C)), which falls as C grows
    low, high = 1.0, _SHARPEST
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if middle * math.tan(0.5 * math.pi / middle) > ratio else (low, middle)
    return stiffness / (high * peak), high, peak


@kernel
def slip_angle(axle: Record, force: float) -> float:
    """Return the slip angle [rad] at which an axle has a lateral force over its load, both without sign."""
    if axle.C == 0.0:
        return float(force / axle.B)
    return float(math.tan(math.asin(min(force / axle.D, _MOST_USE)) / axle.C) / axle.B)


@kernel
def _lead(slip: Record, force: float) -> float:
    """Return by how much more than the arc's angle the car is steered [rad], at a lateral acceleration over g."""
    return _read(slip.lead, force / slip.most)


@kernel
def _read(table: FloatArray, share: float) -> float:
    """Return a value of a table over the lateral acceleration, at a share of the greatest."""
    position = min(share, 1.0) * (_FORCES - 1)
    at = min(int(position), _FORCES - 2)
    return float(table[at] + (position - at) * (table[at + 1] - table[at]))


@kernel
def steered(slip: Record, car: Record, angle: float, speed: float) -> float:
    """Return the steering angle [rad] with which a car at `speed` [m/s] runs on the arc of `angle` [rad]."""
    force = speed * speed * math.tan(abs(angle)) / (car.wheelbase * car.gravity)
    return saturate(angle + math.copysign(_lead(slip, force), angle), car.max_steering_angle)


@kernel
def steady_arc(slip: Record, car: Record, angle: float, speed: float) -> float:
    """Return the angle [rad] to command in place of that of an arc, so that `steered` steers for a steady curve.

    That is the look-up of the model- and acceleration-based pursuit. A car whose rear axle needs more than the one in
    front would be steered less than the arc's angle, and by any error turn in by itself: it gets the arc's angle.
    """
    share = speed * speed * math.tan(abs(angle)) / (car.wheelbase * car.gravity * slip.most)
    return angle + math.copysign(_read(slip.steady, share) - _read(slip.lead, share), angle)


@kernel
def arc_angle(slip: Record, car: Record, steering_angle: float, speed: float) -> float:
    """Return the angle [rad] of the arc on which a car at `speed` [m/s] runs in the end with a steering angle [rad]."""
    if steering_angle == 0.0 or not math.isfinite(steering_angle + speed):
        return steering_angle
    size = _arc_within(
        slip, abs(steering_angle), speed, car.max_steering_angle, car.wheelbase, car.gravity, slip.most
    )  # fmt: skip
    return math.copysign(size, steering_angle)


@kernel
def _arc_within(
    slip: Record, steering_angle: float, speed: float, lock: float, wheelbase: float, gravity: float, most: float
) -> float:
    """Return the angle of an arc as `arc_angle`, without sign and up to a lateral acceleration over g."""
    low, high = 0.0, min(lock, math.atan2(wheelbase * gravity * most, speed * speed))
    over = speed * speed / (wheelbase * gravity)
    if high + _lead(slip, over * math.tan(high)) <= steering_angle:
        return high
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if middle + _lead(slip, over * math.tan(middle)) <= steering_angle:
            low = middle
        else:
            high = middle
    return low


@kernel
def tightest_arc(slip: Record, speed: float) -> float:
    """Return the greatest angle [rad] of an arc that lock and critical speed leave at `speed` [m/s]."""
    position = min(abs(speed) / slip.top_speed, 1.0) * (_SPEEDS - 1)
    at = min(int(position), _SPEEDS - 2)
    return float(slip.tightest[at] + (position - at) * (slip.tightest[at + 1] - slip.tightest[at]))


@kernel
def fastest_on(slip: Record, angle: float) -> float:
    """Return the greatest speed [m/s] at which lock and critical speed leave the arc of `angle` [rad]."""
    size = abs(angle)
    for at in range(_SPEEDS - 1, 0, -1):
        before, here = slip.tightest[at - 1], slip.tightest[at]
        if before >= size:
            if here >= size:
                return math.inf if at == _SPEEDS - 1 else float(slip.top_speed * at / (_SPEEDS - 1))
            speed = slip.top_speed * (at - 1 + (before - size) / (before - here)) / (_SPEEDS - 1)
            return float(max(speed, slip.least_speed))
    return float(slip.least_speed)


@kernel
def held_arc(slip: Record, car: Record, angle: float, curvature: float) -> float:
    """Return the angle [rad] of the arc to command so that the car keeps its path; `angle` of tires that are not soft.

    Braking takes load off the rear axle, whose slip angle then grows: the car turns in more than its wheels say, by
    itself, and the harder it turns the more. A planner that follows a path steers against that. Where there is none,
    the wheels are turned out by as much as the path of the car is tighter than their arc.

    Args:
      slip: of type SLIP.
      car: of type CAR.
      angle: of the arc of the wheels [rad].
      curvature: of the path that the car is on [1/m].
    """
    if not slip.needs_slip_angle:
        return angle
    more = curvature - math.tan(angle) / car.wheelbase
    if not more * curvature > 0.0:
        return angle
    return math.atan(math.tan(angle) - car.wheelbase * more)


@kernel
def path_lag(slip: Record, speed: float) -> float:
    """Return the way [m] over which the path of a car follows its steering: v^2 s / a for a slip angle s at a."""
    return float(slip.lag * speed * speed + slip.relaxation_length)


@kernel
def late_on_path(slip: Record, car: Record, speed: float) -> float:
    """Return by how much later the path of a car follows its commands than the F1TENTH car's [s], see `path_lag`."""
    if not slip.needs_slip_angle:
        return late_by(car)
    return float(late_by(car) + path_lag(slip, speed) / max(speed, _SLOW))


@kernel
def velocity_angle(slip: Record, car: Record, speed: float, yaw_rate: float) -> float:
    """Return the direction in which the rear axle moves, from the car's heading [rad]; 0 of tires that are not soft."""
    if not (slip.needs_slip_angle and speed > 0.0 and math.isfinite(speed * yaw_rate)):
        return 0.0
    force = min(abs(speed * yaw_rate) / car.gravity, slip.most)
    return float(-math.copysign(force / slip.rear_stiffness, yaw_rate))


@kernel
def to_velocity_frame(slip: Record, car: Record, geometry: Record, odometry: Record, frame: Record) -> float:
    """Write a scan's geometry and a motion in the velocity frame; return the curvature [1/m] of the car's path.

    Args:
      slip: of type SLIP.
      car: of type CAR.
      geometry: of type SCAN_GEOMETRY.
      odometry: of type ODOMETRY.
      frame: of type VELOCITY_FRAME, written to.
    """
    speed, yaw_rate, seen, last = odometry.speed, odometry.angular_velocity[2], frame.odometry, frame.angle
    frame.angle = velocity_angle(slip, car, speed, yaw_rate)
    frame.geometry.angle_min, frame.geometry.angle_increment = (
        geometry.angle_min - frame.angle,
        geometry.angle_increment,
    )
    frame.geometry.range_max, frame.geometry.scan_time = geometry.range_max, geometry.scan_time
    seen.stamp, seen.speed = odometry.stamp, speed
    seen.steering_angle = arc_angle(slip, car, odometry.steering_angle, speed)
    seen.angular_velocity[:], seen.linear_acceleration[:] = odometry.angular_velocity, odometry.linear_acceleration
    seen.angular_velocity[2] += (frame.angle - last) / period_of(geometry)
    seen.wheel_speeds[:], seen.pose[:] = odometry.wheel_speeds, odometry.pose
    if speed > _SLOW:
        return float(yaw_rate / speed)
    return float(math.tan(seen.steering_angle) / car.wheelbase)
