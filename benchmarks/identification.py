"""How exactly `identify` finds the tires of our own cars, in three dimensions and with the noise of real sensors.

    python benchmarks/identification.py [--sets nuc2 nuc6 random_1 ...] [--seeds 20] [--json FILE]

Each car drives `growing_slalom` at the speeds and frequencies of DRIVES. The angle at the end is 0.4 rad. A car that
spins before drives again, to 0.9 of the angle at which it did, as a driver would. The tires are then identified from
what the car's sensors recorded, with the two-track and with the single-track model. Last, each model is given the
commands and the speed of a lap that no fit has seen, and predicts its yaw rate.
"""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from common import parser, report, stay_on_cores, table
from numpy.typing import ArrayLike

import fg_mujoco as fg
from fg_mujoco.addons.realcar.drives.channels import Channel
from fg_mujoco.addons.realcar.identification.drive_log import Drive
from fg_mujoco.addons.realcar.identification.identification import Identification, identify_drives
from fg_mujoco.addons.realcar.identification.problem import PARAMETERS, DriveProblem
from fg_mujoco.addons.realcar.identification.steering_response import Steering
from fg_mujoco.lab.manoeuvres import GrowingSlalom
from fg_mujoco.racing.run_folder import write_run
from fg_mujoco.vehicle.tires import AxleTires, MagicFormula

DRIVES = (
    (4.0, 1.0, 0.08), (7.0, 1.0, 0.05), (2.5, 1.4, 0.4), (3.5, 2.0, 0.4), (4.5, 1.4, 0.4), (5.0, 0.8, 0.4),
    (5.0, 2.0, 0.4), (6.5, 1.4, 0.4), (8.0, 2.0, 0.4), (9.0, 2.4, 0.4),
)  # fmt: skip
"""Speed [m/s], frequency [Hz] and angle at the end [rad] of each growing slalom."""

SPINS = 0.35  # [rad] of sideslip, at which the driver stops
TRIES = 6  # slaloms of one speed and frequency, each to a smaller angle
LAP = ("chicanes", "gap_finder", 6.0)  # track, planner and greatest speed [m/s] of the lap that no fit has seen

# Of the IMU of a VESC 6, a BMI160. Its data sheet (BST-BMI160-DS000) has 0.007 deg/s/sqrt(Hz) and 180 ug/sqrt(Hz), and
# offsets of +-3 deg/s and +-40 mg. A car at rest calibrates the offsets to a tenth; what is left of them is drawn. The
# noise of a car that drives is its vibration, ten times the data sheet's: a choice of ours.
GYRO, GYRO_OFFSET = 0.01, 0.005  # [rad/s]
ACCELEROMETER, ACCELEROMETER_OFFSET = 0.2, 0.1  # [m/s^2]
# Of a pose by scan matching with a UST-10LX, whose beams are exact to +-40 mm (its data sheet): half of that, and half
# a degree; a choice of ours, as is that of the wheels' speed.
POSE, HEADING = 0.02, 0.01  # [m], [rad]
WHEELS = 0.05  # [m/s]

MODELS = ("two_track", "single_track")
GOALS = {"stiffness": 5.0, "peak": 3.0, "lag": 10.0, "lap": 3.0}  # [%], [%], [ms], [%]
SLIPS = np.linspace(0.0, 0.6, 1201)  # [rad] up to which a peak counts, as in `identify`


@dataclass(frozen=True, kw_only=True)
class Case:
    """A car and its tires."""

    name: str
    vehicle: str
    tires: fg.Tires
    seed: int  # of the noise


def random_tires(seed: int) -> fg.Tires:
    """Return tires whose values are drawn evenly from around those that are published.

    The published ones (models/tires/) have stiffnesses B C D of 3 to 20 and peaks of 0.3 to 1.2. These have stiffnesses
    of 4 to 28 and peaks of 0.6 to 1.2: D of the rear axle is that of the front, or up to 12 % more, because a car whose
    rear lets go first spins. SlipX' relaxation length of 0.045 m is halved at least, and doubled at most.
    """
    rng = np.random.default_rng(seed)
    while True:
        grip = rng.uniform(0.6, 1.1)
        drawn = {
            "front": (rng.uniform(6, 11), rng.uniform(1.2, 1.7), grip, rng.uniform(0.0, 0.8)),
            "rear": (rng.uniform(7, 12), rng.uniform(1.3, 1.9), grip * rng.uniform(1.0, 1.12), rng.uniform(0.0, 0.8)),
        }
        sigma = 0.045 * 2.0 ** rng.uniform(-1.0, 1.0)
        try:
            curves = {axle: MagicFormula(**dict(zip("BCDE", values, strict=True))) for axle, values in drawn.items()}
        except fg.SettingsError:  # a curve without a peak is no set
            continue
        axles = {
            axle: AxleTires(
                lateral=curve, longitudinal=curve, relaxation_length=sigma, load_sensitivity=0.0, nominal_load=9.17
            )
            for axle, curve in curves.items()
        }
        return fg.Tires(model="magic_formula", name=f"random_{seed}", **axles)


