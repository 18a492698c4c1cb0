"""A planner that shows values of each kind."""

SHOWS = """
import math
import re

import numpy as np

import fg_mujoco as fg
from fg_mujoco.messages import DriveCommand


class Shows:
    def __init__(self, car, mu, max_speed):
        self.count = 0

    def reset(self):
        self.count = 0

    def __call__(self, scan, odometry):
        self.count += 1
        ahead = float(scan.ranges[len(scan.ranges) // 2])
        fg.show("ahead", ahead)
        fg.show("count", self.count)
        if self.count % 2:
            fg.show("odd", True)
        fg.show("nothing known", math.nan)
        fg.show("halved", 0.5 * scan.ranges)
        fg.show("hit", (ahead, 0.0))
        fg.show("box", [(0.0, 0.0), (1.0, 0.0), (1.0, 0.5)], frame="base_link")
        fg.show("start", (0.0, 0.0), frame="map", draw="points")
        fg.show("<b>bad</b>", "text")
        return DriveCommand(steering_angle=0.02, speed=min(1.5, 0.2 * self.count))
"""


def file_of_shows(folder):
    """Write the planner's file into a folder, and return its name."""
    (folder / "shows.py").write_text(SHOWS)
    return f"{folder / 'shows.py'}:Shows"
