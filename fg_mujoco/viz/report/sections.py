"""The parts of a report that are text and tables, as HTML."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

from ...racing.decision_times import decision_limit_text
from ...racing.hints import clamped_hint, late_hint
from ...racing.manoeuvres import is_driven_by_commands
from ...racing.run_folder import RECORDED
from ...simulation.planner_failure import place
from ...vehicle.tire_slip import slides_above, sliding_rule
from .clip import Clip
from .lap_table import SECTORS, Lap
from .recorded_run import RecordedRun
from .slide_events import SlideEvent

NOT_KNOWN = '<p class="note">Not known: a car recorded this run, and nobody measured its tires.</p>'
"""In the place of the list of sliding."""
_MOST_EVENTS = 200  # rows of the list of sliding


def table(header: Sequence[str], rows: Sequence[str], kind: str = "") -> str:
    """Return a table of rows that are HTML already."""
    head = "".join(f"<th>{escape(name)}</th>" for name in header)
    return f'<table class="{kind}"><thead><tr>{head}</tr></thead><tbody>{"".join(rows)}</tbody></table>'


def head(run: RecordedRun, title: str, notes: Sequence[str]) -> str:
    """Return the title, the result line, notes (HTML) and the figures."""
    summary, lap_times = run.summary, run.lap_times
    good = bool(summary["finished"]) and not summary["collisions"]
    recorded = summary["end_reason"] == RECORDED
    word = "finished" if good and not recorded else str(summary["end_reason"]).replace("_", " ")
    best = f", best {min(lap_times):.3f} s" if lap_times else ""
    sliding: list[tuple[str, str]] = []
    if recorded:
        verdict = "recorded by a car: what its tires did, and whether it touched anything, is not known"
    else:
        sliding, verdict = _sliding(run)
    decisions, clamped = summary.get("decision_times"), summary.get("clamped_commands")
    boxes = [
        *_lap_boxes(run),
        *([] if recorded else [(f"{summary['collisions']}", "collisions")]),
        *sliding,
        (f"{summary['max_speed_m_s']:.2f} m/s", "top speed"),
        (f"{summary['mean_speed_m_s']:.2f} m/s", "mean speed"),
        (f"{run.mu:g}", "μ of the tires, assumed" if recorded else "μ of the tires"),
    ]
    if clamped is not None and not recorded:
        boxes.append((f"{clamped}", "commands clamped"))
    planned = not recorded and not is_driven_by_commands(str(summary["controller"]))
    if planned and "planner_mu" in summary:
        assumed = summary["planner_mu"]  # None: infinity, which JSON has not
        boxes.append(("off" if assumed is None else f"{assumed:.4g}", "μ that the planner assumes"))
    if planned and decisions is not None and decisions["decisions"]:
        times = [decisions[name] for name in ("median_s", "percentile_99_s", "worst_s", "period_s")]
        median, most, worst, period = (math.nan if time is None else 1e3 * time for time in times)
        shown = " / ".join(_known(time, ".2f") for time in (median, most, worst))
        boxes.append((f"{shown} ms", "decisions: median / 99 % / worst"))
        over = f"decisions over {_known(period, 'g')} ms"
        boxes.append((f"{decisions['over_period']} of {decisions['decisions']}", over))
    figures = "".join(f"<div><b>{escape(value)}</b><span>{escape(name)}</span></div>" for value, name in boxes)
    wrong_way = [] if run.wrong_way is None else [f"Wrong way: {run.wrong_way}. The map marks the place with a cross."]
    failure = [] if run.planner_failure is None else [_failure(run.planner_failure)]
    crash = [] if run.crash is None else [f"Crash: {run.crash}. The map marks the place with a cross."]
    if run.rollover is not None:
        crash.append(f"Rolled over {run.rollover}. The map marks the place with a cross.")
    late = []
    if summary["end_reason"] == "decision_limit":
        late.append(f"Decision limit: {decision_limit_text(summary['decision_limit_s'], run.end)}.")
    hints = []
    if planned:
        hints = [clamped_hint(run.telemetry, run.car), late_hint(decisions) if decisions is not None else ""]
    told = (*failure, *map(escape, (*wrong_way, *crash, *late, *(f"{hint}." for hint in hints if hint))), *notes)
    said = "".join(f'<div class="note">{note}</div>' for note in told)
    return (
        f"<h1>{escape(title)}</h1>"
        f'<p class="result"><span class="badge {"good" if good else "bad"}">{escape(word)}</span>'
        f"{escape(' '.join(boxes[0]))}{best}; {verdict}.</p>{said}"
        f'<div class="figures">{figures}</div>'
    )


def _sliding(run: RecordedRun) -> tuple[list[tuple[str, str]], str]:
    """Return the figures of how the tires slid, and whether they did, in words."""
    summary = run.summary
    slides = float(summary["max_slide_m_s"])
    lateral = summary.get("max_lateral_slide_m_s")  # older runs lack it
    share = f"{100 * summary['slide_time_fraction']:.2f} %"
    boxes = [
        (f"{slides:.3f} m/s", "greatest sliding"),
        *([] if lateral is None else [(f"{lateral:.3f} m/s", "greatest sideways")]),
        (share, "of the time sliding"),
    ]
    return boxes, "no tire slid" if slides <= slides_above(run.tires_model) else f"a tire slid {share} of the time"


def _lap_boxes(run: RecordedRun) -> list[tuple[str, str]]:
    """Return the figures of the laps; of a drive without laps how long it took, and the greatest of its motion."""
    summary, lap_times = run.summary, run.lap_times
    if not summary["laps_requested"]:
        boxes = [(f"{run.end:.2f} s", "simulated")]
        for name, unit, what in _MOTION:
            greatest = np.abs(run.column(name)[np.isfinite(run.column(name))]).max(initial=0.0)
            boxes.append((f"{greatest:.3g} {unit}", what))
        return boxes
    laps = f"{summary['laps_completed']} of {summary['laps_requested']}"
    return [(laps, "laps"), (f"{min(lap_times):.3f} s" if lap_times else "-", "best lap")]


_MOTION = (
    ("ay_m_s2", "m/s²", "greatest lateral acceleration"), ("sideslip_rad", "rad", "greatest sideslip"),
    ("yaw_rate_rad_s", "rad/s", "greatest yaw rate"),
)  # fmt: skip
"""Columns whose greatest size the page of a drive has."""


def _failure(told: dict[str, Any]) -> str:
    """Return why a planner failed and where, and its traceback."""
    where = place(told["file"], told["line"])
    scan = f" It was told {told['scan']}." if told.get("scan") else ""  # which summary.json alone has
    text = f"The planner failed at t = {told['time_s']:.3f} s: {told['error']}{where}.{scan}"
    said = f"<pre>{escape(told['traceback'])}</pre>" if told["traceback"] else ""
    return escape(text) + said


def switch(name: str, choices: Sequence[tuple[str, str]]) -> str:
    """Return buttons of which one is pressed, the first: (value, text) each; `report.js` acts on them."""
    buttons = "".join(
        f'<button type="button" data-switch="{name}" value="{value}" aria-pressed="{"false" if i else "true"}">'
        f"{text}</button>"
        for i, (value, text) in enumerate(choices)
    )
    return f'<div class="switch" role="group">{buttons}</div>'


def _known(value: float, form: str, unit: str = "") -> str:
    return "-" if math.isnan(value) else f"{value:{form}}{unit}"


def laps(laps: Sequence[Lap], summary: dict[str, Any]) -> str:
    """Return the table of the laps; a click on one puts the cursor on its start."""
    if not summary["laps_requested"]:
        return '<p class="note">Open ground has no laps.</p>'
    if not laps:
        return '<p class="note">No tick was driven.</p>'
    header = ("lap", "time [s]", *(f"sector {i + 1}" for i in range(SECTORS)), "top [m/s]", "mean [m/s]",
              "friction utilisation", "sliding")  # fmt: skip
    best_lap = min((lap.time for lap in laps if lap.time is not None), default=None)
    best = [
        min((time for lap in laps if (time := lap.sectors[sector]) is not None), default=None)
        for sector in range(SECTORS)
    ]
    rows = []
    start = 0.0
    for lap in laps:
        times = [(lap.time, best_lap), *zip(lap.sectors, best, strict=True)]
        cells = "".join(_time_cell(value, least) for value, least in times)
        ending = "" if lap.time is not None else f", {str(summary['end_reason']).replace('_', ' ')}"
        rows.append(
            f'<tr class="here" data-time="{start:.3f}"><td>{lap.number}{escape(ending)}</td>{cells}'
            f"<td>{lap.top_speed:.2f}</td><td>{lap.mean_speed:.2f}</td>"
            f"<td>{_known(lap.friction_utilisation, '.2f')}</td>"
            f"<td>{_known(100 * lap.sliding_share, '.1f', ' %')}</td></tr>"
        )
        start += lap.time or 0.0
    note = '<p class="note">Sectors are thirds of the lap by progress.</p>'
    return f'<div class="scroll">{table(header, rows)}</div>{note}'


def _time_cell(value: float | None, least: float | None) -> str:
    if value is None:
        return "<td>-</td>"
    return f'<td class="{"best" if value == least else ""}">{value:.3f}</td>'


def events(events: Sequence[SlideEvent], model: str) -> str:
    """Return the list of sliding; a click on a row puts the cursor there."""
    if not events:
        return f'<p class="note">None: no tire slid. It does {sliding_rule(model)}.</p>'
    rows = [
        f'<tr class="here" data-time="{event.start:.3f}"><td>{event.start:.3f}</td>'
        f"<td>{1e3 * (event.end - event.start):.0f}</td><td>{event.lap}</td>"
        f"<td>{event.progress:.1f}</td><td>{event.tire.replace('_', ' ')}</td>"
        f"<td>{event.speed:.2f}</td><td>{event.greatest:.3f}</td></tr>"
        for event in events[:_MOST_EVENTS]
    ]
    more = f" The first {_MOST_EVENTS} are listed." if len(events) > _MOST_EVENTS else ""
    header = ("time [s]", "for [ms]", "lap", "progress [m]", "tire", "car [m/s]", "greatest [m/s]")
    return (
        f'<p class="note">{len(events)} times a tire slid, {sliding_rule(model)}.{more} '
        "A click shows where.</p>"
        f'<div class="scroll">{table(header, rows)}</div>'
    )


def clip(clip: Clip | None, whose: str = "") -> str:
    """Return the video, among several cars with the name of the one that it follows, or what it takes to have one.

    It is nothing where none was wanted.
    """
    if clip is None:
        return ""
    if clip.missing:
        text = f"Not drawn here; to have it: <code>{escape(clip.missing)}</code>"
        return f'<div class="clip"><h2>Clip</h2><p class="note">{text}</p></div>'
    begin = f"{escape(whose)}, from" if whose else "From"
    return (
        f'<div class="clip"><h2>{begin} {clip.start:.1f} to {clip.end:.1f} s</h2>'
        f'<video controls loop muted playsinline src="data:video/mp4;base64,{clip.video}"></video></div>'
    )


def settings(run: RecordedRun) -> str:
    """Return the whole summary: settings, versions and hashes."""

    def rows(name: str, value: Any) -> list[tuple[str, str]]:
        if run.others and isinstance(value, list) and value and isinstance(value[0], dict):
            value = {str(index): part for index, part in enumerate(value)}
        if isinstance(value, dict) and value:
            return [row for key, part in value.items() for row in rows(f"{name}.{key}", part)]
        return [(name, value if isinstance(value, str) else json.dumps(value))]

    listed = [row for name, value in run.summary.items() for row in rows(name, value)]
    cells = [f"<tr><td>{escape(name)}</td><td><code>{escape(text)}</code></td></tr>" for name, text in listed]
    half = (len(cells) + 1) // 2
    halves = "".join(
        f'<table class="settings"><tbody>{"".join(part)}</tbody></table>' for part in (cells[:half], cells[half:])
    )
    return f'<div class="halves">{halves}</div>'
