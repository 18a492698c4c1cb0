"""The kinds of studies, by what their runs are: alone, heats, duels, checks. Each has its tables and its pages."""

from __future__ import annotations

import math
import re
import statistics
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fg_mujoco.arguments import explain_class
from fg_mujoco.course.writing import write_file
from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.racing.entries import BOTH
from fg_mujoco.rollouts.store import as_json

from ..runs.duels import SAFE
from ..runs.run import FAILURES, Checked, Run, RunRow
from .grade_page import write_grade_page
from .intervals import ALL, Differences
from .league_page import write_league_page
from .ratings import ratings
from .store import Study, lines_of
from .tables import (
    Cell,
    Line,
    cells_of,
    conditions,
    count,
    ends,
    fixed,
    interval,
    of,
    plain,
    quartiles,
    share_of,
    spread,
    table_of,
)


def _alone(runs: Sequence[Line]) -> Cell:
    """Return how a planner fared in some runs; lap times are of the successes alone."""
    won = [run for run in runs if run["success"]]
    among = [run for run in runs if run["position"] is not None]
    total = {name: of(sum, among, name) for name in ("overtakes", "overtaken", "contacts", "at_fault")}
    return {
        "runs": len(runs), **count("successes", runs, lambda run: run["success"]), "end_reasons": ends(runs),
        "laps_completed": sum(run["laps_completed"] for run in runs),
        "laps_requested": sum(run["laps_requested"] for run in runs), **spread("best_lap_s", won, "best_lap_s"),
        "mean_lap_s": of(statistics.fmean, won, "mean_lap_s"), "collisions": sum(run["collisions"] for run in runs),
        "slide_time_fraction": of(statistics.fmean, runs, "slide_time_fraction"),
        "max_slide_m_s": of(max, runs, "max_slide_m_s"), "least_clearance_m": of(min, runs, "least_clearance_m"),
        "wrong_way_time_s": of(sum, runs, "wrong_way_time_s"), "completion": of(statistics.fmean, runs, "completion"),
        "won": sum(run["position"] == 1 and run["finished"] for run in among) if among else None,
        "mean_position": of(statistics.fmean, among, "position"), **total,
    }  # fmt: skip


_ALONE = (
    ("success", share_of("successes")), ("95 % interval", interval("successes")),
    ("laps", lambda cell: f"{cell['laps_completed']}/{cell['laps_requested']}"), ("best lap [s]", fixed("best_lap_s")),
    ("quartiles [s]", quartiles("best_lap_s")), ("mean lap [s]", fixed("mean_lap_s")),
    ("of runs", plain("best_lap_s_of")),
    ("not finished", lambda cell: cell["end_reasons"] if cell["successes"] < cell["runs"] else None),
    ("collisions", plain("collisions")), ("sliding", fixed("slide_time_fraction", ".1f", 100.0, " %")),
    ("least clearance [m]", fixed("least_clearance_m", ".3f")), ("wrong way [s]", fixed("wrong_way_time_s", ".1f")),
    ("won", plain("won")), ("mean position", fixed("mean_position", ".1f")), ("overtakes", plain("overtakes")),
    ("overtaken", plain("overtaken")), ("contacts", plain("contacts")), ("at fault", plain("at_fault")),
)  # fmt: skip


@explain_class
class Comparison(Study):
    """How planners fared alone, or against the same opponents."""

    differences_of = Differences(
        by=("course", "max_speed", "mu"), value="best_lap_s", title="best lap [s]", success="success"
    )

    @staticmethod
    def make_cells(rows: Sequence[RunRow]) -> tuple[Cell, ...]:
        """See Study."""
        return cells_of(lines_of(rows), [("planner", *conditions(rows, always=("course",)))], _alone)

    def _tables(self) -> list[Table]:
        places = ("planner", *conditions(self.rows, always=("course",)))
        legend = (
            "A success has finished and touched nothing but other cars; the interval of its share is Wilson's at 95 %. "
            'Lap times are of the successes alone, whose number is "of runs": the median of their best laps with its '
            "quartiles, and the mean of their mean laps. An interval is given only where runs differ."
        )
        return [table_of(self.cells, places, _ALONE, legend)]

    def draw(self, runs: Sequence[Run]) -> None:
        """Write the picture of the table and, of runs with a trace, one of each course."""
        out = self.folder
        for picture in (out / "table.png", *(out / "traces").glob("*.png")):
            picture.unlink(missing_ok=True)
        if any(run.traced for run in runs):
            from .pictures import table_picture, trace_pictures

            table_picture(self.cells, out / "table.png")
            (out / "traces").mkdir(exist_ok=True)
            trace_pictures(runs, self.rows, out / "traces")


