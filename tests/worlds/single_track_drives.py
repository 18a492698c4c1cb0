"""Drives of an independent single-track car with Magic Formula axles, and its noisy sensors.

CommonRoad's equations as in ForzaETH's On-Track-SysID, with a first-order lag of the steering. Nothing of fg_mujoco's
own model is used: only the containers that a drive is handed over in.
"""

import math
from dataclasses import replace

import numpy as np

from fg_mujoco.addons.realcar.drives.channels import Channel
from fg_mujoco.addons.realcar.identification.drive_log import Drive
from fg_mujoco.vehicle.vehicle import Vehicle

FINE = 0.005  # [s] between the states that are kept
FINER = 4  # steps from one to the next
STEP = FINE / FINER
_SOLVED = {}


def random_set(seed):
    """A set that resembles real ones, with a rear axle that holds at least as well as the front."""
    rng = np.random.default_rng(seed)
    front = (rng.uniform(6, 11), rng.uniform(1.2, 1.7), rng.uniform(0.6, 1.1), rng.uniform(0.0, 0.8))
    rear = (rng.uniform(7, 12), rng.uniform(1.3, 1.9), front[2] * rng.uniform(1.0, 1.12), rng.uniform(0.0, 0.8))
    return front, rear, (rng.uniform(3.4, 4.5), rng.uniform(0.045, 0.065), 0.165, 0.155, rng.uniform(0.01, 0.08))


def magic_formula(slip, tire):
    b, c, d, e = tire
    return d * np.sin(c * np.arctan(b * slip - e * (b * slip - np.arctan(b * slip))))


def friction(slip, tire):
    """The same of one slip, in numbers of Python."""
    b, c, d, e = tire
    return d * math.sin(c * math.atan(b * slip - e * (b * slip - math.atan(b * slip))))


def limit(tires):
    """The greatest lateral acceleration of both axles, in g."""
    slips = np.linspace(0.0, 0.6, 601)
    return min(magic_formula(slips, tire).max() for tire in tires[:2])


def exciting(seed, tires, seconds=60.0):
    """Commands at 40 Hz, (time, steering angle, speed): ramps, slaloms and steps to both sides, up to past the peak."""
    rng = np.random.default_rng(seed)
    length = sum(tires[2][2:4])
    time = np.arange(0.0, seconds, 0.025)
    steering, speed = np.zeros(len(time)), np.full(len(time), 3.0)
    at, kind, side = 2.0, 0, 1.0
    while at < seconds - 1.0:
        v = rng.uniform(*((2.5, 5.0), (3.5, 7.0), (3.5, 7.0), (7.5, 10.0))[kind % 4])
        holds = np.arctan(limit(tires) * 9.81 * length / v**2)  # kinematic steering angle at the limit [rad]
        lasts = (3.0, 2.0, 1.0, 1.2)[kind % 4]
        now = (time >= at) & (time < at + lasts)
        after = time[now] - at
        if kind % 4 == 0:  # ramp
            steering[now] = side * np.minimum(2.0 * holds * after / lasts, 0.4)
        elif kind % 4 == 1:  # slalom
            rate = rng.uniform(0.7, 2.0)
            steering[now] = side * min(rng.uniform(0.8, 2.0) * holds, 0.4) * np.sin(2.0 * np.pi * rate * after)
        elif kind % 4 == 2:  # step
            steering[now] = side * min(rng.uniform(0.7, 2.0) * holds, 0.4)
        else:  # flicks: from one side to the other as fast as the servo goes
            rate = rng.uniform(1.5, 3.0)
            steering[now] = side * rng.uniform(0.3, 0.4) * np.sign(np.sin(2.0 * np.pi * rate * after))
        speed[time >= at - (1.4 if kind % 4 == 3 else 0.5)] = v
        at, kind, side = at + lasts + (1.5 if kind % 4 == 2 else 0.6), kind + 1, -side if rng.random() < 0.6 else side
    return time, steering, speed


def lap(seconds=20.0):
    """Commands of a lap that no drive of `exciting` has: curves of varied radius, at speeds that vary with them."""
    time = np.arange(0.0, seconds, 0.025)
    steering = 0.12 * np.sin(0.9 * time) + 0.08 * np.sin(2.3 * time + 1.0) * (time > 1.0)
    return time, steering, 4.2 - 6.0 * np.abs(steering)


def solve(commands, tires, *, lag=0.1, gain=1.0, offset=0.0, rate=3.2):
    """Drive the commands, each held for its tick of 25 ms; return the steering that was commanded, and every FINE the
    states (7, n): x, y, heading of the centre of gravity, v_x, v_y, yaw rate, steering; and a_x, a_y (2, n).

    The driver steers along the way that the front axle moves while the car slides by more than .35 rad.
    The same drive is solved once.
    """
    asked = (*(each.tobytes() for each in commands), tires, lag, gain, offset, rate)
    if asked not in _SOLVED:
        _SOLVED[asked] = _solve(commands, tires, lag, gain, offset, rate)
    return _SOLVED[asked]


