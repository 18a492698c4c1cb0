"""Other cars are followed or passed: the way of a car, what is decided about it, the speed, and the lane beside it.

Walls are those of a straight corridor or of a ring, whose ways are known in closed form.
"""

import math

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.drivers.corridor import (
    HEADING,
    LEFT,
    RIGHT,
    STEP,
    X,
    Y,
    ground_points,
    room_beside,
    walk,
)
from fg_mujoco.addons.drivers.overtaker import Overtaker
from fg_mujoco.addons.drivers.passing import DROPS_BACK, FOLLOWS, PASSES, RACING, choose, predict_cars, take_lane
from fg_mujoco.controllers.control.driving import REFERENCE
from fg_mujoco.controllers.perception.scan_geometry import geometry_record
from fg_mujoco.controllers.safety.predictions import CURVATURE, PREDICTIONS, meets
from scan_worlds import CAR, MU, corridor

PLANNER = Overtaker(CAR, MU)
SETTINGS, DRIVER = PLANNER.settings_row[0], PLANNER.driver[0]
DRIVEN_CAR = DRIVER["car"]
POINTS = 768  # of the walls, at most


def points_of(left, right):
    scan = corridor(left, right)
    points = np.empty((POINTS, 2))
    return points, ground_points(geometry_record(scan)[0], np.array(scan.ranges), points)


def ring(radius, half_width):
    """Points of the walls of a ring to the left, through whose middle the LiDAR drives."""
    turns = np.linspace(0.0, 2.0 * math.pi, 180, endpoint=False)
    points = np.empty((POINTS, 2))
    for k, wall in enumerate((radius - half_width, radius + half_width)):
        points[180 * k : 180 * (k + 1)] = np.stack((wall * np.sin(turns), radius - wall * np.cos(turns)), axis=1)
    return points, 360


def decided(ahead, left, speed, width, own_side=0.0, before=FOLLOWS):
    """What is decided about a car that drives along a corridor, and the greatest speed."""
    memory, scan = np.zeros(1, RACING)[0], corridor(0.5 * width - own_side, 0.5 * width + own_side)
    car = memory["seen"]["cars"][0]
    car["age"], car["moves"], car["x"], car["y"], car["vx"] = 20, True, ahead, left, speed
    memory["passing"][0]["what"], memory["passing"][0]["side"] = before, 1
    limit = choose(memory, geometry_record(scan)[0], np.array(scan.ranges), DRIVEN_CAR, SETTINGS)
    return memory, limit


def test_room_in_a_corridor_is_the_distance_to_its_walls():
    points, count = points_of(1.2, 0.7)
    assert room_beside(points, count, 2.0, 0.3, 0.0) == pytest.approx((0.9, 1.0), abs=0.01)
    assert room_beside(points, count, 2.0, -0.2, 0.0) == pytest.approx((1.4, 0.5), abs=0.01)


def test_a_walk_along_a_corridor_keeps_its_side():
    points, count = points_of(1.2, 0.7)
    path = np.empty((12, 5))
    assert walk(points, count, 1.0, 0.5, 0.1, path) == 12
    assert path[-1, Y] == pytest.approx(0.5, abs=0.05) and path[-1, HEADING] == pytest.approx(0.0, abs=0.05)
    assert path[-1, X] == pytest.approx(1.0 + 11 * STEP, abs=0.05)
    assert (path[-1, LEFT], path[-1, RIGHT]) == pytest.approx((0.7, 1.2), abs=0.06)


@each("radius", [2.5, 4.0])
def test_a_walk_goes_round_a_bend(radius):
    points, count = ring(radius, 1.0)
    path = np.empty((12, 5))
    assert walk(points, count, 0.0, 0.0, 0.0, path) == 12
    from_middle = np.hypot(path[:, X], path[:, Y] - radius)
    assert from_middle == pytest.approx(radius, abs=0.12)
    assert path[-1, HEADING] == pytest.approx(11 * STEP / radius, abs=0.15)


def test_a_car_is_passed_where_there_is_room_and_followed_where_there_is_none():
    for width, what in ((2.4, PASSES), (1.2, FOLLOWS)):
        memory, _ = decided(2.0, 0.0, 2.0, width)
        assert memory["passing"][0]["what"] == what
    memory, _ = decided(2.0, -0.4, 2.0, 2.0)
    assert memory["passing"][0]["side"] == 1  # the wider one


