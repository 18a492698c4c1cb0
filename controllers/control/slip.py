"""Slip angles: how a car is steered whose tires need them, and where it goes.

Planners think of arcs: of the steering angle d of a kinematic car, whose rear axle runs on a circle of curvature
k = tan(d) / b. A tire of rubber has a lateral force only at a slip angle. In a steady curve each axle has the force
over its load a / g, a = v^2 k, and so the slip angle of this force. To run on the arc of d the car is steered by

    d + front slip angle - rear slip angle

and its rear axle moves outwards of its heading by the rear slip angle (T. Gillespie, Fundamentals of Vehicle Dynamics,
1992, chapter 6). With these two a planner for the kinematic car drives a real one:

1. The arc's angle is made the steering angle of the command, and the measured one the angle of the arc (`steered`,
   `arc_angle`). The lead is never negative: an axle behind that needs more than the one in front is left to the
   planner's feedback.
2. An arc is no tighter than the lock leaves, and no faster than the critical speed, at which an oversteering car turns
   in by itself: b + v^2 / g d(lead)/d(a / g) = 0 (`tightest_arc`, `fastest_on`). Tighter ones would share their
   steering angles with wider ones.
3. Scan and yaw rate are taken in the velocity frame: its x axis is the direction in which the rear axle moves, not the
   heading (`to_velocity_frame`). Its speed is that over the ground: wheels that brake roll slower (`ground_speed`).
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
_MOST_RATIO = 0.5  # [-] of slip along the heading
_SMALL = 0.01  # share of the grip over which a gradient is taken
_SLOW = 0.5  # [m/s] below it the path is the arc's, and the ground's speed that of the wheels
_HALVINGS = 24
_SPEEDS = 128  # of the tables
_FORCES = 64
_SHARPEST = 10.0  # [-] greatest C
_USES, _STOPS = 17, 33  # of the table of braking

_AXLE = np.dtype([("B", np.float64), ("C", np.float64), ("D", np.float64)])  # C is 0 where linear, and B the stiffness

SLIP = np.dtype(
    [
        ("needs_slip_angle", np.bool_),  # the tires need slip angles; the rest is zero where not
        ("front", _AXLE),
        ("rear", _AXLE),
        ("most", np.float64),  # [-] greatest lateral acceleration over g that is looked at
        ("lead", np.float64, (_FORCES,)),  # [rad] by which to steer more than the arc's angle, from 0 to `most`
        ("top_speed", np.float64),  # [m/s] last of the speeds of `tightest`
        ("tightest", np.float64, (_SPEEDS,)),  # [rad] greatest angle of an arc, by speed
        ("stable", np.float64, (_USES, _STOPS)),  # [-] see `stable_braking`, by share of the grip and by speed
        ("least_speed", np.float64),  # [m/s] to which the lock slows the car at most
        ("wound_up", np.float64),  # [-] the front axle's part of the slip of a wound-up shaft; 0: there is none
        ("lag", np.float64),  # [s^2/m] of the path's way
        ("relaxation_length", np.float64),  # [m]
    ]
)
"""Type of the row that the kernels here read of a car."""

VELOCITY_FRAME = np.dtype(
    [
        ("angle", np.float64),  # [rad] from the heading to where the rear axle moves, positive to the left
        ("excess", np.float64),  # [m/s] by which the wheels are faster than the ground
        ("geometry", SCAN_GEOMETRY),  # in the velocity frame
        ("odometry", ODOMETRY),  # with the frame's own yaw rate, and the steering angle of the arc
    ]
)
"""Type of what `to_velocity_frame` keeps from tick to tick; zero at the beginning."""


def slip_row(car: CarParameters, mu: float, lateral: float) -> NDArray[np.void]:
    """Return a row of type SLIP, shape (1,), of a car that corners with `lateral` [m/s^2] at most.

    On a floor of another friction `mu` than the tires' least peak, their curves are scaled by it, as the floor's are.
    """
    row = np.zeros(1, SLIP)
    slip = row[0]
    stiffness = min(car.front_cornering_stiffness, car.rear_cornering_stiffness)
    slip["needs_slip_angle"] = math.isfinite(stiffness)
    if not slip["needs_slip_angle"]:
        return row
    share = mu / min(car.front_peak, car.rear_peak)
    slip["front"] = _formula(share * car.front_cornering_stiffness, share * car.front_peak, car.front_peak_slip)
    slip["rear"] = _formula(share * car.rear_cornering_stiffness, share * car.rear_peak, car.rear_peak_slip)
    slip["relaxation_length"] = max(car.relaxation_length, 1e-3)  # a car that stands divides by it
    slip["most"] = most = _MOST_USE * mu
    if car.shaft:  # both axles' forces are as great, against each other
        front = car.front_cornering_stiffness * car.rear_axle_distance
        slip["wound_up"] = 1.0 / (1.0 + front / (car.rear_cornering_stiffness * car.front_axle_distance))
    used = _LAG_USE * most
    slip["lag"] = max(slip_angle(slip[axle], used) for axle in ("front", "rear")) / (used * car.gravity)
    slip["least_speed"] = math.sqrt(_LOCK_USE * lateral * car.wheelbase / math.tan(car.max_steering_angle))
    forces = np.linspace(0.0, most, _FORCES)
    needed = _slip_angles(slip["front"], forces) - _slip_angles(slip["rear"], forces)
    slip["lead"] = np.maximum(needed, 0.0)
    gradient = np.minimum.accumulate(np.gradient(needed, forces))
    slip["top_speed"] = car.max_speed
    speeds = np.linspace(0.0, car.max_speed, _SPEEDS)
    stable = gradient >= -car.wheelbase * car.gravity / np.maximum(speeds, 1e-3)[:, np.newaxis] ** 2
    most_stable = np.maximum(np.where(stable, forces, 0.0).max(axis=1), _LEAST_USE * most)
    _find_tightest(slip, speeds, most_stable, car.max_steering_angle, car.wheelbase, car.gravity)
    slip["stable"] = _stable(slip, car, mu)
    return row


def _stable(slip: np.void, car: CarParameters, mu: float) -> FloatArray:
    """Return the table that `stable_braking` reads.

    At a lateral acceleration u and a braking x, both over g, an axle with the share l of its load at rest needs the
    force hypot(u / l, x) of it, and has its slip in the direction of this force. The car is stable below the critical
    speed, which is that of 2 in the module's text with the lead at this x.
    """
    braking = np.linspace(0.0, _MOST_USE * mu, 64)
    speeds = np.maximum(np.linspace(0.0, car.max_speed, _STOPS), 1e-3)
    height, lateral = car.center_of_gravity_height, np.maximum(np.linspace(0.0, 1.0, _USES), _SMALL) * _MOST_USE * mu
    loads = 1.0 + height / car.rear_axle_distance * braking, 1.0 - height / car.front_axle_distance * braking
    leads, held = [], np.ones((_USES, 64), np.bool_)
    for force in (lateral[:, np.newaxis], (1.0 - _SMALL) * lateral[:, np.newaxis]):
        angles = []
        for axle, load in zip((slip["front"], slip["rear"]), loads, strict=True):
            across = force / np.maximum(load, 1e-3)
            used = np.hypot(across, braking)
            angles.append(across / used * _slip_angles(axle, used))
            held &= used <= _MOST_USE * axle["D"]
        leads.append(angles[0] - angles[1])
    gradient = np.where(held, (leads[0] - leads[1]) / (_SMALL * lateral[:, np.newaxis]), -1e9)
    gradient = np.minimum.accumulate(gradient, axis=1)
    wanted = car.wheelbase * car.gravity / speeds**2
    return np.array([np.interp(wanted, -row, braking) for row in gradient])


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


def _slip_angles(axle: np.void, force: FloatArray) -> FloatArray:
    """Return what `slip_angle` does, of many forces."""
    linear = axle["C"] == 0.0
    reached: FloatArray = force if linear else np.tan(np.arcsin(np.minimum(force / axle["D"], _MOST_USE)) / axle["C"])
    return reached / float(axle["B"])


@kernel
def _lead(slip: Record, force: float) -> float:
    """Return by how much more than the arc's angle the car is steered [rad], at a lateral acceleration over g."""
    position, table = min(force / slip.most, 1.0) * (_FORCES - 1), slip.lead
    at = min(int(position), _FORCES - 2)
    return float(table[at] + (position - at) * (table[at + 1] - table[at]))


