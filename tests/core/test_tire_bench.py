"""One wheel at set slips has the formula's force, and follows over its relaxation length."""

import sys
from pathlib import Path

import pytest

from cases import each
from fg_mujoco.vehicle.tires import Tires

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

from tire_bench import AXLES, SPEEDS, Bench, errors, formula, lag

SETS = [(name, axle) for name in ("forzaeth_nuc2", "slipx_reference") for axle in AXLES]


@pytest.mark.slow
@each(("name", "axle"), SETS)
def test_the_force_is_the_formulas_pure_and_combined(name, axle):
    """At most .5 % of the peak is asked; settled it is exact."""
    error, spread = errors(Tires.load(name), axle, (2.0, 20.0))
    assert error < 1e-3 and spread < 1e-3


@each(("name", "axle"), SETS)
def test_the_force_follows_over_the_relaxation_length_at_any_speed(name, axle):
    tires = Tires.load(name)
    length = tires.axles[AXLES.index(axle)].relaxation_length
    for speed in SPEEDS:
        assert lag(tires, axle, speed) == pytest.approx(length, rel=0.01)


def test_signs_and_loads():
    """Turned to the left of its way a wheel is pushed to the left; one that brakes is pushed back."""
    tires = Tires.load("slipx_reference")
    bench = Bench(tires, "front", 9.17, 3.0)
    load, along, across = bench.roll(1.0, -0.05, 0.05)[-1]
    assert load == pytest.approx(9.17, rel=1e-3) and along < -1.0 and across > 1.0
    assert formula(tires.axles[0], load, 0.0, 0.121)[1] == pytest.approx(load * (load / 8.58) ** -0.15 * 1.1, rel=1e-4)
