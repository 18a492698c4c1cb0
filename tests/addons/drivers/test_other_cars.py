"""Other cars in the scan: a box that moves is told from one that stands, and where it goes is measured.

The world is flat: a corridor, and a box of 12 x 12 cm, worked out beam by beam.
"""

import math

import numpy as np
import pytest

from cases import each
from fg_mujoco.addons.drivers.other_cars import OTHER_CARS, TOLD, find_boxes, follow_told, read_told, watch_cars
from fg_mujoco.addons.drivers.overtaker import Overtaker, hide_cars
from fg_mujoco.addons.drivers.passing import RACING
from fg_mujoco.controllers.perception.scan_filters import noise_of
from fg_mujoco.controllers.perception.scan_geometry import SCAN_GEOMETRY, geometry_values
from fg_mujoco.messages import Reading, columns_of_others
from moving_worlds import box, odometry_row, ranges_of
from scan_worlds import CAR, MU, corridor, scan_of

HALF = 0.06  # [m] of a box
PERIOD = 0.025
WALLS = corridor(1.4, 1.4, 12.0)


def with_box(x, y, heading):
    """Ranges of a scan of the corridor with a box at a place [m] and a heading [rad], as the LiDAR sees it."""
    cos, sin = math.cos(heading), math.sin(heading)
    sides = box(0.0, 0.0, 2.0 * HALF, 2.0 * HALF)
    turned = [[(x + cos * a - sin * b, y + sin * a + cos * b) for a, b in side] for side in sides]
    return np.minimum(WALLS.ranges, ranges_of(turned))


def record(kind, values):
    row = np.zeros(1, kind)
    for name, value in zip(kind.names, values, strict=True):
        row[0][name] = value
    return row[0]


CAR_ROW = Overtaker(CAR, MU).driver[0]["car"]
SCAN_ROW = record(SCAN_GEOMETRY, geometry_values(WALLS))


def watched(place, speed, ticks, own_speed, noise=0.0):
    """The memory after some ticks: the planner's car drives straight on, the box as `place` says by the time."""
    memory, rng = np.zeros(1, OTHER_CARS)[0], np.random.default_rng(5)
    seen = False
    for tick in range(ticks):
        time = tick * PERIOD
        x, y = place(time)
        ranges = with_box(x - own_speed * time, y, 0.0)
        scan = scan_of(ranges + rng.normal(0.0, noise, len(ranges)))
        seen = watch_cars(memory, SCAN_ROW, scan.ranges, odometry_row(own_speed), CAR.lidar_offset)
    return memory, seen


@each("x, y", [(1.2, -1.15), (0.7, 1.2), (2.5, 1.0)])
def test_a_car_next_to_a_wall_is_taken_out_of_the_scan(x, y):
    """The wall goes on straight behind it, where beams before and behind it meet the wall at very different ranges."""
    memory, ranges = np.zeros(1, RACING)[0], with_box(x, y, 0.0)
    car = memory["seen"]["cars"][0]
    car["age"], car["moves"], car["x"], car["y"] = 20, True, x, y
    hide_cars(memory, SCAN_ROW, ranges)
    assert ranges == pytest.approx(WALLS.ranges, rel=1e-9)


def test_a_box_is_found_where_it_is():
    rng = np.random.default_rng(3)
    found = np.zeros((16, 2))
    for _ in range(200):
        x, y, heading = rng.uniform(0.6, 7.0), rng.uniform(-1.0, 1.0), rng.uniform(-math.pi, math.pi)
        count = find_boxes(SCAN_ROW, with_box(x, y, heading), 0.005, found)
        assert count == 1, (x, y)
        assert math.hypot(found[0, 0] - x, found[0, 1] - y) < 0.05


@each("noise", [0.0, 0.005, 0.01, 0.02, 0.03])
def test_walls_are_no_boxes(noise):
    rng, found, measured = np.random.default_rng(4), np.zeros((16, 2)), []
    for _ in range(40):
        walls = WALLS.ranges + rng.normal(0.0, noise, len(WALLS.ranges))
        measured.append(noise_of(walls, WALLS.range_max))
        assert find_boxes(SCAN_ROW, walls, max(measured[-1], 0.005), found) == 0
    assert np.median(measured) == pytest.approx(noise, rel=0.05, abs=0.001)
    assert np.max(np.abs(np.array(measured) - noise)) < 0.3 * noise + 0.001


@pytest.mark.slow
@each("own_speed", [0.0, 4.0])
@each("noise, off", [(0.0, 0.2), (0.03, 0.4)])
def test_velocity_of_a_car_is_measured(noise, off, own_speed):
    memory, seen = watched(lambda time: (3.0 + 2.5 * time, 0.4 - 0.3 * time), 2.5, 40, own_speed, noise)
    assert seen
    (car,) = [car for car in memory["cars"] if car["moves"]]
    assert (car["vx"], car["vy"]) == pytest.approx((2.5, -0.3), abs=off)
    assert car["heading"] == pytest.approx(math.atan2(-0.3, 2.5), abs=0.4 * off)


