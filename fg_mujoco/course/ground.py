"""The ground of a course that is not level: banks, a ramp, a crest, roughness, or heights of one's own.

    result = race("oval[bank=15,roughness=C]")
    course = replace(load_track("oval"), relief=Relief(ramp=10.0))

There is one surface: a height field, whose nodes are `Ground.heights`. Between them it is bicubic (native/vehicle/
terrain.hpp), and all that stands on the course stands on it. Heights are over the level that the line would have.
Banks, ramps and crests are of circuits. A scene takes roughness and heights of one's own, open ground the heights.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from io import BytesIO
from typing import Any

import numpy as np

from .. import portable
from ..arguments import explain_class
from ..errors import SettingsError, TrackError, accepted_names, missing_extra
from ..messages import FloatArray, read_only, require, require_served, require_whole, shown
from .files import read_bytes
from .polyline import cross, is_inside, step_lengths, steps, subdivide

ROUGHNESS = {"": 0.0, "A": 16e-6, "B": 64e-6, "C": 256e-6, "D": 1024e-6}
"""Class of a road -> spectral density of its heights at a wave of 10 m [m^3]. Source: ISO 8608, geometric means."""

SCALE = 0.1
"""Of our cars: a road's heights and lengths are so many times as great for them."""

_CELL, _FINE_CELL, _BRIDGE_CELL = 0.1, 0.05, 0.025  # [m]
_COARSE_CELL = 0.2  # [m] of circuits that are too large for _CELL
_BEYOND = 1.5  # [m] of ground round the walls
_STEEPEST_BANK, _STEEPEST_RAMP = 30.0, 20.0  # [deg]
_PLATEAU, _RISE, _ROUNDED = 1.0, 0.25, 1.0  # [m] a ramp's length on top, its height, and over what its corners are
_CREST_LENGTH = 4.0  # [m]
_KERB_WIDTH, _KERB_RISE = 0.25, 0.1  # [m] of a kerb, and of it what rises from the road
_BRIDGE_TOP, _BRIDGE_SLOPE = 4.0, 3.0  # heights of it. An estimate: protectors that cars cross are some 5 by 50 cm
_STRAIGHT = 0.05  # [1/m] curvature of a stretch that takes a ramp
_LONGEST_WAVE, _SHORTEST_WAVE, _WAVES = 5.0, 0.2, 160  # [m] of roughness, at our scale
_STEEPEST = 1.0  # slope of a road: 45 degrees
_HIGHEST = 1000.0  # [m] over level ground, and below
_MOST_NODES = 2_000_000
_SPACING, _BLOCK = 0.1, 16  # [m] between points of the line that nodes are near to; side of so many nodes at a time
_BEYOND_STEEPEST, _LEVEL_ENOUGH = 1.2, 0.1  # share of its bank and ramp, and slope, of ground where stretches meet
_AVERAGED, _REACH = 400, 2  # times at most, and nodes on either side
_CLEAR = 1.0  # [m] of the start line to a ramp
_EASED = 2.0  # [m] over which a bank begins


