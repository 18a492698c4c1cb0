"""The command `fg-mujoco friction`: the friction lab.

Exit codes: 0 everything was measured, whatever came out; 1 a cell failed; 2 input that cannot be used; 130 Ctrl-C.
Cells that are finished then stay in the folder of `--out`, and the same command goes on with the others.
"""

from __future__ import annotations

import argparse

from ..errors import SettingsError
from ..lab.experiment import ON_CIRCLES, LabSettings
from ..lab.lab import EXPERIMENTS, LabProgress, run_lab
from .command import WORKERS, can_draw, command, numbers_in, option, whole
from .out import STUDY, out_options
from .progress import study

_ALL = "all"


def _experiment(parser: argparse.ArgumentParser) -> None:
    names = (*EXPERIMENTS, _ALL)
    parser.add_argument("experiment", metavar="EXPERIMENT", choices=names, help=", ".join(names))


@command(
    _experiment,
    out_options(
        STUDY, "report.html, CSVs, figures and finished cells; the same command continues an unfinished folder, and "
        "other experiments may be added; default: the results are printed",
    ),
    WORKERS,
    option("--quick", "a small part of each experiment, for a first look"),
    option("--seed", "seed of all random values; default: 0", "N", whole, 0),
    option("--mu", "friction coefficients of skidpad, a comma between two", "LIST", numbers_in),
    option("--steering", "steering angles of skidpad [rad]", "LIST", numbers_in),
    option(
        "--redraw", "write the report of DIR again without measuring; other versions may have measured its cells"
    ),
)  # fmt: skip
def friction_command(options: argparse.Namespace) -> int:
    """Measure how far the speed law and the tires hold, and write the report."""
    names = list(EXPERIMENTS) if options.experiment == _ALL else [options.experiment]
    for name, values in (("mu", options.mu), ("steering", options.steering)):
        if values is not None and ON_CIRCLES not in names:
            raise SettingsError(f"--{name} with {options.experiment}; accepted: with {ON_CIRCLES}, or all")
    settings = LabSettings(quick=options.quick, seed=options.seed, mus=options.mu, steerings=options.steering)
    with study(options, "cells", _progress) as watch:
        result = run_lab(
            names, out=options.out, workers=options.workers, settings=settings, redraw=options.redraw, watch=watch,
            pictures=options.out is not None and can_draw("figures"),
        )  # fmt: skip
    print(result.text())
    if result.folder is not None:
        found = result.cells - result.cells_measured
        earlier = f", {found} of them by an earlier call" if found else ""
        print(f"\n{result.cells} cells{earlier}; written to {result.folder / 'report.html'}")
    return 0


def _progress(progress: LabProgress) -> tuple[int, int, float | None]:
    return progress.cells_found + progress.cells_measured, progress.cells, progress.remaining_s
