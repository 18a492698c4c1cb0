"""Physics steps of MuJoCo with tires that have a law of ours.

`tire_patch` has the force of a tire, whose load is that of a spring and a damper under its lowest point; `tire_solve`
the short steps of tires and drive; `tire_rows` what both read off a model. Here MuJoCo's stages are called around them.

The short steps are seen from the car, whose velocity turns the other way while it turns; `place_between` turns what it
gained. So a step is of the second order: at 5 ms the yaw rate follows the steering within .05 ms as it does at .25 ms.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from ..arguments import Suggesting
from ..compiled.kernels import kernel
from ..messages import FloatArray
from . import mujoco_stages as stages
from .car import WHEELS
from .mujoco_stages import Fields, fields
from .tire_rows import (
    ACROSS,
    ALONG,
    LOAD,
    USERDATA,
    GearRows,
    TireRows,
    gear_row,
    peaks,
    steps_within,
    take_over,
    tire_rows,
)  # fmt: skip
from .tire_solve import SCRATCH, Inertia, push_car, put_steering, steer
from .tires import tires_of

_MOST_PULL = 30.0  # [m/s^2] of a car: no tires give as much, and a wall that stops it gives more
_STILL = 1.0  # [rad/s] of a wheel: from there on it has all of its rolling resistance


class TireForces(Suggesting):
    """Steps a model by hand, the tires of its cars included; of the model `contact` as mujoco.mj_step does.

    The motor's power is limited here: mujoco.mj_step gives the full force at every speed. The model's own contacts of
    tires that have a law of ours are switched off.

    Args:
      prefix: of the car's names, or those of several cars, in their order in the model.

    Attributes:
      rows: of the tires, (cars x wheels,) of TIRE; without those of the model `contact`.
      mu: lateral peak of each of them [-], likewise; where all are of the model `contact`, of these. Live.
      steps: short ones in a physics step; None: as many as `steps_within` says. Can be set.

    Raises:
      ModelError: a time step that is too long for the tires.
    """

    def __init__(self, model: mujoco.MjModel, prefix: str | Sequence[str] = "") -> None:
        prefixes = (prefix,) if isinstance(prefix, str) else tuple(prefix)
        own = [name for name in prefixes if not tires_of(model, name).is_contact]
        self.rows: TireRows = np.concatenate([tire_rows(model, name) for name in own or prefixes[:1]])
        self.mu: FloatArray = np.concatenate([peaks(model, name) for name in own or prefixes])
        self.steps: int | None = None
        self._model, self._fields = model, fields()
        for name in own:
            take_over(model, name)
        self._gears = np.concatenate([gear_row(model, name) for name in own or prefixes])
        if own:
            self._gears["first_tire"] = range(0, len(self.rows), len(WHEELS))
            self._inertia, self._scratch = Inertia.of(model), np.zeros(SCRATCH)
            self._divided: tuple[object, ...] = ()  # what `tire_steps` was worked out for

    def _meant(self, name: str) -> str | None:
        return {"apply": "step", "end": "step"}.get(name) or super()._meant(name)

    def begin(self, data: mujoco.MjData) -> None:
        """Let the tires be as they are drawn, and work out everything of the state, sensors too."""
        if len(self.rows):
            data.eq_active[:] = self._model.eq_active0
            data.userdata[:] = 0.0
        self.forward(data)

    def forward(self, data: mujoco.MjData) -> None:
        """Work out everything of the state, sensors and tires' forces too, in the place of mujoco.mj_forward."""
        if len(self.rows):
            self._step(data, False)
        else:
            mujoco.mj_forward(self._model, data)

    def step(self, data: mujoco.MjData) -> None:
        """Do one physics step, in the place of mujoco.mj_step."""
        if len(self.rows):
            self._step(data, True)
        else:
            step_on_contacts(self._model._address, data._address, self._fields, self._gears, self._model.nv)

    def run(self, data: mujoco.MjData, records: FloatArray, states: FloatArray) -> None:
        """Do a physics step for each row of two arrays, (steps, sensordata) and (steps, userdata), written to."""
        if len(self.rows):
            arguments = (*self._arguments(data), data.sensordata, records, states)
            steps_on_tires(*arguments)
            return
        for record, state in zip(records, states, strict=True):
            self.step(data)
            record[:], state[:] = data.sensordata[: len(record)], data.userdata[: len(state)]

    def _step(self, data: mujoco.MjData, advance: bool) -> None:
        arguments = (*self._arguments(data), advance, False, True)
        step_on_tires(*arguments)

    def _arguments(self, data: mujoco.MjData) -> tuple[Any, ...]:
        """Return what kernels take to step the model."""
        model = self._model
        timestep, wheels = float(model.opt.timestep), len(WHEELS)
        masses = model.body_mass.tobytes(), model.body_subtreemass.tobytes(), model.dof_M0.tobytes()
        divided = self.steps, timestep, self.rows.tobytes(), *masses
        if divided != self._divided:
            for car, gear in enumerate(self._gears):
                own = self.rows[wheels * car : wheels * (car + 1)]
                gear["tire_steps"] = self.steps or steps_within(model, own, timestep)
            self._divided = divided
        return (
            model._address, data._address, self._fields, self._inertia, self._gears, self.rows,
            self.mu.reshape(-1, wheels), data.userdata, self._scratch, model.nv, timestep,
        )  # fmt: skip


