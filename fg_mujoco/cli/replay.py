"""The command `fg-mujoco replay`: a run is simulated again, and compared bit for bit."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

from ..racing.replay import decisions_again, replay

_DONE, _NOT_DONE = 0, 1


def add_replay(add_command: Callable[..., argparse.ArgumentParser], commands: Any) -> None:
    """Add the command; `add_command` is the one that adds the others."""
    command = add_command(commands, "replay", _replay, "simulate a run folder again and compare it bit for bit")
    command.add_argument("folder", metavar="DIR", help="written by race --out")


def _replay(options: argparse.Namespace) -> int:
    report = replay(options.folder)
    again = decisions_again(options.folder) if report.first_difference is None else ""
    print(f"{options.folder}: {report}", *(f"  {line}" for line in (*report.lines, again) if line), sep="\n")
    return _DONE if report.holds else _NOT_DONE
