"""The forces of tires with a law of ours, in a physics step of MuJoCo.

    forces = TireForces(model)  # from now on the model's own contacts of the tires are off
    forces.begin(data)
    for _ in range(substeps):
        forces.step(data)  # in the place of mujoco.mj_step

Each tire has two deflections u [m] of its contact patch, along its heading and across, that follow the velocity v of
its contact point over the ground by

    du/dt = v - V u / sigma

with the relaxation length sigma and the wheel's forward speed V. Its slip is u / sigma: along the heading the slip
ratio, across it the tangent of the slip angle. In a slip of both, each is measured by the slip of its own peak
(similarity): the size r of this slip vector gives the force, the law's at r times the peak's slip, along the slip
vector. So the greatest forces lie on an ellipse, and a tire is past its peak where r is above 1. A law of bristles
(Law.holds) keeps u where r is 1; what the contact point moves beyond that is sliding. Rubber also damps: a force
against du/dt, across the heading only of a wheel that hardly rolls, since there rolling damps by itself, and the force
would come V c / k sooner than the relaxation length says. The load is that of a spring and a damper under the lowest
point of the tire.

All this is far stiffer than the car: a wheel's spin follows its tire at some 300 rad/s, where a body rolls on its
springs at 50. So a physics step h moves the tires by n shorter ones (`steps_within`) while the rest of the car goes on
as MuJoCo has it. The velocities of the four contact points and of the drive make one vector w (13,), and in a step

    dw/dt = J M^-1 (the forces without tires and drive) + (J M^-1 J') f(w, u)

with MuJoCo's own inertia M, joint damping taken implicitly as its `implicitfast` does, and the Jacobian J of w. What is
then given to MuJoCo is the mean of f over the step, so that it ends with the very w that the short steps ended with.
All of this is seen from the car, whose velocity turns the other way while it turns; `place_between` turns what it
gained. So a step is of the second order: at 5 ms the yaw rate follows the steering within .05 ms as it does at .25 ms.
The motor's force is a part of f, and the steering servo, which no tire moves, is stepped beside it; Ackermann's
kingpins are then put where they belong.

The deflections, and for others to read what a tire did (see USERDATA), lie in `userdata`, a part of
mjSTATE_INTEGRATION: a recorded state holds all that the next step depends on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..arguments import Suggesting
from ..compiled.kernels import inlined, kernel
from ..errors import ModelError
from ..messages import FloatArray
from . import stages
from .arithmetic import add_scaled_4, add_scaled_16, unlikely
from .car import WHEELS, element_id
from .changes import six_digits
from .stages import Fields, fields
from .tires import GREATEST_SLIP, LAW_OF, LAWS, NUMBERS, NUMERIC, Tires, curve_force, tires_of
from .tires.sets import numbers_of

_MOST_LINKS = 16  # joints between the world and a wheel, at most
_DAMPING_RATIO = 0.3  # [-] of a wheel's spin on its tire: between those of rubber and of its foam
_LONGEST = (0.35, 0.5)  # [-] of a short step times the fastest rate of the tires, of curves and of bristles: measured
_MOST_STEPS = 64  # short ones in a physics step
_FIRST_AXLE = "front"
_MOST_PULL = 30.0  # [m/s^2] of a car: no tires give as much, and a wall that stops it gives more
_STILL = 1.0  # [rad/s] of a wheel: from there on it has all of its rolling resistance
_ROLLING = 0.5  # [m/s] of a wheel: from there on its tire does not damp across the heading

USERDATA = 8
"""Numbers of each tire in `userdata`."""

ALONG, ACROSS, LOAD, FORCE_ALONG, FORCE_ACROSS, SLIDING, SLIDING_ACROSS, SLIP_SIZE = range(USERDATA)
"""Deflections [m] along the wheel's heading and to its left, which the next step begins with; then what the tire did in
the last step: its mean load [N] and force [N], forward and to the left positive, the greatest speed at which it slid
[m/s], that across its heading, and its greatest slip over that of the peak."""

CONTACTS = 13
"""Velocities that the short steps follow: of each wheel's contact point, along its heading, to its left and up, then
that of the drive."""

_DRIVE = CONTACTS - 1
_MOST_COMMON = 16  # dofs that move more than one wheel, at most

TIRE = np.dtype(
    [
        ("law", np.int64),  # its place in LAWS
        ("holds", np.int64),  # see Law
        ("slides", np.int64),
        ("alike", np.int64),  # whether both curves are the same
        # along the heading and across
        ("curve", np.float64, (2, NUMBERS)),
        ("slope", np.float64, (2,)),
        ("peak_slip", np.float64, (2,)),  # 1 where there is no peak
        ("peak", np.float64, (2,)),
        ("relaxation_length", np.float64),
        ("load_sensitivity", np.float64),
        ("nominal_load", np.float64),
        ("vertical_stiffness", np.float64),
        ("vertical_damping", np.float64),
        ("rolling_resistance", np.float64),
        ("damping", np.float64),  # [N s/m] of its deflections
        ("radius", np.float64),  # [m] of an ellipsoid about its axle, and half its width; equal: of a sphere
        ("half_width", np.float64),
        ("ground", np.float64),  # [m] height
        ("body", np.int64),  # of the wheel
        ("root", np.int64),  # of its tree
        ("axle", np.float64, (3,)),  # in the frame of the wheel's body, forward spin positive
        ("spin_dof", np.int64),
        ("links", np.int64),
        ("own_links", np.int64),  # how many of them move this wheel only: the first ones
        ("chain", np.int64, (_MOST_LINKS,)),  # the dofs that move it, from its spin to the root
        ("common", np.int64, (_MOST_LINKS,)),  # their places in `Gear.common`, behind its own
        ("turned_by", np.int64, (_MOST_LINKS,)),  # how many, the first ones, turn the wheel against the body of each
        ("straight", np.int64, (_MOST_LINKS,)),  # whether each moves without turning
    ]
)
"""A tire with a law of ours, and its wheel. Kernels take an array (tires,) of it; none for the model `contact`."""

GEAR = np.dtype(
    [
        ("first_tire", np.int64),  # its first row among those of TIRE; -1: its tires are MuJoCo's contacts
        ("userdata", np.int64),  # where in `userdata` that of its tires begins
        ("free_qpos", np.int64),  # of base_link's joint
        ("free_dof", np.int64),
        ("tire_steps", np.int64),  # short steps in a physics step, of `steps_within`
        ("commons", np.int64),
        ("common", np.int64, (_MOST_COMMON,)),  # the dofs that move more than one wheel, in order
        ("common_of", np.int64, (_MOST_COMMON, _MOST_COMMON)),  # where the entries of their rows are among them
        ("steered", np.int64),  # whether the kingpins follow the steering by polynomials, and are put there
        ("steering_qpos", np.int64),
        ("steering_dof", np.int64),
        ("steering_damping", np.float64),  # [N m s/rad] of it and its kingpins
        ("steering_inertia", np.float64),  # [kg m^2] likewise
        ("steering_range", np.float64, (2,)),  # [rad] at which its joint ends; infinite: nowhere
        ("kingpin_qpos", np.int64, (2,)),
        ("kingpin_dof", np.int64, (2,)),
        ("ackermann", np.float64, (2, 5)),  # their angles as polynomials of the steering angle
        ("driven", np.int64),  # whether the motor acts through fixed shares of the wheels' spins
        ("drive_share", np.float64, (4,)),  # [m] of each wheel's spin in the speed of the drive
        # of the two servos, steering and drive
        ("actuator", np.int64, (2,)),
        ("delayed", np.int64, (2,)),  # how MuJoCo interpolates what they were told; -1: they have no delay
        ("control_range", np.float64, (2, 2)),
        ("force_range", np.float64, (2, 2)),
        ("power", np.float64),  # [W] of the motor: its greatest force at `power_limit_speed`
        ("spin_dof", np.int64, (4,)),
        ("wheel_radius", np.float64),  # [m] mean of the drive
    ]
)
"""The steering and the drive of a car; of one on MuJoCo's contacts only the servos and the motor's power."""

LANES = 16
"""Numbers in a row of `push_car`'s matrices: CONTACTS and, behind them, zeros."""

