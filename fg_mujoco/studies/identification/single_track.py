"""The single-track model with Magic Formula axles that identification fits, and its forward simulation.

Lateral force of an axle: F_y = F_z D sin(C atan(B a - E (B a - atan(B a)))), with the slip angles
a_f = delta - atan((v_y + l_f r) / v_x), a_r = -atan((v_y - l_r r) / v_x) and the loads by longitudinal transfer
F_zf = m (g l_r - a_x h) / L, F_zr = m (g l_f + a_x h) / L: CommonRoad's single-track model with the tires of ForzaETH's
On-Track-SysID (arXiv 2411.17508). The forward speed and acceleration are those measured. Of the force that drives the
car, the share of the front axle acts along the steered wheels; CommonRoad's model is that with a share of 0.

The steering angle follows gain * command + offset, late by a delay, with a first-order lag and the servo's rate.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...kernels import inlined, kernel
from ...messages import CarParameters, FloatArray
from .drive import Channel

TIRE = ("stiffness", "C", "D", "E")
"""Parameters of an axle in the fit: the stiffness B C D takes the place of B, because a drive determines it better."""

STATES = 5
"""v_y [m/s], r [rad/s], x [m], y [m], heading [rad] of the centre of gravity."""


def car_array(car: CarParameters, front_drive: float) -> FloatArray:
    """Return the constants of a car as kernels take them; `front_drive` is the share of the front axle's drive."""
    return np.array(
        (
            car.mass, car.yaw_inertia, car.front_axle_distance, car.rear_axle_distance,
            car.center_of_gravity_height, car.gravity, front_drive,
        )
    )  # fmt: skip


@inlined
def friction_used(slip: float, stiffness: float, c: float, d: float, e: float) -> float:
    """Return F_y / F_z of an axle [-] at a slip angle [rad]."""
    x = stiffness / (c * d) * slip
    return d * math.sin(c * math.atan(x - e * (x - math.atan(x))))


@kernel
def friction_curve(slip: FloatArray, tire: FloatArray) -> FloatArray:
    """Return F_y / F_z [-] at slip angles [rad]; `tire` is stiffness, C, D, E."""
    out = np.empty(len(slip))
    for i in range(len(slip)):
        out[i] = friction_used(slip[i], tire[0], tire[1], tire[2], tire[3])
    return out


@kernel
def axle_loads(forward_acceleration: FloatArray, car: FloatArray) -> FloatArray:
    """Return the loads of the front and the rear axle [N], (2, n)."""
    mass, _, front, rear, height, gravity, _ = car
    out = np.empty((2, len(forward_acceleration)))
    out[0] = mass * (gravity * rear - forward_acceleration * height) / (front + rear)
    out[1] = mass * (gravity * front + forward_acceleration * height) / (front + rear)
    return out


@inlined
def _accelerations(
    vy: float, r: float, steering: float, vx: float, ax: float, car: FloatArray, tires: FloatArray
) -> tuple[float, float]:
    """Return the lateral [m/s^2] and the yaw acceleration [rad/s^2]."""
    mass, inertia, front, rear, height, gravity, share = car
    length = front + rear
    slip_front = steering - math.atan2(vy + front * r, vx)
    slip_rear = -math.atan2(vy - rear * r, vx)
    load_front = mass * (gravity * rear - ax * height) / length
    load_rear = mass * (gravity * front + ax * height) / length
    force_front = load_front * friction_used(slip_front, tires[0], tires[1], tires[2], tires[3])
    force_rear = load_rear * friction_used(slip_rear, tires[4], tires[5], tires[6], tires[7])
    cos, sin = math.cos(steering), math.sin(steering)
    drive = share * (mass * ax + force_front * sin) / (share * cos + 1.0 - share)
    across_front = force_front * cos + drive * sin
    return (across_front + force_rear) / mass, (front * across_front - rear * force_rear) / inertia


