"""Worlds drawn as lines, with a car that drives through them and sees them: numpy only, no physics, no ray caster."""

import itertools
import math

import numpy as np

from fg_mujoco.controllers.perception.frontiers import FRONTIER_SEARCH, search_frontier
from fg_mujoco.controllers.perception.local_map import CELL, KIND, RING, SIZE
from fg_mujoco.controllers.perception.scan_geometry import SCAN_GEOMETRY
from fg_mujoco.messages import ODOMETRY
from scan_worlds import CAR, INCREMENT

PERIOD = 0.025
BEAMS = 1081
FIRST = -0.5 * (BEAMS - 1) * INCREMENT
BEARINGS = FIRST + INCREMENT * np.arange(BEAMS)
GEOMETRY = np.array([(FIRST, INCREMENT, 30.0, PERIOD)], SCAN_GEOMETRY)[0]


def lines(*polylines):
    """Straight walls between the points of each polyline. Shape (n, 2, 2) [m]."""
    return np.array([pair for line in polylines for pair in itertools.pairwise(line)], float)


def box(low_x, low_y, high_x, high_y):
    return [(low_x, low_y), (high_x, low_y), (high_x, high_y), (low_x, high_y), (low_x, low_y)]


def seen_from(walls, x, y, headings, longest=30.0):
    """How far it is to the nearest wall along each heading, at most `longest`. Shape (n,) [m]."""
    rays = np.column_stack((np.cos(headings), np.sin(headings)))[:, np.newaxis]
    ahead, away = walls[:, 1] - walls[:, 0], walls[:, 0] - (x, y)

    def cross(a, b):
        return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]

    with np.errstate(divide="ignore", invalid="ignore"):
        distance, share = cross(away, ahead) / cross(rays, ahead), cross(away, rays) / cross(rays, ahead)
    met = (distance > 0.0) & (share >= 0.0) & (share <= 1.0)
    return np.where(met, distance, longest).min(axis=1, initial=longest)


def cell(x, y):
    """The cell of a place, in the ring."""
    return math.floor(x / CELL) & RING, math.floor(y / CELL) & RING


def kinds(memory):
    """Which cells of a local map are unknown, free or walls, by their index in the ring."""
    return memory["cells"] & KIND


def least_of_blocks(distance):
    """The least of each two by two cells."""
    return distance.reshape(SIZE // 2, 2, SIZE // 2, 2).min(axis=(1, 3))


def middles(memory):
    """The places of all cells of a local map's window, by their index in the ring: x and y, NaN at its edge [m]."""
    found = []
    for at in (int(memory["column"]), int(memory["row"])):
        places = np.full(SIZE, math.nan)
        kept = np.arange(at - SIZE // 2 + 2, at + SIZE // 2 - 1)
        places[kept & RING] = (kept + 0.5) * CELL
        found.append(places)
    return np.meshgrid(*found, indexing="ij")


class Driven:
    """A car that starts at x = 0, y = 0 along x, and searches the frontier in every tick."""

    def __init__(self, walls, every=1):
        self.walls, self.every = walls, every
        self.frontier = np.zeros(1, FRONTIER_SEARCH)[0]
        self.x = self.y = self.heading = 0.0
        self.look(0.0, 0.0)

    def look(self, speed, yaw_rate):
        odometry = np.zeros(1, ODOMETRY)[0]
        odometry["speed"] = speed
        odometry["angular_velocity"][2] = yaw_rate
        every = self.every
        search_frontier(GEOMETRY, self.ranges(), odometry, CAR.lidar_offset, self.frontier, every, every, False)

    def lidar(self):
        offset = CAR.lidar_offset
        return self.x + offset * math.cos(self.heading), self.y + offset * math.sin(self.heading)

    def ranges(self):
        return seen_from(self.walls, *self.lidar(), self.heading + BEARINGS)

    def go(self, distance, curvature=0.0, speed=2.0):
        """Drive an arc, in reverse if the distance is negative."""
        ticks = max(round(abs(distance) / (speed * PERIOD)), 1)
        for _ in range(ticks):
            step = distance / ticks
            turn = step * curvature
            self.x += step * math.cos(self.heading + 0.5 * turn)
            self.y += step * math.sin(self.heading + 0.5 * turn)
            self.heading += turn
            self.look(step / PERIOD, turn / PERIOD)

    def distance_to_goal(self, x, y):
        """The way to go from a place [m], inf where it is not known."""
        i, j = cell(x, y)
        distance = self.frontier["distance_to_goal"][i // 2, j // 2]
        return math.inf if distance == 65535 else distance * 0.01
