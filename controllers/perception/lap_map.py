"""Lap map: the places of the first lap and what the LiDAR saw from them, and where the car is among them later.

    see_lap(lap, geometry, ranges, odometry, lidar_offset)  # in every tick

1. Recording. By dead reckoning, a place is added every `SPACING` of way, with the readings of `BEAMS` beams. Places
   that the car reverses over are dropped.
2. Closing. When the car comes by one of the first places in the same direction, the scan is matched with the readings
   there. Where it fits, the lap is closed: the error of the dead reckoning is spread evenly over the places of the lap.
3. Localisation. From then on dead reckoning is corrected in every tick by matching the scan with the readings at the
   nearest place. Where the scan fits no longer, everything is forgotten, and recording begins anew.

`walls_of` returns where all recorded beams ended, and on which side of the lap's path.

A scan is matched by one step of Gauss and Newton: each recorded point of a straight piece of wall is looked up in the
scan by its bearing, and the distance between the two, square to the wall, is to vanish. Distances beyond a gate do not
count: there something hides the wall, or has moved. Dead reckoning is the prior.

A reading is kept in a byte, as the square root of its share of `TOO_FAR`: within 8 mm at .5 m, and 22 mm at 4 m.

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
from .scan_geometry import bearing_of, looks_ahead, nearest_beam, period_of, sees

PLACES = 1024  # at most
SPACING = 0.5  # [m] of places
BEAMS = 64  # of a scan that are kept of each place, evenly spread
TOO_FAR = 8.0  # [m] readings from here on are not used

_MOST = 255  # of a byte: a reading from TOO_FAR on
_FIRST, _LAST = 2, 20  # places at which the lap may close
_LEAST_LAP = 16  # places of a lap
_OFF, _OFF_SHARE = 1.0, 0.02  # [m] and share of the way: how far dead reckoning may be off when the lap closes
_TURNED = 0.6  # [rad] of the car from a place, within which a scan is matched with it
_HEADING_OFF = 0.15  # [rad] by which dead reckoning may have turned too far
_STEP = 0.1  # [m] beside each of the first places, from the second to the first time: later ones may be further off
_CLOSING_STEPS = 20  # of matching when the lap closes
_CLOSES, _FITS = 0.7, 0.4  # share of the beams that fit: from which on a lap closes; below which the car is lost
_MEMORY = 0.1  # share of the newest tick in the mean of the beams that fit
_LOST = 4.0  # [m] from the nearest place, beyond which the car is lost
_PIECE = 0.8  # [m] of wall at most between a point's neighbours
_STRAIGHT = 0.04  # [m] of a point from the line through its neighbours
# a match: distance beyond which a point does not fit [m], and weights of the dead reckoning, in points and points times
# m^2: readings err by .03 m, its shift in a tick by .02 m and its turn by .005 rad; when a lap closes, by far more
_MATCH, _FIRST_MATCH, _CLOSING_MATCH = (0.25, 2.0, 40.0), (0.6, 0.1, 0.5), (0.25, 0.1, 0.5)
_BEHIND, _AHEAD = 3, 8  # places round the last nearest one
_SIDE_BEHIND, _SIDE_AHEAD = 4, 20  # places round one, to whose path the ends of its beams are compared
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
        ("places", np.float32, (PLACES, 3)),  # x, y [m] and heading [rad]
        ("ranges", np.uint8, (PLACES, BEAMS)),  # square root of the share of TOO_FAR, of _MOST
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
    elif _record(lap, ranges, odometry.speed):
        _close(lap, geometry, ranges, lidar_offset)


@kernel
def forget_lap(lap: Record) -> None:
    """Begin to record anew."""
    lap.closed, lap.count, lap.x, lap.y, lap.heading, lap.driven = False, 0, 0.0, 0.0, 0.0, 0.0


@kernel
def _record(lap: Record, ranges: FloatArray, speed: float) -> bool:
    """Add the car's place where it is far enough from the last one, and return whether it was added."""
    cos, sin = math.cos(lap.heading), math.sin(lap.heading)
    while speed < 0.0 and lap.count > 0:
        last = lap.places[lap.count - 1]
        if cos * (last[0] - lap.x) + sin * (last[1] - lap.y) <= 0.0:
            break
        lap.count -= 1
    if lap.count > 0:
        last = lap.places[lap.count - 1]
        if math.hypot(lap.x - last[0], lap.y - last[1]) < SPACING:
            return False
    if lap.count == PLACES or speed < 0.0 or lap.drifts:
        return False
    place = lap.places[lap.count]
    place[0], place[1], place[2] = lap.x, lap.y, lap.heading
    for beam in range(BEAMS):
        share = min(max(ranges[_beam_of(beam, len(ranges))], 0.0) / TOO_FAR, 1.0)
        lap.ranges[lap.count, beam] = round(math.sqrt(share) * _MOST)
    lap.count += 1
    return True


