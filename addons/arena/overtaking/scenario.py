"""A scenario of a suite: an opponent on a lane, the planner behind it, a few seconds. Did it stay safe, and pass?

Both stand at their starts. The opponent is pure_pursuit on a lane of the course; what it commands is multiplied by a
share of its speed, and it sees nobody. A scenario ends with its time, or with the first touch of either car with
anything. The planner has overtaken if its rear axle is ahead along the centreline at the end, without a touch.

Source: Z. Qiao, H. Li, Z. Cao and H. X. Liu, End2Race, arXiv 2509.16894, and its published evaluation: 50 starts on a
lap, three lines of the opponent, four shares of its speed, 8 s. There the opponent is a lattice planner, which avoids
the other car.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import CarParameters, Controller, DriveCommand, FloatArray, LaserScan, Odometry
from fg_mujoco.racing.entries import check_starts
from fg_mujoco.racing.planners import ControllerChoice, make_controller
from fg_mujoco.racing.rules import RULES
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.planner_adapter import PlannersOfEach, adapt
from fg_mujoco.simulation.settings import Start
from fg_mujoco.simulation.termination import END_REASONS

from ..grid_study import GridKey, GridRow, figures_of, why_failed
from ..race_control.race_control import RaceControl
from .duel import DuelSettings, alike_cars, build_planner, closed_track, place_cars
from .slower_opponents import least_curvature, write_line

LANES = {
    "right": (-1.0, -1.0 / 3.0), "middle": (-1.0 / 3.0, 1.0 / 3.0), "left": (1.0 / 3.0, 1.0), "raceline": (-1.0, 1.0)
}  # fmt: skip
"""Lanes of a course, by name: the part of the room between the walls that the opponent's line may use."""

OUTCOMES = ("overtaken", "behind", "touch", "wall", "stopped", "failed")
"""Ends of a scenario. "touch": the cars touched; "wall": either touched one; "stopped": the planner's race ended
otherwise; "failed": it could not be driven."""

_PLANNER, _OPPONENT = 0, 1  # rows of the cars


@dataclass(frozen=True)
class ScenarioKey(GridKey):
    """A scenario of a planner, without the settings that all have in common, and without the versions."""

    planner: str
    planner_sha256: str | None  # of a user's file
    track: str
    lane: str  # of the opponent
    speed: float  # share of the opponent's own speed
    start_m: float  # of the planner's car, along the centreline
    headway_m: float  # of the opponent, from rear axle to rear axle
    offset_m: float  # of the planner's start from the centreline, left positive
    planner_files_sha256: str | None = None  # of the files that the planner reads; None: it reads none


@dataclass(frozen=True, kw_only=True)
class ScenarioFigures:
    """The result of a scenario. None: there is no such figure."""

    outcome: str  # of OUTCOMES
    message: str | None  # why it failed, or why a car's race ended
    time_s: float | None  # until the end
    ahead_m: float | None  # by which the planner's car is ahead along the centreline at the end, negative behind
    to_blame: str | None  # of a touch: planner, opponent, both or no fault
    blame_reason: str | None  # of fault.REASONS


@dataclass(frozen=True)
class ScenarioRow(GridRow):
    """A scenario and its figures: one line of scenarios.jsonl, one row of scenarios.csv."""

    key: ScenarioKey
    figures: ScenarioFigures


@dataclass(frozen=True)
class Scenario:
    """A scenario to be driven. It travels to a worker process."""

    key: ScenarioKey
    planner: ControllerChoice
    settings: DuelSettings
    seconds: float

    def __str__(self) -> str:
        key = self.key
        return f"{key.planner} behind {key.speed:g} of {key.lane} on {key.track} at {key.start_m:.1f} m"

    def drive(self) -> ScenarioRow:
        """Drive it, and return its row. What raises on the way is a scenario that failed."""
        try:
            return ScenarioRow(self.key, drive_scenario(self))
        except Exception as error:
            return self.died(why_failed(error))

    def died(self, how: str) -> ScenarioRow:
        """Return the result of one that failed, or whose worker process ended, with its end in words."""
        return ScenarioRow(self.key, figures_of(ScenarioFigures, outcome="failed", message=how))


