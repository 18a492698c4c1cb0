"""Lap raceline: a line of short lap time through the ground of the first lap.

    keep_lap(remembered, geometry, ranges, odometry, driver)           # in every tick
    proposal = propose_line(remembered, odometry, driver)              # whose `state` is AWAY, NEAR or ON

1. Shaping. The line begins as the path of the first lap. In each tick the room to both sides of its points is read off
   the recorded ends of beams, and the points are moved once within that room (line_optimizer).
2. Trial. On tires that need slip angles, the line is followed only if the car's own simulated lap holds (lap_trial).
   Else it is shaped again, farther from the walls, twice at most.
3. Joining. NEAR the line the car is led towards a point of it further on, with all the protections of the planner.
4. Following. ON the line the car steers along it (line_following). The limiter turns the wheels faster there, and
   braking takes nothing of the cornering. Known ground counts as free although it is not in sight, so neither the speed
   law of sight nor the safety filter applies.
5. Something new. Where a beam ends on the line, the car brakes to stop before it. Near to it, the planner drives again.
6. Something that moves. The planner drives until the car has driven two laps without seeing anything that moves.

Source of the rounds of the line's shaping: A. Heilmeier et al., Minimum curvature trajectory planning and control for
an autonomous race car, Vehicle System Dynamics 58(10), 2020.

Limits: what stands on the line behind a corner, and was not there in the first lap, is seen late: the car comes faster
than it could stop within what it sees. A line that is sharper somewhere than 1.08 times the curvature at full lock is
not followed at all.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

from ..control.actuation import apply_limits_of
from ..control.decision import extend_path_history
from ..control.planner_settings import Record
from ..control.reasons import REMEMBERED_LINE, log_step
from ..control.slip import lock_arc
from ..control.stages import Stage, Tick
from ..control.steering import arc_through, saturate
from ..control.tracking import X, Y, next_point
from ..perception.lap_map import BEAMS, LAP_MAP, TOO_FAR, ends_of, nearest_place, see_lap, walls_of
from ..perception.scan_geometry import bearing_of, nearest_beam, period_of, sees
from .lap_trial import FAILS, HOLDS, TRIAL, TRYING, try_lap
from .line_following import (
    LEAVES,
    OFF,
    curvature_at,
    describe_line,
    line_ahead,
    position_on,
    reference_on,
    speed_on,
    turn_in_use,
    turning_use,
    uses_on,
)
from .line_optimizer import STEPS, average, begin_step, improve, length_of, limited_grip, normals_of

if TYPE_CHECKING:
    from ..control.planner import Planner

POINTS = 2048  # of a line, at most
_SPACING = 0.25  # [m] of them; greater where they would be more than POINTS
_STEPS_A_TICK = 4  # of shaping: some 5 ms
_SMOOTHED = 6  # times that the path is smoothed before the first step
_MARGIN, _MORE_MARGIN = 0.16, 0.05  # [m] between the car's outline and walls, and as much more after a failed trial
_TRIALS = 3  # that a lap on the line may have
_BEHIND, _AHEAD = 3, 5  # places whose beams are read for the room at a point
_THROUGH = 0.6  # [m] by which the line may lead through a wall, before its points are moved
_CUSP = 1.6  # spacings from the point before to the one after, below which the line turns back at a point
_TOO_SHARP = 1.08  # share of the curvature at full lock: a line that is sharper somewhere is not followed
_NEAR = (1.5, 0.7)  # [m] to the side of the line and [rad] from it, within which the car is led to it
# within which the car begins to follow the line: [m] to its side, [rad] from it, and share of the cornering
# acceleration from its curvature
_JOINS = (OFF, 0.2, 0.3)
_REACH, _REACH_TIME = 0.8, 0.3  # [m] and [s] to the point of the line to which the car is led
_CLEAR = 0.05  # [m] to each side of the car, within which the end of a beam on the line is something new
_BEAMS_A_POINT = 24  # that are looked at for each point, at most
_STOPS_BEFORE = 1.0  # [m] between the rear axle and something new at which the car stands
_PLANNER_DRIVES = 5.0  # [m] after something new was within twice that
_STILL_LAPS = 2.0  # without anything that moves, after which the line is followed again

AWAY, NEAR, ON = range(3)
"""Where the car is: the planner drives, the car is led to the line, or it follows the line."""

LINE = np.dtype(
    [
        ("step", np.int64),  # of line_optimizer.STEPS
        ("weight", np.float64),  # of that step
        ("failed", np.int64),  # trials that failed
        ("ready", np.bool_),
        ("refused", np.bool_),  # it is too sharp, or there is none
        ("follows", np.bool_),  # the reference is that of the line
        ("next", np.int64),  # index of the point that is next
        ("until", np.float64),  # `driven` until which the planner drives
        ("count", np.int64),  # of points
        ("spacing", np.float64),  # [m]
        ("points", np.float32, (POINTS, 2)),  # [m] evenly apart, once the line is ready
        ("described", np.float32, (POINTS, 4)),  # heading [rad], curvature [1/m], RADIUS and DEMAND of line_following
        ("trial", TRIAL),  # of a lap on it, on soft tires
    ]
)
"""Type of a line, and of what is kept of it from tick to tick; zero at the beginning."""

REMEMBERED = np.dtype([("lap", LAP_MAP), ("line", LINE), ("moved", np.bool_), ("still", np.float64)])
"""Type of all that is remembered: of the first lap, whether anything has moved, and the way [m] since."""


class LineProposal(NamedTuple):
    """How to follow the line."""

    state: int  # AWAY: there is no proposal; NEAR or ON
    points: FloatArray  # (n, 4) of the line ahead, in the frame of the car, see control.tracking
    steering_angle: float  # [rad] for now
    speed: float  # [m/s] for now
    turn_in_use: float  # setting of the limiter with which to follow the line,
    lateral_use_in_braking: float  # and another one


@kernel
def keep_lap(remembered: Record, geometry: Record, ranges: FloatArray, odometry: Record, driver: Record) -> None:
    """Record the lap or find the car in it, and do a tick's part of the work on the line.

    Args:
      remembered: of type REMEMBERED, written to.
      geometry: of type SCAN_GEOMETRY.
      ranges: readings (n,) [m], without NaN or inf.
      odometry: of type ODOMETRY.
      driver: of type driving.DRIVER.
    """
    lap, line, limiter = remembered.lap, remembered.line, driver.limiter
    see_lap(lap, geometry, ranges, odometry, driver.car.lidar_offset)
    if not lap.closed:
        line.step, line.failed, line.ready, line.refused, line.follows, line.until = 0, 0, False, False, False, 0.0
        line.trial.begun, line.trial.state = False, TRYING
    elif not line.ready:
        walls = walls_of(lap, geometry, len(ranges), driver.car.lidar_offset)
        for _ in range(_STEPS_A_TICK):
            if not line.ready:
                shape_line(line, lap, walls, limiter, driver.max_speed)
    elif limiter.slip.needs_slip_angle and line.trial.state == TRYING and not line.refused:
        walls = ends_of(lap, geometry, len(ranges), driver.car.lidar_offset)
        state = try_lap(line, lap, walls, limiter, driver.max_speed, period_of(geometry))
        if state == FAILS and line.failed < _TRIALS - 1:  # once more, farther from the walls
            line.failed += 1
            line.step, line.ready, line.trial.begun, line.trial.state = 0, False, False, TRYING


@kernel
def shape_line(line: Record, lap: Record, walls: FloatArray, limiter: Record, max_speed: float) -> None:
    """Move the points of the line once.

    Args:
      line: of type LINE, written to.
      lap: of type LAP_MAP, closed.
      walls: see `lap_map.walls_of`.
      limiter: of type LIMITER.
      max_speed: [m/s].
    """
    if line.step == 0:
        places = lap.places[: lap.count, :2].astype(np.float64)
        for _ in range(_SMOOTHED):
            average(places[:, 0])
            average(places[:, 1])
    else:
        places = line.points[: line.count].astype(np.float64)
    points, most = begin_step(places, line.step, max(_SPACING, length_of(places) / POINTS))
    normals = normals_of(points)
    low, high = np.full(len(points), -most), np.full(len(points), most)
    margin = _MARGIN + _MORE_MARGIN * line.failed
    _read_room(lap, walls, points, normals, limiter.car, margin, low, high)
    cornering, braking = uses_on(limiter)
    grip = limited_grip(limiter, max_speed, (cornering, braking, 1.0), turning_use(limiter))
    line.step, line.weight = improve(points, normals, (low, high), line.step, line.weight, grip)
    line.count = len(points)
    line.points[: line.count] = points
    if line.step >= STEPS:
        _finish(line, limiter)


@kernel
def _read_room(
    lap: Record, walls: FloatArray, points: FloatArray, normals: FloatArray, car: Record, margin: float,
    low: FloatArray, high: FloatArray,
) -> None:  # fmt: skip
    """Lower the room of each point to where the walls leave the car's rectangle and a margin [m]."""
    half, at = 0.5 * car.width + margin, 0
    tail, nose = -car.rear_overhang - margin, car.length - car.rear_overhang + margin
    for k in range(len(points)):
        x, y, normal_x, normal_y = points[k, 0], points[k, 1], normals[k, 0], normals[k, 1]
        at, _ = nearest_place(lap, at, x, y, math.nan)
        for more in range(-_BEHIND, _AHEAD + 1):
            ends = walls[(at + more) % lap.count]
            for beam in range(BEAMS):
                dx, dy, side = ends[beam, 0] - x, ends[beam, 1] - y, ends[beam, 2]
                if tail < normal_y * dx - normal_x * dy < nose:  # nor is NaN
                    to_left = normal_x * dx + normal_y * dy
                    if side > 0.0 and to_left > -_THROUGH:
                        high[k] = min(high[k], to_left - half)
                    elif side < 0.0 and to_left < _THROUGH:
                        low[k] = max(low[k], to_left + half)


