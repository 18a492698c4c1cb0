"""Stages: what stands between a planner's reference and the car's command, as compiled calls.

    @kernel
    def creep(tick: Tick) -> None:
        tick.command[1] = min(tick.command[1], 1.0)

    CREEP = Stage(text="at most 1 m/s", after_driving=creep)
    STAGES["creep"] = "my_package.my_module:CREEP"  # of control.assist
    fg.race("oval", "gap_finder", assist="full+creep")

`assist` chooses the stages of a planner. A stage that no planner uses is neither imported nor compiled. They are
called in the order of the kernels of `Stage`; in between every planner sees, refers and begins its decision
(planner_batch). A kernel of a stage is called for one world at a time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.compiled.array_table import Table, flags, matrix, read_only, rows, table_at, whole_matrix
from fg_mujoco.compiled.kernels import call_at, kernel
from fg_mujoco.errors import ControllerError
from fg_mujoco.messages import ODOMETRY, FloatArray

from ..perception.scan_filters import copy_ranges, valid_ranges
from ..perception.scan_geometry import SCAN_GEOMETRY
from ..safety.braking_trajectories import TRAJECTORIES
from .driving import TICK
from .planner_settings import Record

PLACES = ("before_reference", "after_reference", "guide", "after_guidance", "drive", "after_driving")
"""Names of the kernels of a Stage, in the order of their calls."""

NO_MEMORY = np.dtype([("unused", np.int8)])
"""Type of the record of a stage, or of a planner, that keeps nothing."""


class Tick(NamedTuple):
    """What a stage knows of one world in one tick, and what it writes to."""

    geometry: Record  # of the scan, of type SCAN_GEOMETRY; it and `odometry` are in the velocity frame (slip) from
    odometry: Record  # `guide` on, for a car whose tires need slip angles; of type ODOMETRY
    ranges: FloatArray  # readings (n,) [m], without NaN or inf
    ranges_without_cars: FloatArray  # the same for guidance: a planner that sees other cars has taken them out
    ranges_without_movers: FloatArray  # the same without what moves; undefined where `memory.predictions` has no rows
    driver: Record  # the planner's car, settings and limits, of type DRIVER
    line: FloatArray  # the planner's line through the map (points, columns); no points without a map
    trajectories: Record  # its braking trajectories, of type TRAJECTORIES; undefined for a planner without `sight`
    reference: Record  # of type REFERENCE, written to
    memory: Record  # what driving keeps from tick to tick, of type DRIVING_MEMORY, written to
    state: Record  # what this stage keeps from tick to tick, of its `state_type`, written to
    debug: FloatArray  # (4, beams) [m] for pictures, in the order of IntermediateScans; written to
    command: FloatArray  # (2,) steering angle [rad] and speed [m/s], written to
    record: Record  # of type TICK, with the records above; a stage that writes the command sets `record.decided`


Step = Callable[[Tick], None]
"""A kernel of a stage."""



@dataclass(frozen=True, kw_only=True)
class Stage:
    """A stage of driving.

    Attributes:
      text: what it does, in one line.
      needs: names of the stages without which it can do nothing.
      needs_friction: whether it has no meaning for a planner that assumes no friction limit, mu = inf.
      before_reference: kernel that is called before the planner refers; None: none is called then.
      after_reference: the same once the planner has referred.
      guide: the same once the decision has begun.
      after_guidance: the same; if it decides, it sets `tick.record.decided`.
      drive: writes the command, unless there is one. Of a planner's stages only the last one that has it is called.
      after_driving: the same once there is a command.
      state_type: type of the stage's memory in a world, which is zero at the beginning.

    Raises:
      ControllerError: what is called at a place is no kernel of a Tick.
    """

    text: str = ""
    needs: tuple[str, ...] = ()
    needs_friction: bool = False
    before_reference: Step | None = None
    after_reference: Step | None = None
    guide: Step | None = None
    after_guidance: Step | None = None
    drive: Step | None = None
    after_driving: Step | None = None
    state_type: np.dtype[np.void] = NO_MEMORY

    def __post_init__(self) -> None:
        for name in PLACES:
            step = getattr(self, name)
            code = getattr(getattr(step, "py_func", None), "__code__", None)
            if step is not None and (code is None or code.co_argcount != 1):
                said = f"Stage.{name} is {getattr(step, '__name__', step)!r}"
                said += ", which is no kernel" if code is None else f", which takes {code.co_argcount} arguments"
                raise ControllerError(f"{said}; accepted: a @kernel of (tick: Tick)")


class BatchArrays(NamedTuple):
    """The arrays of a batch of n worlds, as kernels find them in its table."""

    geometry: NDArray[np.void]  # (1,) of type SCAN_GEOMETRY
    measured: FloatArray  # (n, beams) [m]
    odometry: NDArray[np.void]  # (n,) of type ODOMETRY
    running: NDArray[np.bool_]  # (n,)
    ticks: NDArray[np.void]  # (n,) of type TICK
    lines: FloatArray  # (points, columns) of the lines through the map, of all planners
    trajectories: NDArray[np.void]  # (tables,) of type TRAJECTORIES, of all planners
    ranges: FloatArray  # (n, beams) [m]; this and the following as in Tick
    ranges_without_cars: FloatArray
    ranges_without_movers: FloatArray
    debug: FloatArray
    commands: FloatArray


_COUNT = len(BatchArrays._fields)

STAGE_ARRAYS = ("batch", "active", "states")
"""Names of the arrays of one stage: the table of its batch, the worlds that have the stage, and its states."""


@kernel
def call_all(calls: NDArray[np.int64]) -> None:
    """Call kernels by their addresses, (k, 2): each address of code, and the number that it is called with."""
    for index in range(len(calls)):
        call_at(calls[index, 0], calls[index, 1])


@kernel
def _arrays_in(table: Table) -> BatchArrays:
    """Return the arrays of a batch's table."""
    return BatchArrays(
        rows(table[0], SCAN_GEOMETRY), read_only(matrix(table[1])), rows(table[2], ODOMETRY), flags(table[3]),
        rows(table[4], TICK), read_only(matrix(table[5])), read_only(rows(table[6], TRAJECTORIES)), matrix(table[7]),
        matrix(table[8]), matrix(table[9]), matrix(table[10]), matrix(table[11]),
    )  # fmt: skip


