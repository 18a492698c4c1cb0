"""The page of one run: one HTML file that loads nothing else.

    write_report("runs/oval", "runs/oval/report.html")

Its plots are bokeh's, whose JavaScript is in the page too, or beside it where many pages share one.
"""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Callable, Sequence
from hashlib import sha256
from html import escape
from importlib.resources import files
from pathlib import Path

from ...course.writing import write_file
from ...errors import RunFolderError
from ...racing.planner_choice import with_settings
from ...racing.result import RaceResult
from ...racing.run_folder import RECORDED, Run
from . import sections
from .clip import clip_of_several, clip_start, make_clip
from .field import STYLE, Field, cars_table, contact_pictures, contacts_table, field_plots, overtakes_table, said
from .gg_plot import gg_plot
from .lap_table import lap_length, lap_table
from .map_plot import colour_scales, map_plot
from .map_shapes import map_shapes
from .plot_style import cursor_source, require_bokeh, tick_source
from .recorded_run import RecordedRun, read_recorded
from .slide_events import slide_events
from .tick_columns import SPEED_FAR_ABOVE, tick_columns
from .time_plots import time_plots

LIBRARY = "bokeh.min.js"
"""Name of the file with bokeh's JavaScript, where pages share one."""

CLIP_SECONDS = 8.0

_NONE = "'none'"  # of a policy that allows no script

_COLOURS = (("speed_m_s", "speed"), ("friction_use", "friction utilisation"), ("slide_m_s", "sliding"))
_AXES = (("distance_m", "over distance"), ("time_s", "over time"))

_READOUT = (
    ("t", "time_s", 3, "s"), ("lap", "lap", 0, ""), ("progress", "progress_m", 1, "m"),
    ("speed", "speed_m_s", 2, "m/s"), ("limit", "limit_speed_m_s", 2, "m/s"),
    ("steering", "steering_angle_rad", 3, "rad"), ("friction utilisation", "friction_use", 2, ""),
    ("sliding", "slide_m_s", 3, "m/s"), ("ahead", "acceleration_ahead_m_s2", 1, "m/s²"),
    ("left", "acceleration_left_m_s2", 1, "m/s²"),
)  # fmt: skip


def write_report(
    source: RaceResult | Run | str | Path,
    path: str | Path,
    *,
    clip_seconds: float | None = CLIP_SECONDS,
    share_library: bool = False,
    notes: Sequence[str] = (),
    watch: Callable[[int, int, str], None] | None = None,
) -> Path:
    """Write the report of a run and return its path. It appears whole, in the place of one that may be there.

    Args:
      source: a run folder, a Run or a RaceResult.
      path: of the page.
      clip_seconds: of the video in it [s]; None: there is none, and no pictures of contacts.
      share_library: whether bokeh's JavaScript is read from a file LIBRARY beside the page, and not in the page.
      notes: lines of text (HTML) under the result.
      watch: told how many frames of the video are done, of how many, and the word "frame".

    Raises:
      RunFolderError: a folder that is none of `race --out`, lacks a file, or is of another version; or the page
        cannot be written.
      MissingExtraError: bokeh is not installed.
    """
    require_bokeh()
    run = read_recorded(source)
    path = Path(path)
    page = _page(run, source, clip_seconds, share_library, notes, watch)
    write_page(path, page)
    return path


def write_page(path: Path, page: str) -> None:
    """Write a page in one piece.

    Raises:
      RunFolderError: it cannot be written.
    """
    try:
        write_file(path, page.encode())
    except OSError as error:
        reason = error.strerror or str(error)
        raise RunFolderError(
            f"{path}: cannot be written: {reason}; accepted: a file in a folder that can be"
        ) from error


def library() -> str:
    """Return bokeh's JavaScript."""
    from bokeh.resources import Resources

    return "\n".join(Resources(mode="inline", components=["bokeh"], log_level="error").js_raw)


def page_frame(
    title: str, body: str, scripts: Sequence[str] = (), *, data: str = "", beside: str = "", style: str = ""
) -> str:
    """Return a page that loads nothing and runs these scripts alone: its policy has their hashes.

    Args:
      title: of the page, a text.
      body: of the page, HTML.
      scripts: JavaScript, in the order in which it runs.
      data: JSON that the scripts find in the element `report-data`.
      beside: name of a file beside the page with JavaScript that runs before the scripts.
      style: CSS, after that of all pages.
    """
    style = (files(__package__) / "report.css").read_text(encoding="utf-8") + style
    scripts = [_as_parsed(script) for script in scripts]
    allowed = [f"'sha256-{b64encode(sha256(script.encode()).digest()).decode()}'" for script in scripts]
    allowed += ["'self'", "file:"] if beside else []
    policy = (
        f"default-src 'none'; script-src {' '.join(allowed) or _NONE}; style-src 'unsafe-inline'; "
        "img-src data: blob:; media-src data:; font-src data:; base-uri 'none'; form-action 'none'"
    )
    tags = [f'<script src="{escape(beside)}"></script>'] if beside else []
    tags += [f'<script type="application/json" id="report-data">{_in_script(data)}</script>'] if data else []
    tags += [f"<script>{script}</script>" for script in scripts]
    script = "".join(f"{tag}\n" for tag in tags)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n{body}\n{script}</body>\n</html>\n"
    )


