"""The functions that drive a study: `study` of any suite, and `compare`, `overtake` and `league`, which make one.

    found = compare(["gap_finder", "follow_the_gap[point=middle]"], track="oval", out="runs/compare")
    found = league(["gap_finder", "overtaker", "my_planner.py:Mine"], track=["oval", "fast"], laps=3, out="runs/league")
    found = study("lab3.toml", ["alice.py", "bob.py:Planner"], out="grades")
    print(found.markdown())

A later call with the same folder drives only the runs that are missing, also where planners or courses are added. A
script that calls one with several workers needs `if __name__ == "__main__":`, as every script that starts processes
does. All raise SettingsError, TrackError, ControllerError or RunFolderError for what cannot be driven, before anything
is; MissingExtraError where there is no matplotlib for pictures; EngineError where a worker could not be started.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from fg_mujoco.course.course import USUAL_LAPS
from fg_mujoco.course.scenes import PREFIX, scene_names
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import shown
from fg_mujoco.pictures.pages.figure_kit import require_matplotlib
from fg_mujoco.racing.entries import Entry
from fg_mujoco.racing.opponents import Opponents
from fg_mujoco.racing.planners import controller_names
from fg_mujoco.racing.rules import find_rules
from fg_mujoco.racing.setup import OF_A_CAR, OF_A_CONTEXT, Setup, StudyKeywords
from fg_mujoco.simulation.settings import FASTEST

from ..runs.duels import Duels
from ..runs.slower_cars import OPPONENTS
from .kinds import KINDS, Comparison, League, Overtaking
from .plan import plan
from .store import Study, StudyProgress, drive_study
from .suite import Group, Suite, read_suite, require_axis

if TYPE_CHECKING:
    from typing_extensions import Unpack

Watch = Callable[[StudyProgress], None] | None

DEFAULT_SEEDS = range(10)
DUEL_TRACKS = ("oval", "l_corridor", "hairpins", "chicanes", "fast", "tight")
DUEL_SEEDS, DUEL_RATIO = range(50), (0.3, 0.9)
LEAGUE_TRACKS, LEAGUE_RULES = ("oval", "fast", "hairpins"), "roboracer_2026"

_COMPARED = (
    *OF_A_CAR, *OF_A_CONTEXT, "controller", "track", "obstacles", "moving", "patches", "start", "laps", "time_limit",
    "lidar", "grid", "rules", "decision_limit",
)  # fmt: skip
_OF_ENTRIES = ("controller", "planner_settings", "seed", "name", "start")
_RACED = (
    *OF_A_CAR, *OF_A_CONTEXT, "obstacles", "obstacle_seed", "moving", "patches", "laps", "time_limit", "lidar", "grid",
    "rules", "decision_limit",
)  # fmt: skip


def study(
    suite: Suite | str | Path,
    planners: str | Sequence[str],
    *,
    out: str | Path,
    every: int = 1,
    workers: int | None = None,
    watch: Watch = None,
) -> Study:
    """Drive planners through a suite, and write what became of them to a folder.

    Args:
      suite: or the path of its file.
      planners: one or more, as `race` takes them; of a file with one planner the file is enough.
      out: a new or empty folder, or one of the same suite.
      every: drive only one in so many runs of each planner, drawn by lot, always the same.
      workers: processes; None: as many as there are cores; one: no other than this.
      watch: called several times a second.
    """
    read = suite if isinstance(suite, Suite) else read_suite(suite)
    return drive_suite(read, as_axis(planners), out=out, workers=workers, watch=watch, every=every)


def compare(  # type: ignore[misc]  # mu is an axis here
    controller: str | Sequence[str] | None = None,
    *,
    track: str | Sequence[str] | None = None,
    max_speed: float | Sequence[float] | None = None,
    mu: float | Sequence[float] | None = None,
    seed: int | Sequence[int] = DEFAULT_SEEDS,
    out: str | Path,
    workers: int | None = None,
    pictures: bool = True,
    setup: Setup | None = None,
    watch: Watch = None,
    **keywords: Unpack[StudyKeywords],
) -> Comparison:
    """Drive every controller on every course at every speed with every friction and seed.

    Args:
      controller: one or more: bundled names or `path/to/file.py:ClassName`, each with settings that differ from its own
        in brackets where wanted, as `gap_finder[lookahead=8]`; None: that of `setup`, or all bundled ones.
      track: one or more, as `load_track` takes them; of scenes `scene:NAME`; None: that of `setup`, or all scenes.
      max_speed: one or more: fastest that the planner may command [m/s]; None: that of `setup`, or 8 m/s.
      mu: one or more: coefficients of friction of the tires; None: that of `setup`, or of the tires' file.
      seed: one or more: of a scene; on a track, of the obstacles and the LiDAR's noise. Where nothing depends on it, a
        course is driven once.
      out: a new or empty folder, or one of a comparison with the same setup.
      workers: processes; None: as many as there are cores; one: no other than this, which a planner can end.
      pictures: whether to draw them.
      setup: that all runs have in common.
      watch: called several times a second.
      keywords: of a Setup, see there, that change `setup`. `obstacles` is how many boxes, at places drawn from the
        seed. `opponents` race against the car of each run, and rows are that car's, with how it fared among them. Cars
        that touch are no failure: `contacts` counts them.
    """
    base = Setup.of(setup, caller="compare", **keywords)
    base.require_usable("a comparison", *_COMPARED)
    Opponents.of(base)  # refuses those that no study can have
    usual: tuple[Any, ...] = (base.first.controller, base.track, base.first.max_speed)
    if setup is None:
        usual = (controller_names(), [f"{PREFIX}{name}" for name in scene_names()], FASTEST)
    planners, courses, speeds = (
        as_axis(given if given is not None else own)
        for given, own in zip((controller, track, max_speed), usual, strict=True)
    )
    base = replace(
        base, track="oval", laps=USUAL_LAPS if base.laps is None else base.laps,
        entries=(replace(base.first, controller="gap_finder", planner_settings={}), *base.entries[1:]),
    )  # fmt: skip
    axes = {"track": [_by_name("track", each) for each in courses], "max_speed": speeds}
    axes |= {} if mu is None else {"mu": as_axis(mu)}
    axes = {name: [float(each) if type(each) is int else each for each in values] for name, values in axes.items()}
    suite = Suite(name="comparison", groups=(Group(name="all", base=base, axes=axes, seeds=_seeds(seed)),))
    found = drive_suite(
        suite, planners, _settings(base), out=out, command="comparison", workers=workers, watch=watch, traced=pictures
    )  # fmt: skip
    assert isinstance(found, Comparison)
    return found


def overtake(
    controller: str | Sequence[str] = "overtaker",
    *,
    track: str | Sequence[str] = DUEL_TRACKS,
    opponents: str | Sequence[str] = OPPONENTS,
    seed: int | Sequence[int] = DUEL_SEEDS,
    speed_ratio: Sequence[float] = DUEL_RATIO,
    out: str | Path,
    workers: int | None = None,
    pictures: bool = True,
    setup: Setup | None = None,
    watch: Watch = None,
    **keywords: Any,
) -> Overtaking:
    """Drive each planner behind each slower opponent on each track with each seed.

    Args:
      controller: one or more: bundled names or `path/to/file.py:ClassName`, with settings in brackets where wanted.
      track: one or more: closed ones, as `load_track` takes them.
      opponents: one or more of `slower_cars.OPPONENTS`.
      seed: one or more: each draws where a duel starts, the distance and the ratio; the same for all planners.
      speed_ratio: least and greatest ratio of the opponent's speed to the planner's own at the same place, alone.
      out: a new or empty folder, or one of a study with the same settings.
      workers: processes; None: as many as there are cores; one: no other than this.
      pictures: whether to draw one.
      setup: that all duels have in common.
      watch: called several times a second.
      keywords: of a Setup, see there, that change `setup`: `laps` within which the planner is to overtake, by default
        2, `max_speed` and `planner_mu` of both cars, which car both are: `vehicle`, `tires`, `mu`, `changes`, and what
        the planner senses and `knows`.
    """
    base = Setup.of(setup, caller="overtake", **keywords)
    base.require_usable("overtake", *OF_A_CAR, *OF_A_CONTEXT, "laps", alone=True)
    duels = Duels(opponent=as_axis(opponents), ratio=tuple(speed_ratio))
    group = Group(name="all", base=base, axes={"track": as_axis(track)}, seeds=_seeds(seed), duels=duels)
    suite, settings = Suite(name="overtaking", groups=(group,)), _settings(base) | {"ratio": list(speed_ratio)}
    found = drive_suite(
        suite, as_axis(controller), settings, out=out, command="overtaking study", workers=workers, watch=watch,
        traced=pictures,
    )  # fmt: skip
    assert isinstance(found, Overtaking)
    return found


def league(
    controller: Sequence[str | Entry] = (),
    *,
    track: str | Sequence[str] = LEAGUE_TRACKS,
    seed: int | Sequence[int] = 0,
    cars: int = 2,
    out: str | Path,
    workers: int | None = None,
    keep_runs: bool = False,
    setup: Setup | None = None,
    watch: Watch = None,
    **keywords: Unpack[StudyKeywords],
) -> League:
    """Race every group of planners on every track, each of them from each place of the grid once.

    A heat in which a planner fails, takes too long, or ends its worker process, is lost by it, and the others go on.

    Args:
      controller: two or more: planners as `race` takes their texts, or an Entry, with a vehicle and settings of its
        own; none: the entries of `setup`.
      track: one or more, as `load_track` takes them.
      seed: one or more: of what the cars' sensors draw. Where they draw nothing, each heat is driven once.
      cars: of a heat.
      out: a new or empty folder, or one of a league with the same settings.
      workers: processes; None: as many as there are cores; one: no other than this, which a planner can end.
      keep_runs: whether to write the run folder of each heat that is driven, to `runs` in `out`.
      setup: that all heats have in common.
      watch: called several times a second.
      keywords: of a Setup, see there, that change `setup`. Where none are given, `rules` of race control are
        "roboracer_2026", and `decision_limit` is 1 s.
    """
    grid, rules = keywords.pop("grid", None), keywords.pop("rules", None)
    base = Setup.of(setup, caller="league", **keywords)
    several = len(base.entries) > 1
    base.require_usable("a league", *_RACED, *(_OF_ENTRIES if several else ()))
    planners = list(as_axis(controller) or (base.entries if several else ()))
    if not isinstance(cars, int) or not cars >= 2:
        raise SettingsError(f"cars is {shown(cars)} for {len(planners)} planners; accepted: 2 to {len(planners)}")
    rules = rules or (base.rules if several and base.rules != "none" else LEAGUE_RULES)
    find_rules(rules)
    first = replace(base.first, name=None, controller="gap_finder", planner_settings={})
    both = (first, replace(first, name="other"))  # of two, so that it can have a grid and rules
    base = replace(base, entries=both, grid=grid or base.grid, rules=rules)
    group = Group(name="all", base=base, axes={"track": as_axis(track)}, seeds=_seeds(seed), heats=cars)
    suite, keep = Suite(name="league", groups=(group,)), str(Path(out) / "runs") if keep_runs else ""
    found = drive_suite(
        suite, planners, _settings(base), out=out, command="league", workers=workers, watch=watch, keep=keep
    )  # fmt: skip
    assert isinstance(found, League)
    return found


def drive_suite(
    suite: Suite,
    planners: Sequence[Any],
    settings: Mapping[str, Any] | None = None,
    *,
    out: str | Path,
    command: str = "study",
    workers: int | None,
    watch: Watch,
    **planned: Any,
) -> Study:
    """Drive planners through a suite; `planned` are arguments of `plan`, the others those of `drive_study`."""
    if planned.get("traced"):
        require_matplotlib()
    with TemporaryDirectory(prefix="fg_mujoco-study-") as marks:
        runs = plan(suite, planners, marks=marks, **planned)
        settings = {"suite": suite.name} if settings is None else settings
        return drive_study(KINDS[suite.kind], suite, runs, out, settings, command=command, workers=workers, watch=watch)


def _settings(base: Setup) -> dict[str, Any]:
    """Return what all runs have in common as it can stand in JSON; the course and the planners are the runs'."""
    return {name: value for name, value in base.described().items() if name not in ("track", "controller")}


def as_axis(value: Any) -> list[Any]:
    """Return the values of an axis: one, or a sequence of them."""
    return [value] if isinstance(value, (str, Entry)) or not isinstance(value, Iterable) else list(value)


def _seeds(seed: Any) -> list[int]:
    require_axis("seed", as_axis(seed))
    return as_axis(seed)


def _by_name(name: str, value: Any) -> str:
    if not isinstance(value, str):
        raise SettingsError(f"{name} is {shown(value)}, an object, in a comparison; accepted: a name, or a file")
    return value
