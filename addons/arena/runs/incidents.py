"""The contacts of a run of several cars, each with the verdict and the poses of all cars around the touch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fg_mujoco.racing.result import RaceResult

BEFORE, AFTER = 2.0, 1.0
"""[s] around the touch that are kept."""

_STEP = 2  # ticks from one pose to the next
_UNITS = 1000.0  # poses are in mm and mrad


@dataclass(frozen=True, kw_only=True)
class Incident:
    """A contact of two cars; fields are as in `Contact`, besides `poses`."""

    time_s: float
    car: str
    other: str
    closing_speed_m_s: float
    displacement_m: float
    at_fault: str  # a planner, "both" or "no fault"
    reason: str
    x_m: float
    y_m: float
    first_s: float  # time of the first pose
    step_s: float  # from one pose to the next
    poses: list  # type: ignore[type-arg]  # of each car of the heat a list: x [mm], y [mm], heading [mrad] of each pose

    def as_dict(self) -> dict[str, Any]:
        """Return its fields but the poses, as a table has them."""
        return {name: value for name, value in vars(self).items() if name not in ("first_s", "step_s", "poses")}


def incidents_of(result: RaceResult) -> tuple[Incident, ...]:
    """Return the contacts of a race, in the order of time."""
    times, period = result.cars[0].column("time_s"), result.world.lidar.beams.period
    poses = [np.stack([car.column(name) for name in ("x_m", "y_m", "heading_rad")], axis=1) for car in result.cars]
    found = []
    for contact in result.contacts:
        touch = int(np.searchsorted(times, contact.time_s - 1e-9))
        ticks = np.arange(touch - _STEP * round(BEFORE / period / _STEP), touch + round(AFTER / period) + 1, _STEP)
        ticks = ticks[(ticks >= 0) & (ticks < len(times))]
        found.append(
            Incident(
                time_s=contact.time_s, car=contact.cars[0], other=contact.cars[1],
                closing_speed_m_s=contact.closing_speed_m_s, displacement_m=contact.displacement_m,
                at_fault=contact.at_fault, reason=contact.reason, x_m=contact.x_m, y_m=contact.y_m,
                first_s=float(times[ticks[0]]), step_s=_STEP * period,
                poses=[np.rint(_UNITS * own[ticks]).astype(int).ravel().tolist() for own in poses],
            )
        )  # fmt: skip
    return tuple(found)
