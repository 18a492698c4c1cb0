"""Parts of a physics step of one world other than the tires: moving obstacles, and the floor under each tire.

A world whose cars all stand on MuJoCo's contacts is stepped by mj_step. Where any car has tires of ours, MuJoCo's
stages are called one after the other, and the tires' forces are put in between (vehicle/tire_forces.py).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..messages import FloatArray

TIRES, AXLES, CHASSIS_CONTACT, FIRST_TIRE, MOUNT, TREE, LEVEL = range(7)
"""Columns of `car_places`, one row for each car of a world: where in its sensors the tires' readings begin, those of
the axles (-1: none) and the chassis' contact; its first row among the tires with a law of ours (-1: it has none); where
in qpos the pose of the body that its LiDAR is fixed to is; the tree of its bodies, as in SceneArrays (-1: none); and
whether its LiDAR stays level (1)."""


class Floor(NamedTuple):
    """The patches of the worlds, and what the tires have on them; all empty where there are none."""

    patches: FloatArray  # (k, 7) of `patch_table`
    wheels: FloatArray  # (4 cars_per_world, 2) of `wheel_positions`
    mu: FloatArray  # (steps, r, 4) room: what each tire had in each step of a tick
    pairs: NDArray[np.int32]  # (4 cars_per_world,) of the tires


class Sizes(NamedTuple):
    """Sizes of a world's model, and of its steps."""

    positions: int
    dofs: int
    readings: int
    userdata: int
    pairs: int
    own_tires: int  # whether any car has tires with a law of ours
