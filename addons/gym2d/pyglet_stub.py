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
    "GL_TRIANGLE_FAN": 6, "GL_QUADS": 7, "GL_QUAD_STRIP": 8, "GL_POLYGON": 9, "GL_ZERO": 0, "GL_ONE": 1, "GL_FALSE": 0,
    "GL_TRUE": 1, "GL_SRC_ALPHA": 770, "GL_ONE_MINUS_SRC_ALPHA": 771, "GL_BLEND": 3042, "GL_DEPTH_TEST": 2929,
    "GL_LINE_SMOOTH": 2848, "GL_POINT_SMOOTH": 2832, "GL_MODELVIEW": 5888, "GL_PROJECTION": 5889,
    "GL_COLOR_BUFFER_BIT": 16384, "GL_DEPTH_BUFFER_BIT": 256, "GL_TEXTURE_2D": 3553, "GL_UNSIGNED_BYTE": 5121,
    "GL_FLOAT": 5126, "GL_RGB": 6407, "GL_RGBA": 6408, "GL_FRONT_AND_BACK": 1032, "GL_LINE": 6913, "GL_FILL": 6914,
    "GL_LINE_SMOOTH_HINT": 3154, "GL_NICEST": 4354, "GL_LINE_STIPPLE": 2852, "GL_CULL_FACE": 2884, "GL_BACK": 1029,
    "GL_FRONT": 1028, "GL_LESS": 513, "GL_LEQUAL": 515, "GL_NEAREST": 9728, "GL_LINEAR": 9729, "GL_COMPILE": 4864,
    "GL_PACK_ALIGNMENT": 3333, "GL_MULTISAMPLE": 32925, "GL_SCISSOR_TEST": 3089, "GL_STENCIL_TEST": 2960,
    "GL_CURRENT_BIT": 1, "GL_POINT_BIT": 2, "GL_LINE_BIT": 4, "GL_ENABLE_BIT": 8192, "GL_ALL_ATTRIB_BITS": 1048575,
    "GL_POINT_SIZE": 2833, "GL_LINE_WIDTH": 2849, "GL_VIEWPORT": 2978, "GL_BLEND_DST": 3040, "GL_BLEND_SRC": 3041,
}  # fmt: skip

_FUNCTIONS = (
    "glBegin", "glEnd", "glVertex2f", "glVertex2d", "glVertex2i", "glVertex3f", "glVertex3d", "glColor3f", "glColor3ub",
    "glColor4f", "glColor4ub", "glClear", "glClearColor", "glEnable", "glDisable", "glBlendFunc", "glHint",
    "glPointSize", "glLineWidth", "glLineStipple", "glMatrixMode", "glLoadIdentity", "glPushMatrix", "glPopMatrix",
    "glTranslatef", "glRotatef", "glScalef", "glOrtho", "gluOrtho2D", "gluPerspective", "glViewport", "glPolygonMode",
    "glFlush", "glFinish", "glReadPixels", "glReadBuffer", "glPushAttrib", "glPopAttrib", "glGetFloatv",
    "glGetIntegerv", "glGetString", "glGenLists", "glNewList", "glEndList", "glCallList", "glDeleteLists",
    "glBindTexture", "glTexParameteri", "glDepthFunc", "glCullFace", "glFrontFace", "glShadeModel", "glScissor",
    "glRectf", "glMultMatrixf", "glLoadMatrixf",
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