def cases(seeds: int) -> Iterator[Case]:
    """Yield NUC2, NUC6 and so many sets drawn at random, these on both cars in turn."""
    yield Case(name="nuc2", vehicle="nuc2", tires=fg.Tires.load("forzaeth_nuc2"), seed=1)
    yield Case(name="nuc6", vehicle="f1tenth", tires=fg.Tires.load("forzaeth_nuc6"), seed=1)
    for seed in range(1, seeds + 1):
        vehicle = ("f1tenth", "nuc2")[seed % 2]
        yield Case(name=f"random_{seed}", vehicle=vehicle, tires=random_tires(seed), seed=seed)


def recorded(result: Any) -> Drive:
    """Return what the sensors of a run recorded, without noise."""
    with tempfile.TemporaryDirectory() as folder:
        return Drive.of_run(fg.read_run(write_run(result, Path(folder) / "run")))


def slaloms(case: Case, drives: Sequence[tuple[float, float, float]] = DRIVES) -> tuple[list[Drive], float]:
    """Return the drives of a car, and how late its steering is [s].

    Each slalom, by speed, frequency and angle at its end, is driven to the greatest angle at which the car does not
    spin. The steering is late by the lag and the delay of the first-order model that comes closest to the true angle.
    """
    found, late = [], []
    for speed, frequency, angle in drives:
        for _ in range(TRIES):
            slalom = GrowingSlalom(speed=speed, frequency=frequency, angle=angle)
            result = fg.drive(slalom, vehicle=case.vehicle, tires=case.tires)
            spun = np.flatnonzero(np.abs(result.car.column("sideslip_rad")) > SPINS)
            if not len(spun):
                break
            share = (result.car.column("time_s")[spun[0]] - slalom.begin) / slalom.seconds
            angle = round(0.9 * angle * min(share, 1.0), 3)
        found.append(recorded(result))
        late.append(_lateness(found[-1], result))
    return found, float(np.median(late))


def _lateness(drive: Drive, result: Any) -> float:
    time, angle = result.car.column("time_s"), result.car.column("steering_angle_rad")
    grid = np.arange(time[0], time[-1], 0.005)
    steering = Steering(
        drive.steering, grid, limit=drive.car.max_steering_angle, rate=drive.car.max_steering_rate, held=True
    )
    lags = np.arange(0.004, 0.06, 0.002)
    delays = np.arange(0.0, 0.02, 0.0025)
    angles = {
        (lag, delay): np.interp(time, grid, steering.angles(1.0, 0.0, lag, delay)) for lag in lags for delay in delays
    }
    return float(sum(min(angles, key=lambda at: float(np.sum((angles[at] - angle) ** 2)))))


def with_noise(drives: list[Drive], seed: int) -> list[Drive]:
    """Return the drives as real sensors would have recorded them; the offsets are the same in all."""
    rng = np.random.default_rng(seed)
    gyro, accelerometer = rng.normal(0.0, GYRO_OFFSET), rng.normal(0.0, ACCELEROMETER_OFFSET, 2)

    def noisy(channel: Channel | None, spread: ArrayLike, offset: ArrayLike = 0.0) -> Any:
        assert channel is not None
        values = channel.values + offset + np.asarray(spread) * rng.standard_normal(channel.values.shape)
        return replace(channel, values=values)

    return [
        replace(
            drive,
            name=f"slalom {number}",
            yaw_rate=noisy(drive.yaw_rate, GYRO, gyro),
            acceleration=noisy(drive.acceleration, ACCELEROMETER, accelerometer),
            pose=noisy(drive.pose, (POSE, POSE, HEADING)),
            speed=noisy(drive.speed, WHEELS),
        )
        for number, drive in enumerate(drives, start=1)
    ]