@kernel
def _wound_up(slip: Record, angle: float) -> float:
    """Return by how much more than the angle of an arc [rad] a car is steered whose shaft is wound up there.

    The front axle has the longer way, by 1 / cos(d), and a shaft lets it turn no faster than the other one. So the
    front wheels slip along their heading by a part of 1 - cos(d), and their drag pulls sideways by sin(d).
    """
    return float(slip.wound_up * (1.0 - math.cos(angle)) * math.tan(angle))


@kernel
def held_on_arc(slip: Record, car: Record, angle: float, lateral: float, back: bool, brakes: bool, use: float) -> float:
    """Return the acceleration over g at which an inner tire has a share of its peak, as the car is on an arc.

    On the arc of `angle` [rad] a wound-up shaft drags the front axle along, see above: of the slip of driving the rear
    axle has the more, and of that of braking the front one. Load moves to the rear axle, of an acceleration `back` off
    it, and off the inner wheel by the lateral acceleration over g; an open axle pulls alike with both, at a mean slip.
    """
    inner = max(1.0 - 2.0 * car.center_of_gravity_height / car.track_width * lateral, 0.0)
    wound = 1.0 - math.cos(angle) if slip.wound_up > 0.0 else 0.0
    most, of_rear = use * slip.front.D, slip_angle(slip.rear, use * inner * slip.rear.D)
    of_front = of_rear - wound
    if brakes:
        of_front = 0.5 * (slip_angle(slip.front, most) + slip_angle(slip.front, most * inner / (2.0 - inner)))
        of_rear = of_front - wound
    front = _axle_force(slip.front, of_front) * car.rear_axle_distance / car.wheelbase
    rear = _axle_force(slip.rear, of_rear) * car.front_axle_distance / car.wheelbase
    moved = car.center_of_gravity_height * (rear / car.front_axle_distance - front / car.rear_axle_distance)
    return float(max(front + rear, 0.0) / (1.0 + moved if back else 1.0 - moved))


