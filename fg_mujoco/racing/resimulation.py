"""What the car of a run sensed, tick by tick: a run folder keeps states, and this measures in them once more.

Each tick is simulated again from its recorded state with its recorded controls, and the LiDAR measures with the same
effects, drawn from the same seed: the scans, late, noisy and distorted as they were, are those that the planner got,
bit for bit where `fg-mujoco replay` is bit-identical. Elsewhere, as under another version of MuJoCo, they are measured
in the recorded states all the same, and each tick's accelerometer is at most one tick's rounding off.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np

from ..course.moving_obstacles import make_mover
from ..errors import RunFolderError
from ..lidar.effects import LidarEffects, ScanPipeline
from ..lidar.lidar import Lidar, make_lidar
from ..messages import DriveCommand, FloatArray, LaserScan, Odometry
from ..simulation.simulation import STATE, complete_state, hold_controls, whole_steps
from ..simulation.world import CAR_PREFIX, LIDAR_PREFIX
from ..vehicle.car import Car
from .run_folder import Run


@dataclass(frozen=True, kw_only=True, eq=False)
class Sensed:
    """One tick: what the planner was told, where the car was, and what the planner answered."""

    time: float  # [s]
    scan: LaserScan  # as delivered; measured earlier where the LiDAR is late
    odometry: Odometry
    position: FloatArray  # (3,) [m] of base_link, world frame
    quaternion: FloatArray  # (4,) wxyz of base_link
    lateral_speed: float  # [m/s] of base_link over the ground, left positive
    command: DriveCommand


def load_scene(run: Run) -> mujoco.MjModel:
    """Return the model that a run was raced in, compiled from its scene.xml.

    Raises:
      RunFolderError: it does not compile, or is not that of the states.
    """
    try:
        model = mujoco.MjModel.from_xml_path(str(run.scene))
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise RunFolderError(f"{run.scene}: cannot be read: {reason}; accepted: as `race --out` wrote it") from error
    if mujoco.mj_stateSize(model, STATE) != run.states.shape[1]:
        raise RunFolderError(f"{run.scene}: its states are not those of states.npz; accepted: as `race --out` wrote it")
    return model


def sensed(run: Run, model: mujoco.MjModel) -> Iterator[Sensed]:
    """Yield each tick of a run.

    Args:
      run: as read from its folder.
      model: of `load_scene(run)`.

    Raises:
      RunFolderError: a summary without what the LiDAR was set to.
    """
    lidar, pipeline = _lidar(run, model)
    car, mover, data = Car(model, CAR_PREFIX), make_mover(model), mujoco.MjData(model)
    steps = whole_steps(lidar.beams.period, model.opt.timestep)
    records = np.empty((steps, model.nsensordata))
    after_step = pipeline.record if pipeline.needs_every_step else None
    commands = np.column_stack((run.column("command_steering_rad"), run.column("command_speed_m_s")))

    here = mujoco.MjData(model)  # sensors need a forward pass at the start, which would change what is simulated
    mujoco.mj_setState(model, here, run.states[0], STATE)
    mujoco.mj_forward(model, here)
    mujoco.mj_setState(model, data, run.states[0], STATE)
    for (steering_angle, speed), controls, after in zip(commands.tolist(), run.ctrl, run.states[1:], strict=True):
        constants = car.constants[0]
        pose = here.qpos[constants["free_qpos"] :][:7].copy()
        heading = car.pose(here)[2]
        velocity = here.qvel[constants["free_dof"] :][:2]
        yield Sensed(
            time=float(here.time),
            scan=pipeline.scan(here),
            odometry=car.odometry(here),
            position=pose[:3],
            quaternion=pose[3:],
            lateral_speed=float(velocity @ (-np.sin(heading), np.cos(heading))),
            command=DriveCommand(steering_angle=steering_angle, speed=speed),
        )
        data.ctrl[:] = controls
        hold_controls(model, data, records, mover, after_step)
        if not np.array_equal(complete_state(model, data), after, equal_nan=True):
            mujoco.mj_setState(model, data, after, STATE)
            mujoco.mj_kinematics(model, data)
        here = data


def _lidar(run: Run, model: mujoco.MjModel) -> tuple[Lidar, ScanPipeline]:
    """Return the LiDAR that a run was raced with, and what it did to a scan, from its seed."""
    try:
        backend, seed = str(run.summary["lidar"]), int(run.summary["seed"])
        effects = LidarEffects(**run.summary["lidar_effects"])
    except (KeyError, TypeError, ValueError) as error:
        raise RunFolderError(
            f"{run.folder / 'summary.json'}: {type(error).__name__}: {error}; accepted: with lidar, lidar_effects and "
            "seed, as `race --out` wrote it"
        ) from error
    lidar = make_lidar(backend, model, LIDAR_PREFIX)
    return lidar, ScanPipeline(lidar, effects, np.random.default_rng(seed))
