"""Reads tires, steering and drive off a compiled model, for native/vehicle, which steps them; and puts tires on a spec.

Tires with a law of ours are rows of TIRE, and how a car is steered and driven is a row of GEAR. What a tire did in the
last step lies in `userdata`, which is a part of mjSTATE_INTEGRATION: a recorded state holds all that the next step
depends on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..errors import ModelError
from ..messages import FloatArray
from ..native import record
from .car import WHEELS, element_id, steering_of
from .changes import six_digits
from .drive_line import DriveLine, tie_on_contacts
from .steering_servo import ackermann, is_ours, is_plain_servo
from .tires import LAW_OF, LAWS, NUMBERS, NUMERIC, Tires, tires_of
from .tires.sets import numbers_of

_MOST_LINKS = 16  # joints between the world and a wheel, at most
_DAMPING_RATIO = 0.3  # [-] of a wheel's spin on its tire: between those of rubber and of its foam
_LONGEST = (0.35, 0.5)  # [-] of a short step times the fastest rate of the tires, of curves and of bristles: measured
_MOST_STEPS = 64  # short ones in a physics step
_MOST_COMMON = 16  # dofs that move more than one wheel, at most
_FIRST_AXLE = "front"
_SHARE = "{}_friction_share"  # numeric of a spec: what its pairs have of the vehicle's friction, as the tires have it
_ALONG = 0.999  # [-] cosine between the axis of a tire and the axle of its wheel, at least
_NEVER = -1e3  # [m] margin of contacts: no tire is ever as deep in the ground plane
_COUPLED = 1.0  # [-] of what a tendon may damp in a physics step, which takes its force of the step's beginning
_ON_CONTACTS = "or MuJoCo's own tires: a text 'tires' with data 'contact'"

USERDATA = 8
"""Numbers of each tire in `userdata`."""

ALONG, ACROSS, LOAD, FORCE_ALONG, FORCE_ACROSS, SLIDING, SLIDING_ACROSS, SLIP_SIZE = range(USERDATA)
"""Deflections [m] along the wheel's heading and to its left, which the next step begins with; then what the tire did in
the last step: its mean load [N] and force [N], forward and to the left positive, the greatest speed at which it slid
[m/s], that across its heading, and its greatest slip over that of the peak."""

TIRE = record(
    "Tire",
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
    ],
)
"""A tire with a law of ours, and its wheel. Functions take an array (tires,) of it; none for the model `contact`."""

GEAR = record(
    "Gear",
    [
        ("first_tire", np.int64),  # its first row among those of TIRE; -1: its tires are MuJoCo's contacts
        ("userdata", np.int64),  # where in `userdata` that of its tires begins
        ("free_qpos", np.int64),  # of base_link's joint
        ("free_dof", np.int64),
        ("drag", np.float64),  # [N s/m] against the velocity of its centre of gravity
        ("tire_steps", np.int64),  # short steps in a physics step, of `steps_within`
        ("commons", np.int64),
        ("common", np.int64, (_MOST_COMMON,)),  # the dofs that move more than one wheel, in order
        ("common_of", np.int64, (_MOST_COMMON, _MOST_COMMON)),  # where the entries of their rows are among them
        ("steered", np.int64),  # whether `steer` moves the steering, and the kingpins follow by polynomials
        ("handed", np.int64),  # whether MuJoCo's stages do; neither: its tires are MuJoCo's contacts, or it is no car
        ("steering_qpos", np.int64),
        ("steering_dof", np.int64),
        ("servo_damping", np.float64, (3,)),  # [N m s/rad] of its servo, and by the rate and its square; if handed
        ("servo_gear", np.float64),
        ("steering_damping", np.float64),  # [N m s/rad] of it and its kingpins
        ("steering_inertia", np.float64),  # [kg m^2] likewise
        ("steering_range", np.float64, (2,)),  # [rad] at which its joint ends; infinite: nowhere
        ("kingpin_qpos", np.int64, (2,)),
        ("kingpin_dof", np.int64, (2,)),
        ("ackermann", np.float64, (2, 5)),  # their angles as polynomials of the steering angle
        ("driven", np.int64),  # whether the motor acts through fixed shares of the wheels' spins
        ("lanes", np.int64),  # how many speeds of the drive line are followed, that of the drive first; see `push_car`
        ("share", np.float64, (4, 4)),  # of each wheel's spin in each of them
        ("give", np.float64, (4,)),  # of what ties each: 0 rigid, else an inverse inertia; negative: nothing does
        ("preload", np.float64, (4,)),  # [N m] of a clutch that holds each, [N] of the drag brake; negative: none does
        ("ramp", np.float64, (4,)),  # [-] of the torque through its axle
        ("clutches", np.int64),
        # of the two servos, steering and drive
        ("actuator", np.int64, (2,)),
        ("delayed", np.int64, (2,)),  # how MuJoCo interpolates what they were told; -1: they have no delay
        ("control_range", np.float64, (2, 2)),
        ("force_range", np.float64, (2, 2)),
        ("power", np.float64),  # [W] of the motor: its greatest force at `power_limit_speed`
        ("spin_dof", np.int64, (4,)),
        ("wheel_radius", np.float64),  # [m] mean of the drive
    ],
)
"""The steering and the drive of a car; of one on MuJoCo's contacts only the servos and the motor's power."""

TireRows = NDArray[np.void]
GearRows = NDArray[np.void]


def put_on(spec: Any, tires: Tires) -> Tires:
    """Put tires on a vehicle's spec, in place, for `tires_of`, with its friction; return them with it.

    The pairs stay as they are but for that, so that MuJoCo alone can drive the model, on its own contacts.

    Raises:
      ModelError: a pair that asks for a contact that tires of ours do not have, or a drag on MuJoCo's own contacts.
    """
    for name in ("front", "rear"):  # a spec that was written to a file has the tires of then
        numbers = spec.numeric(NUMERIC.format(name))
        if numbers is not None:
            spec.delete(numbers)
            spec.nuserdata = 0
        share = spec.numeric(_SHARE.format(name))
        if share is not None:  # else each writing would take it once more
            pairs = [spec.pair(f"{wheel}_tire") for wheel in WHEELS if wheel.startswith(name)]
            for pair in (each for each in pairs if each is not None):
                mu = six_digits(pair.friction[0] / share.data[0])
                pair.friction = [mu, mu, *pair.friction[2:]]
            spec.delete(share)
    if tires.is_contact:
        drag = spec.numeric("drag")
        if drag is not None and drag.data[0] > 0.0:
            said = f"numeric 'drag' is {drag.data[0]:g} on MuJoCo's own tires"
            raise ModelError(f"{said}; accepted: 0 there, or another set of tires")
        if spec.tendon("drive") is not None:
            tie_on_contacts(spec)
            for wheel in WHEELS:  # what implicit damping adds to the inertia, which MuJoCo's contacts do not know of
                joint = spec.joint(f"{wheel}_wheel")
                added = six_digits(spec.option.timestep * float(np.ravel(joint.damping)[0]))
                joint.armature = max(joint.armature, added)
        return tires
    found = [wheel for wheel in WHEELS if spec.pair(f"{wheel}_tire") is not None]
    frictions: list[float] = []
    for name in ("front", "rear"):
        own = {_plain_friction(spec, wheel) for wheel in found if wheel.startswith(name)}
        if len(own) > 1:
            raise ModelError(f"the {name} tires have friction {min(own):g} and {max(own):g}; accepted: one of both")
        frictions += own
    tires = tires.on(*frictions)
    spec.nuserdata = USERDATA * len(found)
    for name, axle, friction in zip(("front", "rear"), tires.axles, (frictions[0], frictions[-1]), strict=True):
        numbers = [six_digits(value) for value in numbers_of(axle, tires.model)]
        spec.add_numeric(name=NUMERIC.format(name), data=numbers)
        spec.add_numeric(name=_SHARE.format(name), data=[axle.lateral.peak / friction])
        for wheel in found:
            if wheel.startswith(name):
                pair, mu = spec.pair(f"{wheel}_tire"), six_digits(axle.lateral.peak)
                pair.friction = [mu, mu, *pair.friction[2:]]
    return tires


def _plain_friction(spec: Any, wheel: str) -> float:
    """Return the friction of a wheel's pair, which is the same in all directions."""
    pair = spec.pair(f"{wheel}_tire")
    along, across = pair.friction[:2]
    if pair.condim != 3 or along != across:
        raise ModelError(
            f"pair '{wheel}_tire' has condim {pair.condim} and friction {along:g} {across:g}; accepted: condim 3 and "
            f"one friction for both directions, {_ON_CONTACTS}"
        )
    return float(along)


