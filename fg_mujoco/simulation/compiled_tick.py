"""The table of all arrays of some worlds, of which the native core makes a tick and its parts.

What the cars sense, how they are driven, and what becomes of it: native/simulation/compiled_tick.cpp. Arrays have one
row a car: the cars of world 0, then those of world 1, and so on (r,). A state has one row a world (n,).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..array_table import ArrayTable
from ..course.course import Course
from ..lidar.visible_surfaces import SceneArrays, Scratch
from .physics import Batch, StateLayout

NAMES = (
    "places", "running", "states", "sensors", "cars", "timers", "odometry", "telemetry", "offset_positions",
    "offset_rotations", "motions", *SceneArrays._fields, *Scratch._fields, "ranges", "commands", "times", "records",
    "ids", "status", "failed", "mu", "slip", "crashed", "statistics", "reasons", "warnings", "lap_times",
    "standing_since", "table", "tires", "tire_states",
    "patches", "wheels", "floor_mu", "pairs", "car_places", "links", "touch_places", "touched_at", "sizes", "span",
    "row_counts", "row_starts", "inertia_columns", "gears", "scratch",
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

KEPT = ("ticks", "telemetry", "states", "controls")
"""Of the arrays in a table that whole ticks of world 0 are kept in: how many are, (1,), and for each the telemetry of
all cars, the state after it, and the controls; in the row before the first state is that before it."""

NOTHING_KEPT = ArrayTable(KEPT, {})

DRIVEN, LATE, NO_NUMBERS = range(3)
"""Ends of a whole tick: driven, or not: after a decision over its limit, or because the command of a car is no number.
"""


def whole_places(cars_per_world: int, batch: Batch, laps: int, layout: StateLayout) -> NDArray[np.int64]:
    """Return the array `places` of a table."""
    spans = (*layout.qpos, *layout.qvel, *layout.ctrl, *layout.mocap_pos, *layout.userdata)
    return np.array((cars_per_world, batch.address, laps, batch.first, layout.time, *spans), np.int64)


def course_numbers(
    timestep: float, course: Course | None, laps: int, time_limit: float | None, period: float
) -> NDArray[np.float64]:
    """Return the array `times` of a table; `time_limit` None is that of the course."""
    of_course = (1.0, 1.0, 0.0) if course is None else (course.length, course.modulus, course.stop_time)
    if time_limit is None:
        time_limit = math.inf if course is None else course.longest_race(laps)
    last_time = time_limit - 0.5 * period  # times are sums of many ticks
    return np.array((timestep, *of_course, last_time), np.float64)
