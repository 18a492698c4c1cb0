"""The command `fg-mujoco car`: a vehicle of the files of other stacks."""

from __future__ import annotations

import argparse
from pathlib import Path

from fg_mujoco.cli.command import FORCE, command, option
from fg_mujoco.cli.out import new_files
from fg_mujoco.course.writing import writing

from .cars import ENDINGS, car_of, write_car


@command(
    option(
        "files", "parameters of f1tenth_gym, vesc.yaml, a model of ForzaETH, a URDF, a folder of these or of SlipX",
        "FILE", Path, nargs="+",
    ),
    option("--out", "the folder of the vehicle, its tires and its page; default: none", "FOLDER", Path),
    FORCE,
)  # fmt: skip
def car_command(options: argparse.Namespace) -> int:
    """Make a vehicle of the files that other stacks have, and say what they do not tell."""
    car = car_of(options.files)
    written: list[Path] = []
    if options.out is not None:
        files = [options.out / f"{car.files.name}{ending}" for ending in ENDINGS]
        with new_files(options.out, *files, options=options), writing(options.out):
            written = write_car(car, options.out)
    print(f"{car.files.name}:", *car.words, sep="\n  ")
    if written:
        print("written:", *written)
    return 0