_JACOBIAN = 0  # (4, 16, 4) by wheel, dof of its chain, and velocity: forward, left, up, drive
_HALVES = 256  # likewise, see `_half_solve`
_COMMON = 512  # (16, LANES) of the common dofs
_MOBILITY = 768  # (CONTACTS, LANES)
_ODD = 1024  # likewise, a part of its sums, and of those of a short step
_VELOCITY, _FORCE, _MEAN, _FREE, _EVEN = range(1280, 1360, LANES)  # (LANES,) each
_DEPTH, _FORWARD, _LEFT, _REACH, _SLOW_X, _SLOW_Y = range(1360, 1384, 4)  # (4,) each, by wheel
_MOVES = 1384  # (5,) of the last wheel, see `_wheel_rows`

SCRATCH = 1536
"""Numbers that `push_car` needs room for."""

TireRows = NDArray[np.void]
GearRows = NDArray[np.void]


class Inertia(NamedTuple):
    """Which entries MuJoCo keeps of its inertia matrices: of a model, and the same for all its data."""

    row_counts: NDArray[np.int32]
    row_starts: NDArray[np.int32]
    columns: NDArray[np.int32]

    @classmethod
    def of(cls, model: mujoco.MjModel) -> Inertia:
        """Return that of a model."""
        return cls(model.M_rownnz.copy(), model.M_rowadr.copy(), model.M_colind.copy())


def put_on(spec: Any, tires: Tires) -> Tires:
    """Put tires on a vehicle's spec, in place: the numbers that `tires_of` reads, and the friction of its pairs.

    The pairs stay as they are but for that, so that MuJoCo alone can drive the model, on its own contacts.

    Returns:
      The tires, with the vehicle's friction where they give none.
    """
    for name in ("front", "rear"):  # a spec that was written to a file has the tires of then
        numbers = spec.numeric(NUMERIC.format(name))
        if numbers is not None:
            spec.delete(numbers)
            spec.nuserdata = 0
    if tires.is_contact:
        return tires
    found = [wheel for wheel in WHEELS if spec.pair(f"{wheel}_tire") is not None]
    tires = tires.on(float(spec.pair(f"{found[0]}_tire").friction[0]))
    spec.nuserdata = USERDATA * len(found)
    for name, axle in zip(("front", "rear"), tires.axles, strict=True):
        numbers = [six_digits(value) for value in numbers_of(axle, tires.model)]
        spec.add_numeric(name=NUMERIC.format(name), data=numbers)
        for wheel in found:
            if wheel.startswith(name):
                pair, mu = spec.pair(f"{wheel}_tire"), six_digits(axle.lateral.peak)
                pair.friction = [mu, mu, *pair.friction[2:]]
    return tires


def tire_rows(model: mujoco.MjModel, prefix: str = "", wheels: Sequence[str] = WHEELS) -> TireRows:
    """Return the rows of TIRE of a car in a compiled model, in the order of its wheels; none for the model `contact`.

    Raises:
      ModelError: the model does not hold the car under this prefix, or a wheel hangs on too many joints.
    """
    tires = tires_of(model, prefix)
    if tires.is_contact:
        return np.zeros(0, TIRE)
    rows, law = np.zeros(len(wheels), TIRE), LAW_OF[tires.model]
    common = _common(model, prefix, wheels)
    for row, wheel in zip(rows, wheels, strict=True):
        axle = tires.axles[0 if wheel.startswith("front") else 1]
        row["law"], row["holds"], row["slides"] = LAWS.index(law), law.holds, law.slides
        row["alike"] = axle.lateral == axle.longitudinal
        for k, curve in enumerate((axle.longitudinal, axle.lateral)):
            row["curve"][k], row["slope"][k], row["peak"][k] = curve.row(), curve.slope, curve.peak
            row["peak_slip"][k] = curve.peak_slip if math.isfinite(curve.peak_slip) else 1.0
        for name in ("relaxation_length", "load_sensitivity", "nominal_load", "vertical_stiffness", "vertical_damping",
                     "rolling_resistance"):  # fmt: skip
            row[name] = getattr(axle, name)
        _find_wheel(model, prefix, wheel, row, common)
        stiffness = row["slope"][0] * axle.nominal_load / axle.relaxation_length
        # rounded, so that a heavier chassis does not change its last bits: a batch has one row for all of its worlds
        row["damping"] = six_digits(2.0 * _DAMPING_RATIO * math.sqrt(stiffness * _spinning_mass(model, row)))
    rows.flags.writeable = False
    return rows


def _common(model: mujoco.MjModel, prefix: str, wheels: Sequence[str]) -> list[int]:
    """Return the dofs that move more than one wheel, and those above them; of one wheel alone, none but its own do."""
    chains = [_chain(model, element_id(model, mujoco.mjtObj.mjOBJ_BODY, f"{prefix}{wheel}_wheel")) for wheel in wheels]
    dofs = [dof for chain in chains for dof in chain]
    found = sorted({dof for dof in dofs if dofs.count(dof) > 1})
    if len(found) > _MOST_COMMON:
        raise ModelError(f"{len(found)} dofs move more than one wheel; accepted: up to {_MOST_COMMON}")
    return found


def _chain(model: mujoco.MjModel, body: int) -> list[int]:
    """Return the dofs that move a body, the last first."""
    chain, dof = [], int(model.body_dofadr[body] + model.body_dofnum[body] - 1)
    while dof >= 0:
        chain.append(dof)
        dof = int(model.dof_parentid[dof])
    return chain


def _find_wheel(model: mujoco.MjModel, prefix: str, wheel: str, row: Any, common: Sequence[int]) -> None:
    """Write where a wheel is, and what moves it."""
    geom = element_id(model, mujoco.mjtObj.mjOBJ_GEOM, f"{prefix}{wheel}_tire")
    size = model.geom_size[geom]
    ellipsoid = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_ELLIPSOID
    row["radius"] = size[0]
    row["half_width"] = size[1] if ellipsoid else size[0]
    row["ground"] = model.geom_pos[element_id(model, mujoco.mjtObj.mjOBJ_GEOM, f"{prefix}ground"), 2]
    body = element_id(model, mujoco.mjtObj.mjOBJ_BODY, f"{prefix}{wheel}_wheel")
    spin = element_id(model, mujoco.mjtObj.mjOBJ_JOINT, f"{prefix}{wheel}_wheel")
    row["body"], row["root"] = body, model.body_rootid[body]
    row["axle"], row["spin_dof"] = model.jnt_axis[spin], model.jnt_dofadr[spin]
    chain = _chain(model, body)
    if len(chain) > _MOST_LINKS:
        raise ModelError(f"{prefix}{wheel}_wheel hangs on {len(chain)} dofs; accepted: up to {_MOST_LINKS}")
    row["links"], row["chain"], row["common"] = len(chain), -1, -1
    row["chain"][: len(chain)] = chain
    row["own_links"] = sum(dof not in common for dof in chain)
    joints = model.dof_jntid[chain].tolist()
    for link, dof in enumerate(chain):
        if dof in common:
            row["common"][link] = common.index(dof)
        row["turned_by"][link], row["straight"][link] = joints.index(joints[link]), _moves_straight(model, dof)


