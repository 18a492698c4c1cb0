"""The command `fg-mujoco overtake`; its exit codes are those of `drive_study`."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

from fg_mujoco.cli.drive_study import add_study_options, drive_study, seeds_in
from fg_mujoco.cli.options import add_setup_options, names_in, number, setup_of
from fg_mujoco.simulation.settings import PLANNER_OPTIONS

from .overtaking.overtaking import DEFAULT_RATIO, DEFAULT_SEEDS, DEFAULT_TRACKS, Overtaking, overtake
from .overtaking.slower_opponents import OPPONENTS

DRIVE = (
    "vehicle", "tires", "mu", "floor", "planner_mu", "max_speed", "mass", "cog_height", "steering_gain", "speed_gain",
    "command_delay", *PLANNER_OPTIONS,
)  # fmt: skip


def add_overtake(add_command: Callable[..., argparse.ArgumentParser], commands: Any) -> None:
    """Add the command; `add_command` is the one that adds the others."""
    text = "drive a planner behind slower opponents, and make a table of how often it overtakes"
    command = add_command(commands, "overtake", _overtake, text)
    add = command.add_argument
    add(
        "--controller", type=names_in, default=["overtaker"], metavar="LIST",
        help="NAME, path/to/file.py:ClassName or a policy's file, with settings in brackets, comma between two; "
        "default: overtaker",
    )  # fmt: skip
    add(
        "--track", type=names_in, default=DEFAULT_TRACKS, metavar="LIST",
        help=f"NAME, random:SEED[:tight] or file.csv; default: {','.join(DEFAULT_TRACKS)}",
    )  # fmt: skip
    add(
        "--opponents", type=names_in, default=OPPONENTS, metavar="LIST",
        help=f"of {','.join(OPPONENTS)}; default: all",
    )  # fmt: skip
    add(
        "--speed-ratio", type=_ratio, default=DEFAULT_RATIO, metavar="LOW:HIGH",
        help="of the opponent to the planner's own speed at the same place; default: .3:.9",
    )  # fmt: skip
    add(
        "--seed", type=seeds_in, default=DEFAULT_SEEDS, metavar="LIST",
        help="numbers, or FIRST:END without END; of start, distance and speed ratio; default: 0:50",
    )  # fmt: skip
    add_setup_options(command, "laps", *DRIVE, laps="within which the planner is to overtake; default: 2")
    add_study_options(command, "table, picture and finished duels")


def _overtake(options: argparse.Namespace) -> int:
    setup = setup_of(options, lists=("controller", "track", "opponents", "seed"))
    return drive_study(
        overtake,
        Overtaking,
        options,
        options.controller,
        track=options.track,
        opponents=options.opponents,
        speed_ratio=options.speed_ratio,
        setup=setup,
        failed=lambda figures: figures.outcome == "failed",
    )


def _ratio(text: str) -> tuple[float, float]:
    """Read `.3:.9`."""
    low, colon, high = text.partition(":")
    if not colon:
        raise argparse.ArgumentTypeError(f"{text!r}; accepted: LOW:HIGH")
    return number(low), number(high)
