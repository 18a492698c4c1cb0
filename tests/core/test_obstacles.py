"""Obstacles are where they were put, as large as they were made, and neither is anything else."""

import math

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fg_mujoco as fg
from cases import each
from fg_mujoco.course.obstacles import Box, Cylinder, Prism, solids_numbers, solids_of
from fg_mujoco.errors import SettingsError

places, sizes, headings = st.floats(-50, 50), st.floats(0.01, 5), st.floats(-10, 10)


def area(corners):
    """Shoelace formula: positive where the corners go counterclockwise [m^2]."""
    (x, y), (next_x, next_y) = corners.T, np.roll(corners, -1, axis=0).T
    return 0.5 * float(np.sum(x * next_y - next_x * y))


@given(x=places, y=places, length=sizes, width=sizes, heading=headings)
def test_a_box_has_its_length_along_its_heading_and_its_width_across(x, y, length, width, heading):
    corners = fg.Box(x=x, y=y, length=length, width=width, heading=heading).corners()
    assert corners.shape == (4, 2)
    assert corners.mean(axis=0) == pytest.approx((x, y), abs=1e-9)
    assert area(corners - (x, y)) == pytest.approx(length * width, rel=1e-9)
    away = corners - (x, y)
    ahead, left = np.array([math.cos(heading), math.sin(heading)]), np.array([-math.sin(heading), math.cos(heading)])
    assert np.abs(away @ ahead) == pytest.approx([0.5 * length] * 4, abs=1e-9)
    assert np.abs(away @ left) == pytest.approx([0.5 * width] * 4, abs=1e-9)


@given(x=places, y=places, radius=sizes)
def test_a_cylinder_is_a_regular_prism_inscribed_in_it(x, y, radius):
    corners = fg.Cylinder(x=x, y=y, radius=radius).corners()
    assert np.hypot(*(corners - (x, y)).T) == pytest.approx([radius] * 24, abs=1e-9)
    assert area(corners - (x, y)) == pytest.approx(12 * radius**2 * math.sin(2 * math.pi / 24), rel=1e-9)


@each(
    "obstacle",
    (fg.Box(x=2.0, y=-0.3, length=0.4, width=0.2, heading=0.7, height=0.15), fg.Cylinder(x=3.0, y=0.4, radius=0.2)),
)
def test_the_compiled_solid_is_the_footprint_from_below_the_ground_to_its_height(obstacle):
    """MuJoCo moves a mesh to its own centre and axes; put back, every corner is where it was asked for."""
    model = fg.World("oval", obstacles=(obstacle,)).model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    geom = model.geom("obstacle_0")
    mesh = int(geom.dataid[0])
    vertices = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]].astype(float)
    found = vertices @ data.geom_xmat[geom.id].reshape(3, 3).T + data.geom_xpos[geom.id]
    expected = [(*corner, z) for z in (-0.5, obstacle.height) for corner in obstacle.corners()]
    distances = np.linalg.norm(found[:, None] - np.array(expected)[None], axis=2)
    assert distances.shape[0] == distances.shape[1]
    assert distances.min(axis=0).max() < 1e-5 and distances.min(axis=1).max() < 1e-5  # MJCF text keeps six digits


def test_the_lidar_sees_an_obstacle_and_past_it_what_was_there_before():
    box = fg.Box(x=3.0, y=0.0, length=0.4, width=0.4)
    before, _ = fg.Simulation(fg.World("oval")).reset()
    after, _ = fg.Simulation(fg.World("oval", obstacles=(box,))).reset()
    distance = box.x - 0.5 * box.length - fg.World("oval").parameters.lidar_offset
    assert after.ranges[540] == pytest.approx(distance, abs=1e-6)
    hit = np.abs(after.bearings) < math.atan(0.5 * box.width / distance) - 1e-6
    assert after.ranges[hit] * np.cos(after.bearings[hit]) == pytest.approx(distance, abs=1e-6)
    assert np.array_equal(after.ranges[~hit], before.ranges[~hit])
    assert (after.ranges[hit] < before.ranges[hit]).all() and hit.sum() == 37  # 2 atan(.2 / 2.525) in steps of 0.25 deg


SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))


def test_a_solid_that_mujoco_cannot_make_is_refused():
    box = fg.Box(x=8.0, y=1e6, length=0.01, width=0.01)
    with pytest.raises(fg.SettingsError, match=r"^obstacle 0 is Box\(.*, which MuJoCo cannot make a solid; accepted: "):
        fg.World("oval", obstacles=(box,))


@each(
    "footprint",
    (
        SQUARE[::-1],  # clockwise
        SQUARE[:2],
        ((0.0, 0.0), (2.0, 0.0), (1.0, 0.5), (1.0, 2.0)),  # a corner that juts in
        tuple((math.cos(a), math.sin(a)) for a in (0.8 * math.pi * k for k in range(5))),  # a star: twice round
        (*SQUARE[:3], (math.nan, 1.0)),
        (*SQUARE[:3], (0.0, 1.0, 2.0)),
        "abc",
        None,
    ),
)
def test_a_footprint_that_is_no_convex_polygon_is_refused(footprint):
    with pytest.raises(SettingsError, match=r"Prism.footprint is .*; accepted: three or more \(x, y\) \[m\], counter"):
        Prism(footprint=footprint)


def test_solids_are_the_same_from_their_numbers():
    solids = (
        Box(x=1.0, y=2.0, length=0.3, width=0.4, heading=0.1), Prism(footprint=SQUARE[:3], height=0.7),
        Cylinder(x=-1.0, y=0.1, radius=0.2, height=0.5), Prism(footprint=SQUARE),
    )  # fmt: skip
    assert solids_of(solids_numbers(solids)) == solids
    assert solids_of(solids_numbers(())) == ()
    with pytest.raises((IndexError, ValueError)):
        solids_of(solids_numbers(solids)[:-1])
