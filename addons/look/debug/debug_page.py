"""The page to step through the decisions of a run: one HTML file that loads nothing and needs no network.

Its drawings are made in the browser by `debug.js` on canvases, from the numbers in the page. Texts of the run are
escaped here, or are set as text there.
"""

from __future__ import annotations

import math
from base64 import b64encode
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fg_mujoco.display import Html, element, html
from fg_mujoco.messages import FloatArray
from fg_mujoco.pictures.pages.page import resource, result, scroll, switch, write_page
from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.simulation.telemetry import recorded_command
from fg_mujoco.vehicle.car import WHEELS
from fg_mujoco.vehicle.tire_slip import slides_above

from ..intermediate_values import COLOURS, SHOWS_NOTHING
from .decisions import Decision, Step
from .window import Moving, Window

# Colours read on light and on dark. Most are after Okabe and Ito.
_SCANS = {"raw": "#59606b", "filtered": "#0a84c6", "extended": "#e07b00", "bubble": "#e0314b", "gap": "#12a066"}
_DRIVEN = "#e07b00"
_UNKNOWN = "#8a8f98"

_LAWS = {
    "maximum speed": "#9aa1ab", "planner": "#2f7ed8", "last plan": "#b06a00", "no plan": "#7a1f2b",
    "mean range": "#59b4e0", "guidance": "#a04bd0",
    "turning in moves": "#d06bd0", "remembered line": "#0b8f8f",
    "no reference": "#7a1f2b", "distance ahead": "#b8a200", "after recovery": "#c98a5a",
    "sight": "#e07b00", "plan in time": "#c2178f", "safety filter": "#e0314b", "recovery": "#8a5a2b",
    "friction limiter": "#12a066",
    "clamped by the car": "#3b4252", "the planner failed": "#e0314b", "not known": _UNKNOWN,
}  # fmt: skip
_MISSING = 65535  # of a range that is not a number
_MOST_MOTION = 60  # points of a motion
_BUTTONS = (
    ("first", "|◀", "first decision (Home)"), ("back", "◀", "one decision back (←)"),
    ("play", "▶ play", "play or stop (space)"), ("forward", "▶", "one decision forward (→)"),
    ("last", "▶|", "last decision (End)"),
)  # fmt: skip
_MOTION = ("speed over the ground", "speed of the odometry", "sideslip")
_CARD = '<div class="card"><span>{name}</span><b id="{id}"></b><i id="{id}_by"></i><p id="{id}_why"></p></div>'
_BODY = """<h1>{title}</h1>
{result}{notes}
<div class="readout player"><div class="buttons">{buttons}</div>
<input type="range" id="slider" min="0" max="{last}" value="{at}" aria-label="decision">
<div id="moment"></div></div>
<canvas id="strip" aria-label="speed over time, and the step that chose it"></canvas>
<div id="laws" class="legend"></div>
<pre id="failure" class="failure" hidden></pre>
<div class="columns">
<div class="top"><div class="row"><h2>From above</h2>{zooms}</div>
<canvas id="top" aria-label="the scan from above, in the frame of the car"></canvas>
<div id="layers" class="legend"></div>
<h2>Range over bearing</h2><canvas id="ranges" aria-label="range over bearing"></canvas></div>
<div class="grow"><h2>The command, and why</h2><div class="cards">{cards}</div><div id="steps">{steps}</div>
<p class="note">From the reference down to the command. A value is in colour if its step changed it; the last such
step chose it. Steps below the line say how fast the car gets there.</p>
<h2>How the car moves</h2>{motion}
<p class="note">Over the ground: the true speed of the rear axle. Odometry: from the wheels, as the planner reads it.
Each tire: during this command; in colour if it slides.</p></div></div>
{numbers}<p class="note">← and → step one decision, with Shift ten; Home, End, space.</p>"""


