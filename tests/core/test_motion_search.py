"""The motion search: arcs that the car can drive at its speed, clear of walls, to the frontier and round U-turns."""

import itertools
import math

import numpy as np
import pytest

from cases import each
from drawn_worlds import least_of_blocks
from fg_mujoco.controllers.perception.frontiers import FAR, FRONTIER_SEARCH
from fg_mujoco.controllers.perception.local_map import CELL, FREE, RING, SIZE, WALL, WALL_IN_1, WALL_IN_2
from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter, longitudinal_share
from fg_mujoco.controllers.safety.motions import MOST_NODES, MOTION, Query, search_motion, sorted_ends, touches
from scan_worlds import CAR, MU

LIMITER = FrictionLimiter(CAR, MU)
TIGHTEST = math.tan(CAR.max_steering_angle) / CAR.wheelbase
GRIP = 0.85
NODES = 16000  # of a search; in a tick there are fewer
AT = np.arange(-120, 121)
X, Y = np.meshgrid((AT + 0.5) * CELL, (AT + 0.5) * CELL, indexing="ij")
INDEX = np.ix_(AT & RING, AT & RING)


def grown(walls, shape):
    """Cells that have a wall at one of the offsets of a shape."""
    return np.any([np.roll(walls, offset, (0, 1)) for offset in shape], axis=0)


def offsets(half, least):
    """Offsets up to `half` cells along each axis, and up to `least` along one of them."""
    across = range(-half, half + 1)
    return [(a, b) for a in across for b in across if min(abs(a), abs(b)) <= least]


def world(walls, goal):
    """The memory of a car at x = 0, y = 0 along x that knows its walls (of the shape of X) and all ground around.

    The way to go is the length of the shortest way among cells that share a side, clear of walls by a cell.
    """
    way = np.zeros(1, FRONTIER_SEARCH)[0]
    way["found"], way["nodes"] = True, MOST_NODES - NODES
    at, near = grown(walls, offsets(1, 0)), grown(walls, offsets(2, 1))
    way["map"]["cells"][INDEX] = np.where(walls, WALL, FREE) | np.where(at, WALL_IN_1, near * WALL_IN_2)
    way["distance_to_goal"][:] = FAR
    distance_to_goal = np.full(X.shape, FAR)
    front = np.hypot(X - goal[0], Y - goal[1]) < 0.15
    length = 0
    while front.any():
        distance_to_goal[front] = length
        length += int(100 * CELL)
        front = grown(front, offsets(1, 0)) & (distance_to_goal == FAR) & ~at
        front[[0, -1], :] = front[:, [0, -1]] = False
    fine = np.full((SIZE, SIZE), FAR)
    fine[INDEX] = distance_to_goal
    way["distance_to_goal"] = least_of_blocks(fine)
    return way


def u_turn(lane, barrier=0.1):
    """Two lanes beside a barrier along x that ends at x = 1, between y = lane / 2 and that and its own width."""
    low, high = 0.5 * lane, 0.5 * lane + barrier
    inside = (-0.5 * lane < Y) & (high + lane > Y) & (X > -4.0) & (1.0 + max(lane, 1.2) > X)
    return ~inside | ((X < 1.0) & (low < Y) & (high > Y))


def search(way, speed=0.0, reverses=False, nearest=WALL_IN_2, nodes=NODES):
    motion = np.zeros(1, MOTION)[0]
    query = Query(0.0, speed, 0.0, GRIP, 0.97, 100.0, nearest, reverses, nodes)
    found = search_motion(way, LIMITER.record[0], motion, query)
    assert found == motion["found"]
    return motion


def poses(motion):
    """x, y, heading, curvature and direction of all points, and of the start."""
    return np.concatenate((np.array([[0.0, 0.0, 0.0, 0.0, 1.0]]), motion["points"][: motion["count"]]))


def in_walls(walls, way, places):
    """How far the nearest middle of a wall's cell is from three discs' middles, at each pose [m]."""
    middles = np.column_stack((X[walls], Y[walls]))
    middles = middles[np.hypot(*middles.T) < 8.0]
    back, front = 0.5 * CAR.width - CAR.rear_overhang, CAR.length - CAR.rear_overhang - 0.5 * CAR.width
    least = []
    for x, y, heading in places[:, :3]:
        for disc in (back, 0.5 * (back + front), front):
            least.append(np.hypot(*(middles - (x + disc * math.cos(heading), y + disc * math.sin(heading))).T).min())
    return np.array(least)


OPEN = np.abs(Y) > 5.0
WORLDS = {
    "straight on": (OPEN, (6.0, 0.0), 4.0),
    "aside": (OPEN, (4.0, 3.0), 3.0),
    "slalom": (OPEN | ((np.abs(X - 2.5) < 0.1) & (Y < 0.4)) | ((np.abs(X - 5.0) < 0.1) & (Y > -0.4)), (7.0, -1.0), 2.0),
    "wide U-turn": (u_turn(1.8), (-1.0, 1.9), 2.0),
}


