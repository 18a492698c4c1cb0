"""A tire law: the force of a tire over its load, by its slip in one direction.

A law is a frozen dataclass. A bundled one has a module of its own, and a function of its numbers in
native/vehicle/tires.hpp; one of a user's own is `sampled`. `tire_forces` does for all laws what they share: load,
deflection of the contact patch, slip of both directions at once, damping.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar

import numpy as np

from ...errors import SettingsError
from ...messages import FloatArray, require

NUMBERS = 197
"""Number of values of a law that the native core gets."""

GREATEST_SLIP = 1.0
"""[-] Greatest slip that a tire takes on: that of a locked wheel. A wheel that slides more has the force of this."""


@dataclass(frozen=True, kw_only=True)
class Law:
    """The force over the load of a tire, by its slip in one direction.

    Attributes:
      model: its name in tire files.
      holds: whether the contact patch deflects no further than where it slides, as bristles do, so that the slip never
        passes that of the peak. Else the slip goes on to GREATEST_SLIP, and the force follows the curve behind it.
      slides: whether it has a peak, past which a tire slides.
    """

    model: ClassVar[str] = ""
    holds: ClassVar[bool] = False
    slides: ClassVar[bool] = True

    @abstractmethod
    def force(self, slip: float) -> float:
        """Return the force over the load [-] at a slip [rad or -], which has its sign."""

    @property
    @abstractmethod
    def slope(self) -> float:
        """Force over the load for each rad of slip, at none [1/rad]: the cornering stiffness over the load."""

    @property
    @abstractmethod
    def peak_slip(self) -> float:
        """Slip of the peak [rad or -]; infinite where there is none."""

    @property
    @abstractmethod
    def peak(self) -> float:
        """Greatest force over the load [-]; where there is none, the friction that its planner assumes."""

    @property
    def numbers(self) -> tuple[float, ...]:
        """The values for its native function, up to NUMBERS of them; nothing of a law without one."""
        return ()

    @property
    def has_peak(self) -> bool:
        """Whether a tire slides past a peak, which a law without a finite `peak_slip` does not have."""
        return self.slides and math.isfinite(self.peak_slip)

    def scaled(self: Any, by: float) -> Any:
        """Return it with all forces times a factor, which is that of its value D."""
        return replace(self, D=by * self.D)

    @classmethod
    def value_names(cls) -> tuple[str, ...]:
        """Return the names of its values in a tire file."""
        return tuple(field.name for field in fields(cls))

    @classmethod
    def needed(cls) -> tuple[str, ...]:
        """Return the names of those that a tire file must have."""
        return cls.value_names()

    def packed(self) -> list[float]:
        """Return its values as numbers in a row, as a compiled model has them; `unpacked` reads them."""
        return [float(v) for name in self.value_names() for v in np.atleast_1d(getattr(self, name))]

    @classmethod
    def unpacked(cls, row: Sequence[float]) -> Law:
        """Return the law of the values of `packed`."""
        return cls(**dict(zip(cls.value_names(), row, strict=True)))

    def row(self) -> FloatArray:
        """Return its numbers, and zeros behind them. Shape (NUMBERS,)."""
        found = np.zeros(NUMBERS)
        found[: len(self.numbers)] = self.numbers
        return found


class Layer(Law):
    """A law of a friction D over the load, and of a stiffness over that."""

    D: float
    stiffness: float

    @property
    def slope(self) -> float:
        """Force over the load for each rad of slip, at none [1/rad]."""
        return self.D * self.stiffness

    @property
    def peak(self) -> float:
        """Friction [-]."""
        return self.D

    def _require(self, least: str, accepts: Callable[[float], bool]) -> None:
        require(self, lambda v: 0.0 < v <= 3.0, "above 0, up to 3, which no such tire reaches", ("D",), SettingsError)
        require(self, lambda v: accepts(v) and v <= 1000.0, f"{least} 1000 per rad", ("stiffness",), SettingsError)
