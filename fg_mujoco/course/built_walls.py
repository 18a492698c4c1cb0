"""How the walls of a circuit are built, and the hall that they stand in.

    result = race("oval[walls=duct,height=0.2,room=5]")
    course = replace(load_track("oval"), built=Walls(kind="duct", height=0.2, room=5.0))

RoboRacer circuits are laid out with flexible ducts of 20 to 33 cm, in halls. A duct is nearest half way up. Between two
of them there may be a gap. Over one that is low a beam passes when the car pitches or rolls, and then meets the wall of
the hall, which a planner must not take for free way.

The inner faces stay where the circuit has them: of a duct that is where it is nearest to the road.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arguments import explain_class
from ..errors import SettingsError, TrackError, accepted_names
from ..messages import FloatArray, require, require_served, require_whole
from .obstacles import Box, Obstacle, Pipe, Prism
from .polyline import distance_to_segment, is_inside, segments, step_lengths
from .track_mesh import (
    WALL_HEIGHT,
    WALL_THICKNESS,
    Surface,
    open_ends,
    prism_surface,
    prisms_on,
    wall_feet,
    wall_footprints,
)  # fmt: skip

KINDS = ("upright", "duct")

_LEAST, _GREATEST = 0.01, 5.0  # [m] of a wall's height and thickness
_HEAVIEST = 1000.0  # [kg/m]
_FURTHEST = 100.0  # [m] of the hall from the walls
_SHORTEST, _LONGEST = 0.1, 1000.0  # [m] of a piece of wall
_HALL_THICKNESS = 0.2  # [m] of its walls
_SNAP = 0.02  # [m] a gap ends at a corner that is as near
_CLUTTER_SIDES, _CLUTTER_HEIGHTS = (0.2, 1.0), (0.3, 1.8)  # [m] boxes, tables, people
_MOST_PIECES = 100_000  # of an edge
_CLUTTER_CLEAR = 0.1  # [m] between what stands in the hall and any wall
_TRIES = 200  # places for each


@explain_class
@dataclass(frozen=True, kw_only=True)
class Walls:
    """How walls are built.

    Raises:
      SettingsError: a value out of its range, or one that such walls do not have.
    """

    kind: str = "upright"  # of KINDS; a duct lies on the floor, and is round
    height: float = WALL_HEIGHT  # [m]; of a duct its diameter
    thickness: float | None = None  # [m] of upright walls; None: 5 cm
    gap: float = 0.0  # [m] between two pieces of wall; 0: there are none
    piece: float = 5.0  # [m] mean length of the pieces between gaps
    porosity: float = 0.0  # share of the beams that pass through
    room: float = 0.0  # [m] from the outermost walls to those of the hall; 0: there is no hall
    room_height: float = 3.0  # [m] of the hall's walls
    clutter: int = 0  # how many things stand in the hall
    seed: int = 0  # of where the gaps are, and what stands in the hall
    weight: float = 0.0  # [kg] of a metre of a wall that a car pushes, in pieces that hold together; 0: all stand

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise SettingsError(f"Walls.kind is {self.kind!r}; {accepted_names(self.kind, KINDS)}")
        sizes = ("height",) if self.thickness is None else ("height", "thickness")
        for names, least, most in (
            (sizes, _LEAST, _GREATEST), (("gap", "room"), 0.0, _FURTHEST), (("piece",), _SHORTEST, _LONGEST),
            (("porosity",), 0.0, 1.0), (("room_height",), _LEAST, _FURTHEST), (("weight",), 0.0, _HEAVIEST),
        ):  # fmt: skip
            unit = {"porosity": "", "weight": " kg/m"}.get(names[0], " m")
            accepted = f"{least:g} to {most:g}{unit}"
            require(self, lambda value: least <= value <= most, accepted, names, SettingsError)  # noqa: B023
        require_whole("Walls.clutter", self.clutter, 0)
        require_whole("Walls.seed", self.seed, 0)
        if self.thickness is not None and self.kind == "duct":
            raise SettingsError(f"Walls.thickness is {self.thickness!r} of ducts; accepted: None, they are round")
        require_served(self, ("room_height", "clutter"), room=self.room)
        require_served(self, ("piece",), gap=self.gap, weight=self.weight)

    @property
    def depth(self) -> float:
        """Thickness where they are thickest [m]."""
        return self.height if self.kind == "duct" else self.thickness or WALL_THICKNESS

    @property
    def numbers(self) -> FloatArray:
        """All that they are, for the definition of a course; `of` reads it back. A thickness of NaN: none is told."""
        kind, *others = astuple(self)
        return np.array([KINDS.index(kind), *others], np.float64)

    @classmethod
    def of(cls, numbers: FloatArray) -> Walls:
        """Return the walls of such numbers; raise SettingsError, ValueError or IndexError for others."""
        names = (field.name for field in fields(cls))
        own: dict[str, Any] = dict(zip(names, np.asarray(numbers).tolist(), strict=True))
        own |= {"kind": KINDS[int(own["kind"])], "clutter": int(own["clutter"]), "seed": int(own["seed"])}
        return cls(**own | ({"thickness": None} if math.isnan(own["thickness"]) else {}))


def walls_of(*, walls: str = Walls.kind, wall_seed: int = Walls.seed, **others: Any) -> Walls:
    """Return the walls of settings in a name; raise as Walls."""
    return Walls(kind=walls, seed=wall_seed, **others)


SETTINGS: dict[str, tuple[str, Callable[[str], Any]]] = {
    "walls": (" or ".join(KINDS), str),
    **dict.fromkeys(("height", "thickness", "gap", "piece", "room", "room_height"), ("METRES", float)),
    "porosity": ("NUMBER", float),
    "weight": ("KILOGRAMS", float),
    "clutter": ("NUMBER", int),
    "wall_seed": ("NUMBER", int),
}
"""Settings in the brackets of a circuit's name, as `centreline_csv.read_settings` reads them."""

