"""A car on a line: what lies ahead, where the car is there, how it is steered, and how fast it may go.

    window = line_ahead(line, first, x, y, heading, limiter)
    position, aside, turned = position_on(window, point, line.spacing)
    steering_angle, speed, _ = reference_on(window, position, aside, turned, line.spacing, limiter, now, True)

The car steers along the line as in control.tracking. Its place on the line and the curvature there are read between
the points: steps of the steering angle would take from braking. Its speed is the greatest from which the tires hold the
car through what comes: cornering, turning the wheels, and braking before with what cornering leaves.
"""

from __future__ import annotations

import math

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

from ..control.planner_settings import Record
from ..control.slip import lock_arc
from ..control.steering import late_by, saturate
from ..control.tracking import CURVATURE, HEADING, LAG, SPEED, X, Y
from .friction_limiter import longitudinal_share, stable_share
from .line_optimizer import average

# columns of a window after those of control.tracking: the greatest speed squared over `lateral` [m], and the
# acceleration that the tires hold while the car brakes, over the speed squared [1/m]
RADIUS, DEMAND = 5, 6
OFF = 0.1  # [m] to the side of the line, from which on the car corners less than it could
LEAVES = 0.6  # [m] to the side of the line, beyond which the car no longer follows it

_POINTS = 64  # that the car looks ahead
# shares of the limiter's cornering acceleration and of its braking; of tires that need slip angles, and so answer late
_USES, _USES_WHEN_LATE = (0.93, 0.85), (0.9, 0.7)
_CORRECTION_USE = 0.9  # share of the limiter's cornering acceleration for coming back to the line
_TURNS_FASTER = 1.35  # times the share of the grip for turning the wheels, on the line
_TURNING_USE = 0.58  # share of the limiter's steering rate; in the mean of a tick the servo turns with .59 of it
_NEAR_LOCK = 0.8  # share of the curvature at full lock from which on the car is slower, as it hardly can correct
_SLOWER = 0.5  # share by which the squared speed is less at full lock
_LOOKAHEAD = 0.1  # [s] for which the speed is read ahead
_LENGTH, _LENGTH_TIME = 0.35, 0.15  # [m] and [s]: over which the distance from the line falls
_ON_IT = 0.06  # [m] to the side of the line from which on the car is slower,
_SLOWER_OFF = 1.5  # [1/m] by this share for each metre


@kernel
def uses_on(limiter: Record) -> tuple[float, float]:
    """Return the shares of a limiter's cornering acceleration and of its braking that speed on the line counts on."""
    return _USES_WHEN_LATE if limiter.slip.needs_slip_angle else _USES


@kernel
def turn_in_use(limiter: Record) -> float:
    """Return the share of what cornering leaves for turning the wheels, of a car on the line: it turns them faster."""
    own = limiter.settings.turn_in_use
    return float(own if limiter.slip.needs_slip_angle else min(_TURNS_FASTER * own, 1.0))


@kernel
def on_line(limiter: Record) -> tuple[float, float]:
    """Return the limiter's settings turn_in_use and lateral_use_in_braking for a car on the line."""
    in_braking = limiter.settings.lateral_use_in_braking if limiter.slip.needs_slip_angle else 1.0
    return turn_in_use(limiter), float(in_braking)


@kernel
def turning_use(limiter: Record) -> float:
    """Return the share of what cornering leaves with which the wheels of a car on the line turn in the mean."""
    return _TURNING_USE * turn_in_use(limiter)


