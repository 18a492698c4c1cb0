"""The judge: a reference after which the car can stop is driven, any other is replaced by the best other proposal."""

import math

import numpy as np
import pytest

from cases import each
from fg_mujoco.controllers.control.planner_settings import for_car
from fg_mujoco.controllers.control.reasons import ASIDE, REFERENCE, STOP
from fg_mujoco.controllers.control.steering import bearing_of_arc, pursue
from fg_mujoco.controllers.perception.frontiers import FRONTIER_SEARCH
from fg_mujoco.controllers.perception.local_map import FREE as FREE_GROUND
from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter
from fg_mujoco.controllers.safety.judge import (
    JUDGE,
    MOVES,
    STANDS,
    JudgeSettings,
    Plan,
    Wanted,
    judge,
    reading,
    simulate,
)
from fg_mujoco.racing.planners import make_controller
from fg_mujoco.vehicle.vehicle import Vehicle
from scan_worlds import corridor, odometry_of, situation

CAR = Vehicle.load().parameters
LIMITER = FrictionLimiter(CAR, 1.0489)
BEAMS, INCREMENT = 1081, math.radians(0.25)
NO_PATH = np.empty((0, 4))
START = -0.5 * (BEAMS - 1) * INCREMENT
BEARINGS = START + INCREMENT * np.arange(BEAMS)
BUMPER = CAR.length - CAR.rear_overhang - CAR.lidar_offset - 0.25 * CAR.width  # [m] from the LiDAR to the disc's centre


def judged(
    widened, reference=0.0, angle=0.0, speed=4.0, acceleration=0.0, reference_speed=0.0, path=NO_PATH, kept=False,
    guided=False, ground=None, movers=(), **settings,
):  # fmt: skip
    """The best proposal, and the table of all."""
    here = situation(LIMITER.record[0], widened, angle, speed, ground=ground, movers=movers, **settings)
    here.memory["acceleration"] = acceleration
    memory = np.zeros(1, JUDGE)[0]
    memory["proposals"] = math.nan
    judge(here, Wanted(reference, reference_speed, path, guided, NO_PATH, kept), memory)
    assert here.memory["acceleration"] == acceleration  # trying leaves no trace
    return memory["best"], memory["proposals"]


def passes(*given, **options):
    """Whether the reference itself is driven, or its stop."""
    best, _ = judged(*given, **options)
    return best["contact"] == 0.0 and best["why"] <= STOP


def wall_ahead(distance):
    """A wall across the way, but for an opening to the left of 20 degrees."""
    ranges = np.full(BEAMS, 30.0)
    ahead = np.abs(BEARINGS) < math.radians(20.0)
    ranges[ahead] = distance / np.cos(BEARINGS[ahead])
    return ranges


def test_a_reference_that_passed_goes_on_where_a_new_one_would_not():
    """It has to keep half of the margin, so that millimetres do not end a turn; and that half it has to keep."""
    stop = 4.0**2 / (2.0 * LIMITER.braking) + BUMPER
    distances, margin = stop + np.arange(0.0, 1.0, 0.005), for_car(JudgeSettings(), CAR).margin

    def nearest(**options):
        return next(d for d in distances if passes(wall_ahead(d), margin_aside=margin, **options))

    new, kept, bare = nearest(), nearest(kept=True), nearest(margin=0.0)
    assert new - kept == pytest.approx(0.5 * margin, abs=0.006)
    assert kept - bare == pytest.approx(0.5 * margin, abs=0.006)


def test_a_stop_keeps_the_way_of_the_reference_where_it_is_free():
    found = [judged(wall_ahead(d), 0.02, 0.02, reference_speed=6.0, kept=True)[0] for d in np.arange(1.5, 4.0, 0.01)]
    uses = [float(best["use"]) for best in found if best["why"] == STOP and best["contact"] == 0.0]
    # nearest to the wall it brakes straight on; farther away it corners with the limiter's own share of the grip
    assert uses == sorted(uses) and set(uses) == {0.0, 0.5}


@each("reference", [-0.2, 0.0, 0.1])
def test_where_nothing_is_near_the_reference_stands_to_the_bit(reference):
    best, proposals = judged(np.full(BEAMS, 30.0), reference)
    assert (best["why"], best["steering_angle"], best["use"], best["contact"]) == (REFERENCE, reference, 0.5, 0.0)
    assert np.isnan(proposals[REFERENCE + 1 :, 1]).all() and proposals[REFERENCE, 4] == 0.0  # nothing else was tried


def test_a_reference_into_a_box_is_left_for_a_way_past_it_and_the_table_says_why():
    ranges = np.full(BEAMS, 30.0)
    ranges[math.radians(8.0) < BEARINGS] = 1.2
    best, proposals = judged(ranges, 0.15)
    assert best["contact"] == 0.0 and best["why"] == ASIDE and best["steering_angle"] < 0.15
    assert proposals[REFERENCE, 4] == STANDS and proposals[REFERENCE, 2] > 0.0 and 0.0 < proposals[REFERENCE, 3] < 1.0
    assert proposals[ASIDE, 2] == 0.0


