"""The gap finder on scans of simple places: where it heads, how fast, and that it does so every time."""

import math
from functools import cache

import numpy as np
import pytest
from scan_worlds import CAR, INCREMENT, MU, corridor, mirrored, odometry_of, scan_of

from fg_mujoco.controllers.gap_finder import GapFinder, GapFinderSettings
from fg_mujoco.messages import STOP

SEEDS = range(20)


def rough_scan(seed):
    """A scan of 60 faces at random, no two alike, and a nearest point on a round post: no ties."""
    rng = np.random.default_rng(seed)
    ranges = np.interp(np.arange(1081), np.linspace(0, 1080, 60), rng.uniform(0.9, 9.5, 60))
    post = 0.5 + np.abs(np.arange(1081) - rng.integers(0, 1081)) / 200.0
    return scan_of(np.where(post < 0.8, post, ranges))


@cache
def made(**settings):
    return GapFinder(CAR, MU, 8.0, GapFinderSettings(**settings))


def finder(**settings):
    """A gap finder as new; making one takes longer than any test here."""
    planner = made(**settings)
    planner.reset()
    return planner


def settled_steering(planner, scan, speed=1.0):
    """The steering angle [rad] that the command comes to when scan and speed stay."""
    planner.reset()
    angle = 0.0
    for _ in range(60):
        angle = planner(scan, odometry_of(speed, angle)).steering_angle
    return angle


def test_in_the_middle_of_a_straight_corridor_it_goes_straight_on():
    scan = corridor(1.0, 1.0)
    bearing, _, _ = finder().find_goal(scan)
    assert abs(bearing) <= INCREMENT
    assert abs(settled_steering(finder(), scan)) < 0.01


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_heads_for_the_side_that_is_open(side):
    left, right = (8.0, 0.8) if side > 0 else (0.8, 8.0)
    scan = corridor(left, right, ahead=2.0)
    bearing, distance, _ = finder().find_goal(scan)
    assert side * bearing > 0.3
    assert distance > 2.0
    assert side * settled_steering(finder(), scan) > 0.2


@pytest.mark.parametrize("offset", [0.3, -0.3])
def test_beside_the_middle_of_a_corridor_it_comes_back_to_it(offset):
    scan = corridor(1.0 - offset, 1.0 + offset, ahead=8.0)
    assert settled_steering(finder(), scan) * offset < 0.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_passes_an_obstacle_on_the_wider_side(side):
    scan = corridor(2.0, 2.0)
    hidden = np.abs(scan.bearings - side * 0.05) < 0.12  # a box 3 m ahead, a little to one side
    blocked = scan_of(np.where(hidden, 3.0, scan.ranges))
    bearing, _, _ = finder().find_goal(blocked)
    assert side * bearing < 0.0
    # the goal's beam clears the box's near corner by half the car's width, and no less than by some of the clearance
    assert 3.0 * math.sin(abs(bearing - side * 0.05) - 0.12) > 0.5 * CAR.width


@pytest.mark.parametrize("seed", SEEDS)
def test_a_mirrored_scan_gets_the_mirrored_command(seed):
    scan, motions = rough_scan(seed), ((0.0, 0.0), (3.0, 0.1), (6.0, -0.05))
    planner = finder()
    here = [planner(scan, odometry_of(speed, angle)) for speed, angle in motions]
    planner.reset()
    there = [planner(mirrored(scan), odometry_of(speed, -angle)) for speed, angle in motions]
    for one, other in zip(here, there, strict=True):
        assert one.steering_angle == pytest.approx(-other.steering_angle, abs=1e-9)
        assert one.speed == pytest.approx(other.speed, abs=1e-9)


def test_the_goal_lies_within_the_field_of_view():
    scan = corridor(math.inf, 0.5, ahead=2.0)  # the longest beams point to the left and back
    for width in (1.0, math.pi, 4.5):
        bearing, _, _ = finder(field_of_view=width).find_goal(scan)
        assert abs(bearing) <= 0.5 * width + 1e-6


def test_what_lies_beyond_the_lookahead_does_not_draw_it_aside():
    ranges = np.full(1081, 12.0)
    ranges[700:760] = 25.0
    bearing, distance, _ = finder(lookahead=10.0).find_goal(scan_of(ranges))
    assert abs(bearing) <= INCREMENT
    assert distance == pytest.approx(10.0)


def test_a_single_longer_beam_counts_as_the_mean_of_its_bubble():
    ranges = np.full(1081, 5.0)
    ranges[800] = 6.0
    smooth, rough = (finder(disparity_threshold=100.0, mean_radius=radius) for radius in (0.3, 1e-6))
    # a window of .3 m / (6 m * .25 degrees), rounded up: 12 beams to either side
    assert smooth.find_goal(scan_of(ranges))[1] == pytest.approx(5.0 + 1.0 / 25)
    assert rough.find_goal(scan_of(ranges))[1] == pytest.approx(5.0 + 1.0 / 3)


