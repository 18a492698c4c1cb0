"""Random numbers of the native core: those of numpy's default generator, bit for bit, in a third of the time.

    state = generator_state(seed)
    draw_normals(state, *ziggurat(), normals)  # as np.random.default_rng(seed).standard_normal(out=normals)

Sources: O'Neill, PCG: A family of simple fast space-efficient statistically good algorithms for random number
generation, 2014 (XSL-RR 128/64); Marsaglia and Tsang, The ziggurat method for generating random variables, 2000, as in
numpy's distributions.c.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..messages import FloatArray
from ..native import core

State = NDArray[np.int64]
"""Of a generator: high and low half of its state, high and low half of its increment. Shape (4,)."""


def generator_state(seed: int) -> State:
    """Return the state of np.random.default_rng(seed), before it has drawn anything."""
    numbers: Any = np.random.default_rng(seed).bit_generator.state["state"]
    halves = [half for name in ("state", "inc") for half in divmod(numbers[name], 2**64)]
    return np.array(halves, np.uint64).view(np.int64)


@cache
def ziggurat() -> tuple[State, FloatArray, FloatArray]:
    """Return the layers of the ziggurat under the normal density, as numpy has them: limits, widths, heights. (256,)"""
    text = (files("fg_mujoco.lidar") / "ziggurat.csv").read_text(encoding="utf-8")
    layers = np.array([line.split(",") for line in text.splitlines()[1:]])
    return layers[:, 0].astype(np.int64), layers[:, 1].astype(np.float64), layers[:, 2].astype(np.float64)


def draw_shares(state: State, out: FloatArray) -> None:
    """Draw numbers from 0 to 1, as Generator.random."""
    core.draw_shares(state, out)


def draw_normals(state: State, limits: State, widths: FloatArray, heights: FloatArray, out: FloatArray) -> None:
    """Draw standard normal numbers, as Generator.standard_normal; limits, widths and heights are of `ziggurat`."""
    core.draw_normals(state, limits, widths, heights, out)
