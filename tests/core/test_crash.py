"""A crash says into what, where, when and at what speed, in the table, the summary, the report and the picture."""

import math

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.racing.crash import crash_of
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.telemetry import TELEMETRY
from fg_mujoco.simulation.termination import END_REASONS
from fg_mujoco.vehicle.car import WHEELS
from hand_planners import driven


def wall_distance(track, point):
    """Of a point from the nearest corner-to-corner line of the two edges [m]."""
    edges = [np.asarray(edge) for edge in track.edges]
    starts, ends = (np.concatenate(parts) for parts in (edges, [np.roll(edge, -1, axis=0) for edge in edges]))
    along = ends - starts
    share = np.clip(((point - starts) * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
    return np.hypot(*(point - starts - share[:, None] * along).T).min()


@each(("steering", "side"), ((0.2, "left wall"), (-0.2, "right wall")))
def test_the_wall_on_the_side_that_the_car_steers_to(steering, side):
    result = fg.race("oval", driven((steering, 2.0)), laps=1)
    crash = result.car.crash
    assert (result.car.end_reason, crash.into) == ("crash", side)
    assert wall_distance(result.world.track, (crash.x_m, crash.y_m)) < 0.02
    # the contact is on the chassis, which is .31 x .58 m
    pose = np.array([result.car.column(name)[-1] for name in ("x_m", "y_m")])
    assert math.dist(pose, (crash.x_m, crash.y_m)) < math.hypot(0.58, 0.31)
    assert result.car.column("time_s")[-1] <= crash.time_s < result.sim_time_s
    assert crash.speed_m_s == pytest.approx(result.car.column("speed_m_s")[-1], abs=0.05)
    assert (crash.lap, crash.s_m) == (1, pytest.approx(result.car.column("progress_m")[-1], abs=2.0 * 0.025))
    assert crash.geom.startswith("wall_") and crash.geom in result.world.xml


def test_a_box_ahead_is_hit_at_its_face_by_its_number():
    boxes = (fg.Box(x=8.0, y=0.9, length=0.2, width=0.2), fg.Box(x=5.0, y=0.05, length=0.4, width=0.3))
    result = fg.race("oval", driven((0.0, 3.0)), laps=1, obstacles=boxes)
    crash = result.car.crash
    assert (crash.into, crash.geom) == ("obstacle 1", "obstacle_1")
    assert crash.x_m == pytest.approx(4.8, abs=0.02) and -0.11 <= crash.y_m <= 0.21
    assert crash.speed_m_s == pytest.approx(3.0, abs=0.1)
    car = result.world.parameters
    front = crash.x_m - (car.length - car.rear_overhang)
    reached = np.interp(front, result.car.column("x_m"), result.car.column("time_s"))
    assert crash.time_s == pytest.approx(reached, abs=0.026)
    assert str(crash).startswith(f"hit obstacle 1 at ({crash.x_m:.2f}, {crash.y_m:.2f}) m, ")


def skids(odometry):
    """Turn in, and back again, at a speed that the tires do not hold."""
    before = odometry.stamp < 1.2
    return 0.0 if before else 0.4 if odometry.stamp < 1.7 else -0.4, 6.0 if before else 12.0


def test_a_car_that_slides_into_the_wall_is_told_at_its_speed_over_the_ground_and_how_long_which_tires_had_slid():
    result = fg.race("oval", driven(skids), laps=1, mu=0.3)
    crash, column = result.car.crash, result.car.column
    # the car's last rows, carried on to the contact; the speed along the heading is another
    ground = np.hypot(column("vx_m_s"), column("vy_m_s"))
    assert crash.speed_m_s == pytest.approx(2.0 * ground[-1] - ground[-2], abs=0.1)
    assert crash.speed_m_s > abs(column("speed_m_s")[-1]) + 0.5
    assert crash.sideslip_rad == pytest.approx(column("sideslip_rad")[-1], abs=0.1)
    for wheel in WHEELS:
        whole = column(f"slide_{wheel}_m_s")[:-1] <= 0.01
        since = len(whole) - int(np.argmax(np.append(whole[::-1], True)))  # behind the last tick in which it held
        slid = crash.time_s - column("time_s")[since] if since < len(whole) else 0.0
        assert getattr(crash, f"slid_{wheel}_s") == pytest.approx(slid)
    assert crash.slid_front_left_s > 0.2
    degrees = math.degrees(abs(crash.sideslip_rad))
    assert f", {crash.speed_m_s:.1f} m/s, {degrees:.0f} degrees of sideslip; had slid: " in str(crash)


def test_a_moving_obstacle_a_dead_end_and_a_wall_behind():
    leader = fg.race("scene:slow_leader:0", driven((0.0, 4.0)))
    assert (leader.car.crash.into, leader.car.crash.geom) == ("moving obstacle 0", "moving_0")
    (obstacle,) = leader.world.moving
    low, high = (corner(obstacle.corners(leader.car.crash.time_s), axis=0) for corner in (np.min, np.max))
    place = np.array((leader.car.crash.x_m, leader.car.crash.y_m))
    assert (low - 0.03 <= place).all() and (place <= high + 0.03).all()
    end = fg.race("scene:dead_end:0", driven((0.0, 4.0)))
    assert str(end.car.crash).startswith("hit the wall across the course at (")
    reverses = fg.race("oval", driven((0.3, -2.0)), laps=1).car  # rolls, with 11 degrees of sideslip
    behind = reverses.crash
    assert behind.speed_m_s == pytest.approx(-reverses.column("speed_m_s")[-1], abs=0.05)
    assert str(behind).endswith(f", {behind.speed_m_s:.1f} m/s in reverse")


def test_a_car_that_is_in_a_wall_at_the_beginning_has_crashed_at_once():
    """A race refuses such a start; runs of earlier versions have it."""
    engine = Engine(fg.World("oval"), laps=1)
    engine.place([fg.Start(offset=1.05)])
    states, ctrl = engine.state(0)[np.newaxis], np.empty((0, 2))
    telemetry = np.empty((0, len(TELEMETRY)))
    crash = crash_of(engine.world, states, ctrl, telemetry, engine.monitor.timers[0], 1, engine.period)
    assert END_REASONS[engine.monitor.reasons[0]] == "crash"
    assert (crash.into, crash.time_s, crash.speed_m_s) == ("left wall", 0.0, 0.0)
