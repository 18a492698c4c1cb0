"""A recorded drive at any time: a run folder, a Run or a RaceResult.

States are recorded once a tick, 25 ms. Between two of them the physics is stepped again from the earlier one, to the
last physics step before the requested time. The rest, less than 5 ms, is extrapolated with that step's velocities. So
pictures move smoothly at any frame rate, and no frame depends on another.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from ... import from_addons
from ...course.moving_obstacles import moving_obstacles, place_moving
from ...errors import RunFolderError, SettingsError
from ...messages import FloatArray
from ...racing.resimulation import load_world
from ...racing.result import RaceResult
from ...racing.run_folder import Run, read_run
from ...simulation.cars import require_car
from ...simulation.physics import STATE
from ...simulation.telemetry import TELEMETRY
from .renderer import Renderer, track_start


@dataclass(frozen=True, kw_only=True, eq=False)
class Drive:
    """A recording, whatever it was read from. Arrays as in RaceResult; the car is the one that is looked at."""

    name: str
    xml: str = field(repr=False)  # of the world
    summary: dict[str, Any] = field(repr=False)  # of several cars, with what its row in `cars` says of this one
    time: FloatArray = field(repr=False)  # (ticks + 1,) [s]
    states: FloatArray = field(repr=False)  # (ticks + 1, k)
    ctrl: FloatArray = field(repr=False)  # (ticks, 2 cars)
    telemetry: FloatArray = field(repr=False)  # (ticks, len(TELEMETRY)) of this car
    start: tuple[float, float] | None = None  # a point on the start line [m]
    raced_here: bool = False  # by this process, which has run the planner's code already
    car: int = 0  # number of this car
    telemetries: tuple[FloatArray, ...] = field(default=(), repr=False)  # of all cars

    def column(self, name: str) -> FloatArray:
        """Return one column of the telemetry, shape (ticks,)."""
        return self.telemetry[:, TELEMETRY.index(name)]

    @property
    def end(self) -> float:
        """When it ends [s]."""
        return float(self.time[-1])

    @property
    def best_lap(self) -> tuple[int, float, float] | None:
        """The number of the fastest lap, and when it begins and ends [s]; None where fewer than two are complete."""
        laps = self.summary.get("lap_times_s") or ()
        if len(laps) < 2:
            return None
        best = int(np.argmin(laps))
        ends = np.cumsum(laps)
        return best + 1, float(ends[best] - laps[best]), min(float(ends[best]), self.end)

    @cached_property
    def headings(self) -> FloatArray:
        """At the start of each tick, without jumps (ticks,) [rad]."""
        return np.unwrap(self.column("heading_rad"))

    @cached_property
    def friction_utilisation(self) -> FloatArray:
        """Greatest friction utilisation of the four tires in each tick (ticks,) [-]; 0 where none is on the ground."""
        first = TELEMETRY.index("friction_utilisation_front_left")
        values = self.telemetry[:, first : first + 4]
        greatest: FloatArray = np.where(np.isnan(values), 0.0, values).max(axis=1, initial=0.0)
        return greatest

    @cached_property
    def standings(self) -> from_addons.Standings | None:
        """Positions of the cars; None if the car was alone."""
        return from_addons.standings(self.telemetries, self.summary["cars"]) if len(self.telemetries) > 1 else None

    def tick_at(self, time: float) -> int:
        """Return the tick that a time [s] is in; raise SettingsError for one outside of the drive."""
        if not -1e-9 <= time <= self.end + 1e-9:
            raise SettingsError(f"time {time:g} s is outside of {self.name}; accepted: 0 to {self.end:.3f} s")
        tick = int(np.searchsorted(self.time, time + 1e-9, side="right")) - 1
        return min(max(tick, 0), max(len(self.ctrl) - 1, 0))


def read_drive(source: Drive | Run | RaceResult | str | Path, car: int = 0) -> Drive:
    """Return a recording, of one of its cars; a Drive is taken as it is. Raises RunFolderError, SettingsError."""
    if isinstance(source, Drive):
        return source
    if isinstance(source, RaceResult):
        time = _times(source.world.model, source.states)
        telemetries = tuple(each.telemetry for each in source.cars)
        require_car(car, len(telemetries))
        return Drive(
            name=f"{source.track}, {source.car.controller}", xml=source.world.xml, time=time,
            summary=_summary_of(source.summary(), car), states=source.states, ctrl=source.ctrl,
            telemetry=telemetries[car], start=track_start(source.world), raced_here=True, car=car,
            telemetries=telemetries,
        )  # fmt: skip
    run = source if isinstance(source, Run) else read_run(source)
    load_world(run)  # refuses a scene that does not compile, or is not that of the states
    telemetries = (run.telemetry, *run.others)
    require_car(car, len(telemetries))
    return Drive(
        name=str(run.folder), xml=run.xml, summary=_summary_of(run.summary, car), time=run.time, states=run.states,
        ctrl=run.ctrl, telemetry=telemetries[car], start=_start_of(run.telemetry), car=car, telemetries=telemetries,
    )  # fmt: skip


def _summary_of(summary: dict[str, Any], car: int) -> dict[str, Any]:
    """Return the summary of a run with what it says of one of several cars, which else is of car 0."""
    rows = summary.get("cars") or ()
    return summary | dict(rows[car]) if car and len(rows) > car else summary


def _times(model: mujoco.MjModel, states: FloatArray) -> FloatArray:
    data = mujoco.MjData(model)
    times = np.empty(len(states))
    for index, state in enumerate(states):
        mujoco.mj_setState(model, data, state, STATE)
        times[index] = data.time
    return times


def _start_of(telemetry: FloatArray) -> tuple[float, float] | None:
    """Return the place where the start line is passed [m], by the progress nearest to 0; None if it is never near."""
    if not len(telemetry):
        return None
    column = {name: telemetry[:, TELEMETRY.index(name)] for name in ("progress_m", "x_m", "y_m", "heading_rad")}
    tick = int(np.abs(column["progress_m"]).argmin())
    progress, x, y, heading = (float(values[tick]) for values in column.values())
    if abs(progress) > 0.5:
        return None
    return x - progress * float(np.cos(heading)), y - progress * float(np.sin(heading))


class Player:
    """Takes a renderer to any time of a drive; raises RunFolderError, when made, for states of another world."""

    def __init__(self, drive: Drive, renderer: Renderer) -> None:
        self.drive, self.renderer = drive, renderer
        self._moving = moving_obstacles(renderer.model)
        if drive.states.shape[1] != mujoco.mj_stateSize(renderer.model, STATE):
            raise RunFolderError(
                f"{drive.name}: its states are not of its scene.xml; accepted: as `race --out` wrote it"
            )

    def tick_start(self, tick: int) -> mujoco.MjData:
        """Return data at the start of a tick, forces, sensors and poses current."""
        return self.renderer.set_state(self.drive.states[tick])

    def at(self, time: float) -> mujoco.MjData:
        """Return data at a time [s]: forces and sensors of the physics step that it is in, poses of the time itself."""
        drive, model = self.drive, self.renderer.model
        tick = drive.tick_at(time)
        data = self.tick_start(tick)
        if not len(drive.ctrl) or time >= drive.end:
            return self.tick_start(len(drive.states) - 1)
        data.ctrl[:] = drive.ctrl[tick]
        steps = int((time - float(drive.time[tick])) / model.opt.timestep + 1e-6)
        for _ in range(steps):
            self.renderer.tires.step(data)
            place_moving(self._moving, data)
        self.renderer.tires.forward(data)
        rest = time - float(data.time)
        if rest > 1e-9:
            mujoco.mj_integratePos(model, data.qpos, data.qvel, rest)
            data.time = time
            place_moving(self._moving, data)
            for update in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_tendon):
                update(model, data)
        return data
