"""Pictures of an environment from a camera behind the car, as an array or in a window."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..errors import EngineError
from ..pictures.display_check import can_open_window
from ..pictures.rendering import Renderer
from ..simulation.engine import Engine
from ..simulation.world import World

WIDTH, HEIGHT = 640, 480  # [px]

_ACCEPTED = "accepted: a display; without one, render_mode 'rgb_array'"
_DISTANCE, _ELEVATION = 2.2, -22.0  # [m] from the car, [deg] downwards
_AHEAD = 0.5  # [m] of the rear axle, what the camera looks at


def usable_modes(modes: Sequence[str]) -> list[str]:
    """Return the render modes that can be had on this machine: without a display no window can be opened."""
    return [mode for mode in modes if mode != "human" or can_open_window()]


class WorldViews:
    """Draws the worlds of an engine from behind their car 0, each as it is now, the World that it has now."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._drawn: tuple[World, mujoco.MjData, Renderer] | None = None

    def frames(self, worlds: Sequence[int]) -> list[NDArray[np.uint8]]:
        """Return a frame (HEIGHT, WIDTH, 3) of each of some worlds; MissingExtraError: no OpenGL."""
        found: dict[int, NDArray[np.uint8]] = {}
        for i in sorted(worlds, key=lambda i: id(self._engine.world_of(i))):  # a context of OpenGL for each World
            world = self._engine.world_of(i)
            if self._drawn is None or self._drawn[0] is not world:
                self.close()
                drawn = Renderer(world, size=(WIDTH, HEIGHT), quality="draft")
                self._drawn = world, mujoco.MjData(world.model), drawn
            _, data, renderer = self._drawn
            self._engine.read(i, data)
            found[i] = renderer.rgb(data, "chase")
        return [found[i] for i in worlds]

    def close(self) -> None:
        """Free the OpenGL context."""
        if self._drawn is not None:
            self._drawn[2].close()
            self._drawn = None


class Window:
    """MuJoCo's viewer, at the simulation's pace, `period` [s] from `show` to `show`; EngineError: no display."""

    def __init__(self, world: World, data: mujoco.MjData, period: float) -> None:
        if not can_open_window():
            raise EngineError(f"no window can be opened: there is no display; {_ACCEPTED}")
        import mujoco.viewer

        self.world, self.data, self._period = world, data, period
        self._shown = -math.inf  # [s] on time.monotonic's clock
        try:
            self._viewer: Any = mujoco.viewer.launch_passive(
                world.model, data, show_left_ui=False, show_right_ui=False
            )  # fmt: skip
        except Exception as error:
            raise EngineError(f"no window can be opened ({error}); {_ACCEPTED}") from error

    def show(self) -> None:
        """Show the present state, not sooner than a period after the last."""
        if self._viewer.is_running():
            time.sleep(max(self._shown + self._period - time.monotonic(), 0.0))
            self._shown = time.monotonic()
            follow(self.world, self.data, self._viewer.cam)
            self._viewer.sync()

    def close(self) -> None:
        """Close the window."""
        self._viewer.close()


def follow(world: World, data: mujoco.MjData, camera: Any) -> None:
    """Put a free camera behind the car, looking ahead."""
    x, y, heading = world.car.pose(data)
    camera.lookat[:] = x + _AHEAD * math.cos(heading), y + _AHEAD * math.sin(heading), 0.0
    camera.distance, camera.azimuth, camera.elevation = _DISTANCE, math.degrees(heading), _ELEVATION
