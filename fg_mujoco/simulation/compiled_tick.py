"""A tick and its parts as kernels of a table of all arrays of some worlds (array_table)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..array_table import (
    ArrayTable,
    Table,
    corner_numbers,
    cube,
    flags,
    matrix,
    numbers,
    rows,
    short_matrix,
    short_numbers,
    table_at,
    whole_matrix,
    whole_numbers,
)
from ..course.course import Course
from ..course.lap_timer import LAP_TIMER
from ..kernels import c_function, call_at, kernel
from ..lidar.links import LINK
from ..lidar.visible_surfaces import SceneArrays, Scratch
from ..messages import ODOMETRY
from ..vehicle.motion import CAR
from ..vehicle.stages import Fields
from ..vehicle.tire_forces import GEAR, TIRE, Inertia
from .clear_ground import ClearGround
from .clock import seconds
from .physics import Batch, StateLayout, apply_to_states
from .telemetry import STATISTICS
from .termination import END_REASONS, judge_cars
from .tick import Mounts, book_cars, hold_commands, read_cars, scan_cars, worlds_to_drive
from .world_step import Floor, Sizes, step_world

NAMES = (
    "places", "running", "states", "sensors", "cars", "timers", "odometry", "telemetry", "offset_positions",
    "offset_rotations", "motions", *SceneArrays._fields, *Scratch._fields, "ranges", "commands", "times", "records",
    "ids", "status", "failed", "mu", "slip", "crashed", "statistics", "reasons", "warnings", "lap_times",
    "standing_since", "table", "tires", "tire_states",
    "patches", "wheels", "floor_mu", "pairs", "car_places", "links", "touch_places", "touched_at", "sizes", "span",
    "fields", "row_counts", "row_starts", "inertia_columns", "gears", "scratch",
    "distances", "corner", "bodies",
)  # fmt: skip
"""Of the arrays in a table, in the order of its rows."""

(
    _PLACES, _RUNNING, _STATES, _SENSORS, _CARS, _TIMERS, _ODOMETRY, _TELEMETRY, _OFFSET_POSITIONS, _OFFSET_ROTATIONS,
    _MOTIONS, _BEAMS, _LIMITS, _EDGES, _TRIANGLES, _BOXES, _SPANS, _PLANES, _FRAMES, _SHAPES, _SPHERES, _CUTS,
    _COLUMNS, _NEAREST, _VIEWS, _BINS, _POSES, _RANGES, _COMMANDS, _TIMES, _RECORDS, _IDS, _STATUS,
    _FAILED, _MU, _SLIP, _CRASHED, _STATISTICS, _REASONS, _WARNINGS, _LAP_TIMES, _STANDING_SINCE, _TABLE, _TIRE_ROWS,
    _TIRE_STATES, _PATCHES, _WHEELS, _FLOOR_MU, _PAIRS, _CAR_PLACES, _LINKS, _TOUCH_PLACES, _TOUCHED_AT, _SIZES, _SPAN,
    _FIELDS, _ROW_COUNTS, _ROW_STARTS, _COLUMNS_OF_INERTIA, _GEARS, _SCRATCH,
    _DISTANCES, _CORNER, _BODIES,
) = range(len(NAMES))  # fmt: skip

_ARRAYS = len(NAMES)

KEPT = ("ticks", "telemetry", "states", "controls")
"""Of the arrays in a table that whole ticks of world 0 are kept in: how many are, (1,), and for each the telemetry of
all cars, the state after it, and the controls; in the row before the first state is that before it."""

NOTHING_KEPT = ArrayTable(KEPT, {}).rows

DRIVEN, LATE, NO_NUMBERS = range(3)
"""Ends of a whole tick: driven, or before the cars were driven, after a decision over its limit, or because the
command of a car that runs is no number."""

_TICKS, _KEPT_TELEMETRY, _KEPT_STATES, _KEPT_CONTROLS = range(len(KEPT))
_FAILED_REASON = END_REASONS.index("failed")

_CARS_PER_WORLD, _BATCH, _LAPS, _FIRST_OF_LAYOUT = range(4)
_FIRST, _END, _ADVANCE = range(3)
_TIMESTEP, _LENGTH, _MODULUS, _STOP_TIME, _LAST_TIME = range(5)


def whole_places(cars_per_world: int, batch: Batch, laps: int, layout: StateLayout) -> NDArray[np.int64]:
    """Return the array `places` of a table."""
    spans = (*layout.qpos, *layout.qvel, *layout.ctrl, *layout.mocap_pos, *layout.userdata)
    return np.array((cars_per_world, batch.address, laps, layout.time, *spans), np.int64)


def course_numbers(
    timestep: float, course: Course | None, laps: int, time_limit: float | None, period: float
) -> NDArray[np.float64]:
    """Return the array `times` of a table; `time_limit` None is that of the course."""
    of_course = (1.0, 1.0, 0.0) if course is None else (course.length, course.modulus, course.stop_time)
    if time_limit is None:
        time_limit = math.inf if course is None else course.longest_race(laps)
    last_time = time_limit - 0.5 * period  # times are sums of many ticks
    return np.array((timestep, *of_course, last_time), np.float64)


@kernel
def _layout(places: Any) -> StateLayout:
    k = _FIRST_OF_LAYOUT
    return StateLayout(
        places[k], (places[k + 1], places[k + 2]), (places[k + 3], places[k + 4]), (places[k + 5], places[k + 6]),
        (places[k + 7], places[k + 8]), (places[k + 9], places[k + 10]),
    )  # fmt: skip


@kernel
def read(table: Table, which: NDArray[np.bool_]) -> None:
    """Read the odometry of the cars `which` (r,), see `read_cars`."""
    places = whole_numbers(table[_PLACES])
    read_cars(
        which, places[_CARS_PER_WORLD], matrix(table[_STATES]), _layout(places), matrix(table[_SENSORS]),
        rows(table[_CARS], CAR), rows(table[_TIMERS], LAP_TIMER), rows(table[_ODOMETRY], ODOMETRY),
        matrix(table[_TELEMETRY]),
    )  # fmt: skip


@kernel
def sense(table: Table, which: NDArray[np.bool_]) -> None:
    """Read the odometry of the cars `which` (r,), and draw their scans, see `scan_cars`."""
    read(table, which)
    places = whole_numbers(table[_PLACES])
    scan_cars(
        which, places[_CARS_PER_WORLD], matrix(table[_STATES]), _layout(places),
        whole_matrix(table[_CAR_PLACES]),
        Mounts(matrix(table[_OFFSET_POSITIONS]), cube(table[_OFFSET_ROTATIONS])),
        matrix(table[_MOTIONS]), rows(table[_LINKS], LINK),
        SceneArrays(
            matrix(table[_BEAMS]), numbers(table[_LIMITS]), matrix(table[_EDGES]), corner_numbers(table[_TRIANGLES]),
            matrix(table[_BOXES]), short_matrix(table[_SPANS]), matrix(table[_PLANES]), short_matrix(table[_FRAMES]),
            matrix(table[_SHAPES]), matrix(table[_SPHERES]),
        ),
        Scratch(
            matrix(table[_CUTS]), short_numbers(table[_COLUMNS]), numbers(table[_NEAREST]), short_matrix(table[_VIEWS]),
            short_numbers(table[_BINS]), matrix(table[_POSES]),
        ),
        matrix(table[_RANGES]),
    )  # fmt: skip


@kernel
def _fields_of(n: Any) -> Fields:
    return Fields(
        n[0], n[1], n[2], n[3], n[4], n[5], n[6], n[7], n[8], n[9], n[10], n[11], n[12], n[13], n[14], n[15], n[16],
        n[17], n[18], n[19], n[20], n[21], n[22], n[23], n[24],
    )  # fmt: skip


@kernel
def _floor(table: Table) -> Floor:
    return Floor(
        matrix(table[_PATCHES]), matrix(table[_WHEELS]), cube(table[_FLOOR_MU]), short_numbers(table[_PAIRS])
    )  # fmt: skip


@kernel
def _step_world(model: int, data: int, world: int, address: int) -> None:
    """Do the steps of `span` in a world, see `step_world`; MuJoCo's batch calls it with the address of a table."""
    table = table_at(address, _ARRAYS)
    sizes, span = whole_numbers(table[_SIZES]), whole_numbers(table[_SPAN])
    step_world(
        model, data, world, span[_FIRST], span[_END], span[_ADVANCE] != 0,
        Sizes(sizes[0], sizes[1], sizes[2], sizes[3], sizes[4], sizes[5]),
        _fields_of(whole_numbers(table[_FIELDS])),
        Inertia(
            short_numbers(table[_ROW_COUNTS]), short_numbers(table[_ROW_STARTS]),
            short_numbers(table[_COLUMNS_OF_INERTIA]),
        ),
        rows(table[_GEARS], GEAR), whole_matrix(table[_CAR_PLACES]), rows(table[_CARS], CAR),
        rows(table[_TIRE_ROWS], TIRE), matrix(table[_MU]), _floor(table), matrix(table[_MOTIONS]),
        numbers(table[_TIMES])[_TIMESTEP], matrix(table[_SENSORS]), cube(table[_RECORDS]), cube(table[_TIRE_STATES]),
        numbers(table[_SCRATCH]),
        ClearGround(matrix(table[_DISTANCES]), numbers(table[_CORNER]), matrix(table[_BODIES])),
    )  # fmt: skip


