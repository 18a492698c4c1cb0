"""The command `fg-mujoco raceline`: the fastest line of a circuit for a car, as a file that planners follow."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fg_mujoco.cli.options import add_setup_options, number, setup_of
from fg_mujoco.cli.out import require_new
from fg_mujoco.errors import SettingsError

_DONE = 0
_SETTINGS = ("vehicle", "tires", "mu", "floor", "max_speed", "obstacles", "obstacle_seed")


def add_raceline(add_command: Callable[..., argparse.ArgumentParser], commands: Any) -> None:
    """Add the command; `add_command` is the one that adds the others."""
    from .racelines.raceline import MARGIN, OBJECTIVES

    command = add_command(commands, "raceline", _raceline, "the fastest line of a circuit for a car, with its speeds")
    add = command.add_argument
    add("track", metavar="TRACK", help="NAME, random:SEED[:tight], file.csv with widths, or map.yaml")
    add(
        "--objective", default=OBJECTIVES[0], choices=OBJECTIVES, metavar="NAME",
        help="time: the least lap time, the default; curvature: the least curvature",
    )  # fmt: skip
    add(
        "--margin", type=number, default=MARGIN, metavar="M",
        help=f"between the car's outline and walls and obstacles; default: {MARGIN:g}",
    )  # fmt: skip
    add_setup_options(
        command, *_SETTINGS, max_speed="fastest that the car is driven [m/s]; default: 8",
        obstacles="boxes on the track, which the line passes; default: 0",
    )  # fmt: skip
    add("--out", type=Path, metavar="FILE.csv", help="the line, as pure_pursuit[line=FILE.csv] takes it; default: none")
    add("--picture", type=Path, metavar="FILE.png", help="the line coloured by speed, and its g-g diagram")
    add("--force", action="store_true", help="replace files that exist")


def _raceline(options: argparse.Namespace) -> int:
    from fg_mujoco.pictures.pages.figure_kit import require_matplotlib

    from .racelines.raceline import make_raceline

    for path, ending in ((options.out, ".csv"), (options.picture, ".png")):
        if path is not None:
            if path.suffix.lower() != ending:
                raise SettingsError(f"{path}: is no name for this file; accepted: one that ends in {ending}")
            require_new(path, force=options.force)
    if options.picture is not None:
        require_matplotlib()
    line = make_raceline(setup_of(options), objective=options.objective, margin=options.margin)
    print(line.summary())
    try:
        if options.out is not None:
            line.write(options.out)
            print(f"line: {options.out}; drive it with --controller 'pure_pursuit[line={options.out}]'")
        if options.picture is not None:
            from .racelines.raceline_picture import raceline_picture

            raceline_picture(line, options.picture)
            print(f"picture: {options.picture}")
    except OSError as error:
        raise SettingsError(f"{error.filename}: cannot be written: {error.strerror or error}") from error
    return _DONE
