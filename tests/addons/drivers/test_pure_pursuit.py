"""Pure pursuit and the other trackers of a line: closed forms, Riccati's equation, lines near themselves, open ends."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.drivers.line_trackers import lqr_feedback
from fg_mujoco.addons.drivers.pure_pursuit import PurePursuit, PurePursuitSettings
from fg_mujoco.controllers.control.slip import steered
from fg_mujoco.controllers.gap_finder import GapFinderSettings
from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter
from fg_mujoco.errors import ControllerError, SettingsError
from fg_mujoco.messages import MapLine
from scan_worlds import CAR, MU, corridor, odometry_of, rows_of
from vehicle_worlds import open_file

OPEN = corridor(5.0, 5.0)
TURNS = np.linspace(0.0, 2.0 * math.pi, 720, endpoint=False)


def circle(radius, direction=1):
    return MapLine(points=radius * np.column_stack((np.cos(TURNS), direction * np.sin(TURNS))), closed=True)


STRAIGHT = MapLine(points=np.array([[0.0, 0.0], [30.0, 0.0]]), closed=False)


def pursuer(map_line=STRAIGHT, mu=MU, max_speed=8.0, **changes):
    return PurePursuit(CAR, mu, max_speed, PurePursuitSettings(**changes), map_line=map_line)


def at(x, y, heading, speed=0.0, steering_angle=0.0):
    return replace(odometry_of(speed, steering_angle), pose=(x, y, heading))


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


@each("offset, tracker", [(0.5, "auto"), (-1.5, "auto"), (4.0, "auto"),
                          *product((0.3, -1.5), ("stanley", "lqr", "map", "mpc"))])  # fmt: skip
def test_it_joins_the_line_and_stays_on_it(offset, tracker):
    line = MapLine(points=np.array([[0.0, 0.0], [100.0, 0.0]]), closed=False)
    trace = driven(pursuer(line, max_speed=4.0, tracker=tracker), (0.0, offset, 0.5), 500)
    settled = trace[trace[:, 0] > 38.0]
    assert len(settled) > 10 and np.abs(settled[:, 1]).max() < 0.02
    assert tracker != "auto" or (np.sign(offset) * trace[:, 1]).min() > -0.3  # nor does it swing far across


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


def test_a_line_that_is_no_lap_of_the_course_is_refused(tmp_path):
    path = tmp_path / "raceline.csv"
    course = replace(circle(4.0), walls=(circle(5.0).points, circle(3.0).points))
    for points, said in (
        (np.add(circle(4.0).points, (9.0, 0.0)), r"outside of the course, as at \(13.00, 0.00\); accepted: a line"),
        (np.tile(circle(4.0).points, (2, 1)), "is 50.3 m long, the course 25.1 m; accepted: one lap of it"),
    ):
        np.savetxt(path, points, delimiter=",")
        with pytest.raises(SettingsError, match=said):
            pursuer(course, line=str(path))


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
    car = fg.race("l_corridor", "pure_pursuit", laps=1, tires="coulomb", vehicle=open_file()).car
    assert car.finished and car.max_slide_m_s <= 0.05 and np.abs(car.column("offset_m")).max() < 0.5


# other trackers


@each("length", [0.3, 0.8, 2.0])
def test_the_regulator_solves_riccatis_equation(length):
    a, b = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]])
    gain = b.T @ solve_continuous_are(a, b, np.diag([length**-4, 0.0]), np.eye(1))
    for aside, angle in ((0.1, 0.0), (0.0, 0.2), (-0.3, 0.1)):
        assert lqr_feedback(aside, angle, length) == pytest.approx(-(gain @ [aside, angle])[0], rel=1e-9)


def test_stanleys_law_on_a_straight_line():
    command = pursuer(mu=math.inf, tracker="stanley")(OPEN, at(5.0, 0.1, -0.05, 2.0))
    front = 0.1 - CAR.wheelbase * math.sin(0.05)
    assert command.steering_angle == pytest.approx(0.05 - math.atan(2.5 * front / 2.0), rel=1e-9)


@each("direction, tracker", product((1, -1), ("stanley", "lqr", "map", "mpc")))
def test_on_a_circle_it_stays(direction, tracker):
    trace = driven(pursuer(circle(2.0, direction), tracker=tracker), (2.0, 0.0, direction * math.pi / 2), 300)
    assert np.abs(np.hypot(trace[:, 0], trace[:, 1]) - 2.0).max() < 0.06


@each("stiffnesses", [(4.7, 5.5), (5.5, 4.7)])
@each("speed, curvature", [(2.0, 0.3), (5.0, -0.1), (5.0, 0.2)])
def test_the_look_up_steers_the_single_track_car_along_a_steady_curve(speed, curvature, stiffnesses):
    front, rear = stiffnesses
    car = replace(CAR, front_cornering_stiffness=front, rear_cornering_stiffness=rear, front_peak=1.0, rear_peak=1.0,
                  front_peak_slip=math.inf, rear_peak_slip=math.inf, relaxation_length=0.01, shaft=False)  # fmt: skip
    limiter = FrictionLimiter(car, 1.0).record[0]
    slip, row = limiter["slip"], limiter["car"]
    arc = math.atan(car.wheelbase * curvature)
    steering = steered(slip, row, arc, speed)
    if front > rear:
        assert steering == arc
        return
    gradient = (1.0 / front - 1.0 / rear) / car.gravity  # of a car on linear axles, at mu 1
    assert steering / (car.wheelbase + gradient * speed**2) == pytest.approx(curvature, rel=0.01)


def test_map_laps_on_tires_that_need_slip_angles():
    planner = "pure_pursuit[line=raceline,margin=0.2,tracker=map]"
    car = fg.race("hairpins", planner, laps=1, tires="f1tenth_gym").car
    assert car.end_reason == "finished" and math.isnan(car.max_slide_m_s)  # these tires have no peak to slide past


def test_a_planner_with_other_settings_needs_a_reference_of_its_own():
    """The native one would read them as those that it knows."""
    with pytest.raises(ControllerError, match="Other has other Settings or another memory_type than its native"):

        class Other(PurePursuit):
            Settings = GapFinderSettings
