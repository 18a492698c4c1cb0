"""How the speed law v = sqrt(g mu b / tan d) holds on tires with a curve, on steady circles and under the limiter.

    python benchmarks/tire_law.py [--tires forzaeth_nuc2,my_tires.toml] [--steering 0.1,0.3] [--mu 0.6]

The law's mu is the least peak of a set. The first table has the k (speed over the law's) at which the first tire passes
its peak, and in brackets the curvature at k 1 over that of the steering angle, where no tire is past its peak there.
The second has in how many manoeuvres of the friction lab, and steps to these angles, a tire passes its peak under the
friction limiter of the planners, at 1.1 and 1.5 times the law's speed. About a minute a set.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from common import table

from fg_mujoco.lab.lab_ground import LabGround
from fg_mujoco.lab.reference_steering import MANOEUVRES, Manoeuvre
from fg_mujoco.lab.skidpad import STEERINGS
from fg_mujoco.lab.steady_circle import CircleReading, SteadyCircle, UnreachableError, greatest_peak
from fg_mujoco.lab.transient import drive
from fg_mujoco.messages import CarParameters, Odometry
from fg_mujoco.vehicle.tires import Tires, tire_names
from fg_mujoco.vehicle.vehicle import Vehicle

TIMESTEP = float(Vehicle.load().compile().opt.timestep)  # [s] of a race
LOW, HIGH = 0.4, 3.0  # k between which the first tire is sought
KS = (1.1, 1.5)  # of the reference speed, under the friction limiter
STRAIGHT, SECONDS = 0.5, 3.0  # [s] of a step


def passes_peak(reading: CircleReading) -> bool:
    """Return whether some tire slides."""
    return bool(reading.sliding.any())


def circle(tires: Tires, mu: float, steering: float) -> tuple[float | None, float | None]:
    """Return the k at which the first tire passes its peak, and the curvature at k 1; None: there is none."""
    held = SteadyCircle(mu, steering, TIMESTEP, tires)
    curvature = peak = None
    try:
        reading = held.at(1.0)
        curvature = None if passes_peak(reading) else reading.curvature
        peak = held.bisect(passes_peak, low=LOW, high=HIGH)[0].k
    except UnreachableError:
        pass
    return peak, curvature


def slides_when_limited(tires: Tires, mu: float, steerings: Sequence[float]) -> tuple[int, int]:
    """Return in how many manoeuvres a tire passes its peak under the friction limiter, and of how many."""
    plans = [(plan, None) for plan in MANOEUVRES.values()] + [(step(angle), angle) for angle in steerings]
    ground = LabGround(greatest_peak(tires, mu), TIMESTEP, tires)
    slid = [any(drive(ground, plan, mu, k, "guard", angle)[0].slip.slides.any() for k in KS) for plan, angle in plans]
    return sum(slid), len(slid)


def step(angle: float) -> Manoeuvre:
    """Return a step to a steering angle [rad]."""

    def steering(odometry: Odometry, car: CarParameters) -> float:
        return angle if odometry.stamp >= STRAIGHT else 0.0

    return Manoeuvre(name=f"step to {angle:g} rad", steering=steering, seconds=SECONDS)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--tires", help="sets, by commas: names or TOML files; default: all that have a peak")
    parser.add_argument("--steering", help="angles [rad], by commas", default=",".join(map(str, STEERINGS)))
    parser.add_argument("--mu", type=float, help="least peak of each set; default: its own")
    options = parser.parse_args()
    steerings = [float(angle) for angle in options.steering.split(",")]
    friction = Vehicle.load().nominal_mu
    named = options.tires.split(",") if options.tires else tire_names()
    sets = [tires for tires in (Tires.load(name).on(friction) for name in named) if tires.slides]
    rows, limited = [], []
    for tires in sets:
        mu = options.mu or tires.least_peak
        assert mu is not None
        cells = [circle(tires, mu, steering) for steering in steerings]
        shown = [
            (f"{peak:.3f}" if peak else "none") + (f" ({curvature:.2f})" if curvature else "")
            for peak, curvature in cells
        ]
        rows.append([tires.name, *shown])
        limited.append([tires.name, "{} of {}".format(*slides_when_limited(tires, mu, steerings))])
    print(table(["set, steering [rad]", *(f"{angle:g}" for angle in steerings)], rows), end="\n\n")
    print(table(["set", "manoeuvres in which a tire slides under the limiter"], limited))


if __name__ == "__main__":
    main()
