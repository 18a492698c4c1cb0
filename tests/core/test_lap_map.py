"""The lap map and the lap raceline, in a ring that is driven with odometry that drifts; against geometry."""

import math
from dataclasses import replace

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from drawn_worlds import BEARINGS, GEOMETRY, PERIOD, box, lines, seen_from
from fg_mujoco.controllers.control.driving import TICK
from fg_mujoco.controllers.control.slip import arc_angle
from fg_mujoco.controllers.perception.scan_filters import widen_all
from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter
from fg_mujoco.controllers.safety.judge import FREE, Plan, simulate
from fg_mujoco.controllers.safety.lap_raceline import (
    AWAY,
    ON,
    REMEMBERED,
    TRIAL,
    keep_lap,
    move_car,
    propose_line,
    see_lap,
    shape_line,
    walls_of,
)
from fg_mujoco.controllers.safety.line_following import (
    DEMAND,
    RADIUS,
    describe_line,
    line_ahead,
    on_line,
    position_on,
    speed_on,
    write_speeds,
)
from fg_mujoco.controllers.safety.motions import CURVATURE, HEADING, X, Y
from fg_mujoco.messages import ODOMETRY
from fg_mujoco.vehicle.tires import AxleTires, Coulomb, Tires
from scan_worlds import CAR, situation

RADIUS_DRIVEN = 3.0  # [m] of the circle that is driven in the ring
RING = lines(box(-4.4, -4.4, 4.4, 4.4), box(-1.5, -1.5, 1.5, 1.5))
SPEED = 3.0  # [m/s]
LIMITER = FrictionLimiter(CAR, 0.66)
INCREMENT = float(BEARINGS[1] - BEARINGS[0])
CAR_ROW = LIMITER.record[0]["car"]


def pose(way):
    """Where the car is on its circle after a way [m], counterclockwise from the bottom: x, y and heading."""
    angle = way / RADIUS_DRIVEN
    return RADIUS_DRIVEN * math.sin(angle), -RADIUS_DRIVEN * math.cos(angle), angle


def scan_at(walls, way):
    x, y, heading = pose(way)
    offset = CAR.lidar_offset
    return seen_from(walls, x + offset * math.cos(heading), y + offset * math.sin(heading), heading + BEARINGS)


def odometry(speed_error=1.0, yaw_error=1.0):
    row = np.zeros(1, ODOMETRY)
    row["speed"] = SPEED * speed_error
    row["angular_velocity"][0, 2] = SPEED / RADIUS_DRIVEN * yaw_error
    return row[0]


def drive(remembered, from_way, laps, motion, walls=RING):
    """Drive so many laps on, and return the way and the worst distance from the true place while the lap is closed."""
    way, worst = from_way, 0.0
    while way < from_way + laps * 2.0 * math.pi * RADIUS_DRIVEN:
        way += SPEED * PERIOD
        see_lap(remembered["lap"], GEOMETRY, scan_at(walls, way), motion, CAR.lidar_offset)
        if remembered["lap"]["closed"]:
            x, y, _ = pose(way)
            lap = remembered["lap"]
            worst = max(worst, math.hypot(lap["x"] - x, lap["y"] - RADIUS_DRIVEN - y))
    return way, worst


def line_of_ring():
    """The lap and the finished line of the ring, driven with exact odometry."""
    remembered = np.zeros(1, REMEMBERED)[0]
    drive(remembered, 0.0, 1.1, odometry())
    walls = walls_of(remembered["lap"], GEOMETRY, len(BEARINGS), CAR.lidar_offset)
    for _ in range(100):
        if not remembered["line"]["ready"]:
            shape_line(remembered["line"], remembered["lap"], walls, LIMITER.record[0], 8.0)
    assert remembered["line"]["ready"]
    return remembered


def test_drifting_odometry_is_corrected_once_the_lap_is_closed():
    """The odometry is off by 1 %: without correction by .1 m after a lap, and more after each."""
    remembered, motion = np.zeros(1, REMEMBERED)[0], odometry(0.99, 1.002)
    way, _ = drive(remembered, 0.0, 1.1, motion)
    assert remembered["lap"]["closed"]
    _, worst = drive(remembered, way, 1.0, motion)
    assert worst < 0.1
    assert remembered["lap"]["fits"] > 0.95


