"""The safety filter: a safe reference stands, any other is replaced by a direction in which the car can stop."""

import math

import numpy as np
import pytest

from cases import each
from fg_mujoco.controllers.control.planner_settings import for_car, record_type, record_values
from fg_mujoco.controllers.control.steering import pursue
from fg_mujoco.controllers.perception.frontiers import FRONTIER_SEARCH
from fg_mujoco.controllers.perception.local_map import FREE
from fg_mujoco.controllers.safety.friction_limiter import LIMITER_MEMORY, FrictionLimiter
from fg_mujoco.controllers.safety.safety_filter import (
    SafetyFilterSettings,
    bearing_of_arc,
    least_cornering,
    reading,
    safe_steering,
)
from fg_mujoco.vehicle.vehicle import Vehicle

CAR = Vehicle.load().parameters
LIMITER = FrictionLimiter(CAR, 1.0489)
BEAMS, INCREMENT = 1081, math.radians(0.25)
NO_PATH = np.empty((0, 4))
NO_TARGETS = np.empty((0, 10))
UNSEEN = np.zeros(1, FRONTIER_SEARCH)[0]  # nothing was seen
START = -0.5 * (BEAMS - 1) * INCREMENT
BEARINGS = START + INCREMENT * np.arange(BEAMS)
BUMPER = CAR.length - CAR.rear_overhang - CAR.lidar_offset - 0.25 * CAR.width  # [m] from the LiDAR to the disc's centre


def filtered(
    widened, reference=0.0, angle=0.0, speed=4.0, acceleration=0.0, reference_speed=0.0, path=NO_PATH, kept=False,
    ground=UNSEEN, **settings,
):  # fmt: skip
    values = for_car(SafetyFilterSettings(**settings), CAR)
    row = np.array([record_values(values)], record_type(SafetyFilterSettings))
    memory = np.zeros(1, LIMITER_MEMORY)
    memory["acceleration"] = acceleration
    answer = safe_steering(
        LIMITER.record[0], memory[0], row[0], widened, START, INCREMENT, reference, reference_speed, angle, speed,
        0.025, path, kept, NO_TARGETS, 0.17, ground,
    )  # fmt: skip
    assert memory["acceleration"][0] == acceleration  # trying leaves no trace
    return answer


def wall_ahead(distance):
    """A wall across the way, but for an opening to the left of 20 degrees."""
    ranges = np.full(BEAMS, 30.0)
    ahead = np.abs(BEARINGS) < math.radians(20.0)
    ranges[ahead] = distance / np.cos(BEARINGS[ahead])
    return ranges


def test_a_reference_that_passed_goes_on_where_a_new_one_would_not():
    """It has to keep half of the margin, so that millimetres do not end a turn; and that half it has to keep."""
    stop = 4.0**2 / (2.0 * LIMITER.braking) + BUMPER
    distances, margin = stop + np.arange(0.0, 1.0, 0.005), for_car(SafetyFilterSettings(), CAR).margin

    def nearest(**options):
        answers = ((d, filtered(wall_ahead(d), margin_aside=margin, **options)) for d in distances)
        return next(distance for distance, (way, _, found) in answers if found and way == 0.0)

    new, kept, bare = nearest(), nearest(kept=True), nearest(margin=0.0)
    assert new - kept == pytest.approx(0.5 * margin, abs=0.006)
    assert kept - bare == pytest.approx(0.5 * margin, abs=0.006)


@each("reference", [-0.2, 0.0, 0.1])
def test_where_nothing_is_near_the_reference_stands_to_the_bit(reference):
    assert filtered(np.full(BEAMS, 30.0), reference) == (reference, 0.5, True)


def test_a_reference_into_a_box_is_left_for_a_way_past_it():
    ranges = np.full(BEAMS, 30.0)
    ranges[math.radians(8.0) < BEARINGS] = 1.2
    reference = 0.15
    way, use, found = filtered(ranges, reference)
    assert found and way < reference and 0.0 < use <= 1.0


def bend(radius, aside):
    """A left bend, with walls so far to either side of the way of the rear axle, as the disc over the front sees it."""
    ahead, left = np.cos(BEARINGS), np.sin(BEARINGS)
    x, y = CAR.lidar_offset, -radius  # of the LiDAR, from the middle of the bend
    towards = x * ahead + y * left
    ranges = np.full(BEAMS, 30.0)
    for wall in (radius - aside + 0.17, radius + aside - 0.17):
        root = towards**2 - (x * x + y * y - wall * wall)
        for sign in (-1.0, 1.0):
            found = -towards + sign * np.sqrt(np.maximum(root, 0.0))
            ranges = np.where((root > 0.0) & (found > 0.0), np.minimum(ranges, found), ranges)
    return ranges


BENDS = [(np.full(BEAMS, 30.0), 0.0), (bend(3.0, 2.5), 0.0), (bend(3.0, 0.9), 0.25), (bend(3.0, 0.5), -1.0)]


@each(("ranges", "use"), BENDS)
def test_a_car_that_brakes_corners_only_as_far_as_the_walls_make_it(ranges, use):
    row = np.array([record_values(for_car(SafetyFilterSettings(), CAR))], record_type(SafetyFilterSettings))
    memory = np.zeros(1, LIMITER_MEMORY)
    angle = math.atan(CAR.wheelbase / 3.0)
    found = least_cornering(
        LIMITER.record[0], memory[0], row[0], ranges, START, INCREMENT, angle, angle, 4.2, 0.025, NO_PATH,
        row[0]["margin_aside"], 0.25, NO_TARGETS, 0.17, UNSEEN,
    )  # fmt: skip
    assert (found, memory["acceleration"][0]) == (use, 0.0)


def test_along_a_path_ground_that_was_seen_counts_as_free_where_a_corner_hides_it():
    turn = np.arange(0.0, 1.5, 0.05)
    path = np.column_stack((2.0 * np.sin(turn), 2.0 - 2.0 * np.cos(turn), turn, np.full_like(turn, 0.5)))
    ranges = np.full(BEAMS, 30.0)
    ranges[math.radians(10.0) < BEARINGS] = 0.3  # the corner's end, beside the path
    seen = np.zeros(1, FRONTIER_SEARCH)[0]
    seen["map"]["cells"] = FREE
    angle = math.atan(0.5 * CAR.wheelbase)
    along = {"path": path}
    for options, passes in ((along | {"ground": seen}, True), (along, False), ({"ground": seen}, False)):
        way, _, found = filtered(ranges, angle, angle, 3.5, **options)
        assert (way == angle and found) == passes, options


def test_where_no_way_is_free_it_says_so():
    way, use, found = filtered(np.full(BEAMS, 0.6))
    assert not found and abs(way) <= CAR.max_steering_angle and 0.0 < use <= 1.0


@each("angle", [-0.4, -0.1, 0.0, 0.02, 0.3])
def test_the_bearing_of_an_arc_is_what_pursuit_steers_for(angle):
    bearing = bearing_of_arc(angle, 1.0, CAR.lidar_offset, CAR.wheelbase)
    assert pursue(bearing, 1.0, CAR.lidar_offset, CAR.wheelbase) == pytest.approx(angle, abs=1e-12)


def test_a_reading_is_the_nearest_beam_and_at_the_ends_the_last():
    ranges = np.arange(5.0)
    bearings = (-3.0, -0.2, -0.06, 0.04, 0.06, 9.0)
    assert [reading(ranges, -0.2, 0.1, bearing) for bearing in bearings] == [0.0, 0.0, 1.0, 2.0, 3.0, 4.0]
