"""Trackers: the steering angle that keeps a car on a line through the map, by its error now and the curvature ahead.

`stanley`: the angle to the line at the front axle, and the arc tangent of a gain times the distance there over the
speed. `lqr`: the curvature of the line as far ahead as the steering takes, and a feedback of distance e and angle a, e'
= a, a' = u along the way. The one that is least for the integral of e^2 / L^4 + u^2 is u = -e / L^2 - sqrt(2) a / L; L
grows with the speed and with how late the car answers. `map`: the arc through a goal on the line at the distance L asks
for a lateral acceleration 2 v^2 sin(n) / L, n from the velocity of the rear axle to the goal. The steering angle for it
is that of the steady curves of the car on its tires (slip.steered), whose course differs from the heading by the rear
slip angle. Where tires need no slip angles, this is pure pursuit that joins the line as the other trackers do.
Sources: G. Hoffmann et al., Autonomous Automobile Trajectory Tracking for Off-Road Driving, ACC 2007, for Stanley; B.
Anderson and J. Moore, Optimal Control: Linear Quadratic Methods, 1990, for the regulator of the double integrator; J.
Becker et al., Model- and Acceleration-based Pursuit Controller for High-Performance Autonomous Racing, ICRA 2023, for
`map`. There the angle is that from the heading, and the look-up is simulated.
Limits: `stanley` and `lqr` are kinematic. What tires need is added afterwards (slip.steered), and their angle to the
line is the heading's.
"""

from __future__ import annotations

import math

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.controllers.control.planner_settings import Record
from fg_mujoco.controllers.control.slip import velocity_angle
from fg_mujoco.controllers.control.stages import Stage, Tick
from fg_mujoco.controllers.control.steering import late_by, pursue
from fg_mujoco.controllers.control.tracking import LAG
from fg_mujoco.messages import FloatArray

from .line_profile import X, Y, moved_along

_SPAN = 0.2  # [m] to either side of a point, for the direction of the line
_BEND_SPAN = 0.4  # [m] the same for its curvature
_STANLEY_GAIN, _STANLEY_SLOWEST = 2.5, 1.0  # [1/s] and [m/s]
_LENGTH, _LENGTH_TIME = 0.4, 0.1  # [m] and [s]: of the regulator's L
OFF_LINE = 0.4
"""[m] Distance from the line beyond which the car joins it by pure pursuit."""


@kernel
def direction_at(line: FloatArray, point: int) -> float:
    """Return the direction [rad] of the line at a point."""
    before, after = moved_along(line, point, -_SPAN), moved_along(line, point, _SPAN)
    return math.atan2(line[after, Y] - line[before, Y], line[after, X] - line[before, X])


@kernel
def curvature_at(line: FloatArray, point: int) -> float:
    """Return the curvature [1/m] of the line at a point: of the circle through it and one to either side."""
    before, after = moved_along(line, point, -_BEND_SPAN), moved_along(line, point, _BEND_SPAN)
    ux, uy = line[point, X] - line[before, X], line[point, Y] - line[before, Y]
    vx, vy = line[after, X] - line[point, X], line[after, Y] - line[point, Y]
    sides = math.hypot(ux, uy) * math.hypot(vx, vy) * math.hypot(ux + vx, uy + vy)
    return 2.0 * (ux * vy - uy * vx) / sides if sides > 0.0 else 0.0


@kernel
def errors_at(line: FloatArray, point: int, x: float, y: float, heading: float) -> tuple[float, float]:
    """Return how far to the left of the line (x, y) is [m], and the angle of a heading to the line [rad]."""
    along = direction_at(line, point)
    aside = math.cos(along) * (y - line[point, Y]) - math.sin(along) * (x - line[point, X])
    angle = heading - along
    return aside, angle - 2.0 * math.pi * round(angle / (2.0 * math.pi))


