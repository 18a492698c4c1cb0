"""The drive line of a car: which axles its motor drives, and what ties the spins of its wheels.

The tendon `drive` of a vehicle's MJCF has the wheels that are driven, and <custom> has the rest:

    <text name="centre" data="shaft"/>
    <text name="rear_axle" data="limited 0.05 0.3"/>
    <numeric name="motor_inertia" data="0.0003"/>

- `centre`, of a car that drives both axles: `open` (a differential: the torques have the shares of the tendon) or
  `shaft` (both axles turn alike, and each takes the torque that its tires hold).
- `front_axle`, `rear_axle`: `open` (a differential: both wheels have the same torque), `locked` (both turn alike), or
  `limited`: its clutch holds the difference of the two torques up to a preload [N m] and a ramp [-] times the size of
  their sum. So does a differential of Salisbury's type (Milliken and Milliken, Race Car Vehicle Dynamics, 1995); the
  ramp is its locking value, 0 of an open one and 1 of one that never turns under load alone.
- `motor_inertia` [kg m^2]: of all that turns with the motor, about the axis of the driven wheels: the rotor's times the
  square of the gear ratio.
- `drag_brake` [N]: force at the ground against the motion of the drive, whatever its servo does: friction of gears and
  bearings, the motor's cogging, and the drag brake that an ESC is set to.

Where nothing is said, all is open, and the motor has neither inertia nor drag.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import mujoco

from ..errors import ModelError

AXLES = ("front", "rear")
_LEFT, _RIGHT = "left", "right"
_WHEELS = tuple(f"{axle}_{side}" for axle in AXLES for side in (_LEFT, _RIGHT))
_OF_AXLE = "'open', 'locked', or 'limited PRELOAD RAMP', of a preload [N m] and a ramp [-] from 0, not both 0"
_BOTH_WHEELS = "the spins of both wheels of the front axle, of the rear axle, or of both, by positive coefficients"
_NUMBERS = {"motor_inertia": "kg m^2", "drag_brake": "N"}
_TIED = "drive_line_"  # how the names begin of what `tie_on_contacts` adds


@dataclass(frozen=True, kw_only=True)
class Axle:
    """How the two wheels of an axle turn beside each other.

    Attributes:
      locked: whether they turn alike.
      preload: torque difference that a clutch holds [N m]; 0 with a ramp of 0: an open differential.
      ramp: what it holds of the torque through the axle besides [-].
    """

    locked: bool = False
    preload: float = 0.0
    ramp: float = 0.0

    @property
    def is_open(self) -> bool:
        """Whether its wheels turn freely beside each other."""
        return not self.locked and self.preload == self.ramp == 0.0

    @property
    def lock(self) -> float:
        """What the difference of its wheels' forces can be of their sum [-], preload left out: 0 open, 1 locked."""
        return 1.0 if self.locked else min(self.ramp, 1.0)


@dataclass(frozen=True, kw_only=True)
class DriveLine:
    """The drive line of a car, as its MJCF says it.

    Attributes:
      shares: coefficient of each wheel's spin in the tendon `drive` [m]; 0 of one that is not driven.
      shaft: whether both axles turn alike.
      front: axle.
      rear: axle.
      motor_inertia: about the axis of the driven wheels [kg m^2].
      drag_brake: force at the ground against the motion of the drive [N].
    """

    shares: Mapping[str, float]
    shaft: bool
    front: Axle
    rear: Axle
    motor_inertia: float
    drag_brake: float

    @property
    def driven(self) -> tuple[str, ...]:
        """The axles that the motor drives."""
        return tuple(axle for axle in AXLES if self.shares[f"{axle}_{_LEFT}"] > 0.0)

    @property
    def wheel_radius(self) -> float:
        """Radius that the driven wheels roll on, in the mean [m]."""
        return sum(self.shares.values())

    @classmethod
    def of(cls, model: mujoco.MjModel, prefix: str = "") -> DriveLine:
        """Return that of a car in a compiled model; ModelError: no such car, or a drive line that is none."""
        drive = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TENDON, f"{prefix}drive")
        if drive < 0:
            raise ModelError("the model has no tendon named 'drive'; accepted: a model with the car under this prefix")
        wraps = range(int(model.tendon_adr[drive]), int(model.tendon_adr[drive] + model.tendon_num[drive]))
        shares = {
            model.joint(int(model.wrap_objid[wrap])).name.removeprefix(prefix): float(model.wrap_prm[wrap])
            for wrap in wraps
            if model.wrap_type[wrap] == mujoco.mjtWrap.mjWRAP_JOINT
        }

        def text(name: str) -> str | None:
            found = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TEXT, prefix + name)
            start = int(model.text_adr[found])
            return None if found < 0 else bytes(model.text_data[start : start + model.text_size[found] - 1]).decode()

        def number(name: str) -> float:
            found = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, prefix + name)
            return float(model.numeric_data[model.numeric_adr[found]]) if found >= 0 else 0.0

        return cls._read(shares, text, number)

    @classmethod
    def of_spec(cls, spec: Any) -> DriveLine:
        """Return that of a vehicle's mujoco.MjSpec; raises as `of`."""
        shares = {wrap.target.name: float(wrap.coef) for wrap in spec.tendon("drive").path}
        texts = {text.name: str(text.data) for text in spec.texts}
        numbers = {number.name: float(number.data[0]) for number in spec.numerics if number.name in _NUMBERS}
        return cls._read(shares, texts.get, lambda name: numbers.get(name, 0.0))

    @classmethod
    def _read(
        cls, spins: Mapping[str, float], text: Callable[[str], str | None], number: Callable[[str], float]
    ) -> DriveLine:
        shares = {wheel: spins.get(f"{wheel}_wheel", 0.0) for wheel in _WHEELS}
        pairs = [(shares[f"{axle}_{_LEFT}"], shares[f"{axle}_{_RIGHT}"]) for axle in AXLES]
        if any((left > 0.0) != (right > 0.0) or left < 0.0 or right < 0.0 for left, right in pairs):
            raise ModelError(f"tendon 'drive' has {_told(shares)}; accepted: {_BOTH_WHEELS}")
        if not any(shares.values()):
            raise ModelError(f"tendon 'drive' has the spin of no wheel; accepted: {_BOTH_WHEELS}")
        numbers = {name: number(name) for name in _NUMBERS}
        for name, value in numbers.items():
            if not 0.0 <= value < math.inf:
                raise ModelError(f"numeric {name!r} is {value:g}; accepted: a number from 0 [{_NUMBERS[name]}]")
        centre = text("centre")
        if centre not in (None, "open", "shaft"):
            raise ModelError(f"text 'centre' is {centre!r}; accepted: 'open' or 'shaft'")
        if centre == "shaft" and not all(left > 0.0 for left, _ in pairs):
            raise ModelError(
                "text 'centre' is 'shaft' and tendon 'drive' drives one axle; accepted: 'open', or a tendon of all "
                "four spins"
            )
        front, rear = (_axle(f"{axle}_axle", text(f"{axle}_axle")) for axle in AXLES)
        return cls(shares=shares, shaft=centre == "shaft", front=front, rear=rear, **numbers)


