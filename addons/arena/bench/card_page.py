"""The page of a card: its scores beside those of the bundled planners, and its figures in each group."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fg_mujoco.controllers import BASELINES
from fg_mujoco.display import Html, element, html
from fg_mujoco.pictures.pages.page import boxes, note, scroll, write_page
from fg_mujoco.pictures.pages.table import Table

from .card import Card, recorded

_BODY = """<h1>{title}</h1><p class="result">{suite}</p>{figures}
<h2>With the bundled planners</h2>{beside}{legend}
{assists}
"""
_BAR = 220.0  # [px] of 100 %


def scores_table(scores: Mapping[str, Any], own: str = "") -> Table:
    """Return the scores of planners, the best at the first assist first; `own` is the planner that is marked."""
    assists = list(dict.fromkeys(assist for each in scores.values() for assist in each))

    def of(name: str, assist: str) -> float:
        return float(scores[name][assist]["score"]) if assist in scores[name] else 0.0

    rows = []
    for name in sorted(scores, key=lambda name: tuple(-of(name, assist) for assist in assists)):
        shown = [f"{of(name, assist):.1f}" if assist in scores[name] else None for assist in assists]
        kind = "looks at nothing" if name in BASELINES else "this card" if name == own else ""
        rows.append([name, *shown, kind])
    return Table(header=("planner", *(f"assist {assist}" for assist in assists), ""), rows=rows, left=("planner", ""))


def beside_table(card: Card) -> Table:
    """Return the score of a card among the recorded ones."""
    return scores_table({**recorded()["cards"], card.planner: card.described()["scores"]}, card.planner)


_HEADER = {
    "score": "score [%]", "finished": "finished", "lap_s": "best lap, mean [s]", "bound_s": "raceline [s]",
    "touches": "touches", "sliding_percent": "sliding [%]", "least_clearance_m": "least clearance [m]",
}  # fmt: skip


def groups_table(card: Card, assist: str) -> Table:
    """Return the figures of each group."""
    rows = [(group, *card.figures(assist, group).values()) for group in card.groups(assist)]
    return Table(header=("group", *_HEADER.values()), rows=rows, left=("group",))


def card_text(card: Card) -> str:
    """Return a card as a terminal shows it."""
    parts = [f"{card.planner}, suite {card.suite} ({card.suite_sha256[:12]})\n", beside_table(card).markdown()]
    parts += [f"\nassist {assist}\n\n{groups_table(card, assist).markdown()}" for assist in card.rows]
    return "".join(parts)


def write_card_page(card: Card, path: Path) -> Path:
    """Write the page of a card and return its path.

    Raises:
      RunFolderError: it cannot be written.
    """
    title = f"Card of {card.planner}"
    figures = [(f"{card.score(assist):.1f} %", f"score, assist {assist}") for assist in card.rows]
    slowest = [time for time in map(card.decision_ms, card.rows) if time is not None]
    if slowest:
        figures.append((f"{max(slowest):.2f} ms", "99 % of the decisions, on this machine"))
    body = html(
        _BODY, title=title, suite=f"suite {card.suite}, {card.suite_sha256[:12]}; fg_mujoco {card.version}",
        figures=boxes(figures), beside=scroll(beside_table(card).html("words"), "whole"),
        legend=note(
            "A run's completion is 1 if the car finished without a touch, else the share of its way that it drove. A "
            "score is the mean of the groups' mean completions, in percent. Planners without stages are driven once, "
            "with the assist none. Lap times are shown where all runs of a group finished, beside the bound of the "
            "raceline, which knows the course."
        ),
        assists=[_of_assist(card, assist) for assist in card.rows],
    )  # fmt: skip
    return write_page(path, title, body)


def _of_assist(card: Card, assist: str) -> list[Html]:
    """Return the part of the page for an assist: bars of the groups' scores, and their figures."""
    bars = []
    for group in card.groups(assist):
        score = card.score(assist, group)
        bar = element("rect", x="0", y="2", width=f"{0.01 * score * _BAR:.1f}", height="12", fill="currentColor")
        frame = element("rect", x="0", y="2", width=f"{_BAR:g}", height="12", fill="none", stroke="currentColor")
        picture = element("svg", bar, frame, width=f"{_BAR + 2:g}", height="16")
        bars.append(html("<tr><td>{g}</td><td>{p}</td><td>{s}</td></tr>", g=group, p=picture, s=f"{score:.1f} %"))
    ends = [
        (
            row["group"], row["course"], row.get("obstacle_seed"),
            ": ".join(filter(None, (row["end_reason"], row["message"]))), f"{100.0 * row['completion']:.0f} %",
        )
        for row in card.rows[assist] if not row["success"]
    ]  # fmt: skip
    unfinished = Table(header=("group", "track", "seed", "end", "way"), rows=ends, left=("group", "track", "end"))
    return [
        element("h2", f"Assist {assist}"), html('<table class="settings"><tbody>{bars}</tbody></table>', bars=bars),
        scroll(groups_table(card, assist).html("words"), "whole"), element("h3", "Runs that did not finish"),
        scroll(unfinished.html("words"), "whole") if ends else note("None."),
    ]  # fmt: skip
