"""Gap finder: the disparity extender with more filters, as the field's gap_finder_base describes it, made safe.

The nine components, in the order of that text:

1. disparity extender      scan_filters.extend_disparities
2. safety bubble           scan_filters.safety_bubbles, as wide as the arc says
3. lookahead               scan_filters.clip_to_lookahead
4. field of view           scan_filters.field_of_view
5. nearest-point bubble    scan_filters.mask_nearest
6. mean filter             scan_filters.rolling_mean, its window that of a bubble
7. centre priority         scan_filters.prioritise_centre, 0.999 to 1.000
8. greatest range          the goal
9. speed                   speed.range_ratio_speed by the mean range in front; speed.friction_speed by the steering

To these come what a real car needs: stopping_paths (it stops within what it sees) and friction_guard (the friction
law as a limit in transients). Where this differs from the known implementation of the text: the friction limit is
the last word on speed, no gain follows it; g is the model's, not 10; bubbles reach to the ends of the scan; no
filter changes its input; the car steers along the arc to the goal, not by the goal's bearing.

Limits: it sees no further than the next corner and has no memory, so it takes the longer of two ways, wherever that
leads, and it does not reverse out of a dead end: it stops.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fg_mujoco.messages import STOP, CarParameters, DriveCommand, LaserScan, Odometry

from . import scan_filters as filters
from .friction_guard import FrictionGuard
from .speed import range_ratio_speed
from .steering import pursue, saturate
from .stopping_paths import StoppingPaths

_PERIOD = 0.025  # [s] of the field's LiDARs, for scans that do not tell theirs
_LEAST_INCREMENT = 1e-9  # [rad] below it, counts of beams overflow


@dataclass(frozen=True, kw_only=True)
class GapFinderSettings:
    """Parameters of the nine components."""

    lookahead: float = 10.0  # [m]
    field_of_view: float = math.pi  # [rad]
    disparity_threshold: float = 0.3  # [m]
    clearance: float = 0.15  # [m] beside the car, past a disparity
    nearest_bubble: float = 0.2  # [m] radius
    mean_radius: float = 0.1  # [m] of the mean filter's bubble
    edge_weight: float = 0.999  # centre priority at the edges of the field of view
    pursuit_distance: float = 1.0  # [m] the arc leads through the point this far along the goal's direction
    front_width: float = math.radians(20.0)  # [rad] around the goal, for the mean range in front
    range_ratio_gain: float = 3.0  # top speed at a third of the lookahead


class GapFinder:
    """The planner of the package.

    Args:
      car: parameters of the car.
      mu: friction coefficient that it believes in; inf: no friction limits, and so no stopping in sight either.
      max_speed: fastest that it commands [m/s].
      settings: parameters of the nine components.
    """

    def __init__(
        self, car: CarParameters, mu: float, max_speed: float = 8.0, settings: GapFinderSettings | None = None
    ) -> None:
        self.settings = settings or GapFinderSettings()
        self._car = car
        self._max_speed = max_speed
        self._guard = FrictionGuard(car, mu) if math.isfinite(mu) else None
        self._stopping = StoppingPaths(car, self._guard, max_speed) if self._guard else None

    def reset(self) -> None:
        """Forget everything seen so far."""
        if self._guard:
            self._guard.reset()

    def __call__(self, scan: LaserScan, odometry: Odometry) -> DriveCommand:
        """Answer the command to hold until the next scan.

        Where there is no way, or nothing to see, it brakes as hard as the tires hold, the wheels kept as they are; at
        rest, and without odometry, that is STOP.
        """
        if not math.isfinite(odometry.speed + odometry.steering_angle):
            self.reset()
            return STOP
        period = scan.scan_time if scan.scan_time > 0.0 else _PERIOD
        goal = self.find_goal(scan)
        if goal is None:
            return self._guard(odometry.steering_angle, 0.0, odometry, period) if self._guard else STOP
        bearing, distance, speed = goal
        steering_angle = pursue(bearing, min(distance, self.settings.pursuit_distance), self._car)
        if self._guard is None or self._stopping is None:
            return DriveCommand(steering_angle=saturate(steering_angle, self._car.max_steering_angle), speed=speed)
        readings = filters.valid_ranges(scan.ranges, scan.range_max)
        widened = filters.widen_all(readings, scan.angle_increment, self._stopping.radius)
        safe_speed = self._stopping.safe_speed(
            widened, scan.angle_min, scan.angle_increment, odometry.speed, odometry.steering_angle
        )
        return self._guard(steering_angle, min(speed, safe_speed), odometry, period)

    def find_goal(self, scan: LaserScan) -> tuple[float, float, float] | None:
        """Return the goal's bearing [rad] and distance [m], and the speed [m/s] by the ranges in front.

        None where no beam can be driven along: fewer than two, all zero, or no sensible angle between them.
        """
        settings, increment = self.settings, scan.angle_increment
        if len(scan.ranges) < 2 or not _LEAST_INCREMENT < increment < 2.0 * math.pi:
            return None
        ranges = filters.valid_ranges(scan.ranges, scan.range_max)
        ranges = filters.clip_to_lookahead(ranges, settings.lookahead)
        reach = 0.5 * self._car.width + settings.clearance
        ranges = filters.extend_disparities(ranges, increment, settings.disparity_threshold, reach)
        ranges = filters.mask_nearest(ranges, increment, settings.nearest_bubble)
        ranges = filters.rolling_mean(ranges, increment, settings.mean_radius)
        view = filters.field_of_view(scan.bearings, settings.field_of_view)
        ranges, bearings = ranges[view], scan.bearings[view]
        preferred = filters.prioritise_centre(ranges, bearings, settings.edge_weight)
        if not np.any(preferred > 0.0):
            return None
        goal = int(np.argmax(preferred))
        half = round(0.5 * settings.front_width / increment)
        front = ranges[max(goal - half, 0) : goal + half + 1]
        speed = range_ratio_speed(front, settings.lookahead / settings.range_ratio_gain, self._max_speed)
        return float(bearings[goal]), float(ranges[goal]), speed
