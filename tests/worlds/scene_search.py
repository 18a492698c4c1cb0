"""Whether a way exists among solids: for a disc, on a grid; for a car that only drives forward, on a lattice of poses.

Independent of how scenes are made: solids are taken by their corners, distances by brute force.
"""

import math

import numpy as np

import fg_mujoco as fg
from drawn_worlds import lines, seen_from
from fg_mujoco.compiled.kernels import kernel


def solids_of(course, time=0.0):
    """All that stands and moves on a course, at a time [s]."""
    return [*course.walls, *course.obstacles, *(moving.box(time) for moving in course.moving)]


def corridor_walls(begin, end, width):
    """Return the four walls of a straight corridor along x, 0.1 m thick, from `begin` to `end`."""
    middle, length, aside = 0.5 * (begin + end), end - begin + 0.2, 0.5 * width + 0.05
    sides = [fg.Box(x=middle, y=y, length=length, width=0.1) for y in (-aside, aside)]
    return (*sides, *(fg.Box(x=x, y=0.0, length=0.1, width=width) for x in (begin - 0.05, end + 0.05)))


class Clearances:
    """Distance to the nearest solid, 0 inside of one, on a grid over a rectangle [m]."""

    def __init__(self, solids, low, high, cell):
        self.low, self.cell = np.asarray(low, float), cell
        shape = np.ceil((np.asarray(high) - self.low) / cell).astype(int) + 1
        corners = [np.ascontiguousarray(solid.corners()) for solid in solids]
        offsets = np.cumsum([0] + [len(polygon) for polygon in corners])
        middles = np.array([polygon.mean(axis=0) for polygon in corners])
        reaches = np.array([np.hypot(*(p - m).T).max() for p, m in zip(corners, middles, strict=True)])
        around = np.column_stack((middles, reaches))
        self.values = _distances(np.concatenate(corners), offsets, around, self.low, cell, shape[0], shape[1])

    def index(self, points):
        return tuple(np.round((np.atleast_2d(points) - self.low) / self.cell).astype(int).T)

    def at(self, points):
        return self.values[self.index(points)]


@kernel
def _distances(corners, offsets, around, low, cell, columns, rows):
    values = np.empty((columns, rows))
    for i in range(columns):
        for j in range(rows):
            x, y = low[0] + i * cell, low[1] + j * cell
            least = math.inf
            for polygon in range(len(offsets) - 1):
                middle_x, middle_y, reach = around[polygon]
                if math.hypot(x - middle_x, y - middle_y) - reach > least:
                    continue
                first, last = offsets[polygon], offsets[polygon + 1]
                inside = True
                for k in range(first, last):
                    after = k + 1 if k + 1 < last else first
                    ax, ay = corners[k, 0], corners[k, 1]
                    dx, dy = corners[after, 0] - ax, corners[after, 1] - ay
                    if dx * (y - ay) - dy * (x - ax) < 0.0:
                        inside = False
                    share = min(max(((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy), 0.0), 1.0)
                    least = min(least, math.hypot(x - ax - share * dx, y - ay - share * dy))
                if inside:
                    least = 0.0
            values[i, j] = least
    return values


def disc_gets_through(clearances, start, goal, radius):
    """Whether a disc [m] can move from start to goal (2,) [m]."""
    free = clearances.values > radius
    return bool(_flood(free, *(int(v[0]) for v in clearances.index(start)))[clearances.index(goal)][0])


@kernel
def _flood(free, i, j):
    seen = np.zeros(free.shape, np.bool_)
    stack = np.empty((free.size, 2), np.int64)
    count = 0
    if free[i, j]:
        seen[i, j] = True
        stack[0, 0], stack[0, 1] = i, j
        count = 1
    while count > 0:
        count -= 1
        i, j = stack[count]
        for di, dj in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            a, b = i + di, j + dj
            if 0 <= a < free.shape[0] and 0 <= b < free.shape[1] and free[a, b] and not seen[a, b]:
                seen[a, b] = True
                stack[count, 0], stack[count, 1] = a, b
                count += 1
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


@kernel
def _drive(values, low, cell, pose, goal_x, body, radius):
    step, turns_of_lock, headings = 0.04, 5, 180
    grid = 0.01
    columns = int(values.shape[0] * cell / grid) + 1
    rows = int(values.shape[1] * cell / grid) + 1
    seen = np.zeros((columns, rows, headings), np.bool_)
    stack = np.empty((40_000_000, 3))
    stack[0] = pose
    count = 1
    while count > 0:
        count -= 1
        x, y, heading = stack[count]
        if x >= goal_x:
            return True
        for lock in range(turns_of_lock):
            curvature = (lock / (turns_of_lock - 1) * 2.0 - 1.0) / radius
            turned = curvature * step
            middle = heading + 0.5 * turned
            new_x, new_y, new_heading = x + step * math.cos(middle), y + step * math.sin(middle), heading + turned
            i, j = int((new_x - low[0]) / grid), int((new_y - low[1]) / grid)
            k = round(new_heading / (2.0 * math.pi) * headings) % headings
            if not (0 <= i < columns and 0 <= j < rows) or seen[i, j, k]:
                continue
            cos, sin = math.cos(new_heading), math.sin(new_heading)
            hit = False
            for point in range(len(body)):
                px = new_x + cos * body[point, 0] - sin * body[point, 1] - low[0]
                py = new_y + sin * body[point, 0] + cos * body[point, 1] - low[1]
                a, b = round(px / cell), round(py / cell)
                if not (0 <= a < values.shape[0] and 0 <= b < values.shape[1]) or values[a, b] <= 0.0:
                    hit = True
                    break
            if hit:
                continue
            seen[i, j, k] = True
            if count < len(stack):
                stack[count, 0], stack[count, 1], stack[count, 2] = new_x, new_y, new_heading
                count += 1
    return False


def ray_distances(solids, origin, headings):
    """Distance along each ray to the nearest side of any solid, inf where there is none. Shape (n,) [m]."""
    corners = [solid.corners() for solid in solids]
    return seen_from(lines(*([*points, points[0]] for points in corners)), *origin, headings, math.inf)
