"""Moving targets in the scan: which things move, where they are and how fast, from the LiDAR and odometry alone.

1. A scan is cut into clusters where neighbouring ranges differ by more than `_EDGE` and than the noise of the beams
   explains, which is estimated in each scan. A cluster is looked at if it is narrower than `_WIDEST` and ends in front
   of farther ground on at least one side. Walls are wider, and what lies between two nearer things shows no end of its
   own.
2. Each cluster has two ends: bearings of its outermost beams, at the distance of the middle of a disc that would be
   seen under the same angle at its least range. The middle of the ends does not go round a box or a cylinder when the
   car does. The least of many noisy beams is too short, so where there is noise the ranges are averaged first, over an
   eighth of the cluster at most. An end in front of farther ground belongs to the thing itself; one beside nearer
   ground is the edge of a shadow, and says nothing of motion. Of a thing that is partly hidden the end is where it is
   seen itself, as the part in cover may be the nearest.
3. Clusters are followed from scan to scan in a frame that stands still, by dead reckoning. A Kalman filter with
   constant velocity, whose covariance is the same for x and y, is fed with the mean innovation of the ends that belong
   to the thing. So a thing that comes out of cover is measured by the end that leads. Innovations against the velocity
   are summed up (CUSUM): a thing that turns back is noticed after some scans. Its velocity is turned round then, and
   the farthest place it was seen at is kept, because it will turn there again. Where both such places are known it is
   expected to turn there, at once; if it goes on, both are forgotten.
4. A target moves if its velocity is `_CERTAIN` standard deviations from zero, and if this scan and one of the last
   0.8 s contradict each other. A standing thing is where a beam ends, so no other beam sees past it. The proof is that
   two of the target's beams end where the earlier scan sees past, or that this scan sees past where the earlier one saw
   it. Odometry errs by shares of the way and of the turn, and by the slip of wheels that speed up or brake. So all
   beams that may point to the place have to see past it, by more than the way may err along them. A wall's end that
   only changes its outline as the car turns round it never contradicts an earlier scan.

Sources: R. Kalman, A New Approach to Linear Filtering and Prediction Problems, Journal of Basic Engineering 82(1),
1960; E. Page, Continuous Inspection Schemes, Biometrika 41, 1954, for the sums of innovations; D. Hähnel, R. Triebel,
W. Burgard and S. Thrun, Map Building with Mobile Robots in Dynamic Environments, IEEE ICRA 2003, for ground that was
free before.

Limits: a thing that touches a wall, or one nearer than `_EDGE` to what is behind it, is part of it, and so is one that
the field of view cuts off. Beyond `_LEVEL`, what moves in front of nothing that the LiDAR sees is not known to move: as
the car rolls, beams pass above things there. A target that is hidden is taken to go on as it did for `_FORGOTTEN`.
Things wider than `_WIDEST` stand.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

from ..control.planner_settings import Record
from .scan_filters import noise_of
from .scan_geometry import bearing_of, nearest_beam, period_of

MOST_TARGETS = 24
RIGHT, LEFT = 0, 1  # ends of a cluster

_FARTHEST = 12.0  # [m] at which clusters are looked at
_EDGE, _CUT = 0.15, 4.0  # [m] between neighbouring ranges, and in standard deviations, whichever is more
_STEEP = 4.0  # times the mean step within a cluster, the same
_LEAST_BEAMS = 2
_WIDEST = 1.2  # [m] from the first to the last beam of a cluster
_NEAR = 0.08  # of its distance is half of a thing, from which on its size is not measured
_FOUND = 48  # clusters of a scan that are kept
_GATE = 0.3  # [m] from where an end is expected to where it is seen
_RANGE_NOISE = 0.02  # [m] besides that of the beams
_PARTS, _MEAN_NOISE = 8, 0.005  # at least, of a cluster, of whose means the least is its distance; [m] noise of a mean
_OUTLINE = 0.3  # [m] by which an end may err, for each metre of distance and squared radian of the cluster
_ACCELERATION = 1.5  # [m/s^2] standard deviation of what a target does between two scans
_FIRST_SPEED = 2.0  # [m/s] the same, of the velocity of a new one
_MISFIT = 9.0  # squared innovation over its variance; at the second in turn the velocity is uncertain again
_TURNED = 3.0  # standard deviations: sum of innovations against the velocity, from which on it has turned
_ALLOWED = 0.5  # the same, of each innovation, that is not counted
_UNCERTAIN, _EXPECTED = 0.3, 0.1  # of its speed is the standard deviation of one that has turned back; as expected
_CERTAIN = 4.0  # standard deviations
_LEAST_SPEED = 0.25  # [m/s]
_DRIFT, _TURN_DRIFT = 0.07, 0.06  # share by which odometry may err: of the way, and of the turn
_SLIP = 0.01  # [s^2/m] share of the way by which wheels slip for each m/s^2 of acceleration
_LEAST_AGE = 5  # sightings
_NO_RETURN = 65.0  # [m] as which a beam without a return is kept
_LEVEL = 7.0  # [m] up to which such a beam has not passed above a thing of 0.3 m, as the car rolls
_SIGMAS = 3.0  # of the noise by which what is seen may be elsewhere
_FREE = 0.08  # [m] past a place that a beam has to reach, for the place to be free
_FORGOTTEN = 0.6  # [s]
_FORGOTTEN_IN_VIEW = 0.15  # [s] the same, where it would be seen
_STANDS = 1.0  # [s] without motion after which a target is a standing thing again
_SNAPSHOTS, _EVERY = 5, 6  # scans that are kept: the last one, and one of so many before it
_BINS = 1081  # of a scan that is kept, at most

TARGET = np.dtype(
    [
        ("age", np.int64),  # sightings; 0: there is none
        ("ends", np.float64, (2, 2)),  # x and y [m] of the right and of the left end, where the planner's car began
        ("own", np.uint8, (2,)),  # whether each end belonged to the thing at the last sighting
        ("radius", np.float64),  # [m] of a disc that is seen under the same angle; 0 where an end is hidden
        ("vx", np.float64),  # [m/s]
        ("vy", np.float64),  # [m/s]
        ("p_place", np.float64),  # [m^2] covariance, the same in x and y
        ("p_mixed", np.float64),  # [m^2/s]
        ("p_speed", np.float64),  # [m^2/s^2]
        ("misfits", np.int64),  # innovations in turn that were too great
        ("against", np.float64),  # sum of those against its velocity, in standard deviations
        ("still", np.float64),  # [s] for which it has not moved
        ("unseen", np.float64),  # [s]
        ("moves", np.bool_),
        ("distance", np.float64),  # [m] from the LiDAR at the last sighting
        ("size", np.float64),  # [m] greatest radius that was seen
        ("first", np.int64),  # beam of the last sighting,
        ("end", np.int64),  # and the one behind the last
        ("turns", np.int64),  # times that it was seen to turn back
        ("turned", np.float64, (2, 2)),  # x and y [m] of the last two places where it did
        ("farthest", np.float64, (2,)),  # x and y [m] of the place that is farthest on its way since it turned
    ]
)
SNAPSHOT = np.dtype(
    [
        ("x", np.float64),  # [m] of the LiDAR
        ("y", np.float64),  # [m]
        ("heading", np.float64),  # [rad]
        ("tick", np.int64),  # when it was taken; 0: none is kept
        ("turned", np.float64),  # [rad] until then
        ("doubt", np.float64),  # [m] the same
        ("noise", np.float64),  # [m]
        ("ranges", np.uint16, (_BINS,)),  # [mm] least of each bin
    ]
)
TARGETS = np.dtype(
    [
        ("x", np.float64),  # [m] of the LiDAR, by dead reckoning from where it began
        ("y", np.float64),  # [m]
        ("heading", np.float64),  # [rad]
        ("speed", np.float64),  # [m/s] at the last scan: the mean of two is that of the time between them
        ("yaw_rate", np.float64),  # [rad/s]
        ("turned", np.float64),  # [rad] to either side
        ("doubt", np.float64),  # [m] by which the way may err
        ("noise", np.float64),  # [m] of the last scan's readings
        ("tick", np.int64),
        ("beams", np.int64),  # of the scans that are kept
        ("count", np.int64),  # of targets that move
        ("targets", TARGET, (MOST_TARGETS,)),
        ("snapshots", SNAPSHOT, (_SNAPSHOTS,)),
    ]
)
"""Type of what is kept from tick to tick; zero at the beginning."""

_CLUSTER = np.dtype(
    [
        ("ends", np.float64, (2, 2)),  # as of a target
        ("own", np.uint8, (2,)),
        ("radius", np.float64),  # [m] as of a target
        ("distance", np.float64),  # [m] least range
        ("variance", np.float64),  # [m^2] of an end
        ("first", np.int64),  # beam
        ("end", np.int64),  # and the one behind the last
        ("taken", np.bool_),
    ]
)


@kernel
def track_targets(
    memory: Record, geometry: Record, ranges: FloatArray, odometry: Record, lidar_offset: float, course: float
) -> int:
    """Follow what is in a scan, and return how many targets move.

    Args:
      memory: of type TARGETS, written to.
      geometry: of type SCAN_GEOMETRY.
      ranges: readings (n,) [m], without NaN or inf.
      odometry: of type ODOMETRY.
      lidar_offset: of the LiDAR ahead of the rear axle [m].
      course: direction in which the rear axle moves, from the car's heading [rad].
    """
    period, count = period_of(geometry), len(ranges)
    speed, yaw_rate = odometry.speed, odometry.angular_velocity[2]
    way, turn = 0.5 * period * (memory.speed + speed), 0.5 * period * (memory.yaw_rate + yaw_rate)
    change = abs(speed - memory.speed)
    memory.count, memory.speed, memory.yaw_rate = 0, speed, yaw_rate
    if not abs(way) + abs(turn) < 10.0 or count != memory.beams:  # it is no odometry, or another LiDAR
        memory.beams = count
        forget_targets(memory)
        return 0
    towards = memory.heading + 0.5 * turn + course
    x = memory.x - lidar_offset * math.cos(memory.heading) + way * math.cos(towards)
    y = memory.y - lidar_offset * math.sin(memory.heading) + way * math.sin(towards)
    memory.heading += turn
    memory.x, memory.y = x + lidar_offset * math.cos(memory.heading), y + lidar_offset * math.sin(memory.heading)
    memory.doubt += abs(way) * (_DRIFT + _SLIP * change / period)
    memory.turned += abs(turn)
    memory.tick += 1
    memory.noise = noise_of(ranges, geometry.range_max)
    _keep_scan(memory, geometry, ranges)
    found = np.empty(_FOUND, _CLUSTER)
    clusters = find_clusters(memory, geometry, ranges, found)
    for moves in (True, False):
        for target in memory.targets:
            if target.age > 0 and target.moves == moves:
                _predict(target, period)
                _follow(memory, target, found, clusters, geometry, ranges)
                memory.count += target.age > 0 and target.moves
    _begin_all(memory.targets, found, clusters)
    return int(memory.count)


@kernel
def forget_targets(memory: Record) -> None:
    """Forget all targets and scans."""
    for target in memory.targets:
        target.age = 0
        target.moves = False
    for snapshot in memory.snapshots:
        snapshot.tick = 0


@kernel
def find_clusters(memory: Record, geometry: Record, ranges: FloatArray, found: Record) -> int:
    """Write the clusters of a scan that may be things, (k,) of type _CLUSTER; return how many."""
    edge = max(_EDGE, _CUT * math.sqrt(2.0) * memory.noise)
    count, first, nearer = 0, 0, True  # the cluster that has not ended; whether what is right of it is nearer
    for beam in range(1, len(ranges)):
        step = ranges[beam] - ranges[beam - 1]
        if abs(step) <= edge:
            continue
        whole = first > 0 and beam - first >= _LEAST_BEAMS  # what the field of view cuts off may be a wall
        if whole and ranges[first] < _FARTHEST and (not nearer or step > 0.0):
            count += _is_cluster(memory, geometry, ranges, first, beam, edge, found[count])
            if count == len(found):
                return count
        first, nearer = beam, step > 0.0
    return count


@kernel
def _is_cluster(
    memory: Record, geometry: Record, ranges: FloatArray, first: int, end: int, edge: float, found: Record
) -> bool:
    """Write a cluster of the beams from `first` to before `end`; return False if it is too wide, or part of a wall.

    The variance of an end is of the range, of where between two beams the thing ends, and of its outline: near the car
    another part of the outline is outermost in each scan.
    """
    noise, right, left = memory.noise, ranges[first], ranges[end - 1]
    edge = max(edge, _STEEP * abs(left - right) / (end - 1 - first))  # beams on a wall that is seen at a small angle
    own_right, own_left = ranges[first - 1] - right > edge, ranges[end] - left > edge
    if not (own_right or own_left):
        return False
    turn = (end - 1 - first) * geometry.angle_increment
    if right * right + left * left - 2.0 * right * left * math.cos(turn) > _WIDEST * _WIDEST or turn > 2.0:
        return False
    least, beam, wanted = math.inf, first, math.ceil(noise * noise / (_MEAN_NOISE * _MEAN_NOISE))
    together = max(min(int(wanted), (end - first) // _PARTS), 1)
    while beam < end:
        last, total = beam + together if beam + 2 * together <= end else end, 0.0
        for k in range(beam, last):
            total += ranges[k]
        least = min(least, total / (last - beam))
        beam = last
    half, radius, of_range = math.sin(0.5 * turn), 0.0, noise
    if own_right and own_left:
        radius, of_range = least * half / (1.0 - half), noise / (1.0 - half)
    away_right = away_left = least + radius
    bearing = memory.heading + bearing_of(geometry, first)
    between, outline = least * geometry.angle_increment, _OUTLINE * least * turn * turn
    if not (own_right and own_left):
        away_right, away_left = right, left
        outline = abs(left - right) / (end - 1 - first)
    found.variance = _RANGE_NOISE * _RANGE_NOISE + of_range * of_range + between * between / 12.0 + outline * outline
    found.ends[RIGHT, 0] = memory.x + away_right * math.cos(bearing)
    found.ends[RIGHT, 1] = memory.y + away_right * math.sin(bearing)
    found.ends[LEFT, 0] = memory.x + away_left * math.cos(bearing + turn)
    found.ends[LEFT, 1] = memory.y + away_left * math.sin(bearing + turn)
    found.own[RIGHT], found.own[LEFT] = own_right, own_left
    found.radius, found.distance, found.first, found.end, found.taken = radius, least, first, end, False
    return True


@kernel
def _predict(target: Record, period: float) -> None:
    """Take a target on by one tick."""
    for end in range(2):
        target.ends[end, 0] += target.vx * period
        target.ends[end, 1] += target.vy * period
    if target.moves and target.turns >= 2:
        _turn_at_end(target)
    change = _ACCELERATION * period
    target.p_place += period * (2.0 * target.p_mixed + period * target.p_speed)
    target.p_mixed += period * target.p_speed
    target.p_speed += change * change


@kernel
def _follow(
    memory: Record, target: Record, found: Record, count: int, geometry: Record, ranges: FloatArray
) -> None:
    """Take what was found nearest to a target for it."""
    nearest, least = -1, _GATE
    for k in range(count):
        if not found[k].taken:
            dx, dy, _ = _innovation(target, found[k])
            apart = math.hypot(dx, dy)
            if apart < least:
                nearest, least = k, apart
    if nearest < 0:
        target.unseen += period_of(geometry)
        patience = _FORGOTTEN if target.moves else _FORGOTTEN_IN_VIEW
        if target.moves and _is_in_view(memory, target, geometry, len(ranges)):
            patience = _FORGOTTEN_IN_VIEW
        if target.unseen > patience:
            target.age, target.moves = 0, False
        return
    cluster = found[nearest]
    cluster.taken = True
    dx, dy, ends = _innovation(target, cluster)
    noise = cluster.variance / max(ends, 1)
    x = 0.5 * (target.ends[0, 0] + target.ends[1, 0]) + dx  # where it is seen
    y = 0.5 * (target.ends[0, 1] + target.ends[1, 1]) + dy
    if ends == 0:  # only edges of shadows: it is there, and its motion is not seen
        noise *= 100.0
    sum_of_both = target.p_place + noise
    change, turned = _change_of_speed(target, dx, dy, ends, sum_of_both)
    if turned:
        _turn_back(target, dx, dy)
        dx = dy = 0.0
    if change > 0.0:
        target.p_place += 0.5 * (dx * dx + dy * dy)
        target.p_speed += change * change
        sum_of_both = target.p_place + noise
    gain, gain_speed = target.p_place / sum_of_both, target.p_mixed / sum_of_both
    target.vx += gain_speed * dx
    target.vy += gain_speed * dy
    target.p_speed -= gain_speed * target.p_mixed
    target.p_place *= 1.0 - gain
    target.p_mixed *= 1.0 - gain
    compared = _is_like(target, cluster)
    for end in range(2):
        if compared and target.own[end] and cluster.own[end]:
            # the outline may change: an end goes on from where it is seen by as much as it errs from the mean
            target.ends[end, 0] += gain * dx + 0.3 * (cluster.ends[end, 0] - target.ends[end, 0] - dx)
            target.ends[end, 1] += gain * dy + 0.3 * (cluster.ends[end, 1] - target.ends[end, 1] - dy)
        else:
            target.ends[end, 0], target.ends[end, 1] = cluster.ends[end, 0], cluster.ends[end, 1]
        target.own[end] = cluster.own[end]
    _take(target, cluster)
    if turned or (x - target.farthest[0]) * target.vx + (y - target.farthest[1]) * target.vy > 0.0:
        target.farthest[0], target.farthest[1] = x, y
    target.age += 1
    target.unseen = 0.0
    _judge(memory, target, geometry, ranges)


@kernel
def _turn_at_end(target: Record) -> None:
    """Turn a target round that has come to where it turned before last."""
    end, other, vx, vy = target.turned[target.turns % 2], target.turned[(target.turns - 1) % 2], target.vx, target.vy
    dx = 0.5 * (target.ends[0, 0] + target.ends[1, 0]) - end[0]
    dy = 0.5 * (target.ends[0, 1] + target.ends[1, 1]) - end[1]
    over, square = dx * vx + dy * vy, vx * vx + vy * vy
    if over < 0.0 or (end[0] - other[0]) * vx + (end[1] - other[1]) * vy < 0.5 * _GATE * math.sqrt(square):
        return
    for side in range(2):
        target.ends[side, 0] -= 2.0 * over * vx / square
        target.ends[side, 1] -= 2.0 * over * vy / square
    target.vx, target.vy, target.farthest[:] = -vx, -vy, end
    target.turns += 1
    target.against = 0.0
    target.p_speed += _EXPECTED * _EXPECTED * square


@kernel
def _turn_back(target: Record, dx: float, dy: float) -> None:
    """Turn the velocity of a target round where it is seen now, which is dx, dy [m] from where it was expected."""
    target.vx, target.vy = -target.vx, -target.vy
    x, y, last, other = target.farthest[0], target.farthest[1], (target.turns - 1) % 2, target.turns % 2
    from_last = math.hypot(target.turned[last, 0] - x, target.turned[last, 1] - y)
    if target.turns >= 2 and from_last < math.hypot(target.turned[other, 0] - x, target.turned[other, 1] - y):
        target.turns = 0  # it goes on, beyond where it was expected to turn
    else:
        target.turned[other, 0], target.turned[other, 1] = x, y
        target.turns += 1
    for end in range(2):
        target.ends[end, 0] += dx
        target.ends[end, 1] += dy


@kernel
def _change_of_speed(target: Record, dx: float, dy: float, ends: int, variance: float) -> tuple[float, bool]:
    """Return by how much a target may have changed its velocity [m/s], and whether it has turned back.

    The first is 0 where its innovations do not say that it has.
    """
    speed = math.hypot(target.vx, target.vy)
    if speed < _LEAST_SPEED or target.age <= _LEAST_AGE:
        target.against = 0.0
    elif ends > 0:
        against = -(dx * target.vx + dy * target.vy) / (speed * math.sqrt(variance))
        target.against = max(target.against + against - _ALLOWED, 0.0)
    target.misfits = target.misfits + 1 if dx * dx + dy * dy > 2.0 * _MISFIT * variance else 0
    change, turned = 0.0, target.against > _TURNED
    if turned:
        change = _UNCERTAIN * speed
    elif target.misfits >= 2:
        change = 0.5 * _FIRST_SPEED
    if change > 0.0:
        target.misfits, target.against = 0, 0.0
    return change, bool(turned)


@kernel
def _innovation(target: Record, cluster: Record) -> tuple[float, float, int]:
    """Return by how much the ends of a cluster are off those that are expected [m], and how many say so."""
    dx, dy, ends, compared = 0.0, 0.0, 0, _is_like(target, cluster)
    for end in range(2):
        if compared and target.own[end] and cluster.own[end]:
            dx += cluster.ends[end, 0] - target.ends[end, 0]
            dy += cluster.ends[end, 1] - target.ends[end, 1]
            ends += 1
    if ends > 0:
        return dx / ends, dy / ends, ends
    dx = 0.5 * (cluster.ends[0, 0] + cluster.ends[1, 0] - target.ends[0, 0] - target.ends[1, 0])
    dy = 0.5 * (cluster.ends[0, 1] + cluster.ends[1, 1] - target.ends[0, 1] - target.ends[1, 1])
    return dx, dy, 0


@kernel
def _is_like(target: Record, cluster: Record) -> bool:
    """Return whether as much of a cluster is seen as of a target at its last sighting: both ends of its own, or one."""
    return bool((target.radius > 0.0) == (cluster.radius > 0.0))


@kernel
def _judge(memory: Record, target: Record, geometry: Record, ranges: FloatArray) -> None:
    """Decide whether a target moves."""
    square = target.vx * target.vx + target.vy * target.vy
    if not target.moves:
        least = max(_CERTAIN * _CERTAIN * target.p_speed, _LEAST_SPEED * _LEAST_SPEED)
        target.moves = square > least and _has_moved(memory, target, geometry, ranges)
        target.still = 0.0
        return
    target.still = target.still + period_of(geometry) if square < 0.25 * _LEAST_SPEED * _LEAST_SPEED else 0.0
    target.moves = target.still <= _STANDS


@kernel
def _has_moved(memory: Record, target: Record, geometry: Record, ranges: FloatArray) -> bool:
    """Return whether a target covers ground that a kept scan saw free, or has left ground that it covered there."""
    now, count = memory.snapshots[0], len(ranges)
    x, y = 0.5 * (target.ends[0, 0] + target.ends[1, 0]), 0.5 * (target.ends[0, 1] + target.ends[1, 1])
    share = target.radius / max(math.hypot(x - now.x, y - now.y), target.radius + _FREE)
    face_x, face_y = x - share * (x - now.x), y - share * (y - now.y)
    for k in range(1, len(memory.snapshots)):
        then = memory.snapshots[k]
        if then.tick == 0:
            continue
        covered = 0
        for beam in range(target.first, target.end):
            bearing = now.heading + bearing_of(geometry, beam)
            x, y = now.x + ranges[beam] * math.cos(bearing), now.y + ranges[beam] * math.sin(bearing)
            covered += _sees_past(then, now, geometry, count, x, y)
        if covered > 1:
            return True
        since = (now.tick - then.tick) * period_of(geometry)
        old_x, old_y = face_x - target.vx * since, face_y - target.vy * since
        beam, distance = _beam_towards(then, geometry, old_x, old_y)
        if 0 <= beam < count:
            reach = _reach(then, count, beam)
            if abs(reach - distance) < _EDGE:
                share = reach / max(distance, _FREE)  # to what was seen there
                old_x, old_y = then.x + share * (old_x - then.x), then.y + share * (old_y - then.y)
                if _sees_past(now, then, geometry, count, old_x, old_y):
                    return True
    return False


@kernel
def _sees_past(view: Record, other: Record, geometry: Record, count: int, x: float, y: float) -> bool:
    """Return whether a kept scan of `count` beams sees past a place where another one saw a thing.

    If all stands, a beam towards that place ends there or before. Odometry that errs puts the place elsewhere: so all
    beams have to reach past it that may point there.
    """
    beam, distance = _beam_towards(view, geometry, x, y)
    distance = max(distance, _FREE)
    cos, sin, way_x, way_y = (x - view.x) / distance, (y - view.y) / distance, other.x - view.x, other.y - view.y
    turn = _TURN_DRIFT * abs(other.turned - view.turned)
    way = max(math.hypot(way_x, way_y), 1e-6)
    doubt = abs(other.doubt - view.doubt) / way
    off = 0.5 * turn * way + _SIGMAS * other.noise  # an error of the turn bends the way
    aside = (doubt * abs(way_x * sin - way_y * cos) + off) / distance + turn
    beside = 1.0 + math.hypot(x - other.x, y - other.y) / distance  # what lies between two beams is seen by neither
    beams = int(min(aside / geometry.angle_increment + beside + 0.5, 1.0 * count))
    if beam < beams or beam + beams >= count:
        return False
    past = distance + _FREE + doubt * abs(way_x * cos + way_y * sin) + off
    for k in range(beam - beams, beam + beams + 1):
        reach = _reach(view, count, k)
        if reach < past or (distance > _LEVEL and reach == _NO_RETURN):
            return False
    return True


@kernel
def _beam_towards(view: Record, geometry: Record, x: float, y: float) -> tuple[int, float]:
    """Return the beam of a kept scan that points to a place, below 0 or beyond the last if none does; and how far."""
    cos, sin, dx, dy = math.cos(view.heading), math.sin(view.heading), x - view.x, y - view.y
    beam = nearest_beam(geometry.angle_min, geometry.angle_increment, cos * dx + sin * dy, cos * dy - sin * dx)
    return int(beam), math.hypot(dx, dy)


@kernel
def _reach(view: Record, count: int, beam: int) -> float:
    """Return how far a beam of a kept scan of `count` beams reaches [m]."""
    return float(view.ranges[beam // ((count + _BINS - 1) // _BINS)] / 1000.0)


@kernel
def _is_in_view(memory: Record, target: Record, geometry: Record, count: int) -> bool:
    """Return whether a target would be seen where it is expected: the beams there end beyond it."""
    x, y = 0.5 * (target.ends[0, 0] + target.ends[1, 0]), 0.5 * (target.ends[0, 1] + target.ends[1, 1])
    now = memory.snapshots[0]
    return _sees_past(now, now, geometry, count, x, y)


@kernel
def _begin_all(targets: Record, found: Record, count: int) -> None:
    """Begin targets of the clusters that no target took."""
    for k in range(count):
        if not found[k].taken:
            _begin(targets, found[k])


@kernel
def _begin(targets: Record, cluster: Record) -> None:
    """Follow a cluster that is new, if there is room for one."""
    for target in targets:
        if target.age == 0:
            target.age = 1
            target.ends[:] = cluster.ends
            target.own[:] = cluster.own
            target.size = 0.0
            _take(target, cluster)
            target.farthest[:] = cluster.ends[RIGHT]
            target.vx = target.vy = target.unseen = target.still = 0.0
            target.p_place, target.p_mixed = cluster.variance, 0.0
            target.p_speed = _FIRST_SPEED * _FIRST_SPEED
            target.misfits = target.turns = 0
            target.against = 0.0
            target.moves = False
            return


@kernel
def _take(target: Record, cluster: Record) -> None:
    """Write what was seen of a target at its last sighting."""
    target.radius, target.distance = cluster.radius, cluster.distance
    target.first, target.end = cluster.first, cluster.end
    dx, dy = cluster.ends[LEFT, 0] - cluster.ends[RIGHT, 0], cluster.ends[LEFT, 1] - cluster.ends[RIGHT, 1]
    half = 0.5 * math.hypot(dx, dy)
    if target.age < _LEAST_AGE or half < _NEAR * cluster.distance:
        target.size = max(target.size, half)


@kernel
def _keep_scan(memory: Record, geometry: Record, ranges: FloatArray) -> None:
    """Keep a scan as the newest one, and sometimes that before it in place of the oldest.

    A beam without a return may have passed above a thing beyond `_LEVEL`, as the car rolls.
    """
    now, kept = memory.snapshots[0], len(memory.snapshots) - 1
    if memory.tick % _EVERY == 1:
        memory.snapshots[1 + (memory.tick // _EVERY) % kept] = now
    now.x, now.y, now.heading, now.tick = memory.x, memory.y, memory.heading, memory.tick
    now.turned, now.doubt, now.noise = memory.turned, memory.doubt, memory.noise
    together, count = (len(ranges) + _BINS - 1) // _BINS, len(ranges)
    for index in range((count + together - 1) // together):
        least = _NO_RETURN
        for beam in range(index * together, min((index + 1) * together, count)):
            least = min(least, ranges[beam] if ranges[beam] < geometry.range_max else _NO_RETURN)
        now.ranges[index] = int(1000.0 * least + 0.5)
