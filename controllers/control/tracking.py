"""Tracking: the steering angle that keeps a car on a motion.

The curvature of the motion is steered ahead of time, by as much as the steering takes, and the distance from the
motion and the angle to it fall over a length that grows with the speed, as a critically damped oscillator does.

Source: the linear feedback of the kinematic car in Frenet coordinates, with feed-forward of the curvature: C. Samson,
Path Following and Time-Varying Feedback Stabilization of a Wheeled Mobile Robot, ICARCV 1992.
"""

from __future__ import annotations

from fg_mujoco.native import core

X, Y, HEADING, CURVATURE = range(4)  # columns of a motion: of the rear axle after each arc, and the arc's curvature
SPEED = 4  # [m/s] column of a motion that says how fast the car drives there

LAG = 0.08  # [s] until a new steering angle is reached, of the F1TENTH car
_LENGTH, _LENGTH_TIME = 0.3, 0.1  # [m] and [s]: over which errors fall

next_point = core.next_point
"""Return the index of the first point of a motion from `index` on that lies ahead of the car; the last, if none."""

errors = core.errors
"""Return the position of a car on the arc that ends at a point of a motion.

That is how far ahead the end of the arc is [m], how far to the left of the arc the car is [m], and its angle to the
arc [rad], positive to the left. The car's rear axle is at (x, y) [m], its heading in [rad].
"""

steer_along = core.steer_along
"""Return the steering angle [rad] that keeps a car on a motion.

It takes, in this order:
  points: of the motion (n, 4 or more), see X; in the same frame as the car.
  index: index of the next one, see `next_point`.
  pose: of the rear axle: x [m], y [m], heading [rad].
  speed: of the car [m/s].
  wheelbase: of the car [m].
  late: by how much its wheels turn later than the F1TENTH car's [s], see `late_by`.
  path_late: by how much its path follows its commands later than the F1TENTH car's [s]. Errors fall over a length
    that is greater by the way of this time: a car that answers late would swing about the motion else.
"""
