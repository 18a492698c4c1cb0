"""The cars' MJCFs have the published constants, and `Car` reads, places and drives it under any prefix."""

import math
from importlib.resources import files

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fg_mujoco as fg
from car_worlds import flat_world, run
from cases import each
from fg_mujoco.messages import DriveCommand
from fg_mujoco.vehicle.car import Car
from fg_mujoco.vehicle.vehicle import Vehicle
from vehicle_worlds import open_file

SCENE = str(files("fg_mujoco.models") / "scene.xml")
WORLDS = {prefix: flat_world(prefix=prefix) for prefix in ("", "car/")}

# f1tenth_gym, CommonRoad 1:10; design.md; the last two are not the community's, but chosen in models/f1tenth.xml
COMMUNITY = {
    "mass": 3.74, "front_axle_distance": 0.15875, "rear_axle_distance": 0.17145, "wheelbase": 0.3302,
    "center_of_gravity_height": 0.074, "yaw_inertia": 0.04712, "wheel_radius": 0.049, "max_steering_angle": 0.4189,
    "max_steering_rate": 3.2, "min_speed": -5.0, "max_speed": 20.0, "max_acceleration": 9.51,
    "power_limit_speed": 7.319, "length": 0.58, "width": 0.31, "lidar_offset": 0.275, "gravity": 9.81,
    "track_width": 0.236, "speed_time_constant": 0.1,
}  # fmt: skip
# ForzaETH/On-Track-SysID, NUC2; the others are those of f1tenth.xml
NUC2 = COMMUNITY | {
    "mass": 4.5, "front_axle_distance": 0.17, "rear_axle_distance": 0.155, "wheelbase": 0.325,
    "center_of_gravity_height": 0.02, "yaw_inertia": 0.0627,
}  # fmt: skip
# of its owners: F1Tenth-INI/f1tenth_development_gym; and identified, docs/addons/realcar/identification.md
IPZ = COMMUNITY | {
    "mass": 4.0, "front_axle_distance": 0.162, "rear_axle_distance": 0.145, "wheelbase": 0.307,
    "yaw_inertia": 0.1195, "lidar_offset": 0.27, "max_steering_angle": 0.4758, "steering_time_constant": 0.0530,
    "command_delay": 0.0038,
}  # fmt: skip


@pytest.fixture(scope="module")
def flat():
    return flat_world()


@each(("vehicle", "constants"), [("f1tenth", COMMUNITY), ("nuc2", NUC2), ("ipz", IPZ)])
def test_a_compiled_car_has_its_published_measured_and_identified_constants(vehicle, constants):
    parameters = Vehicle.load(vehicle).parameters
    for name, value in constants.items():
        assert getattr(parameters, name) == pytest.approx(value, rel=1e-4), name


def test_what_ipz_is_sent_becomes_the_angle_of_its_wheels_by_the_identified_map_and_a_command_is_that_angle():
    vehicle = Vehicle.load("ipz")
    response, angles = vehicle.command_response, np.array((-0.3, 0.0, 0.2))
    assert response.wheel_angle(np.array((0.2, -0.1))) == pytest.approx((1.339 * 0.2 + 0.0019, 0.0019 - 0.1339))
    assert response.wheel_angle(response.steering_command(angles)) == pytest.approx(angles)
    commands = fg.Commands(time=np.array([0.0, 1.0]), steering_angle=np.full(2, 0.2), speed=np.full(2, 1.0))
    angle = fg.drive(commands, vehicle=vehicle).car.column("steering_angle_rad")
    assert angle[-1] == pytest.approx(0.2, abs=1e-4)
    turned = np.interp(0.2 * (1.0 - math.exp(-1.0)), angle, 0.025 * np.arange(len(angle)))
    assert turned == pytest.approx(0.0530 + 0.0038, abs=0.015)  # its lag and delay, seen at ticks
    assert response.acceleration(np.array((2.0, -2.0))) == pytest.approx((1.185 * 2.0, 0.0))


def test_a_steering_ends_where_its_joint_does_whatever_is_commanded(tmp_path):
    file = tmp_path / "car.xml"
    file.write_text(Vehicle.load("ipz").text.replace('ctrlrange="-0.4758 0.4758"', 'ctrlrange="-0.6 0.6"'))
    commands = fg.Commands(time=np.array([0.0, 1.0]), steering_angle=np.full(2, -0.6), speed=np.full(2, 1.0))
    angle = fg.drive(commands, vehicle=file).car.column("steering_angle_rad")[-1]
    assert angle == pytest.approx(-0.4758, abs=1e-6)


