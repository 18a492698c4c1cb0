"""Guidance: planners that would turn back, or stop in a pocket, are led to the frontier."""

import math

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.controllers.control.planner_settings import for_car
from fg_mujoco.controllers.perception.scan_geometry import geometry_record
from fg_mujoco.controllers.safety.guidance import GuidanceSettings, speed_to_stop
from fg_mujoco.racing.planners import make_controller
from fg_mujoco.vehicle.tire_slip import SLIDING_SPEED
from scan_worlds import CAR, MU, corridor, odometry_of, scan_of


def finder():
    return make_controller("gap_finder", car=CAR, mu=MU, max_speed=8.0)


@pytest.mark.slow
@each(
    ("circuit", "without"),
    [("spiral", "no_progress"), ("maze", "no_progress"), ("boxes", "no_progress"), ("random:1:tight", "no_progress")],
)
def test_a_lap_that_the_planner_does_not_finish_on_its_own_is_finished(circuit, without):
    guided, alone = (fg.race(circuit, "gap_finder", laps=1, max_speed=4.0, assist=each) for each in ("full", "safe"))
    assert guided.car.finished and guided.car.collisions_wall == 0 and guided.car.max_slide_m_s <= SLIDING_SPEED
    assert alone.car.end_reason == without


@each("seed, without", [(0, "wrong_way"), (1, "wrong_way"), (2, "wrong_way"), (3, "wrong_way")])
def test_out_of_the_trap_it_goes_on_and_without_guidance_turns_back_or_stands(seed, without):
    guided, alone = (
        fg.race(f"scene:u_turn_trap:{seed}", "gap_finder", max_speed=8.0, assist=assist) for assist in ("full", "safe")
    )
    assert guided.car.finished and guided.car.collisions_wall == 0 and guided.car.max_slide_m_s <= SLIDING_SPEED
    assert alone.car.end_reason == without and alone.car.collisions_wall == 0


@each("seed", range(4))
def test_in_a_dead_end_it_stops_and_touches_nothing(seed):
    race = fg.race(f"scene:dead_end:{seed}", "gap_finder")
    assert race.car.finished and race.car.collisions_wall == 0
    assert abs(race.car.column("speed_m_s")[-1]) < 0.1


@each(("seed", "laps"), [(138, 1), (154, 1), (228, 1), (241, 3)])
def test_where_its_motion_is_given_up_the_car_still_stops_and_leaves_a_line_that_turns_back(seed, laps):
    """Without the last stop it ran into a wall after 2 s; on its line, which has a cusp, in the third lap."""
    car = fg.race(f"random:{seed}:tight", "gap_finder", laps=laps, max_speed=8.0).car
    assert car.finished and car.collisions_wall == 0


@each("blind", [scan_of(np.zeros(1081)), scan_of([]), scan_of(np.full(1081, math.nan))])
def test_the_place_is_kept_in_ticks_in_which_nothing_is_seen(blind):
    planner = finder()
    for scan in (corridor(1.0, 1.0, 20.0), blind):
        for _ in range(20):
            planner(scan, odometry_of(2.0))
    world = planner._alone._ticks[0]["memory"]["guidance"]["frontier"]["map"]
    assert world["x"] == pytest.approx(39 * 2.0 * 0.025)  # the first tick has nothing to come from


@each("ahead", [0.2, 1.0, 2.5])
def test_without_a_frontier_the_speed_is_that_from_which_the_car_stops_ahead_of_a_wall(ahead):
    """Oracle: v^2 = 2 a d, with d from the bumper to the stop margin ahead of the wall."""
    driver, scan = finder().driver[0], corridor(1.0, 1.0, ahead=ahead)
    settings, limiter = driver["guidance_settings"], driver["limiter"]
    own = for_car(GuidanceSettings(), CAR)
    room = max(ahead - (CAR.length - CAR.rear_overhang - CAR.lidar_offset) - own.stop_margin, 0.0)
    expected = math.sqrt(2.0 * own.profile_braking * limiter["braking"] * room)
    scan_row, limiter, settings = (np.rec.array(row)[()] for row in (geometry_record(scan)[0], limiter, settings))
    assert speed_to_stop(scan_row, scan.ranges, limiter, settings) == pytest.approx(expected, rel=1e-3)


@each("way_round", [1, -1])
def test_on_a_lap_as_short_as_its_memory_it_is_no_slower_than_without_guidance(way_round, tmp_path):
    """A ring of 12 m, of which the map has all after a lap: nothing is unseen, and there is no frontier."""
    angles = way_round * np.linspace(0.0, 2.0 * np.pi, 150, endpoint=False)
    rows = [f"{2.2 * math.cos(a):.5f}, {1.6 * math.sin(a):.5f}, 0.62, 0.62" for a in angles]
    path = tmp_path / "ring.csv"
    path.write_text("# x_m, y_m, w_tr_right_m, w_tr_left_m\n" + "\n".join(rows) + "\n")
    laps, alone = (fg.race(path, laps=4, assist=each).car.lap_times_s for each in ("full", "safe"))
    assert len(laps) == len(alone) == 4 and sum(laps[1:]) < 1.02 * sum(alone[1:])
