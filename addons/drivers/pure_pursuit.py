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

What is done in each tick is in native/addons/drivers/pure_pursuit.cpp.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Literal

import numpy as np

from fg_mujoco.controllers.control.driving import DrivingSettings
from fg_mujoco.controllers.control.planner import Planner
from fg_mujoco.controllers.control.planner_settings import (
    FROM_ZERO,
    POSITIVE,
    SHARE,
    for_car,
    record_type,
    setting,
    setting_of_car,
)
from fg_mujoco.controllers.control.stages import NativeStep, Stage
from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter
from fg_mujoco.course.line_file import require_closed
from fg_mujoco.course.polyline import is_inside, step_lengths
from fg_mujoco.errors import SettingsError, TrackError
from fg_mujoco.messages import CarParameters, FloatArray, MapLine, Odometry
from fg_mujoco.native import core, record

from .line_profile import LEFT, RIGHT, SPEED, is_counterclockwise, line_table, read_line

_SHORTEST, _LONGEST = 0.5, 1.5  # times the course's own line may a lap of another be
_LOOKED_AT = 100  # points of a line, about, of which most have to be on the course


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


record_type(PurePursuitSettings, native=True)  # is checked


class PurePursuit(Planner):
    """The planner with a map. Without a pose, or a scan, it brakes and keeps its steering angle.

    Raises SettingsError: as Planner; a line that cannot be read, with file and row, is open, or goes the course's other
    way.
    """

    Settings = PurePursuitSettings
    assists = {"full": ("limiter",)}  # noqa: RUF012 - it has a map
    memory_type = record("OnLine", [("point", np.int64), ("on_line", np.bool_)])  # the nearest point, if there is one
    refer = NativeStep("pure_pursuit")

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
        goal: tuple[float, float] = core.goal_on_line(self.line, self.settings_row, self.driver, x, y, odometry.speed)
        return goal


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