def test_what_a_car_meets_first_is_named():
    open_ground = np.full(BEAMS, 30.0)
    crossing = [2.0, -1.2, 0.0, 1.0, 2.0, 0.25, math.inf, 6.0, 0.05, 0.0, math.inf, 0.0]
    worlds = ((wall_ahead(0.6), [], STANDS), (open_ground, [crossing], MOVES), (open_ground, [], 0))
    for widened, movers, what in worlds:
        here = situation(LIMITER.record[0], widened, 0.0, 4.0, movers=movers)
        met = simulate(here, Plan(0.0, 10.0, NO_PATH, 4.0, 0.12), 0.5, 4.0)
        assert met.what == what and (met.speed > 0.0) == (what != 0)


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
    angle = math.atan(CAR.wheelbase / 3.0)
    here = situation(LIMITER.record[0], ranges, angle, 4.2)
    goal = bearing_of_arc(angle, 1.0, CAR.lidar_offset, CAR.wheelbase)
    plan = Plan(goal, float(reading(here, goal)), NO_PATH, 0.0, float(here.settings["margin_aside"]))
    free = [u for u in (0.0, 0.25) if simulate(here, plan, u, 4.2).speed == 0.0]
    assert min(free, default=-1.0) == use


def test_along_a_path_ground_that_was_seen_counts_as_free_where_a_corner_hides_it():
    turn = np.arange(0.0, 1.5, 0.05)
    path = np.column_stack((2.0 * np.sin(turn), 2.0 - 2.0 * np.cos(turn), turn, np.full_like(turn, 0.5)))
    ranges = np.full(BEAMS, 30.0)
    ranges[math.radians(10.0) < BEARINGS] = 0.3  # the corner's end, beside the path
    seen = np.zeros(1, FRONTIER_SEARCH)[0]
    seen["map"]["cells"] = FREE_GROUND
    angle = math.atan(0.5 * CAR.wheelbase)
    along = {"path": path}
    for options, expected in ((along | {"ground": seen}, True), (along, False), ({"ground": seen}, False)):
        assert passes(ranges, angle, angle, 3.5, **options) == expected, options


def test_where_no_way_is_free_the_slowest_contact_is_taken():
    ranges = np.where(math.radians(-5.0) > BEARINGS, 0.5, 0.8)
    best, proposals = judged(ranges, angle=-0.3, speed=2.0)  # the wheels lead to the nearer wall
    tried = proposals[~np.isnan(proposals[:, 1]), 2]
    assert best["contact"] == tried.min() > 0.0 and 0.0 <= best["use"] <= 1.0


def test_where_no_way_is_free_a_guided_car_stays_on_its_motion_and_the_table_has_the_one_that_is_driven():
    straight = np.column_stack((np.arange(0.2, 3.0, 0.2), np.zeros((14, 3))))
    best, proposals = judged(np.full(BEAMS, 0.6), 0.05, path=straight, guided=True)
    assert (best["steering_angle"], best["use"]) == (0.05, 1.0) and best["contact"] > 0.0
    assert not np.isnan(proposals[best["why"], 1])


@each("angle", [-0.4, -0.1, 0.0, 0.02, 0.3])
def test_the_bearing_of_an_arc_is_what_pursuit_steers_for(angle):
    bearing = bearing_of_arc(angle, 1.0, CAR.lidar_offset, CAR.wheelbase)
    assert pursue(bearing, 1.0, CAR.lidar_offset, CAR.wheelbase) == pytest.approx(angle, abs=1e-12)


def test_a_reading_is_the_nearest_beam_and_at_the_ends_the_last():
    here = situation(LIMITER.record[0], np.arange(5.0), 0.0, 1.0, angle_min=-0.2, increment=0.1)
    assert [reading(here, bearing) for bearing in (-9.0, -0.2, 0.04, 0.06, 9.0)] == [0.0, 0.0, 2.0, 3.0, 4.0]


def test_reasons_say_what_each_proposal_would_have_met_and_which_is_driven():
    planner = make_controller("gap_finder", car=CAR, mu=1.0489, max_speed=8.0, settings={})
    planner(corridor(0.6, 0.6, ahead=1.2), odometry_of(3.0))
    proposals = [reason for reason in planner.reasons() if reason.name.startswith("proposal: ")]
    assert len(proposals) > 2 and all("meets what stands at" in each.text for each in proposals)
    assert sum(each.text.endswith("is driven") for each in proposals) == 1
    planner(corridor(1.0, 1.0), odometry_of(1.0))
    (only,) = [reason for reason in planner.reasons() if reason.name.startswith("proposal: ")]
    assert only.name == "proposal: reference" and only.text.endswith("meets nothing and is driven")
