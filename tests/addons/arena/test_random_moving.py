"""Things that move on circuits: where they are, that they stay between the walls; race, replay and rollout agree."""


import numpy as np

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.arena.random_courses.moving import with_moving
from fg_mujoco.course.course import outline, wall_outlines
from fg_mujoco.course.definitions import course_of
from fg_mujoco.racing.resolved import ground_of
from fg_mujoco.racing.setup import Setup
from fg_mujoco.vehicle.vehicle import Vehicle

CAR = Vehicle.load().parameters
ALL = "box,crossing,pedestrian"


def least_distance(points, sides):
    """Return the least distance of points (n, 2) to sides (m, 4), by its definition [m]."""
    start, along = sides[:, :2], sides[:, 2:] - sides[:, :2]
    away = points[:, np.newaxis] - start
    share = np.clip((away * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
    return float(np.linalg.norm(away - share[..., np.newaxis] * along, axis=2).min())


@each("name", ["oval", "tight"])
def test_nothing_that_moves_comes_to_a_wall_or_to_the_grid(name):
    track = fg.load_track(name)
    walls = np.concatenate([outline(line) for line in wall_outlines(track)])
    for seed in range(6):
        for thing in with_moving(track, ALL, seed, car=CAR, cars=4).moving:
            later = (2.0 * thing.way + abs(thing.headway)) / thing.speed
            corners = np.concatenate([thing.corners(time) for time in np.linspace(0.0, later, 40).tolist()])
            assert least_distance(corners, walls) > 0.03
            s, offset = track.project(corners)
            right, left = (np.interp(s, track.arc_length, side,
                                     period=track.length) for side in (track.corridor_right, track.corridor_left))
            assert ((offset > -right) & (offset < left)).all()
            assert ((s > 2.5) & (s < track.length - 3.0)).all()  # the last of four cars is 2.4 m behind the start


def test_what_moves_is_drawn_by_the_seed_and_boxes_stand_elsewhere():
    setup = Setup.of("oval", moving="crossing, pedestrian:2", obstacle_seed=5, obstacles=6)
    assert setup.moving == "crossing,pedestrian:2"
    course = ground_of(setup).course
    assert course is ground_of(setup).course and len(course.moving) == 5
    assert course.moving != ground_of(setup.replace(obstacle_seed=6)).course.moving
    places = course.project(np.array([each.start for each in course.moving]))[0]
    boxes = course.project(np.array([[each.x, each.y] for each in ground_of(setup).boxes]))[0]
    apart = np.abs((boxes[:, np.newaxis] - places + 0.5 * course.length) % course.length - 0.5 * course.length)
    assert apart.min() > 2.5
    again = course_of(course.name, course.definition)
    assert again.moving == course.moving
    assert "moving" not in fg.load_track("oval").definition
