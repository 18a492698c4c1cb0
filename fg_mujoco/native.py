"""The native core, the compiled module `fg_mujoco._native`: loads it, and says in one line what is wrong with it.

Its sources are in the folder native/ of the repository. `core` is the module; its functions take contiguous arrays of
the types that `_native.pyi` names, and never a copy of one.
"""

from __future__ import annotations

import ctypes
import platform
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from .errors import EngineError
from .interrupts import end_command

__all__ = ["check_record", "core", "load_mujoco", "mujoco_library", "record"]

_INTERFACE = 1  # FG_INTERFACE of native/CMakeLists.txt
_MENDED_BY = "to build it: make native in a checkout, else pip install --force-reinstall --no-deps fg-mujoco"


def _refuse(said: str, error: Exception | None = None) -> NoReturn:
    """End the command; raise EngineError in another program."""
    end_command(f"{said}; {_MENDED_BY}")
    raise EngineError(f"{said}; {_MENDED_BY}") from error


def _loaded() -> Any:
    """Return the module.

    Raises:
      EngineError: it is missing, built for another Python, only half there, or of other sources than these.
    """
    try:
        from . import _native
    except ImportError as error:
        version = f"{platform.python_implementation()} {platform.python_version()}"
        said = " ".join(str(error).split())
        _refuse(f"the native core does not load in {version} ({said})", error)
    found = getattr(_native, "INTERFACE", None)
    if found != _INTERFACE:
        _refuse(f"the native core has interface {found}, and these sources need {_INTERFACE}")
    return _native


if TYPE_CHECKING:
    from . import _native as core
else:
    core = _loaded()


@cache
def mujoco_library() -> ctypes.CDLL:
    """Return the MuJoCo library of the Python package, whose functions the core calls from then on.

    Raises:
      EngineError: there is none beside the package, or as of `load_mujoco`.
    """
    import mujoco

    folder = Path(mujoco.__file__).parent
    names = ("libmujoco.so*", "libmujoco*.dylib", "mujoco.dll")
    path = next((str(path) for name in names for path in sorted(folder.glob(name))), None)
    if path is None:
        raise EngineError(f"there is no MuJoCo library in {folder}; accepted: the package `mujoco` as pip installs it")
    load_mujoco(path)
    library = ctypes.CDLL(path)
    # The package has MuJoCo ask for the time some fifty times a tick, for MjData.timer, which nobody reads.
    ctypes.c_void_p.in_dll(library, "mjcb_time").value = None
    return library


def load_mujoco(path: str) -> None:
    """Look up the functions of the MuJoCo library in a file, for all that the core does with MuJoCo.

    Raises:
      EngineError: it lacks one, or is of another version than the core was built for.
    """
    try:
        core.load_mujoco(path)
    except RuntimeError as error:
        _refuse(str(error), error)


def check_record(name: str, dtype: np.dtype[Any], fields: dict[str, int]) -> None:
    """Check that a numpy type has the fields of a structure of the native core, at the same offsets [bytes].

    Raises:
      EngineError: it has not.
    """
    found = {} if dtype.fields is None else {field: int(of[1]) for field, of in dtype.fields.items()}
    if found != fields:
        _refuse(f"the native core has another layout of {name}")


def record(name: str, fields: list[Any]) -> np.dtype[np.void]:
    """Return the numpy type of a record of the native core.

    Args:
      name: of its structure in native/.
      fields: as `np.dtype` takes them.

    Raises:
      EngineError: the structure has other fields, or has them elsewhere.
    """
    dtype = np.dtype(fields, align=True)
    size, found = core.RECORDS[name]
    check_record(name, dtype, found)
    if dtype.itemsize != size:
        _refuse(f"the native core has another layout of {name}")
    return dtype
