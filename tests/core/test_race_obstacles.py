"""Boxes on the track of a race, at random places that a number repeats; and scenes, on the command line."""


import numpy as np

import fg_mujoco as fg
from conftest import Straight
from fg_mujoco.course.random_obstacles import CLEAR_AHEAD
from fg_mujoco.simulation.course_loading import default_car


def race(track="oval", **settings):
    return fg.race(track, Straight(), time_limit=0.2, **settings)


def test_the_same_seed_places_the_same_boxes_and_the_result_says_which():
    first, again, other = (race(obstacles=5, obstacle_seed=seed) for seed in (3, 3, 4))
    expected = fg.load_track("oval").obstacle_sites(default_car()).place(5, 0.0, np.random.default_rng(3))
    assert first.world.obstacles == again.world.obstacles == expected != other.world.obstacles
    assert first.trajectory_sha256 == again.trajectory_sha256
    assert (first.obstacles, first.obstacle_seed) == (5, 3)
    assert (first.summary()["obstacles"], first.summary()["obstacle_seed"]) == (5, 3)


def test_the_start_is_clear_of_them_wherever_it_is():
    track = fg.load_track("oval")
    for s in (0.0, 7.0, 20.0):
        result = race(obstacles=6, obstacle_seed=1, start=fg.Start(s=s))
        stations, _ = track.project([(box.x, box.y) for box in result.world.obstacles])
        assert ((stations - s) % track.length).min() >= CLEAR_AHEAD - 0.1
        assert not result.car.collisions_wall
