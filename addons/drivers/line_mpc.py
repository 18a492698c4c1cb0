"""Model-predictive control along a line: the plan of least cost for the next second, of which a tick is driven.

The plan is a linear time-varying program (ltv_program) of 20 steps of 0.05 s. Its state, in the frame of the line:
distance of the rear axle from the line [m], angle of the heading to the line [rad], lateral speed of the centre of
gravity [m/s] and yaw rate [rad/s] where tires need slip angles, steering angle less that of the line's curvature [rad].
The speed along the horizon is that of the line's profile, reached with what the tires give. The input is the steering
rate, bounded by what the friction limiter allows at the speed and the steering angle of each step, and by the way that
the servo comes in a tick: the car begins to turn in before a bend at which it would be late. The steering angle is
bounded by lock and grip. The distance costs more where walls that are known leave no room beside the line, and there
the car slows. The cost is that of the regulator in line_trackers, e^2 / L^4 + k^2 over the way, k the curvature beyond
the line's, and a share for the change of k.
Where tires need no slip angles, the car is kinematic. Else it is the single-track car, whose axles have the secant
stiffness of their curves at the force of the line's curvature (slip). The steering angle is that of the arc, and the
wheels are turned by the lead more. The command is the angle for which the servo reaches the plan's angle at the next
tick; the plan begins where the car will be when late commands act. Where the program does not converge, the car steers
by the last plan; where that is over, it brakes, and steers by its last angle.
Source: P. Falcone et al., Predictive Active Steering Control for Autonomous Vehicle Systems, IEEE TCST 15(3), 2007, for
the linear time-varying plan; the model is R. Rajamani, Vehicle Dynamics and Control, 2012, chapter 2.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.controllers.control.planner_settings import Record
from fg_mujoco.controllers.control.slip import arc_angle, slip_angle, steered, tightest_arc, velocity_angle
from fg_mujoco.controllers.control.speed import friction_steering, share_of_way
from fg_mujoco.controllers.control.stages import Stage, Tick
from fg_mujoco.controllers.control.steering import late_by, saturate
from fg_mujoco.controllers.perception.scan_geometry import period_of
from fg_mujoco.messages import FloatArray

from .line_profile import LEFT, RIGHT, ROOM, SPEED, STEP, X, Y, next_point
from .line_trackers import OFF_LINE, curvature_at, direction_at, is_ahead
from .ltv_program import COUPLED, FIRST, HIGH, INPUT, LAST, LOW, MOST_ITERATIONS, SOFTNESS, solve_program

STEPS, DT = 20, 0.05  # of the horizon, and [s] of each
SOLVED, LAST_PLAN, NO_PLAN = range(3)
"""What the steering angle is by: this plan, the last one, or none, and the car has to brake."""
_SLOWEST = 1.0  # [m/s] the car is planned no slower: one that stands cannot be steered
_LENGTH, _LENGTH_TIME = 0.3, 0.05  # [m] and [s]: of the regulator's L
_RATE_TIME = 0.1  # [s] a change of the curvature in this time costs as much as the curvature
_BEYOND, _BEYOND_RATE = 1e3, 1e5  # times the weight of what is bounded: that of the distance beyond a soft bound
_TOUCH = 0.01  # [m] by which a plan may leave the room
_SLOWER, _MOST_SLOWER = 10.0, 0.2  # [1/s] and [m/s]: by how much the car slows where its plan leaves the room
_NUDGE = 0.01  # [rad] for the slope of the lead

MPC = np.dtype(
    [
        ("planned", np.bool_),
        ("age", np.float64),  # [s] since the plan was made
        ("command", np.float64),  # [rad] steering angle that was last commanded
        ("iterations", np.int64),  # of the last tick
        ("angles", np.float64, (STEPS + 1,)),  # [rad] of the plan
    ]
)
"""Type of what is kept of the last plan; zero at the beginning."""

_SPEED_AT, _TURN, _CURVATURE, _ANGLE, _RIGHT, _LEFT = range(
    6
)  # columns of what is ahead at each step, see `_look_ahead`


@kernel
def plan_steering(
    line: FloatArray,
    nearest: int,
    odometry: Record,
    driver: Record,
    period: float,
    mpc: Record,
) -> tuple[float, float, int]:
    """Return the steering angle [rad] for the next tick, the greatest speed [m/s], and what they are by, see SOLVED.

    The speed is inf where the plan stays in the room beside the line. Else the car slows: its wheels then turn in less
    distance, and its tires hold a sharper curve. It slows by at most 0.2 m/s at a time, as the friction limiter takes
    grip from the cornering of a car that is far too fast. Without a plan the speed is 0. `nearest` is the line's point
    that is nearest to the rear axle, `mpc` is written to.
    """
    car, slip = driver.car, driver.limiter.slip
    now = min(abs(odometry.speed), car.max_speed)
    angle = arc_angle(slip, car, odometry.steering_angle, now) if slip.needs_slip_angle else odometry.steering_angle
    share = share_of_way(period, car.steering_time_constant + car.command_delay)
    begin = _place_at_command(odometry, car, angle, mpc)
    ahead = np.empty((STEPS + 1, 6))
    aside, turned = _look_ahead(line, nearest, begin, now, driver, ahead)
    size = 5 if slip.needs_slip_angle else 3
    start = np.zeros(size)
    start[0], start[1], start[size - 1] = aside, turned, begin[3] - ahead[0, _ANGLE]
    if slip.needs_slip_angle:
        start[3] = odometry.angular_velocity[2]
        start[2] = now * velocity_angle(slip, car, now, start[3]) + car.rear_axle_distance * start[3]
    a, b, c = np.zeros((STEPS, size, size)), np.zeros((STEPS, size)), np.zeros((STEPS, size))
    if slip.needs_slip_angle:
        _single_track(ahead, driver, a, b, c)
    else:
        _kinematic(ahead, car, a, b, c)
    mpc.age += period
    weights, effort, coupling = np.zeros((STEPS + 1, size)), np.empty(STEPS), np.zeros(STEPS)
    limits = np.zeros((3, STEPS, 4))
    _weigh(ahead, car, weights, effort)
    _bound(ahead, driver, share / period, weights, effort, coupling, limits)
    inputs, states = np.empty(STEPS), np.empty((STEPS + 1, size))
    iterations = solve_program(a, b, c, weights, effort, coupling, limits, start, inputs, states, MOST_ITERATIONS)
    mpc.iterations, state, outside = iterations, SOLVED, 0.0
    if iterations > 0:
        mpc.planned, mpc.age = True, 0.0
        for k in range(STEPS + 1):
            mpc.angles[k] = ahead[k, _ANGLE] + states[k, size - 1]
        outside = _outside(ahead, states)
    else:
        state = LAST_PLAN if mpc.planned and mpc.age + 0.5 * period < STEPS * DT else NO_PLAN
    mpc.command = angle
    if mpc.planned and math.isfinite(begin[3]):
        wanted = _planned_angle(mpc, mpc.age + period)
        mpc.command = saturate(begin[3] + (wanted - begin[3]) / share, car.max_steering_angle)
    slowest = max(now - min(_SLOWER * outside, _MOST_SLOWER), _SLOWEST) if outside > 0.0 else math.inf
    return mpc.command, 0.0 if state == NO_PLAN else slowest, state


@kernel
def _planned_angle(mpc: Record, time: float) -> float:
    """Return the steering angle of the last plan [rad] at a time [s] after it was made; the last one beyond its end."""
    place = min(max(time / DT, 0.0), float(STEPS))
    at = min(int(place), STEPS - 1)
    return float(mpc.angles[at] + (place - at) * (mpc.angles[at + 1] - mpc.angles[at]))


@kernel
def _outside(ahead: FloatArray, states: FloatArray) -> float:
    """Return by how much a plan leaves the room beside the line, and further than the car now does [m]."""
    now = max(states[0, 0] - ahead[0, _LEFT], ahead[0, _RIGHT] - states[0, 0], 0.0)
    most = now
    for k in range(1, STEPS + 1):
        most = max(most, states[k, 0] - ahead[k, _LEFT], ahead[k, _RIGHT] - states[k, 0])
    return float(max(most - now - _TOUCH, 0.0))


@kernel
def _place_at_command(odometry: Record, car: Record, angle: float, mpc: Record) -> tuple[float, float, float, float]:
    """Return where the car is once a command reaches its servos: x and y [m], heading and steering angle [rad]."""
    x, y, heading = odometry.pose
    delay = car.command_delay
    if delay == 0.0 or not mpc.planned:
        return x, y, heading, angle
    then = mpc.command + (angle - mpc.command) * math.exp(-delay / car.steering_time_constant)
    way = odometry.speed * delay
    turn = way * math.tan(0.5 * (angle + then)) / car.wheelbase
    x, y = x + way * math.cos(heading + 0.5 * turn), y + way * math.sin(heading + 0.5 * turn)
    return x, y, heading + turn, then


@kernel
def _wrapped(angle: float) -> float:
    """Return an angle [rad] within half a turn."""
    return angle - 2.0 * math.pi * round(angle / (2.0 * math.pi))


@kernel
def _look_ahead(
    line: FloatArray,
    nearest: int,
    begin: tuple[float, float, float, float],
    now: float,
    driver: Record,
    ahead: FloatArray,
) -> tuple[float, float]:
    """Return the car's distance from the line [m] and angle to it [rad], and write what is ahead (STEPS + 1, 6).

    In each step: the speed [m/s], by how much the line turns until the next [rad], its curvature [1/m] and the steering
    angle for it [rad], both within the lock, and how far the car may be to the right (negative) and to the left [m].
    """
    car, step = driver.car, line[0, STEP]
    x, y, heading, _ = begin
    along = direction_at(line, nearest)
    cos, sin = math.cos(along), math.sin(along)
    aside = cos * (y - line[nearest, Y]) - sin * (x - line[nearest, X])
    beyond = cos * (x - line[nearest, X]) + sin * (y - line[nearest, Y])
    braking = driver.limiter.braking if driver.has_limiter else car.max_acceleration
    accelerating = driver.limiter.accelerating if driver.has_limiter else car.max_acceleration
    point, speed = nearest, max(now, _SLOWEST)
    last, turned = along, 0.0
    for k in range(STEPS + 1):
        while beyond < 0.0:
            point, beyond = next_point(line, point, -1), beyond + step
        while beyond >= step:
            point, beyond = next_point(line, point, 1), beyond - step
        here = direction_at(line, point)
        after, share = next_point(line, point, 1), beyond / step
        here += share * _wrapped(direction_at(line, after) - here)
        bend = (1.0 - share) * curvature_at(line, point) + share * curvature_at(line, after)
        if k == 0:
            turned = _wrapped(heading - here)
        else:
            ahead[k - 1, _TURN] = _wrapped(here - last)
        last = here
        angle = saturate(math.atan(car.wheelbase * bend), car.max_steering_angle)
        ahead[k, _SPEED_AT], ahead[k, _CURVATURE] = speed, math.tan(angle) / car.wheelbase
        ahead[k, _RIGHT] = max(line[point, RIGHT], line[after, RIGHT])
        ahead[k, _LEFT] = min(line[point, LEFT], line[after, LEFT])
        ahead[k, _ANGLE] = angle
        target = line[next_point(line, point, 1), SPEED]
        reached = max(_SLOWEST, min(max(target, speed - braking * DT), speed + accelerating * DT))
        beyond += 0.5 * (speed + reached) * DT
        speed = reached
    ahead[STEPS, _TURN] = 0.0
    return aside, turned


@kernel
def _kinematic(ahead: FloatArray, car: Record, a: FloatArray, b: FloatArray, c: FloatArray) -> None:
    """Write the program's system for the kinematic car: distance, angle, steering angle; its steering rate is held."""
    for k in range(STEPS):
        way = 0.5 * (ahead[k, _SPEED_AT] + ahead[k + 1, _SPEED_AT]) * DT
        gain = 1.0 / (car.wheelbase * math.cos(ahead[k, _ANGLE]) ** 2)
        bend = 0.5 * (ahead[k, _CURVATURE] + ahead[k + 1, _CURVATURE])
        a[k, 0, 0] = a[k, 1, 1] = a[k, 2, 2] = 1.0
        a[k, 0, 1], a[k, 0, 2], b[k, 0] = way, 0.5 * way * way * gain, way * way * gain * DT / 6.0
        a[k, 1, 0], a[k, 1, 2], b[k, 1] = -way * bend * bend, way * gain, 0.5 * way * gain * DT
        b[k, 2] = DT
        c[k, 1] = way * bend - ahead[k, _TURN]
        c[k, 0] = 0.5 * way * c[k, 1]


