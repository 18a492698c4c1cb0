"""The command `fg-mujoco debug`: a page to step through a run's decisions, or one of them as a picture."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fg_mujoco.cli.options import add_trust_option, number
from fg_mujoco.errors import SettingsError

PAGE = "debug.html"
"""Name of the page in a run folder."""

_DONE = 0


def add_debug(add_command: Callable[..., argparse.ArgumentParser], commands: Any) -> None:
    """Add the command; `add_command` is the one that adds the others."""
    text = (
        "write the page to step through a run's decisions: the scan, what the planner made of it, the command and why"
    )
    add = add_command(commands, "debug", _debug, text).add_argument
    add("folder", metavar="DIR", help="written by race --out")
    add("--at", type=number, metavar="S", help="time in the run that the page opens at; default: its end, or crash")
    add("--window", type=number, default=3.0, metavar="S", help="of decisions in the page, round --at; default: 3")
    add("--out", type=Path, metavar="FILE.html", help=f"default: DIR/{PAGE}")
    add("--picture", type=Path, metavar="FILE.png", help="draw the decision at --at; no page is written without --out")
    add_trust_option(add)


def _debug(options: argparse.Namespace) -> int:
    from fg_mujoco.pictures.pages.figure_kit import require_matplotlib

    from .debug import debug

    path, picture = options.out, options.picture
    if path is None and picture is None:
        path = Path(options.folder) / PAGE
    if path is not None and path.suffix.lower() not in (".html", ".htm"):
        raise SettingsError(f"{path}: is no name for a page; accepted: one that ends in .html")
    if picture is not None:
        if picture.suffix.lower() != ".png":
            raise SettingsError(f"{picture}: is no name for a picture; accepted: one that ends in .png")
        require_matplotlib()
    seen = debug(options.folder, at=options.at, window=options.window, trust=options.trust)
    for note in seen.notes:
        print(f"fg-mujoco: {note}", file=sys.stderr)
    if path is not None:
        seen.write_page(path)
        first, last = seen.decisions[0], seen.decisions[-1]
        print(
            f"{path}: {len(seen.decisions)} decisions from {first.time:.3f} to {last.time:.3f} s, "
            f"{path.stat().st_size / 1e6:.1f} MB"
        )
    if picture is not None:
        seen.write_picture(picture)
        print(f"{picture}: the decision at {seen.chosen.time:.3f} s")
    chosen = seen.chosen
    if chosen.failure:
        print(f"at {chosen.time:.3f} s the planner failed: {chosen.failure.splitlines()[0]}")
    else:
        print(f"at {chosen.time:.3f} s  speed           {chosen.why_speed}")
        print(f"{'':{len(f'at {chosen.time:.3f} s')}}  steering angle  {chosen.why_steering}")
    return _DONE