@kernel
def damp_inertia(
    model: int, data: int, found: Fields, inertia: Inertia, gears: GearRows, dofs: int, timestep: float
) -> None:
    """Add to MuJoCo's inertia what takes joint damping implicitly, and keep joints that are put where they belong."""
    entries = len(inertia.columns)
    matrix, damping = stages.vector(data, found.inertia, entries), stages.vector(model, found.dof_damping, dofs)
    higher, qvel = stages.vector(model, found.dof_dampingpoly, 2 * dofs), stages.vector(data, found.qvel, dofs)
    for dof in range(dofs):
        slope = damping[dof] + _higher_slope(higher[2 * dof], higher[2 * dof + 1], qvel[dof])
        matrix[inertia.row_starts[dof] + inertia.row_counts[dof] - 1] += timestep * slope
    for car in range(len(gears)):
        gear = gears[car]
        if gear.steered:
            for dof in (gear.steering_dof, gear.kingpin_dof[0], gear.kingpin_dof[1]):
                matrix[inertia.row_starts[dof] + inertia.row_counts[dof] - 1] += 1.0  # [kg m^2], ten thousand times its
        elif gear.handed:
            slope = _servo_slope(model, data, found, gear, dofs)
            dof = gear.steering_dof
            matrix[inertia.row_starts[dof] + inertia.row_counts[dof] - 1] += timestep * slope
    stages.factor_inertia(model, data)
    stages.project_constraints(model, data)


@kernel
def _higher_slope(first: float, second: float, rate: float) -> float:
    """Return what the higher coefficients of a damping add to its slope at a rate."""
    slope: float = 2.0 * first * abs(rate) + 3.0 * second * rate * rate
    return slope


@kernel
def _servo_slope(model: int, data: int, found: Fields, gear: Any, dofs: int) -> float:
    """Return by how much the torque of a steering servo falls with the rate of its joint [N m s/rad]."""
    own, servo = gear.servo_damping, gear.actuator[0]
    rate = stages.vector(data, found.qvel, dofs)[gear.steering_dof]
    slope: float = own[0] + _higher_slope(own[1], own[2], rate)
    force = stages.vector(data, found.actuator_force, servo + 1)[servo]
    if gear.force_range[0, 0] < force < gear.force_range[0, 1]:  # a force at its limit does not fall
        bias = stages.vector(model, found.actuator_biasprm, 10 * servo + 10)[10 * servo + 2]
        slope -= bias * gear.servo_gear * gear.servo_gear
    return slope