def at_least_peak(slip: np.void) -> tuple[float, float]:
    """Return the forces over load of front and rear axle at one slip ratio, the least that a peak of them has."""
    ratios = (
        axle["D"] / axle["B"] if axle["C"] == 0.0 else math.tan(0.5 * math.pi / axle["C"]) / axle["B"]
        for axle in (slip["front"], slip["rear"])
    )
    ratio = min(ratios)
    return float(_axle_force(slip["front"], ratio)), float(_axle_force(slip["rear"], ratio))


@kernel
def _axle_force(axle: Record, angle: float) -> float:
    """Return the force of an axle over its load at a slip angle [rad], or at a slip ratio: `slip_angle` read back."""
    if axle.C == 0.0:
        return float(axle.B * angle)
    return float(axle.D * math.sin(axle.C * math.atan(axle.B * angle)))


@kernel
def steered(slip: Record, car: Record, angle: float, speed: float) -> float:
    """Return the steering angle [rad] with which a car at `speed` [m/s] runs on the arc of `angle` [rad]."""
    if angle == 0.0 or not math.isfinite(angle + speed):
        return angle
    force = speed * speed * math.tan(abs(angle)) / (car.wheelbase * car.gravity)
    lead = _lead(slip, force) + _wound_up(slip, abs(angle))
    return saturate(angle + math.copysign(lead, angle), car.max_steering_angle)


@kernel
def arc_angle(slip: Record, car: Record, steering_angle: float, speed: float) -> float:
    """Return the angle [rad] of the arc on which a car at `speed` [m/s] runs in the end with a steering angle [rad]."""
    if steering_angle == 0.0 or not math.isfinite(steering_angle + speed):
        return steering_angle
    lock = min(tightest_arc(slip, speed), car.max_steering_angle)
    size = _arc_within(slip, abs(steering_angle), speed, lock, car.wheelbase, car.gravity, slip.most)
    return math.copysign(size, steering_angle)


@kernel
def _arc_within(
    slip: Record, steering_angle: float, speed: float, lock: float, wheelbase: float, gravity: float, most: float
) -> float:
    """Return the angle of an arc as `arc_angle`, without sign and up to a lateral acceleration over g."""
    low, high = 0.0, min(lock, math.atan2(wheelbase * gravity * most, speed * speed))
    over = speed * speed / (wheelbase * gravity)
    if high + _lead(slip, over * math.tan(high)) + _wound_up(slip, high) <= steering_angle:
        return high
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if middle + _lead(slip, over * math.tan(middle)) + _wound_up(slip, middle) <= steering_angle:
            low = middle
        else:
            high = middle
    return low


@kernel
def _find_tightest(
    slip: Record, speeds: FloatArray, forces: FloatArray, lock: float, wheelbase: float, gravity: float
) -> None:
    """Write `tightest`: the arc at the lock, at each speed up to a lateral acceleration over g."""
    for index in range(_SPEEDS):
        slip.tightest[index] = _arc_within(slip, lock, speeds[index], lock, wheelbase, gravity, forces[index])


@kernel
def tightest_arc(slip: Record, speed: float) -> float:
    """Return the greatest angle [rad] of an arc that lock and critical speed leave at `speed` [m/s]."""
    position = min(abs(speed) / slip.top_speed, 1.0) * (_SPEEDS - 1)
    at = min(int(position), _SPEEDS - 2)
    return float(slip.tightest[at] + (position - at) * (slip.tightest[at + 1] - slip.tightest[at]))


@kernel
def lock_arc(slip: Record, car: Record) -> float:
    """Return the angle [rad] of the tightest arc of a slow car: the lock, less what a wound-up shaft takes of it."""
    return float(slip.tightest[0]) if slip.needs_slip_angle else float(car.max_steering_angle)


