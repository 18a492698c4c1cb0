"""Windows for scripts of f1tenth_gym: MuJoCo's viewer where there is a display, and a stub of the gym's window.

Callbacks get the stub, with the names that they read and write: the cars' corners in 50 px a metre, the camera, the
label, the batch. What they draw with pyglet's names is kept nowhere and shown nowhere.
"""

from __future__ import annotations

import importlib
import os
import sys
import warnings
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.errors import SettingsError, accepted_names

from .gym_functions import get_vertices
from .gym_world import Driving

MODES = ("human", "human_fast", "unlimited", "rgb_array")

CAR_LENGTH, CAR_WIDTH = 0.58, 0.31  # [m] as the gym draws cars
_SCALE = 50.0  # [px / m]
_PICTURE = (640, 480)  # [px] columns, rows

# Names of pyglet, all of which draw nothing. OpenGL's constants have their values, for arrays.
_CONSTANTS = {
    "GL_POINTS": 0, "GL_LINES": 1, "GL_LINE_LOOP": 2, "GL_LINE_STRIP": 3, "GL_TRIANGLES": 4, "GL_TRIANGLE_STRIP": 5,
    "GL_TRIANGLE_FAN": 6, "GL_QUADS": 7, "GL_QUAD_STRIP": 8, "GL_POLYGON": 9, "GL_SRC_ALPHA": 770,
    "GL_ONE_MINUS_SRC_ALPHA": 771, "GL_BLEND": 3042, "GL_DEPTH_TEST": 2929, "GL_LINE_SMOOTH": 2848,
    "GL_POINT_SMOOTH": 2832, "GL_MODELVIEW": 5888, "GL_PROJECTION": 5889, "GL_COLOR_BUFFER_BIT": 16384,
    "GL_DEPTH_BUFFER_BIT": 256, "GL_FRONT_AND_BACK": 1032, "GL_LINE": 6913, "GL_FILL": 6914, "GL_RGB": 6407,
    "GL_RGBA": 6408, "GL_UNSIGNED_BYTE": 5121, "GL_FLOAT": 5126,
}  # fmt: skip

_FUNCTIONS = (
    "glBegin", "glEnd", "glVertex2f", "glVertex3f", "glColor3f", "glColor3ub", "glColor4f", "glColor4ub", "glClear",
    "glClearColor", "glEnable", "glDisable", "glBlendFunc", "glHint", "glPointSize", "glLineWidth", "glMatrixMode",
    "glLoadIdentity", "glPushMatrix", "glPopMatrix", "glTranslatef", "glRotatef", "glScalef", "glOrtho", "gluOrtho2D",
    "glViewport", "glPolygonMode", "glFlush", "glReadPixels",
)  # fmt: skip

_MODULES = (
    "app", "canvas", "clock", "display", "event", "font", "gl", "graphics", "gui", "image", "input", "key", "math",
    "media", "mouse", "resource", "shapes", "sprite", "text", "util", "window",
)  # fmt: skip

_TYPES = ("GLfloat", "GLdouble", "GLint", "GLuint", "GLubyte", "GLenum")


