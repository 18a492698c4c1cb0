"""Pictures, checked by what is in them: against projections, rays and closed forms."""

import math

import mujoco
import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.pictures.rendering import CAMERAS, LABELS, Film, Overlays, Renderer, render
from fg_mujoco.pictures.rendering.cameras import View
from fg_mujoco.pictures.rendering.planner_view import PlannerEye
from fg_mujoco.pictures.rendering.recorded_drive import read_drive
from fg_mujoco.pictures.rendering.ribbons import wall_chains
from fg_mujoco.pictures.rendering.scenery import SUN
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


def test_overlaid_beams_stay_within_what_the_lidar_sees(lap):
    """Drawn beams change pixels of road, car and walls, and none behind a wall."""
    shapes = []
    for overlays in (Overlays(), Overlays(beams=True)):
        with Film(lap, camera="top", size=(640, 480), quality="draft", overlays=overlays) as film:
            shapes.append(film.frame(6.0))
            labels, view = film.segmentation(6.0), film.view(6.0)
    changed = (shapes[0] != shapes[1]).any(axis=2)
    changed[:150, :160] = False  # the legend
    outside = changed & (labels == GROUND)
    assert changed.sum() > 5000
    assert outside.sum() < 0.01 * changed.sum()
    seen = PlannerEye(read_drive(lap)).at_tick(read_drive(lap).tick_at(6.0))
    column, row = pixel(view, seen.goal, (640, 480))
    assert inside(column, row, (640, 480))
    near = shapes[1][row - 3 : row + 4, column - 3 : column + 4].astype(int)  # half of it is in the wall
    assert (np.minimum(near[..., 0], near[..., 2]) > near[..., 1] + 60).any()  # magenta
    away = shapes[1][row - 3 : row + 4, column + 20 : column + 27].astype(int)
    assert (np.minimum(away[..., 0], away[..., 2]) > away[..., 1] + 60).sum() < 10  # but for the line to it


def test_a_scene_with_obstacles_that_move_is_drawn():
    race = fg.race("scene:crossing_box:1", max_speed=1.0, time_limit=1.0)
    with Film(race, camera="track", size=SIZE, quality="draft", overlays=Overlays()) as film:
        first, later = (film.segmentation(time) == LABELS.index("obstacle") for time in (0.0, 0.9))
    assert first.any() and later.any()
    assert (first != later).any()


def sunlit_wall_views(world):
    """Return for places where the sun grazes a wall's face: a view of it, and points just under its upper edge."""
    spec = mujoco.MjSpec.from_string(world.xml)  # it owns what the mesh shows
    prisms = np.array(spec.mesh("walls").uservert).reshape(-1, 8, 3)
    sun = np.array(SUN) / np.linalg.norm(SUN)
    for prism in (prism for chain in wall_chains(prisms)[:2] for prism in chain[::7]):
        outwards = prism[[0, 1]].mean(axis=0) - prism[[2, 3]].mean(axis=0)
        outwards /= np.linalg.norm(outwards)
        if not 0.03 < -outwards @ sun < 0.3:
            continue
        along = (prism[1] - prism[0]) / np.linalg.norm(prism[1] - prism[0])
        edge = prism[[4, 5]].mean(axis=0)
        target = edge + np.array([0.0, 0.0, -0.02])
        eye = edge + 0.8 * outwards + np.array([0.0, 0.0, 0.25])
        forward = (target - eye) / np.linalg.norm(target - eye)
        right = np.cross(forward, (0.0, 0.0, 1.0)) / np.linalg.norm(np.cross(forward, (0.0, 0.0, 1.0)))
        view = View(
            position=eye, forward=forward, up=np.cross(right, forward), fovy=0.5, focus=target, shadow_radius=5.0
        )
        below = -np.array([0.01, 0.02, 0.03])[:, None, None] * np.array([0.0, 0.0, 1.0])
        yield view, (edge + below + np.linspace(-0.15, 0.15, 200)[:, None] * along).reshape(-1, 3)


def test_wall_that_the_sun_shines_on_has_no_specks_of_shadow(lap):
    """Nothing stands between it and the sun, so with shadows it is as bright as without."""
    state, brightness, views = lap.states[0], {}, list(sunlit_wall_views(lap.world))
    assert len(views) >= 4
    for quality in ("draft", "good"):
        with Renderer(lap.world, size=SIZE, quality=quality) as renderer:
            brightness[quality] = []
            for view, points in views:
                columns, rows = np.floor(view.project(points, SIZE)[0]).astype(int).T
                brightness[quality].append(renderer.rgb(state, view).mean(axis=2)[rows, columns])
    assert np.min(brightness["good"]) > 40.0  # in the light, and not the sky's
    assert np.var(np.subtract(brightness["good"], brightness["draft"]), axis=1).max() < 0.5  # with specks: 12 to 76
