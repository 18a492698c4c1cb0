"""The table of all arrays of some worlds, of which the native core makes a tick and its parts.

What the cars sense, how they are driven, and what becomes of it: native/simulation/compiled_tick.cpp. Arrays have one
row a car: the cars of world 0, then those of world 1, and so on (r,). A state has one row a world (n,).

A world whose cars all stand on MuJoCo's contacts is stepped by mj_step. Where any car has tires of ours, MuJoCo's
stages are called one after the other, and the tires' forces are put in between (vehicle/tire_forces.py).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..course.course import Course
from ..lidar.visible_surfaces import SceneArrays, Scratch
from ..messages import FloatArray
from ..native_arrays import ArrayTable
from .physics import Batch, StateLayout

NAMES = (
    "places", "running", "states", "sensors", "cars", "timers", "odometry", "telemetry", "offset_positions",
    "offset_rotations", "motions", *SceneArrays._fields, *Scratch._fields, "ranges", "optics", "commands", "times",
    "records", "ids", "status", "failed", "mu", "slip", "crashed", "statistics", "reasons", "warnings", "lap_times",
    "standing_since", "table", "tires", "tire_states",
    "patches", "wheels", "floor_mu", "pairs", "car_places", "links", "touch_places", "touched_at", "sizes", "span",
    "row_counts", "row_starts", "inertia_columns", "gears", "scratch",
    "distances", "corner", "bodies", "state_numbers", "alone", "copies", "pieces",
)  # fmt: skip
"""Of the arrays in a table, in the order of its rows.

Of the cars: `cars` (r,) of CAR, `timers` (r,) of LAP_TIMER, `odometry` (r,) of ODOMETRY, `telemetry` (r,
len(TELEMETRY)), `statistics` (r,) of STATISTICS, `ranges` (r, beams) [m], `optics` (r, 2) of their LiDARs, `mu` (r, 4)
of the tires, `touched_at` (r, m) when a car last touched each other of its world [s], and (r,) `running`, `failed` and
`crashed`. Of a world of m cars: `car_places` (m, 7) see LEVEL, `touch_places` (m, m) where in the sensors two cars'
touching is, `tires` (k,) of TIRE, `links` of LINK, `motions` (obstacles, 8) of `motion_table`, and how the LiDARs are
fixed to the cars, `offset_positions` (m, 3) [m] and `offset_rotations` (m, 3, 3). Of the steps of a tick: `records` (n,
steps, nsensordata) as of a Batch, `tire_states` (n, steps, k USERDATA), and `slip` (QUANTITIES, steps, 4), room in
which that of the last car is left. `alone` (2,) and `copies` (k, 4) are those of CarsAlone; empty: there is none.
`pieces` (k, 5) is `pieces.piece_table`.
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


TIRES, AXLES, CHASSIS_CONTACT, FIRST_TIRE, MOUNT, TREE, LEVEL = range(7)
"""Columns of `car_places`, one row for each car of a world: where in its sensors the tires' readings begin, those of
the axles (-1: none) and the chassis' contact; its first row among the tires with a law of ours (-1: it has none); where
in qpos the pose of the body that its LiDAR is fixed to is; the tree of its bodies, as in SceneArrays (-1: none); and
whether its LiDAR stays level (1)."""


SCRATCH = 1536
"""Numbers that the short steps of the tires of a car need room for, see native/vehicle/tire_solve.hpp."""


class Inertia(NamedTuple):
    """Which entries MuJoCo keeps of its inertia matrices: of a model, and the same for all its data."""

    row_counts: NDArray[np.int32]
    row_starts: NDArray[np.int32]
    columns: NDArray[np.int32]

    @classmethod
    def of(cls, model: mujoco.MjModel) -> Inertia:
        """Return that of a model."""
        return cls(model.M_rownnz.copy(), model.M_rowadr.copy(), model.M_colind.copy())


class Floor(NamedTuple):
    """The patches of the worlds, and what the tires have on them; all empty where there are none."""

    patches: FloatArray  # (k, 7) of `patch_table`
    wheels: FloatArray  # (4 cars_per_world, 2) of `wheel_positions`
    mu: FloatArray  # (steps, r, 4) room: what each tire had in each step of a tick
    pairs: NDArray[np.int32]  # (4 cars_per_world,) of the tires


class Sizes(NamedTuple):
    """Sizes of a world's model, and of its steps."""

    positions: int
    dofs: int
    readings: int
    userdata: int
    pairs: int
    own_tires: int  # whether any car has tires with a law of ours