@kernel
def describe_line(line: Record, limiter: Record) -> None:
    """Write heading, curvature, RADIUS and DEMAND of each point of a closed line, of type lap_raceline.LINE."""
    points, n, spacing, described = line.points, line.count, line.spacing, line.described
    bends, share, lateral_use = np.empty(n), turning_use(limiter), uses_on(limiter)[0]
    for k in range(n):
        before, here, after = points[k - 1 if k > 0 else n - 1], points[k], points[k + 1 if k + 1 < n else 0]
        to_x, to_y, on_x, on_y = here[0] - before[0], here[1] - before[1], after[0] - here[0], after[1] - here[1]
        dx, dy = float(to_x + on_x), float(to_y + on_y)
        bends[k] = (to_x * on_y - to_y * on_x) / (spacing * spacing * 0.5 * max(math.hypot(dx, dy), 1e-9))
        described[k, 0] = math.atan2(dy, dx)
    average(bends)
    tightest = math.tan(lock_arc(limiter.slip, limiter.car)) / limiter.car.wheelbase
    rear_lag = limiter.car.yaw_inertia / (limiter.car.mass * limiter.car.front_axle_distance)
    for k in range(n):
        bend = bends[k]
        change = (bends[k + 1 if k + 1 < n else 0] - bends[k - 1 if k > 0 else n - 1]) / (2.0 * spacing)
        described[k, 1] = bend
        inwards, bend, change = bend * change > 0.0, abs(bend), abs(change)
        most = max(bend / lateral_use, limiter.yaw_lag * change / (share * limiter.settings.most_left))
        if inwards:  # the limiter turns the wheels in with a share of what cornering leaves
            most = max(most, limiter.yaw_lag * change / share + bend)
        near_lock = min(max((bend / tightest - _NEAR_LOCK) / (1.0 - _NEAR_LOCK), 0.0), 1.0)
        described[k, 2] = (1.0 - _SLOWER * near_lock) / max(most, 1e-3)
        described[k, 3] = bend + (limiter.yaw_lag if inwards else 2.0 * rear_lag) * change


@kernel
def line_ahead(line: Record, first: int, x: float, y: float, heading: float, limiter: Record) -> FloatArray:
    """Return the points of a closed line from the one before `first` on, in the frame of a car. Shape (64, 7).

    Columns: x and y [m], heading [rad], curvature [1/m], the greatest speed from which the tires hold the car through
    all that comes [m/s], RADIUS and DEMAND.

    Args:
      line: of type lap_raceline.LINE, see `describe_line`.
      first: index of the point.
      x: of the rear axle [m], in the frame of the points.
      y: of the rear axle [m].
      heading: of the car [rad].
      limiter: of type LIMITER.
    """
    window, cos, sin = np.empty((_POINTS, 7)), math.cos(heading), math.sin(heading)
    for k in range(_POINTS):
        row, at = window[k], (first - 1 + k) % line.count
        dx, dy = line.points[at, 0] - x, line.points[at, 1] - y
        row[X], row[Y] = cos * dx + sin * dy, cos * dy - sin * dx
        turn = line.described[at, 0] - heading
        row[HEADING] = turn - 2.0 * math.pi * round(turn / (2.0 * math.pi))
        row[CURVATURE] = line.described[at, 1]
        row[RADIUS], row[DEMAND] = line.described[at, 2], line.described[at, 3]
    write_speeds(window, line.spacing, limiter)
    return window


@kernel
def write_speeds(window: FloatArray, spacing: float, limiter: Record) -> None:
    """Write the greatest speed at each point of a window (n, 7), whose points are `spacing` apart [m]."""
    grip, braking = limiter.mu * limiter.car.gravity, uses_on(limiter)[1] * limiter.braking
    square, demand = math.inf, 0.0
    for k in range(len(window) - 1, -1, -1):
        corner = limiter.lateral * window[k, RADIUS]
        if square < corner:
            used = square * demand / grip
            share = longitudinal_share(limiter, used, True)
            if limiter.slip.needs_slip_angle:
                share = stable_share(limiter, share, used, math.sqrt(square))
            square += 2.0 * braking * share * spacing
        square = min(square, corner)
        window[k, SPEED], demand = math.sqrt(square), window[k, DEMAND]


