"""What docs/conventions.md says of other software: each row has a test, here or where its subject is tested."""

import math
import re
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

import fg_mujoco as fg
from bag_worlds import robot_scan
from cases import each
from fg_mujoco.addons.ros.bag_messages import from_cdr, type_store
from fg_mujoco.course.line_file import read_line_file
from fg_mujoco.errors import BagError

ROOT = Path(__file__).parents[2]
REP_117 = "addons/ros/test_bag_scans.py::test_readings_that_are_no_distance_are_as_rep_117_has_them"
FULL_CIRCLE = "addons/ros/test_bag_scans.py::test_a_full_circle_from_0_to_2_pi_is_turned_to_look_ahead"
THRESHOLD = "core/test_map_file.py::test_free_is_what_is_up_to_the_threshold_as_nav2_has_it"
SIGNS = (
    "addons/ros/test_bag_signs.py::"
    "test_odometry_that_is_negative_forward_is_turned_round_by_what_commands_or_scans_say"
)
GREY = "test_grey_of_unknown_ground_that_counts_as_free_is_named_with_the_setting_that_makes_it_a_wall"
HERE = "addons/test_conventions.py::"
TESTS = {  # the beginning of a row -> its tests
    "urg_node2": [REP_117],
    "sllidar_ros2": [REP_117, FULL_CIRCLE],
    "ydlidar_ros2_driver": [REP_117],
    "LD19": [FULL_CIRCLE, "addons/ros/test_bag_reader.py::test_a_planner_goes_on_where_the_beams_change_in_the_middle"],
    "map_saver, ROS 1": [THRESHOLD],
    "map_saver, nav2": ["core/test_map_course.py::" + GREY],
    "Cartographer": [THRESHOLD],
    "map_server": [THRESHOLD, "core/test_map_file.py::test_raw_brightness_is_the_probability_in_percent"],
    "TUM's": [HERE + "test_a_heading_from_either_axis_is_that_of_the_line"],
    "f1tenth_racetracks": [HERE + "test_a_heading_from_either_axis_is_that_of_the_line"],
    "f1tenth_system": ["addons/ros/test_bag_composed.py::test_motor_and_servo_of_a_vesc_count_as_they_do_in_nodes"],
    "f1tenth/vesc": [SIGNS],
    "ROS 2, QoS": ["addons/servers/test_ros2.py::test_who_comes_and_cannot_match_or_publishes_the_same_is_told"],
    "ROS 2, CDR": [
        HERE + "test_messages_of_either_byte_order_are_read",
        HERE + "test_padding_behind_a_message_is_left_out_up_to_eight_bytes",
        HERE + "test_another_encoding_than_xcdr1_is_named",
    ],
    "MuJoCo 3.17, materials": [
        "core/test_lidar.py::test_transparent_geoms_are_invisible_to_both_backends",
        "core/vehicle_contract/test_vehicle_refusals.py::test_beams_see_a_part_of_another_car_where_pictures_draw_it",
    ],
    "MuJoCo 3.17, mocap": ["core/test_moving_obstacles.py::test_the_lidar_sees_it_without_lag"],
    "MuJoCo 3.17, `sleep`": [HERE + "test_a_car_that_stands_is_awake"],
    "f1tenth_gym 0.2.1, servo": ["addons/gym2d/test_f110_interfaces.py::test_footprints_and_servos_are_the_gyms"],
    "f1tenth_gym 0.2.1, laps": [
        "addons/gym2d/test_f110.py::test_the_episode_is_done_when_all_cars_have_driven_two_laps"
    ],
    "AutoDRIVE": [
        "addons/servers/test_autodrive_bridge.py::test_a_packet_has_what_the_simulator_tells_in_its_units",
        "addons/ros/test_ros_surroundings.py::test_a_node_of_autodrive_drives_by_throttle_and_steering",
    ],
}


