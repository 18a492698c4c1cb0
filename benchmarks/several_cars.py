"""What a tick of m cars costs, beside m ticks of one car: 1081 beams at 40 Hz each, gap_finder, one world on one core.

    python benchmarks/several_cars.py [--track oval] [--seconds 10] [--cars 1,2,4,8] [--json FILE]

The cars are spread evenly over the course, or begin on a staggered grid. Worlds of all numbers of cars are driven in
turn. The times are medians of processor time over the ticks in which all cars race; that of a tick is the
sum of its parts. A ratio of 1 is m times what one car takes; wanted is 1.1 at most. `control` is race control, which
only watches.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from common import parser, report, stay_on_cores, table

import fg_mujoco as fg
from fg_mujoco.addons.arena.race_control.race_control import RaceControl
from fg_mujoco.racing.entries import Entry, entry_planner, grid_starts
from fg_mujoco.racing.rules import RULES
from fg_mujoco.simulation.cars import WorldCar
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.planner_adapter import Planners, PlannersOfEach, adapt
from fg_mujoco.simulation.world import World

PARTS = ("sense", "decide", "drive", "judge")
LAYOUTS = ("spread", "bunched")
_BLOCK = 40  # ticks of a world in turn; the first block is not counted


def field(track: str, cars: int, layout: str) -> tuple[Engine, RaceControl]:
    """Return a race of so many cars at its start, and who watches it."""
    world = World(track, others=[WorldCar()] * (cars - 1))
    parameters = [car.parameters for car in world.cars]
    planners = [
        adapt([entry_planner(Entry(name=f"car_{i}"), car=car, map_line=world.track.map_line)])
        for i, car in enumerate(parameters)
    ]
    groups: list[tuple[Any, Planners]] = [(np.array([row]), planner) for row, planner in enumerate(planners)]
    engine = Engine(world, laps=1000)
    engine.planners = PlannersOfEach(groups) if cars > 1 else planners[0]
    spread = [fg.Start(s=world.track.length * i / cars) for i in range(cars)]
    engine.place(spread if layout == "spread" else grid_starts(world.track, parameters))
    return engine, RaceControl(engine, names=[f"car_{i}" for i in range(cars)], rules=RULES["none"])


def tick(engine: Engine, control: RaceControl) -> list[float]:
    """Drive a tick and return the processor time that each part took [us]; one car has no race control."""
    times = [time.thread_time()]
    watch = control.after_tick if engine.cars_per_world > 1 else lambda: None
    for verb in (engine.sense, engine.decide, engine.drive, engine.judge, watch):
        verb()
        times.append(time.thread_time())
    return np.diff(1e6 * np.array(times)).tolist()


def measure(track: str, seconds: float, numbers: list[int]) -> dict[str, Any]:
    """Return the medians [us] of each part and the ratios, by layout and number of cars."""
    found: dict[str, Any] = {}
    for layout in LAYOUTS:
        fields = {cars: field(track, cars, layout) for cars in numbers}
        rows: dict[int, list[list[float]]] = {cars: [] for cars in numbers}
        for block in range(1 + round(seconds / 0.025 / _BLOCK)):
            for cars, (engine, control) in fields.items():
                for done in range(_BLOCK):
                    if engine.running.all():
                        taken = tick(engine, control)
                        if block > 0 and done > 1:  # the others' worlds have been in the caches meanwhile
                            rows[cars].append(taken)
        one = np.median(rows[1], axis=0)
        found[layout] = {}
        for cars in numbers:
            parts = np.median(rows[cars], axis=0)
            ratios = parts / (cars * one)
            found[layout][str(cars)] = {
                "ticks": len(rows[cars]),
                "us_per_tick": dict(zip((*PARTS, "control"), parts.tolist(), strict=True))
                | {"tick": float(parts.sum())},
                "ratio": dict(zip(PARTS, ratios.tolist(), strict=False))
                | {"tick": float(parts.sum() / (cars * one.sum()))},
            }
    return {"track": track, "seconds": seconds, **found}


def main() -> None:
    """Print the table."""
    arguments = parser(__doc__)
    arguments.add_argument("--track", default="oval")
    arguments.add_argument("--seconds", type=float, default=10.0)
    arguments.add_argument("--cars", default="1,2,4,8", help="numbers of cars, 1 among them")
    options = arguments.parse_args()
    stay_on_cores(1)
    figures = measure(options.track, options.seconds, [int(text) for text in options.cars.split(",")])
    rows = [
        [
            f"{layout}, {cars}", *(row["us_per_tick"][name] for name in (*PARTS, "control", "tick")),
            *(row["ratio"][name] for name in ("sense", "decide", "drive", "tick")), row["ticks"],
        ]
        for layout in LAYOUTS
        for cars, row in figures[layout].items()
    ]  # fmt: skip
    header = ["cars", *(f"{name} [us]" for name in (*PARTS, "control", "tick"))]
    header += [f"{name} / m" for name in ("sense", "decide", "drive", "tick")]
    report(figures, table([*header, "ticks"], rows), options.json)


if __name__ == "__main__":
    main()
