"""A step of an environment as kernels of a table of arrays: actions in, rewards and observations out.

The rows of the episodes are those of the cars that learn: every `stride`-th row of the engine's arrays.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..compiled.array_table import (
    Table,
    cube,
    flags,
    matrix,
    numbers,
    rows,
    single_numbers,
    table_at,
    whole_numbers,
)
from ..compiled.kernels import kernel
from ..course.lap_timer import LAP_TIMER
from ..messages import FloatArray
from ..simulation.compiled_tick import ARRAYS, Addresses, cars_of, drive, end_failed, judge, sense_all
from ..simulation.telemetry import TELEMETRY
from ..simulation.termination import END_REASONS
from .contacts import take_contacts
from .reward_kernels import read_actions, read_sensors, reward_ticks

Mask = NDArray[np.bool_]
Values = NDArray[np.float32]

NAMES = (
    "running", "timers", "crashed", "reasons", "telemetry", "held", "odometry", "ranges",
    "driven", "commands", "clipped", "limits", "planned", "targets", "previous",
    "progress", "wrecked", "impacts", "before", "sliding", "weights", "rewards", "terms",
    "contacts", "touched_at", "began", "beams", "columns", "low", "high", "numbers",
)  # fmt: skip
"""Of the arrays in a table. The first line are the engine's, of all cars; `held` are its commands, `odometry` its
numbers (r, k). The others are arguments of `read_actions`, `reward_ticks` and `read_sensors`, (n,) for the cars that
learn; `contacts`, `touched_at` and `began` are those of Contacts, (r,) for all cars; `numbers` are `stride`, `share`,
`slow`, `reward_share`, `alone`, `range_max`, `substeps` and `on_contact`."""

(
    _RUNNING, _TIMERS, _CRASHED, _REASONS, _TELEMETRY, _HELD, _ODOMETRY, _RANGES,
    _DRIVEN, _COMMANDS, _CLIPPED, _LIMITS, _PLANNED, _TARGETS, _PREVIOUS,
    _PROGRESS, _WRECKED, _IMPACTS, _BEFORE, _SLIDING, _WEIGHTS, _REWARDS, _TERMS,
    _CONTACTS, _TOUCHED_AT, _BEGAN, _BEAMS, _COLUMNS, _LOW, _HIGH, _NUMBERS,
) = range(len(NAMES))  # fmt: skip
_STRIDE, _SHARE, _SLOW, _REWARD_SHARE, _ALONE, _RANGE_MAX, _SUBSTEPS, _ON_CONTACT = range(8)

_ROLLED_OVER = END_REASONS.index("rolled_over")
_SLIDING_STEPS, _AHEAD, _LEFT = (TELEMETRY.index(name) for name in ("sliding_steps", "vx_m_s", "vy_m_s"))


@kernel
def act(table: Table, actions: FloatArray) -> int:
    """Note whose episodes go on, and convert their actions (n, 2) to commands; return what `read_actions` does."""
    n, running, driven = numbers(table[_NUMBERS]), flags(table[_RUNNING]), flags(table[_DRIVEN])
    for i in range(len(driven)):
        driven[i] = running[i * int(n[_STRIDE])]
    return read_actions(
        actions, driven, matrix(table[_LIMITS]), n[_SHARE], matrix(table[_PLANNED]), n[_SLOW], cube(table[_TARGETS]),
        matrix(table[_PREVIOUS]), matrix(table[_COMMANDS]), whole_numbers(table[_CLIPPED]),
    )  # fmt: skip


@kernel
def note(table: Table, first: int, end: int) -> None:
    """Note by what races the tick of the agents from `first` up to `end` is rewarded, after they were judged."""
    n, timers = numbers(table[_NUMBERS]), rows(table[_TIMERS], LAP_TIMER)
    crashed, reasons = flags(table[_CRASHED]), whole_numbers(table[_REASONS])
    progress, wrecked = numbers(table[_PROGRESS]), flags(table[_WRECKED])
    for i in range(first, end):
        row = i * int(n[_STRIDE])
        progress[i], wrecked[i] = timers[row].progress, crashed[row] or reasons[row] == _ROLLED_OVER


@kernel
def reward(table: Table) -> None:
    """Reward the tick by what was noted, see `reward_ticks`."""
    n = numbers(table[_NUMBERS])
    reward_ticks(
        flags(table[_DRIVEN]), numbers(table[_PROGRESS]), numbers(table[_BEFORE]), flags(table[_WRECKED]),
        numbers(table[_SLIDING]), numbers(table[_IMPACTS]), numbers(table[_WEIGHTS]), n[_REWARD_SHARE],
        n[_ALONE] != 0.0, numbers(table[_REWARDS]), cube(table[_TERMS]),
    )  # fmt: skip


@kernel
def drive_worlds(table: Table, tables: Addresses, firsts: NDArray[np.int64]) -> None:
    """Hold the commands for a tick and judge the races of one car each; `tables` and `firsts` as of `read_all`."""
    commands, held, running = matrix(table[_COMMANDS]), matrix(table[_HELD]), flags(table[_RUNNING])
    sliding, telemetry, crashed = numbers(table[_SLIDING]), matrix(table[_TELEMETRY]), flags(table[_CRASHED])
    on_contact, began = int(numbers(table[_NUMBERS])[_ON_CONTACT]), flags(table[_BEGAN])
    impacts = numbers(table[_IMPACTS])
    for k in range(len(tables)):
        world_table = table_at(tables[k], ARRAYS)
        first, end = firsts[k], firsts[k] + cars_of(world_table)
        held[first:end] = commands[first:end]
        if on_contact > 0:
            crashed[first:end] = False
        drive(world_table)
        end_failed(world_table)
        for row in range(first, end):
            impacts[row] = math.hypot(telemetry[row, _AHEAD], telemetry[row, _LEFT])
            if running[row]:
                sliding[row] = telemetry[row, _SLIDING_STEPS] / numbers(table[_NUMBERS])[_SUBSTEPS]
        if on_contact > 0:
            counts, touched_at = whole_numbers(table[_CONTACTS]), numbers(table[_TOUCHED_AT])
            take_contacts(world_table, first, on_contact, counts, touched_at, began)
        judge(world_table)
        if on_contact > 0:
            crashed[first:end] = began[first:end]
        note(table, first, end)


@kernel
def step(table: Table, tables: Addresses, firsts: NDArray[np.int64], actions: FloatArray) -> int:
    """Do a step of worlds of one car; return what `read_actions` does, before anything is written."""
    bad = act(table, actions)
    if bad < 0:
        drive_worlds(table, tables, firsts)
        reward(table)
    return bad


@kernel
def read(table: Table, scan: Values, values: Values) -> None:
    """Write what the agents have sensed, see `read_sensors`."""
    n = numbers(table[_NUMBERS])
    read_sensors(
        int(n[_STRIDE]), matrix(table[_RANGES]), matrix(table[_ODOMETRY]), matrix(table[_PREVIOUS]),
        matrix(table[_PLANNED]), whole_numbers(table[_BEAMS]), n[_RANGE_MAX], whole_numbers(table[_COLUMNS]),
        single_numbers(table[_LOW]), single_numbers(table[_HIGH]), scan, values,
    )  # fmt: skip


@kernel
def observe(
    table: Table, tables: Addresses, firsts: NDArray[np.int64], which: Mask, scan: Values, values: Values
) -> None:
    """Take the scans and odometry of the cars `which` (n,) of worlds of one car, and write what they are."""
    sense_all(tables, firsts, which)
    read(table, scan, values)
