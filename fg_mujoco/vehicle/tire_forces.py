"""The forces of tires with a curve, worked out before each physics step and written into the state.

    forces = TireForces(model)
    forces.begin(data)  # after mj_forward
    for _ in range(substeps):
        forces.apply(data)
        mujoco.mj_step(model, data)
        forces.end(data)

MuJoCo's contacts of such tires have condim 1: they carry the load only. Each tire has two deflections u [m] of its
contact patch, along its heading and across, that follow the velocity v of its contact point over the ground by

    du/dt = v - V u / sigma

with the relaxation length sigma and the wheel's forward speed V. Its slip is u / sigma: along the heading the slip
ratio, across it the tangent of the slip angle. In a slip of both, each is measured by the slip of its own peak
(similarity): the size r of this slip vector gives the force, the curve's at r times the peak's slip, along the slip
vector. So the greatest forces lie on an ellipse, and a tire is past its peak where r is above 1.

The force acts at the contact point on the wheel's body, in its row of `xfrc_applied`; nobody else may write there. What
belongs to a tire lies in `userdata` (see USERDATA). Both are parts of mjSTATE_INTEGRATION, so that a recorded state
holds all that the next step depends on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..errors import ModelError
from ..kernels import kernel
from ..messages import FloatArray
from .car import WHEELS, element_id, sensor_slice
from .changes import six_digits
from .tires import AXLE_KEYS, CURVE_KEYS, GREATEST_SLIP, LINEAR, NUMERIC, Tires, tires_of

_LINKS = 8  # joints and bodies between the chassis and a wheel, at most

_DAMPING_RATIO = 0.3  # [-] of a deflected tire under a car that stands: between those of rubber and of its foam
_DAMPED_BELOW = 0.5  # [m/s] forward; there the damping has faded, so that it takes no part in what is measured
_GRAVITY = 9.81  # [m/s^2] from a load to the mass that swings on a tire, for its damping
_STIFFEST = 1.0  # [-] of timestep^2 * stiffness / mass: a stiffer tire is slowed down, because beyond 4 it would ring
_YAWING = 2.5  # [-] a car yields to a side force on one tire as a mass smaller by this would, because it yaws and rolls

READINGS = 19
"""Sensor readings of a tire: found, force in the contact's frame (normal first), point, normal; centre, velocity and
angular velocity of the wheel."""

USERDATA = 6
"""Numbers of each tire in `userdata`."""

ALONG, ACROSS, LOAD, LOAD_USED, FORCE_ALONG, FORCE_ACROSS = range(USERDATA)
"""Deflections [m] along the wheel's heading and to its left; the load of the last step, which the next force is of, and
the load that the last force was of [N]; and that force [N], forward and to the left positive."""

TIRE = np.dtype(
    [
        ("linear", np.int64),
        ("alike", np.int64),  # whether both curves are the same
        # along the heading and across; see TireCurve
        ("B", np.float64, (2,)),
        ("C", np.float64, (2,)),
        ("D", np.float64, (2,)),
        ("E", np.float64, (2,)),
        ("slope", np.float64, (2,)),
        ("peak_slip", np.float64, (2,)),  # 1 for a linear curve
        ("peak", np.float64, (2,)),
        ("hold_slip", np.float64, (2,)),
        ("relaxation_length", np.float64),
        ("load_sensitivity", np.float64),
        ("nominal_load", np.float64),
        ("radius", np.float64),  # [m] of an ellipsoid about its axle, and half its width; equal: of a sphere
        ("half_width", np.float64),
        ("ground", np.float64),  # [m] height
        ("wheel_mass", np.float64),  # [kg] spin inertia over the square of the radius
        ("free_qpos", np.int64),
        ("free_dof", np.int64),
        ("body", np.int64),  # of the wheel
        ("axle", np.float64, (3,)),  # in the frame of the wheel's body, forward spin positive
        ("center_of_mass", np.float64, (3,)),
        ("spin_dof", np.int64),
        ("links", np.int64),  # from the chassis to the wheel, without its spin
        ("kind", np.int64, (_LINKS,)),  # 0: fixed, 1: slide, 2: hinge
        ("qpos", np.int64, (_LINKS,)),
        ("dof", np.int64, (_LINKS,)),
        ("qpos0", np.float64, (_LINKS,)),
        ("place", np.float64, (_LINKS, 3)),  # of its frame in that of the link before
        ("turned", np.int64, (_LINKS,)),  # whether `turn` is more than none
        ("turn", np.float64, (_LINKS, 9)),
        ("axis", np.float64, (_LINKS, 3)),
        ("anchor", np.float64, (_LINKS, 3)),
    ]
)
"""A tire with a curve, and where its wheel is. Kernels take an array (tires,) of it; none for the model `contact`."""

TireRows = NDArray[np.void]

_FIXED, _SLIDE, _HINGE = range(3)


def put_on(spec: Any, tires: Tires) -> None:
    """Put tires on a vehicle's spec, in place: its pairs, and the numbers that `tires_of` reads."""
    if tires.is_contact:
        return
    found = [wheel for wheel in WHEELS if spec.pair(f"{wheel}_tire") is not None]
    spec.nuserdata = USERDATA * len(found)
    for name, axle in zip(("front", "rear"), tires.axles, strict=True):
        curves = (axle.lateral, axle.longitudinal)
        values = [getattr(curve, key) or 0.0 for curve in curves for key in CURVE_KEYS]
        values += [getattr(axle, key) for key in AXLE_KEYS]
        spec.add_numeric(name=NUMERIC.format(name), data=[six_digits(value) for value in values])
        for wheel in found:
            if wheel.startswith(name):
                pair = spec.pair(f"{wheel}_tire")
                mu = six_digits(axle.lateral.peak)
                pair.condim, pair.friction = 1, [mu, mu, *pair.friction[2:]]


