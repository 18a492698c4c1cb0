"""The library of MuJoCo, whose functions the native core calls once this module is imported."""

from __future__ import annotations

import ctypes
from pathlib import Path

import mujoco

from ..errors import EngineError
from ..native import load_mujoco


def _path() -> str:
    """Return the MuJoCo library that the Python package uses; EngineError: there is none beside it."""
    folder = Path(mujoco.__file__).parent
    for pattern in ("libmujoco.so*", "libmujoco*.dylib", "mujoco.dll"):
        for path in sorted(folder.glob(pattern)):
            return str(path)
    raise EngineError(f"there is no MuJoCo library in {folder}; accepted: the package `mujoco` as pip installs it")


LIBRARY_PATH = _path()
load_mujoco(LIBRARY_PATH)
# The package has MuJoCo ask for the time some fifty times a tick, for MjData.timer, which nobody reads.
ctypes.c_void_p.in_dll(ctypes.CDLL(LIBRARY_PATH), "mjcb_time").value = None
