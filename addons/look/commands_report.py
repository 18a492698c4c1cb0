"""The command `fg-mujoco report`, and what `race --out` does: a page of a run folder, or pages of a comparison."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fg_mujoco.cli.options import add_trust_option, number
from fg_mujoco.cli.out import PAGE
from fg_mujoco.cli.progress import ProgressLine, to_go
from fg_mujoco.errors import MissingExtraError, SettingsError
from fg_mujoco.registry import PARTS

_DONE = 0
_USUAL_CLIP = 8.0  # [s]


def add_report(add_command: Callable[..., argparse.ArgumentParser], commands: Any) -> None:
    """Add the command; `add_command` is the one that adds the others."""
    text = "write the page of a run folder, or the pages of what compare left: plots to zoom into, without network"
    add = add_command(commands, "report", _report, text).add_argument
    add("folder", metavar="DIR", help="written by race --out or by compare --out")
    add("--out", type=Path, metavar="FILE.html", help=f"of a run; default: DIR/{PAGE}; of a comparison: DIR/report/")
    add("--clip", type=number, default=_USUAL_CLIP, metavar="S", help="of video in the page of a run; default: 8")
    add("--no-clip", action="store_true", help="without video")
    add_trust_option(add)


def report_race(folder: str | Path) -> None:
    """Write the report of a race into its run folder, without video, where there is what it takes; else say how."""
    from fg_mujoco.pictures.pages.bokeh_plots import require_bokeh

    from .report import write_report

    try:
        require_bokeh()
    except MissingExtraError as error:
        print(f"fg-mujoco: {PAGE} is left out; {error}", file=sys.stderr)
        return
    write_report(folder, Path(folder) / PAGE, clip_seconds=None)


def _report(options: argparse.Namespace) -> int:

    from .report import write_report

    if not 0.0 < options.clip <= 600.0:
        raise SettingsError(f"--clip is {options.clip:g}; accepted: seconds above 0, at most 600")
    began = time.perf_counter()
    with ProgressLine("preparing pages") as line:

        def watch(done: int, of: int, what: str) -> None:
            if line.due:
                left = (time.perf_counter() - began) / max(done, 1) * (of - done)
                line.write(f"{what} {done}/{of}{to_go(left)}")

        if "is comparison" in PARTS and PARTS.find("is comparison")(options.folder):
            if options.out is not None:
                raise SettingsError("--out is of the page of a run; accepted: without, pages go to DIR/report/")
            write = PARTS.find("comparison report")
            page, pages = write(options.folder, watch, trust=options.trust), "and a page for each run"
        else:
            path = options.out or Path(options.folder) / PAGE
            if path.suffix.lower() not in (".html", ".htm"):
                raise SettingsError(f"{path}: is no name for a page; accepted: one that ends in .html")
            clip = None if options.no_clip else options.clip
            page, pages = write_report(options.folder, path, clip_seconds=clip, watch=watch), ""
    print(f"{page}: {page.stat().st_size / 1e6:.1f} MB{', ' + pages if pages else ''}")
    return _DONE
