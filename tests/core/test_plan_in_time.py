"""The plan in time: where things may be, motions by an independent slow check, what is no end, and hostile scans."""

import math

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.controllers.safety import plan_in_time as planned
from fg_mujoco.controllers.safety.friction_limiter import EVASIVE, FrictionLimiter
from fg_mujoco.controllers.safety.predictions import occupied
from fg_mujoco.native import core
from fg_mujoco.racing.planners import make_controller
from moving_worlds import WALLS, box, ranges_of
from scan_worlds import CAR, MU, odometry_of, scan_of, situation

LIMITER = FrictionLimiter(CAR, MU, EVASIVE).record[0]
FIRST, INCREMENT = math.radians(-135.0), math.radians(0.25)
PERIOD = 0.025
USED = 0.08  # [m] of all margins that a motion may use up
LANE = 0.3  # [m] beside the lane of one that crosses


def target(x, y, vx, vy, *, to_wall=math.inf, from_wall=math.inf, turns=0.0, spread=0.05, radius=0.25):
    speed = math.hypot(vx, vy)
    return np.array([x, y, vx / speed, vy / speed, speed, radius, to_wall, 0.0, spread, 0.0, from_wall, turns])


def corridor(half):
    """Widened readings (1081,) of two walls."""
    sines = np.sin(FIRST + INCREMENT * np.arange(1081))
    return np.minimum((half - 0.17) / np.maximum(np.abs(sines), 1e-3), 20.0)


def around(rows, speed, *, widened=None, angle=0.0):
    return situation(LIMITER, corridor(1.4) if widened is None else widened, angle, speed, movers=rows)


def decide(rows, speed, *, plan=None, may_back_off=False, onwards=4.0, **options):
    plan = np.zeros(1, planned.PLAN_IN_TIME)[0] if plan is None else plan
    here = around(rows, speed, **options)
    return planned.plan_in_time(here, plan, (0.0, 0.0, 0.0), (0.0, 8.0), onwards, may_back_off)


def among(here, room, servo=0.6, may_turn=0.0):
    reaches, spans = core.reaches_of(CAR_ROW, here.movers, 0.0), core.spans_of(here.movers, 0.0)
    return planned.Among(here, (8.0, 0.0), 4.0, room, servo, spans, reaches, may_turn)


def test_a_thing_is_between_slowing_down_and_going_on_and_turns_where_it_is_expected_to():
    unknown, known = target(3.0, 0.0, 0.0, 1.0), target(3.0, 0.0, 0.0, 1.0, to_wall=0.5, turns=2.0)
    assert occupied(unknown, 1.0, 0.0) == pytest.approx((1.0 - 0.1 - 0.15, 1.0 + 0.1))  # two sigmas, .3 m/s^2
    assert occupied(known, 0.4, 0.0) == pytest.approx((0.38, 0.42))
    assert occupied(known, 1.0, 0.0) == pytest.approx((2 * 0.5 - 1.05, 0.5))
    assert occupied(known, 0.4, 1.0) == pytest.approx((0.39, 0.41))  # the car has waited
    drives = target(3.0, 0.0, 2.0, 0.3, to_wall=1.0)  # a car, which follows the walls
    assert occupied(drives, 1.0, 0.0) == pytest.approx((0.9, 1.4))


@each("seed", range(40))
def test_what_turns_at_both_ends_is_where_a_slow_walk_to_and_fro_comes(seed):
    rng = np.random.default_rng(seed)
    to_wall, back, speed, spread = rng.uniform(0.0, 1.0), rng.uniform(0.02, 1.0), rng.uniform(0.3, 2.0), 0.05
    row = target(3.0, 0.0, 0.0, speed, to_wall=to_wall, from_wall=back, turns=2.0, spread=spread)
    for time in np.arange(0.0, 3.0, 0.1):
        ways = np.linspace((speed - spread) * time, (speed + spread) * time, 800)
        phases = (ways + back) % (2.0 * (to_wall + back))
        places = np.minimum(phases, 2.0 * (to_wall + back) - phases) - back
        assert occupied(row, time, 0.0) == pytest.approx((places.min(), places.max()), abs=0.002)


def test_a_motion_is_worth_less_that_touches_what_may_turn_back_and_not_where_it_is_known_to_go_on():
    path = np.zeros((56, 6))
    for turns, less in ((0.0, True), (1.0, True), (2.0, False)):
        scores = np.zeros((2, len(core.PROFILES)))
        row = target(2.0, 0.55, 0.0, 0.8, to_wall=2.0, from_wall=3.0, turns=turns)
        for may_turn, each_score in zip((0.0, 5.0), scores, strict=True):
            these = among(around([row], 3.0), 9.0, may_turn=may_turn)
            core.judge_path(these, path, core.lay_path(these, 8.0, 0.0, path), 0.0, each_score)
        assert scores[0, 4] > 0.0
        assert (scores[1, 4] == scores[0, 4] - 5.0) == less and (scores[1, 4] == scores[0, 4]) != less


