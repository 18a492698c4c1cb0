"""The front camera of AutoDRIVE's car, a picture for each packet: drawn, or blank where nobody looks at it.

Sources of place and lens: the technical guide of 2026 of the RoboRacer Sim Racing League.
"""

from __future__ import annotations

import base64
import io
import math
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from fg_mujoco.errors import missing_extra
from fg_mujoco.messages import Odometry
from fg_mujoco.simulation.planner_adapter import Surroundings
from fg_mujoco.simulation.simulation import complete_state

if TYPE_CHECKING:
    from fg_mujoco.pictures.rendering import Renderer

PLACE, PITCH = (-0.015, 0.0, 0.15), math.radians(10.0)
"""[m] from the middle of the rear axle, and [rad] downwards."""

FIELD_OF_VIEW = math.radians(48.8311)
"""From the lower to the upper edge: the guide does not say which angle it means."""

SIZE = (640, 360)
"""[px] of a drawn picture; the guide says 16:9."""

_BLANK_SIZE = (16, 9)
_QUALITY = 75  # of the JPEG, in percent: the guide


class BlankCamera:
    """A camera whose pictures are white."""

    def __init__(self) -> None:
        width, height = _BLANK_SIZE
        self._picture = jpeg(np.full((height, width, 3), 255, np.uint8))

    def __call__(self, surroundings: Surroundings, odometry: Odometry) -> str:
        """See devkit.Camera."""
        return self._picture


class FrontCamera:
    """A camera that draws what is ahead of the car, and other cars with it. The extra `render` draws."""

    def __init__(self) -> None:
        self._renderer: Renderer | None = None
        self._data: Any = None

    def __call__(self, surroundings: Surroundings, odometry: Odometry) -> str:
        """See devkit.Camera."""
        from fg_mujoco.pictures.rendering import Renderer
        from fg_mujoco.pictures.rendering.cameras import View

        world = surroundings.world
        if self._renderer is None:
            self._renderer, self._data = Renderer(world, size=SIZE, quality="draft"), mujoco.MjData(world.model)
        x, y, heading = odometry.pose.tolist()
        poses = [(x, y, heading), *(other.pose for other in surroundings.others)]  # who is drawn as which makes no odds
        for car, pose in zip(world.cars, poses, strict=True):
            car.write_pose(self._data, *pose)
        ahead, level = np.array((math.cos(heading), math.sin(heading), 0.0)), np.array((0.0, 0.0, 1.0))
        forward = math.cos(PITCH) * ahead - math.sin(PITCH) * level
        up = math.sin(PITCH) * ahead + math.cos(PITCH) * level
        position = np.array((x, y, PLACE[2] + world.car.parameters.wheel_radius)) + PLACE[0] * ahead
        view = View(position=position, forward=forward, up=up, fovy=FIELD_OF_VIEW, focus=position + ahead)
        return jpeg(self._renderer.rgb(complete_state(world.model, self._data), camera=view))


def jpeg(pixels: NDArray[np.uint8]) -> str:
    """Return a picture (height, width, 3) as a JPEG in base64.

    Raises:
      MissingExtraError: pillow is not installed.
    """
    try:
        from PIL import Image
    except ImportError as error:
        raise missing_extra("pictures of the front camera need pillow", "autodrive") from error
    written = io.BytesIO()
    Image.fromarray(pixels).save(written, format="JPEG", quality=_QUALITY)
    return base64.b64encode(written.getvalue()).decode("ascii")
