"""Random circuits from a seed. They are closed, smooth and wide enough to race, and never cross themselves.

    track = generate_track(7)

The generator grows a patch of cells at random on an uneven grid. The circuit is the outline of the patch: a finger of
the patch is a hairpin, a step in its edge a chicane, and a long edge a straight. The outline of a patch without holes
or diagonal contacts never crosses itself, and its stretches are at least a cell apart. Corners are rounded by arcs of
random radius, the plane is bent a little, and the curvature is smoothed. A circuit that breaks the settings is drawn
again. The same seed gives the same numbers.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Set
from dataclasses import dataclass, fields

import numpy as np

from fg_mujoco import portable
from fg_mujoco.arguments import explain_class
from fg_mujoco.course.polyline import resample, rounded_polygon, smooth, step_lengths, turns
from fg_mujoco.course.track import Track
from fg_mujoco.course.track_walls import shared_widths
from fg_mujoco.errors import SettingsError, TrackError
from fg_mujoco.messages import FloatArray, require

SPACING = 0.2  # [m] between the points of a generated centreline
EASEMENT = 0.35  # [m] sigma over which curvature is evened out: a car of wheelbase 0.33 m steers into its arcs

_ATTEMPTS = 200  # draws before giving up; with the default settings the first few keep them
_WIDTH_SWING = 0.12  # share by which each half width wanders about its mean
_MAX_BEND = 0.18  # greatest gradient of the displacement that bends the plane
_DIGITS = 4  # decimals of the coordinates [0.1 mm]: a tidy file, far below any tolerance

Cell = tuple[int, int]
RING = ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1))  # neighbours, counterclockwise
SIDES = RING[::2]


@explain_class
@dataclass(frozen=True, kw_only=True)
class GeneratorSettings:
    """Limits that every generated circuit keeps.

    Raises:
      SettingsError: a number that is not positive, or a least value above its greatest.
    """

    min_length: float = 40.0  # [m] F1TENTH race tracks are 40 to 200 m
    max_length: float = 200.0  # [m]
    min_width: float = 1.8  # [m] of the corridor, where a circuit is narrowest on average
    max_width: float = 2.8  # [m]
    min_radius: float = 1.5  # [m] of the centreline; the car turns in 0.742 m at full steering
    wall_gap: float = 0.3  # [m] left between the walls of two stretches

    def __post_init__(self) -> None:
        names = tuple(field.name for field in fields(self))
        require(self, lambda value: 0.0 < value < math.inf, "a positive number of metres", names, SettingsError)
        for name in ("length", "width"):
            low, high = getattr(self, f"min_{name}"), getattr(self, f"max_{name}")
            if low > high:
                said = f"GeneratorSettings.min_{name} is {low} m"
                raise SettingsError(f"{said}; accepted: at most max_{name}, {high} m")


def generate_track(
    seed: int | np.random.Generator, settings: GeneratorSettings | None = None, *, name: str | None = None
) -> Track:
    """Draw a circuit, driven from the middle of its longest straight, which starts at the origin along x.

    Args:
      seed: a seed from 0, or the generator to draw from.
      settings: what the circuit must keep; the defaults of `GeneratorSettings` if None.
      name: of the track; `random:SEED` if None.

    Raises:
      SettingsError: settings that no circuit was found for.
    """
    settings = settings or GeneratorSettings()
    rng = seed if isinstance(seed, np.random.Generator) else np.random.default_rng(seed)
    name = name or ("random" if isinstance(seed, np.random.Generator) else f"random:{seed}")
    for _ in range(_ATTEMPTS):
        track = _draw(rng, settings, name)
        if track is not None:
            return track
    raise SettingsError(f"no circuit found in {_ATTEMPTS} draws for {settings}; accepted: longer, narrower or tighter")


def _draw(rng: np.random.Generator, settings: GeneratorSettings, name: str) -> Track | None:
    width = rng.uniform(settings.min_width, settings.max_width)
    radius = settings.min_radius * (1.0 + _MAX_BEND)
    cell = (1.0 + _MAX_BEND) * max(2.0 * radius, width * (1.0 + _WIDTH_SWING) + settings.wall_gap)
    corners = _outline(rng, cell, rng.uniform(settings.min_length, settings.max_length))
    line = _bend(rng, rounded_polygon(corners, _corner_radii(rng, corners, radius)))
    line = line if rng.random() < 0.5 else line[::-1]
    (line,) = resample(start_on_longest_straight(smooth(line, EASEMENT, 0.25 * SPACING)), SPACING)
    line = np.round(line, _DIGITS)
    halves = [np.round(0.5 * width * (1.0 + _WIDTH_SWING * _wander(rng, len(line))), _DIGITS) for _ in range(2)]
    lengths = step_lengths(line)
    curvature = np.abs(turns(line)) / lengths
    if not settings.min_length <= lengths.sum() <= settings.max_length or curvature.max() > 1.0 / settings.min_radius:
        return None
    with_gap = [half + 0.5 * settings.wall_gap for half in halves]
    try:
        track = Track(name=name, centreline=line, width_right=halves[0], width_left=halves[1])
        left_over = shared_widths(line, *with_gap, all_round=True)
    except TrackError:
        return None
    if any(np.any(left < wanted) for left, wanted in zip(left_over, with_gap, strict=True)):
        return None
    return track if _has_walls(track) else None


def _has_walls(track: Track) -> bool:
    try:
        return len(track.left_wall) > 0
    except TrackError:
        return False


def _outline(rng: np.random.Generator, cell: float, length: float) -> FloatArray:
    """Corners of a patch of cells at least `cell` [m] wide, grown until its outline is `length` [m]; (n, 2) [m]."""
    size = 9  # cells to either side: more than a circuit of 200 m can fill
    edges = [np.concatenate(([0.0], np.cumsum(cell * rng.uniform(1.0, 1.8, size)))) for _ in range(2)]
    fingers = rng.uniform(0.0, 4.0)  # how much rather the patch grows fingers than bulges
    patch = {(size // 2, size // 2)}
    corners = _corners(patch, edges)
    while step_lengths(corners).sum() < 1.12 * length:  # rounding the corners will shorten it
        frontier = sorted({(i + di, j + dj) for i, j in patch for di, dj in SIDES} - patch)
        open_cells = [c for c in frontier if can_join(c, patch) and 0 <= c[0] < size and 0 <= c[1] < size]
        if not open_cells:
            break
        neighbours = np.array([sum((i + di, j + dj) in patch for di, dj in SIDES) for i, j in open_cells])
        weight = portable.exp(-fingers * (neighbours - 1.0))
        patch.add(open_cells[rng.choice(len(open_cells), p=weight / weight.sum())])
        corners = _corners(patch, edges)
    return corners


def can_join(cell: Cell, patch: Collection[Cell]) -> bool:
    """Tell whether the patch stays without holes and diagonal contacts: its cells about this one are one run."""
    ring = [(cell[0] + di, cell[1] + dj) in patch for di, dj in RING]
    runs = sum(ring[k] != ring[k - 1] for k in range(8))
    return runs == 2 and any(ring[::2])


def _corners(patch: set[Cell], edges: list[FloatArray]) -> FloatArray:
    """Corners of the outline of a patch, counterclockwise."""
    points = np.array([(edges[0][i], edges[1][j]) for i, j in walk_round(patch)])
    return points[np.abs(turns(points)) > 0.1]


def walk_round(patch: Set[Cell]) -> list[Cell]:
    """Return the corners of cells along the outline of a patch, counterclockwise from the lowest of the leftmost."""
    following: dict[Cell, Cell] = {}
    for i, j in patch:
        loop = ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1))
        for k, (di, dj) in enumerate(((0, -1), (1, 0), (0, 1), (-1, 0))):
            if (i + di, j + dj) not in patch:
                following[loop[k]] = loop[(k + 1) % 4]
    path = [min(following)]
    while following[path[-1]] != path[0]:
        path.append(following[path[-1]])
    return path


def _corner_radii(rng: np.random.Generator, corners: FloatArray, radius: float) -> FloatArray:
    """Radius at each corner, from `radius` to what half of the shorter edge allows; the greatest every third time."""
    lengths = step_lengths(corners)
    room = 0.5 * np.minimum(lengths, np.roll(lengths, 1))
    share = np.where(rng.random(len(corners)) < 1.0 / 3.0, 1.0, rng.random(len(corners)))
    return np.asarray(radius + share * (room - radius))


def _bend(rng: np.random.Generator, line: FloatArray) -> FloatArray:
    """Bend the plane by a wave in x and one in y, so that not every straight is straight nor at right angles."""
    extent = float(np.ptp(line, axis=0).max())
    gradient, phase = rng.uniform(0.0, _MAX_BEND, 2), rng.uniform(0.0, 2.0 * math.pi, 2)
    wave = 2.0 * math.pi / (extent * rng.uniform(0.8, 1.6, 2))
    return line + (gradient / wave) * portable.sin(wave * line[:, ::-1] + phase)


def _wander(rng: np.random.Generator, count: int) -> FloatArray:
    """Smooth periodic noise within +-1: three harmonics. Shape (count,)."""
    angle = 2.0 * math.pi * np.arange(count) / count
    size, phase = rng.dirichlet(np.ones(3)), rng.uniform(0.0, 2.0 * math.pi, 3)
    return np.asarray(np.sum(size * portable.sin(np.arange(1, 4) * angle[:, None] + phase), axis=1))


def start_on_longest_straight(line: FloatArray) -> FloatArray:
    """Move and turn a dense line so that it starts at the origin along x, in the middle of its longest straight."""
    lengths = step_lengths(line)
    straight = np.abs(turns(line)) < 0.02 * lengths  # radius over 50 m
    bends = np.flatnonzero(~straight)
    runs = np.diff(np.append(bends, bends[0] + len(line)))  # points from one bend to the next
    longest = int(np.argmax(runs))
    start = (int(bends[longest]) + int(runs[longest]) // 2) % len(line)
    return place_at_origin(np.roll(line, -start, axis=0))


def place_at_origin(line: FloatArray) -> FloatArray:
    """Move and turn a line so that it starts at the origin along x."""
    x, y = line[1] - line[-1]
    turn = np.array([[x, -y], [y, x]]) / math.hypot(x, y)
    return np.asarray((line - line[0]) @ turn)