@explain_class
@dataclass(frozen=True, kw_only=True, eq=False)
class Relief:
    """What the ground of a course has.

    Raises:
      SettingsError: a value out of its range.
    """

    bank: float = 0.0  # [deg] of bends, their outside higher
    ramp: float = 0.0  # [deg] up and down again, on the longest straight stretch
    crest: float = 0.0  # [m] height of a smooth one there; negative: a sag
    kerb: float = 0.0  # [m] height of what rises along both walls of bends
    cable_bridge: float = 0.0  # [m] height of one across the longest straight stretch
    roughness: str = ""  # class of ISO 8608, at the scale of our cars
    seed: int = 0  # of the roughness
    heights: FloatArray | None = None  # (rows, columns) [m] of one's own, rows from the lowest y on
    cell: float = _CELL  # [m] between two of one's own
    corner: tuple[float, float] = (0.0, 0.0)  # [m] x and y of the first

    def __post_init__(self) -> None:
        for names, most, unit in (
            (("bank",), _STEEPEST_BANK, "deg"), (("ramp",), _STEEPEST_RAMP, "deg"), (("crest",), 0.5, "m"),
            (("kerb",), 0.05, "m"), (("cable_bridge",), 0.1, "m"),
        ):  # fmt: skip
            least = -most if names in (("bank",), ("crest",)) else 0.0
            require(self, lambda v: least <= v <= most, f"{least:g} to {most:g} {unit}", names, SettingsError)  # noqa: B023
        if self.roughness not in ROUGHNESS:
            said = accepted_names(self.roughness, filter(None, ROUGHNESS), ", or none")
            raise SettingsError(f"Relief.roughness is {self.roughness!r}; {said}")
        require_whole("Relief.seed", self.seed, 0)
        require(self, lambda value: 0.001 <= value <= 10.0, "0.001 to 10 m", ("cell",), SettingsError)
        try:
            x, y = map(float, self.corner)
        except (TypeError, ValueError):
            x = y = math.nan
        if not (math.isfinite(x) and math.isfinite(y)):
            raise SettingsError(f"Relief.corner is {shown(self.corner)}; accepted: x and y [m]")
        object.__setattr__(self, "corner", (x, y))
        require_served(self, ("cell", "corner"), heights=self.heights is not None)
        if self.heights is not None:
            try:
                own = read_only(np.asarray(self.heights).astype(np.float64, casting="same_kind"))
            except (TypeError, ValueError):
                said = f"Relief.heights is {shown(self.heights)}"
                raise SettingsError(f"{said}; accepted: an array (rows, columns) of real numbers [m]") from None
            if own.ndim != 2 or min(own.shape) < 2 or own.size > _MOST_NODES:
                accepted = f"(rows, columns), 2 or more each, up to {_MOST_NODES} in all"
                raise SettingsError(f"Relief.heights has shape {own.shape}; accepted: {accepted}")
            within = np.abs(own) <= _HIGHEST  # nor is NaN
            if not within.all():
                row, column = np.argwhere(~within)[0].tolist()
                said = f"Relief.heights is {own[row, column]} in row {row}, column {column}"
                raise SettingsError(f"{said}; accepted: -{_HIGHEST:g} to {_HIGHEST:g} m")
            object.__setattr__(self, "heights", own)

    @property
    def level(self) -> bool:
        """Whether it has nothing."""
        return self.heights is None and not (self.shaped or self.roughness)

    @property
    def shaped(self) -> bool:
        """Whether it has something that is along the line."""
        return bool(self.bank or self.ramp or self.crest or self.kerb or self.cable_bridge)

    @property
    def own(self) -> Ground:
        """The heights of one's own, where it has them, where they lie."""
        assert self.heights is not None
        return Ground(heights=self.heights, corner=self.corner, cell=self.cell)

    @property
    def definition(self) -> dict[str, FloatArray]:
        """All numbers that it is, by name, for the definition of a course; `of` reads them back."""
        shape = (self.bank, self.ramp, self.crest, self.kerb, self.cable_bridge)
        row = (*shape, list(ROUGHNESS).index(self.roughness), self.seed, self.cell, *self.corner)
        own = {} if self.heights is None else {"heights": self.heights}
        return {"relief": np.array(row, np.float64)} | own

    @classmethod
    def of(cls, definition: Mapping[str, FloatArray]) -> Relief:
        """Return the relief that is in a definition."""
        bank, ramp, crest, kerb, bridge, place, seed, cell, x, y = np.asarray(definition["relief"]).tolist()
        return cls(
            bank=bank, ramp=ramp, crest=crest, kerb=kerb, cable_bridge=bridge, roughness=list(ROUGHNESS)[int(place)],
            seed=int(seed), cell=cell, corner=(x, y), heights=definition.get("heights"),
        )  # fmt: skip


def relief_of(
    *, heights: str | None = None, low: float | None = None, high: float | None = None, ground_seed: int = 0,
    **others: Any,
) -> Relief:
    """Return the relief of settings in a name; `low` and `high` [m] are the heights of black and of white in a picture.

    Raises:
      SettingsError: of Relief, a file that has no heights, or a picture in colour or without `high`.
    """
    is_picture = heights is not None and heights.lower().endswith(".png")
    if is_picture != (high is not None) or (low is not None and high is None):
        said = f"heights={heights}, low={low}, high={high}"
        raise SettingsError(f"{said}; accepted: low and high [m] of a grey .png, of which low is 0 unless told")
    if heights is None:
        return Relief(seed=ground_seed, **others)
    try:
        own = _read_picture(heights) if is_picture else np.load(BytesIO(read_bytes(heights)), allow_pickle=False)
    except SettingsError:
        raise
    except (OSError, EOFError, MemoryError, SyntaxError, ValueError) as error:
        said = f"heights={heights}: {getattr(error, 'strerror', None) or 'no heights'}"
        raise SettingsError(f"{said}; accepted: {SETTINGS['heights'][0]}, of heights") from error
    own = own if high is None else (low or 0.0) + (high - (low or 0.0)) * own
    return Relief(heights=own, seed=ground_seed, **others)


