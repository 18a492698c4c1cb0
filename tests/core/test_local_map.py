"""The local map: where the car is, by dead reckoning, which cells are free or walls, and the path with its room."""

import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cases import each
from drawn_worlds import BEARINGS, GEOMETRY, PERIOD, box, cell, kinds, lines, middles, seen_from
from fg_mujoco.controllers.control.planner_settings import CAR_RECORD, record_values
from fg_mujoco.controllers.perception.local_map import (
    ALONG,
    CELL,
    FREE,
    LEFT,
    LOCAL_MAP,
    PATH,
    RIGHT,
    UNKNOWN,
    WALL,
    cut_path,
    enter_scan,
    extend_path,
    in_window,
    move,
)
from fg_mujoco.controllers.safety.motions import sorted_ends, touches
from scan_worlds import CAR

ROOM = lines(box(-2.05, -1.55, 4.05, 2.05))
OPEN = np.full(len(BEARINGS), 30.0)
NOTHING = np.zeros(len(BEARINGS))


def new():
    memory = np.zeros(1, LOCAL_MAP)[0]
    move(memory, 0.0, 0.0, PERIOD)
    return memory


def drive(memory, distance, yaw_rate=0.0, speed=2.0):
    """Drive so far [m], in reverse if negative."""
    for _ in range(round(abs(distance) / (speed * PERIOD))):
        move(memory, math.copysign(speed, distance), yaw_rate, PERIOD)


def see(memory, ranges):
    enter_scan(memory, GEOMETRY, ranges, CAR.lidar_offset)


def see_walls(memory, walls):
    """Enter the scan of walls from where the map says that the car is."""
    x, y, heading = (float(memory[name]) for name in ("x", "y", "heading"))
    offset = CAR.lidar_offset
    see(memory, seen_from(walls, x + offset * math.cos(heading), y + offset * math.sin(heading), heading + BEARINGS))


def beside(right, left):
    """Ranges in a straight corridor, by its walls' distances from the LiDAR [m]."""
    return seen_from(lines([(-50.0, -right), (50.0, -right)], [(-50.0, left), (50.0, left)]), 0.0, 0.0, BEARINGS)


def newest(memory):
    return memory["path"][memory["newest"]]


@each("side", [1.0, -1.0])
@each("wall", [0.16, 0.17, 0.18])
def test_a_rear_corner_that_turns_into_a_wall_that_no_beam_sees_any_more_touches_it(side, wall):
    """The car has driven along the wall, and turns its nose away from it about its rear axle.

    Ends of beams 3 cm apart may lie to both sides of a corner: then it is in the wall by up to half of that.
    """
    memory, row = new(), np.array([record_values(CAR)], CAR_RECORD)[0]
    for _ in range(24):
        see_walls(memory, lines([(-5.0, side * wall), (5.0, side * wall)]))
        drive(memory, 0.05)
    for turned in np.arange(0.0, 0.8, 0.02):
        corner = CAR.rear_overhang * math.sin(turned) + 0.5 * CAR.width * math.cos(turned)
        if not wall - 0.001 < corner < wall + 0.016:
            heading, ends = memory["heading"] - side * turned, sorted_ends(memory, int(memory["ends_known"]))
            at = memory["x"], memory["y"], math.cos(heading), math.sin(heading)
            assert touches(ends, row, *at, 0.0) == (corner > wall), turned


@each("sign", [1.0, -1.0])
def test_a_circle_is_where_its_closed_form_says(sign):
    speed, yaw_rate, ticks = 2.0 * sign, 1.6, 110
    memory = new()
    for tick in range(1, ticks + 1):
        move(memory, speed, yaw_rate, PERIOD)
        turned = yaw_rate * PERIOD * tick
        place = speed / yaw_rate * math.sin(turned), speed / yaw_rate * (1.0 - math.cos(turned))
        assert (memory["x"], memory["y"]) == pytest.approx(place, abs=3e-4)
        assert memory["heading"] == pytest.approx(turned)
    assert memory["driven"] == pytest.approx(2.0 * PERIOD * ticks)


@each(("yaw", "ahead"), [(0.0, 0.0), (0.6, 0.8), (-2.3, 0.5)])
def test_a_room_is_free_within_its_walls_are_walls_and_what_is_beyond_is_unknown(yaw, ahead):
    memory = new()
    move(memory, 0.0, yaw / PERIOD, PERIOD)
    drive(memory, ahead)
    see_walls(memory, ROOM)
    x, y = middles(memory)
    heading, offset = float(memory["heading"]), CAR.lidar_offset
    away_x, away_y = x - memory["x"] - offset * math.cos(heading), y - memory["y"] - offset * math.sin(heading)
    bearing = (np.arctan2(away_y, away_x) - heading + math.pi) % (2.0 * math.pi) - math.pi
    distance = np.hypot(away_x, away_y)
    visible = np.abs(bearing) + np.arctan2(CELL, distance) < BEARINGS[-1]
    depth = np.minimum.reduce([x + 2.05, 4.05 - x, y + 1.55, 2.05 - y])  # into the room; negative outside of it
    cells = kinds(memory)
    inside = visible & (depth > 1.5 * CELL) & (distance > 2.0 * CELL)
    assert inside.sum() > 500 and (cells[inside] == FREE).all()
    walls = visible & (np.abs(depth) < 0.01)
    assert walls.sum() > 100 and (cells[walls] == WALL).all()
    assert (cells[~(depth > -1.1 * CELL)] == UNKNOWN).all()
    assert (cells[np.abs(bearing) > BEARINGS[-1] + np.arctan2(1.5 * CELL, distance)] != FREE).all()


