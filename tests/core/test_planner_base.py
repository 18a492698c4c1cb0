"""A planner of one's own on the base classes: settings, memory and scans reach its function, alone and in a batch."""

import copy
import inspect
import math
import re
from dataclasses import dataclass, replace

import numpy as np
import pytest

from cases import each
from fg_mujoco.controllers.control.driving import DrivingSettings
from fg_mujoco.controllers.control.planner import GoalPlanner, Planner
from fg_mujoco.controllers.control.planner_batch import PlannerBatch
from fg_mujoco.controllers.control.planner_settings import FROM_ZERO, Settings, for_car, relative_size, setting_of_car
from fg_mujoco.controllers.control.stages import SAFE, STAGES, Stage, Tick
from fg_mujoco.controllers.gap_finder import GapFinder, GapFinderSettings
from fg_mujoco.controllers.safety.recovery import RecoverySettings
from fg_mujoco.controllers.wall_follow import WallFollow
from fg_mujoco.errors import ControllerError, SettingsError
from fg_mujoco.messages import ODOMETRY
from scan_worlds import CAR, INCREMENT, MU, corridor, odometry_of, scan_of

TWICE_AS_LONG = replace(CAR, wheelbase=2.0 * CAR.wheelbase)


@dataclass(frozen=True, kw_only=True)
class PatientSettings(DrivingSettings):
    """A number of each kind."""

    patience: int = 2  # ticks before it drives off
    pace: float = 3.0  # [m/s]
    backwards: bool = False


class Patient(Planner):
    """Waits, then drives."""

    Settings = PatientSettings
    memory_type = np.dtype([("ticks", np.int64)])

    @staticmethod
    def reference(geometry, ranges, odometry, car, settings, memory, line):
        speed = settings.pace if memory.ticks >= settings.patience else 0.0
        if settings.backwards:
            speed = -speed
        memory.ticks += 1
        return 0.1, speed, 0.1


class Leftmost(GoalPlanner):
    """Drives to the leftmost beam; it shows every other beam as its gap, and filters all to a metre."""

    Settings = DrivingSettings

    @staticmethod
    def goal(geometry, ranges, car, settings, debug):
        debug.filtered[:] = 1.0
        debug.gap[:] = np.nan
        debug.gap[::2] = ranges[::2]
        last = len(ranges) - 1
        return geometry.angle_min + geometry.angle_increment * last, ranges[last]


def speeds(planner, ticks):
    return [planner(corridor(2.0, 2.0), odometry_of(0.0)).speed for _ in range(ticks)]


@pytest.mark.slow
def test_settings_and_memory_reach_its_function():
    for patience in (0, 1, 3):
        planner = Patient(CAR, MU, settings=PatientSettings(patience=patience))
        moving = [speed > 0.0 for speed in speeds(planner, 5)]
        assert moving == [tick >= patience for tick in range(5)]
        planner.reset()
        assert [speed > 0.0 for speed in speeds(planner, 5)] == moving
    assert speeds(Patient(CAR, MU, settings=PatientSettings(backwards=True)), 3)[2] < 0.0


def test_a_planner_that_assumes_no_friction_limit_gets_its_reference():
    settings = PatientSettings(patience=0, pace=7.0, assist="grip")
    command = Patient(CAR, np.inf, settings=settings)(corridor(1.0, 1.0, ahead=0.5), odometry_of(0.0))
    assert (command.steering_angle, command.speed) == (0.1, 7.0)


def test_a_copied_planner_is_a_new_one():
    planner = Patient(CAR, MU, settings=PatientSettings(patience=2))
    assert max(speeds(planner, 2)) == 0.0
    copied, before = copy.deepcopy(planner), planner._commands.copy()
    assert speeds(copied, 3)[:2] == [0.0, 0.0]
    assert np.array_equal(planner._commands, before)
    assert speeds(planner, 1)[0] > 0.0


