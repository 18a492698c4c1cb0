"""Pictures, checked by what is in them: against projections, rays and closed forms."""

import math

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.pictures.rendering import CAMERAS, LABELS, Film, Overlays, render
from fg_mujoco.pictures.rendering.planner_view import PlannerEye
from fg_mujoco.pictures.rendering.recorded_drive import read_drive
from fg_mujoco.vehicle.car import WHEELS
from rendered import inside, needs_gl, pixel

pytestmark = needs_gl

SIZE = (320, 240)
ROAD, WALL, CAR, GROUND = (LABELS.index(name) for name in ("road", "wall", "car", "ground"))


@pytest.fixture(scope="module")
def films(lap):
    made = {camera: Film(lap, camera=camera, size=SIZE, quality="draft", overlays=Overlays()) for camera in CAMERAS}
    yield made
    for film in made.values():
        film.close()


@pytest.fixture(scope="module")
def top(films):
    return films["top"]


@each("camera", CAMERAS)
@each("time", [0.0, 3.3, 7.1])
def test_car_is_where_the_projection_says_and_nowhere_else(films, camera, time):
    film = films[camera]
    labels, data, view = film.segmentation(time), film._player.at(time), film.view(time)
    model = film.renderer.model
    seen = np.argwhere(labels == CAR)[:, ::-1] + 0.5
    assert len(seen)
    vertices = np.vstack(
        [_vertices(model, data, name) for name in ("tub", "deck", "bumper", "rear_bumper", "lidar_base")]
    )
    wheels = np.vstack([data.body(f"car/{wheel}_wheel").xpos for wheel in WHEELS])
    rise = np.array([0.0, 0.0, 0.05])
    corners, depth = view.project(np.vstack((vertices, wheels, wheels + rise, wheels - rise)), SIZE)
    corners = corners[depth > 0.05]
    reach = 0.06 * SIZE[1] / (view.height if view.is_parallel else 1.0) + 3.0  # [px] tires stand out of their axles
    assert (seen >= corners.min(axis=0) - reach).all() and (seen <= corners.max(axis=0) + reach).all()
    if camera != "onboard":  # which sees parts of it only
        middle = np.array([0.165, 0.0, 0.02]) @ data.body("car/base_link").xmat.reshape(3, 3).T
        column, row = pixel(view, data.body("car/base_link").xpos + middle, SIZE)
        assert labels[row, column] == CAR


def _vertices(model, data, name):
    geom = model.geom(f"look/{name}").id
    mesh = model.geom_dataid[geom]
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    return model.mesh_vert[first : first + count] @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]


@each("camera", ["chase", "onboard", "orbit"])
def test_depth_of_the_ground_is_where_each_ray_meets_it(films, camera):
    film = films[camera]
    depth, labels, view = film.depth(4.0), film.segmentation(4.0), film.view(4.0)
    rows, columns = np.nonzero(labels == ROAD)
    right = np.cross(view.forward, view.up)
    scale = math.tan(0.5 * view.fovy) / (0.5 * SIZE[1])
    x, y = (columns + 0.5 - 0.5 * SIZE[0]) * scale, (0.5 * SIZE[1] - rows - 0.5) * scale
    rays = view.forward + x[:, None] * right + y[:, None] * view.up
    expected = -view.position[2] / rays[:, 2]  # along the axis, as each ray is 1 long along it
    error = np.abs(depth[rows, columns] - expected) / expected
    assert len(rows) > 5000 and np.median(error) < 1e-4 and np.quantile(error, 0.99) < 5e-3


def test_beams_of_the_lidar_end_on_what_is_labelled_wall(films, lap):
    """An oracle that draws nothing: the distances are those of the ray caster."""
    film = films["onboard"]
    seen = PlannerEye(read_drive(lap)).at_tick(160)
    time = float(film.drive.time[160])
    labels, view, right = film.segmentation(time), film.view(time), 0
    depths = film.depth(time)
    beams = np.arange(300, 781, 4)
    ends = seen.points(seen.scan.ranges, beams)
    places, depth = view.project(ends, SIZE)
    for (column, row), far in zip(places.astype(int), depth, strict=True):
        if far < 0.5 or not inside(column, row, SIZE):
            continue
        if abs(depths[row, column] - far) < 0.1 * far:  # else the car's own nose or LiDAR is in front
            assert labels[row - 1 : row + 2, column - 1 : column + 2].max() >= WALL
            right += 1
    assert right > 40


def test_two_renders_of_one_state_are_equal_whatever_was_drawn_between(films, lap):
    film = films["chase"]
    first = film.frame(5.21)
    for elsewhere in (1.0, 4.3, 6.0):
        film.frame(elsewhere), film.depth(2.0), film.segmentation(3.0)
        np.testing.assert_array_equal(film.frame(5.21), first)
    again = render(lap, time=5.21, size=SIZE, quality="draft")
    np.testing.assert_array_equal(again, first)
    assert (film.frame(5.31) != first).mean() > 0.1


def test_a_scene_with_obstacles_that_move_is_drawn():
    race = fg.race("scene:crossing_box:1", max_speed=1.0, time_limit=1.0)
    with Film(race, camera="track", size=SIZE, quality="draft", overlays=Overlays()) as film:
        first, later = (film.segmentation(time) == LABELS.index("obstacle") for time in (0.0, 0.9))
    assert first.any() and later.any()
    assert (first != later).any()