def _read_picture(path: str) -> FloatArray:
    """Return the brightness of a grey PNG, 0 black to 1 white, the lowest row first. Shape (rows, columns)."""
    try:
        from PIL import Image
    except ModuleNotFoundError:
        raise missing_extra("heights of a picture need Pillow", "maps") from None
    with Image.open(BytesIO(read_bytes(path))) as image:
        if image.width * image.height > _MOST_NODES:
            raise SettingsError(f"{path}: {image.width} x {image.height} pixels; accepted: {_MOST_NODES} at most")
        if image.format != "PNG" or image.mode not in ("L", "I;16", "I;16B", "I"):
            raise SettingsError(f"{path}: a {image.format} of mode {image.mode}; accepted: a grey PNG of 8 or 16 bits")
        return np.asarray(image, np.float64)[::-1] / (255.0 if image.mode == "L" else 65535.0)


def _read_point(text: str) -> tuple[float, float]:
    x, y = map(float, text.split(":"))
    return x, y


SETTINGS: dict[str, tuple[str, Callable[[str], Any]]] = {
    "bank": ("DEGREES", float), "ramp": ("DEGREES", float), **dict.fromkeys(("crest", "kerb"), ("METRES", float)),
    "cable_bridge": ("METRES", float), "roughness": (", ".join(filter(None, ROUGHNESS)), str),
    "ground_seed": ("NUMBER", int), "heights": ("FILE.npy or FILE.png", str),
    **dict.fromkeys(("low", "high", "cell"), ("METRES", float)), "corner": ("X:Y", _read_point),
}  # fmt: skip
"""Settings in the brackets of a circuit's name, as `centreline_csv.read_settings` reads them."""

@explain_class
@dataclass(frozen=True, kw_only=True, eq=False)
class Ground:
    """A surface of heights."""

    heights: FloatArray  # (rows, columns) [m] at the nodes, rows from the lowest y on
    corner: tuple[float, float]  # [m] x and y of the first
    cell: float  # [m] between two

    @property
    def bounds(self) -> FloatArray:
        """Least and greatest x and y of its nodes. Shape (2, 2) [m]."""
        rows, columns = self.heights.shape
        return np.array([self.corner, np.add(self.corner, self.cell * np.array([columns - 1, rows - 1]))])

    @property
    def flat(self) -> bool:
        """Whether it is level ground after all."""
        return not self.heights.any()

    def at(self, points: FloatArray) -> FloatArray:
        """Return the height at points (..., 2) [m], between nodes along the sides of their cell. Shape (...,) [m]."""
        place = (np.asarray(points) - self.corner) / self.cell
        column, row = (np.clip(place[..., axis], 0.0, self.heights.shape[1 - axis] - 1.0) for axis in (0, 1))
        left = np.minimum(column.astype(int), self.heights.shape[1] - 2)
        low = np.minimum(row.astype(int), self.heights.shape[0] - 2)
        across, up = column - left, row - low
        nodes = self.heights
        lower = (1.0 - across) * nodes[low, left] + across * nodes[low, left + 1]
        upper = (1.0 - across) * nodes[low + 1, left] + across * nodes[low + 1, left + 1]
        return np.asarray((1.0 - up) * lower + up * upper)

    def lifted(self, vertices: FloatArray) -> FloatArray:
        """Return vertices (n, 3) [m] of something that stands on level ground where they are on this one."""
        return np.column_stack((vertices[:, :2], vertices[:, 2] + self.at(vertices[:, :2])))


