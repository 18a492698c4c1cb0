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

The work is done in native/addons/drivers/ltv_program.cpp.
"""

from __future__ import annotations

from fg_mujoco.native import core

INPUT, COUPLED, LAST, FIRST = range(4)
"""Columns of what is bounded: the input, the input and a multiple of the last entry of the state before it, and the
last and the first entry of the state after it."""
LOW, HIGH, SOFTNESS = range(3)
"""Rows of `limits`: the bounds, and one over the weight of the squared distance beyond them; 0: they are hard."""

solve_program = core.solve_program
"""Write the solution, and return after how many of at most `most` steps it converged; 0: not, or it is not finite.

Args:
  program: the tuple (a, b, c, weights, effort, coupling, limits, start). The system is `a` (n, states, states), `b`
    (n, states) for its input, and the known disturbance `c` (n, states). `weights` of the squared states, from 0, are
    (n + 1, states), `effort` of the squared inputs, above 0, (n,). The last entry is added to the input `coupling` (n,)
    times. `limits` (3, n, 4), see LOW, are finite, and apart.
  inputs: (n,) written to.
  states: (n + 1, states) written to.
  most: steps.
"""
