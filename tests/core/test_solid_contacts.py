"""How cars bounce off walls, obstacles and each other: depth, restitution and energy, at several steps."""

import math
from functools import cache

import mujoco
import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.vehicle.bodywork import RESTITUTION, fit_timestep, solref

PLACE = 2.0  # [m] along the oval: straight for metres
TRACK = "oval"


def energy(model, data):
    mujoco.mj_energyPos(model, data)
    mujoco.mj_energyVel(model, data)
    return float(data.energy.sum())


def motorless(world):
    """Return the model of a world without motors, and its data."""
    model = world.model
    for index in range(model.nu):
        if model.actuator(index).name.endswith("speed"):
            model.actuator_gainprm[index] = model.actuator_biasprm[index] = 0.0
    return model, mujoco.MjData(model)


def drive_into(world, speed, angle, gap, solid, seconds=0.3):
    """Let a car of some speed [m/s] meet what is `gap` [m] ahead of its front, at an angle [rad] to the left wall.

    Returns:
      depths: of the chassis in geoms whose names begin with `solid` (steps,) [m].
      speeds: of the centre of mass towards the wall (steps,) [m/s].
      energies: (steps,) [J].
    """
    model, data = motorless(world)
    x, y, heading = world.track.start_pose(PLACE)
    aside = np.array((-math.sin(heading), math.cos(heading)))
    chassis, base = model.geom("car/chassis").id, model.body("car/base_link").id
    half, middle = model.geom_size[chassis], model.geom_pos[chassis]
    solids = {i for i in range(model.ngeom) if model.geom(i).name.startswith(solid)}
    corners = np.array([(middle[0] + i * half[0], j * half[1]) for i in (-1, 1) for j in (-1, 1)])
    reach = (corners @ (math.sin(angle), math.cos(angle))).max()
    offset = left_wall(world) - reach - gap
    world.car.write_pose(data, *(np.array((x, y)) + offset * aside), heading + angle, speed)
    mujoco.mj_forward(model, data)
    depths, speeds, energies = [], [], []
    for _ in range(round(seconds / model.opt.timestep)):
        energies.append(energy(model, data))
        mujoco.mj_step(model, data)
        found = [contact.dist for contact in data.contact if chassis in contact.geom and solids & set(contact.geom)]
        mujoco.mj_subtreeVel(model, data)
        depths.append(max(0.0, -min(found, default=0.0)))
        speeds.append(float(data.subtree_linvel[base][:2] @ aside))
    return np.array(depths), np.array(speeds), np.array(energies)


def left_wall(world):
    """Return how far the left wall is from the line at PLACE [m]."""
    x, y, heading = world.track.start_pose(PLACE)
    ahead, found = np.array((math.cos(heading), math.sin(heading))), []
    for wall in world.track.walls:
        corners = wall.corners() - (x, y)
        along, aside = corners @ ahead, corners @ (-ahead[1], ahead[0])
        if along.min() <= 0.0 <= along.max() and aside.mean() > 0.0:
            found.append(aside.min())
    return min(found)


@cache
def oval(tires):
    return fg.World(TRACK, tires=tires)


@each("tires", ("contact", "coulomb"))
@each("degrees", (90, 70, 45, 30))
@each("speed", (2.0, 15.0, 20.0))
@pytest.mark.slow
def test_a_wall_stops_a_car_within_the_step_in_which_it_arrives(tires, degrees, speed):
    """Wherever in its step it arrives: no deeper than it moves in it, and slower afterwards; up to .4 m before."""
    angle = math.radians(degrees)
    world = oval(tires)
    for phase in np.linspace(0.0, 1.0, 4):
        gap = 0.05 + phase * speed * math.sin(angle) * 0.005
        depths, speeds, energies = drive_into(world, speed, angle, gap, "wall_")
        assert 0.0 < depths.max() <= speed * 0.005 + 0.005
        assert energies.max() < 1.001 * energies[0]
        if speed < 10.0 and degrees < 90:
            continue  # it still turns to the wall when the time is over
        rebound = -speeds.min() / (speed * math.sin(angle))
        low, high = {90: (0.15, 0.3), 70: (0.1, 0.4), 45: (0.1, 0.45), 30: (-0.1, 0.4)}[degrees]
        assert low < rebound < high, (phase, rebound)


@each("timestep", (0.001, 0.0025, 0.01))
def test_a_wall_bounces_alike_at_other_timesteps(timestep):
    """Fitted to 5 ms and left so, contacts at 10 ms would throw the car back faster than it came."""
    world = fg.World(TRACK, tires="coulomb")
    world.model.opt.timestep = timestep
    before = world.model.geom("car/chassis").solref.copy()
    fit_timestep(world.model)
    assert world.model.geom("wall_0").solref == pytest.approx(solref(timestep))
    assert not np.allclose(world.model.geom("car/chassis").solref, before)
    _, speeds, energies = drive_into(world, 5.0, 0.5 * math.pi, 0.05, "wall_")
    assert -speeds.min() / 5.0 == pytest.approx(RESTITUTION, abs=0.1) and energies.max() < 1.001 * energies[0]


def test_a_moving_obstacle_pushes_a_car_along_and_hardly_enters_it():
    """MuJoCo takes it for standing: it goes 4 times the way of a step into a car, 3 cm at 1.5 m/s, and was 18."""
    world = fg.World("scene:crossing_box:1", tires="coulomb")
    model, data = motorless(world)
    motion = world.moving[0]
    x, y, _ = world.track.start_pose(2.0)
    world.car.write_pose(data, x, y, 0.0, 0.0)
    chassis, body = model.geom("car/chassis").id, int(model.body_mocapid[model.body("moving_0").id])
    half = 0.5 * motion.length + model.geom_size[chassis][1] + 0.05
    depths, speeds = [], []
    for step in range(110):  # before it is at the wall
        data.mocap_pos[body] = x + 0.17, y - half - 0.3 + 1.5 * 0.005 * step, 0.0
        mujoco.mj_step(model, data)
        depths.append(max((-contact.dist for contact in data.contact if chassis in contact.geom), default=0.0))
        speeds.append(data.qvel[1])
    assert 0.005 < max(depths) < 0.05 and max(speeds) < 1.5 * (1.0 + RESTITUTION) + 0.5