def test_what_moved_on_is_forgotten_when_its_place_is_seen_through_and_not_before():
    memory = new()
    post = np.where(np.abs(BEARINGS) < 0.1, 2.0, 6.0)
    see(memory, post)
    place, behind = cell(CAR.lidar_offset + 2.02, 0.02), cell(CAR.lidar_offset + 4.0, 0.02)
    assert kinds(memory)[place] == WALL and kinds(memory)[behind] == UNKNOWN
    see(memory, np.where(np.abs(BEARINGS) < 0.1, 1.0, 6.0))  # it is hidden
    assert kinds(memory)[place] == WALL and kinds(memory)[behind] == UNKNOWN
    see(memory, np.full(len(BEARINGS), 6.0))
    assert kinds(memory)[place] == FREE and kinds(memory)[behind] == FREE
    see(memory, post)
    assert kinds(memory)[place] == WALL and kinds(memory)[behind] == FREE


def test_cells_are_known_for_sixteen_metres_and_at_most_for_eighteen():
    memory = new()
    see(memory, OPEN)
    far = cell(6.0, 3.0)
    assert kinds(memory)[far] == FREE
    for _ in range(round(15.9 / 0.05)):
        drive(memory, 0.05, 2.0)  # round in a circle of 1 m
        see(memory, NOTHING)
    assert kinds(memory)[far] == FREE
    for _ in range(round(2.15 / 0.05) + 16):  # eighteen, and until all rows have been searched
        drive(memory, 0.05, 2.0)
        see(memory, NOTHING)
    assert kinds(memory)[far] == UNKNOWN and in_window(memory, 60, 30)


def test_cells_that_left_the_window_come_back_unknown():
    memory = new()
    see(memory, OPEN)
    gone, kept = cell(-4.5, 7.5), cell(0.0, 7.5)
    assert kinds(memory)[gone] == kinds(memory)[kept] == FREE
    drive(memory, 7.7)  # less than after which cells are too old
    assert kinds(memory)[gone] == FREE and in_window(memory, -45, 75)
    drive(memory, 1.0)
    assert not in_window(memory, -45, 75)
    drive(memory, -2.0)
    assert in_window(memory, -45, 75) and kinds(memory)[gone] == UNKNOWN and kinds(memory)[kept] == FREE


@each("motion", [(math.nan, 0.0), (1.0, math.nan), (math.inf, 0.0), (-math.inf, 1.0)])
def test_odometry_that_is_no_number_leaves_the_map_as_it_is(motion):
    memory = new()
    see(memory, OPEN)
    drive(memory, 1.0)
    before = memory.tobytes()
    move(memory, *motion, PERIOD)
    assert memory.tobytes() == before
    move(memory, 1.0, 0.0, PERIOD)
    assert memory.tobytes() != before


@each("distance", [30.0, -1000.0, 1e7])
def test_after_a_jump_nothing_is_known_but_what_is_seen_then(distance):
    memory = new()
    see_walls(memory, ROOM)
    move(memory, distance / PERIOD, 0.0, PERIOD)
    assert memory["x"] == pytest.approx(distance) and not memory["cells"].any()
    see(memory, OPEN)
    assert kinds(memory)[cell(distance + 3.0, 0.0)] == FREE


@pytest.mark.slow
def test_a_speed_that_no_integer_holds_does_not_hang():
    command = "from test_local_map import PERIOD, move, new; move(new(), 1e22, 0.0, PERIOD)"
    here = Path(__file__).parent
    environment = {**os.environ, "PYTHONPATH": str(here.with_name("worlds"))}
    subprocess.run([sys.executable, "-c", command], cwd=here, env=environment, check=True, timeout=240)


@each(("right", "left"), [(0.8, 1.3), (1.3, 0.8), (0.4, 2.0), (9.0, 0.5)])
def test_the_room_beside_the_path_is_that_of_the_corridor_up_to_three_metres(right, left):
    memory = new()
    for _ in range(5):
        extend_path(memory, GEOMETRY, beside(right, left))
        drive(memory, 0.15)
    point = newest(memory)
    assert (point[RIGHT], point[LEFT]) == pytest.approx((min(right, 3.0), min(left, 3.0)), rel=0.01)


def test_a_path_that_is_cut_ends_before_the_cut_and_goes_on_from_there():
    memory = new()
    for _ in range(60):
        extend_path(memory, GEOMETRY, beside(1.0, 1.0))
        drive(memory, 0.15)
    cut, furthest, known = float(memory["along"]) - 3.0, float(memory["furthest"]), int(memory["known"])
    kept = [float(memory["path"][(memory["newest"] - k) % PATH][ALONG]) for k in range(known)]
    cut_path(memory, cut)
    assert memory["known"] == sum(along <= cut for along in kept) < known
    assert cut - 0.16 < newest(memory)[ALONG] <= cut and memory["along"] == pytest.approx(cut)
    assert memory["furthest"] == furthest
    drive(memory, 0.15)
    extend_path(memory, GEOMETRY, beside(1.0, 1.0))
    assert newest(memory)[0] == pytest.approx(memory["x"])
    cut_path(memory, -100.0)
    assert memory["known"] == 1
