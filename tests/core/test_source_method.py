"""The method `source`: each planner's text to the letter, by examples that were computed by hand; and the baselines."""

import math

import numpy as np
import pytest

from cases import each
from fg_mujoco.controllers import BASELINES
from fg_mujoco.controllers.control.planner_settings import for_method
from fg_mujoco.controllers.disparity_selection import source_beam
from fg_mujoco.controllers.follow_the_gap import FollowTheGapSettings
from fg_mujoco.controllers.perception.scan_filters import mask_bubble, mask_nearest
from fg_mujoco.messages import ODOMETRY
from fg_mujoco.racing.planners import find_controller, make_controller
from scan_worlds import CAR, MU, corridor, odometry_of, scan_of


def planner(name, mu=MU, **settings):
    return make_controller(name, car=CAR, mu=mu, max_speed=8.0, settings={"method": "source", **settings})


def test_the_notes_bubble_is_the_arctangent_cut_off_to_whole_beams():
    """atan(.4 / .6) is .588 rad: of beams .5 rad apart one to either side, of beams .6 rad apart none."""
    ranges = np.array([2.5, 2.5, 0.6, 0.6, 2.5, 2.5])
    assert mask_bubble(ranges, 0.5, 0.4).tolist() == [2.5, 0.0, 0.0, 0.0, 2.5, 2.5]
    assert mask_bubble(ranges, 0.6, 0.4).tolist() == [2.5, 2.5, 0.0, 0.6, 2.5, 2.5]
    assert mask_bubble(ranges[2:], 0.5, 0.4).tolist() == [0.0, 0.0, 2.5, 2.5]
    assert mask_bubble(np.array([2.5, 0.0, 2.5]), 0.5, 0.4).tolist() == [2.5, 0.0, 2.5]
    assert mask_nearest(ranges, 0.5, 0.4).tolist() == [0.0, 0.0, 0.0, 0.0, 0.0, 2.5]  # .4 / (.6 * .5), rounded up: 2


def test_disparity_selection_takes_the_index_before_each_jump_and_the_first_two():
    diagram = np.array([0.4, 0.5, 2.5, 2.5, 2.5, 0.6, 0.5])
    assert source_beam(diagram, 0, 7, 0.5) == 2  # (1 + 4) // 2
    assert source_beam(np.array([0.0, 0.0, *diagram]), 2, 9, 0.5) == 4  # in a gap that begins at its third beam
    box = np.array([3.0, 3.0, 3.1, 1.0, 1.0, 1.0, 3.0, 3.0])
    assert source_beam(box, 0, 8, 0.5) == 3  # (2 + 5) // 2, which is the box
    assert source_beam(np.array([2.5, 2.5, 0.5]), 0, 3, 0.5) == 0  # one disparity: the furthest, the first of two


def test_the_disparity_extender_covers_the_farther_side_only():
    """Half the width of .31 m and .15 m, over arcs of .2 m: two beams."""
    made = planner("disparity_extender")
    scan = scan_of([2.2, 2.0, 4.0, 4.0, 4.0, 4.0, 4.0], 0.1)
    assert made.intermediate_scans(scan)["extended"].tolist() == [2.2, 2.0, 2.0, 2.0, 4.0, 4.0, 4.0]
    refined = planner("disparity_extender", method="refined")
    assert refined.intermediate_scans(scan)["extended"].tolist() == [2.0, 2.0, 2.0, 2.0, 4.0, 4.0, 4.0]


def test_the_gap_finders_components_one_after_the_other():
    """A bubble's radius is .305 m: two beams of .1 rad at 2 m, one at 4 m."""
    made, scan = planner("gap_finder"), scan_of([4.0, 4.0, 4.0, 2.0, 4.0, 4.0, 40.0], 0.1)
    scans = made.intermediate_scans(scan)
    assert scans["extended"].tolist() == [4.0, 2.0, 2.0, 2.0, 2.0, 2.0, 4.0]
    assert scans["bubble"].tolist() == [2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 4.0]  # round the first of the nearest
    assert scans["filtered"].tolist() == pytest.approx([2.0, 2.0, 2.0, 2.0, 12.0 / 5, 10.0 / 4, 3.0])


