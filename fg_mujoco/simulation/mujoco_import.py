"""Imports MuJoCo, or says in one line why it cannot be: half upgraded, damaged, or of a version that is not accepted.

With MUJOCO_GL=egl, `import mujoco` ends in a traceback from ctypes where there is no EGL. Then it is imported as with
MUJOCO_GL=disable: races need no pictures, and a request for one is refused with what to install (rendering/gl.py).

By default MuJoCo draws with the package `glfw`, which starts another Python to look for its library, and takes longer
to import than MuJoCo itself. Here it is imported once something draws.

MuJoCo imports NumPy, whose linear algebra has a thread for each core. They wait by spinning, and the matrices of a
command are small, so there it has one thread.
"""

from __future__ import annotations

import contextlib
import importlib.util
import os
import shlex
import sys
import threading
from types import ModuleType
from typing import Any, NoReturn

from ..errors import MissingExtraError
from ..interrupts import end_command, is_command

_LEAST, _BEYOND = (3, 17), (5,)  # versions of MuJoCo, as in pyproject.toml


def import_mujoco() -> None:
    """Import mujoco, with its own OpenGL or without."""
    if is_command():
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    wanted, platform = os.environ.get("MUJOCO_GL"), os.environ.get("PYOPENGL_PLATFORM")
    if not wanted:
        _import_glfw_later()
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


def _require_accepted() -> None:
    """Raise ImportError of a MuJoCo of another version, or one whose library is of another version than its Python."""
    import mujoco

    of_python, of_library = mujoco.__version__, mujoco.mj_versionString()
    if of_python != of_library:
        raise ImportError(f"its Python is {of_python}, its library {of_library}")
    if not _LEAST <= tuple(map(int, of_python.split(".")[:2])) < _BEYOND:
        raise ImportError(f"it is {of_python}")


def _refuse(error: Exception) -> NoReturn:
    """End the command; raise in another program."""
    python, accepted = shlex.quote(sys.executable or "python3"), "mujoco>=" + ".".join(map(str, _LEAST))
    commands = ("uninstall -y mujoco mujoco-core mujoco-studio", f"install '{accepted},<{_BEYOND[0]}'")
    why = " ".join(f"{type(error).__name__}: {error}".split())
    said = f"MuJoCo cannot be used: {why}; install it again: " + " && ".join(f"{python} -m pip {c}" for c in commands)
    end_command(said)
    raise MissingExtraError(said) from error


class _Later(ModuleType):
    """A module that is imported once something of it is asked for, later than by `LazyLoader`; other threads wait."""

    def __getattr__(self, name: str) -> Any:
        with _importing:
            if name in vars(self):  # another thread has imported it meanwhile
                return vars(self)[name]
            if name.startswith("__") or "_begun" in vars(self) or type(self) is ModuleType:
                raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")
            assert self.__spec__ is not None and self.__spec__.loader is not None
            vars(self)["_begun"] = True
            try:
                self.__spec__.loader.exec_module(self)
                self.__class__ = ModuleType  # type: ignore[assignment]
            finally:
                vars(self).pop("_begun", None)
        return getattr(self, name)


_importing = threading.RLock()


def _import_glfw_later() -> None:
    """Let `import glfw` import it once it is used."""
    if "glfw" in sys.modules or "mujoco" in sys.modules:
        return
    with contextlib.suppress(ImportError, ValueError):
        spec = importlib.util.find_spec("glfw")
        if spec is not None and spec.loader is not None:
            module = sys.modules["glfw"] = importlib.util.module_from_spec(spec)
            module.__class__ = _Later


def _keep_no_log() -> None:
    """Let MuJoCo print its warnings as always, and write no MUJOCO_LOG.TXT into the folder where somebody works."""
    import mujoco

    log = mujoco.MjLogConfig()
    log.logto_console = True
    mujoco.MjLogConfig.set(log)


try:
    import_mujoco()
    _require_accepted()
    _keep_no_log()
except Exception as error:
    _refuse(error)
