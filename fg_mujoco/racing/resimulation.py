"""Simulates a run again, tick by tick: from its first state, with its recorded controls and the LiDAR's own seed.

    run = read_run("runs/oval")
    for tick in resimulate(run, load_world(run)):
        tick.sensed.scan, tick.command, tick.state
    scan, odometry = scan_at(run)  # the last that the planner got

A run folder keeps states and controls. The scans, late, noisy and distorted as they were, follow from them: they are
those that the planner got, bit for bit where `fg-mujoco replay` is bit-identical. Elsewhere, as under another version
of MuJoCo, each tick starts again from its recorded state.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import islice
from types import SimpleNamespace
from typing import Any, Protocol, cast

import mujoco
import numpy as np

from .. import portable
from ..errors import ControllerError, FgMujocoError, RunFolderError, SettingsError, TrackError
from ..lidar.effects import LidarEffects
from ..messages import Controller, DriveCommand, FloatArray, LaserScan, Odometry
from ..simulation.cars import car_prefix
from ..simulation.course_loading import load_track
from ..simulation.engine import Engine
from ..simulation.physics import STATE, whole_steps
from ..simulation.planner_adapter import OtherCar, Surroundings, odometry_message, start, up_of
from ..simulation.settings import DriveSettings
from ..simulation.world import World
from ..vehicle.car import car_parameters
from ..vehicle.sensors import Sensor, as_sensors
from .planner_origin import require_no_file
from .planners import ControllerChoice, make_controller
from .result import RaceResult
from .run_folder import Run


class Recording(Protocol):
    """The parts of a run that are needed: of a run folder that was read, or of a drive in memory."""

    @property
    def summary(self) -> dict[str, Any]:
        """As in its summary.json."""

    @property
    def states(self) -> FloatArray:
        """At the start of each tick, and the last. Shape (ticks + 1, k)."""

    @property
    def ctrl(self) -> FloatArray:
        """The controls of the actuators. Shape (ticks, controls)."""

    def column(self, name: str) -> FloatArray:
        """Return one column of the telemetry, shape (ticks,)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Sensed:
    """The readings of the car's sensors at the start of a tick, and its pose."""

    scan: LaserScan  # as delivered; measured earlier where the LiDAR is late
    odometry: Odometry
    position: FloatArray  # (3,) [m] of base_link, world frame
    quaternion: FloatArray  # (4,) wxyz of base_link
    lateral_speed: float  # [m/s] of base_link over the ground, left positive

    @property
    def pose(self) -> tuple[float, float, float]:
        """The true x [m], y [m] and heading [rad] of base_link, which its odometry tells as `pose` says."""
        x, y, _ = self.position.tolist()
        return x, y, _heading(self.quaternion)


@dataclass(frozen=True, kw_only=True, eq=False)
class Tick:
    """One tick of a run, simulated again."""

    time: float  # [s] at its start
    sensed_by_each: tuple[Sensed, ...]  # what every car sensed, car 0 the first
    command: DriveCommand  # that the planner answered
    state: FloatArray  # (k,) at its end

    @property
    def sensed(self) -> Sensed:
        """What car 0 sensed."""
        return self.sensed_by_each[0]

    def surroundings(self, world: World) -> Surroundings:
        """Return the surroundings of car 0 of a world at the start of the tick, for planners with `look_round`."""
        others = tuple(_other_car(sensed) for sensed in self.sensed_by_each[1:])
        return Surroundings(world=world, pose=self.sensed.pose, others=others, up=up_of(self.sensed.quaternion))


@contextmanager
def _quiet_libraries() -> Iterator[None]:
    """Leave out what C libraries print on stderr: of a mesh that is flat, MuJoCo's Qhull prints a page."""
    try:
        kept = os.dup(2)
    except OSError:  # it is closed
        yield
        return
    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


