"""Walls in 3D: what is seen is what is hit. What all tracks keep is in course_contract."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from fg_mujoco.course.track import Track
from fg_mujoco.course.track_mesh import wall_prisms, wall_surface


def track_of(line, width=1.0):
    return Track(
        name="test", centreline=line, width_right=np.full(len(line), width), width_left=np.full(len(line), width)
    )


def areas(prisms):
    x, y = prisms[:, :4, 0], prisms[:, :4, 1]
    return 0.5 * np.sum(x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y, axis=1)


@pytest.fixture(scope="module")
def square():
    return track_of(np.array([(0.0, 0.0), (10.0, 0.0), (10.0, 8.0), (0.0, 8.0)]))


def test_walls_of_a_square_are_two_frames_of_four_pieces(square):
    prisms = wall_prisms(square, 0.4, 0.1)
    assert prisms.shape == (8, 8, 3)
    assert prisms[..., 2].max() == 0.4
    inner, outer = areas(prisms[:4]).sum(), areas(prisms[4:]).sum()
    assert inner == pytest.approx(8 * 6 - 7.8 * 5.8)  # its thickness is on the inside of the inner wall
    assert outer == pytest.approx(12.2 * 10.2 - 12 * 10)


def test_mesh_of_a_square_is_closed_but_for_its_underside(square):
    mesh = trimesh.Trimesh(*wall_surface(square, 0.4, 0.1), process=False)
    assert len(mesh.faces) == 8 * 6  # front, back and top; no ends, for the pieces meet
    faces = mesh.triangles
    up = mesh.face_normals[:, 2] > 0.9
    assert mesh.area_faces[up].sum() == pytest.approx(areas(wall_prisms(square, 0.4, 0.1)).sum())
    assert mesh.area_faces[~up].sum() == pytest.approx(0.4 * (28 + 27.2 + 44 + 44.8))
    assert faces[..., 2].min() == 0.0 and faces[..., 2].max() == 0.4


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10_000), thickness=st.floats(0.01, 0.3))
def test_pieces_are_convex_on_any_jagged_wall(seed, thickness):
    rng = np.random.default_rng(seed)
    angle = 2.0 * np.pi * np.arange(300) / 300
    line = np.column_stack((10.0 * np.cos(angle), 6.0 * np.sin(angle))) + rng.normal(0.0, 0.01, (300, 2))
    widths = rng.uniform(0.8, 1.2, (2, 300))
    track = Track(name="test", centreline=line, width_right=widths[0], width_left=widths[1])
    feet = wall_prisms(track, thickness=thickness)[:, :4, :2]
    sides = np.roll(feet, -1, axis=1) - feet
    following = np.roll(sides, -1, axis=1)
    assert (sides[..., 0] * following[..., 1] - sides[..., 1] * following[..., 0]).min() > 0.0
