"""Poses of bodies at the present state of a simulation.

MuJoCo's `data.xpos` and `data.xmat` lie one timestep behind `data.qpos` after mj_step, until mj_kinematics runs. A body
that is fixed to the body of a free joint, or to a mocap body, needs neither: its pose follows from the state itself.

A batch of worlds keeps `qpos` of each and no poses. What a LiDAR sees of another car, wheels too, is placed from the
positions of its joints alone, by the links of its kinematic tree: as mj_kinematics, without MuJoCo.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..arguments import Uncopied
from ..messages import FloatArray
from ..native import check_record, core

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


LINK = np.dtype(
    [
        ("parent", np.int64),  # the link that it hangs on; -1: the world
        ("kind", np.int64),  # mjtJoint; -1: fixed
        ("qpos", np.int64),  # where its joint's positions begin
        ("qpos0", np.float64),  # of a slide or a hinge
        ("place", np.float64, (3,)),  # [m] in the frame of the parent
        ("turn", np.float64, (4,)),  # quaternion wxyz into it
        ("axis", np.float64, (3,)),  # of the joint, in its own frame
        ("anchor", np.float64, (3,)),  # [m]
        ("frame", np.int64),  # place among the bodies that are asked for; -1: none of them
    ]
)
"""A body with one joint at most; one of several joints is several links. native/lidar/links.cpp places them."""

LinkRows = NDArray[np.void]

check_record("LINK", LINK, core.link_fields())


def make_links(model: Any, bodies: tuple[int, ...]) -> LinkRows:
    """Return the links that the poses of `bodies` follow from, in an order in which each comes behind its parent."""
    wanted = set()
    for body in bodies:
        while body > 0:
            wanted.add(body)
            body = int(model.body_parentid[body])
    rows: list[Any] = []
    last: dict[int, int] = {0: -1}
    for body in sorted(wanted):  # parents have lesser ids
        joints = range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body])
        parent = last[int(model.body_parentid[body])]
        place, turn = model.body_pos[body], model.body_quat[body]
        for joint in joints or (-1,):
            row = np.zeros((), LINK)
            row["parent"], row["kind"], row["place"], row["turn"], row["frame"] = parent, -1, place, turn, -1
            if joint >= 0:
                row["kind"], row["qpos"] = model.jnt_type[joint], model.jnt_qposadr[joint]
                row["qpos0"] = model.qpos0[row["qpos"]]
                row["axis"], row["anchor"] = model.jnt_axis[joint], model.jnt_pos[joint]
            parent = len(rows)
            rows.append(row)
            place, turn = np.zeros(3), np.array((1.0, 0.0, 0.0, 0.0))
        last[body] = parent
    for frame, body in enumerate(bodies):
        rows[last[body]]["frame"] = frame
    links = np.array(rows, LINK) if rows else np.zeros(0, LINK)
    links.flags.writeable = False
    return links
