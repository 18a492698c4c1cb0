"""The tables of a league: standings, who beat whom, and points by track.

heats.csv      a row a heat
results.csv    a row for each car of each heat
incidents.csv  a row for each contact, with race control's verdict
table.csv      the standings: a row a planner
table.md       the standings, and who beat whom, as Markdown
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fg_mujoco.pictures.pages.table import Table

from ..grid_study import GridCell
from .heat import CarFigures, HeatRow, beaten
from .ratings import ratings

FAILURES = ("planner_failed", "decision_limit", "worker_died")
"""Ends of races that are the planner's failure, not the driving's."""


@dataclass(frozen=True, kw_only=True)
class Standing(GridCell):
    """How a planner fared in all heats."""

    place: int
    planner: str
    heats: int
    points: int
    wins: int
    finished: int
    failures: int  # heats in which its planner raised, took too long, or ended the process
    rating: float | None  # None: no heats connect it with the others
    rating_low: float | None  # lower end of the interval at 95 %
    rating_high: float | None
    overtakes: int
    incidents: int  # contacts
    at_fault: int  # contacts that were its fault, alone or with the other car
    disqualified: int


def planners_of(rows: Sequence[HeatRow]) -> list[str]:
    """Return the planners of some heats, in the order in which they appear."""
    return list(dict.fromkeys(planner for row in rows for planner in row.key.planners))


def wins_of(rows: Sequence[HeatRow]) -> np.ndarray:
    """Return how often planner i finished before planner j, in the order of `planners_of`. Shape (n, n)."""
    planners = planners_of(rows)
    wins = np.zeros((len(planners), len(planners)))
    for pair, count in Counter(pair for row in rows for pair in beaten(row.cars)).items():
        wins[planners.index(pair[0]), planners.index(pair[1])] = count
    return wins


def make_standings(rows: Sequence[HeatRow]) -> tuple[Standing, ...]:
    """Return the standings after some heats: by points, then by wins, then by rating."""
    planners, found = planners_of(rows), ratings(wins_of(rows))
    standings = []
    for planner, *rating in zip(planners, found.value.tolist(), found.low.tolist(), found.high.tolist(), strict=True):
        cars = [car for row in rows for car in row.cars if car.planner == planner]
        value, low, high = (None if math.isnan(each) else each for each in rating)
        standings.append(
            Standing(
                place=0, planner=planner, heats=len(cars), points=sum(car.points for car in cars),
                wins=sum(_won(car) for car in cars), finished=sum(car.position is not None for car in cars),
                failures=sum(car.end_reason in FAILURES for car in cars), rating=value, rating_low=low,
                rating_high=high, overtakes=sum(car.overtakes for car in cars),
                incidents=sum(car.contacts for car in cars), at_fault=sum(car.at_fault for car in cars),
                disqualified=sum(car.end_reason == "disqualified" for car in cars),
            )
        )  # fmt: skip
    standings.sort(key=lambda each: (-each.points, -each.wins, -(each.rating or 0.0), each.planner))
    return tuple(
        Standing(**vars(each) | {"place": 1 + sum(_score(other) > _score(each) for other in standings)})
        for each in standings
    )


def _won(car: CarFigures) -> bool:
    return car.position == 1


def _score(standing: Standing) -> tuple[int, int]:
    return standing.points, standing.wins


def standings_table(standings: Sequence[Standing]) -> Table:
    """Return the standings for people."""
    return Table(
        header=("", "planner", "points", "heats", "wins", "rating", "95 % interval", "finished", "failed", "overtakes",
                "incidents", "at fault", "disqualified"),
        rows=[
            (
                f"{each.place}.", each.planner, each.points, each.heats, each.wins,
                None if each.rating is None else f"{each.rating:.0f}",
                None if each.rating_low is None else f"{each.rating_low:.0f} to {each.rating_high:.0f}",
                each.finished, each.failures, each.overtakes, each.incidents, each.at_fault, each.disqualified,
            )
            for each in standings
        ],
        left=("planner",),
        legend=(
            "A car has a point for each car of its heat that it beats: it finished, the other one later or not at all. "
            "Ratings are Bradley-Terry's with Jeffreys' prior (Firth 1993), 100 points more are 64 % of the wins, and "
            "their intervals follow from the curvature of the likelihood. Failed: the planner raised, took too long "
            "for a decision, or ended the process."
        ),
    )  # fmt: skip


def beaten_table(rows: Sequence[HeatRow], standings: Sequence[Standing]) -> Table:
    """Return how often each planner finished before each other one, of how many heats that both drove."""
    planners, wins = planners_of(rows), wins_of(rows)
    met = Counter((one, other) for row in rows for one in row.key.planners for other in row.key.planners)
    order = [each.planner for each in standings]
    lines = [
        (
            planner,
            *(
                f"{int(wins[planners.index(planner), planners.index(other)])} of {met[planner, other]}"
                if planner != other and met[planner, other] else None
                for other in order
            ),
        )
        for planner in order
    ]  # fmt: skip
    return Table(
        header=("beats", *order), rows=lines, left=("beats",),
        legend="Heats of which the planner of the row finished before that of the column, of all that both drove.",
    )  # fmt: skip


def tracks_table(rows: Sequence[HeatRow], standings: Sequence[Standing]) -> Table:
    """Return the points by track, and the wins of the car that started in front."""
    tracks = list(dict.fromkeys(row.key.track for row in rows))
    points = Counter[tuple[str, str]]()
    front = Counter[str]()
    for row in rows:
        for car in row.cars:
            points[car.planner, row.key.track] += car.points
            front[row.key.track] += car.place == 1 and car.position == 1
    heats = Counter(row.key.track for row in rows)
    lines: list[tuple[object, ...]] = [
        (each.planner, *(points[each.planner, track] for track in tracks)) for each in standings
    ]
    lines.append(("won from the front", *(f"{front[track]} of {heats[track]}" for track in tracks)))
    return Table(header=("points on", *tracks), rows=lines, left=("points on",))
