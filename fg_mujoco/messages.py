"""Messages between the car and a planner: a scan and odometry in, a command out.

The field names are those of the ROS messages (sensor_msgs/LaserScan, sensor_msgs/Imu,
ackermann_msgs/AckermannDrive), so that a planner moves to a real car unchanged. All are frozen; arrays are
copied on the way in and read-only. SI units and radians; frames as in REP 103: x forward, y left, z up.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import lru_cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .arguments import Suggesting, explain_class
from .display import Shown, brief
from .errors import MessageError, SettingsError, accepted_names, with_unit

FloatArray = NDArray[np.float64]


def read_only(values: ArrayLike) -> FloatArray:
    """Return a read-only float copy of `values`, same shape."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def _writing(name: str) -> Any:
    """Return a method of arrays that writes to its own, and says what to do where that is read-only."""
    plain = getattr(np.ndarray, name)

    def write(self: Any, *args: Any, **named: Any) -> Any:
        if not self.flags.writeable:
            raise MessageError("the ranges of a scan are read-only; accepted: a copy, ranges = scan.ranges.copy()")
        return plain(self, *args, **named)

    return write


class _Ranges(np.ndarray):
    """The ranges of a scan: read-only, and the refusal says what to do. What is computed of them is a plain array."""

    __setitem__ = _writing("__setitem__")
    __iadd__, __isub__, __imul__ = _writing("__iadd__"), _writing("__isub__"), _writing("__imul__")
    fill, put, sort = _writing("fill"), _writing("put"), _writing("sort")

    def copy(self, order: Any = "C") -> Any:
        """Return a copy that can be written to, a plain array."""
        return np.array(self, order=order)

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: bool = False) -> Any:
        return array[()] if return_scalar else np.asarray(array)

    def __repr__(self) -> str:
        return repr(np.asarray(self))


def shown(value: object) -> str:
    """Return the repr of a value, a long one without its middle; of a huge number, its number of digits."""
    try:
        text = repr(value)
        text = " ".join(text.split()) if "\n" in text else text
    except ValueError:  # Python does not write out a whole number of more than 4300 digits
        return "a number of thousands of digits"
    except RecursionError:
        return "a value that is nested too deeply"
    return text if len(text) <= 200 else f"{text[:100]}...{text[-60:]}"


def _as_float(value: Any) -> float:
    try:
        return float(value)
    except OverflowError:  # a whole number that is greater than any float
        return math.inf if value > 0 else -math.inf


def require(
    message: object, holds: Callable[[float], bool], accepted: str, names: tuple[str, ...], error: type[Exception]
) -> None:
    """Raise `error` for the first of the fields `names` of `message` that is no number or for which not `holds`."""
    for name in names:
        value = getattr(message, name)
        number = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
        if not number or not holds(_as_float(value)):
            raise error(f"{type(message).__name__}.{name} is {shown(value)}; accepted: {accepted}")


def require_served(message: object, names: tuple[str, ...], **others: Any) -> None:
    """Raise SettingsError for the first of the fields `names` that is told, where all `others` that it serves are 0."""
    told = [name for name in names if getattr(message, name) != getattr(type(message), name)]
    if told and not any(others.values()):
        said = f"{type(message).__name__}.{told[0]} is {shown(getattr(message, told[0]))}"
        raise SettingsError(f"{said} without {' or '.join(others)}; accepted: with {' or '.join(others)}")


MOST_WHOLE = 2**63 - 1
"""The greatest whole number of settings and files, that of 64 bits, as TOML has it."""


def require_whole(
    name: str, value: object, least: int, most: int = MOST_WHOLE, *, why: str = "", optional: bool = False
) -> None:
    """Raise SettingsError unless a value is a whole number from `least` to `most`, or None where it is `optional`."""
    if optional and value is None:
        return
    above = isinstance(value, int) and value > most
    if not isinstance(value, int) or isinstance(value, bool) or value < least or above:
        upwards = f" to {most}" if above or most < MOST_WHOLE else ""
        reason = f"; {why}" if above and why else ""
        raise SettingsError(f"{name} is {shown(value)}; accepted: a whole number from {least}{upwards}{reason}")


