"""Disparity selection: the diagram of its source, and the faults of its code that are not repeated here."""

import cmath
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fg_mujoco.controllers.disparity_selection import (
    DisparitySelection,
    DisparitySelectionSettings,
    best_opening,
    widest_opening,
)
from fg_mujoco.controllers.perception.gaps import middle_of
from scan_worlds import CAR, INCREMENT, MU, scan_of

DIAGRAM = np.array([0.4, 0.5, 2.5, 2.5, 2.5, 0.6, 0.5])


@cache
def planner(**settings):
    return DisparitySelection(CAR, MU, 8.0, DisparitySelectionSettings(**settings))


def opening(ranges, threshold=0.5, increment=0.01):
    ranges = np.asarray(ranges, float)
    return widest_opening(ranges, 0, len(ranges), increment, threshold)


def test_in_the_diagram_it_aims_at_the_middle_of_the_free_space():
    """The source's code takes the third reading, (1 + 4) // 2; of the three that are free the fourth is the middle."""
    assert opening(DIAGRAM) == (2, 5)
    assert middle_of(*best_opening(DIAGRAM, 0.01, 0.5)) == 3.0


def test_the_drop_of_the_sources_first_example_is_an_edge_and_alone_no_opening():
    assert opening([2.5, 2.5, 0.5]) == (0, 0)
    assert middle_of(*best_opening(np.array([2.5, 2.5, 0.5]), 0.01, 0.5)) == 0.5  # the furthest: the middle of the two


def test_between_two_disparities_may_be_a_box_and_that_is_no_free_space():
    box = np.array([3.0, 3.0, 3.1, 1.0, 1.0, 1.0, 3.0, 3.0])
    assert opening(box) == (0, 0)
    assert middle_of(*best_opening(box, 0.01, 0.5)) == 2.0


def test_the_widest_opening_is_that_of_most_metres_not_of_most_beams():
    near = [0.5, 9.0, 9.0, 9.0, 9.0, 0.5]
    far = [6.0, 9.0, 9.0, 6.0]
    # five steps of .01 rad at .5 m, against three at 6 m
    assert opening([*near, *far]) == (7, 9)
    assert opening([*far, *near]) == (1, 3)


@given(ranges=arrays(np.float64, st.integers(0, 20), elements=st.sampled_from([0.5, 1.0, 1.7, 3.0, 3.2])))
@settings(deadline=None)
def test_the_opening_is_the_widest_of_all_pairs_that_follow_each_other(ranges):
    steps = np.diff(ranges)
    disparities = [(beam + 1, step) for beam, step in enumerate(steps.tolist()) if abs(step) > 0.6]
    pairs = [(one, other) for (one, up), (other, down) in pairwise(disparities) if up > 0.0 > down]
    edges = [
        abs(cmath.rect(ranges[one - 1], 0.02 * (one - 1)) - cmath.rect(ranges[other], 0.02 * other))
        for one, other in pairs
    ]
    found = opening(ranges, 0.6, 0.02)
    if not pairs:
        assert found == (0, 0)
    else:
        assert edges[pairs.index(found)] == pytest.approx(max(edges))


def test_it_looks_in_the_largest_gap_only():
    ranges = np.full(1081, 2.0)
    ranges[400:440] = 0.7  # the nearest, masked
    ranges[300:330] = 2.9  # an opening in the smaller part
    ranges[700:760] = 2.9
    bearing, distance = planner().find_goal(scan_of(ranges))
    assert bearing == pytest.approx((729.5 - 540.0) * INCREMENT)
    assert distance == 2.9


def test_it_aims_between_two_boxes():
    ranges = np.full(1081, 2.9)
    ranges[:200] = 0.6
    ranges[620:700] = 1.5
    ranges[800:900] = 1.5
    assert planner().find_goal(scan_of(ranges))[0] == pytest.approx((749.5 - 540.0) * INCREMENT)