def _moves_straight(model: mujoco.MjModel, dof: int) -> bool:
    """Return whether a dof turns nothing: that of a slide, or one of the first three of a free joint."""
    joint, kinds = int(model.dof_jntid[dof]), mujoco.mjtJoint
    free = model.jnt_type[joint] == kinds.mjJNT_FREE
    return bool(model.jnt_type[joint] == kinds.mjJNT_SLIDE or (free and dof < model.jnt_dofadr[joint] + 3))


def _spinning_mass(model: mujoco.MjModel, row: Any) -> float:
    """Return the mass that a force along the heading of a tire moves when the wheel spins up [kg]."""
    return float(model.dof_M0[row["spin_dof"]]) / float(row["radius"]) ** 2


def steps_within(model: mujoco.MjModel, rows: TireRows, timestep: float) -> int:
    """Return in how many short steps a physics step moves the tires.

    Raises:
      ModelError: a step that is too long for tires so stiff.
    """
    fastest = 0.0  # [rad/s] of all, over what a short step may be of it
    for row in rows:
        mass = float(model.body_mass[row["body"]])
        unsprung = float(model.body_subtreemass[model.body_parentid[row["body"]]]) if mass else mass
        upright = math.sqrt(float(row["vertical_stiffness"]) / max(min(unsprung, 1.0), mass, 1e-3))
        greatest = max(float(slope) for slope in row["slope"])
        stiffness = greatest * float(row["nominal_load"]) / float(row["relaxation_length"])
        rate = max(upright, math.sqrt(stiffness / _spinning_mass(model, row)))
        fastest = max(fastest, rate / _LONGEST[int(row["holds"])])
    steps = max(math.ceil(timestep * fastest - 1e-9), 1)
    if steps > _MOST_STEPS:
        raise ModelError(
            f"timestep is {timestep:g} s with tires so stiff; accepted: up to {_MOST_STEPS / fastest:.3g} s, or tires "
            "with less stiffness or a longer relaxation_length"
        )
    return steps


def gear_row(model: mujoco.MjModel, prefix: str = "") -> GearRows:
    """Return how a car is steered and driven, (1,) of GEAR; whoever has the rows of all tires writes `first_tire`.

    Raises:
      ModelError: the model does not hold the car under this prefix.
    """
    gears, kinds = no_gear(), mujoco.mjtObj
    gear = gears[0]
    for k, name in enumerate(("steering", "speed")):
        servo = element_id(model, kinds.mjOBJ_ACTUATOR, f"{prefix}{name}")
        samples, interpolation = model.actuator_history[servo].tolist()
        gear["actuator"][k], gear["delayed"][k] = servo, interpolation if samples > 0 else -1
        unlimited = (-np.inf, np.inf)
        gear["control_range"][k] = model.actuator_ctrlrange[servo] if model.actuator_ctrllimited[servo] else unlimited
        gear["force_range"][k] = model.actuator_forcerange[servo] if model.actuator_forcelimited[servo] else unlimited
    limit = element_id(model, kinds.mjOBJ_NUMERIC, f"{prefix}power_limit_speed")
    gear["power"] = gear["force_range"][1, 1] * model.numeric_data[model.numeric_adr[limit]]
    gear["spin_dof"] = [
        model.jnt_dofadr[element_id(model, kinds.mjOBJ_JOINT, f"{prefix}{wheel}_wheel")] for wheel in WHEELS
    ]
    drive = element_id(model, kinds.mjOBJ_TENDON, f"{prefix}drive")
    wraps = slice(model.tendon_adr[drive], model.tendon_adr[drive] + model.tendon_num[drive])
    gear["wheel_radius"] = model.wrap_prm[wraps].sum()
    if not tires_of(model, prefix).is_contact:
        gear["userdata"] = userdata_place(model, prefix)
        free = element_id(model, kinds.mjOBJ_JOINT, f"{prefix}base_link")
        gear["free_qpos"], gear["free_dof"] = model.jnt_qposadr[free], model.jnt_dofadr[free]
        _find_common(model, gear, _common(model, prefix, WHEELS))
        _find_steering(model, prefix, gear)
        _find_drive(model, prefix, gear)
    gears.flags.writeable = False
    return gears


def _find_common(model: mujoco.MjModel, gear: Any, common: Sequence[int]) -> None:
    """Write which dofs move more than one wheel, and what MuJoCo's inertia has in their rows."""
    gear["commons"], gear["common"], gear["common_of"] = len(common), -1, -1
    gear["common"][: len(common)] = common
    for place, dof in enumerate(common):
        start, entries = int(model.M_rowadr[dof]), int(model.M_rownnz[dof]) - 1
        columns = model.M_colind[start : start + entries].tolist()
        gear["common_of"][place][:entries] = [common.index(column) for column in columns]


def _find_steering(model: mujoco.MjModel, prefix: str, gear: Any) -> None:
    """Write how the kingpins follow the steering; not `steered` where no equalities of the joints say so."""
    joint = mujoco.mjtObj.mjOBJ_JOINT
    steering = element_id(model, joint, f"{prefix}steering")
    kingpins = [element_id(model, joint, f"{prefix}front_{side}_kingpin") for side in ("left", "right")]
    found = _ackermann(model, steering, kingpins)
    if len(found) < 2 or not _is_plain(model, int(gear["actuator"][0]), mujoco.mjtTrn.mjTRN_JOINT):
        return
    dofs = model.jnt_dofadr[[steering, *kingpins]]
    gear["steered"] = 1
    gear["steering_qpos"], gear["steering_dof"] = model.jnt_qposadr[steering], dofs[0]
    gear["kingpin_qpos"], gear["kingpin_dof"] = model.jnt_qposadr[kingpins], dofs[1:]
    gear["steering_damping"] = model.dof_damping[dofs].sum()
    limited = bool(model.jnt_limited[steering])
    gear["steering_range"] = model.jnt_range[steering] if limited else (-np.inf, np.inf)
    gear["steering_inertia"] = six_digits(float(model.dof_M0[dofs].sum()))  # rounded for the same reason as damping
    gear["ackermann"] = [model.eq_data[equality, :5] for equality in found]


def _ackermann(model: mujoco.MjModel, steering: int, kingpins: Sequence[int]) -> list[int]:
    """Return the equalities that make the kingpins follow the steering, as many as there are."""
    joints = mujoco.mjtEq.mjEQ_JOINT
    return [
        equality
        for kingpin in kingpins
        for equality in range(model.neq)
        if model.eq_type[equality] == joints
        and (model.eq_obj1id[equality], model.eq_obj2id[equality]) == (kingpin, steering)
    ]


