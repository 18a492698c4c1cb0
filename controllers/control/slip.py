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
6. A yaw rate that equals v tan(d) / b of the measured speed and steering angle, up to rounding, was computed from
   them, as the odometry of a VESC is. It is replaced by that of the arc on which the car runs (`arc_angle`).

A planner knows of an axle what can be identified on a real car: cornering stiffness, peak, and the peak's slip angle.
Through these leads one Magic Formula D sin(C atan(B s)), which read backwards is s = tan(asin(u) / C) / B at the share
u of the peak, or a straight line up to the peak, as bristles have it. Tires without such parameters need no slip
angles, and all this is left out, to the bit.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fg_mujoco import portable
from fg_mujoco.messages import ODOMETRY, CarParameters, FloatArray
from fg_mujoco.native import core, record

from ..perception.scan_geometry import SCAN_GEOMETRY

_MOST_USE = 0.97  # of an axle's peak: a greater force has the slip angle of this
_LAG_USE = 0.9  # of that: where the lag is taken
_LEAST_USE = 0.2  # of that, which the critical speed leaves: what a planner steers for is never nothing
_LOCK_USE = 0.5  # of the grip on an arc of full lock, below whose speed the lock slows nothing
_SMALL = 0.01  # share of the grip over which a gradient is taken
_HALVINGS = 24
_SPEEDS = 128  # of the tables
_FORCES = 64
_SHARPEST = 10.0  # [-] greatest C
_USES, _STOPS = 17, 33  # of the table of braking

# C is 0 where linear, and B the stiffness
_AXLE = record("Axle", [("B", np.float64), ("C", np.float64), ("D", np.float64)])

SLIP = record(
    "Slip",
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
    ],
)
"""Type of a row of a car."""

VELOCITY_FRAME = record(
    "VelocityFrame",
    [
        ("angle", np.float64),  # [rad] from the heading to where the rear axle moves, positive to the left
        ("excess", np.float64),  # [m/s] by which the wheels are faster than the ground
        ("geometry", SCAN_GEOMETRY),  # in the velocity frame
        ("odometry", ODOMETRY),  # with the frame's own yaw rate, and the steering angle of the arc
    ],
)
"""Type of what is kept of the velocity frame from tick to tick; zero at the beginning."""


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
    slip["lag"] = max(core.slip_angle(slip[axle], used) for axle in ("front", "rear")) / (used * car.gravity)
    slip["least_speed"] = math.sqrt(_LOCK_USE * lateral * car.wheelbase / math.tan(car.max_steering_angle))
    forces = np.linspace(0.0, most, _FORCES)
    needed = _slip_angles(slip["front"], forces) - _slip_angles(slip["rear"], forces)
    slip["lead"] = np.maximum(needed, 0.0)
    gradient = np.minimum.accumulate(np.gradient(needed, forces))
    slip["top_speed"] = car.max_speed
    speeds = np.linspace(0.0, car.max_speed, _SPEEDS)
    stable = gradient >= -car.wheelbase * car.gravity / np.maximum(speeds, 1e-3)[:, np.newaxis] ** 2
    most_stable = np.maximum(np.where(stable, forces, 0.0).max(axis=1), _LEAST_USE * most)
    core.find_tightest(slip, speeds, most_stable, car.max_steering_angle, car.wheelbase, car.gravity)
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


slip_angle = core.slip_angle
"""Return the slip angle [rad] at which an axle has a lateral force over its load, both without sign."""


def _slip_angles(axle: np.void, force: FloatArray) -> FloatArray:
    """Return what `slip_angle` does, of many forces."""
    if axle["C"] == 0.0:
        return force / float(axle["B"])
    use = np.minimum(force / axle["D"], _MOST_USE)
    return portable.tan(portable.arcsin(use) / axle["C"]) / float(axle["B"])


held_on_arc = core.held_on_arc
"""Return the acceleration over g at which an inner tire has a share of its peak, as the car is on an arc.

On the arc of `angle` [rad] a wound-up shaft drags the front axle along, see above: of the slip of driving the rear axle
has the more, and of that of braking the front one. Load moves to the rear axle, of an acceleration `back` off it, and
off the inner wheel by the lateral acceleration over g; an open axle pulls alike with both, at a mean slip.
"""


def at_least_peak(slip: np.void) -> tuple[float, float]:
    """Return the forces over load of front and rear axle at one slip ratio, the least that a peak of them has."""
    ratios = (
        axle["D"] / axle["B"] if axle["C"] == 0.0 else math.tan(0.5 * math.pi / axle["C"]) / axle["B"]
        for axle in (slip["front"], slip["rear"])
    )
    ratio = min(ratios)
    return _axle_force(slip["front"], ratio), _axle_force(slip["rear"], ratio)


def _axle_force(axle: np.void, angle: float) -> float:
    """Return the force of an axle over its load at a slip angle [rad], or at a slip ratio: `slip_angle` read back."""
    if axle["C"] == 0.0:
        return float(axle["B"] * angle)
    return float(axle["D"] * math.sin(axle["C"] * math.atan(axle["B"] * angle)))


steered = core.steered
"""Return the steering angle [rad] with which a car at `speed` [m/s] runs on the arc of `angle` [rad]."""

arc_angle = core.arc_angle
"""Return the angle [rad] of the arc on which a car at `speed` [m/s] runs in the end with a steering angle [rad]."""

tightest_arc = core.tightest_arc
"""Return the greatest angle [rad] of an arc that lock and critical speed leave at `speed` [m/s]."""

lock_arc = core.lock_arc
"""Return the angle [rad] of the tightest arc of a slow car: the lock, less what a wound-up shaft takes of it."""

stable_braking = core.stable_braking
"""Return the braking over g up to which a car that corners with a share of the grip does not turn in by itself.

Braking takes load off the rear axle, and a part of its force: on tires that are hardly stiffer behind than in front a
fast car then turns in the more, the more it does. Bilinear in a table; at a speed [m/s].
"""

held_arc = core.held_arc
"""Return the angle [rad] of the arc to command so that the car keeps its path; `angle` of tires that are not soft.

Braking takes load off the rear axle, whose slip angle then grows: the car turns in more than its wheels say, by itself,
and the harder it turns the more. A planner that follows a path steers against that. Where there is none, the wheels are
turned out by as much as the path of the car is tighter than their arc.
"""

path_lag = core.path_lag
"""Return the way [m] over which the path of a car follows its steering: v^2 s / a for a slip angle s at a."""

drag = core.drag
"""Return by how much friction of gears and of rolling slows a car [m/s^2] that drives forward at a speed [m/s]."""

ground_speed = core.ground_speed
"""Return how fast a car moves [m/s] whose wheels, by a command of `command` [m/s], roll at `wheels` [m/s].

The motor's servo pulls with a = (command - wheels) / its time constant, less what rolling takes. For this the wheels
are faster than the ground by a slip ratio s, or slower: v = wheels / (1 + s). A car that brakes by half of its grip on
tires of 5 /rad is faster by a tenth than its wheels tell. Where one axle is driven, it has the whole force, at the load
that pitching leaves it. Tires are taken to be as stiff along as they are across. A shaft that is wound up on the arc of
`angle` [rad] makes the rear wheels faster. A command of 0: none.
"""
