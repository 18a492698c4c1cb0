"""Quadratic programs on a ring, against dense linear algebra and another solver."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from cases import each
from fg_mujoco.controllers.control.band_program import least_on_ring, solve_ring


def program(seed, count):
    """A factor F of H = F'F, as bands and dense, and a right side."""
    rng = np.random.default_rng(seed)
    factor = np.zeros((count, count))
    for i in range(count):
        factor[i, [i - 1, i, (i + 1) % count]] = rng.normal(0.0, 1.0, 3)
    factor += 2.0 * np.eye(count)
    dense = factor.T @ factor
    here = np.arange(count)
    bands = np.stack([dense[here, (here + k) % count] for k in range(3)])
    return factor, dense, bands, rng.normal(0.0, 5.0, count)


@each("count", [6, 7, 8, 40])
def test_equations_round_the_ring_are_solved(count):
    _, dense, bands, right = program(1, count)
    found = np.empty(count)
    solve_ring(bands, right, found)
    assert found == pytest.approx(np.linalg.solve(dense, right), rel=1e-8, abs=1e-10)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000), count=st.integers(8, 40))
def test_least_place_within_bounds_is_that_of_least_squares(seed, count):
    """H = F'F and g = -F't, so that g x + x H x / 2 is half of |F x - t|^2: scipy's bounded least squares."""
    factor, _, bands, target = program(seed, count)
    rng = np.random.default_rng(seed + 1)
    low = rng.uniform(-2.0, 0.5, count)
    high = low + rng.uniform(0.1, 2.0, count)
    found = np.empty(count)
    assert least_on_ring(bands, -factor.T @ target, low, high, found)
    expected = lsq_linear(factor, target, (low, high), method="bvls", tol=1e-14)
    assert (found >= low).all() and (found <= high).all()
    assert np.sum((factor @ found - target) ** 2) == pytest.approx(2.0 * expected.cost, rel=1e-5, abs=1e-6)


def test_program_without_finite_numbers_has_no_solution():
    _, _, bands, right = program(2, 12)
    right[3] = np.nan
    assert not least_on_ring(bands, right, np.full(12, -1.0), np.ones(12), np.empty(12))
