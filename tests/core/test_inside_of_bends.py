"""Progress on the inside of bends that are tighter than the course is wide: it is that of where the car leads on.

The oracle is a way that surely leads round the course: beside a wall. Along it progress never falls, and a lap of it is
a lap, though the nearest place of the line leaps, or stays on the arm that the car came by.
"""

import functools
import math

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.course.lap_timer import LapTimer
from fg_mujoco.course.polyline import resample, steps, turns
from fg_mujoco.simulation.termination import WRONG_WAY_LIMIT

BESIDE = 0.2  # [m] from the wall: the middle of the rear axle of a car that touches it


def pin(radius, half_width, clockwise=False):
    """A loop of two straights that spread by 16 deg, between a hairpin and a wide bend, where it starts."""
    spread, along = math.radians(8.0), np.arange(0.0, 18.0, 0.4)[:, np.newaxis]
    ahead, left = np.array([math.cos(spread), math.sin(spread)]), np.array([-math.sin(spread), math.cos(spread)])
    up = radius * left + along * ahead
    far = np.linspace(0.5 * math.pi, -0.5 * math.pi, 40)
    tip = np.linspace(1.5 * math.pi - spread, 0.5 * math.pi + spread, 12)
    bend = (up[-1, 0], 0.0) + up[-1, 1] * np.column_stack((np.cos(far), np.sin(far)))
    tip = radius * np.column_stack((np.cos(tip), np.sin(tip)))
    (line,) = resample(np.concatenate((bend[20:], up[-2::-1] * (1.0, -1.0), tip[1:-1], up[:-1], bend[:20])), 0.4)
    width = np.full(len(line), half_width)
    return fg.Track(name="pin", centreline=line[:: -1 if clockwise else 1], width_right=width, width_left=width)


def beside(wall, side):
    """The way BESIDE a wall, on its left for a side of 1, every 5 cm; round a corner that juts out it is an arc."""
    mirror = np.array([1.0, side])
    wall = wall * mirror
    heading, turn = np.arctan2(*steps(wall).T[::-1]), turns(wall)
    points = []
    for i, point in enumerate(wall):
        bends = np.linspace(-turn[i], 0.0, 12) if turn[i] < 0.0 else np.array([-0.5 * turn[i]])
        away = BESIDE if turn[i] < 0.0 else BESIDE / math.cos(0.5 * turn[i])
        angle = heading[i] + bends
        points.append(point + away * np.column_stack((-np.sin(angle), np.cos(angle))))
    (way,) = resample(np.concatenate(points) * mirror, 0.05)
    return np.concatenate((way, way[:1]))


def ways_round(track):
    return beside(track.left_wall, -1.0), beside(track.right_wall, 1.0)


def followed(course, way):
    """The progress along a way, and how far the car has come back by the judge's count [m]."""
    timer, found = LapTimer(course), []
    for tick, place in enumerate(way.tolist()):
        timer.update(0.025 * tick, place)
        found.append((timer.progress, timer.memory["passed"][0] - timer.progress))
    return np.array(found).T


def progress_along(course, way):
    return followed(course, way)[0]


def greatest_fall(progress):
    return float((np.maximum.accumulate(progress) - progress).max())


def loops(count):
    """Radii and half-widths [m] of hairpins: extremes, one whose arms are as far apart as a wall is, and others."""
    rng = np.random.default_rng(60)
    drawn = rng.uniform((0.4, 0.8), (1.5, 1.6), (count - 5, 2)).tolist()
    known = [(0.4, 1.6), (0.4, 1.6), (0.65, 1.1), (1.5, 0.8), (0.4, 0.845)]
    return [(*each, k % 2 == 1) for k, each in enumerate([*known, *drawn])]


@each("radius, half_width, clockwise", loops(8))
def test_along_each_wall_of_a_loop_with_a_hairpin_progress_never_falls(radius, half_width, clockwise):
    track = pin(radius, half_width, clockwise)
    for way in ways_round(track):
        for sense in (1, -1):
            progress = sense * progress_along(track, way[::sense])
            assert greatest_fall(progress) < 0.1
            assert progress[-1] == pytest.approx(track.length, abs=1e-6)


