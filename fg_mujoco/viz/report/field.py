"""What the page of a race has of several cars: who came where, gaps and positions, overtakes, and contacts."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import MissingExtraError
from ...messages import FloatArray
from ...racing.result import RaceResult
from ...racing.run_folder import Run
from ...racing.standings import Standings, standings
from ...simulation.cars import car_colour_hex
from ...simulation.telemetry import TELEMETRY
from .plot_style import ALERT, new_figure, put_legend_above
from .recorded_run import RecordedRun
from .sections import table

if TYPE_CHECKING:
    from bokeh.models import UIElement
    from bokeh.plotting import figure as Figure  # noqa: N812 - a class, whatever its name

PICTURE_SIZE = (480, 270)  # [px] of a contact
_MOST_PICTURES = 12  # of contacts: each adds some 30 kB to a page
_MOST_ROWS = 200
_PANEL_HEIGHT = 170  # [px]
_QUALITY = 85  # of JPEG


@dataclass(frozen=True, kw_only=True, eq=False)
class Field:
    """The cars of a race. Lists have one entry a car."""

    rows: list[dict[str, Any]]  # as in `cars` of the summary
    lines: list[FloatArray]  # where each drove until its race was over (k, 2) [m]
    standings: Standings
    contacts: list[dict[str, Any]]
    overtakes: list[dict[str, Any]]

    @classmethod
    def of(cls, run: RecordedRun) -> Field | None:
        """Return the cars of a run; None where one was alone."""
        if not run.others:
            return None
        telemetries, rows = (run.telemetry, *run.others), run.summary["cars"]
        found = standings(telemetries, rows)
        ends = [int(np.searchsorted(found.time, float(row["end_time_s"]) - 1e-9)) for row in rows]
        x, y = (TELEMETRY.index(name) for name in ("x_m", "y_m"))
        lines = [telemetry[: max(end, 1)][:, [x, y]] for telemetry, end in zip(telemetries, ends, strict=True)]
        contacts, overtakes = (list(run.summary.get(name) or ()) for name in ("contacts", "overtakes"))
        return cls(rows=rows, lines=lines, standings=found, contacts=contacts, overtakes=overtakes)

    def index(self, name: str) -> int:
        """Return the number of the car of a name; 0 where there is none."""
        names = [row["name"] for row in self.rows]
        return names.index(name) if name in names else 0


def field_plots(field: Field) -> UIElement:
    """Return the gap of each car to the leader, and the positions, over time; contacts are marked."""
    from bokeh.layouts import gridplot
    from bokeh.models import Range1d, Span

    time = field.standings.time
    across = Range1d(0.0, max(float(time[-1]) if len(time) else 1.0, 1e-3), bounds="auto")
    widest = max(1.05 * float(np.nanmax(field.standings.gaps_s, initial=0.0)), 0.1)
    gaps = _panel("gap to leader [s]", across, (widest, 0.0))
    places = _panel("position", across, (len(field.rows) + 0.4, 0.6))
    places.yaxis.ticker = list(range(1, len(field.rows) + 1))
    for index, line in enumerate(field.lines):
        end, drawn = len(line), {"line_color": car_colour_hex(index), "line_width": 2.0}
        gaps.line(time[:end], field.standings.gaps_s[index, :end], legend_label=f"car {index}", **drawn)
        places.step(time[:end], field.standings.positions[index, :end], mode="after", **drawn)
    for panel in (gaps, places):
        for contact in field.contacts[:_MOST_ROWS]:
            panel.add_layout(
                Span(location=contact["time_s"], dimension="height", line_color=ALERT, line_dash=[2, 3], line_width=1)
            )
    put_legend_above(gaps)
    gaps.xaxis.visible = False
    places.xaxis.axis_label = "time [s]"
    places.height += 45
    return gridplot([[gaps], [places]], toolbar_location="right", sizing_mode="stretch_width", merge_tools=True,
                    toolbar_options={"logo": None})  # fmt: skip


def _panel(title: str, across: object, height: tuple[float, float]) -> Figure:
    return new_figure(
        height=_PANEL_HEIGHT, sizing_mode="stretch_width", x_range=across, y_range=height, y_axis_label=title,
        tools="xpan,xwheel_zoom,xbox_zoom,reset,save", active_scroll=None, min_border_left=64, min_border_right=8,
    )  # fmt: skip


def said(field: Field, winner: str | None) -> str:
    """Return a line about who won, and whose the figures at the head of the page are, as HTML."""
    won = "nobody finished" if winner is None else f"{_named(field, winner)} won"
    return f"{len(field.rows)} cars raced: {won}. The figures here are of {_car(field, 0)}."


def cars_table(field: Field) -> str:
    """Return the cars in the order of the result, as HTML."""
    header = ("", "car", "planner", "vehicle", "laps", "best lap [s]", "end", "at [s]", "contacts", "walls",
              "top [m/s]", "greatest sliding [m/s]")  # fmt: skip
    rows = []
    for index in sorted(range(len(field.rows)), key=lambda index: int(field.rows[index]["position"])):
        row = field.rows[index]
        best = f"{min(row['lap_times_s']):.3f}" if row["lap_times_s"] else "-"
        cells = (
            f"{row['laps_completed']}", best, str(row["end_reason"]).replace("_", " "), f"{row['end_time_s']:.2f}",
            f"{row['collisions_car']}", f"{row['collisions_wall']}", f"{row['max_speed_m_s']:.2f}",
            f"{row['max_slide_m_s']:.3f}",
        )  # fmt: skip
        names = "".join(f'<td class="left">{escape(str(row[name]))}</td>' for name in ("controller", "vehicle"))
        rows.append(
            f'<tr><td>{row["position"]}.</td><td class="left">{_car(field, index)}</td>{names}'
            f"{''.join(f'<td>{escape(cell)}</td>' for cell in cells)}</tr>"
        )
    return f'<h2>Cars</h2><div class="scroll">{table(header, rows)}</div>'


def overtakes_table(field: Field) -> str:
    """Return who overtook whom, as HTML; a click on a row puts the cursor there."""
    rows = [
        f'<tr class="here" data-time="{overtake["time_s"]:.3f}"><td>{overtake["time_s"]:.2f}</td>'
        f'<td class="left">{_named(field, overtake["by"])}</td><td class="left">{_named(field, overtake["of"])}</td>'
        f"<td>{overtake['s_m']:.1f}</td></tr>"
        for overtake in field.overtakes[:_MOST_ROWS]
    ]
    listed = table(("time [s]", "by", "of", "progress [m]"), rows) if rows else ""
    body = f'<div class="scroll">{listed}</div>' if rows else '<p class="note">None.</p>'
    return f"<h2>Overtakes</h2>{body}{_left_out(len(field.overtakes))}"


def contacts_table(field: Field) -> str:
    """Return who touched whom, as HTML; a click on a row puts the cursor there."""
    rows = [
        f'<tr class="here" data-time="{contact["time_s"]:.3f}"><td>{contact["time_s"]:.2f}</td>'
        f'<td class="left">{" ".join(_named(field, name) for name in contact["cars"])}</td>'
        f"<td>{contact['impulse_Ns']:.2f}</td><td>{contact['closing_speed_m_s']:.2f}</td>"
        f"<td>{100.0 * contact['displacement_m']:.1f}</td>"
        f'<td class="left">{_named(field, contact["at_fault"])}</td></tr>'
        for contact in field.contacts[:_MOST_ROWS]
    ]
    header = ("time [s]", "cars", "impulse [Ns]", "closing speed [m/s]", "displaced by [cm]", "at fault")
    body = f'<div class="scroll">{table(header, rows)}</div>' if rows else '<p class="note">None.</p>'
    return f"<h2>Contacts</h2>{body}{_left_out(len(field.contacts))}"


def contact_pictures(field: Field, source: RaceResult | Run | str | Path) -> str:
    """Return pictures of the contacts, from behind the car at fault, as HTML.

    Where the extra `render` or OpenGL is missing, it says what installs it.
    """
    if not field.contacts:
        return ""
    shown = field.contacts[:_MOST_PICTURES]
    try:
        pictures = _pictures(field, shown, source)
    except MissingExtraError as error:
        return f'<p class="note">Pictures are not drawn here; to have them: <code>{escape(str(error))}</code></p>'
    figures = "".join(
        f'<figure><img src="data:image/jpeg;base64,{picture}" width="{PICTURE_SIZE[0]}" height="{PICTURE_SIZE[1]}" '
        f'alt="contact at {contact["time_s"]:.2f} s"><figcaption class="note">{contact["time_s"]:.2f} s, from behind '
        f"{_named(field, contact['at_fault'])}</figcaption></figure>"
        for contact, picture in zip(shown, pictures, strict=True)
    )
    more = f'<p class="note">Of the first {len(shown)}.</p>' if len(shown) < len(field.contacts) else ""
    return f'<div class="columns pictures">{figures}</div>{more}'


def _pictures(field: Field, contacts: Sequence[dict[str, Any]], source: RaceResult | Run | str | Path) -> list[str]:
    """Return a picture of each contact, JPEG in base64; the cars at fault are followed one after the other."""
    from ..rendering import Film, Overlays

    found = [""] * len(contacts)
    faults = [field.index(contact["at_fault"]) for contact in contacts]
    for car in sorted(set(faults)):
        with Film(source, camera="chase", car=car, size=PICTURE_SIZE, overlays=Overlays()) as film:
            for place, contact in enumerate(contacts):
                if faults[place] == car:
                    time = min(max(float(contact["time_s"]), 0.0), film.drive.end)
                    found[place] = _as_jpeg(film.frame(time))
    return found


def _as_jpeg(picture: Any) -> str:
    from ..rendering.telemetry_strip import require_pillow

    require_pillow()
    from PIL import Image

    text = io.BytesIO()
    Image.fromarray(picture).save(text, format="jpeg", quality=_QUALITY)
    return base64.b64encode(text.getvalue()).decode()


def _named(field: Field, name: str) -> str:
    """Return the name of a car behind its colour, as HTML; one that is none of them is only written."""
    names = [row["name"] for row in field.rows]
    return _car(field, names.index(name)) if name in names else escape(name)


def _car(field: Field, index: int) -> str:
    swatch = f'<span class="swatch" style="background:{car_colour_hex(index)}">{index}</span>'
    return f"{swatch} {escape(str(field.rows[index]['name']))}"


def _left_out(count: int) -> str:
    return f'<p class="note">The first {_MOST_ROWS} of {count}.</p>' if count > _MOST_ROWS else ""


STYLE = (
    ".swatch { display: inline-block; min-width: 18px; padding: 0 4px; border-radius: 4px; color: #fff; "
    "font-size: 12px; text-align: center; }\n"
    ".pictures { gap: 12px; margin-top: 14px; }\nfigure { margin: 0; }\n"
    "figure img { max-width: 100%; height: auto; border-radius: 8px; display: block; }\n"
)
"""CSS of a page with these."""
