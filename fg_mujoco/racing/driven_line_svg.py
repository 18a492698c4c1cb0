"""The line that a car drove, over the plan of its course, coloured by speed, and the lines of several, as SVG."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from ..course.plan import plan
from ..messages import FloatArray
from ..simulation.cars import car_colour_hex
from ..simulation.world import World

_COLOURS = ("#440154", "#46327e", "#365c8d", "#277f8e", "#1fa187", "#4ac16d", "#a0da39", "#fde725")  # viridis
_ALERT = "#d00000"
_MOST_TICKS = 8000  # of the line, 200 s: more would cover each other, and make the picture slow


def driven_line(
    world: World,
    line: FloatArray,
    speed: FloatArray,
    *,
    time: float,
    marks: Iterable[tuple[str, tuple[float, float]]],
    title: str,
) -> str:
    """Return the picture of a drive as SVG.

    Args:
      world: that was driven in.
      line: where the car was at the start of each tick (ticks, 2) [m]; of a longer drive the last 8000 ticks are drawn.
      speed: of the car then, (ticks,) [m/s].
      time: at which moving obstacles are drawn [s].
      marks: a text, and the place that it is written at [m].
      title: for screen readers.
    """
    drawing = plan(world.track, obstacles=world.obstacles, moving=world.moving, time=time, line=False, around=line)
    line, speed = line[-_MOST_TICKS:], speed[-_MOST_TICKS:]
    speed = np.where(np.isfinite(speed), speed, 0.0)
    fastest = max(float(speed.max(initial=0.0)), 1.0)
    bands = (speed.clip(0.0) / fastest * (len(_COLOURS) - 1e-9)).astype(int)
    starts = np.flatnonzero(np.diff(bands, prepend=-1))  # where the colour changes
    for start, end in zip(starts, (*starts, len(bands))[1:], strict=True):
        drawing.line(line[start : end + 1], _COLOURS[bands[start]], width=2.2)
    for text, place in marks:
        drawing.cross(place, text, _ALERT)
    drawing.legend(_COLOURS, "0", f"{fastest:.1f} m/s")
    return drawing.svg(title)


def driven_lines(
    world: World, lines: Sequence[FloatArray], *, time: float, contacts: Iterable[tuple[float, float]], title: str
) -> str:
    """Return the picture of a race of several cars as SVG, the line of each in its colour.

    Args:
      world: that was driven in.
      lines: where each car was at the start of each tick (ticks, 2) [m]; of longer ones the last 8000 ticks are drawn.
      time: at which moving obstacles are drawn [s].
      contacts: where two cars touched [m].
      title: for screen readers.
    """
    around = np.concatenate(lines)
    drawing = plan(world.track, obstacles=world.obstacles, moving=world.moving, time=time, line=False, around=around)
    for index, line in enumerate(lines):
        drawing.line(line[-_MOST_TICKS:], car_colour_hex(index), width=1.8)
    for place in contacts:
        drawing.cross(place, "", _ALERT)
    drawing.legend([car_colour_hex(index) for index in range(len(lines))], "car 0", f"car {len(lines) - 1}")
    return drawing.svg(title)
