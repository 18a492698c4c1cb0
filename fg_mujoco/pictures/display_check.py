"""Whether a window can be opened. MuJoCo's own viewer ends the whole process where GLFW finds no display."""

from __future__ import annotations

import os
import platform
import warnings


def can_open_window() -> bool:
    """Return whether GLFW, which opens MuJoCo's windows, finds a display."""
    if platform.system() == "Linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return False
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of GLFW: it returns nothing, too
        import glfw

        return bool(glfw.init())
