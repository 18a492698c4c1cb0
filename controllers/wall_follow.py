"""Wall following: a steady distance from the wall at the car's side. The planner looks at nothing else.

Two beams to one side, b at 90 degrees and a at theta ahead of it, meet the wall at two points. From these

    alpha = atan2(a cos(theta) - b, a sin(theta))    by how much the car turns away from the wall
    D     = b cos(alpha)                             distance from the LiDAR to the wall
    D'    = D + L sin(alpha)                         the same after the lookahead L, on its present heading

and the steering angle, towards the wall, is kp (D' - desired) + kd sin(alpha), saturated. sin(alpha) is by how much
the distance grows on each metre, so this is a PD law whose derivative is measured, not differenced.

`side` says which wall: left, right, or both, which holds the middle: half of the difference of the two sides' D' and
of their sin(alpha), and no desired distance. Where one of a wall's beams has no return, or the scan does not reach
that far round, there is no wall: with both sides the car keeps the desired distance from the other wall, and where no
wall is left it goes straight on.

Source: the F1TENTH course, lecture and lab on wall following. There the derivative is differenced in time, and there is
an integral term. The speed is that of the planner's speed law, in the direction in which the car steers.

Limits, which are where the slides on reactive methods begin: two beams of a side. The planner does not steer round an
obstacle ahead: it stops before it, by its speed law, unless `assist=full+safety_filter` leads it past. A box at the
wall is a wall that is near, then far. At a square corner of the inner wall the beam ahead is lost round the corner, and
the car turns in on the corner; the default is the middle, where the outer wall outweighs that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from fg_mujoco.messages import FloatArray, LaserScan
from fg_mujoco.native_arrays import views

from .control.driving import DrivingSettings
from .control.planner import Planner
from .control.planner_settings import FROM_ZERO, Accepted, Record, setting
from .control.steering import late_by, saturate
from .perception.scan_filters import valid_ranges
from .perception.scan_geometry import geometry_record, sees


@dataclass(frozen=True, kw_only=True)
class WallFollowSettings(DrivingSettings):
    """Parameters of the law."""

    side: Literal["left", "right", "both"] = setting("both", text="wall that is followed")
    desired_distance: float = setting(0.9, "m", "from the LiDAR to the wall", FROM_ZERO)
    beam_angle: float = setting(
        math.radians(45.0), "rad", "theta, from the beam abeam to the one ahead of it",
        Accepted("an angle between 0 and 90 degrees, in radians", lambda value: 0.0 < value < 0.5 * math.pi),
    )  # fmt: skip
    projection: float = setting(1.5, "m", "the lookahead L", FROM_ZERO)
    proportional_gain: float = setting(0.2, "rad/m", "kp", FROM_ZERO)
    derivative_gain: float = setting(0.3, "rad", "kd", FROM_ZERO)


def reading_at(geometry: Record, ranges: FloatArray, bearing: float) -> float:
    """Return the reading [m] of the beam nearest to a bearing [rad]; NaN without a return, or without a beam there."""
    beam = round((bearing - geometry.angle_min) / geometry.angle_increment)
    if not 0 <= beam < len(ranges) or ranges[beam] >= geometry.range_max:
        return math.nan
    return float(ranges[beam])


def wall_beside(geometry: Record, ranges: FloatArray, side: float, beam_angle: float) -> tuple[float, float]:
    """Return the distance to the wall [m] and the angle by which the car turns away from it [rad]; NaN without a wall.

    Args:
      geometry: fields of SCAN_GEOMETRY.
      ranges: readings without NaN or inf (n,) [m].
      side: 1 left, -1 right.
      beam_angle: theta [rad].
    """
    b = reading_at(geometry, ranges, side * 0.5 * math.pi)
    a = reading_at(geometry, ranges, side * (0.5 * math.pi - beam_angle))
    alpha = math.atan2(a * math.cos(beam_angle) - b, a * math.sin(beam_angle))
    return b * math.cos(alpha), alpha


def steering_towards(
    geometry: Record, ranges: FloatArray, side: float, settings: WallFollowSettings, way: float
) -> float:
    """Return the steering angle [rad], towards the wall at that side (1 left, -1 right); NaN without a wall.

    `way` [m] is what the car drives until its wheels have turned, beyond that of the F1TENTH car.
    """
    distance, alpha = wall_beside(geometry, ranges, side, settings.beam_angle)
    error = distance + (settings.projection + way) * math.sin(alpha) - settings.desired_distance
    return float(settings.proportional_gain * error + settings.derivative_gain * math.sin(alpha))


class WallFollow(Planner):
    """The baseline of the course. Where there is nothing to see it brakes and keeps its steering angle."""

    Settings = WallFollowSettings
    source_laws = ("distance_ahead",)
    assists = {  # noqa: RUF012 - it steers by the walls alone, and the filter would lead it off them
        "safe": ("mean_range", "distance_ahead", "sight", "limiter"),
        "full": ("mean_range", "distance_ahead", "sight", "limiter", "guidance"),
    }

    @staticmethod
    def reference(
        geometry: Record,
        ranges: FloatArray,
        odometry: Record,
        car: Record,
        settings: WallFollowSettings,
        memory: Record,
        line: FloatArray,
    ) -> tuple[float, float, float]:
        """Return the steering angle [rad], no limit to the speed, and the bearing [rad] in which the car steers."""
        left = right = math.nan
        way = late_by(car) * abs(odometry.speed)
        if settings.side != "right":
            left = steering_towards(geometry, ranges, 1.0, settings, way)
        if settings.side != "left":
            right = steering_towards(geometry, ranges, -1.0, settings, way)
        if math.isnan(left) and math.isnan(right):
            steering_angle = 0.0
        elif math.isnan(left):
            steering_angle = -right
        elif math.isnan(right):
            steering_angle = left
        else:
            steering_angle = 0.5 * (left - right)
        steering_angle = saturate(steering_angle, car.max_steering_angle)
        return steering_angle, math.inf, steering_angle

    def find_wall(self, scan: LaserScan, side: Literal["left", "right"]) -> tuple[float, float] | None:
        """Return the distance to the wall at a side [m] and the angle by which the car turns away from it [rad]."""
        geometry, ranges = views(geometry_record(scan))[0], valid_ranges(scan.ranges, scan.range_max)
        if not sees(geometry, ranges):
            return None
        distance, alpha = wall_beside(geometry, ranges, 1.0 if side == "left" else -1.0, self.settings.beam_angle)
        return None if math.isnan(distance) else (distance, alpha)
