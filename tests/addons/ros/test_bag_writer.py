"""A run as a bag: the scans are those that the planner got, and other libraries read what was written."""

import json
import math

import numpy as np
import pytest
from mcap.reader import make_reader

import fg_mujoco as fg
from bag_worlds import decoded
from cases import each
from fg_mujoco import portable
from fg_mujoco.addons.ros.bag_messages import heading_of
from fg_mujoco.addons.ros.bag_reader import ScanBag
from fg_mujoco.addons.ros.bag_writer import TOPICS, export_bag
from fg_mujoco.addons.ros.occupancy_grid import OCCUPIED
from fg_mujoco.lidar.effects import LidarEffects
from fg_mujoco.lidar.point_cloud import POINT, POINTS, point_cloud
from fg_mujoco.messages import LaserScan
from fg_mujoco.racing.resimulation import load_world, resimulate
from field_races import shunt

ALL_EFFECTS = LidarEffects(range_noise_std=0.01, dropout_probability=0.05, latency=0.06, motion_distortion=True)


class Listener:
    """Steers to and fro, and keeps what it was told."""

    def reset(self):
        self.heard = []

    def __call__(self, scan, odometry):
        self.heard.append((scan, odometry))
        return fg.DriveCommand(steering_angle=0.1 * math.sin(len(self.heard)), speed=odometry.speed + 0.2)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Of a race of 40 ticks by the gap finder."""
    result = fg.race("l_corridor", laps=1, time_limit=0.99)
    return fg.write_run(result, tmp_path_factory.mktemp("runs") / "corridor", picture=False)


@pytest.fixture(scope="module")
def bag(folder):
    path = folder.with_name("corridor.mcap")
    assert export_bag(folder, path) == 40
    return path


@pytest.fixture(scope="module")
def messages(bag):
    """(log time, message) by topic."""
    return decoded(bag)


def test_bag_opens_with_a_summary_a_schema_a_topic_and_the_run_itself(bag, folder):
    with bag.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        assert reader.get_header().profile == "ros2"
    schemas = {channel.topic: summary.schemas[channel.schema_id] for channel in summary.channels.values()}
    assert {topic: schema.name for topic, schema in schemas.items()} == TOPICS
    assert {schema.encoding for schema in schemas.values()} == {"ros2msg"}
    assert {channel.message_encoding for channel in summary.channels.values()} == {"cdr"}
    assert json.loads(metadata["fg_mujoco"]["summary"]) == fg.read_run(folder).summary


@pytest.mark.slow
@each("track, effects, lidar",
      [("oval", LidarEffects(), "raycast"),
       ("oval", ALL_EFFECTS, "raycast"),
       ("scene:crossing_box:1", LidarEffects(no_return="range_max"), "raycast"),
       ("oval", LidarEffects(range_noise_std=0.02), "rangefinder")])  # fmt: skip
def test_a_run_is_sensed_again_bit_for_bit(track, effects, lidar, tmp_path):
    planner, here = Listener(), tmp_path / "run"
    fg.write_run(fg.race(track, planner, laps=1, time_limit=0.49, effects=effects, lidar=lidar, seed=3), here,
                 picture=False)  # fmt: skip
    run = fg.read_run(here)
    ticks = [tick.sensed for tick in resimulate(run, load_world(run))]
    assert len(ticks) == len(planner.heard) == 20
    for index, (tick, (scan, odometry)) in enumerate(zip(ticks, planner.heard, strict=True)):
        assert tick.scan.stamp == scan.stamp
        np.testing.assert_array_equal(tick.scan.ranges, scan.ranges)
        assert tick.odometry.stamp == run.time[index]
        for name in ("stamp", "speed", "steering_angle", "angular_velocity", "wheel_speeds", "pose"):
            np.testing.assert_array_equal(getattr(tick.odometry, name), getattr(odometry, name))
        # at the start the sensor is read with a solver that is warm already
        np.testing.assert_allclose(tick.odometry.linear_acceleration, odometry.linear_acceleration, atol=1e-6)


def test_scans_read_by_another_library_are_those_of_the_run(messages, folder):
    run = fg.read_run(folder)
    for (log_time, scan), tick in zip(messages["/scan"], resimulate(run, load_world(run)), strict=True):
        np.testing.assert_array_equal(np.array(scan.ranges, np.float32), tick.sensed.scan.ranges.astype(np.float32))
        assert log_time == scan.header.stamp.sec * 10**9 + scan.header.stamp.nanosec == round(1e9 * tick.time)
        assert scan.header.frame_id == "laser"
        assert scan.angle_min == pytest.approx(-scan.angle_max) == pytest.approx(math.radians(-135.0))
        assert (len(scan.ranges), len(scan.intensities), scan.time_increment) == (1081, 0, 0.0)


def test_points_of_a_mid360_are_those_that_the_planner_got(tmp_path):
    planner = Listener()
    fg.write_run(fg.race("oval", planner, laps=1, time_limit=0.35, lidar="mid360"), tmp_path / "run", picture=False)
    export_bag(tmp_path / "run", tmp_path / "run.mcap")
    found, heard = decoded(tmp_path / "run.mcap"), [odometry.readings["mid360"] for _, odometry in planner.heard]
    frames = [reading for reading in heard if len(reading.stamps)]
    assert len(frames) == len(found["/livox/lidar"]) == 3
    for (log_time, cloud), reading in zip(found["/livox/lidar"], frames, strict=True):
        points = np.frombuffer(bytes(cloud.data), POINT)
        assert [(field.name, field.offset) for field in cloud.fields] == [(n, POINT.fields[n][1]) for n in POINT.names]
        assert (cloud.point_step, cloud.width, cloud.header.frame_id) == (26, POINTS, "livox_frame")
        assert np.array_equal(points, point_cloud(reading.values, log_time)) and points["intensity"].any()
        first = cloud.header.stamp.sec * 10**9 + cloud.header.stamp.nanosec
        assert first == points["timestamp"][0] == log_time - 98_750_000
    (mount,) = [each for each in found["/tf_static"][0][1].transforms if each.child_frame_id == "livox_frame"]
    assert mount.transform.translation.z == pytest.approx(0.0614 + 0.07, abs=1e-4)


def test_odometry_read_by_another_library_is_that_of_the_telemetry(messages, folder):
    run = fg.read_run(folder)
    for i, (_, odometry) in enumerate(messages["/odom"]):
        assert (odometry.header.frame_id, odometry.child_frame_id) == ("odom", "base_link")
        assert odometry.pose.pose.position.x == run.column("x_m")[i]
        assert odometry.pose.pose.position.y == run.column("y_m")[i]
        assert odometry.pose.pose.position.z == pytest.approx(0.0486, abs=5e-3)  # base_link is the axle, not the ground
        turn = odometry.pose.pose.orientation
        heading = portable.arctan2(2.0 * (turn.w * turn.z + turn.x * turn.y), 1.0 - 2.0 * (turn.y**2 + turn.z**2))
        assert heading == run.column("heading_rad")[i]
        assert odometry.twist.twist.linear.x == pytest.approx(run.column("speed_m_s")[i], abs=0.3)  # wheels slip
        assert odometry.twist.twist.angular.z == run.column("yaw_rate_rad_s")[i]
        assert not any(odometry.pose.covariance) and not any(odometry.twist.covariance)  # unknown
    xy = np.array([(o.pose.pose.position.x, o.pose.pose.position.y) for _, o in messages["/odom"]])
    heading = run.column("heading_rad")
    moved = np.gradient(xy, 0.025, axis=0)
    sideways = -np.sin(heading) * moved[:, 0] + np.cos(heading) * moved[:, 1]
    lateral = [o.twist.twist.linear.y for _, o in messages["/odom"]]
    np.testing.assert_allclose(lateral[1:-1], sideways[1:-1], atol=0.02)


def test_commands_joints_and_imu_are_those_of_the_run(messages, folder):
    run = fg.read_run(folder)
    drive = [message.drive for _, message in messages["/drive"]]
    assert [d.steering_angle for d in drive] == run.column("command_steering_rad").astype(np.float32).tolist()
    assert [d.speed for d in drive] == run.column("command_speed_m_s").astype(np.float32).tolist()
    for i, (_, joints) in enumerate(messages["/joint_states"]):
        assert joints.name[0] == "steering"
        assert joints.position[0] == run.column("steering_angle_rad")[i]
        wheels = np.array(joints.velocity[1:])
        speed = messages["/odom"][i][1].twist.twist.linear.x
        assert 0.04899 * wheels.mean() == pytest.approx(speed, rel=0.01, abs=1e-9)
        motor = messages["/sensors/core"][i][1].state
        assert motor.speed == pytest.approx(4614.0 * speed) and 12.0 < motor.voltage_input < 13.0
    _, imu = messages["/imu"][20]
    assert imu.header.frame_id == "imu"
    assert imu.orientation_covariance[0] == -1.0  # it measures none
    assert (imu.angular_velocity_covariance[0], imu.linear_acceleration_covariance[0]) == (0.0, 0.0)
    assert imu.linear_acceleration.z == pytest.approx(9.81, abs=3.0)
    assert imu.angular_velocity.z == run.column("yaw_rate_rad_s")[20]


def test_every_beam_ends_on_an_occupied_cell_of_the_map(messages):
    """By what is in the bag alone: scan, frames and map must fit together."""
    _, grid = messages["/map"][0]
    assert grid.header.frame_id == "map"
    assert grid.info.resolution == pytest.approx(0.05)
    cells = np.array(grid.data).reshape(grid.info.height, grid.info.width)
    mount = next(t.transform for t in messages["/tf_static"][0][1].transforms if t.child_frame_id == "laser")
    hits = total = 0
    for (_, scan), (_, odometry) in list(zip(messages["/scan"], messages["/odom"], strict=True))[::8]:
        pose = odometry.pose.pose
        heading = 2.0 * math.atan2(pose.orientation.z, pose.orientation.w)
        bearings = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
        ranges = np.array(scan.ranges)
        there = np.isfinite(ranges)
        x = mount.translation.x + ranges[there] * np.cos(bearings[there])
        y = ranges[there] * np.sin(bearings[there])
        world_x = pose.position.x + math.cos(heading) * x - math.sin(heading) * y
        world_y = pose.position.y + math.sin(heading) * x + math.cos(heading) * y
        column = np.floor((world_x - grid.info.origin.position.x) / grid.info.resolution).astype(int)
        row = np.floor((world_y - grid.info.origin.position.y) / grid.info.resolution).astype(int)
        near = [cells[r - 1 : r + 2, c - 1 : c + 2].max() for r, c in zip(row, column, strict=True)]
        hits, total = hits + sum(value == OCCUPIED for value in near), total + len(near)
    assert hits >= 0.99 * total  # a pitching car sees the ground now and then


def test_same_run_same_bytes(folder, bag, tmp_path):
    export_bag(folder, tmp_path / "again.mcap")
    assert (tmp_path / "again.mcap").read_bytes() == bag.read_bytes()


# several cars: topics as f1tenth_gym_ros names them, and what each car's planner was told


@pytest.fixture(scope="module")
def bag_of_two(tmp_path_factory):
    folder = tmp_path_factory.mktemp("two")
    export_bag(fg.write_run(shunt()[0], folder / "run", picture=False), folder / "run.mcap")
    return folder / "run.mcap"


@pytest.fixture(scope="module")
def two(bag_of_two):
    """Messages by topic."""
    return {topic: [message for _, message in found] for topic, found in decoded(bag_of_two).items()}


@pytest.mark.slow
def test_topics_of_two_cars_are_those_of_f1tenth_gym_ros(two):
    named = {"/ego_racecar/odom", "/ego_racecar/opp_odom", "/opp_racecar/opp_odom", "/opp_scan", "/opp_drive"}
    others = ("odom", "imu", "joint_states", "sensors/core")
    assert set(two) == set(TOPICS) | named | {f"/opp_racecar/{name}" for name in others}


def test_scans_are_those_that_each_planner_got(two):
    _, planners = shunt()
    for topic, planner, frame in (("/scan", planners[0], "laser"), ("/opp_scan", planners[1], "opp_racecar/laser")):
        assert len(two[topic]) == len(planner.heard)
        for message, (scan, _) in zip(two[topic], planner.heard, strict=True):
            np.testing.assert_array_equal(np.array(message.ranges, np.float32), scan.ranges.astype(np.float32))
            assert message.header.frame_id == frame
    assert np.isnan(two["/opp_scan"][5].ranges).any() != np.isnan(two["/scan"][5].ranges).any()  # dropouts of one


def test_odometry_is_what_each_planner_was_told_and_each_has_the_other_s(two):
    race, planners = shunt()
    for topic, car in (("/ego_racecar/odom", 0), ("/opp_racecar/odom", 1)):
        for message, (_, odometry) in zip(two[topic], planners[car].heard, strict=True):
            assert message.twist.twist.linear.x == odometry.speed
            assert message.pose.pose.position.x == pytest.approx(odometry.pose[0], abs=1e-12)
            assert heading_of(message.pose.pose.orientation) == pytest.approx(odometry.pose[2], abs=1e-9)
            assert message.header.frame_id == "map"
    assert two["/ego_racecar/odom"][0].child_frame_id == "ego_racecar/base_link"
    for other, own in (("/ego_racecar/opp_odom", "/opp_racecar/odom"), ("/opp_racecar/opp_odom", "/ego_racecar/odom")):
        assert [str(message) for message in two[other]] == [str(message) for message in two[own]]
    commands = race.cars[1].column("command_speed_m_s")
    np.testing.assert_allclose([message.drive.speed for message in two["/opp_drive"]], commands, rtol=1e-6)


def test_frames_of_the_other_car_hang_on_the_map(two):
    parents = {entry.child_frame_id: entry.header.frame_id for message in two["/tf"] for entry in message.transforms}
    parents |= {e.child_frame_id: e.header.frame_id for message in two["/tf_static"] for e in message.transforms}
    assert parents == {"odom": "map", "base_link": "odom", "laser": "base_link", "imu": "base_link",
                       "ego_racecar/base_link": "base_link", "opp_racecar/base_link": "map",
                       "opp_racecar/laser": "opp_racecar/base_link", "opp_racecar/imu": "opp_racecar/base_link"}


def test_bag_is_read_as_that_of_car_0_or_of_another_by_its_topics(bag_of_two):
    race, planners = shunt()
    for topics, planner in (({}, planners[0]), ({"scan_topic": "/opp_scan"}, planners[1])):
        with ScanBag(bag_of_two, race.world.parameters, **topics) as bag:
            scans = [delivery.scan for delivery in bag]
        assert len(scans) == len(planner.heard) and isinstance(scans[0], LaserScan)
        np.testing.assert_allclose(scans[3].ranges, planner.heard[3][0].ranges, rtol=1e-6)
    assert fg.read_run(bag_of_two.with_name("run")).summary["cars"][1]["name"] == "car_1"
