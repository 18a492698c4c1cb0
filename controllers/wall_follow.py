"""Wall following: a steady distance from the wall beside the car. It looks at nothing else.

Two beams to one side, b at 90 degrees and a at theta ahead of it, meet the wall at two points. From these

    alpha = atan2(a cos(theta) - b, a sin(theta))    by how much the car turns away from the wall
    D     = b cos(alpha)                             distance from the LiDAR to the wall
    D'    = D + L sin(alpha)                         the same after the lookahead L, on its present heading

and the steering angle, towards the wall, is kp (D' - desired) + kd sin(alpha), saturated. sin(alpha) is by how much
the distance grows on each metre, so this is a PD law whose derivative is measured, not differenced.

`side` says which wall: left, right, or both, which holds the middle: half of the difference of the two sides' D' and of
their sin(alpha), and no desired distance.

Where one of a wall's beams has no return, or the scan does not reach that far round, there is no wall: with both sides
the car keeps the desired distance from the other, and where no wall is left it goes straight on.

Source: the F1TENTH course, lecture and lab on wall following; the speed is that of the planner's speed law, in the
direction in which it steers. There the derivative is differenced in time, and there is an integral term.

Limits, which are where the slides on reactive methods begin: it sees two beams of a side. An obstacle ahead it does not
steer round: it stops before it, by its speed law, unless `way_out=true` leads it past. A box at the wall is a wall that
is near, then far. At a square corner of the inner wall the beam ahead is lost round the corner, and the car turns in on
the corner; the default is the middle, where the outer wall outweighs that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.errors import SettingsError
from fg_mujoco.kernels import kernel
from fg_mujoco.messages import FloatArray, LaserScan, require

from .control.compiled_planner import CompiledPlanner
from .control.driving import DrivingSettings, brake, drive, speed_towards
from .control.records import Record
from .control.steering import saturate
from .perception.scan_filters import valid_ranges
from .perception.scan_geometry import scan_record, sees

_LEFT, _RIGHT, _BOTH = 0, 1, 2  # places of the words of `side`


@dataclass(frozen=True, kw_only=True)
class WallFollowSettings(DrivingSettings):
    """Parameters of the law.

    Raises:
      SettingsError: an unknown side; an angle that is not between 0 and 90 degrees; a number that is negative.
    """

    way_out: bool = False  # it steers by the walls alone, and a way out is a way off them
    side: Literal["left", "right", "both"] = "both"
    desired_distance: float = 0.9  # [m] from the LiDAR to the wall
    beam_angle: float = math.radians(45.0)  # [rad] theta, from the beam abeam to the one ahead of it
    projection: float = 1.5  # [m] the lookahead L
    proportional_gain: float = 0.2  # [rad/m] kp
    derivative_gain: float = 0.3  # [rad] kd

    def __post_init__(self) -> None:
        super().__post_init__()
        angle, accepted = ("beam_angle",), "an angle between 0 and 90 degrees, in radians"
        require(self, lambda value: 0.0 < value < 0.5 * math.pi, accepted, angle, SettingsError)
        from_zero = ("desired_distance", "projection", "proportional_gain", "derivative_gain")
        require(self, lambda value: 0.0 <= value < math.inf, "a number from 0", from_zero, SettingsError)


@kernel
def reading_at(scan: Record, ranges: FloatArray, valid: FloatArray, bearing: float) -> float:
    """Return the reading [m] of the beam nearest to a bearing [rad]; NaN without a return, or without a beam there."""
    place = round((bearing - scan.angle_min) / scan.angle_increment)
    if not 0 <= place < len(valid) or ranges[place] >= scan.range_max:
        return math.nan
    return float(valid[place])


@kernel
def wall_beside(
    scan: Record, ranges: FloatArray, valid: FloatArray, side: float, beam_angle: float
) -> tuple[float, float]:
    """Return the distance to the wall [m] and the angle by which the car turns away from it [rad]; NaN without a wall.

    Args:
      scan: of type SCAN.
      ranges: (n,) [m], as in LaserScan.
      valid: the same without NaN or inf.
      side: 1 left, -1 right.
      beam_angle: theta [rad].
    """
    b = reading_at(scan, ranges, valid, side * 0.5 * math.pi)
    a = reading_at(scan, ranges, valid, side * (0.5 * math.pi - beam_angle))
    alpha = math.atan2(a * math.cos(beam_angle) - b, a * math.sin(beam_angle))
    return b * math.cos(alpha), alpha


@kernel
def steering_towards(scan: Record, ranges: FloatArray, valid: FloatArray, side: float, settings: Record) -> float:
    """Return the steering angle [rad], towards the wall at that side (1 left, -1 right); NaN without a wall."""
    distance, alpha = wall_beside(scan, ranges, valid, side, settings.beam_angle)
    error = distance + settings.projection * math.sin(alpha) - settings.desired_distance
    return float(settings.proportional_gain * error + settings.derivative_gain * math.sin(alpha))


@kernel
def wished_steering(scan: Record, ranges: FloatArray, valid: FloatArray, settings: Record) -> float:
    """Return the steering angle [rad], left positive, not saturated; 0 without a wall."""
    left = right = math.nan
    if settings.side != _RIGHT:
        left = steering_towards(scan, ranges, valid, 1.0, settings)
    if settings.side != _LEFT:
        right = steering_towards(scan, ranges, valid, -1.0, settings)
    if math.isnan(left):
        return 0.0 if math.isnan(right) else -right
    return left if math.isnan(right) else 0.5 * (left - right)


@kernel
def decide(
    scan: Record, ranges: FloatArray, odometry: Record, planner: Record, memory: Record, paths: NDArray[np.void]
) -> tuple[float, float]:
    """Return the command for one scan: steering angle [rad] and speed [m/s]. Types as in `driving`."""
    driver = planner.driver
    valid = valid_ranges(ranges, scan.range_max)
    if not sees(scan, valid):
        return brake(scan, odometry, driver, memory.driving)
    steering_angle = wished_steering(scan, ranges, valid, planner.settings)
    steering_angle = saturate(steering_angle, driver.car.max_steering_angle)
    speed = speed_towards(scan, valid, valid, planner, steering_angle)
    return drive(scan, valid, odometry, driver, memory.driving, paths, steering_angle, speed)


class WallFollow(CompiledPlanner):
    """The baseline of the course. Where there is nothing to see it brakes and keeps the wheels as they are."""

    Settings = WallFollowSettings
    decide = staticmethod(decide)

    def find_wall(self, scan: LaserScan, side: Literal["left", "right"]) -> tuple[float, float] | None:
        """Return the distance to the wall at a side [m] and the angle by which the car turns away from it [rad]."""
        record, valid = scan_record(scan)[0], valid_ranges(scan.ranges, scan.range_max)
        if not sees(record, valid):
            return None
        towards = 1.0 if side == "left" else -1.0
        distance, alpha = wall_beside(record, scan.ranges, valid, towards, self.settings.beam_angle)
        return None if math.isnan(distance) else (distance, alpha)