@kernel
def damp_steering(
    model: int, data: int, found: Fields, inertia: Inertia, gears: GearRows, dofs: int, share: float
) -> bool:  # fmt: skip
    """Add to the inertia, `share` [s] times, what constraints lack, damping of steerings of MuJoCo's; False: none."""
    damping, qvel = stages.vector(model, found.dof_damping, dofs), stages.vector(data, found.qvel, dofs)
    higher, any_handed = stages.vector(model, found.dof_dampingpoly, 2 * dofs), False
    matrix = stages.vector(data, found.inertia, len(inertia.columns))
    for car in range(len(gears)):
        gear = gears[car]
        if gear.handed:
            any_handed = True
            for dof in (gear.steering_dof, gear.kingpin_dof[0], gear.kingpin_dof[1]):
                slope = damping[dof] + _higher_slope(higher[2 * dof], higher[2 * dof + 1], qvel[dof])
                if dof == gear.steering_dof:
                    slope += _servo_slope(model, data, found, gear, dofs)
                matrix[inertia.row_starts[dof] + inertia.row_counts[dof] - 1] += share * slope
    if any_handed:
        stages.factor_inertia(model, data)
    return any_handed


@kernel
def resist_rolling(data: int, found: Fields, tires: TireRows, own: FloatArray, dofs: int) -> None:
    """Add the tires' rolling resistance to MuJoCo's passive forces; arguments as in `push_car`."""
    for k in range(len(tires)):
        tire = tires[k]
        if tire.rolling_resistance > 0.0:
            spin = stages.vector(data, found.qvel, dofs)[tire.spin_dof]
            share = min(max(spin / _STILL, -1.0), 1.0)
            moment = tire.rolling_resistance * own[USERDATA * k + LOAD] * tire.radius
            stages.vector(data, found.qfrc_passive, dofs)[tire.spin_dof] -= moment * share


@kernel
def resist_air(data: int, found: Fields, gear: Any, dofs: int) -> None:
    """Add a car's drag to MuJoCo's passive forces: in proportion to the velocity of its centre of gravity."""
    first, axes = gear.free_dof, stages.vector(data, found.cdof, 6 * dofs)
    qvel, passive = stages.vector(data, found.qvel, dofs), stages.vector(data, found.qfrc_passive, dofs)
    for axis in range(3, 6):  # of what each dof makes of that velocity
        velocity = 0.0
        for dof in range(first, first + 6):
            velocity += axes[6 * dof + axis] * qvel[dof]
        for dof in range(first, first + 6):
            passive[dof] -= gear.drag * axes[6 * dof + axis] * velocity


