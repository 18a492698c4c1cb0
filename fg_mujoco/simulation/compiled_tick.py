"""A tick and its parts as kernels of a table of all arrays of some worlds (array_table).

What the cars sense, how they are driven, and what becomes of it. Arrays have one row a car: the cars of world 0, then
those of world 1, and so on (r,). A state has one row a world (n,).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..compiled.array_table import (
    ArrayTable,
    Table,
    carray,
    cube,
    flags,
    matrix,
    numbers,
    pointer,
    rows,
    short_matrix,
    short_numbers,
    table_at,
    whole_matrix,
    whole_numbers,
)
from ..compiled.kernels import c_function, call_at, kernel
from ..course.course import Course
from ..course.lap_timer import LAP_TIMER
from ..course.moving_obstacles import obstacle_position
from ..lidar.in_kernels import mounted_pose, place_links, scan
from ..lidar.links import LINK
from ..lidar.visible_surfaces import SceneArrays, Scratch
from ..messages import ODOMETRY, FloatArray
from ..vehicle import mujoco_stages as stages
from ..vehicle.motion import CAR, read_motions, read_odometry
from ..vehicle.motion import drive as drive_car
from ..vehicle.mujoco_stages import Fields
from ..vehicle.tire_forces import step_on_contacts, step_on_tires
from ..vehicle.tire_rows import GEAR, TIRE, USERDATA
from ..vehicle.tire_slip import measure_slip
from ..vehicle.tire_solve import Inertia
from .clear_ground import ClearGround, touches_nothing
from .clock import seconds
from .physics import BAD_STATE, STATE, Batch, StateLayout, apply_to_states
from .telemetry import COMMAND, GREATEST_COMMAND, STATISTICS, add_row, begin_row, end_motion, end_row
from .termination import END_REASONS, judge_cars
from .world_step import (
    AXLES,
    CHASSIS_CONTACT,
    FIRST_TIRE,
    LEVEL,
    MOUNT,
    TIRES,
    TREE,
    Floor,
    Sizes,
    friction_under,
    place_obstacles,
)

Mask = NDArray[np.bool_]
Rows = NDArray[np.void]
Places = NDArray[np.int64]
Addresses = NDArray[np.int64]

APART = 0.5
"""[s] Time without touching each other after which two cars touch anew."""

NAMES = (
    "places", "running", "states", "sensors", "cars", "timers", "odometry", "telemetry", "offset_positions",
    "offset_rotations", "motions", *SceneArrays._fields, *Scratch._fields, "ranges", "commands", "times", "records",
    "ids", "status", "failed", "mu", "slip", "crashed", "statistics", "reasons", "warnings", "lap_times",
    "standing_since", "table", "tires", "tire_states",
    "patches", "wheels", "floor_mu", "pairs", "car_places", "links", "touch_places", "touched_at", "sizes", "span",
    "fields", "row_counts", "row_starts", "inertia_columns", "gears", "scratch",
    "distances", "corner", "bodies", "state_numbers", "alone", "copies",
)  # fmt: skip
"""Of the arrays in a table, in the order of its rows.

