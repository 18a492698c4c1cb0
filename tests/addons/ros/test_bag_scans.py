"""A robot's scans as planners read them: what drivers do must not change what is seen where."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bag_worlds import robot_scan, rotation
from cases import each
from fg_mujoco.addons.ros.bag_frames import rotation as _rotation
from fg_mujoco.addons.ros.bag_messages import scan_message, to_cdr, type_store
from fg_mujoco.addons.ros.bag_scans import Mount, to_scan
from fg_mujoco.lidar.beams import LidarModel

DISTANCE = 0.125 * np.arange(1, 96)  # exact in float32, all of them different, within 0.1 to 12 m


def sent(message):
    """What arrives of a message: its numbers as float32."""
    return type_store().deserialize_cdr(to_cdr(message), message.__msgtype__)


def assert_ordered(scan):
    assert (np.diff(scan.bearings) > 0.0).all()
    assert scan.bearings[0] > -math.pi - scan.angle_increment
    assert scan.bearings[-1] < math.pi + scan.angle_increment
    assert scan.angle_max == pytest.approx(scan.bearings[-1])


def test_readings_that_are_no_distance_are_as_rep_117_has_them():
    readings = [math.nan, math.inf, -math.inf, 0.0, -1.0, 0.05, 0.1, 5.0, 12.0, 65.533]
    scan = to_scan(robot_scan(readings, range_min=0.1, range_max=12.0))
    expected = [math.nan, math.inf, -math.inf, math.nan, math.nan, -math.inf, 0.1, 5.0, math.inf, math.inf]
    np.testing.assert_allclose(scan.ranges[6], 0.1, rtol=1e-6)
    np.testing.assert_array_equal(np.delete(scan.ranges, 6), np.delete(expected, 6))


@each("count", [0, 1, 2, 1081])
def test_any_number_of_beams_is_a_scan(count):
    scan = to_scan(robot_scan(np.full(count, 2.0), first=-1.0, step=0.002))
    np.testing.assert_array_equal(scan.ranges, np.full(count, 2.0))
    np.testing.assert_allclose(scan.bearings, -1.0 + 0.002 * np.arange(count), atol=1e-6)


def test_a_scan_comes_back_as_it_went():
    beams = LidarModel.load().beams
    ranges = np.linspace(0.02, 29.9, len(beams.bearings))
    ranges[[3, 5, 8]] = math.nan, math.inf, -math.inf
    scan = beams.to_scan(ranges, stamp=12.025, swept=True)
    again = to_scan(sent(scan_message(scan)))
    np.testing.assert_array_equal(again.ranges, ranges.astype(np.float32).astype(np.float64))
    np.testing.assert_allclose(again.bearings, scan.bearings, atol=1e-6)
    assert again.stamp == pytest.approx(scan.stamp, abs=2e-9)
    for name in ("angle_min", "angle_max", "angle_increment", "range_min", "range_max", "time_increment", "scan_time"):
        assert getattr(again, name) == pytest.approx(getattr(scan, name), rel=1e-6)


def test_the_stamp_in_a_header_is_that_of_the_first_beam():
    message = robot_scan([1.0, 1.0, 1.0], time=5_000_000_000, time_increment=0.25)
    assert to_scan(message).stamp == 5.5
    scan = LidarModel.load().beams.to_scan(np.ones(1081), stamp=1.0, swept=True)
    stamp = scan_message(scan).header.stamp
    assert stamp.sec + 1e-9 * stamp.nanosec == pytest.approx(1.0 - 0.025 * 0.75)  # 270 of 360 deg in 25 ms


@pytest.mark.slow
@given(beams=st.integers(2, 95), share=st.floats(0.05, 0.99), start=st.floats(-math.pi, math.pi),
       turns=st.integers(-1, 1))  # fmt: skip
def test_wherever_the_beams_begin_the_same_is_seen(beams, share, start, turns):
    step = share * math.tau / (beams - 1) if share * math.tau / (beams - 1) * beams <= math.tau else math.tau / beams
    ranges = DISTANCE[:beams]
    scan = to_scan(robot_scan(ranges, first=start + turns * math.tau, step=step))
    assert_ordered(scan)
    finite = np.isfinite(scan.ranges)
    bearings = scan.bearings[finite][np.argsort(scan.ranges[finite])]
    np.testing.assert_array_equal(np.sort(scan.ranges[finite]), ranges)  # every beam is there once
    apart = np.array([math.remainder(b - (start + i * step), math.tau) for i, b in enumerate(bearings)])
    assert np.abs(apart).max() <= 0.5 * step + 1e-5


def test_a_full_circle_from_0_to_2_pi_is_turned_to_look_ahead():
    ranges = DISTANCE[:72]
    scan = to_scan(robot_scan(ranges, first=0.0, step=math.tau / 72))
    assert_ordered(scan)
    assert len(scan.ranges) == 72
    assert scan.ranges[36] == ranges[0]  # beam 0 looks ahead, and is in the middle
    assert scan.ranges[37] == ranges[1]
    assert scan.ranges[0] == ranges[36]
    again = to_scan(robot_scan(np.append(ranges, ranges[0]), first=0.0, step=math.tau / 72))  # 0 and 2 pi both
    np.testing.assert_array_equal(again.ranges, scan.ranges)
    failed = to_scan(robot_scan(np.append(ranges, math.nan), first=0.0, step=math.tau / 72))  # as an LD19 ends often
    np.testing.assert_array_equal(failed.ranges, scan.ranges)


@each("yaw, roll", [(0.0, 0.0), (0.3, 0.0), (0.0, math.pi), (-0.4, math.pi), (math.pi, 0.0)])
def test_bearings_are_those_of_the_car_however_the_lidar_is_mounted(yaw, roll):
    turned = _rotation(rotation(yaw, roll))
    scan = to_scan(robot_scan(DISTANCE[:40], first=-2.0, step=0.1), Mount.of(turned, "laser"))
    assert_ordered(scan)
    angles = -2.0 + 0.1 * np.arange(40)
    directions = turned @ np.array((np.cos(angles), np.sin(angles), np.zeros(40)))  # in 3D, from first principles
    for direction, distance in zip(directions.T, DISTANCE[:40], strict=True):
        (bearing,) = scan.bearings[scan.ranges == distance]
        off = math.remainder(bearing - math.atan2(direction[1], direction[0]), math.tau)
        assert abs(off) <= (1e-5 if yaw < 3.0 else 0.05)  # in the circle, a beam is within half a step of its place
