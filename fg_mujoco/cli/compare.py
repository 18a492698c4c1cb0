"""The command `fg-mujoco compare`.

Exit codes: 0 all runs were driven, however they ended; 1 the worker of a run died; 2 input that cannot be
used; 130 Ctrl-C. Runs that are finished then stay in the folder of `--out`, and the same command goes on with the
others.
"""

from __future__ import annotations

import argparse
import contextlib
import re
import sys
from collections.abc import Callable, Sequence
from typing import Any

from ..course.scenes.catalogue import PREFIX, scene_names
from ..errors import EngineError
from ..racing.planner_sources import controller_names
from ..simulation.settings import FASTEST
from ..studies.comparison.comparison import DEFAULT_SEEDS, Comparison, ComparisonProgress, compare
from ..studies.store import as_json
from .config import add_config
from .options import CAR, add_setup_options, add_trust_option, can_draw, number, setup_of, whole
from .out import STUDY, add_out_options
from .progress import shown_as, to_go

_DONE, _NOT_DONE = 0, 1
_COMMA = re.compile(r",(?![^\[]*\])")  # outside brackets


def add_compare(add_command: Callable[..., argparse.ArgumentParser], commands: Any) -> None:
    """Add the command; `add_command` is the one that adds the others."""
    text = "drive every controller on every course with every seed, and make a table of how they fared"
    command = add_command(commands, "compare", _compare, text)
    add = command.add_argument
    add(
        "--controller", type=names_in, metavar="LIST",
        help="NAME or path/to/file.py:ClassName, with settings as gap_finder[lookahead=8,clearance=0.2], comma between "
        "two; default: all bundled ones",
    )  # fmt: skip
    add(
        "--track", type=names_in, metavar="LIST",
        help="NAME, random:SEED[:tight], file.csv or scene:NAME; default: all scenes",
    )  # fmt: skip
    add(
        "--seed", type=seeds_in, default=DEFAULT_SEEDS, metavar="LIST",
        help="numbers, or FIRST:END without END; of scenes, and on tracks of obstacles and noise; default: 0:10",
    )  # fmt: skip
    add(
        "--max-speed", type=numbers_in, metavar="LIST",
        help=f"fastest that a planner may command [m/s], each a run of its own; default: {FASTEST:g}",
    )  # fmt: skip
    own = (name for name in CAR if name != "max_speed")
    add_setup_options(
        add, "laps", "obstacles", "patches", *own, "lidar", "motion_distortion", "opponents", "grid", "rules",
        "time_limit", "decision_limit", laps="on tracks; default: 5",
        obstacles="boxes on each track, at places drawn from the seed; default: 0",
    )  # fmt: skip
    add("--workers", type=whole, metavar="N", help="processes; default: as many as there are cores")
    add_out_options(
        command,
        STUDY,
        "tables, pictures and finished runs; the same command goes on with a folder left unfinished, and a larger "
        "one drives only what is new",
        required=True,
    )  # fmt: skip
    add("--json", action="store_true", help="print one JSON object and nothing else")
    add_config(command)
    add_trust_option(add)


def _compare(options: argparse.Namespace) -> int:
    base = setup_of(options, lists=("controller", "track", "seed", "max_speed"))
    with (
        contextlib.redirect_stdout(sys.stderr),
        shown_as(_progress, "preparing runs", show=not options.json) as watch,
    ):
        try:
            result = compare(
                options.controller or controller_names(),
                track=options.track or [f"{PREFIX}{name}" for name in scene_names()],
                seed=options.seed,
                max_speed=options.max_speed or FASTEST,
                setup=base,
                workers=options.workers,
                out=options.out,
                pictures=can_draw("pictures"),
                watch=watch,
            )
        except EngineError as error:
            print("fg-mujoco:", *f"{error}; finished runs are kept".split(), file=sys.stderr)
            return _NOT_DONE
        except KeyboardInterrupt:
            print(f"fg-mujoco: {options.out}: interrupted; the same command goes on", file=sys.stderr)
            raise
    print(as_json(result.summary()) if options.json else _report(result, options.out, base.first.friction))
    died = any(row.figures.end_reason == "worker_died" for row in result.rows)
    return _NOT_DONE if died else _DONE


def names_in(text: str) -> list[str]:
    """Read names with commas between them; a comma in brackets is part of a name."""
    names = [name.strip() for name in _COMMA.split(text)]
    if not all(names):
        raise argparse.ArgumentTypeError(f"{text!r}; accepted: names, a comma between two")
    return names


def seeds_in(text: str) -> Sequence[int]:
    """Read `0:10` or `1,4,7`."""
    first, colon, end = text.partition(":")
    try:
        return range(int(first), int(end)) if colon else [int(part) for part in text.split(",")]
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}; accepted: FIRST:END, or whole numbers as 1,4,7") from None


def numbers_in(text: str) -> list[float]:
    """Read `4,6.5`."""
    return [number(part.strip()) for part in text.split(",")]


def _progress(progress: ComparisonProgress) -> str:
    done = progress.runs_found + progress.runs_driven
    return f"{done}/{progress.runs} runs{to_go(progress.remaining_s)}"


def _report(result: Comparison, out: str, friction: str) -> str:
    found = len(result.rows) - result.runs_driven
    earlier = f", {found} of them by an earlier call" if found else ""
    return f"{result.markdown()}\n{len(result.rows)} runs{earlier}; written to {out}\n{friction}"
