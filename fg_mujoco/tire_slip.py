"""The slip meter: how fast each tire's contact point slides over the ground, and how much of its friction it uses.

    meter = TireSlipMeter(model)
    for _ in range(substeps):
        mujoco.mj_step(model, data)
        meter.record(data)
    slip = meter.read()  # arrays of shape (substeps, 4)

`record` copies the tires' sensors, which hold the contacts that the step was made with; `read` does the arithmetic
for all steps at once. A tire off the ground has no contact point: it reads NaN, never zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import mujoco
import numpy as np
from numpy.typing import NDArray

from .car import WHEELS, element_id, sensor_slice
from .errors import ModelError
from .messages import FloatArray

SLIDING_SPEED = 0.05
"""[m/s] A tire slides when its contact point moves faster than this over the ground.

A tire that holds still creeps by 3 mm/s for each m/s^2 (see the tires' `solref` in models/f1tenth.xml): 31 mm/s at
the limit of dry ground, measured on steady circles; past the limit the speed soon exceeds 100 mm/s.
"""

_SENSORS = ("tire_contact", "wheel_position", "wheel_velocity", "wheel_angular_velocity")


@dataclass(frozen=True, kw_only=True, eq=False)
class TireSlip:
    """What the tires did in the recorded steps; columns: front left, front right, rear left, rear right.

    All have shape (steps, 4), NaN where a tire is off the ground.
    """

    sliding_speed: FloatArray  # [m/s] of the contact point over the ground
    friction_use: FloatArray  # [-] |Ft| / (mu Fn), 1 at the limit
    normal_force: FloatArray  # [N] Fn
    friction_force: FloatArray  # [N] |Ft|

    @property
    def slides(self) -> NDArray[np.bool_]:
        """Whether each tire slides, faster than SLIDING_SPEED. Shape (steps, 4); False off the ground."""
        return self.sliding_speed > SLIDING_SPEED


class TireSlipMeter:
    """Records the tires' contacts at every physics step.

    mu is the tire's own friction: its geoms have the higher `priority`, so MuJoCo takes theirs and not the ground's.
    The ground is taken to be at rest.

    Raises:
      ModelError: the model does not hold the car under this prefix, or a ground geom overrides the tires' friction.
    """

    def __init__(self, model: mujoco.MjModel, prefix: str = "") -> None:
        self._model = model
        self._tires = np.array([element_id(model, mujoco.mjtObj.mjOBJ_GEOM, f"{prefix}{w}_tire") for w in WHEELS])
        _require_priority(model, self._tires)
        slices = [sensor_slice(model, f"{prefix}{wheel}_{sensor}") for wheel in WHEELS for sensor in _SENSORS]
        if any(before.stop != after.start for before, after in pairwise(slices)):
            raise ModelError(f"the tires' sensors are apart; accepted: for each of {WHEELS}, {_SENSORS} side by side")
        self._slice = slice(slices[0].start, slices[-1].stop)
        self._components = (self._slice.stop - self._slice.start) // len(WHEELS)
        self._records = np.empty((64, self._components * len(WHEELS)))
        self._count = 0

    def record(self, data: mujoco.MjData) -> None:
        """Copy the tires' sensors; call right after each `mj_step`."""
        if self._count == len(self._records):
            self._records = np.concatenate((self._records, np.empty_like(self._records)))
        self._records[self._count] = data.sensordata[self._slice]
        self._count += 1

    def read(self) -> TireSlip:
        """Return the slip of all steps recorded since the last reading, shape (steps, 4), and forget them."""
        # (components, steps, tires); a contact sensor reads: found, force in the contact's frame (normal first),
        # position, normal
        records = np.moveaxis(self._records[: self._count].reshape(self._count, len(WHEELS), self._components), 2, 0)
        found, force, point, normal, center, velocity, angular_velocity = np.split(records, (1, 4, 7, 10, 13, 16))
        self._count = 0

        point_velocity = velocity + _cross(angular_velocity, point - center)
        sliding_velocity = point_velocity - (point_velocity * normal).sum(axis=0) * normal
        normal_force, friction_force = force[0], np.hypot(force[1], force[2])
        mu = self._model.geom_friction[self._tires, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            friction_use = friction_force / (mu * normal_force)
        off_ground = found[0] == 0.0

        def where_on_ground(values: FloatArray) -> FloatArray:
            return np.where(off_ground, np.nan, values)

        return TireSlip(
            sliding_speed=where_on_ground(np.sqrt((sliding_velocity**2).sum(axis=0))),
            friction_use=where_on_ground(friction_use),
            normal_force=where_on_ground(normal_force),
            friction_force=where_on_ground(friction_force),
        )


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross product along the first axis; numpy's own takes thrice the time on arrays this small."""
    return np.stack((a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]))


def _require_priority(model: mujoco.MjModel, tires: NDArray[np.int_]) -> None:
    tire = int(tires[0])
    touches = (model.geom_contype & model.geom_conaffinity[tire]) | (model.geom_conaffinity & model.geom_contype[tire])
    grounds = np.flatnonzero(touches)
    overriding = grounds[model.geom_priority[grounds] >= model.geom_priority[tires].min()]
    if len(overriding):
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, int(overriding[0]))
        raise ModelError(
            f"geom {name!r} has priority {model.geom_priority[overriding[0]]}, so that its friction may act in place of"
            f" the tires'; accepted: a priority below {model.geom_priority[tires].min()}"
        )