Of the cars: `cars` (r,) of CAR, `timers` (r,) of LAP_TIMER, `odometry` (r,) of ODOMETRY, `telemetry`
(r, len(TELEMETRY)), `statistics` (r,) of STATISTICS, `ranges` (r, beams) [m], `mu` (r, 4) of the tires, `touched_at`
(r, m) when a car last touched each other of its world [s], and (r,) `running`, `failed` and `crashed`. Of a world of m
cars: `car_places` (m, 7) see LEVEL, `touch_places` (m, m) where in the sensors two cars' touching is, `tires` (k,) of
TIRE, `links` of LINK, `motions` (obstacles, 8) of `motion_table`, and how the LiDARs are fixed to the cars,
`offset_positions` (m, 3) [m] and `offset_rotations` (m, 3, 3). Of the steps of a tick: `records` (n, steps,
nsensordata) as of a Batch, `tire_states` (n, steps, k USERDATA), and `slip` (QUANTITIES, steps, 4), room in which that
of the last car is left. `alone` (2,) and `copies` (k, 4) are those of CarsAlone; empty: there is none.
"""

(
    _PLACES, _RUNNING, _STATES, _SENSORS, _CARS, _TIMERS, _ODOMETRY, _TELEMETRY, _OFFSET_POSITIONS, _OFFSET_ROTATIONS,
    _MOTIONS, _BEAMS, _LIMITS, _EDGES, _TRIANGLES, _BOXES, _SPANS, _PLANES, _FRAMES, _SHAPES, _SPHERES, _CUTS,
    _COLUMNS, _NEAREST, _VIEWS, _BINS, _POSES, _RANGES, _COMMANDS, _TIMES, _RECORDS, _IDS, _STATUS,
    _FAILED, _MU, _SLIP, _CRASHED, _STATISTICS, _REASONS, _WARNINGS, _LAP_TIMES, _STANDING_SINCE, _TABLE, _TIRE_ROWS,
    _TIRE_STATES, _PATCHES, _WHEELS, _FLOOR_MU, _PAIRS, _CAR_PLACES, _LINKS, _TOUCH_PLACES, _TOUCHED_AT, _SIZES, _SPAN,
    _FIELDS, _ROW_COUNTS, _ROW_STARTS, _COLUMNS_OF_INERTIA, _GEARS, _SCRATCH,
    _DISTANCES, _CORNER, _BODIES, _STATE_NUMBERS, _ALONE, _COPIES,
) = range(len(NAMES))  # fmt: skip

ARRAYS = len(NAMES)

KEPT = ("ticks", "telemetry", "states", "controls")
"""Of the arrays in a table that whole ticks of world 0 are kept in: how many are, (1,), and for each the telemetry of
all cars, the state after it, and the controls; in the row before the first state is that before it."""

NOTHING_KEPT = ArrayTable(KEPT, {}).rows

DRIVEN, LATE, NO_NUMBERS = range(3)
"""Ends of a whole tick: driven, or not: after a decision over its limit, or because the command of a car is no number.
"""

_TURNS = 64  # at most, in which worlds do their ticks: each looks through all worlds for those that run

_TICKS, _KEPT_TELEMETRY, _KEPT_STATES, _KEPT_CONTROLS = range(len(KEPT))
_STATE, _FIRST_BAD, _BEHIND_BAD = int(STATE), BAD_STATE.start, BAD_STATE.stop  # in kernels, numbers
_FAILED_REASON = END_REASONS.index("failed")

_CARS_PER_WORLD, _BATCH, _LAPS, _FIRST_STATE, _STEP, _FIRST_OF_LAYOUT = range(6)
_FIRST, _END, _ADVANCE, _COUNT = range(4)
_TIMESTEP, _LENGTH, _MODULUS, _STOP_TIME, _LAST_TIME = range(5)


def whole_places(cars_per_world: int, batch: Batch, laps: int, layout: StateLayout) -> NDArray[np.int64]:
    """Return the array `places` of a table."""
    spans = (*layout.qpos, *layout.qvel, *layout.ctrl, *layout.mocap_pos, *layout.userdata)
    code = step.address(0)  # type: ignore[attr-defined]
    return np.array((cars_per_world, batch.address, laps, batch.first, code, layout.time, *spans), np.int64)


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
def layout_of(places: Any) -> StateLayout:
    """Return where the parts of a state are, of the array `places` of a table."""
    k = _FIRST_OF_LAYOUT
    return StateLayout(
        places[k], (places[k + 1], places[k + 2]), (places[k + 3], places[k + 4]), (places[k + 5], places[k + 6]),
        (places[k + 7], places[k + 8]), (places[k + 9], places[k + 10]),
    )  # fmt: skip


@kernel
def read(table: Table, which: Mask) -> None:
    """Write the odometry of the cars `which` (r,), and the first columns of their rows of telemetry."""
    places, states, telemetry = whole_numbers(table[_PLACES]), matrix(table[_STATES]), matrix(table[_TELEMETRY])
    cars, timers, odometry = rows(table[_CARS], CAR), rows(table[_TIMERS], LAP_TIMER), rows(table[_ODOMETRY], ODOMETRY)
    layout, sensors = layout_of(places), matrix(table[_SENSORS])
    for row in range(len(which)):
        if which[row]:
            world = row // places[_CARS_PER_WORLD]
            state = states[world]
            time, car = state[layout.time], cars[row : row + 1]
            qpos, qvel = state[layout.qpos[0] : layout.qpos[1]], state[layout.qvel[0] : layout.qvel[1]]
            read_odometry(time, qpos, qvel, sensors[world], car, odometry[row : row + 1])
            begin_row(time, qpos, qvel, car, timers, row, telemetry[row])


@kernel
def sense(table: Table, which: Mask) -> None:
    """Read the odometry of the cars `which` (r,), and write what their LiDARs measure, where scans are drawn."""
    read(table, which)
    if len(matrix(table[_BEAMS])) == 0:
        return
    places, states, ranges = whole_numbers(table[_PLACES]), matrix(table[_STATES]), matrix(table[_RANGES])
    cars_per_world, layout, car_places = places[_CARS_PER_WORLD], layout_of(places), whole_matrix(table[_CAR_PLACES])
    offset_positions, offset_rotations = matrix(table[_OFFSET_POSITIONS]), cube(table[_OFFSET_ROTATIONS])
    motions, links = matrix(table[_MOTIONS]), rows(table[_LINKS], LINK)
    scene, scratch = table[_BEAMS].ctypes.data, table[_CUTS].ctypes.data
    position, rotation = np.empty(3), np.empty((3, 3))
    bodies = table[_FRAMES, 1] - 1
    moving, turned, poses = np.empty((bodies, 3)), np.empty((bodies, 3, 3)), np.empty((len(links), 7))
    for k in range(len(motions)):
        moving[k, 2] = 0.0
        for i in range(3):
            for j in range(3):
                turned[k, i, j] = 1.0 if i == j else 0.0
    placed = -1
    for row in range(len(which)):
        if which[row]:
            world = row // cars_per_world
            car, state = row - world * cars_per_world, states[world]
            if world != placed:
                for k in range(len(motions)):
                    moving[k, 0], moving[k, 1] = obstacle_position(motions[k], state[layout.time])
                if len(links) > 0:
                    qpos = state[layout.qpos[0] : layout.qpos[1]]
                    linked, linked_turned = moving[len(motions) :], turned[len(motions) :]
                    place_links(
                        qpos.ctypes.data, len(qpos), links.ctypes.data, len(links), poses.ctypes.data,
                        linked.ctypes.data, linked_turned.ctypes.data, len(linked),
                    )  # fmt: skip
                placed = world
            first = layout.qpos[0] + car_places[car, MOUNT]
            offset_position, offset_rotation = offset_positions[car], offset_rotations[car]
            pose = state[first : first + 7]
            mounted_pose(
                pose.ctypes.data, int(car_places[car, LEVEL]), offset_position.ctypes.data, offset_rotation.ctypes.data,
                position.ctypes.data, rotation.ctypes.data,
            )  # fmt: skip
            scan(
                scene, scratch, position.ctypes.data, rotation.ctypes.data, moving.ctypes.data, turned.ctypes.data,
                ranges[row].ctypes.data, int(car_places[car, TREE]),
            )  # fmt: skip


@kernel
def _fields_of(n: Any) -> Fields:
    return Fields(
        n[0], n[1], n[2], n[3], n[4], n[5], n[6], n[7], n[8], n[9], n[10], n[11], n[12], n[13], n[14], n[15], n[16],
        n[17], n[18], n[19], n[20], n[21], n[22], n[23], n[24], n[25], n[26], n[27], n[28], n[29],
    )  # fmt: skip


@kernel
def _floor(table: Table) -> Floor:
    return Floor(
        matrix(table[_PATCHES]), matrix(table[_WHEELS]), cube(table[_FLOOR_MU]), short_numbers(table[_PAIRS])
    )  # fmt: skip


@kernel
def _step_world(model: int, data: int, world: int, address: int) -> None:
    """Do the physics steps of `span` in a world, of addresses that MuJoCo's batch hands on; or only work out forces."""
    table = table_at(address, ARRAYS)
    _do_steps(model, data, world - whole_numbers(table[_PLACES])[_FIRST_STATE], table, False)


