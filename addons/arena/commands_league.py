"""The command `fg-mujoco league`; its exit codes are those of `drive_study`."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fg_mujoco.cli.drive_study import add_study_options, drive_study, seeds_in
from fg_mujoco.cli.options import CAR, add_setup_options, names_in, setup_of, whole

from .league.league import DECISION_LIMIT, DEFAULT_RULES, DEFAULT_TRACKS, PAGE, League, league

_NOT_HERE = ("start_s", "start_offset", "start_heading", "start_speed")


def add_league(add_command: Callable[..., argparse.ArgumentParser], commands: Any) -> None:
    """Add the command; `add_command` is the one that adds the others."""
    text = "race planners against each other, each pair on each track from both places, and make a table with ratings"
    command = add_command(commands, "league", _league, text)
    add = command.add_argument
    add(
        "planners", nargs="*", metavar="PLANNER",
        help="NAME, path/to/file.py:ClassName, a policy's file or folder, or ros:path/to/node.py, with settings "
        "NAME[SETTING=VALUE,...]; none: the entries of --config, each with a car of its own",
    )  # fmt: skip
    add(
        "--track", type=names_in, default=DEFAULT_TRACKS, metavar="LIST",
        help=f"NAME, random:SEED[:tight], file.csv or map.yaml, comma between two; default: {','.join(DEFAULT_TRACKS)}",
    )  # fmt: skip
    add(
        "--seed", type=seeds_in, default=[0], metavar="LIST",
        help="numbers, or FIRST:END without END; of what sensors draw, each a heat of its own; default: 0",
    )  # fmt: skip
    add("--cars", type=whole, default=2, metavar="N", help="of a heat; default: 2")
    add("--keep-runs", action="store_true", help="write the run folder of each heat, as `replay` takes it, to DIR/runs")
    own = (name for name in CAR if name not in _NOT_HERE)
    add_setup_options(
        command, "laps", "obstacles", "obstacle_seed", "moving", "patches", *own, "lidar", "motion_distortion", "grid",
        "rules", "time_limit", "decision_limit", rules=f"of race control; default: {DEFAULT_RULES}",
        decision_limit=f"of wall time for each decision; default: {DECISION_LIMIT:g}",
    )  # fmt: skip
    add_study_options(command, f"tables, {PAGE}, a file for each heat, and finished heats")


def _league(options: argparse.Namespace) -> int:
    among = {name: getattr(options, name, None) for name in ("grid", "rules")}
    setup = setup_of(options, lists=("track", "seed", "grid", "rules"))
    code = drive_study(
        league,
        League,
        options,
        options.planners,
        track=options.track,
        cars=options.cars,
        keep_runs=options.keep_runs,
        setup=setup,
        failed=lambda figures: figures.trajectory_sha256 is None,
        pictures=False,
        **among,
    )
    if not options.json:
        print(f"page: {Path(options.out) / PAGE}")
    return code
