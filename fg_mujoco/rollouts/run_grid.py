"""A grid of runs: each value of each axis with each of the others, driven until none is missing."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from ..errors import SettingsError


def as_axis(value: Any) -> list[Any]:
    """Return the values of an axis: one, or a sequence of them."""
    return [value] if isinstance(value, str) or not isinstance(value, Iterable) else list(value)


def require_axes(axes: Iterable[tuple[str, Sequence[Any]]]) -> None:
    """Refuse an axis, a name and its values, that is empty or has a value twice.

    Raises:
      SettingsError: one is.
    """
    for name, values in axes:
        twice = next((value for i, value in enumerate(values) if value in values[:i]), None)
        if not values or twice is not None:
            said = f"no {name} is given" if not values else f"{name} {twice} is given twice"
            raise SettingsError(f"{said}; accepted: one or more, each once")


def time_left(runs: int, found: int, driven: int, elapsed: float) -> float | None:
    """Return the expected time for the missing runs [s]; None before the first one is finished.

    Args:
      runs: of the whole grid.
      found: finished by an earlier call.
      driven: finished by this one.
      elapsed: what those took [s].
    """
    return (runs - found - driven) * elapsed / driven if driven else None
