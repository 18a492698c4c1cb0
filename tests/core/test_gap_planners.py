"""What all planners have in common that find a goal in a scan: simple places, mirrors, and where there is none."""

import math

import numpy as np
import pytest

from cases import each
from fg_mujoco.controllers.disparity_extender import DisparityExtender
from fg_mujoco.controllers.disparity_selection import DisparitySelection
from fg_mujoco.controllers.follow_the_gap import FollowTheGap
from fg_mujoco.controllers.gap_finder import GapFinder
from fg_mujoco.controllers.threshold_gap import ThresholdGap
from fg_mujoco.controllers.wall_follow import WallFollow
from fg_mujoco.controllers.weighted_gap import WeightedGap
from fg_mujoco.controllers.widest_gap import WidestGap
from scan_worlds import CAR, INCREMENT, MU, corridor, mirrored, odometry_of, rough_scan, scan_of

GAPS = (DisparitySelection, FollowTheGap, ThresholdGap, WeightedGap)
CHOICES = [
    *((made, {}) for made in (*GAPS, DisparityExtender, GapFinder, WidestGap)),
    *((FollowTheGap, {"point": point}) for point in ("middle", "deepest")),
    (FollowTheGap, {"bubble": "points"}),
    (ThresholdGap, {"gap": "deepest"}),
]


def named(choice):
    return " ".join([choice[0].__name__, *choice[1].values()])


def as_planner(choice):
    made, settings = choice
    return made(CAR, MU, 8.0, made.Settings(**settings))


every_planner = each("planner", CHOICES, ids=named, made=as_planner)


@each("choice", [*CHOICES, (WallFollow, {})], ids=named)
def test_a_mirrored_scan_gets_the_mirrored_command(choice):
    """Without guidance: the cells of its map have an orientation of their own."""
    made, settings = choice
    planner = made(CAR, MU, 8.0, made.Settings(**settings), assist="safe")
    motions = ((0.0, 0.0), (3.0, 0.1), (6.0, -0.05))
    for scan in map(rough_scan, range(20)):
        planner.reset()
        here = [planner(scan, odometry_of(speed, angle)) for speed, angle in motions]
        planner.reset()
        there = [planner(mirrored(scan), odometry_of(speed, -angle)) for speed, angle in motions]
        for one, other in zip(here, there, strict=True):
            assert one.steering_angle == pytest.approx(-other.steering_angle, abs=1e-9)
            assert one.speed == pytest.approx(other.speed, abs=1e-9)


@every_planner
@each("side", [1.0, -1.0])
def test_it_heads_for_the_side_that_is_open(planner, side):
    left, right = (8.0, 0.8) if side > 0 else (0.8, 8.0)
    bearing, distance = planner.find_goal(corridor(left, right, ahead=1.8))
    assert side * bearing > 0.2
    assert distance > 0.0


def test_in_the_middle_of_a_straight_corridor_it_goes_straight_on():
    for made in (*GAPS, DisparityExtender, GapFinder):
        bearing, _ = made(CAR, MU).find_goal(corridor(1.1, 1.1))
        assert abs(bearing) <= INCREMENT, made


def test_the_goal_lies_within_the_field_of_view():
    scan = corridor(math.inf, 0.5, ahead=2.0)  # the longest beams point to the left and back
    for made in (*GAPS, GapFinder):
        for width in (1.0, 2.0, math.pi):
            goal = made(CAR, MU, 8.0, made.Settings(field_of_view=width)).find_goal(scan)
            assert goal is None or abs(goal[0]) <= 0.5 * width + 1e-6


@every_planner
def test_what_cannot_be_seen_and_an_empty_field_of_view_have_no_goal(planner):
    for ranges in ([], [5.0], np.zeros(1081), np.full(1081, math.nan)):
        assert planner.find_goal(scan_of(ranges)) is None
    assert planner.find_goal(scan_of(np.full(100, 5.0), angle_min=2.0)) is None
