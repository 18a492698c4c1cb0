"""Follow the gap: the worked examples of its sources, each choice of point, and where it fails."""

import cmath
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fg_mujoco.controllers.follow_the_gap import (
    FollowTheGap,
    FollowTheGapSettings,
    best_place,
    free_space,
    mask_points,
)
from fg_mujoco.controllers.perception.gaps import longest_run
from scan_worlds import CAR, INCREMENT, MU, corridor, scan_of

SLIDES = np.array([4.8, 3.1, 4.3, 4.5, 6.0, 10.1, 8.3])  # for ".." one reading of 6 m


@cache
def planner(**settings):
    return FollowTheGap(CAR, MU, 8.0, FollowTheGapSettings(**settings))


def told(**settings):
    """Settings as the kernels get them."""
    return planner(**settings).settings_row[0]


def with_post(ranges, bearing, distance, half_width=0.1):
    """Ranges with a round post, its nearest point at that bearing [rad] and distance [m]."""
    bearings = INCREMENT * (np.arange(len(ranges)) - (len(ranges) - 1) / 2)
    off = np.abs(bearings - bearing) * distance
    return np.where(off < half_width, np.minimum(ranges, distance + 0.1 * off), ranges)


def test_the_slides_bubble_masks_the_points_within_its_radius():
    """4.8 m is next to the nearest point and free, 4.5 m is two beams away and is not: it goes by distance."""
    free = free_space(SLIDES, 0.01, told(bubble="points", bubble_radius=1.6))
    assert free.tolist() == [4.8, 0.0, 0.0, 0.0, 6.0, 10.1, 8.3]
    assert best_place(free, *longest_run(free), told(point="furthest")) == 5.0


def test_a_bubble_at_the_end_of_a_scan_does_not_wrap_round():
    ranges = np.array([0.6, 2.5, 2.5, 2.5, 2.5, 2.5])
    for bubble in ("beams", "points"):
        free = free_space(ranges, 0.7, told(bubble=bubble, bubble_radius=0.4))
        assert free[0] == 0.0
        assert free[2:].tolist() == [2.5] * 4


@pytest.mark.slow
@given(
    ranges=arrays(np.float64, st.integers(0, 30), elements=st.floats(0.0, 10.0)),
    increment=st.floats(1e-3, 0.2),
    radius=st.floats(0.01, 3.0),
)
@settings(deadline=None)
def test_the_points_in_a_bubble_are_those_near_the_nearest_in_the_plane(ranges, increment, radius):
    points = [cmath.rect(distance, beam * increment) for beam, distance in enumerate(ranges)]
    nearest = points[int(np.argmin(ranges))] if points else 0.0
    for point, distance, masked in zip(points, ranges, mask_points(ranges, increment, radius), strict=True):
        if abs(abs(point - nearest) - radius) > 1e-9:
            assert masked == (0.0 if abs(point - nearest) < radius else distance)


def test_each_point_is_what_it_says():
    #                0    1    2    3    4    5    6    7    8
    free = np.array([0.0, 3.0, 2.8, 2.7, 1.0, 2.0, 2.9, 1.0, 1.0])
    assert best_place(free, *longest_run(free), told(point="furthest")) == 1.0
    assert best_place(free, *longest_run(free), told(point="middle")) == 4.5
    assert best_place(free, *longest_run(free), told(point="deepest", depth_tolerance=0.5)) == 2.0
    assert planner().find_goal(scan_of(np.zeros(9))) is None


def test_the_goal_is_in_the_longest_run_even_if_another_is_deeper():
    free = np.array([9.0, 9.0, 0.0, 2.0, 3.0, 2.0])
    assert best_place(free, *longest_run(free), told()) == 4.0


def test_it_passes_a_post_on_the_side_that_is_open():
    for side in (1.0, -1.0):
        scan = scan_of(with_post(corridor(2.0, 2.0).ranges, side * 0.1, 1.5))
        bearing, _ = planner().find_goal(scan)
        # past the post's bubble of .4 m: an arc of .27 rad at 1.5 m
        assert side * bearing < 0.1 - 0.4 / 1.5 + INCREMENT


def test_beyond_the_lookahead_all_is_as_far_and_it_takes_the_middle():
    ranges = np.full(1081, 2.0)
    ranges[600:641] = 5.0
    ranges[635] = 9.0
    near, far = planner(lookahead=3.0), planner(lookahead=30.0)
    assert near.find_goal(scan_of(ranges)) == pytest.approx((80 * INCREMENT, 3.0))
    assert far.find_goal(scan_of(ranges)) == pytest.approx((95 * INCREMENT, 9.0))
