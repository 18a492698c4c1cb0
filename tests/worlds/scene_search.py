"""Whether a way exists among solids: for a disc, on a grid; for a car that only drives forward, on a lattice of poses.

Independent of how scenes are made: solids are taken by their corners, distances by brute force.
"""

import math

import numpy as np

import fg_mujoco as fg
from drawn_worlds import lines, seen_from


def solids_of(course, time=0.0):
    """All that stands and moves on a course, at a time [s]."""
    return [*course.walls, *course.obstacles, *(moving.box(time) for moving in course.moving)]


def corridor_walls(begin, end, width):
    """Return the four walls of a straight corridor along x, 0.1 m thick, from `begin` to `end`."""
    middle, length, aside = 0.5 * (begin + end), end - begin + 0.2, 0.5 * width + 0.05
    sides = [fg.Box(x=middle, y=y, length=length, width=0.1) for y in (-aside, aside)]
    return (*sides, *(fg.Box(x=x, y=0.0, length=0.1, width=width) for x in (begin - 0.05, end + 0.05)))


REACH = 1.0
"""[m] from a solid, within which distances to it are worked out."""


class Clearances:
    """Distance to the nearest solid, 0 inside of one, on a grid over a rectangle [m]; infinite beyond REACH."""

    def __init__(self, solids, low, high, cell):
        self.low, self.cell = np.asarray(low, float), cell
        shape = np.ceil((np.asarray(high) - self.low) / cell).astype(int) + 1
        axes = [low[i] + self.cell * np.arange(shape[i]) for i in (0, 1)]
        x, y = axes[0][:, None], axes[1]
        self.values = np.full(shape, np.inf)
        for solid in solids:
            self._approach(solid.corners(), x, y)
        np.sqrt(self.values, out=self.values)

    def _approach(self, corners, x, y):
        """Take in the squared distance to one more solid, of corners (n, 2) in the order of the clock backwards."""
        ends = ((corners.min(axis=0) - REACH, corners.max(axis=0) + REACH) - self.low) / self.cell
        rows, columns = (slice(max(int(least), 0), max(int(most) + 2, 0)) for least, most in ends.T)
        x, y, values = x[rows], y[columns], self.values[rows, columns]
        inside = np.ones(values.shape, bool)
        for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            dx, dy = bx - ax, by - ay
            inside &= dx * (y - ay) >= dy * (x - ax)
            length = dx * dx + dy * dy
            share = np.clip((x - ax) * (dx / length) + (y - ay) * (dy / length), 0.0, 1.0)
            aside, along = x - ax - share * dx, y - ay - share * dy
            np.minimum(values, aside * aside + along * along, out=values)
        values[inside] = 0.0

    def index(self, points):
        return tuple(np.round((np.atleast_2d(points) - self.low) / self.cell).astype(int).T)

    def at(self, points):
        return self.values[self.index(points)]


def disc_gets_through(clearances, start, goal, radius):
    """Whether a disc [m] can move from start to goal (2,) [m]."""
    free = clearances.values > radius
    return bool(_flood(free, *(int(v[0]) for v in clearances.index(start)))[clearances.index(goal)][0])


def _flood(free, i, j):
    """Where a way leads to from a place, over free cells side by side: along rows and columns by turns."""
    seen, count = np.zeros_like(free), 0
    seen[i, j] = free[i, j]
    while np.count_nonzero(seen) > count:
        count = np.count_nonzero(seen)
        for _ in range(4):  # each way along both axes
            free, seen = np.rot90(free), np.rot90(seen)
            place = np.arange(free.shape[1])
            last_seen, last_solid = (np.maximum.accumulate(np.where(w, place, -1), axis=1) for w in (seen, ~free))
            seen = free & (last_seen > last_solid)
    return seen


def car_gets_through(clearances, pose, goal_x, car, *, radius, margin=0.0):
    """Whether a car of that turning radius [m] can drive forward from a pose to beyond x = goal_x [m].

    `margin` [m] is added to its footprint all round; negative, the footprint is that much smaller.
    """
    front, back = car.length - car.rear_overhang + margin, -car.rear_overhang - margin
    half = 0.5 * car.width + margin
    side = np.linspace(back, front, 13)
    body = np.concatenate([np.column_stack((side, np.full(13, s))) for s in (-half, 0.0, half)])
    return bool(_drive(clearances.values, clearances.low, clearances.cell, np.array(pose, float), goal_x, body, radius))


def _drive(values, low, cell, pose, goal_x, body, radius):
    step, headings, grid = 0.04, 180, 0.01
    shape = (*(int(length * cell / grid) + 1 for length in values.shape), headings)
    seen = np.zeros(shape, bool)
    turned = np.linspace(-1.0, 1.0, 5) / radius * step
    waiting = [pose[None]]
    while waiting:  # depth first, some poses at once
        poses = waiting.pop()
        if (poses[:, 0] >= goal_x).any():
            return True
        x, y, heading = poses.T[:, :, None]
        middle = heading + 0.5 * turned
        poses = np.stack((x + step * np.cos(middle), y + step * np.sin(middle), heading + turned), axis=-1)
        poses = poses.reshape(-1, 3)
        turns = np.round(poses[:, 2] / (2.0 * math.pi) * headings) % headings
        places = np.column_stack(((poses[:, :2] - low) / grid, turns)).astype(int)
        known = (places >= 0).all(axis=1) & (places < shape).all(axis=1)
        known[known] = ~seen[tuple(places[known].T)]
        poses, places = poses[known], places[known]
        free = _is_free(values, (poses[:, :2] - low) / cell, poses[:, 2], body / cell)
        cells, first = np.unique(np.ravel_multi_index(tuple(places[free].T), shape), return_index=True)
        seen.flat[cells] = True
        poses = poses[free][first]
        waiting += [poses[k : k + 100] for k in range(0, len(poses), 100)]
    return False


def _is_free(values, places, headings, body):
    """Whether points (m, 2) of a body are in free cells, at places (n, 2) and headings (n,). Shape (n,)."""
    cos, sin = np.cos(headings)[:, None], np.sin(headings)[:, None]
    i = np.round(places[:, :1] + cos * body[:, 0] - sin * body[:, 1]).astype(int)
    j = np.round(places[:, 1:] + sin * body[:, 0] + cos * body[:, 1]).astype(int)
    known = (i >= 0) & (i < values.shape[0]) & (j >= 0) & (j < values.shape[1])
    free = np.zeros(known.shape, bool)
    free[known] = values[i[known], j[known]] > 0.0
    return free.all(axis=1)


def ray_distances(solids, origin, headings):
    """Distance along each ray to the nearest side of any solid, inf where there is none. Shape (n,) [m]."""
    corners = [solid.corners() for solid in solids]
    return seen_from(lines(*([*points, points[0]] for points in corners)), *origin, headings, math.inf)
