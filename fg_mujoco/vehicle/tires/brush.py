"""The brush model: bristles that bend along the contact patch, under a load that is a parabola over it.

The patch slides from its rear end on, and from the slip 3 / stiffness on as a whole. The force bends over smoothly on
its way to friction times load: D (1 - (1 - x)^3) of the load, where x is the slip over that at which all slides.

Source: E. Fiala (1954); H. Pacejka, "Tire and Vehicle Dynamics", 3rd ed., section 3.2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from .law import Layer


@dataclass(frozen=True, kw_only=True)
class Brush(Layer):
    """The brush model; SettingsError: a value that no tire has."""

    model: ClassVar[str] = "brush"
    holds: ClassVar[bool] = True

    D: float  # [-] friction
    stiffness: float  # [1/rad] force over friction times load, by slip, at none

    def __post_init__(self) -> None:
        self._require("3 to", lambda v: v >= 3.0)

    def force(self, slip: float) -> float:
        """Return the force over the load [-] at a slip [rad or -], which has its sign."""
        rest = 1.0 - min(abs(slip) / self.peak_slip, 1.0)
        return math.copysign(self.D * (1.0 - rest**3), slip)

    @property
    def peak_slip(self) -> float:
        """Slip at which all of the patch slides [rad or -]."""
        return 3.0 / self.stiffness

    @property
    def numbers(self) -> tuple[float, ...]:
        """Friction, and a third of the stiffness."""
        return self.D, self.stiffness / 3.0
