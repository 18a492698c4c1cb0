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
   the place is kept, because it will turn there again.
4. A target moves if its velocity is `_CERTAIN` standard deviations from zero, faster than an odometry error of `_DRIFT`
   makes standing things appear, and if the scans of the last 0.4 s agree: where it is now, one saw past, or where it
   was, one sees past now. What only changes its outline, as a wall's end does when the car turns round it, never
   covers ground that was seen free.

Sources: R. Kalman, A New Approach to Linear Filtering and Prediction Problems, Journal of Basic Engineering 82(1),
1960; E. Page, Continuous Inspection Schemes, Biometrika 41, 1954, for the sums of innovations; D. Hähnel, R. Triebel,
W. Burgard and S. Thrun, Map Building with Mobile Robots in Dynamic Environments, IEEE ICRA 2003, for ground that was
free before.

Limits: a thing that touches a wall, or one nearer than `_EDGE` to what is behind it, is part of it, and so is one that
the field of view cuts off. A target that is hidden is taken to go on as it did for `_FORGOTTEN`. Things wider than
`_WIDEST` stand.
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
_UNCERTAIN = 0.3  # of its speed is the standard deviation of one that has turned back
_CERTAIN = 4.0  # standard deviations
_LEAST_SPEED = 0.25  # [m/s]
_DRIFT = 0.06  # share by which odometry may err
_LEAST_AGE = 5  # sightings
_LEAST_EVIDENCE = 3  # scans
_MOST_EVIDENCE = 12  # scans
_FREE = 0.2  # [m] past a place that a beam has to reach, for the place to be free
_SAMPLES = 8  # beams of a cluster that are looked at for evidence
_LEAST_FREE = 0.05  # [m] of a cluster that has to lie on ground that was free
_FORGOTTEN = 0.6  # [s]
_FORGOTTEN_IN_VIEW = 0.15  # [s] the same, where it would be seen
_STANDS = 1.0  # [s] without motion after which a target is a standing thing again
_SNAPSHOTS, _EVERY = 4, 4  # scans that are kept, and of so many one
_BINS = 512  # of a scan that is kept

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
        ("evidence", np.int64),  # scans that agree that it moves
        ("still", np.float64),  # [s] for which it has not moved
        ("unseen", np.float64),  # [s]
        ("moves", np.bool_),
        ("distance", np.float64),  # [m] from the LiDAR at the last sighting
        ("size", np.float64),  # [m] greatest radius that was seen
        ("first", np.int64),  # beam of the last sighting,
        ("end", np.int64),  # and the one behind the last
        ("turns", np.int64),  # times that it was seen to turn back
        ("turned", np.float64, (2, 2)),  # x and y [m] of the last two places where it did
    ]
)
SNAPSHOT = np.dtype(
    [
        ("x", np.float64),  # [m] of the LiDAR
        ("y", np.float64),  # [m]
        ("heading", np.float64),  # [rad]
        ("tick", np.int64),  # when it was taken; 0: none is kept
        ("turned", np.float64),  # [rad] until then
        ("ranges", np.float32, (_BINS,)),  # [m] least of each bin
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
    memory.turned += abs(turn)
    memory.tick += 1
    found = np.empty(_FOUND, _CLUSTER)
    clusters = find_clusters(memory, geometry, ranges, found)
    for moves in (True, False):
        for target in memory.targets:
            if target.age > 0 and target.moves == moves:
                _predict(target, period)
                _follow(memory, target, found, clusters, geometry, ranges, odometry, period)
                memory.count += target.age > 0 and target.moves
    _begin_all(memory.targets, found, clusters)
    if memory.tick % _EVERY == 1:
        _keep_snapshot(memory, ranges)
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
    noise = noise_of(ranges, geometry.range_max)
    edge = max(_EDGE, _CUT * math.sqrt(2.0) * noise)
    count, first, nearer = 0, 0, True  # the cluster that has not ended; whether what is right of it is nearer
    for beam in range(1, len(ranges)):
        step = ranges[beam] - ranges[beam - 1]
        if abs(step) <= edge:
            continue
        whole = first > 0 and beam - first >= _LEAST_BEAMS  # what the field of view cuts off may be a wall
        if whole and ranges[first] < _FARTHEST and (not nearer or step > 0.0):
            count += _is_cluster(memory, geometry, ranges, first, beam, edge, noise, found[count])
            if count == len(found):
                return count
        first, nearer = beam, step > 0.0
    return count


@kernel
def _is_cluster(
    memory: Record, geometry: Record, ranges: FloatArray, first: int, end: int, edge: float, noise: float, found: Record
) -> bool:
    """Write a cluster of the beams from `first` to before `end`; return False if it is too wide, or part of a wall.

    The variance of an end is of the range, of where between two beams the thing ends, and of its outline: near the car
    another part of the outline is outermost in each scan.
    """
    right, left = ranges[first], ranges[end - 1]
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
    change = _ACCELERATION * period
    target.p_place += period * (2.0 * target.p_mixed + period * target.p_speed)
    target.p_mixed += period * target.p_speed
    target.p_speed += change * change


@kernel
def _follow(
    memory: Record, target: Record, found: Record, count: int, geometry: Record, ranges: FloatArray, odometry: Record,
    period: float,
) -> None:  # fmt: skip
    """Take what was found nearest to a target for it."""
    nearest, least = -1, _GATE
    for k in range(count):
        if not found[k].taken:
            dx, dy, _ = _innovation(target, found[k])
            apart = math.hypot(dx, dy)
            if apart < least:
                nearest, least = k, apart
    if nearest < 0:
        target.unseen += period
        patience = _FORGOTTEN if target.moves else _FORGOTTEN_IN_VIEW
        if target.moves and _is_in_view(memory, target, geometry, ranges):
            patience = _FORGOTTEN_IN_VIEW
        if target.unseen > patience:
            target.age, target.moves = 0, False
        return
    cluster = found[nearest]
    cluster.taken = True
    dx, dy, ends = _innovation(target, cluster)
    noise = cluster.variance / max(ends, 1)
    if ends == 0:  # only edges of shadows: it is there, and its motion is not seen
        noise *= 100.0
    sum_of_both = target.p_place + noise
    change, turned = _change_of_speed(target, dx, dy, ends, sum_of_both)
    if turned:
        _turn_back(target, cluster, dx, dy)
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
    target.age += 1
    target.unseen = 0.0
    _judge(memory, target, geometry, ranges, odometry, period)


@kernel
def _turn_back(target: Record, cluster: Record, dx: float, dy: float) -> None:
    """Turn the velocity of a target round where it is seen now, which is dx, dy [m] from where it was expected."""
    target.vx, target.vy = -target.vx, -target.vy
    slot = target.turns % 2
    for axis in range(2):
        target.turned[slot, axis] = 0.5 * (cluster.ends[RIGHT, axis] + cluster.ends[LEFT, axis])
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
def _judge(
    memory: Record, target: Record, geometry: Record, ranges: FloatArray, odometry: Record, period: float
) -> None:
    """Decide whether a target moves."""
    square = target.vx * target.vx + target.vy * target.vy
    if target.moves:
        target.still = target.still + period if square < 0.25 * _LEAST_SPEED * _LEAST_SPEED else 0.0
        if target.still > _STANDS:
            target.moves, target.evidence = False, 0
        return
    certain = square > _CERTAIN * _CERTAIN * target.p_speed and square > _LEAST_SPEED * _LEAST_SPEED
    if target.age < _LEAST_AGE or not certain:
        target.evidence = 0
        return
    x, y = 0.5 * (target.ends[0, 0] + target.ends[1, 0]), 0.5 * (target.ends[0, 1] + target.ends[1, 1])
    turn = _DRIFT * abs(odometry.angular_velocity[2]) * math.hypot(x - memory.x, y - memory.y)
    most = _LEAST_SPEED + _DRIFT * abs(odometry.speed) + turn
    cos, sin = math.cos(memory.heading), math.sin(memory.heading)
    along, across = cos * target.vx + sin * target.vy, cos * target.vy - sin * target.vx
    if abs(along) < most and abs(across) < _LEAST_SPEED + turn:
        target.evidence = 0
        return
    if _has_moved(memory, target, geometry, ranges):
        target.evidence = min(target.evidence + 1, _MOST_EVIDENCE)
    else:
        target.evidence = max(target.evidence - 1, 0)
    target.moves = target.evidence >= _LEAST_EVIDENCE
    target.still = 0.0


@kernel
def _has_moved(memory: Record, target: Record, geometry: Record, ranges: FloatArray) -> bool:
    """Return whether a target covers ground that a kept scan saw free, or has left ground that it covered there.

    An error of the odometry's speed moves what stands along the car's way: of something ahead, towards the car or
    away, and not aside. So ground that it leaves or covers aside has to be wider by an error of the turn only.
    """
    stride = max((target.end - target.first) // _SAMPLES, 1)
    x, y = 0.5 * (target.ends[0, 0] + target.ends[1, 0]), 0.5 * (target.ends[0, 1] + target.ends[1, 1])
    distance = math.hypot(x - memory.x, y - memory.y)
    cos, sin = (x - memory.x) / distance, (y - memory.y) / distance
    x, y = x - target.radius * cos, y - target.radius * sin  # from its middle to its face
    for snapshot in memory.snapshots:
        if snapshot.tick == 0:
            continue
        dx, dy, turned = memory.x - snapshot.x, memory.y - snapshot.y, distance * (memory.turned - snapshot.turned)
        free = _FREE + _DRIFT * (abs(dx * cos + dy * sin) + turned)
        wide = _LEAST_FREE + _DRIFT * (abs(dx * sin - dy * cos) + turned)
        covered = 0
        for beam in range(target.first, target.end, stride):
            bearing = memory.heading + bearing_of(geometry, beam)
            at_x, at_y = memory.x + ranges[beam] * math.cos(bearing), memory.y + ranges[beam] * math.sin(bearing)
            covered += _beyond(snapshot, geometry, memory.beams, at_x, at_y) > free
        if covered * stride * geometry.angle_increment * distance > wide and covered > 1:
            return True
        since = (memory.tick - snapshot.tick) * period_of(geometry)
        old_x, old_y = x - target.vx * since, y - target.vy * since
        if abs(_beyond(snapshot, geometry, memory.beams, old_x, old_y)) < _FREE and (
            _beyond_now(memory, geometry, ranges, old_x, old_y) > free
        ):
            return True
    return False


@kernel
def _beyond(snapshot: Record, geometry: Record, beams: int, x: float, y: float) -> float:
    """Return by how much a kept scan reaches past a place [m]; -inf where it does not look."""
    cos, sin = math.cos(snapshot.heading), math.sin(snapshot.heading)
    dx, dy = x - snapshot.x, y - snapshot.y
    ahead, left = cos * dx + sin * dy, cos * dy - sin * dx
    beam = nearest_beam(geometry.angle_min, geometry.angle_increment, ahead, left)
    if not 0.0 <= beam < beams:
        return -math.inf
    reach = snapshot.ranges[int(beam) if beams <= _BINS else int(beam) * _BINS // beams]
    return float(reach - math.hypot(ahead, left))


@kernel
def _beyond_now(memory: Record, geometry: Record, ranges: FloatArray, x: float, y: float) -> float:
    """Return by how much the least of three beams reaches past a place now [m]; -inf where none looks."""
    cos, sin = math.cos(memory.heading), math.sin(memory.heading)
    dx, dy = x - memory.x, y - memory.y
    ahead, left = cos * dx + sin * dy, cos * dy - sin * dx
    beam = nearest_beam(geometry.angle_min, geometry.angle_increment, ahead, left)
    if not 1.0 <= beam < len(ranges) - 1.0:
        return -math.inf
    k = int(beam)
    return float(min(ranges[k - 1], ranges[k], ranges[k + 1]) - math.hypot(ahead, left))


@kernel
def _is_in_view(memory: Record, target: Record, geometry: Record, ranges: FloatArray) -> bool:
    """Return whether a target would be seen where it is expected: the beams there end beyond it."""
    x, y = 0.5 * (target.ends[0, 0] + target.ends[1, 0]), 0.5 * (target.ends[0, 1] + target.ends[1, 1])
    return bool(_beyond_now(memory, geometry, ranges, x, y) > _FREE)


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
            target.vx = target.vy = target.unseen = target.still = 0.0
            target.p_place, target.p_mixed = cluster.variance, 0.0
            target.p_speed = _FIRST_SPEED * _FIRST_SPEED
            target.misfits = target.evidence = target.turns = 0
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
def _keep_snapshot(memory: Record, ranges: FloatArray) -> None:
    """Keep a scan in place of the oldest one."""
    snapshot = memory.snapshots[(memory.tick // _EVERY) % _SNAPSHOTS]
    snapshot.x, snapshot.y, snapshot.heading, snapshot.tick = memory.x, memory.y, memory.heading, memory.tick
    snapshot.turned = memory.turned
    count = len(ranges)
    if count <= _BINS:
        for beam in range(count):
            snapshot.ranges[beam] = ranges[beam]
        return
    first = 0
    for index in range(_BINS):  # `beam * _BINS // count` is the bin of a beam
        end = ((index + 1) * count + _BINS - 1) // _BINS
        least = ranges[first]
        for beam in range(first + 1, end):
            least = min(least, ranges[beam])
        snapshot.ranges[index] = least
        first = end
