"""The engine: what each world does is what it does alone; hooks, worlds of their own, worlds that are rebuilt."""

from copy import copy

import mujoco
import numpy as np
import pytest

import fg_mujoco as fg
from fg_mujoco.course.moving_obstacles import MovingObstacle, motion_table, obstacle_position
from fg_mujoco.errors import ModelError, SettingsError
from fg_mujoco.simulation.cars import CAR_PREFIX
from fg_mujoco.simulation.engine import Engine, whole_steps
from fg_mujoco.simulation.physics import STATE, Batch, StateLayout, span_of
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


@pytest.mark.parametrize("world", [OVAL, ON_CONTACTS], ids=["coulomb", "contact"])
def test_a_world_has_the_bits_of_the_same_steps_by_hand(world):
    (state,) = driven(placed(Engine(world)), 40)
    assert state.tobytes() == by_hand(world, 40).tobytes()


@pytest.mark.slow
@pytest.mark.parametrize(("count", "threads"), [(3, 1), (9, 2), (9, 4)])
@pytest.mark.parametrize("world", [OVAL, ON_CONTACTS], ids=["coulomb", "contact"])
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


def test_worlds_with_other_lidars_or_timesteps_are_refused():
    other = fg.World("oval")
    other.model.opt.timestep = 0.001
    with pytest.raises(ModelError, match="the same in all worlds"):
        Engine([OVAL, other])
    with pytest.raises(ModelError, match="a whole fraction"):
        Engine(OVAL, period=0.012)
    assert whole_steps(0.025, 0.005) == 5


def test_a_world_is_rebuilt_while_the_others_go_on():
    changes = [fg.CarChanges(mass=3.5 + 0.1 * i) for i in range(3)]
    engine, undisturbed = placed(Engine(OVAL, 3, changes=changes)), placed(Engine(OVAL, 3, changes=changes))
    driven(engine, 5), driven(undisturbed, 5)
    fresh = fg.World("hairpins")
    engine.rebuild(1, fresh)
    assert engine.running.tolist() == [True, False, True] and engine.world_of(1) is fresh
    engine.place([Start(s=2.0)], np.array([False, True, False]))
    states, expected = driven(engine, 10), driven(undisturbed, 10)
    assert [states[i].tobytes() == expected[i].tobytes() for i in range(3)] == [True, False, True]
    alone = Engine(fresh, changes=changes[1:2])
    alone.place([Start(s=2.0)])
    assert states[1].tobytes() == driven(alone, 10)[0].tobytes()


def test_hooks_act_before_and_after_each_physics_step():
    """A force written before each step is what the next step is made with: a push of F for t is F t / m."""
    force, seen = 2.0, []

    def push(engine, worlds):
        for i in worlds.tolist():
            engine.part_of_state(i, mujoco.mjtState.mjSTATE_QFRC_APPLIED)[1] = force  # along y, of the free joint

    engine = placed(Engine(OVAL, 2))
    engine.before_substep.append(push)
    engine.after_substep.append(lambda engine, worlds: seen.append((worlds.tolist(), engine.time(0))))
    plain = placed(Engine(OVAL, 2))
    driven(engine, 1, (0.0, 0.0)), driven(plain, 1, (0.0, 0.0))
    assert [worlds for worlds, _ in seen] == [[0, 1]] * 5
    assert [time for _, time in seen] == pytest.approx([0.005, 0.01, 0.015, 0.02, 0.025])
    assert engine.qvel(0)[1] > plain.qvel(0)[1] + 1e-5
    lone = placed(Engine(OVAL, 2))
    lone.after_substep.append(lambda engine, worlds: None)  # single steps alone change nothing
    assert driven(lone, 5)[1].tobytes() == driven(placed(Engine(OVAL, 2)), 5)[1].tobytes()


def test_recorded_controls_are_held_as_they_are():
    engine, controls, states = placed(Engine(OVAL)), [], []
    for _ in range(10):
        states.append(driven(engine, 1)[0])
        controls.append(engine.ctrl(0).copy())
    again = Engine(OVAL)
    first = placed(Engine(OVAL)).state(0).copy()
    again.load(first)
    for expected, ctrl in zip(states, controls, strict=True):
        again.drive(controls=ctrl[np.newaxis])
        assert again.state(0).tobytes() == expected.tobytes()


def test_a_state_outlives_its_engine():
    state = placed(Engine(OVAL)).state(0)  # the engine is gone
    junk = [Engine(OVAL) for _ in range(3)]
    assert state.tobytes() == placed(Engine(OVAL)).state(0).tobytes() and junk


@pytest.mark.parametrize("world", [OVAL, ON_CONTACTS], ids=["coulomb", "contact"])
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


def test_layout_names_the_parts_of_a_state():
    engine = placed(Engine(fg.World("scene:crossing_box:1")))
    model, layout = engine.world.model, StateLayout.of(engine.world.model)
    data = mujoco.MjData(model)
    engine.read(0, data)
    state = engine.state(0)
    for name, values in (("qpos", data.qpos), ("qvel", data.qvel), ("ctrl", data.ctrl), ("mocap_pos", data.mocap_pos)):
        first, end = getattr(layout, name)
        np.testing.assert_array_equal(state[first:end], values.ravel())
    assert span_of(model, mujoco.mjtState.mjSTATE_QPOS) == layout.qpos
    assert state[layout.time] == data.time


def test_obstacles_are_where_the_closed_form_has_them():
    obstacles = [
        MovingObstacle(length=0.5, width=0.3, start=(4.0, 0.3), end=(30.0, -1.7), speed=1.7),
        MovingObstacle(
            length=0.5, width=0.3, start=(1.0, 2.0), end=(0.0, 0.1), speed=0.9, back_and_forth=True, headway=0.7
        ),
    ]
    for obstacle, motion in zip(obstacles, motion_table(obstacles), strict=True):
        for time in np.random.default_rng(0).uniform(0.0, 60.0, 500).tolist():
            assert obstacle_position(motion, time) == obstacle.position(time)


def test_what_one_state_raises_fails_that_state_only():
    """A model with next to no memory cannot be stepped once the car touches a wall; the others go on."""
    batch = Batch(OVAL.model, 2, 5)
    assert batch.status.tolist() == [0, 0] and batch.error(0) == ""
    assert batch.states.shape == (2, mujoco.mj_stateSize(OVAL.model, int(STATE)))
    with pytest.raises(fg.EngineError, match="accepted: a field of numbers"):
        batch.expand("geom_bodyid")


def test_worlds_without_room_for_the_lidar_of_the_first_are_refused(tmp_path):
    engine = Engine(OVAL)
    assert engine.beams is OVAL.lidar.beams
    with pytest.raises((SettingsError, ModelError)):
        engine.rebuild(0, _with_another_lidar())


def _with_another_lidar():
    world = fg.World("oval")
    world.__dict__["lidar"] = type("Lidar", (), {"beams": type("Beams", (), {"geometry": object()})()})()
    return world
