"""Worlds that come and go in an engine, and how its worlds are shared out to threads."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .physics import Batch
from .termination import RaceMonitor
from .world import World
from .world_batch import CarArrays, WorldBatch

if TYPE_CHECKING:
    from .cars_alone import CarsAlone

Make = Callable[[World, slice, int, "CarsAlone | None"], WorldBatch]
"""Returns a batch of the world of a slice, with room for so many states, and the cars of the world alone."""


class Slots:
    """Batches of one world each, kept when a world leaves: those of a World in a share have one compiled model."""

    def __init__(self) -> None:
        self._of: dict[tuple[int, World], _SameWorld] = {}  # by share
        self._homes: dict[WorldBatch, tuple[int, World]] = {}  # of batches that are driven
        self._alone: dict[tuple[int, str], CarsAlone] = {}  # by share and text

    def take(
        self, make: Make, share: int, world: World, place: slice, arrays: CarArrays, monitor: RaceMonitor, room: int
    ) -> WorldBatch:
        """Return a batch of a world for a slice, of a model with `room` for states of 1 MB each, and of 5 MB itself."""
        key = share, world
        if key not in self._of:
            alone = self.cars_alone(share, world)
            self._of[key] = _SameWorld(lambda place: make(world, place, room, alone), room)
        batch = self._of[key].take(place, arrays, monitor)
        self._homes[batch] = key
        return batch

    def leave(self, batch: WorldBatch) -> None:
        """Keep a batch that was taken here and whose world is another one now."""
        same = self._of.get(self._homes.pop(batch, (-1, batch.world)))
        if same is not None:
            same.free.append(batch)

    def forget(self, worlds: Sequence[World]) -> None:
        """Keep nothing of some worlds."""
        self._of = {key: same for key, same in self._of.items() if key[1] not in worlds}

    def cars_alone(self, share: int, world: World) -> CarsAlone | None:
        """Return the cars of a world alone, for the thread of a share; None where no ground is known to be clear."""
        if not world.distances[0].size:
            return None
        key = share, world.xml_of_cars
        if key not in self._alone:
            from .cars_alone import CarsAlone

            self._alone[key] = CarsAlone(world.xml_of_cars, world.model, world.cars)
        return self._alone[key]


class _SameWorld:
    """Batches of one World, for one thread; `free` are those that no world is in."""

    def __init__(self, make: Callable[[slice], WorldBatch], room: int) -> None:
        self.free: list[WorldBatch] = []
        self._make, self._room = make, room
        self._first: WorldBatch | None = None
        self._physics: Batch | None = None
        self._given = 0  # of its states

    def take(self, place: slice, arrays: CarArrays, monitor: RaceMonitor) -> WorldBatch:
        """Return a batch for the world of a slice."""
        if self.free:
            left = self.free.pop()
            left.move(place, arrays, monitor)
            return left
        if self._first is None:
            self._first = self._make(place)
            self._physics, self._given = self._first.all_physics, 1
            return self._first
        if self._physics is None or self._given == self._room:
            self._physics, self._given = self._first.all_physics.like(), 0
        self._given += 1
        return self._first.another(self._physics.part(self._given - 1, 1), place, arrays, monitor)


class Share(NamedTuple):
    """The batches that one thread drives."""

    tables: NDArray[np.int64]  # addresses of their tables
    firsts: NDArray[np.int64]  # first row of the cars of each


def ends_of_shares(count: int, threads: int) -> list[int]:
    """Return the ends of equal shares of the worlds, one for each thread."""
    shares = min(threads, count)
    return [count * k // shares for k in range(1, shares + 1)]


def parts_of(worlds: Sequence[World], shares: Sequence[int]) -> list[slice]:
    """Split the worlds into runs of equal models that end where a share ends."""
    count = len(worlds)
    ends = set(shares) | {i for i in range(1, count) if worlds[i] is not worlds[i - 1]}
    return [slice(first, end) for first, end in zip([0, *sorted(ends)], sorted(ends), strict=False)]


def share_of(worlds: slice, ends: Sequence[int]) -> int:
    """Return the number of the share that some worlds are in; `ends` of `ends_of_shares`."""
    return bisect_left(ends, worlds.stop)


def shared_out(batches: Sequence[WorldBatch], ends: Sequence[int]) -> list[Share]:
    """Return the shares of batches; those of one World follow each other, so that it stays in the cache."""
    shares: list[list[WorldBatch]] = [[] for _ in ends]
    for batch in batches:
        shares[share_of(batch.worlds, ends)].append(batch)
    found = []
    for share in shares:
        share.sort(key=lambda batch: id(batch.world))
        tables, firsts = [batch.table_address for batch in share], [batch.rows.start for batch in share]
        found.append(Share(np.array(tables, np.int64), np.array(firsts, np.int64)))
    return found
