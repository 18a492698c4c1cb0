"""The issue's oracle: on every track, from poses tilted and lifted anyhow, the LiDAR sees what MuJoCo's rays see.

No beam is excepted, not those that graze an edge either: both back ends are exact to rounding, 1e5 times finer than the
1e-4 m that is asked.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

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
CIRCUITS = ["maps/mco", "circuits/Zandvoort"]


class Scene:
    """A world, with its car in any place."""

    def __init__(self, track: str, **settings: Any) -> None:
        self.world = World(track, **settings)
        self.model = self.world.model
        self.data = mujoco.MjData(self.model)
        self.lidar = self.world.make_lidar()

    def throw(self, rng: np.random.Generator) -> None:
        """Put the car somewhere about the track: mostly tilted, sometimes above the walls, on its side or its roof."""
        track = self.world.track
        x, y, _ = track.start_pose(rng.uniform(0, track.length), rng.uniform(-0.5, 0.5))
        lift = rng.choice([0.0, rng.uniform(-0.03, 0.1), rng.uniform(0.0, 2.0 * WALL_HEIGHT)])
        tilts = [(0.0, 0.0), rng.uniform(-0.1, 0.1, 2), rng.uniform(-0.3, 0.3, 2), rng.uniform(-0.3, 0.3, 2)]
        roll, pitch = tilts[rng.integers(4)] + np.array([rng.choice([0.0, np.pi / 2, np.pi], p=[0.8, 0.1, 0.1]), 0.0])
        quaternion = np.empty(4)
        mujoco.mju_euler2Quat(quaternion, np.array([rng.uniform(-np.pi, np.pi), pitch, roll]), "zyx")
        self.data.joint("car/base_link").qpos[:] = (x, y, self.model.qpos0[2] + lift, *quaternion)
        mujoco.mj_kinematics(self.model, self.data)

    def oracle(self) -> Any:
        return mujoco_rays(self.model, self.data, self.lidar.beams, "car/" + EYE)


def assert_sees_what_mujoco_sees(scene: Scene, seed: int, poses: int = POSES) -> None:
    rng = np.random.default_rng(seed)
    returns = 0
    for _ in range(poses):
        scene.throw(rng)
        oracle = scene.oracle()
        returns += np.isfinite(oracle).sum()
        assert disagreements(scene.lidar.ranges(scene.data), oracle, TOLERANCE).size == 0
    assert returns > 0.3 * poses * 1081


@pytest.mark.slow
@each("track", track_names())
def test_raycast_sees_what_mujoco_sees_on_the_bundled_track(track: str) -> None:
    assert_sees_what_mujoco_sees(Scene(track), seed=2)


@pytest.mark.slow
@each("circuit", CIRCUITS)
def test_raycast_sees_what_mujoco_sees_on_the_real_circuit(circuit: str) -> None:
    path = DATA / f"{circuit}_centerline.csv"
    if not path.exists():
        pytest.skip(f"needs {path.name} in ../shared/data, which is no part of this repository")
    assert_sees_what_mujoco_sees(Scene(str(path)), seed=3)
