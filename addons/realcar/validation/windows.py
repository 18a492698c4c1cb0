"""The windows and steady states of recorded drives, from whose recorded states models are driven.

The motion of a drive is smoothed from its poses, gyro and speed (`identification.smoothed_motion`), because no sensor
measures the lateral velocity that a window starts with. Windows of 1, 2 and 5 s follow each other without a gap while
the car moves forward, its poses do not jump and it hits nothing. A steady state is a stretch in which steering, speed
and yaw rate hardly change.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import CarParameters, FloatArray
from fg_mujoco.vehicle.command_response import CommandResponse

from ..drives.drive_recording import RecordedDrive
from ..identification.drive_log import Drive
from ..identification.smoothed_motion import Motion, smooth
from ..identification.steering_response import Steering

PERIOD = 0.01
"""[s] Between two commands of a window, and two comparisons."""

LENGTHS = (1.0, 2.0, 5.0)
"""[s] Of windows."""

STEADY_SECONDS = 2.5
"""[s] For which a model is driven from a steady state; the last STEADY_MEAN of them count."""
STEADY_MEAN = 0.5

COMMAND_SPEED, HOLD_SPEED, ACCELERATE = range(3)
"""How a model is driven: by commanded speeds, at speeds that are held, or by accelerations of its motor."""

_SLOWEST = 1.0  # [m/s] at which a window starts, and
_LEAST = 0.5  # below which none goes on: models switch there to a kinematic one
_SPIN = 0.7  # [rad] of sideslip, at which no window starts: the car has lost its tires
_JUMP = 0.25  # [m] between a pose and the smoothed path
_HIT = 12.0  # [m/s^2] smoothed, more than tires of friction 1.2 hold: the car hits something, or its poses jump
_AROUND_HIT = 10  # periods before and after it
_STEADY = 1.0  # [s] of a steady state
_SAME_STEERING = 0.02  # [rad] range of its commands
_DRIFT = 0.1  # [-] of their mean: greatest drift of speed and yaw rate over a steady state, by a line through them
_SPREAD = 0.08  # [-] of their mean: greatest standard deviation about that line
_TURNS = 0.3  # [rad/s] least yaw rate of one


@dataclass(frozen=True, kw_only=True, eq=False)
class DriveMotion:
    """A drive on a grid of PERIOD, the reference of models; arrays (n,)."""

    drive: RecordedDrive
    time: FloatArray  # [s]
    x: FloatArray  # [m] of base_link, smoothed
    y: FloatArray  # [m]
    heading: FloatArray  # [rad]
    forward_speed: FloatArray  # [m/s] smoothed
    lateral_speed: FloatArray  # [m/s] of base_link, smoothed
    yaw_rate: FloatArray  # [rad/s] smoothed
    lateral_acceleration: FloatArray  # [m/s^2] of the centre of gravity, smoothed
    slip_angle: FloatArray  # [rad] of the centre of gravity, smoothed
    speed: FloatArray  # [m/s] as recorded
    gyro: FloatArray  # [rad/s] as recorded
    steering: FloatArray  # [rad] as recorded: what the servo was sent, or a measured angle
    wheel_command: FloatArray  # [rad] what the servo turns the wheels to when it is sent that
    wheel_angle: FloatArray  # [rad] of the front wheels, which follow it with the servo's delay, lag and greatest rate
    speed_command: FloatArray | None  # [m/s]
    acceleration: FloatArray | None  # [m/s^2] by the motor, as the car answers the accelerations that it was sent
    jumps: NDArray[np.bool_]  # whether the poses are far from the smoothed path, or the car hits something

    @property
    def commanded(self) -> tuple[int, FloatArray]:
        """How the recorded commands drive a model, and with what [m/s, m/s^2]; the speed is held if there are none."""
        if self.acceleration is not None:
            return ACCELERATE, self.acceleration
        return (HOLD_SPEED, self.speed) if self.speed_command is None else (COMMAND_SPEED, self.speed_command)


@dataclass(frozen=True, kw_only=True)
class Window:
    """A part of a drive that models are driven through, from its recorded state."""

    drive: int  # number of the drive
    first: int  # row of its DriveMotion
    count: int  # rows after it


@dataclass(frozen=True, kw_only=True)
class SteadyState:
    """A stretch in which a car held a circle: means of what was recorded."""

    drive: int
    first: int
    count: int
    steering: float  # [rad] as recorded
    wheel_command: float  # [rad] that the servo makes of it
    speed: float  # [m/s]
    yaw_rate: float  # [rad/s]
    lateral_acceleration: float  # [m/s^2] speed times yaw rate
    slip_angle: float  # [rad]


def motion_of(
    drive: RecordedDrive, car: CarParameters, vehicle: str, response: CommandResponse | None = None
) -> DriveMotion:
    """Return the smoothed motion of a drive; without `response` the car obeys at once; SettingsError: no poses."""
    if drive.pose is None:
        raise SettingsError(f"{drive.name}: has no poses; accepted: poses that were measured against the surroundings")
    motion: Motion = smooth(Drive.of_recorded(drive, car, vehicle))
    first, last = motion.time[[0, -1]]
    time = np.asarray(first + PERIOD * np.arange(int((last - first) / PERIOD + 1e-6)))
    ahead, poses = car.rear_axle_distance, drive.pose.at(time)

    def of(values: FloatArray) -> FloatArray:
        return np.asarray(np.interp(time, motion.time, values))

    heading, yaw_rate, forward, lateral = map(
        of, (motion.heading, motion.yaw_rate, motion.forward_speed, motion.lateral_speed)
    )
    x, y = of(motion.x) - ahead * np.cos(heading), of(motion.y) - ahead * np.sin(heading)
    hits = np.hypot(of(motion.forward_acceleration), of(motion.lateral_acceleration)) > _HIT
    near = np.convolve(hits, np.ones(2 * _AROUND_HIT + 1), "same") > 0.5
    jumps = near | (np.hypot(x - poses[:, 0], y - poses[:, 1]) > _JUMP)
    steering = (drive.steering.held if drive.commanded else drive.steering.at)(time)[:, 0]
    response = response or CommandResponse()
    if not drive.sent_to_servo:
        response = replace(response, steering_gain=1.0, steering_offset=0.0)
    wheels = Steering(
        drive.steering, time, limit=car.max_steering_angle, held=drive.commanded,
        rate=car.max_steering_rate if drive.commanded else math.inf,
    )  # fmt: skip
    lag, late = (response.steering_lag, response.steering_delay) if drive.commanded else (0.0, 0.0)
    acceleration = None
    if drive.acceleration_command is not None:
        before = time - response.acceleration_delay
        acceleration = response.acceleration(drive.acceleration_command.held(before)[:, 0])
    return DriveMotion(
        drive=drive, time=time, x=x, y=y, heading=heading, forward_speed=forward,
        lateral_speed=lateral - ahead * yaw_rate, yaw_rate=yaw_rate,
        lateral_acceleration=of(motion.lateral_acceleration), slip_angle=np.arctan2(lateral, forward),
        speed=drive.speed.at(time)[:, 0], gyro=drive.yaw_rate.at(time)[:, 0], steering=steering,
        wheel_command=response.wheel_angle(steering),
        wheel_angle=wheels.angles(response.steering_gain, response.steering_offset, lag, late),
        speed_command=None if drive.speed_command is None else drive.speed_command.held(time)[:, 0],
        acceleration=acceleration, jumps=jumps,
    )  # fmt: skip


def windows_of(motions: Sequence[DriveMotion], length: float) -> list[Window]:
    """Return the windows of some drives, of a length [s]."""
    count, found = round(length / PERIOD), []
    for number, motion in enumerate(motions):
        usable = (motion.forward_speed > _LEAST) & (motion.speed > _LEAST) & ~motion.jumps
        starts = usable & (motion.forward_speed > _SLOWEST) & (np.abs(motion.slip_angle) < _SPIN)
        bad = np.concatenate(([0], np.cumsum(~usable)))
        first = 0
        while first + count < len(motion.time):
            if not starts[first]:
                first += 1
            elif bad[first + count + 1] > bad[first]:
                first += 1 + int(np.flatnonzero(~usable[first : first + count + 1])[-1])
            else:
                found.append(Window(drive=number, first=first, count=count))
                first += count
    return found


def steady_states_of(motions: Sequence[DriveMotion]) -> list[SteadyState]:
    """Return the steady states of some drives, of _STEADY seconds each, that do not overlap."""
    found, count = [], round(_STEADY / PERIOD)
    for number, motion in enumerate(motions):
        first = 0
        while first + count < len(motion.time):
            part = slice(first, first + count)
            speed, turning = motion.speed[part], motion.gyro[part]
            held = np.ptp(motion.steering[part]) <= _SAME_STEERING and not motion.jumps[part].any()
            moves = speed.mean() > _SLOWEST and abs(turning.mean()) > _TURNS
            if not (held and moves and _steady(speed) and _steady(turning)):
                first += 10
                continue
            found.append(
                SteadyState(
                    drive=number, first=first, count=count, steering=float(motion.steering[part].mean()),
                    wheel_command=float(motion.wheel_command[part].mean()), speed=float(speed.mean()),
                    yaw_rate=float(turning.mean()),
                    lateral_acceleration=float((speed * turning).mean()),
                    slip_angle=float(motion.slip_angle[part].mean()),
                )
            )  # fmt: skip
            first += count
    return found


def _steady(values: FloatArray) -> bool:
    """Return whether values hardly drift and spread."""
    along = np.linspace(-0.5, 0.5, len(values))
    mean = float(values.mean())
    slope = float(along @ (values - mean) / (along @ along))
    spread = float(np.std(values - mean - slope * along))
    return abs(slope) <= _DRIFT * abs(mean) and spread <= _SPREAD * abs(mean)