def load_world(run: Run) -> World:
    """Return the world that a run was raced in, compiled from its scene.xml.

    Raises:
      RunFolderError: it does not compile, or is not that of the states.
    """
    try:
        with _quiet_libraries():
            world = World.from_xml(run.xml, lidar=str(run.summary.get("lidar", "raycast")))
        period = world.make_lidar().beams.period
        whole_steps(period, world.model.opt.timestep)
    except Exception as error:  # whatever MuJoCo, or reading its model, says of a scene that is none of ours
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise RunFolderError(f"{run.scene}: cannot be read: {reason}; accepted: as `race --out` wrote it") from error
    sizes = mujoco.mj_stateSize(world.model, int(STATE)), world.model.nu
    if sizes != (run.states.shape[1], run.ctrl.shape[1]):
        raise RunFolderError(f"{run.scene}: its states are not those of states.npz; accepted: as `race --out` wrote it")
    if len(run.ctrl) and abs(float(run.time[1] - run.time[0]) - period) > 1e-9:
        raise RunFolderError(f"{run.scene}: its ticks of {period} s are not those of states.npz; accepted: the same")
    return world


def resimulate(run: Recording, world: World) -> Iterator[Tick]:
    """Yield each tick of a run, which starts from its recorded state, also where the one that was simulated differs.

    Args:
      run: what was recorded.
      world: of `load_world(run)`.

    Raises:
      RunFolderError: a summary without what the LiDAR was set to.
    """
    commands = np.column_stack((run.column("command_steering_rad"), run.column("command_speed_m_s"))).tolist()
    engine = Engine(world)
    rows = run.summary.get("cars") or ()
    settings = [_sensor_settings(row) for row in (rows if len(world.cars) > 1 else (run.summary,))]
    if len(settings) != len(world.cars):
        said = f"summary.json: cars has {len(settings)} rows of {len(world.cars)} cars"
        raise RunFolderError(f"{said}; accepted: one a car, as `race --out` wrote it")
    effects, seeds, drifts, sensors = (list(each) for each in zip(*settings, strict=True))
    engine.load(run.states[0], effects=effects, seed=seeds, odometry_drift=drifts, sensors=sensors)
    for controls, (steering_angle, speed), after in zip(run.ctrl, commands, run.states[1:], strict=True):
        time = float(engine.times[0])
        sensed = _sense(engine)
        engine.drive(controls=controls[np.newaxis])
        state = engine.state(0).copy()
        command = DriveCommand(steering_angle=steering_angle, speed=speed)
        yield Tick(time=time, sensed_by_each=sensed, command=command, state=state)
        if not np.array_equal(state, after, equal_nan=True):
            engine.state(0)[:] = after


def scan_at(run: RaceResult | Run, time: float | None = None) -> tuple[LaserScan, Odometry]:
    """Return the scan and the odometry that the planner of a run decided on: to look at, or to call the planner with.

    Args:
      run: the result of a race, or a run folder that was read.
      time: of the decision [s]; between two, that of the one before; None: the last.

    Raises:
      SettingsError: a time outside of the run, or a run without a tick.
      RunFolderError: a damaged run folder.
    """
    count = len(run.ctrl)
    starts = run.states[:count, 0]  # mjSTATE_TIME comes first in a state
    if count == 0 or (time is not None and not starts[0] <= time <= run.states[-1, 0]):
        accepted = f"{starts[0]:g} to {run.states[-1, 0]:g} s" if count else "a run that has a tick"
        raise SettingsError(f"time is {time!r} s; accepted: {accepted}")
    place = count - 1 if time is None else int(np.searchsorted(starts, time + 1e-9, side="right")) - 1
    if isinstance(run, Run):
        recording, world = cast(Recording, run), load_world(run)
    else:
        kept = SimpleNamespace(summary=run.summary(), states=run.states, ctrl=run.ctrl, column=run.car.column)
        recording, world = cast(Recording, kept), run.world
    sensed = next(islice(resimulate(recording, world), place, None)).sensed
    return sensed.scan, sensed.odometry