def _find_drive(model: mujoco.MjModel, prefix: str, gear: Any) -> None:
    """Write which share each wheel has in the drive; not `driven` where the motor acts on anything else."""
    motor = int(gear["actuator"][1])
    spins = gear["spin_dof"].tolist()
    if not _is_plain(model, motor, mujoco.mjtTrn.mjTRN_TENDON):
        return
    tendon = int(model.actuator_trnid[motor, 0])
    wraps = range(int(model.tendon_adr[tendon]), int(model.tendon_adr[tendon] + model.tendon_num[tendon]))
    if len(wraps) > 4 or any(model.wrap_type[wrap] != mujoco.mjtWrap.mjWRAP_JOINT for wrap in wraps):
        return
    dofs = model.jnt_dofadr[model.wrap_objid[wraps.start : wraps.stop]].tolist()
    if not set(dofs) <= set(spins):
        return
    gear["driven"] = 1
    for dof, share in zip(dofs, model.wrap_prm[wraps.start : wraps.stop].tolist(), strict=True):
        gear["drive_share"][spins.index(dof)] += share


def _is_plain(model: mujoco.MjModel, actuator: int, transmission: Any) -> bool:
    """Return whether an actuator's force is affine in its control, and acts one to one through a transmission."""
    return bool(
        model.actuator_trntype[actuator] == transmission
        and model.actuator_dyntype[actuator] == mujoco.mjtDyn.mjDYN_NONE
        and model.actuator_gaintype[actuator] == mujoco.mjtGain.mjGAIN_FIXED
        and model.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_AFFINE
        and model.actuator_gear[actuator, 0] == 1.0
    )


def no_gear() -> GearRows:
    """Return the row of GEAR of contacts, or of wheels that are no car's, (1,): nothing steers or drives them."""
    gears = np.zeros(1, GEAR)
    gears["free_dof"] = gears["first_tire"] = -1
    return gears


def take_over(model: mujoco.MjModel, prefix: str = "") -> bool:
    """Switch off what `push_car` does in MuJoCo's place, in a compiled model, in place.

    These are the contacts of a car's tires, and where it is steered by Ackermann's equalities, these. A joint's damping
    is then taken implicitly by `push_car`, and not by MuJoCo's Euler step.

    Returns:
      Whether the car has tires of ours; else nothing was done.
    """
    if tires_of(model, prefix).is_contact:
        return False
    for wheel in WHEELS:
        pair = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_PAIR, f"{prefix}{wheel}_tire")
        if pair >= 0:
            model.pair_margin[pair] = -1.0  # [m]: never as deep
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP)
    joint = mujoco.mjtObj.mjOBJ_JOINT
    steering = mujoco.mj_name2id(model, joint, f"{prefix}steering")
    kingpins = [mujoco.mj_name2id(model, joint, f"{prefix}front_{side}_kingpin") for side in ("left", "right")]
    if min(steering, *kingpins) >= 0 and gear_row(model, prefix)["steered"][0]:
        model.eq_active0[_ackermann(model, steering, kingpins)] = 0
    return True


class TireForces(Suggesting):
    """Steps a model by hand, the tires of its cars included; of the model `contact` as mujoco.mj_step does.

    The motor's power is limited here: mujoco.mj_step gives the full force at every speed.

    Args:
      model: compiled. Its own contacts of tires that have a law of ours are switched off.
      prefix: of the car's names, or those of several cars, in their order in the model.
      wheels: that each has.

    Attributes:
      rows: of the tires, (cars x wheels,) of TIRE; without those of the model `contact`.
      mu: lateral peak of each of them [-], likewise; where all are of the model `contact`, of these. Live.
      steps: short ones in a physics step; None: as many as `steps_within` says. Can be set.

    Raises:
      ModelError: a time step that is too long for the tires.
    """

    def __init__(self, model: mujoco.MjModel, prefix: str | Sequence[str] = "", wheels: Sequence[str] = WHEELS) -> None:
        prefixes = (prefix,) if isinstance(prefix, str) else tuple(prefix)
        own = [name for name in prefixes if not tires_of(model, name).is_contact]
        self.rows: TireRows = np.concatenate([tire_rows(model, name, wheels) for name in own or prefixes[:1]])
        self.mu: FloatArray = np.concatenate([peaks(model, name, wheels) for name in own or prefixes])
        self.steps: int | None = None
        self._model, self._fields = model, fields()
        for name in own:
            take_over(model, name)
        whole = tuple(wheels) == WHEELS
        self._gears = np.concatenate([gear_row(model, name) if whole else no_gear() for name in own or prefixes])
        if own:
            self._gears["first_tire"] = range(0, len(self.rows), len(wheels))
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
        """Do a physics step for each row of two arrays, and write its sensors and its userdata there.

        Args:
          data: of the model.
          records: (steps, sensordata of the model), or fewer columns.
          states: (steps, userdata of the model), or fewer columns.
        """
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
        timestep, wheels = float(model.opt.timestep), len(self.rows) // len(self._gears)
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


def userdata_place(model: mujoco.MjModel, prefix: str = "") -> int:
    """Return where in `userdata` that of a car's tires begins: behind that of all cars that come before it."""
    name = NUMERIC.format(_FIRST_AXLE)
    own = element_id(model, mujoco.mjtObj.mjOBJ_NUMERIC, prefix + name)
    before: int = sum(model.numeric(index).name.endswith(f"/{name}") for index in range(own))
    return before * USERDATA * len(WHEELS)


def peaks(model: mujoco.MjModel, prefix: str = "", wheels: Sequence[str] = WHEELS) -> FloatArray:
    """Return the friction coefficient of each tire, or its lateral peak [-]. Shape (wheels,), a copy."""
    pairs = [element_id(model, mujoco.mjtObj.mjOBJ_PAIR, f"{prefix}{wheel}_tire") for wheel in wheels]
    found: FloatArray = model.pair_friction[pairs, 0]
    return found


@kernel
def slips(tire: Any, along: float, across: float) -> tuple[float, float, float]:
    """Return slip ratio and slip angle [rad] of deflections [m], and the size of both, 1 at the peak.

    The signs are those of the deflections: a wheel that brakes has a positive slip, one that drifts to the left, too.
    """
    ratio, angle = along / tire.relaxation_length, math.atan(across / tire.relaxation_length)
    share_x, share_y = ratio / tire.peak_slip[0], angle / tire.peak_slip[1]
    return ratio, angle, math.sqrt(share_x * share_x + share_y * share_y)


@kernel
def patch_force(tire: Any, along: float, across: float, grip: float) -> tuple[float, float]:
    """Return the force [N] along the heading and to the left of a contact patch that is deflected by so much [m].

    `grip` is the load [N] times what scales the curves: load sensitivity and friction.
    """
    ratio, angle, size = slips(tire, along, across)
    return _shared_force(tire, ratio / tire.peak_slip[0], angle / tire.peak_slip[1], size, grip)


@kernel
def grip_of(tire: Any, load: float, mu: float) -> float:
    """Return the load [N] times what scales the curves of a tire: its load sensitivity, and its lateral peak `mu`."""
    grip: float = load * mu / tire.peak[1]
    if tire.load_sensitivity > 0.0 and load > 0.0:
        grip *= (load / tire.nominal_load) ** -tire.load_sensitivity
    return grip


