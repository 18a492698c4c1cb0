"""What a policy sees: the scan and what the car's own sensors say, by name, as float32 within bounds.

| name | shape | what |
| --- | --- | --- |
| scan | (beams,) | distances [m], rightmost beam first; no return reads `range_max`, too close or failed reads 0 |
| speed | (1,) | of the wheels' surfaces, mean, forward positive [m/s] |
| yaw_rate | (1,) | left positive [rad/s] |
| steering_angle | (1,) | of the servo, left positive [rad] |
| acceleration | (2,) | ahead and to the left, as the accelerometer in the centre of gravity has it [m/s^2] |

None of it knows the track or the pose. The bounds follow from the car; what goes beyond reads the bound.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import SettingsError
from ..lidar.beams import Beams
from ..messages import ODOMETRY, CarParameters, FloatArray
from .reward_kernels import read_sensors

Observation = dict[str, NDArray[np.float32]]

ACCELEROMETER_RANGE = 4.0
"""[g] The narrowest range that IMUs on such cars are commonly set to; the tires give little more than 1."""

_OVERSHOOT = 1.25  # of spinning wheels over the greatest speed that can be commanded


@dataclass(frozen=True, kw_only=True, eq=False)
class Bounds:
    """Least and greatest values of one part of an observation; both have its shape, float32."""

    low: NDArray[np.float32]
    high: NDArray[np.float32]


class ObservationLayout:
    """Makes observations from scans and odometry.

    Args:
      car: of the compiled model.
      beams: of its LiDAR.
      beam_step: every how many-th beam is seen, counted from the one straight ahead to both sides.

    Attributes:
      bounds: name -> Bounds, in the order of the table above.
      bearings: of the beams that are seen (beams,) [rad].

    Raises:
      SettingsError: a step that leaves the beam straight ahead alone.
    """

    def __init__(self, car: CarParameters, beams: Beams, beam_step: int = 1) -> None:
        middle = len(beams.bearings) // 2
        if not 1 <= beam_step <= middle:
            raise SettingsError(f"beam_step is {beam_step!r}; accepted: a whole number from 1 to {middle}")
        self._first, self._step = middle % beam_step, beam_step
        self.bearings = beams.bearings[self._first :: beam_step]
        self._range_max = beams.range_max
        fastest = max(abs(car.min_speed), car.max_speed) * _OVERSHOOT
        limits = {
            "speed": (fastest, 1),
            "yaw_rate": (fastest * math.tan(car.max_steering_angle) / car.wheelbase, 1),
            "steering_angle": (car.max_steering_angle, 1),
            "acceleration": (ACCELEROMETER_RANGE * car.gravity, 2),
        }
        self.bounds = {"scan": _bounds(0.0, beams.range_max, len(self.bearings))}
        self.bounds |= {name: _bounds(-limit, limit, size) for name, (limit, size) in limits.items()}
        self._high = np.concatenate([self.bounds[name].high for name in limits])
        ahead, yaw = _column("linear_acceleration"), _column("angular_velocity") + 2  # about the z axis
        self._columns = np.array((_column("speed"), yaw, _column("steering_angle"), ahead, ahead + 1))
        ends = np.cumsum([size for _, size in limits.values()]).tolist()
        self._slices = dict(zip(limits, map(slice, [0, *ends[:-1]], ends), strict=True))

    def read(self, ranges: FloatArray, odometry: NDArray[np.void]) -> Observation:
        """Return the observations of n cars, new arrays (n, ...) by name.

        Args:
          ranges: of all beams (n, 1081) [m], as in LaserScan.
          odometry: (n,) of ODOMETRY.
        """
        count = len(ranges)
        scan = np.empty((count, len(self.bearings)), np.float32)
        values = np.empty((count, len(self._columns)), np.float32)
        read_sensors(
            ranges, odometry.view(np.float64).reshape(count, -1), self._first, self._step, self._range_max,
            self._columns, self._high, scan, values,
        )  # fmt: skip
        observation = {"scan": scan}
        for name, columns in self._slices.items():
            observation[name] = values[:, columns]
        return observation


def _bounds(low: float, high: float, size: int) -> Bounds:
    return Bounds(low=np.full(size, low, np.float32), high=np.full(size, high, np.float32))


def _column(name: str) -> int:
    """Return where a field of ODOMETRY begins in a row of its numbers, all of which are float64."""
    assert ODOMETRY.fields is not None
    return int(ODOMETRY.fields[name][1]) // np.dtype(np.float64).itemsize
