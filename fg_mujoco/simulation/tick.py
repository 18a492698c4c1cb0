"""The compiled parts of a tick: what the cars of some worlds sense, how they are driven, and where obstacles move.

Arrays have one row a car: the cars of world 0, then those of world 1, and so on. A state has one row a world.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..course.moving_obstacles import obstacle_position
from ..kernels import kernel
from ..lidar.body_poses import mounted_pose
from ..lidar.links import place_links
from ..lidar.scanline import scan
from ..lidar.visible_surfaces import SceneArrays, Scratch
from ..messages import FloatArray
from ..vehicle.motion import drive, read_odometry
from ..vehicle.tire_forces import USERDATA
from ..vehicle.tire_slip import measure_slip
from .physics import StateLayout
from .telemetry import COMMAND, GREATEST_COMMAND, add_row, begin_row, end_motion, end_row
from .world_step import AXLES, CHASSIS_CONTACT, FIRST_TIRE, MOUNT, TIRES, TREE, Floor

Mask = NDArray[np.bool_]
Rows = NDArray[np.void]
Places = NDArray[np.int64]


_APART = 0.5  # [s] without touching each other after which two cars touch anew


class Mounts(NamedTuple):
    """Mounts of the LiDARs of a world on their cars, see body_poses.Mount."""

    offset_positions: FloatArray  # (m, 3) [m]
    offset_rotations: FloatArray  # (m, 3, 3)


@kernel
def read_cars(
    which: Mask,
    cars_per_world: int,
    states: FloatArray,
    layout: StateLayout,
    sensors: FloatArray,
    cars: Rows,
    timers: Rows,
    odometry: Rows,
    telemetry: FloatArray,
) -> None:
    """Write the odometry of each car, and the first columns of its row of telemetry.

    Args:
      which: (r,) the cars that sense.
      cars_per_world: r of them make one world.
      states: (n, k) of the worlds.
      layout: of a state.
      sensors: (n, nsensordata) of the last physics step.
      cars: (r,) of CAR.
      timers: (r,) of LAP_TIMER, up to date.
      odometry: (r,) of ODOMETRY, written to.
      telemetry: (r, len(TELEMETRY)), written to.
    """
    for row in range(len(which)):
        if which[row]:
            world = row // cars_per_world
            state = states[world]
            time, car = state[layout.time], cars[row : row + 1]
            qpos, qvel = state[layout.qpos[0] : layout.qpos[1]], state[layout.qvel[0] : layout.qvel[1]]
            read_odometry(time, qpos, qvel, sensors[world], car, odometry[row : row + 1])
            begin_row(time, qpos, qvel, car, timers, row, telemetry[row])


@kernel
def scan_cars(
    which: Mask,
    cars_per_world: int,
    states: FloatArray,
    layout: StateLayout,
    car_places: Places,
    mounts: Mounts,
    motions: FloatArray,
    links: Rows,
    scene: SceneArrays,
    scratch: Scratch,
    ranges: FloatArray,
) -> None:
    """Write what the LiDAR of each car measures.

    Args:
      which: (r,) the cars that sense.
      cars_per_world: r of them make one world.
      states: (n, k) of the worlds.
      layout: of a state.
      car_places: (cars_per_world, 6) see TREE.
      mounts: of the LiDARs.
      motions: (obstacles, 8) of `motion_table`.
      links: (k,) of LINK, of the bodies that follow the obstacles in the scene.
      scene: of the worlds' LiDARs.
      scratch: of this thread.
      ranges: (r, beams) [m], written to.
    """
    position, rotation = np.empty(3), np.empty((3, 3))
    bodies = len(scene.frames) - 1
    moving, turned, poses = np.empty((bodies, 3)), np.empty((bodies, 3, 3)), np.empty((len(links), 7))
    for k in range(len(motions)):
        moving[k, 2] = 0.0
        for i in range(3):
            for j in range(3):
                turned[k, i, j] = 1.0 if i == j else 0.0
    placed = -1
    for row in range(len(which)):
        if which[row]:
            world = row // cars_per_world
            car, state = row - world * cars_per_world, states[world]
            if world != placed:
                for k in range(len(motions)):
                    moving[k, 0], moving[k, 1] = obstacle_position(motions[k], state[layout.time])
                if len(links) > 0:
                    qpos = state[layout.qpos[0] : layout.qpos[1]]
                    place_links(qpos, links, poses, moving[len(motions) :], turned[len(motions) :])
                placed = world
            first = layout.qpos[0] + car_places[car, MOUNT]
            offset_position, offset_rotation = mounts.offset_positions[car], mounts.offset_rotations[car]
            mounted_pose(state[first : first + 7], offset_position, offset_rotation, position, rotation)
            scan(scene, position, rotation, moving, turned, scratch, ranges[row], car_places[car, TREE])


@kernel
def worlds_to_drive(running: Mask, cars_per_world: int, ids: NDArray[np.int32]) -> int:
    """Write the numbers of the worlds in which any car runs into `ids` (n,), and return how many there are."""
    count = 0
    for world in range(len(running) // cars_per_world):
        runs = False
        for row in range(world * cars_per_world, (world + 1) * cars_per_world):
            runs = runs or running[row]
        if runs:
            ids[count] = world
            count += 1
    return count


@kernel
def hold_commands(
    ids: NDArray[np.int32],
    count: int,
    cars_per_world: int,
    states: FloatArray,
    layout: StateLayout,
    commands: FloatArray,
    cars: Rows,
    telemetry: FloatArray,
) -> None:
    """Write the commands of all cars of `count` worlds `ids` to their actuators, and to the telemetry."""
    for place in range(count):
        world = ids[place]
        qvel = states[world, layout.qvel[0] : layout.qvel[1]]
        ctrl = states[world, layout.ctrl[0] : layout.ctrl[1]]
        for row in range(world * cars_per_world, (world + 1) * cars_per_world):
            drive(qvel, commands[row, 0], commands[row, 1], cars[row : row + 1], ctrl)
            for part in range(2):
                telemetry[row, COMMAND + part] = min(max(commands[row, part], -GREATEST_COMMAND), GREATEST_COMMAND)


@kernel
def book_cars(
    ids: NDArray[np.int32],
    count: int,
    cars_per_world: int,
    states: FloatArray,
    layout: StateLayout,
    cars: Rows,
    car_places: Places,
    touch_places: Places,
    tire_rows: Rows,
    tire_states: FloatArray,
    floor: Floor,
    running: Mask,
    records: FloatArray,
    status: NDArray[np.int32],
    failed: Mask,
    mu: FloatArray,
    slip: FloatArray,
    crashed: Mask,
    touched_at: FloatArray,
    telemetry: FloatArray,
    statistics: Rows,
) -> None:
    """Read what the physics steps of a tick recorded in `count` worlds `ids`.

    Args:
      ids: (n,) the worlds.
      count: how many of them.
      cars_per_world: r cars make n worlds.
      states: (n, k) of the worlds.
      layout: of a state.
      cars: (r,) of CAR.
      car_places: (cars_per_world, 6) see TREE.
      touch_places: (cars_per_world, cars_per_world) where in the sensors two cars' touching is.
      tire_rows: (k,) of TIRE, of the cars whose tires have a law of ours.
      tire_states: (n, steps, k) the tires' user data after each step.
      floor: of the worlds.
      running: (r,) which cars run.
      records: (n, steps, nsensordata) `Batch.records`.
      status: (n,) `Batch.status`.
      failed: (r,) written to: whether the engine failed.
      mu: (r, 4) of the tires.
      slip: (QUANTITIES, steps, 4) room; left with the slip of the last car.
      crashed: (r,) written to: whether the chassis touched something else than a car.
      touched_at: (r, cars_per_world) when a car last touched each other of its world [s], written to.
      telemetry: (r, len(TELEMETRY)), its last columns written to.
      statistics: (r,) of STATISTICS, written to.
    """
    for place in range(count):
        world = ids[place]
        state = states[world]
        time = state[layout.time]
        qpos, qvel = state[layout.qpos[0] : layout.qpos[1]], state[layout.qvel[0] : layout.qvel[1]]
        for row in range(world * cars_per_world, (world + 1) * cars_per_world):
            end_motion(time, qpos, qvel, cars[row : row + 1], telemetry[row])
            failed[row] = failed[row] or status[world] != 0
            car = row - world * cars_per_world
            own, first = car_places[car], car_places[car, FIRST_TIRE]
            races = running[row] or cars_per_world == 1
            if cars_per_world == 1:
                crashed[row] = crashed[row] or any_touch(records[world], own[CHASSIS_CONTACT])
            else:
                touched_wall = book_touches(
                    records[world], car, own[CHASSIS_CONTACT], touch_places[car], time, touched_at[row], statistics, row
                )
                crashed[row] = crashed[row] or (touched_wall and races)
            rows = tire_rows[max(first, 0) : first + 4] if first >= 0 else tire_rows[:0]
            mus = np.ascontiguousarray(floor.mu[:, row]) if len(floor.patches) > 0 else mu[row : row + 1]
            measure_slip(
                records[world], own[TIRES], own[AXLES], mus, rows, tire_states[world], max(USERDATA * first, 0), slip
            )
            end_row(telemetry[row], slip)
            if races:
                add_row(statistics, row, telemetry[row], slip)


@kernel
def book_touches(
    records: FloatArray,
    car: int,
    chassis_contact: int,
    touch_places: Places,
    time: float,
    touched_at: FloatArray,
    statistics: Rows,
    row: int,
) -> bool:
    """Note which other cars a car touched in a tick; return whether its chassis touched anything else.

    Args:
      records: (steps, nsensordata) of the tick.
      car: its number in its world.
      chassis_contact: where its chassis' contacts are counted.
      touch_places: (cars,) where those with each other car are.
      time: at the end of the tick [s].
      touched_at: (cars,) when it last touched each of them [s], -inf: not yet; written to.
      statistics: (r,) of STATISTICS, written to.
      row: of the car among them.
    """
    for other in range(len(touch_places)):
        if other != car and any_touch(records, touch_places[other]):
            if time - touched_at[other] > _APART:
                statistics[row].touches += 1
            touched_at[other] = time
    for step in range(len(records)):
        count = records[step, chassis_contact]
        for other in range(len(touch_places)):
            if other != car:
                count -= records[step, touch_places[other]]
        if count > 0.0:
            return True
    return False


@kernel
def any_touch(records: FloatArray, sensor: int) -> bool:
    """Return whether a contact sensor found anything in any of the rows of `records` (steps, nsensordata)."""
    touched = False
    for step in range(len(records)):
        touched = touched or records[step, sensor] > 0.0
    return touched


@kernel
def not_finite(running: Mask, commands: FloatArray) -> Mask:
    """Return whether each running car got a command that is no number. Shape (r,)."""
    bad = np.zeros(len(running), np.bool_)
    for row in range(len(running)):
        bad[row] = running[row] and not (math.isfinite(commands[row, 0]) and math.isfinite(commands[row, 1]))
    return bad