def test_the_wished_speed_falls_with_the_room_in_front():
    speeds = [finder().find_goal(corridor(1.0, 1.0, ahead))[2] for ahead in (1.0, 2.0, 3.0, 30.0)]
    assert speeds == sorted(speeds)
    assert speeds[0] < 0.5 * speeds[-1]
    assert speeds[-1] == 8.0


def test_the_wished_speed_is_by_the_mean_range_over_the_width_in_front():
    # a tent, 3 m ahead and 2 m less for each radian, no filter of which does much: over 10 degrees to either side
    # the mean is 3 - 2 * (5 degrees) = 2.825 m, and top speed is at 10 m / 3
    bearings = INCREMENT * (np.arange(1081) - 540)
    tent = scan_of(np.maximum(3.0 - 2.0 * np.abs(bearings), 0.1))
    plain = finder(disparity_threshold=100.0, nearest_bubble=0.001, mean_radius=1e-6)
    bearing, distance, speed = plain.find_goal(tent)
    assert bearing == 0.0
    assert distance == pytest.approx(3.0, abs=0.01)
    assert speed == pytest.approx(8.0 * 2.825 / (10.0 / 3.0), rel=1e-3)


def test_it_takes_the_goal_round_a_dropout():
    scan = corridor(1.3, 0.8, 6.0)
    ranges = scan.ranges.copy()
    ranges[::7] = math.nan
    ranges[538:543] = math.nan
    whole, holed = finder().find_goal(scan), finder().find_goal(scan_of(ranges))
    assert holed[0] == pytest.approx(whole[0], abs=2 * INCREMENT)
    assert holed[1] == pytest.approx(whole[1], rel=0.01)


def test_reset_makes_it_as_new():
    planner, drive = finder(), [(corridor(1.0, 1.0), odometry_of(speed)) for speed in (0.0, 0.2, 0.5)]
    first = [planner(*seen) for seen in drive]
    assert [planner(*seen) for seen in drive] != first  # it remembers how hard it last braked or accelerated
    planner.reset()
    assert [planner(*seen) for seen in drive] == first
    assert GapFinder(CAR, MU, 8.0)(*drive[0]) == first[0]


def test_it_stops_where_nothing_can_be_driven_along():
    assert finder()(scan_of(np.zeros(1081)), odometry_of(0.0)) == STOP
    braking = finder()(scan_of(np.zeros(1081)), odometry_of(3.0))  # within the grip: STOP at once would slide the car
    assert braking.steering_angle == 0.0 and 2.5 < braking.speed < 3.0
    assert finder().find_goal(scan_of(np.zeros(1081))) is None
    assert finder()(scan_of(np.full(1081, 0.05)), odometry_of(0.0)).speed == 0.0


def test_after_a_stop_it_is_as_new():
    planner, seen = finder(), (corridor(1.0, 1.0), odometry_of(0.0))
    first = planner(*seen)
    assert planner(*seen).speed > first.speed
    assert planner(scan_of([]), odometry_of(0.0)) == STOP
    assert planner(*seen) == first


def test_without_odometry_it_stops():
    for speed, angle in ((math.nan, 0.0), (1.0, math.nan), (math.inf, 0.0)):
        assert finder()(corridor(1.0, 1.0), odometry_of(speed, angle)) == STOP


def test_it_does_not_drive_at_a_wall_that_is_too_near():
    planner, scan = finder(), corridor(0.3, 0.3, 0.5)
    assert planner(scan, odometry_of(0.0)).speed <= 0.0


def test_that_believes_in_no_limit_has_none():
    scan = corridor(8.0, 0.8, ahead=2.5)
    free, held = GapFinder(CAR, math.inf, 8.0), GapFinder(CAR, MU, 8.0)
    unlimited, limited = (planner(scan, odometry_of(7.0)) for planner in (free, held))
    bearing, _, speed = free.find_goal(scan)
    assert bearing > 0.3
    assert unlimited.speed == speed
    assert unlimited.steering_angle == CAR.max_steering_angle
    assert limited.speed < 7.0
    assert limited.steering_angle < 0.1
    free.reset()


def test_no_gain_follows_the_friction_limit():
    # straight ahead all is open; at rest on any steering the speed it comes to is within the law, whatever the gain
    for gain in (1.0, 3.0, 10.0):
        planner = finder(range_ratio_gain=gain)
        scan = corridor(8.0, 0.8, ahead=2.5)
        speed, angle = 1.0, 0.0
        for _ in range(200):
            command = planner(scan, odometry_of(speed, angle))
            speed += 0.22 * (command.speed - speed)  # the servo over a tick: 1 - exp(-.025 / .1)
            angle = command.steering_angle
        assert speed**2 * math.tan(abs(angle)) / CAR.wheelbase <= MU * CAR.gravity
