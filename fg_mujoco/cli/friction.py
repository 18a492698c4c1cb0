"""The command `fg-mujoco friction`: the friction lab.

Exit codes: 0 everything was measured, whatever came out; 1 a cell failed; 2 input that cannot be used; 130 Ctrl-C.
Cells that are finished then stay in the folder of `--out`, and the same command goes on with the others.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Callable
from typing import Any

from ..errors import EngineError, SettingsError
from ..lab.experiment import ON_CIRCLES, LabSettings
from ..lab.lab import EXPERIMENTS, LabProgress, run_lab
from .options import can_draw, number, whole
from .out import STUDY, add_out_options
from .progress import shown_as, to_go

_DONE, _NOT_DONE = 0, 1
_ALL = "all"


def add_friction(add_command: Callable[..., argparse.ArgumentParser], commands: Any) -> None:
    """Add the command; `add_command` is the one that adds the others."""
    text = "measure how far the speed law and the tires hold, and write the report"
    command = add_command(commands, "friction", _friction, text)
    add = command.add_argument
    names = (*EXPERIMENTS, _ALL)
    add("experiment", metavar="EXPERIMENT", choices=names, help=", ".join(names))
    add_out_options(
        command,
        STUDY,
        "report.html, CSVs, figures and finished cells; the same command goes on with a folder left unfinished, "
        "and other experiments may be added to it; default: the results are printed",
    )  # fmt: skip
    add("--workers", type=whole, metavar="N", help="processes; default: as many as there are cores")
    add("--quick", action="store_true", help="a small part of each experiment, for a first look")
    add("--seed", type=whole, default=0, metavar="N", help="of whatever is drawn; default: 0")
    add("--mu", type=_numbers, metavar="LIST", help="friction coefficients of skidpad, a comma between two")
    add("--steering", type=_numbers, metavar="LIST", help="steering angles of skidpad [rad]")
    add(
        "--redraw", action="store_true",
        help="measure nothing: write the report of DIR anew, from cells that other sources may have measured",
    )  # fmt: skip


def _friction(options: argparse.Namespace) -> int:
    names = list(EXPERIMENTS) if options.experiment == _ALL else [options.experiment]
    for option, values in (("--mu", options.mu), ("--steering", options.steering)):
        if values is not None and ON_CIRCLES not in names:
            raise SettingsError(f"{option} with {options.experiment}; accepted: with {ON_CIRCLES}, or all")
    settings = LabSettings(quick=options.quick, seed=options.seed, mus=options.mu, steerings=options.steering)
    with contextlib.redirect_stdout(sys.stderr), shown_as(_progress, "preparing cells") as watch:
        try:
            result = run_lab(
                names,
                out=options.out,
                workers=options.workers,
                settings=settings,
                pictures=options.out is not None and can_draw("figures"),
                redraw=options.redraw,
                watch=watch,
            )
        except EngineError as error:
            kept = "nothing is kept without --out" if options.out is None else "finished cells are kept"
            print("fg-mujoco:", *f"{error}; {kept}".split(), file=sys.stderr)
            return _NOT_DONE
        except KeyboardInterrupt:
            goes_on = "nothing is kept without --out" if options.out is None else "the same command goes on"
            print(f"fg-mujoco: {options.out or 'friction'}: interrupted; {goes_on}", file=sys.stderr)
            raise
    print(result.text())
    if result.folder is not None:
        found = result.cells - result.cells_measured
        earlier = f", {found} of them by an earlier call" if found else ""
        print(f"\n{result.cells} cells{earlier}; written to {result.folder / 'report.html'}")
    return _DONE


def _numbers(text: str) -> tuple[float, ...]:
    return tuple(number(part.strip()) for part in text.split(","))


def _progress(progress: LabProgress) -> str:
    done = progress.cells_found + progress.cells_measured
    return f"{done}/{progress.cells} cells{to_go(progress.remaining_s)}"
