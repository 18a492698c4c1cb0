"""Walls that a map lacks, drawn on request: across gaps, and along the image's border.

    closed = close_gaps(occupancy, 1.5)        # gaps of up to 1.5 m
    closed = wall_the_border(occupancy)

A gap is a narrow place on a way from the course out of the image. Ground that is wider than the gap is divided in two
first: what of it reaches the image's border without passing a narrower place, and what does not. All other free pixels
go to the one of the two that they have the widest way to, which is the watershed of the distance to the walls (J. Cousty
et al., Watershed cuts: minimum spanning forests and the drop of water principle, 2009). The wall stands where the two
meet, at the narrowest place of each way. Narrow places that do not lead out of the image stay open.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...messages import FloatArray
from .map_server import BoolArray, OccupancyMap

_ROUNDING = 1e-6  # [pixel]
_INSIDE, _OUTSIDE = 0, 1  # numbers of the two wide parts in the graph; other pixels follow


def wall_the_border(occupancy: OccupancyMap) -> OccupancyMap:
    """Return the map with a wall of one pixel along the image's border."""
    free = np.zeros_like(occupancy.free)
    free[1:-1, 1:-1] = occupancy.free[1:-1, 1:-1]
    return replace(occupancy, free=free)


def close_gaps(occupancy: OccupancyMap, width: float) -> OccupancyMap:
    """Return the map with a wall across every gap of up to `width` [m] that leads out of the image."""
    from scipy import ndimage

    free = occupancy.free
    clearance = ndimage.distance_transform_edt(free)
    wide, _ = ndimage.label(clearance > 0.5 * width / occupancy.resolution + _ROUNDING, np.ones((3, 3)))
    border = np.ones_like(free)
    border[1:-1, 1:-1] = False
    outside = np.isin(wide, np.setdiff1d(wide[border], 0)) | (border & free)
    inside = (wide > 0) & ~outside
    if not inside.any():
        return occupancy
    inside = _nearer_by_the_wider_way(free, clearance, inside, outside)
    return replace(occupancy, free=free & (inside | ~ndimage.binary_dilation(inside)))


def _nearer_by_the_wider_way(
    free: BoolArray, clearance: FloatArray, inside: BoolArray, outside: BoolArray
) -> BoolArray:
    """Return which free pixels have a wider way to `inside` than to `outside`, these two included or not."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components, minimum_spanning_tree

    rest = free & ~inside & ~outside
    number = np.full(free.shape, -1)
    number[inside], number[outside] = _INSIDE, _OUTSIDE
    count = 2 + np.count_nonzero(rest)
    number[rest] = np.arange(2, count)
    ends, ways = [], []
    for one, other in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        pair = np.sort(np.stack((number[one], number[other]), axis=-1), axis=-1)
        used = (pair[..., 0] >= 0) & (pair[..., 1] > 1) & (pair[..., 0] != pair[..., 1])
        ends.append(pair[used])
        ways.append(np.minimum(clearance[one], clearance[other])[used])
    pairs, way = np.concatenate(ends), np.concatenate(ways)
    order = np.argsort(-way, kind="stable")  # of several edges between two numbers the widest counts
    _, first = np.unique(pairs[order] @ (count, 1), return_index=True)
    (start, end), way = pairs[order][first].T, way[order][first]
    # the tree joins the two wide parts first, and everything else by its widest way to either: cut, it is two
    graph = csr_array(
        (np.append(1.0 / way, 1e-9), (np.append(start, _INSIDE), np.append(end, _OUTSIDE))), (count, count)
    )
    tree = minimum_spanning_tree(graph).tolil()
    tree[_INSIDE, _OUTSIDE] = 0.0
    _, part = connected_components(tree.tocsr(), directed=False)
    return free & (number >= 0) & (part[number] == part[_INSIDE])