@kernel
def _beam_of(beam: int, count: int) -> int:
    """Return which of the beams of a scan is kept as one of BEAMS."""
    return beam * (count - 1) // (BEAMS - 1)


@kernel
def _close(lap: Record, geometry: Record, ranges: FloatArray, lidar_offset: float) -> None:
    """Close the lap where the car is at one of its first places again, and the scan fits there."""
    first, least = -1, _OFF + _OFF_SHARE * lap.driven
    for index in range(_FIRST, min(_LAST, lap.count - _LEAST_LAP)):
        apart = math.hypot(lap.x - lap.places[index, 0], lap.y - lap.places[index, 1])
        if apart < least and abs(_turn_between(lap.places[index, 2], lap.heading)) < _TURNED:
            first, least = index, apart
    if first < 0:
        return
    pose, fits = (lap.x, lap.y, lap.heading), 0.0
    for step in range(_CLOSING_STEPS):
        match = _FIRST_MATCH if step < _CLOSING_STEPS // 2 else _CLOSING_MATCH
        pose, fits = _matched(lap, first, geometry, ranges, lidar_offset, pose, match)
    beside = math.hypot(pose[0] - lap.places[first, 0], pose[1] - lap.places[first, 1])
    if fits < _CLOSES or beside > _STEP * first:
        return
    turn = _turn_between(lap.heading, pose[2])  # a lap turns by 2 pi, which is no error
    if abs(turn) > _HEADING_OFF:  # its odometry drifts; at a later place the scan might fit without that turn
        lap.drifts = True
        return
    _bend(lap, first, turn, pose)
    cos, sin = math.cos(lap.places[0, 2]), math.sin(lap.places[0, 2])
    while lap.count > _LEAST_LAP // 2:  # the last places may lie beside the first
        dx, dy = lap.places[lap.count - 1, 0] - lap.places[0, 0], lap.places[lap.count - 1, 1] - lap.places[0, 1]
        if cos * dx + sin * dy < -0.5 * SPACING:
            break
        lap.count -= 1
    lap.closed, lap.nearest, lap.fits = True, 0, 1.0
    lap.x, lap.y, lap.heading = pose


@kernel
def _bend(lap: Record, first: int, turn: float, pose: tuple[float, float, float]) -> None:
    """Begin the lap at its `first` place, and spread the error of dead reckoning: to `pose`, and by a turn [rad]."""
    lap.count -= first
    count, before_x, before_y = lap.count, float(lap.places[first, 0]), float(lap.places[first, 1])
    here_x, here_y = before_x, before_y
    for k in range(count):  # turn the ways between places
        place = lap.places[first + k]
        cos, sin = math.cos(turn * k / count), math.sin(turn * k / count)
        dx, dy = place[0] - before_x, place[1] - before_y
        before_x, before_y = float(place[0]), float(place[1])
        here_x += cos * dx - sin * dy
        here_y += sin * dx + cos * dy
        lap.places[k, 0], lap.places[k, 1], lap.places[k, 2] = here_x, here_y, place[2] + turn * k / count
        lap.ranges[k] = lap.ranges[first + k]
    shift_x, shift_y = pose[0] - here_x, pose[1] - here_y
    for k in range(count):
        lap.places[k, 0] += shift_x * k / count
        lap.places[k, 1] += shift_y * k / count


