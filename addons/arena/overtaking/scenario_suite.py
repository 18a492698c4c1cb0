"""A suite of scenarios that a file defines, driven for any planner, and how often each was safe and passed.

    study = drive_suite("examples/scenarios/overtaking.toml", "overtaker", out="runs/suite")
    print(study.markdown())

The file has the seconds of a scenario and groups of them, in each of which every value is combined with every other:

    seconds = 8.0

    [[scenarios]]
    track = ["hairpins", "fast"]
    starts = 50                   # at equal distances on a lap, or a list [m]
    lane = ["right", "middle", "left"]
    speed = [0.5, 0.6, 0.7, 0.8]  # share of the opponent's own
    headway = 3.0                 # [m]
    offset = 0.0                  # [m] of the planner's start from the centreline

The folder has scenarios.csv, a row a scenario, and table.csv and table.md, in which they are summed up.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from fg_mujoco.course.documents import read_toml
from fg_mujoco.errors import SettingsError, accepted_names
from fg_mujoco.messages import CarParameters, require_whole, shown
from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.racing.entries import BOTH
from fg_mujoco.racing.planners import ControllerChoice
from fg_mujoco.racing.setup import Setup
from fg_mujoco.racing.trust import check_planner, files_sha256
from fg_mujoco.rollouts.rollout_result import wilson

from ..grid_study import GridCell, GridFolder, Study, StudyProgress, as_axis, drive_grid
from ..intervals import ALL
from .duel import DuelSettings, closed_track
from .overtaking import USABLE
from .scenario import LANES, Scenario, ScenarioKey, ScenarioRow

_SAFE = ("overtaken", "behind")
_LEAST_SECONDS, _MOST_SECONDS = 0.1, 600.0
_MOST_SCENARIOS = 100_000
_ENDLESS = 1000  # laps, so that the time ends a scenario


@dataclass(frozen=True, kw_only=True)
class ScenarioGroup:
    """Scenarios of which every value is combined with every other.

    Raises:
      SettingsError: a value outside what is accepted.
    """

    track: Sequence[str]
    starts: int | Sequence[float]  # how many at equal distances on a lap, or where [m]
    lane: Sequence[str] = ("raceline",)  # of the opponent
    speed: Sequence[float] = (0.5,)  # shares of the opponent's own
    headway: Sequence[float] = (3.0,)  # [m] of the opponent
    offset: Sequence[float] = (0.0,)  # [m] of the planner's start from the centreline, left positive

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (field.name == "starts" and isinstance(value, int)):
                object.__setattr__(self, field.name, tuple(as_axis(value)))
        if isinstance(self.starts, int):
            require_whole("starts", self.starts, 1, _MOST_SCENARIOS, why="or a list of metres")
        for name in ("track", "lane"):
            if not getattr(self, name):
                raise SettingsError(f"{name} is empty; accepted: one or more names")
        for lane in self.lane:
            if not isinstance(lane, str) or lane not in LANES:
                raise SettingsError(f"lane {shown(lane)}; {accepted_names(lane, LANES)}")
        self._require("speed", lambda value: 0.0 < value <= 1.5, "numbers above 0 and at most 1.5")
        self._require("headway", lambda value: -100.0 <= value <= 100.0, "numbers from -100 to 100 [m]")
        self._require("offset", lambda value: -10.0 <= value <= 10.0, "numbers from -10 to 10 [m]")
        starts: Any = range(self.starts) if isinstance(self.starts, int) else self.starts
        if not isinstance(self.starts, int):
            self._require("starts", lambda value: abs(value) <= 1e5, "a whole number from 1, or a list of metres")
        count = math.prod(map(len, (self.track, starts, self.lane, self.speed, self.headway, self.offset)))
        if count > _MOST_SCENARIOS:
            raise SettingsError(f"starts and the other lists make {count}; accepted: {_MOST_SCENARIOS} at most")

    def _require(self, name: str, holds: Callable[[float], bool], accepted: str) -> None:
        values = getattr(self, name)
        for value in values:
            if not (_is_number(value) and holds(value)):
                raise SettingsError(f"{name} has {shown(value)}; accepted: {accepted}")
        if not values:
            raise SettingsError(f"{name} is empty; accepted: {accepted}")

    def keys(self, planner: str, sha256: str | None, files: str | None, car: CarParameters) -> Iterator[ScenarioKey]:
        """Yield the keys of a planner's scenarios.

        Raises:
          TrackError: a course that is no closed track, or cannot be loaded.
        """
        for track in self.track:
            length = closed_track(track, car).length
            starts = self.starts
            places = [length * k / starts for k in range(starts)] if isinstance(starts, int) else list(starts)
            for s, lane, speed, headway, offset in product(places, self.lane, self.speed, self.headway, self.offset):
                yield ScenarioKey(
                    planner, sha256, track, lane, float(speed), round(float(s), 6), float(headway), float(offset), files
                )


@dataclass(frozen=True, kw_only=True)
class Suite:
    """A suite as its file has it."""

    seconds: float  # of a scenario
    scenarios: tuple[ScenarioGroup, ...]

    @classmethod
    def read(cls, path: str | Path, data: str | Path | None = None) -> Suite:
        """Return the suite of a TOML file.

        Args:
          path: of the file.
          data: folder that tracks which are paths begin in; None: the present one.

        Raises:
          SettingsError: it cannot be read, has an unknown key, or a value outside what is accepted.
        """
        content = read_toml(path)
        try:
            return cls._of(content.values, data)
        except SettingsError as error:
            raise SettingsError(content.located(str(error))) from error

    @classmethod
    def _of(cls, values: Mapping[str, Any], data: str | Path | None) -> Suite:
        _require_known(values, [field.name for field in fields(cls)])
        seconds, groups = values.get("seconds", 8.0), values.get("scenarios")
        if not (_is_number(seconds) and _LEAST_SECONDS <= seconds <= _MOST_SECONDS):
            raise SettingsError(f"seconds is {shown(seconds)}; accepted: {_LEAST_SECONDS:g} to {_MOST_SECONDS:g}")
        if not isinstance(groups, list) or not groups or not all(isinstance(group, Mapping) for group in groups):
            raise SettingsError("scenarios is missing, or is no table; accepted: one or more tables [[scenarios]]")
        return cls(seconds=float(seconds), scenarios=tuple(_group(group, data) for group in groups))


def _group(values: Mapping[str, Any], data: str | Path | None) -> ScenarioGroup:
    _require_known(values, [field.name for field in fields(ScenarioGroup)])
    for name in ("track", "starts"):
        if name not in values:
            raise SettingsError(f"scenarios lacks {name}; accepted: a table with track and starts")
    tracks = as_axis(values["track"])
    if not all(isinstance(track, str) for track in tracks):
        raise SettingsError(f"track is {shown(values['track'])}; accepted: one or more names or paths")
    at = [str(Path(data, track)) if data is not None and Path(track).suffix else track for track in tracks]
    return ScenarioGroup(**{**values, "track": at})


def _require_known(values: Mapping[str, Any], known: Sequence[str]) -> None:
    for name in values:
        if name not in known:
            raise SettingsError(f"{name} is no key here; {accepted_names(name, known)}")


@dataclass(frozen=True, kw_only=True)
class ScenarioCell(GridCell):
    """How a planner fared in some scenarios."""

    planner: str
    track: str  # or ALL
    speed: str  # of the opponent, or ALL
    scenarios: int
    safe: int  # neither car touched anything
    safe_low: float  # share, lower end of its interval at 95 %
    safe_high: float
    overtaken: int
    overtaken_low: float
    overtaken_high: float
    touches: int  # of the two cars
    to_blame: int  # touches that the planner is at fault for, alone or with the opponent
    walls: int
    others: int  # that ended otherwise, or failed


def make_cells(rows: Sequence[ScenarioRow]) -> tuple[ScenarioCell, ...]:
    """Return the cells of some rows: of each planner all, each share of the speed, and each track."""
    cells = []
    for planner in dict.fromkeys(row.key.planner for row in rows):
        own = [row for row in rows if row.key.planner == planner]
        cells.append(_cell(planner, ALL, ALL, own))
        for speed in sorted({row.key.speed for row in own}):
            cells.append(_cell(planner, ALL, f"{speed:g}", [row for row in own if row.key.speed == speed]))
        for track in dict.fromkeys(row.key.track for row in own):
            cells.append(_cell(planner, track, ALL, [row for row in own if row.key.track == track]))
    return tuple(cells)


def _cell(planner: str, track: str, speed: str, rows: Sequence[ScenarioRow]) -> ScenarioCell:
    outcomes = [row.figures.outcome for row in rows]
    count, safe, overtaken = len(rows), sum(outcomes.count(each) for each in _SAFE), outcomes.count("overtaken")
    (safe_low, safe_high), (low, high) = wilson(safe, count), wilson(overtaken, count)
    touches, walls = outcomes.count("touch"), outcomes.count("wall")
    return ScenarioCell(
        planner=planner, track=track, speed=speed, scenarios=count, safe=safe, safe_low=safe_low, safe_high=safe_high,
        overtaken=overtaken, overtaken_low=low, overtaken_high=high, touches=touches,
        to_blame=sum(row.figures.to_blame in ("planner", BOTH) for row in rows), walls=walls,
        others=count - safe - touches - walls,
    )  # fmt: skip


class SuiteResult(Study[ScenarioRow, ScenarioCell]):
    """The results of all scenarios of a suite."""

    noun = "scenarios"
    make_cells = staticmethod(make_cells)

    def _summed_up(self) -> str:
        return f"{sum(row.figures.outcome in _SAFE for row in self.rows)} safe"

    def _table(self, *, chosen: bool) -> Table:
        return Table(
            header=(
                "planner", "track", "opponent's speed", "scenarios", "safe", "95 % interval", "overtaken",
                "95 % interval", "touches", "to blame for", "walls", "otherwise ended",
            ),
            rows=[
                (
                    cell.planner, cell.track, cell.speed, cell.scenarios, _share(cell.safe, cell.scenarios),
                    _interval(cell.safe_low, cell.safe_high), _share(cell.overtaken, cell.scenarios),
                    _interval(cell.overtaken_low, cell.overtaken_high), cell.touches, cell.to_blame, cell.walls,
                    cell.others,
                )
                for cell in self.cells
            ],
            left=("planner", "track"),
            legend=(
                "A scenario is safe where neither car touches anything within its time. Intervals are Wilson's at "
                "95 %. The opponent's speed is a share of what it would drive alone."
            ),
        )  # fmt: skip


def _one_in(keys: Sequence[ScenarioKey], every: int) -> list[ScenarioKey]:
    """Return one in so many keys, in their order, drawn by lot with a fixed seed: axes have a rhythm."""
    if every == 1:
        return list(keys)
    drawn = np.random.default_rng(0).permutation(len(keys))[: math.ceil(len(keys) / every)]
    return [keys[i] for i in sorted(drawn.tolist())]


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _share(part: int, count: int) -> str:
    return f"{100.0 * part / count:.1f} %"


def _interval(low: float, high: float) -> str:
    return f"{100.0 * low:.1f} to {100.0 * high:.1f}"


def drive_suite(
    suite: str | Path | Suite,
    controller: str | Sequence[str] = "overtaker",
    *,
    data: str | Path | None = None,
    every: int = 1,
    out: str | Path,
    workers: int | None = None,
    setup: Setup | None = None,
    watch: Callable[[StudyProgress], None] | None = None,
    **keywords: Any,
) -> SuiteResult:
    """Drive a suite of scenarios for each planner, and write what became of them to a folder.

    A scenario that cannot be driven is a row that says why; the others go on. The same call goes on with those that
    are missing.

    Args:
      suite: its TOML file, or a Suite.
      controller: one or more: bundled names or `path/to/file.py:ClassName`, with settings in brackets where wanted.
      data: folder that tracks which are paths begin in; None: the present one.
      every: drive only one in so many scenarios, drawn by lot, always the same.
      out: a new or empty folder, or one of the same suite.
      workers: processes; None: as many as there are cores; one: no other than this.
      setup: that all scenarios have in common.
      watch: called several times a second.
      keywords: of a Setup, see there, that change `setup`: `max_speed` of both cars, and which car both are.

    Raises:
      SettingsError, TrackError, ControllerError, RunFolderError: what cannot be driven; nothing has run then.
      EngineError: a worker process could not be started.
    """
    if not isinstance(every, int) or every < 1:
        raise SettingsError(f"every is {shown(every)}; accepted: a whole number from 1")
    if not isinstance(suite, Suite):
        suite = Suite.read(suite, data)
    base = Setup.of(setup, caller="drive_suite", **keywords)
    base.require_usable("drive_suite", *USABLE, alone=True)
    settings = DuelSettings(base=base.replace(laps=_ENDLESS))
    scenarios = plan_suite(suite, [ControllerChoice.of(text) for text in as_axis(controller)], settings, every)
    folder = GridFolder(out, ScenarioRow.of, title="suite of scenarios", command="scenarios", file="scenarios.jsonl")
    manifest = settings.manifest() | {"seconds": suite.seconds}
    return drive_grid(SuiteResult, scenarios, folder, manifest, workers=workers, watch=watch, draw=lambda study: None)


def plan_suite(
    suite: Suite, planners: Sequence[ControllerChoice], settings: DuelSettings, every: int = 1
) -> list[Scenario]:
    """Return the scenarios of a suite for each planner, in its order; each once.

    Raises:
      SettingsError: none, or too many.
      TrackError, ControllerError: what cannot be loaded.
    """
    car = settings.car
    found: list[Scenario] = []
    for choice in planners:
        course = closed_track(suite.scenarios[0].track[0], car)
        files = files_sha256(check_planner(choice, course, settings.base.drive_settings))
        keys = [key for group in suite.scenarios for key in group.keys(choice.label, choice.sha256, files, car)]
        found += [Scenario(key, choice, settings, suite.seconds) for key in _one_in(list(dict.fromkeys(keys)), every)]
        if len(found) > _MOST_SCENARIOS:
            raise SettingsError(f"the suite has {len(found)} scenarios; accepted: {_MOST_SCENARIOS} at most")
    return found
