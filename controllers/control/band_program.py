"""A quadratic program on a ring of points, each of which moves within its bounds.

    converges = least_on_ring(bands, gradient, low, high, x)

It minimises g x + x H x / 2 with low <= x <= high. H is symmetric and positive definite, and couples each point with
the two before and the two behind it, round the ring: so do the squares of second differences along a closed line.

Source: the predictor and corrector of S. Mehrotra, On the Implementation of a Primal-Dual Interior Point Method, SIAM
Journal on Optimization 2(4), 1992. The equations of a step are those of H with a greater diagonal. They are solved by
the LDL factors of the band, with the last two points as a border. A program takes 10 to 20 steps, however many points.

The work is done in native/controllers/control/band_program.cpp.
"""

from __future__ import annotations

from fg_mujoco.native import core

least_on_ring = core.least_on_ring
"""Write where the program is least to x (n,), and return whether the method converges.

It takes, in this order:
  bands: H[i, i], H[i, i + 1] and H[i, i + 2], round the ring, (3, n), n at least 6.
  gradient: g, (n,).
  low: least of each x, (n,).
  high: greatest of each x, (n,), above `low`.
  x: (n,), written to.
"""

solve_ring = core.solve_ring
"""Write x of H x = right (n,): the band without the last two points first, for the right side and for these two."""
