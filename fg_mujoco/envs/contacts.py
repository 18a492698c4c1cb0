"""Touches of walls and obstacles that do not end an episode: the car stops there, or goes on as it comes off."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..native import core
from ..simulation.engine import Engine

Mask = NDArray[np.bool_]

ON_CONTACT = ("end", "stop", "continue")
"""What the touch of a wall does; by number, in the native core too."""


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
        """The arrays of touches, by their names in the table of a step."""
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
            core.take_contacts(share.tables, share.firsts, self.number, self.counts, self.touched_at, self.began)

    def tell(self) -> None:
        """Write which cars began to touch something, after the races were judged."""
        self._engine.crashed[self.began] = True
