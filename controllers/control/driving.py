"""From a goal to a command: the steering angle by pursuit, the speed by the planner's speed law, made safe for a car.

Laws that look at the scan say how fast it may go; `stopping` sees to it that it stops within what it sees
(stopping_paths), and `friction` that the tires hold what is commanded (friction_guard). With both, it goes no way on
which it could not stop if it has another (escape), and where it has come to stand without one it goes back
(backing_out). A planner that believes in no friction limit, mu = inf, has none of these.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.errors import SettingsError
from fg_mujoco.kernels import kernel
from fg_mujoco.messages import CarParameters, FloatArray, require

from ..perception.scan_filters import widen_all
from ..perception.scan_geometry import beams_between, period_of
from ..safety.braking_trajectories import safe_speed
from ..safety.friction_limiter import GUARD, GUARD_MEMORY, FrictionGuard, guarded
from ..safety.recovery import TRAIL, BackingSettings, angle_back, backs, follow
from ..safety.safety_filter import EscapeSettings, way_out
from .records import CAR, Record, record_type, record_values, require_words
from .speed import forward_distance_speed, range_ratio_speed
from .steering import pursue, saturate

_STANDING = 0.05  # [m/s] a car as slow as this stands
_AHEAD = math.radians(2.0)  # to either side: beams that count as straight ahead

SpeedLaw = Literal["minimum", "forward_distance", "range_ratio", "friction", "stopping"]

DRIVER = np.dtype(
    [
        ("car", CAR),
        ("max_speed", np.float64),  # [m/s]
        ("forward_distance", np.bool_),  # which of the speed laws are kept
        ("range_ratio", np.bool_),
        ("friction", np.bool_),
        ("stopping", np.bool_),
        ("way_out", np.bool_),
        ("backs_out", np.bool_),
        ("guard", GUARD),
        ("escape", record_type(EscapeSettings)),
        ("backing", record_type(BackingSettings)),
        ("paths", np.int64),  # which table of stopping paths is its own
    ]
)
"""What these kernels are told of a planner."""

DRIVING_MEMORY = np.dtype([("guard", GUARD_MEMORY), ("trail", TRAIL)])
"""What they keep of its car from tick to tick; zero in the beginning."""


@dataclass(frozen=True, kw_only=True)
class DrivingSettings:
    """Parameters that every planner has, with its own defaults: how it drives to a goal.

    Raises:
      SettingsError: an unknown law; a length or gain that is not a positive number; an angle or distance below 0; a
        full-speed distance that is not above the safe one.
    """

    speed_law: SpeedLaw = "minimum"
    way_out: bool = True  # minimum: where the car could not stop on its way, it takes one on which it can
    backs_out: bool = True  # with a way out: where it stands and there is none, it goes back and tries again
    # forward_distance: nearer ahead than the first, stop; farther than the second, full speed. Among the other laws it
    # is the last resort, as it does not know that the car turns; alone, 5 m are safe: from 8 m/s braking takes 4.9
    safe_distance: float = 0.2  # [m] from the LiDAR, which is .18 behind the bumper
    full_speed_distance: float = 1.5  # [m]
    lookahead: float = 10.0  # [m] range_ratio: what lies beyond counts as no farther
    range_ratio_gain: float = 3.0  # range_ratio: full speed at this part of the lookahead
    front_width: float = math.radians(20.0)  # [rad] range_ratio: around the goal, for the mean
    pursuit_distance: float = 1.0  # [m] the arc leads through the point this far along the goal's direction

    def __post_init__(self) -> None:
        require_words(self)
        for name in ("way_out", "backs_out"):
            if not isinstance(getattr(self, name), bool):
                value = getattr(self, name)
                raise SettingsError(f"{type(self).__name__}.{name} is {value!r}; accepted: True, False")
        positive = ("lookahead", "range_ratio_gain", "pursuit_distance")
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", positive, SettingsError)
        from_zero = ("safe_distance", "front_width")
        require(self, lambda value: 0.0 <= value < math.inf, "a number from 0", from_zero, SettingsError)
        accepted = f"a number above safe_distance, {self.safe_distance}"
        longer = ("full_speed_distance",)
        require(self, lambda value: self.safe_distance < value < math.inf, accepted, longer, SettingsError)


def driver_record(
    car: CarParameters, max_speed: float, guard: FrictionGuard | None, settings: DrivingSettings
) -> NDArray[np.void]:
    """Return a row of type DRIVER, shape (1,); without a guard, of a planner that believes in no friction limit."""
    law = settings.speed_law
    row = np.zeros(1, DRIVER)
    row["escape"], row["backing"] = record_values(EscapeSettings()), record_values(BackingSettings())
    row["car"], row["max_speed"] = astuple(car), max_speed
    for name in ("forward_distance", "range_ratio"):
        row[name] = law in (name, "minimum")
    if guard is not None:
        row["friction"], row["stopping"] = law in ("friction", "minimum"), law in ("stopping", "minimum")
        row["way_out"] = settings.way_out and law == "minimum"
        row["backs_out"] = settings.backs_out and row["way_out"]
        row["guard"] = guard.record
    return row


@kernel
def drive_to(
    scan: Record,
    valid: FloatArray,
    ranges: FloatArray,
    odometry: Record,
    planner: Record,
    memory: Record,
    paths: NDArray[np.void],
    bearing: float,
    distance: float,
) -> tuple[float, float]:
    """Return the command that leads to a goal seen by the LiDAR, as fast as the planner's speed law lets it.

    Args:
      scan: of type SCAN.
      valid: its readings (n,) [m], without NaN or inf.
      ranges: what the planner made of them, for the mean range towards the goal, (n,) [m].
      odometry: of type ODOMETRY.
      planner: `settings` (of DrivingSettings, and more) and `driver` (of type DRIVER).
      memory: of type DRIVING_MEMORY, written to.
      paths: tables of type PATHS.
      bearing: of the goal [rad]; NaN: there is none, and the car brakes.
      distance: of the goal from the LiDAR [m].
    """
    driver, settings = planner.driver, planner.settings
    if math.isnan(bearing):
        return brake(scan, odometry, driver, memory)
    reach = min(distance, settings.pursuit_distance)
    steering_angle = pursue(bearing, reach, driver.car.lidar_offset, driver.car.wheelbase)
    speed = speed_towards(scan, valid, ranges, planner, bearing)
    return drive(scan, valid, odometry, driver, memory, paths, steering_angle, speed)


@kernel
def speed_towards(scan: Record, valid: FloatArray, ranges: FloatArray, planner: Record, bearing: float) -> float:
    """Return the speed [m/s] by the two laws that look at ranges only; arguments as in `drive_to`."""
    driver, settings = planner.driver, planner.settings
    speed = driver.max_speed
    if driver.forward_distance:
        first, end = beams_between(scan, len(valid), -_AHEAD, _AHEAD)
        ahead = math.inf  # where nobody looks straight ahead, this law has nothing to say
        for beam in range(first, end):
            ahead = min(ahead, valid[beam])
        full_speed = settings.full_speed_distance
        speed = min(speed, forward_distance_speed(ahead, settings.safe_distance, full_speed, driver.max_speed))
    if driver.range_ratio:
        goal = round((bearing - scan.angle_min) / scan.angle_increment)
        half = round(0.5 * settings.front_width / scan.angle_increment)
        front = ranges[max(goal - half, 0) : max(goal + half + 1, 0)]
        gain = settings.range_ratio_gain
        speed = min(speed, range_ratio_speed(front, settings.lookahead, gain, driver.max_speed))
    return float(speed)


@kernel
def drive(
    scan: Record,
    valid: FloatArray,
    odometry: Record,
    driver: Record,
    memory: Record,
    paths: NDArray[np.void],
    steering_angle: float,
    speed: float,
) -> tuple[float, float]:
    """Return the command for a wish: steering angle [rad] and speed [m/s]; without odometry, 0 and 0.

    Args:
      scan: of type SCAN.
      valid: its readings (n,) [m], without NaN or inf.
      odometry: of type ODOMETRY.
      driver: of type DRIVER.
      memory: of type DRIVING_MEMORY, written to.
      paths: tables of type PATHS; `driver.paths` is the place of the planner's own.
      steering_angle: wished [rad].
      speed: wished [m/s].
    """
    if not math.isfinite(odometry.speed + odometry.steering_angle):
        return brake(scan, odometry, driver, memory)
    if driver.stopping:
        table = paths[driver.paths]
        widened = widen_all(valid, scan.angle_increment, table.radius)
        _note_the_way(scan, odometry, driver, memory)
        in_sight = safe_speed(
            table, widened, scan.angle_min, scan.angle_increment, odometry.speed, odometry.steering_angle
        )
        if driver.way_out:
            return _drive_with_way_out(scan, widened, odometry, driver, memory, steering_angle, speed, in_sight)
        speed = min(speed, in_sight)
    if not driver.friction:
        return saturate(steering_angle, driver.car.max_steering_angle), speed
    return _hold(scan, odometry, driver, memory, steering_angle, speed, driver.guard.settings.least_lateral_use)


@kernel
def _drive_with_way_out(
    scan: Record,
    widened: FloatArray,
    odometry: Record,
    driver: Record,
    memory: Record,
    steering_angle: float,
    speed: float,
    in_sight: float,
) -> tuple[float, float]:
    """Return the command for a wish, or for the way beside it on which the car can stop; arguments as in `drive`.

    Beside the wish it brakes. With a way out it does at least crawl, even where nothing that is planned softly is free.
    Where it has come to stand without one it goes back, and tries again.
    """
    angle, now, car = odometry.steering_angle, odometry.speed, driver.car
    guard, settings, trail, period = driver.guard, driver.escape, memory.trail, period_of(scan)
    wish = saturate(steering_angle, car.max_steering_angle)
    if trail.tried > 0:
        speed = min(speed, driver.backing.speed)
    wished_speed = min(speed, max(in_sight, settings.crawl_speed))
    way, use, found = way_out(
        guard, memory.guard, settings, widened, scan.angle_min, scan.angle_increment, wish, wished_speed, angle, now,
        period,
    )  # fmt: skip
    if driver.backs_out and backs(trail, driver.backing, abs(now) < _STANDING, found, period):
        back = saturate(angle_back(trail, car.wheelbase), car.max_steering_angle)
        return _hold(scan, odometry, driver, memory, back, -driver.backing.speed, use)
    if not found:
        speed = 0.0 if now > settings.crawl_speed else min(speed, in_sight)
        return _hold(scan, odometry, driver, memory, way, speed, use)
    if way != wish:
        return _hold(scan, odometry, driver, memory, way, min(speed, settings.crawl_speed), use)
    return _hold(scan, odometry, driver, memory, steering_angle, wished_speed, use)


@kernel
def brake(scan: Record, odometry: Record, driver: Record, memory: Record) -> tuple[float, float]:
    """Return the command to stop as hard as the tires hold, the wheels kept as they are; arguments as in `drive`.

    Without the friction law, and without odometry, that is 0 and 0.
    """
    _note_the_way(scan, odometry, driver, memory)
    if not driver.friction:
        return 0.0, 0.0
    least = driver.guard.settings.least_lateral_use
    return _hold(scan, odometry, driver, memory, odometry.steering_angle, 0.0, least)


@kernel
def _note_the_way(scan: Record, odometry: Record, driver: Record, memory: Record) -> None:
    """Keep what the car needs to know to go back; once in every tick, whatever is decided."""
    if driver.backs_out:
        follow(memory.trail, driver.backing, odometry.speed, odometry.angular_velocity[2], period_of(scan))


@kernel
def _hold(
    scan: Record,
    odometry: Record,
    driver: Record,
    memory: Record,
    steering_angle: float,
    speed: float,
    least_use: float,
) -> tuple[float, float]:
    angle, now = odometry.steering_angle, odometry.speed
    return guarded(driver.guard, memory.guard, steering_angle, speed, least_use, angle, now, period_of(scan))
