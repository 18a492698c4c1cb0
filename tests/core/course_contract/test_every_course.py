"""What every course keeps, of whatever class it is: tracks, maps, scenes, and one of a user's own."""

import functools
import io
import math
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from own_course import Yard

import fg_mujoco as fg
from cases import each
from conftest import Straight
from fg_mujoco.course.course import MEMBERS, require_course, wall_outlines
from fg_mujoco.course.definitions import course_sha256
from fg_mujoco.course.lap_timer import LapTimer
from fg_mujoco.simulation.course_loading import default_car, reload_course
from map_oracles import draw_map, ring
from scene_search import ray_distances, solids_of

CAR = default_car()
RANDOM = ("random:4", "random:4:tight", "random:8:tight")
NAMES = (*fg.track_names(), *RANDOM, *(f"scene:{name}:1" for name in fg.scene_names()), "ring.yaml", "corridor.yaml")
ONE_OF_EACH_CLASS = ("oval", "random:4:tight", "scene:crossing_box:1", "ring.yaml", "own")


@functools.cache
def made(name):
    if name == "own":
        return Yard()
    if name.endswith(".yaml"):
        free = ring()
        if name == "corridor.yaml":
            free[:, :150] = False
        with tempfile.TemporaryDirectory() as folder:
            return fg.load_track(draw_map(Path(folder), free, name=name.removesuffix(".yaml")))
    return fg.load_track(name)


@functools.cache
def world_of(course):
    """One world for all tests of a course."""
    return fg.World(course)


every_course = each("course", [*NAMES, "own"], made=made)
every_class = each("course", ONE_OF_EACH_CLASS, made=made)


@every_course
def test_it_is_a_course_and_loading_it_returns_it(course):
    require_course(course, "here")
    assert fg.load_track(course) is course
    assert course.name and course.description and "\n" not in course.description


@every_course
def test_poses_along_the_line_project_onto_their_progress(course):
    origin = course.origin or 0.0
    for s in np.linspace(0.0, 0.999 * course.length, 40):
        x, y, _ = course.start_pose(float(s))
        for found, offset in (course.project([[x, y]]), course.project([[x, y]], near=origin + s)):
            assert found[0] == pytest.approx(origin + s, abs=1e-6) or (course.closed and s == 0.0)
            assert offset[0] == pytest.approx(0.0, abs=1e-6)


@every_course
def test_an_offset_is_to_the_left_of_the_heading(course):
    for s in np.linspace(0.0, 0.999 * course.length, 20):
        x, y, heading = course.start_pose(float(s))
        left_x, left_y, _ = course.start_pose(float(s), 0.1)
        assert (left_y - y) * math.cos(heading) - (left_x - x) * math.sin(heading) > 0.05


@every_course
def test_driving_its_length_along_the_line_is_one_lap(course):
    timer, step = LapTimer(course), 0.2003  # [m], of which no length is a multiple
    for tick, s in enumerate(np.arange(0.0, course.length + 0.5, step)):
        x, y, _ = course.start_pose(float(s))
        timer.update(0.1 * tick, (x, y))
        assert timer.laps_completed == (s > course.length)
    assert timer.lap_times[0] == pytest.approx(0.1 * course.length / step, abs=1e-3)


@every_class
def test_it_is_the_same_from_its_definition(course):
    assert len(course_sha256(course)) == 64
    if isinstance(course, Yard):
        with pytest.raises(fg.TrackError, match="unknown track 'yard'"):
            reload_course(course.name, course.definition)
        return
    again = reload_course(course.name, course.definition)
    assert course_sha256(again) == course_sha256(course) and type(again) is type(course)
    assert fg.World(again).xml == world_of(course).xml


@every_course
def test_its_bounds_hold_the_start_and_its_walls_are_round_it(course):
    low, high = course.bounds
    start = np.array(course.start_pose()[:2])
    assert np.all(low <= start) and np.all(start <= high)
    headings = np.linspace(-math.pi, math.pi, 90)
    assert np.isfinite(ray_distances(course.walls, start, headings)).all()
    assert all(outline.ndim == 2 and outline.shape[1] == 2 for outline in wall_outlines(course))
    assert course.ground_lines.shape == (1 if course.closed else 2, 2, 2)


@every_course
def test_the_lidar_sees_what_stands_there_and_nothing_else(course):
    simulation = fg.Simulation(world_of(course))
    scan, _ = simulation.reset()
    x, y, heading = simulation.pose
    lidar = np.array([x + CAR.lidar_offset * math.cos(heading), y + CAR.lidar_offset * math.sin(heading)])
    expected = ray_distances(solids_of(course), lidar, scan.bearings + heading)
    expected[expected > scan.range_max] = math.inf
    seen = np.asarray(scan.ranges)
    agree = np.isclose(seen, expected, atol=2e-3, rtol=1e-3)
    assert agree.mean() > 0.99  # the others graze an edge
    assert np.isfinite(seen).mean() > 0.9


@every_course
def test_the_car_stands_free_at_the_start_and_hits_every_solid(course):
    world = world_of(course)
    simulation = fg.Simulation(world)
    assert not simulation.crashed
    solids = solids_of(course)
    for solid in solids[:: max(len(solids) // 40, 1)]:
        world.car.set_pose(simulation.data, *solid.corners().mean(axis=0), 0.0)
        assert world.car.crashed(simulation.data)


@every_course
def test_a_random_start_is_the_generators_alone_and_clear(course):
    world = world_of(course)
    simulation = fg.Simulation(world)
    for seed in range(10):
        s, offset, heading = course.draw_start(np.random.default_rng(seed), CAR, world.obstacles)
        assert (s, offset, heading) == course.draw_start(np.random.default_rng(seed), CAR, world.obstacles)
        simulation.reset(s=s, offset=offset, heading=heading)
        assert not simulation.crashed


@every_course
def test_random_boxes_leave_the_start_clear_or_are_refused(course):
    if not course.closed:
        with pytest.raises(fg.SettingsError, match=r"random obstacles .* on a track"):
            course.obstacle_sites(CAR)
        return
    sites = course.obstacle_sites(CAR)
    boxes = sites.place(min(sites.most, 3), 0.0, np.random.default_rng(0))
    assert len(boxes) == min(sites.most, 3)
    assert not fg.Simulation(fg.World(course, obstacles=boxes)).crashed


@every_class
def test_it_is_raced_drawn_and_learned_on(course):
    """The course is drawn to its last pixel, and its race, too."""
    result = fg.race(course, Straight(), time_limit=0.1)
    assert (result.track, result.laps_requested) == (course.name, 5 if course.closed else 1)
    files = io.BytesIO(), io.BytesIO()
    fg.track_picture(course, files[0])
    fg.trace_picture(result, files[1])
    assert all(file.getvalue().startswith(b"\x89PNG") for file in files)
    from fg_mujoco.envs.environment_settings import EnvironmentSettings

    assert EnvironmentSettings(track=course).make_world().track is course


def test_an_object_that_lacks_a_member_is_no_course():
    for missing in MEMBERS:
        members = {name: getattr(Yard, name) for name in MEMBERS if name != missing}
        with pytest.raises(fg.TrackError, match=f"is a Half without {missing}; accepted: a Track, a Scene"):
            fg.World(type("Half", (), members)())


def test_a_course_that_cannot_be_told_from_others_is_refused():
    @dataclass
    class Equal(Yard):
        number: int = 1

    with pytest.raises(fg.TrackError, match="is a Equal without hash; accepted: a dataclass with eq=False"):
        fg.race(Equal())
