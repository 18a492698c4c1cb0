"""The slip meter: how fast each tire's contact point slides over the ground, and how much of its friction it uses.

`record` copies the tires' sensors, which hold the contacts that the step was made with; `read` does the arithmetic
for all steps at once. A tire off the ground has no contact point: it reads NaN, never zero. The part of sliding across
the wheel's heading takes the sensors of `add_axle_sensors`, as World adds them; without them it is NaN.

Whether a tire slides is said here, and nowhere else. A contact point of the model `contact` slides when it is faster
than SLIDING_SPEED over the ground. A tire of bristles slides when the ground moves under it by more than BRISTLES_SLIDE
beyond what bends them. Any other tire slides when it is past its peak (`tire_forces`), and its sliding speed is that
part of its slip speed by which it is past it: v (1 - 1 / r), where its slip is r times that of the peak.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..arguments import explain_class
from ..display import brief
from ..errors import ModelError
from ..messages import FloatArray
from ..native import core
from .car import WHEELS, element_id, sensor_slice
from .tire_rows import TireRows, tire_rows, userdata_place
from .tires import CONTACT, LAW_OF

SLIDING_SPEED = 0.05
"""[m/s] A tire of the model `contact` slides when its contact point moves faster than this over the ground.

While it holds it creeps by 4 mm/s for each m/s^2 (see the tires' `solreffriction` in models/f1tenth.xml): 42 mm/s at
the limit of dry ground, measured on steady circles; past the limit the speed soon exceeds 100 mm/s.
"""


BRISTLES_SLIDE = 0.010
"""[m/s] A tire of bristles (Law.holds) slides when the ground moves under it by more than this beyond what bends them.

In a corner the light inner wheel bends its bristles to their end first, and slides by some mm/s, which the car does not
feel. Where the car slides, its speed is within 1 % of that of the law v^2 = g mu b / tan(steering), up to .2 rad, when
a tire passes this: measured, and much less than that of a contact, which counts its creep, too.
"""


def slides_above(model: str) -> float:
    """Return the speed above which a tire of a model slides [m/s]; of one with a curve it counts from the peak."""
    if model == CONTACT:
        return SLIDING_SPEED
    return BRISTLES_SLIDE if model in LAW_OF and LAW_OF[model].holds else 0.0


def sliding_rule(model: str) -> str:
    """Return when a tire of a model slides, in words."""
    speed = slides_above(model)
    return f"above {speed:g} m/s" if speed else "past its peak"


NO_PEAK = "not measured: these tires have no peak"
"""What is said of the sliding of tires that have no peak, past which they would slide."""


def sliding_text(speed: float | None, digits: int = 4, more: str = "") -> str:
    """Return a sliding speed [m/s] in words, with `more` behind it; NaN or None: tires without a peak."""
    return NO_PEAK if speed is None or math.isnan(speed) else f"{speed:.{digits}f} m/s{more}"


def share_text(share: float | None) -> str:
    """Return the share of the time in which a tire slid, in words; NaN or None: tires without a peak."""
    return NO_PEAK if share is None or math.isnan(share) else f"{100.0 * share:.2f} %"


_SENSORS = ("tire_contact", "wheel_position", "wheel_velocity", "wheel_angular_velocity")
_AXLE = "wheel_axle"  # sensor of a wheel: where its axle points, (3,) in the world

QUANTITIES = 10
"""Number of quantities of each tire and step that the slip meter writes."""

(
    _SLIDING_SPEED, _FRICTION_USE, NORMAL_FORCE, _FRICTION_FORCE, _LATERAL_SPEED, FORCE_X, FORCE_Y, SLIP_ANGLE,
    SLIP_RATIO, _SLIDES,
) = range(QUANTITIES)  # fmt: skip


@explain_class
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class TireSlip:
    """Slip and forces of the tires in the recorded steps; columns: front left, front right, rear left, rear right.

    All have shape (steps, 4), NaN where a tire is off the ground. Sliding speeds of tires without a peak are NaN, too.
    """

    values: FloatArray  # (QUANTITIES, steps, 4) the quantities below

    def __repr__(self) -> str:
        steps, touching = self.values.shape[1], np.isfinite(self.normal_force)
        if not touching.any():
            return brief(self, f"{steps} steps", "no tire on the ground")
        fastest, most = self.sliding_speed[touching].max(), self.friction_utilisation[touching].max()
        sliding = f"greatest sliding speed {sliding_text(fastest)}"
        return brief(self, f"{steps} steps", sliding, f"greatest friction utilisation {most:.2f}")

    @property
    def sliding_speed(self) -> FloatArray:
        """Sliding speed of each tire [m/s].

        Of bristles: the ground under them, beyond what bends them. Of the model `contact`: the contact point over the
        ground. Of any other tire: the part of its slip speed by which it is past its peak.
        """
        values: FloatArray = self.values[_SLIDING_SPEED]
        return values

    @property
    def friction_utilisation(self) -> FloatArray:
        """|Ft| over the greatest force at this load, 1 at the limit [-]."""
        values: FloatArray = self.values[_FRICTION_USE]
        return values

    @property
    def normal_force(self) -> FloatArray:
        """Fn [N]."""
        values: FloatArray = self.values[NORMAL_FORCE]
        return values

    @property
    def friction_force(self) -> FloatArray:
        """|Ft| [N]."""
        values: FloatArray = self.values[_FRICTION_FORCE]
        return values

    @property
    def lateral_sliding_speed(self) -> FloatArray:
        """Speed of the contact point over the ground across the wheel's heading [m/s]; NaN without axle sensors."""
        values: FloatArray = self.values[_LATERAL_SPEED]
        return values

    @property
    def longitudinal_force(self) -> FloatArray:
        """Force on the tire along the wheel's heading, forward positive [N]."""
        values: FloatArray = self.values[FORCE_X]
        return values

    @property
    def lateral_force(self) -> FloatArray:
        """Force on the tire across the wheel's heading, left positive [N]."""
        values: FloatArray = self.values[FORCE_Y]
        return values

    @property
    def slip_angle(self) -> FloatArray:
        """Angle from the contact's velocity to the wheel's heading [rad]; positive if the force is to the left.

        NaN where a wheel of the model `contact` hardly rolls.
        """
        values: FloatArray = self.values[SLIP_ANGLE]
        return values

    @property
    def slip_ratio(self) -> FloatArray:
        """By how much the tire's surface is faster than the wheel, over the wheel's speed [-]; NaN as `slip_angle`."""
        values: FloatArray = self.values[SLIP_RATIO]
        return values

    @property
    def slides(self) -> NDArray[np.bool_]:
        """Whether each tire slides. Shape (steps, 4); False off the ground."""
        slides: NDArray[np.bool_] = self.values[_SLIDES] > 0.0
        return slides


def add_axle_sensors(spec: Any) -> None:
    """Add to a vehicle's spec, in place, what measures where the axle of each wheel points; those it has stay."""
    for wheel in WHEELS:
        name = f"{wheel}_{_AXLE}"
        if spec.sensor(name) is not None:
            continue
        site = spec.body(f"{wheel}_wheel").add_site(name=name, group=5, rgba=(0.0, 0.0, 0.0, 0.0))
        site.alt.type = mujoco.mjtOrientation.mjORIENTATION_ZAXIS
        site.alt.zaxis = spec.joint(f"{wheel}_wheel").axis
        spec.add_sensor(
            name=name, type=mujoco.mjtSensor.mjSENS_FRAMEZAXIS, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=name
        )  # fmt: skip


def drop_tire_sensors(spec: Any) -> None:
    """Take the sensors of MuJoCo's contacts from a vehicle's spec, in place: tires with a law of ours need none."""
    names = {f"{wheel}_{sensor}" for wheel in WHEELS for sensor in _SENSORS}
    for sensor in list(spec.sensors):
        if sensor.name in names:
            spec.delete(sensor)


@explain_class
class TireSlipMeter:
    """Records the tires' contacts at every physics step, of a `pair` of each with the ground, which is at rest.

    Attributes:
      mu: friction coefficient of each tire, or its lateral peak, (4,).
      rows: of the tires, (4,) of TIRE; none for the model `contact`.
      readings, axles: where the tires' and the axles' sensors are in `data.sensordata`; -1: the model has none.

    Raises:
      ModelError: the model does not hold the car under this prefix.
    """

    def __init__(self, model: mujoco.MjModel, prefix: str = "") -> None:
        self.pairs = [element_id(model, mujoco.mjtObj.mjOBJ_PAIR, f"{prefix}{wheel}_tire") for wheel in WHEELS]
        self.mu: FloatArray = model.pair_friction[self.pairs, 0]
        self.rows: TireRows = tire_rows(model, prefix)
        self._place = userdata_place(model, prefix) if len(self.rows) else 0
        self.readings, self.axles = slice(0, 0), -1
        if not len(self.rows):
            slices = [sensor_slice(model, f"{prefix}{wheel}_{sensor}") for wheel in WHEELS for sensor in _SENSORS]
            if any(before.stop != after.start for before, after in pairwise(slices)):
                said = f"for each of {WHEELS}, {_SENSORS} side by side"
                raise ModelError(f"the tires' sensors are apart; accepted: {said}")
            self.readings = slice(slices[0].start, slices[-1].stop)
            self.axles = _first_axle(model, prefix)
        self._records = np.empty((8, model.nsensordata))
        self._states = np.empty((8, model.nuserdata))
        self._count = 0

    def __repr__(self) -> str:
        return brief(self, f"mu {self.mu.min():.4g}", f"{self._count} steps recorded")

    def record(self, data: mujoco.MjData) -> None:
        """Copy the sensors; call right after each `mj_step`."""
        if self._count == len(self._records):
            self._records = np.concatenate((self._records, np.empty_like(self._records)))
            self._states = np.concatenate((self._states, np.empty_like(self._states)))
        self._records[self._count] = data.sensordata
        if len(self.rows):
            self._states[self._count] = data.userdata
        self._count += 1

    def read(self) -> TireSlip:
        """Return the slip of all steps recorded since the last reading, shape (steps, 4), and forget them."""
        slip = self.measure(self._records[: self._count], self._states[: self._count])
        self._count = 0
        return slip

    def measure(self, records: FloatArray, states: FloatArray | None = None) -> TireSlip:
        """Return the slip of steps whose `sensordata` are the rows of `records` (steps, nsensordata).

        Tires with a curve need the steps' `userdata`, too, the rows of `states`.
        """
        slip = np.empty((QUANTITIES, len(records), len(WHEELS)))
        states = np.empty((len(records), 0)) if states is None else states
        core.measure_slip(
            records, self.readings.start, self.axles, self.mu[np.newaxis], self.rows, states, self._place, slip
        )
        return TireSlip(values=slip)


def _first_axle(model: mujoco.MjModel, prefix: str) -> int:
    """Return the first index of the axles' sensors in `data.sensordata`, -1 unless they are consecutive."""
    found = [
        mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SENSOR, f"{prefix}{wheel}_{_AXLE}") for wheel in WHEELS
    ]  # fmt: skip
    if min(found) < 0:
        return -1
    places = model.sensor_adr[found]
    return int(places[0]) if (np.diff(places) == 3).all() else -1
