"""A linear tire, as the single-track models of the 2D gyms have it: the force grows with the slip and has no peak.

Such a tire never slides, and can roll a car over that no real one would.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from .law import Layer


@dataclass(frozen=True, kw_only=True)
class Linear(Layer):
    """A linear tire; SettingsError: a value that no tire has."""

    model: ClassVar[str] = "linear"
    slides: ClassVar[bool] = False

    stiffness: float  # [1/rad] the force is load * D * stiffness * slip
    D: float  # [-] the friction that its planner assumes

    def __post_init__(self) -> None:
        self._require("above 0, up to", lambda v: v > 0.0)

    def force(self, slip: float) -> float:
        """Return the force over the load [-] at a slip [rad or -], which has its sign."""
        return self.slope * slip

    @property
    def peak_slip(self) -> float:
        """Infinite: there is no peak."""
        return math.inf

    @property
    def numbers(self) -> tuple[float, ...]:
        """D, and its product with the stiffness."""
        return self.D, self.slope
