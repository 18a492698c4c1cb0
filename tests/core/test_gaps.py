"""What a gap is: the worked examples of the sources, and every definition worked out again, slowly."""

import cmath
import math
from itertools import groupby

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fg_mujoco.controllers.perception import gaps

SLIDES = np.array([0.5, 5.1, 6.0, 7.0, math.inf, 3.0, math.inf, 3.0, math.inf, 8.0, 1.0, 3.0])

# of few values, so that runs and ties are common
scans = arrays(np.float64, st.integers(0, 25), elements=st.sampled_from([0.0, 1.0, 2.0, 2.5, 3.0, math.inf]))


def runs_where(holds):
    """First and end of each run in which `holds`."""
    place = 0
    for value, run in groupby(holds):
        count = len(list(run))
        if value:
            yield place, place + count
        place += count


def longest(runs, otherwise):
    """The longest of the runs, the first of several."""
    return max(runs, key=lambda run: run[1] - run[0], default=otherwise)


def test_in_the_slides_array_one_run_reaches_three_readings():
    """They mark two gaps; the second run of more than one reading, inf and 8.0, is a gap with n = 2."""
    assert gaps.runs_beyond(SLIDES, 5.0, 3).tolist() == [[1, 5]]
    assert gaps.runs_beyond(SLIDES, 5.0, 2).tolist() == [[1, 5], [8, 10]]
    assert gaps.runs_beyond(SLIDES, 5.0, 1).tolist() == [[1, 5], [6, 7], [8, 10]]


def test_no_return_is_beyond_any_threshold_and_a_failed_reading_beyond_none():
    ranges = np.array([math.inf, 9.0, math.nan, math.inf])
    assert gaps.runs_beyond(ranges, math.inf, 1).tolist() == [[0, 1], [3, 4]]
    assert gaps.runs_beyond(ranges, 8.0, 1).tolist() == [[0, 2], [3, 4]]


@given(ranges=scans)
def test_the_longest_run_is_that_of_all_runs_of_non_zeros(ranges):
    assert gaps.longest_run(ranges) == longest(runs_where(ranges != 0.0), (0, 0))


@given(ranges=scans, threshold=st.sampled_from([0.0, 1.5, 2.5, 30.0]), least=st.integers(-1, 6))
def test_the_runs_beyond_a_threshold_are_all_that_are_long_enough(ranges, threshold, least):
    found = gaps.runs_beyond(ranges, threshold, least)
    assert found.shape[1:] == (2,)
    expected = [run for run in runs_where(ranges > threshold) if run[1] - run[0] >= max(least, 1)]
    assert list(map(tuple, found.tolist())) == expected


@given(
    ranges=scans, bounds=st.tuples(st.integers(0, 25), st.integers(0, 25)), tolerance=st.sampled_from([0.0, 0.5, 2.0])
)
def test_the_deepest_run_is_the_longest_of_those_near_the_greatest(ranges, bounds, tolerance):
    first, end = sorted(min(bound, len(ranges)) for bound in bounds)
    part = ranges[first:end]
    near = part >= part.max() - tolerance if len(part) else []
    expected = longest(((first + one, first + other) for one, other in runs_where(near)), (first, first))
    assert gaps.deepest_run(ranges, first, end, tolerance) == expected
    if tolerance == 0.0:
        right, left = expected
        assert gaps.furthest_beam(ranges, first, end) == ((right + left - 1) // 2 if left > right else -1)


@pytest.mark.slow
@given(a=st.floats(0.0, 30.0), b=st.floats(0.0, 30.0), angle=st.floats(0.0, 2.0 * math.pi))
def test_a_chord_is_the_distance_of_the_two_points(a, b, angle):
    assert gaps.chord(a, b, angle) == pytest.approx(abs(cmath.rect(a, 0.0) - cmath.rect(b, angle)), abs=1e-12)
    assert gaps.chord(a, b, angle) == gaps.chord(b, a, angle)


def test_a_chord_of_a_tiny_angle_is_not_lost_in_the_cosine():
    # 1 - cos(1e-9) is 0 in double precision, and by the cosine law as written so would the width be
    assert gaps.chord(10.0, 10.0, 1e-9) == pytest.approx(1e-8, rel=1e-9)
    assert gaps.chord(1e300, 1e300, math.pi) == pytest.approx(2e300)


def test_the_middle_of_a_run_is_a_beam_or_between_two():
    assert gaps.middle_of(4, 7) == 5.0
    assert gaps.middle_of(4, 8) == 5.5
    ranges = np.arange(10.0)
    assert gaps.range_at(ranges, 5.0) == 5.0
    assert gaps.range_at(ranges, 5.5) == 5.0
