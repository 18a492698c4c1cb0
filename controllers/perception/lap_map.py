"""Lap map: the places of the first lap and what the LiDAR saw from them, and where the car is among them later.

    see_lap(lap, scan, ranges, odometry, lidar_offset)  # in every tick

1. Recording. By dead reckoning, a place is added every `SPACING` of way, with the readings of `BEAMS` beams. Places
   that the car reverses over are dropped.
2. Closing. When the car comes by one of the first places in the same direction, the scan is matched with the readings
   there. Where it fits, the lap is closed: the error of the dead reckoning is spread evenly over the places of the lap.
3. Localisation. From then on dead reckoning is corrected in every tick by matching the scan with the readings at the
   nearest place. Where the scan fits no longer, everything is forgotten, and recording begins anew.

`tell_sides` says of each recorded reading on which side of the lap's path it is: a line that is moved may not pass it.

A scan is matched by one step of Gauss and Newton: each recorded point of a straight piece of wall is looked up in the
scan by its bearing, and the distance between the two, square to the wall, is to vanish. Distances beyond a gate do not
count: there something hides the wall, or has moved. Dead reckoning is the prior.

Source: F. Lu and E. Milios, Robot Pose Estimation in Unknown Environments by Matching 2D Range Scans, Journal of
Intelligent and Robotic Systems 18, 1997, and Globally Consistent Range Scan Alignment for Environment Mapping,
Autonomous Robots 4, 1997, in which a closed loop corrects all poses.

Limits: a lap has at most 512 m. Dead reckoning may be off by 1 m, 2 % of the way, and .15 rad when the lap closes. Two
places that look the same, lie as near to each other as that, and are driven through in the same direction count as one.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

from ..control.planner_settings import Record
from .scan_geometry import looks_ahead, nearest_beam, period_of, sees

PLACES = 2048  # at most
SPACING = 0.25  # [m] of places
BEAMS = 64  # of a scan that are kept of each place, evenly spread
TOO_FAR = 8.0  # [m] readings from here on are not used

_FIRST, _LAST = 4, 40  # places at which the lap may close
_LEAST_LAP = 32  # places of a lap
_OFF, _OFF_SHARE = 1.0, 0.02  # [m] and share of the way: how far dead reckoning may be off when the lap closes
_TURNED = 0.6  # [rad] of the car from a place, within which a scan is matched with it
_HEADING_OFF = 0.15  # [rad] by which dead reckoning may have turned too far
_STEP = 0.05  # [m] beside each of the first places, from the second to the first time: later ones may be further off
_CLOSING_STEPS = 20  # of matching when the lap closes
_CLOSES = 0.7  # share of the beams that fit, from which on the lap closes
_FITS = 0.4  # share of the beams that fit, below which the car is lost; the mean of the last ticks
_MEMORY = 0.1  # share of the newest tick in that mean
_LOST = 4.0  # [m] from the nearest place, beyond which the car is lost
_GATE, _CLOSING_GATE = 0.25, 0.6  # [m] beyond it a point does not fit
_PIECE = 0.8  # [m] of wall at most between a point's neighbours
_STRAIGHT = 0.04  # [m] of a point from the line through its neighbours
# weights of the dead reckoning, in points and points times m^2: readings err by .03 m, its shift in a tick by .02 m and
# its turn by .005 rad; when a lap closes, by far more
_SHIFT, _TURN = 2.0, 40.0
_CLOSING_SHIFT, _CLOSING_TURN = 0.1, 0.5
_BEHIND, _AHEAD = 6, 16  # places round the last nearest one
_SIDE_BEHIND, _SIDE_AHEAD = 8, 40  # places round one whose beams are looked at
_TURN_COUNTS = 0.7  # [m/rad] so that the nearest place goes round a hairpin with the car

LAP_MAP = np.dtype(
    [
        ("closed", np.bool_),
        ("drifts", np.bool_),  # dead reckoning was off by more than a lap may be: none closes any more
        ("x", np.float64),  # [m] of the rear axle, from where recording began
        ("y", np.float64),  # [m]
        ("heading", np.float64),  # [rad]
        ("driven", np.float64),  # [m] since recording began
        ("count", np.int64),  # of places
        ("nearest", np.int64),  # place
        ("fits", np.float64),  # share of the beams that fit, the mean of the last ticks
        ("places", np.float64, (PLACES, 3)),  # x, y [m] and heading [rad]
        ("ranges", np.float32, (PLACES, BEAMS)),  # [m]
        ("to_left", np.int8, (PLACES, BEAMS)),  # 1: the beam ended to the left of the lap's path, -1: right
    ]
)
"""Type of what is kept from tick to tick; zero at the beginning."""


@kernel
def see_lap(lap: Record, geometry: Record, ranges: FloatArray, odometry: Record, lidar_offset: float) -> None:
    """Take the car on by one tick, and record or match a scan; one that shows nothing ahead is not used.

    Args:
      lap: of type LAP_MAP, written to.
      geometry: of type SCAN_GEOMETRY.
      ranges: readings (n,) [m], without NaN or inf.
      odometry: of type ODOMETRY.
      lidar_offset: of the LiDAR ahead of the rear axle [m].
    """
    way, turn = odometry.speed * period_of(geometry), odometry.angular_velocity[2] * period_of(geometry)
    if not (abs(way) < 1.0 and abs(turn) < math.pi):  # nor is NaN
        forget_lap(lap)
        return
    lap.x += way * math.cos(lap.heading + 0.5 * turn)
    lap.y += way * math.sin(lap.heading + 0.5 * turn)
    lap.heading += turn
    lap.driven += abs(way)
    if not (sees(geometry, ranges) and looks_ahead(geometry, len(ranges))):
        return
    if lap.closed:
        _localise(lap, geometry, ranges, lidar_offset)
    else:
        _record(lap, geometry, ranges, odometry.speed, lidar_offset)


@kernel
def forget_lap(lap: Record) -> None:
    """Begin to record anew."""
    lap.closed, lap.count, lap.x, lap.y, lap.heading, lap.driven = False, 0, 0.0, 0.0, 0.0, 0.0


@kernel
def _record(lap: Record, geometry: Record, ranges: FloatArray, speed: float, lidar_offset: float) -> None:
    """Add the car's place where it is far enough from the last one, and close the lap where it is complete."""
    cos, sin = math.cos(lap.heading), math.sin(lap.heading)
    while speed < 0.0 and lap.count > 0:
        last = lap.places[lap.count - 1]
        if cos * (last[0] - lap.x) + sin * (last[1] - lap.y) <= 0.0:
            break
        lap.count -= 1
    if lap.count > 0:
        last = lap.places[lap.count - 1]
        if math.hypot(lap.x - last[0], lap.y - last[1]) < SPACING:
            return
    if lap.count == PLACES or speed < 0.0 or lap.drifts:
        return
    place = lap.places[lap.count]
    place[0], place[1], place[2] = lap.x, lap.y, lap.heading
    for beam in range(BEAMS):
        lap.ranges[lap.count, beam] = ranges[beam * (len(ranges) - 1) // (BEAMS - 1)]
    lap.count += 1
    _close(lap, geometry, ranges, lidar_offset)


@kernel
def _close(lap: Record, geometry: Record, ranges: FloatArray, lidar_offset: float) -> None:
    """Close the lap where the car is at one of its first places again, and the scan fits there."""
    first, least = -1, _OFF + _OFF_SHARE * lap.driven
    for index in range(_FIRST, min(_LAST, lap.count - _LEAST_LAP)):
        apart = math.hypot(lap.x - lap.places[index, 0], lap.y - lap.places[index, 1])
        turned = _turn_between(lap.places[index, 2], lap.heading)
        if apart < least and abs(turned) < _TURNED:
            first, least = index, apart
    if first < 0:
        return
    x, y, heading, fits = lap.x, lap.y, lap.heading, 0.0
    for step in range(_CLOSING_STEPS):
        gate = _CLOSING_GATE if step < _CLOSING_STEPS // 2 else _GATE
        x, y, heading, fits = _matched(
            lap, first, geometry, ranges, lidar_offset, x, y, heading, gate, _CLOSING_SHIFT, _CLOSING_TURN
        )
    if fits < _CLOSES or math.hypot(x - lap.places[first, 0], y - lap.places[first, 1]) > _STEP * first:
        return
    turn = _turn_between(lap.heading, heading)  # a lap turns by 2 pi, which is no error
    if abs(turn) > _HEADING_OFF:  # its odometry drifts; at a later place the scan might fit without that turn
        lap.drifts = True
        return
    count = lap.count - first
    before_x, before_y = lap.places[first, 0], lap.places[first, 1]
    here_x, here_y = before_x, before_y
    for k in range(count):  # turn the ways between places, then shift the places
        place = lap.places[first + k]
        cos, sin = math.cos(turn * k / count), math.sin(turn * k / count)
        dx, dy = place[0] - before_x, place[1] - before_y
        before_x, before_y = place[0], place[1]
        here_x += cos * dx - sin * dy
        here_y += sin * dx + cos * dy
        place[0], place[1], place[2] = here_x, here_y, place[2] + turn * k / count
    shift_x, shift_y = x - here_x, y - here_y
    for k in range(count):
        place = lap.places[first + k]
        lap.places[k, 0], lap.places[k, 1] = place[0] + shift_x * k / count, place[1] + shift_y * k / count
        lap.places[k, 2] = place[2]
        lap.ranges[k] = lap.ranges[first + k]
    cos, sin = math.cos(lap.places[0, 2]), math.sin(lap.places[0, 2])
    while count > _LEAST_LAP // 2:  # the last places may lie beside the first
        ahead_x, ahead_y = lap.places[count - 1, 0] - lap.places[0, 0], lap.places[count - 1, 1] - lap.places[0, 1]
        if cos * ahead_x + sin * ahead_y < -0.5 * SPACING:
            break
        count -= 1
    lap.count, lap.closed, lap.nearest, lap.fits = count, True, 0, 1.0
    lap.x, lap.y, lap.heading = x, y, heading


@kernel
def _turn_between(heading: float, other: float) -> float:
    """Return the turn from one heading to another, the short way round [rad]."""
    turn = other - heading
    return turn - 2.0 * math.pi * round(turn / (2.0 * math.pi))


@kernel
def _localise(lap: Record, geometry: Record, ranges: FloatArray, lidar_offset: float) -> None:
    """Correct where the car is by the readings at the nearest place."""
    best, least = lap.nearest, math.inf
    for ahead in range(-_BEHIND, _AHEAD + 1):
        index = (lap.nearest + ahead) % lap.count
        apart = math.hypot(lap.x - lap.places[index, 0], lap.y - lap.places[index, 1])
        apart += _TURN_COUNTS * abs(_turn_between(lap.places[index, 2], lap.heading))
        if apart < least:
            best, least = index, apart
    lap.nearest = best
    lap.x, lap.y, lap.heading, fits = _matched(
        lap, best, geometry, ranges, lidar_offset, lap.x, lap.y, lap.heading, _GATE, _SHIFT, _TURN
    )
    lap.fits += _MEMORY * (fits - lap.fits)
    if lap.fits < _FITS or least > _LOST:
        forget_lap(lap)


@kernel
def wall_points(lap: Record, index: int, geometry: Record, count: int, lidar_offset: float) -> FloatArray:
    """Return where the beams kept at a place ended (BEAMS, 2) [m]; NaN for those that ended beyond `TOO_FAR`.

    `count` is the number of beams of a scan.
    """
    x, y, heading = lap.places[index, 0], lap.places[index, 1], lap.places[index, 2]
    x += lidar_offset * math.cos(heading)
    y += lidar_offset * math.sin(heading)
    ends = np.full((BEAMS, 2), math.nan)
    for beam in range(BEAMS):
        distance = lap.ranges[index, beam]
        if distance < TOO_FAR:
            bearing = heading + geometry.angle_min + geometry.angle_increment * (beam * (count - 1) // (BEAMS - 1))
            ends[beam, 0], ends[beam, 1] = x + distance * math.cos(bearing), y + distance * math.sin(bearing)
    return ends


@kernel
def beam_directions(geometry: Record, count: int) -> FloatArray:
    """Return cosines and sines of the bearings of the beams that are kept, of `count` beams. Shape (BEAMS, 2)."""
    directions = np.empty((BEAMS, 2))
    for beam in range(BEAMS):
        bearing = geometry.angle_min + geometry.angle_increment * (beam * (count - 1) // (BEAMS - 1))
        directions[beam, 0], directions[beam, 1] = math.cos(bearing), math.sin(bearing)
    return directions


@kernel
def tell_sides(lap: Record, index: int, geometry: Record, count: int, lidar_offset: float) -> None:
    """Write on which side of the lap's path the beams of a place ended; arguments as of `wall_points`."""
    ends = wall_points(lap, index, geometry, count, lidar_offset)
    for beam in range(BEAMS):
        least, to_left = math.inf, 0.0
        for ahead in range(-_SIDE_BEHIND, _SIDE_AHEAD + 1, 2):
            other = lap.places[(index + ahead) % lap.count]
            dx, dy = ends[beam, 0] - other[0], ends[beam, 1] - other[1]
            apart = dx * dx + dy * dy
            if apart < least:  # nor is NaN
                least, to_left = apart, math.cos(other[2]) * dy - math.sin(other[2]) * dx
        lap.to_left[index, beam] = 1 if to_left >= 0.0 else -1


@kernel
def _matched(
    lap: Record,
    index: int,
    geometry: Record,
    ranges: FloatArray,
    lidar_offset: float,
    x: float,
    y: float,
    heading: float,
    gate: float,
    shift: float,
    turn: float,
) -> tuple[float, float, float, float]:
    """Return where the car is by the readings at a place: x, y [m] and heading [rad]; and the share that fits.

    Args:
      lap: of type LAP_MAP.
      index: index.
      geometry: of type SCAN_GEOMETRY.
      ranges: readings (n,) [m].
      lidar_offset: [m].
      x: of the rear axle before [m].
      y: [m].
      heading: [rad].
      gate: distance beyond which a point does not fit [m].
      shift: weight of the place before, in points.
      turn: weight of the heading before, in points times m^2.
    """
    ends = wall_points(lap, index, geometry, len(ranges), lidar_offset)
    cos, sin = math.cos(heading), math.sin(heading)
    lidar_x, lidar_y = x + lidar_offset * cos, y + lidar_offset * sin
    xx, xy, yy, xt, yt, tt = shift, 0.0, shift, 0.0, 0.0, turn
    ex, ey, et = 0.0, 0.0, 0.0
    seen, fitting = 0, 0
    for beam in range(1, BEAMS - 1):
        along_x, along_y = ends[beam + 1, 0] - ends[beam - 1, 0], ends[beam + 1, 1] - ends[beam - 1, 1]
        piece = math.hypot(along_x, along_y)
        if not 1e-3 < piece < _PIECE:  # nor is NaN
            continue
        normal_x, normal_y = -along_y / piece, along_x / piece
        dx, dy = ends[beam, 0] - ends[beam - 1, 0], ends[beam, 1] - ends[beam - 1, 1]
        if not abs(normal_x * dx + normal_y * dy) < _STRAIGHT:
            continue
        dx, dy = ends[beam, 0] - lidar_x, ends[beam, 1] - lidar_y
        at = nearest_beam(geometry.angle_min, geometry.angle_increment, cos * dx + sin * dy, cos * dy - sin * dx)
        if not 0.0 <= at <= len(ranges) - 1.0:
            continue
        distance, bearing = ranges[int(at)], heading + geometry.angle_min + geometry.angle_increment * at
        seen += 1
        from_x, from_y = lidar_x - x + distance * math.cos(bearing), lidar_y - y + distance * math.sin(bearing)
        error = normal_x * (x + from_x - ends[beam, 0]) + normal_y * (y + from_y - ends[beam, 1])
        if not abs(error) < gate:
            continue
        fitting += 1
        lever = normal_y * from_x - normal_x * from_y
        xx += normal_x * normal_x
        xy += normal_x * normal_y
        yy += normal_y * normal_y
        xt += normal_x * lever
        yt += normal_y * lever
        tt += lever * lever
        ex -= normal_x * error
        ey -= normal_y * error
        et -= lever * error
    # solve the three normal equations by elimination; the weights of the dead reckoning make them definite
    a = xy / xx
    yy, yt, ey = yy - a * xy, yt - a * xt, ey - a * ex
    a = xt / xx
    tt, et = tt - a * xt, et - a * ex
    a = yt / yy
    turned = (et - a * ey) / (tt - a * yt)
    moved_y = (ey - yt * turned) / yy
    moved_x = (ex - xy * moved_y - xt * turned) / xx
    return x + moved_x, y + moved_y, heading + turned, fitting / max(seen, 1)