@kernel
def _do_steps(model: int, data: int, world: int, table: Table, alone: bool) -> int:
    """Do the physics steps of `span`; return where they ended: `alone` where a car may touch something."""
    n, span = whole_numbers(table[_SIZES]), whole_numbers(table[_SPAN])
    sizes, found = Sizes(n[0], n[1], n[2], n[3], n[4], n[5]), _fields_of(whole_numbers(table[_FIELDS]))
    inertia = Inertia(
        short_numbers(table[_ROW_COUNTS]), short_numbers(table[_ROW_STARTS]), short_numbers(table[_COLUMNS_OF_INERTIA])
    )  # fmt: skip
    gears, car_places, cars = rows(table[_GEARS], GEAR), whole_matrix(table[_CAR_PLACES]), rows(table[_CARS], CAR)
    tires, mu, floor = rows(table[_TIRE_ROWS], TIRE), matrix(table[_MU]), _floor(table)
    motions, timestep, scratch = matrix(table[_MOTIONS]), numbers(table[_TIMES])[_TIMESTEP], numbers(table[_SCRATCH])
    ground = ClearGround(matrix(table[_DISTANCES]), numbers(table[_CORNER]), matrix(table[_BODIES]))
    sensors, records, tire_states = matrix(table[_SENSORS]), cube(table[_RECORDS]), cube(table[_TIRE_STATES])
    userdata = stages.vector(data, found.userdata, sizes.userdata)
    readings = stages.vector(data, found.sensordata, sizes.readings)
    for step in range(span[_FIRST], span[_END]):
        place_obstacles(data, found, motions)
        under = friction_under(model, data, found, world, step, sizes, car_places, cars, mu, floor)
        if not sizes.own_tires:
            step_on_contacts(model, data, found, gears, sizes.dofs)
        else:
            own = cars[world * len(car_places) : (world + 1) * len(car_places)]
            clear = touches_nothing(stages.vector(data, found.qpos, sizes.positions), own, ground)
            if alone and not clear:
                return step
            step_on_tires(
                model, data, found, inertia, gears, tires, under, userdata, scratch, sizes.dofs, timestep,
                span[_ADVANCE] != 0, clear, step == span[_END] - 1,
            )  # fmt: skip
        for k in range(sizes.readings):
            sensors[world, k] = records[world, step, k] = readings[k]
        for k in range(sizes.userdata):
            tire_states[world, step, k] = userdata[k]
    place_obstacles(data, found, motions)
    return int(span[_END])