@kernel
def _finish(line: Record, limiter: Record) -> None:
    """Take the line as ready, and refuse one on which the car turned in moves, or that is too sharp for it."""
    count = line.count
    points, length = line.points[:count].astype(np.float64), 0.0
    for k in range(count):
        length += math.hypot(points[k, 0] - points[k - 1, 0], points[k, 1] - points[k - 1, 1])
    line.spacing, line.ready, line.next = length / count, True, 0
    describe_line(line, limiter)
    if math.isnan(line.weight):
        line.refused = True
    tightest = _TOO_SHARP * math.tan(lock_arc(limiter.slip, limiter.car)) / limiter.car.wheelbase
    for k in range(count):
        before, after = points[k - 1], points[k + 1 if k + 1 < count else 0]
        cusp = math.hypot(after[0] - before[0], after[1] - before[1]) < _CUSP * line.spacing
        if cusp or abs(line.described[k, 1]) > tightest:
            line.refused = True


@kernel
def propose_line(remembered: Record, odometry: Record, limiter: Record) -> LineProposal:
    """Return how to follow the line from here, or to come to it; AWAY: the car is not near it, or may not follow it.

    Args:
      remembered: of type REMEMBERED, written to.
      odometry: of type ODOMETRY.
      limiter: of type LIMITER.
    """
    lap, line, now, car = remembered.lap, remembered.line, odometry.speed, limiter.car
    follows, line.follows = line.follows, False
    none = LineProposal(AWAY, np.empty((0, 4)), 0.0, 0.0, 0.0, 0.0)
    if not (lap.closed and line.ready) or line.refused or lap.driven < line.until:
        return none
    if remembered.moved and remembered.still < _STILL_LAPS * line.count * line.spacing:
        return none
    if (limiter.slip.needs_slip_angle and line.trial.state != HOLDS) or not math.isfinite(now):
        return none
    if not follows:
        line.next = _nearest(line.points[: line.count], lap.x, lap.y)
    window, spacing = line_ahead(line, line.next, lap.x, lap.y, lap.heading), line.spacing
    point = next_point(window, 1, 0.0, 0.0, 0.0)
    line.next = (line.next + point - 1) % line.count
    along, aside, turned = position_on(window, point, spacing)
    if abs(aside) > _NEAR[0] or abs(turned) > _NEAR[1]:
        return none
    if not follows:
        held = limiter.lateral / max(now * now, 0.5)
        off = abs(math.tan(odometry.steering_angle) / car.wheelbase - curvature_at(window, along))
        near = abs(aside) < _JOINS[0] and abs(turned) < _JOINS[1] and off < _JOINS[2] * held
        line.follows = near and now < speed_on(window, along, spacing, limiter, now)
    else:
        line.follows = abs(aside) <= LEAVES
    steering, speed, most = reference_on(window, along, aside, turned, spacing, limiter, now, line.follows)
    points = window[point:, :4].copy()
    if not line.follows:  # towards a point further on: to lead the car there needs no sharp turns
        target = points[_target(len(points), spacing, now)]
        steering = saturate(arc_through(target[X], target[Y], car.wheelbase), most)
    in_braking = limiter.settings.lateral_use_in_braking if limiter.slip.needs_slip_angle else 1.0
    return LineProposal(ON if line.follows else NEAR, points, steering, speed, turn_in_use(limiter), float(in_braking))


