"""A course of a user's own: an object with the members of `Course`, of no class of the package."""

import numpy as np

from fg_mujoco.course.moving_obstacles import MovingObstacle
from fg_mujoco.course.obstacles import Box, Cylinder
from fg_mujoco.errors import SettingsError, TrackError
from fg_mujoco.messages import MapLine

BEHIND = 3.0  # [m] of the line behind the start, which is at x = 0


class Yard:
    """A yard along x with a pillar to the left of the line and a gate that moves; it is driven once, from 0 to 12 m.

    Its random starts are to the left and the right of the line.
    """

    name = "yard"
    description = "12 m across a yard"
    closed = False
    length = 12.0
    modulus = 100.0
    origin = BEHIND
    most_laps = 1
    stop_time = 0.0
    edges = ()
    map_line = MapLine(points=[[-BEHIND, 0.0], [17.0, 0.0]], closed=False)
    bounds = np.array([[-4.0, -3.0], [18.0, 3.0]])
    table = np.array([[0.0], [-BEHIND], [0.0], [20.0], [0.0], [400.0]])
    walls = tuple(Box(x=7.0, y=y, length=22.0, width=0.2) for y in (-2.9, 2.9)) + tuple(
        Box(x=x, y=0.0, length=0.2, width=6.0) for x in (-4.0, 18.0)
    )
    obstacles = (Cylinder(x=6.0, y=1.5, radius=0.3),)
    moving = (MovingObstacle(length=0.3, width=0.6, start=(9.0, -2.0), end=(9.0, 2.0), speed=0.5, back_and_forth=True),)
    ground_lines = np.array([[[0.0, 1.0], [0.0, -1.0]], [[12.0, 1.0], [12.0, -1.0]]])

    @property
    def definition(self):
        return {"length": np.array([self.length])}

    def project(self, points, near=None):
        points = np.asarray(points, float).reshape(-1, 2)
        return points[:, 0] + BEHIND, points[:, 1]

    def start_pose(self, s=0.0, offset=0.0):
        return float(s), float(offset), 0.0

    def longest_race(self, laps):
        return 30.0

    def wall_surface(self):
        return None

    def check_car(self, car):
        if car.width > 1.0:
            raise TrackError(f"the gate is for cars of 1 m; this one is {car.width} m wide")

    def draw_start(self, rng, car, obstacles=()):
        return 0.0, float(rng.uniform(-1.0, 1.0)), 0.0

    def obstacle_sites(self, car):
        raise SettingsError("random obstacles in the yard; accepted: on a track")
