"""Whether a vehicle can be driven: what its MJCF asks of the engine and of the tires, and a second of driving."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np

from ..errors import ModelError
from .car import Car
from .tire_forces import TireForces

_DRIVEN, _COMMANDED, _LEAST_SPEED = 1.0, 1.0, 0.05  # [s] of driving, the speed that is commanded then, and the least
_ANGLE = 0.25  # [-] of the greatest steering angle, by which it is steered meanwhile
_BAD_STATE = slice(int(mujoco.mjtWarning.mjWARN_BADQPOS), int(mujoco.mjtWarning.mjWARN_BADQACC) + 1)
_SERVOS = {
    "dyntype": ("mjtDyn", ("mjDYN_NONE", "mjDYN_FILTER", "mjDYN_FILTEREXACT")),
    "gaintype": ("mjtGain", ("mjGAIN_FIXED",)),
    "biastype": ("mjtBias", ("mjBIAS_AFFINE",)),
}
_NEEDED = (
    "CONSTRAINT", "EQUALITY", "FRICTIONLOSS", "LIMIT", "CONTACT", "SPRING", "DAMPER", "GRAVITY", "CLAMPCTRL",
    "ACTUATION", "SENSOR",
)  # fmt: skip


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
    off = [flag for flag in _NEEDED if model.opt.disableflags & getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}")]
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
