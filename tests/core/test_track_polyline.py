"""Plane geometry of closed polylines, against all pairs and closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fg_mujoco.course.polyline import (
    crossings,
    distance_to_segment,
    enclosed_area,
    meeting_point,
    nearby,
    resample,
    rounded_polygon,
    segments,
    simplify,
    smooth,
    spline,
    step_lengths,
    subdivide,
    turns,
)

SQUARE = np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)])


def ellipse(count, a=6.0, b=4.0):
    angle = 2.0 * np.pi * np.arange(count) / count
    return np.column_stack((a * np.cos(angle), b * np.sin(angle)))


def test_lengths_turns_and_area_of_a_rectangle():
    np.testing.assert_array_equal(step_lengths(SQUARE), [4, 3, 4, 3])
    np.testing.assert_allclose(turns(SQUARE), 0.5 * np.pi)
    np.testing.assert_allclose(turns(SQUARE[::-1]), -0.5 * np.pi)
    assert enclosed_area(SQUARE) == 12.0
    assert enclosed_area(SQUARE[::-1]) == -12.0


@given(seed=st.integers(0, 10_000), reach=st.floats(0.0, 2.0))
def test_nearby_finds_all_pairs_whose_boxes_come_within_reach(seed, reach):
    rng = np.random.default_rng(seed)
    first, second = rng.normal(size=(70, 2, 2)), rng.normal(size=(50, 2, 2))
    gap = np.maximum(
        first.min(axis=1)[:, None] - second.max(axis=1), second.min(axis=1) - first.max(axis=1)[:, None]
    ).max(axis=2)
    assert set(zip(*nearby(first, second, reach), strict=True)) == set(zip(*np.nonzero(gap <= reach), strict=True))


@given(seed=st.integers(0, 10_000))
def test_crossings_are_those_of_the_solved_equations(seed):
    rng = np.random.default_rng(seed)
    first, second = rng.normal(size=(20, 2, 2)), rng.normal(size=(30, 2, 2))
    expected = set()
    for i, (a, b) in enumerate(first):
        for j, (c, d) in enumerate(second):
            t, u = np.linalg.solve(np.column_stack((b - a, c - d)), c - a)
            if 0.0 <= t <= 1.0 and 0.0 <= u <= 1.0:
                expected.add((i, j))
                np.testing.assert_allclose(meeting_point(first[i], second[j]), a + t * (b - a), atol=1e-9)
    assert set(zip(*crossings(first, second), strict=True)) == expected


def test_resampled_steps_are_even_and_keep_the_first_point():
    line, column = resample(SQUARE, 0.3, np.array([0.0, 4.0, 7.0, 4.0]))
    assert len(line) == round(14.0 / 0.3)
    np.testing.assert_array_equal(line[0], SQUARE[0])
    assert column[3] == pytest.approx(3 * 14.0 / len(line))  # that column is the arc length, at first


def test_subdivided_line_has_all_its_points_and_no_long_step():
    line, column = subdivide(SQUARE, 0.7, np.arange(4.0))
    assert step_lengths(line).max() <= 0.7
    assert {tuple(p) for p in SQUARE.tolist()} <= {tuple(p) for p in line.tolist()}
    np.testing.assert_allclose(column[:7], np.arange(6 + 1) / 6)


@given(seed=st.integers(0, 10_000), tolerance=st.floats(1e-3, 0.1))
def test_simplified_line_stays_within_its_tolerance(seed, tolerance):
    line = ellipse(200) + np.random.default_rng(seed).normal(0.0, 0.01, (200, 2))
    _, fewer = simplify(line, tolerance)
    assert {tuple(p) for p in fewer.tolist()} <= {tuple(p) for p in line.tolist()}
    own = segments(fewer)
    for point in line:
        away = distance_to_segment(np.repeat(point[None], len(own), 0), own[:, 0], own[:, 1])
        assert away.min() <= tolerance + 1e-12


def test_rounded_rectangle_has_straights_and_arcs():
    line = rounded_polygon(SQUARE, np.full(4, 1.0), 0.01)
    assert step_lengths(line).sum() == pytest.approx(2 * 2 + 2 * 1 + 2 * np.pi, abs=1e-3)
    assert enclosed_area(line) == pytest.approx(12 - (4 - np.pi), abs=1e-3)
    np.testing.assert_allclose(rounded_polygon(SQUARE, np.zeros(4)), SQUARE)


def test_smoothed_rectangle_keeps_its_straights_and_bounds_its_curvature():
    line = smooth(np.array([(0.0, 0.0), (20.0, 0.0), (20.0, 20.0), (0.0, 20.0)]), 1.0, 0.05)
    middle = (np.abs(line[:, 0] - 10.0) < 4.0) & (line[:, 1] < 5.0)
    np.testing.assert_allclose(line[middle, 1], 0.0, atol=1e-6)
    # closed form at the corner: the tangent (1 - P, P) with P the normal distribution turns by sqrt(4 / pi) / sigma
    curvature = np.abs(turns(line)) / step_lengths(line)
    assert curvature.max() == pytest.approx(np.sqrt(4.0 / np.pi), rel=0.01)


def test_spline_through_a_circle_is_the_circle():
    angle = 2.0 * np.pi * np.arange(16) / 16
    line, column = spline(5.0 * np.column_stack((np.cos(angle), np.sin(angle))), 0.2, np.full(16, 1.1))
    np.testing.assert_allclose(np.hypot(*line.T), 5.0, atol=2e-3)
    np.testing.assert_allclose(column, 1.1)
    np.testing.assert_allclose(step_lengths(line), 0.2, rtol=0.02)