def tire_rows(model: mujoco.MjModel, prefix: str = "") -> TireRows:
    """Return the rows of TIRE of a car in a compiled model, in the order of its wheels; none for the model `contact`.

    Raises:
      ModelError: no such car, too many joints, or what the model says of a tire or tendon and our steps do not obey.
    """
    tires = tires_of(model, prefix)
    if tires.is_contact:
        return np.zeros(0, TIRE)
    _require_plain_contact(model, prefix)
    _require_free_spins(model, prefix)
    rows, law = np.zeros(len(WHEELS), TIRE), LAW_OF[tires.model]
    common = _common(model, prefix)
    for row, wheel in zip(rows, WHEELS, strict=True):
        axle = tires.axles[0 if wheel.startswith("front") else 1]
        row["law"], row["holds"], row["slides"] = LAWS.index(law), law.holds, axle.lateral.has_peak
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


def _require_plain_contact(model: mujoco.MjModel, prefix: str) -> None:
    """Refuse what a model says of tires and tendons that our steps do not obey."""
    for wheel in WHEELS:
        pair = element_id(model, mujoco.mjtObj.mjOBJ_PAIR, f"{prefix}{wheel}_tire")
        for name in ("margin", "gap", "adhesion"):
            value = float(getattr(model, f"pair_{name}")[pair])
            if value != 0.0 and value != _NEVER:
                raise ModelError(f"pair '{wheel}_tire' has {name} {value:g}; accepted: 0, {_ON_CONTACTS}")
        _require_round(model, prefix, wheel)
    most = _COUPLED / float(model.opt.timestep)
    for tendon in range(model.ntendon):
        if not (rate := _damped_by(model, tendon)) <= most:
            name = model.tendon(tendon).name.removeprefix(prefix)
            raise ModelError(
                f"tendon {name!r} damps its joints at {rate:.4g} /s; accepted: up to {most:.4g} /s, {_ON_CONTACTS}"
            )