@kernel
def curve_peaks(tire: Any, load: float, mu: float) -> tuple[float, float]:
    """Return the greatest force of a tire along its heading and across [N]; arguments as in `grip_of`."""
    grip = grip_of(tire, load, mu)
    return grip * tire.peak[0], grip * tire.peak[1]


@kernel
def deflect(
    tire: Any, along: float, across: float, over_x: float, over_y: float, forward: float, grip: float, timestep: float
) -> tuple[float, float, float, float, float, float, float]:
    """Return the deflections of a contact patch after a short step [m], and its force then [N].

    Args:
      tire: of TIRE.
      along: deflection before, along the heading [m].
      across: to the left [m].
      over_x: velocity of the contact point over the ground, forward [m/s].
      over_y: to the left [m/s].
      forward: that of the wheel, without sign [m/s].
      grip: as in `patch_force`.
      timestep: [s].

    Returns:
      Deflections, forces, the size of the slip over that of the peak, and how fast it slides, forward and to the left
      [m/s].
    """
    if tire.holds:
        left, reach = rolled(forward, tire.relaxation_length, timestep)
        slow_x, slow_y = damping_of(tire, forward, timestep)
        return bend(tire, along, across, over_x, over_y, left, reach, slow_x, slow_y, grip)
    sigma, sliding_x, sliding_y = tire.relaxation_length, 0.0, 0.0
    if tire.slides and along * over_x + across * over_y < 0.0 and slips(tire, along, across)[2] > 1.0:
        # A tire that slid, and now moves back, springs back by what gives its force, and no more.
        force_x, force_y = patch_force(tire, along, across, grip)
        along, across = -force_x * sigma / (grip * tire.slope[0]), -force_y * sigma / (grip * tire.slope[1])
    # a locked wheel deflects no further than to GREATEST_SLIP
    roll = max(forward, math.sqrt(over_x * over_x + over_y * over_y) / GREATEST_SLIP)
    left, reach = rolled(roll, sigma, timestep)
    new_along, new_across = along * left + reach * over_x, across * left + reach * over_y
    ratio, angle, size = slips(tire, new_along, new_across)
    ratio, angle = ratio / tire.peak_slip[0], angle / tire.peak_slip[1]
    if tire.slides and size > 1.0:
        sliding_x, sliding_y = over_x * (1.0 - 1.0 / size), over_y * (1.0 - 1.0 / size)
    force_x, force_y = _shared_force(tire, ratio, angle, size, grip)
    slow_x, slow_y = damping_of(tire, forward, timestep)
    force_x, force_y = force_x - slow_x * (new_along - along), force_y - slow_y * (new_across - across)
    if tire.slides:
        force_x, force_y = within_peaks(tire, force_x, force_y, grip)
    return new_along, new_across, force_x, force_y, size, sliding_x, sliding_y


@kernel
def rolled(forward: float, relaxation_length: float, timestep: float) -> tuple[float, float]:
    """Return which share of a deflection is left after a short step of rolling, and what a velocity adds to it [s].

    Both are exact where the velocities stay.
    """
    way = timestep * forward / relaxation_length
    if way < 1e-6:
        return 1.0 - way, timestep
    left = math.exp(-way)
    return left, timestep * (1.0 - left) / way


@kernel
def damping_of(tire: Any, forward: float, timestep: float) -> tuple[float, float]:
    """Return the force of damping for each metre of deflection in a short step, along the heading and across [N/m].

    Across it fades with the wheel's speed forward [m/s].
    """
    standing = max(1.0 - forward / _ROLLING, 0.0)
    return tire.damping / timestep, tire.damping * standing / timestep


@inlined
def bend(
    tire: Any, along: float, across: float, over_x: float, over_y: float, left: float, reach: float, slow_x: float,
    slow_y: float, grip: float,
) -> tuple[float, float, float, float, float, float, float]:  # fmt: skip
    """Do what `deflect` does, for a tire of bristles; `left` and `reach` are of `rolled`, the rest of `damping_of`."""
    new_along, new_across = along * left + reach * over_x, across * left + reach * over_y
    ratio = new_along / (tire.relaxation_length * tire.peak_slip[0])
    angle = new_across / (tire.relaxation_length * tire.peak_slip[1])
    square, sliding_x, sliding_y = ratio * ratio + angle * angle, 0.0, 0.0
    size = math.sqrt(square)
    if unlikely(square > 1.0):
        beyond = (1.0 - 1.0 / size) / reach
        sliding_x, sliding_y = new_along * beyond, new_across * beyond
        new_along, new_across = new_along / size, new_across / size
    force_x, force_y = _shared_force(tire, ratio, angle, size, grip)
    force_x, force_y = force_x - slow_x * (new_along - along), force_y - slow_y * (new_across - across)
    force_x, force_y = within_peaks(tire, force_x, force_y, grip)
    return new_along, new_across, force_x, force_y, size, sliding_x, sliding_y


@kernel
def within_peaks(tire: Any, along: float, across: float, grip: float) -> tuple[float, float]:
    """Return a force [N] that is no greater than a tire that slides can give."""
    share_x, share_y = along / tire.peak[0], across / tire.peak[1]
    much = share_x * share_x + share_y * share_y
    if unlikely(much > grip * grip):
        down = grip / math.sqrt(much)
        return along * down, across * down
    return along, across


@inlined
def _shared_force(tire: Any, ratio: float, angle: float, size: float, grip: float) -> tuple[float, float]:
    """Return the force [N] along the heading and to the left, by slips over those of the peaks, and their size."""
    if size == 0.0:
        return 0.0, 0.0
    within = min(size, 1.0) if tire.holds else size
    across = curve_force(tire.law, tire.curve[1], within * tire.peak_slip[1])
    along = across if tire.alike else curve_force(tire.law, tire.curve[0], within * tire.peak_slip[0])
    scale = -grip / size
    return along * ratio * scale, across * angle * scale


@kernel
def _control(model: int, data: int, found: Fields, gear: Any, servo: int, scratch: FloatArray) -> float:
    """Return what a servo of a car is told now, delay and range included."""
    actuator = gear.actuator[servo]
    delay = stages.vector(model, found.actuator_delay, actuator + 1)[actuator]
    if gear.delayed[servo] >= 0 and delay > 0.0:  # of no delay MuJoCo's history knows the last step's only
        now = stages.number_at(data + found.time)[0]
        address = stages.read_control(model, data, actuator, now, scratch.ctypes.data, gear.delayed[servo])
        told = stages.number_at(address)[0] if address != 0 else scratch[0]
    else:
        told = stages.vector(data, found.ctrl, actuator + 1)[actuator]
    control: float = min(max(told, gear.control_range[servo, 0]), gear.control_range[servo, 1])
    return control


