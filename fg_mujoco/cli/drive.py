"""The command `fg-mujoco drive`: a manoeuvre, or a CSV file of commands, on open ground, without a planner."""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import sys
from collections.abc import Callable

from ..errors import SettingsError
from ..lab.commands import COLUMNS
from ..lab.drive import drive
from ..lab.handling import handling
from ..lab.manoeuvres import MANOEUVRES
from ..pictures.plots import write_run
from ..racing.result import RaceResult, clamped_hint
from ..racing.run_folder import check_run_folder
from ..racing.summary import summary_json
from ..vehicle.tire_slip import share_text, sliding_text
from .command import CONFIG, JSON, can_draw, command, number, option
from .options import setup_of, setup_options
from .out import RUN, out_options, write_page, written_rows

_DONE, _NOT_DONE = 0, 1

_FIGURES: dict[str, tuple[str, Callable[[float], str]]] = {
    "max_lateral_acceleration_m_s2": ("lateral acceleration", lambda value: f"{value:.2f} m/s^2 at most"),
    "max_sideslip_rad": ("sideslip", lambda value: f"{value:.3f} rad at most, {math.degrees(value):.1f} deg"),
    "max_yaw_rate_rad_s": ("yaw rate", lambda value: f"{value:.2f} rad/s at most"),
    "understeer_gradient_rad_s2_m": ("understeer gradient", lambda value: f"{value:.5f} rad s^2/m"),
    "yaw_rate_response_time_s": ("yaw response time", lambda value: f"{1e3 * value:.0f} ms"),
    "braking_distance_m": ("braking distance", lambda value: f"{value:.3f} m"),
    "braking_time_s": ("braking time", lambda value: f"{value:.3f} s"),
    "mean_deceleration_m_s2": ("mean deceleration", lambda value: f"{value:.2f} m/s^2"),
}
"""Rows of the table, by the names of `handling`."""


@command(
    option(
        "commands", f"{', '.join(MANOEUVRES)}, with settings NAME[SETTING=VALUE,...]; or a CSV with "
        f"{', '.join(COLUMNS)}", "NAME|COMMANDS.csv", nargs="?",
    ),
    option("--list", "list the manoeuvres and their settings"),
    option("--speed", "of a manoeuvre [m/s]; default: its own", "V", number),
    setup_options(
        "vehicle", "tires", "mu", "floor", "patches", "start_s", "start_offset", "start_heading", "start_speed", "mass",
        "cog_height", "steering_gain", "speed_gain", "command_delay",
        start_speed="speed of the rolling car; default: the first commanded speed",
    ),
    out_options(RUN, "write a run folder here"),
    JSON,
    CONFIG,
)  # fmt: skip
def drive_command(options: argparse.Namespace) -> int:
    """Drive a manoeuvre, or a CSV of commands, on open ground."""
    if options.list:
        print(_manoeuvres())
        return _DONE
    if options.commands is None:
        raise SettingsError(f"drive has no commands; accepted: {', '.join(MANOEUVRES)}, or the path of a CSV file")
    picture = False
    if options.out is not None:
        check_run_folder(options.out)
        picture = can_draw("trace.png", several=False)
    with contextlib.redirect_stdout(sys.stderr):
        result = drive(options.commands, speed=options.speed, setup=setup_of(options))
    if options.out is not None:
        write_run(result, options.out, picture=picture)
        write_page(options.out)
    print(_json(result) if options.json else _table(result, options.out))
    hint = clamped_hint(result.car.telemetry, result.world.parameters)
    if hint:
        print("fg-mujoco: hint:", hint, file=sys.stderr)
    return _DONE if result.car.finished else _NOT_DONE


def _manoeuvres() -> str:
    """Return the manoeuvres, one a line, with their settings."""
    rows = []
    for name, kind in MANOEUVRES.items():
        text = " ".join((kind.__doc__ or "").split("\n\n")[0].split())
        standard = f" {kind.standard}." if kind.standard else ""
        settings = ",".join(f"{setting}={value:g}" for setting, value in vars(kind()).items())
        rows.append(f"{name:<11} {text}{standard}\n{'':12}{name}[{settings}]")
    return "\n".join(rows)


def _json(result: RaceResult) -> str:
    """Return the summary with the figures of handling as one JSON object; NaN is null."""
    figures = {name: value if math.isfinite(value) else None for name, value in handling(result).items()}
    return json.dumps(json.loads(summary_json(result)) | {"handling": figures}, indent=2)


def _table(result: RaceResult, out: str | None) -> str:
    car, figures = result.car, handling(result)
    rows = [("duration", f"{result.sim_time_s:.2f} s, {car.end_reason.replace('_', ' ')}")]
    for name, (title, text) in _FIGURES.items():
        if name in figures:
            rows.append((title, "-" if math.isnan(figures[name]) else text(figures[name])))
    rows += [
        ("greatest sliding", sliding_text(car.max_slide_m_s)),
        ("time sliding", share_text(car.slide_time_fraction)),
        *([("fastest sliding", car.max_slide_place)] if car.max_slide_place else []),
        ("top speed", f"{car.max_speed_m_s:.2f} m/s"),
        ("clamped commands", f"{car.clamped_commands} of {len(car.telemetry)}"),
        *written_rows(out),
    ]
    heading = f"{car.controller}, {car.vehicle}, mu {car.mu:.4g}" + (f" on floor {car.floor}" if car.floor else "")
    return "\n".join([heading, *(f"  {name:<22}{value}" for name, value in rows)])
