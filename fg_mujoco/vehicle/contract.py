"""The contract of a vehicle's MJCF: the names that it must have, the rules that it must keep, and the checks of both.

A user's vehicle is checked when it is loaded; the bundled ones are checked by the tests.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from ..errors import FgMujocoError, ModelError, nearest
from ..lidar.beams import Beams
from ..messages import CarParameters, FloatArray
from .bodywork import HULL
from .car import WHEELS, Car, car_parameters, element_id, sensor_slice, steering_of
from .command_response import command_response
from .drive_line import DriveLine
from .steering_servo import ackermann
from .tire_forces import TireForces
from .tire_slip import TireSlipMeter
from .vehicle_mjcf import OWN_CAR

_FREE, _HINGE = mujoco.mjtJoint.mjJNT_FREE, mujoco.mjtJoint.mjJNT_HINGE
_PLANE, _BOX = mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_BOX

_GAP, _DEPTH = 0.001, 0.005  # [m] of a tire over the ground, and in it, before the car has settled
_SETTLING, _SETTLED = 0.5, 0.005  # [s] that a car is given to come to rest, and [m] by which it may move meanwhile
_MOST_DOFS, _MOST_CONTACTS = 200, 200  # of a vehicle alone on its ground
_STEERING_TOLERANCE = 0.005  # [rad] of a front wheel's angle at the steering's limit, from Ackermann's
_BAD_STATE = slice(int(mujoco.mjtWarning.mjWARN_BADQPOS), int(mujoco.mjtWarning.mjWARN_BADQACC) + 1)
_RADIUS_TOLERANCE = 0.05  # [-] of the radius that wheels roll on, from the height of their middles
_DRIVEN, _COMMANDED, _LEAST_SPEED = 1.0, 1.0, 0.05  # [s] of driving, the speed that is commanded then, and the least
_ANGLE = 0.25  # [-] of the greatest steering angle, by which it is steered meanwhile
_SERVOS = {
    "dyntype": ("mjtDyn", ("mjDYN_NONE", "mjDYN_FILTER", "mjDYN_FILTEREXACT")),
    "gaintype": ("mjtGain", ("mjGAIN_FIXED",)),
    "biastype": ("mjtBias", ("mjBIAS_AFFINE",)),
}
_FLAGS = (
    "CONSTRAINT", "EQUALITY", "FRICTIONLOSS", "LIMIT", "CONTACT", "SPRING", "DAMPER", "GRAVITY", "CLAMPCTRL",
    "ACTUATION", "SENSOR",
)  # fmt: skip


@dataclass(frozen=True)
class Part:
    """Something that the MJCF of a vehicle must name."""

    kind: str  # the element's, as MjSpec has it
    name: str
    what: str  # it is, with its unit
    type: Any = None  # that a joint or geom must have


def _parts() -> Iterator[Part]:
    yield Part("geom", "ground", "the ground that the car stands on, a plane", _PLANE)
    yield Part("body", "base_link", "the chassis: origin in the middle of the rear axle, x forward, y left, z up")
    yield Part("joint", "base_link", "its free joint", _FREE)
    yield Part("geom", "chassis", "the box, on base_link, that touches walls and obstacles: length and width", _BOX)
    yield Part("site", "lidar_mount", "on base_link, where the LiDAR stands")
    yield Part("joint", "steering", "steering angle of the bicycle model [rad]", _HINGE)
    for side in ("left", "right"):
        yield Part("joint", f"front_{side}_kingpin", f"steering angle of the {side} wheel [rad]", _HINGE)
    for wheel in WHEELS:
        noun = wheel.replace("_", " ")
        yield Part("body", f"{wheel}_wheel", f"the {noun} wheel, origin in its middle")
        yield Part("joint", f"{wheel}_wheel", "its spin [rad], forward positive", _HINGE)
        yield Part("geom", f"{wheel}_tire", "its tire")
        yield Part("pair", f"{wheel}_tire", "contact of the tire and the ground: friction, springs")
    yield Part(
        "tendon", "drive", "of the driven wheels' spins, each times a quarter of the radius, of two wheels half of it"
    )
    yield Part("actuator", "steering", "position servo of the steering, ctrl [rad]; the first actuator")
    yield Part("actuator", "speed", "velocity servo of the drive, ctrl [m/s]; the second actuator")
    yield Part("numeric", "power_limit_speed", "speed above which the motor's power limits the acceleration [m/s]")
    yield Part("sensor", "accelerometer", "in the centre of gravity [m/s^2]")
    yield Part("sensor", "chassis_contact", "whether the chassis touches anything")
    for wheel in WHEELS:
        yield Part("sensor", f"{wheel}_tire_contact", "the tire's contact: found, force, pos, normal")
        yield Part("sensor", f"{wheel}_wheel_position", "of the wheel's body [m]")
        yield Part("sensor", f"{wheel}_wheel_velocity", "of the wheel's body [m/s]")
        yield Part("sensor", f"{wheel}_wheel_angular_velocity", "of the wheel's body [rad/s]")


_FEW = 4  # faults that a message tells each with what is accepted

_TEXTS = ("centre", "front_axle", "rear_axle", "tires", "lidar", "look")
_NUMERICS = (
    "motor_inertia", "drag_brake", "drag", "motor", "battery", "power_limit_speed", "steering_map", "acceleration_map"
)  # fmt: skip

NEEDED = tuple(_parts())
"""All that the MJCF of a vehicle must name; docs/howto/own_car.md shows it."""


def check_names(spec: Any, where: str) -> None:
    """Refuse a spec without some of NEEDED, or with some of another type; ModelError: naming all of them."""
    faults: list[tuple[str, str]] = []
    for part in NEEDED:
        element = getattr(spec, part.kind)(part.name)
        if element is None:
            names = [other.name for other in getattr(spec, _PLURALS.get(part.kind, f"{part.kind}s")) if other.name]
            near = nearest(part.name, names, cutoff=0.8)
            meant = f" (did you mean {near!r}?)" if near is not None and not _is_part(part.kind, near) else ""
            faults.append((f"has no {part.kind} named {part.name!r}{meant}", part.what))
        elif part.type is not None and element.type != part.type:
            is_, should = (_type_name(kind) for kind in (element.type, part.type))
            faults.append((f"{part.kind} {part.name!r} is a {is_}", f"a {should}, {part.what}"))
    if len(faults) > len(NEEDED) // 2:
        raise ModelError(f"{where}: {_something_else(len(NEEDED) - len(faults))}")
    if faults:
        told = ", ".join(fault for fault, _ in faults)
        accepted = "; ".join(what for _, what in faults) if len(faults) <= _FEW else OWN_CAR
        raise ModelError(f"{where}: {told}; accepted: {accepted}")


def hint_at_another(text: str) -> str:
    """Return that an MJCF text is that of something else, if it has few of the names of NEEDED; else nothing."""
    known = sum(f'"{part.name}"' in text for part in NEEDED)
    return f"; {_something_else(known)}" if "<mujoco" in text and known <= len(NEEDED) // 2 else ""


def _something_else(known: int) -> str:
    """Say of an MJCF with few of the names of NEEDED what it is."""
    return f"is the MJCF of something else: it has {known} of the {len(NEEDED)} names of a vehicle; accepted: {OWN_CAR}"


_PLURALS = {"body": "bodies"}


def _is_part(kind: str, name: str) -> bool:
    return any(part.kind == kind and part.name == name for part in NEEDED)


def _type_name(kind: Any) -> str:
    return str(kind.name).split("_", 1)[1].lower()


def check_model(model: Any, beams: Beams, where: str) -> None:
    """Refuse a compiled vehicle that cannot be driven by a ModelError; warn of front wheels unlike Ackermann's."""
    if model.nv > _MOST_DOFS:
        raise ModelError(f"{where}: {model.nv} degrees of freedom; accepted: {_MOST_DOFS} at most")
    try:
        with _no_warnings():
            faults = list(engine_faults(model)) or list(_drive_faults(model, beams))
        if not faults:
            _check_stance(model, where)
            _check_steering(model, car_parameters(model), where)
    except mujoco.FatalError as error:  # as of too little memory
        raise ModelError(f"{where}: {' '.join(str(error).split())}; accepted: a car that MuJoCo simulates") from error
    if faults:
        raise ModelError(f"{where}: {'; and '.join(faults)}")


