"""Drives windows with one of our cars: all of them as worlds of one batch of the engine."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from fg_mujoco.course.open_ground import OpenGround
from fg_mujoco.messages import CarParameters, FloatArray
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.physics import STATE
from fg_mujoco.simulation.settings import Start
from fg_mujoco.simulation.world import World
from fg_mujoco.vehicle.command_response import CommandResponse
from fg_mujoco.vehicle.motion import surface_speed
from fg_mujoco.vehicle.tires import Tires
from fg_mujoco.vehicle.vehicle import Vehicle

from .windows import ACCELERATE, HOLD_SPEED, PERIOD

SIGNALS = ("x", "y", "heading", "forward_speed", "lateral_speed", "yaw_rate")
"""Columns of a simulated motion: base_link's pose [m, m, rad], its velocity [m/s] and the yaw rate [rad/s]."""

BEFORE = 16
"""Periods before a start whose commands are known: as late as a servo may be."""

_GAIN = 3.0  # [1/s] by which the command makes up for a speed that is to be held
_SMOOTHED = 0.2  # of an acceleration of the wheels, each period: over 0.05 s


@dataclass(frozen=True, kw_only=True, eq=False)
class Task:
    """What models are driven through: n starts, and their commands, of which those of BEFORE periods come first."""

    starts: FloatArray  # (n, 7) SIGNALS, and the angle of the front wheels [rad]
    counts: FloatArray  # (n,) periods that each lasts
    steering: FloatArray  # (n, BEFORE + k) [rad] angle of the wheels that is commanded
    drive: FloatArray  # (n, BEFORE + k) [m/s] commanded or to be held, or [m/s^2] by the motor
    kinds: NDArray[np.int64]  # (n,) which of them: COMMAND_SPEED, HOLD_SPEED or ACCELERATE


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class CarModel:
    """One of our cars on its tires; SettingsError, ModelError: a vehicle, tires or friction that there are not."""

    vehicle: Vehicle
    tires: Tires
    mu: float | None = None  # [-] None: as in the file of the tires, or of the vehicle
    threads: int = 1

    @property
    def name(self) -> str:
        """Vehicle and tires."""
        return f"{self.vehicle.name} on {self.tires.name}"

    @property
    def car(self) -> CarParameters:
        """The car's constants."""
        return self.vehicle.parameters

    @property
    def response(self) -> CommandResponse:
        """How the car answers commands."""
        return self.vehicle.command_response

    @property
    def friction(self) -> float:
        """The friction of the tires: the greatest peak of those with a curve [-]."""
        return float(self._world().car.mu)

    def _world(self) -> World:
        return World(OpenGround(seconds=3600.0), self.vehicle, mu=self.mu, tires=self.tires)

    def simulate(self, task: Task, watch: Callable[[int, int], None] | None = None) -> FloatArray:
        """Return SIGNALS at the start and after each period, NaN after the end. Shape (n, k + 1, 6)."""
        world, count = self._world(), len(task.starts)
        engine = Engine(world, count, period=PERIOD, threads=self.threads)
        try:
            return self._driven(engine, world, task, watch)
        finally:
            engine.close()

    def _driven(
        self, engine: Engine, world: World, task: Task, watch: Callable[[int, int], None] | None
    ) -> FloatArray:
        count, periods = len(task.starts), task.steering.shape[1] - BEFORE
        held, accelerate = task.kinds == HOLD_SPEED, task.kinds == ACCELERATE
        tau = world.parameters.speed_time_constant
        # The servo accelerates by (set point - wheel speed) / tau. A set point that was under way and is held for a
        # period is old by this time in the mean, and the wheels' acceleration, which is smoothed, has gone on.
        step, servo = world.model.opt.timestep, int(world.car.constants[0]["speed_ctrl"])
        late = step * math.ceil(float(world.model.actuator_delay[servo]) / step - 1e-9)
        old, goes_on = late + 0.5 * PERIOD, np.zeros(count)
        engine.place([Start(s=0.0, offset=0.0, heading=0.0, speed=max(float(row[3]), 0.0)) for row in task.starts])
        for number, row in enumerate(task.starts):
            _write_start(engine, number, world, row)
            if world.model.nhistory:
                speeds = task.drive[number]
                if task.kinds[number] == ACCELERATE:
                    speeds = max(float(row[3]), 0.0) + tau * speeds
                _write_history(engine, number, world, task.steering[number], speeds)
        found = np.full((count, periods + 1, len(SIGNALS)), np.nan)
        poses, velocities = np.zeros((count, 3)), np.zeros((count, 3))
        missing = np.zeros(count)
        constants = world.car.constants
        wheel_speeds = np.array([surface_speed(engine.qvel(number), constants) for number in range(count)])
        turned, before = np.zeros(count), task.starts[:, 2].copy()
        for period in range(periods + 1):
            which = engine.running & (task.counts >= period)
            engine.running[:] = which
            engine.read_motions(which, poses, velocities)
            turned += np.where(which, np.remainder(poses[:, 2] - before + np.pi, 2.0 * np.pi) - np.pi, 0.0)
            before[which] = poses[which, 2]
            now = np.column_stack((poses[:, :2], task.starts[:, 2] + turned, velocities))
            found[which, period] = now[which]
            engine.running[:] = which = which & (task.counts > period)
            if period == periods or not which.any():
                break
            wanted = task.drive[:, BEFORE + period]
            after = task.drive[:, min(BEFORE + period + 1, task.drive.shape[1] - 1)]
            missing += np.where(held, wanted - velocities[:, 0], 0.0) * PERIOD
            rising = (after - wanted) / PERIOD
            last = wheel_speeds.copy()
            for number in np.flatnonzero(which & accelerate).tolist():
                wheel_speeds[number] = surface_speed(engine.qvel(number), constants)
            goes_on += _SMOOTHED * (old * (wheel_speeds - last) / PERIOD - goes_on)
            engine.commands[:, 0] = task.steering[:, BEFORE + period]
            engine.commands[:, 1] = np.select(
                (held, accelerate),
                (wanted + tau * rising + _GAIN * missing, wheel_speeds + goes_on + tau * wanted),
                wanted,
            )
            engine.drive()
            if watch is not None:
                watch(period, periods)
        return found