@each(("left", "expected"), [(0.3, 0.3), (1.0, CAR.max_steering_angle)])
def test_the_steering_angle_is_the_goals_bearing_up_to_the_lock(left, expected):
    bearings = 0.1 * (np.arange(27) - 13)
    scan = scan_of(np.where(np.abs(bearings - left) < 0.01, 3.0, 2.0), 0.1)
    for name, settings in (("follow_the_gap", {}), ("threshold_gap", {"threshold": 2.5, "least_readings": 1})):
        free = planner(name, mu=math.inf, **settings)
        assert free(scan, odometry_of(1.0)).steering_angle == pytest.approx(expected), name


LAWS = {
    "gap_finder": ("mean_range", "friction_law"),  # component 9
    "widest_gap": (),  # the code in C++ has none
    **dict.fromkeys(("follow_the_gap", "threshold_gap", "weighted_gap", "disparity_extender"), ("distance_ahead",)),
    "disparity_selection": ("distance_ahead",),  # as a chapter of follow the gap
    **dict.fromkeys(BASELINES, ()),
}


@each("name", LAWS)
def test_without_stages_a_planner_has_the_method_and_the_speed_laws_of_its_source(name):
    none, grip, full = (find_controller(name)(CAR, MU, assist=assist) for assist in ("none", "grip", "full"))
    assert (set(none.stages), set(grip.stages)) == ({*LAWS[name]}, {*LAWS[name], "limiter"})
    assert [each.settings.method for each in (none, grip, full)] == ["source", "source", "refined"]


def test_follow_the_gap_looks_all_round_in_its_source():
    settings = FollowTheGapSettings()
    assert (settings.field_of_view, for_method(settings, "source").field_of_view) == (None, 2.0 * math.pi)


def test_the_speed_laws_of_the_sources_in_closed_form():
    """The mean of 2, 2, 2, 2, 2.4, 2.5 and 3 m over 10 m, of 8 m/s; sqrt(g mu b / tan .3), of less friction."""
    scan = scan_of([4.0, 4.0, 4.0, 2.0, 4.0, 4.0, 40.0], 0.1)
    command = planner("gap_finder", assist="none")(scan, odometry_of(1.0))
    assert (command.steering_angle, command.speed) == pytest.approx((0.3, 8.0 * 15.9 / 7 / 10))
    slippery = planner("gap_finder", mu=0.2, assist="none")(scan, odometry_of(1.0)).speed
    assert slippery == pytest.approx(math.sqrt(9.81 * 0.2 * 0.3302 / math.tan(0.3)))
    ahead = planner("follow_the_gap", assist="none")(corridor(1.0, 1.0, ahead=5.1), odometry_of(1.0)).speed
    assert ahead == pytest.approx(8.0 * (5.1 - 0.2) / (10.0 - 0.2))  # stops at .2 m


# -- baselines


def test_the_draws_are_those_of_the_seed_and_the_tick_whoever_else_draws():
    kind, scan = find_controller("random"), corridor(1.0, 1.0)
    drawn = {seed: kind(CAR, math.inf, seed=seed) for seed in (0, 1, 7)}
    alone = {}
    for seed, one in drawn.items():
        alone[seed] = [one(scan, odometry_of(1.0)).steering_angle for _ in range(50)]
        one.reset()
        assert [one(scan, odometry_of(1.0)).steering_angle for _ in range(50)] == alone[seed]
    assert len({tuple(angles) for angles in alone.values()}) == 3
    assert abs(np.mean(alone[7])) < 0.2 and np.ptp(alone[7]) == pytest.approx(2.0 * CAR.max_steering_angle)
    batch, commands = kind.batch([kind(CAR, math.inf, seed=seed) for seed in (7, 0, 1)]), np.zeros((3, 2))
    for tick in range(50):
        batch(scan, np.tile(scan.ranges, (3, 1)), np.zeros(3, ODOMETRY), np.ones(3, bool), commands)
        assert commands[:, 0].tolist() == [alone[seed][tick] for seed in (7, 0, 1)]
