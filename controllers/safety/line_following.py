"""A car on a line: what lies ahead, where the car is there, how it is steered, and how fast it may go.

    window = line_ahead(line, first, x, y, heading, limiter)
    position, aside, turned = position_on(window, point, line.spacing)
    steering_angle, speed, _ = reference_on(window, position, aside, turned, line.spacing, limiter, now, True)

The car steers along the line as on a motion. Its place on the line and the curvature there are read between
the points: steps of the steering angle would take from braking. Its speed is the greatest from which the tires hold the
car through what comes: cornering, turning the wheels, and braking before with what cornering leaves.

The work is done in native/controllers/safety/line_following.cpp.
"""

from __future__ import annotations

from fg_mujoco.native import core

# columns of a window after those of motions: the greatest speed squared over `lateral` [m], and the
# acceleration that the tires hold while the car brakes, over the speed squared [1/m]
RADIUS, DEMAND = 5, 6

on_line = core.on_line
"""Return the limiter's settings turn_in_use and lateral_use_in_braking for a car on the line."""

describe_line = core.describe_line
"""Write heading, curvature, RADIUS and DEMAND of each point of a closed line, of type lap_raceline.LINE."""

line_ahead = core.line_ahead
"""Return the points of a closed line from the one before `first` on, in the frame of a car. Shape (64, 7).

Columns: x and y [m], heading [rad], curvature [1/m], the greatest speed from which the tires hold the car through all
that comes [m/s], RADIUS and DEMAND.

Args:
  line: of type lap_raceline.LINE, see `describe_line`.
  first: index of the point.
  x: of the rear axle [m], in the frame of the points.
  y: of the rear axle [m].
  heading: of the car [rad].
  limiter: of type LIMITER.
"""

write_speeds = core.write_speeds
"""Write the greatest speed at each point of a window (n, 7), whose points are `spacing` apart [m]."""

position_on = core.position_on
"""Return the position of the car between two points of a window: their arc leads from one to the other.

That is the position along the line in points, how far to the left of the line the car is [m], and its angle to the line
[rad], positive to the left.

Args:
  window: of a line in the frame of the car (n, 7).
  point: index of the one ahead of the car, from 1.
  spacing: of the points [m].
"""

speed_on = core.speed_on
"""Return the greatest speed [m/s] at a position in points, and as far ahead as the car answers late.

Args:
  window: of a line (n, 7).
  position: of the car, in points.
  spacing: of the points [m].
  now: present speed [m/s].
"""
