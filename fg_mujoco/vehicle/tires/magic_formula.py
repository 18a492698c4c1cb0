"""The Magic Formula (Pacejka): of a slip s [rad or -], D sin(C atan(B s - E (B s - atan(B s)))) of the load.

Some of the identified curves fall through zero soon behind their peak, where nothing was measured. So a curve never
falls below a share of its peak, `sliding_share`. Behind the slip where it would, it is constant.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import ClassVar

import numpy as np

from ...errors import SettingsError
from ...messages import require
from .law import GREATEST_SLIP, Law

_NEAR_PEAK = 0.99  # [-] of a curve's greatest force: where a curve without a falling branch has its peak
_LEAST_OF_D = 0.9  # [-] a curve that reaches less of D up to GREATEST_SLIP has no peak
_STEP = 1e-3  # [-] of slip, in the search of the peak


@dataclass(frozen=True, kw_only=True)
class MagicFormula(Law):
    """A Magic Formula.

    Raises:
      SettingsError: a value that no tire has, or a curve without a peak.
    """

    model: ClassVar[str] = "magic_formula"

    B: float  # [1/rad] stiffness factor
    C: float  # [-] shape factor
    D: float  # [-] peak of the force over the load
    E: float = 0.0  # [-] curvature factor
    sliding_share: float = 0.7  # [-] of the peak, that the force never falls below behind it

    def __post_init__(self) -> None:
        require(self, lambda v: 0.0 < v <= 3.0, "above 0, up to 3, which no such tire reaches", ("D",), SettingsError)
        require(self, lambda v: 0.0 < v <= 1000.0, "above 0, up to 1000 per rad", ("B",), SettingsError)
        require(self, lambda v: 0.5 <= v <= 10.0, "0.5 to 10", ("C",), SettingsError)
        require(self, lambda v: -100.0 <= v <= 2.0, "-100 to 2", ("E",), SettingsError)
        require(self, lambda v: 0.0 <= v <= 1.0, "0 to 1, of the peak", ("sliding_share",), SettingsError)
        if self.peak < _LEAST_OF_D * self.D:
            raise SettingsError(
                f"MagicFormula has no peak: B {self.B:g}, C {self.C:g}, E {self.E:g} reach {self.peak / self.D:.2f} of "
                f"D up to a slip of {GREATEST_SLIP:g}; accepted: a curve that reaches {_LEAST_OF_D:g} of it"
            )

    @classmethod
    def needed(cls) -> tuple[str, ...]:
        """Return the names of those that a tire file must have."""
        return "B", "C", "D", "E"

    def force(self, slip: float) -> float:
        """Return the force over the load [-] at a slip [rad or -], which has its sign."""
        return math.copysign(self._formula(min(abs(slip), self.hold_slip)), slip)

    @property
    def slope(self) -> float:
        """Force over the load for each rad of slip, at none [1/rad]."""
        return self.D * self.B * self.C

    @property
    def peak_slip(self) -> float:
        """Slip of the peak [rad or -].

        Where the curve does not fall up to GREATEST_SLIP, this is where it reaches 0.99 of its force there.
        """
        return _peak_slip(self)

    @property
    def falls(self) -> bool:
        """Whether the force falls behind the peak."""
        return self._formula(self.peak_slip + 1e-3) < self._formula(self.peak_slip)

    @cached_property
    def peak(self) -> float:
        """Greatest force over the load [-]."""
        return self._formula(self.peak_slip if self.falls else GREATEST_SLIP)

    @cached_property
    def hold_slip(self) -> float:
        """Slip from which on the curve is constant, because it would fall below `sliding_share` of its peak [-]."""
        if not self.falls:
            return GREATEST_SLIP
        least, low = self.sliding_share * self.peak, self.peak_slip
        while low < GREATEST_SLIP and self._formula(low + _STEP) >= least:
            low += _STEP
        if low >= GREATEST_SLIP:
            return GREATEST_SLIP
        high = low + _STEP
        while high - low > 1e-12:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self._formula(middle) >= least else (low, middle)
        return low

    @property
    def numbers(self) -> tuple[float, ...]:
        """B, C, D, E, and the slip from which on it is constant."""
        return self.B, self.C, self.D, self.E, self.hold_slip

    def _formula(self, slip: float) -> float:
        x = self.B * slip
        return self.D * math.sin(self.C * math.atan(x - self.E * (x - math.atan(x))))


@lru_cache(maxsize=256)  # a scan of the whole curve, of which each world reads one some twenty times
def _peak_slip(curve: MagicFormula) -> float:
    """Return the slip of the peak of a curve [rad or -]."""
    grid = np.arange(0.0, GREATEST_SLIP + 0.5 * _STEP, _STEP)
    values = [curve._formula(slip) for slip in grid.tolist()]
    top = next((i for i in range(1, len(grid) - 1) if values[i + 1] < values[i]), None)
    if top is None:
        low, high = 0.0, GREATEST_SLIP
        while high - low > 1e-12:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if curve._formula(middle) < _NEAR_PEAK * values[-1] else (low, middle)
        return high
    low, high = grid[top] - _STEP, grid[top] + _STEP
    for _ in range(100):
        third = (high - low) / 3.0
        if curve._formula(low + third) < curve._formula(high - third):
            low += third
        else:
            high -= third
    return float(0.5 * (low + high))
