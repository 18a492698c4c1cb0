"""Several cars in a world: what they see of each other, how they collide, and that nobody feels the others but so."""

import math

import mujoco
import numpy as np
import pytest

from cases import each
from fg_mujoco import World
from fg_mujoco.course.open_ground import OpenGround
from fg_mujoco.racing.entries import grid_starts
from fg_mujoco.simulation.cars import WorldCar, car_prefix
from fg_mujoco.simulation.course_loading import load_track
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.physics import STATE
from fg_mujoco.simulation.settings import Start

FRICTIONLESS = 1e-6


def place_at_random(engine, rng):
    """Put the cars of a world anywhere near each other: tilted, over the ground, wheels turned and sprung."""
    world, qpos = engine.world, engine.qpos(0)
    qpos[:] = world.model.qpos0
    for joint in range(world.model.njnt):
        kind, at = world.model.jnt_type[joint], world.model.jnt_qposadr[joint]
        if kind == mujoco.mjtJoint.mjJNT_HINGE:
            qpos[at] = rng.uniform(-0.4, 0.4)
        elif kind == mujoco.mjtJoint.mjJNT_SLIDE:
            qpos[at] = rng.uniform(-0.01, 0.01)
    for car in world.cars:
        at = int(car.constants["free_qpos"][0])
        x, y, _ = world.track.start_pose(rng.uniform(0.0, 5.0), rng.uniform(-0.9, 0.9))
        turn, tilt, both = np.empty(4), np.empty(4), np.empty(4)
        mujoco.mju_axisAngle2Quat(turn, np.array((0.0, 0.0, 1.0)), rng.uniform(-math.pi, math.pi))
        mujoco.mju_axisAngle2Quat(tilt, _unit(rng.normal(size=3) * (1.0, 1.0, 0.0)), rng.normal(scale=0.1))
        mujoco.mju_mulQuat(both, turn, tilt)
        qpos[at : at + 3] = x, y, rng.uniform(0.04, 0.12)
        qpos[at + 3 : at + 7] = both


def _unit(vector):
    return vector / np.linalg.norm(vector)


def rays_of_mujoco(world, data, car):
    """Return what MuJoCo's own single rays measure from a car's LiDAR, its own geoms left out. Shape (beams,) [m]."""
    model, beams = world.model, world.lidar.beams
    body = model.body(f"{car_prefix(car)}lidar/hokuyo").id
    own = np.flatnonzero(model.body_rootid[model.geom_bodyid] == model.body_rootid[body])
    rgba, material = model.geom_rgba[own].copy(), model.geom_matid[own].copy()
    model.geom_rgba[own, 3], model.geom_matid[own] = 0.0, -1
    directions = beams.directions @ data.xmat[body].reshape(3, 3).T
    geom = np.empty(1, np.int32)
    found = np.array([mujoco.mj_ray(model, data, data.xpos[body], way, None, 1, -1, geom) for way in directions])
    model.geom_rgba[own], model.geom_matid[own] = rgba, material
    return beams.readings(np.where(found < 0.0, math.inf, found))


def differences(one, other):
    """Return by how much two scans differ, 0 where both have the same infinity [m]."""
    apart = np.zeros(len(one))
    np.subtract(one, other, out=apart, where=one != other)
    return np.abs(apart)


@pytest.mark.slow
@each(("count", "placements"), [(2, 30), (4, 12), (8, 6)])
def test_the_cars_of_a_world_are_in_each_others_scans_as_mujocos_rays_see_them(count, placements):
    world = World("oval", others=[WorldCar(vehicle=("nuc2", "f1tenth")[i % 2]) for i in range(count - 1)])
    engine, data, rng = Engine(world), mujoco.MjData(world.model), np.random.default_rng(count)
    engine.place([Start(s=1.2 * i) for i in range(count)])
    on_cars = 0
    for _ in range(placements):
        place_at_random(engine, rng)
        engine.sense(np.ones(count, np.bool_))
        mujoco.mj_setState(world.model, data, engine.state(0), int(STATE))
        mujoco.mj_kinematics(world.model, data)
        for car in range(count):
            wanted = rays_of_mujoco(world, data, car)
            assert differences(engine.ranges[car], wanted).max() < 1e-6
            alone = world.make_lidar(car).ranges(data)
            assert differences(alone, wanted).max() < 1e-6
        on_cars += int((differences(engine.ranges[0], empty_scan(world, engine)) > 0.0).sum())
    assert on_cars > 20 * placements


