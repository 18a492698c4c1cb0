"""The input of a report: a run folder, a Run or a RaceResult, read into the same fields, and what is drawn of it."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from fg_mujoco.course.moving_obstacles import moving_obstacles
from fg_mujoco.errors import RunFolderError
from fg_mujoco.messages import CarParameters, FloatArray
from fg_mujoco.native import core
from fg_mujoco.racing.crash import Crash, Rollover
from fg_mujoco.racing.off_the_wheels import Jump, Stuck
from fg_mujoco.racing.planners import with_settings
from fg_mujoco.racing.resimulation import load_world
from fg_mujoco.racing.result import RaceResult
from fg_mujoco.racing.run_folder import SUMMARY, Run, read_run
from fg_mujoco.racing.summary import summary_json
from fg_mujoco.simulation.cars import CAR_PREFIX
from fg_mujoco.simulation.telemetry import TELEMETRY
from fg_mujoco.simulation.termination import WrongWay
from fg_mujoco.simulation.terrain import TERRAIN
from fg_mujoco.vehicle.car import WHEELS, car_parameters
from fg_mujoco.vehicle.tires import CONTACT

SPEED_FAR_ABOVE = 99.0
"""[m/s] Drawn for a limit that is higher, as that of a car that does not steer."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedRun:
    """A race as it was recorded."""

    source: str  # a folder, or what else it was read from
    summary: dict[str, Any] = field(repr=False)  # as in summary.json
    telemetry: FloatArray = field(repr=False)  # (ticks, len(TELEMETRY))
    model: mujoco.MjModel = field(repr=False)  # of its world
    others: tuple[FloatArray, ...] = field(default=(), repr=False)  # telemetry of the other cars; all else is of car 0

    def column(self, name: str) -> FloatArray:
        """Return one column of the telemetry, shape (ticks,)."""
        return self.telemetry[:, TELEMETRY.index(name)]

    @property
    def title(self) -> str:
        """What was raced: the course, and the planner with its settings."""
        planner = with_settings(str(self.summary["controller"]), self.summary.get("planner_settings") or {})
        return f"{self.summary['track']}, {planner}"

    @property
    def mu(self) -> float:
        """Friction coefficient of the tires [-]."""
        return float(self.summary["mu"])

    @property
    def tires_model(self) -> str:
        """Model of the tires."""
        return str(self.summary.get("tires_model", CONTACT))

    @property
    def lap_times(self) -> tuple[float, ...]:
        """Of the laps that were completed [s]."""
        return tuple(float(time) for time in self.summary["lap_times_s"])

    @property
    def end(self) -> float:
        """Simulated time at the end [s]."""
        return float(self.summary["sim_time_s"])

    @property
    def wrong_way(self) -> WrongWay | None:
        """Where the car turned; None: the race did not end by going the wrong way."""
        told = self.summary.get("wrong_way")  # older runs lack it
        return None if told is None else WrongWay(**told)

    @property
    def planner_failure(self) -> dict[str, Any] | None:
        """How the planner failed, as in summary.json; None: it did not."""
        told: dict[str, Any] | None = self.summary.get("planner_failure")  # older runs lack it
        return told

    @property
    def crash(self) -> Crash | None:
        """What the car hit; None: the race did not end in a crash."""
        told = self.summary.get("crash")  # older runs lack it
        return None if told is None else Crash(**told)

    @property
    def rollover(self) -> Rollover | None:
        """Where the car rolled over; None: the race did not end so, or was one of several cars."""
        return None if self.others else Rollover.of(self.summary["end_reason"], self.telemetry)

    @property
    def off_the_wheels(self) -> list[str]:
        """Sentences of where the car jumped, and where its chassis rests on the ground."""
        stuck, jumps = self.summary.get("stuck"), self.summary.get("jumps") or []
        told = [f"Jumped {Jump(**jump)}." for jump in jumps]
        return told if stuck is None else [*told, f"Stuck {Stuck(**stuck)}."]

    @cached_property
    def car(self) -> CarParameters:
        """Of the car that was raced."""
        return car_parameters(self.model, CAR_PREFIX)


_NEEDED = (
    "track", "controller", "laps_requested", "laps_completed", "finished", "end_reason", "lap_times_s", "collisions",
    "max_slide_m_s", "slide_time_fraction", "mean_speed_m_s", "max_speed_m_s", "sim_time_s", "mu", "speed_limit_m_s",
    "trajectory_sha256",
)  # fmt: skip
"""What a report is made of."""


def read_recorded(source: RaceResult | Run | str | Path) -> RecordedRun:
    """Return a race to be reported.

    Raises RunFolderError: no folder of `race --out`, a file is missing, or another version.
    """
    if isinstance(source, RaceResult):
        return RecordedRun(
            source=f"{source.track}, {source.car.controller}", summary=json.loads(summary_json(source)),
            telemetry=source.car.telemetry, model=source.world.model,
            others=tuple(car.telemetry for car in source.cars[1:]),
        )  # fmt: skip
    run = source if isinstance(source, Run) else read_run(source)
    may_be_null = {name for name in _NEEDED if "slide" in name} & run.summary.keys()  # of tires without a peak
    missing = [name for name in _NEEDED if run.summary.get(name) is None and name not in may_be_null]
    if missing:
        raise RunFolderError(
            f"{run.folder / SUMMARY}: has no {', '.join(missing)}; accepted: as this version's `race --out` wrote it"
        )
    model = load_world(run).model
    return RecordedRun(
        source=str(run.folder), summary=run.summary, telemetry=run.telemetry, model=model, others=run.others
    )  # fmt: skip


