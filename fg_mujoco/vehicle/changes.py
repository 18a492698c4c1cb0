"""Cars that differ from their vehicle's MJCF: friction, mass, height of the CoG, servo gains, delay.

A change is made to the MJCF before it is compiled, or to the worlds of a batch that share one compiled model. Both get
the same numbers, of six digits, because that is what MJCF text keeps.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Any

import mujoco
import numpy as np

from ..arguments import explain_class, setting
from ..errors import SettingsError
from ..messages import FloatArray, require
from .car import WHEELS

GREATEST_MU = 3.0
"""[-] Greatest friction coefficient of tires that is accepted; no tire on any ground has more."""

ACCEPTED_MU = f"a positive number up to {GREATEST_MU:g}, which no tire of a 1:10 car reaches"

_LONGEST_DELAY = 0.15  # [s] 30 physics steps of 5 ms
_DELAY_SAMPLES = 32
_CHANGED = (
    "body_mass", "body_inertia", "body_ipos", "pair_friction", "actuator_gainprm", "actuator_biasprm", "actuator_delay"
)  # fmt: skip
_MASSES = 3  # of them are such that others follow from them
_CHASSIS, _SERVOS = "base_link", ("steering", "speed")


@explain_class
@dataclass(frozen=True, kw_only=True)
class CarChanges:
    """Changes of a vehicle's MJCF; None: no change.

    Raises:
      SettingsError: a value out of its range.
    """

    mu: float | None = None  # [-] friction coefficient of the tires
    mass: float | None = setting(  # what is added or taken sits in the chassis' centre of gravity
        None, "of the whole car [kg]; default: the vehicle's", "KG", "car"
    )
    center_of_gravity_height: float | None = setting(
        None, "of the whole car's centre of gravity over the ground [m]; default: the vehicle's", "M", "car"
    )
    steering_gain: float | None = setting(None, "factor on the stiffness of the steering servo; default: 1", "K", "car")
    speed_gain: float | None = setting(None, "factor on the gain of the speed servo; default: 1", "K", "car")
    command_delay: float | None = setting(None, "from a command to the servos [s]; default: the vehicle's", "S", "car")

    def __post_init__(self) -> None:
        given = {field.name for field in fields(self) if getattr(self, field.name) is not None}
        positive = tuple(sorted(given - {"command_delay", "mu"}))
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", positive, SettingsError)
        if "mu" in given:
            require(self, lambda value: 0.0 < value <= GREATEST_MU, ACCEPTED_MU, ("mu",), SettingsError)
        if "command_delay" in given:
            accepted = f"0 to {_LONGEST_DELAY} s"
            require(self, lambda value: 0.0 <= value <= _LONGEST_DELAY, accepted, ("command_delay",), SettingsError)


def set_mu(spec: Any, mu: float) -> None:
    """Set the greatest friction coefficient of the tires of a vehicle's spec [-], in place; their ratios stay."""
    pairs = [spec.pair(f"{wheel}_tire") for wheel in WHEELS]
    for pair, own in zip(pairs, scaled_mu([pair.friction[0] for pair in pairs], mu), strict=True):
        pair.friction = [own, own, *pair.friction[2:]]


def scaled_mu(present: Sequence[float], mu: float) -> list[float]:
    """Return friction coefficients with the ratios of the present ones, `mu` the greatest [-]."""
    greatest, rounded = max(present), six_digits(mu)
    return [six_digits(rounded * float(own) / float(greatest)) for own in present]


def change_spec(spec: Any, changes: CarChanges, plain: Any) -> None:
    """Change a vehicle's spec, in place; SettingsError: a mass or height that the chassis cannot have."""
    if changes.mu is not None:
        set_mu(spec, six_digits(changes.mu))
    if changes.mass is not None or changes.center_of_gravity_height is not None:
        chassis = spec.body(_CHASSIS)
        chassis.mass, chassis.inertia, chassis.ipos = _chassis(changes, plain)
    for servo, gain in zip(_SERVOS, (changes.steering_gain, changes.speed_gain), strict=True):
        actuator = spec.actuator(servo)
        if gain is not None:
            actuator.gainprm = [six_digits(gain * value) for value in actuator.gainprm]
            actuator.biasprm = [six_digits(gain * value) for value in actuator.biasprm]
        if changes.command_delay is not None:
            actuator.delay, actuator.nsample = six_digits(changes.command_delay), _DELAY_SAMPLES