@kernel
def _target(count: int, spacing: float, now: float) -> int:
    """Return to which of the points ahead the car is led."""
    return min(int((_REACH + _REACH_TIME * max(now, 0.0)) / spacing), count - 1)


@kernel
def _nearest(points: FloatArray, x: float, y: float) -> int:
    """Return the index of the point that is nearest to a place [m]."""
    best, least = 0, math.inf
    for k in range(len(points)):
        dx, dy = points[k, X] - x, points[k, Y] - y
        if dx * dx + dy * dy < least:
            best, least = k, dx * dx + dy * dy
    return best


@kernel
def speed_held_back(
    remembered: Record, proposal: LineProposal, geometry: Record, ranges: FloatArray, now: float, limiter: Record
) -> float:
    """Return the speed from which the car stops before something new on the line [m/s]; NaN: the planner is to drive.

    Args:
      remembered: of type REMEMBERED, written to.
      proposal: NEAR or ON.
      geometry: of type SCAN_GEOMETRY.
      ranges: readings (n,) [m], without NaN or inf.
      now: present speed [m/s].
      limiter: of type LIMITER.
    """
    line, points, car = remembered.line, proposal.points, limiter.car
    free = free_on(points, line.spacing, geometry, ranges, car) if sees(geometry, ranges) else -math.inf
    if free < 2.0 * _STOPS_BEFORE:
        line.follows, line.until = False, remembered.lap.driven + (_PLANNER_DRIVES if free >= 0.0 else 0.0)
        return math.nan
    if proposal.state == NEAR:
        target = points[_target(len(points), line.spacing, now)]
        if not _sees_way(target[X], target[Y], geometry, ranges, car):  # a wall between, as on the inside of a hairpin
            return math.nan
    return math.sqrt(2.0 * uses_on(limiter)[1] * limiter.braking * (free - _STOPS_BEFORE))