@kernel
def _array_at(address: int, count: int) -> Any:
    return carray(pointer(address), (count,), np.float64)


@kernel
def _has_warned(data: int, found: Fields) -> bool:
    """Return whether MuJoCo has met a bad state in a mujoco.MjData since it was reset."""
    warned = False
    for kind in range(_FIRST_BAD, _BEHIND_BAD):
        warned = warned or stages.whole_number_at(data + found.warnings + 8 * kind + 4)[0] > 0
    return warned


@kernel
def _step_alone(table: Table, world: int) -> int:
    """Do the steps of `span` in CarsAlone while the cars touch nothing, none in a bad state; return as `_do_steps`."""
    alone, copies, places = whole_numbers(table[_ALONE]), whole_matrix(table[_COPIES]), whole_numbers(table[_PLACES])
    model, data, found = alone[0], alone[1], _fields_of(whole_numbers(table[_FIELDS]))
    first, state = whole_numbers(table[_SPAN])[_FIRST], matrix(table[_STATES])[world]
    (first_qpos, end_qpos), cars_per_world = layout_of(places).qpos, places[_CARS_PER_WORLD]
    ground = ClearGround(matrix(table[_DISTANCES]), numbers(table[_CORNER]), matrix(table[_BODIES]))
    cars = rows(table[_CARS], CAR)[world * cars_per_world : (world + 1) * cars_per_world]
    if not touches_nothing(state[first_qpos:end_qpos], cars, ground):
        return int(first)
    for k in range(len(copies)):
        to, of, count, apart = copies[k]
        _array_at(to, count)[:] = _array_at(of + world * apart, count)
    stages.set_state(model, data, state.ctypes.data, _STATE)
    end = _do_steps(model, data, world, table, True)
    if _has_warned(data, found):
        stages.reset(model, data)
        return int(first)
    stages.get_state(model, data, state.ctypes.data, _STATE)
    return end


