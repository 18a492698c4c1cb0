"""The frontier: in drawn worlds it is where the course goes, not behind the car, nor in what was seen to its end."""

import heapq
import math

import numpy as np
import pytest

from cases import each
from drawn_worlds import Driven, box, cell, kinds, least_of_blocks, lines, middles
from fg_mujoco.controllers.perception.frontiers import BLOCKS, FAR, WAY_BACK, cell_at, dijkstra, mark_cells
from fg_mujoco.controllers.perception.local_map import CELL, FREE, SIZE, WALL

STRAIGHT = lines([(-30.0, -1.0), (60.0, -1.0)], [(-30.0, 1.0), (60.0, 1.0)])


def junction(left_end, right_end):
    """A corridor that ends at x = 6.5 in one across it, which is closed at those distances to its left and right."""
    walls = lines([(-30.0, 1.0), (4.5, 1.0)], [(-30.0, -1.0), (4.5, -1.0)], [(6.5, -right_end), (6.5, left_end)])
    sides = lines([(4.5, 1.0), (4.5, left_end)], [(4.5, -1.0), (4.5, -right_end)])
    ends = lines([(4.5, left_end), (6.5, left_end)], [(4.5, -right_end), (6.5, -right_end)])
    return np.concatenate((walls, sides, ends))


def hairpin(pocket=0.0):
    """Two lanes of 1.6 m beside a barrier of 5 cm that ends at x = 6; the wall at the end is at 7.8 m, and a pocket."""
    outer = [(-30.0, -0.8), (7.8, -0.8), (7.8, -0.4), (7.8 + pocket, -0.4), (7.8 + pocket, 0.4), (7.8, 0.4)]
    outer += [(7.8, 2.45), (-30.0, 2.45)]
    return lines(outer, [(-30.0, 0.8), (6.0, 0.8), (6.0, 0.85), (-30.0, 0.85)])


def ahead(driven, distance, aside=0.0):
    """The way to go from a place ahead of the rear axle and to its left [m]."""
    cos, sin = math.cos(driven.heading), math.sin(driven.heading)
    return driven.distance_to_goal(driven.x + distance * cos - aside * sin, driven.y + distance * sin + aside * cos)


def goal(driven):
    """The middle of the frontier."""
    return float(driven.frontier["x"]), float(driven.frontier["y"])


def test_in_a_corridor_it_is_ahead_and_nearer_by_what_is_driven():
    driven = Driven(STRAIGHT)
    assert driven.frontier["found"] and not driven.frontier["hidden"]
    x, y = goal(driven)
    assert x > 7.0 and abs(y) < 0.3
    places = np.arange(0.85, 6.0, 0.5)
    distance_to_goal = np.array([driven.distance_to_goal(place, 0.0) for place in places])
    np.testing.assert_allclose(np.diff(distance_to_goal), -0.5, atol=0.011 + CELL)
    for _ in range(10):
        before, middle = ahead(driven, 1.0), goal(driven)[0]
        driven.go(0.5)
        assert goal(driven)[0] - middle == pytest.approx(0.5, abs=0.25)
        assert driven.distance_to_goal(driven.x + 0.5, 0.0) == pytest.approx(
            before + goal(driven)[0] - middle, abs=0.25
        )
        assert driven.distance_to_goal(driven.x + 3.0, 0.0) < driven.distance_to_goal(driven.x + 0.5, 0.0) - 2.3


def test_the_way_back_is_closed():
    driven = Driven(STRAIGHT)
    driven.go(8.0)
    free_behind = [x for x in np.arange(1.0, 7.3, 0.2) if kinds(driven.frontier["map"])[cell(x, 0.0)] == FREE]
    assert len(free_behind) > 20
    assert all(driven.distance_to_goal(x, y) == math.inf for x in free_behind for y in (-0.5, 0.0, 0.5))
    assert ahead(driven, 0.5) < math.inf


@each("open_side", [1, -1])
def test_at_a_junction_it_is_not_the_branch_that_is_seen_to_its_end(open_side):
    ends = (30.0, 3.0) if open_side == 1 else (3.0, 30.0)
    driven = Driven(junction(*ends))
    driven.go(4.0)
    driven.go(1.0)
    assert driven.frontier["found"] and open_side * goal(driven)[1] > 2.0
    at_open, at_closed = driven.distance_to_goal(5.5, 2.0 * open_side), driven.distance_to_goal(5.5, -2.0 * open_side)
    assert at_open < ahead(driven, 0.5) < at_closed


