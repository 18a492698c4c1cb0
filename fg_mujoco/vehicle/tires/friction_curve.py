"""Unity's WheelFrictionCurve, on which AutoDRIVE's cars drive: two cubics through an extremum and an asymptote.

The first begins at zero with the slope of the line to the extremum, and ends there level: it is x + x^2 - x^3 of the
extremum's value, where x is the slip over that of the extremum. The second falls to the asymptote, level at both ends.
From there on the force is constant.

Source: Unity's manual of WheelFrictionCurve; for the slope at zero, which it does not give, `hermiteEval` of
NxTireFunctionDesc in PhysX 2.8, which the curve comes from.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

from ...errors import SettingsError
from ...messages import require
from .law import Law


@dataclass(frozen=True, kw_only=True)
class FrictionCurve(Law):
    """A WheelFrictionCurve; its stiffness, a factor, is in the values.

    Raises:
      SettingsError: a value that no tire has, or an asymptote that is not behind and below the extremum.
    """

    model: ClassVar[str] = "friction_curve"

    extremum_slip: float  # [rad or -] of the peak
    extremum_value: float  # [-] force over the load there
    asymptote_slip: float  # [rad or -] from which on the force is constant
    asymptote_value: float  # [-] force over the load there

    def __post_init__(self) -> None:
        least, most = 1e-3, "above 0, up to 3, which no such tire reaches"
        require(self, lambda v: 0.0 < v <= 3.0, most, ("extremum_value",), SettingsError)
        require(self, lambda v: least <= v < 1.0, f"{least:g} to 1", ("extremum_slip",), SettingsError)
        behind = f"above extremum_slip, {self.extremum_slip:g}"
        require(self, lambda v: v > self.extremum_slip, behind, ("asymptote_slip",), SettingsError)
        below = f"0 to extremum_value, {self.extremum_value:g}"
        require(self, lambda v: 0.0 <= v <= self.extremum_value, below, ("asymptote_value",), SettingsError)

    def scaled(self, by: float) -> FrictionCurve:
        """Return it with all forces times a factor."""
        return replace(self, extremum_value=by * self.extremum_value, asymptote_value=by * self.asymptote_value)

    def force(self, slip: float) -> float:
        """Return the force over the load [-] at a slip [rad or -], which has its sign."""
        x = min(abs(slip) / self.extremum_slip, 1.0)
        behind = (abs(slip) - self.extremum_slip) / (self.asymptote_slip - self.extremum_slip)
        y = min(max(behind, 0.0), 1.0)
        fallen = (self.extremum_value - self.asymptote_value) * y**2 * (3.0 - 2.0 * y)
        return math.copysign(self.extremum_value * (x + x**2 - x**3) - fallen, slip)

    @property
    def slope(self) -> float:
        """Force over the load for each rad of slip, at none [1/rad]."""
        return self.extremum_value / self.extremum_slip

    @property
    def peak_slip(self) -> float:
        """Slip of the extremum [rad or -]."""
        return self.extremum_slip

    @property
    def peak(self) -> float:
        """Greatest force over the load [-]."""
        return self.extremum_value

    @property
    def numbers(self) -> tuple[float, ...]:
        """Its values."""
        return self.extremum_slip, self.extremum_value, self.asymptote_slip, self.asymptote_value