def test_each_row_of_the_page_has_a_test_that_is_there():
    text = (ROOT / "docs" / "conventions.md").read_text("utf-8")
    rows = re.findall(r"^\| (?!software|---)([^|]+) \|", text, re.M)
    assert [row for row in rows if sum(row.startswith(begin) for begin in TESTS) != 1] == []
    assert [begin for begin in TESTS if not any(row.startswith(begin) for row in rows)] == []
    for path, name in (test.split("::") for tests in TESTS.values() for test in tests):
        assert f"\ndef {name}(" in (ROOT / "tests" / path).read_text("utf-8"), name


@each("turns, since", [(1.0, 0.5 * math.pi), (1.0, 0.0), (-1.0, 0.0)], ids=["f1tenth_racetracks", "TUM", "mirrored"])
def test_a_heading_from_either_axis_is_that_of_the_line(turns, since, tmp_path):
    angle = np.linspace(0.0, math.tau, 100, endpoint=False)
    heading = np.remainder(turns * angle + since + math.pi, math.tau) - math.pi
    x, y, one = 5.0 * np.cos(angle), 5.0 * np.sin(angle), np.ones(100)
    path = tmp_path / "line.csv"
    names = "s_m; x_m; y_m; psi_rad; kappa_radpm; vx_mps; ax_mps2"
    np.savetxt(path, np.c_[5.0 * angle, x, y, heading, 0.2 * one, 3.0 * one, 0.0 * one], delimiter="; ", header=names)
    line = read_line_file(path, course=False)
    np.testing.assert_allclose(line.points, np.c_[x, y], atol=1e-9)
    assert ("psi_rad is not the heading" in line.said) is (turns < 0.0)


@each("little_endian", [True, False])
def test_messages_of_either_byte_order_are_read(little_endian):
    message = robot_scan([1.0, 2.5, 3.0])
    kind = message.__msgtype__
    again = from_cdr(type_store().serialize_cdr(message, kind, little_endian=little_endian), kind)
    assert again.angle_min == pytest.approx(message.angle_min)
    np.testing.assert_array_equal(again.ranges, message.ranges)


@each("padding, read", [(0, True), (3, True), (4, True), (8, True), (12, False)])
def test_padding_behind_a_message_is_left_out_up_to_eight_bytes(padding, read):
    message = robot_scan([1.0, 2.5, 3.0])
    content = bytes(type_store().serialize_cdr(message, message.__msgtype__)) + bytes(padding)
    if read:
        np.testing.assert_array_equal(from_cdr(content, message.__msgtype__).ranges, message.ranges)
    else:
        with pytest.raises(Exception, match="size mismatch"):
            from_cdr(content, message.__msgtype__)


@each("number, encoding", [(3, "PL_CDR"), (6, "XCDR2"), (7, "XCDR2"), (9, "XCDR2"), (11, "XCDR2"), (17, "XCDR2")])
def test_another_encoding_than_xcdr1_is_named(number, encoding):
    with pytest.raises(BagError, match=f"LaserScan is written in {encoding}; accepted: XCDR1"):
        from_cdr(bytes((0, number, 0, 0)) + bytes(40), "sensor_msgs/msg/LaserScan")


@each("policy", ["never", "auto", "allowed"])
def test_a_car_that_stands_is_awake(policy, tmp_path):
    """After five seconds without a motion the first command moves it."""
    text = (files("fg_mujoco.models") / "f1tenth.xml").read_text("utf-8")
    path = tmp_path / "car.xml"
    path.write_text(text.replace('sleep="never"', f'sleep="{policy}"'), "utf-8")
    simulation = fg.Simulation(fg.World(fg.OpenGround(seconds=20.0), path, tires="coulomb"))
    simulation.reset()
    for speed, ticks in ((0.0, 200), (1.0, 40)):
        for _ in range(ticks):
            simulation.step(fg.DriveCommand(steering_angle=0.0, speed=speed))
    assert simulation.data.qvel[0] == pytest.approx(1.0, abs=0.02)
