"""Touches of walls and obstacles that do not end an episode: the car stops there, or goes on as it comes off."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..compiled.array_table import Table, flags, matrix, rows, table_at, whole_matrix, whole_numbers
from ..compiled.kernels import kernel
from ..messages import FloatArray
from ..simulation import compiled_tick
from ..simulation.compiled_tick import APART, ARRAYS, Addresses, layout_of
from ..simulation.engine import Engine
from ..simulation.world_step import FIRST_TIRE
from ..vehicle.car import WHEELS
from ..vehicle.motion import CAR
from ..vehicle.tire_rows import USERDATA

Mask = NDArray[np.bool_]

ON_CONTACT = ("end", "stop", "continue")
"""What the touch of a wall does; by number."""

_STOP = ON_CONTACT.index("stop")
_CRASHED, _STATES, _CARS, _PLACES, _CAR_PLACES = (
    compiled_tick.NAMES.index(name) for name in ("crashed", "states", "cars", "places", "car_places")
)
_TIRES = USERDATA * len(WHEELS)


class Contacts:
    """The touches of all cars of an engine (r,), which end no race: `counts` in the episode, `touched_at` [s] the last.

    `began`, and `crashed` of the engine, say who began to touch something in the last tick, .5 s after the last touch.
    """

    def __init__(self, engine: Engine, on_contact: str) -> None:
        count = len(engine.commands)
        self._engine, self.number = engine, ON_CONTACT.index(on_contact)
        self.counts, self.touched_at = np.zeros(count, np.int64), np.full(count, -math.inf)
        self.began = np.zeros(count, np.bool_)

    @property
    def arrays(self) -> dict[str, NDArray[Any]]:
        """The arrays that `take_contacts` takes, by their names in the table of a step."""
        return {"contacts": self.counts, "touched_at": self.touched_at, "began": self.began}

    def begin(self, which: Mask) -> None:
        """Begin the episodes of the cars `which` (r,)."""
        self.counts[which], self.touched_at[which], self.began[which] = 0, -math.inf, False

    def clear(self) -> None:
        """Begin a tick."""
        self._engine.crashed[self.began] = False

    def take(self) -> None:
        """Count the new touches of a tick before its races are judged."""
        for share in self._engine.shares:
            _take_all(share.tables, share.firsts, self.number, self.counts, self.touched_at, self.began)

    def tell(self) -> None:
        """Write which cars began to touch something, after the races were judged."""
        self._engine.crashed[self.began] = True


@kernel
def take_contacts(
    table: Table, first: int, how: int, counts: NDArray[np.int64], touched_at: FloatArray, began: Mask
) -> None:
    """Count new touches of cars whose rows begin at `first`, stop them (`how`, by ON_CONTACT), let them race on."""
    crashed, states, cars = flags(table[_CRASHED]), matrix(table[_STATES]), rows(table[_CARS], CAR)
    places, car_places = whole_numbers(table[_PLACES]), whole_matrix(table[_CAR_PLACES])
    layout, m = layout_of(places), len(car_places)
    for k in range(len(crashed)):
        began[first + k] = False
        if not crashed[k]:
            continue
        state, car = states[k // m], k % m
        time = state[layout.time]
        began[first + k] = time - touched_at[first + k] > APART
        counts[first + k] += began[first + k]
        touched_at[first + k], crashed[k] = time, False
        if how == _STOP:
            end = layout.qvel[1] if car == m - 1 else layout.qvel[0] + cars[k + 1].free_dof
            state[layout.qvel[0] + cars[k].free_dof : end] = 0.0
            tires = layout.userdata[0] + USERDATA * car_places[car, FIRST_TIRE]
            if car_places[car, FIRST_TIRE] >= 0:
                state[tires : tires + _TIRES] = 0.0


@kernel
def _take_all(
    tables: Addresses, firsts: NDArray[np.int64], how: int, counts: NDArray[np.int64], touched_at: FloatArray,
    began: Mask,
) -> None:  # fmt: skip
    """Do `take_contacts` for each of several tables; `firsts` are the first rows of their cars."""
    for k in range(len(tables)):
        take_contacts(table_at(tables[k], ARRAYS), firsts[k], how, counts, touched_at, began)
