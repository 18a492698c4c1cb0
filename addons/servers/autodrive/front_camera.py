"""The front camera of AutoDRIVE's car, a picture for each packet: drawn, or blank where nobody looks at it."""

from __future__ import annotations

import base64
import io

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.addons.ros import front_camera
from fg_mujoco.errors import missing_extra
from fg_mujoco.messages import Odometry
from fg_mujoco.simulation.planner_adapter import Surroundings

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
        self._camera = front_camera.FrontCamera()

    def __call__(self, surroundings: Surroundings, odometry: Odometry) -> str:
        """See devkit.Camera."""
        return jpeg(self._camera.picture(surroundings))


def jpeg(pixels: NDArray[np.uint8]) -> str:
    """Return a picture (height, width, 3) as a JPEG in base64; MissingExtraError: pillow is not installed."""
    try:
        from PIL import Image
    except ImportError as error:
        raise missing_extra("pictures of the front camera need pillow", "autodrive") from error
    written = io.BytesIO()
    Image.fromarray(pixels).save(written, format="JPEG", quality=_QUALITY)
    return base64.b64encode(written.getvalue()).decode("ascii")