class Permissive(type):
    """The type of what has every name, itself, too: pyglet.window.key.UP."""

    def __getattr__(cls, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return Nothing()


class Nothing(metaclass=Permissive):
    """A thing that is drawn nowhere: it takes whatever is done to it. Its attributes can be set, and read again."""

    def __init__(self, *_: Any, **named: Any) -> None:
        self.__dict__.update(named)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return Nothing()

    def __call__(self, *_: Any, **__: Any) -> Any:  # noqa: D102
        return Nothing()

    def __iter__(self) -> Iterator[Any]:
        return iter(())

    def __len__(self) -> int:
        return 0

    def __getitem__(self, _: Any) -> Any:
        return Nothing()

    def __setitem__(self, _: Any, __: Any) -> None:
        pass

    def __enter__(self) -> Any:
        return self

    def __exit__(self, *_: Any) -> None:
        pass

    def __float__(self) -> float:
        return 0.0

    def __int__(self) -> int:
        return 0

    __index__ = __int__

    def _number(self, *_: Any) -> float:
        return 0.0

    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __neg__ = _number


class Batch(Nothing):
    """Stub of pyglet's: what is added to it is a list of vertices whose values can be set."""

    def add(self, count: int = 0, *_: Any, **__: Any) -> Nothing:
        """Return a list of vertices."""
        return Nothing(vertices=[0.0] * (2 * count), colors=[0] * (3 * count))

    add_indexed = add


class EnvRenderer(Nothing):
    """Stub of the gym's window, of v0.2 and of v1.0: cars' `vertices` [px], camera, label, batch and `poses` (n, 3)."""

    def __init__(self, width: int = 1000, height: int = 800, **named: Any) -> None:
        super().__init__(**named)
        self.width, self.height = width, height
        self.left, self.right, self.top, self.bottom = -0.5 * width, 0.5 * width, 0.5 * height, -0.5 * height
        self.zoom_level, self.zoomed_width, self.zoomed_height = 1.2, width, height
        self.batch, self.fps_display = Batch(), Nothing()
        self.score_label: Any = Nothing(x=0, y=0, text="")
        self.poses: Any = None
        self.cars: list[Any] = []
        self.callbacks: list[Callable[[Any], Any]] = []

    def get_size(self) -> tuple[int, int]:
        """Return width and height [px]."""
        return self.width, self.height

    def update_map(self, *_: Any, **__: Any) -> None:
        """Take a map, which is not drawn here."""
        self.map_points = np.zeros((0, 3))

    def update_obs(self, obs: dict[str, Any]) -> None:
        """Take where the cars are, from an observation of v0.2."""
        self.ego_idx = obs["ego_idx"]
        self.obs = obs
        self.poses = np.column_stack((obs["poses_x"], obs["poses_y"], obs["poses_theta"])).astype(np.float64)
        if len(self.cars) != len(self.poses):
            self.cars = [Nothing(vertices=[], colors=[]) for _ in self.poses]
        for car, pose in zip(self.cars, self.poses, strict=True):
            car.vertices = (_SCALE * get_vertices(pose, CAR_LENGTH, CAR_WIDTH)).ravel().tolist()
        if "lap_times" in obs:
            lap, time = obs["lap_counts"][self.ego_idx], obs["lap_times"][0]
            self.score_label.text = f"Lap Time: {float(time):.2f}, Ego Lap Count: {float(lap):.0f}"

    def update(self, state: Any) -> None:
        """Take where the cars are, as v1.0 has it."""
        if state is not None:
            self.update_obs(state)

    def add_renderer_callback(self, callback: Callable[[Any], Any]) -> None:
        """Take a callback that draws."""
        self.callbacks.append(callback)

    def close(self) -> None:
        """Close nothing."""


class View:
    """Shows an environment in MuJoCo's viewer, or as pictures. Without a display it says so once, `warned`."""

    def __init__(self, driving: Driving, *, warned: bool = False) -> None:
        self._driving = driving
        self._window: Any = None
        self._renderer: Any = None
        self.warned = warned

    def show(self, *, paced: bool) -> None:
        """Show the present state in a window, at the pace of real time or as fast as it can be drawn."""
        if self.warned:
            return
        if self._window is None:
            try:
                self._window = self._open(paced)
            except Exception as error:  # of the window system, of any kind
                self._tell(error)
                return
        _ = self._driving.data
        self._window.show()

    def picture(self, ego: int) -> NDArray[np.uint8]:
        """Return a picture from behind the ego, black where nothing can be drawn. Shape (480, 640, 3)."""
        if not self.warned:
            try:
                if self._renderer is None:
                    from fg_mujoco.pictures.rendering import Renderer  # on the GPU, or on the CPU where there is none

                    self._renderer = Renderer(self._driving.world, size=_PICTURE, quality="draft", car=ego)
                picture: NDArray[np.uint8] = self._renderer.rgb(self._driving.data, "chase")
                return picture
            except Exception as error:  # of OpenGL, of any kind
                self._tell(error)
        return np.zeros((*_PICTURE[::-1], 3), np.uint8)

    def close(self) -> None:
        """Close the window and what draws pictures, if they are there."""
        for opened in (self._window, self._renderer):
            if opened is not None:
                opened.close()
        self._window = self._renderer = None

    def _open(self, paced: bool) -> Any:
        if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
            raise SettingsError("there is no display")
        from fg_mujoco.envs.rendering import Window

        return Window(self._driving.world, self._driving.data, self._driving.engine.period if paced else 0.0)

    def _tell(self, error: Exception) -> None:
        self.warned = True
        warnings.warn(f"render shows nothing and goes on: {error}", stacklevel=5)


def require_mode(mode: str) -> str:
    """Return a mode of rendering; SettingsError: there is none of the name."""
    if mode not in MODES:
        raise SettingsError(f"render mode {mode!r}; {accepted_names(mode, MODES)}")
    return mode


class Pyglet(ModuleType):
    """A module of pyglet: what is not said here draws nothing."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        if name in _MODULES:
            return importlib.import_module(f"{self.__name__}.{name}")
        return _CONSTANTS.get(name, 0) if name.startswith("GL_") else Nothing


def names_of(module: str) -> dict[str, Any]:
    """Return an attribute of a module of pyglet."""
    if module == "pyglet":
        return {"options": {}, "version": "1.5.27"}
    if module == "pyglet.graphics":
        return {"Batch": Batch, "Group": Nothing}
    if module.startswith("pyglet.gl"):
        from ctypes import c_double, c_float, c_int, c_ubyte, c_uint

        types = dict(zip(_TYPES, (c_float, c_double, c_int, c_uint, c_ubyte, c_uint), strict=True))
        return {**_CONSTANTS, **dict.fromkeys(_FUNCTIONS, Nothing()), **types}
    return {}
