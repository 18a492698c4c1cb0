"""Drives the races and circles whose results README.md and docs/ show, and writes their figures to one file.

    python benchmarks/circuits.py --json docs/figures.json [--data ../shared/data] [--workers 2] [--runs DIR]

`make figures` runs it and then fills the tables of README.md and docs/ from that file (docs/tables.py). Six groups
of races are driven, all with the default settings unless the group says otherwise:

- identified: gap_finder, five laps, by the identified car on the floor that it was identified on;
- identified_baseline: random, which looks at nothing, on the bundled circuits: what the assist drives by itself;
- ideal: gap_finder on the published circuits, on tires that need no slip angle, as those of the published times;
- circuits: gap_finder, five laps, on the bundled circuits, on the real ones of `--data` and on random:0 to random:19;
- scenes: every planner in every scene, ten seeds;
- sets: the friction lab's circles on every bundled set of tires.

Races that a folder given by `--runs` already has are not driven again.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import fg_mujoco as fg
from fg_mujoco.lab.lab import run_lab

COMMAND = "python benchmarks/circuits.py --json docs/figures.json"
BUNDLED = ("chicanes", "fast", "hairpins", "l_corridor", "oval", "tight")
RANDOM = tuple(f"random:{seed}" for seed in range(20))
IDENTIFIED = {"vehicle": "ipz", "floor": "ipz8"}
DIGITS = {"first_lap_s": 2, "best_lap_s": 2, "max_slide_m_s": 3}


def real_circuits(data: Path) -> list[str]:
    """Return the centreline CSVs of the real circuits in a folder; they are not part of the repository."""
    found = [str(path) for kind in ("maps", "circuits") for path in sorted((data / kind).glob("*_centerline.csv"))]
    if not found:
        raise SystemExit(f"--data is {data}; accepted: a folder with maps/ and circuits/, of *_centerline.csv files")
    return found


def lap_figures(row: Any) -> dict[str, Any]:
    """Return what a table of circuits shows of a run."""
    run = row.car
    shown = {name: getattr(run, name) for name in ("end_reason", "laps_completed", "collisions", *DIGITS)}
    return {name: round(value, DIGITS[name]) if name in DIGITS and value else value for name, value in shown.items()}


def by_controller(comparison: fg.Study) -> dict[str, dict[str, Any]]:
    """Return the figures of each controller on each circuit."""
    found: dict[str, dict[str, Any]] = {}
    for row in comparison.rows:
        circuit = row.place["course"].removesuffix("_centerline")
        found.setdefault(row.planner, {})[circuit] = lap_figures(row)
    return found


def successes(comparison: fg.Study) -> dict[str, dict[str, int]]:
    """Return how many runs of each controller in each scene succeeded."""
    found: dict[str, dict[str, int]] = {}
    for cell in comparison.cells:
        if cell["course"] != "all":
            found.setdefault(cell["planner"], {})[cell["course"].removeprefix("scene:")] = cell["successes"]
    return found


def circles(workers: int) -> dict[str, str]:
    """Return the cells of the lab's table of all sets of tires, by the set."""
    (chapter,) = run_lab(["sets"], workers=workers).chapters
    names = ("slides_over_law", "leaves_arc_over_law", "curvature_at_law")
    return {
        str(row["tires"]): "; ".join((f"{row['mu']:.3f}", *(str(row[name]) for name in names)))
        for row in chapter.section.printed or ()
    }


def drive(data: Path, runs: Path, workers: int) -> dict[str, Any]:
    """Drive all groups, and return their figures."""

    def group(name: str, controllers: Sequence[str] | None = None, **settings: Any) -> fg.Study:
        print(f"{name} ...", flush=True)
        return fg.compare(controllers, out=runs / name, workers=workers, **{"assist": "full"} | settings)

    real = real_circuits(data)
    published = [path for path in real if Path(path).parent.name == "maps"]
    circuits = group("circuits", ["gap_finder"], track=[*BUNDLED, *real, *RANDOM])
    identified = group("identified", ["gap_finder"], track=[*BUNDLED, *real, *RANDOM], **IDENTIFIED)
    identified_baseline = group("identified_baseline", ["random"], track=BUNDLED, **IDENTIFIED)
    scenes = group("scenes", track=[f"scene:{name}" for name in fg.scene_names()], seed=range(10))
    return {
        "identified": by_controller(identified)["gap_finder"],
        "identified_baseline": by_controller(identified_baseline)["random"],
        "ideal": by_controller(group("ideal", ["gap_finder"], track=published, tires="coulomb"))["gap_finder"],
        "circuits": by_controller(circuits)["gap_finder"],
        "scenes": successes(scenes),
        "sets": circles(workers),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures here")
    parser.add_argument("--data", type=Path, default=Path(__file__).parents[1] / "../shared/data")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument("--runs", type=Path, help="keep the runs here, and go on with those that are there")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        figures = drive(options.data, options.runs or Path(folder), options.workers)
    versions = {name: version(name) for name in ("fg-mujoco", "mujoco", "numpy")}
    text = json.dumps({"command": COMMAND, "versions": versions, **figures}, indent=1) + "\n"
    if options.json is None:
        print(text)
    else:
        options.json.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
