"""A duel: a planner starts behind a slower opponent, and has two laps to overtake it without a touch.

Both stand on the centreline at a place that the seed draws, the opponent ahead by a distance and slower by a ratio that
it draws, too. An overtake counts when the planner's car has been half a length ahead along the centreline for 1 s. The
first touch of the cars ends a duel, and so does whatever ends the race of the planner's car.

Who is to blame for a touch is decided by race control, see arena.race_control.fault.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from fg_mujoco.course.track import Track
from fg_mujoco.errors import ControllerError, PlannerError, SettingsError, TrackError
from fg_mujoco.lidar.effects import LidarEffects
from fg_mujoco.messages import CarParameters, PlannerContext
from fg_mujoco.racing.planners import ControllerChoice, make_controller
from fg_mujoco.racing.resolved import Resolved
from fg_mujoco.racing.rules import RULES
from fg_mujoco.racing.setup import Setup
from fg_mujoco.simulation.course_loading import load_track
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.planner_adapter import Cars, Planners, PlannersOfEach, Reasons, adapt
from fg_mujoco.simulation.settings import Start
from fg_mujoco.simulation.termination import END_REASONS
from fg_mujoco.simulation.world import World

from ..grid_study import GridKey, GridRow, figures_of, why_failed
from ..race_control.race_control import RaceControl
from .slower_opponents import Blocking, Pace, make_opponent

AHEAD_FOR = 1.0  # [s]
HEADWAY = (2.0, 10.0)
"""[m] Least and greatest distance by which the opponent starts ahead, from rear axle to rear axle."""

_PLANNER, _OPPONENT = 0, 1  # rows of the cars
_BIN = 0.25  # [m] along the centreline, of a pace
OUTCOMES = ("overtaken", "behind", "touch", "wall", "stopped", "failed")
"""Ends of a duel. "behind": after two laps; "wall": the planner's car touched one; "stopped": its race ended
otherwise; "failed": no duel could be driven."""


@dataclass(frozen=True, kw_only=True)
class DuelSettings:
    """The settings that all duels of a study have in common.

    Raises:
      SettingsError: a value outside what is accepted.
    """

    base: Setup = field(default_factory=Setup)  # of one car; planner, track and starts are the duel's
    slowest: float = 0.3  # least ratio of the speeds
    fastest: float = 0.9  # greatest

    def __post_init__(self) -> None:
        if not 0.0 < self.slowest <= self.fastest <= 1.0:
            said = f"{self.slowest:g}:{self.fastest:g}"
            raise SettingsError(f"speed_ratio is {said}; accepted: FIRST:LAST, above 0 and at most 1")

    @property
    def laps(self) -> int:
        """Laps within which the planner is to overtake."""
        return 2 if self.base.laps is None else self.base.laps

    @property
    def car(self) -> CarParameters:
        """Parameters of both cars."""
        return self.base.first.car.parameters

    def context(self, world: World) -> PlannerContext:
        """Return what the planner of the first car of a world is told."""
        return self.base.drive_settings.context(world.parameters, world.track.map_line)

    def manifest(self) -> dict[str, Any]:
        """Return them as they can stand in JSON."""
        own = {name: getattr(self, name) for name in ("laps", "slowest", "fastest")}
        return {"max_speed": self.base.first.max_speed} | self.base.drive_settings.described() | own


@dataclass(frozen=True)
class DuelKey(GridKey):
    """The settings of one duel, without those that all have in common, and without the versions."""

    planner: str
    planner_sha256: str | None  # of a user's file
    track: str
    opponent: str
    seed: int
    planner_files_sha256: str | None = None  # of the files that the planner reads; None: it reads none


@dataclass(frozen=True, kw_only=True)
class DuelFigures:
    """The result of a duel. None: there is no such figure."""

    outcome: str  # of OUTCOMES
    message: str | None  # why it failed, or ended
    ratio: float | None  # of the opponent's speed to the planner's own
    headway_m: float | None  # at the start
    start_s_m: float | None  # of the planner's car
    time_s: float | None  # until the end; of an overtake, until its second was over
    progress_m: float | None  # of the planner's car until then
    time_lost_s: float | None  # of an overtake: against the planner alone from the same start to the same place
    to_blame: str | None  # of a touch: planner, opponent, both or no fault
    blame_reason: str | None  # of fault.REASONS
    touch_ahead_m: float | None  # at the touch: how far the planner's car was ahead along the centreline
    closing_speed_m_s: float | None  # of a touch: how fast the cars approached
    opponent_end: str | None  # why the race of the opponent ended, where it did
    decision_median_s: float | None  # of the planner, wall time
    decision_longest_s: float | None


@dataclass(frozen=True)
class DuelRow(GridRow):
    """A duel and its figures: one line of duels.jsonl, one row of duels.csv."""

    key: DuelKey
    figures: DuelFigures


@dataclass(frozen=True)
class Duel:
    """A duel to be driven. It travels to a worker process."""

    key: DuelKey
    planner: ControllerChoice
    settings: DuelSettings

    def __str__(self) -> str:
        key = self.key
        return f"{key.planner} against {key.opponent} on {key.track}, seed {key.seed}"

    def drive(self) -> DuelRow:
        """Drive it, and return its row. What raises on the way is a duel that failed."""
        try:
            return DuelRow(self.key, drive_duel(self))
        except Exception as error:
            return self.died(why_failed(error))

    def died(self, how: str) -> DuelRow:
        """Return the result of a duel that failed, or whose worker process ended, with its end in words."""
        return DuelRow(self.key, figures_of(DuelFigures, outcome="failed", message=how))

    def draw(self, length: float) -> tuple[float, float, float]:
        """Return the start of the planner's car [m], the headway [m] and the ratio of speeds, as the seed draws them.

        They are the same for all planners.
        """
        key = self.key
        rng = np.random.default_rng([key.seed, *f"{key.track} {key.opponent}".encode()])
        s, headway, ratio = rng.uniform(
            (0.0, HEADWAY[0], self.settings.slowest), (length, HEADWAY[1], self.settings.fastest)
        ).tolist()
        return s, headway, ratio


class Timed:
    """Planners whose decisions are timed.

    Attributes:
      times: of each decision [s].
      failures: see Planners.
    """

    def __init__(self, planners: Planners) -> None:
        self._planners = planners
        self.failures: dict[int, PlannerError] = planners.failures
        self.times: list[float] = []

    def __call__(self, cars: Cars) -> Reasons | None:
        """See Planners."""
        begun = time.perf_counter()
        reasons = self._planners(cars)
        self.times.append(time.perf_counter() - begun)
        return reasons


def drive_duel(duel: Duel, watch: Any = None) -> DuelFigures:
    """Drive a duel and return its figures; `watch`, if given, is called with the engine before each tick.

    Raises:
      ControllerError: the planner cannot be built.
      TrackError: no closed track, or one that cannot be loaded.
    """
    settings, track = duel.settings, closed_track(duel.key.track, duel.settings.car)
    own_pace = pace(duel.key.track, duel.planner, settings)
    start, headway, ratio = duel.draw(track.length)
    world = alike_cars(duel.key.track, settings, 2)
    with tempfile.TemporaryDirectory() as folder:
        opponent = make_opponent(duel.key.opponent, track, own_pace, ratio, settings.context(world), Path(folder))
    engine = Engine(world, laps=settings.laps + 1)
    timed = Timed(adapt([build_planner(duel.planner, world, settings)]))
    engine.planners = PlannersOfEach([(np.array([_PLANNER]), timed), (np.array([_OPPONENT]), adapt([opponent]))])
    place_cars(engine, [Start(s=start), Start(s=start + headway)], settings)
    half = 0.5 * world.parameters.length
    timers, since = engine.monitor.timers, math.nan
    outcome = ""
    control = RaceControl(engine, names=("planner", "opponent"), rules=RULES["none"])
    progress = timers["progress"]  # of both, from the planner's start
    ahead = float(progress[_PLANNER] - progress[_OPPONENT])
    while not outcome:
        now = engine.time(0)
        if isinstance(opponent, Blocking):
            opponent.follower = (-ahead, float(timers["offset"][_PLANNER]))
        if watch is not None:
            watch(engine)
        engine.tick()
        control.after_tick()
        touched = engine.touched_at[_PLANNER, _OPPONENT] > now
        ahead = float(progress[_PLANNER] - progress[_OPPONENT])
        if math.isnan(since) or ahead < half:
            since = engine.time(0) if ahead >= half else math.nan
        if touched:
            outcome = "touch"
        elif not engine.running[_PLANNER]:
            outcome = "wall" if engine.crashed[_PLANNER] else "stopped"
        elif engine.time(0) - since >= AHEAD_FOR:
            outcome = "overtaken"
        elif progress[_PLANNER] >= settings.laps * track.length:
            outcome = "behind"
    control.finish()
    touch = control.contacts[0] if control.contacts else None
    taken, driven = engine.time(0), float(progress[_PLANNER])
    lost = taken - time_alone(duel, start, driven) if outcome == "overtaken" else None
    ends = [END_REASONS[reason] or None for reason in engine.monitor.reasons.tolist()]
    failure = timed.failures.get(0)
    return DuelFigures(
        outcome=outcome, message=str(failure) if failure else ends[_PLANNER], ratio=ratio, headway_m=headway,
        start_s_m=start, time_s=taken, progress_m=driven, time_lost_s=lost,
        to_blame=touch.at_fault if touch else None, blame_reason=touch.reason if touch else None,
        touch_ahead_m=ahead if touch else None, closing_speed_m_s=touch.closing_speed_m_s if touch else None,
        opponent_end=ends[_OPPONENT],
        decision_median_s=float(np.median(timed.times)), decision_longest_s=float(np.max(timed.times)),
    )  # fmt: skip


def closed_track(name: str, car: CarParameters) -> Track:
    """Return a track, loaded for a car.

    Raises:
      TrackError: no closed track, or one that cannot be loaded.
    """
    track = load_track(name, car=car)
    if not (isinstance(track, Track) and track.closed):
        raise TrackError(f"track {name!r} is no circuit; accepted: a closed track")
    return track


@lru_cache(maxsize=4)
def alike_cars(track: str, settings: DuelSettings, cars: int) -> World:
    """Return a world of so many alike cars."""
    course = closed_track(track, settings.car)
    return Resolved.of(settings.base.replace(track=course, laps=None, entries=[settings.base.first] * cars)).world


def place_cars(engine: Engine, starts: Sequence[Start], settings: DuelSettings) -> None:
    """Place the cars of a world, of which the first senses as the settings say."""
    first, others = settings.base.first, len(starts) - 1
    engine.place(
        starts, seeds=[0] * len(starts), effects=[first.effects, *[LidarEffects()] * others],
        odometry_drifts=[first.odometry_drift, *[0.0] * others], sensors=[first.sensed, *[()] * others],
    )  # fmt: skip


def build_planner(choice: ControllerChoice, world: World, settings: DuelSettings) -> Any:
    """Return the planner of the first car of a world.

    Raises:
      ControllerError: it cannot be built.
    """
    return make_controller(choice.source, settings.context(world), settings=dict(choice.settings))


@lru_cache(maxsize=64)
def pace(track: str, planner: ControllerChoice, settings: DuelSettings) -> Pace:
    """Return the pace of a planner in its second lap alone, from a standing start at the line.

    Raises:
      ControllerError: it does not drive two laps.
    """
    world = alike_cars(track, settings, 1)
    engine = Engine(world, laps=2)
    engine.planners = adapt([build_planner(planner, world, settings)])
    place_cars(engine, [Start()], settings)
    length = world.track.length
    sums = np.zeros((2, round(length / _BIN)))
    while engine.running[0]:
        engine.tick()
        progress = float(engine.monitor.timers["progress"][0])
        if progress > 0.9 * length:  # what is driven twice counts as a mean
            place = int(progress % length / length * sums.shape[1])
            sums[:, place] += max(engine.speed(0), 0.0), 1.0
    if END_REASONS[engine.monitor.reasons[0]] != "finished":
        reason = END_REASONS[engine.monitor.reasons[0]]
        raise ControllerError(f"{planner.label} does not drive two laps of {track} alone: {reason}")
    seen = np.flatnonzero(sums[1])
    return Pace((seen + 0.5) * length / sums.shape[1], sums[0, seen] / sums[1, seen], length)


def time_alone(duel: Duel, start: float, progress: float) -> float:
    """Return the planner's time alone from the same start for the same way [s]; inf: it does not get there."""
    world = alike_cars(duel.key.track, duel.settings, 1)
    engine = Engine(world, laps=duel.settings.laps + 1)
    engine.planners = adapt([build_planner(duel.planner, world, duel.settings)])
    place_cars(engine, [Start(s=start)], duel.settings)
    before = 0.0
    while engine.running[0]:
        engine.tick()
        after = float(engine.monitor.timers["progress"][0])
        if after >= progress:
            return engine.time(0) - engine.period * (after - progress) / max(after - before, 1e-9)
        before = after
    return math.inf
