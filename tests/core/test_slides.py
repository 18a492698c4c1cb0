"""Cars that slide: at the default time step as at a tenth of it, and as the closed forms say."""

import math
import sys
from pathlib import Path

import pytest

from cases import each

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import slides

MANOEUVRES = {manoeuvre.name: manoeuvre for manoeuvre in slides.steps()}
FINE = 0.0005  # [s]


def apart(name, tires, vehicle="f1tenth"):
    """Both outcomes of a manoeuvre, and by how much their yaw rates differ [-]."""
    coarse, fine = (slides.slide(MANOEUVRES[name], vehicle, tires, step) for step in (0.005, FINE))
    return coarse, fine, coarse.yaw_rate / fine.yaw_rate - 1.0


@each(("vehicle", "tires"), [("f1tenth", "coulomb"), ("f1tenth", "slipx_reference"), ("nuc2", "forzaeth_nuc7")])
@each("name", ["step_8_0.4", "brake_in_turn", "lift_off"])
def test_cars_slide_at_the_default_step_as_at_a_tenth_of_it(vehicle, tires, name):
    coarse, fine, difference = apart(name, tires, vehicle)
    assert not coarse.rolled and not fine.rolled
    assert abs(difference) < 0.03
    assert coarse.lateral < 1.03


@each("name", ["sideways_2", "sideways_3.5", "sideways_5", "locked_5", "wheelspin"])
def test_a_sliding_car_moves_as_coulomb_says(name):
    """v^2 / (2 mu g) to a stop, and mu g t from it; the car's rolling moves load for a moment, and so takes some mm."""
    manoeuvre = MANOEUVRES[name]
    outcome = slides.slide(manoeuvre, "f1tenth", "coulomb", 0.005)
    reached = outcome.gained if manoeuvre.closed == "gain" else outcome.moved
    assert reached == pytest.approx(slides.closed_form(manoeuvre, "f1tenth", "coulomb"), rel=0.03)


@each("tires", ["coulomb", "slipx_reference", "forzaeth_nuc2", "f1tenth_gym"])
@each("name", ["sideways_5", "spin_20", "sideways_5_spin_8", "locked_5"])
def test_energy_never_rises_with_the_motor_off(name, tires):
    outcome = slides.slide(MANOEUVRES[name], "f1tenth", tires, 0.005)
    assert outcome.energy < 1e-3


def test_a_car_on_two_grounds_turns_to_the_one_that_holds():
    """Half the friction under the left wheels: braking turns it to the right, at both steps alike."""
    coarse, fine, difference = apart("brake_on_patch", "coulomb")
    assert fine.yaw_rate > 1.0 and abs(difference) < 0.03
    assert math.isfinite(coarse.moved)
