"""The skidpad against closed forms: where the tires let go, how the circle widens, and what it refuses."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from cases import each
from fg_mujoco.controllers.control.speed import lifting_share
from fg_mujoco.lab.rigid_car import axle_use, tire_loads
from fg_mujoco.lab.skidpad import EXPERIMENT
from fg_mujoco.lab.steady_circle import SteadyCircle, UnreachableError
from fg_mujoco.vehicle.changes import CarChanges
from fg_mujoco.vehicle.tires import Tires
from fg_mujoco.vehicle.vehicle import Vehicle

CAR = Vehicle.load().parameters


@cache
def tables_of(tires, mu, steering, ks):
    return EXPERIMENT.measure({"tires": tires, "mu": mu, "steering": steering, "ks": list(ks)})


def measure(mu, steering, ks=(), tires="coulomb"):
    tables = tables_of(tires, mu, steering, tuple(ks))
    return tables["onset"][0], tables["curvature"]


# Measured: k_grip .9977, .9977 and .9945 of the law on bristles, .9930 on contacts.
@each(
    ("mu", "steering", "tires"),
    [(0.5, 0.1, "coulomb"), (1.0489, -0.1, "coulomb"), (0.9, 0.2, "coulomb"), (0.9, 0.2, "contact")],
)  # fmt: skip
def test_tires_let_go_within_one_percent_of_the_law(mu, steering, tires):
    row, _ = measure(mu, steering, tires=tires)
    assert row["k_grip"] == pytest.approx(1.0, abs=0.01)
    assert row["k_grip"] == pytest.approx(row["k_grip_closed_form"], abs=0.004)
    assert row["k_slides"] == pytest.approx(row["k_slides_closed_form"], abs=0.006)
    assert row["lets_go"] == "front axle" and row["reason"] == ""
    assert row["lightest_tire"] == ("rear_left" if steering > 0 else "rear_right")  # the inner one of the lighter axle


@each(
    ("vehicle", "tires", "steering"),
    [*((vehicle, "coulomb", steering) for vehicle in ("f1tenth", "nuc2") for steering in (0.05, 0.2)),
     ("f1tenth", "contact", 0.05)],
)  # fmt: skip
def test_the_first_tire_slides_within_one_percent_of_the_law(vehicle, tires, steering):
    """Measured: .9969 to 1.0094 on bristles, .9957 to 1.0066 on contacts."""
    circle = SteadyCircle(1.0489, steering, tires=Tires.load(tires), vehicle=vehicle)
    before, after = circle.bisect(lambda reading: bool(reading.sliding.any()), low=0.95, high=1.05)
    assert 0.99 < before.k < after.k < 1.01


@each(("mu", "steering", "tires"), [(0.5, 0.1, "coulomb"), (1.0489, 0.2, "contact")])
def test_curvature_falls_as_the_square_of_the_speed(mu, steering, tires):
    """Measured: .992 and .986 of 1/k^2 at the worst."""
    _, rows = measure(mu, steering, (0.95, 1.1, 1.3), tires)
    held, *wide = rows
    assert held["curvature_ratio"] == pytest.approx(1.0, abs=2e-3)
    for row, k in zip(wide, (1.1, 1.3), strict=True):
        assert row["k"] == pytest.approx(k, abs=2e-3)
        assert row["curvature_ratio"] * k**2 == pytest.approx(1.0, abs=0.05)
        assert row["curvature_ratio"] == pytest.approx(row["closed_form"], rel=0.025)


def test_measured_loads_and_uses_are_those_of_the_rigid_car():
    """The body rolls on its springs, and wheels are gyroscopes: some 9 % more load moves, measured."""
    reading = SteadyCircle(0.7, 0.3).at(0.95)
    rigid = tire_loads(0.95, 0.7, 0.3, CAR)
    assert reading.loads.sum() == pytest.approx(CAR.mass * CAR.gravity, rel=2e-3) == rigid.sum()
    assert reading.loads[:2].sum() == pytest.approx(rigid[:2].sum(), rel=3e-3)
    moved = (reading.loads[1] - reading.loads[0]) / (rigid[1] - rigid[0])
    assert 1.0 < moved < 1.15
    assert reading.axle_use == pytest.approx(axle_use(0.95, 0.7, 0.3, CAR), rel=0.01)


def test_forces_of_the_rigid_car_turn_it_as_it_turns():
    """Oracle: all four forces, placed, make the acceleration of a steady circle and no moment."""
    k, mu, steering = 0.9, 0.8, 0.35
    b, half, lr = CAR.wheelbase, 0.5 * CAR.track_width, CAR.rear_axle_distance
    radius = b / math.tan(steering)
    loads, (front, rear) = tire_loads(k, mu, steering, CAR), axle_use(k, mu, steering, CAR)
    places = np.array([[b, half], [b, -half], [0.0, half], [0.0, -half]])
    angles = np.array([math.atan(b / (radius - half)), math.atan(b / (radius + half)), 0.0, 0.0])
    sizes = mu * loads * np.array([front, front, rear, rear])
    forces = sizes[:, None] * np.column_stack((-np.sin(angles), np.cos(angles)))
    yaw_rate = k * math.sqrt(9.81 * mu * radius) / radius
    assert forces.sum(axis=0) == pytest.approx(CAR.mass * yaw_rate**2 * np.array([-lr, radius]), rel=1e-9)
    arms = places - [lr, 0.0]
    assert (arms[:, 0] * forces[:, 1] - arms[:, 1] * forces[:, 0]).sum() == pytest.approx(0.0, abs=1e-9)


def test_a_wheel_that_carries_next_to_nothing_spins_first():
    """Open differentials give it the torque of the others. Measured: at .98, with .1 N on it."""
    row, _ = measure(1.3, 0.3)
    assert row["lets_go"] == "rear_left spins" == f"{row['lightest_tire']} spins"
    assert row["k_grip"] == pytest.approx(row["k_grip_closed_form"], abs=0.01)
    assert row["lightest_load_N"] < 0.5


@each("steering", [0.05, 0.2, 0.4])
def test_a_wheel_of_a_rigid_car_lifts_where_moments_say(steering):
    car = replace(CAR, wheel_inertia=1e-12)  # the loads are of wheels that are no gyroscopes
    assert tire_loads(1.0, lifting_share(car, steering), steering, car).min() == pytest.approx(0.0, abs=1e-6)
    taller = replace(car, center_of_gravity_height=0.12)
    assert tire_loads(1.0, lifting_share(taller, steering), steering, taller).min() == pytest.approx(0.0, abs=1e-6)


def test_a_tall_car_lifts_a_wheel_before_its_tires_slide():
    """On its springs the car leans; measured: 2.6 % before the rigid car, which is at .871 of the law's speed."""
    circle = SteadyCircle(1.0489, 0.4, changes=CarChanges(center_of_gravity_height=0.12))
    lifts = math.sqrt(lifting_share(circle.car, 0.4) / 1.0489)
    assert 0.86 < lifts < 0.88
    assert circle.at(0.96 * lifts).lets_go == ""
    after = circle.at(0.99 * lifts)
    assert after.lets_go == "rear_left spins" and after.loads.min() < 0.1
    assert measure(1.0489, 0.2, (0.95, 1.1, 1.3), "contact")[0]["k_lifts_closed_form"] == pytest.approx(1.140, abs=1e-3)


def test_a_speed_out_of_reach_is_nan_with_a_reason():
    row, curvature = measure(1.0489, 0.005, ks=(1.0,))  # 26 m/s
    assert math.isnan(row["k_grip"]) and math.isnan(row["lightest_load_N"])
    assert "above the car's greatest speed, 20 m/s" in row["reason"]
    assert math.isnan(curvature[0]["k"]) and "20 m/s" in curvature[0]["reason"]


def test_a_car_that_tips_over_says_so():
    with pytest.raises(UnreachableError, match="tips over"):
        SteadyCircle(2.5, 0.2).at(1.0)
