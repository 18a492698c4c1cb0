"""Colours with a meaning in pictures, and their scales."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ...messages import FloatArray

STAGES: dict[str, tuple[float, float, float]] = {
    "raw": (0.45, 0.72, 0.98),
    "extended": (0.98, 0.62, 0.10),
    "bubble": (0.90, 0.12, 0.14),
    "gap": (0.22, 0.80, 0.36),
    "goal": (0.93, 0.20, 0.85),
}
"""Of what a planner does to a scan, in the order it does so."""

_FRICTION_USE = np.array([0.0, 0.35, 0.65, 0.85, 1.0])
_FRICTION_RGB = np.array(
    [(0.16, 0.35, 0.85), (0.10, 0.72, 0.80), (0.35, 0.85, 0.35), (1.00, 0.85, 0.10), (0.90, 0.10, 0.12)]
)


def friction_colour(use: ArrayLike) -> FloatArray:
    """Return the colour of a friction utilisation: blue at 0, green at two thirds, red from 1 on. Shape (..., 3)."""
    use = np.nan_to_num(np.asarray(use, dtype=np.float64))
    return np.stack([np.interp(use, _FRICTION_USE, _FRICTION_RGB[:, channel]) for channel in range(3)], axis=-1)
