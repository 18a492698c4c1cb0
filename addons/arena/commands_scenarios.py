"""The command `fg-mujoco scenarios`; its exit codes are those of `drive_study`."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

from fg_mujoco.cli.drive_study import add_study_options, drive_study
from fg_mujoco.cli.options import add_setup_options, names_in, setup_of, whole

from .commands_overtake import DRIVE
from .overtaking.scenario_suite import SuiteResult, drive_suite


def add_scenarios(add_command: Callable[..., argparse.ArgumentParser], commands: Any) -> None:
    """Add the command; `add_command` is the one that adds the others."""
    text = "drive a planner through a suite of overtaking scenarios that a file defines"
    command = add_command(commands, "scenarios", _scenarios, text)
    add = command.add_argument
    add("suite", metavar="SUITE.toml", help="the scenarios, such as examples/scenarios/overtaking.toml")
    add(
        "--controller", type=names_in, default=["overtaker"], metavar="LIST",
        help="NAME, path/to/file.py:ClassName or a policy's file, with settings in brackets, comma between two; "
        "default: overtaker",
    )  # fmt: skip
    add("--data", metavar="DIR", help="folder that tracks which are paths begin in; default: the present one")
    add("--every", type=whole, default=1, metavar="N", help="drive only one in N, drawn by lot; default: 1")
    add_setup_options(command, *DRIVE)
    add_study_options(command, "tables and finished scenarios")


def _scenarios(options: argparse.Namespace) -> int:
    setup = setup_of(options, lists=("controller",))
    return drive_study(
        lambda controllers, **given: drive_suite(options.suite, controllers, **given),
        SuiteResult,
        options,
        options.controller,
        setup=setup,
        failed=lambda figures: figures.outcome == "failed",
        pictures=False,
        data=options.data,
        every=options.every,
    )
