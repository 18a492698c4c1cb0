"""Imports MuJoCo where MUJOCO_GL asks for a library that is not there: races need no pictures.

With MUJOCO_GL=egl, `import mujoco` itself looks for EGL and ends in a traceback from ctypes without it. Then it is
imported as with MUJOCO_GL=disable; whoever asks for a picture is told what to install (rendering/gl.py).
"""

from __future__ import annotations

import os


def import_mujoco() -> None:
    """Import mujoco, with its own OpenGL or without."""
    wanted, platform = os.environ.get("MUJOCO_GL"), os.environ.get("PYOPENGL_PLATFORM")
    try:
        import mujoco
    except Exception:
        if not wanted:
            raise
        os.environ["MUJOCO_GL"] = "disable"
        try:
            import mujoco  # noqa: F401
        finally:
            os.environ["MUJOCO_GL"] = wanted
            if platform is None:
                os.environ.pop("PYOPENGL_PLATFORM", None)


import_mujoco()