def test_whole_car_inertia_agrees_with_the_engine(flat):
    """Oracle: the engine's joint-space inertia matrix of the free joint, shifted from base_link to the CoG."""
    model, data, car = flat
    mujoco.mj_resetData(model, data)
    mujoco.mj_forward(model, data)
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    mass = inertia[0, 0]
    center = data.subtree_com[model.body("base_link").id] - data.body("base_link").xpos
    about_center = np.diag(inertia)[3:6] - mass * (center @ center - center**2)
    assert mass == pytest.approx(car.parameters.mass, rel=1e-9)
    assert about_center[2] == pytest.approx(car.parameters.yaw_inertia, rel=1e-6)
    assert about_center == pytest.approx([0.013587, 0.039767, 0.04712], rel=1e-4)  # as derived in the MJCF
    assert center[1] == pytest.approx(0.0, abs=1e-12)


@settings(max_examples=30, deadline=None)
@given(
    x=st.floats(-100, 100), y=st.floats(-100, 100), heading=st.floats(-10, 10), speed=st.floats(-5, 20),
    prefix=st.sampled_from(["", "car/"]),
)  # fmt: skip
def test_pose_is_where_the_car_was_set(x, y, heading, speed, prefix):
    _, data, car = WORLDS[prefix]
    car.set_pose(data, x, y, heading, speed)
    got_x, got_y, got_heading = car.pose(data)
    assert (got_x, got_y) == (x, y)
    assert math.remainder(got_heading - heading, math.tau) == pytest.approx(0.0, abs=1e-9)
    assert car.ground_speed(data) == pytest.approx(speed, abs=1e-9)
    odometry = car.odometry(data)
    assert odometry.speed == pytest.approx(speed, abs=1e-9)
    assert odometry.steering_angle == 0.0 and odometry.yaw_rate == pytest.approx(0.0, abs=1e-9)


def test_imu_feels_the_turn():
    model, data, car = flat_world(vehicle=open_file())
    car.set_pose(data, 0, 0, 0, 2.0)
    car.apply(data, DriveCommand(steering_angle=0.2, speed=2.0))
    run(model, data, 2.0)
    odometry = car.odometry(data)
    rear_axle_speed = odometry.wheel_speeds[2:].mean()
    yaw_rate = rear_axle_speed * math.tan(0.2) / car.parameters.wheelbase
    assert odometry.yaw_rate == pytest.approx(yaw_rate, rel=2e-3)
    # in the CoG, and turned with the body, which rolls on springs and tires: level, a cos(roll) + g sin(roll)
    axes, heading = data.body("base_link").xmat.reshape(3, 3), car.pose(data)[2]
    cos, sin = math.cos(heading), math.sin(heading)
    inward = [-(yaw_rate**2) * car.parameters.rear_axle_distance, yaw_rate * rear_axle_speed, 9.81]
    expected = axes.T @ [cos * inward[0] - sin * inward[1], sin * inward[0] + cos * inward[1], inward[2]]
    assert odometry.linear_acceleration == pytest.approx(expected, abs=0.025)  # m/s^2; the tires creep by 10 mm/s
    assert odometry.linear_acceleration[1] == pytest.approx(expected[1], rel=2e-3)
    assert math.asin(axes[2, 1]) > 0.005  # it does roll, to the outside
    # the front wheels go round a larger circle, and the drive holds the mean of all four
    assert odometry.speed == pytest.approx(rear_axle_speed * (1 + 1 / math.cos(0.2)) / 2, rel=2e-3)
    left, right = odometry.wheel_speeds[[0, 2]], odometry.wheel_speeds[[1, 3]]
    assert (left < right).all()  # the outer wheels turn faster


def test_scene_opens_without_our_python_and_drives():
    model = mujoco.MjModel.from_xml_path(SCENE)
    data = mujoco.MjData(model)
    data.ctrl[:] = 0.1, 1.5
    run(model, data, 1.0)
    assert data.body("base_link").xpos[0] > 0.8 and data.body("base_link").xpos[1] > 0.05
    assert Car(model).ground_speed(data) == pytest.approx(1.5, rel=0.01)
    assert data.warning.number.sum() == 0
