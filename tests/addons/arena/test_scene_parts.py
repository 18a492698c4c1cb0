"""Scenes are built of rooms with walls round them."""

import math

import numpy as np
import pytest
from matplotlib.path import Path

from fg_mujoco.addons.arena.scenes.parts import walls_round
from scene_search import Clearances, disc_gets_through


def test_walls_stand_outside_of_their_room_and_meet_at_its_corners():
    room = np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (2.0, 3.0), (1.0, 1.0), (0.0, 3.0)])  # one corner juts in
    walls = walls_round(room)
    for wall, a, b in zip(walls, room, np.roll(room, -1, axis=0), strict=True):
        along = (b - a) / math.dist(a, b)
        corners = wall.corners() - a
        aside = along[0] * corners[:, 1] - along[1] * corners[:, 0]
        assert sorted(aside) == pytest.approx([-0.1, -0.1, 0.0, 0.0], abs=1e-12)
        reach = corners @ along
        assert reach.min() < 0.08 and reach.max() > math.dist(a, b) - 0.08  # cut off where the corner is sharp
        pulled_back = wall.corners() + 1e-6 * (np.array([wall.x, wall.y]) - wall.corners())
        assert not Path(room).contains_points(pulled_back).any()
    field = Clearances(walls, (-0.5, -0.5), (4.5, 3.5), 0.01)
    assert not disc_gets_through(field, (2.0, 0.5), (-0.4, -0.4), 0.01)
