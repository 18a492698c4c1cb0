"""Moving targets in the scan: what moves is found soon and measured, and what stands is not taken to move.

The worlds are flat, and truth is a closed form of the time.
"""

import math

import numpy as np
import pytest

from cases import each
from fg_mujoco.controllers.perception.targets import TARGETS, track_targets
from moving_worlds import GEOMETRY, PERIOD, WALLS, box, moving, odometry_row, ranges_of, watched
from scan_worlds import CAR


def crossing(time, speed=0.8):
    return WALLS + box(6.0, -0.8 + speed * time), ()


@each("noisy", (False, True))
@each(("speed", "yaw_rate"), ((0.0, 0.0), (3.0, 0.0), (2.0, 0.25)))
@each(
    ("velocity", "thing"),
    (
        ((0.0, 0.8), lambda x, y: (box(x, y), ())),
        ((0.0, -1.2), lambda x, y: ((), ((x, y, 0.15),))),
        ((1.0, 0.3), lambda x, y: (box(x, y, 0.5, 0.3), ())),
    ),
)
def test_the_velocity_of_what_moves_is_that_of_the_closed_form(velocity, thing, speed, yaw_rate, noisy):
    vx, vy = velocity

    def world(time):
        segments, discs = thing(6.0 + vx * time, -0.5 * vy + vy * time)
        return WALLS + segments, discs

    memory, known = watched(world, 32, speed, yaw_rate, noise=np.random.default_rng(1) if noisy else None)
    (target,) = moving(memory)
    assert known <= 16  # 0.4 s
    assert (target["vx"], target["vy"]) == pytest.approx(velocity, abs=0.15 if noisy else 0.1)
    middle = target["ends"].mean(axis=0) + np.array((CAR.lidar_offset, 0.0))
    truth = (6.0 + 31 * 0.025 * vx, -0.5 * vy + 31 * 0.025 * vy)
    assert middle == pytest.approx(truth, abs=0.16)  # how long the box is behind its face is not seen


def test_what_crosses_slowly_is_found_from_a_fast_car():
    """Odometry that errs shifts a box ahead towards the car, and not aside: 0.1 m of motion aside is enough."""
    end = ((25.0, -1.4), (25.0, 1.4))  # in view: beams without a return prove nothing that far away
    _, known = watched(lambda time: ((*WALLS, end, *box(13.0, -0.6 + 0.4 * time)), ()), 48, speed=8.0)
    assert known is not None
    assert known * PERIOD < 0.7  # it is near enough to be tracked after 0.1 s


def test_a_wall_that_slides_along_itself_does_not_move_nor_does_one_that_ends():
    """The aperture problem: the LiDAR cannot see that a long wall slides; its end, seen in passing, goes round it."""

    def world(time):
        return (*WALLS, ((3.0 - time, 0.5), (9.0 - time, 0.5)), ((4.0, -0.6), (4.6, -1.4))), ()

    for speed in (0.0, 4.0):
        memory, known = watched(world, 40, speed)
        assert known is None and not moving(memory)


@each(("speed", "yaw_rate"), ((4.0, 0.0), (2.0, 0.6), (2.0, -1.5)))
def test_what_stands_stands_with_noise_and_odometry_that_drifts(speed, yaw_rate):
    things = WALLS + box(4.0, 0.6) + box(6.0, -0.7, 0.5, 0.3), ((3.0, -0.6, 0.1), (5.0, 0.3, 0.2), (7.0, 0.1, 0.15))
    for seed in range(3):
        noise = np.random.default_rng(seed)
        _, known = watched(lambda _: things, 60, speed, yaw_rate, drift=0.05, noise=noise)
        assert known is None


@each("yaw_rate", (0.0, 0.5, -0.8))
@each(("start", "acceleration", "drift"), ((3.0, 7.0, 0.05), (8.0, -7.0, -0.05), (7.0, -6.0, -0.05)))
def test_what_stands_stands_beside_a_car_whose_wheels_slip_as_it_turns(start, acceleration, drift, yaw_rate):
    """Wheels that slip by 0.008 of the speed for each m/s^2 err besides the odometry's own drift."""
    ends = (((3.0, -0.8), (3.0, -1.4)), ((5.0, 0.7), (7.0, 1.4)))
    for things in (box(3.0, -0.8), box(4.0, 0.9, 0.5), box(5.0, 1.1), box(9.0, -0.3), ends):
        memory, x, y, heading = np.zeros(1, TARGETS)[0], 0.0, 0.0, 0.0
        for tick in range(48):
            speed = max(start + acceleration * tick * PERIOD, 1.0)
            gained = acceleration if speed > 1.0 else 0.0
            told = odometry_row(speed * (1.0 + drift) * (1.0 + 0.008 * gained), yaw_rate * (1.0 + drift))
            ranges = ranges_of(WALLS + things, x=x + CAR.lidar_offset * math.cos(heading),
                               y=y + CAR.lidar_offset * math.sin(heading), heading=heading)  # fmt: skip
            assert track_targets(memory, GEOMETRY, ranges, told, CAR.lidar_offset, 0.0) == 0
            way, towards = (speed + 0.5 * gained * PERIOD) * PERIOD, heading + 0.5 * yaw_rate * PERIOD
            x, y, heading = x + way * math.cos(towards), y + way * math.sin(towards), heading + yaw_rate * PERIOD


