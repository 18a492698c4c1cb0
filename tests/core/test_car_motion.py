"""What a tick reads off a car's state is what the model's sensors say, and its commands reach its own actuators."""

import math

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from car_worlds import flat_world, run
from fg_mujoco.messages import ODOMETRY, DriveCommand
from fg_mujoco.vehicle import motion as car_motion
from fg_mujoco.vehicle.car import WHEELS, Car
from fg_mujoco.vehicle.vehicle import Vehicle

rate = st.floats(-30, 30)

WORLDS = {prefix: flat_world(prefix=prefix) for prefix in ("", "car/")}


def two_cars():
    """Two cars in one model, 5 m apart; return (model, data, first car, second car)."""
    spec = mujoco.MjSpec()
    spec.option, spec.memory = Vehicle.load().spec().option, Vehicle.load().spec().memory
    for prefix in ("first/", "second/"):
        spec.attach(Vehicle.load().spec(), prefix=prefix, frame=spec.worldbody.add_frame())
    model = spec.compile()
    data, cars = mujoco.MjData(model), [Car(model, prefix) for prefix in ("first/", "second/")]
    for car, y in zip(cars, (0.0, 5.0), strict=True):
        car.set_pose(data, 0.0, y, 0.0)
    return model, data, *cars


def scatter(model, data, seed):
    """Set any orientation, joint positions and velocities, and measure them."""
    rng = np.random.default_rng(seed)
    mujoco.mj_resetData(model, data)
    data.qpos[:] += rng.uniform(-0.3, 0.3, model.nq)
    data.qpos[:3] = rng.uniform((-9.0, -9.0, 1.0), 9.0)  # in the air
    data.qpos[3:7] = rng.normal(size=4)
    data.qvel[:] = rng.uniform(-30.0, 30.0, model.nv)
    mujoco.mj_normalizeQuat(model, data.qpos)
    mujoco.mj_forward(model, data)


def sensor(data, prefix, name):
    return data.sensor(prefix + name).data


def read_odometry(data, car):
    row = np.zeros(1, ODOMETRY)
    car_motion.read_odometry(data.time, data.qpos, data.qvel, data.sensordata, car.constants, row)
    return row[0]


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), prefix=st.sampled_from(["", "car/"]))
def test_odometry_is_what_the_models_sensors_say(seed, prefix):
    """In any state, however the car lies and turns."""
    model, data, car = WORLDS[prefix]
    scatter(model, data, seed)
    data.time = 0.25 * seed
    row, radius = read_odometry(data, car), car.parameters.wheel_radius
    wheels = [sensor(data, prefix, f"{wheel}_wheel_speed")[0] for wheel in WHEELS]
    assert row["stamp"] == 0.25 * seed
    assert row["angular_velocity"] == pytest.approx(sensor(data, prefix, "gyro"), abs=1e-9)
    assert row["linear_acceleration"].tolist() == sensor(data, prefix, "accelerometer").tolist()
    assert row["steering_angle"] == sensor(data, prefix, "steering_angle")[0]
    assert row["wheel_speeds"] == pytest.approx(np.multiply(wheels, radius), rel=1e-12)
    assert row["speed"] == pytest.approx(np.mean(wheels) * radius, rel=1e-9, abs=1e-12)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), prefix=st.sampled_from(["", "car/"]))
def test_pose_and_speeds_are_what_the_engine_says(seed, prefix):
    """Oracles: the frame of base_link, its velocity, and the velocity of the drive tendon."""
    model, data, car = WORLDS[prefix]
    scatter(model, data, seed)
    x, y, heading = car_motion.planar_pose(data.qpos, car.constants)
    body = data.body(f"{prefix}base_link")
    ahead = body.xmat.reshape(3, 3)[:, 0]
    assert (x, y) == pytest.approx(body.xpos[:2], abs=1e-12)
    assert math.remainder(heading - math.atan2(ahead[1], ahead[0]), math.tau) == pytest.approx(0.0, abs=1e-6)
    velocity = np.zeros(6)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, body.id, velocity, 0)
    along = velocity[3] * math.cos(heading) + velocity[4] * math.sin(heading)
    assert car_motion.ground_speed(data.qpos, data.qvel, car.constants) == pytest.approx(along, abs=1e-9)
    tendon = data.ten_velocity[model.tendon(f"{prefix}drive").id]
    assert car_motion.surface_speed(data.qvel, car.constants) == pytest.approx(tendon, abs=1e-9)


def test_each_of_two_cars_reads_its_own_state_and_drives_its_own_wheels():
    model, data, first, second = two_cars()
    data.ctrl[:] = 0.5
    first.apply(data, DriveCommand(steering_angle=0.1, speed=1.0))
    second.apply(data, DriveCommand(steering_angle=-0.2, speed=2.0))
    assert {model.actuator(index).name: data.ctrl[index] for index in range(model.nu)} == {
        "first/steering": 0.1, "first/speed": 1.0, "second/steering": -0.2, "second/speed": 2.0,
    }  # fmt: skip
    run(model, data, 1.5)
    for car, sign, speed in ((first, 1.0, 1.0), (second, -1.0, 2.0)):
        odometry = car.odometry(data)
        assert odometry.steering_angle == pytest.approx(0.1 if sign > 0 else -0.2, abs=1e-3)
        assert odometry.speed == pytest.approx(speed, rel=0.01)
        assert sign * odometry.yaw_rate > 0.1 and sign * odometry.linear_acceleration[1] > 0.1
        assert car.ground_speed(data) == pytest.approx(speed, rel=0.03)
    assert first.pose(data)[1] > 0.1 and second.pose(data)[1] < 4.9


@given(steering=rate, speed=rate)
def test_drive_holds_a_command_within_the_limits(steering, speed):
    """Oracle: numpy's clip."""
    model, data, car = WORLDS["car/"]
    limits = car.parameters
    mujoco.mj_resetData(model, data)
    data.ctrl[:] = 7.0
    car_motion.drive(steering, speed, car.constants, data.ctrl)
    assert data.actuator("car/steering").ctrl[0] == np.clip(steering, -0.4189, 0.4189)
    assert data.actuator("car/speed").ctrl[0] == np.clip(speed, limits.min_speed, limits.max_speed)