@kernel
def step_on_tires(
    model: int, data: int, found: Fields, inertia: Inertia, gears: GearRows, tires: TireRows, mu: FloatArray,
    userdata: FloatArray, scratch: FloatArray, dofs: int, timestep: float, advance: bool, clear: bool, last: bool,
) -> None:  # fmt: skip
    """Do a physics step of a model whose cars have tires of ours, or only work out its forces and sensors.

    Arguments are those of `push_car`, of all cars: `gears` (m,), `tires` (k,), `mu` (m, wheels) [-], timestep [s].
    """
    count, wheels = mu.shape
    begin_step(model, data, found, clear)
    limit_power(model, data, found, gears, dofs, True)
    for car in range(count):
        gear = gears[car]
        if gear.first_tire >= 0:
            own = userdata[gear.userdata : gear.userdata + USERDATA * wheels]
            resist_rolling(data, found, tires[gear.first_tire : gear.first_tire + wheels], own, dofs)
            if gear.drag > 0.0:
                resist_air(data, found, gear, dofs)
    stages.stage_actuation(model, data)
    damp_inertia(model, data, found, inertia, gears, dofs, timestep)
    stages.stage_acceleration(model, data)
    kept, qvel = np.empty((count, 5)), stages.vector(data, found.qvel, dofs)
    for car in range(count):
        gear = gears[car]
        first = gear.first_tire
        if first >= 0:
            own = userdata[gear.userdata : gear.userdata + USERDATA * wheels]
            if not advance:
                own = own.copy()
            push_car(
                model, data, found, inertia, gear, tires[first : first + wheels], mu[car], own, scratch, dofs,
                timestep, gear.tire_steps,
            )  # fmt: skip
            if not advance:
                for k in range(len(own)):
                    if k % USERDATA not in (ALONG, ACROSS):  # the tires stay as they are
                        userdata[gear.userdata + k] = own[k]
            if gear.steered:
                kept[car, 0], kept[car, 1] = steer(model, data, found, gear, scratch, dofs, timestep, gear.tire_steps)
            if gear.free_dof >= 0:
                free = gear.free_dof
                kept[car, 2], kept[car, 3], kept[car, 4] = qvel[free], qvel[free + 1], qvel[free + 5]
    if damp_steering(model, data, found, inertia, gears, dofs, -timestep):
        stages.project_constraints(model, data)
        end_step(model, data, found, dofs, False, last)
        if advance:
            damp_steering(model, data, found, inertia, gears, dofs, timestep)
            advance_damped(model, data, found, dofs)
    else:
        end_step(model, data, found, dofs, advance, last)
    limit_power(model, data, found, gears, dofs, False)
    if advance:
        for car in range(count):
            if gears[car].first_tire >= 0 and gears[car].free_dof >= 0:
                place_between(data, found, gears[car], dofs, kept[car, 2:], timestep)
                if gears[car].steered:
                    put_steering(data, found, gears[car], dofs, kept[car, 0], kept[car, 1])


@kernel
def steps_on_tires(
    model: int, data: int, found: Fields, inertia: Inertia, gears: GearRows, tires: TireRows, mu: FloatArray,
    userdata: FloatArray, scratch: FloatArray, dofs: int, timestep: float, readings: FloatArray, records: FloatArray,
    states: FloatArray,
) -> None:  # fmt: skip
    """Do a physics step for each row of `records` and `states`; write `readings`, sensordata, and `userdata` there."""
    for step in range(len(records)):
        step_on_tires(
            model, data, found, inertia, gears, tires, mu, userdata, scratch, dofs, timestep, True, False, True
        )
        for k in range(records.shape[1]):
            records[step, k] = readings[k]
        for k in range(states.shape[1]):
            states[step, k] = userdata[k]


@kernel
def step_on_contacts(model: int, data: int, found: Fields, gears: GearRows, dofs: int) -> None:
    """Do a physics step of a model whose cars all stand on MuJoCo's contacts; arguments as of `step_on_tires`."""
    limit_power(model, data, found, gears, dofs, True)
    stages.step(model, data)
    limit_power(model, data, found, gears, dofs, False)


@kernel
def limit_power(model: int, data: int, found: Fields, gears: GearRows, dofs: int, limited: bool) -> None:
    """Write the forces that MuJoCo lets the motors push with: what their power gives now; if not `limited`, all.

    Above `power_limit_speed` the acceleration falls as power_limit_speed / speed (f1tenth_gym, CommonRoad). Braking
    keeps the full force. A motor that `push_car` drives is limited there.
    """
    qvel = stages.vector(data, found.qvel, dofs)
    for car in range(len(gears)):
        gear = gears[car]
        if gear.power > 0.0 and not gear.driven:
            speed, motor = 0.0, gear.actuator[1]
            for wheel in range(4):
                speed += gear.share[wheel, 0] * qvel[gear.spin_dof[wheel]]
            power = gear.power / max(abs(speed), 1e-9) if limited else math.inf
            forces = stages.vector(model, found.actuator_forcerange, 2 * motor + 2)
            least, most = gear.force_range[1, 0], gear.force_range[1, 1]
            forces[2 * motor] = max(least, -power) if speed < 0.0 else least
            forces[2 * motor + 1] = min(most, power) if speed > 0.0 else most