def _write_start(engine: Engine, number: int, world: World, row: FloatArray) -> None:
    """Write a recorded state into a world whose car stands on its springs: pose, velocity, wheels and steering."""
    x, y, heading, forward, lateral, yaw_rate, angle = row.tolist()
    model, car, parameters = world.model, world.car.constants[0], world.parameters
    qpos, qvel = engine.qpos(number), engine.qvel(number)
    cos, sin, free = math.cos(heading), math.sin(heading), int(car["free_qpos"])
    qpos[free : free + 2] = x, y
    qpos[free + 3 : free + 7] = math.cos(0.5 * heading), 0.0, 0.0, math.sin(0.5 * heading)
    dof = int(car["free_dof"])
    qvel[dof : dof + 2] = forward * cos - lateral * sin, forward * sin + lateral * cos
    qvel[dof + 5] = yaw_rate
    qpos[int(car["steering_qpos"])] = angle
    for constraint in range(model.neq):  # the kingpins follow the steering by polynomials
        if model.eq_type[constraint] != mujoco.mjtEq.mjEQ_JOINT:
            continue
        joints = model.eq_obj1id[constraint], model.eq_obj2id[constraint]
        follows, leads = (int(model.jnt_qposadr[joint]) for joint in joints)
        away = qpos[leads] - model.qpos0[leads]
        qpos[follows] = model.qpos0[follows] + float(np.polyval(model.eq_data[constraint, :5][::-1], away))
    half = 0.5 * parameters.track_width
    for place, (ahead, left) in enumerate(((1.0, 1.0), (1.0, -1.0), (0.0, 1.0), (0.0, -1.0))):  # as WHEELS
        along = forward - left * half * yaw_rate
        across = lateral + ahead * parameters.wheelbase * yaw_rate
        turned = ahead * angle
        qvel[int(car["wheel_dofs"][place])] = (along * math.cos(turned) + across * math.sin(turned)) / (
            parameters.wheel_radius
        )
    ctrl = engine.ctrl(number)
    ctrl[int(car["steering_ctrl"])], ctrl[int(car["speed_ctrl"])] = angle, forward


def _write_history(engine: Engine, number: int, world: World, steering: FloatArray, speed: FloatArray) -> None:
    """Write the commands before a start into the history of late servos."""
    model, car = world.model, world.car.constants[0]
    data = mujoco.MjData(model)
    mujoco.mj_setState(model, data, engine.state(number), int(STATE))
    for servo, values in ((int(car["steering_ctrl"]), steering), (int(car["speed_ctrl"]), speed)):
        count = int(model.actuator_history[servo, 0])
        if count == 0:  # this one is not late
            continue
        times = -model.opt.timestep * np.arange(count, 0, -1)
        places = np.clip(BEFORE + np.floor(times / PERIOD + 1e-9).astype(int), 0, BEFORE - 1)
        mujoco.mj_initCtrlHistory(model, data, servo, times[:, np.newaxis], values[places][:, np.newaxis])
    mujoco.mj_getState(model, data, engine.state(number), int(STATE))
