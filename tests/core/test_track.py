"""Track: its arrays, its poses, and which stretch a point belongs to."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cases import each
from fg_mujoco.course.polyline import resample, rounded_polygon
from fg_mujoco.course.track import Track
from fg_mujoco.errors import TrackError

COUNT, RADIUS = 360, 5.0
ANGLE = 2.0 * np.pi * np.arange(COUNT) / COUNT
CIRCLE = RADIUS * np.column_stack((np.cos(ANGLE), np.sin(ANGLE)))


def track_of(line, right=1.0, left=1.0):
    line = np.asarray(line, dtype=float)
    return Track(
        name="test", centreline=line, width_right=np.full(len(line), right), width_left=np.full(len(line), left)
    )


@pytest.fixture(scope="module")
def circle():
    return track_of(CIRCLE)


@pytest.fixture(scope="module")
def hairpin():
    """Two arms 2.2 m apart, one along y = 0 and the other, the other way, along y = 2.2; walls 1 m away."""
    corners = np.array([(0.0, 2.2), (0.0, 0.0), (20.0, 0.0), (20.0, 10.0), (15.0, 10.0), (15.0, 2.2)])
    line = rounded_polygon(corners, np.array([1.1, 1.1, 2.0, 2.0, 2.0, 1.0]))
    return track_of(resample(line, 0.2)[0])


def test_circle_has_the_length_headings_and_curvature_of_a_circle(circle):
    assert circle.length == pytest.approx(2.0 * np.pi * RADIUS, rel=1e-4)
    np.testing.assert_allclose(circle.curvature, 1.0 / RADIUS, rtol=1e-4)
    np.testing.assert_allclose(np.cos(circle.headings - ANGLE - 0.5 * np.pi), 1.0)
    np.testing.assert_allclose(circle.arc_length, circle.length * np.arange(COUNT) / COUNT)


def test_arrays_are_copied_in_and_read_only():
    line = CIRCLE.copy()
    track = track_of(line)
    line[0] = 0.0
    np.testing.assert_array_equal(track.centreline, CIRCLE)
    names = ("centreline", "width_right", "width_left", "corridor_right", "corridor_left", "arc_length", "headings")
    for name in (*names, "curvature", "left_wall", "right_wall"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(track, name)[...] = 0.0


@settings(deadline=None)
@given(s=st.floats(-100.0, 100.0), offset=st.floats(-0.9, 0.9))
def test_position_and_project_are_inverse_on_the_arms(hairpin, s, offset):
    point = hairpin.position(s, offset)
    found, _ = hairpin.project(point[None])
    if not (3.0 < point[0] < 12.0 and -1.0 < point[1] < 3.2):
        return
    for near in (None, s + 0.5, s - 0.5):
        found, lateral = hairpin.project(point[None], near)
        assert abs((found[0] - s + 10.0) % hairpin.length - 10.0) < 1e-9
        assert lateral[0] == pytest.approx(offset, abs=1e-9)


def test_with_a_hint_the_other_arm_is_never_taken(hairpin):
    on_lower = hairpin.project([[8.0, 0.0]])[0][0]
    on_upper = hairpin.project([[8.0, 2.2]])[0][0]
    between = [[8.0, 1.5]]  # nearer to the upper arm
    assert hairpin.project(between, near=on_lower)[0][0] == pytest.approx(on_lower)
    assert hairpin.project(between, near=on_upper)[0][0] == pytest.approx(on_upper)
    both = hairpin.project(between * 2, near=[on_lower, on_upper])
    np.testing.assert_allclose(both[0], [on_lower, on_upper])
    np.testing.assert_allclose(np.abs(both[1]), [1.5, 0.7])


def test_without_a_hint_a_corridor_counts_more_than_a_nearer_centreline():
    line = resample(np.array([(0.0, 0.0), (20.0, 0.0), (20.0, 12.0), (10.0, 12.0), (10.0, 2.5), (0.0, 2.5)]), 0.25)[0]
    narrow = line[:, 1] > 1.0
    left = np.where(narrow, 0.5, 1.6)
    track = Track(name="test", centreline=line, width_right=np.full(len(line), 0.5), width_left=left)
    s, offset = track.project([[5.0, 1.4]])  # 1.1 m from the narrow arm, whose wall is 0.5 m away
    assert s[0] == pytest.approx(5.0)
    assert offset[0] == pytest.approx(1.4)


@each(
    ("change", "message"),
    [
        ({"centreline": CIRCLE[:3]}, "at least 4 points"),
        ({"centreline": np.zeros((COUNT, 3))}, r"shape \(360, 3\)"),
        ({"centreline": np.where(np.arange(COUNT)[:, None] == 7, np.nan, CIRCLE)}, "at point 7; accepted: finite"),
        ({"centreline": np.where(np.arange(COUNT)[:, None] == 7, CIRCLE[6], CIRCLE)}, "point 7 .* repeats point 6"),
        ({"width_left": np.where(np.arange(COUNT) == 9, -1.0, 1.0)}, r"width_left is -1.0 m at point 9"),
        ({"width_right": np.where(np.arange(COUNT) == 9, np.nan, 1.0)}, r"width_right is nan m at point 9"),
        ({"width_right": np.ones(5)}, r"width_right has shape \(5,\)"),
    ],
)
def test_arrays_that_make_no_track_are_refused(change, message):
    arrays = {"centreline": CIRCLE, "width_right": np.ones(COUNT), "width_left": np.ones(COUNT)} | change
    with pytest.raises(TrackError, match=message):
        Track(name="test", **arrays)


def test_figure_of_eight_is_refused_with_the_place():
    eight = np.column_stack((10.0 * np.sin(ANGLE + 0.01), 5.0 * np.sin(2.0 * (ANGLE + 0.01))))
    with pytest.raises(TrackError, match=r"crosses itself near \(-?0\.\d+, -?0\.\d+\): between points \d+ and \d+"):
        track_of(eight)


def test_line_that_turns_back_is_refused():
    with pytest.raises(TrackError, match=r"turns back by 1\d\d deg at point 1, \(20.00, 0.00\)"):
        track_of([(0.0, 0.0), (20.0, 0.0), (0.0, 5.0), (-5.0, 5.0)], 0.2, 0.2)
