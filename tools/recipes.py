"""Recipes of the bundled circuits: draws them again into tracks/.

    python tools/recipes.py                  # all of them
    python tools/recipes.py maze [FILE.csv]  # one
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from fg_mujoco.addons.arena.random_courses.generator import (
    EASEMENT,
    SPACING,
    GeneratorSettings,
    generate_track,
    start_on_longest_straight,
)
from fg_mujoco.addons.arena.tight_courses.lanes import Block, corner_radii, lane, outline, patch, with_boxes
from fg_mujoco.course.centreline_csv import write_centreline
from fg_mujoco.course.polyline import resample, rounded_polygon, smooth
from fg_mujoco.course.track import Track

TRACKS = Path(__file__).parents[1] / "tracks"


def oval() -> Track:
    """Two straights of 16 m and two half circles of 4 m radius; the plainest circuit there is."""
    return _circuit("oval", [(0, 0), (24, 0), (24, 8), (0, 8)], 4.0, 2.2)


def l_corridor() -> Track:
    """An L-shaped corridor of a building, 2.4 m wide, its corners square inside and out."""
    corners = np.array([(-9, 0), (9, 0), (9, 6), (-3, 6), (-3, 15), (-9, 15)], dtype=np.float64)
    (line,) = resample(np.roll(np.insert(corners, 1, (0, 0), axis=0), -1, axis=0), 0.25)  # divides every side
    return _with_width("l_corridor", line, 2.4)


def hairpins() -> Track:
    """Five hairpins of 2 m radius, one after the other, and the straight back."""
    corners = [(0, 0), (24, 0), (24, 18), (20, 18), (20, 4), (16, 4), (16, 18), (12, 18)]
    corners += [(12, 4), (8, 4), (8, 18), (4, 18), (4, 6), (0, 6)]
    return _circuit("hairpins", corners, 2.0, 2.2)


def chicanes() -> Track:
    """Four chicanes, to the left and to the right, between straights."""
    corners = [(0, 0), (12, 0), (14, 2.6), (20, 2.6), (22, 0), (34, 0), (34, 14)]
    corners += [(23, 14), (21, 11.4), (13, 11.4), (11, 14), (0, 14)]
    radii = [4.0, 2.5, 2.5, 2.5, 2.5, 4.0, 4.0, 2.5, 2.5, 2.5, 2.5, 4.0]
    return _circuit("chicanes", corners, radii, 2.2)


def fast() -> Track:
    """Long straights and sweepers of 7 to 16 m radius, 3 m wide."""
    corners = [(0, 0), (62, -4), (74, 24), (48, 36), (40, 22), (18, 30), (-8, 26)]
    return _circuit("fast", corners, [11.0, 14.0, 12.0, 7.0, 7.0, 16.0, 9.0], 3.0)


def tight() -> Track:
    """A random circuit, narrow and with corners down to 1.2 m radius: seed 11."""
    settings = GeneratorSettings(min_length=80.0, max_length=110.0, min_width=1.6, max_width=1.7, min_radius=1.2)
    return generate_track(11, settings, name="tight")


def u_turns() -> Track:
    """Two U-turns round the ends of one bent barrier; lanes 1.4 to 1.5 m wide, barrier 0.1 m thick."""
    return _back_to_back("u_turns", ("##..", ".###"), [4.0, 1.5, 2.0, 3.0], [1.4, 1.6], width=1.5, radius=1.0)


def serpentine() -> Track:
    """Five U-turns in a row round barriers of 0.1 m; lanes 1.4 m wide, the outer corners square."""
    return _back_to_back("serpentine", ("#.#.#", "#####"), [1.5] * 5, [1.5, 3.5], width=1.4, radius=0.8, square=1.0)


def spiral() -> Track:
    """A lane that winds inward, turns round and winds out again; lanes 1.4 m wide, barriers 0.1 m thick."""
    drawing = ("####", "#..#", "##.#", "...#", "####")
    return _back_to_back("spiral", drawing, [1.5] * 4, [1.5] * 5, width=1.4, radius=0.7)


def elbow() -> Track:
    """Corners of 90 degrees straight into hairpins, a centreline of 0.45 m radius in lanes 1.3 to 1.5 m wide."""
    drawing, columns, rows = ("#..", "###", "..#"), [1.5, 3.5, 1.6], [1.4, 1.4, 1.5]
    return _back_to_back("elbow", drawing, columns, rows, width=1.5, radius=0.45, square=0.5)


def boxes() -> Track:
    """Chicanes of boxes, each of which leaves 0.75 m; lanes 1.6 m wide, barrier 0.1 m thick."""
    drawing, columns, rows = ("##", "#."), [1.7, 6.2], [4.6, 1.7]
    return _back_to_back("boxes", drawing, columns, rows, width=1.6, radius=0.8, square=1.0, gap=0.75)


def maze() -> Track:
    """Eight U-turns and dead ends of barriers, as in a hall full of them; lanes 1.0 to 1.35 m wide."""
    drawing = ("#.###", "#.#..", "#####", "..#.#", "###.#")
    sizes = [1.3, 1.1, 1.1, 1.3, 1.3]
    return _back_to_back("maze", drawing, sizes, sizes, width=1.5, radius=0.6, square=0.5)


RECIPES: dict[str, Callable[[], Track]] = {
    recipe.__name__: recipe
    for recipe in (oval, l_corridor, hairpins, chicanes, fast, tight, u_turns, serpentine, spiral, elbow, boxes, maze)
}


def write_bundled(name: str, path: str | Path) -> None:
    """Write one bundled circuit, with its recipe in the header."""
    header = (f"{name}: {RECIPES[name].__doc__}", f"made by: python tools/recipes.py {name}")
    write_centreline(RECIPES[name](), path, header)


def _circuit(name: str, corners: Sequence[tuple[float, float]], radii: float | Sequence[float], width: float) -> Track:
    """Rounded polygon with easements, started from the middle of its longest straight."""
    polygon = np.array(corners, dtype=np.float64)
    line = rounded_polygon(polygon, np.broadcast_to(radii, len(polygon)).astype(np.float64))
    (line,) = resample(start_on_longest_straight(smooth(line, EASEMENT, 0.25 * SPACING)), SPACING)
    return _with_width(name, np.round(line, 4), width)


def _with_width(name: str, line: np.ndarray, width: float) -> Track:
    half = np.full(len(line), 0.5 * width)
    return Track(name=name, centreline=line, width_right=half, width_left=half)


def _back_to_back(
    name: str, drawing: Sequence[str], columns: Sequence[float], rows: Sequence[float], *, width: float, radius: float,
    square: float = 0.0, gap: float = 0.0,
) -> Track:  # fmt: skip
    """Lanes round a drawing of cells (lanes.patch), with barriers of 0.1 m between them.

    Args:
      name: of the track.
      drawing: rows of cells, the last is the lowest.
      columns: their widths [m].
      rows: their heights [m].
      width: of the lanes, at most [m].
      radius: of the centreline in all corners that are no U-turns, at most [m].
      square: how square the corners of the outer wall are, from 0 to 1.
      gap: left by boxes on all straights of 2.5 m or more [m]; 0: no boxes.
    """
    around = outline(patch(*drawing), columns, rows)
    right, left = (np.minimum(room - 0.05, 0.5 * width) for room in (around.room_right, around.room_left))
    corners = np.ones(len(right))
    radii = corner_radii(around, radius * corners, hairpin=1.8)
    drawn = lane(around, radii=radii, right=right, left=left, squareness=square * corners)
    for start, end in reversed(drawn.straights()) if gap else ():
        count = int((end - start - 0.6) / 1.9)
        first = 0.5 * (end - start - 1.9 * count + 1.5)
        blocks = [Block(start=first + 1.9 * k, length=0.4, depth=width - gap, left=k % 2 == 0) for k in range(count)]
        drawn = with_boxes(drawn, start, end, blocks) if blocks else drawn
    return drawn.track(name)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("name", nargs="?", choices=list(RECIPES), metavar="NAME", help=", ".join(RECIPES))
    parser.add_argument("file", nargs="?", type=Path, metavar="FILE", help="of one circuit; default: tracks/NAME.csv")
    options = parser.parse_args()
    for name in [options.name] if options.name else RECIPES:
        write_bundled(name, options.file or TRACKS / f"{name}.csv")


if __name__ == "__main__":
    main()
