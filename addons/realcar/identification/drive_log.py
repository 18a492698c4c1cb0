"""What a car records of a drive, as identification reads it: steering, speed, yaw rate, acceleration and pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fg_mujoco.display import brief
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import CarParameters
from fg_mujoco.racing.resimulation import load_world
from fg_mujoco.racing.run_folder import Run

from ..drives.channels import LONGEST, SHORTEST, Channel, Measured
from ..drives.drive_recording import RecordedDrive
from ..drives.driven_runs import drive_of_run

SLOWEST = 1.0
"""[m/s] Below it nothing is identified: a slip angle is a ratio of two speeds."""

_MOST = 12.0  # times LONGEST, of a drive in one piece: the memory of the smoother grows with it


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Drive(Measured):
    """A drive as the car's sensors recorded it, in base_link's frame; SettingsError: too short, or the car stands."""

    name: str  # of the run folder or bag
    sha256: str  # of what it was read from
    vehicle: str  # its name
    car: CarParameters
    steering: Channel  # [rad] commanded, or measured
    commanded: bool  # whether the steering is commands
    speed: Channel  # [m/s] surface speed of the rear wheels
    yaw_rate: Channel  # [rad/s] gyro
    acceleration: Channel | None  # [m/s^2] ahead and to the left, in the centre of gravity; None: no accelerometer
    pose: Channel | None  # x [m], y [m], heading [rad] of base_link; None: no odometry of a LiDAR
    speed_command: Channel | None = None  # [m/s], or [m/s^2] of a car that is sent accelerations
    sent_accelerations: bool = False  # whether they are known to be accelerations

    def __post_init__(self) -> None:
        lasts = self.end - self.start
        if not lasts >= SHORTEST:
            raise SettingsError(f"{self.name}: lasts {max(lasts, 0.0):.3g} s; accepted: {SHORTEST:g} s or more")
        if self.pauses or lasts > _MOST * LONGEST:
            what = "pauses" if self.pauses else f"lasts {lasts:.6g} s"
            accepted = f"one of RecordedDrive.parts(), or {_MOST * LONGEST:g} s without a pause"
            raise SettingsError(f"{self.name}: {what}; accepted: {accepted}")
        speeds = self.speed.values[:, 0]
        moving = float(np.mean(speeds > SLOWEST)) * lasts
        if not moving >= SHORTEST:
            what = "the car stands" if not np.abs(speeds).max() > 0.05 else f"it is faster for {moving:.3g} s"
            raise SettingsError(f"{self.name}: {what}; accepted: {SHORTEST:g} s or more above {SLOWEST:g} m/s")
        if self.acceleration is None and self.pose is None:
            raise SettingsError(f"{self.name}: neither accelerations nor poses; accepted: an IMU, odometry, or both")

    def __repr__(self) -> str:
        return brief(self, self.name, self.vehicle, f"{self.end - self.start:.3g} s")

    @classmethod
    def of_recorded(cls, recorded: RecordedDrive, car: CarParameters, vehicle: str) -> Drive:
        """Return a recorded drive for identification.

        Its poses head where the car goes that goes straight: else its tires would slip where they do not. Raises
        SettingsError: a drive that is too short, or stands, or has neither accelerations nor poses.
        """
        pose, offset = recorded.pose, recorded.checks.turned_poses
        if pose is not None and offset != 0.0:
            values = pose.values + np.array((0.0, 0.0, offset))
            pose = Channel(name=pose.name, time=pose.time, values=values)
        return cls(
            name=recorded.name, sha256=recorded.sha256, vehicle=vehicle, car=car, steering=recorded.steering,
            commanded=recorded.commanded, speed=recorded.speed, yaw_rate=recorded.yaw_rate,
            acceleration=recorded.acceleration, pose=pose,
            speed_command=recorded.acceleration_command or recorded.speed_command,
            sent_accelerations=recorded.acceleration_command is not None,
        )  # fmt: skip

    @classmethod
    def of_run(cls, run: Run, car: CarParameters | None = None) -> Drive:
        """Return what a run's car measured, by simulating it again; RunFolderError: damaged.

        Raises SettingsError: too short.
        """
        world = load_world(run)
        recorded = drive_of_run(run, world, beams=False)
        return cls.of_recorded(recorded, car or world.parameters, str(run.summary.get("vehicle", "unknown")))
