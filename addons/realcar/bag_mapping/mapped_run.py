"""A run folder from a bag: the drive that a car recorded, on the course that was mapped from its scans.

    write_recorded_run(sweeps, made, course, vehicle, "runs/mine", name="drive.mcap")

Known are the poses, and from them the speed and the yaw rate; the commands and the steering angle where the bag has
them, else both are those that fit the path. Nothing is known of the tires: slip, sliding and forces are NaN in the
telemetry and null in the summary, whose `end_reason` is "recorded". The mass, the friction and the look are the
vehicle's. The scans of the bag, with the poses, are in recording.mcap, so that `replay-scans` runs on the folder.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from fg_mujoco.addons.ros.bag_messages import (
    DRIVE,
    drive_message,
    nanoseconds,
    odometry_message,
    scan_message,
    transform_message,
)
from fg_mujoco.addons.ros.bag_recording import Recording
from fg_mujoco.addons.ros.bag_writer import BagWriter
from fg_mujoco.course.course import Course
from fg_mujoco.errors import BagError
from fg_mujoco.messages import STOP, DriveCommand, FloatArray, LaserScan, Odometry
from fg_mujoco.racing.decision_times import DecisionTimes
from fg_mujoco.racing.race import race
from fg_mujoco.racing.result import trajectory_sha256
from fg_mujoco.racing.run_folder import RECORDED, write_run
from fg_mujoco.simulation.cars import CAR_PREFIX
from fg_mujoco.simulation.simulation import complete_state
from fg_mujoco.simulation.telemetry import TELEMETRY
from fg_mujoco.vehicle.car import Car, element_id
from fg_mujoco.vehicle.vehicle import Vehicle

from ..mapping.recorded_map import RecordedMap
from ..mapping.sweeps import Sweeps, interpolated

RECORDING = "recording.mcap"
"""The bag in the folder: the scans, the poses and the commands, from the first scan on."""

_OVER = 0.05  # [s] before and after, between whose poses a speed is taken
_KNOWN = (
    "time_s", "lap", "progress_m", "offset_m", "x_m", "y_m", "heading_rad", "speed_m_s", "yaw_rate_rad_s",
    "steering_angle_rad", "command_steering_rad", "command_speed_m_s",
)  # fmt: skip


class _Nobody:
    """Drives the tick that a result of a race is made of."""

    def reset(self) -> None:
        """Do nothing."""

    def __call__(self, scan: LaserScan, odometry: Odometry) -> DriveCommand:
        """Stand."""
        return STOP


def write_recorded_run(
    bag: Recording,
    sweeps: Sweeps,
    made: RecordedMap,
    course: Course,
    vehicle: Vehicle | str | Path,
    folder: str | Path,
    *,
    drive_topic: str | None = None,
) -> Path:
    """Write a run folder of a bag, and return its path. A failure leaves nothing behind.

    Args:
      bag: open; its commands are read.
      sweeps: of it.
      made: the map of them, with the corrected path.
      course: of that map.
      vehicle: that is shown, and whose constants a report has.
      folder: new or empty.
      drive_topic: of the commands; None: /drive, or the only one there is.

    Raises:
      BagError: a recording of less than a tick.
      RunFolderError: the folder cannot be written.
    """
    begun = race(course, _Nobody(), vehicle=vehicle, laps=1, time_limit=0.03, planner_mu=math.inf)
    world, period = begun.world, begun.world.make_lidar().beams.period
    track = _base_track(sweeps, made)
    ticks = int((track[-1, 0] - track[0, 0]) / period)
    if ticks < 1:
        raise BagError(f"{bag.path}: lasts {track[-1, 0] - track[0, 0]:.3f} s; accepted: {period} s at least")
    time = np.asarray(period * np.arange(ticks + 1), np.float64)
    poses = interpolated(track, track[0, 0] + time)
    speed, yaw_rate = _rates(track, track[0, 0] + time)
    car = world.parameters
    fitting = np.arctan2(car.wheelbase * yaw_rate, np.maximum(np.abs(speed), 0.2)) * np.where(speed < 0.0, -1.0, 1.0)
    steering = np.clip(fitting, -car.max_steering_angle, car.max_steering_angle)
    commands = _commands(bag, sweeps, drive_topic, track[0, 0] + time, np.column_stack((steering, speed)))
    states = _states(world.model, time, poses, speed, yaw_rate, steering)
    telemetry = np.full((ticks, len(TELEMETRY)), math.nan)
    progress, offset, laps = _along(course, poses, time)
    values = (
        time, np.searchsorted(laps, time, side="right") + 1.0 if course.closed else np.ones(ticks + 1), progress,
        offset, poses[:, 0], poses[:, 1], np.remainder(poses[:, 2] + np.pi, math.tau) - np.pi, speed, yaw_rate,
        steering, commands[:, 0], commands[:, 1],
    )  # fmt: skip
    for name, value in zip(_KNOWN, values, strict=True):
        telemetry[:, TELEMETRY.index(name)] = value[:ticks]
    telemetry[:, [TELEMETRY.index("sliding_steps"), TELEMETRY.index("steps")]] = 0.0
    ctrl = np.array(commands[:ticks])
    moving = np.abs(speed[:ticks])
    asked = max(math.ceil(float(progress.max()) / course.length), 1) if course.closed else 1
    greatest, raced = float(moving.max()), begun.car
    driven = replace(
        raced, entry=replace(raced.entry, max_speed=max(greatest, 0.1)), controller=f"bag:{bag.path.name}",
        controller_origin=dict.fromkeys(raced.controller_origin), controller_source=None, laps_completed=len(laps),
        finished=True, end_reason=RECORDED, end_time_s=float(time[-1]), crash=None, wrong_way=None,
        lap_times_s=tuple(np.diff([0.0, *laps]).tolist()), collisions_wall=0, clamped_commands=0,
        mean_speed_m_s=float(moving.mean()), max_speed_m_s=greatest, max_slide_m_s=math.nan,
        max_lateral_slide_m_s=math.nan, slide_time_fraction=math.nan, decision_times=DecisionTimes.of((), period),
        telemetry=telemetry,
    )  # fmt: skip
    result = replace(
        begun, cars=(driven,), laps_requested=asked, winner=None, sim_time_s=float(time[-1]), states=states, ctrl=ctrl,
        trajectory_sha256=trajectory_sha256(states, ctrl), wall_time_s=math.nan, realtime_factor=math.nan,
    )  # fmt: skip

    def add(staging: Path) -> None:
        _write_recording(staging / RECORDING, sweeps, made, track, time, commands)

    return write_run(result, folder, add=add)


def _base_track(sweeps: Sweeps, made: RecordedMap) -> FloatArray:
    """Return the times [s] and the poses of base_link, shape (m, 4), over the scans that have poses."""
    if made.matched:
        track = np.column_stack((sweeps.times[list(made.numbers)], made.path))
    else:
        inside = (sweeps.track[:, 0] >= sweeps.times[0]) & (sweeps.track[:, 0] <= sweeps.times[-1])
        track = sweeps.track[inside]
    track = track.copy()
    track[:, 3] = np.unwrap(track[:, 3])
    c, s = np.cos(track[:, 3]), np.sin(track[:, 3])
    ahead, left = sweeps.offset
    track[:, 1] -= c * ahead - s * left
    track[:, 2] -= s * ahead + c * left
    return np.asarray(track)


def _rates(track: FloatArray, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the speed along the car [m/s] and the yaw rate [rad/s] at times."""
    before = np.maximum(times - _OVER, track[0, 0])
    after = np.minimum(times + _OVER, track[-1, 0])
    moved = interpolated(track, after) - interpolated(track, before)
    seconds = np.maximum(after - before, 1e-9)
    heading = interpolated(track, times)[:, 2]
    ahead = moved[:, 0] * np.cos(heading) + moved[:, 1] * np.sin(heading)
    return ahead / seconds, moved[:, 2] / seconds


