"""Sums of several numbers at once have the bits of loops."""

import numpy as np

from cases import each
from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.vehicle.tire_solve import add_scaled_4, add_scaled_16


@kernel
def add_to_4(numbers, to, of, factor):
    add_scaled_4(numbers, to, of, factor)


@kernel
def add_to_16(numbers, to, of, factor):
    add_scaled_16(numbers, to, of, factor)


@each(("lanes", "add"), [(4, add_to_4), (16, add_to_16)])
@each(("to", "of"), [(0, 16), (21, 3), (7, 7)])
def test_a_sum_of_several_numbers_has_the_bits_of_a_loop(lanes, add, to, of):
    numbers = np.random.default_rng(lanes + to).normal(size=40)
    expected = numbers.copy()
    for k, other in enumerate(numbers[of : of + lanes].tolist()):
        expected[to + k] += 0.3 * other
    add(numbers, to, of, 0.3)
    assert numbers.tobytes() == expected.tobytes()