def make_ground(track: Any) -> Ground | None:
    """Return the ground of a course, as its relief says; None: it is level.

    Raises:
      TrackError: no stretch is long enough for its ramp, the road is too steep somewhere, or the course is too large.
    """
    relief = track.relief
    if relief.level:
        return None
    if relief.shaped and not track.closed:
        said = f"{track.name!r} has a bank, ramp, crest, kerb or cable bridge"
        raise TrackError(f"{said}; accepted: roughness or heights, where the line is not closed")
    cell = _BRIDGE_CELL if relief.cable_bridge else _FINE_CELL if relief.roughness or relief.kerb else _CELL
    if relief.heights is not None:
        cell = min(cell, relief.cell) if relief.cable_bridge or relief.kerb else relief.cell
    points = np.concatenate((track.bounds, *track.edges, *(each.corners() for each in getattr(track, "hall", ()))))
    if relief.heights is not None:
        field, course = relief.own.bounds, np.stack((points.min(axis=0), points.max(axis=0)))
        if (field[0] > course[1]).any() or (field[1] < course[0]).any():
            said = f"the heights of {track.name!r} are over {_extent(field)}"
            raise TrackError(f"{said}; accepted: over some of the course, {_extent(course)}")
    low, rows, columns = _grid(points, cell)
    if rows * columns > _MOST_NODES and cell == _CELL and relief.heights is None:
        cell = _COARSE_CELL
        low, rows, columns = _grid(points, cell)
    if rows * columns > _MOST_NODES:
        said = f"the ground of {track.name!r} has {rows * columns} nodes, {cell:g} m apart"
        raise TrackError(f"{said}; accepted: {_MOST_NODES} at most")
    x, y = low[0] + cell * np.arange(columns), low[1] + cell * np.arange(rows)
    nodes = np.stack(np.meshgrid(x, y), axis=-1)
    heights = np.zeros(rows * columns)
    if relief.shaped:
        most = math.tan(math.radians(abs(relief.bank))) + math.tan(math.radians(relief.ramp))
        most += math.pi * abs(relief.crest) / _CREST_LENGTH
        most += relief.kerb / _KERB_RISE + (relief.cable_bridge > 0.0) / _BRIDGE_SLOPE
        found = _along_and_across(track, *_places(track, nodes)).reshape(rows, columns)
        heights += _without_steps(found, (_BEYOND_STEEPEST * most + _LEVEL_ENOUGH) * cell).ravel()
    nodes = nodes.reshape(-1, 2)
    if relief.roughness:
        heights += rough_heights(nodes, relief)
    if relief.heights is not None:
        heights += relief.own.at(nodes)
    ground = Ground(heights=read_only(heights.reshape(rows, columns)), corner=(float(low[0]), float(low[1])), cell=cell)
    _check_slope(track, ground, nodes)
    return ground


def _extent(bounds: FloatArray) -> str:
    (low_x, low_y), (high_x, high_y) = bounds.tolist()
    return f"x {low_x:.1f} to {high_x:.1f} m, y {low_y:.1f} to {high_y:.1f} m"


def _grid(points: FloatArray, cell: float) -> tuple[FloatArray, int, int]:
    """Return the first node of a field round points (n, 2) [m], and how many rows and columns it has."""
    low = np.floor((points.min(axis=0) - _BEYOND) / cell) * cell
    columns, rows = (np.ceil((points.max(axis=0) + _BEYOND - low) / cell).astype(int) + 1).tolist()
    return low, rows, columns