def tick_columns(run: RecordedRun) -> dict[str, FloatArray]:
    """Return the columns of a report's plots, each (ticks,), by name.

    Besides those of the telemetry, with its names: `distance_m` that the rear axle drove, `limit_speed_m_s` of the law,
    `friction_utilisation` and `slide_m_s` of the tire with the greatest, `acceleration_ahead_m_s2` and
    `acceleration_left_m_s2`. On ground with heights also `ground_m`, its height under the middle of the rear axle, and
    the loads of the wheels, 0 off the ground.
    """
    own = (
        "time_s", "lap", "progress_m", "offset_m", "x_m", "y_m", "heading_rad", "speed_m_s", "yaw_rate_rad_s",
        "steering_angle_rad", "command_steering_rad", "command_speed_m_s",
        *(f"slide_{wheel}_m_s" for wheel in WHEELS), *(f"friction_utilisation_{wheel}" for wheel in WHEELS),
        "sliding_steps", "steps",
    )  # fmt: skip
    columns = {name: run.column(name) for name in own}
    steps = np.hypot(np.diff(columns["x_m"]), np.diff(columns["y_m"]))
    columns["distance_m"] = np.concatenate(([0.0], np.cumsum(steps)))[: len(columns["x_m"])]
    columns["limit_speed_m_s"] = limit_speed(columns["steering_angle_rad"], run.car, run.mu)
    for name, form in (("friction_utilisation", "friction_utilisation_{}"), ("slide_m_s", "slide_{}_m_s")):
        tires = np.stack([columns[form.format(wheel)] for wheel in WHEELS])
        columns[name] = np.where(np.isnan(tires), 0.0, tires).max(axis=0)  # NaN: off the ground, and so no force
    if run.summary["max_slide_m_s"] is None:
        columns["slide_m_s"], columns["sliding_steps"] = np.full((2, len(columns["steps"])), np.nan)
    ahead, left = accelerations(columns["time_s"], columns["speed_m_s"], columns["yaw_rate_rad_s"])
    columns["acceleration_ahead_m_s2"], columns["acceleration_left_m_s2"] = ahead, left
    if mujoco.mj_name2id(run.model, mujoco.mjtObj.mjOBJ_GEOM, TERRAIN) >= 0:
        places = zip(columns["x_m"].tolist(), columns["y_m"].tolist(), strict=True)
        columns["ground_m"] = np.array([core.surface_at(run.model._address, x, y)[0] for x, y in places])
        columns |= {f"load_{wheel}_N": np.nan_to_num(run.column(f"load_{wheel}_N")) for wheel in WHEELS}
    return columns


def limit_speed(steering_angle: FloatArray, car: CarParameters, mu: float) -> FloatArray:
    """Return the greatest speed [m/s] at angles (n,) [rad], sqrt(g mu b / tan|angle|), at most SPEED_FAR_ABOVE."""
    grip = car.gravity * mu * car.wheelbase
    least = grip / SPEED_FAR_ABOVE**2  # of the tangent, for which the limit is just that
    limit: FloatArray = np.sqrt(grip / np.maximum(np.tan(np.abs(steering_angle)), least))
    return limit


def accelerations(time: FloatArray, speed: FloatArray, yaw_rate: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the rear axle's acceleration ahead, dv/dt over the tick, and to the left, v times yaw rate (n,) [m/s^2].

    They leave out the lateral slip of the rear axle. In the last tick, whose end the telemetry does not have, dv/dt is
    that of the tick before.
    """
    if len(time) < 2:
        return np.zeros(len(time)), speed * yaw_rate
    ahead = np.diff(speed) / np.diff(time)
    return np.append(ahead, ahead[-1]), speed * yaw_rate


@dataclass(frozen=True, kw_only=True, eq=False)
class MapShapes:
    """Convex outlines, each counterclockwise and (k, 2) [m]."""

    walls: list[FloatArray]
    obstacles: list[FloatArray]
    moving: list[FloatArray]  # where they are at the end

    @property
    def bounds(self) -> FloatArray:
        """Least and greatest x and y of all that does not move, (2, 2) [m]; zeros where there is nothing."""
        points = np.concatenate([*self.walls, *self.obstacles]) if self.walls or self.obstacles else np.zeros((1, 2))
        return np.stack((points.min(axis=0), points.max(axis=0)))


def map_shapes(model: mujoco.MjModel, end: float) -> MapShapes:
    """Return the footprints in a world's model; what moves is where it is at the time `end` [s]."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    walls: list[FloatArray] = []
    obstacles: list[FloatArray] = []
    for geom in range(model.ngeom):
        name = model.geom(geom).name
        if name.startswith(("wall_", "obstacle_")) and model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
            (walls if name.startswith("wall_") else obstacles).append(_footprint(model, data, geom))
    return MapShapes(
        walls=walls, obstacles=obstacles, moving=[obstacle.corners(end) for obstacle in moving_obstacles(model)]
    )


def _footprint(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> FloatArray:
    """Return the outline of an upright prism: its lower corners, by their bearing from the middle of them."""
    mesh = model.geom_dataid[geom]
    first = model.mesh_vertadr[mesh]
    corners = np.asarray(model.mesh_vert[first : first + model.mesh_vertnum[mesh]], dtype=np.float64)
    corners = data.geom_xpos[geom] + corners @ data.geom_xmat[geom].reshape(3, 3).T
    low = corners[corners[:, 2] <= 0.5 * (corners[:, 2].min() + corners[:, 2].max()), :2]
    away = low - low.mean(axis=0)
    outline: FloatArray = low[np.argsort(np.arctan2(away[:, 1], away[:, 0]))]
    return outline