def _require_free_spins(model: mujoco.MjModel, prefix: str) -> None:
    """Refuse equalities of the wheels' spins: they act once a physics step, in which a tire answers many times."""
    spins = [element_id(model, mujoco.mjtObj.mjOBJ_JOINT, f"{prefix}{wheel}_wheel") for wheel in WHEELS]
    loss = float(model.tendon_frictionloss[element_id(model, mujoco.mjtObj.mjOBJ_TENDON, f"{prefix}drive")])
    if loss > 0.0:
        raise ModelError(f"tendon 'drive' has frictionloss {loss:g}; accepted: a numeric 'drag_brake' [N] in <custom>")
    for equality in range(model.neq):
        ends, tied = (int(model.eq_obj1id[equality]), int(model.eq_obj2id[equality])), set[int]()
        if model.eq_type[equality] == mujoco.mjtEq.mjEQ_JOINT:
            tied.update(ends)
        elif model.eq_type[equality] == mujoco.mjtEq.mjEQ_TENDON:
            for end in ends:
                wraps = slice(model.tendon_adr[end], model.tendon_adr[end] + model.tendon_num[end] if end >= 0 else 0)
                tied.update(model.wrap_objid[wraps][model.wrap_type[wraps] == mujoco.mjtWrap.mjWRAP_JOINT].tolist())
        if tied & set(spins):
            name = model.equality(equality).name.removeprefix(prefix)
            raise ModelError(
                f"equality {name!r} ties spins of wheels, between whose answers tires act many times; accepted: a text "
                f"'centre' with data 'shaft' or 'front_axle' or 'rear_axle' with 'locked' in <custom>, {_ON_CONTACTS}"
            )


def _require_round(model: mujoco.MjModel, prefix: str, wheel: str) -> None:
    """Refuse a tire that is not round about its wheel's axle: `_find_wheel` takes its first size for the radius."""
    geom = element_id(model, mujoco.mjtObj.mjOBJ_GEOM, f"{prefix}{wheel}_tire")
    kind, kinds, turn = model.geom_type[geom], mujoco.mjtGeom, np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
    across = {int(kinds.mjGEOM_ELLIPSOID): 1, int(kinds.mjGEOM_CYLINDER): 2, int(kinds.mjGEOM_CAPSULE): 2}
    axle = model.jnt_axis[element_id(model, mujoco.mjtObj.mjOBJ_JOINT, f"{prefix}{wheel}_wheel")]
    round_about = kind in across and abs(turn.reshape(3, 3)[:, across[int(kind)]] @ axle) > _ALONG
    if kind == kinds.mjGEOM_ELLIPSOID:
        round_about = round_about and model.geom_size[geom, 0] == model.geom_size[geom, 2]
    if not round_about and kind != kinds.mjGEOM_SPHERE:
        raise ModelError(
            f"geom '{wheel}_tire' is not round about the axle of its wheel; accepted: a sphere, or an ellipsoid, "
            f"cylinder or capsule with its axis along it, {_ON_CONTACTS}"
        )