@each("name", ["l_corridor", "elbow", "boxes"])
def test_along_each_wall_of_a_bundled_track_with_tight_bends_progress_hardly_falls(name):
    track = fg.load_track(name)
    for way in ways_round(track):
        progress = progress_along(track, way)
        assert greatest_fall(progress) < 0.2 and progress[-1] == pytest.approx(track.length, abs=1e-6)


@functools.cache
def hairpin():
    return pin(0.65, 1.1)


def from_wide_bend(track):
    """The way beside the inner wall from where the course is wide, and the index of the tip of the wall."""
    inner = min(ways_round(track), key=len)[:-1]
    inner = np.roll(inner, -int(inner[:, 0].argmax()), axis=0)
    return inner, int(inner[:, 0].argmin())


def test_a_car_that_turns_back_in_the_hairpin_is_judged_once_it_is_five_metres_out_of_it():
    """It goes round the tip of the inner wall, halfway, and the same way back."""
    inner, tip = from_wide_bend(hairpin())
    there = inner[tip - 200 : tip + 2]
    progress, back = followed(hairpin(), np.concatenate((there, there[::-1])))
    assert progress.max() == progress[len(there) - 1] and progress[-1] == pytest.approx(0.0, abs=1e-6)
    assert back[: len(there)].max() < 0.05 and back[-1] > WRONG_WAY_LIMIT
    out_of_it = len(there) + 10  # 0.4 m before the tip
    judged = int((back >= WRONG_WAY_LIMIT).argmax())
    assert 0.0 <= progress[out_of_it] - progress[judged] <= WRONG_WAY_LIMIT


def test_a_car_that_goes_to_and_fro_in_a_wide_hairpin_is_not_judged():
    """It crosses to the other arm in front of the tip, goes round the bend against its order, and crosses again."""
    track = pin(0.46, 1.59)
    inner, tip = from_wide_bend(track)
    x, y = inner[tip]
    in_bend = [(x - 1.0, y), (1.0, 0.9), (-0.8, 0.8), (-0.8, -0.8), (1.5, -0.9), (x - 1.0, y)]
    way = np.array([(x + 3.0, y - 1.2), *in_bend, (x + 3.0, y + 1.2)])
    progress, back = followed(track, resample(way, 0.1)[0][:-60])  # without the side that closes it
    assert greatest_fall(progress) > 4.0 and back.max() < 0.5


def test_without_a_hint_the_same_progress_is_found():
    track = hairpin()
    inner, _ = from_wide_bend(track)
    followed = track.project(inner[:1])[0] + progress_along(track, inner)
    found, offset = track.project(inner)
    np.testing.assert_allclose((found - followed + 1.0) % track.length, 1.0, atol=1e-6)
    assert np.abs(offset).max() < 1.1  # it is that of the nearest place


@each("seed", [0, 1, 2])
def test_round_the_corner_of_a_scene_progress_grows_as_much_as_on_its_line(seed):
    """From leg to leg, 0.3 m from the inner edge: the scene's way has a tight arc there."""
    scene = fg.load_track(f"scene:square_corner:{seed}")
    goal, side = scene.way[-1], math.copysign(1.0, scene.way[-1, 1])
    half = min(abs(corner[1]) for wall in scene.walls for corner in wall.corners())
    edge = np.array([goal[0] - half, side * half])
    corner = edge + 0.3 * np.array([1.0, -side])
    to_corner, from_corner = np.array([-3.0, 0.0]), np.array([0.0, 3.0 * side])
    share = np.linspace(0.0, 1.0, 60)[:, np.newaxis]
    legs = np.concatenate((corner + to_corner * (1.0 - share), corner + from_corner * share))
    progress = progress_along(scene, legs)
    ends = scene.project([legs[0] * (1.0, 0.0), (goal[0], legs[-1, 1])])[0]
    assert greatest_fall(progress) < 0.05
    assert progress[-1] - progress[0] == pytest.approx(ends[1] - ends[0], abs=1e-6)


@each("planner", ["gap_finder", "follow_the_gap"])
def test_laps_round_a_hairpin_narrower_than_the_course_are_finished(planner):
    """The first one by the planner, the second on the remembered line."""
    track = pin(0.46, 1.59, clockwise=True)
    result = fg.race(track, planner, laps=2)
    assert result.car.finished
    assert result.car.column("progress_m")[-1] == pytest.approx(2.0 * track.length, abs=0.5)
