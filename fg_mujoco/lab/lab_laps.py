"""Laps for the lab: those of `race`, in a world whose model the lab may change.

    world = World("oval", patches=(Patch(x=6.0, y=0.0, length=2.0, width=1.0, mu=0.5),))
    world.model.opt.timestep = 0.001
    laps = drive_laps(world, laps=2, planner_mu=0.9)
    print(laps.lap_times_s, laps.max_slide_m_s)

MuJoCo's contacts are wrong at the default timestep where they slide (Tires.sliding_timestep); our own tires are not.
In a world that nobody changed, a race here is `race`'s, bit for bit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ..messages import FloatArray
from ..racing.planners import make_controller
from ..racing.result import History, trajectory_sha256
from ..simulation.engine import Engine
from ..simulation.planner_adapter import adapt
from ..simulation.planner_adapter import start as start_planner
from ..simulation.settings import DriveSettings, Start
from ..simulation.telemetry import TELEMETRY, statistics_figures
from ..simulation.termination import END_REASONS
from ..simulation.world import World

MAX_SPEED = 8.0  # [m/s] as `race` has it


@dataclass(frozen=True, kw_only=True, eq=False)
class LabLaps:
    """How some laps went; fields as in RaceResult."""

    end_reason: str
    lap_times_s: tuple[float, ...]
    max_slide_m_s: float
    max_lateral_slide_m_s: float
    slide_time_fraction: float
    mean_speed_m_s: float
    max_speed_m_s: float
    trajectory_sha256: str
    telemetry: FloatArray = field(repr=False)
    states: FloatArray = field(repr=False)
    ctrl: FloatArray = field(repr=False)
    floor_mu: FloatArray = field(repr=False)  # (ticks, 4) least that each tire had in a tick [-]

    def column(self, name: str) -> FloatArray:
        """Return one column of the telemetry by its name in TELEMETRY. Shape (ticks,)."""
        return self.telemetry[:, TELEMETRY.index(name)]

    @property
    def crashed(self) -> bool:
        """Whether the chassis touched anything."""
        return self.end_reason == "crash"

    @property
    def best_flying_lap_s(self) -> float:
        """Best lap but the first, which is from a standing start; NaN where there is none [s]."""
        return min(self.lap_times_s[1:], default=math.nan)


def drive_laps(
    world: World, *, laps: int, planner_mu: float | None = None, start: Start | None = None
) -> LabLaps:
    """Drive laps with the gap finder as `race` does, and return how they went.

    Args:
      world: that no other simulation uses.
      laps: to be driven.
      planner_mu: friction coefficient that the planner assumes; None: that of the world's tires, without patches.
      start: where the car stands at first; None: on the line.

    Raises:
      ControllerError: the planner fails.
    """
    assumed = world.vehicle.reliable_mu(world.tires, world.car.mu) if planner_mu is None else planner_mu
    settings = DriveSettings(vehicle=world.vehicle, tires=world.tires, planner_mu=assumed, max_speed=MAX_SPEED)
    context = settings.context(world.car.parameters, world.track.map_line)
    planner = make_controller("gap_finder", context)
    start_planner(planner)
    engine = Engine(world, laps=laps, own_model=True)
    engine.planners = adapt([planner], raises=True)
    engine.place([start or Start()])
    history, floor_mu = History(engine), []
    while engine.running[0]:
        engine.sense()
        engine.decide()
        engine.drive()
        history.append()
        floor_mu.append(engine.floor_friction().min(axis=0))
        engine.judge()
    arrays, monitor = history.arrays(), engine.monitor
    return LabLaps(
        end_reason=END_REASONS[monitor.reasons[0]],
        lap_times_s=tuple(monitor.lap_times[0, : int(monitor.timers["laps_completed"][0])].tolist()),
        **statistics_figures(engine.statistics[0]),
        trajectory_sha256=trajectory_sha256(arrays["states"], arrays["ctrl"]),
        floor_mu=np.array(floor_mu).reshape(-1, 4),
        **arrays,
    )
