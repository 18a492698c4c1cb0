"""Tight circuits keep their settings, and the car can drive a lap of each of them, whatever the seed."""

from __future__ import annotations

import itertools
import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.arena.tight_courses.chicanes import Block, with_boxes
from fg_mujoco.addons.arena.tight_courses.drivable import MARGIN, STEP, drivable_lap
from fg_mujoco.addons.arena.tight_courses.lanes import corner_radii, lane, patch
from fg_mujoco.addons.arena.tight_courses.lanes import outline as outline_of
from fg_mujoco.addons.arena.tight_courses.tight import TightSettings, generate_tight_track
from fg_mujoco.course.clearance import least_clearance
from fg_mujoco.course.course import outline
from fg_mujoco.course.polyline import self_crossings
from fg_mujoco.simulation.course_loading import default_car
from scene_search import Clearances, car_gets_through

CAR = default_car()
BUNDLED = ("u_turns", "serpentine", "spiral", "elbow", "boxes", "maze")
SEEDS = tuple(f"random:{seed}:tight" for seed in range(3))
DEFAULTS = TightSettings()


def bar(width, barrier=0.1, length=4.0, square=0.0):
    """Two straights back to back, with a U-turn at either end."""
    around = outline_of(patch("#"), [length], [width + barrier])
    corners = np.ones(4)
    radii = corner_radii(around, 0.5 * (width + barrier) * corners, hairpin=2.0)
    sides = 0.5 * width * corners
    return lane(around, radii=radii, right=sides, left=sides, squareness=square * corners)


def barriers_with_a_turn_round_their_end(track):
    """Thickness of the wall between places that head in opposite directions, a U-turn apart. Shape (k,) [m]."""
    line, heading, at = track.centreline, track.headings, track.arc_length
    left = np.column_stack((-np.sin(heading), np.cos(heading)))
    found = []
    for i, j in itertools.combinations(range(0, len(line), 2), 2):
        between = min(at[j] - at[i], track.length - at[j] + at[i])
        opposite = math.cos(heading[i] - heading[j]) < -0.98
        if opposite and between < 4.5:
            towards = line[j] - line[i]
            distance = math.hypot(*towards)
            if abs(towards @ left[i]) > 0.98 * distance:
                widths = (track.width_left, track.width_right)[int(towards @ left[i] < 0.0)]
                found.append(distance - widths[i] - widths[j])
    return np.array(found)


def check_lap(track, poses, margin=MARGIN):
    """The poses are a lap that the car can drive forward, clear of all walls: without the search or its grids."""
    x, y, heading = poses.T
    np.testing.assert_allclose(poses[0], track.start_pose(), atol=1e-9)
    chord = np.hypot(np.diff(x), np.diff(y))
    turn = np.diff(heading)
    assert chord.max() <= STEP + 1e-9 and chord.min() > 0.99 * STEP
    assert np.abs(turn).max() <= STEP * math.tan(CAR.max_steering_angle) / CAR.wheelbase + 1e-4  # full lock
    middle = heading[:-1] + 0.5 * turn  # an arc's chord looks half way, forward
    np.testing.assert_allclose(np.diff(x), chord * np.cos(middle), atol=1e-9)
    np.testing.assert_allclose(np.diff(y), chord * np.sin(middle), atol=1e-9)
    walls = np.concatenate([outline(edge) for edge in track.edges])
    assert least_clearance(poses, walls, CAR) >= margin
    places = np.argmin(np.hypot(*(poses[:, None, :2] - track.centreline).transpose(2, 0, 1)), axis=1)
    gone = np.diff(track.arc_length[places])
    gone = (gone + 0.5 * track.length) % track.length - 0.5 * track.length
    assert np.abs(gone).max() < 1.5 and gone.sum() > track.length - 0.2
    assert not np.any((np.cumsum(gone) < 0.0) & (np.arange(len(gone)) > 20))  # never round the wrong way