def _commands(bag: Recording, sweeps: Sweeps, topic: str | None, times: FloatArray, fitting: FloatArray) -> FloatArray:
    """Return steering angle [rad] and speed [m/s] that were commanded at times, those of the path without commands."""
    drive = bag.choose((DRIVE,), wanted=topic, option="--drive-topic")
    if drive is None:
        bag.warn("has no commands; the run has those that fit its path")
        return fitting
    begin = sweeps.received[0] / 1e9 - sweeps.times[0]
    rows = []
    for heard in bag.messages({drive}):
        row = (heard.received / 1e9 - begin, heard.message.drive.steering_angle, heard.message.drive.speed)
        rows += [row] if np.isfinite(row).all() else []
    if not rows:
        return fitting
    table = np.array(sorted(rows))
    at = np.clip(np.searchsorted(table[:, 0], times + 1e-6, side="right") - 1, 0, len(table) - 1)
    return np.asarray(table[at, 1:])


def _states(
    model: mujoco.MjModel,
    time: FloatArray,
    poses: FloatArray,
    speed: FloatArray,
    yaw_rate: FloatArray,
    steering: FloatArray,
) -> FloatArray:
    """Return the state of the model with the car at each pose, wheels rolling and steered."""
    car, data = Car(model, CAR_PREFIX), mujoco.MjData(model)
    joints = mujoco.mjtObj.mjOBJ_JOINT
    steered = [
        model.jnt_qposadr[element_id(model, joints, CAR_PREFIX + name)]
        for name in ("steering", "front_left_kingpin", "front_right_kingpin")
    ]
    turning = int(car.constants[0]["free_dof"]) + 5
    states = []
    for row in range(len(time)):
        x, y, heading = poses[row].tolist()
        car.write_pose(data, x, y, heading, float(speed[row]))
        data.qvel[turning] = yaw_rate[row]
        data.qpos[steered] = steering[row]
        data.time = time[row]
        states.append(complete_state(model, data))
    return np.array(states)


