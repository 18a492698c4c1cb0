"""The law on tires with a curve: closed forms of where the first tire passes its peak, and the experiment tire_law."""

from dataclasses import replace

import numpy as np
import pytest

from fg_mujoco.lab.curve_onset import axle_factor, curve_onset
from fg_mujoco.lab.lab_ground import Engine, LabGround
from fg_mujoco.lab.steady_circle import SteadyCircle
from fg_mujoco.lab.tire_law import EXPERIMENT, passes_peak
from fg_mujoco.messages import DriveCommand
from fg_mujoco.vehicle.changes import CarChanges
from fg_mujoco.vehicle.tire_slip import slides_above, sliding_rule
from fg_mujoco.vehicle.tires import AxleTires, MagicFormula, Tires
from fg_mujoco.vehicle.vehicle import Vehicle
from refusals import refused

CAR = Vehicle.load().parameters
FLAT = CarChanges(center_of_gravity_height=0.002)  # hardly any load moves
FLAT_CAR = replace(CAR, center_of_gravity_height=FLAT.center_of_gravity_height)
OWN_TIMESTEP = Engine(timestep=None)


def stiff(load_sensitivity=0.0, mu=1.0):
    """Equal tires in front and behind, whose peak is at a slip angle so small that it hardly turns the car."""
    curve = MagicFormula(B=75.0, C=1.4, D=mu, E=0.0)
    axle = AxleTires(lateral=curve, longitudinal=curve, relaxation_length=0.1, load_sensitivity=load_sensitivity)
    return Tires(model="magic_formula", front=axle, rear=axle, name="stiff")


def onset(tires, steering, changes=None, mu=None):
    """The last reading before the first tire passes its peak, and the first after."""
    circle = SteadyCircle(mu or tires.least_peak, steering, OWN_TIMESTEP, tires, changes=changes)
    return circle, *circle.bisect(passes_peak, low=0.4, high=3.0)


@pytest.mark.parametrize(("mu", "steering"), [(1.0, 0.05), (0.5, -0.1)])
def test_equal_axles_on_level_loads_pass_their_peak_at_the_laws_speed(mu, steering):
    _, before, after = onset(stiff(), steering, FLAT, mu)

    assert before.k == pytest.approx(1.0, abs=0.01)
    assert before.acceleration == pytest.approx(mu * CAR.gravity, rel=0.01)
    assert not before.sliding.any() and after.sliding.any()


@pytest.mark.parametrize("sensitivity", [0.0, 0.4])
def test_load_sensitivity_lowers_the_grip_as_the_closed_form_of_two_tires_says(sensitivity):
    tires = stiff(sensitivity)
    _, before, _ = onset(tires, 0.1)
    a = before.acceleration / CAR.gravity
    moved = CAR.mass * CAR.gravity * a * CAR.center_of_gravity_height / CAR.track_width
    axles = []
    for lever in (CAR.rear_axle_distance, CAR.front_axle_distance):
        load = CAR.mass * CAR.gravity * lever / CAR.wheelbase
        inner, outer = 0.5 * (load - moved), 0.5 * (load + moved)
        peak = sum(tire * (tire / 9.17) ** -sensitivity for tire in (inner, outer)) / load
        assert axle_factor(tires.front, load, moved / load) == pytest.approx(peak, rel=1e-12)
        axles.append(peak)

    assert a == pytest.approx(min(axles), rel=0.02)


@pytest.mark.parametrize(("steering", "k"), [(0.05, 0.846), (0.1, 0.881)])
def test_unequal_axles_spin_where_the_single_track_says(steering, k):
    """ForzaETH's NUC2 has less grip behind: without load transfer it spins well below the law."""
    tires = Tires.load("forzaeth_nuc2")
    circle, before, after = onset(tires, steering, FLAT)
    assert after.first_tire == "rear_left"
    assert curve_onset(tires, circle.mu, steering, FLAT_CAR) == pytest.approx(k, abs=2e-3)
    assert before.k == pytest.approx(k, rel=0.015)


def test_a_step_passes_the_peak_and_the_friction_limiter_of_a_planner_that_is_told_less_does_not():
    tires = Tires.load("forzaeth_nuc2").described()
    cell = {"part": "transients", "tires": tires, "mu": None, "manoeuvre": "step to 0.1 rad", "steering": 0.1}
    (row,) = EXPERIMENT.measure(cell)["transients"]
    assert 0.9 < row["k_peak"] < 1.0 and row["first_tire"].startswith("rear left at ")
    assert row["limited_slide_share"] > 0.0 and 0.5 <= row["limited_mu_share"] < 1.0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("tire_law", "--tires", "forzaeth_nuc"), "tires 'forzaeth_nuc' are not known; "),
        (("tire_law", "--tires", "coulomb,coulomb"), "each once"),
        (("tire_law", "--tires", "contact"), "'contact' have no curve; accepted"),
        (("tire_law", "--tires", "nowhere.toml"), "tire file nowhere.toml: No such file"),
        (("skidpad", "--tires", "coulomb"), "--tires with skidpad; accepted: with tire_law, or all"),
    ],
)
def test_sets_that_cannot_be_measured_are_refused_in_one_line(tmp_path, monkeypatch, capsys, arguments, said):
    monkeypatch.chdir(tmp_path)
    assert said in refused(tmp_path, capsys, "friction", *arguments, "--out", "out")


def test_the_onset_is_the_same_at_a_fifth_of_the_timestep():
    """Asked for within .2 % down to .25 ms, which the experiment compares."""
    tires = Tires.load("slipx_reference")
    ks = []
    for timestep in (0.005, 0.001):
        circle = SteadyCircle(tires.least_peak, 0.4, Engine(timestep=timestep), tires)
        ks.append(circle.bisect(passes_peak, low=0.9, high=1.2, width=0.0005)[0].k)
    assert ks[0] == pytest.approx(ks[1], rel=2e-3)


@pytest.mark.parametrize("name", ["contact", "coulomb", "forzaeth_nuc2", "f1tenth_gym"])
def test_a_sliding_speed_says_whether_a_tire_slides(name):
    """One rule for the lab, races and reports, which have the speed only."""
    tires = Tires.load(name)
    ground = LabGround(tires.peak, OWN_TIMESTEP, tires)
    ground.place(6.0)
    slip = ground.run([DriveCommand(steering_angle=0.3, speed=6.0)] * 40).slip
    assert (slip.slides == (np.nan_to_num(slip.sliding_speed) > slides_above(tires.model))).all()
    assert slip.slides.any() == (name != "f1tenth_gym")
    rules = {"contact": "above 0.05 m/s", "coulomb": "above 0.01 m/s"}
    assert sliding_rule(tires.model) == rules.get(name, "past its peak")
