"""The commands of studies: `study`; `compare` and `bench`, which are studies of a suite that they make or have; `tune`.

Exit codes: 0 all runs were driven, however they ended; 1 a run could not be driven, a planner has not passed a lab,
or no draw of `tune` is safe;
2 input that cannot be used; 130 Ctrl-C. Runs that are finished then stay in the folder of `--out`, and the same command
goes on with the others.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from fg_mujoco.cli.command import (
    CONFIG,
    JSON,
    WORKERS,
    Part,
    can_draw,
    command,
    named_values,
    names_in,
    number,
    numbers_in,
    option,
    whole,
)
from fg_mujoco.cli.options import NAMES, setup_of, setup_options
from fg_mujoco.cli.out import STUDY, out_options
from fg_mujoco.cli.progress import study as shown
from fg_mujoco.cli.rollout import EXECUTOR, executor_for, rollout_progress
from fg_mujoco.course.scenes import PREFIX, scene_names
from fg_mujoco.racing.planners import controller_names
from fg_mujoco.racing.setup import Setup
from fg_mujoco.rollouts.store import as_json
from fg_mujoco.simulation.settings import FASTEST

from .runs.run import FAILURES
from .study.functions import DEFAULT_SEEDS, REACTIVE, compare, study
from .study.store import PAGE, Study, StudyProgress
from .study.suite import read_suite
from .tuning import CONDITIONS, RUNS, tune

_DONE, _NOT_DONE = 0, 1
_ROWS = 30  # of the table of `tune` in a terminal
PICTURE = "settings.png"

_SEEDS = "numbers, or FIRST:END without END"
_OUT = "table, page and finished runs; the same command goes on there, and a larger one drives only the new runs"


def _list(name: str, text: str, reads: Callable[[str], Any], default: Any = None) -> Part:
    """Return the option of an axis of a study, which takes several values with commas between them."""
    names = NAMES.get(name.removeprefix("--").replace("-", "_"))
    return option(name, f"{text}; comma between two", "LIST", reads, default, names=names)


def _seeds_in(text: str) -> Sequence[int]:
    """Read `0:10` or `1,4,7`."""
    first, colon, end = text.partition(":")
    try:
        return range(int(first), int(end)) if colon else [int(part) for part in text.split(",")]
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}; accepted: FIRST:END, or whole numbers as 1,4,7") from None


def _print(found: Study, options: argparse.Namespace, *said: str) -> int:
    """Print the table of a study or its JSON, and return the exit code."""
    earlier = len(found.rows) - found.runs_driven
    by_earlier = f", {earlier} of them by an earlier call" if earlier else ""
    written = "" if options.out is None else f"; page: {Path(options.out) / PAGE}"
    passed = [found.passed(each) for each in found.sums]
    lines = [found.markdown(), f"{len(found.rows)} runs{by_earlier}{written}", *said]
    if passed:  # the table of a lab says why one failed
        lines.append(f"{found.suite.name}: {sum(passed)} of {len(passed)} passed")
    else:
        ends = (*FAILURES, "failed")  # a duel that is decided is interrupted, and has no message
        of_planners = [row for row in reversed(found.rows) if row.car.end_reason in ends and row.car.message]
        failed = {row.planner: row.car.message for row in of_planners}
        lines += [f"{planner} failed, first: {failed[planner]}" for planner in reversed(failed)]
    print(as_json(found.summary()) if options.json else "\n".join(lines))
    return _DONE if all(passed) and (passed or not found.failed) else _NOT_DONE


@command(
    _list(
        "--controller", "NAME, path/to/file.py:ClassName or a policy's file, with settings as gap_finder[lookahead=8]; "
        "default: all bundled ones", names_in,
    ),
    _list("--track", "NAME, random:SEED[:tight], file.csv or scene:NAME; default: all scenes", names_in),
    _list(
        "--seed", f"{_SEEDS}; of scenes, and on tracks of obstacles and noise; default: 0:10", _seeds_in, DEFAULT_SEEDS
    ),
    _list("--max-speed", f"fastest that a planner may command [m/s]; default: {FASTEST:g}", numbers_in),
    option(
        "--assist", "stages between planners and cars, as of `race`, again for each that they are driven with; "
        "default: none, so that planners are compared", "NAMES", default=argparse.SUPPRESS, action="append",
    ),
    _list("--mu", "friction coefficients of the tires; default: of the tires' file", numbers_in),
    setup_options(
        but=("controller", "track", "seed", "max_speed", "mu", "assist", "obstacle_seed"), laps="on tracks; default: 5",
        obstacles="boxes on each track, at places drawn from the seed; default: 0",
        moving="things that move on each track, at places drawn from the seed: {names}; default: nothing",
    ),
    WORKERS, out_options(STUDY, _OUT, required=True), JSON, CONFIG,
)  # fmt: skip
def compare_command(options: argparse.Namespace) -> int:
    """Drive every controller on every course at every speed, friction and seed, and make a table of how they fared."""
    options.controller = options.controller or controller_names()
    options.track = options.track or [f"{PREFIX}{name}" for name in scene_names()]
    options.max_speed = options.max_speed or FASTEST
    lists = ("controller", "track", "seed", "max_speed", "mu")
    given = {name: value for name in lists if (value := getattr(options, name, None)) is not None}
    given["assist"] = getattr(options, "assist", None)
    if given["assist"]:
        options.assist = given["assist"][0]  # of opponents
    setup = setup_of(options, lists=lists)
    with shown(options, "runs", StudyProgress.counts) as watch:
        found = compare(**given, setup=setup, workers=options.workers, out=options.out, watch=watch)
    several = len(getattr(options, "mu", None) or ()) > 1
    return _print(found, options, *([] if several else [Setup.read(found.rows[0].setup).first.friction]))


_PLANNERS = option(
    "planners", "path/to/file.py, or file.py:NAME where it has several planners; also NAME, ros:path/to/node.py, "
    "or a policy's file", "PLANNER", nargs="+", names=controller_names,
)  # fmt: skip
_EVERY = option("--every", "drive only one run in N of each planner, drawn by lot; default: 1", "N", whole, 1)


def _study(options: argparse.Namespace, *, scored: bool) -> int:
    """Drive a study of a suite's file, print its table, and return the exit code."""
    suite = read_suite(options.suite)
    aside_of = TemporaryDirectory(prefix="fg_mujoco-study-")
    with aside_of as aside, shown(options, "runs", StudyProgress.counts) as watch:
        found = study(
            suite, options.planners, out=options.out or Path(aside) / "study", every=options.every, scored=scored,
            workers=options.workers, watch=watch, page=options.out is not None,
        )  # fmt: skip
    return _print(found, options)