@each("seed", range(12))
def test_motions_are_free_by_a_slow_check_of_discs_and_intervals(seed):
    """Every motion that counts as free keeps away from a thing wherever it may be, in steps of 5 ms."""
    rng = np.random.default_rng(seed)
    heading, speed, way = rng.uniform(-3.0, 3.0), rng.uniform(0.3, 1.5), rng.uniform(0.3, 2.0)
    row = target(
        rng.uniform(0.8, 4.0), rng.uniform(-1.0, 1.0), speed * math.cos(heading), speed * math.sin(heading), to_wall=way
    )  # fmt: skip
    rows, now = row[np.newaxis], rng.uniform(0.0, 4.0)
    path = np.zeros((56, 6))
    place, widened = (rng.uniform(1.0, 3.0), rng.uniform(-0.8, 0.8)), np.full(1081, 20.0)
    these = among(around(rows, now, widened=widened, angle=rng.uniform(-0.2, 0.2)), 1.0)
    free = core.lay_path(these, *place, path)
    assert free == 112
    offsets = np.array((CAR.length - CAR.rear_overhang - 0.25 * CAR.width, CAR.lidar_offset, 0.0))
    for profile in core.PROFILES:
        gap, _ = core.try_profile(these, path, free, profile, False)
        times, *poses = np.array(list(driven(path, profile, now))).T
        x, y, cos, sin = (each[:, None, None] for each in poses)
        along = np.linspace(*np.array([occupied(row, time, 0.0) for time in times]).T, 9, axis=1)[:, None]
        ahead, aside = x + offsets[:, None] * cos, y + offsets[:, None] * sin
        least = np.hypot(ahead - row[0] - along * row[2], aside - row[1] - along * row[3]).min()
        assert gap < -USED or least > these.reaches[0] + min(gap, 0.0) - 0.12  # a step is up to .4 m long


CAR_ROW = LIMITER["car"]


def driven(path, profile, speed):
    """Times, places and headings of a profile on a path, in steps of 5 ms, without the limiter's jerk."""
    time = way = 0.0
    while time < 4.0 and way < 0.15 * 54:
        point = int(way / 0.15)
        share = max(1.0 - speed**2 * abs(path[point, 4]) / LIMITER["lateral"] - path[point, 5], 0.1)
        aim = 0.0
        if time < profile[1]:
            aim = 4.0 * profile[0]
        elif time < profile[1] + profile[3]:
            aim = 4.0 * profile[2]
        aim = min(aim, math.sqrt(9.0 + LIMITER["braking"] * max(1.0 - way, 0.0)))
        faster, slower = 0.8 * share * LIMITER["accelerating"] * 0.005, 0.9 * share * LIMITER["braking"] * 0.005
        speed = min(aim, speed + faster) if aim > speed else max(aim, speed - slower)
        way, time = way + 0.005 * speed, time + 0.005
        part = way / 0.15 - point
        x, y = path[point, :2] + min(part, 1.0) * (path[point + 1, :2] - path[point, :2])
        yield time, x, y, path[point, 2], path[point, 3]
        if speed == 0.0 and aim == 0.0:
            return


def test_the_car_goes_on_where_it_is_past_in_time_and_waits_outside_the_lane_where_it_is_not():
    passes = decide([target(3.0, -1.1, 0.0, 0.4, to_wall=2.2)], 4.0)
    assert passes[0] == planned.DRIVES and passes[2] > 2.5
    waits = decide([target(1.6, -0.7, 0.0, 1.0, to_wall=2.0, from_wall=0.5)], 1.0, widened=corridor(0.8))
    assert waits[0] == planned.DRIVES and waits[2] < 1.0


def test_a_car_in_the_lane_of_what_comes_drives_on_or_backs_off_and_does_not_stand():
    coming = [target(0.5, -1.5, 0.0, 1.5, to_wall=3.0, from_wall=0.5)]
    what, _, speed = decide(coming, 0.0, may_back_off=True)
    assert what == planned.BACKS_OFF or (what == planned.DRIVES and speed > 0.5)
    closed = np.minimum(corridor(0.5), 0.75)  # there is no way ahead
    assert decide(coming, 0.0, widened=closed, may_back_off=True)[0] == planned.BACKS_OFF
    plan = np.zeros(1, planned.PLAN_IN_TIME)[0]
    backs = [decide(coming, -1.0, widened=closed, may_back_off=True, plan=plan)[0] for _ in range(50)]
    assert backs == 40 * [planned.BACKS_OFF] + 10 * [backs[-1]] and backs[-1] != planned.BACKS_OFF  # 1 m
    decide(coming, 1.0, widened=closed, plan=plan)
    assert plan["backed"] == 0.0  # it has driven since


