"""Pieces of walls that a car pushes over the floor: bodies that slide and turn, whose friction is that of the floor.

A piece lies on its whole length. While it slides, the friction is along its motion, f = mu m g (v, c^2 w) / s with
s^2 = |v|^2 + c^2 w^2; w is its yaw rate, and c the mean distance of its mass from its centre. Source: Howe, Cutkosky
(IJRR 15, 1996), an ellipsoid in the place of the limit surface of Goyal, Ruina, Papadopoulos (Wear 143, 1991).
native/simulation/pieces.hpp takes it from the velocities after each step: a piece at rest costs no constraint.
Pieces pass through each other, and through the walls of the hall.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from ..course.built_walls import WallPart
from ..messages import FloatArray

FRICTION = 0.5
"""[-] Of a duct on a floor: cloth and foil on carpet or concrete. An estimate."""

MOST = 400
"""Pieces of a world at most: MuJoCo reads no more than 500 numbers of a kind from a file."""

_NUMBERS = "pieces"
_ALONG = 50  # places of each footprint at which its mass is taken to be


def add_body(spec: Any, index: int, part: WallPart) -> tuple[Any, FloatArray]:
    """Add the body of a piece to the spec of a world, in place, as yet without geoms; return it, and its centre [m]."""
    start, end = (0.5 * (part.feet[:, near] + part.feet[:, far]) for near, far in ((0, 3), (1, 2)))
    lengths = np.hypot(*(end - start).T)
    share = (np.arange(_ALONG) + 0.5) / _ALONG
    places = (start[:, None] + share[:, None] * (end - start)[:, None]).reshape(-1, 2)
    weights = np.repeat(lengths / lengths.sum() / _ALONG, _ALONG)
    centre = weights @ places
    away, mass = np.hypot(*(places - centre).T), part.built.weight * float(lengths.sum())
    inertia = mass * float(weights @ (away**2 + part.built.depth**2 / 12.0))
    body = spec.worldbody.add_body(
        name=f"piece_{index}", pos=(*centre, 0.0), mass=mass, ipos=(0.0, 0.0, 0.0), inertia=(inertia,) * 3,
        explicitinertial=True,
        sleep=mujoco.mjtSleepPolicy.mjSLEEP_NEVER,
    )  # fmt: skip
    for kind, axis in (("SLIDE", (1, 0, 0)), ("SLIDE", (0, 1, 0)), ("HINGE", (0, 0, 1))):
        body.add_joint(type=getattr(mujoco.mjtJoint, f"mjJNT_{kind}"), axis=axis)
    numbers = spec.numeric(_NUMBERS) or spec.add_numeric(name=_NUMBERS)
    numbers.data = [*numbers.data, float(weights @ away)]
    return body, centre


def piece_table(model: mujoco.MjModel) -> FloatArray:
    """Return the rows of the pieces of a compiled model for the native core, none without. Shape (k, 5).

    Where in qpos and in qvel its x, y and yaw are, deceleration while it slides [m/s^2], c [m], and m c^2 / I [-].
    """
    if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, _NUMBERS) < 0:
        return np.zeros((0, 5))
    rows = []
    for index, lever in enumerate(model.numeric(_NUMBERS).data.tolist()):
        body = model.body(f"piece_{index}")
        share = float(body.mass[0]) * lever**2 / float(body.inertia[2])
        slowing = FRICTION * float(np.linalg.norm(model.opt.gravity))
        rows.append((model.jnt_qposadr[body.jntadr[0]], body.dofadr[0], slowing, lever, share))
    return np.array(rows, np.float64)