def require_finite(message: object, *values: object, names: tuple[str, ...]) -> None:
    """Raise MessageError unless all `values` of the fields `names` are finite: each tick, hence by their sum first."""
    if not ({*map(type, values)} <= {float} and math.isfinite(sum(values))):  # type: ignore[arg-type]
        require(message, math.isfinite, "a finite number", names, MessageError)


@lru_cache(maxsize=32)
def _bearings(count: int, angle_min: float, angle_increment: float) -> FloatArray:
    return read_only(angle_min + angle_increment * np.arange(count))


@explain_class
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class LaserScan(Shown):
    """One sweep of the LiDAR (sensor_msgs/LaserScan).

    `ranges` has shape (n,) [m], rightmost beam first, bearings growing to the left. What is not a distance
    follows REP 117: +inf is no return within `range_max` (or `range_max` itself where `no_return` says so),
    -inf is closer than `range_min`, NaN is a failed reading. Any n is a scan, 0 and 1 included.

    Raises:
      MessageError: an angle, limit or stamp that is not finite, or ranges that are not one row.
    """

    stamp: float  # [s] time of the last beam
    angle_min: float  # [rad]
    angle_max: float  # [rad]
    angle_increment: float  # [rad]
    range_min: float  # [m]
    range_max: float  # [m]
    ranges: FloatArray  # (n,) [m]
    time_increment: float = 0.0  # [s] from one beam to the next; 0 where all are taken at `stamp`
    scan_time: float = 0.025  # [s] from one sweep to the next
    no_return: float = math.inf  # [m] what a beam without a return reads: inf or range_max

    def __post_init__(self) -> None:
        object.__setattr__(self, "ranges", read_only(self.ranges).view(_Ranges))
        require_finite(
            self, self.stamp, self.angle_min, self.angle_max, self.angle_increment, self.range_min, self.range_max,
            self.time_increment, self.scan_time, names=_SCAN_NUMBERS,
        )  # fmt: skip
        if self.ranges.ndim != 1:
            raise MessageError(f"LaserScan.ranges has shape {self.ranges.shape}; accepted: (n,)")
        if self.no_return not in (math.inf, self.range_max):
            raise MessageError(f"LaserScan.no_return is {self.no_return!r}; accepted: inf or range_max")

    def __repr__(self) -> str:
        measured = self.ranges[np.isfinite(self.ranges) & (self.ranges < self.range_max)]
        least, most = math.degrees(self.angle_min), math.degrees(self.angle_max)
        found = f"ranges {measured.min():.2f} to {measured.max():.2f} m" if len(measured) else "no ranges"
        others = len(self.ranges) - len(measured)
        return brief(
            self, f"stamp {self.stamp:.3f} s", f"{len(self.ranges)} beams from {least:.1f} to {most:.1f} deg", found,
            *([f"{others} beams without a return"] if others else []),
        )  # fmt: skip

    @property
    def bearings(self) -> FloatArray:
        """Bearing of each beam from straight ahead, left positive. Shape (n,) [rad], read-only."""
        return _bearings(len(self.ranges), self.angle_min, self.angle_increment)


_SCAN_NUMBERS = tuple(f.name for f in fields(LaserScan) if f.name not in ("ranges", "no_return"))


_COMMAND_NUMBERS = ("steering_angle", "speed")
_VECTORS = (("angular_velocity", (3,)), ("linear_acceleration", (3,)), ("wheel_speeds", (4,)), ("pose", (3,)))
_NO_POSE = read_only((math.nan, math.nan, math.nan))
_NO_NUMBERS = read_only(())


