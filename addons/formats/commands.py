"""The command `fg-mujoco car`: a vehicle of the files of other stacks."""

from __future__ import annotations

import argparse
from pathlib import Path

from fg_mujoco.cli.command import FORCE, command, option
from fg_mujoco.cli.out import require_new
from fg_mujoco.errors import SettingsError

from .cars import car_of, write_car


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
    print(f"{car.files.name}:", *car.words, sep="\n  ")
    if options.out is not None:
        require_new(options.out / f"{car.files.name}.xml", force=options.force)
        try:
            written = write_car(car, options.out)
        except OSError as error:
            raise SettingsError(f"{options.out}: cannot be written: {error.strerror or error}") from error
        print("written:", *written)
    return 0
