"""Automatic emergency braking: drives straight ahead, and brakes when the time to collision is short.

The time to collision is the way to the nearest thing ahead of the car, within its width, over the speed of the car.
Source: the F1TENTH course, lab 2.
"""

import math

import numpy as np

from fg_mujoco.messages import STOP, DriveCommand

BRAKES_AT = 0.5  # [s]


class EmergencyBrake:
    """Drives as fast as it may until something is near, and then stays where it is."""

    def __init__(self, car, max_speed):
        self.car, self.max_speed = car, max_speed

    def reset(self):
        """Forget that it braked."""
        self.braking = False

    def __call__(self, scan, odometry):
        """Return the command."""
        bearings = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
        ahead, aside = scan.ranges * np.cos(bearings), scan.ranges * np.sin(bearings)
        in_the_way = np.isfinite(scan.ranges) & (ahead > 0.0) & (np.abs(aside) < 0.5 * self.car.width + 0.05)
        nose = self.car.length - self.car.rear_overhang - self.car.lidar_offset
        distance = float(np.min(ahead[in_the_way], initial=math.inf)) - nose
        if distance < BRAKES_AT * odometry.speed:
            self.braking = True
        return STOP if self.braking else DriveCommand(steering_angle=0.0, speed=self.max_speed)
