"""What it takes to start: import, track, world, first scan, first decision, first step; and a long track.

    python benchmarks/startup.py [--repeats 7] [--json FILE]

Each repeat is a new process; medians. The baseline is importing MuJoCo alone. Last, the same with nothing kept on disk
yet: what the first run ever takes.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from typing import Any

import numpy as np
from common import parser, report, stay_on_cores, table

STAGES = """
import json, sys, time
marks = [time.perf_counter()]
def mark(): marks.append(time.perf_counter())
import mujoco; mark()
import fg_mujoco as fg; mark()
import numpy as np
if sys.argv[1] == "long":
    angles = np.linspace(0.0, 2.0 * np.pi, 5000, endpoint=False)
    radius = 5000.0 / (2.0 * np.pi) * (1.0 + 0.1 * np.cos(7.0 * angles))
    line = np.column_stack((radius * np.cos(angles), radius * np.sin(angles)))
    half = np.full(len(line), 1.5)
    track = fg.Track(name="long", centreline=line, width_right=half, width_left=half)
else:
    track = fg.load_track(sys.argv[1])
mark()
world = fg.World(track); mark()
simulation = fg.Simulation(world); mark()
from fg_mujoco.vehicle.vehicle import Vehicle
planner = fg.make_controller("gap_finder", car=world.parameters, mu=Vehicle.load().nominal_mu, max_speed=8.0)
planner.reset()
command = planner(*simulation.reset()); mark()
simulation.step(command); mark()
print(json.dumps([b - a for a, b in zip(marks, marks[1:])]))
"""
NAMES = ("import mujoco", "import fg_mujoco", "track", "world", "first scan", "planner, first decision", "first step")


def run(track: str, cache: str | None = None) -> list[float]:
    """Return the stages' times in a new process [s]."""
    environment = os.environ | ({"XDG_CACHE_HOME": cache} if cache else {})
    done = subprocess.run(
        [sys.executable, "-c", STAGES, track], check=True, capture_output=True, text=True, env=environment
    )
    stages: list[float] = json.loads(done.stdout)
    return stages


def measure(repeats: int) -> dict[str, Any]:
    """Return the figures of the benchmark."""
    taken: dict[str, list[list[float]]] = {"oval": [], "long": []}
    run("oval")
    for _ in range(repeats):
        for track, rows in taken.items():
            rows.append(run(track))
    stages = {track: dict(zip(NAMES, np.median(rows, axis=0).tolist(), strict=True)) for track, rows in taken.items()}
    totals = {track: float(np.median(np.sum(rows, axis=1))) for track, rows in taken.items()}
    with tempfile.TemporaryDirectory() as cache:
        first_ever = sum(run("oval", cache))
    return {"stages_s": stages, "total_s": totals, "first_ever_s": first_ever}


def main() -> None:
    """Print the tables."""
    arguments = parser(__doc__)
    arguments.add_argument("--repeats", type=int, default=7)
    options = arguments.parse_args()
    stay_on_cores(1)
    figures = measure(options.repeats)
    stages, totals = figures["stages_s"], figures["total_s"]
    baseline = stages["oval"]["import mujoco"]
    rows = [(name, *(f"{stages[track][name]:.3f}" for track in stages)) for name in NAMES]
    rows.append(("all", *(f"{total:.2f}" for total in totals.values())))
    rows.append(("times importing mujoco", *(f"{total / baseline:.1f}" for total in totals.values())))
    text = (
        table(("[s]", "oval", "5 km track, 5000 points"), rows)
        + f"\n\nThe first run ever, nothing kept yet: {figures['first_ever_s']:.1f} s"
    )
    report(figures, text, options.json)


if __name__ == "__main__":
    main()
