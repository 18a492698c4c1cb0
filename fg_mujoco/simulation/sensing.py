"""Measurements in Python of an engine's cars: LiDARs with effects, further sensors, odometry that drifts.

The native core has taken scans and odometry before; `Sensing` changes them, and measures the rest.
"""

from __future__ import annotations

import weakref
import zlib
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ModelError, SettingsError, is_of_planner
from ..lidar.beams import Beams
from ..lidar.effects import LidarEffects
from ..lidar.lidar import RaycastLidar
from ..lidar.scan_pipeline import EffectsOfRows, ScanPipeline
from ..messages import NO_READINGS, FloatArray, LaserScan, Reading, Readings
from ..vehicle.motion import drift_odometry
from ..vehicle.sensors import CarState, Sensor
from ..vehicle.sensors.sensor import NOTHING_YET
from .cars import car_prefix
from .planner_failure import error_text, file_of
from .terrain import SEEN
from .world_batch import CarArrays, Mask

_SAME_TIME = 1e-9  # [s]


class Sensing:
    """The measurements of an engine's cars that take Python; `scans` of the cars whose LiDAR has effects, by row."""

    def __init__(self, engine: Any, arrays: CarArrays) -> None:
        self.scans: dict[int, LaserScan] = {}
        self._engine = weakref.proxy(engine)  # no circle: an engine without references is freed at once
        self._arrays = arrays
        self._pipelines: dict[int, ScanPipeline] = {}
        self._row_effects = EffectsOfRows(engine.beams, len(arrays.commands))
        self._samplers: dict[int, list[Sampler]] = {}
        self._timesteps: dict[int, float] = {}  # [s] of the physics, of the cars that have samplers
        self._odometry_drift = np.zeros(len(arrays.commands))
        self._drifts = False
        self._data: dict[int, mujoco.MjData] = {}

    @property
    def active(self) -> bool:
        """Whether any car measures here."""
        return bool(self._samplers or self._drifts or self._pipelines or self._row_effects)

    def begin(
        self, row: int, effects: LidarEffects | None, sensors: Sequence[Sensor], seed: int, drift: float, *,
        messages: bool,
    ) -> None:  # fmt: skip
        """Begin anew for a car, of whom scans (`messages`) or ranges only are read; SettingsError as Sensor.steps."""
        self._pipelines.pop(row, None)
        self._row_effects.end(row)
        self._arrays.optics[row] = optics = (effects or LidarEffects()).optics
        batch, _ = self._engine._place_of(row // self._engine.cars_per_world)
        if any(optics) and batch.drawn is None:
            raise SettingsError("floor_angle or through_cars of a LiDAR that MuJoCo measures; accepted: lidar raycast")
        if optics[1] and mujoco.mj_name2id(batch.world.model, mujoco.mjtObj.mjOBJ_GEOM, SEEN) >= 0:
            raise SettingsError("floor_angle on ground that is not level; accepted: 0, or a level course")
        if effects is not None and effects != LidarEffects():
            if messages or effects.motion_distortion:
                self._pipelines[row] = self._pipeline(row, effects, seed)
            else:
                self._row_effects.begin(row, effects, seed)
        self._samplers.pop(row, None)
        if sensors:
            self._samplers[row] = self._make_samplers(row, sensors, seed)
        self._odometry_drift[row] = drift
        self._drifts = bool(self._odometry_drift.any())

    def forget(self, i: int) -> None:
        """Forget the data of a world that another one has taken the place of."""
        self._data.pop(i, None)

    def sense(self, chosen: Mask) -> None:
        """Measure with the cars `chosen` (r,), whose scans and odometry have just been taken."""
        engine = self._engine
        if self._drifts:
            drifted = engine.odometry[chosen]
            drift_odometry(drifted, 1.0 + self._odometry_drift[chosen])
            engine.odometry[chosen] = drifted
        for batch in engine._batches:
            if batch.drawn is None:
                for row in (np.flatnonzero(chosen[batch.rows]) + batch.rows.start).tolist():
                    lidar = batch.lidar(row % engine.cars_per_world)
                    engine.ranges[row] = lidar.ranges(self._data_of(row // engine.cars_per_world))
        if self._samplers:
            self._measure(np.flatnonzero(chosen), deliver=True)
            for row, samplers in self._samplers.items():
                for sampler in samplers if chosen[row] else ():
                    sampler.sensor.tell(sampler.reading.values, engine.odometry[row : row + 1])
        if self._row_effects:
            self._row_effects.apply(chosen, engine.ranges)
        if self._pipelines:
            self.scans = {
                row: pipeline.scan(self._data_of(row // engine.cars_per_world, pipeline))
                for row, pipeline in self._pipelines.items()
                if chosen[row]
            }
            for row, scan in self.scans.items():
                engine.ranges[row] = scan.ranges

    def follow(self, stepped: Mask, *, last: bool) -> None:
        """Follow a physics step of the worlds `stepped` (n,), for what measures within a tick, but for its `last`."""
        engine = self._engine
        for row, pipeline in self._pipelines.items():
            if pipeline.needs_every_step and stepped[row // engine.cars_per_world]:
                pipeline.record(self._data_of(row // engine.cars_per_world, pipeline))
        if self._samplers and not last:
            self._measure(np.flatnonzero(engine.running & np.repeat(stepped, engine.cars_per_world)), deliver=False)

    @property
    def in_steps(self) -> bool:
        """Whether any LiDAR moves during its sweep, or any sensor measures within a tick."""
        return any(pipeline.needs_every_step for pipeline in self._pipelines.values()) or any(
            sampler.steps % self._engine.substeps for samplers in self._samplers.values() for sampler in samplers
        )

    def readings(self, row: int) -> Mapping[str, Reading]:
        """Return what the sensors of a car have delivered up to when it last sensed, by their names."""
        samplers = self._samplers.get(row)
        if samplers is None:
            return NO_READINGS
        return Readings((sampler.sensor.name, sampler.reading) for sampler in samplers)

    def _car_state(self, row: int) -> CarState:
        """Return what can be measured on a car now. Live."""
        engine = self._engine
        i, car = divmod(row, engine.cars_per_world)
        batch, place = engine._place_of(i)
        cars = self._arrays.constants[row - car : row - car + engine.cars_per_world]
        return CarState(
            time=engine.time(i), qpos=engine.qpos(i), qvel=engine.qvel(i), ctrl=engine.ctrl(i),
            sensordata=batch.physics.sensors[place], ranges=engine.ranges[row], constants=cars[car : car + 1],
            others=np.delete(cars, car),
            odometry_drift=float(self._odometry_drift[row]), model=batch.world.model, prefix=car_prefix(car),
        )  # fmt: skip

    def _pipeline(self, row: int, effects: LidarEffects, seed: int) -> ScanPipeline:
        engine = self._engine
        i, car = divmod(row, engine.cars_per_world)
        distorted = engine._place_of(i)[0].lidar(car) if effects.motion_distortion else None
        if isinstance(distorted, RaycastLidar):
            distorted.optics[:] = effects.optics
        return ScanPipeline(distorted or _RangesRow(engine.beams, engine.ranges[row]), effects, seed)

    def _data_of(self, i: int, pipeline: ScanPipeline | None = None) -> Any:
        """Return the data that a LiDAR in Python measures in, of world i; a pipeline without bodies needs its time."""
        engine = self._engine
        if pipeline is not None and not pipeline.needs_every_step:
            return SimpleNamespace(time=engine.time(i))
        if i not in self._data:
            self._data[i] = mujoco.MjData(engine.world_of(i).model)
        engine.read(i, self._data[i])
        return self._data[i]

    def _make_samplers(self, row: int, sensors: Sequence[Sensor], seed: int) -> list[Sampler]:
        """Return what measures with the sensors of a car."""
        engine = self._engine
        timestep, beams = engine.world_of(row // engine.cars_per_world).model.opt.timestep, len(engine.beams.bearings)
        self._timesteps[row] = timestep
        return [
            Sampler(sensor, seed, steps=sensor.steps(timestep, engine.substeps), size=sensor.size(beams))
            for sensor in sensors
        ]

    def _measure(self, rows: NDArray[np.int64], *, deliver: bool) -> None:
        """Have the sensors of some cars measure where it is time to, and deliver what is old enough."""
        for row in rows.tolist():
            samplers, i = self._samplers.get(row, ()), row // self._engine.cars_per_world
            time = self._engine.time(i)
            step = round(time / self._timesteps[row]) if samplers else 0
            due = [sampler for sampler in samplers if step % sampler.steps == 0]
            state = self._car_state(row) if due else None
            for sampler in due:
                assert state is not None
                sampler.measure(step, state)
            for sampler in samplers if deliver else ():
                sampler.deliver(time)


class Sampler:
    """Measures with a sensor on one car, from the start of its race on; `reading` was delivered last.

    What is delivered depends on the states of the car, the settings of the sensor and the seed only: it is the same bit
    for bit whatever other cars, worlds and sensors there are.
    """

    def __init__(self, sensor: Sensor, seed: int, *, steps: int, size: int) -> None:
        self.sensor, self.steps, self._size = sensor, steps, size
        stream = zlib.crc32(sensor.name.encode())
        self._rng, self._own_rng = np.random.default_rng([seed, stream]), np.random.default_rng([seed, stream, 1])
        self._begun: Callable[[CarState], ArrayLike] | None = None
        self._noisy = bool(np.any(sensor.noise_std))
        self._measured_at = -1  # physics step
        self._held: deque[tuple[float, FloatArray]] = deque()  # measured, and not delivered yet
        nothing = np.full(size, np.nan)
        self.reading = Reading(
            stamp=np.nan, values=nothing, columns=sensor.columns, stamps=nothing[:0], samples=np.empty((0, size))
        )

    def measure(self, step: int, car: CarState) -> None:
        """Measure, if it is time to.

        Raises:
          SettingsError: the sensor raises, or measures something else than numbers in its columns.
          ModelError: the car lacks what the sensor measures.
        """
        if step % self.steps or step <= self._measured_at:
            return
        self._measured_at = step
        sensor = self.sensor
        try:
            if self._begun is None:
                self._begun = sensor.begin(car, self._own_rng)
            measured = self._begun(car)
            values = np.array(measured, dtype=np.float64)
        except BaseException as error:
            if not is_of_planner(error) or isinstance(error, ModelError):  # but Ctrl-C, and a car that lacks something
                raise
            failed = error_text(error, file_of(type(sensor)))
            said = f"sensor {sensor.name!r} failed at t = {car.time:.3f} s: {failed}"
            raise SettingsError(f"{said}; accepted: a `measure` that returns numbers") from error
        if measured is NOTHING_YET:
            return
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


class _RangesRow:
    """A car's row of ranges, as the LiDAR that its ScanPipeline measures with."""

    def __init__(self, beams: Beams, row: FloatArray) -> None:
        self.beams = beams
        self._row = row

    def ranges(self, data: Any) -> FloatArray:
        """Return a copy of the row [m]. Shape (beams,)."""
        return self._row.copy()