def tire_rows(model: mujoco.MjModel, prefix: str = "", wheels: Sequence[str] = WHEELS) -> TireRows:
    """Return the rows of TIRE of a car in a compiled model, in the order of its wheels; none for the model `contact`.

    Raises:
      ModelError: the model does not hold the car under this prefix, or a wheel hangs on something else than hinges and
        slides.
    """
    tires = tires_of(model, prefix)
    if tires.is_contact:
        return np.zeros(0, TIRE)
    rows = np.zeros(len(wheels), TIRE)
    for row, wheel in zip(rows, wheels, strict=True):
        axle = tires.axles[0 if wheel.startswith("front") else 1]
        row["linear"], row["alike"] = tires.model == LINEAR, axle.lateral == axle.longitudinal
        for k, curve in enumerate((axle.longitudinal, axle.lateral)):
            for name in ("B", "C", "D", "E", "slope", "peak", "hold_slip"):
                row[name][k] = getattr(curve, name)
            row["peak_slip"][k] = curve.peak_slip if math.isfinite(curve.peak_slip) else 1.0
        for name in AXLE_KEYS:
            row[name] = getattr(axle, name)
        _find_wheel(model, prefix, wheel, row)
    rows.flags.writeable = False
    return rows


def _find_wheel(model: mujoco.MjModel, prefix: str, wheel: str, row: Any) -> None:
    """Write where a wheel is, and what it hangs on."""
    geom = element_id(model, mujoco.mjtObj.mjOBJ_GEOM, f"{prefix}{wheel}_tire")
    size = model.geom_size[geom]
    ellipsoid = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_ELLIPSOID
    row["radius"] = size[0]
    row["half_width"] = size[1] if ellipsoid else size[0]
    ground = element_id(model, mujoco.mjtObj.mjOBJ_GEOM, f"{prefix}ground")
    row["ground"] = model.geom_pos[ground, 2]
    free = element_id(model, mujoco.mjtObj.mjOBJ_JOINT, f"{prefix}base_link")
    row["free_qpos"], row["free_dof"] = model.jnt_qposadr[free], model.jnt_dofadr[free]
    base = int(model.jnt_bodyid[free])
    body = element_id(model, mujoco.mjtObj.mjOBJ_BODY, f"{prefix}{wheel}_wheel")
    spin = element_id(model, mujoco.mjtObj.mjOBJ_JOINT, f"{prefix}{wheel}_wheel")
    row["body"], row["axle"], row["spin_dof"] = body, model.jnt_axis[spin], model.jnt_dofadr[spin]
    row["center_of_mass"] = model.body_ipos[body]
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, model.body_iquat[body])
    about_axle = (turn.reshape(3, 3).T @ model.jnt_axis[spin]) ** 2 @ model.body_inertia[body]
    row["wheel_mass"] = (about_axle + model.dof_armature[row["spin_dof"]]) / row["radius"] ** 2

    chain = [body]
    while chain[-1] != base:
        chain.append(int(model.body_parentid[chain[-1]]))
        if chain[-1] == 0:
            raise ModelError(f"{prefix}{wheel}_wheel does not hang on base_link; accepted: a body of the car")
    links = 0
    for at in reversed(chain[:-1]):
        first = model.body_jntadr[at]
        joints = [joint for joint in range(first, first + model.body_jntnum[at]) if joint != spin]
        for k, joint in enumerate(joints or [None]):
            if links == _LINKS:
                raise ModelError(f"{prefix}{wheel}_wheel hangs on more than {_LINKS} joints; accepted: fewer")
            moved = k == 0
            row["place"][links] = model.body_pos[at] if moved else 0.0
            mujoco.mju_quat2Mat(turn, model.body_quat[at] if moved else np.array([1.0, 0.0, 0.0, 0.0]))
            row["turn"][links], row["turned"][links] = turn, (turn.reshape(3, 3) != np.eye(3)).any()
            if joint is not None:
                kinds = {mujoco.mjtJoint.mjJNT_SLIDE: _SLIDE, mujoco.mjtJoint.mjJNT_HINGE: _HINGE}
                kind = kinds.get(mujoco.mjtJoint(int(model.jnt_type[joint])))
                if kind is None:
                    raise ModelError(f"{prefix}{wheel}_wheel hangs on a ball joint; accepted: hinges and slides")
                row["kind"][links], row["axis"][links] = kind, model.jnt_axis[joint]
                row["anchor"][links] = model.jnt_pos[joint]
                row["qpos"][links], row["dof"][links] = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
                row["qpos0"][links] = model.qpos0[model.jnt_qposadr[joint]]
            links += 1
    row["links"] = links