@kernel
def free_on(points: FloatArray, spacing: float, geometry: Record, ranges: FloatArray, car: Record) -> float:
    """Return how far ahead the first beam ends on the line [m], where no wall was; inf: none does.

    The line is that of `points` (n, 4), in the frame of the car; the other arguments are as of `speed_held_back`.
    """
    reach = 0.5 * car.width + _CLEAR
    for k in range(len(points)):
        ahead, left = points[k, X] - car.lidar_offset, points[k, Y]
        distance = math.hypot(ahead, left)
        if ahead < 2.0 * reach or distance > TOO_FAR:
            continue
        middle = nearest_beam(geometry.angle_min, geometry.angle_increment, ahead, left)
        half = reach / (distance * geometry.angle_increment)
        step = max(2.0 * half / _BEAMS_A_POINT, 1.0)
        beam = max(middle - half, 0.0)
        while beam <= min(middle + half, len(ranges) - 1.0):
            off = ranges[int(beam)] - distance
            across = distance * geometry.angle_increment * (int(beam) - middle)
            if off * off + across * across < reach * reach:
                return k * spacing
            beam += step
    return math.inf


@kernel
def _sees_way(ahead: float, left: float, geometry: Record, ranges: FloatArray, car: Record) -> bool:
    """Return whether no beam ends where the car's width leads straight from the rear axle to a place [m]."""
    distance, reach = math.hypot(ahead, left), 0.5 * car.width + _CLEAR
    for beam in range(len(ranges)):
        bearing = bearing_of(geometry, beam)
        x, y = car.lidar_offset + ranges[beam] * math.cos(bearing), ranges[beam] * math.sin(bearing)
        if 0.0 < x * ahead + y * left < distance * distance and abs(x * left - y * ahead) < reach * distance:
            return False
    return True


