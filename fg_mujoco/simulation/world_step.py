"""Parts of a physics step of one world other than the tires: moving obstacles, and the floor under each tire.

A world whose cars all stand on MuJoCo's contacts is stepped by mj_step. Where any car has tires of ours, MuJoCo's
stages are called one after the other, and the tires' forces are put in between (vehicle/tire_forces.py).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled.kernels import kernel
from ..course.moving_obstacles import obstacle_position
from ..messages import FloatArray
from ..vehicle import mujoco_stages as stages
from ..vehicle.friction_patches import look_at_floor
from ..vehicle.motion import planar_pose
from ..vehicle.mujoco_stages import Fields

Rows = NDArray[np.void]
Places = NDArray[np.int64]

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


@kernel
def friction_under(
    model: int, data: int, found: Fields, world: int, step: int, sizes: Sizes, car_places: Places, cars: Rows,
    mu: FloatArray, floor: Floor,
) -> FloatArray:  # fmt: skip
    """Return what each tire of a world has on the floor under it (m, 4) [-], and give it to MuJoCo's contacts, too."""
    first, end = world * len(car_places), (world + 1) * len(car_places)
    if len(floor.patches) == 0:
        return mu[first:end]
    all_under = floor.mu[step, first:end]
    friction = stages.vector(model, found.pair_friction, 5 * sizes.pairs)
    qpos = stages.vector(data, found.qpos, sizes.positions)
    for car in range(len(car_places)):
        row, under = first + car, all_under[car]
        x, y, heading = planar_pose(qpos, cars[row : row + 1])
        look_at_floor(x, y, heading, floor.wheels[4 * car : 4 * (car + 1)], floor.patches, mu[row], under)
        for tire in range(4):
            pair = floor.pairs[4 * car + tire]
            friction[5 * pair] = friction[5 * pair + 1] = under[tire]
    return all_under


@kernel
def place_obstacles(data: int, found: Fields, motions: FloatArray) -> None:
    """Put the moving obstacles where they are at the time of the data."""
    if len(motions) == 0:
        return
    time = stages.number_at(data + found.time)[0]
    positions = stages.vector(data, found.mocap_pos, 3 * len(motions))
    for k in range(len(motions)):
        positions[3 * k], positions[3 * k + 1] = obstacle_position(motions[k], time)
        positions[3 * k + 2] = 0.0
