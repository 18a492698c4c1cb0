"""The single-track model of a car, with two kinds of axles, and its forward simulation.

Both kinds carry the loads by longitudinal transfer, F_zf = m (g l_r - a_x h) / L and F_zr = m (g l_f + a_x h) / L.
Linear axles, as the 2D gyms drive them: F_y = mu C_S F_z alpha. Angles are small: they stand where their tangents
would, and nothing turns a force. Source of `linear_rates`: M. Althoff, M. Koschi and S. Manzinger, "CommonRoad:
Composable benchmarks for motion planning on roads", IV 2017, and its vehicle models, the single-track model with load
transfer by acceleration.
Magic Formula axles, which identification fits: F_y = F_z D sin(C atan(B a - E (B a - atan(B a)))), with the slip angles
a_f = delta - atan((v_y + l_f r) / v_x), a_r = -atan((v_y - l_r r) / v_x), at the forward speed and acceleration that
were measured. Of the force that drives the car, the share of the front axle acts along the steered wheels. With a share
of 0 this is CommonRoad's model with the tires of ForzaETH's On-Track-SysID (arXiv 2411.17508). A shaft makes both axles
turn alike: on the longer way of the front wheels they brake, and the rear ones drive.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.compiled.kernels import inlined, kernel
from fg_mujoco.messages import CarParameters, FloatArray

FRONT_STIFFNESS, REAR_STIFFNESS = 4.718, 5.4562
"""[1/rad] C_Sf and C_Sr: side force over (mu times load times slip angle), of each axle; f1tenth_gym's."""

TIRE = ("stiffness", "C", "D", "E")
"""Parameters of an axle in the fit: the stiffness B C D takes the place of B, because a drive determines it better."""

SLIDING_SHARE = 0.7
"""[-] Of its peak, below which the force of a tire does not fall, as in files of tires that say nothing else."""

_HARDLY = 0.2  # [-] of the load: a drive so small takes a fiftieth of the lateral force at most, and one step to find

STATES = 5
"""v_y [m/s], r [rad/s], x [m], y [m], heading [rad] of the centre of gravity."""


@inlined
def axle_loads(
    acceleration: float, front: float, rear: float, height: float, mass: float, gravity: float
) -> tuple[float, float]:
    """Return the loads of the front and the rear axle [N]; a forward acceleration [m/s^2] moves load between them.

    `front` and `rear` [m] are from the centre of gravity, at a height [m], to the axles; mass [kg], gravity [m/s^2].
    """
    moved, length = acceleration * height, front + rear
    return mass * (gravity * rear - moved) / length, mass * (gravity * front + moved) / length


@kernel
def linear_rates(
    yaw_rate: float, slip_angle: float, steering: float, speed: float, acceleration: float, mu: float,
    front_stiffness: float, rear_stiffness: float, front: float, rear: float, height: float, mass: float,
    yaw_inertia: float, gravity: float,
) -> tuple[float, float]:  # fmt: skip
    """Return how fast yaw rate [rad/s^2] and slip angle [rad/s] of a car on linear axles change.

    The slip angle [rad] is from the heading to the velocity of the centre of gravity, left positive; speed [m/s] and
    acceleration [m/s^2] are along that velocity. Stiffnesses are the side force over mu times load times slip angle
    [1/rad]. `front` and `rear` [m] are from the centre of gravity, at a height [m], to the axles. Yaw rate [rad/s],
    steering [rad], mass [kg], yaw inertia [kg m^2], gravity [m/s^2].
    """
    front_load, rear_load = axle_loads(acceleration, front, rear, height, mass, gravity)
    front_force = mu * front_stiffness * front_load * (steering - slip_angle - front * yaw_rate / speed)
    rear_force = mu * rear_stiffness * rear_load * (rear * yaw_rate / speed - slip_angle)
    turning = (front * front_force - rear * rear_force) / yaw_inertia
    return turning, (front_force + rear_force) / (mass * speed) - yaw_rate


