"""Pure pursuit: on circles in closed form, its way along lines that are near themselves, and the end of an open one."""

import dataclasses
import math
from itertools import product

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.drivers.pure_pursuit import PurePursuit, PurePursuitSettings
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import MapLine
from scan_worlds import CAR, MU, corridor, odometry_of, rows_of

OPEN = corridor(5.0, 5.0)
TURNS = np.linspace(0.0, 2.0 * math.pi, 720, endpoint=False)


def circle(radius, direction=1):
    return MapLine(points=radius * np.column_stack((np.cos(TURNS), direction * np.sin(TURNS))), closed=True)


STRAIGHT = MapLine(points=np.array([[0.0, 0.0], [30.0, 0.0]]), closed=False)


def pursuer(map_line=STRAIGHT, mu=MU, max_speed=8.0, **changes):
    return PurePursuit(CAR, mu, max_speed, PurePursuitSettings(**changes), map_line=map_line)


def at(x, y, heading, speed=0.0, steering_angle=0.0):
    return dataclasses.replace(odometry_of(speed, steering_angle), pose=(x, y, heading))


def driven(planner, pose, ticks, speed=0.0):
    """Drive a kinematic car by a planner: its x [m], y [m], heading [rad] and speed [m/s] at each tick. (ticks, 4)."""
    (x, y, heading), angle, trace = pose, 0.0, []
    for _ in range(ticks):
        trace.append((x, y, heading, speed))
        command = planner(OPEN, at(x, y, heading, speed, angle))
        angle = command.steering_angle
        for _ in range(5):
            speed += (command.speed - speed) * 0.05
            x += 0.005 * speed * math.cos(heading)
            y += 0.005 * speed * math.sin(heading)
            heading += 0.005 * speed * math.tan(angle) / CAR.wheelbase
    return np.array(trace)


@each("heading, direction, radius", product((0.0, 2.0 * math.pi, -6.0 * math.pi), (1, -1), (1.5, 4.0, 10.0)))
def test_on_a_circle_it_steers_along_it(heading, direction, radius):
    # any chord of a circle, from a tangent at its one end, is led through by the arc that is the circle
    planner = pursuer(circle(radius, direction), mu=math.inf)
    command = planner(OPEN, at(radius, 0.0, direction * math.pi / 2 + heading, 1.0))
    expected = direction * math.atan(CAR.wheelbase / radius)
    assert command.steering_angle == pytest.approx(expected, rel=0.02)


def test_the_goal_is_a_lookahead_away_which_grows_with_the_speed_and_the_distance():
    planner = pursuer(least_lookahead=0.8, lookahead_time=0.2, joining_lookahead=3.0)
    for speed, lookahead in ((0.0, 0.8), (2.0, 0.8), (6.0, 1.2)):
        assert planner.find_goal(at(5.0, 0.0, 0.0, speed)) == pytest.approx((5.0 + lookahead, 0.0), abs=0.11)
    x, y = planner.find_goal(at(5.0, 1.0, 0.0, 0.0))
    assert math.hypot(x - 5.0, y - 1.0) == pytest.approx(3.8, abs=0.11)


@each("offset", [0.5, -1.5, 4.0])
def test_it_joins_the_line_and_stays_on_it(offset):
    line = MapLine(points=np.array([[0.0, 0.0], [100.0, 0.0]]), closed=False)
    trace = driven(pursuer(line, max_speed=4.0), (0.0, offset, 0.5), 500)
    settled = trace[trace[:, 0] > 38.0]
    assert len(settled) > 10
    assert np.abs(settled[:, 1]).max() < 0.02
    assert (np.sign(offset) * trace[:, 1]).min() > -0.3  # nor does it swing far across


def test_where_the_line_runs_close_by_itself_it_stays_on_its_stretch():
    # there and back, half a metre apart: beside the way back it is still on the way there
    hairpin = MapLine(points=np.array([[0.0, 0.0], [20.0, 0.0], [20.0, 0.5], [0.0, 0.5]]), closed=False)
    planner = pursuer(hairpin, mu=math.inf)
    planner(OPEN, at(5.0, 0.0, 0.0, 1.0))
    assert -0.4 < planner(OPEN, at(5.2, 0.45, 0.0, 1.0)).steering_angle < 0.0
    # seen there for the first time it is on the way back, and has to turn round
    planner.reset()
    assert abs(planner(OPEN, at(5.2, 0.45, 0.0, 1.0)).steering_angle) == CAR.max_steering_angle