@explain_class
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Reading(Suggesting):
    """The latest reading of a sensor, and all that were delivered since the last tick. Arrays are read-only.

    `reading["speed_m_s"]` is one of its values by its column, whose unit may be left out. Before the first reading is
    delivered, its stamp and values are NaN, and `received` is False.

    Raises:
      MessageError: samples that are not one row for each stamp, or another number of values.
    """

    stamp: float  # [s] when the latest was measured
    values: FloatArray  # (n,)
    columns: tuple[str, ...] = ()  # names of the values, with their units at the end; none of a LiDAR's ranges
    stamps: FloatArray = field(default_factory=lambda: _NO_NUMBERS)  # (k,) [s] of those since the last tick
    samples: FloatArray = field(default_factory=lambda: _NO_NUMBERS)  # (k, n) their values

    def __post_init__(self) -> None:
        for name in ("values", "stamps", "samples"):
            object.__setattr__(self, name, read_only(getattr(self, name)))
        shape = len(self.stamps), len(self.values)
        if len(self.samples) != shape[0] or (shape[0] and self.samples.shape != shape):
            raise MessageError(f"Reading.samples has shape {self.samples.shape}; accepted: {shape}")

    @property
    def received(self) -> bool:
        """Whether the sensor has delivered a reading yet."""
        return not math.isnan(self.stamp)

    def __getitem__(self, column: str) -> float:
        found = with_unit(column, self.columns) if isinstance(column, str) else None
        if not self.columns:
            raise MessageError(f"the reading has no columns, such as {shown(column)}; accepted: its `values`")
        if found is None:
            raise MessageError(f"the reading has no column {column!r}; {accepted_names(column, self.columns)}")
        return float(self.values[self.columns.index(found)])

    def __repr__(self) -> str:
        names = self.columns or [f"[{index}]" for index in range(len(self.values))]
        values = [f"{name} {value:.4g}" for name, value in zip(names, self.values, strict=False)]
        return brief(self, f"stamp {self.stamp:.3f} s", *values[:6], *(["..."] if len(values) > 6 else []))


class Readings(dict[str, Reading]):
    """The readings of a car's sensors by name."""

    def __missing__(self, name: str) -> Reading:
        accepted = accepted_names(name, self) if self else f"accepted: sensors=[{name!r}] of the car"
        raise MessageError(f"the car has no sensor {name!r}; {accepted}")


@explain_class
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Odometry(Suggesting):
    """Readings of the car's own sensors between scans: wheel encoders, steering sensor, IMU; and its pose on the map.

    The pose is the true one of base_link at the time of the stamp, unless the car's `pose` has errors. No reactive
    planner needs it. Where there is no map it is NaN. The sensors that a car has besides are in `readings`, by name.

    Raises:
      MessageError: a vector of the wrong length, or a stamp that is not finite.
    """

    stamp: float  # [s]
    speed: float  # [m/s] mean surface speed of the driven wheels, forward positive
    steering_angle: float  # [rad] left positive
    angular_velocity: FloatArray  # (3,) [rad/s] gyro, car frame
    linear_acceleration: FloatArray  # (3,) [m/s^2] accelerometer, car frame, gravity included
    wheel_speeds: FloatArray  # (4,) [m/s] surface speeds: front left, front right, rear left, rear right
    pose: FloatArray = field(default_factory=lambda: _NO_POSE)  # (3,) x [m], y [m], heading [rad], map frame
    readings: Mapping[str, Reading] = field(default_factory=lambda: NO_READINGS)  # of the car's `sensors`

    def __post_init__(self) -> None:
        require_finite(self, self.stamp, names=("stamp",))
        for name, shape in _VECTORS:
            vector = read_only(getattr(self, name))
            if vector.shape != shape:
                raise MessageError(f"Odometry.{name} has shape {vector.shape}; accepted: ({shape[0]},)")
            object.__setattr__(self, name, vector)

    def __repr__(self) -> str:
        x, y, heading = self.pose.tolist()
        return brief(
            self, f"stamp {self.stamp:.3f} s", f"speed {self.speed:.2f} m/s",
            f"steering angle {self.steering_angle:.3f} rad", f"yaw rate {self.yaw_rate:.3f} rad/s",
            "no pose" if math.isnan(x) else f"pose ({x:.2f}, {y:.2f}) m, {heading:.3f} rad",
        )  # fmt: skip

    @property
    def yaw_rate(self) -> float:
        """Turning rate about the car's z axis, left positive [rad/s]."""
        return float(self.angular_velocity[2])


NO_READINGS: Mapping[str, Reading] = Readings()