def _duels(runs: Sequence[Line]) -> Cell:
    won = [run for run in runs if run["outcome"] == "overtaken"]
    outcomes = Counter(run["outcome"] for run in runs)
    blamed = lambda run: run.get("to_blame") in ("planner", BOTH)  # noqa: E731
    return {
        "runs": len(runs), **count("overtaken", runs, lambda run: run["outcome"] == "overtaken"),
        **count("safe", runs, lambda run: run["outcome"] in SAFE), "behind": outcomes["behind"],
        "touches": outcomes["touch"], **count("to_blame", runs, blamed), "walls": outcomes["wall"],
        "others": outcomes["stopped"] + outcomes["failed"], **spread("time_lost_s", won, "time_lost_s"),
        "taken_s": of(statistics.median, won, "taken_s"),
    }  # fmt: skip


_PARTS = ("opponent", "speed", "course")


def _percent(name: str) -> Any:
    return lambda cell: f"{100.0 * cell[name] / cell['runs']:.1f} %"


_DUELS = (
    ("duels", plain("runs")), ("overtaken", _percent("overtaken")),
    ("95 % interval", interval("overtaken", form=".1f", unit="")), ("safe", _percent("safe")),
    ("95 % interval ", interval("safe", form=".1f", unit="")), ("behind", plain("behind")),
    ("touches", plain("touches")),
    ("to blame for", lambda cell: f"{cell['to_blame']} ({100.0 * cell['to_blame'] / cell['runs']:.1f} %)"),
    ("walls", plain("walls")), ("otherwise ended", plain("others")), ("median time lost [s]", fixed("time_lost_s")),
    ("quartiles [s]", quartiles("time_lost_s")), ("of overtakes", plain("time_lost_s_of")),
)  # fmt: skip


@explain_class
class Overtaking(Study):
    """How planners fared behind slower cars."""

    differences_of = Differences(
        by=("course",), value="time_lost_s", title="time lost [s]", success="overtaken"
    )

    @staticmethod
    def make_cells(rows: Sequence[RunRow]) -> tuple[Cell, ...]:
        """See Study. Cells are by opponent, by its speed and by course, and over all."""
        lines = lines_of(rows)
        own = conditions(rows, but=(*_PARTS, "start_m", "headway_m", "offset_m"))
        parts = [name for name in _PARTS if any(name in line for line in lines)]
        groupings = [(*own, *of_part) for of_part in ([*parts], *([name] for name in parts), [])]
        return cells_of(lines, [("planner", *grouping) for grouping in groupings], _duels)

    def _tables(self) -> list[Table]:
        places = list(self.cells[0])[: list(self.cells[0]).index("runs")]
        parts = [name for name in places if name in _PARTS]
        few = [cell for cell in self.cells if sum(cell[name] != ALL for name in parts) <= 1]
        legend = (
            "A duel that is overtaken, and one that is safe, ends without a touch; intervals are Wilson's at 95 %. "
            'Times lost are of overtakes, against the planner alone; "of overtakes" says of how many. The speed is a '
            "share of the opponent's own."
        )
        return [table_of(few, places, _DUELS, legend)]

    def draw(self, runs: Sequence[Run]) -> None:
        """Write the picture of overtakes by the ratio of the speeds, if it is asked for."""
        if any(run.traced for run in runs):
            from .pictures import ratio_picture

            ratio_picture(self.lines, self.folder / "table.png")


def beaten(line_up: Sequence[Line]) -> list[tuple[str, str]]:
    """Return each pair of planners of a heat of which the first finished before the second, or alone did."""
    return [
        (one["planner"], other["planner"])
        for one in line_up
        for other in line_up
        if one["finished"] and (not other["finished"] or other["position"] > one["position"])
    ]


