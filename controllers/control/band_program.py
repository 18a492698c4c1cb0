"""A quadratic program on a ring of points, each of which moves within its bounds.

    converges = least_on_ring(bands, gradient, low, high, x)

It minimises g x + x H x / 2 with low <= x <= high. H is symmetric and positive definite, and couples each point with
the two before and the two behind it, round the ring: so do the squares of second differences along a closed line.

Source: the predictor and corrector of S. Mehrotra, On the Implementation of a Primal-Dual Interior Point Method, SIAM
Journal on Optimization 2(4), 1992. The equations of a step are those of H with a greater diagonal. They are solved by
the LDL factors of the band, with the last two points as a border. A program takes 10 to 20 steps, however many points.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

_STEPS = 60
_SHORT_OF = 0.995  # share of the way to the nearest bound
_TOLERANCE = 1e-8  # of the gradient, and of the products of multipliers and slacks, relative to the greatest gradient


@kernel
def least_on_ring(bands: FloatArray, gradient: FloatArray, low: FloatArray, high: FloatArray, x: FloatArray) -> bool:
    """Write where the program is least to x (n,), and return whether the method converges.

    Args:
      bands: H[i, i], H[i, i + 1] and H[i, i + 2], round the ring, (3, n), n at least 6.
      gradient: g, (n,).
      low: least of each x, (n,).
      high: greatest of each x, (n,), above `low`.
      x: (n,), written to.
    """
    n = len(gradient)
    scale = 1e-12
    for i in range(n):
        scale = max(scale, abs(gradient[i]))
    slacks, forces = np.empty((2, n)), np.full((2, n), 0.1 * scale)  # to the lower and to the upper bound; multipliers
    for i in range(n):
        x[i] = 0.5 * (low[i] + high[i])
        slacks[0, i] = slacks[1, i] = 0.5 * (high[i] - low[i])
    stiff, right, step = np.empty((3, n)), np.empty(n), np.empty(n)
    pulled, changes, centred = np.empty(n), np.empty((2, n)), np.empty((2, n))
    for _ in range(_STEPS):
        off, gap = 0.0, 0.0
        for i in range(n):
            pulled[i] = gradient[i] + _row_times(bands, x, i)
            off = max(off, abs(pulled[i] - forces[0, i] + forces[1, i]))
            gap += slacks[0, i] * forces[0, i] + slacks[1, i] * forces[1, i]
        gap /= 2 * n
        if not math.isfinite(gap):
            return False
        if off <= 10.0 * _TOLERANCE * scale and gap <= _TOLERANCE * scale:
            return True
        for i in range(n):
            stiff[0, i] = bands[0, i] + forces[0, i] / slacks[0, i] + forces[1, i] / slacks[1, i]
            stiff[1, i], stiff[2, i], right[i] = bands[1, i], bands[2, i], -pulled[i]
        solve_ring(stiff, right, step)
        centred[:] = 0.0
        share = min(_until(slacks, forces, centred, step, changes), 1.0)
        reached = 0.0
        for i in range(n):
            reached += (slacks[0, i] + share * step[i]) * (forces[0, i] + share * changes[0, i])
            reached += (slacks[1, i] - share * step[i]) * (forces[1, i] + share * changes[1, i])
        reached /= 2 * n
        centre = (reached / gap) ** 3 * gap
        for i in range(n):
            centred[0, i] = (centre - step[i] * changes[0, i]) / slacks[0, i]
            centred[1, i] = (centre + step[i] * changes[1, i]) / slacks[1, i]
            right[i] = -pulled[i] + centred[0, i] - centred[1, i]
        solve_ring(stiff, right, step)
        share = min(_SHORT_OF * _until(slacks, forces, centred, step, changes), 1.0)
        for i in range(n):
            x[i] += share * step[i]
            slacks[0, i] += share * step[i]
            slacks[1, i] -= share * step[i]
            forces[0, i] += share * changes[0, i]
            forces[1, i] += share * changes[1, i]
    return False


@kernel
def _until(slacks: FloatArray, forces: FloatArray, centred: FloatArray, step: FloatArray, changes: FloatArray) -> float:
    """Write the changes of the forces (2, n) by a step, and return its share that brings a slack or a force to 0."""
    share = math.inf
    for i in range(len(step)):
        for bound in range(2):
            inwards = step[i] if bound == 0 else -step[i]
            change = centred[bound, i] - forces[bound, i] - forces[bound, i] / slacks[bound, i] * inwards
            changes[bound, i] = change
            if inwards < 0.0:
                share = min(share, slacks[bound, i] / -inwards)
            if change < 0.0:
                share = min(share, forces[bound, i] / -change)
    return share


@kernel
def _row_times(bands: FloatArray, x: FloatArray, i: int) -> float:
    """Return a value of H x."""
    n = len(x)
    before, first, after, second = (i - 1) % n, (i - 2) % n, (i + 1) % n, (i + 2) % n
    value = bands[0, i] * x[i] + bands[1, i] * x[after] + bands[1, before] * x[before]
    return float(value + bands[2, i] * x[second] + bands[2, first] * x[first])


@kernel
def solve_ring(bands: FloatArray, right: FloatArray, x: FloatArray) -> None:
    """Write x of H x = right (n,): the band without the last two points first, for the right side and for these two."""
    n = len(right)
    core = n - 2
    pivots, near, far = np.empty(core), np.zeros(core), np.zeros(core)  # D, L[i, i - 1] and L[i, i - 2]
    columns = np.zeros((core, 3))  # the right side, then what couples each point with the last two
    columns[:, 0] = right[:core]
    columns[core - 2, 1], columns[core - 1, 1] = bands[2, core - 2], bands[1, core - 1]
    columns[core - 1, 2] = bands[2, core - 1]
    columns[0, 1], columns[0, 2], columns[1, 2] = bands[2, n - 2], bands[1, n - 1], bands[2, n - 1]
    border = columns.copy()
    for i in range(core):
        pivot = bands[0, i]
        if i > 1:
            far[i] = bands[2, i - 2] / pivots[i - 2]
            pivot -= far[i] * far[i] * pivots[i - 2]
        if i > 0:
            coupled = bands[1, i - 1]
            if i > 1:
                coupled -= far[i] * pivots[i - 2] * near[i - 1]
            near[i] = coupled / pivots[i - 1]
            pivot -= near[i] * near[i] * pivots[i - 1]
        pivots[i] = pivot
        for c in range(3):
            if i > 0:
                columns[i, c] -= near[i] * columns[i - 1, c]
            if i > 1:
                columns[i, c] -= far[i] * columns[i - 2, c]
    for i in range(core - 1, -1, -1):
        for c in range(3):
            columns[i, c] /= pivots[i]
            if i + 1 < core:
                columns[i, c] -= near[i + 1] * columns[i + 1, c]
            if i + 2 < core:
                columns[i, c] -= far[i + 2] * columns[i + 2, c]
    a, b, c, d, e = bands[0, n - 2], bands[1, n - 2], bands[0, n - 1], right[n - 2], right[n - 1]
    for i in (0, 1, core - 2, core - 1):
        a -= border[i, 1] * columns[i, 1]
        b -= border[i, 1] * columns[i, 2]
        c -= border[i, 2] * columns[i, 2]
        d -= border[i, 1] * columns[i, 0]
        e -= border[i, 2] * columns[i, 0]
    x[n - 2], x[n - 1] = (c * d - b * e) / (a * c - b * b), (a * e - b * d) / (a * c - b * b)
    for i in range(core):
        x[i] = columns[i, 0] - columns[i, 1] * x[n - 2] - columns[i, 2] * x[n - 1]
