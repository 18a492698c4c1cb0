"""One sensor on one car: when it measures, with which noise, and when that is delivered."""

from __future__ import annotations

import zlib
from collections import deque

import numpy as np

from ...errors import SettingsError
from ...messages import FloatArray, Reading
from .sensor import CarState, Sensor

_SAME_TIME = 1e-9  # [s]


class Sampler:
    """Measures with a sensor on one car, from the start of its race on.

    What is delivered depends on the states of the car, the settings of the sensor and the seed only: it is the same bit
    for bit whatever other cars, worlds and sensors there are.

    Args:
      sensor: its settings.
      seed: of the car.
      steps: physics steps from one measurement to the next.
      size: of a reading.

    Attributes:
      sensor, steps: as given.
      reading: that was delivered last.
    """

    def __init__(self, sensor: Sensor, seed: int, *, steps: int, size: int) -> None:
        self.sensor, self.steps, self._size = sensor, steps, size
        self._rng = np.random.default_rng([seed, zlib.crc32(sensor.name.encode())])
        self._noisy = bool(np.any(sensor.noise_std))
        self._measured_at = -1  # physics step
        self._held: deque[tuple[float, FloatArray]] = deque()  # measured, and not delivered yet
        nothing = np.full(size, np.nan)
        self.reading = Reading(
            stamp=np.nan, values=nothing, columns=sensor.columns, stamps=nothing[:0], samples=np.empty((0, size))
        )

    def measure(self, step: int, car: CarState) -> None:
        """Measure, if it is time to.

        Args:
          step: physics steps since the start.
          car: after them.

        Raises:
          SettingsError: the sensor raises, or measures something else than numbers in its columns.
        """
        if step % self.steps or step <= self._measured_at:
            return
        self._measured_at = step
        sensor = self.sensor
        try:
            values = np.array(sensor.measure(car), dtype=np.float64)
        except Exception as error:
            said = f"sensor {sensor.name!r} failed at t = {car.time:.3f} s: {type(error).__name__}: {error}"
            raise SettingsError(f"{said}; accepted: a `measure` that returns numbers") from error
        if values.shape != (self._size,):
            columns = f", {', '.join(sensor.columns)}" if sensor.columns else ""
            said = f"sensor {sensor.name!r} measured an array of shape {values.shape}"
            raise SettingsError(f"{said}; accepted: ({self._size},){columns}")
        if self._noisy:
            values += self._rng.normal(0.0, sensor.noise_std, self._size)
        if sensor.dropout_probability > 0.0 and self._rng.random() < sensor.dropout_probability:
            return
        self._held.append((car.time, values))

    def deliver(self, time: float) -> None:
        """Deliver what is old enough at a time [s]."""
        arrived = []
        while self._held and self._held[0][0] <= time - self.sensor.delay + _SAME_TIME:
            arrived.append(self._held.popleft())
        last = self.reading
        if not arrived and not len(last.stamps):
            return
        stamp, values = arrived[-1] if arrived else (last.stamp, last.values)
        self.reading = Reading(
            stamp=stamp, values=values, columns=last.columns, stamps=np.array([stamp for stamp, _ in arrived]),
            samples=np.array([values for _, values in arrived]).reshape(len(arrived), self._size),
        )  # fmt: skip
