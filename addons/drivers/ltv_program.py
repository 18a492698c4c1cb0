"""A quadratic program along a horizon: the inputs of least cost for a linear time-varying system with bounds.

It minimises the sum of weights[k] x[k]^2 / 2 and effort[k] u[k]^2 / 2, over x[k + 1] = a[k] x[k] + b[k] u[k] + c[k].
Bounded are the one input u, its sum with a multiple of the last entry of the state before it, and the last and the
first entry of the state that it leads to: columns INPUT, COUPLED, LAST and FIRST of `limits`. A bound is hard, or soft:
then it costs a weight times half of the squared distance beyond it. The method is the predictor and corrector of
Mehrotra: with slacks and multipliers as they are, a step is a linear-quadratic regulator without bounds, as each bound
adds to the weight of its value, and to its slope; Riccati's recursion solves it. A program takes 3 to 20 steps.
Sources: S. Mehrotra, On the Implementation of a Primal-Dual Interior Point Method, SIAM Journal on Optimization 2(4),
1992; C. Rao, S. Wright and J. Rawlings, Application of Interior-Point Methods to Model Predictive Control, Journal of
Optimization Theory and Applications 99(3), 1998, for the recursion.
Limits: the steps begin anew for each program. One whose hard bounds no inputs meet does not converge.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

INPUT, COUPLED, LAST, FIRST = range(4)
"""Columns of what is bounded: the input, the input and a multiple of the last entry of the state before it, and the
last and the first entry of the state after it."""
_BOUNDED = 4
LOW, HIGH, SOFTNESS = range(3)
"""Rows of `limits`: the bounds, and one over the weight of the squared distance beyond them; 0: they are hard."""

MOST_ITERATIONS = 30
_SHORT_OF = 0.995  # share of the way to where a slack or a multiplier is 0
_LEAST_SLACK = 0.1  # at first, as a share of the way between the bounds
_TOLERANCE = 1e-6  # of the mean product of slack and multiplier, and of what is missing, as a share of the first


@kernel
def solve_program(
    a: FloatArray,
    b: FloatArray,
    c: FloatArray,
    weights: FloatArray,
    effort: FloatArray,
    coupling: FloatArray,
    limits: FloatArray,
    start: FloatArray,
    inputs: FloatArray,
    states: FloatArray,
    most: int,
) -> int:
    """Write the solution, and return after how many of at most `most` steps it converged; 0: not, or it is not finite.

    The system is `a` (n, states, states), `b` (n, states) for its input, and the known disturbance `c` (n, states).
    `weights` of the squared states, from 0, are (n + 1, states), `effort` of the squared inputs, above 0, (n,). The
    last entry is added to the input `coupling` (n,) times. `limits` (3, n, 4), see LOW, are finite, and apart. `inputs`
    (n,) and `states` (n + 1, states) are written to.
    """
    count, size = b.shape
    gains, pivots, carried = np.empty((count, size)), np.empty(count), np.empty((count, size))
    added, slope, forward, slopes = (
        np.zeros((count, _BOUNDED)),
        np.zeros((count, _BOUNDED)),
        np.empty(count),
        np.empty((2, size)),
    )
    values, next_values = np.empty((count, _BOUNDED)), np.empty((count, _BOUNDED))
    slacks, forces = np.empty((2, count, _BOUNDED)), np.empty((2, count, _BOUNDED))
    next_inputs, next_states = np.empty(count), np.empty((count + 1, size))
    slack_steps, force_steps, centred = (
        np.empty((2, count, _BOUNDED)),
        np.empty((2, count, _BOUNDED)),
        np.zeros((2, count, _BOUNDED)),
    )
    states[0] = next_states[0] = start
    _factor(a, b, c, weights, effort, coupling, added, gains, pivots, carried)
    _solve(a, b, c, coupling, gains, pivots, carried, slope, forward, slopes, inputs, states)
    _read_values(coupling, inputs, states, values)
    gap = first_gap = _begin(weights, effort, limits, values, slacks, forces)
    missing = 1.0  # share of what is missing at first of slacks and slopes
    for iteration in range(1, most + 1):
        for products in range(2):
            if products == 0:
                centred[:] = 0.0
            _stiffen(limits, values, slacks, forces, centred, added, slope)
            if products == 0:
                _factor(a, b, c, weights, effort, coupling, added, gains, pivots, carried)
            _solve(a, b, c, coupling, gains, pivots, carried, slope, forward, slopes, next_inputs, next_states)
            _read_values(coupling, next_inputs, next_states, next_values)
            share = _steps(limits, next_values, values, slacks, forces, centred, slack_steps, force_steps)
            if products == 0:
                _centre(slacks, forces, slack_steps, force_steps, share, gap, centred)
        gap = 0.0
        for side in range(2):
            for k in range(count):
                for j in range(_BOUNDED):
                    slacks[side, k, j] += share * slack_steps[side, k, j]
                    forces[side, k, j] += share * force_steps[side, k, j]
                    gap += slacks[side, k, j] * forces[side, k, j] / (2 * _BOUNDED * count)
        for k in range(count):
            inputs[k] += share * (next_inputs[k] - inputs[k])
            for i in range(size):
                states[k + 1, i] += share * (next_states[k + 1, i] - states[k + 1, i])
        _read_values(coupling, inputs, states, values)
        missing *= 1.0 - share
        if not math.isfinite(gap + states[count, 0]):
            return 0
        if gap <= _TOLERANCE * first_gap and missing <= _TOLERANCE:
            return iteration
    return 0


@kernel
def _factor(
    a: FloatArray,
    b: FloatArray,
    c: FloatArray,
    weights: FloatArray,
    effort: FloatArray,
    coupling: FloatArray,
    added: FloatArray,
    gains: FloatArray,
    pivots: FloatArray,
    carried: FloatArray,
) -> None:
    """Write the feedback gains (n, states), the cost's curvature in inputs (n,), and P c (n, states), P Riccati's."""
    count, size = b.shape
    p, pa, pb = np.zeros((size, size)), np.empty((size, size)), np.empty(size)
    for i in range(size):
        p[i, i] = weights[count, i]
    for k in range(count - 1, -1, -1):
        p[size - 1, size - 1] += added[k, LAST]
        p[0, 0] += added[k, FIRST]
        pivot = effort[k] + added[k, INPUT] + added[k, COUPLED]
        crossed = added[k, COUPLED] * coupling[k]
        for i in range(size):
            pb[i] = carried[k, i] = 0.0
            for j in range(size):
                pb[i] += p[i, j] * b[k, j]
                carried[k, i] += p[i, j] * c[k, j]
                pa[i, j] = 0.0
                for m in range(size):
                    pa[i, j] += p[i, m] * a[k, m, j]
        for i in range(size):
            pivot += b[k, i] * pb[i]
        pivots[k] = pivot
        for j in range(size):
            gain = crossed if j == size - 1 else 0.0
            for i in range(size):
                gain += pb[i] * a[k, i, j]
            gains[k, j] = gain / pivot
        for i in range(size):
            for j in range(i + 1):
                value = -pivot * gains[k, i] * gains[k, j]
                for m in range(size):
                    value += a[k, m, i] * pa[m, j]
                p[i, j] = p[j, i] = value
            p[i, i] += weights[k, i]
        p[size - 1, size - 1] += crossed * coupling[k]


@kernel
def _solve(
    a: FloatArray,
    b: FloatArray,
    c: FloatArray,
    coupling: FloatArray,
    gains: FloatArray,
    pivots: FloatArray,
    carried: FloatArray,
    slope: FloatArray,
    forward: FloatArray,
    slopes: FloatArray,
    inputs: FloatArray,
    states: FloatArray,
) -> None:
    """Write inputs and states of least cost without bounds, with a slope (n, 4) of the cost in what is bounded."""
    count, size = b.shape
    after, before = slopes[0], slopes[1]
    after[:] = 0.0
    for k in range(count - 1, -1, -1):
        after[size - 1] += slope[k, LAST]
        after[0] += slope[k, FIRST]
        pull = slope[k, INPUT] + slope[k, COUPLED]
        for i in range(size):
            after[i] += carried[k, i]
            pull += b[k, i] * after[i]
        forward[k] = -pull / pivots[k]
        for j in range(size):
            before[j] = -gains[k, j] * pull
            for i in range(size):
                before[j] += a[k, i, j] * after[i]
        before[size - 1] += coupling[k] * slope[k, COUPLED]
        after, before = before, after
    for k in range(count):
        value = forward[k]
        for i in range(size):
            value -= gains[k, i] * states[k, i]
        inputs[k] = value
        for i in range(size):
            ahead = c[k, i] + b[k, i] * value
            for j in range(size):
                ahead += a[k, i, j] * states[k, j]
            states[k + 1, i] = ahead


@kernel
def _read_values(coupling: FloatArray, inputs: FloatArray, states: FloatArray, values: FloatArray) -> None:
    """Write what is bounded (n, 4)."""
    last = states.shape[1] - 1
    for k in range(len(inputs)):
        values[k, INPUT], values[k, COUPLED] = inputs[k], inputs[k] + coupling[k] * states[k, last]
        values[k, LAST], values[k, FIRST] = states[k + 1, last], states[k + 1, 0]


@kernel
def _begin(
    weights: FloatArray,
    effort: FloatArray,
    limits: FloatArray,
    values: FloatArray,
    slacks: FloatArray,
    forces: FloatArray,
) -> float:
    """Write the first slacks, and multipliers, slacks times weights; return the mean of their products."""
    count, last, gap = len(values), weights.shape[1] - 1, 0.0
    for k in range(count):
        for j in range(_BOUNDED):
            low, high = limits[LOW, k, j], limits[HIGH, k, j]
            weight = effort[k] if j <= COUPLED else weights[k + 1, last if j == LAST else 0]
            for side in range(2):
                slack = values[k, j] - low if side == LOW else high - values[k, j]
                slacks[side, k, j] = max(slack, _LEAST_SLACK * (high - low))
                forces[side, k, j] = weight * slacks[side, k, j]
                gap += slacks[side, k, j] * forces[side, k, j] / (2 * _BOUNDED * count)
    return gap


@kernel
def _stiffen(
    limits: FloatArray,
    values: FloatArray,
    slacks: FloatArray,
    forces: FloatArray,
    centred: FloatArray,
    added: FloatArray,
    slope: FloatArray,
) -> None:
    """Write what the bounds, centred (2, n, 4), add to the values' weights and to the slope of the cost, (n, 4)."""
    for k in range(len(values)):
        for j in range(_BOUNDED):
            value = values[k, j]
            added[k, j] = slope[k, j] = 0.0
            for side in range(2):
                slack, force, inward = slacks[side, k, j], forces[side, k, j], 1.0 if side == LOW else -1.0
                given = limits[SOFTNESS, k, j] * force
                stiff = 1.0 / (slack + given)
                off = inward * (value - limits[side, k, j]) + given
                added[k, j] += force * stiff
                slope[k, j] -= inward * (force + (centred[side, k, j] - force * off) * stiff)
            slope[k, j] -= added[k, j] * value


