"""The experiment tire_bench: one wheel at set slips has the formula's force, and follows over its relaxation length."""

import pytest

from fg_mujoco.lab.experiment import LabSettings
from fg_mujoco.lab.tire_bench import EXPERIMENT, Bench, formula
from fg_mujoco.vehicle.tires import Tires


@pytest.fixture(scope="module")
def tables():
    found = {"points": [], "lag": []}
    for cell in EXPERIMENT.cells(LabSettings(quick=True)):
        for name, rows in EXPERIMENT.measure(cell).items():
            found[name] += rows
    return found


@pytest.mark.slow
def test_the_force_is_the_formulas_pure_and_combined(tables):
    """At most .5 % of the peak is asked; settled it is exact."""
    kinds = {(row["tires"], row["axle"], row["kind"], row["load_N"]) for row in tables["points"]}
    assert len(kinds) == 2 * 2 * 3 * 2
    assert max(row["error"] for row in tables["points"]) < 1e-3
    assert max(row["spread"] for row in tables["points"]) < 1e-3


def test_the_force_follows_over_the_relaxation_length_at_any_speed(tables):
    assert {row["speed_m_s"] for row in tables["lag"]} == {1.0, 2.0, 4.0, 8.0}
    for row in tables["lag"]:
        assert row["lag_m"] == pytest.approx(row["relaxation_length_m"], rel=0.01)


def test_signs_and_loads():
    """Turned to the left of its way a wheel is pushed to the left; one that brakes is pushed back."""
    tires = Tires.load("slipx_reference")
    bench = Bench(tires, "front", 9.17, 3.0)
    load, along, across = bench.roll(1.0, -0.05, 0.05)[-1]
    assert load == pytest.approx(9.17, rel=1e-3) and along < -1.0 and across > 1.0
    assert formula(tires.axles[0], load, 0.0, 0.121)[1] == pytest.approx(load * (load / 8.58) ** -0.15 * 1.1, rel=1e-4)