class TireForces:
    """The forces of a car's tires, for stepping its model by hand; nothing to do for the model `contact`.

    Args:
      model: compiled.
      prefix: of the car's names.
      wheels: that it has.

    Attributes:
      rows: of the tires, (wheels,) of TIRE; none for the model `contact`.
      mu: lateral peak of each tire [-], (wheels,). Live.
    """

    def __init__(self, model: mujoco.MjModel, prefix: str = "", wheels: Sequence[str] = WHEELS) -> None:
        self.rows = tire_rows(model, prefix, wheels)
        self.mu: FloatArray = peaks(model, prefix, wheels)
        self._sensors = [sensor_slice(model, f"{prefix}{wheel}_tire_contact").start for wheel in wheels]
        self._timestep = model.opt

    def begin(self, data: mujoco.MjData) -> None:
        """Take the loads of a forward pass, with tires at rest."""
        if len(self.rows):
            data.userdata[:] = 0.0
            data.xfrc_applied[self.rows["body"]] = 0.0
            self.end(data)

    def apply(self, data: mujoco.MjData) -> None:
        """Write the forces for the next step; call it before `mj_step`."""
        if len(self.rows):
            apply_forces(
                data.qpos, data.qvel, data.userdata, data.xfrc_applied.reshape(-1), self.rows, self.mu,
                self._timestep.timestep,
            )  # fmt: skip

    def end(self, data: mujoco.MjData) -> None:
        """Take the loads of a step; call it after `mj_step`."""
        for tire, place in enumerate(self._sensors if len(self.rows) else ()):
            data.userdata[USERDATA * tire + LOAD] = max(data.sensordata[place + 1], 0.0)


@kernel
def note_loads(sensors: FloatArray, start: int, userdata: FloatArray, count: int) -> None:
    """Write the loads of `count` tires to their user data, from sensors whose tires' readings begin at `start`."""
    for tire in range(count):
        place = start + tire * READINGS
        userdata[USERDATA * tire + LOAD] = max(sensors[place + 1], 0.0) if sensors[place] > 0.0 else 0.0


