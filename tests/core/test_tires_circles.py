"""Steady circles on tires with a curve: where the first tire passes its peak, by closed forms."""

import numpy as np
import pytest

from cases import each
from fg_mujoco.lab.lab_ground import LabGround
from fg_mujoco.lab.steady_circle import SteadyCircle, UnreachableError
from fg_mujoco.messages import DriveCommand
from fg_mujoco.vehicle.changes import CarChanges
from fg_mujoco.vehicle.tire_slip import slides_above, sliding_rule
from fg_mujoco.vehicle.tires import AxleTires, MagicFormula, Tires
from fg_mujoco.vehicle.vehicle import Vehicle

CAR = Vehicle.load().parameters
FLAT = CarChanges(center_of_gravity_height=0.002)  # hardly any load moves
TIMESTEP = 0.005  # [s] of a race


def passes_peak(reading):
    return reading.sliding.any()


def stiff(load_sensitivity=0.0, mu=1.0):
    """Equal tires in front and behind, whose peak is at a slip angle so small that it hardly turns the car."""
    curve = MagicFormula(B=75.0, C=1.4, D=mu, E=0.0)
    axle = AxleTires(lateral=curve, longitudinal=curve, relaxation_length=0.1, load_sensitivity=load_sensitivity)
    return Tires(model="magic_formula", front=axle, rear=axle, name="stiff")


def onset(tires, steering, changes=None, mu=None):
    """The last reading before the first tire passes its peak, and the first after."""
    circle = SteadyCircle(mu or tires.least_peak, steering, TIMESTEP, tires, changes=changes)
    return circle, *circle.bisect(passes_peak, low=0.4, high=3.0)


@each(("mu", "steering"), [(1.0, 0.05), (0.5, -0.1)])
def test_equal_axles_on_level_loads_pass_their_peak_at_the_laws_speed(mu, steering):
    _, before, after = onset(stiff(), steering, FLAT, mu)

    assert before.k == pytest.approx(1.0, abs=0.01)
    assert before.acceleration == pytest.approx(mu * CAR.gravity, rel=0.01)
    assert not before.sliding.any() and after.sliding.any()


@each("sensitivity", [0.0, 0.4])
def test_load_sensitivity_lowers_the_grip_as_the_closed_form_of_two_tires_says(sensitivity):
    tires = stiff(sensitivity)
    _, before, _ = onset(tires, 0.05)  # the shaft slips in tighter turns
    a = before.acceleration / CAR.gravity
    moved = CAR.mass * CAR.gravity * a * CAR.center_of_gravity_height / CAR.track_width
    axles = []
    for lever in (CAR.rear_axle_distance, CAR.front_axle_distance):
        load = CAR.mass * CAR.gravity * lever / CAR.wheelbase
        inner, outer = 0.5 * (load - moved), 0.5 * (load + moved)
        peak = sum(tire * (tire / 9.17) ** -sensitivity for tire in (inner, outer)) / load
        axles.append(peak)

    assert a == pytest.approx(min(axles), rel=0.02)


@each(("steering", "k"), [(0.05, 0.846), (0.1, 0.881)])
def test_unequal_axles_spin_where_the_single_track_says(steering, k):
    """ForzaETH's NUC2 has less grip behind: without load transfer it spins well below the law."""
    tires = Tires.load("forzaeth_nuc2")
    _, before, after = onset(tires, steering, FLAT)
    assert after.first_tire == "rear_left"
    assert before.k == pytest.approx(k, rel=0.015)


def test_left_and_right_are_mirror_images():
    tires = Tires.load("slipx_reference")
    left, right = (onset(tires, side * 0.3)[1:] for side in (1, -1))
    assert left[0].k == pytest.approx(right[0].k, abs=0.002)
    assert (left[1].first_tire, right[1].first_tire) == ("front_left", "front_right")


def test_a_car_that_runs_wide_has_no_onset_and_says_why():
    circle = SteadyCircle(Tires.load("forzaeth_nuc6").least_peak, 0.3, TIMESTEP, Tires.load("forzaeth_nuc6"))
    assert circle.at(1.0).curvature < 0.8  # measured .717
    with pytest.raises(UnreachableError, match="it does not happen up to 3 of the law's speed"):
        circle.bisect(passes_peak, low=0.4, high=3.0)


def test_the_onset_is_the_same_at_a_fifth_of_the_timestep():
    """Within .2 %."""
    tires = Tires.load("slipx_reference")
    ks = []
    for timestep in (0.005, 0.001):
        circle = SteadyCircle(tires.least_peak, 0.4, timestep, tires)
        ks.append(circle.bisect(passes_peak, low=0.9, high=1.2, width=0.0005)[0].k)
    assert ks[0] == pytest.approx(ks[1], rel=2e-3)


@each("name", ["contact", "coulomb", "forzaeth_nuc2", "f1tenth_gym"])
def test_a_sliding_speed_says_whether_a_tire_slides(name):
    """One rule for the lab, races and reports, which have the speed only."""
    tires = Tires.load(name)
    ground = LabGround(tires.peak, TIMESTEP, tires)
    ground.place(6.0)
    slip = ground.run([DriveCommand(steering_angle=0.3, speed=6.0)] * 40).slip
    assert (slip.slides == (np.nan_to_num(slip.sliding_speed) > slides_above(tires.model))).all()
    assert slip.slides.any() == (name != "f1tenth_gym")
    rules = {"contact": "above 0.05 m/s", "coulomb": "above 0.01 m/s"}
    assert sliding_rule(tires.model) == rules.get(name, "past its peak")
