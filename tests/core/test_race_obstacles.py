"""Boxes on the track of a race, at random places that a number repeats; and scenes, on the command line."""

import fg_mujoco as fg
from conftest import Straight
from fg_mujoco.course.random_obstacles import CLEAR_AHEAD


def race(track="oval", **settings):
    return fg.race(track, Straight(), time_limit=0.2, **settings)


def test_the_start_is_clear_of_them_wherever_it_is():
    track = fg.load_track("oval")
    for s in (0.0, 7.0, 20.0):
        result = race(obstacles=6, obstacle_seed=1, start=fg.Start(s=s))
        stations, _ = track.project([(box.x, box.y) for box in result.world.obstacles])
        assert ((stations - s) % track.length).min() >= CLEAR_AHEAD - 0.1
        assert not result.car.collisions_wall
