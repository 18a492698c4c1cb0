"""Scenes by name, each made from a seed: same name and seed, same scene.

    scene = load_track("scene:cylinder_field:3")

Those of a kind are in one module: corridor_scenes, gap_scenes, corner_scenes.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from types import MappingProxyType

from ...errors import TrackError
from ..scene import Scene
from . import corners as corner_scenes
from . import corridors as corridor_scenes
from . import gaps as gap_scenes

PREFIX = "scene:"

SCENES: Mapping[str, Callable[[str, int], Scene]] = MappingProxyType(
    {
        "corridor_sparse": corridor_scenes.corridor_sparse,
        "corridor_dense": corridor_scenes.corridor_dense,
        "cylinder_field": gap_scenes.cylinder_field,
        "narrow_gap_120": gap_scenes.narrow_gap_120,
        "narrow_gap_150": gap_scenes.narrow_gap_150,
        "narrow_gap_200": gap_scenes.narrow_gap_200,
        "square_corner": corner_scenes.square_corner,
        "dead_end": corner_scenes.dead_end,
        "u_turn_trap": corner_scenes.u_turn_trap,
        "wrong_side_chicane": gap_scenes.wrong_side_chicane,
        "crossing_box": corridor_scenes.crossing_box,
        "slow_leader": corridor_scenes.slow_leader,
    }
)
"""Name -> what makes it, called with the scene's name and the seed."""


def scene_names() -> tuple[str, ...]:
    """Return the names of the scenes, without prefix and seed."""
    return tuple(SCENES)


def describe_scene(name: str) -> str:
    """Return what the scene of this name is, in one line."""
    return f"{PREFIX}{name}: {' '.join((SCENES[name].__doc__ or '').split())}"


def load_scene(name: str) -> Scene:
    """Return the scene of a name: `scene:NAME:SEED`, or `scene:NAME`, which has seed 0.

    Raises:
      TrackError: an unknown name, or a seed that is no whole number from 0.
    """
    kind, colon, seed = name.removeprefix(PREFIX).partition(":")
    if kind not in SCENES:
        raise TrackError(
            f"unknown scene {name!r}; accepted: scene:NAME or scene:NAME:SEED, NAME one of {', '.join(SCENES)}"
        )
    if colon and not re.fullmatch("[0-9]{1,18}", seed):
        raise TrackError(
            f"{name!r} has no seed; accepted: scene:NAME:SEED with SEED a whole number from 0, as {PREFIX}{kind}:7"
        )
    number = int(seed or 0)
    return SCENES[kind](f"{PREFIX}{kind}:{number}", number)
