"""Poses of bodies at the present state of a simulation.

MuJoCo's `data.xpos` and `data.xmat` lie one timestep behind `data.qpos` after mj_step, until mj_kinematics runs. A body
that is fixed to the body of a free joint, or to a mocap body, needs neither: its pose follows from the state itself.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import mujoco
import numpy as np

from ..arguments import Uncopied
from ..messages import FloatArray
from ..native import core

StateArrays = tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]
"""qpos, mocap_pos, mocap_quat, xpos and xmat, as in a mujoco.MjData."""

_FREE_JOINT, _MOCAP, _KINEMATICS, _LEVEL = 0, 1, 2, 3  # what a pose follows from, as in native/lidar/body_poses.cpp


class Mount(NamedTuple):
    """Mount of a body on that of a free joint, for `mounted_pose`, with `qpos[qpos_address :][:7]`."""

    qpos_address: int  # of the free joint
    offset_position: FloatArray  # (3,) [m] in the free body's frame
    offset_rotation: FloatArray  # (3, 3) into the free body's frame
    level: bool  # whether it does not tilt with the free body


class BodyPoses(Uncopied):
    """Poses of some bodies as of the last `read`.

    Attributes:
      positions, rotations: (m, 3) [m] and (m, 3, 3), into the world.
      native: the arrays of the native core.
    """

    def __init__(self, model: Any, bodies: tuple[int, ...], *, level: bool = False) -> None:
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        count = len(bodies)
        sources = np.empty((count, 2), np.int32)
        offset_positions, offset_rotations = np.zeros((count, 3)), np.tile(np.eye(3), (count, 1, 1))
        for index, body in enumerate(bodies):
            root = int(model.body_weldid[body])  # the body that it is fixed to, or itself
            joint = int(model.body_jntadr[root])
            if joint >= 0 and model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
                sources[index] = _LEVEL if level and index == 0 else _FREE_JOINT, model.jnt_qposadr[joint]
            elif model.body_mocapid[root] >= 0:
                sources[index] = _MOCAP, model.body_mocapid[root]
            else:
                sources[index] = _KINEMATICS, body
                continue
            to_root = data.xmat[root].reshape(3, 3).T
            offset_positions[index] = to_root @ (data.xpos[body] - data.xpos[root])
            offset_rotations[index] = to_root @ data.xmat[body].reshape(3, 3)
        self.positions, self.rotations = np.empty((count, 3)), np.empty((count, 3, 3))
        self._sources, self._offset_positions, self._offset_rotations = sources, offset_positions, offset_rotations
        self.native = core.Poses(sources, offset_positions, offset_rotations, self.positions, self.rotations)

    def read(self, data: Any) -> None:
        """Read the poses at the present state of `data`. Those that follow from joints want mj_kinematics before."""
        core.read_poses(self.native, *state_arrays(data))

    def mount(self, index: int) -> Mount | None:
        """Return the mount of the body of this index on that of a free joint; None where it has none."""
        kind, address = self._sources[index]
        if kind not in (_FREE_JOINT, _LEVEL):
            return None
        offset_position, offset_rotation = self._offset_positions[index].copy(), self._offset_rotations[index].copy()
        return Mount(int(address), offset_position, offset_rotation, bool(kind == _LEVEL))


def state_arrays(data: Any) -> StateArrays:
    """Return the arrays of a mujoco.MjData that `BodyPoses.read` reads."""
    return data.qpos, data.mocap_pos, data.mocap_quat, data.xpos, data.xmat


def mounted_pose(
    pose: FloatArray,
    level: bool,
    offset_position: FloatArray,
    offset_rotation: FloatArray,
    position: FloatArray,
    rotation: FloatArray,
) -> None:
    """Write position (3,) and rotation (3, 3), in the world, of what is fixed to a free body, or kept level.

    `pose` (7,) has position [m] and quaternion wxyz of the free body, in whose frame the offsets are.
    """
    core.mounted_pose(pose, level, offset_position, offset_rotation, position, rotation)
