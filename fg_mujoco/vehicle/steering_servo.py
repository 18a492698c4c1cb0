"""The steering of a car in a compiled model: who moves it in a physics step, and how its servo answers.

Tires of ours come with a steering of ours (`steer` of native/vehicle/tire_solve.hpp): a servo of limited force turns an
inertia with linear damping, and the kingpins follow it by polynomials. A car whose MJCF says anything else of these
joints, as a friction, a spring or a damping that is not linear, is steered by MuJoCo's own stages, which obey all that
an MJCF can say.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from functools import cache
from typing import Any

import mujoco
import numpy as np

from ..errors import ModelError
from ..messages import FloatArray

# Fields of joints, their dofs and actuators that our own steps read, or that say nothing of forces and limits. All
# others, those of later versions of MuJoCo too, must be as MuJoCo has them where a file does not say anything.
_KNOWN = {
    "jnt": "actuatorid axis bodyid dofadr group limited margin pos qposadr range solimp solref user",
    "dof": "M0 Madr armature bodyid damping invweight0 jntid length parentid simplenum solimp solref treeid",
    "actuator": "acc0 actadr biasprm ctrladr ctrllimited ctrlrange ctrlspec delay dynprm forcelimited "
    "forcerange gainprm group history historyadr length0 lengthrange outadr trnid user",
}
_PLAIN = """
<mujoco>
  <worldbody><body><joint name="hinge"/><geom size=".1"/></body></worldbody>
  <tendon><fixed name="drive"><joint joint="hinge" coef="1"/></fixed></tendon>
  <actuator><position joint="hinge"/><velocity tendon="drive"/></actuator>
