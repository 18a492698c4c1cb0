"""Where the beams of a scan point."""

import math

import numpy as np

from cases import each
from fg_mujoco.controllers.perception.scan_geometry import nearest_beam


@each("increment", [math.radians(0.25), 0.01, 1e-6])
def test_the_beam_towards_a_point_is_that_of_its_arctangent_to_the_bit(increment):
    draw = np.random.default_rng(1)
    bearings = draw.uniform(-math.pi, math.pi, 20_000)
    halfway = increment * (np.rint(bearings / increment) + 0.5) + draw.normal(0.0, 1e-6, len(bearings))
    least = -0.75 * math.pi
    for bearing in np.concatenate((bearings, halfway, np.pi / 2 * np.arange(-2, 3))):
        ahead, left = 3.0 * math.cos(bearing), 3.0 * math.sin(bearing)
        place = np.rint((math.atan2(left, ahead) - least) / increment)
        assert nearest_beam(least, increment, ahead, left) == place


@each("point", [(0.0, 0.0), (-1.0, 0.0), (-1.0, -0.0), (0.0, 1.0), (0.0, -1.0)])
def test_the_beam_towards_a_point_on_an_axis_is_that_of_its_arctangent(point):
    ahead, left = point
    expected = np.rint((math.atan2(left, ahead) + 2.0) / 0.01)
    assert nearest_beam(-2.0, 0.01, ahead, left) == expected
