"""Walls in 3D: what is seen is what is hit. What all tracks keep is in course_contract."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fg_mujoco.course.polyline import cross, resample, rounded_polygon
from fg_mujoco.course.track import Track
from fg_mujoco.course.track_mesh import WALL_HEIGHT, WALL_THICKNESS, wall_mesh, wall_prisms
from fg_mujoco.course.track_walls import WALL_TOLERANCE
from fg_mujoco.errors import SettingsError
from fg_mujoco.simulation.course_loading import load_track


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
    mesh = wall_mesh(square, 0.4, 0.1)
    assert len(mesh.faces) == 8 * 6  # front, back and top; no ends, for the pieces meet
    faces = mesh.triangles
    up = mesh.face_normals[:, 2] > 0.9
    assert mesh.area_faces[up].sum() == pytest.approx(areas(wall_prisms(square, 0.4, 0.1)).sum())
    assert mesh.area_faces[~up].sum() == pytest.approx(0.4 * (28 + 27.2 + 44 + 44.8))
    assert faces[..., 2].min() == 0.0 and faces[..., 2].max() == 0.4


def test_faces_look_outward(square):
    mesh = wall_mesh(square)
    prisms = wall_prisms(square)
    centre = prisms.mean(axis=1)[mesh.faces[:, 0] // 8]
    assert np.all(np.sum((mesh.triangles_center - centre) * mesh.face_normals, axis=1) > 0.0)


def test_an_end_that_no_neighbour_meets_is_closed():
    corners = [(0, 1.6), (0, 0), (1.5, 0), (10.5, -6), (20, -6), (20, 7.6), (10.5, 7.6), (1.5, 1.6)]
    line = resample(rounded_polygon(np.array(corners, dtype=float), np.full(8, 0.75)), 0.1)[0]
    track = track_of(line)
    prisms = wall_prisms(track, thickness=0.5)  # the tips are too short for it
    feet = prisms[:, :4, :2]
    depth = np.linalg.norm(feet[:, 3] - feet[:, 0], axis=1)
    assert depth.min() < 0.4
    assert len(wall_mesh(track, thickness=0.5).faces) > 6 * len(prisms)


def test_pieces_are_full_thickness_where_there_is_room():
    prisms = wall_prisms(load_track("oval"))
    feet = prisms[:, :4, :2]
    along = feet[:, 1] - feet[:, 0]
    np.testing.assert_allclose(cross(along, feet[:, 2] - feet[:, 0]) / np.linalg.norm(along, axis=1), WALL_THICKNESS)
    assert prisms[..., 2].max() == WALL_HEIGHT


def test_straights_are_single_pieces():
    track = load_track("l_corridor")
    assert len(wall_prisms(track)) == 12  # six corners to each wall


def test_thick_walls_are_thinner_where_another_stretch_is_behind():
    track = load_track("hairpins")  # 1.8 m between the walls of two arms
    prisms = wall_prisms(track, thickness=3.0)
    points = track.position(np.random.default_rng(1).uniform(0.0, track.length, 500), 0.0)
    for prism in prisms:
        away = points[:, None] - prism[:4, :2]
        sides = np.roll(prism[:4, :2], -1, axis=0) - prism[:4, :2]
        assert not np.any(np.all(sides[:, 0] * away[..., 1] - sides[:, 1] * away[..., 0] > 0.0, axis=1))
    assert areas(prisms).min() > 0.0


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


def test_mujoco_takes_the_pieces_and_the_mesh():
    track = load_track("oval")
    spec = mujoco.MjSpec()
    mesh = wall_mesh(track)
    spec.add_mesh(
        name="walls",
        uservert=np.ravel(mesh.vertices),
        userface=np.ravel(mesh.faces),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="walls", contype=0, conaffinity=0)
    for k, prism in enumerate(wall_prisms(track)):
        spec.add_mesh(name=f"piece{k}", uservert=np.ravel(prism))
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"piece{k}")
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    hit = np.zeros(1, dtype=np.int32)
    for left in (1.0, -1.0):
        distance = mujoco.mj_ray(model, data, np.array([0.0, 0.0, 0.1]), np.array([0.0, left, 0.0]), None, 1, -1, hit)
        assert distance == pytest.approx(1.1, abs=WALL_TOLERANCE)


@pytest.mark.parametrize("size", [0.0, -0.1, float("nan"), float("inf")])
def test_sizes_that_make_no_wall_are_refused(square, size):
    with pytest.raises(SettingsError, match="height of the walls"):
        wall_prisms(square, height=size)
    with pytest.raises(SettingsError, match="thickness of the walls"):
        wall_mesh(square, thickness=size)
