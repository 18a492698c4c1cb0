"""Where an episode starts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from ..course.obstacles import Obstacle
from ..course.random_obstacles import CLEAR_AHEAD, CLEAR_BEHIND
from ..course.scene import Scene
from ..course.track import Track
from ..errors import SettingsError
from ..messages import FloatArray
from ..simulation.scenario import Start
from ..simulation.world import World

OFF_CENTRE = 0.5
"""Greatest offset of a random start, as a share of what the car has between the centreline and the nearer wall."""

HEADING = 0.2  # [rad] greatest, of a random start, from that of the centreline

_TRIES = 1000


def draw_start(world: World, rng: np.random.Generator) -> Start:
    """Return a standing start anywhere on the lap, near the centreline; of a scene, its own.

    With obstacles it is where `random_boxes` would leave room for it: none is near.

    Raises:
      SettingsError: obstacles everywhere.
    """
    track = world.track
    if isinstance(track, Scene):
        return Start()
    boxes = _stations(track, world.obstacles)
    for _ in range(_TRIES):
        s, across, turned = rng.uniform((0.0, -1.0, -1.0), (track.length, 1.0, 1.0)).tolist()
        ahead = (boxes - s) % track.length
        if not np.any((ahead < CLEAR_AHEAD) | (ahead > track.length - CLEAR_BEHIND)):
            room = min(_width(track, side, s) for side in (track.corridor_right, track.corridor_left))
            car = world.parameters
            room = max(room - 0.5 * math.hypot(car.width, car.length), 0.0)  # however it is turned
            return Start(s=s, offset=OFF_CENTRE * room * across, heading=HEADING * turned)
    raise SettingsError(
        f"no start on {track.name!r} has {CLEAR_AHEAD} m ahead and {CLEAR_BEHIND} m behind it free of its "
        f"{len(boxes)} obstacles; accepted: start 'line', or fewer"
    )


def given_start(options: Mapping[str, Any] | None) -> Start | None:
    """Return the start of the options of a reset, {"start": {"s": 3.0, "speed": 1.0}}; None: they have none.

    Raises:
      SettingsError: an unknown option, or one that is not a start.
    """
    unknown = set(options or ()) - {"start"}
    if unknown:
        raise SettingsError(f"reset has no option {sorted(unknown)[0]!r}; accepted: 'start'")
    start = (options or {}).get("start")
    if start is None or isinstance(start, Start):
        return start
    names = [f.name for f in fields(Start)]
    if not isinstance(start, Mapping) or not set(start) <= set(names):
        raise SettingsError(f"the start is {start!r}; accepted: any of {', '.join(names)}, by name")
    return Start(**start)


def _stations(track: Track, obstacles: tuple[Obstacle, ...]) -> FloatArray:
    """Progress of the middle of each obstacle. Shape (n,) [m]."""
    middles = [obstacle.corners().mean(axis=0) for obstacle in obstacles]
    return track.project(np.array(middles).reshape(-1, 2))[0]


def _width(track: Track, corridor: FloatArray, s: float) -> float:
    return float(np.interp(s, track.arc_length, corridor, period=track.length))