@kernel
def position_on(window: FloatArray, point: int, spacing: float) -> tuple[float, float, float]:
    """Return the position of the car between two points of a window: their arc leads from one to the other.

    That is the position along the line in points, how far to the left of the line the car is [m], and its angle to the
    line [rad], positive to the left.

    Args:
      window: of a line in the frame of the car (n, 4 or more).
      point: index of the one ahead of the car, from 1.
      spacing: of the points [m].
    """
    before, after = window[point - 1], window[point]
    left = math.cos(after[HEADING]) * after[X] + math.sin(after[HEADING]) * after[Y]
    share = min(max(1.0 - left / spacing, 0.0), 1.0)
    turn = after[HEADING] - before[HEADING]
    turn -= 2.0 * math.pi * round(turn / (2.0 * math.pi))
    direction = before[HEADING] + share * turn
    dx, dy = before[X] + share * (after[X] - before[X]), before[Y] + share * (after[Y] - before[Y])
    aside = math.sin(direction) * dx - math.cos(direction) * dy
    aside += 0.5 * share * (1.0 - share) * spacing * turn  # from the chord to the arc
    return point - 1 + share, aside, 2.0 * math.pi * round(direction / (2.0 * math.pi)) - direction


@kernel
def curvature_at(window: FloatArray, position: float) -> float:
    """Return the curvature [1/m] of a line at a position between its points; at the last one, if it is beyond."""
    at = int(position)
    if at + 1 >= len(window):
        return float(window[len(window) - 1, CURVATURE])
    share = position - at
    return float((1.0 - share) * window[at, CURVATURE] + share * window[at + 1, CURVATURE])


@kernel
def speed_on(window: FloatArray, position: float, spacing: float, now: float) -> float:
    """Return the greatest speed [m/s] at a position in points, and as far ahead as the car answers late.

    Args:
      window: of a line (n, 7).
      position: of the car, in points.
      spacing: of the points [m].
      now: present speed [m/s].
    """
    best = math.inf
    for each in (position, position + _LOOKAHEAD * max(now, 0.0) / spacing):
        at = min(int(each), len(window) - 2)
        share = min(each - at, 1.0)
        best = min(best, (1.0 - share) * window[at, SPEED] ** 2 + share * window[at + 1, SPEED] ** 2)
    return math.sqrt(best)


@kernel
def reference_on(
    window: FloatArray, position: float, aside: float, turned: float, spacing: float, limiter: Record, now: float,
    follows: bool,
) -> tuple[float, float, float]:  # fmt: skip
    """Return steering angle [rad] and speed [m/s] for a car on a line, and the greatest steering angle there [rad].

    Args:
      window: of a line (n, 7).
      position: of the car, in points.
      aside: how far to the left of the line it is [m].
      turned: its angle to the line [rad].
      spacing: of the points [m].
      limiter: of type LIMITER.
      now: present speed [m/s].
      follows: whether it follows the line; else it comes to the line by another steering angle.
    """
    car, speed = limiter.car, speed_on(window, position, spacing, now)
    length = _LENGTH + _LENGTH_TIME * max(now, 0.0)
    ahead = curvature_at(window, position + (LAG + late_by(car)) * max(now, 0.0) / spacing)
    steering = math.atan(car.wheelbase * (ahead - aside / (length * length) - 2.0 * math.sin(turned) / length))
    wanted = abs(math.tan(steering)) / car.wheelbase
    if follows and abs(aside) > OFF:
        speed = min(speed, math.sqrt(_CORRECTION_USE * limiter.lateral / max(wanted, 1e-3)))
    speed *= 1.0 - _SLOWER_OFF * min(max(abs(aside) - _ON_IT, 0.0), LEAVES)
    most = max(abs(curvature_at(window, position)), _CORRECTION_USE * (limiter.lateral / max(now * now, 0.5)))
    most = math.atan(car.wheelbase * most)
    return saturate(steering, most), speed, most
