"""The parts of a report that are text and tables."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fg_mujoco.display import Html, element, escaped, html
from fg_mujoco.pictures.pages.page import boxes, names_and_values, note, result, scroll
from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.racing.decision_times import decision_limit_text, late_hint
from fg_mujoco.racing.result import clamped_hint
from fg_mujoco.simulation.planner_failure import place
from fg_mujoco.vehicle.tire_slip import NO_PEAK, slides_above, sliding_rule

from .clip import Clip
from .laps_and_slides import SECTORS, Lap, SlideEvent
from .recorded import RecordedRun

_MOST_EVENTS = 200  # rows of the list of sliding


def _floor(summary: Mapping[str, Any]) -> str:
    """Return the end of a label that says on which floor a race was driven."""
    return f" on floor {summary['floor']}" if summary.get("floor") else ""


def head(run: RecordedRun, notes: Sequence[object]) -> Html:
    """Return the title, the result line, notes and the figures."""
    summary, lap_times = run.summary, run.lap_times
    good = bool(summary["finished"]) and not summary["collisions"]
    word = "finished" if good else str(summary["end_reason"]).replace("_", " ")
    best = f", best {min(lap_times):.3f} s" if lap_times else ""
    sliding, verdict = _sliding(run)
    decisions, clamped = summary.get("decision_times"), summary.get("clamped_commands")
    figures = [
        *_lap_boxes(run),
        (f"{summary['collisions']}", "collisions"),
        *sliding,
        (f"{summary['max_speed_m_s']:.2f} m/s", "top speed"),
        (f"{summary['mean_speed_m_s']:.2f} m/s", "mean speed"),
        (f"{run.mu:g}", f"μ of the tires{_floor(summary)}"),
    ]
    if clamped is not None:
        figures.append((f"{clamped}", "commands clamped"))
    planned = not (summary.get("controller_origin") or {}).get("commands")
    if planned and "planner_mu" in summary:
        assumed = summary["planner_mu"]  # None: infinity, which JSON has not
        figures.append(("off" if assumed is None else f"{assumed:.4g}", "μ that the planner assumes"))
    if planned and "assist" in summary:
        figures.append((summary["assist"], "assist"))
    if planned and decisions is not None and decisions["decisions"]:
        times = [decisions[name] for name in ("median_s", "percentile_99_s", "worst_s", "period_s")]
        median, most, worst, period = (math.nan if time is None else 1e3 * time for time in times)
        shown = " / ".join(_known(time, ".2f") for time in (median, most, worst))
        figures.append((f"{shown} ms", "decisions: median / 99 % / worst"))
        over = f"decisions over {_known(period, 'g')} ms"
        figures.append((f"{decisions['over_period']} of {decisions['decisions']}", over))
    failure = [] if run.planner_failure is None else [_failure(run.planner_failure)]
    marked = (("Wrong way:", run.wrong_way), ("Crash:", run.crash), ("Rolled over", run.rollover))
    said = [f"{word} {each}. The map marks the place with a cross." for word, each in marked if each is not None]
    said += run.off_the_wheels
    if summary["end_reason"] == "decision_limit":
        said.append(f"Decision limit: {decision_limit_text(summary['decision_limit_s'], run.end)}.")
    if planned:
        hints = [clamped_hint(run.telemetry, run.car), late_hint(decisions) if decisions is not None else ""]
        said += [f"{hint}." for hint in hints if hint]
    return html(
        "<h1>{title}</h1>{result}{notes}{figures}",
        title=run.title,
        result=result(word, good, f"{' '.join(figures[0])}{best}; {verdict}."),
        notes=[element("div", each, class_="note") for each in (*failure, *said, *notes)],
        figures=boxes(figures),
    )


def _sliding(run: RecordedRun) -> tuple[list[tuple[str, str]], str]:
    """Return the figures of how the tires slid, and whether they did, in words."""
    summary = run.summary
    slides = summary["max_slide_m_s"]
    if slides is None:
        return [("-", "greatest sliding")], f"sliding was {NO_PEAK}"
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


def _failure(told: dict[str, Any]) -> Html:
    """Return why a planner failed and where, and its traceback."""
    where = place(told["file"], told["line"])
    scan = f" It was told {told['scan']}." if told.get("scan") else ""  # which summary.json alone has
    text = f"The planner failed at t = {told['time_s']:.3f} s: {told['error']}{where}.{scan}"
    return escaped([text, element("pre", told["traceback"]) if told["traceback"] else None])


def _known(value: float, form: str) -> str:
    return "-" if math.isnan(value) else f"{value:{form}}"


def laps(laps: Sequence[Lap], summary: dict[str, Any]) -> Html:
    """Return the table of the laps; a click on one puts the cursor on its start."""
    if not summary["laps_requested"]:
        return note("Open ground has no laps.")
    if not laps:
        return note("No tick was driven.")
    header = ("lap", "time [s]", *(f"sector {i + 1}" for i in range(SECTORS)), "top [m/s]", "mean [m/s]",
              "friction utilisation", "sliding")  # fmt: skip
    best = [
        min((time for time in times if time is not None), default=None)
        for times in zip(*((lap.time, *lap.sectors) for lap in laps), strict=True)
    ]
    ending = f", {str(summary['end_reason']).replace('_', ' ')}"
    rows = [
        (
            f"{lap.number}{'' if lap.time is not None else ending}",
            *(_time(time, least) for time, least in zip((lap.time, *lap.sectors), best, strict=True)),
            f"{lap.top_speed:.2f}", f"{lap.mean_speed:.2f}", f"{lap.friction_utilisation:.2f}",
            "not measured" if math.isnan(lap.sliding_share) else f"{100 * lap.sliding_share:.1f} %",
        )
        for lap in laps
    ]  # fmt: skip
    starts = np.cumsum([0.0, *(lap.time or 0.0 for lap in laps[:-1])]).tolist()
    listed = Table(header=header, rows=rows, times=starts).html()
    return escaped([scroll(listed), note("Sectors are thirds of the lap by progress.")])


def _time(value: float | None, least: float | None) -> str | None:
    text = None if value is None else f"{value:.3f}"
    return element("span", text, class_="best") if value is not None and value == least else text


def events(events: Sequence[SlideEvent], model: str, *, measured: bool = True) -> Html:
    """Return the list of sliding; a click on a row puts the cursor there."""
    if not events:
        return note(f"None: no tire slid. It does {sliding_rule(model)}." if measured else f"{NO_PEAK.capitalize()}.")
    rows = [
        (
            f"{event.start:.3f}", f"{1e3 * (event.end - event.start):.0f}", event.lap, f"{event.progress:.1f}",
            event.tire.replace("_", " "), f"{event.speed:.2f}", f"{event.greatest:.3f}",
        )
        for event in events[:_MOST_EVENTS]
    ]  # fmt: skip
    header = ("time [s]", "for [ms]", "lap", "progress [m]", "tire", "car [m/s]", "greatest [m/s]")
    listed = Table(header=header, rows=rows, times=[event.start for event in events[:_MOST_EVENTS]])
    more = f" The first {_MOST_EVENTS} are listed." if len(events) > _MOST_EVENTS else ""
    said = f"{len(events)} times a tire slid, {sliding_rule(model)}.{more} A click shows the place."
    return escaped([note(said), scroll(listed.html())])


def last_decision(steps: Sequence[Mapping[str, Any]] | None) -> Html:
    """Return the steps of the last decision, with what each proposal would have met; nothing, if there are none."""
    if not steps:
        return Html()
    rows = [
        [step["name"], *(None if step[name] is None else f"{step[name]:.3f}" for name in _NUMBERS), step["text"]]
        for step in steps
    ]
    header = ("step", "steering [rad]", "speed [m/s]", "what it does, or would have met")
    table = Table(header=header, rows=rows, left=(header[0], header[3]))
    return html("<h2>The last decision</h2>{table}", table=scroll(table.html()))


_NUMBERS = ("steering_angle_rad", "speed_m_s")


def clip(clip: Clip | None, whose: str = "") -> Html:
    """Return the video, with the name of the one that it follows, what it takes to have one, or nothing."""
    if clip is None:
        return Html()
    if clip.missing:
        why = missing("Not drawn here; to have it:", clip.missing)
        return html('<div class="clip"><h2>Clip</h2>{why}</div>', why=why)
    return html(
        '<div class="clip"><h2>{title}</h2><video controls loop muted playsinline src="{video}"></video></div>',
        title=f"{f'{whose}, from' if whose else 'From'} {clip.start:.1f} to {clip.end:.1f} s", video=clip.video,
    )  # fmt: skip


def missing(said: str, command: str) -> Html:
    """Return a note on what is not drawn, and how to have it."""
    return note(f"{said} ", element("code", command))


def settings(run: RecordedRun) -> Html:
    """Return the whole summary: settings, versions and hashes."""

    def rows(name: str, value: Any) -> list[tuple[str, Html]]:
        if run.others and isinstance(value, list) and value and isinstance(value[0], dict):
            value = {str(index): part for index, part in enumerate(value)}
        if isinstance(value, dict) and value:
            return [row for key, part in value.items() for row in rows(f"{name}.{key}", part)]
        return [(name, element("code", value if isinstance(value, str) else json.dumps(value)))]

    listed = [row for name, value in run.summary.items() for row in rows(name, value)]
    half = (len(listed) + 1) // 2
    halves = [names_and_values(listed[:half]), names_and_values(listed[half:])]
    return element("div", halves, class_="halves")
