"""Holes in the walls of a map: how wide they are, and the walls that close them on request.

    hole = find_hole(clearance, inside, border)                # the widest way out, where it is narrowest
    free = close_holes(clearance, inside, border, hole.width)  # a wall across each way out, where it is narrowest

All are of one region of free pixels, (rows, columns), row 0 below. `clearance` is the distance to the nearest wall, 0
in walls, `inside` says which pixels are of the course for sure, and `border` which are at the image's border. Lengths
are in pixels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...messages import FloatArray
from .map_server import BoolArray

_ROUNDING = 1e-4  # [pixel]
_PRECISION = 0.005  # [pixel] of half the width of a hole
_INSIDE, _OUTSIDE = 0, 1  # numbers of the two wide parts in the graph; other pixels follow
_NEIGHBOURS = np.ones((3, 3))


@dataclass(frozen=True, kw_only=True)
class Hole:
    """The narrowest place of the widest way out of an image."""

    width: float
    row: int
    column: int


def find_hole(clearance: FloatArray, inside: BoolArray, border: BoolArray) -> Hole:
    """Return the hole through which the course reaches the image's border.

    Of all ways from the inside to the border the widest is looked at: where that is narrowest, a wall is missing.
    """
    from scipy import ndimage

    low, high = 0.0, float(clearance.max()) + 1.0  # they are joined where the clearance is low at least, not where high
    while high - low > _PRECISION:
        middle = 0.5 * (low + high)
        joined = _parts((clearance >= middle) | inside, inside)
        low, high = (middle, high) if (joined & border).any() else (low, middle)
    within = _parts((clearance >= high) | inside, inside)
    beyond = _parts((clearance >= low) & ~within, border)
    gates = np.argwhere(beyond & ndimage.binary_dilation(within, _NEIGHBOURS))
    row, column = gates[len(gates) // 2].tolist()
    return Hole(width=2.0 * float(clearance[clearance < high].max()), row=row, column=column)


def close_holes(clearance: FloatArray, inside: BoolArray, border: BoolArray, width: float) -> BoolArray:
    """Return the pixels that stay free when every way from inside to the border, up to `width`, is walled up.

    Ground that is wider than `width` belongs to the inside or to the border, whichever it is connected to. All other
    pixels go to the one of the two that they have the widest way to, which is the watershed of the clearance (J. Cousty
    et al., Watershed cuts, 2009). The walls stand where the two meet.
    """
    from scipy import ndimage

    wide = clearance > 0.5 * width + _ROUNDING
    within, beyond = _parts(wide | inside, inside), _parts(wide | border, border)
    within = _watershed(clearance, within, beyond & ~within)
    return np.asarray((clearance > 0.0) & (within | ~ndimage.binary_dilation(within)))


def _watershed(clearance: FloatArray, inside: BoolArray, outside: BoolArray) -> BoolArray:
    """Return the free pixels that have a wider way to `inside` than to `outside`."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components, minimum_spanning_tree

    region = clearance > 0.0
    rest = region & ~inside & ~outside
    count = 2 + np.count_nonzero(rest)
    number = np.full(region.shape, -1)
    number[inside], number[outside], number[rest] = _INSIDE, _OUTSIDE, np.arange(2, count)
    start, end, way = _ways(number, clearance)
    # the tree joins the two wide parts first, and every other pixel by its widest way to either: cut, it is two
    weights = np.append(1.0 / way, 1e-9)
    ends = np.append(start, _INSIDE), np.append(end, _OUTSIDE)
    tree = minimum_spanning_tree(csr_array((weights, ends), shape=(count, count))).tocoo()
    kept = tree.col != _OUTSIDE
    tree = csr_array((tree.data[kept], (tree.row[kept], tree.col[kept])), shape=(count, count))
    _, part = connected_components(tree, directed=False)
    return np.asarray(region & (part[number] == part[_INSIDE]))


def _ways(number: NDArray[Any], clearance: FloatArray) -> tuple[NDArray[Any], NDArray[Any], FloatArray]:
    """Return the pairs of numbers that meet, the lower one first, and the greatest width where they do, (m,) each."""
    starts, ends, ways = [], [], []
    widest = np.zeros((2, number.max() + 1), clearance.dtype)  # where a pixel meets one of the two wide parts
    for one, other in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        a, b = number[one], number[other]
        used = (np.minimum(a, b) >= 0) & (np.maximum(a, b) > _OUTSIDE)
        start, end = np.minimum(a[used], b[used]), np.maximum(a[used], b[used])
        way = np.minimum(clearance[one][used], clearance[other][used])
        wide = start <= _OUTSIDE
        np.maximum.at(widest, (start[wide], end[wide]), way[wide])
        starts.append(start[~wide])  # two single pixels meet once
        ends.append(end[~wide])
        ways.append(way[~wide])
    start, end = np.nonzero(widest)
    return (
        np.append(start, np.concatenate(starts)),
        np.append(end, np.concatenate(ends)),
        np.append(widest[start, end], np.concatenate(ways)),
    )


def _parts(mask: BoolArray, seeds: BoolArray) -> BoolArray:
    """Return the connected parts of a mask in which any of some pixels are."""
    from scipy import ndimage

    labels, count = ndimage.label(mask, _NEIGHBOURS)
    seeded = np.zeros(count + 1, dtype=bool)
    seeded[labels[seeds & mask]] = True
    return np.asarray(seeded[labels])