@settings(deadline=None, max_examples=6)
@given(seed=st.integers(0, 2**63 - 1))
def test_every_seed_keeps_the_default_settings_and_has_a_lap_that_the_car_can_drive(seed):
    track = generate_tight_track(seed)
    assert DEFAULTS.min_length <= track.length <= DEFAULTS.max_length
    assert np.abs(track.curvature).max() <= 1.0 / DEFAULTS.min_radius
    width = track.width_left + track.width_right
    assert width.min() >= 0.9 * DEFAULTS.min_gap and np.percentile(width, 25) >= 0.95 * DEFAULTS.min_width
    assert max(np.ptp(np.concatenate(track.edges), axis=0)) < 30.0
    np.testing.assert_array_equal(track.corridor_right, track.width_right)
    np.testing.assert_array_equal(track.corridor_left, track.width_left)
    assert all(len(self_crossings(wall)[0]) == 0 for wall in track.edges)
    barriers = barriers_with_a_turn_round_their_end(track)
    assert np.any((barriers > 0.02) & (barriers < 1.3 * DEFAULTS.max_barrier))
    assert track.start_pose() == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)
    check_lap(track, drivable_lap(track))


@cache
def lap_of(name):
    track = fg.load_track(name)
    return track, drivable_lap(track)


@each("name", [*BUNDLED, *SEEDS])
def test_the_car_can_drive_a_lap_of(name):
    check_lap(*lap_of(name))


def through_the_u_turn(drawn):
    """Whether the search of the tests, on another lattice, gets round one of the U-turns of a bar."""
    line = drawn.line - drawn.line.mean(axis=0)
    track = fg.Track(name="bar", centreline=line, width_right=drawn.right, width_left=drawn.left)
    low, high = np.concatenate(track.edges).min(axis=0), np.concatenate(track.edges).max(axis=0)
    clearances = Clearances(track.walls, low - 0.3, high + 0.3, 0.02)
    above = float(line[:, 1].max())
    radius = CAR.wheelbase / math.tan(CAR.max_steering_angle)
    start = (0.0, above, math.pi)  # heads for the turn at the left, and has to come back below
    return car_gets_through(clearances, start, 1.0, CAR, radius=radius, margin=MARGIN)


@each("width, drivable", [(0.7, False), (0.85, False), (1.15, True), (1.4, True)])
def test_the_search_says_no_where_a_hairpin_is_too_narrow(width, drivable):
    track = bar(width).track("bar")
    poses = drivable_lap(track)
    assert (poses is not None) == drivable == through_the_u_turn(bar(width))
    if drivable:
        check_lap(track, poses)


def test_the_search_says_no_where_a_box_leaves_too_little():
    free = bar(1.4, length=8.0)
    start, end = max(free.straights(), key=lambda straight: straight[1] - straight[0])
    for gap, drivable in ((CAR.width + 2.0 * MARGIN - 0.02, False), (CAR.width + 2.0 * MARGIN + 0.15, True)):
        middle = 0.5 * (end - start)
        drawn = with_boxes(free, start, end, [Block(start=middle, length=0.4, depth=1.4 - gap, left=True)])
        track = drawn.track("box")
        assert (drivable_lap(track) is not None) == drivable
        assert (track.width_left + track.width_right).min() == pytest.approx(gap, abs=1e-3)


def test_same_seed_same_bytes_and_other_seed_other_circuit():
    first, second, other = (generate_tight_track(seed) for seed in (7, 7, 8))
    assert first.centreline.tobytes() == second.centreline.tobytes()
    assert first.width_left.tobytes() == second.width_left.tobytes()
    assert first.centreline.shape != other.centreline.shape or not np.array_equal(first.centreline, other.centreline)
    drawn = generate_tight_track(np.random.default_rng(7))
    assert drawn.centreline.tobytes() == first.centreline.tobytes()
    assert (first.name, drawn.name) == ("random:7:tight", "random:tight")
    assert fg.load_track("random:7:tight").centreline.tobytes() == first.centreline.tobytes()
