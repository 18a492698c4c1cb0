"""Worlds that come and go are stepped without their course where their cars touch nothing, to the same last bit."""

import mujoco
import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.course.obstacles import Box
from fg_mujoco.simulation.cars_alone import CarsAlone, without_course
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.settings import Start
from fg_mujoco.vehicle.changes import CarChanges
from fg_mujoco.vehicle.friction_patches import Patch

TICKS = 60
BOX = Box(x=5.0, y=0.4, length=0.3, width=0.3)
KINDS = ("body", "jnt", "dof", "actuator", "pair", "tendon", "eq", "sensor")
PATCH = Patch(x=2.0, y=0.0, length=1.5, width=1.4, mu=0.4)


@pytest.fixture(scope="module")
def worlds():
    return [fg.World("oval"), fg.World("random:0", obstacles=(BOX,), patches=(PATCH,))]


def test_cars_alone_on_other_heights_are_others():
    texts = {fg.World(f"oval[roughness=D,ground_seed={seed}]").xml_of_cars for seed in (1, 2, 2)}
    assert len(texts) == 2 and not any("elevation" in text for text in texts)


def rebuilt(worlds):
    """Return an engine whose worlds have come in the places of others, with cars alone."""
    engine = Engine(worlds[0], len(worlds))
    engine.rebuild_worlds(dict(enumerate(worlds)))
    return engine


def alone(engine):
    return engine._batches[0]._alone


def driven(engine, changes=()):
    """Drive to the left until the cars hit the walls, and on; return what is known of each tick."""
    for i, change in enumerate(changes):
        engine.change(i, [change] * engine.cars_per_world)
    rows = len(engine.commands)
    engine.place([Start(s=0.7 * row, speed=2.0) for row in range(rows)])
    rng, seen = np.random.default_rng(4), []
    for _ in range(TICKS):
        engine.commands[:] = np.column_stack((rng.uniform(-0.1, 0.4, rows), np.full(rows, 6.0)))
        engine.sense()
        engine.drive()
        engine.judge()
        engine.running[:] = True  # who has crashed drives on
        seen += [*(engine.state(i).copy() for i in range(engine.count)), engine.telemetry.copy(), engine.ranges.copy()]
        seen.append(np.array([engine.records(i)[-1] for i in range(engine.count)]))
    return seen, engine.crashed.copy()


@each("changes", [(), (CarChanges(mu=0.5, mass=4.0), CarChanges(speed_gain=0.8, center_of_gravity_height=0.06))])
def test_cars_alone_move_as_in_their_worlds(worlds, changes):
    """Oracle: the same worlds as batches of their own, which have no cars alone."""
    engine, plain = rebuilt(worlds), Engine(worlds)
    assert alone(engine) is engine._batches[1]._alone is not None
    assert alone(plain) is None
    (seen, crashed), (wanted, _) = driven(engine, changes), driven(plain, changes)
    assert crashed.all()  # so that both ways were gone
    for own, other in zip(seen, wanted, strict=True):
        np.testing.assert_array_equal(own, other)


def test_cars_alone_are_the_cars_of_the_world(worlds):
    """All that belongs to bodies, joints, actuators, pairs, tendons, equalities and sensors, but for ids of geoms."""
    texts = [without_course(world.xml) for world in worlds]
    assert texts[0] == texts[1] != without_course(fg.World("oval", mu=0.7).xml)
    cars = mujoco.MjModel.from_xml_string(texts[0])
    own = CarsAlone(texts[0], worlds[0].model, worlds[0].cars)._model
    np.testing.assert_array_equal(own.dof_length, worlds[0].model.dof_length)
    of_geoms = {"pair_geom1", "pair_geom2", "sensor_objid"}
    of_geoms |= {"body_geomadr", "body_geomnum", "body_bvhadr", "body_bvhnum", "dof_length"}
    for world in worlds:
        model, compared = world.model, 0
        for name in dir(cars):
            kind, value = name.partition("_")[0], getattr(cars, name)
            if kind not in KINDS or name in of_geoms or not isinstance(value, np.ndarray):
                continue
            first = 1 if kind == "body" else 0  # body 0 is the ground with all that stands there
            np.testing.assert_array_equal(value[first:], getattr(model, name)[first:], err_msg=name)
            compared += 1
        assert compared > 100
        assert cars.stat.meaninertia == model.stat.meaninertia