@contextmanager
def _no_warnings() -> Iterator[None]:
    """Let MuJoCo print nothing of a car that is refused in a line here."""
    log = mujoco.MjLogConfig()
    mujoco.MjLogConfig.set(log)
    try:
        yield
    finally:
        log.logto_console = True
        mujoco.MjLogConfig.set(log)


def _drive_faults(model: Any, beams: Beams) -> Iterator[str]:
    """Yield what is wrong with a compiled vehicle of a bounded size, as it is drawn."""
    if not (np.isfinite(model.body_mass).all() and np.isfinite(model.body_inertia).all()):
        yield "a mass or inertia is not finite; accepted: numbers above 0 [kg, kg m^2]"
        return
    yield from _place_faults(model)
    yield from _custom_faults(model)
    line = None
    try:
        line = DriveLine.of(model)
        _ = Car(model), TireSlipMeter(model), command_response(model)
    except FgMujocoError as error:
        yield str(error)
    for wheel in WHEELS:
        if model.joint(f"{wheel}_wheel").limited[0]:
            yield f"joint '{wheel}_wheel' has a range; accepted: none, so that the wheel turns on"
    if model.nmocap:
        moved = model.body(int(np.flatnonzero(model.body_mocapid >= 0)[0])).name
        yield f"body {moved!r} is a mocap body; accepted: none in a vehicle"
    if not all(model.eq_active0[equality] for equality in ackermann(model, steering_of(model)[1])):
        yield "an equality of the kingpins is not active; accepted: active, so that they follow the steering"
    yield from _standing_faults(model, line)
    yield from _beam_faults(model, beams)