def debug_page(seen: Window, path: Path) -> Path:
    """Write the page, whole, in the place of one that may be there, and return its path; or RunFolderError."""
    summary, first, last = seen.run.summary, seen.decisions[0], seen.decisions[-1]
    good = bool(summary["finished"]) and not summary["collisions"]
    told = [f"{prefix}{each}" for prefix, each in
            (("", seen.run.crash), ("", seen.run.wrong_way), ("rolled over ", seen.run.rollover))
            if each is not None]  # fmt: skip
    ends = f"decisions from {first.time:.3f} to {last.time:.3f} s of {seen.run.end:.2f} s"
    text = f"{'; '.join(told)}. " if told else ""
    body = html(
        _BODY,
        title=seen.run.title,
        result=result(
            "finished" if good else str(summary["end_reason"]).replace("_", " "), good,
            f"{text}{len(seen.decisions)} {ends}.",
        ),
        notes=[element("div", each, class_="note warn") for each in seen.notes],
        buttons=[
            element("button", sign, type="button", id=name, title=text, aria_label=text)
            for name, sign, text in _BUTTONS
        ],
        last=len(seen.decisions) - 1,
        at=seen.at,
        zooms=switch("zoom", [(reach, f"{reach} m") for reach in (3, 6, 12)], pressed=1),
        cards=[
            html(_CARD, id=id, name=name) for id, name in (("speed", "speed"), ("steering", "steering angle"))
        ],
        steps=scroll(Table(header=("step", "steering [°]", "speed [m/s]"), rows=()).html()),
        motion=[
            Table(header=("motion", "value"), rows=[(name, "") for name in _MOTION]).html("motion"),
            Table(header=("tire", "sliding [m/s]", "friction utilisation"),
                  rows=[(wheel.replace("_", " "), "", "") for wheel in WHEELS]).html("tires"),
        ],
        numbers=_numbers(seen),
    )  # fmt: skip
    return write_page(
        path, f"{seen.run.title}: decisions", body, script=resource(__package__, "debug.js"), data=_data(seen),
        style=resource(__package__, "debug.css"),
    )  # fmt: skip


def _numbers(seen: Window) -> Html | None:
    """Return the table of the numbers that the planner has shown; where it has shown nothing, how it can."""
    names = dict.fromkeys(name for decision in seen.decisions for name in decision.numbers)
    rows = [(name, "", element("canvas", class_="over_time", aria_label=f"{name} over time")) for name in names]
    table = Table(header=("name", "value", "over time"), rows=rows).html("numbers")
    if names:
        return html("<h2>Values that the planner shows</h2>{table}", table=table)
    if any(decision.drawn or decision.colours for decision in seen.decisions):
        return None
    return html('<p class="note">{text}</p>', text=SHOWS_NOTHING)


def _data(seen: Window) -> dict[str, Any]:
    """Return what the page draws, as JSON has it; lengths in metres, angles in radians."""
    car, scan = seen.run.car, seen.decisions[0].scan
    unit = max(scan.range_max / 60000.0, 1e-3)
    names = list(dict.fromkeys(name for decision in seen.decisions for name in decision.scans))
    shown = {name: _hex(colour) for decision in seen.decisions for name, colour in decision.colours.items()}
    drawn = [each for decision in seen.decisions for each in decision.drawn]
    laws = list(dict.fromkeys(seen.laws))
    colours = _coloured(laws, _LAWS)
    summary = seen.run.summary
    return {
        "at": seen.at,
        "unit": unit,
        "missing": _MISSING,
        "scan": {"min": scan.angle_min, "step": scan.angle_increment, "max": scan.range_max},
        "car": {
            "length": car.length, "width": car.width, "rear": car.rear_overhang, "lidar": car.lidar_offset,
            "wheelbase": car.wheelbase, "lock": car.max_steering_angle,
            "slowest": car.min_speed, "fastest": car.max_speed,
        },
        "period": scan.scan_time,
        "top_speed": float(summary["speed_limit_m_s"]),
        "scans": [[name, colour] for name, colour in _coloured(names, _SCANS | shown).items()],
        "drawn": [[name, _hex(colour)] for name, colour in {each.name: each.colour for each in drawn}.items()],
        "numbers": list(dict.fromkeys(name for decision in seen.decisions for name in decision.numbers)),
        "laws": [[name, colours[name]] for name in laws],
        "stretches": [[first, end, laws.index(name)] for first, end, name in seen.stretches],
        "slides_above": slides_above(seen.run.tires_model),
        "driven_colour": _DRIVEN,
        "ahead": seen.ticks_ahead,
        "before": min(seen.decisions[0].tick, seen.ticks_ahead),  # places of `driven` before the first decision
        "driven": [[_rounded(x, 3), _rounded(y, 3)] for x, y in seen.driven(seen.decisions[0], seen.decisions[-1])],
        "walls": [outline.tolist() for outline in seen.walls],
        "decisions": [
            _decision(decision, unit, moving) | {"motion_of_car": _motion(seen.moving_at(decision))}
            for decision, moving in zip(seen.decisions, seen.moving, strict=True)
        ],
    }  # fmt: skip


