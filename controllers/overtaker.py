"""Overtaker: the gap finder among other cars, from the scan and odometry alone.

1. Moving objects in the scan are separated from standing ones (perception.other_cars). Only what has moved is a car.
2. The beams that end on a car are lengthened to what is next to it. Guidance gets that scan: its map has no cars.
3. Each car is drawn into the scan as large as it is, for the box that is seen is smaller. It is drawn wherever it could
   be when the planner's car is there, and, if it is ahead, where it would come to stand if it began to brake now.
4. The gap finder drives in that scan, and so do the speed laws and the safety filter, as if all in it stood. What
   moves and is no car is tracked and predicted as every planner does it (safety.predictions).

So the planner's car keeps such a distance from one ahead that it could stop behind it, should that one stop, too. Where
there is room next to a car, a gap leads past it, and where there is none, the planner's car stays behind. The ground
that a neighbouring car is about to reach counts as occupied: the planner's car does not turn there.

Source of the distance: S. Shalev-Shwartz, S. Shammah and A. Shashua, On a Formal Model of Safe and Scalable
Self-driving Cars, arXiv 1708.06374, where it is called the safe longitudinal distance.

Limits: cars are taken to hold their speed, then to brake, and to turn as they do. One that comes up from behind is not
seen; nor is one that is hidden. Without a moving car in sight this is the gap finder, to the last bit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fg_mujoco.kernels import kernel
from fg_mujoco.messages import FloatArray

from .control.driving import refer_to_goal
from .control.planner_settings import FROM_ZERO, POSITIVE, Record, setting
from .gap_finder import GapFinder, GapFinderSettings
from .perception.intermediate_scans import IntermediateScans, keep
from .perception.other_cars import OTHER_CARS, WIDEST, watch_cars
from .perception.scan_filters import valid_ranges
from .perception.scan_geometry import sees
from .safety.predictions import draw_disc, place_of, separate, track, write_predictions

_HIDDEN = 0.45  # [m] round the middle of a car: beams that end there end on it
_STEPS = 24  # of a stop
_OF_CAR = 0.6  # [m] from the middle of what may be a car: what moves there is a part of it
_ALONG = 0.7  # of the velocity of a thing is along the car's heading: it drives, as cars do
_find_goal = GapFinder.goal


@dataclass(frozen=True, kw_only=True)
class OvertakerSettings(GapFinderSettings):
    """Parameters of the gap finder, and of the cars that it meets."""

    braking: float = setting(6.0, "m/s^2", "with which another car may stop", POSITIVE)
    car_margin: float = setting(0.06, "m", "round another car", FROM_ZERO)
    least_lead: float = setting(0.2, "s", "for which a car goes on at least", FROM_ZERO)
    closing: float = setting(1.5, "m/s", "faster than a car that it passes, at most", POSITIVE)
    closing_braking: float = setting(4.0, "m/s^2", "with which it slows to that behind a car", POSITIVE)
    beside: float = setting(1.2, "m", "to either side: cars that it passes no faster than that", FROM_ZERO)


class Overtaker(GapFinder):
    """The gap finder among other cars."""

    Settings = OvertakerSettings
    memory_type = OTHER_CARS
    hides_cars = True

    @staticmethod
    @kernel
    def refer_worlds(  # type: ignore[no-untyped-def]
        scan, ranges, odometry, running, own, driven, lines, valid, shown
    ):
        """Write the references of all running worlds, and for each the scan with cars as drawn and that without."""
        scans = IntermediateScans(shown[0], shown[1], shown[2], shown[3])
        count = len(running)
        for world in range(count):
            if running[world]:
                drawn, without, clear = valid[world], valid[count + world], valid[2 * count + world]
                keep(drawn, valid_ranges(ranges[world], scan[0].range_max))
                keep(without, drawn)
                driver, bearing, distance, limit = driven[world].driver, math.nan, 0.0, math.inf
                predictions = driven[world].memory.predictions
                if sees(scan[0], drawn):
                    memory, settings = own[world].memory, own[world].settings
                    if watch_cars(memory, scan[0], drawn, odometry[world], driver.car.lidar_offset):
                        hide_cars(memory, scan[0], without)
                        keep(drawn, without)
                        draw_cars(memory, scan[0], drawn, odometry[world].speed, driver.car, settings)
                        limit = passing_speed(memory, driver.car, settings)
                    moves = track(scan[0], without, odometry[world], driver, predictions)
                    if moves and leave_cars_out(memory, predictions):
                        separate(scan[0], without, clear, odometry[world].speed, predictions)
                        separate(scan[0], drawn, clear, odometry[world].speed, predictions)
                    keep(scans.filtered, drawn)
                    bearing, distance = _find_goal(scan[0], drawn, driver.car, settings, scans)
                reference = driven[world].reference
                refer_to_goal(scan[0], scans.filtered, odometry[world], driver, bearing, distance, reference)
                reference.limit = limit


@kernel
def leave_cars_out(memory: Record, predictions: Record) -> bool:
    """Predict what crosses the car's way and is no part of what may be a car; return whether there is something.

    Args:
      memory: of type OTHER_CARS.
      predictions: of type PREDICTIONS, written to.
    """
    seen = predictions.targets
    cos, sin = math.cos(seen.heading), math.sin(seen.heading)
    for target in seen.targets:
        if target.age > 0 and target.moves:
            along = abs(cos * target.vx + sin * target.vy)
            of_car = target.size < 0.5 * WIDEST or along > _ALONG * math.hypot(target.vx, target.vy)
            x, y = place_of(seen, target)
            for car in memory.cars:
                ahead, left = _seen_from(memory, car.x, car.y)
                of_car = of_car or (car.age > 0 and math.hypot(ahead - x, left - y) < _OF_CAR)
            if of_car:
                target.moves, target.evidence = False, 0
    return write_predictions(predictions)


@kernel
def hide_cars(memory: Record, scan: Record, ranges: FloatArray) -> None:
    """Lengthen the beams (n,) [m] that end on cars to what is next to them."""
    count = len(ranges)
    for car in memory.cars:
        if car.age == 0 or not car.moves:
            continue
        ahead, left = _seen_from(memory, car.x, car.y)
        far = math.hypot(ahead, left)
        middle = round((math.atan2(left, ahead) - scan.angle_min) / scan.angle_increment)
        half = math.ceil(math.asin(min(_HIDDEN / max(far, _HIDDEN), 1.0)) / scan.angle_increment)
        first, end = max(middle - half, 0), min(middle + half + 1, count)
        beam = first
        while beam < end:
            if not _ends_near(scan, ranges, beam, ahead, left):
                beam += 1
                continue
            last = beam
            while last + 1 < end and _ends_near(scan, ranges, last + 1, ahead, left):
                last += 1
            beyond = math.inf  # the nearer of the beams to both sides
            if beam > 0:
                beyond = ranges[beam - 1]
            if last + 1 < count:
                beyond = min(beyond, ranges[last + 1])
            for k in range(beam, last + 1):
                if math.isfinite(beyond):
                    ranges[k] = max(beyond, ranges[k])
            beam = last + 1


@kernel
def _ends_near(scan: Record, ranges: FloatArray, beam: int, ahead: float, left: float) -> bool:
    """Return whether a beam ends within _HIDDEN of a place ahead and to the left of the LiDAR [m]."""
    bearing = scan.angle_min + scan.angle_increment * beam
    distance = ranges[beam]
    return math.hypot(distance * math.cos(bearing) - ahead, distance * math.sin(bearing) - left) < _HIDDEN


@kernel
def _seen_from(memory: Record, x: float, y: float) -> tuple[float, float]:
    """Return the distances of a place ahead of the LiDAR and to its left [m]."""
    cos, sin = math.cos(memory.heading), math.sin(memory.heading)
    dx, dy = x - memory.x, y - memory.y
    return cos * dx + sin * dy, cos * dy - sin * dx


@kernel
def draw_cars(
    memory: Record, scan: Record, ranges: FloatArray, own_speed: float, car: Record, settings: Record
) -> None:
    """Shorten beams (n,) [m] to the cars where the planner's car could meet them, and to where those ahead would stop.

    Args:
      memory: of type OTHER_CARS.
      scan: of type SCAN.
      ranges: readings without cars, written to.
      own_speed: of the planner's car [m/s].
      car: its parameters, which the others are taken to have.
      settings: fields of OvertakerSettings.
    """
    for other in memory.cars:
        if other.age == 0 or not other.moves:
            continue
        x, y, heading = other.x, other.y, other.heading
        speed, time = math.hypot(other.vx, other.vy), 0.0
        step = (speed / settings.braking + settings.least_lead) / _STEPS
        ahead, left = _seen_from(memory, x, y)
        is_ahead = ahead > 0.5 * car.length
        for place in range(_STEPS + 1):
            ahead, left = _seen_from(memory, x, y)
            reached = own_speed * time
            if (place == _STEPS and is_ahead) or abs(math.hypot(ahead, left) - reached) < car.length:
                _draw_car(scan, ranges, ahead, left, heading - memory.heading, car, settings.car_margin)
            x += step * speed * math.cos(heading)
            y += step * speed * math.sin(heading)
            heading += step * other.turn_rate
            time += step
            if time > settings.least_lead:
                speed = max(speed - step * settings.braking, 0.0)


@kernel
def passing_speed(memory: Record, car: Record, settings: Record) -> float:
    """Return the speed at which the car may approach and pass others [m/s], should they turn into its way."""
    limit = math.inf
    cos, sin = math.cos(memory.heading), math.sin(memory.heading)
    for other in memory.cars:
        if other.age == 0 or not other.moves:
            continue
        ahead, left = _seen_from(memory, other.x, other.y)
        if abs(left) < settings.beside and ahead > -0.5 * car.length:
            gap = max(ahead - 0.8 * car.length, 0.0)  # from bumper to bumper
            closing = max(settings.closing, math.sqrt(2.0 * settings.closing_braking * gap))
            limit = min(limit, max(cos * other.vx + sin * other.vy, 0.0) + closing)
    return limit


@kernel
def _draw_car(
    scan: Record, ranges: FloatArray, ahead: float, left: float, heading: float, car: Record, margin: float
) -> None:
    """Shorten beams to a car at a place [m] with a heading [rad]: three discs, as wide as it is."""
    radius = 0.5 * car.width + margin
    reach = 0.5 * car.length - 0.5 * car.width
    for place in range(-1, 2):
        x, y = ahead + place * reach * math.cos(heading), left + place * reach * math.sin(heading)
        draw_disc(scan, ranges, x, y, radius)
