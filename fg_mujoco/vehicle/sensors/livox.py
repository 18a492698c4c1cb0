"""A Livox MID-360 beside the vehicle's own LiDAR: frames of 20,000 points, ten a second, skewed as the car moves."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...arguments import explain_class
from ...errors import SettingsError
from ...messages import FloatArray, require, shown
from .sensor import NOTHING_YET, SENSORS, CarState, Sensor

_LIDAR = "lidar/"  # what its vehicle's LiDAR has before its names, as in simulation.cars
_JUMP = 1.0  # [m] in a tick, of a car that is put elsewhere


@explain_class
@dataclass(frozen=True, kw_only=True)
class Mid360(Sensor):
    """Points of a Livox MID-360: x, y, z [m] in its own frame and intensity of each of 20,000; zeros: no return.

    A frame takes .1 s and is delivered at its end. Point i is of line i % 4, and of burst i // 500, whose points are
    all measured in the burst's middle: `lidar.point_cloud.point_cloud` gives times and lines.

    Raises:
      SettingsError: a value out of its range.
    """

    frame = "livox_frame"

    rate: float | None = 10.0
    range_noise_std: float = 0.0  # standard deviation of each distance [m]; that of the data sheet: 0.02
    angle_noise_std: float = 0.0  # of each direction, across and upwards [rad]; that of the data sheet: 0.0026

    def __post_init__(self) -> None:
        for name, usual in (("rate", 10.0), ("noise_std", 0.0)):
            value = getattr(self, name)
            if isinstance(value, np.ndarray) or value not in (usual, None):
                raise SettingsError(f"{type(self).__name__}.{name} is {shown(value)}; accepted: {usual:g}")
        super().__post_init__()
        names = "range_noise_std", "angle_noise_std"
        require(self, lambda value: 0.0 <= value <= 1.0, "0 to 1 [m] or [rad]", names, SettingsError)

    def steps(self, timestep: float, substeps: int) -> int:
        """See Sensor; it measures once a tick."""
        from ...lidar.point_cloud import FRAME

        ticks = FRAME / (timestep * substeps)
        if abs(ticks - round(ticks)) > 1e-6:
            said = f"sensor {self.name!r} on a car whose LiDAR has a period of {timestep * substeps:g} s"
            raise SettingsError(f"{said}; accepted: {FRAME:g} s over a whole number")
        return substeps

    def size(self, beams: int) -> int:
        """See Sensor."""
        from ...lidar.point_cloud import POINTS

        return 4 * POINTS

    def begin(self, car: CarState, rng: np.random.Generator) -> Callable[[CarState], ArrayLike]:
        """See Sensor."""
        from ...lidar.point_cloud import BURSTS, FRAME, POINTS, PointCaster

        caster, begun = PointCaster(car.model, car.prefix + _LIDAR), car.time
        before, past = car.qpos.copy(), car.time
        frame, done = np.zeros((BURSTS, POINTS // BURSTS, 4)), 0

        def measure(car: CarState) -> ArrayLike:
            nonlocal before, past, done
            number = (car.time - begun) * BURSTS / FRAME
            last = math.floor(number + 0.5 + 1e-6)  # bursts whose middle has passed
            if last == done:
                return NOTHING_YET
            times = begun + (np.arange(done, last) + 0.5) * FRAME / BURSTS
            shares = (times - past) / (car.time - past)
            after = car.qpos.copy()
            from_here = np.where(np.abs(after - before) > _JUMP, after, before)
            caster.cast(from_here, after, shares, times, done, frame[done % BURSTS :][: last - done])
            before, past, done = after, car.time, last
            return self._noisy(frame, rng).ravel() if done % BURSTS == 0 else NOTHING_YET

        return measure

    def _noisy(self, frame: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return the points of a frame with the errors of distances and directions."""
        if not (self.range_noise_std or self.angle_noise_std):
            return frame
        points = frame.reshape(-1, 4).copy()
        place = points[:, :3]
        away = np.sqrt((place * place).sum(axis=1, keepdims=True))
        along = np.divide(place, away, out=np.zeros_like(place), where=away > 0.0)
        level = np.sqrt((along[:, :2] ** 2).sum(axis=1, keepdims=True))
        across = np.divide(along[:, [1, 0]] * (-1.0, 1.0), level, out=np.zeros((len(along), 2)), where=level > 0.0)
        upwards = np.column_stack((-along[:, 2:] * across[:, [1]], along[:, 2:] * across[:, [0]], level))
        spread = self.range_noise_std, self.angle_noise_std, self.angle_noise_std
        drawn = rng.normal(0.0, spread, (len(points), 3))
        place += along * drawn[:, :1] + away * upwards * drawn[:, 2:]
        place[:, :2] += away * across * drawn[:, 1:2]
        return points


SENSORS["mid360"] = Mid360