def _custom_faults(model: Any) -> Iterator[str]:
    """Yield names under <custom> that are nearly those which are read, or of the other kind."""
    kinds = mujoco.mjtObj
    for kind, others, own, element, count in (
        ("text", _NUMERICS, _TEXTS, kinds.mjOBJ_TEXT, model.ntext),
        ("numeric", _TEXTS, _NUMERICS, kinds.mjOBJ_NUMERIC, model.nnumeric),
    ):
        for index in range(count):
            name = mujoco.mj_id2name(model, element, index)
            meant = nearest(name, (*own, *others), cutoff=0.8)
            if name in others:
                yield f"{kind} {name!r} is read as a {'numeric' if kind == 'text' else 'text'}; accepted: such a one"
            elif name not in own and meant is not None:
                yield f"{kind} {name!r} is nothing that is read; accepted: {meant!r}, or a name of your own unlike it"


def _place_faults(model: Any) -> Iterator[str]:
    """Yield wheels on the wrong sides, and what should be fixed to the chassis and is not."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    base = element_id(model, mujoco.mjtObj.mjOBJ_BODY, "base_link")
    if (height := float(data.geom("ground").xpos[2])) != 0.0:
        yield f"geom 'ground' is at z = {height:.4g} m; accepted: at 0"
    owners = ((model.site("lidar_mount"), "site 'lidar_mount'"), (model.geom("chassis"), "geom 'chassis'"))
    for owner, name in (*owners, (model.geom(HULL), f"geom {HULL!r}")):
        if owner.bodyid[0] != base:
            body = model.body(int(owner.bodyid[0])).name
            yield f"{name} is on body {body!r}; accepted: on 'base_link'"
    wheels = [element_id(model, mujoco.mjtObj.mjOBJ_BODY, f"{wheel}_wheel") for wheel in WHEELS]
    places = (data.xpos[wheels] - data.xpos[base]) @ data.xmat[base].reshape(3, 3)
    ahead, left = dict(zip(WHEELS, places[:, 0], strict=True)), dict(zip(WHEELS, places[:, 1], strict=True))
    for axle in ("front", "rear"):
        if not left[f"{axle}_left"] > left[f"{axle}_right"]:
            yield (
                f"{axle}_left_wheel is at y = {left[f'{axle}_left']:.4g} m and {axle}_right_wheel at "
                f"{left[f'{axle}_right']:.4g} m; accepted: y grows to the left"
            )
    for side in ("left", "right"):
        if not ahead[f"front_{side}"] > ahead[f"rear_{side}"]:
            yield (
                f"front_{side}_wheel is at x = {ahead[f'front_{side}']:.4g} m and rear_{side}_wheel at "
                f"{ahead[f'rear_{side}']:.4g} m; accepted: x grows forward"
            )


def _standing_faults(model: Any, line: DriveLine | None) -> Iterator[str]:
    """Yield how a car, as it is drawn, does not stand on its four tires, or does not roll on its drive's radii."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    ground, wrong = model.geom("ground").id, list[str]()
    for wheel in WHEELS:
        tire = model.geom(f"{wheel}_tire")
        if not (np.abs(tire.pos) <= _GAP).all():
            yield f"geom '{wheel}_tire' is {np.linalg.norm(tire.pos):.3g} m from its body's origin; accepted: there"
        gap = mujoco.mj_geomDistance(model, data, model.geom(f"{wheel}_tire").id, ground, 1.0, None)
        if not -_DEPTH <= gap <= _GAP:
            place = f"{1e3 * abs(gap):.3g} mm {'over' if gap > 0.0 else 'in'} the ground"
            yield (
                f"{wheel}_tire is {place} at rest; accepted: at most {1e3 * _GAP:g} mm over it or {1e3 * _DEPTH:g} mm "
                "in it"
            )
        height = float(data.body(f"{wheel}_wheel").xpos[2] - data.geom("ground").xpos[2])
        radius = 2.0 * len(line.driven) * line.shares[wheel] if line is not None else 0.0  # that it rolls on
        if radius > 0.0 and not abs(radius - height) <= _RADIUS_TOLERANCE * abs(height):
            wrong.append(f"{wheel}_wheel roll on {radius:.4g} m, its middle at {height:.4g} m")
    if wrong:
        yield (
            f"tendon 'drive' makes {', '.join(wrong)}; accepted: coefficients of a quarter of the radius for four "
            "driven wheels, and of half of it for two"
        )
    clear = mujoco.mj_geomDistance(model, data, model.geom(HULL).id, ground, 1.0, None)
    if clear <= 0.0:
        yield (
            f"geom 'chassis' is {1e3 * -clear:.3g} mm in the ground at rest; accepted: above the ground, or with a "
            f"geom {HULL!r} on 'base_link' that is, for the ground to stop"
        )