def _damped_by(model: mujoco.MjModel, tendon: int) -> float:
    """Return how fast a tendon with its servo damps the joints that it is fixed to, at a rate of 1 [1/s]."""
    damping, servo = model.tendon_damping[tendon] + model.tendon_dampingpoly[tendon].sum(), model.tendon_actuatorid
    if servo[tendon] >= 0:
        damping += model.actuator_damping[servo[tendon]] + model.actuator_dampingpoly[servo[tendon]].sum()
    wraps = range(int(model.tendon_adr[tendon]), int(model.tendon_adr[tendon] + model.tendon_num[tendon]))
    fixed = [wrap for wrap in wraps if model.wrap_type[wrap] == mujoco.mjtWrap.mjWRAP_JOINT]
    dofs = model.jnt_dofadr[model.wrap_objid[fixed]]
    inertia = model.dof_M0[dofs] + float(model.opt.timestep) * model.dof_damping[dofs]
    return float(damping * (model.wrap_prm[fixed] ** 2 / inertia).sum())


def _common(model: mujoco.MjModel, prefix: str) -> list[int]:
    """Return the dofs that move more than one wheel, and those above them; of one wheel alone, none but its own do."""
    chains = [_chain(model, element_id(model, mujoco.mjtObj.mjOBJ_BODY, f"{prefix}{wheel}_wheel")) for wheel in WHEELS]
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
    """Return how many short steps of the tires a physics step has; ModelError: too long for tires so stiff."""
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
    """Return how a car is steered and driven, (1,) of GEAR, but for `first_tire`; ModelError: no such car."""
    gears, kinds = np.zeros(1, GEAR), mujoco.mjtObj
    gears["free_dof"] = gears["first_tire"] = -1
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
    _find_drive_line(gear, DriveLine.of(model, prefix))
    if not tires_of(model, prefix).is_contact:
        gear["userdata"] = userdata_place(model, prefix)
        free = element_id(model, kinds.mjOBJ_JOINT, f"{prefix}base_link")
        gear["free_qpos"], gear["free_dof"] = model.jnt_qposadr[free], model.jnt_dofadr[free]
        gear["drag"] = _drag(model, prefix) * model.body_subtreemass[model.jnt_bodyid[free]]
        _find_common(model, gear, _common(model, prefix))
        _find_steering(model, prefix, gear)
        gear["driven"] = _drives_spins(model, gear)
    gears.flags.writeable = False
    return gears


def _drag(model: mujoco.MjModel, prefix: str) -> float:
    """Return the drag of a car over its mass [1/s], as the numeric `drag` has it; 0 where there is none."""
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, f"{prefix}drag")
    found = float(model.numeric_data[model.numeric_adr[number]]) if number >= 0 else 0.0
    if not 0.0 <= found < math.inf:
        raise ModelError(f"numeric 'drag' is {found:g}; accepted: a number from 0 [1/s]")
    return found


def _find_common(model: mujoco.MjModel, gear: Any, common: Sequence[int]) -> None:
    """Write which dofs move more than one wheel, and what MuJoCo's inertia has in their rows."""
    gear["commons"], gear["common"], gear["common_of"] = len(common), -1, -1
    gear["common"][: len(common)] = common
    for place, dof in enumerate(common):
        start, entries = int(model.M_rowadr[dof]), int(model.M_rownnz[dof]) - 1
        columns = model.M_colind[start : start + entries].tolist()
        gear["common_of"][place][:entries] = [common.index(column) for column in columns]


