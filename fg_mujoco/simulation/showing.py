"""A planner shows values of its work: numbers, points, polygons, and arrays of a scan's length.

    show("gap width", 0.8)                        # a number
    show("goal", (3.0, 0.4))                      # a point (2,) [m]
    show("path", points, draw="line", frame="base_link")
    show("clipped", scan.ranges.clip(0.0, 3.0))   # ranges (n,) [m], one for each beam of the scan

The add-on look collects these values for the debug page, the live view and `export`. Otherwise, as in a race, in a
rollout and on a real car, `show` returns at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

LASER = "laser"
"""The frame of the LiDAR, as in ROS: x ahead and y to the left (REP 103)."""

_Listener = Callable[[Any, Any, Any, Any], None]
_listener: ContextVar[_Listener | None] = ContextVar("fg_mujoco_show", default=None)


def show(name: str, value: Any, *, draw: str | None = None, frame: str = LASER) -> None:
    """Show a value of this decision on the debug page, in the live view and in an exported bag.

    A value that cannot be shown is left out, with one remark. Where nothing collects values, `show` does nothing.

    Args:
      name: of the value, at most 60 characters. Of one name the last value of a decision counts.
      value: a number; a point (2,) or points (m, 2) [m]; ranges (n,) [m] of all beams of the scan; or None, which
        shows nothing. Points that are not finite are left out, or farther than 1000 km.
      draw: of points: "points", "line" or "polygon"; None: a polygon.
      frame: of points: "laser" (the LiDAR) or "base_link" (the rear axle), x ahead and y to the left; or "map".
    """
    listener = _listener.get()
    if listener is not None:
        listener(name, value, draw, frame)


def listener() -> _Listener | None:
    """Return the function that collects the values of this context; None: nothing collects them."""
    return _listener.get()


def pass_on(to: Callable[[], _Listener | None]) -> None:
    """Let this thread's values go to the listener that `to` returns then, as those of a planner's own thread."""

    def give(name: Any, value: Any, draw: Any, frame: Any) -> None:
        taker = to()
        if taker is not None:
            taker(name, value, draw, frame)

    _listener.set(give)


@contextmanager
def heard_by(collect: _Listener) -> Iterator[None]:
    """Let a function collect what is shown in this context: it gets the arguments of `show`."""
    token = _listener.set(collect)
    try:
        yield
    finally:
        _listener.reset(token)
