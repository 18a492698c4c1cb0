"""The commands of studies: `study`, `grade`, `compare`, `overtake` and `league`.

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
from fg_mujoco.cli.options import NAMES, setup_of, setup_options
from fg_mujoco.cli.out import STUDY, out_options
from fg_mujoco.cli.progress import study as shown
from fg_mujoco.course.scenes import PREFIX, scene_names
from fg_mujoco.racing.planners import controller_names
from fg_mujoco.racing.setup import Setup
from fg_mujoco.rollouts.store import as_json
from fg_mujoco.simulation.settings import FASTEST, PLANNER_OPTIONS

from .runs.slower_cars import OPPONENTS
from .study.functions import (
    DEFAULT_SEEDS,
    DUEL_RATIO,
    DUEL_SEEDS,
    DUEL_TRACKS,
    LEAGUE_RULES,
    LEAGUE_TRACKS,
    compare,
    drive_suite,
    league,
    overtake,
)
from .study.store import Study, StudyProgress
from .study.suite import DECISION_LIMIT, read_suite

_DONE, _NOT_DONE = 0, 1

_SEEDS = "numbers, or FIRST:END without END"
_PLANNER = (
    "NAME, path/to/file.py:ClassName, a policy's file or folder, or ros:path/to/node.py, with settings "
    "NAME[SETTING=VALUE,...]"
)
_STARTS = ("start_s", "start_offset", "start_heading", "start_speed")
_OF_DUELS = (
    "laps", "vehicle", "tires", "mu", "floor", "planner_mu", "max_speed", "mass", "cog_height", "steering_gain",
    "speed_gain", "command_delay", *PLANNER_OPTIONS,
)  # fmt: skip


def _study_options(wrote: str) -> tuple[Part, ...]:
    """Return the options that all studies have; `wrote` is what they leave in their folder."""
    text = f"{wrote}; the same command continues an unfinished folder; a larger one drives only the new runs"
    return WORKERS, out_options(STUDY, text, required=True), JSON, CONFIG, TRUST


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


def _ratio(text: str) -> tuple[float, float]:
    """Read `.3:.9`."""
    low, colon, high = text.partition(":")
    if not colon:
        raise argparse.ArgumentTypeError(f"{text!r}; accepted: LOW:HIGH")
    return number(low), number(high)


def _drive(drive: Callable[..., Study], options: argparse.Namespace, lists: Sequence[str], **given: Any) -> int:
    """Drive a study, print its tables or its JSON, and return the exit code.

    Args:
      drive: the function.
      options: of the command.
      lists: names of the options of which the study takes several values.
      given: other arguments of the function.
    """
    setup = setup_of(options, lists=lists)
    given |= {name: value for name in lists if (value := getattr(options, name, None)) is not None}
    with shown(options, "runs", StudyProgress.counts) as watch:
        found = drive(**given, setup=setup, workers=options.workers, out=options.out, watch=watch)
    several = len(getattr(options, "mu", None) or ()) > 1
    return _print(found, options, *([] if several else [Setup.read(found.rows[0].setup).first.friction]))


def _print(found: Study, options: argparse.Namespace, *said: str) -> int:
    earlier = len(found.rows) - found.runs_driven
    by_earlier = f", {earlier} of them by an earlier call" if earlier else ""
    written = "" if options.out is None else f"; written to {options.out}"
    lines = [found.markdown(), f"{len(found.rows)} runs{by_earlier}{written}", *said]
    print(as_json(found.summary()) if options.json else "\n".join(lines))
    return _NOT_DONE if found.failed else _DONE


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
    _list("--mu", "friction coefficients of the tires; default: of the tires' file", numbers_in),
    setup_options(
        but=("controller", "track", "seed", "max_speed", "mu", "obstacle_seed"), laps="on tracks; default: 5",
        obstacles="boxes on each track, at places drawn from the seed; default: 0",
        moving="things that move on each track, at places drawn from the seed: {names}; default: nothing",
    ),
    *_study_options("tables, pictures and finished runs"),
)  # fmt: skip
def compare_command(options: argparse.Namespace) -> int:
    """Drive every controller on every course at every speed, friction and seed, and make a table of how they fared."""
    options.controller = options.controller or controller_names()
    options.track = options.track or [f"{PREFIX}{name}" for name in scene_names()]
    options.max_speed = options.max_speed or FASTEST
    return _drive(compare, options, ("controller", "track", "seed", "max_speed", "mu"), pictures=can_draw("pictures"))


@command(
    _list(
        "--controller", "NAME, path/to/file.py:ClassName or a policy's file, with settings; default: overtaker",
        names_in, ["overtaker"],
    ),
    _list("--track", f"NAME, random:SEED[:tight] or file.csv; default: {','.join(DUEL_TRACKS)}", names_in, DUEL_TRACKS),
    option("--opponents", "of {names}; default: all", "LIST", names_in, OPPONENTS, names=lambda: OPPONENTS),
    option(
        "--speed-ratio", "of the opponent to the planner's own speed at the same place; default: .3:.9", "LOW:HIGH",
        _ratio, DUEL_RATIO,
    ),
    _list("--seed", f"{_SEEDS}; of start, distance and speed ratio; default: 0:50", _seeds_in, DUEL_SEEDS),
    setup_options(*_OF_DUELS, laps="within which the planner is to overtake; default: 2"),
    *_study_options("tables, picture and finished duels"),
)  # fmt: skip
def overtake_command(options: argparse.Namespace) -> int:
    """Drive a planner behind slower opponents, and make a table of how often it overtakes."""
    lists = ("controller", "track", "opponents", "seed")
    return _drive(overtake, options, lists, speed_ratio=options.speed_ratio, pictures=can_draw("pictures"))


@command(
    option(
        "planners", f"{_PLANNER}; none: the entries of --config, each with a car of its own", "PLANNER", nargs="*",
        names=controller_names,
    ),
    _list("--track", f"NAME, random:SEED[:tight], file.csv or map.yaml; default: {','.join(LEAGUE_TRACKS)}", names_in,
          LEAGUE_TRACKS),
    _list("--seed", f"{_SEEDS}; of the sensors' noise; a heat for each; default: 0", _seeds_in, [0]),
    option("--cars", "of a heat; default: 2", "N", whole, 2),
    option("--keep-runs", "write the run folder of each heat, as `replay` takes it, to DIR/runs"),
    setup_options(
        but=("controller", "track", "seed", "opponents", *_STARTS),
        rules=f"of race control: {{names}}; default: {LEAGUE_RULES}",
        decision_limit=f"of wall time for each decision [s]; default: {DECISION_LIMIT:g}",
    ),
    *_study_options("tables, league.html, a file for each heat, and finished heats"),
)  # fmt: skip
def league_command(options: argparse.Namespace) -> int:
    """Race planners against each other, each pair on each track from both places, and make a table with ratings."""
    code = _drive(
        league, options, ("track", "seed", "cars", "grid", "rules"), controller=options.planners,
        keep_runs=options.keep_runs,
    )  # fmt: skip
    if not options.json:
        print(f"page: {Path(options.out) / 'league.html'}")
    return code


@command(
    option("suite", "the courses, conditions, heats, duels or checks, as a file has them", "SUITE.toml"),
    option(
        "planners", "path/to/file.py, or file.py:NAME where it has several planners; also NAME, ros:path/to/node.py, "
        "or a policy's file", "PLANNER", nargs="+", names=controller_names,
    ),
    option("--every", "drive only one run in N of each planner, drawn by lot; default: 1", "N", whole, 1),
    WORKERS,
    out_options(STUDY, "tables and finished runs, of a lab a page for each planner; the same command goes on there"),
    JSON,
)  # fmt: skip
def study_command(options: argparse.Namespace) -> int:
    """Drive planners through a suite that a file defines: runs alone, heats, duels, or a lab of checks with points."""
    suite = read_suite(options.suite)
    aside_of = TemporaryDirectory(prefix="fg_mujoco-study-")
    with aside_of as aside, shown(options, "runs", StudyProgress.counts) as watch:
        found = drive_suite(
            suite, options.planners, out=options.out or Path(aside) / "study", workers=options.workers, watch=watch,
            every=options.every,
        )  # fmt: skip
    if suite.kind != "checks":
        return _print(found, options)
    passed = [each["points"] >= suite.passing for each in found.cells]
    _print(found, options, f"{suite.name}: {sum(passed)} of {len(passed)} passed")
    return _DONE if all(passed) else _NOT_DONE