def _along(course: Course, poses: FloatArray, time: FloatArray) -> tuple[FloatArray, FloatArray, list[float]]:
    """Return the progress from the start on and the offset [m], and when laps were completed [s]."""
    place, offset = course.project(poses[:, :2])
    if not course.closed:
        return place - place[0], offset, []
    around = np.unwrap(place, period=course.length)
    progress = around - around[0]
    laps = []
    for lap in range(1, int(progress.max() / course.length) + 1):
        over = int(np.argmax(progress >= lap * course.length))
        share = (lap * course.length - progress[over - 1]) / (progress[over] - progress[over - 1])
        laps.append(float(time[over - 1] + share * (time[over] - time[over - 1])))
    return progress, offset, laps


def _write_recording(
    path: Path, sweeps: Sweeps, made: RecordedMap, track: FloatArray, time: FloatArray, commands: FloatArray
) -> None:
    """Write the scans with the poses on the map, and the commands, from time 0 on."""
    ahead, left = sweeps.offset
    upright = np.array((1.0, 0.0, 0.0, 0.0))
    entries: list[tuple[int, int, str, Any]] = []
    for scan, at in zip(sweeps.scans, sweeps.times, strict=True):
        now = nanoseconds(at - track[0, 0])
        if 0 <= now <= nanoseconds(time[-1]):
            entries.append((now, 1, "/scan", scan_message(replace(scan, stamp=at - track[0, 0]))))
    poses, (speed, yaw_rate) = interpolated(track, track[0, 0] + time), _rates(track, track[0, 0] + time)
    for row, at in enumerate(time.tolist()):
        half = 0.5 * poses[row, 2]
        odometry = Odometry(
            stamp=at, speed=float(speed[row]), steering_angle=float(commands[row, 0]),
            angular_velocity=np.array((0.0, 0.0, yaw_rate[row])), linear_acceleration=np.zeros(3),
            wheel_speeds=np.full(4, speed[row]), pose=poses[row],
        )  # fmt: skip
        turned = np.array((math.cos(half), 0.0, 0.0, math.sin(half)))
        position = np.array((poses[row, 0], poses[row, 1], 0.0))
        entries.append((nanoseconds(at), 0, "/odom", odometry_message(odometry, position, turned, 0.0, frame="map")))
        command = DriveCommand(steering_angle=float(commands[row, 0]), speed=float(commands[row, 1]))
        entries.append((nanoseconds(at), 2, "/drive", drive_message(command, nanoseconds(at))))
    with BagWriter(path) as bag:
        mounted = ("base_link", "laser", np.array((ahead, left, 0.0)), upright)
        bag.write("/tf_static", transform_message(0, [mounted]), 0)
        for at, _, topic, message in sorted(entries, key=lambda entry: entry[:2]):
            bag.write(topic, message, at)