def peaks(model: mujoco.MjModel, prefix: str = "", wheels: Sequence[str] = WHEELS) -> FloatArray:
    """Return the friction coefficient of each tire, or its lateral peak [-]. Shape (wheels,), a copy."""
    pairs = [element_id(model, mujoco.mjtObj.mjOBJ_PAIR, f"{prefix}{wheel}_tire") for wheel in wheels]
    found: FloatArray = model.pair_friction[pairs, 0]
    return found


@kernel
def curve_force(tire: Any, way: int, slip: float) -> float:
    """Return the force over the load [-] of a tire at a slip without sign; `way` 0: along its heading, 1: across."""
    if tire.linear:
        linear: float = tire.slope[way] * slip
        return linear
    x = tire.B[way] * min(slip, tire.hold_slip[way])
    force: float = tire.D[way] * math.sin(tire.C[way] * math.atan(x - tire.E[way] * (x - math.atan(x))))
    return force


@kernel
def slips(tire: Any, along: float, across: float) -> tuple[float, float, float]:
    """Return slip ratio and slip angle [rad] of deflections [m], and the size of both, 1 at the peak.

    The signs are those of the deflections: a wheel that brakes has a positive slip, one that drifts to the left, too.
    """
    ratio, angle = along / tire.relaxation_length, math.atan(across / tire.relaxation_length)
    return ratio, angle, math.hypot(ratio / tire.peak_slip[0], angle / tire.peak_slip[1])


@kernel
def patch_force(tire: Any, along: float, across: float, grip: float) -> tuple[float, float]:
    """Return the force [N] along the heading and to the left of a contact patch that is deflected by so much [m].

    `grip` is the load [N] times what scales the curves: load sensitivity and friction.
    """
    ratio, angle, size = slips(tire, along, across)
    if size == 0.0:
        return 0.0, 0.0
    share_along, share_across = ratio / tire.peak_slip[0] / size, angle / tire.peak_slip[1] / size
    across_force = curve_force(tire, 1, size * tire.peak_slip[1])
    along_force = across_force if tire.alike else curve_force(tire, 0, size * tire.peak_slip[0])
    return -grip * along_force * share_along, -grip * across_force * share_across


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
    tire: Any,
    along: float,
    across: float,
    velocity: tuple[float, float, float],
    grip: float,
    load: float,
    timestep: float,
) -> tuple[float, float, float, float]:
    """Return the deflections of a contact patch after a time step [m], and its force then [N].

    Args:
      tire: of TIRE.
      along: deflection before, along the heading [m].
      across: to the left [m].
      velocity: of the contact point over the ground, forward and to the left, and of the wheel, forward [m/s].
      grip: as in `patch_force`.
      load: [N].
      timestep: [s].
    """
    over_x, over_y, forward = velocity
    sigma, slope = tire.relaxation_length, max(tire.slope[0], tire.slope[1])
    if not tire.linear and along * over_x + across * over_y < 0.0 and slips(tire, along, across)[2] > 1.0:
        # A tire that slid, and now moves back, springs back by what gives its force, and no more.
        force_x, force_y = patch_force(tire, along, across, grip)
        along, across = -force_x * sigma / (grip * tire.slope[0]), -force_y * sigma / (grip * tire.slope[1])
    # One that slides while its wheel hardly rolls deflects no further than at GREATEST_SLIP.
    rolled = timestep * max(abs(forward), math.hypot(over_x, over_y) / GREATEST_SLIP) / sigma
    share = -math.expm1(-rolled)  # of the way to the slip that it ends in; exact where the velocities stay
    reach = timestep * (share / rolled if rolled > 1e-9 else 1.0)
    # Stiff tires under little mass are slowed down, as by an implicit step; where the velocities stay nothing changes.
    stiffness, fade = slope * grip / sigma, max(1.0 - abs(forward) / _DAMPED_BELOW, 0.0)
    mass_x, mass_y = 1.0 / (1.0 / tire.wheel_mass + _GRAVITY / load), load / _GRAVITY / _YAWING
    stiff_x, stiff_y = timestep * timestep * stiffness / mass_x, timestep * timestep * stiffness / mass_y
    damped_x = damped_y = 0.0
    if fade > 0.0:
        damping = 2.0 * _DAMPING_RATIO * fade
        damped_x, damped_y = damping * math.sqrt(stiff_x), damping * math.sqrt(stiff_y)
    step_x = (over_x * reach - along * share) / (1.0 + max(stiff_x - _STIFFEST, 0.0) + damped_x)
    step_y = (over_y * reach - across * share) / (1.0 + max(stiff_y - _STIFFEST, 0.0) + damped_y)
    along, across = along + step_x, across + step_y
    force_x, force_y = patch_force(tire, along, across, grip)
    if fade > 0.0:
        force_x -= damped_x * mass_x * step_x / (timestep * timestep)
        force_y -= damped_y * mass_y * step_y / (timestep * timestep)
        much = math.hypot(force_x / tire.peak[0], force_y / tire.peak[1]) / grip
        if much > 1.0 and not tire.linear:
            force_x, force_y = force_x / much, force_y / much
    return along, across, force_x, force_y