def lap_error(found: Identification, lap: Drive, *, single_track: bool) -> float:
    """Return the rms of the predicted yaw rate of a lap less the measured one, over the rms of the measured one [%].

    The lap is simulated in one piece, from its commands and its speed without noise.
    """
    problem = DriveProblem(lap, front_drive=0.5, single_track=single_track)
    problem.segments = np.array([[np.flatnonzero(problem.motion.forward_speed > 1.0)[0], len(problem.motion.time)]])
    begun = problem.segments[0, 0]
    motion = problem.motion
    start = np.array([[v[begun] for v in (motion.lateral_speed, motion.yaw_rate, motion.x, motion.y, motion.heading)]])
    simulated = problem.run(found.fit.parameters, start)[begun:, 1]
    measured = motion.yaw_rate[begun:]
    return 100.0 * float(np.sqrt(np.mean((simulated - measured) ** 2) / np.mean(measured**2)))


def measured(case: Case, found: Identification, late: float) -> dict[str, float]:
    """Return the errors of what was found: [%], of the lag [ms]."""
    errors = {}
    for (name, axle), tires in zip(found.axles, case.tires.axles, strict=True):
        curve = tires.lateral
        peak = max(curve.force(slip) for slip in SLIPS.tolist())
        errors[f"{name}_stiffness"] = 100.0 * (axle.stiffness.value / curve.slope - 1.0)
        errors[f"{name}_peak"] = 100.0 * (axle.peak.value / peak - 1.0)
        errors[f"{name}_reached"] = axle.reached / curve.peak_slip
    errors["lag"] = 1e3 * (found.steering_lag.value + found.steering_delay.value - late)
    errors["relaxation"] = 1e3 * float(found.fit.parameters[PARAMETERS.index("relaxation_length")])
    errors["held_back"] = 100.0 * found.validation.yaw_rate_relative
    return errors


def row_of(case: Case) -> dict[str, Any]:
    """Return the errors of both models with the drives of a case; a refusal in place of those of one that refused."""
    drives, late = slaloms(case, DRIVES)
    drives = with_noise(drives, case.seed)
    track, planner, speed = LAP
    lap = recorded(fg.race(track, planner, laps=1, max_speed=speed, vehicle=case.vehicle, tires=case.tires))
    row: dict[str, Any] = {"name": case.name, "vehicle": case.vehicle, "late_ms": 1e3 * late}
    for model in MODELS:
        single_track = model == "single_track"
        begun = time.process_time()
        try:
            found = identify_drives(drives, single_track=single_track)
            row[model] = measured(case, found, late)
            row[model]["lap"] = lap_error(found, lap, single_track=single_track)
            row[model]["cpu_s"] = time.process_time() - begun
        except fg.SettingsError as refusal:
            row[model] = {"refused": str(refusal)}
    return row


def _worst(errors: dict[str, float], what: str) -> float:
    """Return the greater error of both axles, or the only one there is, without its sign."""
    values = [errors[key] for key in (f"front_{what}", f"rear_{what}", what) if key in errors]
    return max(map(abs, values))


def tables(rows: list[dict[str, Any]]) -> str:
    """Return the tables: each case by the two-track model, and both models over all cases."""
    header = ["tires", "car", "stiffness front, rear [%]", "peak front, rear [%]", "lag [ms]", "lap [%]"]
    lines = []
    for row in rows:
        errors = row["two_track"]
        if "refused" in errors:
            lines.append([row["name"], row["vehicle"], errors["refused"], "", "", ""])
            continue
        pairs = [f"{errors[f'front_{what}']:+.1f}, {errors[f'rear_{what}']:+.1f}" for what in ("stiffness", "peak")]
        lines.append([row["name"], row["vehicle"], *pairs, f"{errors['lag']:+.1f}", f"{errors['lap']:.1f}"])
    whole = []
    for model in MODELS:
        found = [row[model] for row in rows if "refused" not in row[model]]
        cells = []
        for what, goal in GOALS.items() if found else ():
            worst = np.array([_worst(errors, what) for errors in found])
            cells.append(f"{np.median(worst):.1f}, {worst.max():.1f}, {int((worst <= goal).sum())} of {len(rows)}")
        whole.append([model, *(cells or ["-"] * len(GOALS))])
    goals = [f"{what}, {goal:g} {'ms' if what == 'lag' else '%'}" for what, goal in GOALS.items()]
    return "\n\n".join((table(header, lines), table(["model: median, greatest, within", *goals], whole)))


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--sets", nargs="+", metavar="NAME", help="of all; default: all")
    arguments.add_argument("--seeds", type=int, default=20, help="sets drawn at random; default: 20")
    options = arguments.parse_args()
    stay_on_cores()
    rows = []
    for case in cases(options.seeds):
        if options.sets is None or case.name in options.sets:
            rows.append(row_of(case))
            print(json.dumps(rows[-1]), flush=True)
    report({"rows": rows}, tables(rows), options.json)


if __name__ == "__main__":
    main()