def _places(track: Any, nodes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return progress and offset, left positive, of nodes (rows, columns, 2) [m]. Shape (rows * columns,) [m] each.

    They are those of the nearer segment at the nearest point of the line, which is looked for by blocks of nodes.
    """
    (line,) = subdivide(track.centreline, _SPACING)
    ahead, lengths = steps(line), step_lengths(line)
    s, found = np.cumsum(lengths) - lengths, np.empty((2, *nodes.shape[:2]))
    for corner in np.ndindex(*(-(-count // _BLOCK) for count in nodes.shape[:2])):
        rows, columns = (slice(_BLOCK * first, _BLOCK * (first + 1)) for first in corner)
        block = nodes[rows, columns]
        points, middle = block.reshape(-1, 2), 0.5 * (block[0, 0] + block[-1, -1])
        away = np.hypot(*(line - middle).T)
        near = np.flatnonzero(away <= away.min() + 1.01 * float(np.hypot(*(block[-1, -1] - block[0, 0]))))
        x, y = points.T[:, :, None]
        nearest = near[((x - line[near, 0]) ** 2 + (y - line[near, 1]) ** 2).argmin(axis=1)]
        sides = []
        for segment in (nearest - 1, nearest):
            off = points - line[segment]
            share = np.clip(np.sum(off * ahead[segment], axis=1) / lengths[segment] ** 2, 0.0, 1.0)
            distance = np.hypot(*(off - share[:, None] * ahead[segment]).T)
            offset = np.where(cross(ahead[segment], off) < 0.0, -distance, distance)
            sides.append((s[segment] + share * lengths[segment], offset))
        (s_before, before), (s_after, after) = sides
        nearer, shape = np.abs(before) < np.abs(after), block.shape[:2]
        found[0, rows, columns] = np.where(nearer, s_before, s_after).reshape(shape)
        found[1, rows, columns] = np.where(nearer, before, after).reshape(shape)
    return found[0].ravel() % track.length, found[1].ravel()


def _without_steps(heights: FloatArray, most: float) -> FloatArray:
    """Return heights (rows, columns) [m], averaged where stretches meet, until no two nodes are over `most` apart."""
    for _ in range(_AVERAGED):
        steep = np.zeros(heights.shape, np.bool_)
        for axis in (0, 1):
            rows, columns = np.nonzero(np.abs(np.diff(heights, axis=axis)) > most)
            for away in range(-_REACH, _REACH + 2):  # both nodes, and those about them
                at = [rows, columns]
                at[axis] = np.clip(at[axis] + away, 0, heights.shape[axis] - 1)
                steep[at[0], at[1]] = True
        row, column = np.nonzero(steep)
        if not len(row):
            break
        padded, means = np.pad(heights, 1, mode="edge"), np.zeros(len(row))
        for up, across in np.ndindex(3, 3):
            means += padded[row + up, column + across]
        heights[row, column] = means / 9.0
    return heights


def _along_and_across(track: Any, s: FloatArray, offset: FloatArray) -> FloatArray:
    """Return what bank, ramp and crest add at places along and across the line [m]. Shape (n,) [m]."""
    relief, step = track.relief, 0.05
    places = np.arange(0.0, track.length, step)
    curvature = np.interp(places, track.arc_length, track.curvature, period=track.length)
    curvature = _smoothed(curvature, _EASED / step)
    share = np.clip(2.0 * curvature / np.abs(curvature).max(), -1.0, 1.0)
    slope = _smoothed(share, _EASED / step) * math.tan(math.radians(relief.bank))
    width = float(np.maximum(track.corridor_left, track.corridor_right).max()) + 0.5
    found = -np.clip(offset, -width, width) * np.interp(s, places, slope, period=track.length)
    if relief.kerb:
        bends = _smoothed(np.where(np.abs(curvature) > _STRAIGHT, 1.0, 0.0), _KERB_WIDTH / step)
        sides = (track.corridor_left, track.corridor_right)
        left, right = (np.interp(s, track.arc_length, side, period=track.length) for side in sides)
        inside = np.where(offset > 0.0, left, right) - np.abs(offset)
        risen = np.clip((_KERB_WIDTH - inside) / _KERB_RISE, 0.0, 1.0)
        found += relief.kerb * risen * np.interp(s, places, bends, period=track.length)
    if relief.ramp or relief.crest or relief.cable_bridge:
        middle, length = _longest_straight(places, curvature, track.length)
        along = np.abs((places - middle + 0.5 * track.length) % track.length - 0.5 * track.length)
        profile = np.zeros(len(places))
        if relief.ramp:
            slope_of = math.tan(math.radians(relief.ramp))
            needed = _PLATEAU + 2.0 * _RISE / slope_of + _ROUNDED
            _require_room(track, "ramp", needed, length)
            profile += _smoothed(np.clip(_RISE - (along - 0.5 * _PLATEAU) * slope_of, 0.0, _RISE), _ROUNDED / step)
        if relief.crest:
            _require_room(track, "crest", _CREST_LENGTH, length)
            within = np.minimum(along / (0.5 * _CREST_LENGTH), 1.0)
            profile += 0.5 * relief.crest * (1.0 + portable.cos(math.pi * within))
        found += np.interp(s, places, profile, period=track.length)
        if relief.cable_bridge:
            _require_room(track, "cable bridge", 1.0, length)
            away = np.abs((s - middle + 0.5 * track.length) % track.length - 0.5 * track.length)
            half = (0.5 * _BRIDGE_TOP + _BRIDGE_SLOPE) * relief.cable_bridge
            found += np.clip((half - away) / _BRIDGE_SLOPE, 0.0, relief.cable_bridge)
    return found


def _require_room(track: Any, what: str, needed: float, length: float) -> None:
    if length < needed:
        said = f"{track.name!r} has no straight stretch of {needed:.1f} m for its {what}"
        raise TrackError(f"{said}, the longest has {length:.1f} m; accepted: none, or another course")


def _longest_straight(places: FloatArray, curvature: FloatArray, length: float) -> tuple[float, float]:
    """Return the middle of the longest straight stretch, as progress, and its length [m]."""
    straight = np.abs(curvature) < _STRAIGHT
    if straight.all():
        return 0.5 * length, length
    start = int(np.flatnonzero(~straight)[0])
    turned = np.roll(straight, -start)
    changes = np.flatnonzero(np.diff(np.concatenate(([0], turned.astype(int), [0]))))
    if len(changes) == 0:
        return 0.0, 0.0
    step, spans = places[1], []
    for first, behind in changes.reshape(-1, 2).tolist():  # the car does not start on what is put there
        line = len(places) - start
        parts = [(first, line - _CLEAR / step), (line + _CLEAR / step, behind)] if first < line < behind else []
        spans += parts or [(first, behind)]
    first, behind = max(spans, key=lambda span: span[1] - span[0])
    return float(((0.5 * (first + behind) + start) * step) % length), float((behind - first) * step)


def _smoothed(values: FloatArray, width: float) -> FloatArray:
    """Return the means of a closed row of values over so many of them."""
    half = max(int(0.5 * width), 0)
    sums = np.cumsum(np.concatenate((values[-half - 1 :], values, values[:half])))
    return np.asarray((sums[2 * half + 1 :] - sums[: -2 * half - 1]) / (2 * half + 1))


def rough_heights(nodes: FloatArray, relief: Relief) -> FloatArray:
    """Return heights of a rough road at nodes (n, 2) [m], the same in all directions: a sum of waves. Shape (n,) [m].

    ISO 8608 gives the density G0 (n0 / n)^2 of the heights along a line, of n waves a metre, n0 = .1 / m. With waves in
    all directions it is that of a surface of density C / k^3 over the plane of wave numbers, integrated across the
    line: 4 C / n^2, of waves to either side. So those of a wave number k have the variance 2 pi C / k^2 dk.
    """
    rng = np.random.default_rng((relief.seed, 2))
    edges = np.geomspace(1.0 / _LONGEST_WAVE, 1.0 / _SHORTEST_WAVE, _WAVES + 1)
    numbers, widths = np.sqrt(edges[1:] * edges[:-1]), np.diff(edges)
    density = ROUGHNESS[relief.roughness] * 0.1**2 * SCALE  # [m]: G0 by SCALE^3, and n0^2 by SCALE^-2
    variance = 2.0 * math.pi * 0.25 * density * numbers**-2 * widths
    angles, phases = rng.uniform(0.0, 2.0 * math.pi, (2, _WAVES))
    found = np.zeros(len(nodes))
    directions = np.column_stack((portable.cos(angles), portable.sin(angles)))
    for number, (ahead_x, ahead_y), phase, own in zip(numbers, directions, phases, variance, strict=True):
        along = nodes[:, 0] * ahead_x + nodes[:, 1] * ahead_y
        found += math.sqrt(2.0 * own) * portable.cos(2.0 * math.pi * number * along + phase)
    return found


def _check_slope(track: Any, ground: Ground, nodes: FloatArray) -> None:
    """Raise TrackError where a road is steeper than any wheel takes."""
    rise = np.abs(np.diff(ground.heights, axis=1, append=ground.heights[:, -1:]))
    rise = np.maximum(rise, np.abs(np.diff(ground.heights, axis=0, append=ground.heights[-1:])))
    steep = (rise > _STEEPEST * ground.cell).ravel()
    if track.edges:
        steep[steep] = is_inside(nodes[steep], track.edges)
    if steep.any():
        (px, py), slope = nodes[steep][0].tolist(), float(rise.ravel()[steep][0]) / ground.cell
        raise TrackError(
            f"the ground of {track.name!r} has a slope of {math.degrees(math.atan(slope)):.0f} deg at ({px:.2f}, "
            f"{py:.2f}); accepted: up to {math.degrees(math.atan(_STEEPEST)):.0f} deg, with heights in metres"
        )
