"""The recorded drive of one of our own runs: what the car's sensors measured, by simulating the run again."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fg_mujoco.messages import LaserScan
from fg_mujoco.racing.resimulation import load_world, resimulate
from fg_mujoco.racing.result import trajectory_sha256
from fg_mujoco.racing.run_folder import Run
from fg_mujoco.simulation.world import World

from .channels import Beams, Channel
from .drive_checks import check_drive
from .drive_recording import RecordedDrive


def drive_of_run(run: Run, world: World | None = None, *, beams: bool = True) -> RecordedDrive:
    """Return what a run's car measured, with scans if `beams`; RunFolderError: a damaged run folder."""
    world = load_world(run) if world is None else world
    time = run.column("time_s")
    sensed = [tick.sensed for tick in resimulate(run, world)]
    scans = [each.scan for each in sensed if beams]
    stamps = np.array([each.odometry.stamp for each in sensed])

    def channel(name: str, values: list[Any]) -> Channel:
        return Channel(name=name, time=stamps, values=np.asarray(values, np.float64).reshape(len(stamps), -1))

    def commands(name: str, column: str) -> Channel:
        return Channel(name=name, time=time, values=run.column(column)[:, np.newaxis])

    speed = channel("wheel speed", [each.odometry.wheel_speeds[2:].mean() for each in sensed])
    yaw_rate = channel("gyro", [each.odometry.yaw_rate for each in sensed])
    pose = channel("pose", [each.pose for each in sensed])
    steering = commands("commands", "command_steering_rad")
    return RecordedDrive(
        name=str(run.folder), sha256=trajectory_sha256(run.states, run.ctrl), layout="run",
        steering=steering, commanded=True, speed_command=commands("speed commands", "command_speed_m_s"),
        speed=speed, yaw_rate=yaw_rate,
        acceleration=channel("accelerometer", [each.odometry.linear_acceleration[:2] for each in sensed]),
        pose=pose, beams=_beams(scans),
        checks=check_drive(speed=speed, yaw_rate=yaw_rate, steering=steering, commanded=True, pose=pose),
    )  # fmt: skip


def _beams(scans: Sequence[LaserScan]) -> Beams | None:
    """Return the scans of a run; those that came late again are left out."""
    times = np.array([scan.stamp for scan in scans])
    fresh = np.concatenate(([True], np.diff(times) > 0.0)) if len(times) else np.zeros(0, np.bool_)
    if not fresh.any():
        return None
    ranges = np.array([scan.ranges for scan, new in zip(scans, fresh, strict=True) if new])
    return Beams(time=times[fresh], ranges=ranges, bearings=scans[0].bearings)
