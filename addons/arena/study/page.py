"""The page of a study: its table, and where planners drove, each on each course: the first run that did not succeed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fg_mujoco import from_addons
from fg_mujoco.display import Html, element, html
from fg_mujoco.pictures.pages.page import note, scroll, write_page
from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.racing.resolved import ground_of
from fg_mujoco.racing.setup import Setup

from ..runs.run import TRACE_STEP, RunRow
from .tables import conditions

_MOST_PICTURES = 60
_TICK = 0.025  # [s]
_BY_THEMSELVES = ("planner", "group", "course")  # what says itself what it is
_BODY = """<h1>{title}</h1>{table}{legend}
<h2>Where they drove</h2>
<p class="note">Of each planner on each course the first run that did not succeed, or else the first, with its setup,
which <code>fg-mujoco race --config FILE.toml</code> drives again.</p>{pictures}
"""


def write_study_page(head: str, table: Table, rows: Sequence[RunRow], path: Path) -> Path:
    """Write the page of a study and return its path.

    Raises:
      RunFolderError: it cannot be written.
    """
    names, chosen = conditions(rows), dict[tuple[object, ...], RunRow]()
    for row in rows:
        cell = tuple(row.place.get(name) for name in (*names, "drive"))
        if row.trace and (cell not in chosen or (chosen[cell].car.success and not row.car.success)):
            chosen[cell] = row
    shown = list(chosen.values())[:_MOST_PICTURES]
    left_out = note(f"{len(chosen) - len(shown)} more are left out.") if len(chosen) > len(shown) else None
    body = html(
        _BODY, title=head, table=scroll(table.html("words"), "whole"), legend=note(table.legend),
        pictures=[[_picture(row) for row in shown], left_out],
    )  # fmt: skip
    return write_page(path, head, body)


def _picture(row: RunRow) -> Html:
    """Return where a run was driven, how it ended, and its setup."""
    setup, points = Setup.read(row.setup), row.points
    ground = ground_of(setup)
    steps = np.hypot(*np.diff(points, axis=0).T) / (TRACE_STEP * _TICK)
    speeds = np.append(steps, steps[-1:]) if len(steps) else np.zeros(len(points))
    known = {name: value for name, value in row.place.items() if value is not None and name != "drive"}
    words = ", ".join(
        str(v) if name in _BY_THEMSELVES else f"{name.replace('_', ' ')} {v}" for name, v in known.items()
    )
    ended = row.figures.get("outcome") or row.car.end_reason.replace("_", " ")
    said = f"{words}: {ended}" + (f", {row.car.message}" if row.car.message else "")
    marks = [] if row.car.success or not len(points) else [(str(ended), tuple(points[-1]))]
    place, time = (ground.course, ground.obstacles), row.sim_time_s or 0.0
    drawn = from_addons.driven_line(*place, points, speeds, time=time, marks=marks, title=said)
    raced = None if row.checks else element("details", element("summary", "setup"), element("pre", setup.toml))
    return element("figure", Html(drawn), element("figcaption", said), raced)