@each("points", [[[0.0, 0.0], [25.0, 0.0]], [[0.0, 0.0], [10.0, 0.0], [15.0, 5.0], [15.0, 12.0]]])
def test_at_the_end_of_an_open_line_it_stands(points):
    line = MapLine(points=np.array(points), closed=False)
    trace = driven(pursuer(line), (0.0, 0.0, 0.0), 600)
    assert math.dist(trace[-1, :2], points[-1]) < 0.3
    assert abs(trace[-1, 3]) < 0.01
    assert trace[:, 3].max() > 3.0


@each("pose", [(math.nan,) * 3, (0.0, math.nan, 0.0), (0.0, 0.0, math.inf)])
def test_without_a_pose_it_brakes(pose):
    braking = pursuer()(OPEN, at(*pose, speed=3.0, steering_angle=0.1))
    assert braking.speed < 3.0 and braking.steering_angle == pytest.approx(0.1)
    assert pursuer().find_goal(at(*pose)) is None


def test_it_does_not_see_obstacles_unless_its_law_does():
    """The limit of a map: what is not on it is not there."""
    blocked, here = corridor(5.0, 5.0, ahead=1.0), at(5.0, 0.0, 0.0, 2.0)
    assert pursuer()(blocked, here) == pursuer()(OPEN, here)
    assert pursuer(assist="safe")(blocked, here).speed < 2.0 < pursuer()(blocked, here).speed


def test_a_raceline_is_followed_in_place_of_the_centreline(tmp_path):
    path = tmp_path / "raceline.csv"
    points = circle(6.0).points
    rows = [f"0;{x};{y};0;0;3.0;0" for x, y in points]
    path.write_text("# s_m; x_m; y_m; psi_rad; kappa_radpm; vx_mps; ax_mps2\n" + "\n".join(rows) + "\n")
    profile = pursuer(circle(4.0), line=str(path)).speed_profile()
    np.testing.assert_allclose(np.hypot(profile[:, 0], profile[:, 1]), 6.0, rtol=1e-3)
    np.testing.assert_allclose(profile[:, 2], 3.0)


@each("direction", [1, -1])
def test_a_raceline_against_the_course_is_refused_with_the_option_that_turns_the_course(direction, tmp_path):
    path = tmp_path / "raceline.csv"
    path.write_text("\n".join(f"{x},{y},1,1" for x, y in circle(4.0, direction).points) + "\n")
    assert pursuer(circle(6.0, direction), line=str(path)).speed_profile().size
    way, course = ("counterclockwise", "clockwise")[::direction]
    with pytest.raises(SettingsError, match=rf"goes {way}, the course {course}; accepted: .*\[direction={way}\]"):
        pursuer(circle(6.0, -direction), line=str(path))


def test_in_a_batch_each_follows_its_own_line_as_alone():
    lines = [circle(4.0), STRAIGHT, circle(4.0), circle(9.0, -1)]
    poses = [at(4.0, 0.1, 1.5, 1.0), at(3.0, 0.2, 0.0, 2.0), at(0.0, 4.0, 3.1, 3.0), at(9.0, 0.0, -1.5, 2.5)]
    planners = [pursuer(line) for line in lines]
    batch, commands = PurePursuit.batch(planners), np.zeros((4, 2))
    for _ in range(3):
        batch(OPEN, np.tile(OPEN.ranges, (4, 1)), rows_of(poses), np.ones(4, bool), commands)
        alone = [planner(OPEN, pose) for planner, pose in zip(planners, poses, strict=True)]
        assert commands.tolist() == [[command.steering_angle, command.speed] for command in alone]


def test_it_drives_a_circuit_close_to_the_centreline():
    car = fg.race("l_corridor", "pure_pursuit", laps=1).car
    assert car.finished and car.max_slide_m_s <= 0.05 and np.abs(car.column("offset_m")).max() < 0.5