@kernel
def apply_forces(
    qpos: FloatArray, qvel: FloatArray, userdata: FloatArray, applied: FloatArray, tires: TireRows, mu: FloatArray,
    timestep: float,
) -> None:  # fmt: skip
    """Deflect the tires of a car for a physics step, and write their forces.

    Args:
      qpos: of the model, at the start of the step.
      qvel: of the model.
      userdata: of the car, written to.
      applied: `xfrc_applied`, six numbers a body, written to.
      tires: (4,) of TIRE.
      mu: (4,) lateral peak of each [-].
      timestep: [s].
    """
    for k in range(len(tires)):
        tire = tires[k]
        own = userdata[USERDATA * k : USERDATA * (k + 1)]
        to = applied[6 * tire.body : 6 * tire.body + 6]
        load = own[LOAD]
        own[LOAD_USED] = load
        if load <= 0.0:
            own[ALONG] = own[ACROSS] = own[FORCE_ALONG] = own[FORCE_ACROSS] = 0.0
            for i in range(6):
                to[i] = 0.0
            continue
        height, (vx, vy), (wx, wy, wz), (ax, ay, az), (mx, my, mz) = _wheel_motion(qpos, qvel, tire, timestep)
        # contact point, from the wheel's middle: below an ellipsoid, half way to the ground
        broad = tire.half_width**2 - tire.radius**2
        deep = math.sqrt(tire.radius**2 + broad * az * az)
        rx, ry, rz = -broad * az * ax / deep, -broad * az * ay / deep, -deep
        rz = 0.5 * (rz - height)
        norm = math.hypot(ax, ay)
        hx, hy = ay / norm, -ax / norm  # heading on the ground; to its left is (-hy, hx)
        vx, vy = vx + wy * rz - wz * ry, vy + wz * rx - wx * rz
        forward = hx * vx + hy * vy
        spin = qvel[tire.spin_dof]
        px, py = vx + spin * (ay * rz - az * ry), vy + spin * (az * rx - ax * rz)
        velocity = (hx * px + hy * py, hx * py - hy * px, forward)
        grip = grip_of(tire, load, mu[k])
        along, across, fx, fy = deflect(tire, own[ALONG], own[ACROSS], velocity, grip, load, timestep)
        own[ALONG], own[ACROSS], own[FORCE_ALONG], own[FORCE_ACROSS] = along, across, fx, fy
        to[0], to[1], to[2] = hx * fx - hy * fy, hy * fx + hx * fy, 0.0
        rx, ry, rz = rx - mx, ry - my, rz - mz
        to[3], to[4], to[5] = -rz * to[1], rz * to[0], rx * to[1] - ry * to[0]


@kernel
def _turned(m: Any, x: float, y: float, z: float) -> tuple[float, float, float]:
    return m[0] * x + m[1] * y + m[2] * z, m[3] * x + m[4] * y + m[5] * z, m[6] * x + m[7] * y + m[8] * z


