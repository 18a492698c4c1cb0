"""Lap trial: on tires that need slip angles, the planner simulates its own lap on a line before it follows the line.

    state = try_lap(line, lap, walls, limiter, max_speed, period)  # in every tick until it is not TRYING

A car on soft tires answers late: on less than 20 /rad of cornering stiffness it can swing off a line that its friction
allows. So two laps are simulated, 40 ticks in each tick: the steering and the friction limiter as they drive on the
line, the servos, and a single-track model. Its axles have the tires that the planner is told of, with their relaxation
length; what drives or brakes an axle leaves it less lateral force. The line holds where the outline of the car stays
clear of all that the first lap saw.

Source: the single-track model with relaxation of H. Pacejka, Tire and Vehicle Dynamics, 2012, chapters 1 and 7.

Limits: the two wheels of an axle have one load, the axles share drive and brakes alike, as without a shaft, and the
LiDAR is not late. Of 60 lines that cars without a shaft followed whatever the trial said, on nine sets of tires, it
refused all 19 that ended in a crash or a turn, and 13 of the 41 others, with 2 cm to what was seen.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

from ..control.planner_settings import Record
from ..control.slip import arc_angle, drag, steered, velocity_angle
from ..control.steering import saturate
from ..control.tracking import HEADING, X, Y, next_point
from ..perception.lap_map import BEAMS, nearest_place
from .friction_limiter import LIMITER_MEMORY, limited
from .line_following import LEAVES, line_ahead, position_on, reference_on

_LAPS = 2.0
_TICKS = 40  # that are simulated in a tick
_STEPS = 10  # of the model in a tick
_CLEAR = 0.07  # [m] between the car and what was seen: a line that barely holds is not followed
_BEHIND, _AHEAD = 3, 5  # places whose beams are looked at
_START = 1.0  # [m/s]
_DELAYED = 8  # commands that are kept

TRYING, HOLDS, FAILS = range(3)
"""Of a trial: it goes on, the line holds, or it does not."""

TRIAL = np.dtype(
    [
        ("state", np.int64),  # TRYING, HOLDS or FAILS
        ("begun", np.bool_),
        ("way", np.float64),  # [m] driven
        ("x", np.float64),  # [m] of the rear axle
        ("y", np.float64),  # [m]
        ("heading", np.float64),  # [rad]
        ("speed", np.float64),  # [m/s] forward
        ("sideways", np.float64),  # [m/s] of the centre of gravity, to the left
        ("yaw_rate", np.float64),  # [rad/s]
        ("steering", np.float64),  # [rad]
        ("slip", np.float64, (2,)),  # [rad] of the front and the rear tires, behind the slip angles
        ("next", np.int64),  # point of the line
        ("place", np.int64),  # of the lap, the nearest
        ("commands", np.float64, (_DELAYED, 2)),  # the last ones, the newest first
        ("memory", LIMITER_MEMORY),
    ]
)
"""Type of a trial; zero at the beginning."""


@kernel
def try_lap(line: Record, lap: Record, walls: FloatArray, limiter: Record, max_speed: float, period: float) -> int:
    """Simulate a part of the laps on a line; return TRYING, HOLDS or FAILS.

    Args:
      line: of type lap_raceline.LINE, ready; its `trial` is written to.
      lap: of type LAP_MAP, closed.
      walls: where the beams of the first lap ended, see `lap_map.walls_of`.
      limiter: of type LIMITER, of a car on the line.
      max_speed: of the planner [m/s].
      period: of a tick [s].
    """
    trial = line.trial
    if not trial.begun:
        start = line_ahead(line, 1, 0.0, 0.0, 0.0, limiter)[0]
        trial.begun, trial.way, trial.next, trial.place = True, 0.0, 1, 0
        trial.x, trial.y, trial.heading = start[X], start[Y], start[HEADING]
        trial.speed, trial.sideways, trial.yaw_rate, trial.steering = _START, 0.0, 0.0, 0.0
        trial.slip[:], trial.commands[:], trial.commands[:, 1] = 0.0, 0.0, _START
        trial.memory.acceleration = trial.memory.lateral_use = trial.memory.curvature = 0.0
    for _ in range(_TICKS):
        if trial.state == TRYING:
            if not _command(line, limiter, max_speed, period):
                trial.state = FAILS
                break
            for step in range(_STEPS):
                move_car(trial, limiter, step * period / _STEPS, period)
            if _touches(trial, lap, walls, limiter.car):
                trial.state = FAILS
            elif trial.way > _LAPS * line.spacing * line.count:
                trial.state = HOLDS
    return int(trial.state)


@kernel
def _command(line: Record, limiter: Record, max_speed: float, period: float) -> bool:
    """Keep the command of a tick, as on the line; return whether the car is still on it."""
    trial, slip, car = line.trial, limiter.slip, limiter.car
    now, spacing = trial.speed, line.spacing
    heading = trial.heading + velocity_angle(slip, car, now, trial.yaw_rate)
    window = line_ahead(line, trial.next, trial.x, trial.y, heading, limiter)
    point = next_point(window, 1, 0.0, 0.0, 0.0)
    trial.next = (trial.next + point - 1) % line.count
    position, aside, turned = position_on(window, point, spacing)
    if not abs(aside) < LEAVES:  # nor is NaN
        return False
    steering, speed, _ = reference_on(window, position, aside, turned, spacing, limiter, now, True)
    angle, trial.memory.curvature = arc_angle(slip, car, trial.steering, now), trial.yaw_rate / max(now, _START)
    wanted = (steering, min(speed, max_speed))
    steering, speed = limited(limiter, trial.memory, wanted, 1.0, (angle, now), period, False)
    trial.commands[1:] = trial.commands[:-1].copy()
    trial.commands[0, 0], trial.commands[0, 1] = steered(slip, car, steering, now), speed
    return True


@kernel
def move_car(trial: Record, limiter: Record, since: float, period: float) -> None:
    """Move the car by a step of the model, which begins some time [s] after the last command."""
    car, slip, step = limiter.car, limiter.slip, period / _STEPS
    late = math.ceil((car.command_delay - since) / period - 1e-9)
    command = trial.commands[min(max(late, 0), _DELAYED - 1)]
    turn = saturate((command[0] - trial.steering) / car.steering_time_constant, car.max_steering_rate)
    trial.steering = saturate(trial.steering + turn * step, car.max_steering_angle)
    v = max(trial.speed, 0.3)
    most = car.max_acceleration * min(car.power_limit_speed / v, 1.0)
    drive = saturate((command[1] - trial.speed) / car.speed_time_constant, most) - drag(car, trial.speed)
    lf, lr, b, height = car.front_axle_distance, car.rear_axle_distance, car.wheelbase, car.center_of_gravity_height
    front_angle = trial.steering - math.atan2(trial.sideways + lf * trial.yaw_rate, v)
    rear_angle = -math.atan2(trial.sideways - lr * trial.yaw_rate, v)
    ahead = v * step / slip.relaxation_length
    trial.slip[0] = (trial.slip[0] + ahead * front_angle) / (1.0 + ahead)
    trial.slip[1] = (trial.slip[1] + ahead * rear_angle) / (1.0 + ahead)
    front = _force(slip.front, trial.slip[0], (car.gravity * lr - drive * height) / b, drive)
    rear = _force(slip.rear, trial.slip[1], (car.gravity * lf + drive * height) / b, drive)
    cos, sin = math.cos(trial.steering), math.sin(trial.steering)
    trial.sideways += step * (front * cos + rear - trial.speed * trial.yaw_rate)
    trial.yaw_rate += step * car.mass * (lf * front * cos - lr * rear) / car.yaw_inertia
    trial.speed += step * (drive - front * sin + trial.sideways * trial.yaw_rate)
    aside = trial.sideways - lr * trial.yaw_rate
    trial.heading += step * trial.yaw_rate
    cos, sin = math.cos(trial.heading), math.sin(trial.heading)
    trial.x += step * (trial.speed * cos - aside * sin)
    trial.y += step * (trial.speed * sin + aside * cos)
    trial.way += step * trial.speed


@kernel
def _force(axle: Record, slip: float, load: float, drive: float) -> float:
    """Return the lateral force of an axle over the car's mass [m/s^2]; load and drive are over it, too."""
    if axle.C == 0.0:
        return float(load * saturate(axle.B * slip, axle.D))
    used = min(0.5 * abs(drive) / (axle.D * max(load, 1e-3)), 0.99)
    return float(load * math.sqrt(1.0 - used * used) * axle.D * math.sin(axle.C * math.atan(axle.B * slip)))


@kernel
def _touches(trial: Record, lap: Record, walls: FloatArray, car: Record) -> bool:
    """Return whether the end of a beam of the first lap lies within the car's outline, or near to it."""
    trial.place, _ = nearest_place(lap, trial.place, trial.x, trial.y, math.nan)
    cos, sin = math.cos(trial.heading), math.sin(trial.heading)
    half, tail = 0.5 * car.width + _CLEAR, car.rear_overhang + _CLEAR
    nose = car.length - car.rear_overhang + _CLEAR
    for more in range(-_BEHIND, _AHEAD + 1):
        ends = walls[(trial.place + more) % lap.count]
        for beam in range(BEAMS):
            dx, dy = ends[beam, 0] - trial.x, ends[beam, 1] - trial.y
            if -tail < cos * dx + sin * dy < nose and abs(cos * dy - sin * dx) < half:  # nor is NaN
                return True
    return False
