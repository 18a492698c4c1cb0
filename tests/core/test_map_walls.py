"""Walls are traced along the pixels' edges, each within half a pixel."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import ndimage

from cases import each
from fg_mujoco.course.maps.walls import TOLERANCE, find_hole, outlines, trace
from fg_mujoco.course.polyline import enclosed_area, self_crossings, step_lengths
from map_oracles import box_room, loop_difference, ring


def middles_of_edges(region):
    """Middle of each edge between a pixel of the region and one that is not, one after the other."""
    padded = np.pad(region, 1)
    found = set()
    for row, column in np.argwhere(padded):
        for down, right in ((0, 1), (0, -1), (1, 0), (-1, 0)):
            if not padded[row + down, column + right]:
                found.add((column - 1 + 0.5 + 0.5 * right, row - 1 + 0.5 + 0.5 * down))
    return found


def distances(points, loop):
    along = np.roll(loop, -1, axis=0) - loop
    share = np.sum((points[:, None] - loop) * along, axis=2) / np.sum(along * along, axis=1)
    return np.linalg.norm(points[:, None] - loop - np.clip(share, 0, 1)[..., None] * along, axis=2).min(axis=1)


@pytest.mark.slow
@given(arrays(bool, (9, 12)))
@settings(max_examples=200, deadline=None)
def test_outlines_pass_every_edge_once_with_the_region_to_the_left(region):
    loops = outlines(region)
    points = [tuple(point) for loop in loops for point in loop]
    assert len(points) == len(set(points))
    assert set(points) == middles_of_edges(region)
    for loop in loops:
        assert step_lengths(loop).max() <= 1.0  # from one edge to a neighbour
    pieces = ndimage.label(region)[1]
    solids = ndimage.label(~np.pad(region, 1), np.ones((3, 3)))[1]
    areas = [enclosed_area(loop) for loop in loops]
    assert sum(area > 0.0 for area in areas) == pieces  # an outer edge each
    assert sum(area < 0.0 for area in areas) == solids - 1  # and a hole for each solid but the one all round


@each("region", [ring(), box_room()], ids=["ring", "room"])
def test_no_edge_is_further_from_its_wall_than_the_tolerance(region):
    for outline in outlines(region):
        wall = trace(outline)
        assert distances(outline, wall).max() <= TOLERANCE + 1e-5
        assert loop_difference(wall, outline) < 2.0 * TOLERANCE
        assert len(wall) < 0.2 * len(outline)


@pytest.mark.slow
@given(arrays(bool, (7, 7)))
@settings(max_examples=100, deadline=None)
def test_what_is_small_does_not_vanish(region):
    for outline in outlines(region):
        wall = trace(outline)
        assert len(wall) >= 3
        assert np.sign(enclosed_area(wall)) == np.sign(enclosed_area(outline))
        assert abs(enclosed_area(wall)) > 0.5 * abs(enclosed_area(outline))
        assert len(self_crossings(wall)[0]) == 0
        assert distances(outline, wall).max() <= TOLERANCE + 1e-5


@given(arrays(bool, (9, 12), fill=st.just(True)))
@settings(max_examples=200, deadline=None)
def test_a_hole_is_as_wide_as_the_widest_way_and_is_closed_from_wall_to_wall(free):
    free[4, 6] = True
    inside, rim = np.zeros_like(free), np.ones_like(free)
    inside[4, 6], rim[1:-1, 1:-1] = True, False
    clearance = ndimage.distance_transform_edt(np.pad(free, 1, constant_values=False))[1:-1, 1:-1]

    def reached(ground, neighbours):
        labels = ndimage.label(ground | inside, neighbours)[0]
        return ground & (labels == labels[4, 6])

    ways = [level for level in np.unique(clearance)[1:] if (reached(clearance >= level, np.ones((3, 3))) & rim).any()]
    assume(ways)
    hole = find_hole(clearance, inside, free & rim)
    assert hole.width == pytest.approx(2.0 * ways[-1])
    assert clearance[hole.row, hole.column] >= ways[-1] or inside[hole.row, hole.column]
    assert hole.closed[4, 6] and not (hole.closed & ~free).any()
    assert not (reached(hole.closed, None) & rim).any()
