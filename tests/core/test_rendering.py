"""Pictures, checked by what is in them: against projections, rays and closed forms."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest

import fg_mujoco as fg
from fg_mujoco.pictures.rendering import CAMERAS, LABELS, Film, Overlays, Renderer, find_overlays, render
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


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("time", [0.0, 3.3, 7.1])
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


@pytest.mark.parametrize("camera", ["chase", "onboard", "orbit"])
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


def test_depth_from_above_is_the_camera_s_height_over_what_it_sees(top):
    depth, labels = top.depth(4.0), top.segmentation(4.0)
    height = top.view(4.0).position[2]
    assert np.abs(depth[labels == ROAD] - height).max() < 2e-3
    assert np.quantile(np.abs(depth[labels == WALL] - (height - 0.3)), 0.9) < 2e-3


def test_sky_is_infinitely_far_and_nothing(films):
    labels, depth = films["onboard"].segmentation(4.0), films["onboard"].depth(4.0)
    assert (labels[0] == LABELS.index("nothing")).any()
    assert np.isinf(depth[labels == 0]).all() and np.isfinite(depth[labels != 0]).all()


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


def test_wall_is_wall_coloured_and_the_road_is_asphalt(films):
    film = films["chase"]
    picture, labels = film.frame(4.0).astype(float), film.segmentation(4.0)
    wall, road = picture[labels == WALL], picture[labels == ROAD]
    grey = np.ptp(wall, axis=1) < 0.16 * wall.max(axis=1)
    blue = wall[:, 2] > 1.3 * wall[:, 0]
    red = wall[:, 0] > 1.3 * wall[:, 2]
    assert (grey | blue | red).mean() > 0.93  # between two colours there are mixtures
    assert blue.mean() > 0.08 and grey.mean() > 0.4
    assert np.median(wall[grey].mean(axis=1)) > 1.2 * np.median(road.mean(axis=1))
    assert (np.ptp(road, axis=1) < 0.2 * road.max(axis=1) + 8.0).mean() > 0.98


def test_painted_car_is_blue(films):
    film = films["orbit"]
    picture, labels = film.frame(1.0).astype(float), film.segmentation(1.0)
    car = picture[labels == CAR]
    assert (car[:, 2] > 1.8 * car[:, 0]).mean() > 0.15


def test_start_line_is_chequered_across_the_road_where_the_track_starts(top, lap):
    labels, view = top.segmentation(0.0), top.view(0.0)
    x, y, heading = lap.world.track.start_pose()
    across = np.array([-np.sin(heading), np.cos(heading)])
    line = LABELS.index("start line")
    for offset in np.linspace(-1.0, 1.0, 9):
        column, row = pixel(view, (x + offset * across[0], y + offset * across[1], 0.0), SIZE)
        if inside(column, row, SIZE):
            assert labels[row, column] in (line, CAR)
    picture = top.frame(0.0)
    shades = picture[labels == line].mean(axis=1)
    assert shades.min() < 90 and shades.max() > 190


def test_two_renders_of_one_state_are_equal_whatever_was_drawn_between(films, lap):
    film = films["chase"]
    first = film.frame(5.21)
    for elsewhere in (1.0, 4.3, 6.0):
        film.frame(elsewhere), film.depth(2.0), film.segmentation(3.0)
        np.testing.assert_array_equal(film.frame(5.21), first)
    again = render(lap, time=5.21, size=SIZE, quality="draft")
    np.testing.assert_array_equal(again, first)
    assert (film.frame(5.31) != first).mean() > 0.1


def test_frames_of_a_video_are_the_frames_alone(films):
    film = films["top"]
    frames = list(film.frames(fps=20.0, start=2.0, end=2.2))
    assert len(frames) == 5
    np.testing.assert_array_equal(frames[3], film.frame(2.0 + 3 / 20.0))


def test_a_live_simulation_is_drawn_as_its_recorded_state(lap):
    simulation = fg.Simulation(lap.world)
    simulation.reset(s=1.0)
    for _ in range(8):
        simulation.step(fg.DriveCommand(steering_angle=0.2, speed=1.0))
    with Renderer(lap.world, size=SIZE, quality="draft") as renderer:
        live = renderer.rgb(simulation.data, "orbit")
        recorded = renderer.rgb(simulation.state, "orbit")
    np.testing.assert_array_equal(live, recorded)
    np.testing.assert_array_equal(render(simulation, camera="orbit", size=SIZE, quality="draft"), live)


def test_front_wheels_turn_and_tires_go_round_in_the_picture(lap):
    simulation = fg.Simulation(lap.world)
    simulation.reset()
    with Renderer(lap.world, size=SIZE, quality="draft") as renderer:
        data = renderer.set_state(simulation.state)
        camera = renderer.view(data, "orbit")
        straight = renderer.rgb(data, camera)
        state = simulation.data.qpos.copy()
        for joint in ("steering", "front_left_kingpin", "front_right_kingpin"):
            data.qpos[renderer.model.joint(f"car/{joint}").qposadr] = 0.4
        mujoco.mj_forward(renderer.model, data)
        turned = renderer.rgb(data, camera)
        data.qpos[:] = state
        data.qpos[renderer.model.joint("car/rear_left_suspension").qposadr] = 0.009
        mujoco.mj_forward(renderer.model, data)
        lifted = renderer.rgb(data, camera)
    assert 200 < (straight != turned).any(axis=2).sum() < 0.1 * SIZE[0] * SIZE[1]
    assert 30 < (straight != lifted).any(axis=2).sum() < 0.1 * SIZE[0] * SIZE[1]


def test_shadow_and_samples_come_with_quality(lap):
    state = lap.states[100]
    pictures = {}
    for quality in ("draft", "good", "best"):
        with Renderer(lap.world, size=(96, 64), quality=quality) as renderer:
            pictures[quality] = renderer.rgb(state, "orbit").astype(int)
    assert (pictures["good"] < pictures["draft"] - 20).any()  # in the shadow
    assert np.abs(pictures["best"] - pictures["good"]).mean() < 12.0  # the same scene


def test_size_may_be_any_up_to_full_hd_and_beyond(lap):
    for size in ((33, 17), (1920, 1080)):
        picture = render(lap, time=1.0, size=size, quality="draft")
        assert picture.shape == (size[1], size[0], 3)
        assert len(np.unique(picture)) > 20


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


def test_trace_lies_where_the_rear_axle_was(lap):
    with Film(lap, camera="track", size=(640, 480), quality="draft", overlays=Overlays(trace=True)) as film:
        picture, view = film.frame(6.0).astype(int), film.view(6.0)
    ticks = np.arange(10, int(5.5 / 0.025), 7)
    points = np.column_stack((lap.car.column("x_m")[ticks], lap.car.column("y_m")[ticks], np.zeros(len(ticks))))
    places = view.project(points, (640, 480))[0].astype(int)
    on_trace = [
        np.ptp(picture[row - 1 : row + 2, column - 1 : column + 2], axis=2).max() > 60 for column, row in places
    ]
    assert np.mean(on_trace) > 0.95


def test_a_drive_that_was_over_before_its_first_tick_has_one_frame(short_race):
    whole = read_drive(short_race)
    drive = replace(
        whole, time=whole.time[:1], states=whole.states[:1], ctrl=whole.ctrl[:0], telemetry=whole.telemetry[:0]
    )
    everything = Overlays(beams=True, trace=True, forces=True, strip=True)
    with Film(drive, size=(64, 48), quality="draft", overlays=everything) as film:
        assert len(list(film.frames())) == 1


def test_overlays_that_are_not_there_are_named():
    with pytest.raises(fg.SettingsError, match="beams, trace, forces, strip"):
        find_overlays("chase", fog=True)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"camera": "drone"}, "chase, onboard, top, track, orbit"),
        ({"quality": "superb"}, "draft, good, best"),
        ({"output": "heat"}, "rgb, depth, segmentation"),
        ({"size": (0, 480)}, "from 16 to"),
        ({"size": (640, 100_000)}, "from 16 to"),
        ({"size": (640.5, 480)}, "whole numbers"),
        ({"size": 640}, "whole numbers"),
        ({"time": -0.1}, "accepted: 0 to"),
        ({"time": 1e6}, "accepted: 0 to"),
    ],
)
def test_what_cannot_be_drawn_is_refused_with_what_can(short_race, wrong, message):
    with pytest.raises(fg.SettingsError, match=message):
        render(short_race, **{"time": 0.5, "size": (64, 48), "quality": "draft"} | wrong)


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
