"""The widest gap: the field's worked formulas, the faults of its code, and the question that it leaves open."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fg_mujoco.controllers.widest_gap import WidestGap, WidestGapSettings
from fg_mujoco.messages import Odometry
from scan_worlds import CAR, INCREMENT, MU, corridor, odometry_of, scan_of


def planner(**changes):
    return WidestGap(CAR, MU, 8.0, WidestGapSettings(**changes))


def at(x, y, heading):
    zeros = np.zeros(3)
    return Odometry(
        stamp=0.0, speed=0.0, steering_angle=0.0, angular_velocity=zeros, linear_acceleration=zeros,
        wheel_speeds=np.zeros(4), pose=(x, y, heading),
    )  # fmt: skip


def stepped(*steps, length=5.0):
    """1081 readings that are `length` up to a beam, and from it on another: (beam, range from there on)."""
    ranges = np.full(1081, length)
    for beam, distance in steps:
        ranges[beam:] = distance
    return scan_of(ranges)


def centres_by_definition(scan, jump, half):
    """The middles of the widest pairs of neighbouring points, in the car frame; all by points in the plane."""
    points = np.column_stack((scan.ranges * np.cos(scan.bearings), scan.ranges * np.sin(scan.bearings)))
    gaps = []
    for i in range(len(points) - 1):
        inside = abs(scan.bearings[i]) <= half + 1e-9 and abs(scan.bearings[i + 1]) <= half + 1e-9
        if inside and abs(scan.ranges[i + 1] - scan.ranges[i]) > jump:
            centre = 0.5 * (points[i] + points[i + 1]) + (CAR.lidar_offset, 0.0)
            gaps.append((math.dist(points[i], points[i + 1]), *centre))
    widest = max(gaps)[0] if gaps else 0.0
    return [centre for width, *centre in gaps if width >= widest * (1.0 - 1e-9)]


@settings(max_examples=150, deadline=None)
@given(
    ranges=arrays(np.float64, st.integers(2, 60), elements=st.floats(0.0, 20.0), unique=True),
    increment=st.sampled_from([0.01, 0.05, 0.3]),
)
@pytest.mark.slow
def test_the_centre_is_the_middle_of_the_widest_jump_within_45_degrees(ranges, increment):
    scan = scan_of(ranges, increment)
    expected, found = centres_by_definition(scan, 0.5, math.pi / 4), planner().find_centre(scan)
    if found is None:
        assert not expected
    else:
        assert any(found == pytest.approx(tuple(centre), abs=1e-9) for centre in expected)


def test_the_last_beam_has_no_neighbour_beyond_it():
    # the source's loop is for a scan of 1080 beams, whatever comes
    assert planner().find_centre(scan_of([1.0])) is None
    assert planner().find_centre(scan_of([1.0, 4.0], 0.1)) is not None
    for count in (2, 3, 361, 720):
        assert planner().find_centre(scan_of(np.full(count, 4.0), 0.001)) is None


def test_beyond_45_degrees_nothing_is_a_gap():
    assert planner().find_centre(stepped((900, 2.0))) is None
    assert planner(field_of_view=math.pi).find_centre(stepped((900, 2.0))) is not None


def test_no_return_is_a_reading_at_the_greatest_range():
    for far in (math.inf, 30.0, 1e6):
        x, y = planner().find_centre(stepped((540, far)))
        assert math.hypot(x - CAR.lidar_offset, y) == pytest.approx(0.5 * (5.0 + 30.0), rel=1e-4)


# -- on the map


def test_a_gap_is_at_the_same_place_of_the_map_from_wherever_it_is_seen():
    """A gap with its centre 7 m ahead of the LiDAR, from poses all round it; C + X_car is elsewhere each time."""
    place, scan = np.array([3.0, -2.0]), stepped((540, 9.0))
    for heading in np.linspace(-math.pi, math.pi, 7):
        x, y = place - (7.0 + CAR.lidar_offset) * np.array([math.cos(heading), math.sin(heading)])
        assert planner().goal_in_map(scan, at(x, y, heading)) == pytest.approx(tuple(place), abs=7.0 * INCREMENT)
        if abs(heading) > 0.1:
            assert math.dist(np.add(planner().find_centre(scan), (x, y)), place) > 1.0


def test_without_a_pose_or_a_gap_there_is_no_place_on_the_map():
    assert planner().goal_in_map(stepped((540, 9.0)), odometry_of()) is None
    assert planner().goal_in_map(stepped(), at(0.0, 0.0, 0.0)) is None


# -- driving


def test_it_drives_past_the_near_end_of_the_gap_on_its_open_side():
    for beam, far, side in ((600, 9.0, 1.0), (480, 9.0, 1.0), (480, 2.0, -1.0)):
        scan, near = stepped((beam, far)), min(5.0, far)
        x, y = planner().find_centre(scan)
        straight = math.atan2(y, x - CAR.lidar_offset)
        for passing in (0.0, 0.3, 0.6):
            bearing, _ = planner(passing_distance=passing).find_goal(scan)
            assert near * math.sin(side * (bearing - straight)) == pytest.approx(passing, abs=1e-9)


def test_without_a_gap_it_goes_where_it_sees_furthest_ahead():
    bearing, distance = planner().find_goal(corridor(1.0, 2.0, ahead=8.0))
    assert abs(bearing) < 0.3 and distance > 8.0
    assert planner().find_goal(stepped())[0] == pytest.approx(0.0, abs=INCREMENT)
    assert planner().find_goal(scan_of([])) is None
