"""A race says in one line what its planner's mistake may be: degrees, or late decisions."""

import numpy as np

import fg_mujoco as fg
from cases import each
from fg_mujoco.racing.decision_times import DecisionTimes, late_hint
from fg_mujoco.racing.result import clamped_hint
from fg_mujoco.simulation.telemetry import COMMAND, TELEMETRY
from fg_mujoco.vehicle.car import WHEELS
from hand_planners import driven

CAR = fg.Vehicle.load("f1tenth").parameters
PERIOD = 0.025


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
