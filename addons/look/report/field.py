"""What the page of a race has of several cars: who came where, gaps and positions, overtakes, and contacts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fg_mujoco import from_addons
from fg_mujoco.display import Html, element, escaped, html
from fg_mujoco.messages import FloatArray
from fg_mujoco.pictures.pages.bokeh_plots import ALERT, mark, new_panel, put_legend_above, stacked
from fg_mujoco.pictures.pages.page import note, scroll
from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.simulation.cars import car_colour_hex
from fg_mujoco.simulation.telemetry import TELEMETRY

from .recorded import RecordedRun

if TYPE_CHECKING:
    from bokeh.models import UIElement

_MOST_ROWS = 200
_PANEL_HEIGHT = 170  # [px]


@dataclass(frozen=True, kw_only=True, eq=False)
class Field:
    """The cars of a race. Lists have one entry a car."""

    rows: list[dict[str, Any]]  # as in `cars` of the summary
    lines: list[FloatArray]  # where each drove until its race was over (k, 2) [m]
    standings: Any  # see addons.arena.race_control
    contacts: list[dict[str, Any]]
    overtakes: list[dict[str, Any]]

    @classmethod
    def of(cls, run: RecordedRun) -> Field | None:
        """Return the cars of a run; None where one was alone."""
        if not run.others:
            return None
        telemetries, rows = (run.telemetry, *run.others), run.summary["cars"]
        found = from_addons.standings(telemetries, rows)
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
    from bokeh.models import Range1d

    time = field.standings.time
    across = Range1d(0.0, max(float(time[-1]) if len(time) else 1.0, 1e-3), bounds="auto")
    widest = max(1.05 * float(np.nanmax(field.standings.gaps_s, initial=0.0)), 0.1)
    gaps = new_panel("gap to leader [s]", across, (widest, 0.0), _PANEL_HEIGHT)
    places = new_panel("position", across, (len(field.rows) + 0.4, 0.6), _PANEL_HEIGHT)
    places.yaxis.ticker = list(range(1, len(field.rows) + 1))
    for index, line in enumerate(field.lines):
        end, drawn = len(line), {"line_color": car_colour_hex(index), "line_width": 2.0}
        gaps.line(time[:end], field.standings.gaps_s[index, :end], legend_label=f"car {index}", **drawn)
        places.step(time[:end], field.standings.positions[index, :end], mode="after", **drawn)
    for panel in (gaps, places):
        mark(panel, [contact["time_s"] for contact in field.contacts[:_MOST_ROWS]], colour=ALERT, line_dash=[2, 3])
    put_legend_above(gaps)
    return stacked([gaps, places], "time [s]")


def said(field: Field, winner: str | None) -> Html:
    """Return a line about who won, and whose the figures at the head of the page are."""
    won = ["nobody finished"] if winner is None else [_named(field, winner), " won"]
    return escaped([f"{len(field.rows)} cars raced: ", *won, ". The figures here are of ", _car(field, 0), "."])


def cars_table(field: Field) -> Html:
    """Return the cars in the order of the result."""
    header = ("", "car", "planner", "vehicle", "laps", "best lap [s]", "end", "at [s]", "contacts", "walls",
              "top [m/s]", "greatest sliding [m/s]")  # fmt: skip
    rows = [
        (
            f"{row['position']}.", _car(field, index), str(row["controller"]), str(row["vehicle"]),
            row["laps_completed"], f"{min(row['lap_times_s']):.3f}" if row["lap_times_s"] else None,
            str(row["end_reason"]).replace("_", " "), f"{row['end_time_s']:.2f}", row["collisions_car"],
            row["collisions_wall"], f"{row['max_speed_m_s']:.2f}",
            None if row["max_slide_m_s"] is None else f"{row['max_slide_m_s']:.3f}",
        )
        for index, row in sorted(enumerate(field.rows), key=lambda one: int(one[1]["position"]))
    ]  # fmt: skip
    table = Table(header=header, rows=rows, left=("car", "planner", "vehicle"))
    return html("<h2>Cars</h2>{table}", table=scroll(table.html()))


def overtakes_table(field: Field) -> Html:
    """Return who overtook whom; a click on a row puts the cursor there."""
    rows = [
        (f"{each['time_s']:.2f}", _named(field, each["by"]), _named(field, each["of"]), f"{each['s_m']:.1f}")
        for each in field.overtakes[:_MOST_ROWS]
    ]
    return _moments("Overtakes", ("time [s]", "by", "of", "progress [m]"), ("by", "of"), rows, field.overtakes)


def contacts_table(field: Field) -> Html:
    """Return who touched whom; a click on a row puts the cursor there."""
    rows = [
        (
            f"{each['time_s']:.2f}", escaped([[_named(field, name), " "] for name in each["cars"]]),
            f"{each['impulse_Ns']:.2f}", f"{each['closing_speed_m_s']:.2f}", f"{100.0 * each['displacement_m']:.1f}",
            _named(field, each["at_fault"]), escaped(each.get("reason", "")),
        )
        for each in field.contacts[:_MOST_ROWS]
    ]  # fmt: skip
    header = ("time [s]", "cars", "impulse [Ns]", "closing speed [m/s]", "displaced by [cm]", "at fault", "reason")
    return _moments("Contacts", header, ("cars", "at fault", "reason"), rows, field.contacts)


def _moments(
    title: str,
    header: Sequence[str],
    left: Sequence[str],
    rows: Sequence[Sequence[object]],
    moments: Sequence[Mapping[str, Any]],
) -> Html:
    """Return the table of some moments of a race, below its title."""
    table = Table(header=header, rows=rows, left=left, times=[each["time_s"] for each in moments[:_MOST_ROWS]])
    more = note(f"The first {_MOST_ROWS} of {len(moments)}.") if len(moments) > _MOST_ROWS else None
    return escaped([element("h2", title), scroll(table.html()) if rows else note("None."), more])


def _named(field: Field, name: str) -> Html:
    """Return the name of a car behind its colour; one that is none of them is only written."""
    names = [row["name"] for row in field.rows]
    return _car(field, names.index(name)) if name in names else escaped(name)


def _car(field: Field, index: int) -> Html:
    swatch = element("span", index, class_="car", style=f"background:{car_colour_hex(index)}")
    return escaped([swatch, " ", field.rows[index]["name"]])