@kernel
def _single_track(ahead: FloatArray, driver: Record, a: FloatArray, b: FloatArray, c: FloatArray) -> None:
    """Write the program's system for the single-track car, see above."""
    car, slip = driver.car, driver.limiter.slip
    front, rear, gravity = car.front_axle_distance, car.rear_axle_distance, car.gravity
    heavy = car.mass / car.yaw_inertia
    for k in range(STEPS):
        speed = 0.5 * (ahead[k, _SPEED_AT] + ahead[k + 1, _SPEED_AT])
        bend = 0.5 * (ahead[k, _CURVATURE] + ahead[k + 1, _CURVATURE])
        force = min(max(speed * speed * abs(bend) / gravity, 0.1 * slip.most), slip.most)
        ahead_force = force / slip_angle(slip.front, force) * gravity * rear / car.wheelbase  # [m/s^2 / rad]
        behind_force = force / slip_angle(slip.rear, force) * gravity * front / car.wheelbase
        unequal = front * ahead_force - rear * behind_force
        m00, m01 = -(ahead_force + behind_force) / speed, -unequal / speed - speed
        m10, m11 = -heavy * unequal / speed, -heavy * (front**2 * ahead_force + rear**2 * behind_force) / speed
        h00, h01, h10, h11 = _exponential(0.5 * DT * m00, 0.5 * DT * m01, 0.5 * DT * m10, 0.5 * DT * m11)
        e00, e01 = h00 * h00 + h01 * h10, h00 * h01 + h01 * h11
        e10, e11 = h10 * h00 + h11 * h10, h10 * h01 + h11 * h11
        push, twist = ahead_force, heavy * front * ahead_force
        # Simpson's rule for the integral of the exponential
        by_angle0 = DT / 6.0 * ((1.0 + 4.0 * h00 + e00) * push + (4.0 * h01 + e01) * twist)
        by_angle1 = DT / 6.0 * ((4.0 * h10 + e10) * push + (1.0 + 4.0 * h11 + e11) * twist)
        arc, next_arc = ahead[k, _ANGLE], ahead[k + 1, _ANGLE]
        wheels = 0.5 * (steered(slip, car, arc, speed) + steered(slip, car, next_arc, speed))
        middle = 0.5 * (arc + next_arc)
        gain = (steered(slip, car, middle + _NUDGE, speed) - steered(slip, car, middle - _NUDGE, speed)) / (
            2.0 * _NUDGE
        )
        a[k, 2, 2], a[k, 2, 3], a[k, 2, 4] = e00, e01, by_angle0 * gain
        a[k, 3, 2], a[k, 3, 3], a[k, 3, 4] = e10, e11, by_angle1 * gain
        b[k, 2], b[k, 3] = 0.5 * DT * a[k, 2, 4], 0.5 * DT * a[k, 3, 4]
        c[k, 2], c[k, 3] = by_angle0 * wheels, by_angle1 * wheels
        a[k, 4, 4], b[k, 4] = 1.0, DT
        a[k, 1, 1], a[k, 1, 3] = 1.0, 0.5 * DT
        for j in range(2, 5):
            a[k, 1, j] += 0.5 * DT * a[k, 3, j]
        b[k, 1], c[k, 1] = 0.5 * DT * b[k, 3], 0.5 * DT * c[k, 3] - ahead[k, _TURN]
        a[k, 0, 0], a[k, 0, 1] = 1.0, 0.5 * DT * speed
        a[k, 0, 2], a[k, 0, 3] = 0.5 * DT, -0.5 * DT * rear
        for j in range(1, 5):
            a[k, 0, j] += 0.5 * DT * (speed * a[k, 1, j] + a[k, 2, j] - rear * a[k, 3, j])
        b[k, 0] = 0.5 * DT * (speed * b[k, 1] + b[k, 2] - rear * b[k, 3])
        c[k, 0] = 0.5 * DT * (speed * c[k, 1] + c[k, 2] - rear * c[k, 3])


