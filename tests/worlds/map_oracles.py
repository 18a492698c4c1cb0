"""Maps drawn for tests, and slow, independent answers: rays marched pixel by pixel through the image itself."""

import math
from pathlib import Path

import numpy as np
import pytest

DATA = Path(__file__).resolve().parent.joinpath("../../../shared/data").resolve()


def real_map(name):
    """Return the YAML of a map that nobody here drew, or skip the test."""
    path = DATA / f"{name}.yaml"
    if not path.exists():
        pytest.skip(f"needs {path.name} in ../shared/data, which is no part of this repository")
    return path


def draw_map(folder, free, *, name="drawn", resolution=0.05, origin=(0.0, 0.0, 0.0), **settings):
    """Write a map of which pixels are free, (rows, columns) with row 0 below; `settings` are added to the YAML."""
    from PIL import Image

    Image.fromarray(np.where(free, 254, 0).astype(np.uint8)[::-1]).save(folder / f"{name}.png")
    keys = {"image": f"{name}.png", "resolution": resolution, "origin": origin and list(origin), "negate": 0,
            "occupied_thresh": 0.65, "free_thresh": 0.196, **settings}  # fmt: skip
    path = Path(folder) / f"{name}.yaml"
    lines = [f"{key}: {str(value).replace('inf', '.inf')}\n" for key, value in keys.items() if value is not None]
    path.write_text("".join(lines))
    return path


def ring(rows=200, columns=300, *, inner=40.0, outer=70.0):
    """Return the free pixels of a stadium: those `inner` to `outer` pixels from a line in the middle."""
    y, x = np.mgrid[:rows, :columns] + 0.5
    middle = 0.5 * columns
    along = np.clip(x, middle - 60.0, middle + 60.0)
    distance = np.hypot(x - along, y - 0.5 * rows)
    return (distance > inner) & (distance < outer)


KINDS = "{0: {walls: duct, height: 0.2}, 60: {height: 1.0, thickness: 0.1}}"


def draw_walls(folder, blur, table=KINDS):
    """Write a map of a ring whose walls are black on the left, grey in the middle and light grey on the right."""
    from PIL import Image, ImageFilter

    drawn = np.where(ring(), 254, np.where(np.arange(300) < 120, 0, np.where(np.arange(300) < 200, 60, 110)))
    image = Image.fromarray(drawn[::-1].astype(np.uint8))
    path = draw_map(folder, ring(), origin=(-7.5, -5.0, 0.0), walls=table, occupied_thresh=0.5)
    image.filter(ImageFilter.GaussianBlur(blur)).save(folder / "drawn.png")
    return path


def march(free, starts, headings, longest):
    """Go along rays from pixel to pixel until one is not free: how far that is, `longest` where none is met.

    Args:
      free: (rows, columns), row 0 below.
      starts: (k, 2) columns and rows.
      headings: (k,) [rad].
      longest: in pixels.
    """
    direction = np.column_stack((np.cos(headings), np.sin(headings)))
    cell = np.floor(starts).astype(int)
    step = np.where(direction > 0.0, 1, -1)
    with np.errstate(divide="ignore", invalid="ignore"):
        per_cell = np.abs(1.0 / direction)
        crossing = np.where(direction > 0.0, cell + 1 - starts, starts - cell) * per_cell  # distance to the next line
    crossing[direction == 0.0] = np.inf
    result = np.full(len(starts), float(longest))
    active = np.arange(len(starts))
    while len(active):
        axis = np.argmin(crossing[active], axis=1)
        distance = crossing[active, axis]
        cell[active, axis] += step[active, axis]
        crossing[active, axis] += per_cell[active, axis]
        column, row = cell[active].T
        hit = ~free[row, column]
        result[active[hit]] = np.minimum(distance[hit], longest)
        active = active[~hit & (distance < longest)]
    return result


def box_room(rows=160, columns=240):
    """Return a free rectangle with walls all round."""
    free = np.zeros((rows, columns), dtype=bool)
    free[10:-10, 10:-10] = True
    return free


def loop_difference(first, second):
    """Return the greatest distance from a point of one closed line to the other line, either way [m]."""
    return max(_farthest(first, second), _farthest(second, first))


def _farthest(points, line):
    ahead = np.roll(points, -1, axis=0) - points
    dense = (points[:, None] + np.linspace(0.0, 1.0, 20)[:, None] * ahead[:, None]).reshape(-1, 2)
    start, along = line, np.roll(line, -1, axis=0) - line
    worst = 0.0
    for chunk in np.array_split(dense, math.ceil(len(dense) / 200)):
        share = np.sum((chunk[:, None] - start) * along, axis=2) / np.sum(along * along, axis=1)
        foot = start + np.clip(share, 0.0, 1.0)[..., None] * along
        worst = max(worst, float(np.linalg.norm(chunk[:, None] - foot, axis=2).min(axis=1).max()))
    return worst


def building():
    """Return a floor, 30 m x 20 m: a corridor of 2 m round two rooms with open doors, and a lobby with a counter.

    The rooms are from column 60 to 420 and row 60 to 340; the lobby is to their right.
    """
    free = np.zeros((400, 600), dtype=bool)
    free[20:380, 20:580] = True
    free[60:340, 60:420] = False
    free[66:334, 66:236] = True  # the left room
    free[66:334, 244:414] = True
    for column in (140, 320):  # doors of 0.9 m, below and above
        free[60:66, column : column + 18] = True
        free[334:340, column : column + 18] = True
    free[160:240, 460:540] = False  # a counter of 4 m, and a stool
    free[300:310, 495:505] = False
    return free