@each("name", WORLDS)
@each("reverses", [False, True])
def test_motions_are_arcs_of_their_curvature_within_full_lock_and_grip(name, reverses):
    walls, goal, speed = WORLDS[name]
    way = world(walls, goal)
    motion = search(way, speed, reverses=reverses)
    assert motion["found"] and motion["count"] > 5
    places = poses(motion)
    square, slowest = speed**2, GRIP * LIMITER.lateral / (0.97 * TIGHTEST)
    share_before = 0.0
    for before, after in itertools.pairwise(places):
        x, y, heading, curvature, direction = after
        chord = math.hypot(x - before[0], y - before[1])
        turned = heading - before[2]
        towards = math.atan2(y - before[1], x - before[0]) + (math.pi if direction < 0 else 0.0)
        assert math.cos(towards - before[2] - 0.5 * turned) == pytest.approx(1.0, abs=1e-9)
        arc = turned / curvature if curvature != 0.0 else chord * direction
        assert arc * direction > 0.0
        exact = 2.0 / abs(curvature) * math.sin(0.5 * abs(turned)) if curvature != 0.0 else chord
        assert chord == pytest.approx(exact, rel=turned**2 / 20.0 + 1e-9)  # of an arc; up to the third order
        assert chord == pytest.approx(0.2 + 0.05 * math.sqrt(square))
        assert abs(curvature) <= TIGHTEST and square * abs(curvature) <= GRIP * LIMITER.lateral + 1e-9
        share = curvature / min(0.97 * TIGHTEST, GRIP * LIMITER.lateral / max(square, 1e-3))
        assert 2.0 * share == pytest.approx(round(2.0 * share), abs=1e-6)  # all, half or none
        assert abs(share - share_before) < 0.51 or direction != before[4]
        braking = 0.65 * LIMITER.braking * longitudinal_share(LIMITER.record[0], GRIP * abs(share), True)
        square, share_before = max(square - 2.0 * braking * chord, min(square, slowest)), share


@each("name", WORLDS)
def test_motions_are_clear_of_walls_and_end_at_the_frontier(name):
    walls, goal, speed = WORLDS[name]
    way = world(walls, goal)
    places = poses(search(way, speed))
    assert in_walls(walls, way, places).min() > 2.0 * CELL
    x, y, heading = places[-1, :3]
    lidar = x + CAR.lidar_offset * math.cos(heading), y + CAR.lidar_offset * math.sin(heading)
    assert math.hypot(lidar[0] - goal[0], lidar[1] - goal[1]) < 0.35 + 0.15 + CELL


def test_a_u_turn_that_is_wide_is_turned_forward():
    motion = search(world(u_turn(1.8), (-1.0, 1.9)))
    assert motion["found"]
    places = poses(motion)
    assert (places[:, 4] == 1.0).all() and abs(places[-1, 2]) > 2.5
    assert places[:, 1].max() - places[:, 1].min() > 2.0 / TIGHTEST * 0.75


def test_a_u_turn_that_is_narrower_than_the_turning_circle_is_turned_in_reverse_too_and_never_forward():
    """A rear axle that turns by 180 degrees goes twice the least radius aside, and the car is half its width wider."""
    lane = 0.8
    assert 2.0 * lane + 0.1 < 2.0 / TIGHTEST + CAR.width
    for speed in (0.0, 1.0):
        assert not search(world(u_turn(lane), (-1.5, 0.9)), speed)["found"]
    motion = search(world(u_turn(lane), (-1.5, 0.9)), reverses=True, nearest=WALL_IN_1)
    assert motion["found"]
    places = poses(motion)
    assert (places[1:, 4] == -1.0).any() and places[-1, 4] == 1.0
    assert abs(places[-1, 2]) > 2.5


def test_a_car_in_contact_leaves_the_wall_and_is_clear_after_that():
    """Its right side is at a wall; the ends of beams lie 1 cm beside its outline."""
    walls = OPEN | (-0.5 * CAR.width > Y)
    way = world(walls, (4.0, 1.0))
    ends = np.column_stack((np.linspace(-1.0, 1.0, 100), np.full(100, -0.5 * CAR.width - 0.01)))
    way["map"]["ends"][:100], way["map"]["ends_known"] = ends, 100
    places, car = sorted_ends(way["map"], 100), LIMITER.record[0]["car"]
    assert touches(places, car, 0.0, 0.0, 1.0, 0.0, 0.03)
    assert not touches(places, car, 0.0, 0.0, 1.0, 0.0, 0.005)
    motion = search(way)
    assert motion["found"]
    for x, y, heading in poses(motion)[1:, :3]:
        assert not touches(places, car, x, y, math.cos(heading), math.sin(heading), 0.0)
    assert in_walls(walls, way, poses(motion)[-3:]).min() > 2.0 * CELL


@each("reverses", [False, True])
def test_the_nodes_of_searches_are_counted_and_no_more_than_allowed(reverses):
    way = world(u_turn(0.8), (-1.5, 0.9))
    counts = []
    for nodes in (100, 300):
        before = int(way["nodes"])
        search(way, reverses=reverses, nodes=nodes)
        counts.append(int(way["nodes"]) - before)
        assert 0 < counts[-1] <= nodes
    assert counts[0] < counts[1] or not reverses