_step_world_in_c = c_function(_step_world, "int64", "int64", "int32", "int64")


@kernel
def step(address: int) -> None:
    """Do the physics steps of `span` in the worlds of the table at an address; `drive` calls this by its code."""
    table = table_at(address, ARRAYS)
    places, span = whole_numbers(table[_PLACES]), whole_numbers(table[_SPAN])
    count, first, end, advance = span[_COUNT], span[_FIRST], span[_END], span[_ADVANCE] != 0
    ids, states = short_numbers(table[_IDS]), short_numbers(table[_STATE_NUMBERS])
    step_world, alone = _step_world_in_c(), advance and len(whole_numbers(table[_ALONE])) > 0
    if not alone:
        for place in range(count):
            states[place] = ids[place] + places[_FIRST_STATE]
    for place in range(count if alone else 1):
        together = count
        if alone:
            span[_FIRST], states[0], together = first, ids[place] + places[_FIRST_STATE], 1
            span[_FIRST] = _step_alone(table, np.int64(ids[place]))  # type: ignore[arg-type]  # compiled for these only
        if span[_FIRST] < end:
            apply_to_states(places[_BATCH], states, together, step_world, address)


@kernel
def begin_steps(table: Table, count: int, first: int, end: int, advance: bool) -> None:
    """Let `step` do steps `first` up to `end` of a tick in the first `count` worlds of `ids`."""
    span = whole_numbers(table[_SPAN])
    span[_FIRST], span[_END], span[_ADVANCE], span[_COUNT] = first, end, advance, count


