"""Walls in 3D: what is seen is what is hit. What all tracks keep is in course_contract."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from fg_mujoco.course.track import Track
from fg_mujoco.course.track_mesh import WALL_HEIGHT, wall_footprints, wall_prisms, wall_surface


def areas(prisms):
    x, y = prisms[:, :4, 0], prisms[:, :4, 1]
    return 0.5 * np.sum(x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y, axis=1)


@pytest.fixture(scope="module")
def square():
    line = [(0.0, 0.0), (10.0, 0.0), (10.0, 8.0), (0.0, 8.0)]
    return Track(name="test", centreline=line, width_right=np.ones(4), width_left=np.ones(4))


def test_walls_of_a_square_are_two_frames_of_four_pieces(square):
    prisms = wall_prisms(square.edges)
    assert prisms.shape == (8, 8, 3)
    assert prisms[..., 2].max() == WALL_HEIGHT
    inner, outer = areas(prisms[:4]).sum(), areas(prisms[4:]).sum()
    assert inner == pytest.approx(8 * 6 - 7.9 * 5.9)  # its thickness is on the inside of the inner wall
    assert outer == pytest.approx(12.1 * 10.1 - 12 * 10)


def test_mesh_of_a_square_is_closed_but_for_its_underside(square):
    mesh = trimesh.Trimesh(*wall_surface(square.edges), process=False)
    assert len(mesh.faces) == 8 * 6  # front, back and top; no ends, for the pieces meet
    faces = mesh.triangles
    up = mesh.face_normals[:, 2] > 0.9
    assert mesh.area_faces[up].sum() == pytest.approx(areas(wall_prisms(square.edges)).sum())
    assert mesh.area_faces[~up].sum() == pytest.approx(WALL_HEIGHT * (28 + 27.6 + 44 + 44.4))
    assert faces[..., 2].min() == 0.0 and faces[..., 2].max() == WALL_HEIGHT


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10_000), thickness=st.floats(0.01, 0.3))
def test_pieces_are_convex_on_any_jagged_wall(seed, thickness):
    rng = np.random.default_rng(seed)
    angle = 2.0 * np.pi * np.arange(300) / 300
    line = np.column_stack((10.0 * np.cos(angle), 6.0 * np.sin(angle))) + rng.normal(0.0, 0.01, (300, 2))
    widths = rng.uniform(0.8, 1.2, (2, 300))
    track = Track(name="test", centreline=line, width_right=widths[0], width_left=widths[1])
    feet = wall_footprints(track.left_wall, thickness)
    sides = np.roll(feet, -1, axis=1) - feet
    following = np.roll(sides, -1, axis=1)
    assert (sides[..., 0] * following[..., 1] - sides[..., 1] * following[..., 0]).min() > 0.0
