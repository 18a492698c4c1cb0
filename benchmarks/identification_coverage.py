"""How often the 95 % intervals of `identify` hold the truth, on made-up cars whose truth is known.

    python benchmarks/identification_coverage.py [--cars 10] [--first 1001] [--out coverage.jsonl]

Each car has tires drawn at random (as in identification.py), a steering with a gain, an offset and a delay of its own,
and a yaw inertia that differs from the one that is assumed. It drives five growing slaloms in MuJoCo, in three
dimensions, and its sensors have noise. `identify` fits its two-track model to that, which therefore errs: it has one
roll angle, no suspension, no motor. Finished cars stay in the file, and a second call goes on behind them.

The model errors that widen the intervals (`_MODEL_ERRORS` of identification.py) were measured on the seeds 1 to 20.
The table is of cars with other seeds.
"""

from __future__ import annotations

import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from common import parser, report, stay_on_cores, table
from identification import SLIPS, Case, random_tires, slaloms, with_noise

from fg_mujoco.addons.realcar.identification.drive_log import Drive
from fg_mujoco.addons.realcar.identification.identification import Identification, identify_drives
from fg_mujoco.addons.realcar.single_track import car_array

DRIVES = ((7.0, 1.0, 0.05), (3.5, 2.0, 0.4), (5.0, 0.8, 0.4), (6.5, 1.4, 0.4), (9.0, 2.4, 0.4))
"""Speed [m/s], frequency [Hz] and angle at the end [rad] of each growing slalom."""

FIRST = 1001  # seed of the first car
GAIN, OFFSET, DELAY, INERTIA = (0.9, 1.25), (-0.02, 0.02), (0.0, 0.05), (0.8, 1.3)


def made_up(seed: int) -> tuple[list[Drive], dict[str, float]]:
    """Return the noisy drives of a car, and the truth by the name of each parameter."""
    rng = np.random.default_rng((seed, 7))
    gain, offset, delay, ratio = (float(rng.uniform(*ends)) for ends in (GAIN, OFFSET, DELAY, INERTIA))
    case = Case(name=f"car {seed}", vehicle=("f1tenth", "nuc2")[seed % 2], tires=random_tires(seed), seed=seed)
    drives = []
    driven, late = slaloms(case, DRIVES)
    for drive in driven:
        steering = drive.steering
        commands = replace(steering, time=steering.time - delay, values=(steering.values - offset) / gain)
        assumed = replace(drive.car, yaw_inertia=drive.car.yaw_inertia / ratio)
        drives.append(replace(drive, steering=commands, car=assumed))
        true_inertia = car_array(drive.car, 0.5)[1] / car_array(assumed, 0.5)[1]
    truth = {"steering gain": gain, "steering offset": offset, "steering lag and delay": delay + late}
    truth["yaw inertia"] = float(true_inertia)
    for name, tires in zip(("front", "rear"), case.tires.axles, strict=True):
        truth[f"{name} stiffness"] = tires.lateral.slope
        truth[f"{name} peak"] = max(tires.lateral.force(slip) for slip in SLIPS.tolist())
        truth["relaxation length"] = tires.relaxation_length
    return with_noise(drives, seed), truth


def found_by(found: Identification) -> dict[str, tuple[float, float]]:
    """Return each value that was found, with half of its interval."""
    estimates = {
        "steering gain": found.steering_gain, "steering offset": found.steering_offset,
        "steering lag and delay": found.lateness, "yaw inertia": found.inertia_ratio,
        "relaxation length": found.relaxation_length,
    }  # fmt: skip
    for name, axle in found.axles:
        estimates |= {f"{name} stiffness": axle.stiffness, f"{name} peak": axle.peak}
    untold = {f"{name} {what}" for name in ("front", "rear") for what in ("peak", "stiffness")} & set(found.untold)
    return {name: (each.value, each.half) for name, each in estimates.items() if name not in untold}


def row_of(seed: int) -> dict[str, Any]:
    """Return truth, values and intervals of a car."""
    begun = time.process_time()
    drives, truth = made_up(seed)
    driven = time.process_time()
    found = identify_drives(drives, budget=1e4)
    return {
        "seed": seed, "truth": truth, "found": found_by(found), "drives_cpu_s": driven - begun,
        "fit_cpu_s": time.process_time() - driven,
    }  # fmt: skip


def coverage(rows: list[dict[str, Any]]) -> str:
    """Return the table: how many intervals hold the truth, of those that were told."""
    lines = []
    for name in rows[0]["truth"]:
        told = [(row["truth"][name], *row["found"][name]) for row in rows if name in row["found"]]
        if not told:
            continue
        true, value, half = np.array(told).T
        finite = np.isfinite(half)
        inside = np.abs(value - true) <= half
        error, width = (value - true)[finite], half[finite]
        scale = 1.0 if name in ("steering offset", "steering lag and delay", "relaxation length") else true[finite]
        unit = 1e3 if np.isscalar(scale) else 100.0
        medians = (error / scale, np.abs(error / scale), width / scale)
        cells = [f"{unit * float(np.median(each)):.2g}" for each in medians]
        lines.append([name, f"{int(inside.sum())} of {len(told)}", *cells, "1e-3" if unit == 1e3 else "%"])
    held = sum(int(line[1].split(" of ")[0]) for line in lines)
    asked = sum(int(line[1].split(" of ")[1]) for line in lines)
    lines.append(["all", f"{held} of {asked} ({100.0 * held / max(asked, 1):.1f} %)", "", "", "", ""])
    header = ["parameter", "interval holds the truth", "median error", "median |error|", "median half interval", "unit"]
    return table(header, lines)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--cars", type=int, default=10, help="default: 10")
    arguments.add_argument("--first", type=int, default=FIRST, help=f"seed of the first car; default: {FIRST}")
    arguments.add_argument("--out", type=Path, default=Path("coverage.jsonl"), help="a line for each finished car")
    options = arguments.parse_args()
    stay_on_cores()
    rows = [json.loads(line) for line in options.out.read_text().splitlines()] if options.out.exists() else []
    wanted = range(options.first, options.first + options.cars)
    for seed in wanted:
        if all(row["seed"] != seed for row in rows):
            rows.append(row_of(seed))
            with options.out.open("a") as file:
                file.write(json.dumps(rows[-1]) + "\n")
    rows = [row for row in rows if row["seed"] in wanted]
    report({"rows": rows}, coverage(rows), options.json)


if __name__ == "__main__":
    main()