def _beam_faults(model: Any, beams: Beams) -> Iterator[str]:
    """Yield the parts of a car that its LiDAR's beams meet: `rangefinder` would see them, and `raycast` would not."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mount = data.site("lidar_mount")
    turn, count = mount.xmat.reshape(3, 3), len(beams.directions)
    base = element_id(model, mujoco.mjtObj.mjOBJ_BODY, "base_link")
    met: dict[int, list[float]] = {}
    geom = np.zeros(1, np.int32)
    for origin, direction in zip(beams.origins @ turn.T + mount.xpos, beams.directions @ turn.T, strict=True):
        distance = mujoco.mj_ray(model, data, origin, direction, None, 1, -1, geom)
        if 0.0 <= distance < beams.range_max and model.body_rootid[model.geom_bodyid[geom[0]]] == base:
            met.setdefault(int(geom[0]), []).append(distance)
    for part, distances in met.items():
        name = repr(model.geom(part).name) if model.geom(part).name else f"number {part}"
        yield (
            f"geom {name} is in the way of {len(distances)} of the {count} beams of the LiDAR, {min(distances):.3f} "
            "m from it; accepted: below the beams, or transparent (an rgba of its own, or a material, that ends in 0)"
        )


def _check_stance(model: Any, where: str) -> None:
    """Refuse a car that does not come to rest on four tires as it is drawn."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    drawn = _chassis_places(data)
    for _ in range(math.ceil(_SETTLING / model.opt.timestep)):
        if data.ncon > _MOST_CONTACTS:
            raise ModelError(f"{where}: {data.ncon} contacts at rest; accepted: {_MOST_CONTACTS} at most")
        _step(model, data, where)
    moved = float(np.abs(_chassis_places(data) - drawn).max())
    for wheel in WHEELS:
        if not data.sensordata[sensor_slice(model, f"{wheel}_tire_contact")][0] > 0.0:
            raise ModelError(
                f"{where}: {wheel}_tire does not touch the ground after {_SETTLING:g} s at rest; accepted: springs on "
                "which all four do"
            )
    if not moved <= _SETTLED:
        raise ModelError(
            f"{where}: the chassis moves by {1e3 * moved:.3g} mm in its first {_SETTLING:g} s at rest; accepted: at "
            f"most {1e3 * _SETTLED:g} mm (springref puts the car at rest as it is drawn)"
        )


def _step(model: Any, data: Any, where: str) -> None:
    """Do a physics step; refuse a car that MuJoCo resets, which says so on stderr the first time only."""
    time, counts = data.time, data.warning.number[_BAD_STATE]
    counts[:] = 2  # none is the first one; after a reset they are 0 and 1
    mujoco.mj_step(model, data)
    if not (counts == 2).all():
        raise ModelError(
            f"{where}: MuJoCo gives the car at rest positions, speeds or accelerations without bounds after "
            f"{time:.3g} s; accepted: springs, dampers and masses with which it stands"
        )


def _chassis_places(data: Any) -> FloatArray:
    """Return the positions of two points of the chassis, behind and ahead (2, 3) [m]."""
    return np.array((data.body("base_link").xpos, data.site("lidar_mount").xpos))


