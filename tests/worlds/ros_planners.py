"""Nodes of ROS as planners in a corridor, for the tests of the door."""

from dataclasses import replace

from fg_mujoco.racing.planners import make_controller
from scan_worlds import CAR, corridor, odometry_of

SCAN, ODOMETRY = corridor(1.0, 1.0, 5.0), odometry_of(1.0)


def make(source, **settings):
    return make_controller(source, car=CAR, mu=1.0, max_speed=5.0, settings=settings)


def commands(planner, count, odometry=ODOMETRY):
    """Return the commands to scans 25 ms apart, as (speed, steering angle)."""
    found = [planner(replace(SCAN, stamp=0.025 * i), replace(odometry, stamp=0.025 * i)) for i in range(count)]
    return [(command.speed, command.steering_angle) for command in found]


def speeds(planner, count):
    return [speed for speed, _ in commands(planner, count)]
