"""Random circuits keep their settings whatever the seed, tight ones can be driven, and what moves keeps off walls."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.arena.random_courses.generator import SPACING, GeneratorSettings, generate_track
from fg_mujoco.addons.arena.random_courses.moving import with_moving
from fg_mujoco.addons.arena.tight_courses.drivable import MARGIN, STEP, drivable_lap
from fg_mujoco.addons.arena.tight_courses.lanes import Block, corner_radii, lane, patch, with_boxes
from fg_mujoco.addons.arena.tight_courses.lanes import outline as outline_of
from fg_mujoco.addons.arena.tight_courses.tight import BARRIER, GAP, LENGTH, MIN_RADIUS, WIDTH, generate_tight_track
from fg_mujoco.course.clearance import least_clearance
from fg_mujoco.course.course import outline, wall_outlines
from fg_mujoco.course.definitions import course_of
from fg_mujoco.course.formats import track_names
from fg_mujoco.course.polyline import self_crossings, step_lengths, turns
from fg_mujoco.errors import SettingsError
from fg_mujoco.racing.resolved import ground_of
from fg_mujoco.racing.setup import Setup
from fg_mujoco.simulation.course_loading import default_car
from scene_search import Clearances, car_gets_through

CAR = default_car()
BUNDLED = ("u_turns", "serpentine", "spiral", "elbow", "boxes", "maze")
SEEDS = tuple(f"random:{seed}:tight" for seed in range(3))


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
    widest = max(track.width_left.max(), track.width_right.max())  # inside a corner places jump by 2 w
    assert np.abs(gone).max() < max(1.5, 2.0 * widest) and gone.sum() > track.length - 0.2
    assert not np.any((np.cumsum(gone) < 0.0) & (np.arange(len(gone)) > 20))  # never round the wrong way


@settings(deadline=None, max_examples=6)
@given(seed=st.integers(0, 2**63 - 1))
def test_every_seed_keeps_the_default_settings_and_has_a_lap_that_the_car_can_drive(seed):
    track = generate_tight_track(seed)
    assert LENGTH[0] <= track.length <= LENGTH[1]
    assert np.abs(track.curvature).max() <= 1.0 / MIN_RADIUS
    width = track.width_left + track.width_right
    assert width.min() >= 0.9 * GAP[0] and np.percentile(width, 25) >= 0.95 * WIDTH[0]
    assert max(np.ptp(np.concatenate(track.edges), axis=0)) < 30.0
    np.testing.assert_array_equal(track.corridor_right, track.width_right)
    np.testing.assert_array_equal(track.corridor_left, track.width_left)
    assert all(len(self_crossings(wall)[0]) == 0 for wall in track.edges)
    barriers = barriers_with_a_turn_round_their_end(track)
    assert np.any((barriers > 0.02) & (barriers < 1.3 * BARRIER[1]))
    assert track.start_pose() == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)
    check_lap(track, drivable_lap(track))


@each("name", [*track_names(), *SEEDS, *(f"random:{seed}" for seed in range(4))])
def test_the_car_can_drive_a_lap_of(name):
    track = fg.load_track(name)
    check_lap(track, drivable_lap(track))


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


@each("generate, kind", [(generate_track, ""), (generate_tight_track, ":tight")])
def test_same_seed_same_bytes_and_other_seed_other_circuit(generate, kind):
    first, second, other, drawn = map(generate, (7, 7, 8, np.random.default_rng(7)))
    for again in (second, drawn, fg.load_track(f"random:7{kind}")):
        assert again.centreline.tobytes() == first.centreline.tobytes()
        assert again.width_left.tobytes() == first.width_left.tobytes()
    assert first.centreline.shape != other.centreline.shape or not np.array_equal(first.centreline, other.centreline)
    assert (first.name, drawn.name) == (f"random:7{kind}", f"random{kind}")


# circuits with room


def check(track, kept):
    line = track.centreline
    assert kept.min_length <= track.length <= kept.max_length
    np.testing.assert_allclose(step_lengths(line), SPACING, rtol=0.05)
    assert np.abs(track.curvature).max() <= 1.0 / kept.min_radius + 1e-9
    assert np.abs(np.diff(track.curvature)).max() < 0.4 / kept.min_radius  # steering has no jumps
    assert abs(abs(turns(line).sum()) - 2.0 * np.pi) < 1e-6  # once round
    assert len(self_crossings(line)[0]) == 0
    for width in (track.width_right, track.width_left):
        assert 0.5 * kept.min_width * 0.87 <= width.min() and width.max() <= 0.5 * kept.max_width * 1.13
    np.testing.assert_array_equal(track.corridor_right, track.width_right)
    np.testing.assert_array_equal(track.corridor_left, track.width_left)
    check_gap(track, kept)


def check_gap(track, kept):
    """All pairs: places far apart along the line have both widths and the gap between them."""
    line, width = track.centreline, np.maximum(track.width_right, track.width_left)
    apart = np.abs(track.arc_length[:, None] - track.arc_length)
    apart = np.minimum(apart, track.length - apart)
    distance = np.hypot(*(line[:, None] - line).transpose(2, 0, 1))
    stretch = apart > 1.5 * np.pi * np.maximum(kept.min_radius, kept.max_width)
    room = distance - width[:, None] - width
    assert room[stretch].min() >= kept.wall_gap - 0.1 * SPACING


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 2**63 - 1))
@pytest.mark.slow
def test_every_seed_keeps_the_default_settings(seed):
    check(generate_track(seed), GeneratorSettings())


@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 1000), width=st.floats(1.0, 3.0), radius=st.floats(1.0, 3.0), gap=st.floats(0.1, 1.0))
def test_other_settings_are_kept_as_well(seed, width, radius, gap):
    kept = GeneratorSettings(min_length=60.0, max_length=250.0, min_width=width, max_width=width, min_radius=radius,
                             wall_gap=gap)  # fmt: skip
    check(generate_track(seed, kept), kept)


def test_settings_that_no_circuit_keeps_are_refused():
    with pytest.raises(SettingsError, match="no circuit found"):
        generate_track(0, GeneratorSettings(min_length=10.0, max_length=12.0, min_radius=3.0))


# what moves


def least_distance(points, sides):
    """Return the least distance of points (n, 2) to sides (m, 4), by its definition [m]."""
    start, along = sides[:, :2], sides[:, 2:] - sides[:, :2]
    away = points[:, np.newaxis] - start
    share = np.clip((away * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
    return float(np.linalg.norm(away - share[..., np.newaxis] * along, axis=2).min())


@each("name", ["oval", "tight"])
def test_nothing_that_moves_comes_to_a_wall_or_to_the_grid(name):
    track = fg.load_track(name)
    walls = np.concatenate([outline(line) for line in wall_outlines(track)])
    for seed in range(6):
        for thing in with_moving(track, "box,crossing,pedestrian", seed, car=CAR, cars=4).moving:
            later = (2.0 * thing.way + abs(thing.headway)) / thing.speed
            corners = np.concatenate([thing.corners(time) for time in np.linspace(0.0, later, 40).tolist()])
            assert least_distance(corners, walls) > 0.03
            s, offset = track.project(corners)
            sides = (track.corridor_right, track.corridor_left)
            right, left = (np.interp(s, track.arc_length, side, period=track.length) for side in sides)
            assert ((offset > -right) & (offset < left)).all()
            assert ((s > 2.5) & (s < track.length - 3.0)).all()  # the last of four cars is 2.4 m behind the start


def test_what_moves_is_drawn_by_the_seed_and_boxes_stand_elsewhere():
    setup = Setup.of("oval", moving="crossing, pedestrian:2", obstacle_seed=5, obstacles=6)
    assert setup.moving == "crossing,pedestrian:2"
    course = ground_of(setup).course
    assert course is ground_of(setup).course and len(course.moving) == 5
    assert course.moving != ground_of(setup.replace(obstacle_seed=6)).course.moving
    places = course.project(np.array([each.start for each in course.moving]))[0]
    boxes = course.project(np.array([[each.x, each.y] for each in ground_of(setup).boxes]))[0]
    apart = np.abs((boxes[:, np.newaxis] - places + 0.5 * course.length) % course.length - 0.5 * course.length)
    assert apart.min() > 2.5
    again = course_of(course.name, course.definition)
    assert again.moving == course.moving
    assert "moving" not in fg.load_track("oval").definition
