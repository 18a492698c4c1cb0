"""The functions that drive a study: `study` of any suite, and `compare`, which makes one of lists.

    found = compare(["gap_finder", "follow_the_gap[point=middle]"], track="oval", out="runs/compare")
    found = study("lab3.toml", ["alice.py", "bob.py:Planner"], out="grades")
    print(found.markdown())

A later call with the same folder drives only the runs that are missing, also where planners or courses are added. A
script that calls one with several workers needs `if __name__ == "__main__":`, as every script that starts processes
does. Both raise SettingsError, TrackError, ControllerError or RunFolderError for what cannot be driven, before anything
is; EngineError where a worker could not be started.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fg_mujoco.course.course import USUAL_LAPS
from fg_mujoco.course.scenes import PREFIX, scene_names
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import shown
from fg_mujoco.racing.opponents import Opponents
from fg_mujoco.racing.planners import controller_names
from fg_mujoco.racing.setup import OF_A_CAR, OF_A_CONTEXT, Setup, StudyKeywords
from fg_mujoco.simulation.settings import FASTEST

from .plan import plan
from .store import Study, StudyProgress, drive_study
from .suite import ASSIST, Group, Suite, read_suite, require_axis

if TYPE_CHECKING:
    from typing_extensions import Unpack

Watch = Callable[[StudyProgress], None] | None

REACTIVE = Path(__file__).parent / "reactive.toml"
"""The bundled suite, of the card of a planner."""

DEFAULT_SEEDS = range(10)
_OF_A_RACE = "full"  # the assist of a race that says no other

_COMPARED = (
    *OF_A_CAR, *OF_A_CONTEXT, "controller", "track", "obstacles", "moving", "patches", "start", "laps", "time_limit",
    "lidar", "grid", "rules", "decision_limit",
)  # fmt: skip


def study(
    suite: Suite | str | Path,
    planners: str | Sequence[str],
    *,
    out: str | Path,
    every: int = 1,
    scored: bool = False,
    workers: int | None = None,
    watch: Watch = None,
    page: bool = True,
) -> Study:
    """Drive planners through a suite, and write what became of them to a folder.

    Args:
      suite: or the path of its file.
      planners: one or more, as `race` takes them; of a file with one planner the file is enough.
      out: a new or empty folder, or one of the same suite.
      every: drive only one in so many runs of each planner, drawn by lot, always the same.
      scored: whether planners have a score: the share of the way, times the raceline's lap over their own.
      workers: processes; None: as many as there are cores; one: no other than this.
      watch: called several times a second.
      page: whether to write the page.
    """
    read = suite if isinstance(suite, Suite) else read_suite(suite)
    settings = {"suite": read.name} | ({"scored": True} if scored else {})
    runs = plan(read, as_axis(planners), every=every, scored=scored)
    return drive_study(read, runs, out, settings, workers=workers, watch=watch, page=page)


def compare(  # type: ignore[misc]  # mu is an axis here
    controller: str | Sequence[str] | None = None,
    *,
    track: str | Sequence[str] | None = None,
    max_speed: float | Sequence[float] | None = None,
    mu: float | Sequence[float] | None = None,
    assist: str | Sequence[str] | None = None,
    seed: int | Sequence[int] = DEFAULT_SEEDS,
    out: str | Path,
    workers: int | None = None,
    setup: Setup | None = None,
    watch: Watch = None,
    **keywords: Unpack[StudyKeywords],
) -> Study:
    """Drive every controller on every course at every speed with every friction, assist and seed.

    Args:
      controller: one or more: bundled names or `path/to/file.py:ClassName`, each with settings that differ from its own
        in brackets where wanted, as `gap_finder[lookahead=8]`; None: that of `setup`, or all bundled ones.
      track: one or more, as `load_track` takes them; of scenes `scene:NAME`; None: that of `setup`, or all scenes.
      max_speed: one or more: fastest that the planner may command [m/s]; None: that of `setup`, or 8 m/s.
      mu: one or more: coefficients of friction of the tires; None: that of `setup`, or of the tires' file.
      assist: one or more: stages between planners and cars; None: that of `setup`, or none, and so no "full".
      seed: one or more: of a scene; on a track, of the obstacles and the LiDAR's noise. Where nothing depends on it, a
        course is driven once.
      out: a new or empty folder, or one of a comparison with the same setup.
      workers: processes; None: as many as there are cores; one: no other than this, which a planner can end.
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
    assists = as_axis(assist or (ASSIST if base.first.assist == _OF_A_RACE else base.first.assist))
    first = replace(base.first, controller="gap_finder", planner_settings={}, assist=_OF_A_RACE)
    laps = USUAL_LAPS if base.laps is None else base.laps
    base = replace(base, track="oval", laps=laps, entries=(first, *base.entries[1:]))
    axes = {"track": [_by_name(each) for each in courses], "max_speed": speeds}
    axes |= {} if mu is None else {"mu": as_axis(mu)}
    axes = {name: [float(each) if type(each) is int else each for each in values] for name, values in axes.items()}
    require_axis("seed", as_axis(seed))
    group = Group(name="all", base=base, axes=axes, seeds=as_axis(seed))
    settings = {name: value for name, value in base.described().items() if name not in ("track", "controller")}
    suite = Suite(name="comparison", groups=(group,), assists=tuple(assists))
    return drive_study(suite, plan(suite, planners), out, settings, workers=workers, watch=watch)


def as_axis(value: Any) -> list[Any]:
    """Return the values of an axis: one, or a sequence of them."""
    return [value] if isinstance(value, str) or not isinstance(value, Iterable) else list(value)


def _by_name(track: Any) -> str:
    if not isinstance(track, str):
        raise SettingsError(f"track is {shown(track)}, an object, in a comparison; accepted: a name, or a file")
    return track