@kernel
def _exponential(m00: float, m01: float, m10: float, m11: float) -> tuple[float, float, float, float]:
    """Return the exponential of a matrix of two rows, in closed form."""
    mean, half = 0.5 * (m00 + m11), 0.5 * (m00 - m11)
    square = half * half + m01 * m10
    root = math.sqrt(abs(square))
    even = math.cosh(root) if square > 0.0 else math.cos(root)
    odd = (math.sinh(root) if square > 0.0 else math.sin(root)) / root if root > 1e-9 else 1.0
    scale = math.exp(mean)
    return scale * (even + odd * half), scale * odd * m01, scale * odd * m10, scale * (even - odd * half)


@kernel
def _weigh(ahead: FloatArray, car: Record, weights: FloatArray, effort: FloatArray) -> None:
    """Write the weights of the cost, see above; at the end that of the regulator, whose horizon has no end."""
    last = weights.shape[1] - 1
    for k in range(STEPS + 1):
        speed = ahead[k, _SPEED_AT]
        way, length = speed * DT, _LENGTH + (_LENGTH_TIME + late_by(car)) * speed
        gain = 1.0 / (car.wheelbase * math.cos(ahead[k, _ANGLE]) ** 2)
        weights[k, 0], weights[k, last] = way / length**4, way * gain * gain
        if k < STEPS:
            effort[k] = way * (gain * _RATE_TIME) ** 2
        else:
            weights[k, 0] += math.sqrt(2.0) / length**3
            weights[k, 1] += math.sqrt(2.0) / length


