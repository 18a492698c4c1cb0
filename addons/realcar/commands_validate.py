"""The command `fg-mujoco validate`: how well a car, its tires and other simulators agree with recorded drives."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fg_mujoco.cli.options import add_setup_options, setup_of, whole
from fg_mujoco.cli.out import require_new
from fg_mujoco.cli.progress import shown_as
from fg_mujoco.course.writing import write_file
from fg_mujoco.errors import SettingsError
from fg_mujoco.pictures.pages.page import writing
from fg_mujoco.pictures.pages.table import Table

from .commands_validate_beams import add_beam_options, validate_beams

_DONE = 0


def add_validate(add_command: Callable[..., argparse.ArgumentParser], commands: Any) -> None:
    """Add the command; `add_command` is the one that adds the others."""
    text = "drive the recorded commands of a real car from its recorded states, and say how far a model is off"
    command = add_command(commands, "validate", _validate, text)
    add = command.add_argument
    add("drives", metavar="DRIVE", nargs="+", help="CSV files, folders of them, bags, or run folders")
    add_setup_options(command, "vehicle", "tires", "mu", "floor")
    add(
        "--columns", metavar="FILE.toml|LAYOUT",
        help="which columns of a CSV file are what; default: a layout that is recognised",
    )  # fmt: skip
    add("--scoreboard", action="store_true", help="every bundled set of tires on its car, the gym's model, ForzaETH's")
    add("--threads", type=whole, default=1, metavar="N", help="that drive the windows, same bits for any; default: 1")
    add("--report", type=Path, metavar="FILE.html", help="a page of overlays and residuals; default: none")
    add("--csv", type=Path, metavar="FILE.csv", help="all figures, a row each; default: none")
    add_beam_options(add)
    add("--force", action="store_true", help="replace files that exist")


def _validate(options: argparse.Namespace) -> int:
    from fg_mujoco.messages import require_whole
    from fg_mujoco.pictures.pages.bokeh_plots import require_bokeh

    from .validation.scoreboard import scoreboard
    from .validation.validation import validate
    from .validation.validation_page import write_validation_page

    if options.beams:
        for name in ("scoreboard", "report", "csv"):
            if getattr(options, name):
                raise SettingsError(f"{name} is given with --beams; accepted: --beams with --map and --effects")
        print(validate_beams(options), end="")
        return _DONE
    for name in ("map", "effects"):
        if getattr(options, name) is not None:
            raise SettingsError(f"{name} is given without --beams; accepted: --beams --map MAP.yaml")
    require_whole("threads", options.threads, 1)
    for path, endings in ((options.report, (".html", ".htm")), (options.csv, (".csv",))):
        if path is not None:
            if path.suffix.lower() not in endings:
                raise SettingsError(f"{path}: is no name for it; accepted: one that ends in {endings[0]}")
            require_new(path, force=options.force)
    if options.report is not None:
        require_bokeh()
        if options.scoreboard:
            raise SettingsError("report with --scoreboard; accepted: the page of one vehicle on one set of tires")
    setup = setup_of(options).first
    if options.scoreboard and setup.tires is not None:
        raise SettingsError(f"tires is {setup.tires!r} with --scoreboard, which has every bundled set; accepted: none")
    with shown_as(str, "reading drives") as watch:
        given: dict[str, Any] = {
            "vehicle": setup.car, "mu": setup.set_mu, "columns": options.columns, "threads": options.threads,
            "watch": watch,
        }  # fmt: skip
        if options.scoreboard:
            board = scoreboard(options.drives, **given)
            first, text, rows = board.validations[0], str(board), board.rows
        else:
            first = validate(options.drives, tires=setup.tires, **given)
            text, rows = str(first), first.rows
    for name, checks in {drive.part_of or drive.name: drive.checks for drive in first.drives}.items():
        print(f"{name}: {checks}")
    print(f"\n{text}")
    if options.csv is not None:
        with writing(options.csv):
            write_file(options.csv, Table.of(rows).csv().encode())
        print(f"written to {options.csv}")
    if options.report is not None:
        print(f"report: {write_validation_page(first, options.report)}")
    return _DONE
