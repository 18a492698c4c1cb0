"""Where a car may start: beyond the walls, in one or in an obstacle is refused where it is set, a crash where drawn."""

import numpy as np

import fg_mujoco as fg
from cases import each
from fg_mujoco.course.standing import off_course
from map_oracles import draw_map, ring

CAR = fg.Vehicle.load("f1tenth").parameters


def found(course, points):
    return np.array([off_course(course, point, point) for point in points])


@each("name", ["oval", "hairpins", "random:3"])
def test_a_place_is_off_a_track_where_no_corridor_has_it(name):
    """The oracle is the projection: a place has an offset from the line, and the line has room to both sides."""
    course, rng = fg.load_track(name), np.random.default_rng(1)
    low, high = course.bounds
    points = rng.uniform(low - 2.0, high + 2.0, (400, 2))
    s, offset = course.project(points)
    room = [
        np.interp(s, course.arc_length, side, period=course.length)
        for side in (course.corridor_right, course.corridor_left)
    ]
    spare = np.minimum(offset + room[0], room[1] - offset)
    clear = np.abs(spare) > 0.05
    off = found(course, points)
    assert (off[clear] == (spare[clear] < 0.0)).all()
    assert off.any() and not off.all()


def test_a_place_is_off_a_map_where_its_image_is_not_free(tmp_path):
    free = ring()
    free[40:50, 145:155] = False  # an island
    course, rng = fg.load_track(draw_map(tmp_path, free)), np.random.default_rng(2)
    rows, columns = (rng.integers(3, size - 3, 600) for size in free.shape)
    shares = [free[r - 2 : r + 3, c - 2 : c + 3].mean() for r, c in zip(rows, columns, strict=True)]
    same = np.isin(shares, (0.0, 1.0))
    off = found(course, 0.05 * np.column_stack((columns + 0.5, rows + 0.5)))
    assert (off[same] == ~free[rows, columns][same]).all()
    assert off_course(course, (7.5, 2.25), course.start_pose())  # in the island


# -- drawn


def test_a_rollout_has_a_crash_at_0_s_where_it_is_drawn():
    result = fg.rollout("oval", n=40, randomize={"start_offset": (-3.0, 3.0)}, time_limit=0.5)
    aside = np.abs(result["start_offset"])
    beyond, clear = aside > 1.1, aside < 1.1 - 0.5 * CAR.width - 0.05
    assert beyond.any() and clear.any()
    assert (result["end_reason"][beyond] == "crash").all() and (result["collisions"][beyond] == 1).all()
    assert (result["sim_time_s"][aside > 1.1 - 0.5 * CAR.width] == 0.0).all()
    assert (result["end_reason"][clear] == "time_limit").all()
    assert (result["collisions"][clear] == 0).all()