class Scaled:
    """A planner whose commanded speeds are multiplied by a share."""

    def __init__(self, planner: Controller, share: float) -> None:
        self._planner, self._share = planner, share

    def reset(self) -> None:
        """Forget everything seen so far."""
        self._planner.reset()

    def __call__(self, scan: LaserScan, odometry: Odometry) -> DriveCommand:
        """Answer the planner's command, slower."""
        command = self._planner(scan, odometry)
        return replace(command, speed=self._share * command.speed)


def drive_scenario(scenario: Scenario) -> ScenarioFigures:
    """Drive a scenario and return its figures.

    Raises:
      ControllerError: the planner cannot be built.
      TrackError: no closed track, or one that cannot be loaded.
      SettingsError: a start off the course or in a wall, or two cars in one place.
    """
    key, settings = scenario.key, scenario.settings
    world = alike_cars(key.track, settings, 2)
    track, car = world.track, world.parameters
    line = lane_line(key.track, car, key.lane)
    ahead_of = start_on(key.track, car, key.lane, key.start_m + key.headway_m)
    starts = [Start(s=key.start_m, offset=key.offset_m), ahead_of]
    check_starts(track, starts, [car, car], ["planner", "opponent"], ())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "lane.csv"
        write_line(path, line)
        alone = make_controller("pure_pursuit", settings.context(world), settings={"line": str(path)})
    engine, opponent = Engine(world, laps=settings.laps), Scaled(alone, key.speed)
    planner = adapt([build_planner(scenario.planner, world, settings)])
    engine.planners = PlannersOfEach([(np.array([_PLANNER]), planner), (np.array([_OPPONENT]), adapt([opponent]))])
    place_cars(engine, starts, settings)
    control = RaceControl(engine, names=("planner", "opponent"), rules=RULES["none"])
    progress, outcome = engine.monitor.timers["progress"], ""
    ticks = round(scenario.seconds / engine.period)
    for _ in range(ticks):
        now = engine.time(0)
        engine.tick()
        control.after_tick()
        if engine.touched_at[_PLANNER, _OPPONENT] > now:
            outcome = "touch"
        elif engine.crashed.any():
            outcome = "wall"
        elif not engine.running[_PLANNER]:
            outcome = "stopped"
        if outcome:
            break
    control.finish()
    ahead = float(progress[_PLANNER] - progress[_OPPONENT])
    touch = control.contacts[0] if control.contacts else None
    failures = engine.planners.failures
    ends = [END_REASONS[reason] for reason in engine.monitor.reasons.tolist()]
    said = "; ".join(f"{name}: {end}" for name, end in zip(("planner", "opponent"), ends, strict=True) if end)
    return ScenarioFigures(
        outcome=outcome or ("overtaken" if ahead > 0.0 else "behind"),
        message=str(failures[_PLANNER]) if _PLANNER in failures else said or None,
        time_s=engine.time(0), ahead_m=ahead, to_blame=touch.at_fault if touch else None,
        blame_reason=touch.reason if touch else None,
    )  # fmt: skip


@lru_cache(maxsize=32)
def lane_line(track: str, car: CarParameters, lane: str) -> FloatArray:
    """Return the line of least curvature in a lane of a course. Shape (n, 2) [m].

    Raises:
      SettingsError: another lane.
      TrackError: no closed track, or one that cannot be loaded.
    """
    if lane not in LANES:
        raise SettingsError(f"lane {lane!r}; accepted: {', '.join(LANES)}")
    return least_curvature(closed_track(track, car), car, LANES[lane])


def start_on(track: str, car: CarParameters, lane: str, s: float) -> Start:
    """Return the start on a lane's line that is nearest to a place along the centreline [m]; errors as `lane_line`."""
    course, line = closed_track(track, car), lane_line(track, car, lane)
    places, offsets = course.project(line)
    apart = np.abs((places - s + 0.5 * course.length) % course.length - 0.5 * course.length)
    nearest = int(apart.argmin())
    return Start(s=float(places[nearest]), offset=float(offsets[nearest]))
