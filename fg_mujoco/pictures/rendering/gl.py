"""An OpenGL context without a window: EGL, or OSMesa where there is no EGL.

MUJOCO_GL=egl|osmesa|glfw chooses, as with MuJoCo itself. The choice is made here and not when MuJoCo is imported,
because with MUJOCO_GL=egl that import fails on a machine without EGL, and races need no pictures.
"""

from __future__ import annotations

import atexit
import contextlib
import importlib
import os
import platform
import sys
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from ...errors import MissingExtraError, SettingsError, accepted_names

INSTALL_COMMAND = "apt-get install -y --no-install-recommends libegl1 libgl1"
"""Of what Debian and Ubuntu lack for pictures."""

_INSTALL_COMMANDS = {
    "egl": INSTALL_COMMAND,
    "osmesa": "apt-get install -y --no-install-recommends libosmesa6",
    "glfw": INSTALL_COMMAND,
}
_BACKENDS = tuple(_INSTALL_COMMANDS)
_CHOICE = "MUJOCO_GL"
_GL_RENDERER = 0x1F01  # glGetString: what draws
_PLATFORM = "PYOPENGL_PLATFORM"  # that PyOpenGL is bound to, once for a process
_PROCESSES: set[int] = set()  # that have opened a context: this one, and that from which it was forked


@dataclass(frozen=True, kw_only=True, eq=False)
class GraphicsContext:
    """A current OpenGL context; `description` says in one line what draws."""

    backend: str
    description: str
    handle: Any

    def make_current(self) -> None:
        """Make it the one that OpenGL calls of this thread go to."""
        self.handle.make_current()

    @contextlib.contextmanager
    def chosen(self) -> Iterator[None]:
        """Name its back end in MUJOCO_GL for a while: by that MuJoCo knows where to load OpenGL from."""
        before = os.environ.get(_CHOICE)
        if self.backend in _BACKENDS:
            os.environ[_CHOICE] = self.backend
        try:
            yield
        finally:
            if before is None:
                os.environ.pop(_CHOICE, None)
            else:
                os.environ[_CHOICE] = before

    def free(self) -> None:
        """Give it back."""
        atexit.unregister(self.free)
        with contextlib.suppress(Exception):  # whatever a driver says to that, there is nothing to be done
            self.handle.free()


def open_context(width: int, height: int) -> GraphicsContext:
    """Return a context of the first back end that works, made current, for pictures of this size at most [px].

    Raises:
      MissingExtraError: none works; the message has the command that installs one.
      SettingsError: MUJOCO_GL is no back end; this process was forked from one that has drawn, so OpenGL hangs.
    """
    if _PROCESSES and os.getpid() not in _PROCESSES:
        said = "pictures were drawn before this process was forked, and OpenGL cannot draw in both"
        raise SettingsError(f"{said}; accepted: spawned processes, as of AsyncVectorEnv(context='spawn')")
    wanted = os.environ.get(_CHOICE, "").strip().lower()
    if wanted in ("disable", "disabled", "off", "false", "0"):
        raise SettingsError(f"MUJOCO_GL is {wanted!r}, which switches pictures off; accepted: {', '.join(_BACKENDS)}")
    if platform.system() != "Linux":
        return _open("system", width, height)
    if wanted and wanted not in (*_BACKENDS, "enable", "enabled", "on", "true", "1", "glx"):
        raise SettingsError(f"MUJOCO_GL is {wanted!r}; {accepted_names(wanted, _BACKENDS)}")
    backends = (wanted,) if wanted in _INSTALL_COMMANDS else ("egl", "osmesa")
    # PyOpenGL that somebody else loaded may be bound to a platform that does not work: then it is loaded anew
    attempts = 2 if "OpenGL" in sys.modules else 1
    for backend in backends * attempts:
        # a missing library shows as AttributeError, OSError or ImportError, by the place where PyOpenGL trips over it
        with contextlib.suppress(Exception):
            return _open(backend, width, height)
    if wanted == "glfw":
        raise SettingsError("MUJOCO_GL is 'glfw', which needs a display, and there is none; accepted: egl, osmesa")
    raise MissingExtraError(f"3D pictures need OpenGL: {_INSTALL_COMMANDS.get(wanted, INSTALL_COMMAND)}")


def _open(backend: str, width: int, height: int) -> GraphicsContext:
    bound = os.environ.get(_PLATFORM)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of GLFW: it returns nothing, too
            handle = new_context(backend, width, height)
            handle.make_current()
        renderer = importlib.import_module("OpenGL.GL").glGetString(_GL_RENDERER)
        if not renderer:
            raise RuntimeError(f"{backend} has no OpenGL")
    except Exception:
        if bound is None:  # the attempt has set it, and the next back end needs another
            os.environ.pop(_PLATFORM, None)
            _forget_opengl()
        raise
    text = renderer.decode(errors="replace") if isinstance(renderer, bytes) else str(renderer)
    _PROCESSES.add(os.getpid())
    context = GraphicsContext(backend=backend, description=f"drawn by {text} through {backend}", handle=handle)
    atexit.register(context.free)  # before EGL's own display goes, which was registered earlier
    return context


def new_context(backend: str, width: int, height: int) -> Any:
    """Return a context of MuJoCo's that draws through a back end; "system": MuJoCo's own choice."""
    if backend == "system":
        import mujoco

        return mujoco.GLContext(width, height)
    return importlib.import_module(f"mujoco.{backend}").GLContext(width, height)


def _forget_opengl() -> None:
    """Unload a PyOpenGL that was bound to a platform that does not work."""
    for name in list(sys.modules):
        if name.partition(".")[0] == "OpenGL" or name.startswith(("mujoco.egl", "mujoco.osmesa")):
            del sys.modules[name]