def test_odometry_that_turns_faster_in_each_tick_does_not_make_things_move():
    """The mean of two yaw rates is that of the time between them; the last one alone is half a tick late."""
    memory, heading = np.zeros(1, TARGETS)[0], 0.0
    for tick in range(40):
        rate = 0.2 * tick if tick < 20 else 0.2 * (40 - tick)  # 8 rad/s^2
        ranges = ranges_of(WALLS, ((5.0, 0.5, 0.2), (6.0, -0.5, 0.2)), x=CAR.lidar_offset * math.cos(heading),
                           y=CAR.lidar_offset * math.sin(heading), heading=heading)  # fmt: skip
        assert track_targets(memory, GEOMETRY, ranges, odometry_row(0.0, rate), CAR.lidar_offset, 0.0) == 0
        heading += 0.025 * (rate + (0.2 * (tick + 1) if tick < 19 else 0.2 * (39 - tick))) / 2.0


def test_what_comes_out_of_cover_is_known_before_the_whole_of_it_is_seen():
    cover = box(4.0, -1.0, 0.3, 0.6)  # up to y = -0.7; it hides what is below -1.1 at x = 6

    def world(time):
        return WALLS[:1] + WALLS[2:] + cover + box(6.0, -1.6 + 1.0 * time), ()

    memory, known = watched(world, 29)  # its upper side, at -1.4 + t, comes out at 0.35 s; its lower one at 0.75 s
    (target,) = moving(memory)
    assert 0.35 < known * 0.025 < 0.7 and not target["own"].all()
    assert target["vy"] == pytest.approx(1.0, abs=0.15)  # the hidden end stands
    watched(world, 31, memory=memory, first=29)
    (target,) = moving(memory)
    assert target["own"].all() and target["vy"] == pytest.approx(1.0, abs=0.1)


def test_what_comes_out_of_cover_obliquely_does_not_seem_to_come_nearer():
    """Its nearest part is in cover at first: the end that is seen is where it is seen itself."""
    cover = box(3.0, -1.0, 0.3, 0.6)

    def world(time):
        y = -2.0 + 1.2 * time
        return WALLS[:1] + WALLS[2:] + cover + (((5.2, y), (6.0, y + 0.8)),), ()

    for ticks in range(24, 44, 4):
        memory, _ = watched(world, ticks)
        for target in moving(memory):
            assert target["vx"] == pytest.approx(0.0, abs=0.3), ticks


def test_what_is_gone_from_plain_view_is_forgotten_and_what_is_hidden_goes_on():
    gone, _ = watched(crossing, 30)
    assert moving(gone)
    watched(lambda _: (WALLS, ()), 8, memory=gone, first=30)
    assert not moving(gone)

    def hidden(time):
        return WALLS + box(3.0, 0.0, 0.2, 1.6) + box(6.0, -0.8 + 0.8 * time), ()

    kept, _ = watched(crossing, 30)
    watched(hidden, 8, memory=kept, first=30)
    (target,) = moving(kept)
    assert target["ends"][:, 1].mean() == pytest.approx(-0.8 + 0.8 * 37 * 0.025, abs=0.05)
    watched(hidden, 20, memory=kept, first=38)
    assert not moving(kept)


def test_what_stops_is_a_standing_thing_after_a_second_and_what_turns_back_is_measured_anew():
    def stops(time):
        return WALLS + box(5.0, -0.6 + 0.8 * min(time, 0.8)), ()

    memory, _ = watched(stops, 34)
    assert moving(memory)
    watched(stops, 60, memory=memory, first=34)
    assert not moving(memory)

    def turns_back(time):
        return WALLS + box(5.0, 0.4 - abs(0.8 - time)), ()

    memory, _ = watched(turns_back, 41)
    (target,) = moving(memory)
    assert target["vy"] == pytest.approx(-1.0, abs=0.25)
    assert target["turns"] == 1 and target["turned"][0, 1] == pytest.approx(0.4, abs=0.15)


def fro(time):
    """Where a box is that goes .8 m to and fro at 1 m/s."""
    return 0.4 - abs(time % 1.6 - 0.8)


def test_what_goes_to_and_fro_is_expected_to_turn_where_it_did_and_known_no_more_where_it_goes_on():
    memory, _ = watched(lambda time: (WALLS + box(5.0, fro(time)), ()), 100)
    off = []
    for tick in range(100, 200):  # three turns
        watched(lambda time: (WALLS + box(5.0, fro(time)), ()), 1, memory=memory, first=tick)
        (target,) = moving(memory)
        off.append(abs(target["ends"][:, 1].mean() - fro(tick * PERIOD)))
    assert target["turns"] >= 5 and max(off) < 0.03  # where it is only noticed, .05 m
    assert sorted(target["turned"][:, 1]) == pytest.approx((-0.4, 0.4), abs=0.02)

    def goes_on(time):
        return WALLS + box(5.0, fro(time) if time < 4.0 else min(0.4 + time - 4.0, 1.0)), ()

    memory, _ = watched(goes_on, 157)
    assert moving(memory)[0]["turns"] >= 2
    watched(goes_on, 18, memory=memory, first=157)
    assert all(target["turns"] == 0 and target["vy"] > 0.5 for target in moving(memory))


@each("speed", (math.nan, math.inf, 1e9))
def test_odometry_that_is_none_and_another_lidar_forget_all(speed):
    memory, _ = watched(crossing, 30)
    assert track_targets(memory, GEOMETRY, ranges_of(WALLS), odometry_row(speed), CAR.lidar_offset, 0.0) == 0
    assert (memory["targets"]["age"] == 0).all() and math.isfinite(memory["x"])
    memory, _ = watched(crossing, 30)
    assert track_targets(memory, GEOMETRY, np.full(400, 3.0), odometry_row(), CAR.lidar_offset, 0.0) == 0
    assert (memory["targets"]["age"] == 0).all()
