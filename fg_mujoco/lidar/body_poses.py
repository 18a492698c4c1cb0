"""Poses of bodies at the present state of a simulation.

MuJoCo's `data.xpos` and `data.xmat` lie one timestep behind `data.qpos` after mj_step, until mj_kinematics runs. A body
that is fixed to the body of a free joint, or to a mocap body, needs neither: its pose follows from the state itself.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..compiled.kernels import kernel
from ..messages import FloatArray

PoseArrays = tuple[NDArray[np.int32], FloatArray, FloatArray, FloatArray, FloatArray]
"""Of m bodies: what each pose follows from and where that lies, offsets of positions and rotations, the poses."""
StateArrays = tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]
"""qpos, mocap_pos, mocap_quat, xpos and xmat, as in a mujoco.MjData."""

_FREE_JOINT, _MOCAP, _KINEMATICS, _LEVEL = 0, 1, 2, 3  # what a pose follows from; of a free joint that stays level
_LEAST_NORM = 1e-15  # mjMINVAL: MuJoCo takes shorter quaternions for no rotation


class Mount(NamedTuple):
    """Mount of a body on that of a free joint, for `mounted_pose`, with `qpos[qpos_address :][:7]`."""

    qpos_address: int  # of the free joint
    offset_position: FloatArray  # (3,) [m] in the free body's frame
    offset_rotation: FloatArray  # (3, 3) into the free body's frame
    level: bool  # whether it does not tilt with the free body


class BodyPoses:
    """Poses of some bodies as of the last `read`: `positions` (m, 3) [m], `rotations` (m, 3, 3) into the world."""

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
        self.arrays: PoseArrays = (sources, offset_positions, offset_rotations, self.positions, self.rotations)

    def read(self, data: Any) -> None:
        """Read the poses at the present state of `data`. Those that follow from joints want mj_kinematics before."""
        read_poses(self.arrays, state_arrays(data))

    def mount(self, index: int) -> Mount | None:
        """Return the mount of the body of this index on that of a free joint; None where it has none."""
        sources, offset_positions, offset_rotations, _, _ = self.arrays
        kind, address = sources[index]
        if kind not in (_FREE_JOINT, _LEVEL):
            return None
        return Mount(int(address), offset_positions[index].copy(), offset_rotations[index].copy(), bool(kind == _LEVEL))


def state_arrays(data: Any) -> StateArrays:
    """Return the arrays of a mujoco.MjData that `read_poses` reads."""
    return data.qpos, data.mocap_pos, data.mocap_quat, data.xpos, data.xmat


@kernel
def mounted_pose(
    pose: tuple[float, ...],
    level: bool,
    offset_position: FloatArray,
    offset_rotation: FloatArray,
    position: FloatArray,
    rotation: FloatArray,
) -> None:
    """Write position (3,) and rotation (3, 3), in the world, of what is fixed to a free body, or kept level.

    `pose` (7,) has position [m] and quaternion wxyz of the free body, in whose frame the offsets are.
    """
    w, x, y, z = pose[3], pose[4], pose[5], pose[6]
    if level:
        x = y = 0.0
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    if norm < _LEAST_NORM:
        w, x, y, z, norm = 1.0, 0.0, 0.0, 0.0, 1.0
    w, x, y, z = w / norm, x / norm, y / norm, z / norm
    turn = (
        (w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z),
    )
    for i in range(3):
        a, b, c = turn[i]
        position[i] = pose[i] + (a * offset_position[0] + b * offset_position[1] + c * offset_position[2])
        for j in range(3):
            rotation[i, j] = a * offset_rotation[0, j] + b * offset_rotation[1, j] + c * offset_rotation[2, j]


@kernel
def read_poses(poses: PoseArrays, state: StateArrays) -> None:
    """Write the poses of the bodies of a BodyPoses at the state of a simulation, into the last two of its arrays."""
    sources, offset_positions, offset_rotations, positions, rotations = poses
    qpos, mocap_pos, mocap_quat, xpos, xmat = state
    for i in range(len(sources)):
        kind, place = sources[i]
        if kind == _KINEMATICS:
            for j in range(3):  # numba takes seconds to compile the copying of an array into part of another
                positions[i, j] = xpos[place, j]
                for k in range(3):
                    rotations[i, j, k] = xmat[place, 3 * j + k]
            continue
        if kind != _MOCAP:
            p, q = qpos[place : place + 3], qpos[place + 3 : place + 7]
        else:
            p, q = mocap_pos[place], mocap_quat[place]
        pose = (p[0], p[1], p[2], q[0], q[1], q[2], q[3])
        mounted_pose(pose, kind == _LEVEL, offset_positions[i], offset_rotations[i], positions[i], rotations[i])
