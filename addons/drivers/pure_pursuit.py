"""Pure pursuit: the car has a map, and follows a line through it. The reference for what a map is worth.

The nearest point of the line is looked for from the one of the last tick on, so that a stretch that runs close by is
not mistaken for this one; at first, and beyond `lost_distance`, on the whole line. The goal is the first point from
there on that is at least a lookahead away, which grows with the speed, with how late the car's wheels turn, and with
the distance to the line, so that the car joins it at a flat angle. The arc to it has curvature 2 y / L^2
(steering.pursue); to a goal behind it the car turns as sharply as it can. With `tracker` the car steers by another law
near the line (line_trackers, line_mpc). The speed is that of a profile computed once (line_profile.limit_speeds), where
the car is and where it will be after `reaction`, the slower of the two. At the end of an open line the car stops.
The line is the centreline, that of a CSV file (line_profile.read_line), driven in the order of its points, or that of
least lap time between the map's walls (map_raceline). It is closed if the map's own line is, and then goes round in
the same direction.
Source: R. Coulter, Implementation of the Pure Pursuit Path Tracking Algorithm, CMU-RI-TR-92-01.
Limits: the planner does not see obstacles. Its speed law is `friction`, the profile held in transients; `stopping` and
`minimum` stop it before an obstacle on its line, and it stays there. It cuts corners, more with a longer lookahead. It
brakes without a pose, and without a scan: a car whose LiDAR is dead does not know its pose for long.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Literal

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.controllers.control.driving import DrivingSettings, refer
from fg_mujoco.controllers.control.planner import Planner
from fg_mujoco.controllers.control.planner_settings import (
    FROM_ZERO,
    POSITIVE,
    SHARE,
    Record,
    for_car,
    setting,
    setting_of_car,
)
from fg_mujoco.controllers.control.slip import late_on_path
from fg_mujoco.controllers.control.stages import Stage, Tick
from fg_mujoco.controllers.control.steering import late_by, pursue
from fg_mujoco.controllers.perception.scan_geometry import sees
from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter
from fg_mujoco.course.line_file import require_closed
from fg_mujoco.course.polyline import is_inside, step_lengths
from fg_mujoco.errors import SettingsError, TrackError
from fg_mujoco.messages import CarParameters, FloatArray, MapLine, Odometry

from .line_profile import (
    LEFT,
    RIGHT,
    SPEED,
    STEP,
    X,
    Y,
    is_counterclockwise,
    line_table,
    moved_along,
    next_point,
    read_line,
)

_PURE_PURSUIT, _MAP = 1, 4  # indices of the words of the setting `tracker`
_SHORT_JOINING = 1.0  # m/m: the other trackers join the line further on by no more, so as not to cut a bend on the way
_SHORTEST, _LONGEST = 0.5, 1.5  # times the course's own line may a lap of another be
_LOOKED_AT = 100  # points of a line, about, of which most have to be on the course
_SEARCH = 2.0  # [m] along the line, to either side of the last nearest point


@dataclass(frozen=True, kw_only=True)
class PurePursuitSettings(DrivingSettings):
    """The line, the lookahead and the speed."""

    line: str = setting("centreline", text="or raceline, of least lap time, or the path of a CSV file")
    tracker: Literal["auto", "pure_pursuit", "stanley", "lqr", "map", "mpc"] = setting(
        "auto", text="how it steers along the line; auto: lqr on a raceline, else pure_pursuit"
    )
    margin: float = setting(0.1, "m", "raceline: between the car and the walls", FROM_ZERO)
    least_lookahead: float = setting_of_car(0.8, "m", "from the rear axle", POSITIVE)
    lookahead_time: float = setting(0.15, "s", "the lookahead is at least the way of this time", FROM_ZERO)
    joining_lookahead: float = setting(3.0, "m/m", "as much more for each metre off the line", FROM_ZERO)
    lost_distance: float = setting(2.0, "m", "from the line, beyond which the whole line is searched", POSITIVE)
    reaction: float = setting(0.1, "s", "the speed servo's lag", FROM_ZERO)
    curvature_span: float = setting_of_car(0.8, "m", "to either side of a point, for the profile", POSITIVE)
    cornering_use: float = setting(0.9, "", "share of the cornering that the friction limiter allows", SHARE)
    braking_use: float = setting(0.6, "", "share of the braking and accelerating that it allows", SHARE)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.line, str) or not self.line:
            accepted = "centreline, raceline, or a path to a .csv"
            raise SettingsError(f"PurePursuitSettings.line is {self.line!r}; accepted: {accepted}")


@kernel
def distance_to(line: FloatArray, point: int, x: float, y: float) -> float:
    """Return the distance [m] of a point of the line from (x, y) [m]."""
    return math.hypot(line[point, X] - x, line[point, Y] - y)


@kernel
def nearest_of_all(line: FloatArray, x: float, y: float) -> int:
    """Return the point of the line that is nearest to (x, y) [m]."""
    best = 0
    for point in range(1, len(line)):
        if distance_to(line, point, x, y) < distance_to(line, best, x, y):
            best = point
    return best


@kernel
def nearest_from(line: FloatArray, last: int, x: float, y: float) -> int:
    """Return the point nearest to (x, y) [m] of the stretch of line round the last one."""
    best = last
    for direction in (1, -1):
        point = last
        for _ in range(math.ceil(_SEARCH / line[0, STEP])):
            point = next_point(line, point, direction)
            if distance_to(line, point, x, y) < distance_to(line, best, x, y):
                best = point
    return best


@kernel
def nearest_point(line: FloatArray, memory: Record, lost_distance: float, x: float, y: float) -> int:
    """Return the point nearest to (x, y) [m], and remember it."""
    if memory.on_line:
        memory.point = nearest_from(line, memory.point, x, y)
    if not memory.on_line or distance_to(line, memory.point, x, y) > lost_distance:
        memory.point = nearest_of_all(line, x, y)
    memory.on_line = True
    return int(memory.point)


@kernel
def lookahead_at(settings: Record, slip: Record, car: Record, speed: float, offset: float) -> float:
    """Return the lookahead [m] of a car at a speed [m/s] and a distance to the line [m]."""
    late = late_on_path(slip, car, speed) if settings.tracker == _MAP else late_by(car)
    on_line = max(settings.least_lookahead, settings.lookahead_time * speed) + late * speed
    joining = settings.joining_lookahead
    if settings.tracker > _PURE_PURSUIT:
        joining = min(joining, _SHORT_JOINING)
    return float(on_line + joining * offset)


@kernel
def goal_ahead(line: FloatArray, nearest: int, lookahead: float, x: float, y: float) -> tuple[float, float]:
    """Return the first place of the line from a point on that is `lookahead` [m] from (x, y) [m]: x and y [m].

    It is no further along than the lookahead and as much again; beyond the end of an open line it is straight on.
    """
    point = nearest
    for _ in range(math.ceil(2.0 * lookahead / line[0, STEP])):
        if distance_to(line, point, x, y) >= lookahead:
            break
        ahead = next_point(line, point, 1)
        if ahead == point:
            before = next_point(line, point, -1)
            beyond = (lookahead - distance_to(line, point, x, y)) / line[0, STEP]
            goal_x = line[point, X] + beyond * (line[point, X] - line[before, X])
            return goal_x, line[point, Y] + beyond * (line[point, Y] - line[before, Y])
        point = ahead
    return line[point, X], line[point, Y]


@kernel
def profile_speed(line: FloatArray, nearest: int, ahead: float) -> float:
    """Return the speed [m/s] of the profile at a point or `ahead` [m] further on, the slower of the two."""
    return float(min(line[nearest, SPEED], line[moved_along(line, nearest, ahead), SPEED]))


@kernel
def _follow(
    odometry: Record, driver: Record, settings: Record, memory: Record, line: FloatArray, reference: Record
) -> tuple[float, float, float, float]:
    """Return the steering angle [rad], the speed of the profile [m/s], the goal's bearing [rad] and distance [m].

    NaN: brake. The nearest point of the line is written into the reference, for other trackers.
    """
    car, slip = driver.car, driver.limiter.slip
    x, y, heading = odometry.pose
    if not (math.isfinite(x + y + heading) and math.isfinite(odometry.speed)):
        return math.nan, 0.0, math.nan, math.nan
    now = min(abs(odometry.speed), car.max_speed)
    nearest = nearest_point(line, memory, settings.lost_distance, x, y)
    if line[nearest, SPEED] == 0.0:
        return math.nan, 0.0, math.nan, math.nan
    offset = distance_to(line, nearest, x, y)
    reference.point, reference.off_line = nearest, offset
    goal_x, goal_y = goal_ahead(line, nearest, lookahead_at(settings, slip, car, now, offset), x, y)
    bearing, distance = math.atan2(goal_y - y, goal_x - x) - heading, math.hypot(goal_x - x, goal_y - y)
    bearing = math.atan2(math.sin(bearing), math.cos(bearing))
    speed = profile_speed(line, nearest, (settings.reaction + late_by(car)) * now)
    if abs(bearing) > 0.5 * math.pi:
        steering_angle = math.copysign(car.max_steering_angle, bearing)
    else:
        steering_angle = pursue(bearing, distance, 0.0, car.wheelbase)
    return steering_angle, speed, bearing, distance


class PurePursuit(Planner):
    """The planner with a map. Without a pose, or a scan, it brakes and keeps its steering angle.

    Raises SettingsError: as Planner; a line that cannot be read, with file and row, is open, or goes the course's other
    way.
    """

    Settings = PurePursuitSettings
    assists = {"full": ("limiter",)}  # noqa: RUF012 - it has a map
    memory_type = np.dtype([("point", np.int64), ("on_line", np.bool_)])

    def __init__(
        self,
        car: CarParameters,
        mu: float,
        max_speed: float = 8.0,
        settings: Any = None,
        *,
        map_line: MapLine,
        latency: float = 0.0,
        period: float = 0.025,
        assist: str = "full",
    ) -> None:
        settings = PurePursuitSettings() if settings is None else settings
        if type(settings) is not PurePursuitSettings:  # which is refused
            super().__init__(car, mu, max_speed, settings)
        if settings.tracker == "auto":
            settings = replace(settings, tracker="lqr" if settings.line == "raceline" else "pure_pursuit")
        points, speeds = map_line.points, np.full(len(map_line.points), math.inf)
        if settings.line == "raceline":
            from .map_raceline import raceline  # takes a while

            points = raceline(map_line, car, mu, max_speed, for_car(settings, car))
            speeds = np.full(len(points), math.inf)
        elif settings.line != "centreline":
            points, speeds = read_line(settings.line)
            if map_line.closed:
                self._require_lap(points, map_line, settings.line)
        shape = (points.tobytes(), speeds.tobytes(), map_line.closed)
        walled = map_line if settings.tracker == "mpc" and map_line.closed and map_line.walls else None
        table = _table(*shape, car, mu, max_speed, for_car(settings, car), walled)
        super().__init__(car, mu, max_speed, settings, latency=latency, period=period, line=table, assist=assist)

    @staticmethod
    def _require_lap(points: FloatArray, map_line: MapLine, path: str) -> None:
        """Raise SettingsError for a line that is not closed, or is no lap of a course in its direction."""
        try:
            require_closed(points)
        except TrackError as error:
            raise SettingsError(f"line {path}: {error}") from error
        way, course = (
            "counterclockwise" if is_counterclockwise(line) else "clockwise" for line in (points, map_line.points)
        )
        if way != course:
            raise SettingsError(
                f"line {path} goes {way}, the course {course}; accepted: a line in the course's direction; a map or a "
                f"CSV is turned round by --track 'FILE[direction={way}]'"
            )
        length, lap = (float(step_lengths(line).sum()) for line in (points, map_line.points))
        if not _SHORTEST <= length / lap <= _LONGEST:
            raise SettingsError(f"line {path} is {length:.1f} m long, the course {lap:.1f} m; accepted: one lap of it")
        some = points[:: max(len(points) // _LOOKED_AT, 1)]
        outside = some[~is_inside(some, map_line.walls)] if map_line.walls else some[:0]
        if len(outside) > 0.5 * len(some):
            x, y = outside[0].tolist()
            raise SettingsError(
                f"line {path} is outside of the course, as at ({x:.2f}, {y:.2f}); accepted: a line between its walls, "
                "in metres and in its map's frame"
            )

    @staticmethod
    @kernel
    def refer(tick: Tick) -> None:
        """Write the reference."""
        steering_angle, speed, bearing, distance = math.nan, 0.0, math.nan, math.nan
        if sees(tick.geometry, tick.ranges):
            steering_angle, speed, bearing, distance = _follow(
                tick.odometry, tick.driver, tick.state.settings, tick.state.memory, tick.line, tick.reference
            )
        refer(tick.record, tick.ranges, steering_angle, speed, bearing, distance)

    def own_stages(self) -> dict[str, Stage]:
        """Return its tracker, which is a stage."""
        tracker = self.settings.tracker
        if tracker == "pure_pursuit":
            return {}
        if tracker == "mpc":
            from .line_mpc import TRACK

            return {tracker: TRACK}
        from .line_trackers import LQR, MAP, STANLEY

        return {tracker: {"lqr": LQR, "map": MAP, "stanley": STANLEY}[tracker]}

    def speed_profile(self) -> FloatArray:
        """Return the line and its profile: x [m], y [m] and speed [m/s] of each point. Shape (n, 3)."""
        assert self.line is not None
        return self.line[:, : SPEED + 1].copy()

    def find_goal(self, odometry: Odometry) -> tuple[float, float] | None:
        """Return the place on the map that it would steer to, seen for the first time: x and y [m]; None: no pose."""
        x, y, heading = odometry.pose.tolist()
        if self.line is None or not math.isfinite(x + y + heading + odometry.speed):
            return None
        nearest = nearest_of_all(self.line, x, y)
        offset = distance_to(self.line, nearest, x, y)
        driver = self.driver[0]
        slip, car = driver["limiter"]["slip"], driver["car"]
        lookahead = lookahead_at(self.settings_row[0], slip, car, abs(odometry.speed), offset)
        return goal_ahead(self.line, nearest, lookahead, x, y)


@lru_cache(maxsize=8)
def _table(
    points: bytes,
    speeds: bytes,
    closed: bool,
    car: CarParameters,
    mu: float,
    max_speed: float,
    settings: Any,
    walled: MapLine | None,
) -> FloatArray:
    """Return the table of a line, read-only: planners of the same line and settings share it."""
    table = line_table(
        np.frombuffer(points).reshape(-1, 2),
        np.frombuffer(speeds),
        closed=closed,
        limiter=FrictionLimiter(car, mu) if math.isfinite(mu) else None,
        max_speed=max_speed,
        curvature_span=settings.curvature_span,
        cornering_use=settings.cornering_use,
        braking_use=settings.braking_use,
    )
    if walled is not None:
        from .map_raceline import room_on_map

        table[:, [RIGHT, LEFT]] = room_on_map(table, walled, car, settings.margin)
    table.flags.writeable = False
    return table