@kernel
def stanley_steering(
    line: FloatArray, nearest: int, x: float, y: float, heading: float, speed: float, car: Record
) -> float:
    """Return the steering angle [rad] of Stanley's law; arguments as of `lqr_steering`."""
    front = moved_along(line, nearest, car.wheelbase)
    front_x, front_y = x + car.wheelbase * math.cos(heading), y + car.wheelbase * math.sin(heading)
    aside, angle = errors_at(line, front, front_x, front_y, heading)
    return -angle - math.atan2(_STANLEY_GAIN * aside, max(speed, _STANLEY_SLOWEST))


@kernel
def lqr_feedback(aside: float, angle: float, length: float) -> float:
    """Return the curvature [1/m] to steer more than the line's, see above, for the length L [m]."""
    return -aside / (length * length) - math.sqrt(2.0) * angle / length


@kernel
def lqr_steering(
    line: FloatArray, nearest: int, x: float, y: float, heading: float, speed: float, car: Record
) -> float:
    """Return the steering angle [rad] of the regulator, with the line's curvature ahead of its nearest point.

    The rear axle is at (x, y) [m], the heading [rad] and the speed [m/s], from 0, are the car's.
    """
    aside, angle = errors_at(line, nearest, x, y, heading)
    late = LAG + late_by(car)
    ahead = curvature_at(line, moved_along(line, nearest, late * speed))
    length = _LENGTH + (_LENGTH_TIME + late_by(car)) * speed
    return math.atan(car.wheelbase * (ahead + lqr_feedback(aside, angle, length)))


@kernel
def map_steering(
    line: FloatArray, nearest: int, bearing: float, distance: float, speed: float, car: Record, slip: Record
) -> float:
    """Return the steering angle [rad] of the model- and acceleration-based pursuit of a goal, see above.

    The goal's bearing [rad] and distance [m] are from the rear axle, `nearest` is the line's point there; speed [m/s],
    from 0.
    """
    if not slip.needs_slip_angle:
        return pursue(bearing, distance, 0.0, car.wheelbase)
    direction = velocity_angle(slip, car, speed, speed * curvature_at(line, nearest))
    return pursue(bearing - direction, distance, 0.0, car.wheelbase)


@kernel
def is_ahead(reference: Record) -> bool:
    """Return whether the car has a goal on its line, and does not turn round for it."""
    return bool(abs(reference.bearing) <= 0.5 * math.pi)


@kernel
def _track_by_stanley(tick: Tick) -> None:
    """Steer by Stanley's law near the line."""
    driver, reference = tick.driver, tick.reference
    if is_ahead(reference) and reference.off_line < OFF_LINE:
        line, point, (x, y, heading) = tick.line, reference.point, tick.odometry.pose
        now = min(abs(tick.odometry.speed), driver.car.max_speed)
        reference.steering_angle = stanley_steering(line, point, x, y, heading, now, driver.car)


@kernel
def _track_by_lqr(tick: Tick) -> None:
    """Steer by the regulator near the line."""
    driver, reference = tick.driver, tick.reference
    if is_ahead(reference) and reference.off_line < OFF_LINE:
        line, point, (x, y, heading) = tick.line, reference.point, tick.odometry.pose
        now = min(abs(tick.odometry.speed), driver.car.max_speed)
        reference.steering_angle = lqr_steering(line, point, x, y, heading, now, driver.car)


@kernel
def _track_by_map(tick: Tick) -> None:
    """Steer by model- and acceleration-based pursuit."""
    driver, reference = tick.driver, tick.reference
    if is_ahead(reference):
        line, point = tick.line, reference.point
        now = min(abs(tick.odometry.speed), driver.car.max_speed)
        reference.steering_angle = map_steering(
            line, point, reference.bearing, reference.distance, now, driver.car, driver.limiter.slip
        )


STANLEY = Stage(after_reference=_track_by_stanley)
LQR = Stage(after_reference=_track_by_lqr)
MAP = Stage(after_reference=_track_by_map)
"""The trackers as stages of driving, by which pure pursuit steers along its line."""
