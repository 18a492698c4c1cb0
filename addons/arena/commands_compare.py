"""The command `fg-mujoco compare`; its exit codes are those of `drive_study`."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

from fg_mujoco.cli.drive_study import add_study_options, drive_study, numbers_in, seeds_in
from fg_mujoco.cli.options import CAR, add_setup_options, names_in, setup_of
from fg_mujoco.course.random_moving import KINDS
from fg_mujoco.course.scenes.catalogue import PREFIX, scene_names
from fg_mujoco.racing.planners import controller_names
from fg_mujoco.simulation.settings import FASTEST

from .comparison.comparison import DEFAULT_SEEDS, Comparison, compare


def add_compare(add_command: Callable[..., argparse.ArgumentParser], commands: Any) -> None:
    """Add the command; `add_command` is the one that adds the others."""
    text = "drive every controller on every course with every seed, and make a table of how they fared"
    command = add_command(commands, "compare", _compare, text)
    add = command.add_argument
    add(
        "--controller", type=names_in, metavar="LIST",
        help="NAME, path/to/file.py:ClassName or a policy's file, with settings as gap_finder[lookahead=8], comma "
        "between two; default: all bundled ones",
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
        command, "laps", "obstacles", "moving", "patches", *own, "lidar", "motion_distortion", "opponents", "grid",
        "rules", "time_limit", "decision_limit", laps="on tracks; default: 5",
        obstacles="boxes on each track, at places drawn from the seed; default: 0",
        moving=f"what moves on each track, at places drawn from the seed: {', '.join(KINDS)}; default: nothing",
    )  # fmt: skip
    add_study_options(command, "tables, pictures and finished runs")


def _compare(options: argparse.Namespace) -> int:
    base = setup_of(options, lists=("controller", "track", "seed", "max_speed"))
    return drive_study(
        compare,
        Comparison,
        options,
        options.controller or controller_names(),
        track=options.track or [f"{PREFIX}{name}" for name in scene_names()],
        max_speed=options.max_speed or FASTEST,
        setup=base,
        failed=lambda figures: figures.end_reason == "worker_died",
    )
