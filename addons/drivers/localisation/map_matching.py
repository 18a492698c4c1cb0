"""Scan matching on a map: a Kalman filter whose measurement is the scan laid on the walls.

It moves by odometry, whose constant errors it estimates, too: a speed and a yaw rate that read 5 % too much are found
within some metres. The scan corrects the prediction by `field_matching.match`, with the prediction as its prior: along
a straight corridor, where all places look alike, the car stays where odometry has it.

Where the car is not known, a particle filter finds it first; so it does where the scan fits no longer.
"""

from __future__ import annotations

import numpy as np

from fg_mujoco.messages import FloatArray

from .distance_field import DistanceField
from .field_matching import inverse, match
from .odometry import SCALE_ERROR, SCALE_WALK, STATES, predicted, step_errors
from .particle_filter import ParticleFilter

BEAMS = 120
"""Of a scan that are matched, evenly spread."""

_ERROR, _GATE, _STEPS = 0.08, 0.3, 5  # [m], [m]: beams of a scan err together, so that the error is more than a beam's
_FITS, _MEMORY = 0.5, 0.1  # share of the ends that fit, below which the car is lost; share of the newest scan in it


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
