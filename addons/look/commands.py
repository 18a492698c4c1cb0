"""The commands `report`, `debug` and `view`: pages of a run, its decisions one by one, and a race as it goes."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from fg_mujoco.cli.command import ASKED, CONFIG, FORCE, command, number, option, require_ending, whole
from fg_mujoco.cli.options import setup_of, setup_options
from fg_mujoco.cli.out import PAGE, require_new
from fg_mujoco.cli.progress import ProgressLine, to_go
from fg_mujoco.errors import MissingExtraError, SettingsError
from fg_mujoco.pictures.pages.page import is_page
from fg_mujoco.racing.run_folder import read_summary

DEBUG_PAGE = "debug.html"
"""Name of the page of decisions in a run folder."""

_USUAL_CLIP = 8.0  # [s]


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


@command(
    option("folder", "written by race --out", "DIR"),
    option("--out", f"default: DIR/{PAGE}", "FILE.html", Path),
    option("--clip", "of video in the page of a run [s]; default: 8", "S", number, _USUAL_CLIP),
    option("--no-clip", "without video"),
    FORCE,
)
def report_command(options: argparse.Namespace) -> int:
    """Write the page of a run folder, with plots to zoom into, without network."""
    from .report import write_report

    if not 0.0 < options.clip <= 600.0:
        raise SettingsError(f"--clip is {options.clip:g}; accepted: seconds above 0, at most 600")
    began = time.perf_counter()
    with ProgressLine("preparing pages") as line:

        def watch(done: int, of: int, what: str) -> None:
            if line.due:
                left = (time.perf_counter() - began) / max(done, 1) * (of - done)
                line.write(f"{what} {done}/{of}{to_go(left)}")

        path = options.out or Path(options.folder) / PAGE
        _check_page(path, options)
        page = write_report(options.folder, path, clip_seconds=None if options.no_clip else options.clip, watch=watch)
    print(f"{page}: {page.stat().st_size / 1e6:.1f} MB")
    return 0


@command(
    option("folder", "written by race --out", "DIR"),
    option("--at", "time in the run that the page opens at; default: its end, or crash", "S", number),
    option("--window", "of decisions in the page, round --at [s]; default: 3", "S", number, 3.0),
    option("--out", f"default: DIR/{DEBUG_PAGE}", "FILE.html", Path),
    ASKED,
    FORCE,
)
def debug_command(options: argparse.Namespace) -> int:
    """Write the page to step through a run's decisions: scan, what the planner made of it, command and why."""
    from .debug import debug

    path = options.out or Path(options.folder) / DEBUG_PAGE
    _check_page(path, options)
    seen = debug(options.folder, at=options.at, window=options.window, controller=options.controller)
    for note in seen.notes:
        print(f"fg-mujoco: {note}", file=sys.stderr)
    seen.write_page(path)
    first, last = seen.decisions[0], seen.decisions[-1]
    print(
        f"{path}: {len(seen.decisions)} decisions from {first.time:.3f} to {last.time:.3f} s, "
        f"{path.stat().st_size / 1e6:.1f} MB"
    )
    chosen = seen.chosen
    if chosen.failure:
        print(f"at {chosen.time:.3f} s the planner failed: {chosen.failure.splitlines()[0]}")
    else:
        print(f"at {chosen.time:.3f} s  speed           {chosen.why_speed}")
        print(f"{'':{len(f'at {chosen.time:.3f} s')}}  steering angle  {chosen.why_steering}")
    return 0


def _check_page(path: Path, options: argparse.Namespace) -> None:
    """Refuse a file that is no page of ours; one that is made of the run alone, in its folder, is replaced."""
    require_ending(path, ".html", ".htm", what="a page")
    read_summary(options.folder)  # a folder that is no run's is refused before all else
    require_new(path, force=options.force or (options.out is None and is_page(path)), reads=[options.folder])


@command(
    setup_options(but=("laps", "lidar", "motion_distortion", "rules", "time_limit", "decision_limit")),
    option("--web", "serve the view to a browser; without it, a window is opened"),
    option("--host", "with --web: listen there; default: 127.0.0.1, this machine alone", "ADDRESS"),
    option("--port", "with --web; default: 8080", "N", whole),
    option("--no-wait", "with --web: start at once, without waiting for a browser"),
    CONFIG,
)
def view_command(options: argparse.Namespace) -> int:
    """Watch a race as it goes, turn its knobs, and drive by keys."""
    from .live.browser import HOST, PORT, LiveView, check_port, require_viser
    from .live.desktop import require_display, run_desktop
    from .live.live_session import LiveSession

    setup = setup_of(options)
    host, port = options.host or HOST, PORT if options.port is None else options.port
    if options.web:
        require_viser()
        check_port(host, port)  # before the world is built
    elif options.host is not None or options.port is not None or options.no_wait:
        raise SettingsError("--host, --port and --no-wait are of a browser; accepted: with --web")
    else:
        require_display()
    session = LiveSession(setup)
    if not options.web:
        run_desktop(session)
        return 0
    with LiveView(session, host=host, port=port) as view:
        try:
            waits = "" if options.no_wait else "; the race starts when a browser opens it (--no-wait: at once)"
            print(f"{view.url}{waits}; Ctrl-C ends it", flush=True)
            view.run(wait=not options.no_wait)
        except KeyboardInterrupt:
            print(file=sys.stderr)
    return 0
