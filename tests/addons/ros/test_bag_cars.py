"""Bags of several cars: topics as f1tenth_gym_ros names them, and what each car's planner was told."""

import json

import numpy as np
import pytest

import fg_mujoco as fg
from bag_worlds import decoded
from fg_mujoco.addons.ros.bag_messages import heading_of
from fg_mujoco.addons.ros.bag_reader import ScanBag
from fg_mujoco.addons.ros.bag_writer import TOPICS, export_bag
from fg_mujoco.messages import LaserScan
from field_races import shunt

OF_A_CAR = ("odom", "imu", "joint_states")


def written(race, folder):
    """The messages of a bag of a race, by topic."""
    export_bag(fg.write_run(race, folder / "run", picture=False), folder / "run.mcap")
    return {topic: [message for _, message in found] for topic, found in decoded(folder / "run.mcap").items()}


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    return written(shunt()[0], tmp_path_factory.mktemp("two"))


@pytest.mark.slow
def test_topics_of_two_cars_are_those_of_f1tenth_gym_ros(two):
    named = {"/ego_racecar/odom", "/ego_racecar/opp_odom", "/opp_racecar/opp_odom", "/opp_scan", "/opp_drive"}
    assert set(two) == set(TOPICS) | named | {f"/opp_racecar/{name}" for name in OF_A_CAR}


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


@pytest.mark.slow
def test_bag_is_read_as_that_of_car_0_or_of_another_by_its_topics(two, tmp_path):
    race, planners = shunt()
    run = fg.write_run(race, tmp_path / "run", picture=False)
    export_bag(run, tmp_path / "run.mcap")
    car = race.world.parameters
    for topics, planner in (({}, planners[0]), ({"scan_topic": "/opp_scan"}, planners[1])):
        with ScanBag(tmp_path / "run.mcap", car, **topics) as bag:
            scans = [delivery.scan for delivery in bag]
        assert len(scans) == len(planner.heard) and isinstance(scans[0], LaserScan)
        np.testing.assert_allclose(scans[3].ranges, planner.heard[3][0].ranges, rtol=1e-6)
    assert json.loads((run / "summary.json").read_text())["cars"][1]["name"] == "car_1"
