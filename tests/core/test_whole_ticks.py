"""A tick of one compiled call has the bits of sense, decide, drive and judge one by one, and fails as they do."""

import math
from functools import partial

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.controllers.control.driving import DrivingSettings
from fg_mujoco.controllers.control.planner import Planner
from fg_mujoco.native import core
from fg_mujoco.racing.decision_times import DecisionClock
from fg_mujoco.racing.result import History
from fg_mujoco.rollouts.drive_worlds import make_engine
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.planner_adapter import adapt
from fg_mujoco.simulation.settings import Scenario
from fg_mujoco.simulation.world import World

SCENARIOS = [Scenario(seed=seed, max_speed=4.0 + seed, mu=0.6 + 0.1 * seed) for seed in range(3)]
TICKS = 120


def engine_of(controller, scenarios=SCENARIOS, **settings):
    return make_engine(World("oval"), scenarios, controller, laps=1, time_limit=60.0, **settings)


def verbs(engine, clock, history):
    engine.sense()
    clock.time(engine.decide)
    engine.drive()
    history.append()
    engine.judge()


def at_once(engine, clock, history):
    driven = engine.running.copy()
    assert (engine.tick(clock=clock, history=history) == driven).all()
    assert engine._calls is not None, "the tick was not one compiled call"


def driven(controller, tick, scenarios=SCENARIOS):
    """What is known after some ticks, all of it but how long they took."""
    engine, clock = engine_of(controller, scenarios), DecisionClock()
    history = History(engine)
    with clock:
        for _ in range(TICKS):
            tick(engine, clock, history)
    assert len(clock.seconds) == history.ticks == TICKS and min(clock.seconds) > 0.0
    arrays = {name: getattr(engine, name).copy() for name in vars(engine) if name in SENSED_AND_DRIVEN}
    states = {f"state {i}": engine.state(i).copy() for i in range(engine.count)}
    races = {name: getattr(engine.monitor, name).copy() for name in ("running", "reasons", "lap_times", "timers")}
    return arrays | states | races | history.arrays()


SENSED_AND_DRIVEN = ("odometry", "ranges", "commands", "crashed", "failed", "telemetry", "statistics", "touched_at")


def assert_same_bits(found, expected):
    assert found.keys() == expected.keys() and len(found) > 12
    for name in found:
        assert found[name].tobytes() == expected[name].tobytes(), name


@each("controller", ["gap_finder", "pure_pursuit", "follow_the_gap"])
def test_a_tick_of_one_call_has_the_bits_of_the_verbs(controller):
    expected = driven(controller, verbs)
    assert_same_bits(driven(controller, at_once), expected)
    alone = driven(controller, at_once, SCENARIOS[1:2])
    assert alone["ranges"][0].tobytes() == expected["ranges"][1].tobytes()
    assert alone["state 0"].tobytes() == expected["state 1"].tobytes()


def planner_that(fails):
    """A class of planners that fail after 0.1 s: those with a pursuit distance of more than 2 m."""

    def reference(geometry, ranges, odometry, car, settings, memory, line):
        if odometry.stamp > 0.09 and settings.pursuit_distance > 2.0:
            if fails:
                raise ValueError("late", odometry.stamp)
            return 0.0, math.nan, 0.0
        return 0.0, 1.0, 0.0

    settings = {"Settings": DrivingSettings, "reference": staticmethod(reference)}
    return type("Failing", (Planner,), settings)


def failing_engine(count, fails):
    world = World("oval")
    engine = Engine(world, count, laps=1)
    kind = planner_that(fails)
    chosen = [DrivingSettings(pursuit_distance=3.0 if i == 0 else 1.0) for i in range(count)]
    planners = [kind(world.car.parameters, math.inf, settings=own) for own in chosen]
    engine.planners = adapt(planners)
    engine.place([fg.Start()] * count)
    return engine


def how_it_fails(tick):
    engine, clock = failing_engine(3, True), DecisionClock()
    history = History(engine)
    with pytest.raises(fg.PlannerError) as failed:
        for _ in range(10):
            tick(engine, clock, history)
    failure = failed.value.failure
    assert "ValueError: ('late', 0.1" in str(failed.value) and failure.line is not None
    return (
        str(failed.value), failure.error, failure.time_s, failure.line, history.ticks, len(clock.seconds), engine.times,
    )  # fmt: skip


def test_what_a_planner_raises_is_its_failure():
    found, expected = (how_it_fails(tick) for tick in (at_once, verbs))
    assert found[:-1] == expected[:-1] and found[-1].tolist() == expected[-1].tolist()
    assert found[4:6] == (4, 5)


def test_a_command_that_is_no_number_ends_the_race_of_its_car_alone():
    found = []
    for tick in (verbs, lambda engine, clock, history: engine.tick(clock=clock, history=history)):
        engine, clock = failing_engine(3, False), DecisionClock()
        history = History(engine)
        for _ in range(7):
            tick(engine, clock, history)
        failures = {row: str(error) for row, error in engine.planners.failures.items()}
        assert list(failures) == [0] and "numbers" in failures[0]
        known = engine.running.tolist(), engine.monitor.reasons.tolist(), engine.times.tolist()
        found.append((failures, history.ticks, len(clock.seconds), *known))
    assert found[0] == found[1] and found[0][1:3] == (7, 7)


def test_several_ticks_in_a_call_leave_what_single_ones_do():
    one, other = failing_engine(3, False), failing_engine(3, False)
    for _ in range(7):
        one.tick()
    assert other.tick(most=7).tolist() == [False, True, True]
    for of in (lambda engine: engine.times, lambda engine: engine.telemetry, lambda engine: engine.monitor.reasons):
        assert of(one).tobytes() == of(other).tobytes()
    assert other.running.tolist() == [False, True, True] and list(other.planners.failures) == [0]


def test_what_is_called_in_python_raises_through_the_native_core():
    def refuse_odd(number):
        if number % 2:
            raise ValueError("odd", number)
        done.append(number)

    done, numbers = [], (2, 4, 5, 6)
    kept = [partial(refuse_odd, number) for number in numbers]
    with pytest.raises(ValueError, match="odd"):
        core.call_all(np.array([(core.CALL_PYTHON, id(call)) for call in kept]))
    assert done == [2, 4]


def test_an_interrupt_in_a_decision_leaves_the_races_as_they_were():
    def interrupt():
        raise KeyboardInterrupt

    engine = engine_of("gap_finder")
    engine.tick()
    engine._calls, before = np.array([(core.CALL_PYTHON, id(interrupt))]), engine.times
    with pytest.raises(KeyboardInterrupt):
        engine.tick()
    assert engine.running.all() and engine.times.tolist() == before.tolist()
