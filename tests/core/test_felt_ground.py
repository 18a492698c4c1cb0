"""The stage `imu`: the friction limiter on the ground that the IMU feels, against closed forms and in races."""

import math
from dataclasses import replace

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.controllers.control.driving import DrivingSettings
from fg_mujoco.controllers.control.planner import Planner
from fg_mujoco.lab.ground_circles import closed_form
from scan_worlds import CAR, odometry_of, scan_of

GRAVITY, MU, STEERING = 9.81, 0.8, 0.1
RADIUS = CAR.wheelbase / math.tan(STEERING)


class Circling(Planner):
    Settings = DrivingSettings

    @staticmethod
    def reference(geometry, ranges, odometry, car, settings, memory, line):
        return STEERING, 20.0, 0.0


def limit(acceleration, *, speed=2.0, roll=0.0, turn=1.0, ticks=40, planner=None):
    """The limiter's speed on the circle, and its braking and accelerating, after some ticks of the same readings."""
    planner = planner or Circling(CAR, MU, max_speed=20.0, assist="limiter+imu")
    odometry = replace(
        odometry_of(speed, STEERING), linear_acceleration=np.array(acceleration),
        angular_velocity=np.array((roll, 0.0, turn * speed / RADIUS)),
    )  # fmt: skip
    for _ in range(ticks):
        planner(scan_of(np.full(1081, 10.0)), odometry)
    (allowed,) = [reason.speed for reason in planner.reasons() if reason.name == "friction limiter"]
    own = planner._alone._ticks["driver"]["limiter"][0]
    return allowed, float(own["braking"] / own["level"][2]), float(own["accelerating"] / own["level"][3])


LEVEL = limit((0.0, 4.0 / RADIUS, GRAVITY))


@each("degrees", [-10.0, -5.0, 0.0, 5.0, 10.0])
def test_a_circle_on_a_bank_is_allowed_at_the_speed_of_its_closed_form(degrees):
    """At that speed the IMU reads the forces of the tires, and the limiter asks for no other."""
    bank = math.radians(degrees)
    speed = closed_form("bank", degrees, MU, RADIUS) * math.sqrt(GRAVITY * RADIUS * MU)
    inward = speed**2 / RADIUS
    across = inward * math.cos(bank) - GRAVITY * math.sin(bank)
    up = GRAVITY * math.cos(bank) + inward * math.sin(bank)
    assert across / up == pytest.approx(MU)
    allowed, _, _ = limit((0.0, across, up), speed=speed, turn=math.cos(bank))
    assert allowed / LEVEL[0] == pytest.approx(speed * math.sqrt(math.cos(bank) / (GRAVITY * RADIUS * MU)), rel=1e-3)


@each("load", [0.5, 0.8, 1.1])
def test_over_a_crest_all_limits_are_those_of_the_load(load):
    asked = LEVEL[0] * math.sqrt(load), load, load
    assert limit((0.0, 4.0 / RADIUS, load * GRAVITY)) == pytest.approx(asked, rel=1e-3)


def test_a_twisted_road_limits_braking_and_not_the_speed_of_a_circle_and_no_reading_is_kept_that_is_none():
    assert limit((0.0, 4.0 / RADIUS, GRAVITY), roll=0.1) == pytest.approx((LEVEL[0], 0.6, 0.6), rel=1e-3)  # .05 rad/m
    assert limit((0.0, 4.0 / RADIUS, GRAVITY), roll=2.0) == pytest.approx((LEVEL[0], 0.2, 0.2), rel=1e-3)
    assert limit((0.0, math.nan, math.nan)) == pytest.approx(LEVEL)


def test_a_reset_planner_is_on_level_ground_again():
    planner = Circling(CAR, MU, max_speed=20.0, assist="limiter+imu")
    limit((0.0, 4.0 / RADIUS, 0.5 * GRAVITY), planner=planner)
    planner.reset()
    assert limit((0.0, 4.0 / RADIUS, GRAVITY), planner=planner, ticks=1) == pytest.approx(LEVEL, rel=1e-9)


def test_a_planner_with_it_brakes_into_a_banked_bend_without_a_slide_and_no_slower():
    without, felt = (fg.race("oval[bank=10]", assist=assist, laps=1).car for assist in ("safe", "safe+imu"))
    assert without.max_slide_m_s > 0.5 and felt.max_slide_m_s < 0.02
    assert felt.lap_times_s[0] < without.lap_times_s[0]