@kernel
def steer(
    model: int, data: int, found: Fields, gear: Any, scratch: FloatArray, dofs: int, timestep: float, steps: int
) -> tuple[float, float]:
    """Return where the steering servo is after a physics step [rad], and its rate [rad/s]."""
    angle = stages.vector(data, found.qpos, gear.steering_qpos + 1)[gear.steering_qpos]
    rate = stages.vector(data, found.qvel, dofs)[gear.steering_dof]
    control, short, servo = _control(model, data, found, gear, 0, scratch), timestep / steps, gear.actuator[0]
    gain = stages.vector(model, found.actuator_gainprm, 10 * servo + 10)[10 * servo] * control
    bias = stages.vector(model, found.actuator_biasprm, 10 * servo + 10)[10 * servo : 10 * servo + 3]
    least, most = gear.force_range[0, 0], gear.force_range[0, 1]
    push, slowed = short / gear.steering_inertia, 0.5 * short * gear.steering_damping / gear.steering_inertia
    for _ in range(steps):  # of the second order: the force in the middle of a step, and means of rates
        middle = angle + 0.5 * short * rate
        force = min(max(gain + bias[0] + bias[1] * middle + bias[2] * rate, least), most)
        before, rate = rate, (rate * (1.0 - slowed) + push * force) / (1.0 + slowed)
        angle += 0.5 * short * (before + rate)
        if angle < gear.steering_range[0] or angle > gear.steering_range[1]:  # the joint ends there, and it stops
            angle, rate = min(max(angle, gear.steering_range[0]), gear.steering_range[1]), 0.0
    return angle, rate


@kernel
def put_steering(data: int, found: Fields, gear: Any, dofs: int, angle: float, rate: float) -> None:
    """Put the steering where its servo is, and the kingpins where Ackermann's polynomials have them."""
    most = max(gear.steering_qpos, gear.kingpin_qpos[0], gear.kingpin_qpos[1]) + 1
    qpos, qvel = stages.vector(data, found.qpos, most), stages.vector(data, found.qvel, dofs)
    qpos[gear.steering_qpos], qvel[gear.steering_dof] = angle, rate
    for side in range(2):
        c = gear.ackermann[side]
        qpos[gear.kingpin_qpos[side]] = c[0] + angle * (c[1] + angle * (c[2] + angle * (c[3] + angle * c[4])))
        slope = c[1] + angle * (2.0 * c[2] + angle * (3.0 * c[3] + angle * 4.0 * c[4]))
        qvel[gear.kingpin_dof[side]] = slope * rate


@kernel
def damp_inertia(
    model: int, data: int, found: Fields, inertia: Inertia, gears: GearRows, dofs: int, timestep: float
) -> None:
    """Add to MuJoCo's inertia what takes joint damping implicitly, and keep joints that are put where they belong."""
    entries = len(inertia.columns)
    matrix, damping = stages.vector(data, found.inertia, entries), stages.vector(model, found.dof_damping, dofs)
    for dof in range(dofs):
        matrix[inertia.row_starts[dof] + inertia.row_counts[dof] - 1] += timestep * damping[dof]
    for car in range(len(gears)):
        gear = gears[car]
        if gear.steered:
            for dof in (gear.steering_dof, gear.kingpin_dof[0], gear.kingpin_dof[1]):
                matrix[inertia.row_starts[dof] + inertia.row_counts[dof] - 1] += 1.0  # [kg m^2], ten thousand times its
    stages.factor_inertia(model, data)
    stages.project_constraints(model, data)


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
def push_car(
    model: int, data: int, found: Fields, inertia: Inertia, gear: Any, tires: TireRows, mu: FloatArray,
    own: FloatArray, scratch: FloatArray, dofs: int, timestep: float, steps: int,
) -> None:  # fmt: skip
    """Move the tires and the drive of a car by the short steps of a physics step, and add their mean forces.

    MuJoCo's stages up to the acceleration without constraints must be done, with the inertia of `damp_inertia`.

    Args:
      model: address of the mujoco.MjModel.
      data: address of the mujoco.MjData, written to.
      found: where their arrays are.
      inertia: of the model.
      gear: of GEAR.
      tires: (k,) of TIRE, up to four.
      mu: (k,) lateral peak of each [-].
      own: (k USERDATA,) user data of the tires, written to.
      scratch: (SCRATCH,).
      dofs: of the model.
      timestep: of the physics [s].
      steps: of `steps_within`.
    """
    wheels = len(tires)
    short = timestep / steps
    for i in range(LANES):
        scratch[_VELOCITY + i] = scratch[_FORCE + i] = scratch[_MEAN + i] = scratch[_FREE + i] = 0.0
    for i in range(LANES * gear.commons):
        scratch[_COMMON + i] = 0.0
    for k in range(wheels):
        tire = tires[k]
        scratch[_DEPTH + k] = _wheel_rows(data, found, tire, k, gear.drive_share[k], dofs, timestep, scratch)
        forward = _move(data, found, tire, k, short, dofs, scratch)
        scratch[_LEFT + k], scratch[_REACH + k] = rolled(forward, tire.relaxation_length, short)
        scratch[_SLOW_X + k], scratch[_SLOW_Y + k] = damping_of(tire, forward, short)
        scratch[_FORWARD + k] = forward
        for part in range(LOAD, USERDATA):
            own[USERDATA * k + part] = 0.0
        _half_solve(data, found, inertia, tire, k, dofs, scratch)
    _half_solve_common(data, found, inertia, gear, dofs, scratch)
    _mobility(gear, tires, short, scratch)
    gain = bias = slope = damping = length = before = least = most = 0.0
    if gear.driven:
        motor = gear.actuator[1]
        gains = stages.vector(model, found.actuator_gainprm, 10 * motor + 10)
        biases = stages.vector(model, found.actuator_biasprm, 10 * motor + 10)
        gain = gains[10 * motor] * _control(model, data, found, gear, 1, scratch[_EVEN:])
        bias, slope, damping = biases[10 * motor], biases[10 * motor + 1], biases[10 * motor + 2]
        length = stages.vector(data, found.actuator_length, motor + 1)[motor]
        before = stages.vector(data, found.actuator_force, motor + 1)[motor]
        least, most = gear.force_range[1, 0], gear.force_range[1, 1]
    for _ in range(steps):
        for k in range(wheels):
            tire, state, at = tires[k], USERDATA * k, _FORCE + 3 * k
            depth, over = scratch[_DEPTH + k], _VELOCITY + 3 * k
            load = tire.vertical_stiffness * depth - tire.vertical_damping * scratch[over + 2]
            if depth <= 0.0 or load <= 0.0:
                own[state + ALONG] = own[state + ACROSS] = scratch[at] = scratch[at + 1] = scratch[at + 2] = 0.0
                continue
            grip = grip_of(tire, load, mu[k])
            if tire.holds:
                along, across, fx, fy, size, sliding_x, sliding_y = bend(
                    tire, own[state + ALONG], own[state + ACROSS], scratch[over], scratch[over + 1],
                    scratch[_LEFT + k], scratch[_REACH + k], scratch[_SLOW_X + k], scratch[_SLOW_Y + k], grip,
                )  # fmt: skip
            else:
                along, across, fx, fy, size, sliding_x, sliding_y = deflect(
                    tire, own[state + ALONG], own[state + ACROSS], scratch[over], scratch[over + 1],
                    scratch[_FORWARD + k], grip, short,
                )  # fmt: skip
            own[state + ALONG], own[state + ACROSS] = along, across
            scratch[at], scratch[at + 1], scratch[at + 2] = fx, fy, load
            own[state + SLIP_SIZE] = max(own[state + SLIP_SIZE], size)
            if sliding_x != 0.0 or sliding_y != 0.0:
                own[state + SLIDING] = max(own[state + SLIDING], math.hypot(sliding_x, sliding_y))
                own[state + SLIDING_ACROSS] = max(own[state + SLIDING_ACROSS], abs(sliding_y))
        if gear.driven:
            speed = scratch[_VELOCITY + _DRIVE]
            pull = min(max(gain + bias + slope * length + damping * speed, least), most)
            if unlikely(pull * speed > gear.power):
                pull = gear.power / speed
            scratch[_FORCE + _DRIVE] = pull - before
            length += short * speed
        for i in range(LANES):
            scratch[_EVEN + i], scratch[_ODD + i] = scratch[_FREE + i], 0.0  # two sums go on at a time
        for j in range(0, CONTACTS - 1, 2):
            add_scaled_16(scratch, _EVEN, _MOBILITY + LANES * j, scratch[_FORCE + j])
            add_scaled_16(scratch, _ODD, _MOBILITY + LANES * (j + 1), scratch[_FORCE + j + 1])
        add_scaled_16(scratch, _EVEN, _ODD, 1.0)
        add_scaled_16(scratch, _EVEN, _MOBILITY + LANES * _DRIVE, scratch[_FORCE + _DRIVE])
        add_scaled_16(scratch, _VELOCITY, _EVEN, 1.0)
        add_scaled_16(scratch, _MEAN, _FORCE, 1.0)
        for k in range(wheels):
            scratch[_DEPTH + k] -= short * scratch[_VELOCITY + 3 * k + 2]
    share, smooth = 1.0 / steps, stages.vector(data, found.qfrc_smooth, dofs)
    pull = scratch[_MEAN + _DRIVE] * share
    for k in range(wheels):
        tire, mean, state = tires[k], _MEAN + 3 * k, USERDATA * k
        fx, fy, fz = scratch[mean] * share, scratch[mean + 1] * share, scratch[mean + 2] * share
        for link in range(tire.links):
            j = _JACOBIAN + 64 * k + 4 * link
            smooth[tire.chain[link]] += (
                scratch[j] * fx + scratch[j + 1] * fy + scratch[j + 2] * fz + scratch[j + 3] * pull
            )
        own[state + FORCE_ALONG], own[state + FORCE_ACROSS], own[state + LOAD] = fx, fy, fz