OF_EACH = {name: form for name, form in SETTINGS.items() if name not in ("room", "room_height", "clutter")}
"""Those of them that walls of one grey level of a map have; the others are of the course."""


class WallPart(NamedTuple):
    """Walls of a course that are built alike."""

    built: Walls
    feet: FloatArray  # (m, 4, 2) [m] their footprints
    pieces: NDArray[np.intp]  # (m,) which of them hold together

    def split(self) -> list[WallPart]:
        """Return each piece as a part of its own."""
        groups = (self.pieces == piece for piece in np.unique(self.pieces))
        return [WallPart(self.built, self.feet[own], self.pieces[own]) for own in groups]

    def solids(self) -> tuple[Obstacle, ...]:
        """Return one for each footprint."""
        kind: type[Prism] = Pipe if self.built.kind == "duct" else Prism
        return tuple(kind(footprint=own, height=self.built.height) for own in self.feet.tolist())

    def surface(self) -> Surface:
        """Return the mesh of the same walls: what can be seen of them, normals outward."""
        if self.built.kind == "duct":
            return _duct_surface(self.feet, self.built.height)
        return prism_surface(prisms_on(self.feet, self.built.height))


def wall_parts(
    edges: Sequence[FloatArray], standing: Sequence[FloatArray], kinds: Sequence[Walls], marks: FloatArray | None
) -> list[WallPart]:
    """Return the walls along `edges`, as Course.edges, one part for each of the kinds that is there.

    `standing` are the edges with further points, between which pieces are; `marks` has the place of its kind for each
    segment of all edges; None: the first of all.
    """
    firsts = np.cumsum([0, *map(len, edges)])
    found = []
    for place, built in enumerate(kinds):
        rng = np.random.default_rng((built.seed, 0))
        longest = max(float(step_lengths(edge).sum()) for edge in edges)
        if built.gap >= longest:
            raise TrackError(f"gap is {built.gap:g} m in walls of {longest:.1f} m; accepted: a shorter one")
        if built.gap or built.weight:
            cut = [_with_gaps(edge, built, rng) for edge in standing]
        else:
            cut = [(edge, np.zeros(len(edge), np.intp)) for edge in standing]
        pieces = np.concatenate([own + _MOST_PIECES * number for number, (_, own) in enumerate(cut)])
        stands = np.concatenate([own >= 0 for _, own in cut])
        if marks is not None:
            own = [_segments_of(edge, line) + at for edge, (line, _), at in zip(edges, cut, firsts[:-1], strict=True)]
            stands &= marks[np.concatenate(own)] == place
        if stands.any():
            feet = wall_feet([line for line, _ in cut], built.depth)
            found.append(WallPart(built, feet[stands], pieces[stands]))
    return found


def _segments_of(edge: FloatArray, finer: FloatArray) -> NDArray[np.intp]:
    """Return of which segment of a closed line each segment of a finer one is, which begins with the same point."""
    lengths, own = step_lengths(edge), step_lengths(finer)
    return np.searchsorted(np.cumsum(lengths) - lengths, np.cumsum(own) - 0.5 * own, side="right") - 1


