"""What a tick is worth to a policy that learns: three terms, of what a race is judged by.

    reward = progress * metres driven along the centreline        (backward counts negative)
           - collision, once, when the chassis touches anything or the car rolls over
           - sliding * seconds of the tick in which a tire slides (see `TireSlip.slides`)

With the default weights a lap is worth its length, less what was done wrong.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from ..errors import SettingsError
from ..messages import FloatArray, require


@dataclass(frozen=True, kw_only=True)
class Rewards:
    """Weights of the three terms.

    Raises:
      SettingsError: a weight that is negative or not finite.
    """

    progress: float = 1.0  # [1/m]
    collision: float = 10.0
    sliding: float = 1.0  # [1/s]

    def __post_init__(self) -> None:
        names = tuple(f.name for f in fields(self))
        require(self, lambda value: 0.0 <= value < math.inf, "a finite number from 0 on", names, SettingsError)

    def of_tick(self, period: float) -> FloatArray:
        """Return what `reward_ticks` multiplies with, of ticks of so many seconds. Shape (3,)."""
        return np.array((self.progress, self.collision, self.sliding * period))
