"""The command `fg-mujoco evaluate`: how policies and planners fare beside each other over friction coefficients."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Callable
from typing import Any

from fg_mujoco.cli.config import add_config
from fg_mujoco.cli.drive_study import numbers_in, seeds_in
from fg_mujoco.cli.options import CAR, add_setup_options, add_trust_option, names_in, setup_of, whole
from fg_mujoco.cli.out import STUDY, add_out_options
from fg_mujoco.cli.progress import shown_as, to_go
from fg_mujoco.simulation.settings import FASTEST

_DONE, _NOT_DONE = 0, 1


def add_evaluate(add_command: Callable[..., argparse.ArgumentParser], commands: Any) -> None:
    """Add the command; `add_command` is the one that adds the others."""
    text = "compare policies and planners over courses and friction coefficients, in one table"
    command = add_command(commands, "evaluate", _evaluate, text)
    add = command.add_argument
    add(
        "--controller", type=names_in, required=True, metavar="LIST",
        help="policies and planners, comma between two; lap times are compared with those of the last, which is "
        "gap_finder where only one is given",
    )  # fmt: skip
    add("--track", type=names_in, default=["oval"], metavar="LIST", help="comma between two; default: oval")
    add("--mu", type=numbers_in, default=[0.5, 0.8, 1.1], metavar="LIST", help="default: 0.5,0.8,1.1")
    add("--seed", type=seeds_in, default=[0], metavar="LIST", help="of obstacles and noise; default: 0")
    own = (name for name in CAR if name not in ("max_speed", "mu"))
    add_setup_options(command, "laps", "obstacles", *own, "time_limit", "max_speed", laps="default: 5")
    add("--workers", type=whole, metavar="N", help="processes; default: as many as there are cores")
    add_out_options(command, STUDY, "tables, and the runs of each coefficient", required=True)
    add_config(command)
    add_trust_option(add)


def _evaluate(options: argparse.Namespace) -> int:
    from fg_mujoco.rollouts.grid_study import StudyProgress

    from .evaluation import evaluate

    setup = setup_of(options, lists=("controller", "track", "mu", "seed"))

    def text(progress: StudyProgress) -> str:
        return f"{progress.runs_found + progress.runs_driven}/{progress.runs} runs{to_go(progress.remaining_s)}"

    alone = len(options.controller) == 1 and options.controller != ["gap_finder"]
    controllers = [*options.controller, "gap_finder"] if alone else options.controller
    with contextlib.redirect_stdout(sys.stderr), shown_as(text, "preparing runs") as watch:
        evaluation = evaluate(
            controllers, track=options.track, mu=options.mu, seed=options.seed, out=options.out, setup=setup,
            workers=options.workers, max_speed=getattr(setup.first, "max_speed", FASTEST), watch=watch,
        )  # fmt: skip
    print(evaluation.markdown())
    print(f"written to {options.out}")
    worker_died = any(
        row.figures.end_reason == "worker_died" for each in evaluation.comparisons.values() for row in each.rows
    )
    return _NOT_DONE if worker_died else _DONE