OF_OTHER_CAR = ("x_m", "y_m", "heading_rad", "speed_m_s", "yaw_rate_rad_s")
"""What the sensor `opponents` says of another car: base_link in the map frame, speed over the ground, yaw rate."""

MOST_OTHERS = 15
"""Greatest number of other cars in a race."""


@lru_cache
def columns_of_others(cars: int) -> tuple[str, ...]:
    """Return the columns of a reading of the sensor `opponents`, which tells of so many cars."""
    return tuple(f"other_{number}_{name}" for number in range(1, cars + 1) for name in OF_OTHER_CAR)


@explain_class
@dataclass(frozen=True, kw_only=True)
class DriveCommand:
    """Command of a planner to the car (ackermann_msgs/AckermannDrive). As an array: [steering, speed].

    Whole numbers and numpy's become floats.

    Raises:
      MessageError: a value that is not a finite number.
    """

    steering_angle: float  # [rad] left positive
    speed: float  # [m/s] forward positive

    def __post_init__(self) -> None:
        require_finite(self, self.steering_angle, self.speed, names=_COMMAND_NUMBERS)
        for name in _COMMAND_NUMBERS:  # not one of numpy's, which are slower
            if type(getattr(self, name)) is not float:
                object.__setattr__(self, name, float(getattr(self, name)))


A_COMMAND = "a DriveCommand(steering_angle=0.1, speed=1.0)"
"""Name of a planner's answer in messages."""

STOP = DriveCommand(steering_angle=0.0, speed=0.0)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class MapLine:
    """The line through the course and the walls beside it, for planners with a map.

    Raises:
      MessageError: points that are not a table of finite numbers, or fewer than two.
    """

    points: FloatArray  # (n, 2) [m] map frame, in driving order
    closed: bool  # a circuit, whose first point is not repeated; else it is driven once
    walls: tuple[FloatArray, ...] = ()  # (k, 2) [m] of each, a closed polyline; none where they are not known

    def __post_init__(self) -> None:
        points = read_only(self.points)
        if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2 or not np.isfinite(points).all():
            raise MessageError(f"MapLine.points has shape {points.shape}; accepted: (n, 2) finite, n at least 2")
        walls = tuple(read_only(wall) for wall in self.walls)
        for k, wall in enumerate(walls):
            if wall.ndim != 2 or wall.shape[1] != 2 or len(wall) < 3 or not np.isfinite(wall).all():
                raise MessageError(f"MapLine.walls[{k}] has shape {wall.shape}; accepted: (k, 2) finite, k at least 3")
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "walls", walls)

    def __repr__(self) -> str:
        walls = f"{len(self.walls)} walls" if self.walls else "no walls"
        return brief(self, f"{len(self.points)} points", "closed" if self.closed else "open", walls)


@dataclass(frozen=True, kw_only=True, eq=False)
class Sketch:
    """An intermediate value of a planner that is drawn in the world: points, or pieces of lines.

    The live view draws what the method `drawings()` of a planner returns.
    """

    points: FloatArray  # (k, 3), or (k, 2, 3): the ends of pieces of lines [m], in the map frame
    colour: tuple[int, int, int]  # red, green, blue in 0..255
    size: float  # [m] of a point; of a line its width
    name: str = ""  # of what it shows: a topic, or the name in `fg_mujoco.show`


_OF_TIRES = ("cornering_stiffness", "peak", "peak_slip")


