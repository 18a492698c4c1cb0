"""The part of `fg-mujoco validate` that compares recorded LiDAR beams with those cast in a map: `--beams`."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fg_mujoco.cli.out import require_new
from fg_mujoco.cli.progress import shown_as
from fg_mujoco.course.writing import write_file
from fg_mujoco.errors import SettingsError


def add_beam_options(add: Callable[..., Any]) -> None:
    """Add the options of the comparison; `add` adds an option to a command."""
    add("--beams", action="store_true", help="compare the recorded beams of the LiDAR with those cast in --map")
    add("--map", type=Path, metavar="MAP.yaml", help="the ROS map in whose frame the poses are; with --beams")
    add(
        "--effects", type=Path, metavar="FILE.toml",
        help="write noise, bias and dropouts of the LiDAR, as --lidar-effects reads them; with --beams",
    )  # fmt: skip


def validate_beams(options: argparse.Namespace) -> str:
    """Compare the beams of `options.drives` with the map, and return the tables as a text.

    Raises:
      SettingsError: no map, a drive without beams or poses, or one that was not driven in the map.
      TrackError: a map that cannot be read.
    """
    from fg_mujoco.addons.realcar.drives.wall_rays import MapWalls

    from .drives.beam_comparison import compare_beams
    from .drives.beam_text import comparison_text
    from .drives.reading import read_drive
    from .drives.recorded_beams import RecordedBeams

    if options.map is None:
        raise SettingsError("--beams without --map; accepted: the map_server YAML in whose frame the poses are")
    if options.effects is not None:
        require_new(options.effects, force=options.force)
    walls = MapWalls.of(options.map)
    with shown_as(str, "reading drives") as watch:
        recorded: list[RecordedBeams] = []
        for number, source in enumerate(options.drives, start=1):
            watch(f"reading {number} of {len(options.drives)} drives")
            recorded += map(RecordedBeams.of, read_drive(source, columns=options.columns).parts())
        found = compare_beams(recorded, walls, map_name=options.map.stem, watch=watch)
    text = comparison_text(found)
    if options.effects is not None:
        write_file(options.effects, found.errors.toml.encode())
        text += f"\nwritten to {options.effects}, for --lidar-effects\n"
    return text