@kernel
def see_at(address: int) -> None:
    """Take the readings and the odometry of all running worlds, from the arrays of the batch's table at an address."""
    batch = _arrays_in(table_at(address, _COUNT))
    for world in range(len(batch.running)):
        if batch.running[world]:
            copy_ranges(batch.ranges[world], valid_ranges(batch.measured[world], batch.geometry[0].range_max))
            tick = batch.ticks[world]
            tick.geometry, tick.odometry, tick.decided = batch.geometry[0], batch.odometry[world], False


@cache
def stage_at(step: Step, state_type: np.dtype[np.void]) -> Any:
    """Return the kernel that calls a stage for all running worlds that have it, by the table of STAGE_ARRAYS.

    Args:
      step: kernel of the stage.
      state_type: type of the stage's memory in a world.
    """

    @kernel
    def stage_at(address):  # type: ignore[no-untyped-def]
        stage = table_at(address, 3)
        batch, active, states = _arrays_in(whole_matrix(stage[0])), flags(stage[1]), rows(stage[2], state_type)
        for world in range(len(active)):
            if batch.running[world] and active[world]:
                tick = batch.ticks[world]
                driver = tick.driver
                step(
                    Tick(
                        geometry=tick.geometry,
                        odometry=tick.odometry,
                        ranges=batch.ranges[world],
                        ranges_without_cars=batch.ranges_without_cars[world],
                        ranges_without_movers=batch.ranges_without_movers[world],
                        driver=driver,
                        line=batch.lines[driver.line_first : driver.line_end],
                        trajectories=batch.trajectories[driver.trajectories],
                        reference=tick.reference,
                        memory=tick.memory,
                        state=states[world],
                        debug=batch.debug,
                        command=batch.commands[world],
                        record=tick,
                    )
                )

    return stage_at
