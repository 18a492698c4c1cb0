"""The filters of a scan, one by one: worked examples of the sources, slow loops, and what none of them may do."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cases import each
from fg_mujoco.controllers.perception import scan_filters as filters
from scan_worlds import INCREMENT

RADIUS = 0.3  # [m]
BEARINGS = INCREMENT * (np.arange(1081) - 540)

ranges_of_scans = arrays(np.float64, st.integers(0, 60), elements=st.floats(0.0, 30.0))
increments = st.floats(1e-3, 0.3)
radii = st.floats(0.01, 1.0)


@given(arrays(np.float64, st.integers(0, 40)), st.floats(), st.floats())
def test_a_filter_that_is_given_anything_answers_something(ranges, increment, radius):
    # compiled code that left its arrays would take the process with it
    for shorten in (
        lambda: filters.extend_disparities(ranges, increment, 0.3, radius),
        lambda: filters.widen_all(ranges, increment, radius),
        lambda: filters.mask_nearest(ranges, increment, radius),
        lambda: filters.mask_bubble(ranges, increment, radius),
        lambda: filters.rolling_mean(ranges, increment, radius),
        lambda: filters.prioritise_centre(ranges, ranges, radius),
    ):
        assert shorten().shape == ranges.shape


# -- what a reading is


@each(
    ("ranges", "expected"),
    [
        ([1.0, math.inf, 40.0], [1.0, 30.0, 30.0]),  # no return, and beyond what the sensor can see
        ([-math.inf, -2.0, 0.0], [0.0, 0.0, 0.0]),  # closer than range_min
        ([3.0, math.nan, 2.0], [3.0, 2.0, 2.0]),  # a dropout is as near as its nearer neighbour
        ([3.0, math.nan, math.nan, 5.0], [3.0, 3.0, 3.0, 5.0]),  # ... its next valid neighbour
        ([math.nan, 4.0, math.nan], [4.0, 4.0, 4.0]),  # at an end there is one
        ([math.inf, math.nan, math.inf], [30.0, 30.0, 30.0]),  # not an obstacle
        ([math.nan, -math.inf], [0.0, 0.0]),
        ([math.nan, math.nan], [0.0, 0.0]),
    ],
)
def test_readings_become_distances(ranges, expected):
    np.testing.assert_array_equal(filters.valid_ranges(np.array(ranges), 30.0), expected)


@given(arrays(np.float64, st.integers(0, 40), elements=st.sampled_from([math.nan, math.nan, math.inf, -1.0, 0.5, 3.0])))
def test_a_failed_reading_takes_the_nearer_of_its_next_valid_neighbours(ranges):
    def distance(beam):
        if not np.isnan(ranges[beam]):
            return min(max(ranges[beam], 0.0), 30.0)
        valid = np.flatnonzero(~np.isnan(ranges))
        neighbours = [*valid[valid < beam][-1:], *valid[valid > beam][:1]]
        return min((distance(other) for other in neighbours), default=0.0)

    expected = [distance(beam) for beam in range(len(ranges))]
    np.testing.assert_array_equal(filters.valid_ranges(ranges, 30.0), expected)


# -- bubbles


@each(("distance", "beams"), [(1.0, 69), (5.0, 14), (30.0, 3)])
def test_a_bubble_is_as_wide_as_its_arc_says(distance, beams):
    # .3 m over arcs of distance * .25 degrees: 68.75, 13.75 and 2.29 of them
    assert filters.bubble_beams(np.array([distance]), RADIUS, INCREMENT) == beams


@each("nearest", [0, 1, 1079, 1080])
def test_a_nearest_point_at_an_end_is_masked_up_to_the_end_and_not_round_it(nearest):
    ranges = np.full(1081, 8.0)
    ranges[nearest] = 2.0
    width = math.ceil(RADIUS / (INCREMENT * 2.0))
    expected = np.abs(np.arange(1081) - nearest) <= width
    np.testing.assert_array_equal(filters.mask_nearest(ranges, INCREMENT, RADIUS) == 0.0, expected)


def bubbles_by_loop(ranges, beams, increment, radius):
    result = ranges.copy()
    for beam in beams:
        width = math.ceil(radius / (increment * max(ranges[beam], radius / math.pi)))
        for other in range(max(beam - width, 0), min(beam + width, len(ranges) - 1) + 1):
            result[other] = min(result[other], ranges[beam])
    return result


@pytest.mark.slow
@given(ranges_of_scans, increments, radii, st.data())
def test_safety_bubbles_are_those_of_a_slow_loop(ranges, increment, radius, data):
    everyone = list(range(len(ranges)))
    beams = data.draw(st.lists(st.sampled_from(everyone), unique=True)) if everyone else []
    result = filters.safety_bubbles(ranges, np.array(beams, dtype=np.intp), increment, radius)
    np.testing.assert_array_equal(result, bubbles_by_loop(ranges, beams, increment, radius))


@given(
    st.one_of(ranges_of_scans, arrays(np.float64, st.integers(0, 60), elements=st.sampled_from([0.0, 0.1, 1.0, 9.0]))),
    increments,
    radii,
)
def test_widening_all_is_a_safety_bubble_round_every_beam(ranges, increment, radius):
    result = filters.widen_all(ranges, increment, radius)
    np.testing.assert_array_equal(result, bubbles_by_loop(ranges, range(len(ranges)), increment, radius))


# -- disparities


@given(ranges_of_scans, increments, radii, st.floats(0.0, 5.0))
def test_disparities_are_the_safety_bubbles_of_their_nearer_sides(ranges, increment, radius, threshold):
    pairs = [(beam, beam + 1) for beam in range(len(ranges) - 1) if abs(ranges[beam] - ranges[beam + 1]) > threshold]
    edges = [min(pair, key=lambda beam: ranges[beam]) for pair in pairs]
    result = filters.extend_disparities(ranges, increment, threshold, radius)
    np.testing.assert_array_equal(result, bubbles_by_loop(ranges, edges, increment, radius))


def test_between_two_disparities_the_middle_remains():
    # the diagram of 000.txt: free space between an obstacle on the left and one on the right
    ranges = np.array([0.4, 0.5, 2.5, 2.5, 2.5, 0.6, 0.5])
    widened = filters.extend_disparities(ranges, math.radians(10.0), threshold=0.5, radius=0.08)
    np.testing.assert_array_equal(widened, [0.4, 0.5, 0.5, 2.5, 0.6, 0.6, 0.5])


def test_what_differs_by_no_more_than_the_threshold_is_no_disparity():
    ranges = np.array([2.0, 2.5, 3.0, 3.5])
    np.testing.assert_array_equal(filters.extend_disparities(ranges, INCREMENT, 0.5, RADIUS), ranges)


# -- mean, priority, field of view


@given(ranges_of_scans, increments, radii)
def test_the_rolling_mean_is_that_of_a_slow_loop(ranges, increment, radius):
    def mean(beam):
        width = math.ceil(radius / (increment * max(ranges[beam], radius / math.pi)))
        window = ranges[max(beam - width, 0) : beam + width + 1]
        return np.mean(window) if ranges[beam] > 0.0 else 0.0  # what must not be driven along stays so

    expected = [mean(beam) for beam in range(len(ranges))]
    np.testing.assert_allclose(filters.rolling_mean(ranges, increment, radius), expected, atol=1e-11)


def test_the_rolling_mean_of_nothing_to_drive_along_is_exactly_zero():
    assert not filters.rolling_mean(np.zeros(1081), INCREMENT, 0.1).any()


def test_centre_priority_weighs_from_0_999_at_the_edges_to_1_in_the_middle():
    weights = filters.prioritise_centre(np.ones(1081), BEARINGS)
    # 004.txt: a linspace of .999 to 1.000
    np.testing.assert_allclose(weights[:541], np.linspace(0.999, 1.0, 541), rtol=1e-14)
    np.testing.assert_allclose(weights[540:], np.linspace(1.0, 0.999, 541), rtol=1e-14)


@given(ranges_of_scans)
def test_the_greatest_beam_is_the_rightmost_of_the_greatest_ranges(ranges):
    assert filters.greatest_beam(ranges) == (np.argmax(ranges) if len(ranges) else 0)