def _as_parsed(script: str) -> str:
    """Return JavaScript as a browser reads it from a page, which is what it hashes: lines end in LF alone."""
    return script.replace("\r\n", "\n").replace("\r", "\n")


def _in_script(data: str) -> str:
    """Return JSON that no text in it can end, or take for markup."""
    return data.replace("<", "\\u003c")


def _page(
    run: RecordedRun,
    source: RaceResult | Run | str | Path,
    clip_seconds: float | None,
    share_library: bool,
    notes: Sequence[str],
    watch: Callable[[int, int, str], None] | None,
) -> str:
    from bokeh.embed import components

    columns = tick_columns(run)
    summary, lap_times = run.summary, run.lap_times
    length = lap_length(columns["time_s"], columns["progress_m"], lap_times)
    unfinished = len(lap_times) < int(summary["laps_requested"])
    laps = lap_table(columns, lap_times, length, end=run.end if unfinished else None)
    events = slide_events(columns, length, model=run.tires_model)
    recorded = summary["end_reason"] == RECORDED
    slides = sections.NOT_KNOWN if recorded else sections.events(events, run.tires_model)
    field = Field.of(run)
    film, whose = None, ""
    if clip_seconds is not None:
        start = clip_start(clip_seconds, run.end, lap_times, events, bool(summary["collisions"]))
        shown = None if field is None else clip_of_several(clip_seconds, run.end, field.contacts, field.overtakes)
        if shown is not None:
            start, whose = shown
        car = 0 if field is None else field.index(whose)
        film = make_clip(source, start, min(start + clip_seconds, run.end), watch, car=car)

    ticks, cursor = tick_source(columns), cursor_source()
    grip = run.mu * run.car.gravity
    script, places = components(
        {
            "map": map_plot(
                map_shapes(run.model, run.end),
                columns,
                events,
                cursor,
                run.wrong_way,
                run.crash or run.rollover,
                others=[] if field is None else list(enumerate(field.lines))[1:],
                contacts=[] if field is None else field.contacts,
            ),
            "time": time_plots(ticks, columns, lap_times, run.tires_model),
            "gg": gg_plot(ticks, columns, grip, cursor),
            **({} if field is None else {"field": field_plots(field)}),
        },
        wrap_script=False,
    )
    data = {
        "readout": _READOUT,
        "free": SPEED_FAR_ABOVE,
        "colours": colour_scales(columns),
        "axes": {"distance_m": "distance driven [m]", "time_s": "time [s]"},
        "clip_start": film.start if film else 0.0,
    }
    controller = with_settings(str(summary["controller"]), summary.get("planner_settings") or {})
    title = f"{summary['track']}, {controller}"
    body = "\n".join(
        (
            sections.head(run, title, notes if field is None else (said(field, summary.get("winner")), *notes)),
            *([] if field is None else _of_several(field, places["field"], source, pictures=clip_seconds is not None)),
            sections.switch("colour", _COLOURS),
            f'<div id="map" class="plots">{places["map"]}</div>',
            '<div id="readout" class="readout"><span>move over a plot: the values of that moment, here and in all '
            "plots</span></div>",
            f'<div class="columns"><div class="grow"><h2>Laps</h2>{sections.laps(laps, summary)}</div>'
            f"{sections.clip(film, whose)}</div>",
            "<h2>Along the drive</h2>",
            sections.switch("across", _AXES),
            f'<div class="plots">{places["time"]}</div>',
            f'<div class="columns"><div><h2>g-g diagram</h2><p class="note">In the circle of μ g = {grip:.2f} m/s².'
            f'</p>{places["gg"]}</div><div class="grow"><h2>Sliding</h2>{slides}</div></div>',
            f"<h2>Settings, versions, hashes</h2>{sections.settings(run)}",
        )
    )
    code = (files(__package__) / "report.js").read_text(encoding="utf-8")
    scripts = (script, code) if share_library else (library(), script, code)
    return page_frame(
        title, body, scripts, data=json.dumps(data), beside=LIBRARY if share_library else "",
        style=STYLE if field is not None else "",
    )  # fmt: skip


def _of_several(field: Field, plots: str, source: RaceResult | Run | str | Path, *, pictures: bool) -> list[str]:
    """Return what the page has of all cars, before what it has of car 0."""
    return [
        cars_table(field),
        f'<h2>Gaps and positions</h2><div class="plots">{plots}</div>',
        '<div class="columns">'
        f'<div>{overtakes_table(field)}</div><div class="grow">{contacts_table(field)}</div></div>',
        contact_pictures(field, source) if pictures else "",
        f"<h2>{escape(str(field.rows[0]['name']))}</h2>"
        '<p class="note">The rest of the page is of car 0. The map has the lines of the others, too.</p>',
    ]