def _check_steering(model: Any, car: CarParameters, where: str) -> None:
    """Warn of front wheels that do not roll about one point, as when a wheelbase was changed and nothing else."""
    data = mujoco.MjData(model)
    data.ctrl[:] = car.max_steering_angle, 0.0
    for _ in range(math.ceil(_SETTLING / model.opt.timestep)):
        _step(model, data, where)
    for side, track_width in (("left", car.track_width), ("right", -car.track_width)):
        kingpin = f"front_{side}_kingpin"
        angle = float(data.joint(kingpin).qpos[0])
        steered = float(data.joint("steering").qpos[0])  # not what is commanded, of a servo with a gain or an offset
        exact = float(ackermann_angle(steered, car.wheelbase, track_width))
        if not abs(angle - exact) <= _STEERING_TOLERANCE:
            warnings.warn(
                f"{where}: {kingpin} is at {angle:.4f} rad at the steering's limit, where Ackermann's angle is "
                f"{exact:.4f}: tires slide in turns; fg_mujoco.addons.realcar.fitting gives the coefficients",
                stacklevel=2,
            )
            return


def ackermann_angle(angle: Any, wheelbase: float, track_width: float) -> Any:
    """Return the angle [rad] of a front wheel at steering angles; `track_width` is negative for the right one."""
    return np.arctan2(np.sin(angle), np.cos(angle) - np.sin(angle) * 0.5 * track_width / wheelbase)


def engine_faults(model: Any) -> Iterator[str]:
    """Yield what a compiled vehicle has of actuators and options that is not a car's, before its names are used."""
    names = [model.actuator(index).name for index in range(model.nactuator)]
    if names != ["steering", "speed"]:
        yield f"its actuators are {', '.join(names)}; accepted: steering, speed, in this order"
        return
    for index, name in enumerate(names):
        if model.actuator_ctrlnum[index] != 1:
            yield f"actuator {name!r} has {model.actuator_ctrlnum[index]} inputs; accepted: a servo of one input"
        for part, (kinds, accepted) in _SERVOS.items():
            kind = getattr(mujoco, kinds)(getattr(model, f"actuator_{part}")[index]).name
            if kind not in accepted:
                which = ", ".join(_word(other) for other in accepted)
                yield f"actuator {name!r} has {part} {_word(kind)}; accepted: {which}, as a servo has it"
    off = [flag for flag in _FLAGS if model.opt.disableflags & getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}")]
    if off or model.opt.disableactuator:
        which = ", ".join(f"flag {flag.lower()}" for flag in off) or "a group of actuators"
        yield f"option disables {which}; accepted: enabled, because cars are driven with it"
    if model.opt.enableflags & int(mujoco.mjtEnableBit.mjENBL_OVERRIDE):
        yield "option enables flag override; accepted: disabled, because each contact of a car has its own numbers"
    if model.opt.integrator == mujoco.mjtIntegrator.mjINT_DISCRETE:
        yield "option integrator is discrete; accepted: implicitfast, implicit, Euler or RK4"


def _word(kind: str) -> str:
    return kind.split("_", 1)[1].lower()


def check_drive(model: Any) -> None:
    """Refuse a compiled vehicle, on its tires, that does not drive for a second, steered a little, by a ModelError."""
    car, forces, data = Car(model), TireForces(model), mujoco.MjData(model)
    forces.begin(data)
    speed = min(_COMMANDED, car.parameters.max_speed)
    data.ctrl[:] = _ANGLE * car.parameters.max_steering_angle, speed
    counts = data.warning.number[_BAD_STATE]
    for _ in range(math.ceil(_DRIVEN / model.opt.timestep)):
        counts[:] = 2  # none is the first one, which MuJoCo prints; after a reset they are 0 and 1
        time = data.time
        forces.step(data)
        if not ((counts == 2).all() and np.isfinite(data.qvel).all()):
            raise ModelError(
                f"the car's positions, speeds or accelerations are without bounds after {time:.3g} s of "
                "driving; accepted: springs, dampers and servos with which it drives"
            )
    reached = car.ground_speed(data)
    if not reached >= _LEAST_SPEED * speed:
        raise ModelError(
            f"the car moves at {reached:.3g} m/s after {_DRIVEN:g} s at a command of {speed:g} m/s; accepted: "
            "a drive that moves it forward"
        )
    if not (yaw_rate := float(data.qvel[int(car.constants["free_dof"][0]) + 5])) > 0.0:
        raise ModelError(
            f"the car turns by {yaw_rate:.3g} rad/s when it is steered to the left; accepted: axes of the steering and "
            "the kingpins that point up"
        )
