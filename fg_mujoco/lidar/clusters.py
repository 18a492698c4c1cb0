"""Triangles in clusters of neighbours that face the same way, as `scanline` wants them: drawn or skipped as a whole.

A cluster is stored as its edges, each once, because the scan plane cuts edges, and as its triangles, three edges each.
Which vertex of an edge comes first, and the order of the edges of a triangle, follow from the coordinates alone. An
edge that two clusters share is therefore cut to the same bits in both, whatever the order of the geoms.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..messages import FloatArray

CLUSTER_TRIANGLES = 64  # at most
_HEIGHT_WEIGHT = 64.0  # of a distance upwards against one aside: a level scan plane misses what is all below or above
_TURN_LENGTH = 1.0  # [m] of distance that counts as much as 1 rad between the normals of two faces
_LANES = 8  # a cluster's edges are filled up to a multiple of the numbers that one machine instruction works on
_LEAST_AREA = 1e-15  # [m^2] mjMINVAL: MuJoCo's rays pass through smaller triangles


@dataclass(frozen=True, kw_only=True, eq=False)
class Clusters:
    """The clusters of one frame."""

    edges: FloatArray  # (6, e) [m] both ends of each edge; or the vertices (3, v), in the order of their coordinates
    triangles: NDArray[np.uint16]  # (t, 3) edges of each triangle, counted from the first of its cluster; or vertices
    boxes: FloatArray  # (7, b) [m] centre, half-sizes and half diagonal of the box around each cluster
    spans: NDArray[np.int32]  # (b, 4) first edge, behind the last edge, first triangle, behind the last triangle


def make_clusters(vertices: FloatArray, triangles: NDArray[np.int32]) -> Clusters:
    """Return the clusters of `triangles` (t, 3), indices of `vertices` (v, 3) [m]."""
    places, corners, cluster, first_triangle = _clustered(vertices, triangles, _HEIGHT_WEIGHT)

    # Each edge once in each cluster; the upright ones first, because a level scan plane cuts those.
    ends = np.sort(corners[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
    edges, of_triangle = _distinct_rows(np.column_stack((np.repeat(cluster, 3), ends)))
    along = places[edges[:, 2]] - places[edges[:, 1]]
    lying = np.hypot(along[:, 0], along[:, 1]) > np.abs(along[:, 2])
    order = np.lexsort((edges[:, 2], edges[:, 1], lying, edges[:, 0]))
    edges, rank = edges[order], np.argsort(order)
    first_edge = np.searchsorted(edges[:, 0], np.arange(len(first_triangle)))
    of_triangle = np.sort(rank[of_triangle.reshape(-1, 3)], axis=1) - first_edge[cluster][:, None]

    # Fill up with edges of no length, which no plane cuts.
    counts = np.diff(first_edge)
    filled = np.concatenate(([0], np.cumsum(-(-counts // _LANES) * _LANES)))
    stored = np.empty((6, filled[-1]))
    stored[:] = np.concatenate([places[edges[first_edge[:-1], 1]]] * 2, axis=1).T.repeat(np.diff(filled), axis=1)
    slot = np.arange(len(edges)) + np.repeat(filled[:-1] - first_edge[:-1], counts)
    stored[:, slot] = np.hstack((places[edges[:, 1]], places[edges[:, 2]])).T

    return Clusters(
        edges=stored,
        triangles=of_triangle.astype(np.uint16),
        boxes=_boxes(places[corners], first_triangle[:-1]),
        spans=np.column_stack((filled[:-1], filled[1:], first_triangle[:-1], first_triangle[1:])).astype(np.int32),
    )


def make_vertex_clusters(vertices: FloatArray, triangles: NDArray[np.int32]) -> Clusters:
    """Return the clusters of `triangles` (t, 3), indices of `vertices` (v, 3) [m], told by vertices."""
    places, corners, cluster, first_triangle = _clustered(vertices, triangles, 1.0)
    own, of_triangle = _distinct_rows(np.column_stack((np.repeat(cluster, 3), np.sort(corners, axis=1).ravel())))
    first = np.searchsorted(own[:, 0], np.arange(len(first_triangle)))
    return Clusters(
        edges=np.ascontiguousarray(places[own[:, 1]].T),
        triangles=(of_triangle.reshape(-1, 3) - first[cluster][:, None]).astype(np.uint16),
        boxes=_boxes(places[corners], first_triangle[:-1]),
        spans=np.column_stack((first[:-1], first[1:], first_triangle[:-1], first_triangle[1:])).astype(np.int32),
    )


def _clustered(
    vertices: FloatArray, triangles: NDArray[np.int32], height_weight: float
) -> tuple[FloatArray, Any, Any, Any]:
    """Return places (v, 3), corners (t, 3) among them, cluster (t,) of each triangle, and first of each and behind."""
    places, index = _distinct_rows(vertices + 0.0)  # in the order of x, y, z; -0.0 is 0.0
    corners = index[triangles.reshape(-1, 3)]
    sides = places[corners[:, 1:]] - places[corners[:, :1]]
    normals = np.cross(sides[:, 0], sides[:, 1])
    doubled_areas = np.linalg.norm(normals, axis=1)
    solid = doubled_areas > _LEAST_AREA
    corners, normals = corners[solid], normals[solid] / doubled_areas[solid, None]
    at = places[corners]
    heights = 0.5 * (at[:, :, 2].min(axis=1) + at[:, :, 2].max(axis=1))  # the same for both halves of an upright face
    features = (at[:, :, :2].mean(axis=1), height_weight * heights, _TURN_LENGTH * normals)
    members = _split(np.column_stack(features))
    cluster = np.repeat(np.arange(len(members)), [len(ids) for ids in members])
    corners = corners[np.concatenate([np.empty(0, np.intp), *members])]
    return places, corners, cluster, np.searchsorted(cluster, np.arange(len(members) + 1))


def _boxes(at: FloatArray, starts: NDArray[np.intp]) -> FloatArray:
    """Return the boxes (7, b) around triangles (t, 3, 3) from each start on."""
    low, high = np.minimum.reduceat(at.min(axis=1), starts), np.maximum.reduceat(at.max(axis=1), starts)
    centre, half = 0.5 * (low + high), 0.5 * (high - low)
    return np.vstack((centre.T, half.T, np.linalg.norm(half, axis=1)))


def _distinct_rows(rows: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.intp]]:
    """Return the distinct rows of (n, k) in order, and which each is (n,), as numpy.unique, which imports numpy.ma."""
    order = np.lexsort(rows.T[::-1])
    ordered = rows[order]
    first = np.append(True, (ordered[1:] != ordered[:-1]).any(axis=1))[: len(rows)]
    which = np.empty(len(rows), np.intp)
    which[order] = np.cumsum(first) - 1
    return ordered[first], which


def _split(places: FloatArray) -> list[NDArray[np.intp]]:
    """Halve `places` (n, k) where they spread most, again and again. Returns the indices of each part."""
    parts, waiting = [], [np.arange(len(places))]
    while waiting:
        part = waiting.pop()
        if len(part) <= CLUSTER_TRIANGLES:
            parts.append(part)
            continue
        spread = places[part]
        low, high = spread.min(axis=0), spread.max(axis=0)
        axis = int(np.argmax(high - low))
        left = spread[:, axis] < 0.5 * (low[axis] + high[axis])
        if not left.any():  # all in one place
            left = np.arange(len(part)) < len(part) // 2
        waiting += [part[left], part[~left]]
    return [part for part in parts if len(part)]
