"""The medial axis of a region of pixels as a graph, and the ways along it: a closed loop, or an open way.

    axis = medial_axis(region, outlines(region))
    loop = axis.loop_around(hole)            # (n, 2), None where there is none
    way = axis.longest_way()

The medial axis has all points that are equally far from two walls. It is made of those edges of the Voronoi diagram of
the walls' points that are inside the region (J. Brandt and V. Algazi, 1992), so that its points are finer than pixels.
An axis of pixels, as scikit-image has it, changes rows at random where a corridor is an even number of pixels wide:
its lengths are 7 to 17 % too great, and an open way ends in another corner.

Of all loops round a hole, the one with the least sum of length over squared clearance is taken. It passes an obstacle
on the wide side.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...messages import FloatArray
from ..polyline import IndexArray, enclosed_area

_LEAST_CLEARANCE = 1.0  # [pixel] of the medial axis; narrower is between two neighbouring points of one wall
_MANY = 8000  # points of walls; on straight walls, Qhull's time grows with their third power unless they are shifted
_SHIFT = 1e-4  # [pixel] at most; it moves the axis by some hundredths of a pixel at most
_OFF_GRID = 1e-3 * math.pi  # [pixel] by which the ray that tells loops apart misses all points


@dataclass(frozen=True, kw_only=True, eq=False)
class MedialAxis:
    """Points where two walls are equally far, and what of them is joined. In pixels."""

    points: FloatArray  # (n, 2)
    clearance: FloatArray  # (n,) to the nearest wall
    edges: IndexArray  # (m, 2) of points

    def loop_around(self, hole: FloatArray, least_clearance: float = 0.0) -> FloatArray | None:
        """Return the closed line of least cost that goes round a hole's outline (k, 2) once, counterclockwise.

        None where no line does that keeps `least_clearance` [pixel] from the walls. Shape (n, 2).
        """
        from scipy.sparse.csgraph import dijkstra

        # a ray from the hole to the right: a loop goes round the hole if it crosses the ray an odd number of times
        x, y = hole[np.argmax(hole[:, 0])] - (0.0, _OFF_GRID)
        edges = self.edges[(self.clearance[self.edges] >= least_clearance).all(axis=1)]
        a, b = self.points[edges[:, 0]], self.points[edges[:, 1]]
        straddles = (a[:, 1] > y) != (b[:, 1] > y)
        with np.errstate(divide="ignore", invalid="ignore"):
            at = a[:, 0] + (y - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
        across = straddles & (at > x)
        # each point twice, before and after an odd number of crossings: edges that cross lead from one to the other
        count = len(self.points)
        start, end = edges.T
        flip = np.where(across, count, 0)
        graph = _graph(
            np.concatenate((start, start + count)), np.concatenate((end + flip, end + count - flip)),
            np.tile(self._cost(edges), 2), 2 * count,
        )  # fmt: skip
        best: tuple[float, IndexArray] = (math.inf, np.empty(0, dtype=np.intp))
        for seed in np.unique(start[across]):  # every such loop passes one of them
            cost, before = dijkstra(graph, directed=False, indices=seed, return_predecessors=True, limit=best[0])
            if cost[seed + count] < best[0]:
                best = float(cost[seed + count]), _walk(before, int(seed + count))[1:] % count
        if not math.isfinite(best[0]):
            return None
        loop = self.points[best[1]]
        return loop if enclosed_area(loop) > 0.0 else loop[::-1]

    def longest_way(self, room: float) -> FloatArray:
        """Return the longest of the shortest ways from one point to another, all `room` [pixel] from walls at least.

        Exact where the medial axis is a tree. Shape (n, 2), empty where there is no such point.
        """
        from scipy.sparse.csgraph import connected_components, dijkstra

        start, end = self.edges[(self.clearance[self.edges] >= room).all(axis=1)].T
        if len(start) == 0:
            return np.empty((0, 2))
        lengths = np.hypot(*(self.points[start] - self.points[end]).T)
        graph = _graph(start, end, lengths, len(self.points))
        _, part = connected_components(graph, directed=False)
        largest = np.bincount(part[start], weights=lengths).argmax()
        far = int(start[part[start] == largest][0])
        for _ in range(2):  # the farthest from anywhere is an end of the longest
            away, before = dijkstra(graph, directed=False, indices=far, return_predecessors=True)
            far = int(np.argmax(np.where(np.isfinite(away), away, -1.0)))
        return self.points[_walk(before, far)]

    def _cost(self, edges: IndexArray) -> FloatArray:
        start, end = edges.T
        lengths = np.hypot(*(self.points[start] - self.points[end]).T)
        return np.asarray(lengths / np.minimum(self.clearance[start], self.clearance[end]) ** 2)


def medial_axis(region: NDArray[np.bool_], outlines: list[FloatArray]) -> MedialAxis:
    """Return the medial axis of a region (rows, columns), row 0 below, with the `outlines` of `walls.outlines`."""
    from scipy.spatial import Voronoi

    sites = np.concatenate(outlines)
    if len(sites) > _MANY:
        sites = sites + np.random.default_rng(0).uniform(-_SHIFT, _SHIFT, sites.shape)
    diagram = Voronoi(sites)
    column, row = np.floor(diagram.vertices).astype(int).T
    inside = (column >= 0) & (row >= 0) & (column < region.shape[1]) & (row < region.shape[0])
    inside[inside] = region[row[inside], column[inside]]
    edges = np.array(diagram.ridge_vertices)
    pairs = sites[diagram.ridge_points]
    apart = np.hypot(*(pairs[:, 0] - pairs[:, 1]).T) > 2.0 * _LEAST_CLEARANCE
    used = apart & (edges >= 0).all(axis=1) & inside[edges].all(axis=1)
    edges, owner = edges[used], diagram.ridge_points[used, 0]
    numbers, edges = np.unique(edges, return_inverse=True)
    edges = edges.reshape(-1, 2)
    points = diagram.vertices[numbers]
    clearance = np.empty(len(points))
    for side in range(2):
        clearance[edges[:, side]] = np.hypot(*(points[edges[:, side]] - sites[owner]).T)
    return MedialAxis(points=points, clearance=clearance, edges=edges)


def _graph(start: IndexArray, end: IndexArray, weights: FloatArray, count: int) -> Any:
    from scipy.sparse import csr_array

    return csr_array((np.maximum(weights, 1e-12), (start, end)), shape=(count, count))  # 0 would be no edge


def _walk(before: IndexArray, last: int) -> IndexArray:
    """Follow predecessors back to the source, and return the points from there to the last."""
    way = [last]
    while before[way[-1]] >= 0:
        way.append(int(before[way[-1]]))
    return np.array(way[::-1])
