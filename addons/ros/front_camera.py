"""The front camera of a car, drawn: where AutoDRIVE's cars have theirs, with its lens.

Sources of place and lens: the technical guide of 2026 of the RoboRacer Sim Racing League.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from fg_mujoco.simulation.planner_adapter import Surroundings
from fg_mujoco.simulation.simulation import complete_state
from fg_mujoco.simulation.world import World

if TYPE_CHECKING:
    from fg_mujoco.pictures.rendering import Renderer

PLACE, PITCH = (-0.015, 0.0, 0.15), math.radians(10.0)
"""[m] from the middle of the rear axle, and [rad] downwards."""

FIELD_OF_VIEW = math.radians(48.8311)
"""From the lower to the upper edge: the guide does not say which angle it means."""

SIZE = (640, 360)
"""[px] of a picture; the guide says 16:9."""


class FrontCamera:
    """A camera that draws what is ahead of the car, and other cars with it. The extra `render` draws."""

    def __init__(self) -> None:
        self._drawn: tuple[World, Renderer, mujoco.MjData] | None = None

    def picture(self, surroundings: Surroundings) -> NDArray[np.uint8]:
        """Return the picture from where the car is, (360, 640, 3); MissingExtraError: no OpenGL."""
        from fg_mujoco.pictures.rendering import Renderer
        from fg_mujoco.pictures.rendering.cameras import View

        world = surroundings.world
        if self._drawn is None or self._drawn[0] is not world:
            self._drawn = world, Renderer(world, size=SIZE, quality="draft"), mujoco.MjData(world.model)
        _, renderer, data = self._drawn
        x, y, heading = surroundings.pose
        poses = [(x, y, heading), *(other.pose for other in surroundings.others)]  # who is drawn as which makes no odds
        for car, at in zip(world.cars, poses, strict=True):
            car.write_pose(data, *at)
        ahead, level = np.array((math.cos(heading), math.sin(heading), 0.0)), np.array((0.0, 0.0, 1.0))
        forward = math.cos(PITCH) * ahead - math.sin(PITCH) * level
        up = math.sin(PITCH) * ahead + math.cos(PITCH) * level
        position = np.array((x, y, PLACE[2] + world.car.parameters.wheel_radius)) + PLACE[0] * ahead
        view = View(position=position, forward=forward, up=up, fovy=FIELD_OF_VIEW, focus=position + ahead)
        return renderer.rgb(complete_state(world.model, data), camera=view)