def test_a_car_behind_another_could_stop_should_that_one_brake():
    """The speed is the one from which both stop at the distance that is to be kept, by their own braking."""
    middle = CAR.lidar_offset - (0.5 * CAR.length - CAR.rear_overhang)
    for ahead, speed in ((1.5, 2.0), (2.5, 3.0), (0.9, 1.0)):
        _, limit = decided(ahead, 0.0, speed, 1.2)
        gap = ahead + middle - CAR.length
        stops = 0.1 * limit + limit**2 / (2.0 * SETTINGS["slowing"])
        assert stops == pytest.approx(gap - SETTINGS["behind"] + speed**2 / (2.0 * SETTINGS["braking"]), abs=1e-6)


def test_a_pass_is_given_up_before_the_car_is_beside_and_not_after():
    assert decided(0.3, -0.5, 2.0, 1.5, before=PASSES)[0]["passing"][0]["what"] == PASSES
    assert decided(0.4, -0.05, 2.0, 0.8, before=PASSES)[0]["passing"][0]["what"] == DROPS_BACK
    assert decided(1.5, 0.0, 2.0, 1.0, before=PASSES)[0]["passing"][0]["what"] == FOLLOWS


def test_a_pass_is_given_up_after_five_seconds_if_the_car_does_not_come_beside_the_other_one():
    memory = decided(2.0, 0.0, 2.0, 2.0)[0]
    scan = corridor(1.0, 1.0)
    done = []
    for _ in range(250):
        choose(memory, geometry_record(scan)[0], np.array(scan.ranges), DRIVEN_CAR, SETTINGS)
        done.append(memory["passing"][0]["what"])
    assert set(done[:195]) == {PASSES} and FOLLOWS in done[195:210]


def test_a_lane_leads_beside_the_other_car_as_far_as_there_is_room():
    reference = np.zeros(1, REFERENCE)[0]
    to_wall = 1.0 - 0.5 * CAR.width - SETTINGS["beside_wall"]
    for other, left in ((-0.3, -0.3 + CAR.width + SETTINGS["aside"]), (0.0, to_wall)):
        take_lane(decided(1.5, other, 2.0, 2.0)[0], 3.0, DRIVER, SETTINGS, reference)
        assert reference["lane_points"] > 5 and reference["steering_angle"] > 0.0
        assert reference["lane"][reference["lane_points"] - 1, 1] == pytest.approx(left, abs=0.03)
    assert not decided(1.5, 0.0, 2.0, 1.0)[0]["passing"][0]["what"]
    reference["lane_points"] = 0
    take_lane(decided(1.5, 0.0, 2.0, 1.0)[0], 3.0, DRIVER, SETTINGS, reference)
    assert reference["lane_points"] == 0


def test_a_car_beside_is_predicted_as_large_as_it_is_and_one_behind_is_not():
    predictions = np.zeros(1, PREDICTIONS)[0]
    predict_cars(decided(0.4, -0.6, 2.0, 2.4)[0], DRIVEN_CAR, 5.0, predictions)
    rows = predictions["rows"][: predictions["count"]]
    assert predictions["cars"] == len(rows) == 3
    assert meets(rows, 0.4, -0.6 + CAR.width - 0.01, 0.5 * CAR.width, 0.0)
    assert not meets(rows, 0.4, -0.6 + CAR.width + 0.02, 0.5 * CAR.width, 0.0)
    assert np.abs(rows[:, CURVATURE]).max() < 0.05
    behind = np.zeros(1, PREDICTIONS)[0]
    predict_cars(decided(-0.6, -0.6, 2.0, 2.4)[0], DRIVEN_CAR, 5.0, behind)
    assert behind["count"] == 0


@pytest.mark.slow
@each("track, settings",
      [("chicanes", {}),
       ("chicanes", {"obstacles": 6, "lidar_noise": 0.03}),
       ("l_corridor", {"obstacles": 6, "obstacle_seed": 20, "lidar_noise": 0.03, "seed": 0})])  # fmt: skip
def test_alone_the_overtaker_is_the_gap_finder_that_predicts_nothing_to_the_last_bit(track, settings):
    names = ("overtaker", "gap_finder", "gap_finder[assist=full-prediction]")
    results = [fg.race(track, name, **{"laps": 1, "seed": 2} | settings) for name in names]
    assert results[0].car.finished and results[0].car.collisions_wall == 0
    assert len({result.trajectory_sha256 for result in results}) == 1