@kernel
def _wheel_rows(
    data: int, found: Fields, tire: Any, wheel: int, drive_share: float, dofs: int, timestep: float,
    scratch: FloatArray,
) -> float:  # fmt: skip
    """Write what each dof of a wheel's chain moves its contact point by, and the drive, (links, 4).

    Forward and left are those of the wheel half a physics step later, so that its mean force acts along its mean
    heading, and a car that turns neither gains nor loses by it. They are seen from the body that the dof moves: what
    the car itself turns by then is left to `place_between`.

    Written is, too, what is seen of the contact point from the wheel, without its spin (5,): its velocity now, forward,
    to the left and up, and how fast the first two change because the wheel turns.

    Returns:
      How deep the tire is in the ground [m].
    """
    body, center = tire.body, 3 * tire.root
    position = stages.vector(data, found.xpos, 3 * body + 3)
    turn = stages.vector(data, found.xmat, 9 * body + 9)
    mass_center = stages.vector(data, found.subtree_com, center + 3)
    axes, qvel = stages.vector(data, found.cdof, 6 * dofs), stages.vector(data, found.qvel, dofs)
    m, a = 9 * body, tire.axle
    ax = turn[m] * a[0] + turn[m + 1] * a[1] + turn[m + 2] * a[2]
    ay = turn[m + 3] * a[0] + turn[m + 4] * a[1] + turn[m + 5] * a[2]
    az = turn[m + 6] * a[0] + turn[m + 7] * a[1] + turn[m + 8] * a[2]
    broad = tire.half_width**2 - tire.radius**2
    deep = math.sqrt(tire.radius**2 + broad * az * az)  # lowest point of an ellipsoid, below its middle
    depth: float = deep - (position[3 * body + 2] - tire.ground)
    x = position[3 * body] - broad * az * ax / deep - mass_center[center]
    y = position[3 * body + 1] - broad * az * ay / deep - mass_center[center + 1]
    z = position[3 * body + 2] - deep + 0.5 * max(depth, 0.0) - mass_center[center + 2]  # half way to the ground
    level = math.sqrt(ax * ax + ay * ay)
    hx, hy = (ay / level, -ax / level) if level > 1e-9 else (1.0, 0.0)  # to the left of the heading is (-hy, hx)
    speed_along = speed_across = speed_up = gain_along = gain_across = 0.0
    total, turning, by, sin, cos = 0.0, 0.0, 0, 0.0, 1.0  # [rad/s]: of the links before, and of the first `by`
    for link in range(tire.links):
        c = 6 * tire.chain[link]
        # velocity of the point that the dof makes: what it moves, and what it turns
        vx = axes[c + 3] + axes[c + 1] * z - axes[c + 2] * y
        vy = axes[c + 4] + axes[c + 2] * x - axes[c] * z
        up = axes[c + 5] + axes[c] * y - axes[c + 1] * x
        along, across = hx * vx + hy * vy, hx * vy - hy * vx
        if by < tire.turned_by[link]:
            before = turning
            while by < tire.turned_by[link]:
                if by > 0:  # its spin turns no heading
                    turning += axes[6 * tire.chain[by] + 2] * qvel[tire.chain[by]]
                by += 1
            if turning != before:
                half = 0.5 * timestep * turning
                sin, cos = math.sin(half), math.cos(half)
        row = _JACOBIAN + 64 * wheel + 4 * link
        scratch[row], scratch[row + 1] = along * cos + across * sin, across * cos - along * sin
        scratch[row + 2], scratch[row + 3] = up, drive_share if link == 0 else 0.0
        if link > 0:
            speed = qvel[tire.chain[link]]
            speed_along += along * speed
            speed_across += across * speed
            speed_up += up * speed
            seen = total if tire.straight[link] else turning
            gain_along += seen * across * speed
            gain_across -= seen * along * speed
            total += axes[c + 2] * speed
    scratch[_MOVES], scratch[_MOVES + 1], scratch[_MOVES + 2] = speed_along, speed_across, speed_up
    scratch[_MOVES + 3], scratch[_MOVES + 4] = gain_along, gain_across
    return depth


@kernel
def _move(
    data: int, found: Fields, tire: Any, wheel: int, short: float, dofs: int, scratch: FloatArray
) -> float:  # fmt: skip
    """Write how a contact point moves now, and by how much faster in a short step; return the wheel's speed forward.

    Both are seen from the wheel, whose heading turns.
    """
    qvel, acceleration = stages.vector(data, found.qvel, dofs), stages.vector(data, found.qacc_smooth, dofs)
    along = across = up = 0.0
    first = _JACOBIAN + 64 * wheel
    for link in range(1, tire.links):
        pull = acceleration[tire.chain[link]] * short
        along += scratch[first + 4 * link] * pull
        across += scratch[first + 4 * link + 1] * pull
        up += scratch[first + 4 * link + 2] * pull
    spin, pull = qvel[tire.chain[0]], acceleration[tire.chain[0]] * short
    velocity, free = _VELOCITY + 3 * wheel, _FREE + 3 * wheel
    scratch[velocity] = scratch[_MOVES] + scratch[first] * spin
    scratch[velocity + 1] = scratch[_MOVES + 1] + scratch[first + 1] * spin
    scratch[velocity + 2] = scratch[_MOVES + 2] + scratch[first + 2] * spin
    scratch[free] = along + scratch[first] * pull + short * scratch[_MOVES + 3]
    scratch[free + 1] = across + scratch[first + 1] * pull + short * scratch[_MOVES + 4]
    scratch[free + 2] = up + scratch[first + 2] * pull
    scratch[_VELOCITY + _DRIVE] += scratch[first + 3] * spin
    scratch[_FREE + _DRIVE] += scratch[first + 3] * pull
    forward: float = abs(scratch[_MOVES])
    return forward