def car_array(car: CarParameters, *, single_track: bool = False) -> FloatArray:
    """Return the constants of a car as kernels take them, with the front axle's share of the drive, and its shaft.

    With `single_track` half of the track width is 0, which turns off all that the tires of an axle differ in. Otherwise
    the yaw inertia contains the wheels' spin: in a turn the outer wheels roll faster, and have to be sped up for it.
    """
    half = 0.0 if single_track else 0.5 * car.track_width
    inertia = car.yaw_inertia + 4.0 * car.wheel_inertia * (half / car.wheel_radius) ** 2
    return np.array(
        (
            car.mass, inertia, car.front_axle_distance, car.rear_axle_distance, car.center_of_gravity_height,
            car.gravity, car.drives_front / (car.drives_front + car.drives_rear), half, car.shaft,
        )
    )  # fmt: skip


@inlined
def friction_used(slip: float, stiffness: float, c: float, d: float, e: float) -> float:
    """Return F_y / F_z of an axle [-] at a slip angle [rad]."""
    x = stiffness / (c * d) * slip
    return d * math.sin(c * math.atan(x - e * (x - math.atan(x))))


@inlined
def _held(slip: float, stiffness: float, c: float, d: float, e: float) -> float:
    """Return F_y / F_z of a tire [-] at a slip of its own sign, never below its share of the peak behind it."""
    x = stiffness / (c * d) * slip
    turn = c * math.atan(x - e * (x - math.atan(x)))
    used = d * math.sin(turn)
    return max(used, SLIDING_SHARE * d) if turn > 0.5 * math.pi else used


@kernel
def friction_curve(slip: FloatArray, tire: FloatArray) -> FloatArray:
    """Return F_y / F_z [-] at slip angles [rad]; `tire` is stiffness, C, D, E."""
    out = np.empty(len(slip))
    for i in range(len(slip)):
        out[i] = friction_used(slip[i], tire[0], tire[1], tire[2], tire[3])
    return out


@inlined
def _secant(slip: float, ratio: float, stiffness: float, c: float, d: float, e: float) -> float:
    """Return the force of a tire over its load and its slip, at a slip angle [rad] and a slip ratio [-]."""
    size = math.sqrt(slip * slip + ratio * ratio + 1e-12)
    return _held(size, stiffness, c, d, e) / size


@inlined
def _across(slip: float, load: float, drive: float, stiffness: float, c: float, d: float, e: float) -> float:
    """Return the lateral force of a tire [N] at a slip angle [rad], driven by a force along its heading [N].

    By similarity: the curve gives the force at the size of the vector of slip ratio and slip angle. The slip ratio is
    the one with that drive; where there is none, the tire spins, at a slip ratio of 1.
    """
    used = _secant(slip, 0.0, stiffness, c, d, e)
    for _ in range(1 if abs(drive) < _HARDLY * load else 3):
        used = _secant(slip, min(abs(drive) / max(load * used, 1e-6), 1.0), stiffness, c, d, e)
    return load * used * slip


@inlined
def _pulls(
    total: float, slip_front: float, slip_rear: float, load_front: float, load_rear: float, steering: float,
    rolls: float, car: FloatArray, tires: FloatArray,
) -> tuple[float, float]:  # fmt: skip
    """Return both axles' pull along their wheels [N] for a force on the car; `rolls`: rear way over the front's."""
    cos, share = math.cos(steering), car[6]
    if car[8] == 0.0:
        drive = total / (share * cos + 1.0 - share)
        return share * drive, (1.0 - share) * drive
    front = rear = ratio_front = ratio_rear = 0.0
    for _ in range(3):
        front = load_front * _secant(slip_front, ratio_front, tires[0], tires[1], tires[2], tires[3])
        rear = load_rear * _secant(slip_rear, ratio_rear, tires[4], tires[5], tires[6], tires[7])
        ratio_rear = (total - front * (rolls - 1.0) * cos) / (front * rolls * cos + rear)
        ratio_rear = min(max(ratio_rear, -1.0), 1.0)
        ratio_front = rolls * (1.0 + ratio_rear) - 1.0
    return front * ratio_front, rear * ratio_rear


