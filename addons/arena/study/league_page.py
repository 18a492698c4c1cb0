"""The page of a league: standings, every heat, and every incident, which can be played.

It is one file that loads nothing. Its script draws the incidents from the poses of the cars over the track.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fg_mujoco.course.course import wall_outlines
from fg_mujoco.display import Html, element, escaped, html
from fg_mujoco.pictures.pages.page import boxes, note, resource, result, scroll, write_page
from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.racing.resolved import ground_of
from fg_mujoco.simulation.cars import car_colour_hex
from fg_mujoco.simulation.course_loading import load_track

from ..runs.incidents import Incident
from ..runs.run import FAILURES, CarFigures, Run, RunRow
from .store import Study

_CENTIMETRES = 100.0
_STYLE = """
.clips { display: grid; grid-template-columns: repeat(auto-fill, minmax(330px, 1fr)); gap: 18px; margin-top: 12px; }
.clips figure { border: 1px solid var(--line); border-radius: 8px; padding: 8px; background: var(--card); }
.clips svg { width: 100%; cursor: pointer; }
.clips .verdict { font-weight: 600; }
.clips figcaption { color: var(--ink); }
.clips input { width: 100%; margin: 4px 0 0; }
select { font: inherit; padding: 3px 6px; }
"""
_BODY = """<h1>{title}</h1>{result}{figures}
<h2>Standings</h2>{standings}
<h2>Who beat whom</h2>{beaten}
<h2>Points by track</h2>{tracks}
{failures}
<h2>Incidents</h2>{summary}{choice}<div class="clips">{clips}</div>
<h2>Heats</h2>{heats}
<h2>Proof</h2><p>Each heat is a file in <code>heats</code>, named as in the table. From the folder in which the league
was driven,</p><pre>fg-mujoco race --config {folder}/heats/{first}.toml --out runs/heat
fg-mujoco replay runs/heat</pre><p>drives it again and simulates it once more without the planners. The summary has the
<code>trajectory_sha256</code> of <code>heats.csv</code>. With <code>--keep-runs</code> the run folders are in
<code>runs</code>.</p>
"""

_PLAYED = """<p class="note">Each contact from 2 s before the touch to 1 s after it. A click plays it at a third of the
speed, and the slider moves it. Outlines are 0.5 s apart, a circle marks the touch. The car with the number 1 started in
front.</p><label>Incidents of <select id="of-planner">{options}</select></label>"""


def write_league_page(found: Study, tables: Mapping[str, Table], heats: Sequence[Run], path: Path) -> Path:
    """Write the page of a league and return its path.

    Args:
      found: the league.
      tables: its standings, who has beaten whom, and the points by track: `standings`, `beaten`, `tracks`.
      heats: of it, in the order of its rows.
      path: of the page.

    Raises:
      RunFolderError: it cannot be written.
    """
    rows = found.rows
    anchors = {(row.name, number): f"incident-{row.key[:8]}-{number}" for row in rows
               for number in range(len(row.incidents))}  # fmt: skip
    incidents = [(row, number, each) for row in rows for number, each in enumerate(row.incidents)]
    winners = [each for each in found.cells if each["place"] == 1]
    planners = [each["planner"] for each in found.cells]
    tracks = list(dict.fromkeys(row.place["course"] for row in rows))
    body = html(
        _BODY, title=f"{found.folder.resolve().name}: league of {len(planners)} planners",
        result=result(
            "first", True, f"{' and '.join(each['planner'] for each in winners)}, {winners[0]['points']} points in "
            f"{winners[0]['runs']} heats",
        ),
        figures=boxes([
            (str(len(rows)), "heats"), (", ".join(tracks), "tracks"), (str(len(incidents)), "incidents"),
            (str(sum(each["failures"] for each in found.cells)), "failures of planners"),
        ]),
        **{name: _whole(table) for name, table in tables.items()}, failures=_failures(rows),
        summary=_verdicts(incidents),
        choice=_choice(planners) if incidents else None,
        clips=[_clip(row, each, anchors[row.name, number], i) for i, (row, number, each) in enumerate(incidents)],
        heats=scroll(_heats_table(rows, anchors).html()), folder=found.folder, first=rows[0].name,
    )  # fmt: skip
    data = {"tracks": _edges(heats), "sizes": _sizes(heats),
            "clips": [_data(row, each, tracks.index(row.place["course"])) for row, _, each in incidents]}  # fmt: skip
    script = resource(__package__, "league.js") if incidents else ""
    return write_page(path, f"{found.folder.resolve().name}: league", body, script=script, data=data, style=_STYLE)


def _whole(table: Table) -> Html:
    return escaped([scroll(table.html(), "whole"), note(table.legend) if table.legend else None])


def _failures(rows: Sequence[RunRow]) -> Html | None:
    """Return the heats that a planner lost by a failure, and those that failed otherwise, with the reason."""
    lines = [
        element("li", f"{car.planner}, {row.place['course']} ({row.name}): {_end(car)}")
        for row in rows for car in row.cars if car.end_reason in FAILURES
    ]  # fmt: skip
    lines += [
        element("li", f"{row.name}: no result: {row.message}")
        for row in rows
        if row.message is not None and all(car.end_reason not in FAILURES for car in row.cars)
    ]
    return html('<h2>Failures</h2><ul class="note">{lines}</ul>', lines=lines) if lines else None


def _end(car: CarFigures) -> str:
    reason = car.end_reason.replace("_", " ") or "ended with the heat"
    return reason if car.message is None else f"{reason}: {car.message}"


def _verdicts(incidents: Sequence[tuple[RunRow, int, Incident]]) -> Html:
    """Return how often each reason was given."""
    if not incidents:
        return note("No two cars touched.")
    reasons = Counter((each.reason, _kind(each)) for _, _, each in incidents)
    rows = [(reason, kind, count) for (reason, kind), count in reasons.most_common()]
    table = Table(header=("reason", "verdict", "incidents"), rows=rows, left=("reason", "verdict"))
    return scroll(table.html(), "whole")


def _kind(incident: Incident) -> str:
    return "one at fault" if incident.at_fault in (incident.car, incident.other) else incident.at_fault


def _choice(planners: Sequence[str]) -> Html:
    options = [
        element("option", text, value=value)
        for value, text in (("", "all planners"), *((each, each) for each in planners))
    ]
    return html(_PLAYED, options=options)


def _clip(row: RunRow, incident: Incident, anchor: str, number: int) -> Html:
    cars = [
        escaped([_swatch(row, name), " ", name, Html("<br>") if place == 0 else None])
        for place, name in enumerate((incident.car, incident.other))
    ]
    fault = incident.at_fault if _kind(incident) != "one at fault" else f"at fault: {incident.at_fault}"
    told = f"{row.place['course']}, {incident.time_s:.2f} s, closing at {incident.closing_speed_m_s:.2f} m/s, "
    return html(
        '<figure id="{anchor}" data-clip="{number}" data-cars="{names}"><div class="picture"></div><figcaption>{cars}'
        '<br><span class="verdict">{fault}</span>: {reason}<br><span class="note">{told}</span></figcaption></figure>',
        anchor=anchor, number=number, names="|".join((incident.car, incident.other)), cars=cars, fault=fault,
        reason=incident.reason, told=f"{told}displaced by {100.0 * incident.displacement_m:.0f} cm; {row.name}",
    )  # fmt: skip


def _swatch(row: RunRow, planner: str) -> Html:
    place = _planners(row).index(planner)
    return element("span", place + 1, class_="car", style=f"background:{car_colour_hex(place)}")


def _heats_table(rows: Sequence[RunRow], anchors: dict[tuple[str, int], str]) -> Table:
    lines = []
    for row in rows:
        links = [
            escaped([element("a", f"{each.time_s:.1f} s", href=f"#{anchors[row.name, number]}"), " "])
            for number, each in enumerate(row.incidents)
        ]
        cars = [
            element("div", _swatch(row, car.planner), f" {car.position if car.finished else '-'}. {car.planner}: ",
                    f"{car.laps_completed} laps{_best(car)}, {_end(car)}")
            for car in sorted(row.cars, key=lambda car: (not car.finished, car.position or 0, car.started or 0))
        ]  # fmt: skip
        overtakes = sum(car.overtakes or 0 for car in row.cars)
        lines.append((row.name, row.place["course"], row.winner, escaped(cars), overtakes, links))
    return Table(
        header=("heat", "track", "winner", "cars", "overtakes", "incidents"), rows=lines,
        left=("heat", "track", "winner", "cars", "incidents"),
    )  # fmt: skip


def _best(car: CarFigures) -> str:
    return "" if car.best_lap_s is None else f", best {car.best_lap_s:.2f} s"


def _planners(row: RunRow) -> list[str]:
    return [car.planner for car in row.cars]


def _edges(heats: Sequence[Run]) -> list[list[list[int]]]:
    """Return the edges of each track, each a list of x, y and so on [cm]."""
    found = []
    for track in dict.fromkeys(heat.place["course"] for heat in heats):
        setup = next(heat.setup for heat in heats if heat.place["course"] == track)
        course = load_track(setup.track, car=setup.first.car.parameters)
        obstacles = ground_of(setup, course).boxes
        outlines = [*wall_outlines(course), *(each.corners() for each in (*course.obstacles, *obstacles))]
        found.append([np.rint(_CENTIMETRES * each).astype(int).ravel().tolist() for each in outlines])
    return found


def _sizes(heats: Sequence[Run]) -> dict[str, list[float]]:
    """Return of each planner's car its length, its width and its rear overhang [m]."""
    entries = {str(entry.name): entry.car.parameters for heat in heats for entry in heat.setup.entries}
    return {name: [car.length, car.width, car.rear_overhang] for name, car in entries.items()}


def _data(row: RunRow, incident: Incident, track: int) -> dict[str, Any]:
    planners = _planners(row)
    return {
        "track": track, "cars": planners, "pair": [planners.index(incident.car), planners.index(incident.other)],
        "colours": [car_colour_hex(place) for place in range(len(planners))], "x": round(incident.x_m, 3),
        "y": round(incident.y_m, 3), "touch": round((incident.time_s - incident.first_s) / incident.step_s),
        "step": incident.step_s, "poses": incident.poses,
    }  # fmt: skip