@each("speed", np.arange(1.0, 5.0, 0.25))
def test_a_stop_in_the_lane_of_what_crosses_is_no_end_also_while_it_goes_away(speed):
    rows, path = np.array([target(2.0, -0.9, 0.0, -0.8, to_wall=1.0, from_wall=2.5)]), np.zeros((56, 6))
    widened = np.full(1081, 20.0)
    here = around(rows, speed, widened=widened)
    here.memory["acceleration"] = -LIMITER["braking"]
    these = among(here, 9.0)
    free = core.lay_path(these, 4.0, 0.0, path)
    gap, _ = core.try_profile(these, path, free, (0.0, 0.0, 0.0, 0.0), False)
    *_, (_, x, _, _, _) = driven(path, (0.0, 0.0, 0.0, 0.0), speed)
    front = CAR.length - CAR.rear_overhang - 0.25 * CAR.width
    apart = min(abs(x + offset - 2.0) for offset in (front, CAR.lidar_offset, 0.0)) - these.reaches[0] - LANE
    assert abs(apart) < 0.12 or (gap < -USED) == (apart < 0.0)


def test_a_car_that_has_waited_passes_what_is_known_and_no_sooner():
    known = target(1.15, 0.32, 0.0, -0.36, to_wall=0.7, from_wall=0.4, turns=2.0)
    for waited, passes in ((0.0, False), (10.0, True)):
        plan = np.zeros(1, planned.PLAN_IN_TIME)[0]
        plan["waited"] = waited
        assert (decide([known], 0.0, widened=corridor(0.9), plan=plan)[2] > 0.3) == passes


@each(("speed", "what"), ((1.0, planned.DRIVES), (3.0, planned.NO_PLAN), (4.0, planned.NO_PLAN)))
def test_a_motion_after_which_the_car_cannot_stop_before_a_wall_is_none(speed, what):
    wall = np.minimum(corridor(1.4), 0.9)
    assert decide([target(3.0, -1.1, 0.0, 0.4, to_wall=2.2)], speed, widened=wall)[0] == what


def test_a_car_that_stands_before_a_wall_backs_off_where_nothing_comes_by():
    """Things nearby keep it from turning in moves, and it would stand there for good."""
    wall = np.minimum(corridor(1.4), 0.45)
    for way, waited, backs in ((0.3, 0.0, False), (0.3, 3.0, True), (0.9, 3.0, False)):
        plan = np.zeros(1, planned.PLAN_IN_TIME)[0]
        plan["waited"] = waited
        beside = target(-0.95, 0.9, 0.0, -0.7, to_wall=way)
        what, _, _ = decide([beside], 0.0, widened=wall, plan=plan, may_back_off=True)
        assert (what == planned.BACKS_OFF) == backs, (way, waited)


def test_past_what_is_near_the_car_goes_slowly():
    beside = target(1.5, -0.9, -0.5, 0.0)
    assert decide([beside], 3.0, onwards=8.0)[2] < 4.5 < decide([target(7.5, -0.9, -0.5, 0.0)], 3.0, onwards=8.0)[2]


HOSTILE = {
    "faster than the car": lambda t: box(8.0 - 12.0 * t, 0.0),
    "through the car": lambda t: box(-3.0 + 3.0 * t, 0.1 * t),
    "from inside the car": lambda t: box(0.2 + 0.8 * t, 0.0, 0.1, 0.1),
    "never moves": lambda t: box(2.0, 0.3),
    "eight at once": lambda t: sum((box(2.0 + 0.6 * k, math.sin(k + 3.0 * t), 0.2, 0.2) for k in range(8)), ()),
}


@each("name", HOSTILE)
def test_hostile_things_give_commands_within_limits_and_half_a_scan_does(name):
    planner = make_controller("gap_finder", car=CAR, mu=MU, max_speed=8.0, settings={})
    for tick in range(60):
        ranges = ranges_of(WALLS + HOSTILE[name](tick * PERIOD), x=CAR.lidar_offset)
        if tick % 7 == 6:
            ranges[540:] = math.nan  # half of it is missing
        command = planner(scan_of(ranges), odometry_of(2.0))
        assert math.isfinite(command.speed) and -1.5 <= command.speed <= 8.0
        assert abs(command.steering_angle) <= CAR.max_steering_angle


def test_a_car_before_what_blocks_the_way_at_all_times_stops_and_says_why():
    planner = make_controller("gap_finder", car=CAR, mu=MU, max_speed=8.0, settings={})
    speed, x = 3.0, 0.0
    for tick in range(160):
        walls = WALLS + box(8.0, 0.3 * math.sin(4.0 * tick * PERIOD), 0.3, 2.4)
        command = planner(scan_of(ranges_of(walls, x=x + CAR.lidar_offset)), odometry_of(speed))
        speed = min(max(command.speed, speed - 6.0 * PERIOD), speed + 4.0 * PERIOD)
        x += speed * PERIOD
    assert x < 7.3 and abs(speed) < 0.5 and planner.reasons()


def test_races_among_what_moves_finish():
    """Of the twelve of seeds 200 and 201 ten do; without the plan seven did."""
    finished = [
        fg.race(track, "gap_finder", moving="box,crossing,pedestrian", obstacle_seed=seed, max_speed=8.0, laps=1)
        .car.finished
        for track in ("oval", "l_corridor", "hairpins", "chicanes", "fast", "tight")
        for seed in (200, 201)
    ]  # fmt: skip
    assert sum(finished) >= 8