@each("pocket", [0.0, 1.5, 2.5])
def test_in_a_hairpin_it_is_beside_the_barriers_end_and_not_in_the_pocket(pocket):
    driven = Driven(hairpin(pocket))
    driven.go(4.5)
    assert driven.frontier["found"] and driven.frontier["hidden"]
    x, y = goal(driven)
    assert y > 0.8 and 5.0 < x < 7.8
    gap, deep = driven.distance_to_goal(6.6, 0.9), driven.distance_to_goal(7.3 + pocket, 0.1)
    assert gap < ahead(driven, 0.5) and gap < deep
    driven.go(1.5)
    driven.go(1.2, 1.2)
    assert goal(driven)[0] < 5.0 and goal(driven)[1] > 0.9  # along the other lane


def test_a_hall_that_is_seen_to_its_end_has_no_frontier_and_the_ground_behind_a_wall_is_one():
    left = [(-30.0, 1.0), (1.0, 1.0), (1.0, 3.0), (7.0, 3.0)]
    hall = lines(left + [(x, -y) for x, y in reversed(left)])
    closed, half = Driven(hall), Driven(np.concatenate((hall, lines(box(4.6, -3.0, 4.65, 0.5)))))
    for driven in (closed, half):
        driven.go(2.2)
    assert not closed.frontier["found"]
    assert half.frontier["found"]
    x, y = goal(half)
    assert x > 4.7 and y < 1.0


def slow_distances(world, bits, goal):
    """The way to go by Dijkstra's algorithm with a heap, on distances to walls worked out one by one [UNIT]."""
    x, y = middles(world)
    kind = kinds(world)
    index = {}
    for i, j in np.argwhere(np.isfinite(x + y)).tolist():
        index[math.floor(x[i, j] / CELL), math.floor(y[i, j] / CELL)] = i, j
    walls = {place for place, ring in index.items() if kind[ring] == WALL}

    def reaches(place, shape):
        return any((place[0] + a, place[1] + b) in walls for a, b in shape)

    def octagon(half, long):
        return [(a, b) for a in range(-half, half + 1) for b in range(-half, half + 1) if min(abs(a), abs(b)) <= long]

    plus, small = octagon(1, 0), octagon(2, 1)
    square_four, square_six = octagon(4, 4), octagon(6, 6)
    costs = {}

    def cost(place):
        if place not in costs:
            factor = [1.0, 1.5, 2.25][reaches(place, square_six) + reaches(place, square_four)]
            costs[place] = (factor, 2 if reaches(place, small) else 1)
        return costs[place]

    goals = [place for place, ring in index.items() if ring[0] * SIZE + ring[1] == goal]
    best = dict.fromkeys(goals, 0)
    heap = [(0, place) for place in goals]
    while heap:
        so_far, place = heapq.heappop(heap)
        if so_far > best[place]:
            continue
        for a in (-1, 0, 1):
            for b in (-1, 0, 1):
                to = place[0] + a, place[1] + b
                if (a, b) == (0, 0) or to not in index or kind[index[to]] != FREE:
                    continue
                if bits[index[to]] & WAY_BACK or reaches(to, plus):
                    continue
                factor, double = cost(to)
                length = 10 if a == 0 or b == 0 else 14
                step = {1.0: length, 1.5: length + length // 2}.get(factor, (length * 3 // 2) * 3 // 2) * double
                if so_far + step < best.get(to, 1 << 30):
                    best[to] = so_far + step
                    heapq.heappush(heap, (so_far + step, to))
    found = np.full((SIZE, SIZE), FAR)
    for place, value in best.items():
        found[index[place]] = value
    return found


@each(("walls", "distance"), [(hairpin(), 4.5), (junction(30.0, 3.0), 4.5), (STRAIGHT, 7.0)])
@pytest.mark.slow
def test_the_way_to_go_is_that_of_a_slow_search_with_a_heap(walls, distance):
    driven = Driven(walls)
    driven.go(distance)
    assert driven.frontier["found"]
    world, bits = driven.frontier["map"], np.zeros((SIZE, SIZE), np.uint8)
    free = mark_cells(world, bits)
    bits[np.arange(SIZE) % 50 < 2] |= np.uint8(WAY_BACK)
    goal, found = cell_at(driven.x + 1.0, driven.y), np.full(SIZE * SIZE, FAR, np.uint16)
    least = np.full((BLOCKS, BLOCKS), FAR, np.uint16)
    dijkstra(bits.ravel(), found, least, np.array([goal], np.uint16), free)
    expected = slow_distances(world, bits, goal)
    assert (expected != FAR).sum() > 300
    np.testing.assert_array_equal(found.reshape(SIZE, SIZE), expected)
    np.testing.assert_array_equal(least, least_of_blocks(expected))
