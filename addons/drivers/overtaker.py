"""Overtaker: the gap finder among other cars, from the scan and odometry alone.

Cars are what has moved in the scan (other_cars), with `knows=opponents` those whose odometry is told, as far as they
are in sight. The course ahead of a car is where it is expected to go, with the room to both sides (corridor). Each is
followed or passed, by the room that there is (passing). While it follows, the planner's car drives as the gap finder
does in the scan without cars, so slowly that it could stop behind the car ahead. While it passes, it keeps a lane,
which guidance does not change. The safety filter simulates its stops in the scan without cars, and compares each place
of a stop with the places where the others may be then. A car that has stood for two seconds is an obstacle. So is, once
a car has been met, a thing that stands and is as large as the box on a car: it is drawn into the scan as large as a
car.
Limits: cars are taken to keep their share of the course's width. One that comes up from behind is not seen; nor is one
that is hidden. Without a car that has moved in sight this is the gap finder, to the last bit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.controllers.control.assist import SAFE
from fg_mujoco.controllers.control.driving import refer_to_goal
from fg_mujoco.controllers.control.planner_settings import FROM_ZERO, POSITIVE, Record, setting
from fg_mujoco.controllers.control.stages import Tick
from fg_mujoco.controllers.gap_finder import GapFinder, GapFinderSettings
from fg_mujoco.controllers.perception.intermediate_scans import IntermediateScans, write_debug
from fg_mujoco.controllers.perception.scan_filters import copy_ranges
from fg_mujoco.controllers.perception.scan_geometry import bearing_of, sees
from fg_mujoco.controllers.safety.predictions import (
    MOST_CARS,
    hide_targets,
    position_of,
    separate,
    track,
    write_predictions,
)
from fg_mujoco.messages import FloatArray, Reading

from .other_cars import NEAREST, WIDEST, follow_told, is_told, read_told, seen_from, watch_cars
from .passing import FOLLOWS, RACING, STANDS_FOR, choose, pose_on, predict_cars, take_lane

_HIDDEN = 0.45  # [m] round the middle of a car: beams that end there end on it
_STEPS = 24  # of a stop
_STANDS, _STANDING = 4, 0.26  # sightings of what may be a car that stands, and its radius [m]
_OF_CAR = 0.6  # [m] from the middle of what may be a car: what moves there is a part of it
_ALONG = 0.7  # of the velocity of a thing is along the car's heading: it drives, as cars do
_find_goal = GapFinder.goal


@dataclass(frozen=True, kw_only=True)
class OvertakerSettings(GapFinderSettings):
    """Parameters of the gap finder, and of the cars that it meets."""

    braking: float = setting(5.0, "m/s^2", "with which another car may stop", POSITIVE)
    car_margin: float = setting(0.06, "m", "round another car", FROM_ZERO)
    least_lead: float = setting(0.2, "s", "for which a car goes on at least", FROM_ZERO)
    closing: float = setting(2.5, "m/s", "faster than a car that it passes, at most", POSITIVE)
    slowing: float = setting(3.0, "m/s^2", "with which the car can slow behind another, in a bend, too", POSITIVE)
    behind: float = setting(0.2, "m", "from a car that it follows, beside what braking takes", FROM_ZERO)
    look_at: float = setting(4.0, "m", "from a car that it may pass", POSITIVE)
    aside: float = setting(0.6, "m", "from a car that it passes, at most", FROM_ZERO)
    beside_wall: float = setting(0.2, "m", "from a wall beside another car, where there is more room", FROM_ZERO)
    patience: float = setting(0.6, "s", "from giving up a pass to the next one", FROM_ZERO)
    clear: float = setting(0.08, "m", "from side to side, from which on it goes faster than a car ahead", FROM_ZERO)
    clear_by_speed: float = setting(0.02, "s", "the same, more for each m/s of the other car", FROM_ZERO)
    room_to_pass: float = setting(0.5, "m", "to a side of another car, for a pass to begin", POSITIVE)
    room_by_speed: float = setting(0.03, "s", "the same, more for each m/s of the other car", FROM_ZERO)
    room_to_go_on: float = setting(0.45, "m", "the same, for it to go on", POSITIVE)


class Overtaker(GapFinder):
    """The gap finder among other cars."""

    Settings = OvertakerSettings
    assists = {"full": (*SAFE, "guidance")}  # noqa: RUF012 - on a remembered line it would not look out for other cars
    memory_type = RACING
    hides_cars = True

    @staticmethod
    def read(memory: Any, readings: Mapping[str, Reading]) -> None:
        """Put the odometry of the other cars, where the planner is told of it, into its memory."""
        if "opponents" in readings:
            read_told(memory["told"], readings["opponents"])

    @staticmethod
    @kernel
    def refer(tick: Tick) -> None:
        """Write the reference, the scan with cars as drawn, that without, and that without anything that moves."""
        scans = IntermediateScans(tick.debug[0], tick.debug[1], tick.debug[2], tick.debug[3])
        geometry, odometry, car, predictions = tick.geometry, tick.odometry, tick.driver.car, tick.memory.predictions
        drawn, without, memory, settings = tick.ranges, tick.ranges_without_cars, tick.state.memory, tick.state.settings
        copy_ranges(without, drawn)
        bearing, distance, limit, among = math.nan, 0.0, math.inf, False
        if sees(geometry, drawn):
            if is_told(memory.told, odometry):
                among = follow_told(memory.seen, memory.told, geometry, drawn, odometry, car)
            else:
                memory.told.follows = False
                among = watch_cars(memory.seen, geometry, drawn, odometry, car.lidar_offset)
            draw_standing(memory, geometry, drawn, car, settings.car_margin)
            copy_ranges(without, drawn)
            if among:
                hide_cars(memory, geometry, without)
                copy_ranges(drawn, without)
                limit = choose(memory, geometry, without, car, settings)
                draw_cars(memory, geometry, drawn, odometry.speed, car, settings)
            moves = track(geometry, without, odometry, tick.driver, predictions)
            if among:
                copy_ranges(tick.ranges_without_movers, without)
            if moves and leave_cars_out(memory.seen, predictions):
                separate(geometry, without, tick.ranges_without_movers, predictions)
                hide_targets(predictions.targets, drawn)
            if among and tick.driver.prediction:
                predict_cars(memory, car, settings.braking, predictions)
            write_debug(scans.filtered, drawn)
            bearing, distance = _find_goal(geometry, drawn, car, settings, scans)
        refer_to_goal(tick.record, scans.filtered, bearing, distance)
        tick.reference.limit = limit
        if among:
            take_lane(memory, odometry.speed, tick.driver, settings, tick.reference)
            if tick.reference.lane_points > 0:
                copy_ranges(drawn, without)


@kernel
def draw_standing(memory: Record, geometry: Record, ranges: FloatArray, parameters: Record, margin: float) -> None:
    """Shorten beams (n,) [m] to what stands and may be a car, once cars have been `met`: a box is less than all of it.

    `margin` [m] is round a car whose heading is known.
    """
    seen = memory.seen
    for car in seen.cars:
        memory.met = memory.met or (car.age > 0 and car.moves)
    if memory.met:
        for k in range(MOST_CARS):
            car = seen.cars[k]
            ahead, left = seen_from(seen, car.x, car.y)
            if car.age >= _STANDS and not car.moves:
                draw_disc(geometry, ranges, ahead, left, _STANDING)
            elif car.age > 0 and car.moves and memory.passing[k].stood > STANDS_FOR:
                _draw_car(geometry, ranges, ahead, left, car.heading - seen.heading, parameters, margin)


@kernel
def leave_cars_out(memory: Record, predictions: Record) -> bool:
    """Predict what crosses the car's way and is no part of what may be a car; return whether there is something."""
    seen = predictions.targets
    cos, sin = math.cos(seen.heading), math.sin(seen.heading)
    for target in seen.targets:
        if target.age > 0 and target.moves:
            along = abs(cos * target.vx + sin * target.vy)
            of_car = target.size < 0.5 * WIDEST or along > _ALONG * math.hypot(target.vx, target.vy)
            x, y = position_of(seen, target)
            for car in memory.cars:
                ahead, left = seen_from(memory, car.x, car.y)
                of_car = of_car or (car.age > 0 and math.hypot(ahead - x, left - y) < _OF_CAR)
            if of_car:
                target.moves = False
    return write_predictions(predictions)


