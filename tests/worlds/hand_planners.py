"""Planners that tests drive by hand."""

import fg_mujoco as fg


def driven(law):
    """A planner of one steering angle [rad] and speed [m/s], or of those that a function of the odometry answers."""

    def planner(scan, odometry):
        steering, speed = law(odometry) if callable(law) else law
        return fg.DriveCommand(steering_angle=steering, speed=speed)

    return planner
