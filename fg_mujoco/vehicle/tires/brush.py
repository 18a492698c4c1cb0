"""The brush model: bristles that bend along the contact patch, under a load that is a parabola over it.

The patch slides from its rear end on, and from the slip 3 / stiffness on as a whole. The force bends over smoothly on
its way to friction times load: D (1 - (1 - x)^3) of the load, where x is the slip over that at which all slides.

Source: E. Fiala (1954); H. Pacejka, "Tire and Vehicle Dynamics", 3rd ed., section 3.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ...compiled.kernels import kernel
from ...errors import SettingsError
from ...messages import FloatArray, require
from .law import Law, with_sign


@dataclass(frozen=True, kw_only=True)
class Brush(Law):
    """The brush model.

    Raises:
      SettingsError: a value that no tire has.
    """

    model: ClassVar[str] = "brush"
    holds: ClassVar[bool] = True

    D: float  # [-] friction
    stiffness: float  # [1/rad] force over friction times load, by slip, at none

    def __post_init__(self) -> None:
        require(self, lambda v: 0.0 < v <= 3.0, "above 0, up to 3, which no such tire reaches", ("D",), SettingsError)
        require(self, lambda v: 3.0 <= v <= 1000.0, "3 to 1000 per rad", ("stiffness",), SettingsError)

    def force(self, slip: float) -> float:
        """Return the force over the load [-] at a slip [rad or -], which has its sign."""
        rest = 1.0 - min(abs(slip) / self.peak_slip, 1.0)
        return with_sign(self.D * (1.0 - rest**3), slip)

    @property
    def slope(self) -> float:
        """Force over the load for each rad of slip, at none [1/rad]."""
        return self.D * self.stiffness

    @property
    def peak_slip(self) -> float:
        """Slip at which all of the patch slides [rad or -]."""
        return 3.0 / self.stiffness

    @property
    def peak(self) -> float:
        """Friction [-]."""
        return self.D

    @property
    def numbers(self) -> tuple[float, ...]:
        """Friction, and a third of the stiffness."""
        return self.D, self.stiffness / 3.0


@kernel
def force(numbers: FloatArray, slip: float) -> float:
    """Return the force over the load [-] at a slip without sign; `numbers` of Brush."""
    rest = 1.0 - min(numbers[1] * slip, 1.0)
    found: float = numbers[0] * (1.0 - rest * rest * rest)
    return found
