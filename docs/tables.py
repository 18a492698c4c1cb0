"""Fills the tables of README.md and docs/ from docs/figures.json and from docstrings.

    python docs/tables.py           # rewrites the lines between the markers
    python docs/tables.py --check   # exits with 1 where a page says something else

A table stands between `<!-- table NAME: made by make figures -->` and `<!-- end of table -->`. TABLES has the function
that makes each. `python benchmarks/circuits.py --json docs/figures.json` drives the races of the figures.
"""

from __future__ import annotations

import ast
import json
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
PAGES = ("README.md", "docs/results.md", "docs/planners.md", "docs/friction.md")

BUNDLED = ("oval", "l_corridor", "hairpins", "chicanes", "fast", "tight")
REAL = ("Spielberg", "Monza", "Zandvoort")
PUBLISHED = {  # [s] lap from a standing start: follow-the-gap on LiDAR alone, and an optimised raceline with a map
    "aut": (19.10, 16.79),
    "esp": (45.78, 35.92),
    "gbr": (39.34, 31.24),
    "mco": (34.99, 28.08),
}
"""Of the survey "Unifying F1TENTH Autonomous Racing" (its benchmark notebooks: 8 m/s limit, mu 1.0489)."""

SCENES = {  # heads of the columns, and their scenes
    "corridors, cylinders": ("corridor_sparse", "corridor_dense", "cylinder_field"),
    "gap 1.2": ("narrow_gap_120",),
    "gaps 1.5, 2": ("narrow_gap_150", "narrow_gap_200"),
    "crossing box": ("crossing_box",),
    "others": ("square_corner", "dead_end", "u_turn_trap", "wrong_side_chicane", "slow_leader"),
}
SUMMARY = ("chicanes", "tight", "Spielberg", "ESP", "random:0 to random:19")  # circuits on the first page
LAPS = ("laps", "lap from a standing start [s]", "best of five laps [s]", "greatest slide [m/s]")
WITH_A_MAP = ("pure_pursuit",)
OF_ADDONS = ("overtaker.py", "pure_pursuit.py")

MARKED = re.compile(r"(<!-- table (\w+): made by make figures -->\n).*?(<!-- end of table -->)", re.DOTALL)


def filled(page: str, figures: dict[str, Any]) -> str:
    """Return the text of a page with its tables filled.

    Raises:
      KeyError: a marker names a table that is not in TABLES.
    """
    return MARKED.sub(lambda found: f"{found[1]}\n{TABLES[found[2]](figures)}\n\n{found[3]}", page)


def controllers(figures: dict[str, Any]) -> str:
    """Return the planners, with the first line of each one's docstring."""
    rows = []
    files = [*(ROOT / "controllers").glob("*.py"), *(ROOT / "addons" / "drivers" / name for name in OF_ADDONS)]
    for path in sorted(files, key=lambda path: path.stem):
        if path.stem not in ("__init__", "baselines"):
            line = (ast.get_docstring(ast.parse(path.read_text("utf-8"))) or "").partition("\n")[0]
            rows.append((f"`{path.stem}`", (line.partition(": ")[2] or line).removesuffix(".")))
    return _table(("name", "what it does"), rows, numbers=False)


def circuits(figures: dict[str, Any]) -> str:
    """Return gap_finder's laps of the circuits without published laps."""
    found = {name: run for name, run in figures["circuits"].items() if name not in PUBLISHED}
    return _table(("circuit", *LAPS), [(circuit, *row) for circuit, row in _laps(found).items()])


def summary(figures: dict[str, Any]) -> str:
    """Return the identified car's laps of a few circuits, and those of the baseline on the bundled ones."""
    groups = {"gap_finder": _laps(figures["identified"]), "random": _laps(figures["identified_baseline"])}
    rows = [
        (circuit, f"`{planner}`, `full`", *laps[circuit])
        for circuit in SUMMARY
        for planner, laps in groups.items()
        if circuit in laps
    ]
    return _table(("circuit", "planner, assist", *LAPS), rows)


