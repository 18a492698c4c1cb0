"""Intervals of studies, against published examples and exact coverage."""

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest

from cases import each
from fg_mujoco.addons.arena.study.intervals import median_interval, share_difference
from fg_mujoco.rollouts.shares import wilson


def pairs(both, first, second, neither):
    return [(True, True)] * both + [(True, False)] * first + [(False, True)] * second + [(False, False)] * neither


def test_the_interval_of_a_paired_difference_is_the_published_one():
    """Newcombe 1998, table II, method 10: of 36, 12, 2 and 0 pairs .0569 to .3404."""
    difference, low, high = share_difference(pairs(36, 12, 2, 0))
    assert difference == pytest.approx(0.2)
    assert (round(low, 4), round(high, 4)) == (0.0569, 0.3404)


def test_pairs_the_other_way_round_have_the_opposite_difference():
    for counts in itertools.product(range(4), repeat=4):
        both, first, second, neither = counts
        if sum(counts):
            difference, low, high = share_difference(pairs(*counts))
            opposite, other_low, other_high = share_difference(pairs(both, second, first, neither))
            assert opposite == pytest.approx(-difference)
            assert (other_low, other_high) == (pytest.approx(-high), pytest.approx(-low))
            assert -1.0 - 1e-12 <= low <= difference <= high <= 1.0 + 1e-12
    assert math.isnan(share_difference([])[0]) and share_difference([])[1:] == (-1.0, 1.0)


@each("count", [1, 5, 6, 7, 8, 9, 17, 40, 1200])
def test_the_interval_of_a_median_covers_it_and_is_the_narrowest_of_its_kind(count):
    """How often the median lies outside is counted exactly: as often as k - 1 or fewer of n coins are heads, twice."""
    found = median_interval(range(1, count + 1))

    def outside(place):
        return Fraction(2 * sum(math.comb(count, heads) for heads in range(place)), 2**count)

    if found is None:
        assert outside(1) > Fraction(1, 20)
    else:
        low, high = found
        assert low + high == count + 1
        assert outside(low) <= Fraction(1, 20) < outside(low + 1)


def test_the_interval_of_a_median_does_not_care_for_the_order():
    values = np.random.default_rng(3).normal(size=20).tolist()
    assert median_interval(values) == median_interval(values[::-1]) == tuple(sorted(values)[index] for index in (5, 14))


def test_a_share_covers_what_it_should():
    """How often Wilson's interval of 10 runs covers a share of .3 is counted exactly: in 92.4 % of the outcomes."""
    covered = [k for k in range(11) if wilson(k, 10)[0] <= 0.3 <= wilson(k, 10)[1]]
    assert sum(math.comb(10, k) * 0.3**k * 0.7 ** (10 - k) for k in covered) == pytest.approx(0.924, abs=5e-4)
