"""The command `fg-mujoco track export`: a track as a ROS map, a centreline CSV or a mesh."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from ..course.formats import load_track, require_track
from ..course.maps.export import RESOLUTION, SUFFIXES, export_track, exported_files
from ..errors import SettingsError
from .options import number


def add_export(add: Any, commands: Any) -> None:
    """Add the command to those of `track`; `add` makes a command."""
    command = add(commands, "export", _export, "write a track as a map, a centreline CSV or a mesh of its walls")
    command.add_argument("track", metavar="TRACK", help="NAME, random:SEED, file.csv or map.yaml")
    command.add_argument(
        "files", metavar="FILE", nargs="+", type=Path, help=f"of each suffix what it says: {', '.join(SUFFIXES)}"
    )
    command.add_argument(
        "--resolution", type=number, default=RESOLUTION, metavar="M", help=f"of a map's pixels; default: {RESOLUTION}"
    )
    command.add_argument("--force", action="store_true", help="replace files that exist")


def _export(options: argparse.Namespace) -> int:
    for file in (file for path in options.files for file in exported_files(path)):
        if file.exists() and not options.force:
            raise SettingsError(f"{file}: exists; accepted: a new file, or --force to replace it")
    track = require_track(load_track(options.track), "a file")
    for path in options.files:
        print(*export_track(track, path, resolution=options.resolution), sep="\n")
    return 0
