"""Input and work of a recorded drive's planner in a tick: its scan, its intermediate scans, and its goal.

The scan is measured again at the recorded state, with the noise and delay of the run, and given to the planner again. A
planner gives its intermediate scans by a method `intermediate_scans(scan) -> {name: ranges (n,)}`, which the bundled
planners inherit. Of a run folder that is the planner that is named. If there is none, or it cannot
be made, there is only the scan.
"""

from __future__ import annotations

import inspect
import math
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from ...errors import FgMujocoError
from ...lidar.beams import lidar_body
from ...lidar.effects import LidarEffects
from ...lidar.lidar import make_lidar
from ...messages import FloatArray, LaserScan
from ...racing.resimulation import recorded_planner, resimulate
from ...simulation.cars import car_prefix, lidar_prefix
from ...simulation.physics import STATE
from ...simulation.world import World
from ...vehicle.car import Car
from .recorded_drive import Drive


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannerView:
    """Input and work of a planner in one tick, and the pose of the car."""

    scan: LaserScan
    intermediate_scans: dict[
        str, FloatArray
    ]  # intermediate scans (n,) [m] by name: raw, extended, bubble, gap; those that it has
    goal: FloatArray | None  # (3,) [m] its goal, in the world; None: there is none, or it does not say
    position: FloatArray  # (3,) [m] of the LiDAR
    rotation: FloatArray  # (3, 3) of the LiDAR

    def points(self, ranges: FloatArray, beams: Any = slice(None)) -> FloatArray:
        """Return the ends of some beams of these lengths (n,) [m], in the world. Shape (n, 3) [m]."""
        bearings = self.scan.bearings[beams]
        directions = np.column_stack((np.cos(bearings), np.sin(bearings), np.zeros(len(bearings))))
        ends: FloatArray = self.position + (ranges[beams, None] * directions) @ self.rotation.T
        return ends


def intermediate_scans(planner: Any, scan: LaserScan) -> dict[str, FloatArray]:
    """Return the intermediate scans of a planner by name, ranges (n,) [m]; empty for a planner that has none."""
    own = getattr(planner, "intermediate_scans", None)
    return {name: np.asarray(ranges, dtype=np.float64) for name, ranges in own(scan).items()} if callable(own) else {}


class PlannerEye:
    """Gives scans of a recorded drive to its planner again.

    The planner is that of a text, `controller`, or, without, that of a drive in this process; `missing` says why none.
    """

    def __init__(self, drive: Drive, *, controller: str | None = None) -> None:
        self._drive = drive
        self._model = model = mujoco.MjModel.from_xml_string(drive.xml)
        self._data = mujoco.MjData(model)
        self._car = Car(model, car_prefix(drive.car))
        self._lidar = make_lidar("raycast", model, lidar_prefix(drive.car))
        self._lidar_body = lidar_body(model, lidar_prefix(drive.car))
        self._effects = LidarEffects(**drive.summary.get("lidar_effects", {}))
        self._scans: list[LaserScan] = []
        self.missing = ""
        self._planner = self._make_planner(controller) if controller is not None or drive.raced_here else None

    def _make_planner(self, controller: str | None) -> Any:
        drive = self._drive
        try:
            return recorded_planner(
                drive.summary, self._model, drive.car, controller=controller, where=drive.name,
                raced_here=drive.raced_here,
            )  # fmt: skip
        except (FgMujocoError, KeyError, OSError, TypeError, ValueError) as error:
            self.missing = " ".join(str(error).split())
            return None

    def at_tick(self, tick: int) -> PlannerView:
        """Return the planner's view at the start of a tick."""
        scan = self._scan(tick)
        self._place(tick)
        position = self._data.xpos[self._lidar_body].copy()
        rotation = self._data.xmat[self._lidar_body].reshape(3, 3).copy()
        goal = None
        scans = {"raw": np.nan_to_num(scan.ranges, nan=0.0, posinf=scan.range_max, neginf=0.0)}
        if self._planner is not None:
            scans |= intermediate_scans(self._planner, scan)
            goal = self._goal(scan, position, rotation)
        return PlannerView(scan=scan, intermediate_scans=scans, goal=goal, position=position, rotation=rotation)

    def _goal(self, scan: LaserScan, position: FloatArray, rotation: FloatArray) -> FloatArray | None:
        """Return the goal: of one that looks for it in the scan a bearing and a distance, in the map x and y."""
        find = getattr(self._planner, "find_goal", None)
        wanted = tuple(inspect.signature(find).parameters) if find is not None else ()
        if find is not None and wanted == ("scan",):
            found = find(scan)
            if found is None:
                return None
            bearing, distance = found
            goal: FloatArray = position + rotation @ (distance * np.array([math.cos(bearing), math.sin(bearing), 0.0]))
            return goal
        if find is not None and wanted == ("odometry",):
            place = find(self._car.odometry(self._data))
            return None if place is None else np.array([*place, position[2]])
        return None

    def _place(self, tick: int) -> None:
        mujoco.mj_setState(self._model, self._data, self._drive.states[tick], STATE)
        mujoco.mj_forward(self._model, self._data)

    def _scan(self, tick: int) -> LaserScan:
        if self._effects == LidarEffects():
            self._place(tick)
            return self._lidar.beams.to_scan(self._lidar.ranges(self._data), self._data.time)
        if not self._scans:  # noise is drawn in the order of the ticks, and late scans move up: all at once
            self._scans = self._measure_all()
        return self._scans[tick]

    def _measure_all(self) -> list[LaserScan]:
        """Return the scan at the start of every tick, as the race had them."""
        world = World.from_xml(self._drive.xml)
        return [tick.sensed_by_each[self._drive.car].scan for tick in resimulate(self._drive, world)]
