"""Duels: a planner behind a slower car. Does it overtake, does it stay safe, and who is to blame for a touch?

Both stand at their starts. The opponent is of two kinds:

    opponent = ["centreline", "raceline", "reactive", "blocking"]    # drawn: of `slower_cars`, with `seeds`
    ratio = [0.3, 0.9]          # of its speed to the planner's own at the same place, alone; the seed draws it

    opponent = ["right", "middle", "left", "raceline"]               # placed: pure_pursuit on a lane of the course
    speed = [0.5, 0.6, 0.7]     # shares of its own speed
    starts = 50                 # of the planner, at equal distances on a lap, or a list [m]
    headway = 3.0               # [m] of the opponent, from rear axle to rear axle
    offset = 0.0                # [m] of the planner's start from the centreline, left positive

A drawn duel is of `laps` laps [2], the seed draws the start and a headway too, the same for all planners, and an
overtake counts when the planner's car has been half a length ahead along the centreline for 1 s. A placed one is of
`time_limit` seconds [8], and the planner has overtaken if it is ahead at the end. The first touch of the cars ends
either, and so does the end of the planner's race; of a placed one a crash of the opponent, too. Race control says who
is to blame for a touch, see arena.race_control.fault.

Source of the placed ones: Z. Qiao, H. Li, Z. Cao and H. X. Liu, End2Race, arXiv 2509.16894, and its published
evaluation: 50 starts on a lap, three lines of the opponent, four shares of its speed, 8 s. There the opponent is a
lattice planner, which avoids the other car.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from fg_mujoco.course.course import Course
from fg_mujoco.course.track import Track
from fg_mujoco.errors import ControllerError, SettingsError, TrackError, accepted_names
from fg_mujoco.messages import Controller, require_whole, shown
from fg_mujoco.racing.entries import Entry
from fg_mujoco.racing.race import RaceProgress, race_setup
from fg_mujoco.racing.result import RaceResult
from fg_mujoco.racing.setup import OF_A_CAR, Setup
from fg_mujoco.simulation.course_loading import load_track
from fg_mujoco.simulation.settings import Start

from .run import Run, RunRow, why_failed
from .slower_cars import LANES, OPPONENTS, Pace, make_opponent, start_on

AHEAD_FOR = 1.0  # [s]
HEADWAY = (2.0, 10.0)
"""[m] Least and greatest distance by which a drawn opponent starts ahead."""

SAFE = ("overtaken", "behind")
"""Outcomes without a touch. The others: "touch" of the cars; "wall": the planner's car touched one, or in a placed duel
the opponent's; "stopped": the planner's race ended otherwise; "failed": no duel could be driven."""

_NAMES = ("planner", "opponent")
_ENDLESS = 1000  # laps, so that the time ends a placed duel
_BIN = 0.25  # [m] along the centreline, of a pace
_MOST_STARTS = 100_000


@dataclass(frozen=True, kw_only=True)
class Duels:
    """The duels of a group of a suite. With `speed` they are placed, without drawn.

    Raises:
      SettingsError: a value outside what is accepted.
    """

    opponent: Sequence[str] = OPPONENTS
    ratio: Sequence[float] = (0.3, 0.9)  # least and greatest, of the speeds
    speed: Sequence[float] = ()  # shares of the opponent's own speed
    starts: int | Sequence[float] = 1
    headway: Sequence[float] = (3.0,)  # [m]
    offset: Sequence[float] = (0.0,)  # [m]

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if each.name != "starts" or not isinstance(value, int):
                value = (value,) if isinstance(value, (str, int, float)) else tuple(value)
                object.__setattr__(self, each.name, value)
        if isinstance(self.starts, int):
            require_whole("starts", self.starts, 1, _MOST_STARTS, why="or a list of metres")
        known = LANES if self.speed else OPPONENTS
        if not self.opponent:
            raise SettingsError(f"opponent is empty; {accepted_names('', known)}")
        for name in self.opponent:
            if not isinstance(name, str) or name not in known:
                raise SettingsError(f"opponent {shown(name)}; {accepted_names(name, known)}")
        for name, low, high in (
            ("ratio", 0.0, 1.0), ("speed", 0.0, 1.5), ("headway", -100.0, 100.0), ("offset", -10.0, 10.0),
            *([] if isinstance(self.starts, int) else [("starts", -1e5, 1e5)]),
        ):  # fmt: skip
            for value in getattr(self, name):
                number = isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
                if not number or not low <= value <= high or (value == 0.0 and name in ("ratio", "speed")):
                    accepted = f"numbers {'above' if low == 0.0 else 'from'} {low:g} to {high:g}"
                    raise SettingsError(f"{name} has {shown(value)}; accepted: {accepted}")
            if name != "speed" and not getattr(self, name):
                raise SettingsError(f"{name} is empty; accepted: one or more numbers")
        if len(self.ratio) != 2 or self.ratio[0] > self.ratio[1]:
            raise SettingsError(f"ratio is {shown(self.ratio)}; accepted: the least and the greatest")
        unused = [each.name for each in fields(self) if (each.name == "ratio") == bool(self.speed)
                  and each.name not in ("opponent", "speed") and getattr(self, each.name) != each.default]  # fmt: skip
        if unused:
            kind = "duels from given places" if self.speed else "drawn duels, without `speed`"
            raise SettingsError(f"{unused[0]} is {shown(getattr(self, unused[0]))} in {kind}; accepted: without it")
        places = self.starts if isinstance(self.starts, int) else len(self.starts)
        count = places * math.prod(map(len, (self.opponent, self.speed or (1.0,), self.headway, self.offset)))
        if count > _MOST_STARTS:
            raise SettingsError(f"starts and the other lists make {count}; accepted: {_MOST_STARTS} at most")

    def places(self, length: float) -> Iterator[dict[str, Any]]:
        """Yield what tells the duels of a course apart, besides a seed; `length` is that of a lap [m]."""
        starts = self.starts
        where = [length * k / starts for k in range(starts)] if isinstance(starts, int) else list(starts)
        for opponent in self.opponent if not self.speed else ():
            yield {"opponent": opponent}
        for s, lane, speed, headway, offset in product(where, self.opponent, self.speed, self.headway, self.offset):
            yield {
                "opponent": lane, "speed": float(speed), "start_m": round(float(s), 6), "headway_m": float(headway),
                "offset_m": float(offset),
            }  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class Duel(Run):
    """A duel to be driven; its `setup` has the planner alone."""

    duels: Duels

    @property
    def placed(self) -> bool:
        """Whether it is of some seconds, from a place that its suite says."""
        return "speed" in self.place

    @property
    def laps(self) -> int:
        """Laps within which the planner is to overtake."""
        return _ENDLESS if self.placed else self.setup.laps or 2

    @property
    def seconds(self) -> float:
        """Of a placed duel [s]."""
        return self.setup.time_limit or 8.0

    def draw(self, length: float) -> tuple[float, float, float]:
        """Return the start of the planner's car [m], the headway [m] and the share of the speed.

        A drawn duel has them of its seed, course and opponent: the same for all planners.
        """
        place = self.place
        if self.placed:
            return place["start_m"], place["headway_m"], place["speed"]
        rng = np.random.default_rng([place["seed"], *f"{place['course']} {place['opponent']}".encode()])
        low, high = self.duels.ratio
        s, headway, ratio = rng.uniform((0.0, HEADWAY[0], low), (length, HEADWAY[1], high)).tolist()
        return s, headway, ratio

    def drive(self) -> RunRow:
        """See Run."""
        try:
            return self._judge(*self.race())
        except Exception as error:
            return self.failed("failed", why_failed(error), figures={"outcome": "failed"})

    def died(self, how: str) -> RunRow:
        """See Run."""
        return self.failed("worker_died", how, figures={"outcome": "failed"})

    def race(self) -> tuple[RaceResult, _Watch, float, float]:
        """Race until it is decided; return the result, its watch, the share of the speed and the planner's start [m].

        Raises:
          ControllerError: the planner cannot be built, or does not drive two laps alone.
          TrackError: no closed track, or one that cannot be loaded.
          SettingsError: a start off the course or in a wall, or two cars in one place.
        """
        track, first = closed_track(self.setup), self.setup.first
        start, headway, share = self.draw(track.length)
        context = first.context(first.car.parameters, track.map_line)
        with tempfile.TemporaryDirectory() as folder:
            own = None if self.placed else pace(alone(self.setup))
            opponent = make_opponent(self.place["opponent"], track, own, share, context, Path(folder))
            ahead = start_on(track, context.car, self.place["opponent"], start + headway) if self.placed else None
            places = (Start(s=start, offset=self.place.get("offset_m", 0.0)), ahead or Start(s=start + headway))
            entries = (replace(first, name=_NAMES[0], start=places[0]), opponent_entry(first, opponent, places[1]))
            setup = replace(
                self.setup, entries=entries, laps=self.laps + (0 if self.placed else 1),
                time_limit=self.seconds if self.placed else self.setup.time_limit, rules="none",
            )  # fmt: skip
            watch = _Watch(self)
            result = race_setup(setup, watch=watch, each_tick=True)
        if not watch.decided and any(car.end_reason == "interrupted" for car in result.cars):
            raise KeyboardInterrupt
        return result, watch, share, start

    def _judge(self, result: RaceResult, watch: _Watch, share: float, start: float) -> RunRow:
        planner, opponent = result.cars
        touch = result.contacts[0] if result.contacts else None
        crashed = planner.end_reason == "crash" or (self.placed and opponent.end_reason == "crash")
        taken = result.sim_time_s
        if touch is not None:
            outcome = "touch"
        elif crashed:
            outcome = "wall"
        elif planner.end_reason not in ("interrupted", "finished", "time_limit" if self.placed else ""):
            outcome = "stopped"
        elif self.placed:
            outcome = "overtaken" if watch.ahead > 0.0 else "behind"
        else:
            outcome = "overtaken" if watch.led else "behind"
        lost = None
        if outcome == "overtaken" and not self.placed:
            lost = taken - time_alone(self.setup, start, watch.driven)
        usual = ("interrupted", "time_limit")
        said = "; ".join(f"{car.name}: {car.end_reason}" for car in result.cars if car.end_reason not in usual)
        figures = {
            "outcome": outcome, "share": share, "start_s_m": start, "taken_s": taken, "ahead_m": watch.ahead,
            "time_lost_s": lost, "to_blame": touch.at_fault if touch else None,
            "blame_reason": touch.reason if touch else None,
            "closing_speed_m_s": touch.closing_speed_m_s if touch else None,
        }  # fmt: skip
        row = self.row(result, figures=figures)
        why = row.car.message or said or None
        return replace(row, car=replace(row.car, success=outcome == "overtaken", message=why))


class _Watch:
    """Ends a duel, by an interrupt as of Ctrl-C, when it is decided.

    Attributes:
      decided: whether it is.
      driven: progress of the planner's car [m].
      ahead: by how much it is ahead of the opponent along the centreline [m], negative behind.
      led: whether it has been ahead for AHEAD_FOR.
    """

    def __init__(self, duel: Duel) -> None:
        self.decided = self.led = False
        self.driven = self.ahead = 0.0
        self._duel, self._since, self._half = duel, math.nan, 0.5 * duel.setup.first.car.parameters.length
        self._least = math.inf if duel.placed else duel.laps * closed_track(duel.setup).length

    def __call__(self, progress: RaceProgress) -> None:
        self.driven, other = progress.progress_m
        self.ahead = self.driven - other
        if math.isnan(self._since) or self.ahead < self._half:
            self._since = progress.time if self.ahead >= self._half else math.nan
        self.led = not self._duel.placed and progress.time - self._since >= AHEAD_FOR - 1e-9
        over = not progress.running[0] or (self._duel.placed and not progress.running[1])
        self.decided = progress.last_touch_s > 0.0 or self.led or over or self.driven >= self._least
        if self.decided:
            raise KeyboardInterrupt


def opponent_entry(first: Entry, opponent: Controller, start: Start | None) -> Entry:
    """Return the entry of an opponent in a car as that of the first, which senses without errors."""
    alike = {name: getattr(first, name) for name in (*OF_A_CAR, "max_speed", "planner_mu")}
    return Entry(**alike, controller=opponent, name=_NAMES[1], start=start, knows="opponents")


@lru_cache(maxsize=64)
def closed_track(setup: Setup) -> Track:
    """Return the track of a setup, loaded for its first car.

    Raises:
      TrackError: no closed track, or one that cannot be loaded.
    """
    return require_circuit(load_track(setup.track, car=setup.first.car.parameters))


def require_circuit(course: Course) -> Track:
    """Return a course that is a closed track.

    Raises:
      TrackError: it is none.
    """
    if not (isinstance(course, Track) and course.closed):
        raise TrackError(f"track {course.name!r} is no circuit; accepted: a closed track")
    return course


def alone(setup: Setup) -> Setup:
    """Return the setup of the first car alone in two laps, from a standing start at the line."""
    first = replace(setup.first, start=None, seed=0)
    return replace(setup, entries=(first,), laps=2, time_limit=None, grid="staggered", rules="none", obstacle_seed=0)


@lru_cache(maxsize=64)
def pace(setup: Setup) -> Pace:
    """Return the pace of a planner in the second of two laps.

    Raises:
      ControllerError: it does not drive them.
    """
    result = race_setup(setup)
    car, length = result.car, closed_track(setup).length
    if car.end_reason == "interrupted":
        raise KeyboardInterrupt
    if not car.finished:
        said = f"{car.controller} does not drive two laps of {result.world.track.name} alone: {car.end_reason}"
        raise ControllerError(said)
    progress, speed = car.column("progress_m"), np.maximum(car.column("speed_m_s"), 0.0)
    later = progress > 0.9 * length  # what is driven twice counts as a mean
    count = round(length / _BIN)
    places = (progress[later] % length / length * count).astype(int).clip(0, count - 1)
    sums = np.stack([np.bincount(places, values, count) for values in (speed[later], np.ones(later.sum()))])
    seen = np.flatnonzero(sums[1])
    return Pace((seen + 0.5) * length / count, sums[0, seen] / sums[1, seen], length)


def time_alone(setup: Setup, start: float, progress: float) -> float:
    """Return the planner's time alone from the same start for the same way [s]; inf: it does not get there."""
    there: list[float] = []

    def watch(told: RaceProgress) -> None:
        if there:  # a tick later, so that the telemetry has both sides of the place
            raise KeyboardInterrupt
        if told.progress_m[0] >= progress:
            there.append(told.time)

    first = replace(setup.first, start=Start(s=start))
    longer = replace(alone(setup), entries=(first,), laps=(setup.laps or 2) + 1)
    car = race_setup(longer, watch=watch, each_tick=True).car
    driven, times = car.column("progress_m"), car.column("time_s")
    at = int(np.searchsorted(driven, progress))
    if at == len(driven):
        return there[0] if there else math.inf  # at the end of its last tick, or never
    share = (progress - driven[at - 1]) / max(driven[at] - driven[at - 1], 1e-9) if at else 0.0
    return float(times[at - 1] + share * (times[at] - times[at - 1])) if at else 0.0
