"""What holds for every scene, whatever it is about, and seed after seed."""

import dataclasses
import math

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from scene_search import Clearances, disc_gets_through, solids_of

CELL = 0.025
SEEDS = (0, 1)

every_scene = each("name", fg.scene_names())
every_scene_and_seed = each("name", [f"{name}:{seed}" for name in fg.scene_names() for seed in SEEDS])


def load(name):
    return fg.load_track(f"scene:{name}")


def clearances(scene, solids):
    low, high = scene.bounds
    return Clearances(solids, low - 0.3, high + 0.3, CELL)


CAR = fg.Vehicle.load().parameters


def footprint(pose, car):
    """Points on the outline of the car."""
    x, y, heading = pose
    along = np.linspace(-car.rear_overhang, car.length - car.rear_overhang, 30)
    outline = np.concatenate(
        [np.column_stack((along, np.full(30, side))) for side in (-0.5 * car.width, 0.5 * car.width)]
    )
    cos, sin = math.cos(heading), math.sin(heading)
    return outline @ np.array([[cos, sin], [-sin, cos]]) + (x, y)


def same(a, b):
    """Whether two scenes are the same to the last bit."""
    return all(
        np.array_equal(getattr(a, f.name), getattr(b, f.name))
        if f.name == "way"
        else getattr(a, f.name) == getattr(b, f.name)
        for f in dataclasses.fields(a)
    )


@every_scene
def test_the_same_seed_is_the_same_scene_and_another_seed_another(name):
    assert same(load(f"{name}:3"), load(f"{name}:3"))
    assert same(load(name), load(f"{name}:0"))
    other = dataclasses.replace(load(f"{name}:4"), name=load(f"{name}:3").name)
    assert not same(load(f"{name}:3"), other)


@every_scene
def test_a_seed_that_is_none_is_refused(name):
    for seed in ("", "-1", "1.5", "x", "1:2", " 1", "9" * 19):
        with pytest.raises(fg.TrackError, match="accepted: scene:NAME:SEED"):
            load(f"{name}:{seed}")


@every_scene_and_seed
def test_the_start_is_clear_of_everything(name):
    scene = load(name)
    points = footprint(scene.start_pose(), CAR)
    around = Clearances(solids_of(scene), points.min(axis=0), points.max(axis=0), CELL)
    assert around.at(points).min() > 0.1


@pytest.mark.slow
@every_scene_and_seed
def test_the_goal_can_be_reached_by_a_disc_as_wide_as_the_car(name):
    scene = load(name)
    field = clearances(scene, [*scene.walls, *scene.obstacles])
    start, goal = scene.position(0.0), scene.position(scene.length)
    assert disc_gets_through(field, start, goal, 0.5 * CAR.width)
    assert field.at(goal)[0] > 0.0


@pytest.mark.slow
@every_scene_and_seed
def test_walls_are_closed_and_the_way_leads_clear_of_them(name):
    scene = load(name)
    field = clearances(scene, scene.walls)
    assert not disc_gets_through(field, scene.position(0.0), field.low + CELL, 0.03)  # not even a disc of 6 cm gets out
    beyond = 0.0 if scene.goal_is_to_stop else 3.0 - 1e-6
    assert field.at(scene.position(np.arange(-2.0, scene.length + beyond, 0.05))).min() > 0.2
    assert scene.start >= 2.0 and scene.way_length - scene.goal >= 3.0 - 1e-9
