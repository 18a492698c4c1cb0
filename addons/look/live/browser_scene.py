"""The 3D scene of a live race in a browser: the world, the LiDAR's points, the goal, the trace, and the cameras."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from fg_mujoco.messages import FloatArray
from fg_mujoco.pictures.rendering.scenery import MOVING_COLOUR, OBSTACLE_COLOUR
from fg_mujoco.simulation.physics import STATE

from .browser_shapes import world_shapes
from .live_session import LiveSession

CAMERAS = ("chase", "above", "course", "free")

_BEAM_STEP = 2  # every other beam is shown
_SCAN, _TRACE, _GOAL = (255, 70, 50), (40, 110, 230), (60, 200, 90)
_OBSTACLE, _MOVING = (tuple(round(255 * part) for part in colour[:3]) for colour in (OBSTACLE_COLOUR, MOVING_COLOUR))

_SHOWN_LINE = 3.0  # [pixels]

LEGEND = {
    "where LiDAR beams end": _SCAN, "where the planner steers to": _GOAL, "driven since the reset": _TRACE,
    "obstacles": _OBSTACLE, "obstacles that move": _MOVING,
}  # fmt: skip
"""Colours of the things in the scene."""


class LiveScene:
    """Shows a session in an empty scene of viser's."""

    def __init__(self, scene: Any, session: LiveSession) -> None:
        self._scene, self._session = scene, session
        self._model, shapes = world_shapes(session.world)
        self._data = mujoco.MjData(self._model)
        scene.set_up_direction("+z")
        scene.set_background_image(_sky())
        scene.configure_default_lights(cast_shadow=False)  # they cost most of the time, and leave seams on the floor
        self._frames: dict[int, Any] = {}
        for number, shape in enumerate(shapes):
            parent = "/course"
            if shape.body != 0:
                parent = f"/body_{shape.body}"
                if shape.body not in self._frames:
                    self._frames[shape.body] = scene.add_frame(parent, show_axes=False)
            scene.add_mesh_simple(
                f"{parent}/shape_{number}", shape.vertices, shape.faces, color=shape.colour, flat_shading=True,
                side="double", opacity=shape.opacity if shape.opacity < 1.0 else None,
            )  # fmt: skip
        self._points = scene.add_point_cloud(
            "/scan", self._scan_points(), _SCAN, point_size=0.025, point_shape="circle", precision="float32"
        )
        self._goal = scene.add_icosphere("/goal", radius=0.12, color=_GOAL)
        self._trace: Any = None
        self._shown: dict[tuple[Any, ...], tuple[str, Any]] = {}  # what the planner shows, by kind, colour and size
        course = session.world.track
        if not course.closed:
            line = np.column_stack((course.ground_lines[-1], [0.01, 0.01]))[np.newaxis]
            scene.add_line_segments("/finish", line.astype(np.float32), _GOAL, thickness=6.0, thickness_units="screen")

    def show(self) -> None:
        """Move everything but the trace to where it is now, with what the planner shows."""
        mujoco.mj_setState(self._model, self._data, self._session.simulation.state, STATE)
        mujoco.mj_kinematics(self._model, self._data)
        for body, frame in self._frames.items():
            frame.position, frame.wxyz = self._data.xpos[body], self._data.xquat[body]
        self._points.points = self._scan_points()
        goal = self._session.goal()
        self._goal.visible = goal is not None
        if goal is not None:
            self._goal.position = goal
        self.show_drawings()

    def show_trace(self) -> None:
        """Draw the trace anew."""
        trace = self._session.trace
        if len(trace) > 1:
            line = np.column_stack((trace, np.full(len(trace), 0.02))).astype(np.float32)
            pieces = np.stack((line[:-1], line[1:]), axis=1)
            self._trace = self._scene.add_line_segments(
                "/trace", pieces, _TRACE, thickness=4.0, thickness_units="screen"
            )
        elif self._trace is not None:
            self._trace.remove()
            self._trace = None

    def show_drawings(self) -> None:
        """Draw what the planner shows of its work, one cloud or bundle of lines for each colour and size."""
        alike: dict[tuple[Any, ...], list[FloatArray]] = {}
        for each in self._session.drawings():
            alike.setdefault((each.points.ndim, each.colour, each.size), []).append(each.points)
        for key in [key for key in self._shown if key not in alike]:
            self._shown.pop(key)[1].remove()
        for key, parts in alike.items():
            points = np.concatenate(parts).astype(np.float32)
            if key in self._shown:
                self._shown[key][1].points = points
                continue
            taken = {name for name, _ in self._shown.values()}
            name = next(name for number in range(len(taken) + 1) if (name := f"/shown_{number}") not in taken)
            dimensions, colour, size = key
            shown: Any
            if dimensions == 3:
                shown = self._scene.add_line_segments(
                    name, points, colour, thickness=_SHOWN_LINE, thickness_units="screen"
                )  # fmt: skip
            else:
                shown = self._scene.add_point_cloud(
                    name, points, colour, point_size=size, point_shape="circle", precision="float32"
                )
            self._shown[key] = name, shown

    def _scan_points(self) -> NDArray[np.float32]:
        """Return the ends of beams, always as many points: those of beams without a reading are in the car."""
        points = self._session.scan_points(_BEAM_STEP)
        count = len(self._session.scan.ranges[::_BEAM_STEP])
        x, y, _ = self._session.simulation.pose
        return np.concatenate((points, np.tile((x, y, 0.0), (count - len(points), 1)))).astype(np.float32)


def camera_view(session: LiveSession, camera: str) -> tuple[FloatArray, FloatArray] | None:
    """Return a camera's position and the point that it looks at, (3,) [m] each; None for one that is moved by hand."""
    if camera == "free":
        return None
    if camera == "course":
        low, high = session.world.track.bounds
        middle, size = np.append(0.5 * (low + high), 0.0), float((high - low).max())
        return middle + np.array([0.0, -0.5 * size, 0.9 * size + 2.0]), middle
    x, y, heading = session.simulation.pose
    car, ahead = np.array([x, y, 0.0]), np.array([math.cos(heading), math.sin(heading), 0.0])
    if camera == "chase":
        return car - 1.6 * ahead + np.array([0.0, 0.0, 0.9]), car + 1.2 * ahead
    return car + np.array([0.0, -0.01, 9.0]), car


def _sky() -> NDArray[np.uint8]:
    """Return a picture of the sky, light at the horizon. Shape (64, 64, 3)."""
    shares = np.clip(np.linspace(0.0, 2.0, 64), 0.0, 1.0)[:, None]
    rows = (1.0 - shares) * np.array([110, 160, 220]) + shares * np.array([225, 234, 242])
    return np.repeat(rows[:, None], 64, axis=1).astype(np.uint8)
