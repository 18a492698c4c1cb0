"""Where cars touch nothing, contacts are not searched for, and nothing else changes, to the last bit."""

import math

import mujoco
import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.course.obstacles import Box
from fg_mujoco.racing.planners import make_controller
from fg_mujoco.simulation.cars import WorldCar
from fg_mujoco.simulation.clear_ground import REACH, distances_of, find_clear_ground, touches_nothing
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.planner_adapter import adapt, start
from fg_mujoco.simulation.settings import Start
from fg_mujoco.vehicle.car import WHEELS

NOTHING = np.zeros((0, 0)), np.zeros(2)


def searched(world):
    """Return the world as it was before: with no place known to be clear."""
    world.distances = NOTHING
    return world


def is_clear(engine):
    """Say whether the cars of world 0 are clear of everything now."""
    batch = engine._batches[0]
    cars = batch._arrays.constants[: engine.cars_per_world]
    return touches_nothing(engine.qpos(0), cars, batch.clear)


def driven(engine, ticks):
    states = []
    for _ in range(ticks):
        engine.sense()
        engine.decide()
        engine.drive()
        engine.judge()
        states.append(engine.state(0).copy())
    return np.array(states)


@pytest.mark.slow
@each("track", ("oval", "tight", "boxes", "maze", "scene:dead_end:1"))
def test_a_car_that_is_clear_touches_nothing(track):
    """Oracle: MuJoCo's own search for contacts, and its distance of the chassis from each solid, at random places."""
    world, rng = fg.World(track), np.random.default_rng(3)
    engine, data = Engine(world), mujoco.MjData(world.model)
    model = world.model
    chassis = model.geom("car/chassis").id
    solids = [g for g in range(model.ngeom) if model.geom_contype[g] == 2]
    low, high = world.track.bounds
    counts = [0, 0]
    for _ in range(150):
        x, y = rng.uniform(low - 1.0, high + 1.0)
        world.car.write_pose(data, x, y, rng.uniform(-math.pi, math.pi), 0.0)
        tilt = rng.normal(0.0, 0.1, 3)
        data.qpos[2] += rng.uniform(-0.02, 0.02)
        data.qpos[4:7] += tilt
        data.qpos[3:7] /= np.linalg.norm(data.qpos[3:7])
        mujoco.mj_forward(model, data)
        mujoco.mj_getState(model, data, engine.state(0), int(mujoco.mjtState.mjSTATE_INTEGRATION))
        clear = is_clear(engine)
        counts[clear] += 1
        if clear:
            tires = {model.geom(f"car/{wheel}_tire").id for wheel in WHEELS}
            assert all(set(contact.geom.tolist()) & tires for contact in data.contact)
            away = np.linalg.norm(data.geom_xpos[solids] - data.geom_xpos[chassis], axis=1) - model.geom_rbound[solids]
            near = np.array(solids)[away < 1.0].tolist()
            assert min((mujoco.mj_geomDistance(model, data, chassis, g, 2.0, None) for g in near), default=2.0) > 0.0
    assert min(counts) > 10 or track != "oval"


@each("tires", ("contact", "coulomb"))
def test_a_race_has_the_same_bits_as_when_all_walls_are_searched(tires):
    states, shares = [], []
    for make in (lambda world: world, searched):
        world = make(fg.World("hairpins", tires=tires))
        planner = make_controller(
            "gap_finder", car=world.parameters, mu=1.0489, max_speed=8.0, map_line=world.track.map_line
        )
        start(planner)
        engine = Engine(world)
        engine.planners = adapt([planner])
        engine.place([Start()])
        share = 0
        rows = []
        for _ in range(200):
            share += is_clear(engine)
            rows.append(driven(engine, 1)[0])
        states.append(np.array(rows))
        shares.append(share)
    assert states[0].tobytes() == states[1].tobytes()
    assert shares[0] > 60 and shares[1] == 0


def test_a_wrong_map_of_distances_would_miss_the_crash():
    """A check of the tests above: were everything clear, the car would drive through the wall."""
    world = fg.World("oval")
    world.distances = np.full((1, 1), REACH), np.zeros(2)
    engine = Engine(world)
    engine.place([Start(s=2.0, heading=0.9, speed=3.0)])
    for _ in range(60):
        engine.commands[:] = 0.0, 3.0
        engine.drive()
    assert not engine.crashed[0]


def test_cars_near_each_other_are_searched_and_cars_apart_are_not():
    world = fg.World("fast", others=(WorldCar(), WorldCar()))
    engine = Engine(world)
    engine.place([Start(s=2.0), Start(s=2.5), Start(s=12.0)])
    assert not is_clear(engine)
    engine.place([Start(s=2.0), Start(s=7.0), Start(s=12.0)])
    assert is_clear(engine)


@each(("height", "roll"), [(-0.04, 0.0), (0.0, 0.5), (0.0, math.pi)])
def test_a_car_that_is_low_or_tilts_is_searched(height, roll):
    engine = Engine(fg.World("fast"))
    engine.place([Start(s=2.0)])
    engine.qpos(0)[2] += height
    engine.qpos(0)[3:7] = math.cos(0.5 * roll), math.sin(0.5 * roll), 0.0, 0.0
    assert is_clear(engine) == (height == 0.0 and roll == 0.0)


def test_what_is_in_the_way_is_known_and_what_moves_or_is_too_large_leaves_nothing_out(monkeypatch):
    plain, (grid, corner) = fg.World("fast"), fg.World("fast").distances
    x, y, _ = plain.track.start_pose(2.0)
    row, column = (round((value - low) / 0.25) for value, low in zip((y, x), corner[::-1], strict=True))
    assert grid[row, column] > 0.5
    world = fg.World("fast", obstacles=(Box(x=x, y=y, length=0.8, width=0.8),))
    assert world.distances[0][row, column] == 0.0
    assert fg.World("scene:crossing_box:1").distances[0].size == 0
    monkeypatch.setattr("fg_mujoco.simulation.clear_ground.MOST_CELLS", 100)
    assert distances_of(plain.model)[0].size == 0
    assert find_clear_ground(NOTHING, plain.model, ("car/",)).distances.size == 0
