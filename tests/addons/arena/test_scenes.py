"""Each scene is what its name says: widths measured on its solids, and ways searched among them."""

import math

import numpy as np
import pytest
from matplotlib.path import Path

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.arena.bundled_scenes import walls_round
from fg_mujoco.course.obstacles import Box
from fg_mujoco.simulation.course_loading import default_car
from scene_search import Clearances, car_gets_through, disc_gets_through, ray_distances

SEEDS = range(3)
CAR = default_car()
WIDTH = CAR.width
TURNING_RADIUS = CAR.wheelbase / math.tan(CAR.max_steering_angle)


def load(name, seed):
    return fg.load_track(f"scene:{name}:{seed}")


def extents(scene):
    """The least and the greatest corner of each box (n, 2, 2) [m]."""
    corners = [box.corners() for box in scene.obstacles]
    return np.array([(each.min(axis=0), each.max(axis=0)) for each in corners])


def free_across(boxes, x):
    """Free stretches of the line across a scene at x, by the extents of its boxes. Shape (n, 2) [m], from y to y."""
    y = np.arange(-4.0, 4.0, 0.001)
    occupied = np.ones(len(y), bool)
    inside_walls = np.abs(y) < 1.1
    occupied[inside_walls] = False
    for low, high in boxes[(boxes[:, 0, 0] <= x) & (x <= boxes[:, 1, 0])][:, :, 1]:
        occupied |= (y >= low) & (y <= high)
    edges = np.flatnonzero(np.diff(occupied.astype(int)))
    return y[edges].reshape(-1, 2)


@pytest.mark.slow
@each(("name", "widths"), (("corridor_sparse", 2.5), ("corridor_dense", 2.0)))
@each("seed", SEEDS)
def test_corridors_leave_a_way_past_every_box(name, widths, seed):
    scene = load(name, seed)
    assert all(box.heading == 0.0 for box in scene.obstacles)
    boxes = extents(scene)
    for x in np.arange(0.0, 25.0, 0.02):
        stretches = free_across(boxes, x)
        assert np.max(stretches[:, 1] - stretches[:, 0]) >= widths * WIDTH - 0.003


@pytest.mark.slow
@each("percent", (120, 150, 200))
@each("seed", SEEDS)
def test_the_narrow_gap_is_as_wide_as_its_name_says(percent, seed):
    scene = load(f"narrow_gap_{percent}", seed)
    x = np.mean(np.concatenate([box.corners()[:, 0] for box in scene.obstacles]))
    ((low, high),) = free_across(extents(scene), x)
    assert high - low == pytest.approx(0.01 * percent * WIDTH, abs=0.003)
    field = Clearances([*scene.walls, *scene.obstacles], (-0.5, -1.2), (14.5, 1.2), 0.005)
    start, goal = scene.position(0.0), scene.position(14.0)
    assert disc_gets_through(field, start, goal, 0.5 * (high - low) - 0.01)
    assert not disc_gets_through(field, start, goal, 0.5 * (high - low) + 0.01)


@each("seed", SEEDS)
def test_a_dead_end_has_no_way_out_and_no_room_to_turn_round(seed):
    scene = load("dead_end", seed)
    assert scene.goal_is_to_stop
    end = scene.way[-1, 0]
    (distance,) = ray_distances(scene.walls, scene.position(0.0), np.array([0.0]))
    assert distance == pytest.approx(end) and scene.position(scene.length)[0] == pytest.approx(end - 3.0)
    # one that turns on full lock sweeps from its inner rear wheel to its outer front corner
    outer = math.hypot(TURNING_RADIUS + 0.5 * WIDTH, CAR.length - CAR.rear_overhang)
    (left, right) = ray_distances(scene.walls, scene.position(5.0), np.array([0.5 * math.pi, -0.5 * math.pi]))
    assert left + right < TURNING_RADIUS + outer + 0.5 * WIDTH