@kernel
def _half_solve(
    data: int, found: Fields, inertia: Inertia, tire: Any, wheel: int, dofs: int, scratch: FloatArray
) -> None:
    """Write D^-1/2 L^-T times the rows of a wheel, where MuJoCo's inertia is L' D L, as far as its own dofs go.

    What that makes of the common dofs is added to theirs (commons, LANES).
    """
    factor = stages.vector(data, found.inertia_factor, len(inertia.columns))
    diagonal = stages.vector(data, found.inverse_diagonal, dofs)
    rows, halves, last = _JACOBIAN + 64 * wheel, _HALVES + 64 * wheel, tire.links - 1
    for i in range(4 * tire.links):
        scratch[halves + i] = scratch[rows + i]
    for link in range(tire.own_links):
        dof, own = tire.chain[link], halves + 4 * link
        start, root = inertia.row_starts[dof], math.sqrt(diagonal[dof])
        for entry in range(last - link):  # its row has all that it hangs on, the root first
            add_scaled_4(scratch, halves + 4 * (last - entry), own, -factor[start + entry])
        for i in range(4):
            scratch[own + i] *= root
    for link in range(tire.own_links, tire.links):
        common = _COMMON + LANES * tire.common[link]
        for i in range(3):
            scratch[common + 3 * wheel + i] = scratch[halves + 4 * link + i]
        scratch[common + _DRIVE] += scratch[halves + 4 * link + 3]


@kernel
def _half_solve_common(
    data: int, found: Fields, inertia: Inertia, gear: Any, dofs: int, scratch: FloatArray
) -> None:  # fmt: skip
    """Go on with what `_half_solve` does, for the common dofs."""
    factor = stages.vector(data, found.inertia_factor, len(inertia.columns))
    diagonal = stages.vector(data, found.inverse_diagonal, dofs)
    for place in range(gear.commons - 1, -1, -1):
        dof, own = gear.common[place], _COMMON + LANES * place
        start, root = inertia.row_starts[dof], math.sqrt(diagonal[dof])
        for entry in range(inertia.row_counts[dof] - 1):
            add_scaled_16(scratch, _COMMON + LANES * gear.common_of[place, entry], own, -factor[start + entry])
        for i in range(LANES):
            scratch[own + i] *= root


@kernel
def _mobility(gear: Any, tires: TireRows, short: float, scratch: FloatArray) -> None:
    """Write by how much each force changes each velocity in a short step (CONTACTS, LANES)."""
    for i in range(LANES * CONTACTS):
        scratch[_MOBILITY + i] = scratch[_ODD + i] = 0.0
    for place in range(gear.commons):
        sums, row = _ODD if place % 2 == 1 else _MOBILITY, _COMMON + LANES * place
        for i in range(CONTACTS):
            add_scaled_16(scratch, sums + LANES * i, row, scratch[row + i])
    for i in range(LANES * CONTACTS):
        scratch[_MOBILITY + i] += scratch[_ODD + i]
    drive = _MOBILITY + LANES * _DRIVE
    for k in range(len(tires)):
        block = _MOBILITY + (LANES + 1) * 3 * k
        for link in range(tires[k].own_links):
            own = _HALVES + 64 * k + 4 * link
            x, y, z, pull = scratch[own], scratch[own + 1], scratch[own + 2], scratch[own + 3]
            scratch[block] += x * x
            scratch[block + LANES] += y * x
            scratch[block + LANES + 1] += y * y
            scratch[block + 2 * LANES] += z * x
            scratch[block + 2 * LANES + 1] += z * y
            scratch[block + 2 * LANES + 2] += z * z
            scratch[drive + 3 * k] += pull * x
            scratch[drive + 3 * k + 1] += pull * y
            scratch[drive + 3 * k + 2] += pull * z
            scratch[drive + _DRIVE] += pull * pull
        for i in range(3):
            for j in range(i):
                scratch[block + LANES * j + i] = scratch[block + LANES * i + j]
            scratch[block + LANES * i + _DRIVE - 3 * k] = scratch[drive + 3 * k + i]
    for i in range(LANES * CONTACTS):
        scratch[_MOBILITY + i] *= short


@kernel
def step_on_tires(
    model: int, data: int, found: Fields, inertia: Inertia, gears: GearRows, tires: TireRows, mu: FloatArray,
    userdata: FloatArray, scratch: FloatArray, dofs: int, timestep: float, advance: bool, clear: bool, last: bool,
) -> None:  # fmt: skip
    """Do a physics step of a model whose cars have tires of ours, or only work out its forces and sensors.

    Arguments are those of `push_car`, of all cars, those on MuJoCo's contacts included (their `first_tire` is -1).

    Args:
      model: address of the mujoco.MjModel.
      data: address of the mujoco.MjData, written to.
      found: where the arrays of model and data are.
      inertia: of the model.
      gears: (m,) of GEAR.
      tires: (k,) of TIRE, of the cars with tires of ours.
      mu: (m, wheels) lateral peak of each tire [-].
      userdata: of the data.
      scratch: (SCRATCH,) room.
      dofs: of the model.
      timestep: [s].
      advance: whether to move the state.
      clear: whether there is no contact to be found.
      last: whether somebody reads the accelerometers of this step.
    """
    count, wheels = mu.shape
    begin_step(model, data, found, clear)
    limit_power(model, data, found, gears, dofs, True)
    for car in range(count):
        gear = gears[car]
        if gear.first_tire >= 0:
            own = userdata[gear.userdata : gear.userdata + USERDATA * wheels]
            resist_rolling(data, found, tires[gear.first_tire : gear.first_tire + wheels], own, dofs)
    damp_inertia(model, data, found, inertia, gears, dofs, timestep)
    stages.stage_actuation(model, data)
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
    """Do a physics step for each row of `records` and `states`, and write `readings` and `userdata` there.

    Arguments are those of `step_on_tires`; `readings` is the sensordata of the data.
    """
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
            spin = 0.0
            for wheel in range(4):
                spin += 0.25 * qvel[gear.spin_dof[wheel]]
            speed, motor = spin * gear.wheel_radius, gear.actuator[1]
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
    """Do MuJoCo's stages from the acceleration with the tires' forces on.

    `advance`: move the state, too; `last`: somebody reads the accelerometers of this step.
    """
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
def place_between(data: int, found: Fields, gear: Any, dofs: int, before: FloatArray, timestep: float) -> None:
    """Do what a car that turns does in a physics step, where MuJoCo takes what is at its beginning or at its end.

    Forces turn with the car: it speeds up along its mean heading, and not along that of before. It moves over the
    ground by the mean of its velocities before and after, and turns likewise: with the velocity after, a car that
    slides at v comes to rest v h / 2 too soon, and its tires answer to steering late. Not where something else than
    tires stops the car: a contact counts on it.

    Args:
      data: address of the mujoco.MjData, written to.
      found: where its arrays are.
      gear: of GEAR.
      dofs: of the model.
      before: velocities before the step, (3,): along x and y of the ground [m/s], and of the heading [rad/s].
      timestep: [s].
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
