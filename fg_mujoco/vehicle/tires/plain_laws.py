"""Plain laws of tires, whose force follows from friction and stiffness: Coulomb friction, a line, and the brush model.

Coulomb friction: the force grows with the slip up to friction times load, and stays there. The contact patch is a layer
of bristles. They bend until their force is that of friction, and then slide: elastic and perfectly plastic, as in
Dahl's model. A tire that holds does not creep, and one that slides has the full friction in any direction. How stiff
the bristles are hardly matters to where a car begins to slide; it sets how far it drifts before. Source: P. Dahl, "A
solid friction model" (1968); the bound on the deflection is that of elasto-plastic friction models (Dupont et al., IEEE
Trans. Autom. Control 47(5), 2002).

A linear tire, as the single-track models of the 2D gyms have it: the force grows with the slip and has no peak. Such a
tire never slides, and can roll a car over that no real one would.

The brush model: bristles that bend along the contact patch, under a load that is a parabola over it. The patch slides
from its rear end on, and from the slip 3 / stiffness on as a whole. The force bends over smoothly on its way to
friction times load: D (1 - (1 - x)^3) of the load, where x is the slip over that at which all slides. Source: E. Fiala
(1954); H. Pacejka, "Tire and Vehicle Dynamics", 3rd ed., section 3.2.
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