@command(
    option("suite", "the courses, conditions, duels or checks, as a file has them", "SUITE.toml"),
    _PLANNERS, _EVERY, WORKERS, out_options(STUDY, _OUT), JSON,
)  # fmt: skip
def study_command(options: argparse.Namespace) -> int:
    """Drive planners through a suite that a file defines: runs, duels, or a lab of checks with points."""
    return _study(options, scored=False)


@command(
    _PLANNERS, option("--suite", "default: the bundled suite `reactive`", "FILE.toml", Path, REACTIVE),
    _EVERY, WORKERS, out_options(STUDY, _OUT), JSON,
)  # fmt: skip
def bench_command(options: argparse.Namespace) -> int:
    """Drive planners through a suite of courses and conditions, and score them: a study with scores."""
    return _study(options, scored=True)


@command(
    option("controller", "NAME, path/to/file.py:ClassName or a policy's file", "PLANNER", names=controller_names),
    option("--set", "draw a setting of it, max_speed or planner_mu", "NAME=RANGE", default=[], action="append"),
    option("--mu", "friction of the tires, or its range: LOW:HIGH; default: of the tires' file", "MU"),
    option("--runs", f"of all draws together; default: {RUNS}", "N", whole, RUNS),
    option("--conditions", f"frictions and starts of each draw; default: {CONDITIONS}", "N", whole, CONDITIONS),
    setup_options(
        but=("controller", "mu", "lidar", "motion_distortion", "rules"), laps="default: 1",
        assist="stages between planner and car, as of `race`; default: none",
        seed="of draws, conditions and noise; default: 0",
    ),
    option("--workers", "threads, processes, or with Ray cores; default: all cores", "N", whole),
    EXECUTOR, out_options(STUDY, "table, picture and finished runs; the same command goes on there"), JSON, CONFIG,
)  # fmt: skip
def tune_command(options: argparse.Namespace) -> int:
    """Drive a planner with many draws of its settings under the same conditions, and rank them, the safest first."""
    setup, mu = setup_of(options, lists=("controller", "mu", "assist")), options.mu
    with shown(options, "runs", rollout_progress) as watch:
        found = tune(
            options.controller, named_values(options.set, "--set", "NAME=LOW:HIGH or NAME=A|B"), setup=setup,
            mu=mu if mu is None or ":" in mu else number(mu), assist=getattr(options, "assist", None), out=options.out,
            runs=options.runs, conditions=options.conditions, workers=options.workers, watch=watch,
            executor=options.executor or executor_for(setup.with_cars(controller=options.controller)),
        )  # fmt: skip
    if options.out is not None and can_draw(PICTURE, several=False):
        found.picture(Path(options.out) / PICTURE)
    figures = {"head": found.head, "best": found.best, "draws": list(found.rows)}
    print(as_json(figures) if options.json else found.markdown(_ROWS).rstrip())
    return _NOT_DONE if found.best is None or (found.rollout["end_reason"] == "worker_died").any() else _DONE