@kernel
def _turn_between(heading: float, other: float) -> float:
    """Return the turn from one heading to another, the short way round [rad]."""
    turn = other - heading
    return turn - 2.0 * math.pi * round(turn / (2.0 * math.pi))


@kernel
def nearest_place(lap: Record, last: int, x: float, y: float, heading: float) -> tuple[int, float]:
    """Return the place nearest to a pose, and how far away it is; near the `last` one. NaN: any heading."""
    best, least = last, math.inf
    for more in range(-_BEHIND, _AHEAD + 1):
        place = (last + more) % lap.count
        apart = math.hypot(x - lap.places[place, 0], y - lap.places[place, 1])
        if not math.isnan(heading):
            apart += _TURN_COUNTS * abs(_turn_between(lap.places[place, 2], heading))
        if apart < least:
            best, least = place, apart
    return best, least


@kernel
def _localise(lap: Record, geometry: Record, ranges: FloatArray, lidar_offset: float) -> None:
    """Correct where the car is by the readings at the nearest place."""
    lap.nearest, apart = nearest_place(lap, lap.nearest, lap.x, lap.y, lap.heading)
    pose, fits = _matched(lap, lap.nearest, geometry, ranges, lidar_offset, (lap.x, lap.y, lap.heading), _MATCH)
    lap.x, lap.y, lap.heading = pose
    lap.fits += _MEMORY * (fits - lap.fits)
    if lap.fits < _FITS or apart > _LOST:
        forget_lap(lap)


@kernel
def _directions(geometry: Record, count: int) -> FloatArray:
    """Return cosine and sine of the bearings of the beams that are kept of a scan of `count` beams (BEAMS, 2)."""
    directions = np.empty((BEAMS, 2))
    for beam in range(BEAMS):
        bearing = bearing_of(geometry, _beam_of(beam, count))
        directions[beam, 0], directions[beam, 1] = math.cos(bearing), math.sin(bearing)
    return directions


@kernel
def _ends_of(lap: Record, index: int, directions: FloatArray, lidar_offset: float, ends: FloatArray) -> None:
    """Write where the beams kept at a place ended (BEAMS, 2 or 3); NaN beyond TOO_FAR."""
    heading = float(lap.places[index, 2])
    cos, sin = math.cos(heading), math.sin(heading)
    x, y = lap.places[index, 0] + lidar_offset * cos, lap.places[index, 1] + lidar_offset * sin
    for beam in range(BEAMS):
        kept = lap.ranges[index, beam] / _MOST
        distance = TOO_FAR * kept * kept if kept < 1.0 else math.nan
        ahead, left = distance * directions[beam, 0], distance * directions[beam, 1]
        ends[beam, 0], ends[beam, 1] = x + cos * ahead - sin * left, y + sin * ahead + cos * left


@kernel
def ends_of(lap: Record, geometry: Record, count: int, lidar_offset: float) -> FloatArray:
    """Return where the beams kept at each place ended, as `walls_of`, but without the side."""
    ends, directions = np.zeros((lap.count, BEAMS, 3)), _directions(geometry, count)
    for place in range(lap.count):
        _ends_of(lap, place, directions, lidar_offset, ends[place])
    return ends


@kernel
def walls_of(lap: Record, geometry: Record, count: int, lidar_offset: float) -> FloatArray:
    """Return where the beams kept at each place ended, and 1 to the left of the lap's path or -1 to the right.

    Shape (places, BEAMS, 3), x and y [m]; NaN for those that ended beyond TOO_FAR. A scan has `count` beams.
    """
    walls = ends_of(lap, geometry, count, lidar_offset)
    for place in range(lap.count):
        ends = walls[place]
        for beam in range(BEAMS):
            least = math.inf
            for more in range(-_SIDE_BEHIND, _SIDE_AHEAD + 1):
                other = lap.places[(place + more) % lap.count]
                dx, dy = ends[beam, 0] - other[0], ends[beam, 1] - other[1]
                apart = dx * dx + dy * dy
                if apart < least:  # nor is NaN
                    least, nearest_x, nearest_y, heading = apart, dx, dy, float(other[2])
            if least < math.inf:
                ends[beam, 2] = 1.0 if math.cos(heading) * nearest_y >= math.sin(heading) * nearest_x else -1.0
    return walls


