"""Names of pyglet, for scripts that draw into f1tenth_gym's window: all are there, and nothing is drawn.

OpenGL's constants have their values, so that a script can put them into arrays.
"""

from __future__ import annotations

import importlib
from types import ModuleType
from typing import Any

from .drawing import Batch, Nothing

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
