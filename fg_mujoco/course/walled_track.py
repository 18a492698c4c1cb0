"""A circuit between given walls, as of a map or of a file of two boundaries."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from ..arguments import explain_class
from ..messages import FloatArray, read_only
from .course import ISLAND
from .track import Track


@explain_class
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class MapTrack(Track):
    """A circuit whose walls are given, and not those of its widths. The widths are the distances to the walls.

    Raises:
      TrackError: when made, what Track raises of its line and widths.
    """

    wall_right: FloatArray  # (k, 2) [m] closed, in driving order
    wall_left: FloatArray  # (m, 2) [m] closed, in driving order
    outlines: tuple[FloatArray, ...] = ()  # of what stands between the two, each closed and counterclockwise [m]

    @property
    def islands(self) -> tuple[FloatArray, ...]:
        """Outlines of what stands between the walls, counterclockwise. Shapes (k, 2) [m], read-only."""
        return self.outlines

    @property
    def definition(self) -> dict[str, FloatArray]:
        """All that makes it what it is: line, widths, walls and islands."""
        islands = {f"{ISLAND}{number}": outline for number, outline in enumerate(self.outlines)}
        return super().definition | {"wall_right": self.wall_right, "wall_left": self.wall_left} | islands

    @cached_property
    def _corridor(self) -> tuple[FloatArray, FloatArray]:
        return self.width_right, self.width_left

    @cached_property
    def _walls(self) -> tuple[FloatArray, FloatArray]:
        return read_only(self.wall_right), read_only(self.wall_left)