@each("noise", [0.0, 0.01, 0.03])
def test_a_box_that_stands_is_no_car_however_the_planners_car_moves(noise):
    memory, seen = watched(lambda time: (5.0, 0.5), 0.0, 40, 4.0, noise)
    assert not seen
    assert not memory["cars"]["moves"].any()


# -- cars whose odometry is told


def told_of(*cars, stamp=1.0):
    """What a planner has been told: rows of x, y, heading, speed and yaw rate."""
    memory = np.zeros(1, TOLD)[0]
    values = np.array(cars, np.float64).ravel()
    stamps = np.empty(0)
    columns = columns_of_others(len(cars))
    reading = Reading(stamp=stamp, values=values, columns=columns, stamps=stamps, samples=np.empty((0, len(values))))
    read_told(memory, reading)
    return memory


def own_row(pose, stamp=1.0, speed=0.0):
    row = odometry_row(speed)
    row["stamp"], row["pose"] = stamp, pose
    return row


def followed(seen, told, pose, ranges=WALLS.ranges, stamp=1.0):
    """Whether there are cars, and where their middles are from the LiDAR, ahead and to the left [m]."""
    there = follow_told(seen, told, SCAN_ROW, np.array(ranges), own_row(pose, stamp), CAR_ROW)
    cos, sin = math.cos(seen["heading"]), math.sin(seen["heading"])
    places = {}
    for k, car in enumerate(seen["cars"]):
        if car["age"] > 0:
            dx, dy = car["x"] - seen["x"], car["y"] - seen["y"]
            places[k] = cos * dx + sin * dy, cos * dy - sin * dx
    return there, places


def on_circle(time, radius=5.0, speed=2.0):
    """Where a car is that drives a circle: pose, speed and yaw rate."""
    angle = speed * time / radius
    return radius * math.sin(angle), radius * (1.0 - math.cos(angle)), angle, speed, speed / radius


@each("late", [0.0, 0.1, 0.3])
def test_a_car_that_is_told_is_where_it_has_come_since(late):
    seen, pose = np.zeros(1, OTHER_CARS)[0], (-3.0, -0.2, 0.1)
    there, places = followed(seen, told_of(on_circle(1.0 - late), stamp=1.0 - late), pose)
    x, y, heading, speed, yaw_rate = on_circle(1.0)
    middle = 0.5 * CAR.length - CAR.rear_overhang
    dx, dy = x + middle * math.cos(heading) - pose[0], y + middle * math.sin(heading) - pose[1]
    ahead, left = (math.cos(0.1) * dx + math.sin(0.1) * dy - CAR.lidar_offset, math.cos(0.1) * dy - math.sin(0.1) * dx)
    assert there
    assert places[0] == pytest.approx((ahead, left), abs=2e-3)  # a chord in place of an arc
    car = seen["cars"][0]
    assert math.hypot(car["vx"], car["vy"]) == pytest.approx(speed)
    assert (car["heading"], car["turn_rate"]) == pytest.approx((heading - 0.1, yaw_rate))
    assert car["moves"]


def test_a_car_that_stands_is_known_at_once_and_one_behind_a_wall_is_not():
    seen = np.zeros(1, OTHER_CARS)[0]
    standing, next_door = (3.0, 0.3, 0.0, 0.0, 0.0), (3.0, 3.0, 0.0, 2.0, 0.0)
    there, places = followed(seen, told_of(next_door, standing), (0.0, 0.0, 0.0))
    assert there and len(places) == 1
    (ahead, left) = places[0]
    assert left == pytest.approx(0.3) and 2.5 < ahead < 3.5
    there, places = followed(seen, told_of(next_door), (0.0, 0.0, 0.0))
    assert not there and not places


def test_a_car_that_comes_back_does_not_take_the_place_of_another_one():
    pose, first, second, gone = (0.0, 0.0, 0.0), (2.0, 0.5, 0.0, 1.0, 0.0), (3.0, -0.5, 0.0, 1.0, 0.0), (math.nan,) * 5
    seen, told = np.zeros(1, OTHER_CARS)[0], told_of(first, gone)
    assert sorted(followed(seen, told, pose)[1]) == [0]
    told["cars"][:2] = gone, second
    assert sorted(followed(seen, told, pose)[1]) == [0]
    told["cars"][:2] = first, second
    places = followed(seen, told, pose)[1]
    assert sorted(left for _, left in places.values()) == pytest.approx([-0.5, 0.5])