def test_each_world_of_a_batch_has_a_memory_of_its_own():
    planners = [Patient(CAR, MU, settings=PatientSettings(patience=patience)) for patience in (2, 0, 1)]
    batch, scan, rows = Patient.batch(planners), corridor(2.0, 2.0), np.zeros(3, ODOMETRY)
    commands = np.zeros((3, 2))
    for tick in range(4):
        running = np.array([True, True, tick != 0])  # the last one's patience begins when it does
        batch(scan, np.tile(scan.ranges, (3, 1)), rows, running, commands)
        assert (commands[:, 1] > 0.0).tolist() == [tick >= 2, True, tick >= 2]


@pytest.mark.slow
def test_a_goal_and_the_scans_on_the_way_to_it_are_those_of_its_function():
    scan, planner = scan_of(np.linspace(1.0, 5.0, 101)), Leftmost(CAR, MU)
    assert planner.find_goal(scan) == (pytest.approx(50 * INCREMENT), 5.0)
    made = planner.intermediate_scans(scan)
    assert list(made) == ["raw", "filtered", "gap"]
    np.testing.assert_array_equal(made["raw"], scan.ranges)
    np.testing.assert_array_equal(made["gap"][::2], scan.ranges[::2])
    assert np.isnan(made["gap"][1::2]).all()


def test_the_mean_range_of_the_speed_law_is_that_of_the_filtered_scan():
    settings = DrivingSettings(assist="mean_range", lookahead=10.0, mean_range_gain=2.0)
    command = Leftmost(CAR, np.inf, 8.0, settings)(scan_of(np.full(101, 5.0)), odometry_of(0.0))
    assert command.speed == pytest.approx(8.0 * 2.0 * 1.0 / 10.0)


def test_a_function_with_other_arguments_is_refused_when_its_class_is_made():
    with pytest.raises(ControllerError, match=r"Wrong\.goal takes \(scan, ranges\); accepted: \(geometry, ranges, "):

        class Wrong(GoalPlanner):
            Settings = DrivingSettings

            @staticmethod
            def goal(scan, ranges):
                return 0.0, 1.0


# -- settings of the car


@dataclass(frozen=True, kw_only=True)
class Scaled(Settings):
    """A length and a speed."""

    reach: float = setting_of_car(0.3, "m", "ahead", FROM_ZERO)
    crawl: float = setting_of_car(0.5, "m/s", "slow", FROM_ZERO)


def test_settings_of_the_car_are_to_the_bit_what_was_found_on_the_f1tenth_car():
    assert relative_size(CAR) == 1.0
    assert for_car(Scaled(), CAR) == Scaled(reach=0.3, crawl=0.5)
    recovery = for_car(RecoverySettings(), CAR)
    assert (recovery.distance, recovery.speed, recovery.come_on) == (1.5, 1.5, 2.0)


def test_for_a_car_twice_as_long_lengths_double_and_speeds_grow_by_the_square_root():
    """Froude: v^2 / (g l) stays, and with it the share of the grip that a manoeuvre takes."""
    large = for_car(Scaled(), TWICE_AS_LONG)
    assert large.reach == pytest.approx(0.6)
    assert large.crawl**2 / large.reach == pytest.approx(0.5**2 / 0.3)


def test_a_setting_that_is_given_is_taken_as_it_is():
    assert for_car(Scaled(reach=0.3), TWICE_AS_LONG).reach == 0.3
    planner = GapFinder(TWICE_AS_LONG, MU, 8.0, GapFinderSettings(pursuit_distance=1.0))
    assert planner.settings.pursuit_distance == 1.0
    assert planner.settings.safe_distance == pytest.approx(0.4)
    assert planner.driver["judge_settings"]["crawl_speed"][0] == pytest.approx(0.5 * math.sqrt(2.0))


def creep(tick: Tick) -> None:
    tick.state.ticks += 1
    tick.command[1] = min(tick.command[1], 0.5)