def test_the_error_of_the_dead_reckoning_is_taken_off_the_places_when_the_lap_closes():
    """The speed of the second half is off by 2 %: the last places lie .12 m off the circle before that."""
    remembered = np.zeros(1, REMEMBERED)[0]
    way, _ = drive(remembered, 0.0, 0.5, odometry())
    drive(remembered, way, 0.6, odometry(0.98, 1.0))
    lap = remembered["lap"]
    assert lap["closed"]
    last = lap["places"][lap["count"] - 5 : lap["count"]]
    assert np.hypot(last[:, 0], last[:, 1] - RADIUS_DRIVEN) == pytest.approx(RADIUS_DRIVEN, abs=0.06)


def test_the_lap_is_forgotten_where_the_scan_fits_no_longer():
    remembered = np.zeros(1, REMEMBERED)[0]
    way, _ = drive(remembered, 0.0, 1.1, odometry())
    assert remembered["lap"]["closed"]
    drive(remembered, way, 0.3, odometry(), lines(box(-6.0, -5.0, 5.2, 6.0)))
    assert not remembered["lap"]["closed"]


def test_the_line_keeps_clear_of_the_walls_and_is_faster_than_the_path():
    """The path is a circle, and the line of least radius round the box has its corners to keep clear of."""
    line = line_of_ring()["line"]
    points = line["points"][: line["count"]]
    x, y = points[:, 0], points[:, 1] - RADIUS_DRIVEN  # the lap begins at the bottom of the circle
    outer, inner = 4.4 - np.maximum(abs(x), abs(y)), np.hypot(*np.maximum(abs(np.array([x, y])) - 1.5, 0.0))
    assert np.minimum(outer, inner).min() > 0.5 * CAR.width + 0.1
    assert line["count"] * line["spacing"] < 0.93 * 2.0 * math.pi * RADIUS_DRIVEN
    bends = [line_ahead(line, k + 1, 0.0, 0.0, 0.0, LIMITER.record[0])[0, CURVATURE] for k in range(line["count"])]
    assert sum(bends) * line["spacing"] == pytest.approx(2.0 * math.pi, rel=0.02)


def test_the_whole_state_of_a_car_is_below_300_kb():
    assert TICK.itemsize + REMEMBERED.itemsize < 300_000


def test_the_car_brakes_for_a_corner_as_late_as_the_limiter_can():
    points = np.zeros((64, 7))
    points[:, RADIUS], points[40:, RADIUS] = 1e3, 0.8
    corner = LIMITER.lateral * 0.8

    def square(first, position):
        write_speeds(points, 0.25, LIMITER.record[0])
        return speed_on(points[first:], position, 0.25, 0.0) ** 2

    before = square(20, 0.0)
    assert square(40, 0.0) == pytest.approx(corner)
    assert before == pytest.approx(corner + 2.0 * 0.85 * LIMITER.braking * 20 * 0.25)
    assert before - square(20, 0.5) == pytest.approx(2.0 * 0.85 * LIMITER.braking * 0.5 * 0.25)
    points[:40, DEMAND] = 0.3  # in a bend there is less for braking
    assert square(20, 0.0) < before - 1.0


def test_after_a_lap_that_gives_no_line_the_next_one_is_recorded():
    remembered, driver = line_of_ring(), np.zeros(1, TICK)[0]["driver"]
    driver["limiter"], driver["car"], driver["max_speed"] = LIMITER.record[0], CAR_ROW, 8.0
    for refused in (False, True):
        remembered["line"]["refused"] = refused
        keep_lap(remembered, GEOMETRY, scan_at(RING, 0.0), odometry(), driver)
        assert (remembered["lap"]["closed"], remembered["line"]["ready"]) == (not refused, not refused)
    assert remembered["lap"]["count"] == 1 and not remembered["line"]["refused"]


def line_on_circle(radius, count):
    """The line of a circle round (0, radius), counterclockwise from the bottom."""
    angles = 2.0 * math.pi * np.arange(count) / count
    line = np.zeros(1, REMEMBERED)[0]["line"]
    line["points"][:count, X], line["points"][:count, Y] = radius * np.sin(angles), radius - radius * np.cos(angles)
    line["count"], line["spacing"], line["ready"] = count, 2.0 * math.pi * radius / count, True
    describe_line(line, LIMITER.record[0])
    return line


