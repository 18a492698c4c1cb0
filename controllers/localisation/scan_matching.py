"""Scan matching on a map: a Kalman filter whose measurement is the scan laid on the walls.

It moves by odometry, whose constant errors it estimates, too: a speed and a yaw rate that read 5 % too much are found
within some metres. The scan corrects the prediction by `field_matching.match`, with the prediction as its prior: along
a straight corridor, where all places look alike, the car stays where odometry has it.

Where the car is not known, a particle filter finds it first; so it does where the scan fits no longer.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from fg_mujoco.kernels import kernel
from fg_mujoco.messages import FloatArray

from .distance_field import DistanceField
from .field_matching import STATES, inverse, match

if TYPE_CHECKING:
    from .particle_filter import ParticleFilter

BEAMS = 120
"""Of a scan that are matched, evenly spread."""

# standard deviations: of odometry in a step, share of the way and of the turn, and m and rad besides
WAY_ERROR, TURN_ERROR, SIDE_ERROR = (0.03, 0.002), (0.03, 0.001), (0.01, 0.002)
SCALE_ERROR = 0.06  # of odometry's relative errors before anything is known
SCALE_WALK = 0.0015  # by which they change in a step

_ERROR, _GATE, _STEPS = 0.08, 0.3, 5  # [m], [m]: beams of a scan err together, so that the error is more than a beam's
_FITS, _MEMORY = 0.45, 0.1  # share of the ends that fit, below which the car is lost; share of the newest scan in it


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


class ScanMatching:
    """Tracks a pose by matching scans.

    Args:
      field: of the map.
      finder: finds the car where it is not known.

    Attributes:
      found: whether the pose is known.
      state: the estimate, see STATES.
      covariance: of it, (5, 5).
    """

    beams = BEAMS

    def __init__(self, field: DistanceField, finder: ParticleFilter) -> None:
        self._field, self._finder = field, finder
        self.state, self.covariance = np.zeros(STATES), np.eye(STATES)
        self.found, self._fits = False, 1.0

    def start(self, pose: FloatArray | None, deviations: tuple[float, float]) -> None:
        """Begin anew at a pose (3,) known to so many m and rad; None: anywhere."""
        self.found, self._fits = pose is not None, 1.0
        if pose is None:
            self._finder.start(None, deviations)
            return
        self.state = np.array((*pose, 0.0, 0.0))
        place, heading = deviations
        self.covariance = np.diag(np.square((place, place, heading, SCALE_ERROR, SCALE_ERROR)))

    def move(self, way: float, turn: float) -> None:
        """Take the estimate on by a step of odometry: the way ahead [m] and the turn [rad]."""
        if not self.found:
            self._finder.move(way, turn)
            return
        self.state, self.covariance = predicted(
            self.state, self.covariance, way, turn, *step_errors(way, turn), SCALE_WALK
        )  # fmt: skip

    def see(self, ends: FloatArray) -> None:
        """Correct the estimate by the ends of beams in the frame of the rear axle (b, 2) [m]."""
        if not self.found:
            self._find(ends)
            return
        field = self._field
        self.state, information, fits = match(
            field.distances, field.origin, field.resolution, ends, self.state, inverse(self.covariance), _ERROR, _GATE,
            _STEPS,
        )  # fmt: skip
        self.covariance = inverse(information)
        self._fits += _MEMORY * (fits - self._fits)
        if self._fits < _FITS:
            self.start(None, (0.0, 0.0))

    def _find(self, ends: FloatArray) -> None:
        finder = self._finder
        finder.see(ends)
        if finder.found:
            self.found, self._fits = True, 1.0
            self.state, self.covariance = finder.state.copy(), finder.covariance + 1e-4 * np.eye(STATES)
