"""A LiDAR that turns during its sweep sees other cars and moving obstacles where they were when each beam was cast."""

import mujoco
import numpy as np
import pytest

import fg_mujoco as fg
from fg_mujoco.course.moving_obstacles import moving_obstacles, place_moving
from fg_mujoco.lidar.lidar import RaycastLidar
from fg_mujoco.lidar.scan_pipeline import PoseHistory
from fg_mujoco.simulation.cars import WorldCar, lidar_prefix
from fg_mujoco.simulation.engine import Engine

DISTORTED = fg.LidarEffects(motion_distortion=True)
STEP = 2  # of the beams that are worked out slowly


def driven(world, starts, speeds, ticks):
    """Drive cars straight on; return the scan of car 0 then, and time and state of each physics step."""
    engine = Engine(world)
    count = len(world.cars)
    engine.place(starts, effects=[DISTORTED] + [fg.LidarEffects()] * (count - 1), seeds=[0] * count)
    states = [engine.state(0).copy()]
    engine.after_substep.append(lambda engine, _: states.append(engine.state(0).copy()))
    engine.commands[:, 1] = speeds
    for _ in range(ticks):
        engine.sense()
        engine.drive()
    engine.sense()
    return engine.ranges[0].copy(), np.array(states)


def slowly(world, states, *, still=False):
    """What each `STEP`-th beam measures, by a whole scan at the moment of each: another ray caster, no histories.

    Between two physics steps positions go evenly. `still`: only the LiDAR's own car is where it was.
    """
    model, lidar = world.model, RaycastLidar(world.model, lidar_prefix(0))
    data, moving = mujoco.MjData(model), moving_obstacles(model)
    kind = mujoco.mjtState.mjSTATE_QPOS
    size = mujoco.mj_stateSize(model, kind)
    times, positions = states[:, 0], states[:, 1 : 1 + size]
    count = len(lidar.beams.bearings)
    found = np.empty(len(range(0, count, STEP)))
    own = slice(0, model.nq // len(world.cars))
    for place, beam in enumerate(range(0, count, STEP)):
        time = max(times[-1] - lidar.beams.time_increment * (count - 1 - beam), times[0])
        data.qpos[:] = [np.interp(time, times, column) for column in positions.T]
        if still:
            data.qpos[own.stop :] = positions[-1, own.stop :]
        data.time = times[-1] if still else time
        place_moving(moving, data)
        mujoco.mj_kinematics(model, data)
        found[place] = lidar.ranges(data)[beam]
    return found


def compare(world, ranges, states):
    """Return by how much the scan differs from the slow one, and the slow one from that of a world that stands."""
    true, still = slowly(world, states), slowly(world, states, still=True)
    found, finite = ranges[::STEP], np.isfinite(true)
    return np.abs(found[finite] - true[finite]), np.abs(still[finite] - true[finite])


def test_another_car_is_where_it_was():
    world = fg.World("oval", others=[WorldCar()])
    starts = [fg.Start(s=4.0, heading=1.4), fg.Start(s=4.75, speed=5.0)]  # to the right, where beams are older
    ranges, states = driven(world, starts, [0.0, 5.0], 2)
    differs, moved = compare(world, ranges, states)
    on_car = (moved > 1e-3) & (moved < 0.5)
    assert on_car.sum() > 10 and moved[on_car].max() > 0.07  # by so much it was wrong where cars stood still
    assert differs[on_car].max() < 1e-4 and (differs < 1e-4).mean() > 0.98  # a beam may miss an edge by a hair


def test_a_moving_obstacle_is_where_it_was():
    world = fg.World("scene:slow_leader:0")
    ranges, states = driven(world, [fg.Start(heading=1.0)], [1.0], 6)
    differs, moved = compare(world, ranges, states)
    on_box = (moved > 1e-3) & (moved < 0.5)
    assert on_box.sum() > 5 and moved[on_box].max() > 0.01
    assert differs[on_box].max() < 1e-4 and (differs < 1e-4).mean() > 0.98


def test_a_body_that_was_put_elsewhere_is_nowhere_in_between():
    history, turn = PoseHistory(1.0), np.array((1.0, 0.0, 0.0, 0.0))
    for time, x in ((0.0, 0.0), (0.005, 0.1), (0.010, 60.0), (0.015, 60.1)):
        history.record(time, np.array((x, 0.0, 0.0)), turn)
    positions, _ = history.at(np.array((0.0025, 0.006, 0.0099, 0.010, 0.0125)))
    assert positions[:, 0] == pytest.approx((0.05, 0.1, 0.1, 60.0, 60.05))
