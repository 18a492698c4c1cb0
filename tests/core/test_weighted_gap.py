"""The weighted gap, held against the formulas of Sezer and Gokasan's paper."""

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cases import each
from fg_mujoco.controllers.weighted_gap import WeightedGap, WeightedGapSettings, blended, gap_centre
from scan_worlds import CAR, INCREMENT, MU, scan_of

BEARINGS = INCREMENT * (np.arange(1081) - 540)
HALF = 0.5 * CAR.width

unhurried = settings(deadline=None)
distances = st.floats(0.1, 10.0)


@cache
def planner(**settings):
    return WeightedGap(CAR, MU, 8.0, WeightedGapSettings(**settings))


def gap_at(right, left, count=1081):
    """A scan of 1 m all round, and of 9 m between two bearings [rad]."""
    return scan_of(np.where((right < BEARINGS) & (left > BEARINGS), 9.0, 1.0))


@given(phi1=st.floats(-1.5, 1.5), opening=st.floats(0.05, 3.0), d1=distances, d2=distances)
@unhurried
def test_the_gaps_centre_is_that_of_the_papers_formula(phi1, opening, d1, d2):
    """With the angle to the first obstacle counted to the right, to the second to the left."""
    phi2 = opening - phi1
    median = math.sqrt(d1**2 + d2**2 + 2.0 * d1 * d2 * math.cos(phi1 + phi2))
    expected = math.acos((d1 + d2 * math.cos(phi1 + phi2)) / median) - phi1
    centre = gap_centre(-phi1, d1, phi2, d2)
    assert math.remainder(centre - expected, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-6)


@given(gap=st.floats(-1.5, 1.5), goal=st.floats(-1.5, 1.5), nearest=st.floats(0.01, 30.0), alpha=st.floats(0.1, 20.0))
@unhurried
def test_the_heading_is_that_of_the_papers_formula(gap, goal, nearest, alpha):
    weight = alpha / nearest
    assert blended(gap, goal, nearest, alpha) == pytest.approx((weight * gap + goal) / (weight + 1.0))


def test_three_or_four_metres_away_it_makes_no_sharp_turn():
    """The slides' question: the same gap, with the nearest obstacle at 4 m and at half a metre."""
    open_left = np.where((BEARINGS > 0.5) & (BEARINGS < 1.1), 9.0, 4.0)
    near = np.where(BEARINGS < -1.0, 0.5, open_left)
    far, close = (planner(horizon=6.0).find_goal(scan_of(ranges))[0] for ranges in (open_left, near))
    assert far == pytest.approx(close * (2.0 / 6.0) / (2.0 / 2.5), rel=0.05)
    assert 0.1 < far < 0.3 < close


@each(("right", "left"), [(-0.3, 0.5), (-1.0, -0.4), (0.2, 0.8)])
def test_the_heading_in_a_scan_is_worked_out_from_the_gap_less_the_cars_half_width(right, left):
    bearing, _ = planner().find_goal(gap_at(right, left))
    # both sides at 1 m: the middle of the opening, times (2 / 1) / (2 / 1 + 1)
    assert bearing == pytest.approx(0.5 * (right + left) * 2.0 / 3.0, abs=INCREMENT)


def test_a_gap_narrower_than_the_robot_is_none():
    width = 2.0 * (HALF + 0.05)
    assert planner().find_goal(gap_at(-0.45 * width, 0.45 * width)) is None
    assert planner().find_goal(gap_at(-0.55 * width, 0.55 * width)) is not None


def test_where_all_is_open_it_goes_straight_on():
    bearing, _ = planner().find_goal(scan_of(np.full(1081, math.inf)))
    assert abs(bearing) < 1e-9