@kernel
def fastest_on(slip: Record, angle: float, least: float) -> float:
    """Return the greatest speed [m/s] at which lock and critical speed leave the arc of `angle` [rad], or `least`."""
    size = abs(angle)
    for at in range(_SPEEDS - 1, 0, -1):
        before, here = slip.tightest[at - 1], slip.tightest[at]
        if before >= size:
            if here >= size:
                return math.inf if at == _SPEEDS - 1 else float(slip.top_speed * at / (_SPEEDS - 1))
            speed = slip.top_speed * (at - 1 + (before - size) / (before - here)) / (_SPEEDS - 1)
            return float(max(speed, least))
    return float(least)


@kernel
def stable_braking(slip: Record, use: float, speed: float) -> float:
    """Return the braking over g up to which a car that corners with a share of the grip does not turn in by itself.

    Braking takes load off the rear axle, and a part of its force: on tires that are hardly stiffer behind than in front
    a fast car then turns in the more, the more it does. Bilinear in a table; at `speed` [m/s].
    """
    row, column = min(max(use, 0.0), 1.0) * (_USES - 1), min(speed / slip.top_speed, 1.0) * (_STOPS - 1)
    i, j = min(int(row), _USES - 2), min(int(column), _STOPS - 2)
    down, right, table = row - i, column - j, slip.stable
    above = table[i, j] + right * (table[i, j + 1] - table[i, j])
    below = table[i + 1, j] + right * (table[i + 1, j + 1] - table[i + 1, j])
    return float(above + down * (below - above))


@kernel
def held_arc(slip: Record, car: Record, angle: float, curvature: float) -> float:
    """Return the angle [rad] of the arc to command so that the car keeps its path; `angle` of tires that are not soft.

    Braking takes load off the rear axle, whose slip angle then grows: the car turns in more than its wheels say, by
    itself, and the harder it turns the more. A planner that follows a path steers against that. Where there is none,
    the wheels are turned out by as much as the path of the car is tighter than their arc.

    Args:
      slip: of type SLIP.
      car: of type CAR_RECORD.
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
    return float(-math.copysign(slip_angle(slip.rear, force), yaw_rate))


@kernel
def drag(car: Record, speed: float) -> float:
    """Return by how much friction of gears and of rolling slows a car [m/s^2] that drives forward at `speed` [m/s]."""
    return float(car.rolling_resistance + car.rolling_damping * speed) if speed > 0.0 else 0.0


@kernel
def ground_speed(slip: Record, car: Record, wheels: float, angle: float, command: float) -> float:
    """Return how fast a car moves [m/s] whose wheels, by a command of `command` [m/s], roll at `wheels` [m/s].

    The motor's servo pulls with a = (command - wheels) / its time constant, less what rolling takes. For this the
    wheels are faster than the ground by a slip ratio s, or slower: v = wheels / (1 + s). A car that brakes by half of
    its grip on tires of 5 /rad is faster by a tenth than its wheels tell. Tires are taken to be as stiff along as they
    are across. A shaft that is wound up on the arc of `angle` [rad] makes the rear wheels faster. A command of 0: none.
    """
    if slip.wound_up > 0.0:
        wheels /= 1.0 + (1.0 - slip.wound_up) * (1.0 - math.cos(angle))
    if not (abs(wheels) > _SLOW and command != 0.0):
        return wheels
    pull = saturate((command - wheels) / car.speed_time_constant, car.max_acceleration)
    pull = (pull - drag(car, wheels)) / car.gravity
    ratio = 0.5 * (slip_angle(slip.front, abs(pull)) + slip_angle(slip.rear, abs(pull)))
    return wheels / (1.0 + math.copysign(min(ratio, _MOST_RATIO), pull * wheels))


@kernel
def to_velocity_frame(
    slip: Record, car: Record, geometry: Record, odometry: Record, command: float, frame: Record
) -> float:
    """Write a scan's geometry and a motion in the velocity frame; return the curvature [1/m] of the car's path.

    Args:
      slip: of type SLIP.
      car: of type CAR_RECORD.
      geometry: of type SCAN_GEOMETRY.
      odometry: of type ODOMETRY; in the frame its speed is that over the ground.
      command: the last speed that the wheels were to have [m/s], in the odometry's measure.
      frame: of type VELOCITY_FRAME, written to.
    """
    yaw_rate, seen, last = odometry.angular_velocity[2], frame.odometry, frame.angle
    fast = abs(odometry.speed) > _SLOW
    turn = math.atan(car.wheelbase * yaw_rate / odometry.speed) if fast else odometry.steering_angle
    speed = ground_speed(slip, car, odometry.speed, turn, command)
    excess = odometry.speed - speed
    frame.excess = excess if math.isfinite(excess) else 0.0  # what is not finite is not added to a command
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