def recorded_planner(
    summary: Mapping[str, Any],
    model: mujoco.MjModel,
    index: int = 0,
    *,
    controller: str | None,
    where: str,
    raced_here: bool = False,
) -> Controller:
    """Return a planner that is asked again for a recorded run, built as its own was for the race, and reset.

    Args:
      summary: of the run.
      model: of its world.
      index: of its car.
      controller: the planner's text; without settings in brackets it has those that the run recorded. None: the run's
        own, which a folder never loads by itself.
      where: the run was recorded, for the message.
      raced_here: by this process, whose planner's code and files are the user's.

    Raises:
      FgMujocoError: there is none, or it cannot be built.
      KeyError, TypeError, ValueError, OSError: the summary does not say how.
    """
    own, origin = str(summary["controller"]), summary.get("controller_origin") or {}
    if controller is None and origin.get("commands"):
        raise ControllerError(f"{where}: {own!r} has no planner; its commands were made beforehand")
    if controller is None and not raced_here:
        said = f"{where}: a run folder loads no planner by itself"
        raise ControllerError(f"{said}; accepted: --controller {own} (in Python controller=), or another one")
    choice = ControllerChoice.of(controller or own)
    settings = dict(choice.settings) or summary.get("planner_settings") or {}
    if not choice.settings and not raced_here:
        require_no_file(choice.source, settings, where=where)
    mu = summary.get("planner_mu")
    course = None  # a user's own track or map is not found by its name, and few planners drive by a map
    with suppress(TrackError):
        course = load_track(str(summary["track"]))
    drive = DriveSettings(
        planner_mu=math.inf if mu is None else mu,
        max_speed=summary["speed_limit_m_s"],
        planner_settings=settings,
        effects=LidarEffects(**summary.get("lidar_effects", {})),
        sensors=summary.get("sensors") or (),
        seed=summary.get("seed", 0),
    )
    map_line = None if course is None else course.map_line
    context = drive.context(car_parameters(model, car_prefix(index)), map_line, model=model, index=index)
    planner = make_controller(choice.source, context, settings=drive.planner_settings)
    start(planner)
    return planner


def _other_car(sensed: Sensed) -> OtherCar:
    return OtherCar(pose=sensed.pose, speed=sensed.odometry.speed, yaw_rate=sensed.odometry.yaw_rate)


def _heading(quaternion: FloatArray) -> float:
    w, x, y, z = quaternion.tolist()
    return float(portable.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))


def _sense(engine: Engine) -> tuple[Sensed, ...]:
    """Return the present scan and odometry of each car of world 0."""
    engine.sense()
    return tuple(_sensed(engine, row) for row in range(engine.cars_per_world))


def _sensed(engine: Engine, row: int) -> Sensed:
    """Return the scan and the odometry of a car."""
    odometry = odometry_message(engine.odometry[row], engine.readings(row))
    pose, (x, y) = engine.free_joint(row)
    heading = _heading(pose[3:])
    return Sensed(
        scan=engine.scans.get(row) or engine.beams.to_scan(engine.ranges[row], odometry.stamp),
        odometry=odometry,
        position=pose[:3],
        quaternion=pose[3:],
        lateral_speed=float(-x * np.sin(heading) + y * np.cos(heading)),
    )


def recorded_sensors(summary: dict[str, Any]) -> tuple[Sensor, ...]:
    """Return the sensors of a car of a run, besides LiDAR and odometry.

    Raises:
      RunFolderError: one is not in SENSORS here.
    """
    try:
        return as_sensors(summary.get("sensors") or ())
    except (FgMujocoError, TypeError) as error:
        said = f"summary.json: {error}"
        raise RunFolderError(f"{said}; a sensor of your own is there once its module is imported") from error


def _sensor_settings(summary: dict[str, Any]) -> tuple[LidarEffects, int, float, tuple[Sensor, ...]]:
    """Return the LiDAR effects of a run, the seed of its noise, the drift of the odometry, and the sensors."""
    sensors = recorded_sensors(summary)
    try:
        drift = float(summary.get("odometry_drift", 0.0))  # older runs lack it
        return LidarEffects(**summary["lidar_effects"]), int(summary["seed"]), drift, sensors
    except (KeyError, TypeError, ValueError) as error:
        raise RunFolderError(
            f"summary.json: {type(error).__name__}: {error}; accepted: with lidar_effects and seed, as `race --out` "
            "wrote it"
        ) from error
