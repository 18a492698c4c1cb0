"""The engine: what each world does is what it does alone; hooks, worlds of their own, worlds that are rebuilt."""

from copy import copy

import mujoco
import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.simulation.cars import CAR_PREFIX
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.physics import STATE, span_of
from fg_mujoco.simulation.settings import Start
from fg_mujoco.vehicle.tire_forces import TireForces
from fg_mujoco.vehicle.tire_slip import TireSlipMeter

OVAL, ON_CONTACTS = fg.World("oval"), fg.World("oval", tires="contact")


def driven(engine, ticks, commands=(0.05, 2.0)):
    """The states of all worlds after so many ticks with one command."""
    for _ in range(ticks):
        engine.sense()
        engine.commands[:] = commands
        engine.drive()
        engine.judge()
    return [engine.state(i).copy() for i in range(engine.count)]


def placed(engine, **start):
    engine.place([Start(s=0.5 * i, **start) for i in range(engine.count)])
    return engine


def stepper(world, model):
    """What steps the model of a world by hand."""
    if world.tires.is_contact:
        return lambda data: mujoco.mj_step(model, data)
    return TireForces(model, [car.prefix for car in world.cars]).step


def by_hand(world, ticks, command=(0.05, 2.0), s=0.0):
    """The state after so many ticks by hand, on contacts by mujoco.mj_step alone: what the engine must give."""
    model = copy(world.model)
    data, engine, step = mujoco.MjData(model), Engine(world), stepper(world, model)
    engine.place([Start(s=s)])
    mujoco.mj_setState(model, data, engine.state(0), int(STATE))
    for _ in range(ticks):
        world.car.apply(data, fg.DriveCommand(steering_angle=command[0], speed=command[1]))
        for _ in range(engine.substeps):
            step(data)
    state = np.empty(mujoco.mj_stateSize(model, int(STATE)))
    mujoco.mj_getState(model, data, state, int(STATE))
    return state


@each("world", [OVAL, ON_CONTACTS], ids=["coulomb", "contact"])
def test_a_world_has_the_bits_of_the_same_steps_by_hand(world):
    (state,) = driven(placed(Engine(world)), 40)
    assert state.tobytes() == by_hand(world, 40).tobytes()


@pytest.mark.slow
@each(("count", "threads"), [(3, 1), (9, 2), (9, 4)])
@each("world", [OVAL, ON_CONTACTS], ids=["coulomb", "contact"])
def test_each_of_many_worlds_has_the_bits_that_it_has_alone(world, count, threads):
    states = driven(placed(Engine(world, count, threads=threads)), 20)
    for i, state in enumerate(states):
        assert state.tobytes() == by_hand(world, 20, s=0.5 * i).tobytes(), i


def test_worlds_with_models_of_their_own_are_driven_side_by_side():
    worlds = [OVAL, OVAL, fg.World("hairpins", mu=0.7), fg.World("scene:crossing_box:1")]
    engine = placed(Engine(worlds))
    states = driven(engine, 20)
    for i, world in enumerate(worlds):
        alone = Engine(world)
        alone.place([Start(s=0.5 * i)])
        assert states[i].tobytes() == driven(alone, 20)[0].tobytes(), world.track.name
        assert engine.ranges[i].tobytes() == alone.ranges[0].tobytes()
        assert engine.world_of(i) is world


def test_a_world_is_rebuilt_while_the_others_go_on():
    changes = [fg.CarChanges(mass=3.5 + 0.1 * i) for i in range(3)]
    engine, undisturbed = placed(Engine(OVAL, 3, changes=changes)), placed(Engine(OVAL, 3, changes=changes))
    driven(engine, 5), driven(undisturbed, 5)
    fresh = fg.World("hairpins")
    engine.rebuild_worlds({1: fresh})
    assert engine.running.tolist() == [True, False, True] and engine.world_of(1) is fresh
    engine.place([Start(s=2.0)], np.array([False, True, False]))
    states, expected = driven(engine, 10), driven(undisturbed, 10)
    assert [states[i].tobytes() == expected[i].tobytes() for i in range(3)] == [True, False, True]
    alone = Engine(fresh, changes=changes[1:2])
    alone.place([Start(s=2.0)])
    assert states[1].tobytes() == driven(alone, 10)[0].tobytes()


def test_hooks_act_before_and_after_each_physics_step():
    """A force written before each step is what the next step is made with: a push of F at the rear axle for t moves it
    by F t (1 / m + l^2 / I), of which tires that give way still take less than half in the first step."""
    force, seen, car = 2.0, [], OVAL.parameters

    def push(engine, worlds):
        for i in worlds.tolist():
            first, _ = span_of(engine.world.model, mujoco.mjtState.mjSTATE_QFRC_APPLIED)
            engine.state(i)[first + 1] = force  # along y, of the free joint

    engine = placed(Engine(OVAL, 2))
    engine.before_substep.append(push)
    engine.after_substep.append(
        lambda engine, worlds: seen.append((worlds.tolist(), engine.time(0), engine.qvel(0)[1]))
    )
    plain = placed(Engine(OVAL, 2))
    driven(engine, 1, (0.0, 0.0)), driven(plain, 1, (0.0, 0.0))
    assert [worlds for worlds, _, _ in seen] == [[0, 1]] * 5
    assert [time for _, time, _ in seen] == pytest.approx([0.005, 0.01, 0.015, 0.02, 0.025])
    pushed = force * 0.005 * (1.0 / car.mass + car.rear_axle_distance**2 / car.yaw_inertia)
    assert 0.5 * pushed < seen[0][2] < pushed and abs(plain.qvel(0)[1]) < 1e-12
    lone = placed(Engine(OVAL, 2))
    lone.after_substep.append(lambda engine, worlds: None)  # single steps alone change nothing
    assert driven(lone, 5)[1].tobytes() == driven(placed(Engine(OVAL, 2)), 5)[1].tobytes()


@each("world", [OVAL, ON_CONTACTS], ids=["coulomb", "contact"])
def test_slip_of_a_tick_is_that_of_the_slip_meter(world):
    engine = placed(Engine(world), speed=3.0)
    driven(engine, 3, (0.2, 3.0))
    model = copy(world.model)
    data, step = mujoco.MjData(model), stepper(world, model)
    mujoco.mj_setState(model, data, engine.state(0), int(STATE))
    meter = TireSlipMeter(model, CAR_PREFIX)
    world.car.apply(data, fg.DriveCommand(steering_angle=0.2, speed=3.0))
    for _ in range(engine.substeps):
        step(data)
        meter.record(data)
    driven(engine, 1, (0.2, 3.0))
    np.testing.assert_array_equal(engine.slip(), meter.read().values)