@kernel
def _matched(
    lap: Record,
    index: int,
    geometry: Record,
    ranges: FloatArray,
    lidar_offset: float,
    pose: tuple[float, float, float],
    match: tuple[float, float, float],
) -> tuple[tuple[float, float, float], float]:
    """Return where the car is by the readings at a place, as `pose`, and the share of them that fits.

    `pose` is where it was taken to be, x, y [m] and heading [rad]; `match` as of _MATCH.
    """
    ends = np.empty((BEAMS, 2))
    _ends_of(lap, index, _directions(geometry, len(ranges)), lidar_offset, ends)
    x, y, heading = pose
    cos, sin = math.cos(heading), math.sin(heading)
    lidar_x, lidar_y = x + lidar_offset * cos, y + lidar_offset * sin
    normal, right = np.zeros((3, 3)), np.zeros(3)
    normal[0, 0] = normal[1, 1] = match[1]
    normal[2, 2] = match[2]
    seen, fitting = 0, 0
    for beam in range(1, BEAMS - 1):
        normal_x, normal_y = _across_wall(ends, beam)
        if math.isnan(normal_x):
            continue
        dx, dy = ends[beam, 0] - lidar_x, ends[beam, 1] - lidar_y
        at = nearest_beam(geometry.angle_min, geometry.angle_increment, cos * dx + sin * dy, cos * dy - sin * dx)
        if not 0.0 <= at <= len(ranges) - 1.0:
            continue
        seen += 1
        distance, bearing = ranges[int(at)], heading + bearing_of(geometry, at)
        from_x, from_y = lidar_x - x + distance * math.cos(bearing), lidar_y - y + distance * math.sin(bearing)
        error = normal_x * (x + from_x - ends[beam, 0]) + normal_y * (y + from_y - ends[beam, 1])
        if abs(error) < match[0]:
            fitting += 1
            row = (normal_x, normal_y, normal_y * from_x - normal_x * from_y)
            for i in range(3):
                right[i] -= row[i] * error
                for j in range(3):
                    normal[i, j] += row[i] * row[j]
    moved = _solved(normal, right)
    return (x + moved[0], y + moved[1], heading + moved[2]), fitting / max(seen, 1)


@kernel
def _across_wall(ends: FloatArray, beam: int) -> tuple[float, float]:
    """Return the direction square to the wall at the end of a beam; NaN where that is no straight piece of wall."""
    along_x, along_y = ends[beam + 1, 0] - ends[beam - 1, 0], ends[beam + 1, 1] - ends[beam - 1, 1]
    piece = math.hypot(along_x, along_y)
    if not 1e-3 < piece < _PIECE:  # nor is NaN
        return math.nan, math.nan
    normal_x, normal_y = -along_y / piece, along_x / piece
    off = normal_x * (ends[beam, 0] - ends[beam - 1, 0]) + normal_y * (ends[beam, 1] - ends[beam - 1, 1])
    return (normal_x, normal_y) if abs(off) < _STRAIGHT else (math.nan, math.nan)


@kernel
def _solved(normal: FloatArray, right: FloatArray) -> FloatArray:
    """Return x of three normal equations, by elimination; the dead reckoning makes them definite. Both written to."""
    for i in range(3):
        for j in range(i + 1, 3):
            factor = normal[j, i] / normal[i, i]
            normal[j] -= factor * normal[i]
            right[j] -= factor * right[i]
    for i in range(2, -1, -1):
        for j in range(i + 1, 3):
            right[i] -= normal[i, j] * right[j]
        right[i] /= normal[i, i]
    return right
