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

To these comes what a real car needs, in `driving`: stopping_paths (it stops within what it sees) and friction_guard
(the friction law as a limit in transients). Where this differs from the known implementation of the text: the friction
limit is the last word on speed, no gain follows it; g is the model's, not 10; bubbles reach to the ends of the scan; no
filter changes its input; the car steers along the arc to the goal, not by the goal's bearing.

Limits: it sees no further than the next corner and has no memory, so it takes the longer of two ways, wherever that
leads, and it does not reverse out of a dead end: it stops.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.errors import SettingsError
from fg_mujoco.kernels import kernel
from fg_mujoco.messages import FloatArray, LaserScan, require

from .compiled_planner import CompiledPlanner
from .driving import brake, drive, scan_record
from .records import Record
from .scan_filters import (
    clip_to_lookahead,
    extend_disparities,
    field_of_view,
    mask_nearest,
    prioritise_centre,
    rolling_mean,
    valid_ranges,
)
from .speed import range_ratio_speed
from .steering import pursue

_LEAST_INCREMENT = 1e-9  # [rad] below it, counts of beams overflow


@dataclass(frozen=True, kw_only=True)
class GapFinderSettings:
    """Parameters of the nine components.

    Raises:
      SettingsError: a value that is not a positive number; a clearance or weight below 0, a weight above 1.
    """

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

    def __post_init__(self) -> None:
        lengths = ("lookahead", "field_of_view", "nearest_bubble", "mean_radius", "pursuit_distance")
        positive = (*lengths, "range_ratio_gain")
        from_zero = ("disparity_threshold", "clearance", "front_width")
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", positive, SettingsError)
        require(self, lambda value: 0.0 <= value < math.inf, "a number from 0", from_zero, SettingsError)
        require(self, lambda value: 0.0 <= value <= 1.0, "a number from 0 to 1", ("edge_weight",), SettingsError)


@kernel
def find_goal(scan: Record, valid: FloatArray, planner: Record) -> tuple[float, float, float]:
    """Return the goal's bearing [rad] and distance [m], and the speed [m/s] by the ranges in front.

    The bearing is NaN where no beam can be driven along: fewer than two, all zero, or no sensible angle between them.

    Args:
      scan: of type SCAN.
      valid: its readings (n,) [m], without NaN or inf.
      planner: `settings` (GapFinderSettings) and `driver` (of type DRIVER).
    """
    settings, driver, increment = planner.settings, planner.driver, scan.angle_increment
    if len(valid) < 2 or not _LEAST_INCREMENT < increment < 2.0 * math.pi:
        return math.nan, 0.0, 0.0
    ranges = clip_to_lookahead(valid, settings.lookahead)
    reach = 0.5 * driver.car.width + settings.clearance
    ranges = extend_disparities(ranges, increment, settings.disparity_threshold, reach)
    ranges = mask_nearest(ranges, increment, settings.nearest_bubble)
    ranges = rolling_mean(ranges, increment, settings.mean_radius)
    bearings = scan.angle_min + increment * np.arange(len(ranges))
    first, end = field_of_view(bearings, settings.field_of_view)
    ranges, bearings = ranges[first:end], bearings[first:end]
    if len(ranges) == 0:
        return math.nan, 0.0, 0.0
    preferred = prioritise_centre(ranges, bearings, settings.edge_weight)
    goal = np.argmax(preferred)
    if preferred[goal] <= 0.0:
        return math.nan, 0.0, 0.0
    half = round(0.5 * settings.front_width / increment)
    front = ranges[max(goal - half, 0) : goal + half + 1]
    speed = range_ratio_speed(front, settings.lookahead / settings.range_ratio_gain, driver.max_speed)
    return bearings[goal], ranges[goal], speed


@kernel
def decide(
    scan: Record, ranges: FloatArray, odometry: Record, planner: Record, memory: Record, paths: NDArray[np.void]
) -> tuple[float, float]:
    """Return the command for one scan: steering angle [rad] and speed [m/s]. Types as in `driving`."""
    valid = valid_ranges(ranges, scan.range_max)
    bearing, distance, speed = find_goal(scan, valid, planner)
    if math.isnan(bearing):
        return brake(scan, odometry, planner.driver, memory.guard)
    car = planner.driver.car
    distance = min(distance, planner.settings.pursuit_distance)
    steering_angle = pursue(bearing, distance, car.lidar_offset, car.wheelbase)
    return drive(scan, valid, odometry, planner.driver, memory.guard, paths, steering_angle, speed)


@kernel
def decide_worlds(
    scan: NDArray[np.void],
    ranges: FloatArray,
    odometry: NDArray[np.void],
    running: NDArray[np.bool_],
    planners: NDArray[np.void],
    memories: NDArray[np.void],
    paths: NDArray[np.void],
    commands: FloatArray,
) -> None:
    """Write the command of each running world into `commands` (n, 2); see CompiledBatch."""
    for world in range(len(running)):
        if running[world]:
            commands[world, 0], commands[world, 1] = decide(
                scan[0], ranges[world], odometry[world], planners[world], memories[world], paths
            )


class GapFinder(CompiledPlanner):
    """The planner of the package. Where there is no way, or nothing to see, it brakes and keeps the wheels as they are.

    Its brakes are as hard as the tires hold; at rest, and without odometry, it answers STOP.
    """

    Settings = GapFinderSettings
    decide_worlds = staticmethod(decide_worlds)

    def find_goal(self, scan: LaserScan) -> tuple[float, float, float] | None:
        """Return the goal's bearing [rad] and distance [m], and the speed [m/s] by the ranges in front.

        None where no beam can be driven along: fewer than two, all zero, or no sensible angle between them.
        """
        valid = valid_ranges(scan.ranges, scan.range_max)
        bearing, distance, speed = find_goal(scan_record(scan)[0], valid, self.record[0])
        return None if math.isnan(bearing) else (bearing, distance, speed)