@kernel
def begin_step(model: int, data: int, found: Fields, clear: bool) -> None:
    """Do MuJoCo's stages of positions and velocities, with their sensors; `clear`: there is no contact to be found."""
    stages.check_positions(model, data)
    stages.check_velocities(model, data)
    stages.kinematics(model, data)
    stages.mass_centers(model, data)
    stages.cameras_and_lights(model, data)
    stages.tendons(model, data)
    stages.make_inertia(model, data)
    if not clear or stages.whole_number_at(data + found.contacts)[0] > 0:
        stages.find_contacts(model, data)
    stages.make_constraints(model, data)
    stages.make_islands(model, data)
    stages.transmissions(model, data)
    stages.sensors_of_position(model, data)
    stages.stage_velocity(model, data)
    stages.sensors_of_velocity(model, data)


@kernel
def end_step(model: int, data: int, found: Fields, dofs: int, advance: bool, last: bool) -> None:
    """Do MuJoCo's stages from the acceleration on; `last`: somebody reads the accelerometers of this step."""
    acceleration, smooth = stages.vector(data, found.qacc_smooth, dofs), stages.vector(data, found.qfrc_smooth, dofs)
    stages.solve_inertia(model, data, acceleration.ctypes.data, smooth.ctypes.data, 1)
    stages.stage_constraint(model, data)
    if last:
        stages.body_accelerations(model, data)  # else accelerometers keep those of the first step
    stages.sensors_of_acceleration(model, data)
    if advance:
        stages.check_accelerations(model, data)
        stages.advance(model, data)


@kernel
def advance_damped(model: int, data: int, found: Fields, dofs: int) -> None:
    """Move the state by all forces, those of constraints too, with the inertia as it is now."""
    acceleration, smooth = stages.vector(data, found.qacc, dofs), stages.vector(data, found.qfrc_smooth, dofs)
    constraint = stages.vector(data, found.qfrc_constraint, dofs)
    for dof in range(dofs):
        acceleration[dof] = smooth[dof] + constraint[dof]
    stages.solve_inertia(model, data, acceleration.ctypes.data, acceleration.ctypes.data, 1)
    stages.check_accelerations(model, data)
    stages.advance(model, data)


@kernel
def place_between(data: int, found: Fields, gear: Any, dofs: int, before: FloatArray, timestep: float) -> None:
    """Do what a car that turns does in a step, of `before` (3,), its velocities along x, y [m/s] and yaw rate [rad/s].

    Forces turn with the car: it speeds up along its mean heading, and not along that of before. It moves over the
    ground by the mean of its velocities before and after, and turns likewise: with the velocity after, a car that
    slides at v comes to rest v h / 2 too soon, and its tires answer to steering late. Not where something else than
    tires stops the car: a contact counts on it.
    """
    velocity, position = stages.vector(data, found.qvel, dofs), stages.vector(data, found.qpos, gear.free_qpos + 7)
    free = gear.free_dof
    after_x, after_y, after_turn = velocity[free], velocity[free + 1], velocity[free + 5]
    gain_x, gain_y = after_x - before[0], after_y - before[1]
    if math.hypot(gain_x, gain_y) >= _MOST_PULL * timestep:
        return
    half = 0.25 * timestep * (before[2] + after_turn)
    sin, cos = math.sin(half), math.cos(half)
    velocity[free] = before[0] + gain_x * cos - gain_y * sin
    velocity[free + 1] = before[1] + gain_y * cos + gain_x * sin
    position[gear.free_qpos] += timestep * (0.5 * (before[0] + velocity[free]) - after_x)
    position[gear.free_qpos + 1] += timestep * (0.5 * (before[1] + velocity[free + 1]) - after_y)
    quarter = 0.25 * timestep * (before[2] - after_turn)  # half of the angle
    sin, cos = math.sin(quarter), math.cos(quarter)
    turn = position[gear.free_qpos + 3 : gear.free_qpos + 7]
    w, x, y, z = turn[0], turn[1], turn[2], turn[3]
    turn[0], turn[1], turn[2], turn[3] = w * cos - z * sin, x * cos + y * sin, y * cos - x * sin, z * cos + w * sin
