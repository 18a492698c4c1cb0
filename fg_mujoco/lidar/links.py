"""Poses of the bodies of a kinematic tree from the positions of its joints alone: as mj_kinematics, without MuJoCo.

A batch of worlds keeps `qpos` of each and no poses. What a LiDAR sees of another car, wheels too, is placed by this.
"""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..compiled.kernels import kernel
from ..messages import FloatArray

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
"""A body with one joint at most; one of several joints is several links. Kernels take an array (n,) of it."""

LinkRows = NDArray[np.void]

_FREE, _BALL = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)
_SLIDE, _HINGE = int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE)


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


@kernel
def place_links(
    qpos: FloatArray,
    links: LinkRows,
    poses: FloatArray,
    positions: FloatArray,
    rotations: FloatArray,
) -> None:
    """Write where bodies of `links` (n,) are: positions (bodies, 3) [m], rotations (bodies, 3, 3); `poses` is room."""
    for i in range(len(links)):
        link = links[i]
        if link.kind == _FREE:
            for k in range(3):
                poses[i, k] = qpos[link.qpos + k]
            w, x, y, z = _unit(qpos[link.qpos + 3], qpos[link.qpos + 4], qpos[link.qpos + 5], qpos[link.qpos + 6])
        else:
            px, py, pz, pw, pa, pb, pc = 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0
            if link.parent >= 0:
                p = poses[link.parent]
                px, py, pz, pw, pa, pb, pc = p[0], p[1], p[2], p[3], p[4], p[5], p[6]
            dx, dy, dz = _turned(pw, pa, pb, pc, link.place[0], link.place[1], link.place[2])
            px, py, pz = px + dx, py + dy, pz + dz
            w, x, y, z = _product(pw, pa, pb, pc, link.turn[0], link.turn[1], link.turn[2], link.turn[3])
            if link.kind == _SLIDE:
                way = qpos[link.qpos] - link.qpos0
                dx, dy, dz = _turned(w, x, y, z, link.axis[0], link.axis[1], link.axis[2])
                px, py, pz = px + way * dx, py + way * dy, pz + way * dz
            elif link.kind == _HINGE or link.kind == _BALL:
                ax, ay, az = _turned(w, x, y, z, link.anchor[0], link.anchor[1], link.anchor[2])
                if link.kind == _HINGE:
                    half = 0.5 * (qpos[link.qpos] - link.qpos0)
                    sine = math.sin(half)
                    qw, qx, qy, qz = math.cos(half), sine * link.axis[0], sine * link.axis[1], sine * link.axis[2]
                else:
                    qw, qx, qy, qz = _unit(
                        qpos[link.qpos], qpos[link.qpos + 1], qpos[link.qpos + 2], qpos[link.qpos + 3]
                    )
                w, x, y, z = _product(w, x, y, z, qw, qx, qy, qz)
                dx, dy, dz = _turned(w, x, y, z, link.anchor[0], link.anchor[1], link.anchor[2])
                px, py, pz = px + ax - dx, py + ay - dy, pz + az - dz
            w, x, y, z = _unit(w, x, y, z)
            poses[i, 0], poses[i, 1], poses[i, 2] = px, py, pz
        poses[i, 3], poses[i, 4], poses[i, 5], poses[i, 6] = w, x, y, z
        if link.frame >= 0:
            for k in range(3):
                positions[link.frame, k] = poses[i, k]
            turn = rotations[link.frame]
            turn[0, 0], turn[1, 1], turn[2, 2] = (
                w * w + x * x - y * y - z * z,
                w * w - x * x + y * y - z * z,
                w * w - x * x - y * y + z * z,
            )
            turn[0, 1], turn[1, 0] = 2.0 * (x * y - w * z), 2.0 * (x * y + w * z)
            turn[0, 2], turn[2, 0] = 2.0 * (x * z + w * y), 2.0 * (x * z - w * y)
            turn[1, 2], turn[2, 1] = 2.0 * (y * z - w * x), 2.0 * (y * z + w * x)


@kernel
def _unit(w: float, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    if norm < 1e-15:  # mjMINVAL
        return 1.0, 0.0, 0.0, 0.0
    return w / norm, x / norm, y / norm, z / norm


@kernel
def _product(
    w: float, x: float, y: float, z: float, a: float, b: float, c: float, d: float
) -> tuple[float, float, float, float]:
    return (
        w * a - x * b - y * c - z * d,
        w * b + x * a + y * d - z * c,
        w * c - x * d + y * a + z * b,
        w * d + x * c - y * b + z * a,
    )


@kernel
def _turned(w: float, x: float, y: float, z: float, vx: float, vy: float, vz: float) -> tuple[float, float, float]:
    """Turn a vector by a unit quaternion."""
    tx, ty, tz = 2.0 * (y * vz - z * vy), 2.0 * (z * vx - x * vz), 2.0 * (x * vy - y * vx)
    return (
        vx + w * tx + y * tz - z * ty,
        vy + w * ty + z * tx - x * tz,
        vz + w * tz + x * ty - y * tx,
    )
