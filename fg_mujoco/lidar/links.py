"""Poses of the bodies of a kinematic tree from the positions of its joints alone: as mj_kinematics, without MuJoCo.

A batch of worlds keeps `qpos` of each and no poses. What a LiDAR sees of another car, wheels too, is placed by this.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..native import check_record, core

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
