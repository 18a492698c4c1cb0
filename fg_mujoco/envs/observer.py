"""Makes observations of some cars from what their sensors read, from step to step.

An environment has one for its worlds, a policy that drives one for its car: the same code, the same bits.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import SettingsError
from ..messages import ODOMETRY, CarParameters, FloatArray, Reading
from ..native import core
from .actions import CarLimits
from .observation_description import Observation, Part, even_beams
from .observations import ACCELEROMETER_RANGE, SCALES, Bounds, ObservationTerm, Observed
from .tick_state import SensedState

Mask = NDArray[np.bool_]
Values = NDArray[np.float32]
Seen = Observed | Values
"""Observations of n cars: arrays (n, ...) by name, or one array where the observation is flat."""

FLAT, PRIVILEGED, CAMERA = "observation", "privileged", "camera"
"""Names of the flat vector beside a privileged one or pictures, of the privileged one, and of the pictures."""

_RECEIVED = "{}_received"  # a part: whether a sensor has delivered a reading

_OVERSHOOT = 1.25  # of spinning wheels over the greatest speed that can be commanded


class ScanBeams(Protocol):
    """The beams of a LiDAR: Beams, and those of a PolicyInterface."""

    @property
    def bearings(self) -> FloatArray:
        """Bearing of each beam from straight ahead (n,) [rad]."""

    @property
    def range_max(self) -> float:
        """[m]."""


class SensorSize(Protocol):
    """A sensor besides LiDAR and odometry: a Sensor, and that of a PolicyInterface."""

    @property
    def name(self) -> str:
        """Name of its readings."""

    def size(self, beams: int) -> int:
        """Return how many values a reading has."""


class Observer:
    """Makes the observations of n cars.

    Args:
      car: its limits; to read ObservationTerms, CarParameters.
      period: of a tick [s].
      beam_step: every how many-th beam is seen of a `scan`, counted from the one straight ahead to both sides.
      sensors: that the car has besides; what each delivered last is a part of its name, and whether it has is another.
      actions: bounds of an action (2,), least and greatest.
      speed_range: of the commands [m/s]; None: the car's.

    Attributes:
      bounds: name -> Bounds, of one car's observation in its order; where it is one vector, Bounds.
      needs_every_tick: whether delays or noise go on from tick to tick, and not from step to step.
      bearings: of the beams that are seen (beams,) [rad].
      range_max: greatest distance that is seen [m].

    Raises:
      SettingsError: beams that there are not, bounds that a term may not have, or two parts of one name.
    """

    def __init__(
        self,
        observation: Observation,
        car: CarParameters | CarLimits,
        beams: ScanBeams,
        period: float,
        *,
        count: int = 1,
        beam_step: int = 1,
        sensors: Sequence[SensorSize] = (),
        privileged: Sequence[ObservationTerm] = (),
        actions: tuple[Values, Values],
        speed_range: tuple[float, float] | None = None,
    ) -> None:
        self.observation, self.count = observation, count
        self._beams, self.range_max = _seen_beams(observation, len(beams.bearings), beam_step), beams.range_max
        self.bearings = beams.bearings[self._beams]
        limits = _limits(car)
        angles = (-car.max_steering_angle, car.max_steering_angle)
        commands = np.array(list(zip(angles, speed_range or (car.min_speed, car.max_speed), strict=True)), np.float32)
        of_commands = {"previous_action": actions, "planner_command": (commands[0], commands[1])}
        self._parts: dict[str, slice | ObservationTerm | SensorSize | None] = {}  # None: the scan
        raw: dict[str, Bounds] = {}
        columns: list[int] = []
        for part in observation.parts:
            name, term, first = part.name, part.term, len(columns)
            if isinstance(term, ObservationTerm):
                raw[name], self._parts[name] = term.bounds_of(car), term
            elif name == "scan":
                self.range_max = min(self.range_max, part.greatest or math.inf)
                raw[name], self._parts[name] = _bounds(0.0, self.range_max, len(self._beams)), None
            else:
                columns += _COLUMNS[name]
                self._parts[name] = slice(first, len(columns))
                if name in limits:
                    raw[name] = _bounds(-limits[name], limits[name], len(_COLUMNS[name]))
                else:
                    raw[name] = Bounds(low=of_commands[name][0], high=of_commands[name][1])
        self._farthest = beams.range_max
        for sensor in sensors:
            name, received = sensor.name, _RECEIVED.format(sensor.name)
            if name in raw or received in raw:
                said = f"sensor {name!r} has the name of another observation"
                raise SettingsError(f"{said}; accepted: a `name` of its own, not {', '.join(raw)}")
            size = sensor.size(len(beams.bearings))
            raw[name], self._parts[name] = _bounds(-math.inf, math.inf, size), sensor
            raw[received] = _bounds(0.0, 1.0, 1)
        self._columns, self._width = np.array(columns, np.int64), len(columns)
        read = [name for name, part in self._parts.items() if isinstance(part, slice)]
        self._low, self._high = (
            np.concatenate([np.empty(0, np.float32), *(getattr(raw[name], end) for name in read)])
            for end in ("low", "high")
        )
        self._scan_size = len(self._beams) if "scan" in raw else 0
        self._privileged = {term: (term.bounds_of(car), _scale(term.name, term.bounds_of(car))) for term in privileged}
        self._frames = None if observation.plain else Frames(observation, raw, period, count)
        self.bounds: dict[str, Bounds] | Bounds = self._bounds_of(raw)
        self.needs_every_tick = any(part.delay > 0.0 or part.noise > 0.0 for part in observation.parts)

    def begin(self, which: Mask, seeds: Sequence[int]) -> None:
        """Forget everything that the cars `which` (n,) have seen; one seed of the noise for each of them."""
        if self._frames is not None:
            self._frames.begin(which, seeds)

    def read(
        self,
        which: Mask,
        ranges: FloatArray,
        odometry: NDArray[np.void],
        state: SensedState | None = None,
        readings: Sequence[Mapping[str, Reading]] = (),
        actions: FloatArray | None = None,
        planned: FloatArray | None = None,
        *,
        step: bool = True,
    ) -> Seen:
        """Return the observations of n cars, new arrays.

        Args:
          which: (n,) the cars that have sensed since the last call; the others' observations stay.
          ranges: of all beams (n, beams) [m], as in LaserScan.
          odometry: (n,) of ODOMETRY.
          state, readings: of the cars and their sensors; needed where there are ObservationTerms, or sensors.
          actions, planned: of the policies, and commands that they correct (n, 2); needed where they are seen.
          step: whether a step of the environment is over; else only the sensors have gone on for a tick.
        """
        scan, numbers = self.room()
        core.read_sensors(
            1, ranges, odometry.view(np.float64).reshape(self.count, -1), _NO_ACTIONS if actions is None else actions,
            _NO_ACTIONS if planned is None else planned, self._beams, self.range_max, self._columns, self._low,
            self._high, scan, numbers,
        )  # fmt: skip
        return self.seen(which, scan, numbers, state, readings, step=step)

    def room(self) -> tuple[Values, Values]:
        """Return new arrays of n cars, to be filled by `read_sensors`: of the scans, and of the other numbers."""
        return np.empty((self.count, self._scan_size), np.float32), np.empty((self.count, self._width), np.float32)

    @property
    def arrays(self) -> dict[str, NDArray[Any]]:
        """The arrays that `read_sensors` takes, by its names, which stay the same."""
        return {"beams": self._beams, "columns": self._columns, "low": self._low, "high": self._high}

    def seen(
        self,
        which: Mask,
        scan: Values,
        numbers: Values,
        state: SensedState | None = None,
        readings: Sequence[Mapping[str, Reading]] = (),
        *,
        step: bool = True,
    ) -> Seen:
        """Return the observations of n cars of what `read_sensors` has written into `room()`; else as `read`."""
        seen: Seen = self._parts_of(scan, numbers, state, readings)
        if self._frames is not None:
            assert isinstance(seen, dict)
            seen = self._frames.read(which, seen, step)
        if self._privileged:
            assert state is not None
            vectors = [
                term.read(state, bounds) * (scale if self.observation.normalised else np.ones_like(scale))
                for term, (bounds, scale) in self._privileged.items()
            ]
            seen = (seen if isinstance(seen, dict) else {FLAT: seen}) | {PRIVILEGED: np.concatenate(vectors, axis=1)}
        return seen

    def _parts_of(
        self,
        scan: Values,
        numbers: Values,
        state: SensedState | None,
        readings: Sequence[Mapping[str, Reading]],
    ) -> Observed:
        """Return the parts as they are read."""
        found: Observed = {}
        for name, part in self._parts.items():
            if isinstance(part, slice):
                found[name] = numbers[:, part]
            elif part is None:
                found[name] = scan
            elif isinstance(part, ObservationTerm):
                assert state is not None
                found[name] = part.read(state, self._own[name])
            else:
                values = np.array([each[name].values for each in readings], np.float32)
                found[name] = np.nan_to_num(values, copy=False, posinf=self._farthest, neginf=0.0)
                found[_RECEIVED.format(name)] = np.array([[each[name].received] for each in readings], np.float32)
        return found

    def _bounds_of(self, raw: Mapping[str, Bounds]) -> dict[str, Bounds] | Bounds:
        """Return the bounds of what is observed, from those of its parts as they are read."""
        self._own = dict(raw)
        found: dict[str, Bounds] | Bounds = dict(raw) if self._frames is None else self._frames.bounds
        if self._privileged:
            both = [
                Bounds(low=bounds.low * scale, high=bounds.high * scale) if self.observation.normalised else bounds
                for bounds, scale in self._privileged.values()
            ]
            found = (found if isinstance(found, dict) else {FLAT: found}) | {PRIVILEGED: _joined(both)}
        return found


class Frames:
    """Observations at the last steps, with delays, noise and scales; `period` [s], `bounds` as of an Observer."""

    def __init__(self, observation: Observation, raw: Mapping[str, Bounds], period: float, count: int) -> None:
        self._observation = observation
        own = {part.name: part for part in observation.parts}
        self._sizes = {name: len(bounds.low) for name, bounds in raw.items()}
        whole = _joined(list(raw.values()))
        self._low, self._high = whole.low, whole.high
        delays = [math.ceil(own[name].delay / period - 1e-9) if name in own else 0 for name in raw]
        self._delays = np.repeat(delays, list(self._sizes.values()))
        self._noise = np.repeat([own[name].noise if name in own else 0.0 for name in raw], list(self._sizes.values()))
        self._noisy = np.flatnonzero(self._noise)
        self._scale = np.concatenate([_scale(name, bounds) for name, bounds in raw.items()])
        distances = [name == "scan" and observation.normalised for name in raw]
        self._saturates = np.repeat(distances, list(self._sizes.values()))
        if not observation.normalised:
            self._scale = np.ones_like(self._scale)
        width = len(self._scale)
        self._delayed = np.zeros((count, max(delays) + 1, width), np.float32)  # of the last ticks, the newest first
        self._fresh = np.ones(count, np.bool_)
        self._generators: list[np.random.Generator | None] = [None] * count
        spans = {name: _span(own.get(name), observation) for name in raw}
        self._together = len(set(spans.values())) == 1  # then a flat history is step after step
        columns = np.repeat(np.arange(len(raw)), list(self._sizes.values()))
        self._memories: list[tuple[list[str], Memory]] = []
        for span in dict.fromkeys(spans.values()):
            names = [name for name in raw if spans[name] == span]
            chosen = np.flatnonzero(np.isin(columns, [list(raw).index(name) for name in names]))
            self._memories.append((names, Memory(count, chosen, *span)))
        ends = np.stack((self._low, self._high))
        core.scale(np.ones(2, np.bool_), self._scale, self._saturates, ends)
        shaped = self._shaped([np.repeat(ends[:, np.newaxis, m.columns], m.length, axis=1) for _, m in self._memories])
        self.bounds: dict[str, Bounds] | Bounds
        if isinstance(shaped, dict):
            self.bounds = {name: Bounds(low=low, high=high) for name, (low, high) in shaped.items()}
        else:
            self.bounds = Bounds(low=shaped[0], high=shaped[1])

    def begin(self, which: Mask, seeds: Sequence[int]) -> None:
        """See Observer."""
        self._fresh[which] = True
        if len(self._noisy):
            for row, seed in zip(np.flatnonzero(which).tolist(), seeds, strict=True):
                self._generators[row] = np.random.default_rng((seed, len(self._scale)))

    def read(self, which: Mask, parts: Observed, step: bool) -> Seen:
        """Return the observations, after the parts (n, ...) were read anew for the cars `which` (n,)."""
        frame = np.ascontiguousarray(np.concatenate(list(parts.values()), axis=1))
        if len(self._delayed[0]) > 1:
            core.shift(which, self._fresh, frame, self._delayed, self._delays)
        if len(self._noisy):
            for row in np.flatnonzero(which).tolist():
                generator = self._generators[row]
                assert generator is not None
                frame[row, self._noisy] += self._noise[self._noisy] * generator.standard_normal(len(self._noisy))
            np.clip(frame, self._low, self._high, out=frame)
        if step:
            core.scale(which, self._scale, self._saturates, frame)
            for _, memory in self._memories:
                memory.write(which, self._fresh, frame)
            self._fresh[which] = False
        seen: Seen = self._shaped([memory.read() for _, memory in self._memories])
        return seen

    def _shaped(self, remembered: Sequence[Values]) -> Any:
        """Return what each memory has (n, length, its width) in the form of the observation."""
        if self._observation.flat and self._together:
            return remembered[0].reshape(len(remembered[0]), -1)
        found: Observed = {}
        for (names, memory), steps in zip(self._memories, remembered, strict=True):
            ends = np.cumsum([self._sizes[name] for name in names]).tolist()
            for name, part in zip(names, np.split(steps, ends[:-1], axis=2), strict=True):
                found[name] = np.ascontiguousarray(part[:, 0] if memory.length == 1 else part)
        found = {name: found[name] for name in self._sizes}
        if not self._observation.flat:
            return found
        return np.concatenate([part.reshape(len(part), -1) for part in found.values()], axis=1)


class Memory:
    """Some `columns` (width,) of the frames of n cars, at steps that are evenly apart."""

    def __init__(self, count: int, columns: NDArray[np.int64], length: int, every: int) -> None:
        self.columns, self.length, self._every = columns, length, every
        self._ring = np.zeros((count, (length - 1) * every + 1, len(columns)), np.float32)
        self._last = np.zeros(count, np.int64)  # where in its ring each car's present frame is

    def write(self, which: Mask, fresh: Mask, frame: Values) -> None:
        """Remember the frames (n, all columns) of the cars `which` (n,); those of `fresh` ones are all that was."""
        core.remember(which, fresh, frame, self.columns, self._ring, self._last)

    def read(self) -> Values:
        """Return the steps of all cars, the oldest first, a new array. Shape (n, length, width)."""
        found = np.empty((len(self._ring), self.length, len(self.columns)), np.float32)
        core.recall(self._ring, self._last, self._every, found)
        return found


_NO_ACTIONS = np.zeros((0, 2))


def _column(name: str) -> int:
    """Return where a field of ODOMETRY begins in a row of its numbers, all of which are float64."""
    assert ODOMETRY.fields is not None
    return int(ODOMETRY.fields[name][1]) // np.dtype(np.float64).itemsize


_AHEAD, _WHEELS, _ACTIONS = _column("linear_acceleration"), _column("wheel_speeds"), ODOMETRY.itemsize // 8
_COLUMNS = {
    "speed": [_column("speed")],
    "yaw_rate": [_column("angular_velocity") + 2],  # about the z axis
    "steering_angle": [_column("steering_angle")],
    "acceleration": [_AHEAD, _AHEAD + 1],
    "wheel_speeds": list(range(_WHEELS, _WHEELS + 4)),
    "previous_action": [_ACTIONS, _ACTIONS + 1],  # after the odometry
    "planner_command": [_ACTIONS + 2, _ACTIONS + 3],
}
"""Where the numbers of each sensor are in a row of ODOMETRY."""


def _limits(car: CarParameters | CarLimits) -> dict[str, float]:
    """Return the greatest magnitude of the parts that are read off the odometry."""
    fastest = max(abs(car.min_speed), car.max_speed) * _OVERSHOOT
    return {
        "speed": fastest,
        "yaw_rate": fastest * math.tan(car.max_steering_angle) / car.wheelbase,
        "steering_angle": car.max_steering_angle,
        "acceleration": ACCELEROMETER_RANGE * car.gravity,
        "wheel_speeds": fastest,
    }


def _seen_beams(observation: Observation, count: int, beam_step: int) -> NDArray[np.int64]:
    """Return which beams are seen of so many."""
    scan = next((part for part in observation.parts if part.name == "scan"), Part.of("scan"))
    if scan.beams is not None:
        if beam_step != 1:
            raise SettingsError(f"beam_step is {beam_step!r} and observation has {scan}; accepted: one of the two")
        return even_beams(count, scan.beams)
    middle = count // 2
    if not 1 <= beam_step <= middle:
        raise SettingsError(f"beam_step is {beam_step!r}; accepted: a whole number from 1 to {middle}")
    return np.arange(middle % beam_step, count, beam_step)


def _span(part: Part | None, observation: Observation) -> tuple[int, int]:
    """Return how many steps of a part, or of a sensor besides, are seen, and how many steps these are apart."""
    if part is None or part.history is None:
        return observation.history, 1
    return part.history, part.every


def _scale(name: str, bounds: Bounds) -> Values:
    """Return what a normalised part of a name is multiplied with. Shape (k,)."""
    most = np.maximum(np.abs(bounds.low), np.abs(bounds.high))
    if not np.isfinite(most).all():  # readings of a sensor besides
        return np.ones_like(most)
    scale = np.broadcast_to(np.asarray(SCALES.get(name, most), np.float32), most.shape)
    found: Values = (np.float32(1.0) / scale).astype(np.float32)
    return found


def _bounds(low: float, high: float, size: int) -> Bounds:
    return Bounds(low=np.full(size, low, np.float32), high=np.full(size, high, np.float32))


def _joined(bounds: Sequence[Bounds]) -> Bounds:
    low, high = (np.concatenate([getattr(each, end) for each in bounds]) for end in ("low", "high"))
    return Bounds(low=low, high=high)
