"""Speed laws: how fast the car may go, by what the scan shows and by what the tires hold.

They are stages:

mean_range       by the mean range towards the goal over the lookahead
distance_ahead   by the distance straight ahead: stop, full speed, and in between in proportion
friction_law     v = sqrt(g mu b / tan|d|); in transients the tires slide, unless friction_limiter holds them
sight            the car stops within what the scan shows: braking_trajectories

Their code is native/controllers/control/speed.hpp; `decision` puts them together.
"""

from __future__ import annotations

import math

from fg_mujoco.messages import CarParameters
from fg_mujoco.native import core

friction_speed = core.friction_speed
"""Return the greatest speed [m/s] at which the tires hold the car on the circle of `steering_angle` [rad].

A car of wheelbase b steering by d runs, at its rear axle, on a circle of radius R = b / tan|d|. Holding it there takes
the force m v^2 / R, and the tires have mu m g: v = sqrt(g mu b / tan|d|). Straight ahead: inf. Source: the notes of the
field's gap_finder_base, for the kinematic bicycle.
"""

distance_ahead_speed = core.distance_ahead_speed
"""Return a speed [m/s] by the distance straight ahead [m]: 0 below `safe`, `top_speed` beyond `full_speed`.

In between it grows in proportion. Source: the F1TENTH course slides on reactive methods.
"""

friction_steering = core.friction_steering
"""Return the greatest steering angle [rad] that the tires hold at `speed` [m/s]: `friction_speed` read back."""


def lifting_share(car: CarParameters, steering_angle: float) -> float:
    """Return the lateral acceleration over g at which a rigid car lifts a wheel on a circle of a steering angle [rad].

    Moments about the axles and about the middle of the car, both axles rolling alike: a wheel is lifted by the height
    of the centre of gravity and by the wheels as gyroscopes. The backward part of the acceleration loads the front
    axle.
    """
    b, height = car.wheelbase, car.center_of_gravity_height
    aside = (height + 4.0 * car.wheel_inertia / (car.mass * car.wheel_radius)) / car.track_width
    forward = car.rear_axle_distance * math.tan(abs(steering_angle)) * height / b**2
    return min(car.front_axle_distance / b / (aside + forward), car.rear_axle_distance / b / max(aside - forward, 1e-9))


mean_range_speed = core.mean_range_speed
"""Return a speed [m/s] by the mean of `ranges` (n,), none longer than the lookahead: slow where it is tight.

It is `gain` times the mean's share of the lookahead, of the top speed. Source: the notes of the field's
gap_finder_base.
"""