@kernel
def _remember(tick: Tick) -> None:
    """Keep the lap, and decide while the car is on its line."""
    state, odometry, limiter, predictions = tick.state, tick.odometry, tick.driver.limiter, tick.memory.predictions
    if math.isfinite(odometry.speed):
        state.still += abs(odometry.speed) * period_of(tick.geometry)
    if predictions.count > 0:
        state.moved, state.still = True, 0.0
    keep_lap(state, tick.geometry, tick.ranges_without_cars, odometry, tick.driver)
    if tick.record.decided or (tick.memory.guidance.follows and not state.line.follows):
        return
    proposal = propose_line(state, odometry, limiter)
    if proposal.state != AWAY:
        free = speed_held_back(state, proposal, tick.geometry, tick.ranges, odometry.speed, limiter)
        if not math.isnan(free):
            _follow(tick, proposal, free)


@kernel
def _follow(tick: Tick, proposal: LineProposal, free: float) -> None:
    """Write the reference that follows a proposal, no faster than `free` [m/s]; and the command, ON the line."""
    reference, limiter, ahead = tick.reference, tick.driver.limiter, proposal.points[0]
    speed = min(proposal.speed, free)
    reference.steering_angle = proposal.steering_angle
    reference.speed = speed if proposal.state == ON else min(reference.speed, speed)
    reference.bearing, reference.distance = math.atan2(ahead[Y], ahead[X]), math.hypot(ahead[X], ahead[Y])
    log_step(tick.memory.reasons, REMEMBERED_LINE, reference.steering_angle, reference.speed)
    if proposal.state == ON:
        extend_path_history(tick.record)
        settings = limiter.settings
        own = settings.turn_in_use, settings.lateral_use_in_braking
        settings.turn_in_use, settings.lateral_use_in_braking = proposal.turn_in_use, proposal.lateral_use_in_braking
        speed = min(speed, reference.limit, tick.driver.max_speed)
        limited = apply_limits_of(limiter, tick.record, reference.steering_angle, speed, 1.0, 0.0)
        settings.turn_in_use, settings.lateral_use_in_braking = own
        tick.command[0], tick.command[1] = limited
        tick.record.decided = True


REMEMBER = Stage(
    text="from the second lap on the car follows a line through the ground of the first", needs=("guidance",),
    needs_friction=True, after_guidance=_remember, state_type=REMEMBERED,
)  # fmt: skip
"""The stage `remember`: from the second lap on the car follows a line through the ground of the first."""


def line_of(planner: Planner) -> FloatArray:
    """Return the closed line of a planner that remembers, in the frame in which its first lap began.

    Shape (n, 2) [m]; no points while there is no line.
    """
    line = planner.stage_state("remember")["line"]
    return np.array(line["points"][: line["count"] if line["ready"] else 0], dtype=float)
