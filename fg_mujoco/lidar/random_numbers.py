"""Random numbers in kernels: those of numpy's default generator, bit for bit, in a third of the time.

    state = generator_state(seed)
    draw_normals(state, *ziggurat(), normals)  # as np.random.default_rng(seed).standard_normal(out=normals)

Sources: O'Neill, PCG: A family of simple fast space-efficient statistically good algorithms for random number
generation, 2014 (XSL-RR 128/64); Marsaglia and Tsang, The ziggurat method for generating random variables, 2000, as in
numpy's distributions.c.
"""

from __future__ import annotations

import math
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..compiled.kernels import kernel, numbas
from ..messages import FloatArray

_MULTIPLIER = 0x2360ED051FC65DA44385DF649FCCF645  # of PCG64
_TAIL = 3.6541528853610088  # ziggurat_nor_r of numpy: where the lowest layer of the ziggurat ends
_INVERSE_TAIL = 0.27366123732975828  # ziggurat_nor_inv_r
_UNIT = 1.0 / 9007199254740992.0  # 2^-53
_LOW_BITS, _SIZES = 11, 2**52 - 1  # of a number of 64 bits; the mask of a size

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


def _next_in_python(high: int, low: int, step_high: int, step_low: int) -> tuple[int, int, int, int]:
    def joined(high: int, low: int) -> int:
        return (int(high) % 2**64) << 64 | (int(low) % 2**64)  # numpy's would overflow

    state = (joined(high, low) * _MULTIPLIER + joined(step_high, step_low)) % 2**128
    halves = divmod(state, 2**64)
    turned, by = halves[0] ^ halves[1], halves[0] >> 58
    number = (turned >> by | turned << (64 - by)) % 2**64
    signed = [half - 2**64 if half >= 2**63 else half for half in halves]
    return signed[0], signed[1], number >> _LOW_BITS, number % 2**_LOW_BITS


@numbas(_next_in_python)
def _next() -> Any:
    """Return what draws the next number of 64 bits: halves of the new state, the number's upper 53 bits, the others."""
    from llvmlite.ir import Constant, FunctionType, IntType
    from numba.core import types
    from numba.extending import intrinsic

    def draw(context: Any, high: Any, low: Any, step_high: Any, step_low: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            whole, half = IntType(128), IntType(64)

            def joined(high: Any, low: Any) -> Any:
                upper = builder.shl(builder.zext(high, whole), Constant(whole, 64))
                return builder.or_(upper, builder.zext(low, whole))

            product = builder.mul(joined(given[0], given[1]), Constant(whole, _MULTIPLIER))
            state = builder.add(product, joined(given[2], given[3]))
            upper = builder.trunc(builder.lshr(state, Constant(whole, 64)), half)
            lower = builder.trunc(state, half)
            turned, by = builder.xor(upper, lower), builder.lshr(upper, Constant(half, 58))
            turn = builder.module.declare_intrinsic("llvm.fshr", [half], FunctionType(half, [half, half, half]))
            number = builder.call(turn, [turned, turned, by])
            first = builder.lshr(number, Constant(half, _LOW_BITS))
            rest = builder.and_(number, Constant(half, 2**_LOW_BITS - 1))
            return context.make_tuple(builder, signature.return_type, [upper, lower, first, rest])

        number = types.int64
        return types.UniTuple(number, 4)(number, number, number, number), generate  # type: ignore[attr-defined]

    return intrinsic(draw)


@kernel
def draw_shares(state: State, out: FloatArray) -> None:
    """Draw numbers from 0 to 1, as Generator.random."""
    high, low, step_high, step_low = state[0], state[1], state[2], state[3]
    for k in range(len(out)):
        high, low, first, _ = _next(high, low, step_high, step_low)
        out[k] = first * _UNIT
    state[0], state[1] = high, low


@kernel
def draw_normals(state: State, limits: State, widths: FloatArray, heights: FloatArray, out: FloatArray) -> None:
    """Draw standard normal numbers, as Generator.standard_normal; limits, widths and heights are of `ziggurat`."""
    high, low, step_high, step_low = state[0], state[1], state[2], state[3]
    for k in range(len(out)):
        while True:
            high, low, first, rest = _next(high, low, step_high, step_low)
            layer, size = rest & 255, (first << 2 | rest >> 9) & _SIZES
            found = size * widths[layer]
            if rest & 256:
                found = -found
            if size < limits[layer]:
                break
            high, low, first, _ = _next(high, low, step_high, step_low)
            share = first * _UNIT
            if layer == 0:
                beyond, fits = 0.0, False
                while not fits:
                    beyond = -_INVERSE_TAIL * math.log1p(-share)
                    high, low, first, _ = _next(high, low, step_high, step_low)
                    depth = -math.log1p(-first * _UNIT)
                    fits = depth + depth > beyond * beyond
                    if not fits:
                        high, low, first, _ = _next(high, low, step_high, step_low)
                        share = first * _UNIT
                found = -(_TAIL + beyond) if size & 256 else _TAIL + beyond
                break
            if (heights[layer - 1] - heights[layer]) * share + heights[layer] < math.exp(-0.5 * found * found):
                break
        out[k] = found
    state[0], state[1] = high, low
