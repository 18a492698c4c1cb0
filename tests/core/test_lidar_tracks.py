"""The issue's oracle: on every track, from poses tilted and lifted anyhow, the LiDAR sees what MuJoCo's rays see.

No beam is excepted, not those that graze an edge either: both back ends are exact to rounding, 1e5 times finer than the
1e-4 m that is asked.
"""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from cases import each
from fg_mujoco.course.formats import track_names
from fg_mujoco.course.track_mesh import WALL_HEIGHT
from fg_mujoco.simulation.world import World
from lidar_worlds import EYE, disagreements, mujoco_rays

POSES = 20
TOLERANCE = 1e-9  # [m]
DATA = Path(__file__).parents[3] / "shared" / "data"
CIRCUITS = [DATA / f"{name}_centerline.csv" for name in ("maps/mco", "circuits/Zandvoort")]  # no part of the repository


def throw(world, data, rng):
    """Put the car somewhere about the track: mostly tilted, sometimes above the walls, on its side or its roof."""
    x, y, _ = world.track.start_pose(rng.uniform(0, world.track.length), rng.uniform(-0.5, 0.5))
    lift = rng.choice([0.0, rng.uniform(-0.03, 0.1), rng.uniform(0.0, 2.0 * WALL_HEIGHT)])
    tilts = [(0.0, 0.0), rng.uniform(-0.1, 0.1, 2), rng.uniform(-0.3, 0.3, 2), rng.uniform(-0.3, 0.3, 2)]
    roll, pitch = tilts[rng.integers(4)] + np.array([rng.choice([0.0, np.pi / 2, np.pi], p=[0.8, 0.1, 0.1]), 0.0])
    quaternion = np.empty(4)
    mujoco.mju_euler2Quat(quaternion, np.array([rng.uniform(-np.pi, np.pi), pitch, roll]), "zyx")
    data.joint("car/base_link").qpos[:] = (x, y, world.model.qpos0[2] + lift, *quaternion)
    mujoco.mj_kinematics(world.model, data)


@pytest.mark.slow
@each("track", [
    *track_names(), *(str(path) for path in CIRCUITS if path.exists()), "hairpins[walls=duct,height=0.2,room=5]",
    "random:3[walls=duct,height=0.33,gap=0.2,piece=2,room=2,clutter=30]", "oval[height=0.15,gap=0.3,room=1]",
    "oval[bank=12,ramp=8,roughness=C]",
])
def test_raycast_sees_what_mujoco_sees(track):
    world, rng, returns = World(track), np.random.default_rng(2), 0
    data, lidar = mujoco.MjData(world.model), world.make_lidar()
    for _ in range(POSES):
        throw(world, data, rng)
        oracle = mujoco_rays(world.model, data, lidar.beams, "car/" + EYE)
        returns += np.isfinite(oracle).sum()
        assert disagreements(lidar.ranges(data), oracle, TOLERANCE).size == 0
    assert returns > 0.3 * POSES * 1081
