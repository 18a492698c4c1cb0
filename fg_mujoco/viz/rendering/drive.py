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

from ...course.moving_obstacles import make_mover
from ...errors import RunFolderError, SettingsError
from ...messages import FloatArray
from ...racing.resimulation import load_world
from ...racing.result import RaceResult
from ...racing.run_folder import Run, read_run
from ...simulation.physics import STATE
from ...simulation.telemetry import TELEMETRY
from .renderer import Renderer, track_start


@dataclass(frozen=True, kw_only=True, eq=False)
class Drive:
    """A recording, whatever it was read from. Arrays as in RaceResult."""

    name: str
    xml: str = field(repr=False)  # of the world
    summary: dict[str, Any] = field(repr=False)
    time: FloatArray = field(repr=False)  # (ticks + 1,) [s]
    states: FloatArray = field(repr=False)  # (ticks + 1, k)
    ctrl: FloatArray = field(repr=False)  # (ticks, 2)
    telemetry: FloatArray = field(repr=False)  # (ticks, len(TELEMETRY))
    start: tuple[float, float] | None = None  # a point on the start line [m]
    raced_here: bool = False  # by this process, which has run the planner's code already

    def column(self, name: str) -> FloatArray:
        """Return one column of the telemetry, shape (ticks,)."""
        return self.telemetry[:, TELEMETRY.index(name)]

    @property
    def end(self) -> float:
        """When it ends [s]."""
        return float(self.time[-1])

    @cached_property
    def headings(self) -> FloatArray:
        """At the start of each tick, without jumps (ticks,) [rad]."""
        return np.unwrap(self.column("heading_rad"))

    @cached_property
    def friction_utilisation(self) -> FloatArray:
        """Greatest friction utilisation of the four tires in each tick (ticks,) [-]; 0 where none is on the ground."""
        return self._greatest_of_tires("friction_use_front_left")

    @cached_property
    def sliding_speed(self) -> FloatArray:
        """Greatest slip speed of the four tires in each tick (ticks,) [m/s]; 0 where none is on the ground."""
        return self._greatest_of_tires("slide_front_left_m_s")

    def _greatest_of_tires(self, first_column: str) -> FloatArray:
        first = TELEMETRY.index(first_column)
        values = self.telemetry[:, first : first + 4]
        greatest: FloatArray = np.where(np.isnan(values), 0.0, values).max(axis=1, initial=0.0)
        return greatest

    def tick_at(self, time: float) -> int:
        """Return the tick that a time [s] is in.

        Raises:
          SettingsError: a time before the drive or after it.
        """
        if not -1e-9 <= time <= self.end + 1e-9:
            raise SettingsError(f"time {time:g} s is outside of {self.name}; accepted: 0 to {self.end:.3f} s")
        tick = int(np.searchsorted(self.time, time + 1e-9, side="right")) - 1
        return min(max(tick, 0), max(len(self.ctrl) - 1, 0))


def read_drive(source: Drive | Run | RaceResult | str | Path) -> Drive:
    """Return a recording.

    Raises:
      RunFolderError: a folder that is none of `race --out`, lacks a file, or is of another version.
    """
    if isinstance(source, Drive):
        return source
    if isinstance(source, RaceResult):
        time = _times(source.world.model, source.states)
        return Drive(
            name=f"{source.track}, {source.controller}", xml=source.world.xml, summary=source.summary(), time=time,
            states=source.states, ctrl=source.ctrl, telemetry=source.telemetry, start=track_start(source.world),
            raced_here=True,
        )  # fmt: skip
    run = source if isinstance(source, Run) else read_run(source)
    load_world(run)  # refuses a scene that does not compile, or is not that of the states
    return Drive(
        name=str(run.folder), xml=run.xml, summary=run.summary, time=run.time, states=run.states, ctrl=run.ctrl,
        telemetry=run.telemetry, start=_start_of(run.telemetry),
    )  # fmt: skip


def _times(model: mujoco.MjModel, states: FloatArray) -> FloatArray:
    data = mujoco.MjData(model)
    times = np.empty(len(states))
    for index, state in enumerate(states):
        mujoco.mj_setState(model, data, state, STATE)
        times[index] = data.time
    return times


def _start_of(telemetry: FloatArray) -> tuple[float, float] | None:
    """Return where the start line is passed [m], by the progress that is nearest to 0; None where it is never near."""
    if not len(telemetry):
        return None
    column = {name: telemetry[:, TELEMETRY.index(name)] for name in ("progress_m", "x_m", "y_m", "heading_rad")}
    tick = int(np.abs(column["progress_m"]).argmin())
    progress, x, y, heading = (float(values[tick]) for values in column.values())
    if abs(progress) > 0.5:
        return None
    return x - progress * float(np.cos(heading)), y - progress * float(np.sin(heading))


class Player:
    """Takes a renderer to any time of a drive.

    Args:
      drive: what was recorded.
      renderer: of its world.

    Raises:
      RunFolderError: states that are not of this world.
    """

    def __init__(self, drive: Drive, renderer: Renderer) -> None:
        self.drive, self.renderer = drive, renderer
        self._mover = make_mover(renderer.model)
        if drive.states.shape[1] != mujoco.mj_stateSize(renderer.model, STATE):
            raise RunFolderError(
                f"{drive.name}: its states are not of its scene.xml; accepted: as `race --out` wrote it"
            )

    def tick_start(self, tick: int) -> mujoco.MjData:
        """Return data at the start of a tick, forces, sensors and poses current."""
        return self.renderer.set_state(self.drive.states[tick])

    def at(self, time: float) -> mujoco.MjData:
        """Return data at a time [s]: forces and sensors of the physics step that it is in, poses of the time itself.

        Raises:
          SettingsError: a time before the drive or after it.
        """
        drive, model = self.drive, self.renderer.model
        tick = drive.tick_at(time)
        data = self.tick_start(tick)
        if not len(drive.ctrl) or time >= drive.end:
            return self.tick_start(len(drive.states) - 1)
        data.ctrl[:] = drive.ctrl[tick]
        steps = int((time - float(drive.time[tick])) / model.opt.timestep + 1e-6)
        for _ in range(steps):
            mujoco.mj_step(model, data)
            if self._mover is not None:
                self._mover.place(data)
        mujoco.mj_forward(model, data)
        rest = time - float(data.time)
        if rest > 1e-9:
            mujoco.mj_integratePos(model, data.qpos, data.qvel, rest)
            data.time = time
            if self._mover is not None:
                self._mover.place(data)
            for update in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_tendon):
                update(model, data)
        return data
