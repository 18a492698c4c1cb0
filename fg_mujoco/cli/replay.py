"""The command `fg-mujoco replay`."""

from __future__ import annotations

import argparse

from ..racing.replay import decisions_again, replay
from .command import ASKED, command, option


@command(option("folder", "written by race --out", "DIR"), ASKED)
def replay_command(options: argparse.Namespace) -> int:
    """Simulate a run folder again and compare it bit for bit."""
    report = replay(options.folder)
    asks = options.controller is not None and report.first_difference is None
    again = decisions_again(options.folder, options.controller) if asks else ""
    print(f"{options.folder}: {report}", *(f"  {line}" for line in (*report.lines, again) if line), sep="\n")
    return 0 if report.holds else 1