@explain_class
@dataclass(frozen=True, kw_only=True, repr=False)
class CarParameters:
    """Parameters of a car for planners. Read off the compiled model by `fg_mujoco.vehicle.car`, never typed twice.

    Those from `front_cornering_stiffness` to `relaxation_length` are of its tires, as `fg-mujoco identify` finds them
    on a real car. Their defaults are those of tires that need hardly any slip angle: the set `coulomb`, and
    MuJoCo's contacts.

    Raises:
      MessageError: a value that is not a positive number (`min_speed`: not a finite one; of the tires: inf is one).
    """

    wheelbase: float  # [m] rear axle to front axle
    track_width: float  # [m] between the wheel centres of an axle
    length: float  # [m] over all
    width: float  # [m] over all
    rear_overhang: float  # [m] rear axle to rear bumper
    mass: float  # [kg]
    front_axle_distance: float  # [m] centre of gravity to front axle, lf
    rear_axle_distance: float  # [m] centre of gravity to rear axle, lr
    center_of_gravity_height: float  # [m] over the ground
    yaw_inertia: float  # [kg m^2] about the centre of gravity
    wheel_radius: float  # [m]
    wheel_inertia: float  # [kg m^2] of a wheel about its axle, in the mean
    max_steering_angle: float  # [rad]
    max_steering_rate: float  # [rad/s]
    min_speed: float  # [m/s] fastest in reverse, negative
    max_speed: float  # [m/s]
    max_acceleration: float  # [m/s^2]
    power_limit_speed: float  # [m/s] above it the acceleration falls as power_limit_speed / v
    speed_time_constant: float  # [s] of the speed servo: acceleration = (command - speed) / this, until limited
    lidar_offset: float  # [m] LiDAR ahead of the rear axle
    gravity: float  # [m/s^2] downwards
    front_cornering_stiffness: float = math.inf  # [1/rad] lateral force of the axle over its load, by slip angle
    rear_cornering_stiffness: float = math.inf  # [1/rad]
    front_peak: float = math.inf  # [-] greatest lateral force of the axle over its load
    rear_peak: float = math.inf  # [-]
    front_peak_slip: float = math.inf  # [rad] slip angle of the peak; inf: the force grows in proportion
    rear_peak_slip: float = math.inf  # [rad]
    relaxation_length: float = 0.0  # [m] over which the force follows the slip angle
    steering_time_constant: float = 0.02  # [s] of the steering servo: rate = (command - angle) / this, until limited
    command_delay: float = 0.0  # [s] from a command to the servos
    drives_front: bool = True  # whether the motor drives, and brakes, the front axle
    drives_rear: bool = True
    shaft: bool = False  # whether both axles turn alike; else they have the same torque
    front_lock: float = 0.0  # [-] the greatest difference of its wheels' forces over their sum: 0 open, 1 locked
    rear_lock: float = 0.0
    rolling_resistance: float = 0.0  # [m/s^2] by which a car slows that rolls: by tires, drag brake, friction of gears
    rolling_damping: float = 0.0  # [1/s] by which more, over its speed; only what slows the wheels, not the air

    def __post_init__(self) -> None:
        require(self, math.isfinite, "a finite number", ("min_speed",), MessageError)
        of_tires = tuple(f"{axle}_{name}" for axle in ("front", "rear") for name in _OF_TIRES)
        from_zero = ("relaxation_length", "command_delay", "rolling_resistance", "rolling_damping")
        flags = ("drives_front", "drives_rear", "shaft")
        locks = ("front_lock", "rear_lock")
        others = ("min_speed", *from_zero, *of_tires, *flags, *locks)
        positive = tuple(f.name for f in fields(self) if f.name not in others)
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", positive, MessageError)
        require(self, lambda value: value > 0.0, "a positive number, or inf", of_tires, MessageError)
        require(self, lambda value: 0.0 <= value < math.inf, "a number from 0", from_zero, MessageError)
        require(self, lambda value: 0.0 <= value <= 1.0, "a number from 0 to 1", locks, MessageError)
        for name in flags:
            if not isinstance(getattr(self, name), bool):
                raise MessageError(f"CarParameters.{name} is {getattr(self, name)!r}; accepted: True or False")
        if not (self.drives_front or self.drives_rear):
            raise MessageError("CarParameters.drives_front and drives_rear are False; accepted: True of one or both")

    def __repr__(self) -> str:
        return brief(
            self, f"wheelbase {self.wheelbase:.4g} m", f"{self.length:.3g} x {self.width:.3g} m",
            f"mass {self.mass:.4g} kg", f"steering angle +-{self.max_steering_angle:.4g} rad",
            f"speed {self.min_speed:.4g} to {self.max_speed:.4g} m/s",
            f"acceleration {self.max_acceleration:.4g} m/s^2",
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ScanGeometry:
    """The constant part of one LiDAR's scans: everything of a LaserScan but its stamp and ranges."""

    angle_min: float  # [rad]
    angle_max: float  # [rad]
    angle_increment: float  # [rad]
    range_min: float  # [m]
    range_max: float  # [m]
    scan_time: float  # [s] from one sweep to the next
    bearings: FloatArray  # (beams,) [rad], read-only

    def __repr__(self) -> str:
        least, most = math.degrees(self.angle_min), math.degrees(self.angle_max)
        beams = f"{len(self.bearings)} beams from {least:.1f} to {most:.1f} deg"
        return brief(self, beams, f"{self.range_min:g} to {self.range_max:g} m", f"every {self.scan_time:g} s")


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannerContext:
    """All that a planner may know before it drives. Its constructor names those of these fields that it needs.

    It is made in one place, by `DriveSettings.context`, whoever asks a planner to drive.

    Raises:
      MessageError: a value out of its range.
    """

    car: CarParameters
    mu: float  # friction coefficient that it is to believe in; inf: no friction limits
    max_speed: float  # [m/s] fastest that it may command
    period: float = 0.025  # [s] from one scan to the next
    latency: float = 0.0  # [s] from measuring a scan to its command reaching the servos, without the planner's own time
    seed: int = 0  # that the car is driven with, for planners that draw numbers
    map_line: MapLine | None = None  # the line through the course; None: there is no map
    sensors: tuple[str, ...] = ()  # names of the sensors whose readings are in its odometry
    lidar: ScanGeometry | None = None  # the constant part of its scans; None: not known, as on a car
    assist: str = "full"  # stages between its reference and its command, see controllers.control.stages

    def __post_init__(self) -> None:
        require(self, lambda value: value > 0.0, "a positive number, or inf", ("mu",), MessageError)
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", ("max_speed", "period"), MessageError)
        require(self, lambda value: 0.0 <= value < math.inf, "a number from 0", ("latency",), MessageError)


ODOMETRY = np.dtype(
    [
        ("stamp", np.float64),
        ("speed", np.float64),
        ("steering_angle", np.float64),
        ("angular_velocity", np.float64, (3,)),
        ("linear_acceleration", np.float64, (3,)),
        ("wheel_speeds", np.float64, (4,)),
        ("pose", np.float64, (3,)),
    ]
)
"""One row of the odometry of many cars; fields and units as in Odometry."""


class Controller(Protocol):
    """A planner: called once for each scan; given the same inputs since `reset()`, it gives the same outputs."""

    def __call__(self, scan: LaserScan, odometry: Odometry) -> DriveCommand:
        """Answer the command to hold until the next scan."""

    def reset(self) -> None:
        """Forget everything seen so far."""


class ControllerBatch(Protocol):
    """Many planners of one class, one for each world, decided in one compiled call.

    A controller's class may offer `batch(planners)`, which returns one of these for planners in the order of their
    worlds. Each must decide as the planner itself would, bit for bit, whatever the others see.

    It may have a method `compiled_calls` of the same arguments: it returns calls that decide for these arrays as often
    as they are made, (k, 2) whole numbers, in each row the address of a function in C of one 64-bit whole number, and
    that number. An engine then makes them within its own compiled call. `core.CALL_PYTHON` of fg_mujoco.native is such
    a function: it calls what has that `id` in Python. And a method `take_readings(row, readings)`, called before each
    decision with the readings of each running car that has sensors.
    """

    def __call__(
        self,
        geometry: ScanGeometry,
        ranges: FloatArray,
        odometry: NDArray[np.void],
        running: NDArray[np.bool_],
        commands: FloatArray,
    ) -> None:
        """Write the command of each running world into `commands`.

        Args:
          geometry: of the scans.
          ranges: (n, beams) [m], as in LaserScan.
          odometry: (n,) rows of ODOMETRY.
          running: (n,) the worlds that still run; the others' rows are left as they are.
          commands: (n, 2) steering angle [rad] and speed [m/s], written to.
        """

    def reset(self) -> None:
        """Forget everything seen so far, in all worlds."""