def _laps(found: dict[str, Any]) -> dict[str, tuple[object, ...]]:
    """Return the cells of LAPS of each circuit; the random ones are one row."""
    drawn = {"random:0 to random:19": [found[f"random:{seed}"] for seed in range(20)]} if "random:0" in found else {}
    names = [name for name in (*BUNDLED, *REAL, *PUBLISHED) if name in found]
    rows = {name.upper() if name in PUBLISHED else name: [found[name]] for name in names} | drawn
    return {
        label: (
            f"{sum(run['laps_completed'] for run in runs)}/{5 * len(runs)}",
            _range(run["first_lap_s"] for run in runs),
            _range(run["best_lap_s"] for run in runs),
            f"{max(run['max_slide_m_s'] for run in runs):.3f}",
        )
        for label, runs in rows.items()
    }


def published(figures: dict[str, Any]) -> str:
    """Return gap_finder's laps from a standing start beside published ones."""
    own, ideal = ({name: figures[group][name]["first_lap_s"] for name in PUBLISHED} for group in ("circuits", "ideal"))
    return _table(
        ("", *(name.upper() for name in PUBLISHED)),
        [
            ("published follow-the-gap, LiDAR only [s]", *(_seconds(gap) for gap, _ in PUBLISHED.values())),
            ("**`gap_finder`, LiDAR only [s]**", *(f"**{_seconds(own[name])}**" for name in PUBLISHED)),
            ("`gap_finder` on `coulomb`, the ideal tires [s]", *(_seconds(ideal[name]) for name in PUBLISHED)),
            ("published raceline and tracking, with a map [s]", *(_seconds(line) for _, line in PUBLISHED.values())),
            ("`gap_finder` to the raceline", *(f"{own[n] / line - 1.0:+.1%}" for n, (_, line) in PUBLISHED.items())),
        ],
    )


def scenes(figures: dict[str, Any]) -> str:
    """Return each planner's successes in the scenes of each column [%]: of ten seeds of each."""
    rows = [
        (
            f"`{name}`{' (with a map)' if name in WITH_A_MAP else ''}",
            *(round(10.0 * sum(map(found.get, scenes)) / len(scenes)) for scenes in SCENES.values()),
        )
        for name, found in figures["scenes"].items()
    ]
    return _table(("", *SCENES), rows)


def sets(figures: dict[str, Any]) -> str:
    """Return the lab's circles on each set of tires."""
    head = ("set", "mu", "a tire slides", "leaves the arc", "curvature kept")
    return _table(head, [(f"`{name}`", *row.split("; ")) for name, row in figures["sets"].items()], numbers=False)


TABLES: dict[str, Callable[[dict[str, Any]], str]] = {
    table.__name__: table for table in (controllers, circuits, summary, published, scenes, sets)
}


def _seconds(value: float) -> str:
    return f"{value:.2f}"


def _range(values: Iterable[float]) -> str:
    """Return the least and the greatest of some times, or the one."""
    found = list(values)
    return " to ".join(dict.fromkeys((_seconds(min(found)), _seconds(max(found)))))


def _table(head: Sequence[str], rows: Iterable[Sequence[object]], *, numbers: bool = True) -> str:
    rule = ["---", *["---:" if numbers else "---"] * (len(head) - 1)]
    return "\n".join(f"| {' | '.join(str(value) for value in row)} |" for row in (head, rule, *rows))


def main() -> int:
    """Fill all pages, or say which are not as they should be."""
    figures = json.loads((ROOT / "docs" / "figures.json").read_text("utf-8"))
    old = {page: (ROOT / page).read_text("utf-8") for page in PAGES}
    stale = {page: new for page in PAGES if (new := filled(old[page], figures)) != old[page]}
    if "--check" not in sys.argv[1:]:
        for page, text in stale.items():
            (ROOT / page).write_text(text, "utf-8")
        return 0
    for page in stale:
        print(f"{page}: its tables are not those of docs/figures.json; accepted: what make figures writes")
    return 1 if stale else 0


if __name__ == "__main__":
    sys.exit(main())
