"""The records of a car that does not stand on its wheels: a jump, and a chassis that rests on the ground.

They are read off the telemetry and the last state of a car, and this module is imported where there is one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from ..messages import FloatArray
from ..simulation.cars import tree_of
from ..simulation.engine import Engine
from ..simulation.telemetry import TELEMETRY
from ..simulation.terrain import BODIES
from ..simulation.world import World
from ..vehicle.car import WHEELS

JUMP = 0.1
"""[s] without a wheel on the ground, from which on it is a jump."""

_TIME, _LAP, _X, _VX = (TELEMETRY.index(name) for name in ("time_s", "lap", "x_m", "vx_m_s"))
_LOAD = TELEMETRY.index(f"load_{WHEELS[0]}_N")
_LANDING = 0.1  # [s] in which the greatest load after a jump is looked for


@dataclass(frozen=True, kw_only=True)
class Jump:
    """A flight of JUMP or longer, between the first and the last tick at whose start no wheel touched the ground.

    The text is for people: "for 0.15 s from (3.10, -0.02) m, in lap 1, t = 2.60 s, 4.1 m/s; landed on 61 N".
    """

    time_s: float  # of the first tick
    lasted_s: float
    x_m: float  # of the rear axle, where it began
    y_m: float
    speed_m_s: float  # of the rear axle over the ground, then
    lap: int  # from 1
    landing_load_N: float | None  # noqa: N815 - greatest on all wheels in the next tenth of a second; None: did not land

    def __str__(self) -> str:
        landed = "did not land" if self.landing_load_N is None else f"landed on {self.landing_load_N:.0f} N"
        return (
            f"for {self.lasted_s:.2f} s from ({self.x_m:.2f}, {self.y_m:.2f}) m, in lap {self.lap}, "
            f"t = {self.time_s:.2f} s, {self.speed_m_s:.1f} m/s; {landed}"
        )


def jumps_of(telemetry: FloatArray) -> tuple[Jump, ...]:
    """Return the jumps in telemetry (ticks, len(TELEMETRY)), in order."""
    loads, time = np.nan_to_num(telemetry[:, _LOAD : _LOAD + len(WHEELS)]).sum(axis=1), telemetry[:, _TIME]
    edges = np.flatnonzero(np.diff(np.concatenate(([False], loads == 0.0, [False])).astype(np.int8)))
    found = []
    for first, end in edges.reshape(-1, 2).tolist():
        lasted = float(time[end - 1] - time[first])
        if lasted < JUMP - 1e-9:
            continue
        row, landing = telemetry[first], loads[end:][time[end:] <= time[end - 1] + _LANDING]
        found.append(
            Jump(
                time_s=float(row[_TIME]), lasted_s=lasted, x_m=float(row[_X]), y_m=float(row[_X + 1]),
                speed_m_s=math.hypot(row[_VX], row[_VX + 1]), lap=int(row[_LAP]),
                landing_load_N=float(landing.max()) if len(landing) else None,
            )
        )  # fmt: skip
    return tuple(found)


@dataclass(frozen=True, kw_only=True)
class Stuck:
    """A car whose chassis rests on the ground at the end of a race that ended without progress.

    The text is for people: "at (3.10, -0.02) m, in lap 1: the chassis rests on the ground, the wheels carry 68 % of the
    weight".
    """

    x_m: float  # of the rear axle
    y_m: float
    lap: int  # from 1
    carried: float  # share of the weight that its wheels carry

    def __str__(self) -> str:
        place = f"at ({self.x_m:.2f}, {self.y_m:.2f}) m, in lap {self.lap}"
        return f"{place}: the chassis rests on the ground, the wheels carry {100.0 * self.carried:.0f} % of the weight"


def stuck_of(world: World, telemetry: FloatArray, state: FloatArray, row: int = 0) -> Stuck | None:
    """Return where the chassis of a car rests on ground with heights in the last state; None: it does not."""
    model, car = world.model, world.cars[row]
    ground = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, BODIES)
    if ground < 0 or not len(telemetry):
        return None
    engine, data = Engine(world), mujoco.MjData(model)
    engine.load(state)
    engine.read(0, data)
    mujoco.mj_collision(model, data)
    pairs = data.contact.geom[data.contact.dist <= 0.0]  # tires stand on another geom
    meeting = pairs[(pairs == ground).any(axis=1)].ravel()
    if not (model.body_rootid[model.geom_bodyid[meeting]] == tree_of(model, car.prefix)).any():
        return None
    last = telemetry[-1]
    weight = car.parameters.mass * car.parameters.gravity
    return Stuck(
        x_m=float(last[_X]), y_m=float(last[_X + 1]), lap=int(last[_LAP]),
        carried=float(np.nan_to_num(last[_LOAD : _LOAD + len(WHEELS)]).sum()) / weight,
    )  # fmt: skip
