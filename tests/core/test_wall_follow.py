"""Wall following: the geometry of the two beams in closed form, the law, and what it cannot do."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fg_mujoco.controllers.wall_follow import WallFollow, WallFollowSettings
from scan_worlds import CAR, INCREMENT, corridor, mirrored, odometry_of, room, scan_of

LEFT, RIGHT = math.pi / 2, -math.pi / 2


def follower(**changes):
    return WallFollow(CAR, math.inf, 8.0, WallFollowSettings(**changes))  # no limiter between the law and the command


def steering(scan, **changes):
    return follower(**changes)(scan, odometry_of(1.0)).steering_angle


@settings(deadline=None)
@given(distance=st.floats(0.2, 3.0), away=st.floats(-0.5, 0.5), theta=st.floats(0.2, 0.8))
def test_two_beams_tell_distance_and_angle_of_a_straight_wall(distance, away, theta):
    # a car that turns away from a wall at its left by an angle has the wall's normal that much further to its left
    for side, sign in (("left", 1.0), ("right", -1.0)):
        scan = room((sign * (math.pi / 2 + away), distance))
        theta_of_beams = round(theta / INCREMENT) * INCREMENT
        found = follower(beam_angle=theta_of_beams).find_wall(scan, side)
        assert found == pytest.approx((distance, away), abs=1e-6)


@settings(deadline=None)
@given(
    distance=st.floats(0.4, 2.0), away=st.floats(-0.3, 0.3), kp=st.floats(0.0, 0.5), kd=st.floats(0.0, 0.5),
    ahead=st.floats(0.0, 2.0),
)  # fmt: skip
def test_the_law_is_pd_on_the_distance_ahead(distance, away, kp, kd, ahead):
    gains = {"proportional_gain": kp, "derivative_gain": kd, "projection": ahead, "desired_distance": 0.9}
    wished = kp * (distance + ahead * math.sin(away) - 0.9) + kd * math.sin(away)
    wished = max(-CAR.max_steering_angle, min(CAR.max_steering_angle, wished))
    assert steering(room((LEFT + away, distance)), side="left", **gains) == pytest.approx(wished, abs=1e-6)
    assert steering(room((RIGHT - away, distance)), side="right", **gains) == pytest.approx(-wished, abs=1e-6)


def test_between_both_walls_it_holds_the_middle_at_any_width():
    for width in (0.8, 2.0, 5.0):
        assert steering(corridor(0.5 * width, 0.5 * width)) == pytest.approx(0.0, abs=1e-9)
        assert steering(corridor(0.6 * width, 0.4 * width)) > 0.01


def test_without_a_return_there_is_no_wall():
    one_sided = room((LEFT, 1.5))
    assert follower().find_wall(one_sided, "right") is None
    assert steering(one_sided, side="right") == 0.0
    assert steering(one_sided, side="both") == steering(one_sided, side="left") > 0.05
    mirror = steering(mirrored(one_sided), side="both")
    assert mirror == pytest.approx(-steering(one_sided), abs=1e-9)
    assert steering(scan_of(np.full(1081, math.inf))) == 0.0


def test_a_scan_that_does_not_reach_round_to_the_side_shows_no_wall():
    whole = corridor(1.5, 0.5)
    narrow = scan_of(whole.ranges[300:-300], angle_min=float(whole.bearings[300]))
    assert follower().find_wall(narrow, "left") is None
    assert steering(narrow) == 0.0


def test_a_failed_reading_takes_its_neighbour():
    scan = corridor(1.5, 0.5)
    ranges = scan.ranges.copy()
    ranges[[180, 360, 720, 900]] = math.nan
    assert steering(scan_of(ranges)) == pytest.approx(steering(scan), abs=0.01)
