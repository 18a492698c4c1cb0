"""The threshold gap: the slides' array, widest against deepest, and what a threshold costs."""

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from test_gaps import SLIDES, runs_where

from cases import each
from fg_mujoco.controllers.perception.gaps import runs_beyond
from fg_mujoco.controllers.threshold_gap import ThresholdGap, ThresholdGapSettings, choose_gap
from scan_worlds import CAR, INCREMENT, MU, scan_of


@cache
def planner(**settings):
    return ThresholdGap(CAR, MU, 8.0, ThresholdGapSettings(**settings))


@each(("gap", "middle"), [("widest", 2.5), ("deepest", 8.5)])
def test_with_two_readings_there_are_the_slides_two_gaps_and_it_has_to_choose(gap, middle):
    """Both have a reading without return, and are as deep; here the narrower one's is a metre farther."""
    ranges = np.where(np.isinf(SLIDES), 20.0, SLIDES)
    ranges[8] = 21.0
    finder = planner(threshold=5.0, least_readings=2, gap=gap)
    bearing, _ = finder.find_goal(scan_of(ranges, increment=0.1, angle_min=-0.55))
    assert bearing == pytest.approx(-0.55 + middle * 0.1)


@given(
    ranges=arrays(np.float64, st.integers(0, 25), elements=st.sampled_from([1.0, 3.0, 4.0, 5.0, 30.0])),
    gap=st.sampled_from(["widest", "deepest"]),
)
@settings(deadline=None)
def test_the_gap_taken_is_the_first_in_the_order_that_the_docstring_gives(ranges, gap):
    runs = list(runs_where(ranges > 2.0))
    keys = [(end - first, ranges[first:end].max()) for first, end in runs]
    keys = keys if gap == "widest" else [key[::-1] for key in keys]
    expected = keys.index(max(keys)) if keys else -1
    assert choose_gap(ranges, runs_beyond(ranges, 2.0, 1), planner(gap=gap).settings_row[0]) == expected


def test_a_sensor_that_sees_less_far_than_the_threshold_has_gaps_where_nothing_returns():
    ranges = np.full(1081, 1.0)
    ranges[600:700] = math.inf
    bearing, distance = planner(threshold=5.0).find_goal(scan_of(ranges, range_max=4.0))
    assert bearing == pytest.approx(109.5 * INCREMENT)
    assert distance == 4.0
