"""Transients: the friction limiter keeps tires from sliding where the law read one way does not; traces agree."""

import numpy as np
import pytest

from cases import each
from fg_mujoco.lab.experiment import LAW_TIRES
from fg_mujoco.lab.lab_ground import LabGround
from fg_mujoco.lab.reference_steering import CURVATURE, MANOEUVRES
from fg_mujoco.lab.speed_laws import LAWS
from fg_mujoco.lab.transient import drive
from fg_mujoco.messages import DriveCommand
from fg_mujoco.vehicle.tire_slip import SLIDING_SPEED, slides_above
from fg_mujoco.vehicle.tires import Tires


def greatest_slide(manoeuvre, mu, k, law, tires="coulomb"):
    trace, _ = drive(LabGround(mu, tires=Tires.load(tires)), manoeuvre, mu, k, law)
    return np.nanmax(trace.slip.sliding_speed)


# Measured, limited: .042 m/s at most on contacts, which is what they creep while they hold.
@each("tires", LAW_TIRES)
@each("manoeuvre", MANOEUVRES)
@each(("mu", "k"), [(1.0489, 1.1), (0.6, 1.5)])
def test_a_limited_car_does_not_slide(manoeuvre, mu, k, tires):
    assert greatest_slide(manoeuvre, mu, k, "limiter", tires) < slides_above(tires)


# Measured: .72, 2.0 and 1.7 m/s for the step, the ramp and the sine, .87 for the slalom, 5.3 for the lane change.
@each("tires", LAW_TIRES)
@each(("manoeuvre", "k"), [("step", 1.1), ("ramp", 1.1), ("sine", 1.1), ("slalom", 1.1), ("lane change", 1.5)])
def test_the_law_read_one_way_slides_in_the_same_manoeuvre(manoeuvre, k, tires):
    assert greatest_slide(manoeuvre, 1.0489, k, "one way", tires) > 5 * SLIDING_SPEED


@each("name", ["slalom", "lane change"])
def test_paths_have_the_curvature_that_they_promise_and_slow_cars_follow_them(name):
    plan = MANOEUVRES[name]
    x = np.linspace(3.0, plan.end, 20001)
    y = np.array([plan.path(place) for place in x])
    slope = np.gradient(y, x)
    curvature = np.gradient(slope, x) / (1.0 + slope**2) ** 1.5
    assert np.abs(curvature[5:-5]).max() == pytest.approx(CURVATURE, rel=0.01)
    trace, _ = drive(LabGround(1.0489), name, 1.0489, 0.7, "none")
    assert plan.off_path(trace.position) < 0.05  # measured .035
    assert trace.position[-1, 0] == pytest.approx(plan.end, abs=0.1)


@each("tires", LAW_TIRES)
def test_what_a_trace_tells_agrees_with_itself(tires):
    """Newton's law of the whole car, from the tires' forces, accelerometer and positions."""
    trace, _ = drive(LabGround(1.0489, tires=Tires.load(tires)), "slalom", 1.0489, 0.9, "none")
    mass = trace.sensors.parameters.mass
    assert trace.tire_forces.sum(axis=1) == pytest.approx(mass * trace.acceleration, abs=0.02 * mass)
    assert np.gradient(trace.position, trace.timestep, axis=0)[50:-1] == pytest.approx(trace.velocity[50:-1], abs=0.02)
    assert np.gradient(trace.heading, trace.timestep)[50:-1] == pytest.approx(trace.yaw_rate[50:-1], abs=0.05)
    assert np.hypot(*trace.tire_forces[:, 0].T) == pytest.approx(trace.slip.friction_force[:, 0], nan_ok=True)
    assert len(trace.last(0.1).time) == round(0.1 / trace.timestep)


def test_laws_leave_what_holds_and_limit_what_does_not():
    ground = LabGround(1.0489)
    car = ground.car.parameters
    ground.place(3.0)
    slow, fast = 2.0, 6.0
    odometry = ground.car.odometry(ground.data)
    for name, make in LAWS.items():
        hold = make(car, 1.0489)
        if name != "limiter":
            assert hold(0.1, slow, odometry) == DriveCommand(steering_angle=0.1, speed=slow)
        assert (hold(0.4, fast, odometry).speed < 3.1) == (name != "none")
        assert (hold(0.4, fast, odometry).steering_angle < 0.36) == (name in ("both ways", "limiter"))
