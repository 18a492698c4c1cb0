"""The command `fg-mujoco map`: a planner drives laps of a course, and what it saw becomes a map to race on."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fg_mujoco.cli.config import add_config
from fg_mujoco.cli.options import CAR, add_setup_options, number, setup_of
from fg_mujoco.cli.out import require_new
from fg_mujoco.cli.progress import ProgressLine
from fg_mujoco.cli.race import RaceWatch
from fg_mujoco.course.maps.map_server import RESOLUTION, require_maps_extra
from fg_mujoco.errors import SettingsError
from fg_mujoco.racing.resolved import ground_of

_LAPS = 2
_DONE, _NOT_DONE = 0, 1


def add_map(add_command: Callable[..., argparse.ArgumentParser], commands: Any) -> None:
    """Add the command; `add_command` is the one that adds the others."""
    command = add_command(commands, "map", _map, "drive a planner, and make a map and a pose graph of what it saw")
    add = command.add_argument
    add("name", metavar="TRACK", nargs="?", help="as --track of race takes it; default: oval")
    add_setup_options(
        command, "controller", "laps", *CAR, "motion_distortion", "seed", "time_limit",
        laps=f"that are driven; default: {_LAPS}",
    )  # fmt: skip
    add("--out", metavar="FILE", type=Path, help="my_map writes my_map.yaml, my_map.png and my_map.g2o; default: none")
    add("--resolution", type=number, default=RESOLUTION, metavar="M", help=f"of the cells; default: {RESOLUTION}")
    add("--force", action="store_true", help="replace files that exist")
    add_config(command)


def _map(options: argparse.Namespace) -> int:
    from .mapping.driven_map import driven_files, map_course, write_driven

    require_maps_extra()
    files = () if options.out is None else driven_files(options.out)
    for file in files:
        require_new(file, force=options.force)
    setup = setup_of(options)
    if len(setup.entries) > 1:
        raise SettingsError(f"{len(setup.entries)} cars; accepted: one, which maps the course")
    if options.name is not None:
        setup = setup.replace(track=options.name)
    if not hasattr(options, "laps") and setup.laps is None and ground_of(setup).course.closed:
        setup = setup.replace(laps=_LAPS)
    with contextlib.redirect_stdout(sys.stderr), RaceWatch(show=True) as watch, ProgressLine("matching scans") as line:

        def watch_scans(count: int, total: int) -> None:
            if line.due:
                line.write(f"scan {count}/{total}")

        driven = map_course(setup, resolution=options.resolution, watch=watch, watch_scans=watch_scans)
    car, made = driven.race.car, driven.made
    rows, columns = made.cells.shape
    size = f"{columns * made.resolution:.1f} x {rows * made.resolution:.1f} m"
    print(f"{size}, {car.laps_completed} laps by {setup.first.controller}, {car.end_reason}; {made.text}")
    print(driven.table())
    if files:
        write_driven(driven, files[0], f"made by: fg-mujoco map {setup.track}")
        print(f"written to {', '.join(map(str, files))}")
        print(f"fg-mujoco race --track {files[0]} --controller 'pure_pursuit[pose=particle_filter]' races on it")
    return _DONE if car.finished else _NOT_DONE