@each("share", np.linspace(0.05, 0.95, 7).tolist())
def test_the_place_on_the_line_is_that_on_the_arc_between_two_points(share):
    """The points are .084 rad apart: to the chord the car would be .0026 m more to the right in the middle of it."""
    line = line_on_circle(3.0, 75)
    spacing = line["spacing"]
    angle = (3 + share) * spacing / 3.0
    x, y = 2.9 * math.sin(angle), 3.0 - 2.9 * math.cos(angle)  # to the left of the line is towards the middle
    window = line_ahead(line, 1, x, y, angle + 0.05, LIMITER.record[0])
    assert window[:, CURVATURE] == pytest.approx(1.0 / 3.0, rel=2e-3)
    assert np.diff(np.unwrap(window[:, HEADING])) == pytest.approx(spacing / 3.0, rel=1e-3)
    along, aside, turned = position_on(window, 4, spacing)
    assert along == pytest.approx(3 + share, abs=0.04)
    assert turned == pytest.approx(0.05, abs=0.005)
    assert aside == pytest.approx(0.1, abs=5e-4)


def test_a_car_on_its_line_is_proposed_to_follow_it_or_beside_it_and_within_two_laps_of_a_mover_not():
    remembered, limiter = line_of_ring(), LIMITER.record[0]
    line, lap, motion = remembered["line"], remembered["lap"], odometry()
    ahead = np.diff(line["points"][:2], axis=0)[0]
    lap["x"], lap["y"] = line["points"][0]
    lap["heading"] = math.atan2(ahead[1], ahead[0])
    motion["speed"] = 1.0
    motion["steering_angle"] = math.atan(CAR.wheelbase / 2.5)
    for _ in range(2):
        proposal = propose_line(remembered, motion, limiter, 0.0)
    assert proposal.state == ON and np.abs(proposal.points[0, :2]).max() < 0.5 and proposal.speed > 2.0
    assert on_line(limiter)[0] > limiter["settings"]["turn_in_use"]
    beside = propose_line(remembered, motion, limiter, 0.1)
    apart = beside.points[:, :2] - proposal.points[:, :2]
    left = np.column_stack((-np.sin(proposal.points[:, HEADING]), np.cos(proposal.points[:, HEADING])))
    assert apart == pytest.approx(0.1 * left) and beside.steering_angle > proposal.steering_angle
    remembered["moved"], remembered["still"] = True, 5.0
    assert propose_line(remembered, motion, limiter, 0.0).state == AWAY and not line["follows"]
    remembered["still"] = 100.0
    assert propose_line(remembered, motion, limiter, 0.0).state == ON
    lap["driven"], line["until"] = 3.0, 5.0  # the judge took another proposal
    assert propose_line(remembered, motion, limiter, 0.0).state == AWAY and not line["follows"]


@each(("away", "width", "free"), [(5.0, 2.0, True), (5.0, 0.2, True), (1.2, 0.2, False), (1.2, 0.0, True)])
def test_on_known_ground_only_what_is_in_the_way_counts_and_the_car_stops_before_it(away, width, free):
    """Walls are .21 m beside the middle of the car; a box of some width stands on the way. It drives at 4 m/s."""
    walls = lines([(-20.0, -0.21), (20.0, -0.21)], [(-20.0, 0.21), (20.0, 0.21)])
    if width > 0.0:
        half = min(0.5 * width, 0.2)
        walls = np.concatenate((walls, lines(box(away, -half, away + 0.2, half))))
    ranges = seen_from(walls, CAR.lidar_offset, 0.0, BEARINGS)
    path = np.zeros((40, 4))
    path[:, 0] = 0.25 * np.arange(1, 41)
    widened = widen_all(ranges, INCREMENT, 0.22)  # in which the walls are in the way
    limiter = LIMITER.record[0]
    known = situation(limiter, widened, 0.0, 4.0, angle_min=BEARINGS[0], increment=INCREMENT, ranges=ranges)
    met = simulate(known, Plan(0.0, 0.0, path, 4.0, 0.0), 1.0, 4.0)
    assert (met.what == FREE) == free
    stop = 4.0**2 / (2.0 * LIMITER.braking) + CAR.length - CAR.rear_overhang
    assert (stop < away) == free or width == 0.0
    assert simulate(known._replace(known=False), Plan(0.0, 0.0, path, 4.0, 0.0), 1.0, 4.0).what != FREE


@each("away", [4.0, 9.0])
def test_along_a_path_with_speeds_the_car_goes_on(away):
    """To stop there would be free; it drives on to what stands 4 m ahead, or to the end of the path of 5 m."""
    ranges = seen_from(lines(box(away, -0.2, away + 0.2, 0.2)), CAR.lidar_offset, 0.0, BEARINGS)
    path = np.zeros((20, 5))
    path[:, 0], path[:, 4] = 0.25 * np.arange(1, 21), 3.0
    known = situation(LIMITER.record[0], ranges, 0.0, 3.0, angle_min=BEARINGS[0], increment=INCREMENT, ranges=ranges)
    on, stop = (simulate(known, Plan(0.0, 0.0, points, 3.0, 0.0), 1.0, 3.0) for points in (path, path[:, :4].copy()))
    assert stop.what == FREE and (on.what == FREE) == (away > 5.0)
    assert on.speed == pytest.approx(3.0 if away < 5.0 else 0.0, abs=0.3)


