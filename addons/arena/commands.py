"""The commands of studies: `compare`, `overtake`, `scenarios`, `league`, `grade` and `evaluate`.

Exit codes: 0 all runs were driven, however they ended; 1 a run could not be driven, or a planner has not passed a lab;
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
    TRUST,
    WORKERS,
    Part,
    can_draw,
    command,
    names_in,
    number,
    numbers_in,
    option,
    whole,
)
from fg_mujoco.cli.options import CAR, NAMES, setup_of, setup_options
from fg_mujoco.cli.out import STUDY, out_options
from fg_mujoco.cli.progress import study
from fg_mujoco.course.scenes import PREFIX, scene_names
from fg_mujoco.racing.planners import controller_names
from fg_mujoco.rollouts.store import as_json
from fg_mujoco.simulation.settings import FASTEST, PLANNER_OPTIONS

from .comparison.comparison import DEFAULT_SEEDS, Comparison, compare
from .evaluation import evaluate
from .grid_study import Study, StudyProgress
from .labs.grading import grade
from .labs.lab_file import read_lab
from .league.league import DECISION_LIMIT, DEFAULT_RULES, DEFAULT_TRACKS, PAGE, League, league
from .overtaking import overtaking
from .overtaking.overtaking import Overtaking, overtake
from .overtaking.scenario_suite import SuiteResult, drive_suite
from .overtaking.slower_opponents import OPPONENTS

_DONE, _NOT_DONE = 0, 1

_SEEDS = "numbers, or FIRST:END without END"
_PLANNER = (
    "NAME, path/to/file.py:ClassName, a policy's file or folder, or ros:path/to/node.py, with settings "
    "NAME[SETTING=VALUE,...]"
)
_STARTS = ("start_s", "start_offset", "start_heading", "start_speed")
_OF_DUELS = (
    "vehicle", "tires", "mu", "floor", "planner_mu", "max_speed", "mass", "cog_height", "steering_gain", "speed_gain",
    "command_delay", *PLANNER_OPTIONS,
)  # fmt: skip


def _study_options(wrote: str) -> tuple[Part, ...]:
    """Return the options that all studies have; `wrote` is what they leave in their folder."""
    text = f"{wrote}; the same command goes on with a folder left unfinished, and a larger one drives only what is new"
    return WORKERS, out_options(STUDY, text, required=True), JSON, CONFIG, TRUST


def _list(name: str, text: str, reads: Callable[[str], Any], default: Any = None, **more: Any) -> Part:
    """Return the option of an axis of a study, which takes several values with commas between them."""
    return option(name, text, "LIST", reads, default, names=NAMES.get(name.lstrip("-")), **more)


def _seeds_in(text: str) -> Sequence[int]:
    """Read `0:10` or `1,4,7`."""
    first, colon, end = text.partition(":")
    try:
        return range(int(first), int(end)) if colon else [int(part) for part in text.split(",")]
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}; accepted: FIRST:END, or whole numbers as 1,4,7") from None


def _ratio(text: str) -> tuple[float, float]:
    """Read `.3:.9`."""
    low, colon, high = text.partition(":")
    if not colon:
        raise argparse.ArgumentTypeError(f"{text!r}; accepted: LOW:HIGH")
    return number(low), number(high)


def _drive(
    drive: Callable[..., Study[Any, Any]],
    options: argparse.Namespace,
    *arguments: Any,
    noun: str,
    lists: Sequence[str],
    failed: Callable[[Any], bool],
    **axes: Any,
) -> int:
    """Drive a study, print its tables or its JSON, and return the exit code.

    Args:
      drive: the function, with its planners as the last of the arguments.
      options: of the command.
      arguments: of the function.
      noun: what its runs are called.
      lists: names of the options of which the study takes several values.
      failed: says of the figures of a run whether it could not be driven.
      axes: the other axes and settings of the function.
    """
    setup = setup_of(options, lists=lists)
    if hasattr(options, "seed"):
        axes["seed"] = options.seed
    with study(options, noun, StudyProgress.counts) as watch:
        result = drive(*arguments, **axes, setup=setup, workers=options.workers, out=options.out, watch=watch)
    found = len(result.rows) - result.runs_driven
    earlier = f", {found} of them by an earlier call" if found else ""
    written = f"{len(result.rows)} {noun}{earlier}; written to {options.out}\n{setup.first.friction}"
    print(as_json(result.summary()) if options.json else f"{result.markdown()}\n{written}")
    return _NOT_DONE if any(failed(row.figures) for row in result.rows) else _DONE


@command(
    _list(
        "--controller", "NAME, path/to/file.py:ClassName or a policy's file, with settings as "
        "gap_finder[lookahead=8], comma between two; default: all bundled ones", names_in,
    ),
    _list("--track", "NAME, random:SEED[:tight], file.csv or scene:NAME; default: all scenes", names_in),
    _list(
        "--seed", f"{_SEEDS}; of scenes, and on tracks of obstacles and noise; default: 0:10", _seeds_in, DEFAULT_SEEDS
    ),
    _list(
        "--max-speed", f"fastest that a planner may command [m/s], each a run of its own; default: {FASTEST:g}",
        numbers_in,
    ),
    setup_options(
        but=("controller", "track", "seed", "max_speed", "obstacle_seed"), laps="on tracks; default: 5",
        obstacles="boxes on each track, at places drawn from the seed; default: 0",
        moving="what moves on each track, at places drawn from the seed: {names}; default: nothing",
    ),
    *_study_options("tables, pictures and finished runs"),
)  # fmt: skip
def compare_command(options: argparse.Namespace) -> int:
    """Drive every controller on every course with every seed, and make a table of how they fared."""
    return _drive(
        compare, options, options.controller or controller_names(), noun=Comparison.noun,
        lists=("controller", "track", "seed", "max_speed"), failed=lambda figures: figures.end_reason == "worker_died",
        track=options.track or [f"{PREFIX}{name}" for name in scene_names()],
        max_speed=options.max_speed or FASTEST, pictures=can_draw("pictures"),
    )  # fmt: skip


_DUELISTS = _list(
    "--controller", "NAME, path/to/file.py:ClassName or a policy's file, with settings in brackets, comma between two; "
    "default: overtaker", names_in, ["overtaker"],
)  # fmt: skip


@command(
    _DUELISTS,
    _list(
        "--track", f"NAME, random:SEED[:tight] or file.csv; default: {','.join(overtaking.DEFAULT_TRACKS)}", names_in,
        overtaking.DEFAULT_TRACKS,
    ),
    option("--opponents", "of {names}; default: all", "LIST", names_in, OPPONENTS, names=lambda: OPPONENTS),
    option(
        "--speed-ratio", "of the opponent to the planner's own speed at the same place; default: .3:.9", "LOW:HIGH",
        _ratio, overtaking.DEFAULT_RATIO,
    ),
    _list(
        "--seed", f"{_SEEDS}; of start, distance and speed ratio; default: 0:50", _seeds_in, overtaking.DEFAULT_SEEDS
    ),
    setup_options("laps", *_OF_DUELS, laps="within which the planner is to overtake; default: 2"),
    *_study_options("table, picture and finished duels"),
)  # fmt: skip
def overtake_command(options: argparse.Namespace) -> int:
    """Drive a planner behind slower opponents, and make a table of how often it overtakes."""
    return _drive(
        overtake, options, options.controller, noun=Overtaking.noun,
        lists=("controller", "track", "opponents", "seed"), failed=lambda figures: figures.outcome == "failed",
        track=options.track, opponents=options.opponents, speed_ratio=options.speed_ratio,
        pictures=can_draw("pictures"),
    )  # fmt: skip


@command(
    option("suite", "the scenarios, such as examples/scenarios/overtaking.toml", "SUITE.toml"),
    _DUELISTS,
    option("--data", "folder that tracks which are paths begin in; default: the present one", "DIR"),
    option("--every", "drive only one in N, drawn by lot; default: 1", "N", whole, 1),
    setup_options(*_OF_DUELS),
    *_study_options("tables and finished scenarios"),
)
def scenarios_command(options: argparse.Namespace) -> int:
    """Drive a planner through a suite of overtaking scenarios that a file defines."""
    return _drive(
        drive_suite, options, options.suite, options.controller, noun=SuiteResult.noun, lists=("controller",),
        failed=lambda figures: figures.outcome == "failed", data=options.data, every=options.every,
    )  # fmt: skip


@command(
    option(
        "planners", f"{_PLANNER}; none: the entries of --config, each with a car of its own", "PLANNER", nargs="*",
        names=controller_names,
    ),
    _list(
        "--track", "NAME, random:SEED[:tight], file.csv or map.yaml, comma between two; default: "
        f"{','.join(DEFAULT_TRACKS)}", names_in, DEFAULT_TRACKS,
    ),
    _list("--seed", f"{_SEEDS}; of what sensors draw, each a heat of its own; default: 0", _seeds_in, [0]),
    option("--cars", "of a heat; default: 2", "N", whole, 2),
    option("--keep-runs", "write the run folder of each heat, as `replay` takes it, to DIR/runs"),
    setup_options(
        but=("controller", "track", "seed", "opponents", *_STARTS),
        rules=f"of race control: {{names}}; default: {DEFAULT_RULES}",
        decision_limit=f"of wall time for each decision [s]; default: {DECISION_LIMIT:g}",
    ),
    *_study_options(f"tables, {PAGE}, a file for each heat, and finished heats"),
)  # fmt: skip
def league_command(options: argparse.Namespace) -> int:
    """Race planners against each other, each pair on each track from both places, and make a table with ratings."""
    code = _drive(
        league, options, options.planners, noun=League.noun, lists=("track", "seed", "grid", "rules"),
        failed=lambda figures: figures.trajectory_sha256 is None, track=options.track, cars=options.cars,
        keep_runs=options.keep_runs, grid=getattr(options, "grid", None), rules=getattr(options, "rules", None),
    )  # fmt: skip
    if not options.json:
        print(f"page: {Path(options.out) / PAGE}")
    return code


@command(
    option("lab", "the checks and their points", "LAB.toml"),
    option(
        "planners", "path/to/file.py, or file.py:NAME where it has several planners; also NAME, ros:path/to/node.py, "
        "or a policy's file", "PLANNER", nargs="+", names=controller_names,
    ),
    WORKERS,
    out_options(STUDY, "tables, a page for each planner, grades.json; a planner graded there is not driven again"),
    JSON,
)  # fmt: skip
def grade_command(options: argparse.Namespace) -> int:
    """Grade planners by a lab of a course: checks with points, a table, and a page for each planner."""
    lab = read_lab(options.lab)
    aside_of = TemporaryDirectory(prefix="fg_mujoco-grade-")
    with aside_of as aside, study(options, "drives", StudyProgress.counts) as watch:
        out = options.out or Path(aside) / "grades"
        grades = grade(lab, options.planners, out=out, workers=options.workers, watch=watch)
    passed = [each.points >= lab.passing for each in grades.cells]
    if options.json:
        print(as_json(grades.summary()))
    else:
        written = "" if options.out is None else f"; written to {options.out}"
        print(f"{lab.title}\n\n{grades.markdown()}\n{sum(passed)} of {len(passed)} passed{written}")
        for each in grades.cells:
            if each.reason is not None and len(passed) == 1:
                print(f"{each.planner} failed: {each.reason}")
    return _DONE if all(passed) else _NOT_DONE


@command(
    _list(
        "--controller", "policies and planners, comma between two; lap times are compared with those of the last, "
        "which is gap_finder where only one is given", names_in, required=True,
    ),
    _list("--track", "comma between two; default: oval", names_in, ["oval"]),
    _list("--mu", "default: 0.5,0.8,1.1", numbers_in, [0.5, 0.8, 1.1]),
    _list("--seed", "of obstacles and noise; default: 0", _seeds_in, [0]),
    setup_options("laps", "obstacles", *(name for name in CAR if name != "mu"), "time_limit"),
    WORKERS,
    out_options(STUDY, "tables, and the runs of each coefficient", required=True),
    CONFIG,
    TRUST,
)  # fmt: skip
def evaluate_command(options: argparse.Namespace) -> int:
    """Compare policies and planners over courses and friction coefficients, in one table."""
    setup = setup_of(options, lists=("controller", "track", "mu", "seed"))
    alone = len(options.controller) == 1 and options.controller != ["gap_finder"]
    controllers = [*options.controller, "gap_finder"] if alone else options.controller
    with study(options, "runs", StudyProgress.counts) as watch:
        evaluation = evaluate(
            controllers, track=options.track, mu=options.mu, seed=options.seed, out=options.out, setup=setup,
            workers=options.workers, max_speed=setup.first.max_speed, watch=watch,
        )  # fmt: skip
    print(evaluation.markdown())
    print(f"written to {options.out}")
    rows = (row for each in evaluation.comparisons.values() for row in each.rows)
    return _NOT_DONE if any(row.figures.end_reason == "worker_died" for row in rows) else _DONE
