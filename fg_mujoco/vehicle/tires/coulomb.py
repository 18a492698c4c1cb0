"""Coulomb friction: the force grows with the slip up to friction times load, and stays there.

The contact patch is a layer of bristles. They bend until their force is that of friction, and then slide: elastic and
perfectly plastic, as in Dahl's model. A tire that holds does not creep, and one that slides has the full friction in
any direction. How stiff the bristles are hardly matters to where a car begins to slide; it sets how far it drifts
before.

Source: P. Dahl, "A solid friction model" (1968); the bound on the deflection is that of elasto-plastic friction models
(Dupont et al., IEEE Trans. Autom. Control 47(5), 2002).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from .law import Layer


@dataclass(frozen=True, kw_only=True)
class Coulomb(Layer):
    """Coulomb friction of bristles; SettingsError: a value that no tire has."""

    model: ClassVar[str] = "coulomb"
    holds: ClassVar[bool] = True

    D: float = 1.0  # [-] friction; of a file that does not say it, over that of the vehicle
    stiffness: float  # [1/rad] force over friction times load, by slip, of a tire that holds

    def __post_init__(self) -> None:
        self._require("1 to", lambda v: v >= 1.0)

    @classmethod
    def needed(cls) -> tuple[str, ...]:
        """Return the names of those that a tire file must have."""
        return ("stiffness",)

    def force(self, slip: float) -> float:
        """Return the force over the load [-] at a slip [rad or -], which has its sign."""
        return math.copysign(self.D * min(self.stiffness * abs(slip), 1.0), slip)

    @property
    def peak_slip(self) -> float:
        """Slip at which it begins to slide [rad or -]."""
        return 1.0 / self.stiffness

    @property
    def numbers(self) -> tuple[float, ...]:
        """Friction, and stiffness."""
        return self.D, self.stiffness