@kernel
def hide_cars(memory: Record, geometry: Record, ranges: FloatArray) -> None:
    """Take cars out of a scan (n,) [m]; `memory` is of type RACING."""
    count, seen = len(ranges), memory.seen
    for index in range(MOST_CARS):
        car = seen.cars[index]
        if car.age == 0 or not car.moves or memory.passing[index].stood > STANDS_FOR:
            continue
        ahead, left = seen_from(seen, car.x, car.y)
        far = math.hypot(ahead, left)
        middle = round((math.atan2(left, ahead) - geometry.angle_min) / geometry.angle_increment)
        half = math.ceil(math.asin(min(_HIDDEN / max(far, _HIDDEN), 1.0)) / geometry.angle_increment)
        first, end = max(middle - half, 0), min(middle + half + 1, count)
        beam = first
        while beam < end:
            if not _ends_near(geometry, ranges, beam, ahead, left):
                beam += 1
                continue
            last = beam
            while last + 1 < end and _ends_near(geometry, ranges, last + 1, ahead, left):
                last += 1
            _lengthen(ranges, beam, last, geometry.angle_increment)
            beam = last + 1


@kernel
def _lengthen(ranges: FloatArray, first: int, last: int, increment: float) -> None:
    """Lengthen beams (n,) [m], `increment` [rad] apart, to the straight line between the ends of their neighbours."""
    before, after = max(first - 1, 0), min(last + 1, len(ranges) - 1)
    if before == first or last == after:  # at the end of the scan: as far as the one to the other side
        before = after = after if before == first else before
    for beam in range(first, last + 1):
        left, right = (after - beam) * increment, (beam - before) * increment
        inverse = math.sin(left) / max(ranges[before], NEAREST) + math.sin(right) / max(ranges[after], NEAREST)
        between = math.sin(left + right) / inverse if after > before else ranges[after]
        ranges[beam] = max(ranges[beam], between)


