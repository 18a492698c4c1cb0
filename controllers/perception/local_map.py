"""Local map: what the scans of the last metres showed, on a grid that moves with the car, and the path behind it.

A scan shows what can be seen from one place. In a hairpin round a thin barrier the road ahead is hidden until the car
is in it, and what was seen a second ago is then behind the car. So the free ground and the walls of the last scans are
kept on a grid, by dead reckoning. Dead reckoning drifts: a cell is unknown again when the car has driven 16 to 18 m
since it was seen.

A scan is entered in two steps. The cells along its beams become free. Then the cells at the ends of its beams
become walls; ends of neighbouring beams that are close together are joined, because they lie apart where a beam
meets a wall at a small angle. The last observation counts, so that an obstacle that has moved on is forgotten when
its place is seen again.

The ends of beams close to the car are kept as they are, too: those of the last scan, and earlier ones beside and behind
the car, where no beam goes any more and a car that turns or reverses may touch a wall.

The path of the rear axle is kept with the room to its right and left, so that the way back can be closed (frontiers).

Source: H. Moravec and A. Elfes, High Resolution Maps from Wide Angle Sonar, IEEE ICRA 1985, for the grid. Its cells
have probabilities; these have three values.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

from ..control.planner_settings import Record
from .scan_geometry import bearing_of

SIZE = 256  # cells to a side; a power of two, so that `place & RING` is the place of a cell in the ring
RING = SIZE - 1
CELL = 0.1  # [m]
PER_METRE = 10.0  # cells: a product takes a quarter of the time of a quotient
EDGE = SIZE // 2 - 2  # cells from the car's own that are kept
SIGHT = 9.8  # [m] along a beam that is entered
KIND, UNKNOWN, FREE, WALL = 3, 0, 1, 2
NEARNESS, WALL_IN_4, WALL_IN_2, WALL_IN_1 = 12, 4, 8, 12
"""Bits of a cell, see `cells`: how near a wall was when they were last marked: within four cells, two or one."""

PATH = 160  # points of the path that are kept
RIGHT, LEFT, ALONG, SIN, COS = range(3, 8)  # columns of the path, after x, y and heading; the last two are of that

_FORGET = 8  # times 2 m: longer than the path that is closed (frontiers)
_SWEPT = 16  # rows that are searched for old cells each time: all of them within 16 entries
_STEP = 0.09  # [m] along a beam, below a cell
_FINEST = math.radians(0.5)  # between the beams that are entered: a cell at 11 m
_COARSEST = 8  # only every so many beams are followed from the LiDAR on; those between from where they are apart
_JOINED = 0.4  # [m] between neighbouring ends of beams that are one wall
_PART = 0.8 * CELL  # [m] at most between cells of a wall that is joined
_WITHIN_PART = 0.99 * _PART * _PART  # [m^2] below it, one part is enough
_SPACING = 0.1  # [m] between the points of the path
_WIDENS = 0.3  # [m/m] by which the room along the path may grow: at a barrier's end the road ahead is to the side
_WIDEST = 3.0  # [m] of the room to one side
_BESIDE = math.radians(15.0)  # to either side of square to the car: beams that measure the room to its sides
_KEPT = 15  # cells round the car that are kept when the rest is forgotten
BEFORE = 7.0  # [m] of path that the car is taken to have come before its first tick
_CLOSE = 2.0  # [m] from the LiDAR within which the ends of beams are kept as they are
_VERY_CLOSE = 0.6  # [m] the same, all of them; between, every second
_ENDS = 720
_PASSED = 1.0  # [m] from the rear axle within which the ends of earlier beams are kept, where no beam goes now,
_PASSED_APART = 0.03  # [m] and no closer to each other
_FARTHEST = 1e9  # [m] or [rad] of a tick; beyond, it is no odometry

LOCAL_MAP = np.dtype(
    [
        ("begun", np.bool_),
        ("x", np.float64),  # [m] of the rear axle, by dead reckoning from where it began
        ("y", np.float64),  # [m]
        ("heading", np.float64),  # [rad]
        ("driven", np.float64),  # [m]
        ("along", np.float64),  # [m] along the path, of which pockets are cut off that the car has to leave again
        ("furthest", np.float64),  # [m] greatest `along`
        ("column", np.int64),  # of the cell of the rear axle
        ("row", np.int64),
        ("swept", np.int64),  # row that was last searched for old cells
        # by column and row in the ring; bits, from the lowest: 2 of KIND, 2 of NEARNESS, and 4 of when the cell was
        # seen: `driven` then, in 2 m modulo 16
        ("cells", np.uint8, (SIZE, SIZE)),
        # ring buffer: x, y [m], heading [rad], room to the right and left, along [m], sine and cosine of the heading
        ("path", np.float64, (PATH, 8)),
        ("newest", np.int64),  # index of the last point of the path
        ("known", np.int64),  # how many of them there are
        ("ends", np.float64, (_ENDS, 2)),  # [m] of beams that are close: the last scan's, after those it passed
        ("ends_known", np.int64),
    ]
)
"""Type of the memory; zero at the beginning."""


@kernel
def move(memory: Record, speed: float, yaw_rate: float, period: float) -> None:
    """Take the car on by one tick, and make the cells unknown that come into the window.

    Args:
      memory: of type LOCAL_MAP, written to.
      speed: [m/s].
      yaw_rate: [rad/s].
      period: of the tick [s].
    """
    way, turn = speed * period, yaw_rate * period
    if not memory.begun:
        memory.begun = True
        _begin_path(memory)
        return
    if not (abs(way) < _FARTHEST and abs(turn) < _FARTHEST):  # nor is NaN
        return
    memory.x += way * math.cos(memory.heading + 0.5 * turn)
    memory.y += way * math.sin(memory.heading + 0.5 * turn)
    memory.heading += turn
    memory.driven += abs(way)
    memory.along += way
    memory.furthest = max(memory.furthest, memory.along)
    if way < 0.0:
        cut_path(memory, memory.along)
    column, row = math.floor(memory.x * PER_METRE), math.floor(memory.y * PER_METRE)
    if abs(column - memory.column) > SIZE or abs(row - memory.row) > SIZE:  # odometry that jumps
        memory.cells[:] = UNKNOWN
        memory.column, memory.row = column, row
        _begin_path(memory)
    while memory.column != column:
        step = 1 if column > memory.column else -1
        memory.column += step
        memory.cells[(memory.column + step * (EDGE + 1)) & RING, :] = UNKNOWN
    while memory.row != row:
        step = 1 if row > memory.row else -1
        memory.row += step
        memory.cells[:, (memory.row + step * (EDGE + 1)) & RING] = UNKNOWN


@kernel
def forget(memory: Record) -> None:
    """Forget what was seen far from the car, and the path; what is near is kept, so that the car can reverse there."""
    for i in range(memory.column - EDGE, memory.column + EDGE + 1):
        for j in range(memory.row - EDGE, memory.row + EDGE + 1):
            if max(abs(i - memory.column), abs(j - memory.row)) > _KEPT:
                memory.cells[i & RING, j & RING] = UNKNOWN
    _begin_path(memory)


@kernel
def _begin_path(memory: Record) -> None:
    """Take the car to have come straight to where it is, for the length BEFORE."""
    memory.known = 0
    memory.along = memory.furthest = BEFORE


@kernel
def enter_scan(memory: Record, geometry: Record, ranges: FloatArray, lidar_offset: float) -> None:
    """Enter a scan.

    Args:
      memory: of type LOCAL_MAP, written to.
      geometry: of type SCAN_GEOMETRY.
      ranges: readings (n,) [m], without NaN or inf.
      lidar_offset: of the LiDAR ahead of the rear axle [m].
    """
    cells, now = memory.cells, (int(memory.driven * 0.5) & 15) << 4
    _forget(memory, now)
    stride = max(1, int(_FINEST / geometry.angle_increment + 1e-6))
    count = (len(ranges) + stride - 1) // stride
    x0 = memory.x + lidar_offset * math.cos(memory.heading)
    y0 = memory.y + lidar_offset * math.sin(memory.heading)
    increment = stride * geometry.angle_increment
    turn_cos, turn_sin = math.cos(increment), math.sin(increment)
    cos, sin = math.cos(memory.heading + geometry.angle_min), math.sin(memory.heading + geometry.angle_min)
    ends = np.empty((count, 2))
    _keep_passed_ends(memory, geometry, len(ranges), x0, y0)
    for beam in range(count):
        distance = ranges[beam * stride]
        ends[beam, 0], ends[beam, 1] = x0 + distance * cos, y0 + distance * sin
        if distance < _CLOSE and memory.ends_known < _ENDS and (distance < _VERY_CLOSE or beam % 2 == 0):
            memory.ends[memory.ends_known, 0], memory.ends[memory.ends_known, 1] = ends[beam, 0], ends[beam, 1]
            memory.ends_known += 1
        every = 1
        while every < _COARSEST and beam % (2 * every) == 0:
            every *= 2
        first = 0.0 if every == _COARSEST else 0.3 * CELL / (increment * every)
        last = min(distance, SIGHT) - 0.5 * CELL
        if first < last:
            x, y = (x0 + first * cos) * PER_METRE, (y0 + first * sin) * PER_METRE
            for _ in range(int((last - first) / _STEP) + 1):
                i, j = math.floor(x) & RING, math.floor(y) & RING
                cells[i, j] = cells[i, j] & NEARNESS | FREE | now
                x += _STEP / CELL * cos
                y += _STEP / CELL * sin
        cos, sin = cos * turn_cos - sin * turn_sin, sin * turn_cos + cos * turn_sin
    for beam in range(count):
        if ranges[beam * stride] >= SIGHT:
            continue
        x, y = ends[beam, 0], ends[beam, 1]
        before_x, before_y, parts = x, y, 1
        if beam > 0 and ranges[(beam - 1) * stride] < SIGHT:
            before_x, before_y = ends[beam - 1, 0], ends[beam - 1, 1]
            square = (x - before_x) * (x - before_x) + (y - before_y) * (y - before_y)
            if _WITHIN_PART < square < _JOINED * _JOINED:
                parts = int(math.sqrt(square) / _PART) + 1
        for part in range(parts):
            share = part / parts if part > 0 else 0.0
            i = math.floor((x + share * (before_x - x)) * PER_METRE) & RING
            j = math.floor((y + share * (before_y - y)) * PER_METRE) & RING
            cells[i, j] = cells[i, j] & NEARNESS | WALL | now


@kernel
def _keep_passed_ends(memory: Record, geometry: Record, beams: int, x0: float, y0: float) -> None:
    """Keep of the ends of beams those beside and behind the car that a LiDAR at x0, y0 [m] does not see any more."""
    cos, sin, kept = math.cos(memory.heading), math.sin(memory.heading), 0
    to_right, to_left = math.cos(geometry.angle_min), math.cos(bearing_of(geometry, beams - 1))
    for k in range(memory.ends_known):
        x, y = memory.ends[k, 0], memory.ends[k, 1]
        if (x - memory.x) * (x - memory.x) + (y - memory.y) * (y - memory.y) > _PASSED * _PASSED:
            continue
        ahead, left = cos * (x - x0) + sin * (y - y0), cos * (y - y0) - sin * (x - x0)
        if ahead >= (to_left if left > 0.0 else to_right) * math.sqrt(ahead * ahead + left * left):
            continue
        if kept > 0:
            dx, dy = x - memory.ends[kept - 1, 0], y - memory.ends[kept - 1, 1]
            if dx * dx + dy * dy < _PASSED_APART * _PASSED_APART:
                continue
        memory.ends[kept, 0], memory.ends[kept, 1] = x, y
        kept += 1
    memory.ends_known = kept


@kernel
def _forget(memory: Record, now: int) -> None:
    """Make the cells of some rows unknown that were seen too long ago."""
    for _ in range(_SWEPT):
        memory.swept = (memory.swept + 1) & RING
        cells = memory.cells[memory.swept]
        for j in range(SIZE):
            age = np.uint8(now - (cells[j] & np.uint8(240))) >> np.uint8(4)
            cells[j] = np.uint8(UNKNOWN) if age > _FORGET else cells[j]


@kernel
def extend_path(memory: Record, geometry: Record, ranges: FloatArray) -> None:
    """Add the car's place to its path, with the room to its sides, if the last point is far enough behind.

    Arguments as of `enter_scan`. At first, the way before the start is taken to end where the car is. The room is no
    wider than that at the last point and what _WIDENS allows.
    """
    last = memory.path[memory.newest]
    begins = memory.known == 0
    if not begins and memory.along - last[ALONG] < _SPACING:
        return
    right, left = _room_beside(geometry, ranges)
    if not begins:
        wider = _WIDENS * (memory.along - last[ALONG])
        right, left = min(right, last[RIGHT] + wider), min(left, last[LEFT] + wider)
    while True:
        memory.newest = (memory.newest + 1) % PATH
        memory.known = min(memory.known + 1, PATH)
        point = memory.path[memory.newest]
        point[0], point[1], point[2] = memory.x, memory.y, memory.heading
        point[RIGHT], point[LEFT] = min(right, _WIDEST), min(left, _WIDEST)
        point[SIN], point[COS] = math.sin(memory.heading), math.cos(memory.heading)
        point[ALONG] = memory.known - 1.0 if begins else memory.along
        if not begins or point[ALONG] >= BEFORE:
            break


@kernel
def cut_path(memory: Record, along: float) -> None:
    """Cut the path off beyond a place [m] along it: the car has driven into a pocket from there."""
    while memory.known > 1 and memory.path[memory.newest, ALONG] > along:
        memory.newest = (memory.newest - 1) % PATH
        memory.known -= 1
    memory.along = max(memory.path[memory.newest, ALONG], along)


@kernel
def _room_beside(geometry: Record, ranges: FloatArray) -> tuple[float, float]:
    """Return the distances to the walls to the right and to the left [m], past what is narrower than the beams."""
    right = left = 0.0
    ahead, half = -geometry.angle_min / geometry.angle_increment, _BESIDE / geometry.angle_increment
    quarter, last = 0.5 * math.pi / geometry.angle_increment, len(ranges) - 1.0
    for index in range(-2, 3):
        aside = math.cos(0.5 * index * _BESIDE)
        beam = min(max(ahead - quarter + 0.5 * index * half, 0.0), last)
        right = max(right, aside * ranges[int(beam)])
        beam = min(max(ahead + quarter + 0.5 * index * half, 0.0), last)
        left = max(left, aside * ranges[int(beam)])
    return right, left


@kernel
def in_window(memory: Record, i: int, j: int) -> bool:
    """Return whether the map has a cell, by its column and row."""
    return bool(abs(i - memory.column) <= EDGE and abs(j - memory.row) <= EDGE)
