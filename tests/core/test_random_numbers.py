"""Random numbers of the native core are numpy's."""

import numpy as np

from cases import each
from fg_mujoco.lidar.random_numbers import draw_normals, draw_shares, generator_state, ziggurat


@each("seed", [0, 7, 2**62 + 1])
def test_numbers_are_those_of_numpys_generator(seed):
    """Oracle: numpy. Of 100000 normal numbers some 27 lie in the tail, and 1100 in the wedges of the ziggurat."""
    state, generator = generator_state(seed), np.random.default_rng(seed)
    found, wanted = np.empty(100_000), np.empty(100_000)
    for _ in range(2):
        draw_normals(state, *ziggurat(), found)
        assert found.tobytes() == generator.standard_normal(out=wanted).tobytes()
        assert np.count_nonzero(np.abs(found) > 3.6541528853610088) > 5
        draw_shares(state, found)
        assert found.tobytes() == generator.random(out=wanted).tobytes()