def empty_scan(world, engine):
    """Return the scan of car 0 with the others far away."""
    data = mujoco.MjData(world.model)
    mujoco.mj_setState(world.model, data, engine.state(0), int(STATE))
    for car in world.cars[1:]:
        data.qpos[int(car.constants["free_qpos"][0])] += 500.0
    mujoco.mj_kinematics(world.model, data)
    return world.lidar.ranges(data)


def meet(speeds, *, head_on, offset=0.0):
    """Let two cars meet on ground without friction.

    Returns:
      The greatest change of momentum over what both had without sign, the greatest gain of energy over what there was,
      the least distance of their rear axles along x [m], and whether they touched.
    """
    world = World(OpenGround(seconds=60.0), mu=FRICTIONLESS, others=[WorldCar(mu=FRICTIONLESS)])
    engine, data, model = Engine(world, own_model=True), mujoco.MjData(world.model), world.model
    heading = math.pi if head_on else 0.0
    engine.place([Start(speed=speeds[0]), Start(s=1.6, offset=offset, heading=heading, speed=speeds[1])])
    momenta, energies, distances = [], [], []
    bases = [model.body(f"{car.prefix}base_link").id for car in world.cars]
    for _ in range(50):
        engine.read(0, data)
        mujoco.mj_forward(model, data)
        mujoco.mj_subtreeVel(model, data)
        mujoco.mj_energyPos(model, data)
        mujoco.mj_energyVel(model, data)
        momenta.append(sum(model.body_subtreemass[base] * data.subtree_linvel[base, :2] for base in bases))
        energies.append(float(data.energy.sum()))
        distances.append(float(engine.free_joint(1)[0][0] - engine.free_joint(0)[0][0]))
        engine.monitor.running[:] = True
        engine.commands[:] = [(0.0, speed) for speed in speeds]
        engine.drive()
    mass = world.cars[0].parameters.mass
    change = np.abs(np.array(momenta) - momenta[0]).max() / (mass * sum(speeds))
    gain = (max(energies) - energies[0]) / (0.5 * mass * (speeds[0] ** 2 + speeds[1] ** 2))
    return float(change), gain, min(distances), bool(engine.statistics["touches"].all())


@each("speed", [1.0, 2.0, 4.0])
@each("head_on", [True, False])
def test_cars_that_meet_keep_their_momentum_and_gain_no_energy(speed, head_on):
    change, gain, _, touched = meet((speed, speed) if head_on else (speed + 2.0, 1.0), head_on=head_on)
    assert touched
    assert change < 1e-3
    assert gain < 1e-3


def test_the_grids_are_those_of_the_rules():
    course, car = load_track("oval"), World("oval").car.parameters
    staggered = grid_starts(course, [car] * 3)
    assert [start.s for start in staggered] == [0.0, -0.8, -1.6]
    assert abs(staggered[0].offset - staggered[1].offset) == pytest.approx(0.3)
    first, second, third = grid_starts(course, [car] * 3, "side_by_side")
    assert first.s == second.s == 0.0
    assert first.offset - second.offset == pytest.approx(car.width + 0.3)
    assert third.s == pytest.approx(-(car.length + 0.8))
    behind = grid_starts(course, [car] * 3, "behind")
    assert [start.s for start in behind] == pytest.approx([0.0, 1.6, 0.8])
    open_course = load_track("scene:dead_end:1")
    assert min(start.s for start in grid_starts(open_course, [car] * 3)) == 0.0
