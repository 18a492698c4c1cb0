"""Worlds that come and go: batches of one world each that are the same World, and share its compiled model."""

from __future__ import annotations

from collections.abc import Callable

from .physics import Batch
from .termination import RaceMonitor
from .world_batch import CarArrays, WorldBatch


class Slots:
    """Batches of one world each, of one World, for one thread.

    A batch that a world leaves is kept for the next one that comes.

    Args:
      make: returns a batch of the world of a slice, with room for so many states.
      room: states that each compiled model has room for. A state takes about 1 MB, and a model about 5 MB.
    """

    def __init__(self, make: Callable[[slice, int], WorldBatch], room: int) -> None:
        self._make, self._room = make, room
        self._free: list[WorldBatch] = []
        self._first: WorldBatch | None = None
        self._physics: Batch | None = None
        self._given = 0  # of its states

    def take(self, place: slice, arrays: CarArrays, monitor: RaceMonitor) -> WorldBatch:
        """Return a batch for the world of a slice of the engine, whose arrays and monitor these are."""
        if self._free:
            left = self._free.pop()
            left.move(place, arrays, monitor)
            return left
        if self._first is None:
            self._first = self._make(place, self._room)
            self._physics, self._given = self._first.all_physics, 1
            return self._first
        if self._physics is None or self._given == self._room:
            self._physics, self._given = self._first.all_physics.like(), 0
        self._given += 1
        return self._first.another(self._physics.part(self._given - 1, 1), place, arrays, monitor)

    def leave(self, batch: WorldBatch) -> None:
        """Keep a batch whose world is another one now."""
        self._free.append(batch)