@kernel
def book(table: Table, count: int) -> None:
    """Note failures, touches, telemetry and statistics of a tick's steps in the first `count` worlds of `ids`."""
    places, ids, states = whole_numbers(table[_PLACES]), short_numbers(table[_IDS]), matrix(table[_STATES])
    cars_per_world, layout, cars = places[_CARS_PER_WORLD], layout_of(places), rows(table[_CARS], CAR)
    car_places, touch_places = whole_matrix(table[_CAR_PLACES]), whole_matrix(table[_TOUCH_PLACES])
    tires, tire_states = rows(table[_TIRE_ROWS], TIRE), cube(table[_TIRE_STATES])
    floor, mu, slip = _floor(table), matrix(table[_MU]), cube(table[_SLIP])
    records, status, running = cube(table[_RECORDS]), short_numbers(table[_STATUS]), flags(table[_RUNNING])
    failed, crashed, touched_at = flags(table[_FAILED]), flags(table[_CRASHED]), matrix(table[_TOUCHED_AT])
    telemetry, statistics = matrix(table[_TELEMETRY]), rows(table[_STATISTICS], STATISTICS)
    for place in range(count):
        world = ids[place]
        state = states[world]
        time = state[layout.time]
        qpos, qvel = state[layout.qpos[0] : layout.qpos[1]], state[layout.qvel[0] : layout.qvel[1]]
        for row in range(world * cars_per_world, (world + 1) * cars_per_world):
            end_motion(time, qpos, qvel, cars[row : row + 1], telemetry[row])
            failed[row] = failed[row] or status[world] != 0
            car = row - world * cars_per_world
            own, first = car_places[car], car_places[car, FIRST_TIRE]
            races = running[row] or cars_per_world == 1
            if cars_per_world == 1:
                crashed[row] = crashed[row] or any_touch(records[world], own[CHASSIS_CONTACT])
            else:
                touched_wall = book_touches(
                    records[world], car, own[CHASSIS_CONTACT], touch_places[car], time, touched_at[row], statistics, row
                )
                crashed[row] = crashed[row] or (touched_wall and races)
            own_tires = tires[max(first, 0) : first + 4] if first >= 0 else tires[:0]
            mus = np.ascontiguousarray(floor.mu[:, row]) if len(floor.patches) > 0 else mu[row : row + 1]
            measure_slip(
                records[world], own[TIRES], own[AXLES], mus, own_tires, tire_states[world], max(USERDATA * first, 0),
                slip,
            )  # fmt: skip
            end_row(telemetry[row], slip)
            if races:
                add_row(statistics, row, telemetry[row], slip)


@kernel
def book_touches(
    records: FloatArray,
    car: int,
    chassis_contact: int,
    touch_places: Places,
    time: float,
    touched_at: FloatArray,
    statistics: Rows,
    row: int,
) -> bool:
    """Note which other cars a car touched in a tick; return whether its chassis touched anything else.

    Args:
      records: (steps, nsensordata) of the tick.
      touch_places: (cars,) where those with each other car are.
      touched_at: (cars,) when it last touched each of them [s], -inf: not yet; `time` [s] is written to it.
      statistics: (r,) of STATISTICS, written to.
    """
    for other in range(len(touch_places)):
        if other != car and any_touch(records, touch_places[other]):
            if time - touched_at[other] > APART:
                statistics[row].touches += 1
            touched_at[other] = time
    for step in range(len(records)):
        count = records[step, chassis_contact]
        for other in range(len(touch_places)):
            if other != car:
                count -= records[step, touch_places[other]]
        if count > 0.0:
            return True
    return False


@kernel
def any_touch(records: FloatArray, sensor: int) -> bool:
    """Return whether a contact sensor found anything in any of the rows of `records` (steps, nsensordata)."""
    touched = False
    for step in range(len(records)):
        touched = touched or records[step, sensor] > 0.0
    return touched


@kernel
def hold(table: Table, count: int) -> None:
    """Write the commands of all cars of the first `count` worlds of `ids` to their actuators, and to the telemetry."""
    places, ids, states = whole_numbers(table[_PLACES]), short_numbers(table[_IDS]), matrix(table[_STATES])
    cars_per_world, layout, cars = places[_CARS_PER_WORLD], layout_of(places), rows(table[_CARS], CAR)
    commands, telemetry = matrix(table[_COMMANDS]), matrix(table[_TELEMETRY])
    for place in range(count):
        world = ids[place]
        ctrl = states[world, layout.ctrl[0] : layout.ctrl[1]]
        for row in range(world * cars_per_world, (world + 1) * cars_per_world):
            drive_car(commands[row, 0], commands[row, 1], cars[row : row + 1], ctrl)
            for part in range(2):
                telemetry[row, COMMAND + part] = min(max(commands[row, part], -GREATEST_COMMAND), GREATEST_COMMAND)


