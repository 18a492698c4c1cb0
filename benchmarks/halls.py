"""Draws halls: occupancy maps of wide lanes round an island, with side rooms, niches and fins.

    python benchmarks/race_maps.py --maps none --halls 0:20

A hall is a map as a team's mapping would leave it: a room of 12 to 25 by 10 to 16 m, with an island in its middle. Side
rooms of up to 8 m open from its walls and niches from the island, dead ends all. In every second hall the island is a
C, and a thin wall from outside leads into it: the lap goes in round that wall's end, and passes itself. Fins stand in
wide lanes. The same seed draws the same hall.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

RESOLUTION = 0.05  # [m]
ROOM = 9.0  # [m] round the hall, for side rooms

Mask = NDArray[np.bool_]


class Hall:
    """The free pixels of a hall that is being drawn; places in m from its lower left corner."""

    def __init__(self, width: float, height: float) -> None:
        columns, rows = (round((side + 2.0 * ROOM) / RESOLUTION) for side in (width, height))
        self.free: Mask = np.zeros((rows, columns), np.bool_)
        self.fill((0.0, 0.0, width, height), True)

    def fill(self, box: tuple[float, float, float, float], free: bool) -> None:
        """Make a box of left, low, right and high free, or a wall."""
        left, low, right, high = (max(round((place + ROOM) / RESOLUTION), 1) for place in box)
        self.free[low:high, left:right] = free

    def write(self, path: Path, origin: tuple[float, float]) -> None:
        """Write the YAML and the image; `origin` is the place of the world's [m]."""
        Image.fromarray(np.where(self.free[::-1], 254, 0).astype(np.uint8)).save(path.with_suffix(".png"))
        corner = ", ".join(f"{-ROOM - place:.3f}" for place in origin)
        path.write_text(
            f"image: {path.stem}.png\nresolution: {RESOLUTION}\norigin: [{corner}, 0.0]\nnegate: 0\n"
            "occupied_thresh: 0.65\nfree_thresh: 0.196\n",
            encoding="utf-8",
        )


def draw(seed: int, folder: Path) -> Path:
    """Draw a hall, and return its YAML."""
    rng = np.random.default_rng(seed)
    width, height, folds = rng.uniform(12.0, 22.0), rng.uniform(10.0, 16.0), seed % 2 == 1
    if folds:
        width, height = width + 3.0, max(height, 12.0)
    hall = Hall(width, height)
    low, right, high, left = rng.uniform(1.8, 5.0 if not folds else 3.0, 4)
    for _ in range(rng.integers(3, 8)):  # side rooms
        wide, deep, door = rng.uniform(1.5, 5.0), rng.uniform(1.5, 8.0), rng.uniform(0.4, 1.2)
        side, at = rng.integers(4), rng.uniform(0.1, 0.9)
        wall = 0.1 if door < 0.8 else 0.0
        along = at * ((width if side % 2 == 0 else height) - wide)
        middle, half = along + 0.5 * wide, 0.5 * wide * (door if wall else 1.0)
        base, out = ((height, 1.0), (width, 1.0), (0.0, -1.0), (0.0, -1.0))[side]
        near, far = sorted((base + out * wall, base + out * deep))
        for first, end, low_end, high_end in (
            (along, along + wide, near, far), (middle - half, middle + half, base - 0.1, base + 0.1)
        ):  # fmt: skip
            across = (first, low_end, end, high_end) if side % 2 == 0 else (low_end, first, high_end, end)
            hall.fill(across, True)
    island = (left, low, width - right, height - high)
    hall.fill(island, False)
    if folds:  # the island is a C that is open to the right, and a wall from the right leads into it
        thick = rng.uniform(0.15, 0.6)
        inside = (left + thick, low + thick, width - right, height - high - thick)
        hall.fill(inside, True)
        wall, middle = rng.uniform(0.1, 0.3), 0.5 * (inside[1] + inside[3]) + rng.uniform(-0.5, 0.5)
        hall.fill((inside[0] + rng.uniform(1.6, 3.0), middle - 0.5 * wall, width + ROOM, middle + 0.5 * wall), False)
    else:
        for _ in range(rng.integers(0, 4)):  # niches
            wide, deep = rng.uniform(1.0, 2.5), rng.uniform(0.8, 2.0)
            along = rng.uniform(island[0] + 0.3, max(island[2] - wide - 0.3, island[0] + 0.4))
            base = island[1] if rng.random() < 0.5 else island[3] - deep
            if island[3] - island[1] > 2.0 * deep + 0.5 and along + wide < island[2] - 0.2:
                hall.fill((along, base, along + wide, base + deep), True)
    for side, lane in ((0, high), (2, low)):  # fins, from the walls into the long lanes
        if lane > 2.6 and rng.random() < 0.6:
            along, reach = rng.uniform(left + 2.0, max(width - right - 2.0, left + 2.0)), lane - rng.uniform(1.3, 1.6)
            ends = (height - reach, height) if side == 0 else (-0.2, reach)
            hall.fill((along, ends[0], along + 0.1, ends[1]), False)
    path = folder / f"hall_{seed}.yaml"
    hall.write(path, (0.5 * width, 0.5 * low))
    return path