@kernel
def simulate(
    tires: FloatArray,
    car: FloatArray,
    steering: FloatArray,
    forward_speed: FloatArray,
    forward_acceleration: FloatArray,
    step: float,
    segments: NDArray[np.int64],
    starts: FloatArray,
    out: FloatArray,
) -> None:
    """Simulate segments of a drive on its grid, each from its own state, by Runge and Kutta's fourth-order method.

    Args:
      tires: (8,) of TIRE, front and rear.
      car: (7,) of `car_array`.
      steering: (n,) [rad] of the front wheels.
      forward_speed: (n,) [m/s] as measured.
      forward_acceleration: (n,) [m/s^2] as measured.
      step: of the grid [s].
      segments: (m, 2) first node and the one behind the last.
      starts: (m, STATES).
      out: (n, STATES + 1), written to: the states and the lateral acceleration [m/s^2].
    """
    for segment in range(len(segments)):
        first, end = segments[segment]
        vy, r, x, y, heading = starts[segment]
        for node in range(first, end):
            now, vx, ax = steering[node], forward_speed[node], forward_acceleration[node]
            ay, turn = _accelerations(vy, r, now, vx, ax, car, tires)
            out[node, 0], out[node, 1], out[node, 2], out[node, 3], out[node, 4] = vy, r, x, y, heading
            out[node, 5] = ay
            if node == end - 1:
                break
            vx_end, ax_end = forward_speed[node + 1], forward_acceleration[node + 1]
            vx_mid, ax_mid = 0.5 * (vx + vx_end), 0.5 * (ax + ax_end)
            mid = 0.5 * (now + steering[node + 1])
            half = 0.5 * step
            vy1, r1 = ay - vx * r, turn
            ay, turn = _accelerations(vy + half * vy1, r + half * r1, mid, vx_mid, ax_mid, car, tires)
            vy2, r2 = ay - vx_mid * (r + half * r1), turn
            ay, turn = _accelerations(vy + half * vy2, r + half * r2, mid, vx_mid, ax_mid, car, tires)
            vy3, r3 = ay - vx_mid * (r + half * r2), turn
            ay, turn = _accelerations(vy + step * vy3, r + step * r3, steering[node + 1], vx_end, ax_end, car, tires)
            vy4, r4 = ay - vx_end * (r + step * r3), turn
            new_vy = vy + step / 6.0 * (vy1 + 2.0 * vy2 + 2.0 * vy3 + vy4)
            new_r = r + step / 6.0 * (r1 + 2.0 * r2 + 2.0 * r3 + r4)
            turned = heading + step / 6.0 * (r + 4.0 * (r + half * r2) + new_r)
            halfway, across = 0.5 * (heading + turned), 0.5 * (vy + new_vy)
            x += step * (vx_mid * math.cos(halfway) - across * math.sin(halfway))
            y += step * (vx_mid * math.sin(halfway) + across * math.cos(halfway))
            vy, r, heading = new_vy, new_r, turned


class Steering:
    """The steering of a drive: from commands, each held until the next one, to the angle of the front wheels.

    Args:
      commands: [rad].
      time: (n,) [s] of the grid.
      limit: greatest angle that is commanded [rad].
      rate: greatest of the servo [rad/s].
      held: whether a command holds until the next one; else, as for measured angles, it is linear in between.
    """

    def __init__(self, commands: Channel, time: FloatArray, *, limit: float, rate: float, held: bool) -> None:
        angles = np.clip(commands.values[:, 0], -limit, limit)
        self._time, self._rate = time, rate
        knots = commands.time
        steps = np.diff(knots)
        between = angles[:-1] if held else 0.5 * (angles[1:] + angles[:-1])
        first, last = min(knots[0], time[0]) - 1.0, max(knots[-1], time[-1]) + 1.0
        self._knots = np.concatenate(([first], knots, [last]))
        self._integral = np.cumsum(np.concatenate(([0.0, angles[0] * (knots[0] - first)], between * steps,
                                                   [angles[-1] * (last - knots[-1])])))  # fmt: skip

    def angles(self, gain: float, offset: float, lag: float, delay: float) -> FloatArray:
        """Return the angle of the front wheels on the grid (n,) [rad]."""
        # the mean command over each step: continuous in the delay, which its value at one time is not
        integral = np.interp(self._time - delay, self._knots, self._integral)
        targets = gain * np.diff(integral) / np.diff(self._time) + offset
        out = np.empty(len(self._time))
        _follow(targets, lag, self._rate, float(self._time[1] - self._time[0]), out)
        return out


@kernel
def _follow(targets: FloatArray, lag: float, rate: float, step: float, out: FloatArray) -> None:
    part = 1.0 - math.exp(-step / lag) if lag > 0.0 else 1.0
    out[0] = targets[0]
    for i in range(len(targets)):
        out[i + 1] = out[i] + min(max((targets[i] - out[i]) * part, -rate * step), rate * step)
