"""Lap raceline: a line of short lap time through the ground of the first lap.

    keep_lap(remembered, geometry, ranges, odometry, driver)           # in every tick
    proposal = propose_line(remembered, odometry, limiter, 0.0)        # whose `state` is AWAY, NEAR or ON

1. Shaping. The line begins as the path of the first lap. In each tick the room to both sides of its points is read off
   the recorded ends of beams, and the points are moved once within that room (line_optimizer).
2. Trial. On tires that need slip angles, the line is followed only if the car's own simulated lap holds (lap_trial).
   Else it is shaped again, farther from the walls, twice at most.
3. Joining. NEAR the line the car is led towards a point of it further on, with all the protections of the planner.
4. Following. ON the line the car steers along it (line_following), if the judge's simulation finds it free: either the
   car could stop on it, or it could drive on, without coming near the end of a beam. What the scan hides counts as
   free, as the first lap has been there. Where a wall is nearer than the first lap saw it, .1 m beside the line is
   tried, then braking on it. The limiter turns the wheels faster there, and braking takes nothing of the cornering.
5. Something new. The car brakes on the line; from 2 m/s on the planner drives, for 5 m. If nothing on the line is free,
   the judge may take any other proposal that is; if none is, the slowest contact on the line.
6. Something that moves. The planner drives until the car has driven two laps without seeing anything that moves: it may
   be behind any corner.

Source of the rounds of the line's shaping: A. Heilmeier et al., Minimum curvature trajectory planning and control for
an autonomous race car, Vehicle System Dynamics 58(10), 2020.

Limits: what stands on the line behind a corner, and was not there in the first lap, is seen late: the car comes faster
than it could stop within what it sees. A line that is sharper somewhere than 1.08 times the curvature at full lock is
not followed at all: the next lap is recorded, and gives another.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

from ..control.decision import drive_line, look_round
from ..control.planner_settings import Record
from ..control.reasons import ON_LINE, REMEMBERED_LINE, log_step
from ..control.slip import lock_arc
from ..control.stages import Stage, Tick
from ..control.steering import arc_through, saturate
from ..control.tracking import HEADING, SPEED, X, Y, next_point
from ..perception.lap_map import BEAMS, LAP_MAP, ends_of, forget_lap, nearest_place, see_lap, walls_of
from ..perception.scan_geometry import period_of
from .judge import consider
from .lap_trial import FAILS, HOLDS, TRIAL, TRYING, try_lap
from .line_following import (
    LEAVES,
    OFF,
    curvature_at,
    describe_line,
    line_ahead,
    on_line,
    position_on,
    reference_on,
    speed_on,
    turning_use,
    uses_on,
)
from .line_optimizer import STEPS, average, begin_step, improve, length_of, limited_grip, normals_of
from .rollout import Plan, reading_towards

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
_USES = np.array([1.0, 0.75, 0.5])  # shares of the grip for cornering
_BESIDE = (0.0, 0.1, -0.1)  # [m] to the left of the line, where the car drives if a wall is nearer than was seen
_PLANNER_SPEED = 2.0  # [m/s] from which on the planner drives past something new
_STILL_LAPS = 2.0  # without anything that moves, after which the line is followed again
_PLANNER_DRIVES = 5.0  # [m] after something new was within twice that

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
    points: FloatArray  # (n, 5) of the line ahead, in the frame of the car, see control.tracking
    steering_angle: float  # [rad] for now
    speed: float  # [m/s] for now


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
    if line.refused:  # the car stood or turned in moves on that lap: the next one may give a line
        forget_lap(lap)
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
def propose_line(remembered: Record, odometry: Record, limiter: Record, shift: float) -> LineProposal:
    """Return how to follow the line from here, or to come to it; AWAY: the car is not near it, or may not follow it.

    Args:
      remembered: of type REMEMBERED, written to.
      odometry: of type ODOMETRY.
      limiter: of type LIMITER.
      shift: how far to the left of the line the car is to be [m].
    """
    lap, line, now, car = remembered.lap, remembered.line, odometry.speed, limiter.car
    follows, line.follows = line.follows, False
    none = LineProposal(AWAY, np.empty((0, 4)), 0.0, 0.0)
    if not (lap.closed and line.ready) or line.refused or lap.driven < line.until:
        return none
    if remembered.moved and remembered.still < _STILL_LAPS * line.count * line.spacing:
        return none
    if (limiter.slip.needs_slip_angle and line.trial.state != HOLDS) or not math.isfinite(now):
        return none
    if not follows:
        line.next = _nearest(line.points[: line.count], lap.x, lap.y)
    window, spacing = line_ahead(line, line.next, lap.x, lap.y, lap.heading, limiter), line.spacing
    point = next_point(window, 1, 0.0, 0.0, 0.0)
    line.next = (line.next + point - 1) % line.count
    along, aside, turned = position_on(window, point, spacing)
    if abs(aside) > _NEAR[0] or abs(turned) > _NEAR[1]:
        return none
    if not follows:
        held = limiter.lateral / max(now * now, 0.5)
        off = abs(math.tan(odometry.steering_angle) / car.wheelbase - curvature_at(window, along))
        near = abs(aside) < _JOINS[0] and abs(turned) < _JOINS[1] and off < _JOINS[2] * held
        line.follows = near and now < speed_on(window, along, spacing, now)
    else:
        line.follows = abs(aside) <= LEAVES
    steering, speed, most = reference_on(window, along, aside - shift, turned, spacing, limiter, now, line.follows)
    points = window[point:, : SPEED + 1].copy()
    points[:, X], points[:, Y] = (
        points[:, X] - shift * np.sin(points[:, HEADING]), points[:, Y] + shift * np.cos(points[:, HEADING])
    )  # fmt: skip
    if not line.follows:  # towards a point further on: to lead the car there needs no sharp turns
        target = points[_target(len(points), spacing, now)]
        steering = saturate(arc_through(target[X], target[Y], car.wheelbase), most)
    return LineProposal(ON if line.follows else NEAR, points, steering, speed)


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
def _remember(tick: Tick) -> None:
    """Keep the lap, and decide while the car is on its line."""
    state, odometry, limiter = tick.state, tick.odometry, tick.driver.limiter
    if math.isfinite(odometry.speed):
        state.still += abs(odometry.speed) * period_of(tick.geometry)
    if tick.memory.predictions.count > 0:
        state.moved, state.still = True, 0.0
    keep_lap(state, tick.geometry, tick.ranges_without_cars, odometry, tick.driver)
    if tick.record.decided or (tick.memory.guidance.follows and not state.line.follows):
        return
    if state.line.follows and tick.memory.judge.best.why != ON_LINE:  # the judge took another proposal
        state.line.follows, state.line.until = False, state.lap.driven + _PLANNER_DRIVES
    proposal = propose_line(state, odometry, limiter, 0.0)
    if proposal.state == ON:
        _follow(tick, proposal)
    elif proposal.state == NEAR:
        _come_to_it(tick, proposal)


@kernel
def _come_to_it(tick: Tick, proposal: LineProposal) -> None:
    """Lead the reference to the line, unless a wall is between, as on the inside of a hairpin."""
    reference, here = tick.reference, look_round(tick, True)
    points, car = proposal.points, tick.driver.car
    target = points[_target(len(points), tick.state.line.spacing, here.speed)]
    ahead, left = target[X] - car.lidar_offset, target[Y]
    if reading_towards(here, ahead, left) > math.hypot(ahead, left):
        reference.steering_angle, reference.speed = proposal.steering_angle, min(reference.speed, proposal.speed)
        reference.bearing, reference.distance = math.atan2(left, ahead), math.hypot(ahead, left)
        log_step(tick.memory.reasons, REMEMBERED_LINE, reference.steering_angle, reference.speed)


@kernel
def _follow(tick: Tick, proposal: LineProposal) -> None:
    """Drive the line, or beside it, or brake on it, if the judge finds one of these free; else it may choose others."""
    limiter, here, best, free = tick.driver.limiter, look_round(tick, True), tick.memory.judge.line, False
    settings, proposals = limiter.settings, tick.memory.judge.proposals
    own = settings.turn_in_use, settings.lateral_use_in_braking
    settings.turn_in_use, settings.lateral_use_in_braking = on_line(limiter)
    log_step(tick.memory.reasons, REMEMBERED_LINE, proposal.steering_angle, proposal.speed)
    for shift in _BESIDE:
        if not free:
            beside = proposal if shift == 0.0 else propose_line(tick.state, tick.odometry, limiter, shift)
            angle, speed = beside.steering_angle, min(beside.speed, tick.reference.limit, tick.driver.max_speed)
            stop, on = _braking(beside, speed), Plan(0.0, 0.0, beside.points, speed, 0.0)
            free = consider(here, ON_LINE, angle, stop, _USES, proposals, best)
            free = free or consider(here, ON_LINE, angle, on, _USES[:1], proposals, best)
    if not free:
        free = consider(here, ON_LINE, proposal.steering_angle, _braking(proposal, 0.0), _USES, proposals, best)
        free = free and here.speed > _PLANNER_SPEED
        if not free:
            best.steering_angle, best.speed, best.use = proposal.steering_angle, 0.0, 1.0
    settings.turn_in_use, settings.lateral_use_in_braking = own
    if free:
        tick.memory.judge.best.why, tick.record.decided = ON_LINE, True
        drive_line(tick, best)


@kernel
def _braking(proposal: LineProposal, speed: float) -> Plan:
    """Return the plan to brake on the line after a tick at a speed [m/s]."""
    return Plan(0.0, 0.0, proposal.points[:, :SPEED].copy(), speed, 0.0)


REMEMBER = Stage(
    text="from the second lap on the car follows a line through the ground of the first",
    needs=("guidance", "safety_filter"), needs_friction=True, after_guidance=_remember, state_type=REMEMBERED,
)  # fmt: skip
"""The stage `remember`: from the second lap on the car follows a line through the ground of the first."""


def line_of(planner: Planner) -> FloatArray:
    """Return the closed line of a planner that remembers, in the frame in which its first lap began.

    Shape (n, 2) [m]; no points while there is no line.
    """
    line = planner.stage_state("remember")["line"]
    return np.array(line["points"][: line["count"] if line["ready"] else 0], dtype=float)