@explain_class
class League(Study):
    """How planners fared in heats. A cell is a planner's standing: by points, then by wins, then by rating."""

    @staticmethod
    def make_cells(rows: Sequence[RunRow]) -> tuple[Cell, ...]:
        """See Study."""
        lines = lines_of(rows)
        planners = list(dict.fromkeys(line["planner"] for line in lines))
        found, wins = ratings(wins_of(lines, planners)), []
        for number, planner in enumerate(planners):
            own = [line for line in lines if line["planner"] == planner]
            rated = (float(each[number]) for each in (found.value, found.low, found.high))
            value, low, high = (None if math.isnan(each) else each for each in rated)
            wins.append({
                "place": 0, "planner": planner, "runs": len(own), "points": sum(line["points"] for line in own),
                "wins": sum(line["finished"] and line["position"] == 1 for line in own),
                "finished": sum(line["finished"] for line in own),
                "failures": sum(line["end_reason"] in FAILURES for line in own), "rating": value, "rating_low": low,
                "rating_high": high, "overtakes": sum(line["overtakes"] for line in own),
                "incidents": sum(line["contacts"] for line in own), "at_fault": sum(line["at_fault"] for line in own),
                "disqualified": sum(line["end_reason"] == "disqualified" for line in own),
            })  # fmt: skip
        wins.sort(key=lambda each: (-each["points"], -each["wins"], -(each["rating"] or 0.0), each["planner"]))
        scores = [(each["points"], each["wins"]) for each in wins]
        return tuple(
            each | {"place": 1 + sum(other > score for other in scores)}
            for each, score in zip(wins, scores, strict=True)
        )

    def _tables(self) -> list[Table]:
        return [self.standings(), self.beaten()]

    def standings(self) -> Table:
        """Return the standings for people."""
        columns = (
            ("points", plain("points")), ("heats", plain("runs")), ("wins", plain("wins")),
            ("rating", fixed("rating", ".0f")), ("95 % interval", interval("rating", 1.0, ".0f", "")),
            ("finished", plain("finished")), ("failed", plain("failures")), ("overtakes", plain("overtakes")),
            ("incidents", plain("incidents")), ("at fault", plain("at_fault")), ("disqualified", plain("disqualified")),
        )  # fmt: skip
        return table_of(
            self.cells, ("place", "planner"), columns,
            "A car has a point for each car of its heat that it beats: it finished, the other one later or not at all. "
            "Ratings are Bradley-Terry's with Jeffreys' prior (Firth 1993), 100 points more are 64 % of the wins, and "
            "their intervals follow from the curvature of the likelihood. Failed: the planner raised, took too long "
            "for a decision, or ended the process.",
        )  # fmt: skip

    def beaten(self) -> Table:
        """Return how often each planner finished before each other one, of how many heats that both drove."""
        order = [cell["planner"] for cell in self.cells]
        wins, met = wins_of(self.lines, order), Counter[tuple[str, str]]()
        for row in self.rows:
            met.update((one.planner, other.planner) for one in row.cars for other in row.cars if one is not other)
        lines = [
            (one, *(f"{int(wins[i, j])} of {met[one, other]}" if met[one, other] else None
                    for j, other in enumerate(order)))
            for i, one in enumerate(order)
        ]  # fmt: skip
        return Table(
            header=("beats", *order), rows=lines, left=("beats",),
            legend="Heats of which the planner of the row finished before that of the column, of all that both drove.",
        )  # fmt: skip

    def by_course(self) -> Table:
        """Return the points by course, and the wins of the car that started in front."""
        courses = list(dict.fromkeys(row.place["course"] for row in self.rows))
        points, front = Counter[tuple[str, str]](), Counter[str]()
        for row in self.rows:
            for car in row.cars:
                points[car.planner, row.place["course"]] += car.points or 0
                front[row.place["course"]] += car.started == 1 and car.finished and car.position == 1
        heats = Counter(row.place["course"] for row in self.rows)
        lines: list[tuple[object, ...]] = [
            (cell["planner"], *(points[cell["planner"], course] for course in courses)) for cell in self.cells
        ]
        lines.append(("won from the front", *(f"{front[course]} of {heats[course]}" for course in courses)))
        return Table(header=("points on", *courses), rows=lines, left=("points on",))

    def texts(self) -> dict[str, str]:
        """See Study; and a row for each contact, with race control's verdict."""
        names = ("run", "course", "time_s", "car", "other", "closing_speed_m_s", "displacement_m", "at_fault", "reason",
                 "x_m", "y_m")  # fmt: skip
        incidents = [
            {"run": row.name, "course": row.place["course"]} | each.as_dict()
            for row in self.rows for each in row.incidents
        ]  # fmt: skip
        return super().texts() | {"incidents.csv": Table.of(incidents, names).csv()}

    def draw(self, runs: Sequence[Run]) -> None:
        """Write the page, and a file for each heat, with which it can be raced again."""
        (self.folder / "heats").mkdir(exist_ok=True)
        for stale in (self.folder / "heats").glob("*.toml"):
            stale.unlink()
        for run, row in zip(runs, self.rows, strict=True):
            write_file(self.folder / "heats" / f"{row.name}.toml", run.setup.toml.encode())
        tables = {"standings": self.standings(), "beaten": self.beaten(), "tracks": self.by_course()}
        write_league_page(self, tables, runs, self.folder / "league.html")


