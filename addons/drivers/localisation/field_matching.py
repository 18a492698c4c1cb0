"""Matches the ends of a scan's beams with the walls of a map: least squares on the signed distance field.

    pose = match(field, ends, mean, information, steps)

Each end should lie on a wall, where the distance is 0. A step of Gauss and Newton moves the pose against the gradient
of the distances at the ends; ends far from any wall, such as those on what is not in the map, count little (the kernel
of Geman and McClure). What was known before is a prior.

Source: S. Kohlbrecher et al., A Flexible and Scalable SLAM System with Full 3D Motion Estimation, SSRR 2011 (Hector),
with the distance in place of the occupancy; S. Geman and D. McClure, Bulletin of the ISI 52, 1987.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

from .distance_field import Distances


@kernel
def solved(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Return the solution of a symmetric, positive definite system (n, n), (n,): Cholesky's decomposition."""
    count = len(right)
    lower = np.zeros((count, count))
    for i in range(count):
        for j in range(i + 1):
            value = matrix[i, j]
            for k in range(j):
                value -= lower[i, k] * lower[j, k]
            lower[i, j] = math.sqrt(max(value, 1e-12)) if i == j else value / lower[j, j]
    found = right.copy()
    for i in range(count):
        for k in range(i):
            found[i] -= lower[i, k] * found[k]
        found[i] /= lower[i, i]
    for i in range(count - 1, -1, -1):
        for k in range(i + 1, count):
            found[i] -= lower[k, i] * found[k]
        found[i] /= lower[i, i]
    return found


@kernel
def inverse(matrix: FloatArray) -> FloatArray:
    """Return the inverse of a symmetric, positive definite matrix (n, n)."""
    count = len(matrix)
    found = np.empty((count, count))
    for k in range(count):
        unit = np.zeros(count)
        unit[k] = 1.0
        found[:, k] = solved(matrix, unit)
    return found


@kernel
def match(
    distances: Distances,
    origin: FloatArray,
    resolution: float,
    ends: FloatArray,
    mean: FloatArray,
    prior: FloatArray,
    error: float,
    gate: float,
    steps: int,
) -> tuple[FloatArray, FloatArray, float]:
    """Return the estimate at which the ends lie on walls, its information, and the share of ends within half the gate.

    Args:
      distances: of the field, see DistanceField.
      origin: of it [m].
      resolution: of it [m].
      ends: of the beams (b, 2) in the frame of the rear axle [m].
      mean: estimate before, (n,) with the pose first.
      prior: its information, (n, n).
      error: standard deviation of a distance [m].
      gate: distance from which on an end counts little [m].
      steps: of Gauss and Newton.
    """
    count, rows, columns = len(mean), distances.shape[0], distances.shape[1]
    state, fits = mean.copy(), 0
    information = prior.copy()
    for _ in range(steps):
        information[:] = prior
        cos, sin = math.cos(state[2]), math.sin(state[2])
        off = mean - state
        right = np.zeros(count)
        for i in range(count):
            for j in range(count):
                right[i] += prior[i, j] * off[j]
        fits = 0
        for beam in range(len(ends)):
            arm_x = cos * ends[beam, 0] - sin * ends[beam, 1]
            arm_y = sin * ends[beam, 0] + cos * ends[beam, 1]
            column = (state[0] + arm_x - origin[0]) / resolution
            row = (state[1] + arm_y - origin[1]) / resolution
            if not (0.0 <= column < columns - 1.001 and 0.0 <= row < rows - 1.001):
                continue
            j, i = int(column), int(row)
            u, v = column - j, row - i
            a, b = float(distances[i, j]), float(distances[i, j + 1])
            c, d = float(distances[i + 1, j]), float(distances[i + 1, j + 1])
            distance = (1.0 - v) * (a + u * (b - a)) + v * (c + u * (d - c))
            slope_x = ((1.0 - v) * (b - a) + v * (d - c)) / resolution
            slope_y = ((1.0 - u) * (c - a) + u * (d - b)) / resolution
            turned = slope_y * arm_x - slope_x * arm_y
            share = distance / gate
            weight = 1.0 / (1.0 + share * share)
            weight = weight * weight / (error * error)
            fits += abs(distance) < 0.5 * gate
            information[0, 0] += weight * slope_x * slope_x
            information[0, 1] += weight * slope_x * slope_y
            information[0, 2] += weight * slope_x * turned
            information[1, 1] += weight * slope_y * slope_y
            information[1, 2] += weight * slope_y * turned
            information[2, 2] += weight * turned * turned
            right[0] -= weight * slope_x * distance
            right[1] -= weight * slope_y * distance
            right[2] -= weight * turned * distance
        information[1, 0], information[2, 0] = information[0, 1], information[0, 2]
        information[2, 1] = information[1, 2]
        state += solved(information, right)
    return state, information, fits / max(len(ends), 1)
