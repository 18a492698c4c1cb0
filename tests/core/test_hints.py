"""A race says in one line what its planner's mistake may be: degrees, late decisions, a scan in another order."""

import math

import numpy as np

import fg_mujoco as fg
from cases import each
from fg_mujoco.messages import DriveCommand
from fg_mujoco.racing.decision_times import DecisionTimes
from fg_mujoco.racing.hints import clamped_hint, late_hint, race_hints
from fg_mujoco.simulation.telemetry import COMMAND, TELEMETRY
from fg_mujoco.vehicle.car import WHEELS
from hand_planners import driven

CAR = fg.Vehicle.load("f1tenth").parameters
PERIOD = 0.025


def deepest(read, speed, widest):
    """A planner that steers to where there is most room, of a scan that it reads in some way."""

    def planner(scan, odometry):
        ranges, bearings = read(scan)
        angle = float(np.average(bearings, weights=np.minimum(ranges, 8.0) ** 3 * (abs(bearings) < widest)))
        return DriveCommand(steering_angle=min(max(angle, -0.4), 0.4), speed=speed)

    return planner


def mirrored(scan):
    return scan.ranges[::-1], scan.bearings


def left_half(scan):  # taken for the half turn ahead
    half = scan.ranges[len(scan.ranges) // 2 :]
    return half, np.linspace(-0.5 * math.pi, 0.5 * math.pi, len(half))


def telemetry(angles, speeds):
    rows = np.zeros((len(angles), len(TELEMETRY)))
    rows[:, COMMAND], rows[:, COMMAND + 1] = angles, speeds
    return rows


# -- commands beyond the limits


@each(
    ("angles", "speeds", "said"),
    [
        ([0.5] * 60, [1.0] * 60, "Try less gain"),
        ([20.0] * 60, [1.0] * 60, "math.radians"),
        ([0.0] * 60, [50.0] * 60, "Speeds are in metres per second"),
        ([0.5] * 30 + [0.0] * 30, [1.0] * 60, ""),  # half of them
        ([0.5] * 31 + [0.0] * 29, [1.0] * 60, "31 of 60"),
        ([9.0] * 19, [1.0] * 19, ""),  # too few
    ],
)
def test_most_commands_beyond_the_limits_are_told_and_fewer_are_not(angles, speeds, said):
    hint = clamped_hint(telemetry(angles, speeds), CAR)
    assert said in hint and bool(hint) == bool(said) and "\n" not in hint


def said_of(angles):
    return clamped_hint(telemetry(angles, [2.0] * len(angles)), CAR)


@each("cut", [0.4189, 0.34])
def test_degrees_that_are_cut_off_are_told_and_radians_and_one_side_are_not(cut):
    radians = 0.1 * np.sin(0.2 * np.arange(200))
    degrees = np.clip(np.degrees(radians), -cut, cut)
    assert "if these are degrees that were cut off there, try math.radians(angle)" in said_of(degrees)
    assert [said_of(angles) for angles in (radians, np.abs(degrees), 0.01 * degrees)] == ["", "", ""]


@each(("moves", "said"), [(0.0, "all "), (1.0, "the last "), (99.0, "")])
def test_a_planner_that_asks_for_no_speed_is_told_so(moves, said):
    stops = driven(lambda odometry: (0.0, 1.0 if odometry.stamp < moves else 0.0))
    result = fg.race("oval", stops, laps=1, time_limit=4.0)
    assert result.car.end_reason == "time_limit"
    hints = race_hints(result)
    assert len(hints) == bool(said) and all(hint.startswith(said) and "speed of 0 m/s" in hint for hint in hints)


def test_wheels_that_spin_at_the_start_are_told_with_time_and_place():
    floors = driven(lambda odometry: (0.0, 8.0 if odometry.stamp < 0.3 else 2.0))
    car = fg.race("oval", floors, laps=1, time_limit=2.0, mu=0.7).car  # what the drive gives, 9.51 / 9.81, is more
    assert car.max_slide_m_s > 0.5
    slid = np.nanmax([car.column(f"slide_{wheel}_m_s") for wheel in WHEELS], axis=0)
    tick = int(np.nanargmax(slid))
    x, y, time = (car.column(name)[tick] for name in ("x_m", "y_m", "time_s"))
    assert car.max_slide_place.endswith(f"tire at ({x:.2f}, {y:.2f}) m, t = {time:.2f} s") and time < 0.5
    assert fg.race("oval", laps=1, time_limit=2.0).car.max_slide_place == ""


# -- late decisions


@each(("late", "told"), [(50, False), (51, True)])
def test_most_decisions_over_a_tick_are_told(late, told):
    times = DecisionTimes.of([0.05] * late + [0.001] * (100 - late), PERIOD)
    hint = late_hint(vars(times))
    assert bool(hint) is told
    if told:
        assert hint.startswith("51 of 100 decisions took longer than 25 ms, half of them 50 ms or more.")
        assert "--lidar-latency 0.05" in hint


# -- a scan that is read in another order


# Planners that look only ahead leave the room behind the car on the side to which they should have steered.
@each(
    ("read", "track", "speed", "widest"),
    [
        (mirrored, "chicanes", 1.5, math.pi),
        (mirrored, "chicanes", 4.0, math.pi),
        (left_half, "oval", 4.0, math.pi),
        (mirrored, "oval", 3.0, 1.0),
        (mirrored, "l_corridor", 1.5, 1.0),
    ],
)
def test_a_planner_that_reads_the_scan_in_another_order_is_asked(read, track, speed, widest):
    result = fg.race(track, deepest(read, speed, widest), laps=1, time_limit=30.0)
    assert result.car.end_reason == "crash"
    (hint,) = race_hints(result)
    assert (
        "the planner steered to the other. Does it read the scan as it is? ranges[0] of 1081 is the rightmost" in hint
    )
    assert "at -135 degrees, ranges[540] looks straight ahead" in hint