</mujoco>
"""
_OFF = sum(
    int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}"))
    for name in ("CONSTRAINT", "EQUALITY", "SPRING", "DAMPER", "CLAMPCTRL", "ACTUATION")
)
_SHORT = 0.01  # [s] in which a hard constraint is back
_LIGHT = 0.1  # [-] of the inertia and the damping of a steering are of its kingpins, whose slopes are not 1 everywhere
_SMALL_STEP = 0.1  # [-] of the greatest angle: a servo answers to it without its greatest force
_RISEN = 1.0 - float(np.exp(-1.0))  # [-] of a step, after the time constant
_ENDS = 0.97  # [-] of the angle that a small step promises: less is the end of a steering
_WATCHED = 1.0  # [s] after each command
_HELD = 1e6  # [kg, kg m^2] of a chassis that does not move


@cache
def _plain_fields(kind: str, like: int) -> dict[str, FloatArray]:
    """Return what MuJoCo has in the fields of `kind` but those of `_KNOWN`, where a file does not name them."""
    plain, known = mujoco.MjModel.from_xml_string(_PLAIN), _KNOWN[kind].split()
    names = [name for name in dir(plain) if name.startswith(f"{kind}_") and name[len(kind) + 1 :] not in known]
    return {name: np.array(getattr(plain, name)[like]) for name in names}


def says_nothing_else(model: mujoco.MjModel, kind: str, indices: Sequence[int], like: int = 0) -> bool:
    """Return whether all fields of `kind` but those of `_KNOWN` are as in a file that does not name them."""
    own = list(indices)
    return all(bool((getattr(model, name)[own] == value).all()) for name, value in _plain_fields(kind, like).items())


_OF_A_PULL = ("stiffness", "stiffnesspoly", "damping", "dampingpoly", "frictionloss", "armature", "limited")
"""Fields of a tendon that exerts a force by itself."""


def is_plain_servo(model: mujoco.MjModel, actuator: int, like: int) -> bool:
    """Return whether an actuator is a servo of ours: `like` 0 of a joint's position, 1 of a tendon's speed."""
    on = not int(model.opt.disableflags) & _OFF and not model.opt.disableactuator
    return bool(on and says_nothing_else(model, "actuator", [actuator], like))


def is_ours(model: mujoco.MjModel, servo: int, joints: Sequence[int]) -> bool:
    """Return whether our own steps know all that a model says of a steering."""
    equalities, dofs = ackermann(model, joints), model.jnt_dofadr[list(joints)]
    servo_is_ours = is_plain_servo(model, servo, 0) and model.actuator_trnid[servo, 0] == joints[0]
    return bool(
        len(equalities) == 2
        and all(_is_hard(model.eq_solref[equality]) for equality in equalities)
        and _kingpins_are_light(model, dofs, equalities)
        and servo_is_ours
        and model.actuator_forcelimited[servo]
        and model.actuator_biasprm[servo, 2] == 0.0
        and says_nothing_else(model, "jnt", joints)
        and says_nothing_else(model, "dof", dofs)
        and not model.jnt_limited[list(joints[1:])].any()
        and not model.qpos0[model.jnt_qposadr[list(joints)]].any()
        and _ends_hard(model, servo, joints[0])
        and not _is_tied(model, joints, equalities)
    )


def ackermann(model: mujoco.MjModel, joints: Sequence[int]) -> list[int]:
    """Return the equalities that make the kingpins follow the steering; `joints` as in `is_ours`."""
    return [
        equality
        for kingpin in joints[1:]
        for equality in range(model.neq)
        if model.eq_type[equality] == mujoco.mjtEq.mjEQ_JOINT
        and (model.eq_obj1id[equality], model.eq_obj2id[equality]) == (kingpin, joints[0])
    ]


def _is_hard(solref: FloatArray) -> bool:
    """Return whether a constraint gives way for no longer than _SHORT."""
    return bool(solref[0] <= _SHORT if solref[0] > 0.0 else -solref[0] * _SHORT**2 >= 1.0)


def _kingpins_are_light(model: mujoco.MjModel, dofs: FloatArray, equalities: Sequence[int]) -> bool:
    """Return whether the kingpins turn one to one in the middle, and add little to what the servo turns."""
    light = [values[dofs[1:]].sum() <= _LIGHT * values[dofs].sum() for values in (model.dof_damping, model.dof_M0)]
    return bool(all(light) and (np.abs(model.eq_data[list(equalities), 1] - 1.0) <= _LIGHT).all())


def _ends_hard(model: mujoco.MjModel, servo: int, steering: int) -> bool:
    """Return whether the joint of the steering has no end, a hard one, or one that its servo does not reach."""
    if not model.jnt_limited[steering]:
        return True
    (low, high), (least, most) = model.jnt_range[steering], model.actuator_ctrlrange[servo]
    margin = model.jnt_margin[steering]
    reached = not model.actuator_ctrllimited[servo] or least < low + margin or most > high - margin
    return bool(not reached or (margin == 0.0 and _is_hard(model.jnt_solref[steering])))


def _is_tied(model: mujoco.MjModel, joints: Sequence[int], equalities: Sequence[int]) -> bool:
    """Return whether a tendon, or an equality besides those given, acts on one of the joints or on what they move."""
    moved = set(model.jnt_bodyid[list(joints)].tolist())
    for body in range(model.nbody):  # a parent comes before its children
        if int(model.body_parentid[body]) in moved:
            moved.add(body)
    kinds, wraps = mujoco.mjtObj, mujoco.mjtWrap
    for equality in set(range(model.neq)) - set(equalities):
        ends = model.eq_obj1id[equality], model.eq_obj2id[equality]
        if model.eq_type[equality] == mujoco.mjtEq.mjEQ_JOINT:
            tied = any(end in joints for end in ends)
        elif model.eq_objtype[equality] == kinds.mjOBJ_SITE:
            tied = any(int(model.site_bodyid[end]) in moved for end in ends)
        else:
            tied = model.eq_objtype[equality] == kinds.mjOBJ_BODY and any(end in moved for end in ends)
        if tied and model.eq_active0[equality]:
            return True
    objects, last = model.wrap_objid, model.tendon_adr + model.tendon_num
    return any(
        (model.wrap_type[wrap] == wraps.mjWRAP_JOINT and int(objects[wrap]) in joints)
        or (model.wrap_type[wrap] == wraps.mjWRAP_SITE and int(model.site_bodyid[objects[wrap]]) in moved)
        for tendon in range(model.ntendon)
        if _pulls(model, tendon)
        for wrap in range(int(model.tendon_adr[tendon]), int(last[tendon]))
    )


def _pulls(model: mujoco.MjModel, tendon: int) -> bool:
    """Return whether a tendon can exert a force: those of a look are only to be seen."""
    tied = model.eq_objtype[model.eq_type == mujoco.mjtEq.mjEQ_TENDON].size > 0
    driven = model.actuator_trnid[model.actuator_trntype == mujoco.mjtTrn.mjTRN_TENDON, 0]
    return bool(
        tied or tendon in driven or any(np.any(getattr(model, f"tendon_{name}")[tendon]) for name in _OF_A_PULL)
    )


def response(model: mujoco.MjModel, servo: int, joints: Sequence[int]) -> tuple[float, float, float]:
    """Return how a steering answers: greatest angle [rad] and rate [rad/s], and time constant below that rate [s].

    Those of a steering of ours follow from its numbers; others are driven by MuJoCo. Arguments are those of `is_ours`.

    Raises:
      ModelError: a steering that does not turn as it is commanded.
    """
    stiffness = -float(model.actuator_biasprm[servo, 1])
    if not 0.0 < stiffness < np.inf:
        raise ModelError(f"stiffness of the steering is {stiffness:g}; accepted: a number above 0")
    lock = float(np.abs(model.actuator_ctrlrange[servo]).min())
    if not is_ours(model, servo, joints):
        return _driven(model, servo, joints[0], lock)
    damping = float(model.dof_damping[model.jnt_dofadr[list(joints)]].sum())  # they turn one to one in the middle
    if not damping > 0.0:
        raise ModelError(f"damping of the steering is {damping:g}; accepted: a number above 0")
    end = float(np.abs(model.jnt_range[joints[0]]).min()) if model.jnt_limited[joints[0]] else np.inf
    return min(lock, end), float(np.abs(model.actuator_forcerange[servo]).min()) / damping, damping / stiffness


def _driven(model: mujoco.MjModel, servo: int, steering: int, lock: float) -> tuple[float, float, float]:
    """Return what `response` does of a steering that MuJoCo drives, its chassis held in the air."""
    alone: Any = copy(model)
    flags = mujoco.mjtDisableBit
    alone.opt.disableflags = (int(alone.opt.disableflags) | int(flags.mjDSBL_CONTACT)) & ~int(flags.mjDSBL_EULERDAMP)
    alone.opt.gravity[:] = 0.0
    root = int(alone.body_rootid[alone.jnt_bodyid[steering]])
    alone.dof_armature[alone.body_dofadr[root] :][: alone.body_dofnum[root]] = _HELD
    timestep, place = float(alone.opt.timestep), int(alone.jnt_qposadr[steering])

    def angles(data: Any, command: float) -> FloatArray:
        data.ctrl[alone.actuator_ctrladr[servo]], seen = command, [data.qpos[place]]
        for _ in range(max(round(_WATCHED / timestep), 1)):
            mujoco.mj_step(alone, data)
            seen.append(data.qpos[place])
        return np.array(seen)

    data = mujoco.MjData(alone)
    right, left = angles(data, -lock), angles(data, lock)
    rate, reached = float(np.abs(np.diff(left)).max()) / timestep, 0.5 * float(left[-1] - right[-1])
    data = mujoco.MjData(alone)
    angles(data, 0.0)
    turned = angles(data, _SMALL_STEP * lock)
    gain = float(turned[-1] - turned[0]) / (_SMALL_STEP * lock or np.nan)
    share = (turned - turned[0]) / (turned[-1] - turned[0] or np.nan)
    after = int(np.argmax(share >= _RISEN))
    within = (_RISEN - share[after - 1]) / (share[after] - share[after - 1] or np.nan)
    time_constant = (after - 1 + within) * timestep - float(alone.actuator_delay[servo])
    if not (after > 0 and 0.0 < time_constant < np.inf and 0.0 < rate < np.inf):
        raise ModelError(
            f"the steering does not reach its command within {_WATCHED:g} s; accepted: a position servo that does"
        )
    greatest = lock if reached >= _ENDS * gain * lock else reached / gain  # six digits: the same among other bodies
    return float(f"{greatest:.6g}"), float(f"{rate:.6g}"), float(f"{time_constant:.6g}")
