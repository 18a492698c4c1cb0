"""What the planners have in common that take a gap and drive to a point in it."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest

import fg_mujoco as fg
from fg_mujoco.controllers.disparity_selection import DisparitySelection
from fg_mujoco.controllers.follow_the_gap import FollowTheGap
from fg_mujoco.controllers.threshold_gap import ThresholdGap
from fg_mujoco.controllers.weighted_gap import WeightedGap
from fg_mujoco.errors import SettingsError
from fg_mujoco.vehicle.tire_slip import SLIDING_SPEED
from scan_worlds import CAR, INCREMENT, MU, corridor, mirrored, odometry_of, scan_of

PLANNERS = {
    "disparity_selection": DisparitySelection,
    "follow_the_gap": FollowTheGap,
    "threshold_gap": ThresholdGap,
    "weighted_gap": WeightedGap,
}
CHOICES = [
    *((name, {}) for name in PLANNERS),
    *(("follow_the_gap", {"point": point}) for point in ("middle", "deepest")),
    ("follow_the_gap", {"bubble": "points"}),
    ("threshold_gap", {"gap": "deepest"}),
]


@pytest.fixture(params=CHOICES, ids=lambda choice: " ".join([choice[0], *choice[1].values()]), scope="module")
def planner(request):
    name, settings = request.param
    return PLANNERS[name](CAR, MU, 8.0, PLANNERS[name].Settings(**settings))


def rough_scan(seed):
    """A scan of 60 faces at random, no two alike, and a nearest point on a round post: no ties."""
    rng = np.random.default_rng(seed)
    ranges = np.interp(np.arange(1081), np.linspace(0, 1080, 60), rng.uniform(0.9, 9.5, 60))
    post = 0.5 + np.abs(np.arange(1081) - rng.integers(0, 1081)) / 200.0
    return scan_of(np.where(post < 0.8, post, ranges))


def test_a_mirrored_scan_gets_the_mirrored_command(planner):
    """Without guidance: the cells of its map have an orientation of their own."""
    planner = type(planner)(CAR, MU, planner.max_speed, replace(planner.settings, guidance=False))
    motions = ((0.0, 0.0), (3.0, 0.1), (6.0, -0.05))
    for scan in map(rough_scan, range(20)):
        planner.reset()
        here = [planner(scan, odometry_of(speed, angle)) for speed, angle in motions]
        planner.reset()
        there = [planner(mirrored(scan), odometry_of(speed, -angle)) for speed, angle in motions]
        for one, other in zip(here, there, strict=True):
            assert one.steering_angle == pytest.approx(-other.steering_angle, abs=1e-9)
            assert one.speed == pytest.approx(other.speed, abs=1e-9)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_heads_for_the_side_that_is_open(planner, side):
    left, right = (8.0, 0.8) if side > 0 else (0.8, 8.0)
    bearing, distance = planner.find_goal(corridor(left, right, ahead=1.8))
    assert side * bearing > 0.2
    assert distance > 0.0


def test_in_the_middle_of_a_straight_corridor_it_goes_straight_on():
    for name, made in PLANNERS.items():
        bearing, _ = made(CAR, MU).find_goal(corridor(1.1, 1.1))
        assert abs(bearing) <= INCREMENT, name


def test_the_goal_lies_within_the_field_of_view():
    scan = corridor(math.inf, 0.5, ahead=2.0)  # the longest beams point to the left and back
    for made in PLANNERS.values():
        for width in (1.0, 2.0, math.pi):
            goal = made(CAR, MU, 8.0, made.Settings(field_of_view=width)).find_goal(scan)
            assert goal is None or abs(goal[0]) <= 0.5 * width + 1e-6


def test_what_cannot_be_seen_has_no_goal(planner):
    for ranges in ([], [5.0], np.zeros(1081), np.full(1081, math.nan)):
        assert planner.find_goal(scan_of(ranges)) is None


def test_an_empty_field_of_view_has_no_goal(planner):
    assert planner.find_goal(scan_of(np.full(100, 5.0), angle_min=2.0)) is None


@pytest.mark.parametrize("made", PLANNERS.values())
def test_a_setting_that_it_cannot_plan_with_is_refused_by_name(made):
    for field in fields(made.Settings):
        for value in (-1.0, math.nan, "no such word"):
            with pytest.raises(SettingsError, match=rf"{made.Settings.__name__}\.{field.name} is {value!r}; accepted"):
                made.Settings(**{field.name: value})


@pytest.mark.slow
@pytest.mark.parametrize("circuit", ["oval", "l_corridor"])
@pytest.mark.parametrize("name", PLANNERS)
def test_it_drives_five_laps_without_a_crash_and_without_sliding(name, circuit):
    result = fg.race(circuit, name, laps=5)
    assert (result.car.end_reason, result.car.laps_completed, result.car.collisions_wall) == ("finished", 5, 0)
    assert result.car.max_slide_m_s <= SLIDING_SPEED