def test_laps_after_the_first_are_faster_and_no_tire_slides():
    """Without `remember` laps 2 and 3 take 21.1 s."""
    car = fg.race("tight", "gap_finder", laps=3, mu=0.66).car
    assert car.finished and car.collisions_wall == 0
    assert car.lap_times_s[2] < 0.93 * 21.1
    assert car.max_slide_m_s < 0.01


def test_a_lap_of_odometry_that_drifts_does_not_close_at_a_later_place_either():
    remembered = np.zeros(1, REMEMBERED)[0]
    drive(remembered, 0.0, 1.6, odometry(1.0, 1.05))
    assert remembered["lap"]["drifts"] and not remembered["lap"]["closed"]


def test_a_line_that_is_about_as_sharp_as_full_lock_for_long_is_not_followed():
    """On a line of 1.10 times the lock's curvature the car ran wide, into the wall."""
    assert fg.race("maze", laps=3).car.finished


def test_on_soft_tires_a_line_is_followed_only_where_the_planners_own_simulated_lap_holds():
    """On linear tires of 5 /rad the car crashed on its line in lap 2; on bristles of 12 /rad the line holds."""
    lateral = Coulomb(D=1.0489, stiffness=12.0)
    axle = AxleTires(lateral=lateral, longitudinal=lateral, relaxation_length=0.045)
    bristles = Tires(model="coulomb", front=axle, rear=axle)
    for track, tires, holds in (("tight", "f1tenth_gym", False), ("l_corridor", bristles, True)):
        car = fg.race(track, laps=3, tires=tires).car
        assert car.finished and (car.lap_times_s[2] < 0.85 * car.lap_times_s[0]) == holds
    car = fg.race("l_corridor", laps=3, tires="forzaeth_nuc6").car
    assert car.finished and car.lap_times_s[2] < 0.85 * car.lap_times_s[0]


@each(("track", "tires"), [("boxes", "f1tenth_gym"), ("elbow", "f1tenth_gym"), ("l_corridor", "forzaeth_nuc2")])
def test_on_soft_tires_a_car_that_stops_does_so_where_it_planned_to(track, tires):
    """It touched walls within 3 laps: its stops swung about their direction, and were given up for others."""
    assert fg.race(track, "disparity_extender", laps=3, tires=tires, mu=1.0489).car.finished


@each("tires", ["f1tenth_gym", "forzaeth_nuc6", "ipz"])
@each("angle", [0.04, -0.1])  # at .2 rad the front tires brake the car, which the closed form leaves out
def test_the_simulated_car_runs_on_the_arc_of_its_steering_angle(tires, angle):
    """Oracle: the steady curve in closed form, at 3 m/s, with the axles' slip angles."""
    car = replace(CAR, **Tires.load(tires).for_planners())
    limiter = FrictionLimiter(car, min(car.front_peak, car.rear_peak)).record[0]
    trial = np.zeros(1, TRIAL)[0]
    trial["speed"], trial["commands"] = 3.0, (angle, 3.0)
    for _ in range(400):
        move_car(trial, limiter, 0.0, PERIOD)
    speed = float(trial["speed"])
    arc = arc_angle(limiter["slip"], limiter["car"], angle, speed)
    assert trial["yaw_rate"] / speed == pytest.approx(math.tan(arc) / car.wheelbase, rel=0.02)


def test_after_a_failed_trial_the_line_is_shaped_farther_from_the_walls():
    remembered = line_of_ring()
    nearest = []
    for failed in (0, 1, 2):
        line = remembered["line"]
        line["step"], line["failed"], line["ready"] = 0, failed, False
        walls = walls_of(remembered["lap"], GEOMETRY, 1081, CAR.lidar_offset)
        while not line["ready"]:
            shape_line(line, remembered["lap"], walls, LIMITER.record[0], 8.0)
        x, y = line["points"][: line["count"], 0], line["points"][: line["count"], 1] - RADIUS_DRIVEN
        nearest.append(np.hypot(*np.maximum(abs(np.array([x, y])) - 1.5, 0.0)).min())
    assert np.diff(nearest) == pytest.approx([0.05, 0.05], abs=0.02)