_step_world_in_c = c_function(_step_world, "int64", "int64", "int32", "int64")


@kernel
def step(table: Table, count: int, first: int, end: int, advance: bool) -> None:
    """Do physics steps `first` up to `end` of a tick in the first `count` worlds of `ids`."""
    places, span = whole_numbers(table[_PLACES]), whole_numbers(table[_SPAN])
    span[_FIRST], span[_END], span[_ADVANCE] = first, end, advance
    apply_to_states(places[_BATCH], short_numbers(table[_IDS]), count, _step_world_in_c(), table.ctypes.data)


@kernel
def book(table: Table, count: int) -> None:
    """Read what a tick's steps recorded in the first `count` worlds of `ids`, see `book_cars`."""
    places = whole_numbers(table[_PLACES])
    book_cars(
        short_numbers(table[_IDS]), count, places[_CARS_PER_WORLD], matrix(table[_STATES]), _layout(places),
        rows(table[_CARS], CAR), whole_matrix(table[_CAR_PLACES]), whole_matrix(table[_TOUCH_PLACES]),
        rows(table[_TIRE_ROWS], TIRE), cube(table[_TIRE_STATES]), _floor(table), flags(table[_RUNNING]),
        cube(table[_RECORDS]), short_numbers(table[_STATUS]), flags(table[_FAILED]), matrix(table[_MU]),
        cube(table[_SLIP]), flags(table[_CRASHED]), matrix(table[_TOUCHED_AT]), matrix(table[_TELEMETRY]),
        rows(table[_STATISTICS], STATISTICS),
    )  # fmt: skip


