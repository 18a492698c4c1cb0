"""The slip meter agrees with hand-computed velocities and with the engine's own contact forces."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from car_worlds import flat_world
from fg_mujoco.messages import DriveCommand
from fg_mujoco.vehicle.car import WHEELS, Car
from fg_mujoco.vehicle.tire_slip import TireSlipMeter, add_axle_sensors
from fg_mujoco.vehicle.tires import Tires
from fg_mujoco.vehicle.vehicle import Vehicle

FLAT = flat_world()


def with_axles():
    """The same with sensors of the axles, as a World has them."""
    spec = Vehicle.load().spec(tires=Tires.load("contact"))
    add_axle_sensors(spec)
    model = spec.compile()
    return model, mujoco.MjData(model), Car(model)


STEERED = with_axles()


def slip_now(model, data):
    """The slip of the present state, without a step."""
    mujoco.mj_forward(model, data)
    meter = TireSlipMeter(model)
    meter.record(data)
    return meter.read()


@settings(max_examples=50, deadline=None)
@given(
    forward=st.floats(-10, 10), left=st.floats(-3, 3), yaw_rate=st.floats(-5, 5), heading=st.floats(-4, 4),
    spins=st.lists(st.floats(-300, 300), min_size=4, max_size=4),
)  # fmt: skip
def test_sliding_speed_is_that_of_the_material_point(forward, left, yaw_rate, heading, spins):
    """Oracle: planar rigid-body velocity of the wheel centre, less spin times the contact's depth below it."""
    model, data, car = FLAT
    limits = car.parameters
    car.set_pose(data, 1.0, -2.0, heading)
    sink = 1e-4
    data.qpos[2] -= sink
    cos, sin = np.cos(heading), np.sin(heading)
    data.qvel[:2] = cos * forward - sin * left, sin * forward + cos * left
    data.qvel[5] = yaw_rate
    for wheel, spin in zip(WHEELS, spins, strict=True):
        data.joint(f"{wheel}_wheel").qvel = spin
    slip = slip_now(model, data)
    depth = limits.wheel_radius - 0.5 * sink  # below the wheel's centre: a contact lies halfway into the overlap
    x = np.array([limits.wheelbase, limits.wheelbase, 0.0, 0.0])
    y = np.array([1, -1, 1, -1]) * 0.5 * limits.track_width
    expected = np.hypot(forward - yaw_rate * y - np.array(spins) * depth, left + yaw_rate * x)
    assert slip.sliding_speed[0] == pytest.approx(expected, abs=1e-6)


@settings(max_examples=30, deadline=None)
@given(
    forward=st.floats(-10, 10), left=st.floats(-3, 3), yaw_rate=st.floats(-5, 5), heading=st.floats(-4, 4),
    steering=st.floats(-0.4, 0.4), spin=st.floats(-300, 300), angle=st.floats(-4, 4),
)  # fmt: skip
def test_sliding_across_the_heading_is_the_velocity_along_the_axle(
    forward, left, yaw_rate, heading, steering, spin, angle
):
    """Oracle: planar velocity of the wheel's centre, turned into the wheel's frame; the spin has no part in it."""
    model, data, car = STEERED
    car.set_pose(data, 1.0, -2.0, heading)
    data.qpos[2] -= 1e-4
    cos, sin = np.cos(heading), np.sin(heading)
    data.qvel[:2] = cos * forward - sin * left, sin * forward + cos * left
    data.qvel[5] = yaw_rate
    for wheel in WHEELS:
        data.joint(f"{wheel}_wheel").qvel, data.joint(f"{wheel}_wheel").qpos = spin, angle
    for side in ("left", "right"):
        data.joint(f"front_{side}_kingpin").qpos = steering
    slip, limits = slip_now(model, data), car.parameters
    x = np.array([limits.wheelbase, limits.wheelbase, 0.0, 0.0])
    y = np.array([1, -1, 1, -1]) * 0.5 * limits.track_width
    turned = np.array([steering, steering, 0.0, 0.0])
    across = -np.sin(turned) * (forward - yaw_rate * y) + np.cos(turned) * (left + yaw_rate * x)
    assert slip.lateral_sliding_speed[0] == pytest.approx(np.abs(across), abs=1e-6)


def test_rolling_tire_does_not_slide_and_a_locked_one_slides_at_the_cars_speed():
    model, data, car = FLAT
    car.set_pose(data, 0, 0, 0, 5.0)
    data.qpos[2] -= 1e-5
    assert slip_now(model, data).sliding_speed[0] == pytest.approx([0] * 4, abs=2e-3)
    for wheel in WHEELS[2:]:
        data.joint(f"{wheel}_wheel").qvel = 0.0
    slip = slip_now(model, data)
    assert slip.sliding_speed[0] == pytest.approx([0, 0, 5, 5], abs=2e-3)
    assert slip.slides[0].tolist() == [False, False, True, True]
    assert slip.friction_utilisation[0, 2:] == pytest.approx([1, 1], rel=1e-3)


def test_tire_off_the_ground_reads_nan_in_everything():
    model, data, car = FLAT
    car.set_pose(data, 0, 0, 0, 3.0)
    data.qpos[2] += 0.05
    slip = slip_now(model, data)
    for values in (slip.sliding_speed, slip.friction_utilisation, slip.normal_force, slip.friction_force):
        assert values.shape == (1, 4) and np.isnan(values).all()
    assert not slip.slides.any()


def test_forces_agree_with_the_engines_contacts_and_friction_stays_in_the_cone():
    """Oracle: mj_contactForce of each contact, in a turn at 0.8 of the limit and beyond it."""
    model, data, car = flat_world(mu=0.8)
    meter = TireSlipMeter(model)
    car.set_pose(data, 0, 0, 0, 3.0)
    tires = {model.geom(f"{wheel}_tire").id: index for index, wheel in enumerate(WHEELS)}
    contacts = 0
    for steering in np.linspace(0.0, 0.4, 100):
        car.apply(data, DriveCommand(steering_angle=steering, speed=3.0))
        mujoco.mj_step(model, data)
        expected = np.full((4, 2), np.nan)
        for index, contact in enumerate(data.contact):
            wrench = np.zeros(6)
            mujoco.mj_contactForce(model, data, index, wrench)
            tire = next(tires[int(geom)] for geom in contact.geom if int(geom) in tires)
            expected[tire] = wrench[0], np.hypot(*wrench[1:3])
            assert contact.friction[0] == 0.8
            contacts += 1
        meter.record(data)
        slip = meter.read()
        assert slip.normal_force[0] == pytest.approx(expected[:, 0], rel=1e-9, abs=1e-9, nan_ok=True)
        assert slip.friction_force[0] == pytest.approx(expected[:, 1], rel=1e-9, abs=1e-9, nan_ok=True)
        with np.errstate(invalid="ignore"):
            assert slip.friction_utilisation[0] == pytest.approx(expected[:, 1] / (0.8 * expected[:, 0]), nan_ok=True)
        assert not (slip.friction_utilisation > 1.0 + 1e-6).any()
    assert contacts > 300
