"""The command `fg-mujoco raceline`: the fastest line of a circuit for a car, as a file that planners follow."""

from __future__ import annotations

import argparse
from pathlib import Path

from fg_mujoco.cli.command import FORCE, command, number, option, require_ending
from fg_mujoco.cli.options import NAMES, setup_of, setup_options
from fg_mujoco.cli.out import course_files, given, require_new
from fg_mujoco.course.writing import writing
from fg_mujoco.pictures.pages.figure_kit import require_matplotlib

from .racelines.raceline import MARGIN, OBJECTIVES, make_raceline


@command(
    option("track", "NAME, random:SEED[:tight], file.csv with widths, or map.yaml", "TRACK", names=NAMES["track"]),
    option(
        "--objective", "time: the least lap time, the default; curvature: the least curvature", "NAME",
        default=OBJECTIVES[0], choices=OBJECTIVES,
    ),
    option(
        "--margin", f"between the car's outline and walls and obstacles [m]; default: {MARGIN:g}", "M", number, MARGIN
    ),
    setup_options(
        "vehicle", "tires", "mu", "floor", "max_speed", "obstacles", "obstacle_seed",
        max_speed="fastest that the car is driven [m/s]; default: 8",
        obstacles="boxes on the track, which the line avoids; default: 0",
    ),
    option("--out", "the line, as pure_pursuit[line=FILE.csv] takes it; default: none", "FILE.csv", Path),
    option("--picture", "the line coloured by speed, and its g-g diagram", "FILE.png", Path),
    FORCE,
)  # fmt: skip
def raceline_command(options: argparse.Namespace) -> int:
    """The fastest line of a circuit for a car, with its speeds."""
    for path, ending in ((options.out, ".csv"), (options.picture, ".png")):
        if path is not None:
            require_ending(path, ending, what="this file")
            read = [*given(options, "out", "picture"), *course_files(options.track)]
            require_new(path, force=options.force, reads=read)
    if options.picture is not None:
        require_matplotlib()
    line = make_raceline(setup_of(options), objective=options.objective, margin=options.margin)
    print(line.summary())
    if options.out is not None:
        with writing(options.out):
            line.write(options.out)
        print(f"line: {options.out}; drive it with --controller 'pure_pursuit[line={options.out}]'")
    if options.picture is not None:
        from .racelines.raceline_picture import raceline_picture

        with writing(options.picture):
            raceline_picture(line, options.picture)
        print(f"picture: {options.picture}")
    return 0