@kernel
def _product(a: Any, b: Any) -> tuple[float, float, float, float, float, float, float, float, float]:
    return (
        a[0] * b[0] + a[1] * b[3] + a[2] * b[6], a[0] * b[1] + a[1] * b[4] + a[2] * b[7],
        a[0] * b[2] + a[1] * b[5] + a[2] * b[8], a[3] * b[0] + a[4] * b[3] + a[5] * b[6],
        a[3] * b[1] + a[4] * b[4] + a[5] * b[7], a[3] * b[2] + a[4] * b[5] + a[5] * b[8],
        a[6] * b[0] + a[7] * b[3] + a[8] * b[6], a[6] * b[1] + a[7] * b[4] + a[8] * b[7],
        a[6] * b[2] + a[7] * b[5] + a[8] * b[8],
    )  # fmt: skip


@kernel
def _quaternion(w: float, x: float, y: float, z: float) -> tuple[float, ...]:
    return (
        w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y),
        2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x),
        2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z,
    )  # fmt: skip


@kernel
def _wheel_motion(qpos: FloatArray, qvel: FloatArray, tire: Any, timestep: float) -> Any:
    """Return the height of a wheel's middle over the ground and, without its spin, how it moves.

    These are its velocity along the ground, its angular velocity, where its axle points, and where its centre of mass
    is from its middle, all in the world.
    """
    q, v = tire.free_qpos, tire.free_dof
    m = _quaternion(qpos[q + 3], qpos[q + 4], qpos[q + 5], qpos[q + 6])
    x, y, z = qpos[q], qpos[q + 1], qpos[q + 2]
    vx, vy, vz = qvel[v], qvel[v + 1], qvel[v + 2]
    wx, wy, wz = _turned(m, qvel[v + 3], qvel[v + 4], qvel[v + 5])
    half = 0.5 * timestep * wz  # MuJoCo's velocities are half a step older than its positions
    vx, vy = vx - half * vy, vy + half * vx
    for k in range(tire.links):
        dx, dy, dz = _turned(m, tire.place[k, 0], tire.place[k, 1], tire.place[k, 2])
        x, y, z = x + dx, y + dy, z + dz
        vx, vy, vz = vx + wy * dz - wz * dy, vy + wz * dx - wx * dz, vz + wx * dy - wy * dx
        if tire.turned[k]:
            m = _product(m, tire.turn[k])
        if tire.kind[k] == 0:
            continue
        axis_x, axis_y, axis_z = tire.axis[k, 0], tire.axis[k, 1], tire.axis[k, 2]
        ax, ay, az = _turned(m, axis_x, axis_y, axis_z)
        by, rate = qpos[tire.qpos[k]] - tire.qpos0[k], qvel[tire.dof[k]]
        if tire.kind[k] == 1:
            dx, dy, dz = ax * by, ay * by, az * by
            x, y, z = x + dx, y + dy, z + dz
            vx, vy, vz = vx + wy * dz - wz * dy, vy + wz * dx - wx * dz, vz + wx * dy - wy * dx
            vx, vy, vz = vx + ax * rate, vy + ay * rate, vz + az * rate
            continue
        anchor_x, anchor_y, anchor_z = tire.anchor[k, 0], tire.anchor[k, 1], tire.anchor[k, 2]
        tx, ty, tz = _turned(m, anchor_x, anchor_y, anchor_z)
        half = math.sin(0.5 * by)
        m = _product(m, _quaternion(math.cos(0.5 * by), half * axis_x, half * axis_y, half * axis_z))
        ux, uy, uz = _turned(m, anchor_x, anchor_y, anchor_z)
        # the joint's anchor moves as the link before; the rest turns about it
        vx, vy, vz = vx + wy * tz - wz * ty, vy + wz * tx - wx * tz, vz + wx * ty - wy * tx
        wx, wy, wz = wx + ax * rate, wy + ay * rate, wz + az * rate
        vx, vy, vz = vx - wy * uz + wz * uy, vy - wz * ux + wx * uz, vz - wx * uy + wy * ux
        x, y, z = x + tx - ux, y + ty - uy, z + tz - uz
    axle, center = tire.axle, tire.center_of_mass
    return (
        z - tire.ground, (vx, vy), (wx, wy, wz), _turned(m, axle[0], axle[1], axle[2]),
        _turned(m, center[0], center[1], center[2]),
    )  # fmt: skip
