"""Planners of many worlds that decide together: a tick of all worlds is a few calls of the native core.

1. see: readings without NaN, and odometry;
2. predict: what moves (safety.predictions);
3. refer: the planner's own function, from the scan to a reference;
4. begin: a new decision (decision);
5. guide: a reference that does not lead on is replaced;
6. drive: from the reference to a command.

2, 5 and 6 are stages, and further stages are called between these (stages). A call that no planner of the batch needs
is not made. An engine makes all of them from within its own call of the native core (ControllerBatch): what is native
directly, and functions in Python for one world after the other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.errors import ControllerError
from fg_mujoco.messages import ODOMETRY, FloatArray, LaserScan, Reading, ScanGeometry
from fg_mujoco.native import core
from fg_mujoco.native_arrays import ArrayTable, views

from ..perception.scan_filters import IntermediateScans
from ..perception.scan_geometry import SCAN_GEOMETRY, geometry_values
from ..safety.braking_trajectories import TRAJECTORIES
from .driving import DRIVING_MEMORY, TICK
from .planner_settings import record_type
from .reasons import Reason, reasons_in
from .stages import NO_MEMORY, STAGE_ARRAYS, BatchArrays, NativeStep, Stage, Step, Tick

_NO_TRAJECTORIES = np.zeros(1, TRAJECTORIES)
_ALL = slice(None)


class PlannerState(NamedTuple):
    """State of the step that writes the reference of a planner."""

    settings: Any  # of the planner
    memory: Any  # of its `memory_type`, written to


class PlannerBatch:
    """Planners of one class, one for each world: a fg_mujoco.messages.ControllerBatch.

    One batch is for one thread at a time; others may decide at the same time.

    Args:
      planner_class: of the planners, a subclass of planner.Planner.
      planners: in the order of their worlds; they lend their settings and keep their memory to themselves.

    Attributes:
      references: of the last tick, (n,) of type REFERENCE.
      memory: what driving keeps from tick to tick, (n,) of type DRIVING_MEMORY.
      stage_states: memory of each stage by the stage's name, (n,) of its type.
      debug: intermediate scans of the last world that was decided, (4, beams) [m], in the order of IntermediateScans.

    Raises:
      ControllerError: a planner of another class.
    """

    def __init__(self, planner_class: type[Any], planners: Sequence[Any]) -> None:
        for planner in planners:
            if type(planner) is not planner_class:
                raise ControllerError(
                    f"a batch of {planner_class.__name__} was given a {type(planner).__name__}; accepted: its own class"
                )
        count, self._read = len(planners), planner_class.read
        self._guided = 1 if planner_class.hides_cars else 0  # which of the scans guidance has; the last has no movers
        self._ticks = np.zeros(count, TICK)
        state = [("settings", record_type(planner_class.Settings)), ("memory", planner_class.memory_type)]
        self._planner_states = np.zeros(count, np.dtype(state, align=True))
        lines, line_firsts = _join([planner.line for planner in planners], np.empty((0, 0)))
        trajectories, tables = _join([planner.trajectories for planner in planners], _NO_TRAJECTORIES)
        for world, planner in enumerate(planners):
            driver, self._planner_states["settings"][world] = planner.driver[0].copy(), planner.settings_row[0]
            driver["trajectories"], driver["line_first"] = tables[world], line_firsts[world]
            driver["line_end"] = line_firsts[world] + (0 if planner.line is None else len(planner.line))
            self._ticks["driver"][world] = driver
        self._geometry = cast(Any, None)
        self._used = False  # what nobody has written to takes no memory
        self._tables: list[ArrayTable] = []  # of the steps; none that may be changed: none
        self._lent: list[Any] = []
        self.debug = np.empty((len(IntermediateScans._fields), 0))
        self._arrays: dict[str, Any] = {
            "geometry": np.zeros(1, SCAN_GEOMETRY), "ticks": self._ticks, "lines": lines, "trajectories": trajectories,
        }  # fmt: skip
        self.references, self.memory = self._ticks["reference"], self._ticks["memory"]
        stages = {name: stage for planner in planners for name, stage in planner.stages.items()}
        self.stage_states = {name: np.zeros(count, stage.state_type) for name, stage in stages.items()}
        see = NativeStep("see")
        self._steps: list[tuple[Step, dict[str, NDArray[Any]]]] = [(see, {})]  # and the arrays of their stages
        self._settings = [planner.settings for planner in planners]
        self._calls = np.empty((0, 2), np.int64)  # the same by address, for these tables
        self._called: list[Callable[[], None]] = []  # what they call in Python
        self._add_steps(planner_class, planners, stages)

    def _add_steps(self, planner_class: type[Any], planners: Sequence[Any], stages: dict[str, Stage]) -> None:
        """Add what is called in a tick, in the order of the calls."""
        nothing, all_worlds = np.zeros(len(planners), NO_MEMORY), np.ones(len(planners), np.bool_)
        has = {name: np.array([name in planner.stages for planner in planners]) for name in stages}

        def add(step: Step | None, active: NDArray[np.bool_], states: NDArray[np.void]) -> None:
            if step is not None and active.any():
                self._steps.append((step, {"active": active, "states": states}))

        def add_stages(when: str) -> None:
            for name, stage in stages.items():
                add(getattr(stage, when), has[name], self.stage_states[name])

        if not planner_class.hides_cars:
            add_stages("before_reference")
        add(planner_class.refer, all_worlds, self._planner_states)
        self._until_reference = len(self._steps)
        add_stages("after_reference")
        add(NativeStep("begin"), all_worlds, nothing)
        add_stages("guide")
        add_stages("after_guidance")
        last = [planner.driven_by for planner in planners]
        for name in dict.fromkeys(last):
            drives = np.array([name == each for each in last])
            step = stages[name].drive if name else NativeStep("drive")
            add(step, drives, self.stage_states[name] if name else nothing)
        add_stages("after_driving")

    def reset(self, which: NDArray[np.bool_] | slice = _ALL) -> None:
        """Forget everything seen so far, in all worlds or in those `which` (n,)."""
        if not self._used:
            return
        self._planner_states["memory"][which] = np.zeros((), self._planner_states.dtype["memory"])
        self._ticks["memory"][which] = np.zeros((), DRIVING_MEMORY)
        for state in self.stage_states.values():
            state[which] = np.zeros((), state.dtype)

    def __call__(
        self,
        geometry: ScanGeometry | LaserScan,
        ranges: FloatArray,
        odometry: NDArray[np.void],
        running: NDArray[np.bool_],
        commands: FloatArray,
    ) -> None:
        """Write the command of each running world into `commands`; see ControllerBatch."""
        written = np.ascontiguousarray(commands, np.float64)
        self._take(geometry, ranges, odometry, running, written)
        core.call_all(self._calls)
        if written is not commands:
            commands[:] = written

    def reasons(self, world: int) -> list[Reason]:
        """Return the change that each step made to a world's last command, see `Planner.reasons`."""
        memory = self.memory[world]
        return reasons_in(memory["reasons"], memory["judge"])

    def take_readings(self, world: int, readings: Mapping[str, Reading]) -> None:
        """Take the readings of the sensors of a world's car; see ControllerBatch."""
        self._read(self._planner_states["memory"][world], readings)

    def refer(
        self,
        geometry: ScanGeometry | LaserScan,
        ranges: FloatArray,
        odometry: NDArray[np.void],
        running: NDArray[np.bool_],
    ) -> None:
        """Write the reference of each running world into `references`; arguments as of a call."""
        self._take(geometry, ranges, odometry, running, np.empty((len(running), 2)))
        core.call_all(self._calls[: self._until_reference])

    def compiled_calls(
        self,
        geometry: ScanGeometry | LaserScan,
        ranges: FloatArray,
        odometry: NDArray[np.void],
        running: NDArray[np.bool_],
        commands: FloatArray,
    ) -> NDArray[np.int64]:
        """Return the calls that replace this one, see ControllerBatch."""
        self._take(geometry, ranges, odometry, running, commands)
        self._lent += [*self._tables, *self._called]
        self._tables, self._called = [], []  # from now on nobody puts anything else into those
        self._arrays["geometry"] = self._arrays["geometry"].copy()
        return self._calls

    def _take(
        self,
        geometry: ScanGeometry | LaserScan,
        ranges: FloatArray,
        odometry: NDArray[np.void],
        running: NDArray[np.bool_],
        commands: FloatArray,
    ) -> None:
        """Put the arrays of a call into the tables, unless they are those of the last call."""
        self._used = True
        if geometry is not self._geometry:  # neither a scan nor a geometry changes
            self._arrays["geometry"][0], self._geometry = geometry_values(geometry), geometry
        given = {
            "measured": np.ascontiguousarray(ranges, np.float64), "odometry": np.ascontiguousarray(odometry, ODOMETRY),
            "running": np.ascontiguousarray(running, np.bool_), "commands": commands,
        }  # fmt: skip
        if self._tables and all(array is self._arrays[name] for name, array in given.items()):
            return
        beams = given["measured"].shape[1]
        if "ranges" not in self._arrays or beams != self.debug.shape[1]:
            taken = np.empty((2 + self._guided, len(running), beams))
            self.debug = np.full((len(self.debug), beams), math.nan)
            self._arrays |= {
                "ranges": taken[0], "ranges_without_cars": taken[self._guided], "ranges_without_movers": taken[-1],
                "debug": self.debug,
            }  # fmt: skip
            self._tables = []
        self._arrays |= given
        if self._tables and not self._called:
            for name, array in given.items():
                self._tables[0].put(name, array)
        else:
            self._make_tables()

    def _make_tables(self) -> None:
        """Make the tables of all steps, and their calls."""
        batch = ArrayTable(BatchArrays._fields, self._arrays)
        stages = [ArrayTable(STAGE_ARRAYS, {"batch": batch.rows} | own) for _, own in self._steps[1:]]
        self._tables, self._called, calls = [batch, *stages], [], []
        for (step, own), table in zip(self._steps, self._tables, strict=True):
            if isinstance(step, NativeStep):
                calls.append(step.call(table.address))
            else:
                self._called.append(partial(_call, step, self._ticks_in_python(**own), self._arrays["running"]))
                calls.append((core.CALL_PYTHON, id(self._called[-1])))
        self._calls = np.array(calls, np.int64)

    def _ticks_in_python(self, active: NDArray[np.bool_], states: NDArray[np.void]) -> list[tuple[int, Tick]]:
        """Return the worlds that have a stage, and their ticks."""
        arrays, found = self._arrays, []
        lines, trajectories = arrays["lines"].view(), arrays["trajectories"].view()
        lines.flags.writeable = trajectories.flags.writeable = False
        for world, (record, state) in enumerate(zip(views(self._ticks), views(states), strict=True)):
            if not active[world]:
                continue
            driver = record.driver
            if states is self._planner_states:
                state = PlannerState(self._settings[world], state.memory)
            found.append((world, Tick(
                geometry=record.geometry,
                odometry=record.odometry,
                ranges=arrays["ranges"][world],
                ranges_without_cars=arrays["ranges_without_cars"][world],
                ranges_without_movers=arrays["ranges_without_movers"][world],
                driver=driver,
                line=lines[driver.line_first : driver.line_end],
                trajectories=trajectories[driver.trajectories : driver.trajectories + 1],
                reference=record.reference,
                memory=record.memory,
                state=state,
                debug=IntermediateScans(*self.debug),
                command=arrays["commands"][world],
                record=record,
            )))  # fmt: skip
        return found


def _call(step: Callable[[Tick], None], ticks: list[tuple[int, Tick]], running: NDArray[np.bool_]) -> None:
    """Call a step for the running ones of the worlds that have it."""
    for world, tick in ticks:
        if running[world]:
            step(tick)


def _join(arrays: Sequence[NDArray[Any] | None], none: NDArray[Any]) -> tuple[NDArray[Any], list[int]]:
    """Return arrays as one, `none` where there is none, and where each begins in it, 0 of None."""
    parts = {id(array): array for array in arrays if array is not None}
    ends = np.cumsum([0, *map(len, parts.values())]).tolist()
    firsts = dict(zip(parts, ends, strict=False))
    joined = next(iter(parts.values()), none) if len(parts) < 2 else np.concatenate(list(parts.values()))
    return joined, [firsts.get(id(array), 0) for array in arrays]