@kernel
def _steps(
    limits: FloatArray,
    next_values: FloatArray,
    values: FloatArray,
    slacks: FloatArray,
    forces: FloatArray,
    centred: FloatArray,
    slack_steps: FloatArray,
    force_steps: FloatArray,
) -> float:
    """Write the steps of slacks and multipliers to a solution, and return the share that leaves them positive."""
    share = 1.0
    for k in range(len(values)):
        for j in range(_BOUNDED):
            for side in range(2):
                slack, force, inward = slacks[side, k, j], forces[side, k, j], 1.0 if side == LOW else -1.0
                soft = limits[SOFTNESS, k, j]
                off = inward * (next_values[k, j] - limits[side, k, j]) + soft * force
                rise = (centred[side, k, j] - force * off) / (slack + soft * force)
                grow = off - slack + soft * rise
                slack_steps[side, k, j], force_steps[side, k, j] = grow, rise
                if slack + share * grow < 0.0:
                    share = -slack / grow
                if force + share * rise < 0.0:
                    share = -force / rise
    return share if share == 1.0 else _SHORT_OF * share


@kernel
def _centre(
    slacks: FloatArray,
    forces: FloatArray,
    slack_steps: FloatArray,
    force_steps: FloatArray,
    share: float,
    gap: float,
    centred: FloatArray,
) -> None:
    """Write what the products of slacks and multipliers are to be, by how far the step towards 0 comes: (2, n, 4)."""
    reached, count = 0.0, slacks.shape[1]
    for side in range(2):
        for k in range(count):
            for j in range(_BOUNDED):
                slack = slacks[side, k, j] + share * slack_steps[side, k, j]
                reached += slack * (forces[side, k, j] + share * force_steps[side, k, j]) / (2 * _BOUNDED * count)
    for side in range(2):
        for k in range(count):
            for j in range(_BOUNDED):
                product = slack_steps[side, k, j] * force_steps[side, k, j]
                centred[side, k, j] = (reached / gap) ** 3 * gap - product
