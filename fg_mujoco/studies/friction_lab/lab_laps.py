"""Laps for the lab: those of `race`, on a floor with patches, at a timestep of the lab's choice.

    world = LabWorld("oval", timestep=0.001, patches=(Patch(x=6.0, y=0.0, length=2.0, width=1.0, mu=0.5),))
    laps = drive_laps(world, laps=2, planner_mu=0.9)
    print(laps.lap_times_s, laps.max_slide_m_s)

MuJoCo's contacts are wrong at the default timestep where they slide (Tires.sliding_timestep); our own tires are not.
With neither patches nor a timestep, a race here is `race`'s, bit for bit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np

from ...course.course import Course
from ...messages import FloatArray
from ...racing.planner_loading import make_controller
from ...racing.result import History, trajectory_sha256
from ...simulation.cars import CAR_PREFIX
from ...simulation.engine import Engine
from ...simulation.planner_adapter import adapt
from ...simulation.planner_adapter import start as start_planner
from ...simulation.settings import DriveSettings, Start
from ...simulation.simulation import Simulation
from ...simulation.telemetry import TELEMETRY, statistics_figures
from ...simulation.termination import END_REASONS
from ...simulation.world import World
from ...vehicle.car import Car
from ...vehicle.friction_patches import Patch
from ...vehicle.tires import Tires

MAX_SPEED = 8.0  # [m/s] as `race` has it


class LabWorld(World):
    """A World with patches on its floor, or with another timestep.

    Args:
      track: as of a World.
      mu: as of a World.
      timestep: of the physics [s]; None: as in the car's MJCF.
      patches: of the floor.
      tires: as of a World.

    Raises:
      TrackError, SettingsError: as a World.
    """

    def __init__(
        self,
        track: Course | str,
        *,
        mu: float | None = None,
        timestep: float | None = None,
        patches: Sequence[Patch] = (),
        tires: Tires | str | None = None,
    ) -> None:
        super().__init__(track, mu=mu, patches=patches, tires=tires)
        if timestep is None:
            return
        spec = mujoco.MjSpec.from_string(self.xml)
        spec.option.timestep = timestep
        self.xml = spec.to_xml()
        self.model = mujoco.MjModel.from_xml_string(self.xml)
        self.car = Car(self.model, CAR_PREFIX)


class LabEngine(Engine):
    """An engine that says which friction each tire has on the floor under it.

    Attributes:
      floor_mu: friction coefficient under each tire in the steps of the last tick, (substeps, 4); without patches
        (1, 4).
    """

    def __init__(self, world: World, **settings: Any) -> None:
        super().__init__(world, **(settings | {"own_model": True}))
        self.floor_mu = self.floor_friction()[:1]

    def drive(self, **settings: Any) -> None:
        """Hold the commands for a tick."""
        super().drive(**settings)
        self.floor_mu = self.floor_friction()


class LabSimulation(Simulation):
    """A Simulation on a LabEngine."""

    def __init__(self, world: World) -> None:
        super().__init__(world, engine=LabEngine(world))

    @property
    def floor_mu(self) -> FloatArray:
        """See LabEngine."""
        engine = self.engine
        assert isinstance(engine, LabEngine)
        under: FloatArray = engine.floor_mu
        return under


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
    world: LabWorld,
    controller: str = "gap_finder",
    *,
    laps: int,
    planner_mu: float | None = None,
    planner_settings: Mapping[str, Any] | None = None,
    start: Start | None = None,
) -> LabLaps:
    """Drive laps as `race` does, and return how they went.

    Args:
      world: a LabWorld that no other simulation uses.
      controller: a bundled name.
      laps: to be driven.
      planner_mu: friction coefficient that the planner assumes; None: that of the world's tires, without patches.
      planner_settings: settings of the controller that differ from its own.
      start: where the car stands at first; None: on the line.

    Raises:
      ControllerError: a controller that cannot be built, or fails.
    """
    assumed = world.vehicle.reliable_mu(world.tires, world.car.mu) if planner_mu is None else planner_mu
    settings = DriveSettings(vehicle=world.vehicle, tires=world.tires, planner_mu=assumed, max_speed=MAX_SPEED)
    context = settings.context(world.car.parameters, world.track.map_line)
    planner = make_controller(controller, context, settings=planner_settings or {})
    start_planner(planner)
    engine = LabEngine(world, laps=laps)
    engine.planners = adapt([planner], raises=True)
    engine.place([start or Start()])
    history, floor_mu = History(engine), []
    while engine.running[0]:
        engine.sense()
        engine.decide()
        engine.drive()
        history.append()
        floor_mu.append(engine.floor_mu.min(axis=0))
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