@inlined
def _slips(vy: float, r: float, steering: float, vx: float, car: FloatArray) -> tuple[float, float]:
    """Return the slip angles of both axles [rad]; `vy` is of what the wheels stand on, below the centre of gravity."""
    return steering - math.atan2(vy + car[2] * r, vx), -math.atan2(vy - car[3] * r, vx)


@inlined
def _accelerations(
    slip_front: float, slip_rear: float, vy: float, r: float, steering: float, vx: float, ax: float, leaning: float,
    car: FloatArray, tires: FloatArray,
) -> tuple[float, float]:  # fmt: skip
    """Return the lateral [m/s^2] and the yaw acceleration [rad/s^2]; `leaning` is the lateral one of the loads."""
    mass, inertia, front, rear, height, gravity, share, half, _ = car
    length = front + rear
    load_front, load_rear = axle_loads(ax, front, rear, height, mass, gravity)
    cos, sin = math.cos(steering), math.sin(steering)
    if half == 0.0:
        force_front = load_front * friction_used(slip_front, tires[0], tires[1], tires[2], tires[3])
        force_rear = load_rear * friction_used(slip_rear, tires[4], tires[5], tires[6], tires[7])
        drive = share * (mass * ax + force_front * sin) / (share * cos + 1.0 - share)
        across_front = force_front * cos + drive * sin
        return (across_front + force_rear) / mass, (front * across_front - rear * force_rear) / inertia
    # what drives the car overcomes the drag of the steered wheels, as at the force that turns the car
    drag = mass * leaning * rear / length * math.tan(steering)
    rolls = vx / (vx * cos + (vy + front * r) * sin)
    total = mass * ax + drag
    pull_front, pull_rear = _pulls(total, slip_front, slip_rear, load_front, load_rear, steering, rolls, car, tires)
    moved = 0.25 * mass * leaning * height / half  # load that goes to the outer tire of each axle [N]
    across = turning = 0.0
    for side in (-1.0, 1.0):  # right, left
        along = vx - side * half * r
        # Ackermann's angle of this wheel, and how its slip angle differs from its axle's
        angle = math.atan2(length * sin, length * cos - side * half * sin)
        apart = (angle - math.atan2(vy + front * r, along)) - (steering - math.atan2(vy + front * r, vx))
        load = max(0.5 * load_front - side * moved, 0.0)
        pull = 0.5 * pull_front
        force = _across(slip_front + apart, load, pull, tires[0], tires[1], tires[2], tires[3])
        cos_wheel, sin_wheel = math.cos(angle), math.sin(angle)
        to_left = force * cos_wheel + pull * sin_wheel
        across += to_left
        turning += front * to_left - side * half * (pull * cos_wheel - force * sin_wheel)
        apart = math.atan2(vy - rear * r, vx) - math.atan2(vy - rear * r, along)
        load = max(0.5 * load_rear - side * moved, 0.0)
        pull = 0.5 * pull_rear
        force = _across(slip_rear + apart, load, pull, tires[4], tires[5], tires[6], tires[7])
        across += force
        turning += -rear * force - side * half * pull
    return across / mass, turning / inertia


