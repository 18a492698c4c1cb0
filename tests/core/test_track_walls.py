"""Walls from centreline and widths, against shapes whose walls can be written down."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cases import each
from fg_mujoco.course.polyline import (
    distance_to_segment,
    enclosed_area,
    resample,
    rounded_polygon,
    self_crossings,
    smooth,
    step_lengths,
)
from fg_mujoco.course.track import Track
from fg_mujoco.course.track_walls import SHARED_WALL, WALL_TOLERANCE, shared_widths
from fg_mujoco.errors import TrackError
from fg_mujoco.simulation.course_loading import load_track


def circle(radius, count=400):
    angle = 2.0 * np.pi * np.arange(count) / count
    return radius * np.column_stack((np.cos(angle), np.sin(angle)))


def rounded(corners, radius, spacing=0.2):
    line = rounded_polygon(np.array(corners, dtype=float), np.full(len(corners), float(radius)))
    return resample(line, spacing)[0]


def track_of(line, right, left=None):
    right = np.broadcast_to(np.asarray(right, dtype=float), len(line))
    left = right if left is None else np.broadcast_to(np.asarray(left, dtype=float), len(line))
    return Track(name="test", centreline=line, width_right=right, width_left=left)


def corner_set(wall):
    return {tuple(corner) for corner in np.round(wall, 6).tolist()}


def test_walls_of_a_circle_are_circles():
    track = track_of(circle(5.0), 1.2, 0.8)  # counterclockwise: left is inside
    # a wall's points are within the tolerance, and so are its chords
    for wall, radius in ((track.left_wall, 4.2), (track.right_wall, 6.2)):
        middle = 0.5 * (wall + np.roll(wall, -1, axis=0))
        np.testing.assert_allclose(np.hypot(*wall.T), radius, atol=1e-3)
        np.testing.assert_allclose(np.hypot(*middle.T), radius, atol=WALL_TOLERANCE + 1e-3)


def test_square_corners_stay_square_inside_and_out():
    line = resample(np.array([(0.0, 0.0), (10.0, 0.0), (10.0, 8.0), (0.0, 8.0)]), 0.25)[0]
    track = track_of(line, 1.0)
    assert corner_set(track.left_wall) == {(1, 1), (9, 1), (9, 7), (1, 7)}
    assert corner_set(track.right_wall) == {(-1, -1), (11, -1), (11, 9), (-1, 9)}


def test_fold_of_a_corner_tighter_than_its_corridor_is_cut_where_the_arms_meet():
    line = rounded([(0, 0), (12, 0), (12, 12), (0, 12)], 0.5, 0.1)
    track = track_of(line, 1.0)
    wall = track.left_wall  # a square of 10 m whose corners are where the offsets of the sides meet
    np.testing.assert_allclose(enclosed_area(wall), 100.0, rtol=1e-3)
    for corner in ((1, 1), (11, 1), (11, 11), (1, 11)):
        assert np.hypot(*(wall - corner).T).min() < 0.02


def pinched(gap):
    """Round two bulges, between which the stretches run `gap` apart for 6 m."""
    low, high = -0.5 * gap, 0.5 * gap
    corners = [(-3, low), (3, low), (5, -5), (13, -5), (13, 5), (5, 5), (3, high), (-3, high)]
    corners += [(-5, 5), (-13, 5), (-13, -5), (-5, -5)]
    return rounded(corners, 1.0)


def test_stretches_side_by_side_share_the_room_with_a_wall_between():
    track = track_of(pinched(1.6), 1.0)
    narrow = np.abs(track.centreline[:, 0]) < 2.0
    np.testing.assert_allclose(track.corridor_left[narrow], 0.5 * (1.6 - SHARED_WALL), atol=1e-6)
    np.testing.assert_array_equal(track.corridor_right, 1.0)
    assert len(self_crossings(track.left_wall)[0]) == 0
    middle = np.abs(track.left_wall[:, 0]) < 2.0
    np.testing.assert_allclose(np.abs(track.left_wall[middle, 1]), 0.5 * SHARED_WALL, atol=WALL_TOLERANCE)


def test_wall_beyond_another_stretch_is_refused_with_the_place():
    with pytest.raises(TrackError, match=r"runs over itself: at \(.*\), point \d+, its left wall would be 1.00 m away"):
        track_of(pinched(0.9), 1.0)


def test_loop_narrower_than_its_corridor_is_refused():
    with pytest.raises(TrackError, match="no room for the left wall"):
        _ = track_of(circle(0.9, 60), 1.0).left_wall


@settings(deadline=None, max_examples=25)
@given(
    radii=st.lists(st.floats(6.0, 10.0), min_size=5, max_size=9), right=st.floats(0.3, 1.5), left=st.floats(0.3, 1.5),
    seed=st.integers(0, 1000),
)  # fmt: skip
def test_no_wall_comes_nearer_to_the_line_than_the_width(radii, right, left, seed):
    angle = 2.0 * np.pi * np.arange(len(radii)) / len(radii)
    star = np.array(radii)[:, None] * np.column_stack((np.cos(angle), np.sin(angle)))
    line = smooth(star, 1.0, 0.2)
    line = line + np.random.default_rng(seed).normal(0.0, 0.004, line.shape)  # what a mapping tool leaves
    track = track_of(line, right, left)
    for wall, width in ((track.left_wall, left), (track.right_wall, right)):
        assert len(self_crossings(wall)[0]) == 0
        start, end = line, np.roll(line, -1, axis=0)
        for point in resample(wall, 0.5)[0]:
            away = distance_to_segment(np.repeat(point[None], len(line), 0), start, end)
            assert away.min() >= width - 2.0 * WALL_TOLERANCE
    assert step_lengths(track.left_wall).min() > 0.0


@each("name", ["serpentine", "boxes", "maze"])
def test_square_corners_and_boxes_beside_another_stretch_move_no_wall(name):
    """Widths reach further than half of the way to the other stretch, but aside of it."""
    track = load_track(name)
    widths = track.width_right, track.width_left
    for corridor, width in zip((track.corridor_right, track.corridor_left), widths, strict=True):
        np.testing.assert_array_equal(corridor, width)
    all_round = shared_widths(track.centreline, *widths, all_round=True)
    assert any(np.any(corridor < width) for corridor, width in zip(all_round, widths, strict=True))


def test_walls_that_would_stand_in_another_stretch_are_moved_whatever_the_angle():
    """Two stretches that run towards each other at an angle: no wall stands within the other's corridor."""
    line = rounded([(0.0, 0.0), (16.0, 0.0), (16.0, 8.0), (12.0, 8.0), (8.0, 1.6), (4.0, 8.0), (0.0, 8.0)], 0.6)
    track = track_of(line, 1.1)
    narrow = track.corridor_left < 1.1
    assert narrow.any() and not narrow.all()
    away = np.min(
        [distance_to_segment(track.left_wall, a, b) for a, b in zip(line, np.roll(line, -1, axis=0), strict=True)],
        axis=0,
    )
    assert away.min() > 0.4
    assert len(self_crossings(track.left_wall)[0]) == 0