@kernel
def drive(table: Table) -> None:
    """Hold the commands of the cars that race for a tick, and write what their tires and chassis did meanwhile.

    A world is stepped as long as any of its cars runs.
    """
    places, ids = whole_numbers(table[_PLACES]), short_numbers(table[_IDS])
    count = worlds_to_drive(flags(table[_RUNNING]), places[_CARS_PER_WORLD], ids)
    hold_commands(
        ids, count, places[_CARS_PER_WORLD], matrix(table[_STATES]), _layout(places), matrix(table[_COMMANDS]),
        rows(table[_CARS], CAR), matrix(table[_TELEMETRY]),
    )  # fmt: skip
    if count > 0:
        step(table, count, 0, cube(table[_RECORDS]).shape[1], True)
        book(table, count)


@kernel
def judge(table: Table) -> None:
    """Time the laps of the cars that race and end what is over, see `judge_cars`."""
    places, times = whole_numbers(table[_PLACES]), numbers(table[_TIMES])
    judge_cars(
        flags(table[_RUNNING]), whole_numbers(table[_REASONS]), places[_CARS_PER_WORLD], matrix(table[_STATES]),
        _layout(places), rows(table[_CARS], CAR), short_matrix(table[_WARNINGS]), flags(table[_CRASHED]),
        rows(table[_TIMERS], LAP_TIMER), matrix(table[_LAP_TIMES]), numbers(table[_STANDING_SINCE]),
        matrix(table[_TABLE]), times[_LENGTH], times[_MODULUS], times[_STOP_TIME], places[_LAPS], times[_LAST_TIME],
    )  # fmt: skip


@kernel
def _commands_are_numbers(table: Table) -> bool:
    """Return whether the commands of all cars that run are numbers."""
    running, commands = flags(table[_RUNNING]), matrix(table[_COMMANDS])
    for row in range(len(running)):
        if running[row] and not (math.isfinite(commands[row, 0]) and math.isfinite(commands[row, 1])):
            return False
    return True


@kernel
def _end_failed(table: Table) -> None:
    """End the races of the cars whose engine has failed."""
    running, failed, reasons = flags(table[_RUNNING]), flags(table[_FAILED]), whole_numbers(table[_REASONS])
    for row in range(len(running)):
        if running[row] and failed[row]:
            running[row], reasons[row] = False, _FAILED_REASON


@kernel
def _keep(table: Table, kept: Table) -> None:
    """Keep the tick that world 0 was driven for, in a table of KEPT with room for it; none: in one of empty arrays."""
    ticks = whole_numbers(kept[_TICKS])
    if len(ticks) == 0:
        return
    tick, state = ticks[0], matrix(table[_STATES])[0]
    first, end = _layout(whole_numbers(table[_PLACES])).ctrl
    telemetry, kept_telemetry = matrix(table[_TELEMETRY]), cube(kept[_KEPT_TELEMETRY])
    for row in range(kept_telemetry.shape[1]):
        kept_telemetry[tick, row] = telemetry[row]
    matrix(kept[_KEPT_STATES])[tick + 1], matrix(kept[_KEPT_CONTROLS])[tick] = state, state[first:end]
    ticks[0] = tick + 1


@kernel
def tick(table: Table, calls: NDArray[np.int64], limit: float, kept: Table) -> tuple[int, float]:
    """Sense, decide, drive and judge, for worlds of one car; return how it ended, and how long the decision took [s].

    Args:
      table: of the worlds.
      calls: that decide, see ControllerBatch.
      limit: of a decision [s].
      kept: a table of KEPT.
    """
    sense(table, flags(table[_RUNNING]))
    began = seconds()
    for place in range(len(calls)):
        call_at(calls[place, 0], calls[place, 1])
    took = seconds() - began
    if took > limit:
        return LATE, took
    if not _commands_are_numbers(table):
        return NO_NUMBERS, took
    drive(table)
    _end_failed(table)
    _keep(table, kept)
    judge(table)
    return DRIVEN, took