def max_of_two(a, b):
    return max(a, b)


@each(
    ("made", "said"),
    [
        (lambda: None, "own_stages() returned None; accepted: a dict of stages by names"),
        (lambda: {"creep": creep}, "own_stages() returned 'creep': "),
        (lambda: {"my stage": Stage()}, "own_stages() returned 'my stage': "),
        (lambda: {"sight": Stage(after_driving=creep)}, "returned 'sight', another name of `assist`"),
        (lambda: {"creep": Stage(after_driving=max_of_two)}, "is 'max_of_two' (missing a required argument: 'b')"),
        (lambda: {"creep": Stage(guide=3)}, "Stage.guide is 3 (3 is not a callable object); accepted: a function"),
    ],
)
def test_own_stages_that_are_none_are_refused(made, said):
    own = type("Own", (GapFinder,), {"own_stages": lambda self: made()})
    with pytest.raises(ControllerError, match=re.escape(said)):
        own(CAR, MU)


def test_a_registered_stage_changes_the_command_and_keeps_its_memory_until_a_reset(monkeypatch):
    stage = Stage(after_driving=creep, state_type=np.dtype([("ticks", np.int64)]))
    monkeypatch.setitem(STAGES._own, "creep", stage)
    planner = GapFinder(CAR, MU, assist="full+creep")
    for ticks in (1, 2):
        assert planner(corridor(2.0, 2.0), odometry_of(3.0)).speed == 0.5
        assert planner.stage_state("creep")["ticks"] == ticks
    planner.reset()
    assert planner.stage_state("creep")["ticks"] == 0
    assert GapFinder(CAR, MU)(corridor(2.0, 2.0), odometry_of(3.0)).speed > 2.5


@each(
    ("planner", "assist", "stages"),
    [
        (GapFinder, "full", {*SAFE, "guidance", "remember"}),
        (GapFinder, "safe", {*SAFE}),
        (GapFinder, "grip", {*GapFinder.source_laws, "limiter"}),
        (GapFinder, "none", {*GapFinder.source_laws}),
        (GapFinder, "sight , limiter", {"sight", "limiter"}),
        (GapFinder, "safe+guidance-prediction", {*SAFE, "guidance"} - {"prediction"}),
        (WallFollow, "full", {*SAFE, "guidance"} - {"safety_filter", "prediction", "recovery"}),
    ],
)
def test_an_assist_names_the_stages_of_a_planner(planner, assist, stages):
    assert set(planner(CAR, MU, assist=assist).stages) == stages
    assert set(planner(CAR, MU, 8.0, planner.Settings(assist=assist), assist="none").stages) == stages


def test_without_a_friction_limit_the_laws_of_the_scan_are_left_and_nothing_else_may_be_named():
    assert set(GapFinder(CAR, math.inf).stages) == {"mean_range", "distance_ahead"}
    with pytest.raises(SettingsError, match="sight, which needs a friction limit, and mu is inf"):
        GapFinder(CAR, math.inf, assist="none,sight")


def test_what_a_stage_keeps_is_kept_for_the_planners_that_have_it():
    plain, remembers = GapFinder(CAR, MU, assist="safe"), GapFinder(CAR, MU)
    assert len(PlannerBatch(GapFinder, [remembers, plain]).stage_states["remember"]) == 2
    with pytest.raises(KeyError):
        plain.stage_state("remember")


@each("kind", [GapFinder, Patient])
def test_a_planner_says_by_which_arguments_it_is_made_to_python_3_10_too(kind):
    """Before Python 3.11.3 `inspect` finds those of an inherited `__new__`, where the class does not say."""
    own = [*inspect.signature(kind.__init__).parameters.values()][1:]
    assert list(vars(kind)["__signature__"].parameters.values()) == own
    assert {"car", "mu", "max_speed"} <= {each.name for each in own}