def _decision(decision: Decision, unit: float, moving: list[FloatArray]) -> dict[str, Any]:
    command = decision.command
    held, shaped = decision.speed_step, decision.steering_step
    skip = max(len(decision.motion) // _MOST_MOTION, 1)
    return {
        "tick": decision.tick,
        "time": round(decision.time, 6),
        "pose": [_rounded(value, 4) for value in decision.pose],
        "speed": _rounded(decision.odometry.speed, 4),
        "angle": _rounded(decision.odometry.steering_angle, 5),
        # the command to the last digit, for it is the recorded one
        "command": None if command is None else [command.steering_angle, command.speed],
        "same": None if decision.answer is None or command is None else recorded_command(decision.answer) == command,
        "why": [decision.why_steering, decision.why_speed],
        "held": [_place(decision, shaped), _place(decision, held)],
        "steps": [
            [step.name, _rounded(step.steering_angle, 6), _rounded(step.speed, 5), step.text, step.on_the_way]
            for step in decision.steps
        ],
        "goal": None if decision.goal is None else [_rounded(value, 3) for value in decision.goal],
        "motion": np.round(decision.motion[::skip], 3).tolist(),
        "numbers": {name: _number(value) for name, value in decision.numbers.items()},
        "drawn": [[each.name, _hex(each.colour), np.round(each.points, 3).tolist()] for each in decision.drawn],
        "moving": [np.round(outline, 3).tolist() for outline in moving],
        "failure": decision.failure,
        "scans": {name: _packed(ranges, unit) for name, ranges in decision.scans.items()},
    }  # fmt: skip


def _motion(moving: Moving | None) -> list[Any] | None:
    """Return speed over the ground, sideslip, and of each tire sliding speed and friction utilisation."""
    if moving is None:
        return None
    tires = zip(moving.slides, moving.friction_utilisation, strict=True)
    own = [_rounded(moving.ground_speed, 4), _rounded(moving.sideslip, 5)]
    return [*own, [[_rounded(slide, 4), _rounded(use, 3)] for slide, use in tires]]


def _place(decision: Decision, step: Step | None) -> int | None:
    return None if step is None else decision.steps.index(step)


def _packed(ranges: FloatArray, unit: float) -> str:
    """Return ranges (n,) [m] in whole units as 16-bit numbers, base64."""
    finite = np.isfinite(ranges)
    counts = np.clip(np.rint(np.where(finite, ranges, 0.0) / unit), 0, _MISSING - 1)
    return b64encode(np.where(finite, counts, _MISSING).astype("<u2").tobytes()).decode()


def _number(value: float) -> float | str:
    """Return a number that a planner has shown, to seven digits; the name of one that is not finite."""
    return float(f"{value:.7g}") if math.isfinite(value) else str(value)


def _rounded(value: float, digits: int) -> float | None:
    """Return a number as the page has it; None for what is none."""
    return round(float(value), digits) if math.isfinite(value) else None


def _hex(colour: Sequence[int]) -> str:
    return "#{:02x}{:02x}{:02x}".format(*colour)


def _coloured(names: Sequence[str], known: dict[str, str]) -> dict[str, str]:
    """Return a colour for each name: the known ones, and others in turn."""
    others = [name for name in names if name not in known]
    return {name: known.get(name) or _hex(COLOURS[others.index(name) % len(COLOURS)]) for name in names}