@kernel
def _bound(
    ahead: FloatArray,
    driver: Record,
    per_angle: float,
    weights: FloatArray,
    effort: FloatArray,
    coupling: FloatArray,
    limits: FloatArray,
) -> None:
    """Write the bounds, less what the line has.

    The friction limiter's steering rate is linear in the steering angle, u + coupling d
    (friction_limiter.steering_rate). `per_angle` is the rate of the wheels over the angle from them to the command, in
    the mean of a tick [1/s].
    """
    car, limiter = driver.car, driver.limiter
    last = weights.shape[1] - 1
    for k in range(STEPS):
        speed, angle, after = ahead[k, _SPEED_AT], ahead[k, _ANGLE], ahead[k + 1, _ANGLE]
        lines = (after - angle) / DT
        fastest, lock = car.max_steering_rate, car.max_steering_angle
        most = 2.0 * fastest
        least = -most
        if driver.has_limiter:
            settings = limiter.settings
            response = settings.steering_response * per_angle
            fastest *= min(response, 1.0)
            use = settings.lateral_use * (settings.lateral_use_in_braking if ahead[k + 1, _SPEED_AT] < speed else 1.0)
            held = friction_steering(ahead[k + 1, _SPEED_AT], limiter.mu * use, car.wheelbase, car.gravity)
            lock = min(lock, held)
            if limiter.slip.needs_slip_angle:
                lock = min(lock, tightest_arc(limiter.slip, ahead[k + 1, _SPEED_AT]))
            bent, slope = math.tan(angle), 1.0 / math.cos(angle) ** 2
            by_left = settings.turn_in_use * response * car.wheelbase / (limiter.yaw_lag * speed)
            coupling[k] = by_left * speed * speed / car.wheelbase
            middle = coupling[k] * (angle - bent / slope)
            most, least = by_left * limiter.lateral / slope, -by_left * limiter.lateral / slope
            most, least = most + middle, least + middle
        known = lines + coupling[k] * angle
        limits[LOW, k, INPUT], limits[HIGH, k, INPUT] = -fastest - lines, fastest - lines
        limits[LOW, k, COUPLED], limits[HIGH, k, COUPLED] = least - known, most - known
        limits[LOW, k, LAST], limits[HIGH, k, LAST] = -lock - after, lock - after
        limits[LOW, k, FIRST], limits[HIGH, k, FIRST] = ahead[k + 1, _RIGHT], ahead[k + 1, _LEFT]
        limits[SOFTNESS, k, COUPLED] = 1.0 / (_BEYOND_RATE * effort[k])
        limits[SOFTNESS, k, LAST] = 1.0 / (_BEYOND * weights[k + 1, last])
        limits[SOFTNESS, k, FIRST] = 1.0 / (_BEYOND * weights[k + 1, 0])


@kernel
def _track(tick: Tick) -> None:
    """Steer by a plan near the line, and slow where it leaves the room there."""
    driver, reference, state = tick.driver, tick.reference, tick.state
    planned, state.planned = state.planned, False
    if is_ahead(reference) and reference.off_line < (ROOM if planned else OFF_LINE):
        state.planned = planned
        reference.steering_angle, speed, reference.plan = plan_steering(
            tick.line, reference.point, tick.odometry, driver, period_of(tick.geometry), state
        )
        reference.speed, reference.own_speed = min(reference.speed, speed), min(reference.own_speed, speed)


TRACK = Stage(after_reference=_track, state_type=MPC)
"""The tracker as a stage of driving, by which pure pursuit steers along its line."""
