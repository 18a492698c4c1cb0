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

The work is done in native/addons/drivers/line_trackers.cpp.
"""

from __future__ import annotations

from fg_mujoco.controllers.control.stages import NativeStep, Stage
from fg_mujoco.native import core

lqr_feedback = core.lqr_feedback
"""Return the curvature [1/m] to steer more than the line's, see above, by the distance to the left of the line [m], the
angle to it [rad] and the length L [m]."""

STANLEY = Stage(after_reference=NativeStep("track_by_stanley"))
LQR = Stage(after_reference=NativeStep("track_by_lqr"))
MAP = Stage(after_reference=NativeStep("track_by_map"))
"""The trackers as stages of driving, by which pure pursuit steers along its line."""
