"""Motion by odometry: a step of a way and a turn, its error, and the constant errors of the sensors themselves.

The speed is that of the wheels, which slip, and the yaw rate that of a gyroscope. Both may read some per cent too much
or too little all the time: these relative errors are part of what is estimated.

Source: S. Thrun, W. Burgard, D. Fox, Probabilistic Robotics, 2005, chapter 5: errors in proportion to the step.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

STATES = 5
"""Of an estimate: x [m], y [m], heading [rad], and what the speed and the yaw rate of odometry are to be multiplied by,
less 1."""

# standard deviations: of odometry in a step, share of the way and of the turn, and m and rad besides
WAY_ERROR, TURN_ERROR, SIDE_ERROR = (0.03, 0.002), (0.03, 0.001), (0.01, 0.002)
SCALE_ERROR = 0.06  # of odometry's relative errors before anything is known
SCALE_WALK = 0.0015  # by which they change in a step

@kernel
def predicted(
    mean: FloatArray,
    covariance: FloatArray,
    way: float,
    turn: float,
    way_error: float,
    turn_error: float,
    side_error: float,
    scale_walk: float,
) -> tuple[FloatArray, FloatArray]:
    """Return an estimate and its covariance after a step of odometry: `way` [m] ahead and `turn` [rad]."""
    state = mean.copy()
    heading = mean[2] + 0.5 * turn * (1.0 + mean[4])
    cos, sin = math.cos(heading), math.sin(heading)
    moved, turned = way * (1.0 + mean[3]), turn * (1.0 + mean[4])
    state[0] += moved * cos
    state[1] += moved * sin
    state[2] += turned
    jacobian = np.eye(len(mean))
    jacobian[0, 2], jacobian[1, 2] = -moved * sin, moved * cos
    jacobian[0, 3], jacobian[1, 3] = way * cos, way * sin
    jacobian[0, 4], jacobian[1, 4] = -0.5 * moved * sin * turn, 0.5 * moved * cos * turn
    jacobian[2, 4] = turn
    count = len(mean)
    half, grown = np.zeros((count, count)), np.zeros((count, count))
    for i in range(count):
        for j in range(count):
            for k in range(count):
                half[i, j] += jacobian[i, k] * covariance[k, j]
    for i in range(count):
        for j in range(count):
            for k in range(count):
                grown[i, j] += half[i, k] * jacobian[j, k]
    along, across = way_error * way_error, side_error * side_error
    grown[0, 0] += along * cos * cos + across * sin * sin
    grown[1, 1] += along * sin * sin + across * cos * cos
    grown[0, 1] += (along - across) * cos * sin
    grown[1, 0] += (along - across) * cos * sin
    grown[2, 2] += turn_error * turn_error
    grown[3, 3] += scale_walk * scale_walk
    grown[4, 4] += scale_walk * scale_walk
    return state, grown


def step_errors(way: float, turn: float) -> tuple[float, float, float]:
    """Return the standard deviations of a step of odometry: of the way [m], of the turn [rad], and to the side [m]."""
    way, turn = abs(way), abs(turn)
    return (
        WAY_ERROR[0] * way + WAY_ERROR[1], TURN_ERROR[0] * turn + TURN_ERROR[1], SIDE_ERROR[0] * way + SIDE_ERROR[1]
    )  # fmt: skip
