"""A camera on board as a part of an observation: pictures of the learning cars, drawn offscreen."""

from __future__ import annotations

import re
from collections import OrderedDict
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..errors import SettingsError
from ..messages import shown
from ..pictures.rendering import Renderer
from ..pictures.rendering.cameras import find_camera
from ..simulation.engine import Engine
from ..simulation.world import World

Mask = NDArray[np.bool_]
Pictures = NDArray[np.uint8]

_FEWEST_KEPT = 8  # renderers: each holds a context of OpenGL, takes some seconds to make, and some 100 MB
_SMALLEST, _LARGEST = 16, 2048  # [px] of width and height
_QUALITY = "draft"


def read_camera(text: Any) -> tuple[int, int, str]:
    """Return width and height [px] and the view of a text such as "96x64:chase"; SettingsError: another text."""
    found = re.fullmatch(r"([0-9]{2,4})x([0-9]{2,4})(?::(\w+))?", text) if isinstance(text, str) else None
    if found is None or not all(_SMALLEST <= int(pixels) <= _LARGEST for pixels in found.groups()[:2]):
        sizes = f"WIDTHxHEIGHT, {_SMALLEST} to {_LARGEST} pixels each"
        raise SettingsError(f"camera is {shown(text)}; accepted: {sizes}, as 64x48, or 64x48:VIEW")
    view = found[3] or "onboard"
    find_camera(view)
    return int(found[1]), int(found[2]), view


class Cameras:
    """Draws what the cameras of some cars see, pictures of a `shape`; of who does not look, the last one again."""

    def __init__(self, engine: Engine, rows: slice, text: str) -> None:
        width, height, self._view = read_camera(text)
        self._engine, self._rows, self.shape = engine, np.arange(len(engine.commands))[rows], (height, width, 3)
        self._pictures: Pictures = np.zeros((len(self._rows), *self.shape), np.uint8)
        self._renderers: OrderedDict[World, tuple[Renderer, mujoco.MjData]] = OrderedDict()

    def draw(self, which: Mask) -> Pictures:
        """Return pictures, new ones of `which` (n,). Shape (n, height, width, 3); MissingExtraError: no OpenGL."""
        cars = sorted(np.flatnonzero(which).tolist(), key=lambda car: id(self._engine.world_of(self._world(car))))
        for car in cars:  # those of one World after each other
            i = self._world(car)
            renderer, data = self._renderer(self._engine.world_of(i))
            self._engine.read(i, data)
            renderer.car = int(self._rows[car]) % self._engine.cars_per_world
            self._pictures[car] = renderer.rgb(data, self._view)
        return self._pictures.copy()

    def close(self) -> None:
        """Free the contexts of OpenGL."""
        for renderer, _ in self._renderers.values():
            renderer.close()
        self._renderers.clear()

    def _world(self, car: int) -> int:
        return int(self._rows[car]) // self._engine.cars_per_world

    def _renderer(self, world: World) -> tuple[Renderer, mujoco.MjData]:
        if world not in self._renderers:
            if len(self._renderers) >= max(_FEWEST_KEPT, self._engine.count):
                used = {self._engine.world_of(i) for i in range(self._engine.count)}
                oldest = next(each for each in self._renderers if each not in used)
                self._renderers.pop(oldest)[0].close()
            height, width, _ = self.shape
            drawn = Renderer(world, size=(width, height), quality=_QUALITY)
            self._renderers[world] = drawn, mujoco.MjData(world.model)
        self._renderers.move_to_end(world)
        return self._renderers[world]
