"""Predicted paths: where a moving target may be, that no planner sees it, and that planners get past it."""

import math

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.controllers.safety import predictions as predicted
from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter
from fg_mujoco.controllers.safety.judge import FREE, MOVES, Plan, simulate
from fg_mujoco.controllers.safety.predictions import PREDICTIONS, interval, meets, separate, turned, write_predictions
from fg_mujoco.racing.planners import make_controller
from moving_worlds import GEOMETRY, WALLS, box, ranges_of, watched
from scan_worlds import CAR, MU, odometry_of, scan_of, situation

LIMITER = FrictionLimiter(CAR, 1.0489)


def target(x, y, vx, vy, radius=0.25, to_wall=math.inf, braking=0.0, spread=0.0):
    speed = math.hypot(vx, vy)
    return np.array([x, y, vx / speed, vy / speed, speed, radius, to_wall, braking, spread, 0.0, math.inf, 0.0])


def test_the_places_of_a_target_are_between_braking_and_going_on():
    row = target(5.0, 0.0, 0.0, 2.0, braking=4.0, spread=0.1)
    assert interval(row, 0.25) == pytest.approx((2.0 * 0.25 - 0.5 * 4.0 * 0.25**2 - 0.025, 2.1 * 0.25))
    assert interval(row, 2.0) == pytest.approx((2.0**2 / (2.0 * 4.0) - 0.2, 4.2))  # it stood after 0.5 s


def test_at_a_wall_a_target_stays_or_turns_back():
    row = target(5.0, 0.0, 0.0, 1.0, to_wall=0.6)
    assert interval(row, 0.5) == pytest.approx((0.5, 0.5))
    assert interval(row, 1.0) == pytest.approx((0.2, 0.6))


def test_a_disc_meets_a_target_only_when_both_are_there():
    rows = target(3.0, -1.0, 0.0, 1.0)[np.newaxis]
    assert meets(rows, 3.0, 0.0, 0.2, 1.0) and not meets(rows, 3.0, 0.0, 0.2, 0.4)
    assert meets(rows, 3.0, 0.44, 0.2, 1.0) and not meets(rows, 3.0, 0.46, 0.2, 1.0)
    assert meets(rows, 3.44, 0.0, 0.2, 1.0) and not meets(rows, 3.46, 0.0, 0.2, 1.0)


def test_predictions_are_turned_about_the_lidar():
    memory = np.zeros(1, PREDICTIONS)[0]
    memory["count"], memory["rows"][0] = 1, target(3.0, 0.0, 0.0, 1.0)
    (row,) = turned(memory, 0.5 * math.pi)
    assert row[:4] == pytest.approx((0.0, -3.0, 1.0, 0.0), abs=1e-12)
    assert (turned(memory, 0.0)[0] == memory["rows"][0]).all()


def test_a_target_is_taken_out_of_the_scan_and_walls_and_turns_end_its_way():
    def world(time):
        return WALLS + box(6.0, -0.8 + 0.8 * time), ()  # from right to left, through a corridor

    memory = np.zeros(1, PREDICTIONS)[0]
    tracked, _ = watched(world, 32)
    now = ranges_of(*world(31 * 0.025), x=CAR.lidar_offset)
    ends = []
    for turns in (0, 1, 2):
        (k,) = np.flatnonzero(tracked["targets"]["moves"])
        tracked["targets"][k]["turns"] = turns
        tracked["targets"][k]["turned"] = [(6.0 - CAR.lidar_offset, 0.5), (6.0 - CAR.lidar_offset, -0.8)]
        memory["targets"] = tracked
        assert write_predictions(memory)
        seen, clear = now.copy(), np.empty(1081)
        separate(GEOMETRY, seen, clear, memory)
        ends.append(memory["rows"][0, [predicted.TO_WALL, predicted.FROM_WALL, predicted.TURNS]])
    walls = ranges_of(WALLS, x=CAR.lidar_offset)
    on_box = now < walls - 1e-9
    assert (seen == clear).all() and (clear[~on_box] == now[~on_box]).all() and clear[on_box].min() > 9.0
    assert ends[0] == pytest.approx((1.4 + 0.18 - 0.25, 1.4 - 0.18 - 0.25, 0.0), abs=0.15)
    assert ends[1][0] == pytest.approx(0.5 + 0.18, abs=0.05) and ends[1][1:] == pytest.approx((ends[0][1], 1.0))
    assert ends[2] == pytest.approx((0.5 + 0.18, 0.8 - 0.18, 2.0), abs=0.05)


def met(rows, speed=4.0, ahead=12.0):
    """What a car meets straight on, with a wall ahead of it."""
    bearings = math.radians(0.25) * (np.arange(1081) - 540)
    widened = np.minimum(ahead / np.maximum(np.cos(bearings), 1e-3), 30.0)
    here = situation(LIMITER.record[0], widened, 0.0, speed, movers=rows)
    return simulate(here, Plan(0.0, 10.0, np.empty((0, 4)), speed, 0.12), 0.5, speed).what


def test_a_stop_is_free_where_a_target_leaves_the_way_and_not_where_it_comes():
    assert met([]) == FREE
    assert met([target(2.0, 0.0, 0.0, 3.0)]) == FREE  # in the way now, and gone when the car is there
    assert met([target(2.0, -1.2, 0.0, 2.0)]) == MOVES  # beside the way now, and in it when the car would stop


def test_a_planner_that_does_not_want_it_takes_what_moves_as_standing():
    counts = []
    for assist in ("full", "full-prediction"):
        planner = make_controller("gap_finder", car=CAR, mu=MU, max_speed=8.0, settings={"assist": assist})
        for k in range(24):
            planner(scan_of(ranges_of(WALLS + box(5.0, -0.6 + 0.025 * k), x=CAR.lidar_offset)), odometry_of(0.0))
        counts.append(int(planner._alone.memory[0]["predictions"]["count"]))
    assert counts == [1, 0]


@each(("planner", "speed"), (("gap_finder", 8.0), ("gap_finder", 4.0), ("follow_the_gap", 8.0)))
def test_a_box_that_crosses_is_passed(planner, speed):
    """Of seeds 0 to 99 without predictions: 47 at 8 m/s."""
    seeds = range(3000, 3012)
    passed = [fg.race(f"scene:crossing_box:{seed}", planner, max_speed=speed).car.finished for seed in seeds]
    assert sum(passed) >= 11


@each(
    ("track", "settings"),
    [("chicanes", {}), ("oval", {"obstacles": 2, "effects": {"latency": 0.03}, "changes": {"command_delay": 0.01}})],
    ids=["on_time", "late"],
)
def test_where_nothing_moves_predictions_change_no_bit(track, settings):
    """Nor where scans are late, as the planner is told by how much."""
    with_, without = (
        fg.race(track, "gap_finder", laps=1, assist=each, **settings) for each in ("full", "full-prediction")
    )
    assert with_.car.finished and with_.trajectory_sha256 == without.trajectory_sha256
