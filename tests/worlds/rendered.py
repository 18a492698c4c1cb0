"""What the tests of rendering share: whether there is OpenGL here, and how to look at a picture."""

import numpy as np
import pytest

from fg_mujoco.errors import MissingExtraError
from fg_mujoco.pictures.rendering.gl import open_context


def _missing():
    try:
        open_context(16, 16).free()
    except MissingExtraError as error:
        return str(error)
    return ""


needs_gl = pytest.mark.skipif(bool(_missing()), reason=_missing() or "OpenGL is here")


def pixel(view, point, size):
    """Column and row of the pixel that shows a point (3,) [m], if nothing is in front of it."""
    (column, row), *_ = view.project(point, size)[0]
    return int(np.floor(column)), int(np.floor(row))


def inside(column, row, size, margin=2):
    return margin <= column < size[0] - margin and margin <= row < size[1] - margin
