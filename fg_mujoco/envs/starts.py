"""Where an episode starts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..errors import SettingsError, accepted_names
from ..simulation.settings import Start, as_part
from ..simulation.world import World


def draw_start(world: World, rng: np.random.Generator) -> Start:
    """Return a random standing start, clear of all obstacles: on a track anywhere on the lap; of a scene, its own.

    Raises:
      SettingsError: obstacles everywhere.
    """
    s, offset, heading = world.track.draw_start(rng, world.parameters, world.obstacles)
    return Start(s=s, offset=offset, heading=heading)


def given_start(options: Mapping[str, Any] | None) -> Start | None:
    """Return the start of the options of a reset, {"start": {"s": 3.0, "speed": 1.0}}; None: they have none.

    Raises:
      SettingsError: an unknown option, or one that is not a start.
    """
    for name in sorted(set(options or ()) - {"start"}):
        raise SettingsError(f"reset has no option {name!r}; {accepted_names(name, ['start'])}")
    start = (options or {}).get("start")
    return None if start is None else as_part(start, Start, "start")