@kernel
def worlds_to_drive(running: Mask, cars_per_world: int, ids: NDArray[np.int32]) -> int:
    """Write the numbers of the worlds in which any car runs into `ids` (n,), and return how many there are."""
    count = 0
    for world in range(len(running) // cars_per_world):
        runs = False
        for row in range(world * cars_per_world, (world + 1) * cars_per_world):
            runs = runs or running[row]
        if runs:
            ids[count] = world
            count += 1
    return count


@kernel
def drive(table: Table) -> None:
    """Hold the commands for a tick in worlds where any car races, and write what tires and chassis did meanwhile."""
    running, ids = flags(table[_RUNNING]), short_numbers(table[_IDS])
    count = worlds_to_drive(running, whole_numbers(table[_PLACES])[_CARS_PER_WORLD], ids)
    hold(table, count)
    if count > 0:
        begin_steps(table, count, 0, cube(table[_RECORDS]).shape[1], True)
        call_at(whole_numbers(table[_PLACES])[_STEP], table.ctypes.data)
        book(table, count)


@kernel
def judge(table: Table) -> None:
    """Time the laps of the cars that race and end what is over, see `judge_cars`; without a course there are none."""
    if table[_TABLE, 1] == 0:
        return
    places, times = whole_numbers(table[_PLACES]), numbers(table[_TIMES])
    judge_cars(
        flags(table[_RUNNING]), whole_numbers(table[_REASONS]), places[_CARS_PER_WORLD], matrix(table[_STATES]),
        layout_of(places), rows(table[_CARS], CAR), short_matrix(table[_WARNINGS]), flags(table[_CRASHED]),
        rows(table[_TIMERS], LAP_TIMER), matrix(table[_LAP_TIMES]), numbers(table[_STANDING_SINCE]),
        matrix(table[_TABLE]), times[_LENGTH], times[_MODULUS], times[_STOP_TIME], places[_LAPS], times[_LAST_TIME],
    )  # fmt: skip


@kernel
def cars_of(table: Table) -> int:
    """Return how many cars the worlds of a table have."""
    return int(table[_RUNNING, 1])


@kernel
def read_all(tables: Addresses, firsts: Places, which: Mask) -> None:
    """Do `read` for each of the tables at some addresses; `firsts` are the first rows of their cars in `which`."""
    for k in range(len(tables)):
        table = table_at(tables[k], ARRAYS)
        read(table, which[firsts[k] : firsts[k] + table[_RUNNING, 1]])


@kernel
def sense_all(tables: Addresses, firsts: Places, which: Mask) -> None:
    """Do `sense` for each of several tables, as `read_all`."""
    for k in range(len(tables)):
        table = table_at(tables[k], ARRAYS)
        sense(table, which[firsts[k] : firsts[k] + table[_RUNNING, 1]])


@kernel
def read_times(tables: Addresses, firsts: Places, times: FloatArray) -> None:
    """Write the time of each world (n,) of several tables; `firsts` as in `read_all`."""
    for k in range(len(tables)):
        table = table_at(tables[k], ARRAYS)
        places, states = whole_numbers(table[_PLACES]), matrix(table[_STATES])
        first = firsts[k] // places[_CARS_PER_WORLD]
        for world in range(len(states)):
            times[first + world] = states[world, layout_of(places).time]


@kernel
def read_motions_all(tables: Addresses, firsts: Places, which: Mask, poses: FloatArray, velocities: FloatArray) -> None:
    """Do `motion.read_motions` for each of several tables, as `read_all`; all arrays have the rows of `which`."""
    for k in range(len(tables)):
        table = table_at(tables[k], ARRAYS)
        places, first, end = whole_numbers(table[_PLACES]), firsts[k], firsts[k] + cars_of(table)
        layout = layout_of(places)
        read_motions(
            which[first:end], places[_CARS_PER_WORLD], matrix(table[_STATES]), layout.qpos[0], layout.qvel[0],
            rows(table[_CARS], CAR), poses[first:end], velocities[first:end],
        )  # fmt: skip


@kernel
def drive_all(tables: Addresses) -> None:
    """Do `drive` for each of several tables."""
    for k in range(len(tables)):
        drive(table_at(tables[k], ARRAYS))


@kernel
def judge_all(tables: Addresses) -> None:
    """Do `judge` for each of several tables."""
    for k in range(len(tables)):
        judge(table_at(tables[k], ARRAYS))


@kernel
def not_finite(running: Mask, commands: FloatArray) -> Mask:
    """Return whether each running car got a command that is no number. Shape (r,)."""
    bad = np.zeros(len(running), np.bool_)
    for row in range(len(running)):
        bad[row] = running[row] and not (math.isfinite(commands[row, 0]) and math.isfinite(commands[row, 1]))
    return bad


@kernel
def end_failed(table: Table) -> None:
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
    first, end = layout_of(whole_numbers(table[_PLACES])).ctrl
    telemetry, kept_telemetry = matrix(table[_TELEMETRY]), cube(kept[_KEPT_TELEMETRY])
    for row in range(kept_telemetry.shape[1]):
        kept_telemetry[tick, row] = telemetry[row]
    matrix(kept[_KEPT_STATES])[tick + 1], matrix(kept[_KEPT_CONTROLS])[tick] = state, state[first:end]
    ticks[0] = tick + 1


@kernel
def _tick(
    table: Table, calls: NDArray[np.int64], limit: float, kept: Table, took: FloatArray, waiting: Mask, goes_on: bool
) -> int:  # fmt: skip
    """Sense, decide, drive, judge; return how it ended. `goes_on`: who has no number waits; else nobody is driven."""
    running, commands, how = flags(table[_RUNNING]), matrix(table[_COMMANDS]), DRIVEN
    sense(table, running)
    began = seconds()
    took[0] = -began
    for place in range(len(calls)):
        call_at(calls[place, 0], calls[place, 1])
    took[0] = seconds() - began
    if took[0] > limit:
        return LATE
    for row in range(len(running)):
        if running[row] and not (math.isfinite(commands[row, 0]) and math.isfinite(commands[row, 1])):
            running[row], waiting[row], how = not goes_on, goes_on, NO_NUMBERS
    if how != DRIVEN and not goes_on:
        return how
    drive(table)
    end_failed(table)
    if how == DRIVEN:
        _keep(table, kept)
    judge(table)
    return how


@kernel
def ticks(
    table: Table, calls: NDArray[np.int64], limit: float, kept: Table, took: FloatArray, waiting: Mask
) -> tuple[int, int]:  # fmt: skip
    """Do several ticks of worlds of one car; return how the worst of them ended, and how many the last world did.

    A world does all its ticks before the next one, so that what it remembers stays near the processor. A car whose
    command is no number is not driven, and does none of the ticks that follow. A single tick all worlds do together,
    and none is driven then.

    Args:
      limit: of a decision [s].
      kept: a table of KEPT; for more than a tick, of one world.
      took: (k,) [s] of each decision of the last world, written to; of one that raises, less the time of its beginning.
      waiting: (r,) False; where a decision raises, the cars that run and are not marked as running are left there.
    """
    running, how, count, several = flags(table[_RUNNING]), DRIVEN, 0, len(took) > 1
    together = max(len(running) // _TURNS, 1) if several else len(running)
    for row in range(len(running)):
        waiting[row], running[row] = running[row], False
    for first in range(0, len(running), together):
        end = min(first + together, len(running))
        for row in range(first, end):
            running[row], waiting[row] = waiting[row], False
        count = 0
        while count < len(took) and how != LATE and running[first:end].any():
            how = max(how, _tick(table, calls, limit, kept, took[count : count + 1], waiting, several))
            count += 1
        for row in range(first, end):
            waiting[row], running[row] = running[row] or waiting[row], False
    for row in range(len(running)):
        running[row], waiting[row] = waiting[row], False
    return how, count