@kernel
def simulate(
    tires: FloatArray, car: FloatArray, relaxation_length: float, gain: float, steering: FloatArray,
    forward_speed: FloatArray, forward_acceleration: FloatArray, step: float, segments: NDArray[np.int64],
    starts: FloatArray, out: FloatArray,
) -> None:  # fmt: skip
    """Simulate segments of a drive on its grid, each from its own state, by Heun's method in two parts of each step.

    `tires` (8,) are TIRE, front and rear, `car` is of `car_array`. Slip angles follow over `relaxation_length` [m], 0
    at once; `gain` is the reading of an accelerometer over the lateral acceleration in a steady turn. Steering of the
    front wheels [rad], measured forward speed [m/s] and acceleration [m/s^2] are (n,), `step` [s] is of the grid.
    `segments` (m, 2) are the first node and the one behind the last, `starts` (m, STATES). Written are into `out` (n,
    STATES + 1) the states and what the accelerometer reads across the car [m/s^2].
    A car that rolls by phi reads g phi, too, and its wheels move out from under its centre of gravity by h phi', as if
    its tires relaxed over a longer way. In a steady turn phi is a_y (gain - 1) / g. It follows with a time constant,
    the damping over the stiffness of a suspension that is damped by half of critical, as that of our cars is. Where
    slip angles follow at once, the car does not roll.
    """
    # slip angles that follow at once make the stiffest motion of all
    parts = 2 if relaxation_length == 0.0 else 1
    part = step / parts
    height, half = car[4], car[7]
    rolls = relaxation_length > 0.0 and half > 0.0 and height > 0.0 and gain != 1.0
    lean = (gain - 1.0) / car[5] if rolls else 0.0  # [rad s^2/m]
    rolled = math.exp(-part / (half * math.sqrt(abs(lean) / height))) if rolls else 0.0
    for segment in range(len(segments)):
        first, end = segments[segment]
        vy, r, x, y, heading = starts[segment]
        slip_front, slip_rear = _slips(vy, r, steering[first], forward_speed[first], car)
        leaning = forward_speed[first] * r
        roll = lean * leaning  # [rad] to the outside
        for node in range(first, end):
            now, vx, ax = steering[node], forward_speed[node], forward_acceleration[node]
            out[node, 0], out[node, 1], out[node, 2], out[node, 3], out[node, 4] = vy, r, x, y, heading
            if node == end - 1:
                ay = _accelerations(slip_front, slip_rear, vy, r, now, vx, ax, leaning, car, tires)[0]
                out[node, 5] = ay + car[5] * roll if rolls else gain * ay
                break
            turn_speed = (forward_speed[node + 1] - vx) / parts
            turn_acceleration = (forward_acceleration[node + 1] - ax) / parts
            turn_angle = (steering[node + 1] - now) / parts
            for k in range(parts):
                ay, turn = _accelerations(slip_front, slip_rear, vy, r, now, vx, ax, leaning, car, tires)
                if k == 0:
                    out[node, 5] = ay + car[5] * roll if rolls else gain * ay
                # the wheels move to the inside of the turn
                swing = height * (1.0 - rolled) * (lean * ay - roll) / part if rolls else 0.0  # [m/s]
                steady_front, steady_rear = _slips(vy + swing, r, now, vx, car)
                new_vx, new_ax, new_now = vx + turn_speed, ax + turn_acceleration, now + turn_angle
                new_vy, new_r = vy + part * (ay - vx * r), r + part * turn
                new_front, new_rear = _slips(new_vy + swing, new_r, new_now, new_vx, car)
                if relaxation_length > 0.0:
                    # exact where the slip angle that they follow changes evenly
                    way = part * 0.5 * (vx + new_vx) / relaxation_length
                    kept = math.exp(-way)
                    mean = (1.0 - kept) / way
                    new_front = kept * slip_front + (mean - kept) * steady_front + (1.0 - mean) * new_front
                    new_rear = kept * slip_rear + (mean - kept) * steady_rear + (1.0 - mean) * new_rear
                new_ay, new_turn = _accelerations(
                    new_front, new_rear, new_vy, new_r, new_now, new_vx, new_ax, ay, car, tires
                )
                if rolls:
                    roll = rolled * roll + (1.0 - rolled) * lean * 0.5 * (ay + new_ay)
                old_vy, old_r, old_heading = vy, r, heading
                vy += 0.5 * part * (ay - vx * r + new_ay - new_vx * new_r)
                r += 0.5 * part * (turn + new_turn)
                heading += 0.5 * part * (old_r + r)
                halfway, across, ahead = 0.5 * (old_heading + heading), 0.5 * (old_vy + vy), 0.5 * (vx + new_vx)
                x += part * (ahead * math.cos(halfway) - across * math.sin(halfway))
                y += part * (ahead * math.sin(halfway) + across * math.cos(halfway))
                vx, ax, now, leaning = new_vx, new_ax, new_now, new_ay
                slip_front, slip_rear = new_front, new_rear
                if relaxation_length == 0.0:
                    slip_front, slip_rear = _slips(vy, r, now, vx, car)