def wins_of(lines: Sequence[Line], planners: Sequence[str]) -> np.ndarray:
    """Return how often planner i finished before planner j. Shape (n, n)."""
    heats: dict[str, list[Line]] = {}
    for line in lines:
        heats.setdefault(line["run"], []).append(line)
    wins = np.zeros((len(planners), len(planners)))
    for pair, number in Counter(pair for heat in heats.values() for pair in beaten(heat)).items():
        wins[planners.index(pair[0]), planners.index(pair[1])] = number
    return wins


@explain_class
class Grades(Study):
    """The points of planners in checks. A cell is a planner's grade."""

    @staticmethod
    def make_cells(rows: Sequence[RunRow]) -> tuple[Cell, ...]:
        """See Study: points, all that there are, checks that were passed, why it failed, and each check's points."""
        grades = []
        for planner in dict.fromkeys(row.car.planner for row in rows):
            checks = checks_of(rows, planner)
            failed = dict.fromkeys(row.message for row in rows if row.car.planner == planner)
            grades.append(
                {"planner": planner, "points": sum(each.points for each in checks),
                 "of": sum(each.of for each in checks), "passed": sum(each.passed for each in checks),
                 "reason": "; ".join(filter(None, failed)) or None}
                | {each.name: each.points for each in checks}
            )  # fmt: skip
        return tuple(grades)

    def table_of_checks(self, planner: str) -> Table:
        """Return a row for each check of a planner."""
        checks = checks_of(self.rows, planner)
        rows = [
            (each.name, each.asked, each.measured, "yes" if each.passed else "no", f"{each.points:g} of {each.of:g}")
            for each in checks
        ]
        rows.append((planner, "", "", "", f"{sum(c.points for c in checks):g} of {sum(c.of for c in checks):g}"))
        header = ("check", "asked", "measured", "passed", "points")
        return Table(header=header, rows=rows, left=header[:4])

    def _tables(self) -> list[Table]:
        if len(self.cells) == 1:
            return [self.table_of_checks(self.cells[0]["planner"])]
        names = list(self.cells[0])[5:]
        rows = [
            (each["planner"], f"{each['points']:g} of {each['of']:g}", *(f"{each[n]:g}" for n in names), each["reason"])
            for each in self.cells
        ]
        header = ("planner", "points", *names, "why it failed")
        return [Table(header=header, rows=rows, left=(header[0], header[-1]))]

    def texts(self) -> dict[str, str]:
        """See Study."""
        found = [
            each | {"checks": [vars(check) for check in checks_of(self.rows, each["planner"])]} for each in self.cells
        ]
        return super().texts() | {"grades.json": as_json({"grades": found}) + "\n"}

    def draw(self, runs: Sequence[Run]) -> None:
        """Write the page of each planner."""
        for name, grade in zip(page_names([cell["planner"] for cell in self.cells]), self.cells, strict=True):
            write_grade_page(self, grade, self.table_of_checks(grade["planner"]), self.folder / name)


def checks_of(rows: Sequence[RunRow], planner: str) -> list[Checked]:
    """Return the checks of a planner, in the order of the suite."""
    found = [check for row in rows if row.car.planner == planner for check in row.checks]
    return sorted(found, key=lambda check: check.number)


def page_names(planners: Sequence[str]) -> list[str]:
    """Return the name of the page's file of each planner."""
    names: list[str] = []
    for planner in planners:
        stem = re.sub(r"[^A-Za-z0-9.+-]+", "_", planner)[-80:].strip("._") or "planner"
        number = sum(name.startswith((f"{stem}.", f"{stem}_")) for name in names)
        names.append(f"{stem}{f'_{number + 1}' if number else ''}.html")
    return names


KINDS: Mapping[str, type[Study]] = {"alone": Comparison, "heats": League, "duels": Overtaking, "checks": Grades}
"""By the kind of a suite."""

