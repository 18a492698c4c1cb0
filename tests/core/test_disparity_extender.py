"""The disparity extender on scans of simple places, and against a slow computation by its definition."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cases import each
from fg_mujoco.controllers.control.planner_settings import for_car
from fg_mujoco.controllers.disparity_extender import DisparityExtender, DisparityExtenderSettings
from scan_worlds import CAR, INCREMENT, MU, mirrored, odometry_of, scan_of

BEARINGS = INCREMENT * (np.arange(1081) - 540)


def extender(**changes):
    return DisparityExtender(CAR, MU, 8.0, DisparityExtenderSettings(**changes))


def wished_steering(scan, **changes):
    """The steering angle [rad] of the command, with no guard between the planner and it."""
    planner = DisparityExtender(CAR, math.inf, 8.0, DisparityExtenderSettings(**changes))
    return planner(scan, odometry_of(1.0)).steering_angle


def scan_with(*blocks, length=8.0):
    """Open space, but for (from, to, range): bearings [rad] and distance [m]."""
    ranges = np.full(1081, length)
    for right, left, distance in blocks:
        ranges[np.abs(BEARINGS - 0.5 * (right + left)) <= 0.5 * (left - right)] = distance
    return scan_of(ranges)


def furthest_by_definition(ranges, increment, threshold, radius):
    """Step 2 and 3 of the source, beam by beam: the greatest length within 90 degrees after all extensions."""
    extended = list(ranges)
    for i in range(1, len(ranges)):
        if abs(ranges[i] - ranges[i - 1]) > threshold:
            edge = i if ranges[i] < ranges[i - 1] else i - 1
            for j in range(len(ranges)):
                # the arc between the beams, at the nearer range; half a turn covers all
                near = max(ranges[edge], radius / math.pi)
                if abs(j - edge) <= math.ceil(radius / (increment * near)):
                    extended[j] = min(extended[j], ranges[edge])
    centre = (len(ranges) - 1) / 2
    ahead = [r for j, r in enumerate(extended) if abs(j - centre) * increment <= 0.5 * math.pi + 1e-9]
    return max(ahead)


@settings(max_examples=60, deadline=None)
@given(
    ranges=arrays(np.float64, st.integers(2, 60), elements=st.floats(0.1, 9.0)),
    threshold=st.floats(0.0, 2.0),
    tolerance=st.floats(0.0, 0.5),
)
def test_the_goal_is_the_furthest_reading_that_extensions_leave(ranges, threshold, tolerance):
    increment = 0.05
    planner = extender(disparity_threshold=threshold, tolerance=tolerance)
    bearing, distance = planner.find_goal(scan_of(ranges, increment))
    radius = 0.5 * CAR.width + tolerance
    assert distance == furthest_by_definition(ranges, increment, threshold, radius)
    assert abs(bearing) <= 0.5 * math.pi + 1e-6


def test_it_heads_past_an_edge_by_half_its_width_and_the_tolerance():
    # a near wall on the right, to straight ahead and a little beyond; the longest beams are beside its edge
    ranges = np.where(BEARINGS <= 0.1, 3.0, 8.0 - np.abs(BEARINGS - 0.1))
    for tolerance in (0.0, 0.15, 0.3):
        bearing, _ = extender(tolerance=tolerance).find_goal(scan_of(ranges))
        assert 3.0 * (bearing - 0.1) == pytest.approx(0.5 * CAR.width + tolerance, abs=3.0 * 2.0 * INCREMENT)


def test_a_way_narrower_than_the_car_is_no_way():
    # two posts 3 m ahead, .2 m between them, a long view through; and the open to the left, less far
    posts = [(-0.3, -0.1 / 3.0, 3.0), (0.1 / 3.0, 0.3, 3.0), (-3.0, -0.3, 2.9), (0.3, 3.0, 5.0)]
    bearing, distance = extender().find_goal(scan_with(*posts, length=20.0))
    assert bearing > 0.3 and distance == 5.0
    wide = [(-0.3, -0.4 / 3.0, 3.0), (0.4 / 3.0, 0.3, 3.0), *posts[2:]]
    bearing, distance = extender().find_goal(scan_with(*wide, length=20.0))
    assert abs(bearing) < 0.4 / 3.0 and distance == 20.0


def test_a_closer_reading_is_never_overwritten_by_a_farther_one():
    # behind the edge of a post at 4 m stands another at 1 m: extended by the first, it would be further than it is
    scan = scan_with((-3.0, 0.0, 4.0), (0.01, 0.05, 1.0), (0.06, 3.0, 4.2))
    bearing, distance = extender().find_goal(scan)
    assert distance == 4.2
    assert bearing > 0.3


def scan_beside(distance, first=97.0, last=110.0):
    """Open to the left ahead, and something at the left between two bearings [deg], without an edge to be extended."""
    corners = np.radians([first - 12.0, first, last, last + 12.0])
    beside = np.interp(BEARINGS, corners, [8.0, distance, distance, 8.0])
    return scan_of(np.where((BEARINGS > 0.4) & (BEARINGS < 1.2), 12.0, beside))


@each("side", [1.0, -1.0])
def test_it_does_not_turn_into_a_side_that_is_too_close_behind(side):
    def view(distance):
        return scan_beside(distance) if side > 0.0 else mirrored(scan_beside(distance))

    limit = for_car(DisparityExtenderSettings(), CAR).side_distance
    for distance in (0.9 * limit, 1.1 * limit):
        assert side * extender(side_distance=0.0).find_goal(view(distance))[0] > 0.3  # without the rule
    assert wished_steering(view(0.9 * limit)) == 0.0
    assert side * wished_steering(view(1.1 * limit)) > 0.1


def test_a_scan_that_does_not_reach_behind_holds_nothing_back():
    whole = scan_beside(0.1, first=100.0, last=110.0)
    half = scan_of(whole.ranges[180:-180], angle_min=float(BEARINGS[180]))
    assert wished_steering(whole) == 0.0
    assert wished_steering(half) > 0.1


def test_it_turns_to_the_same_goal_in_a_wider_arc_when_it_is_fast():
    ranges = np.where(BEARINGS > 0.4, 9.0, 6.0)
    planner = DisparityExtender(CAR, math.inf, 8.0)
    angles = [planner(scan_of(ranges), odometry_of(speed)).steering_angle for speed in (0.0, 2.0, 4.0, 6.0)]
    assert angles[0] == angles[1] > angles[2] > angles[3] > 0.0  # up to 1 m / .45 s the arc is as short as it gets