def change_worlds(batch: Any, changes: Sequence[CarChanges], plain: Any, prefix: str = "") -> None:
    """Change the car of each world of a Batch; of a `command_delay` the model has one; `plain` of Vehicle.compile."""
    model = batch.model
    pairs = [model.pair(f"{prefix}{wheel}_tire").id for wheel in WHEELS]
    chassis = model.body(prefix + _CHASSIS).id
    servos = [model.actuator(prefix + servo).id for servo in _SERVOS]
    for world, change in _where(changes, "mu"):
        own = scaled_mu(model.pair_friction[pairs, 0].tolist(), change.mu)
        batch.expand("pair_friction")[world, pairs, :2] = np.array(own)[:, np.newaxis]
    heavier = dict((*_where(changes, "mass"), *_where(changes, "center_of_gravity_height")))
    for world, change in heavier.items():
        mass, inertia, position = _chassis(change, plain)
        batch.expand("body_mass")[world, chassis] = mass
        batch.expand("body_inertia")[world, chassis] = inertia
        batch.expand("body_ipos")[world, chassis] = position
    for name, servo in zip(("steering_gain", "speed_gain"), servos, strict=True):
        for world, change in _where(changes, name):
            for parameters in ("actuator_gainprm", "actuator_biasprm"):
                plain = getattr(model, parameters)[servo]
                batch.expand(parameters)[world, servo] = [six_digits(getattr(change, name) * v) for v in plain]
    for world, change in _where(changes, "command_delay"):
        batch.expand("actuator_delay")[world, servos] = six_digits(change.command_delay)
    if heavier:
        batch.set_const()


def restore_worlds(batch: Any) -> None:
    """Take back what `change_worlds` has changed in all worlds of a batch, so that they can be changed anew."""
    expanded = [batch.expanded(name) for name in _CHANGED]
    for name, values in zip(_CHANGED, expanded, strict=True):
        if values is not None:
            values[:] = getattr(batch.model, name)
    if any(values is not None for values in expanded[:_MASSES]):
        batch.set_const()


def _where(changes: Sequence[CarChanges], name: str) -> Iterator[tuple[int, Any]]:
    return ((world, change) for world, change in enumerate(changes) if getattr(change, name) is not None)


def _chassis(changes: CarChanges, car_model: Any) -> tuple[float, list[float], list[float]]:
    """Return mass [kg], principal inertia (3,) [kg m^2] and centre of gravity (3,) [m] that the chassis then has."""
    data = mujoco.MjData(car_model)
    mujoco.mj_kinematics(car_model, data)
    chassis = car_model.body(_CHASSIS).id
    others = np.flatnonzero((car_model.body_rootid == chassis) & (np.arange(car_model.nbody) != chassis))
    other_masses, other_heights = car_model.body_mass[others], data.xipos[others, 2]
    present: float = car_model.body_mass[chassis]
    position: FloatArray = car_model.body_ipos[chassis].copy()
    whole = changes.mass if changes.mass is not None else present + float(other_masses.sum())
    mass = whole - float(other_masses.sum())
    if mass <= 0.0:
        least = float(other_masses.sum())
        raise SettingsError(f"CarChanges.mass is {whole!r}; accepted: more than {least:.3g} kg, wheels and axles")
    if changes.center_of_gravity_height is not None:
        height = changes.center_of_gravity_height * whole - float(other_masses @ other_heights)
        position[2] = height / mass - data.xpos[chassis, 2]
    inertia = car_model.body_inertia[chassis] * (mass / present)
    return six_digits(mass), [six_digits(v) for v in inertia], [six_digits(v) for v in position]


def six_digits(value: float) -> float:
    """Return the number that MJCF text keeps of `value`."""
    return float(f"{value:.6g}")
