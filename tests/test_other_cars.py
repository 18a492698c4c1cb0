"""Other cars in the scan: a box that moves is told from one that stands, and where it goes is measured.

The world is flat: a corridor, and a box of 12 x 12 cm, worked out beam by beam.
"""

import math

import numpy as np
import pytest
from scan_worlds import CAR, corridor, odometry_of, scan_of

from fg_mujoco.controllers.perception.other_cars import OTHER_CARS, find_boxes, watch_cars
from fg_mujoco.controllers.perception.scan_geometry import SCAN, scan_values
from fg_mujoco.messages import ODOMETRY

HALF = 0.06  # [m] of a box
PERIOD = 0.025
WALLS = corridor(1.4, 1.4, 12.0)


def with_box(x, y, heading):
    """Ranges of a scan of the corridor with a box at a place [m] and a heading [rad], as the LiDAR sees it."""
    bearings = WALLS.bearings
    cos, sin = math.cos(heading), math.sin(heading)
    origin = np.array([-cos * x - sin * y, sin * x - cos * y])  # of the LiDAR, in the frame of the box
    towards = np.stack((np.cos(bearings - heading), np.sin(bearings - heading)))
    with np.errstate(divide="ignore", invalid="ignore"):
        sides = (np.array([[-HALF], [HALF]])[:, :, np.newaxis] - origin[np.newaxis, :, np.newaxis]) / towards
    enter, leave = sides.min(axis=0).max(axis=0), sides.max(axis=0).min(axis=0)
    hit = np.where((enter <= leave) & (enter > 0.0), enter, math.inf)
    return np.minimum(WALLS.ranges, hit)


def record(kind, values):
    row = np.zeros(1, kind)
    for name, value in zip(kind.names, values, strict=True):
        row[0][name] = value
    return row[0]


SCAN_ROW = record(SCAN, scan_values(WALLS))


def odometry_row(speed):
    return record(ODOMETRY, [getattr(odometry_of(speed), name) for name in ODOMETRY.names])


def watched(place, speed, ticks, own_speed):
    """The memory after some ticks: the planner's car drives straight on, the box as `place` says by the time."""
    memory = np.zeros(1, OTHER_CARS)[0]
    seen = False
    for tick in range(ticks):
        time = tick * PERIOD
        x, y = place(time)
        scan = scan_of(with_box(x - own_speed * time, y, 0.0))
        seen = watch_cars(memory, SCAN_ROW, scan.ranges, odometry_row(own_speed), CAR.lidar_offset)
    return memory, seen


def test_a_box_is_found_where_it_is():
    rng = np.random.default_rng(3)
    found = np.zeros((16, 2))
    for _ in range(200):
        x, y, heading = rng.uniform(0.6, 7.0), rng.uniform(-1.0, 1.0), rng.uniform(-math.pi, math.pi)
        count = find_boxes(SCAN_ROW, with_box(x, y, heading), found)
        assert count == 1, (x, y)
        assert math.hypot(found[0, 0] - x, found[0, 1] - y) < 0.05


def test_walls_are_no_boxes():
    assert find_boxes(SCAN_ROW, np.array(WALLS.ranges), np.zeros((16, 2))) == 0


@pytest.mark.slow
@pytest.mark.parametrize("own_speed", [0.0, 4.0])
def test_velocity_of_a_car_is_measured(own_speed):
    memory, seen = watched(lambda time: (3.0 + 2.5 * time, 0.4 - 0.3 * time), 2.5, 40, own_speed)
    assert seen
    (car,) = [car for car in memory["cars"] if car["age"] > 0]
    assert (car["vx"], car["vy"]) == pytest.approx((2.5, -0.3), abs=0.2)
    assert car["heading"] == pytest.approx(math.atan2(-0.3, 2.5), abs=0.08)


def test_a_box_that_stands_is_no_car_however_the_planners_car_moves():
    memory, seen = watched(lambda time: (5.0, 0.5), 0.0, 40, 4.0)
    assert not seen
    assert not memory["cars"]["moves"].any()


def test_a_car_that_stops_stays_a_car():
    memory, seen = watched(lambda time: (3.0 + 2.0 * min(time, 0.5), 0.3), 2.0, 60, 0.0)
    assert seen
    (car,) = [car for car in memory["cars"] if car["age"] > 0]
    assert math.hypot(car["vx"], car["vy"]) < 0.3


@pytest.mark.slow
def test_a_car_that_is_gone_from_plain_view_is_forgotten_soon():
    memory, seen = watched(lambda time: (3.0 + 2.5 * time, 0.0), 2.5, 20, 0.0)
    assert seen
    for _ in range(8):
        seen = watch_cars(memory, SCAN_ROW, np.array(WALLS.ranges), odometry_row(0.0), CAR.lidar_offset)
    assert not seen


def test_a_car_that_was_passed_is_kept_for_a_while():
    memory, seen = watched(lambda time: (0.6, 0.6), 0.0, 1, 0.0)
    memory, seen = watched(lambda time: (1.0 + 1.0 * time, 0.6), 1.0, 56, 3.0)  # 1.8 m nearer: behind the view
    assert memory["cars"]["moves"].any()
    (car,) = [car for car in memory["cars"] if car["moves"]]
    assert car["unseen"] > 0.0 and seen


def test_odometry_that_is_none_forgets_all():
    memory, _ = watched(lambda time: (3.0 + 2.5 * time, 0.0), 2.5, 20, 0.0)
    assert not watch_cars(memory, SCAN_ROW, np.array(WALLS.ranges), odometry_row(math.nan), CAR.lidar_offset)
    assert (memory["cars"]["age"] == 0).all()
    assert math.isfinite(memory["x"])
