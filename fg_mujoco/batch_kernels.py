"""The tick of `race` in each world of a batch that runs: before planning, after it, and after stepping."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .body_poses import Mount, mounted_pose
from .car_motion import drive, read_odometry
from .fan_caster import Fan, Scratch, scan
from .kernels import kernel
from .messages import FloatArray
from .race_result import begin_row, tally_tick
from .simulation import any_touch
from .tire_slip import measure_slip

Mask = NDArray[np.bool_]
Rows = NDArray[np.void]


@kernel
def sense_worlds(
    running: Mask,
    times: FloatArray,
    qpos: FloatArray,
    qvel: FloatArray,
    sensors: FloatArray,
    cars: Rows,
    timers: Rows,
    mount: Mount,
    moving: FloatArray,
    turned: FloatArray,
    fan: Fan,
    scratch: Scratch,
    odometry: Rows,
    ranges: FloatArray,
    telemetry: FloatArray,
) -> None:
    """Write what each car senses, and the first columns of its row of telemetry.

    Args:
      running: (n,) the worlds to sense in.
      times: (n,) [s].
      qpos: (n, nq).
      qvel: (n, nv).
      sensors: (n, nsensordata) of the last physics step.
      cars: (n,) of CAR.
      timers: (n,) of LAP_TIMER, up to date.
      mount: of the LiDARs.
      moving: (m, 3) [m] where the obstacles that move are, in all worlds.
      turned: (m, 3, 3) their rotations.
      fan: of the worlds' LiDARs.
      scratch: of this thread.
      odometry: (n,) of ODOMETRY, written to.
      ranges: (n, beams) [m], written to.
      telemetry: (n, len(TELEMETRY)), written to.
    """
    position, rotation = np.empty(3), np.empty((3, 3))
    for i in range(len(running)):
        if not running[i]:
            continue
        car = cars[i : i + 1]
        read_odometry(times[i], qpos[i], qvel[i], sensors[i], car, odometry[i : i + 1])
        p = qpos[i, mount.qpos_address : mount.qpos_address + 7]
        pose = (p[0], p[1], p[2], p[3], p[4], p[5], p[6])
        mounted_pose(pose, mount.offset_position, mount.offset_rotation, position, rotation)
        scan(fan, position, rotation, moving, turned, scratch, ranges[i])
        begin_row(times[i], qpos[i], qvel[i], car, timers, i, telemetry[i])


@kernel
def command_worlds(
    running: Mask, qvel: FloatArray, commands: FloatArray, cars: Rows, ctrl: FloatArray, telemetry: FloatArray
) -> None:
    """Write the commands (n, 2) [rad, m/s] to the actuators `ctrl` (n, nu), and to the telemetry."""
    for i in range(len(running)):
        if running[i]:
            drive(qvel[i], commands[i, 0], commands[i, 1], cars[i : i + 1], ctrl[i])
            telemetry[i, 10], telemetry[i, 11] = commands[i, 0], commands[i, 1]


@kernel
def book_worlds(
    stepped: NDArray[np.int32],
    records: FloatArray,
    tires: int,
    chassis_contact: int,
    mu: FloatArray,
    slip: FloatArray,
    sensors: FloatArray,
    crashed: Mask,
    telemetry: FloatArray,
    tallies: Rows,
) -> None:
    """Read what the physics steps of a tick recorded.

    Args:
      stepped: (m,) which worlds were stepped.
      records: (at least m, steps, nsensordata) their sensors at each step.
      tires: where the tires' readings are in sensordata.
      chassis_contact: and that of the chassis.
      mu: (n, 4) of the tires.
      slip: (4, steps, 4) room.
      sensors: (n, nsensordata) written to: of the last step.
      crashed: (n,) written to.
      telemetry: (n, len(TELEMETRY)), its last columns written to.
      tallies: (n,) of TALLY, written to.
    """
    for place in range(len(stepped)):
        i = stepped[place]
        for reading in range(sensors.shape[1]):  # an assignment of the row takes numba two seconds to compile
            sensors[i, reading] = records[place, -1, reading]
        crashed[i] = crashed[i] or any_touch(records[place], chassis_contact)
        measure_slip(records[place], tires, mu[i], slip)
        tally_tick(tallies, i, telemetry[i], slip)


@kernel
def not_finite(running: Mask, commands: FloatArray) -> Mask:
    """Return which of the running worlds got a command that is no number. Shape (n,)."""
    bad = np.zeros(len(running), np.bool_)
    for i in range(len(running)):
        bad[i] = running[i] and not (math.isfinite(commands[i, 0]) and math.isfinite(commands[i, 1]))
    return bad
