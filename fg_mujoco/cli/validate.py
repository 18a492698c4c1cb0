"""The command `fg-mujoco validate`: recorded drives of a real car beside what is simulated."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

from ..errors import SettingsError
from .validate_beams import add_beam_options, validate_beams

_DONE = 0


def add_validate(add_command: Callable[..., argparse.ArgumentParser], commands: Any) -> None:
    """Add the command; `add_command` is the one that adds the others."""
    add = add_command(commands, "validate", _validate, "compare recorded drives with what is simulated").add_argument
    add("drives", metavar="DRIVE", nargs="+", help="run folders; .csv, .mcap, .db3 or .bag files, or folders of bags")
    add_beam_options(add)
    add(
        "--columns", metavar="FILE.toml|LAYOUT",
        help="which columns of a CSV file are what; default: a layout that is recognised",
    )  # fmt: skip
    add("--force", action="store_true", help="replace files that exist")


def _validate(options: argparse.Namespace) -> int:
    if not options.beams:
        raise SettingsError("validate without --beams; accepted: --beams --map MAP.yaml")
    print(validate_beams(options), end="")
    return _DONE
