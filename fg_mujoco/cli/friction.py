"""The command `fg-mujoco friction`: the friction lab.

Exit codes: 0 everything was measured, whatever came out; 1 a cell failed; 2 input that cannot be used; 130 Ctrl-C.
Cells that are finished then stay in the folder of `--out`, and the same command goes on with the others.
"""

from __future__ import annotations

import argparse
import shlex
from typing import Any

import numpy as np

from ..errors import SettingsError
from ..lab.experiment import LabSettings
from ..lab.lab import EXPERIMENTS, LabProgress, load_experiment, run_lab
from ..lab.speed_laws import DEFAULT_LAW, LAWS
from .command import WORKERS, can_draw, command, number, numbers_in, option, whole
from .options import NAMES, setup_of, setup_options
from .out import STUDY, out_options
from .progress import study

_ALL = "all"
_POINTS = 4  # of a range
_MOST_POINTS = 1000
_ONLY = ("law", "steering", "mu", "tires", "floor", "planner_mu", "track", "laps", "controller", "assist")
"""Options that some of the experiments take: those that use them."""


def _range(text: str) -> tuple[float, ...]:
    """Read `.3,.5`, or `.3:1.05`, which is four even values, or `.3:1.05:6`."""
    if ":" not in text:
        return numbers_in(text)
    low, _, rest = text.partition(":")
    high, _, count = rest.partition(":")
    first, last, points = number(low), number(high), whole(count) if count else _POINTS
    if not (first < last and 2 <= points <= _MOST_POINTS):
        raise argparse.ArgumentTypeError(f"{text!r}; accepted: LOW:HIGH or LOW:HIGH:COUNT, LOW below HIGH")
    return tuple(round(value, 4) for value in np.linspace(first, last, points).tolist())


def _experiment(parser: argparse.ArgumentParser) -> None:
    names = (*EXPERIMENTS, _ALL)
    parser.add_argument("experiment", metavar="EXPERIMENT", choices=names, help=", ".join(names))


@command(
    _experiment,
    option(
        "--law", f"speed law: {{names}}, or path/to/file.py:NAME of a function (steering_angle, odometry, car, mu); "
        f"default: {DEFAULT_LAW}", "LAW", names=LAWS.names,
    ),
    option(
        "--mu", "friction of the tires, or their greatest peak: values with commas, or LOW:HIGH or LOW:HIGH:COUNT; "
        "default: as published", "LIST", _range, title="floor",
    ),
    option("--planner-mu", "of mismatch: friction that the planner is told, likewise", "LIST", _range, title="floor"),
    option(
        "--steering", "steering angles [rad], likewise; default: 0.05,0.1,0.2,0.3,0.4; of ground 0.1", "LIST", _range,
    ),
    option("--track", "of laps and mismatch, several may be given", "TRACK", names=NAMES["track"], action="append"),
    setup_options(
        "controller", "assist", "laps", "vehicle", "tires", "floor", "mass", "cog_height", "steering_gain",
        "speed_gain", "command_delay", laps="of laps and mismatch; default: 5 and 2",
    ),
    out_options(
        STUDY, "tables as CSV, figures as SVG and PDF, and finished cells; the same command continues an unfinished "
        "folder; default: the results are printed",
    ),
    WORKERS,
)  # fmt: skip
def friction_command(options: argparse.Namespace) -> int:
    """Measure up to where a speed law is safe on a car, and why not beyond."""
    names = list(EXPERIMENTS) if options.experiment == _ALL else [options.experiment]
    given = {name: getattr(options, name, None) for name in _ONLY}
    for name in (each for each in _ONLY if given[each] is not None):
        taking = (*(each for each in EXPERIMENTS if name in load_experiment(each).uses), _ALL)
        if options.experiment not in taking:
            said = f"--{name.replace('_', '-')} with {options.experiment}"
            raise SettingsError(f"{said}; accepted: with {', '.join(taking[:-1])}, or {_ALL}")
    tracks = tuple(given["track"]) if given["track"] else None
    settings = LabSettings(
        entry=setup_of(options, lists=("track", "mu", "planner_mu", "laps")).first, mus=options.mu,
        law=DEFAULT_LAW if options.law is None else options.law, planner_mus=given["planner_mu"],
        steerings=given["steering"], tracks=tracks, laps=given["laps"],
    )  # fmt: skip
    with study(options, "cells", _progress) as watch:
        result = run_lab(
            names, out=options.out, workers=options.workers, settings=settings, watch=watch,
            pictures=options.out is not None and can_draw("figures"), again=_again(options),
        )  # fmt: skip
    print(result.text())
    if result.folder is not None:
        found = result.cells - result.cells_measured
        earlier = f", {found} of them by an earlier call" if found else ""
        print(f"\n{result.cells} cells{earlier}; written to {result.folder}")
    return 0


def _again(options: argparse.Namespace) -> str:
    """Return the command with what it was given."""
    words = ["fg-mujoco", "friction", options.experiment]
    for action in options.command._actions:
        value = getattr(options, action.dest, None)
        if action.option_strings and value not in (None, False, action.default) and action.dest != "force":
            words += [word for each in _texts(value) for word in (action.option_strings[0], each)]
    return shlex.join(words)


def _texts(value: Any) -> list[str]:
    if isinstance(value, list):
        return list(map(str, value))
    return [",".join(f"{each:g}" for each in value) if isinstance(value, tuple) else str(value)]


def _progress(progress: LabProgress) -> tuple[int, int, float | None]:
    return progress.cells_found + progress.cells_measured, progress.cells, progress.remaining_s