def hall_solids(edges: Sequence[FloatArray], built: Walls) -> tuple[Obstacle, ...]:
    """Return the walls of the hall round the walls along `edges`, and what stands in it; none without a hall.

    Raises:
      TrackError: the hall has no room for so much.
    """
    if not built.room:
        return ()
    points = np.concatenate(edges)
    low = points.min(axis=0) - built.depth - built.room
    high = points.max(axis=0) + built.depth + built.room
    clockwise = np.array([low, (low[0], high[1]), high, (high[0], low[1])])  # so that their solid is outside
    feet = wall_footprints(clockwise, _HALL_THICKNESS).tolist()
    sides = (Prism(footprint=own, height=built.room_height) for own in feet)
    return (*sides, *_clutter(edges, built, low, high))


def _clutter(edges: Sequence[FloatArray], built: Walls, low: FloatArray, high: FloatArray) -> list[Box]:
    """Return boxes in a hall between two corners, clear of the walls, of each other's middle, and of the road."""
    rng, sides = np.random.default_rng((built.seed, 1)), np.concatenate([segments(edge) for edge in edges])
    found: list[Box] = []
    for number in range(built.clutter):
        for _ in range(_TRIES):
            length, width = rng.uniform(*_CLUTTER_SIDES, 2).tolist()
            height, heading = float(rng.uniform(*_CLUTTER_HEIGHTS)), float(rng.uniform(-math.pi, math.pi))
            reach = 0.5 * math.hypot(length, width) + _CLUTTER_CLEAR
            if (high - low <= 2.0 * reach).any():
                continue
            place = rng.uniform(low + reach, high - reach)
            away = distance_to_segment(np.broadcast_to(place, (len(sides), 2)), sides[:, 0], sides[:, 1])
            others = [math.hypot(place[0] - box.x, place[1] - box.y) for box in found]
            if away.min() > reach + built.depth and not is_inside(place[None], edges)[0] and min(others, default=9) > 1:
                found.append(Box(x=float(place[0]), y=float(place[1]), length=length, width=width, height=height,
                                 heading=heading))  # fmt: skip
                break
        else:
            said = f"the hall has room for {number} of {built.clutter} things (clutter)"
            raise TrackError(f"{said}; accepted: as many, or a larger room than {built.room:g} m")
    return found


def _with_gaps(edge: FloatArray, built: Walls, rng: np.random.Generator) -> tuple[FloatArray, NDArray[np.intp]]:
    """Return a closed line (n, 2) [m] with points where gaps begin and end, and the piece of each segment; -1: none."""
    ends = np.cumsum(step_lengths(edge))
    starts, length = ends - step_lengths(edge), float(ends[-1])
    cuts, place = [], float(rng.uniform(0.0, built.piece))
    while place + built.gap < length:
        cuts.append((place, place + built.gap))
        place += built.gap + built.piece * float(rng.uniform(0.5, 1.5))
    at = np.unique(np.concatenate((starts, *cuts))) if cuts else starts
    corner = np.isin(at, starts)
    near = np.abs(at[:, None] - np.append(starts, length)).min(axis=1) < _SNAP
    at = at[corner | ~near]
    segment = np.searchsorted(starts, at, side="right") - 1
    share = (at - starts[segment]) / (ends - starts)[segment]
    points = edge[segment] + share[:, None] * (np.roll(edge, -1, axis=0) - edge)[segment]
    middle = 0.5 * (at + np.append(at[1:], length))
    pieces = np.zeros(len(at), np.intp)
    for number, (first, last) in enumerate(cuts, start=1):
        pieces[middle > last] = number % len(cuts)  # the last goes on to the first cut
        pieces[(first < middle) & (middle < last)] = -1
    return points, pieces


def _duct_surface(feet: FloatArray, diameter: float) -> Surface:
    """Return the mesh of ducts of a diameter [m] on footprints (m, 4, 2) [m]."""
    across, above = Pipe.section()
    sides = len(across)
    rings = np.empty((len(feet), 2, sides, 3))  # at the start of each piece, and at its end
    for ring, inner, back in ((0, 0, 3), (1, 1, 2)):
        rings[:, ring, :, :2] = feet[:, None, inner] + across[:, None] * (feet[:, None, back] - feet[:, None, inner])
        rings[:, ring, :, 2] = diameter * above
    here = np.arange(sides)
    there = (here + 1) % sides
    around = np.concatenate((
        np.stack((here, sides + here, sides + there), axis=1), np.stack((here, sides + there, there), axis=1)
    ))  # fmt: skip
    fan = np.stack((np.zeros(sides - 2, int), here[1:-1], here[2:]), axis=1)
    first = 2 * sides * np.arange(len(feet))[:, None, None]
    at_end, at_start = open_ends(feet)
    faces = (first + around, first[at_start] + fan, first[at_end] + sides + fan[:, ::-1])
    return rings.reshape(-1, 3), np.concatenate([face.reshape(-1, 3) for face in faces])