def _told(shares: Mapping[str, float]) -> str:
    return ", ".join(f"{share:g} of {wheel}_wheel" for wheel, share in shares.items())


def _axle(name: str, text: str | None) -> Axle:
    """Return the axle that a text describes."""
    kind, *numbers = (text or "open").split()
    try:
        values = [float(number) for number in numbers]
    except ValueError:
        values = []
    if kind in ("open", "locked") and not numbers:
        return Axle(locked=kind == "locked")
    if kind == "limited" and len(values) == 2 and any(values) and all(0.0 <= value < math.inf for value in values):
        return Axle(preload=values[0], ramp=values[1])
    raise ModelError(f"text {name!r} is {text!r}; accepted: {_OF_AXLE}")


def tie_on_contacts(spec: Any) -> None:
    """Tie the wheels of a vehicle's spec as its drive line says, in place, for MuJoCo's own contacts.

    A shaft is an equality of a tendon, a locked axle one of two joints, and the preload of a limited one the friction
    of a tendon. The driven wheels share the motor's inertia, which is the same as long as they speed up alike.

    Raises:
      ModelError: a drive line that is none, or an axle with a ramp: MuJoCo's friction does not follow a torque.
    """
    for element in (*spec.equalities, *spec.tendons):  # of a spec that was written to a file
        if element.name.startswith(_TIED):
            spec.delete(element)
    line = DriveLine.of_spec(spec)
    if line.shaft:
        signs = {wheel: 2.0 if wheel.startswith("front") else -2.0 for wheel in _WHEELS}
        tendon = _add_tendon(spec, "centre", {wheel: sign * line.shares[wheel] for wheel, sign in signs.items()})
        spec.add_equality(name=tendon, name1=tendon, type=mujoco.mjtEq.mjEQ_TENDON, **_HARD)
    for name, axle in zip(AXLES, (line.front, line.rear), strict=True):
        left, right = f"{name}_{_LEFT}", f"{name}_{_RIGHT}"
        if axle.locked:
            joints = {"name1": f"{left}_wheel", "name2": f"{right}_wheel", "objtype": mujoco.mjtObj.mjOBJ_JOINT}
            equality = spec.add_equality(name=f"{_TIED}{name}", type=mujoco.mjtEq.mjEQ_JOINT, **joints, **_HARD)
            equality.data[:2] = 0.0, 1.0
        elif axle.ramp > 0.0:
            raise ModelError(
                f"text '{name}_axle' has ramp {axle.ramp:g} on MuJoCo's own tires; accepted: 0 there, because friction "
                "follows no torque, or another set of tires"
            )
        elif axle.preload > 0.0:
            tendon = _add_tendon(spec, name, {left: 0.5, right: -0.5})
            spec.tendon(tendon).frictionloss = axle.preload
    for number in [number for number in spec.numerics if number.name in _NUMBERS]:
        spec.delete(number)  # so that a spec that is read again does not have both twice
    spec.tendon("drive").frictionloss += line.drag_brake
    for wheel in _WHEELS:
        if line.shares[wheel] > 0.0:
            spec.joint(f"{wheel}_wheel").armature += line.motor_inertia / (2 * len(line.driven))


_HARD = {"solref": (0.01, 1.0), "solimp": (0.99, 0.999, 0.001, 0.5, 2.0)}  # twice a physics step: MuJoCo has no harder


def _add_tendon(spec: Any, name: str, coefficients: Mapping[str, float]) -> str:
    """Add a fixed tendon of the spins of wheels to a spec; return its name."""
    tendon = spec.add_tendon(name=f"{_TIED}{name}")
    for wheel, coefficient in coefficients.items():
        tendon.wrap_joint(f"{wheel}_wheel", coefficient)
    return f"{_TIED}{name}"