@each("seed", SEEDS)
def test_in_the_u_turn_trap_the_way_on_is_behind_and_looks_shorter_than_the_way_back(seed):
    """The slides: "the farthest path the car can 'see' in the correct direction is shorter than the path in the wrong".

    Seen by whoever has missed the corner: from the room beyond it.
    """
    scene = load("u_turn_trap", seed)
    side = 1.0 if scene.way[-1, 1] > 0.0 else -1.0
    apex = scene.way[np.argmax(np.diff(scene.way[:, 0]) < 0.0), 0]  # as far ahead as the way leads before it turns back
    headings = np.radians(np.arange(0.0, 360.0, 0.25))
    for x, y in ((apex + 0.8, 0.0), (apex + 0.8, -0.6 * side), (apex + 0.4, -0.9 * side)):
        ranges = ray_distances(scene.walls, np.array([x, y]), headings)
        assert np.isfinite(ranges).all()
        ends = np.array([x, y]) + ranges[:, None] * np.column_stack((np.cos(headings), np.sin(headings)))
        on, back = side * ends[:, 1] > 1.11, ends[:, 0] < apex - 5.0
        back &= ~on
        assert on.any() and back.any()
        assert ranges[on].max() < 0.6 * ranges[back].max()
        bearings_on = np.abs(np.degrees(np.arctan2(np.sin(headings[on]), np.cos(headings[on]))))
        assert bearings_on[np.argmax(ranges[on])] > 90.0  # behind a car that has driven straight on


@pytest.mark.slow
@each("seed", (0, 1))
def test_in_the_chicane_the_wider_opening_is_for_robots_that_turn_on_the_spot(seed):
    """The car gets through the narrow one only, a holonomic robot as wide as the car through either."""
    scene = load("wrong_side_chicane", seed)
    second, beside_lane = scene.obstacles
    corners, walls = second.corners(), [*scene.walls, beside_lane]
    side = math.copysign(1.0, second.y)
    near = corners[np.argmin(side * corners[:, 1])]  # the corner between the two openings

    # measured: how far it is from the second barrier to the wall beside it, and to the first barrier
    sides = np.linspace(0.0, 1.0, 50)[:, None] * (np.roll(corners, -1, axis=0) - corners)[:, None]
    outline = (corners[:, None] + sides).reshape(-1, 2)
    beside = ray_distances(walls, near, np.array([-side * 0.5 * math.pi]))[0]
    wide = min(_distance_to(wall, outline) for wall in scene.walls if side * wall.y > 0.0)
    assert beside == pytest.approx(2.0 * WIDTH, abs=1e-6)
    assert 2.25 * WIDTH < wide < 2.31 * WIDTH

    # searched: what gets through when the other opening is shut
    x = float(near[0])
    narrow_shut = Box(x=x + 0.15, y=0.0, length=0.3, width=2.0 * WIDTH + 0.02)
    wide_shut = Box(x=x, y=side * 4.0, length=8.0, width=6.0)  # as far as a third of a metre above the lane
    start, goal = (x - 2.2, 0.0), (x + 2.5, 0.0)
    around = (x - 2.5, -3.6), (x + 3.0, 3.6)
    radius = TURNING_RADIUS
    wide_only = Clearances([*walls, second, narrow_shut], *around, 0.01)
    assert disc_gets_through(wide_only, start, goal, 0.5 * WIDTH + 0.05)
    assert not car_gets_through(wide_only, (*start, 0.0), goal[0], CAR, radius=radius, margin=-0.005)
    assert car_gets_through(wide_only, (*start, 0.0), goal[0], CAR, radius=0.5 * radius)  # it is the steering limit
    narrow_only = Clearances([*walls, second, wide_shut], *around, 0.01)
    assert car_gets_through(narrow_only, (*start, 0.0), goal[0], CAR, radius=radius, margin=0.05)


def _distance_to(box, points):
    cos, sin = math.cos(box.heading), math.sin(box.heading)
    away = (points - (box.x, box.y)) @ np.array([[cos, -sin], [sin, cos]])
    outside = np.maximum(np.abs(away) - (0.5 * box.length, 0.5 * box.width), 0.0)
    return float(np.hypot(*outside.T).min())


def test_walls_stand_outside_of_their_room_and_meet_at_its_corners():
    room = np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (2.0, 3.0), (1.0, 1.0), (0.0, 3.0)])  # one corner juts in
    walls = walls_round(room)
    for wall, a, b in zip(walls, room, np.roll(room, -1, axis=0), strict=True):
        along = (b - a) / math.dist(a, b)
        corners = wall.corners() - a
        aside = along[0] * corners[:, 1] - along[1] * corners[:, 0]
        assert sorted(aside) == pytest.approx([-0.1, -0.1, 0.0, 0.0], abs=1e-12)
        reach = corners @ along
        assert reach.min() < 0.08 and reach.max() > math.dist(a, b) - 0.08  # cut off where the corner is sharp
        pulled_back = wall.corners() + 1e-6 * (np.array([wall.x, wall.y]) - wall.corners())
        assert not Path(room).contains_points(pulled_back).any()
    field = Clearances(walls, (-0.5, -0.5), (4.5, 3.5), 0.01)
    assert not disc_gets_through(field, (2.0, 0.5), (-0.4, -0.4), 0.01)