def _find_steering(model: mujoco.MjModel, prefix: str, gear: Any) -> None:
    """Write who moves the steering and the kingpins, and what they need for it."""
    servo, joints = steering_of(model, prefix)
    dofs = model.jnt_dofadr[list(joints)]
    gear["steering_qpos"], *gear["kingpin_qpos"] = model.jnt_qposadr[list(joints)]
    gear["steering_dof"], *gear["kingpin_dof"] = dofs
    if not is_ours(model, servo, joints):
        gear["handed"] = 1
        if model.actuator_trntype[servo] == mujoco.mjtTrn.mjTRN_JOINT:
            gear["servo_gear"] = model.actuator_gear[model.actuator_outadr[servo], 0]
            gear["servo_damping"] = model.actuator_damping[servo], *model.actuator_dampingpoly[servo]
        return
    gear["steered"] = 1
    gear["steering_damping"] = model.dof_damping[dofs].sum()
    limited = bool(model.jnt_limited[joints[0]])
    gear["steering_range"] = model.jnt_range[joints[0]] if limited else (-np.inf, np.inf)
    gear["steering_inertia"] = six_digits(float(model.dof_M0[dofs].sum()))  # rounded for the same reason as damping
    gear["ackermann"] = [model.eq_data[equality, :5] for equality in ackermann(model, joints)]


def _find_drive_line(gear: Any, line: DriveLine) -> None:
    """Write the speeds of the drive line: that of the drive, and of each two shafts that something ties."""
    gear["lanes"], gear["give"], gear["preload"] = 1, -1.0, -1.0
    gear["wheel_radius"] = line.wheel_radius
    shares = np.array([line.shares[wheel] for wheel in WHEELS])
    gear["share"][:, 0] = shares
    if line.drag_brake > 0.0:
        gear["preload"][0], gear["clutches"] = line.drag_brake, 1
    if line.motor_inertia > 0.0:
        gear["give"][0] = line.wheel_radius**2 / line.motor_inertia
    if line.shaft:
        gear["share"][:, 1], gear["give"][1] = 2.0 * shares * (1.0, 1.0, -1.0, -1.0), 0.0
        gear["lanes"] = 2
    for wheel, axle in ((0, line.front), (2, line.rear)):
        if not axle.is_open:
            lane = int(gear["lanes"])
            gear["share"][wheel : wheel + 2, lane], gear["lanes"] = (0.5, -0.5), lane + 1
            if axle.locked:
                gear["give"][lane] = 0.0
            else:
                gear["preload"][lane], gear["ramp"][lane], gear["clutches"] = axle.preload, axle.ramp, 1


def _drives_spins(model: mujoco.MjModel, gear: Any) -> bool:
    """Return whether the motor is a plain servo that acts through fixed shares of the wheels' spins only."""
    motor, spins = int(gear["actuator"][1]), gear["spin_dof"].tolist()
    if not is_plain_servo(model, motor, 1):
        return False
    tendon = int(model.actuator_trnid[motor, 0])
    if model.tendon_actfrclimited[tendon] or model.jnt_actfrclimited[model.dof_jntid[spins]].any():
        return False
    wraps = slice(int(model.tendon_adr[tendon]), int(model.tendon_adr[tendon] + model.tendon_num[tendon]))
    if len(model.wrap_type[wraps]) > 4 or (model.wrap_type[wraps] != mujoco.mjtWrap.mjWRAP_JOINT).any():
        return False
    return set(model.jnt_dofadr[model.wrap_objid[wraps]].tolist()) <= set(spins)


def take_over(model: mujoco.MjModel, prefix: str = "") -> bool:
    """Switch off in a compiled model, in place, what `push_car` does; return whether the car has tires of ours.

    These are the contacts of its tires, Ackermann's equalities where it is steered by them, and implicit joint damping.
    """
    if tires_of(model, prefix).is_contact:
        return False
    for wheel in WHEELS:
        model.pair_margin[element_id(model, mujoco.mjtObj.mjOBJ_PAIR, f"{prefix}{wheel}_tire")] = _NEVER
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP)
    if gear_row(model, prefix)["steered"][0]:
        model.eq_active0[ackermann(model, steering_of(model, prefix)[1])] = 0
    return True


def userdata_place(model: mujoco.MjModel, prefix: str = "") -> int:
    """Return where in `userdata` that of a car's tires begins: behind that of all cars that come before it."""
    name = NUMERIC.format(_FIRST_AXLE)
    own = element_id(model, mujoco.mjtObj.mjOBJ_NUMERIC, prefix + name)
    before: int = sum(model.numeric(index).name.endswith(f"/{name}") for index in range(own))
    return before * USERDATA * len(WHEELS)


def peaks(model: mujoco.MjModel, prefix: str = "") -> FloatArray:
    """Return the friction coefficient of each tire, or its lateral peak [-]. Shape (4,), a copy."""
    pairs = [element_id(model, mujoco.mjtObj.mjOBJ_PAIR, f"{prefix}{wheel}_tire") for wheel in WHEELS]
    found: FloatArray = model.pair_friction[pairs, 0]
    return found