@kernel
def _ends_near(geometry: Record, ranges: FloatArray, beam: int, ahead: float, left: float) -> bool:
    """Return whether a beam ends within _HIDDEN of a place ahead and to the left of the LiDAR [m]."""
    bearing, distance = bearing_of(geometry, beam), ranges[beam]
    return math.hypot(distance * math.cos(bearing) - ahead, distance * math.sin(bearing) - left) < _HIDDEN


@kernel
def draw_cars(
    memory: Record, geometry: Record, ranges: FloatArray, own_speed: float, car: Record, settings: Record
) -> None:
    """Shorten beams (n,) [m] to the cars that are passed, where the planner's car, at its speed, could meet them."""
    for k in range(MOST_CARS):
        other, passing = memory.seen.cars[k], memory.passing[k]
        if passing.places == 0 or passing.what == FOLLOWS:
            continue
        speed, time, way = math.hypot(other.vx, other.vy), 0.0, 0.0
        step = (speed / settings.braking + settings.least_lead) / _STEPS
        is_ahead = passing.along > 0.5 * car.length
        for index in range(_STEPS + 1):
            ahead, left, heading = pose_on(passing, way)
            reached = own_speed * time
            if (index == _STEPS and is_ahead) or abs(math.hypot(ahead, left) - reached) < car.length:
                _draw_car(geometry, ranges, ahead, left, heading, car, settings.car_margin)
            way += step * speed
            time += step
            if time > settings.least_lead:
                speed = max(speed - step * settings.braking, 0.0)


@kernel
def _draw_car(
    geometry: Record, ranges: FloatArray, ahead: float, left: float, heading: float, car: Record, margin: float
) -> None:
    """Shorten beams to a car at a place [m] with a heading [rad]: three discs, as wide as it is."""
    radius = 0.5 * car.width + margin
    reach = 0.5 * car.length - 0.5 * car.width
    for index in range(-1, 2):
        x, y = ahead + index * reach * math.cos(heading), left + index * reach * math.sin(heading)
        draw_disc(geometry, ranges, x, y, radius)


@kernel
def draw_disc(geometry: Record, ranges: FloatArray, ahead: float, left: float, radius: float) -> None:
    """Draw a disc into a scan (n,) [m], by its radius and its place ahead and to the left of the LiDAR [m]."""
    far, bearing = math.hypot(ahead, left), math.atan2(left, ahead)
    half = math.asin(min(radius / max(far, 1.0001 * radius), 1.0))
    first = math.ceil((bearing - half - geometry.angle_min) / geometry.angle_increment)
    end = math.floor((bearing + half - geometry.angle_min) / geometry.angle_increment) + 1
    for beam in range(max(first, 0), min(end, len(ranges))):
        away = bearing_of(geometry, beam) - bearing
        side = far * math.sin(away)
        near = far * math.cos(away) - math.sqrt(max(radius * radius - side * side, 0.0))
        ranges[beam] = min(ranges[beam], max(near, NEAREST))