def _solve(commands, tires, lag, gain, offset, rate):
    (front, rear, (mass, inertia, lf, lr, h)), g = tires, 9.81
    time, steering, speed = commands
    steering = steering.copy()

    def motion(state, command, wanted):  # of numbers of Python, which are ten times as fast here as those of numpy
        _, _, heading, vx, vy, r, delta = state
        drive = min(max(5.0 * (wanted - vx), -6.0), 6.0)  # of rear wheels, per mass
        safe = max(vx, 0.8)  # below 1 m/s nothing is identified
        slip_f, slip_r = delta - math.atan2(vy + lf * r, safe), -math.atan2(vy - lr * r, safe)
        muf, mur = friction(slip_f, front), friction(slip_r, rear)
        cos_delta, sin_delta = math.cos(delta), math.sin(delta)
        # a_x = drive - F_yf sin(delta) / m with F_zf of a_x: solved for it
        share = muf * sin_delta / (lf + lr)
        ax = (drive - share * g * lr) / (1.0 - share * h)
        force_f = mass * (g * lr - ax * h) / (lf + lr) * muf
        force_r = mass * (g * lf + ax * h) / (lf + lr) * mur
        ay = (force_f * cos_delta + force_r) / mass
        turn = (lf * force_f * cos_delta - lr * force_r) / inertia
        steer = min(max((gain * command + offset - delta) / lag, -rate), rate)
        cos, sin = math.cos(heading), math.sin(heading)
        return vx * cos - vy * sin, vx * sin + vy * cos, r, ax + vy * r, ay - vx * r, turn, steer

    def moved(state, rates, seconds):
        return [value + seconds * change for value, change in zip(state, rates, strict=True)]

    state = [0.0, 0.0, 0.0, 3.0, 0.0, 0.0, offset]
    states, accelerations, caught = [], [], False
    for tick in range(len(time) - 1):
        slides = abs(math.atan2(state[4], state[3]))
        caught = slides > 0.35 or (caught and slides > 0.1)
        if caught:
            along = math.atan2(state[4] + lf * state[5], state[3]) if state[3] > 1.0 else 0.0
            steering[tick] = min(max((along - offset) / gain, -0.4), 0.4)
        inputs = (float(steering[tick]), float(speed[tick]))
        for number in range(5 * FINER):  # of Runge and Kutta, of the fourth order
            first = motion(state, *inputs)
            if number % FINER == 0:
                states.append(state)
                accelerations.append((first[3] - state[4] * state[5], first[4] + state[3] * state[5]))
            second = motion(moved(state, first, 0.5 * STEP), *inputs)
            third = motion(moved(state, second, 0.5 * STEP), *inputs)
            last = motion(moved(state, third, STEP), *inputs)
            state = [
                value + STEP / 6.0 * (a + 2.0 * b + 2.0 * c + d)
                for value, a, b, c, d in zip(state, first, second, third, last, strict=True)
            ]
    return steering, np.array(states).T, np.array(accelerations).T


def car_of(tires):
    mass, inertia, lf, lr, h = tires[2]
    return replace(Vehicle.load("nuc2").parameters, mass=mass, yaw_inertia=inertia, front_axle_distance=lf,
                   rear_axle_distance=lr, wheelbase=lf + lr, center_of_gravity_height=h, max_steering_angle=0.42,
                   max_steering_rate=3.2, gravity=9.81, drives_front=False, shaft=False)  # fmt: skip


def recorded(commands, tires, *, seed=0, noise=1.0, **steering):
    """What a car records: gyro .01 rad/s, accelerometer .2 m/s^2, wheels .05 m/s, poses of 2 cm and .01 rad."""
    rng = np.random.default_rng(seed)
    commanded, states, accelerations = solve(commands, tires, **steering)
    time = FINE * np.arange(states.shape[1])
    fast, slow = slice(0, None, 2), slice(1, None, 5)
    lr = tires[2][3]

    def channel(name, rows, values, spread):
        values = np.atleast_2d(values).T
        return Channel(name=name, time=time[rows], values=values + noise * spread * rng.standard_normal(values.shape))

    x, y, heading = states[:3, slow]
    pose = np.array((x - lr * np.cos(heading), y - lr * np.sin(heading), heading))
    poses = channel("pose", slow, pose, np.array((0.02, 0.02, 0.01)))
    return Drive(name=f"drive {seed}", sha256="0" * 64, vehicle="nuc2", car=car_of(tires),
                 steering=Channel(name="commands", time=commands[0], values=commanded[:, np.newaxis]), commanded=True,
                 speed=channel("wheel speed", slow, states[3, slow], 0.05),
                 yaw_rate=channel("gyro", fast, states[5, fast], 0.01),
                 acceleration=channel("accelerometer", fast, accelerations[:, fast], 0.2), pose=poses)  # fmt: skip
