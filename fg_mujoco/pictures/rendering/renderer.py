"""Draws a world at a state: colours, depths and labels, as arrays.

    with Renderer(World("oval"), size=(640, 480)) as renderer:
        simulation.step(command)
        rgb = renderer.rgb(simulation.data, camera="onboard")
        depth = renderer.depth(simulation.data, camera="onboard")

The same state gives the same picture. One object serves the thread that made it.
"""

from __future__ import annotations

import math
import weakref
from collections.abc import Callable

import mujoco
import numpy as np
from numpy.typing import NDArray

from ...arguments import Uncopied, explain_class
from ...display import brief
from ...errors import SettingsError
from ...messages import FloatArray
from ...simulation.cars import BOX, car_prefixes, require_car
from ...simulation.world import World
from ...vehicle.car import element_id
from ...vehicle.tire_forces import TireForces
from .cameras import Camera, Moment, View, find_camera
from .gl import open_context
from .presets import find_quality
from .scenery import LOOK_PREFIX, WALL_TOPS, compile_scenery, semantic_labels

LABELS = ("nothing", "ground", "road", "start line", "wall", "obstacle", "car")
"""Meanings of the numbers of a segmentation."""

STATE = mujoco.mjtState.mjSTATE_INTEGRATION
_MOST_GEOMS = 20_000
_SUN_DISTANCE = 0.22  # in shadow radii: nearer, what is on this side throws no shadow; farther, the far side flickers
_LARGEST = 8192  # [px] of width and height; beyond, drawing in software runs out of memory

Decorate = Callable[[mujoco.MjvScene], None]
"""Adds geoms that are in no model to a scene."""


@explain_class
class Renderer(Uncopied):
    """Draws pictures of one world, all of one size.

    Args:
      world: a World, or the MJCF text of one.
      size: width and height [px].
      quality: a name in QUALITIES.
      start: a point on the start line, x and y [m]; None: that of the world's track, if it has one.
      around: points (n, 2) [m] that the camera `track` shows where there are no walls; None: 4 m round the origin.
      car: that the cameras follow, of several.

    Attributes:
      model: the compiled model for pictures; it takes the states of the world.
      tires: steps `model` by hand, tires included.
      oversampling: how many pixels are drawn for each of the picture's, along either side.
      description: what draws, in a line.

    Raises:
      SettingsError, ModelError: a value that cannot be drawn; a text that is not of a world.
      MissingExtraError: no OpenGL here; the message has the command that installs it.
    """

    def __init__(
        self,
        world: World | str,
        *,
        size: tuple[int, int] = (640, 480),
        quality: str = "good",
        start: tuple[float, float] | None = None,
        around: FloatArray | None = None,
        car: int = 0,
    ) -> None:
        preset = find_quality(quality)
        self.size = check_size(size)
        self.oversampling = preset.oversampling
        self._width, self._height = (self.oversampling * pixels for pixels in self.size)
        context = open_context(self._width, self._height)
        self._finalizer = weakref.finalize(self, context.free)
        self.description = context.description
        self._context = context
        if isinstance(world, World):
            start = start or track_start(world)
        xml = world.xml if isinstance(world, World) else world
        self.model = model = compile_scenery(xml, start)
        model.vis.global_.offwidth, model.vis.global_.offheight = self._width, self._height
        model.vis.quality.offsamples = preset.samples
        model.vis.quality.shadowsize = preset.shadow_size or 1
        self._data = mujoco.MjData(model)
        prefixes = car_prefixes(model)
        self.tires = TireForces(model, prefixes)
        self._scene = mujoco.MjvScene(model, _MOST_GEOMS)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = preset.shadow_size > 0
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        self._options = mujoco.MjvOption()
        self._camera = mujoco.MjvCamera()
        self._gl = self._make_buffers()
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._gl)
        self._gl.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR
        self._rect = mujoco.MjrRect(0, 0, self._width, self._height)
        self.car = require_car(car, len(prefixes))
        self._bases = [element_id(model, mujoco.mjtObj.mjOBJ_BODY, f"{prefix}base_link") for prefix in prefixes]
        self._carries_box = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, prefixes[car] + BOX) >= 0
        self._labels = semantic_labels(model, LABELS)
        self._bounds = _course_bounds(model, around)
        self._tops = {geom for geom in range(model.ngeom) if model.geom(geom).name.startswith(WALL_TOPS)}

    def __repr__(self) -> str:
        width, height = self.size
        return brief(self, f"{width} x {height} px", f"drawn by {self.description}")

    def _make_buffers(self) -> mujoco.MjrContext:
        try:
            with self._context.chosen():
                buffers = mujoco.MjrContext(self.model, mujoco.mjtFontScale.mjFONTSCALE_100)
        except mujoco.FatalError as error:
            reason = " ".join(str(error).split())
            width, height = self.size
            raise SettingsError(
                f"the size is {width} x {height} pixels, too large here: {reason}; accepted: a smaller one, or a lower "
                "quality"
            ) from error
        return buffers

    def __enter__(self) -> Renderer:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def close(self) -> None:
        """Free what the graphics library holds. The object is of no use afterwards."""
        if self._finalizer.alive:
            self._context.make_current()
            self._gl.free()
            self._finalizer()

    def set_state(self, state: FloatArray) -> mujoco.MjData:
        """Return data of `model` at a complete state of the world (mjSTATE_INTEGRATION), forces and poses current."""
        mujoco.mj_setState(self.model, self._data, state, STATE)
        self.tires.forward(self._data)
        return self._data

    def moment(
        self, data: mujoco.MjData, times: FloatArray | None = None, headings: FloatArray | None = None
    ) -> Moment:
        """Return what cameras need to know of a state; `times` [s] and `headings` [rad] are of the whole drive."""
        if times is None or headings is None:
            times, headings = np.empty(0), np.empty(0)
        base = self._bases[self.car]
        return Moment(
            time=float(data.time), position=data.xpos[base].copy(), rotation=data.xmat[base].reshape(3, 3).copy(),
            times=times, headings=headings, bounds=self._bounds, carries_box=self._carries_box,
        )  # fmt: skip

    def poses(self, data: mujoco.MjData) -> list[tuple[FloatArray, float]]:
        """Return the position (3,) [m] and the heading [rad] of the base_link of each car at a state."""
        axes = [data.xmat[base].reshape(3, 3)[:, 0] for base in self._bases]
        return [(data.xpos[base].copy(), math.atan2(x[1], x[0])) for base, x in zip(self._bases, axes, strict=True)]

    def view(
        self,
        data: mujoco.MjData,
        camera: str | Camera = "chase",
        moment: Moment | None = None,
        rows: int | None = None,
    ) -> View:
        """Return the View of a camera at a state; what it is to show goes into the upper `rows` [px], None: all."""
        take = find_camera(camera) if isinstance(camera, str) else camera
        width, height = self.size
        rows = rows or height
        view = take(moment or self.moment(data), width / rows)
        return view.with_margin_below(height / rows) if rows < height else view

    def rgb(
        self, data: mujoco.MjData | FloatArray, camera: str | Camera | View = "chase", decorate: Decorate | None = None
    ) -> NDArray[np.uint8]:
        """Return a picture. Shape (height, width, 3) uint8.

        Args:
          data: of the world, or of `model`; its body poses must be current. Or a complete state.
          camera: a name in CAMERAS, a Camera, or a View.
          decorate: adds what is in no model.
        """
        self._draw(data, camera, decorate)
        pixels = np.empty((self._height, self._width, 3), np.uint8)
        mujoco.mjr_readPixels(pixels, None, self._rect, self._gl)
        return _reduced(pixels[::-1], self.oversampling)

    def depth(self, data: mujoco.MjData | FloatArray, camera: str | Camera | View = "chase") -> NDArray[np.float32]:
        """Return distances along the view's axis [m], inf where there is only sky. Shape (height, width) float32."""
        view = self._draw(data, camera, None, labels=True)
        values = np.empty((self._height, self._width), np.float32)
        mujoco.mjr_readPixels(None, values, self._rect, self._gl)
        share = values[::-1][:: self.oversampling, :: self.oversampling].astype(np.float64)  # 1 at `near`, 0 at `far`
        near, far = view.near, view.far
        with np.errstate(divide="ignore"):
            metres = far - share * (far - near) if view.is_parallel else near * far / (near + share * (far - near))
        metres[share <= 0.0] = math.inf
        return metres.astype(np.float32)

    def segmentation(
        self, data: mujoco.MjData | FloatArray, camera: str | Camera | View = "chase"
    ) -> NDArray[np.uint8]:
        """Return the label of each pixel, as its place in LABELS. Shape (height, width) uint8."""
        self._draw(data, camera, None, labels=True)
        pixels = np.empty((self._height, self._width, 3), np.uint8)
        mujoco.mjr_readPixels(pixels, None, self._rect, self._gl)
        pixels = pixels[::-1][:: self.oversampling, :: self.oversampling]
        ids = pixels[..., 0] + 256 * pixels[..., 1].astype(np.int32) + 65536 * pixels[..., 2].astype(np.int32)
        table = np.zeros(self._scene.ngeom + 1, np.uint8)
        for geom in self._scene.geoms[: self._scene.ngeom]:
            if geom.segid >= 0:
                is_geom = geom.objtype == mujoco.mjtObj.mjOBJ_GEOM
                table[geom.segid + 1] = self._labels[geom.objid] if is_geom else LABELS.index("car")  # its rods
        labels: NDArray[np.uint8] = table[ids]
        return labels

    def _draw(
        self,
        data: mujoco.MjData | FloatArray,
        camera: str | Camera | View,
        decorate: Decorate | None,
        labels: bool = False,
    ) -> View:
        data = self._own(data)
        view = camera if isinstance(camera, View) else self.view(data, camera)
        scene = self._scene
        self._look(view)  # planes without end are laid out about the scene's cameras, which are else those of before
        mujoco.mjv_updateScene(
            self.model, data, self._options, None, self._camera, mujoco.mjtCatBit.mjCAT_ALL.value, scene
        )
        self._look(view)
        self._let_walls_cast()
        if decorate is not None:
            decorate(scene)
        for flag in (mujoco.mjtRndFlag.mjRND_SEGMENT, mujoco.mjtRndFlag.mjRND_IDCOLOR):
            scene.flags[flag] = labels
        self._context.make_current()
        mujoco.mjr_render(self._rect, scene, self._gl)
        return view

    def _let_walls_cast(self) -> None:
        """Let the faces of walls throw their shadow, and not the tops, which would throw jagged ones on the faces."""
        for geom in self._scene.geoms[: self._scene.ngeom]:
            if geom.objid in self._tops and geom.objtype == mujoco.mjtObj.mjOBJ_GEOM:
                geom.category = mujoco.mjtCatBit.mjCAT_DECOR.value

    def _own(self, data: mujoco.MjData | FloatArray) -> mujoco.MjData:
        """Return data of this model: that of the world has other geoms."""
        if data is self._data:
            return self._data
        if isinstance(data, np.ndarray):
            return self.set_state(data)
        own = self._data
        own.time, own.qpos[:], own.qvel[:] = data.time, data.qpos, data.qvel
        own.mocap_pos[:], own.mocap_quat[:] = data.mocap_pos, data.mocap_quat
        mujoco.mj_kinematics(self.model, own)
        mujoco.mj_comPos(self.model, own)
        mujoco.mj_tendon(self.model, own)
        mujoco.mj_camlight(self.model, own)
        return own

    def _look(self, view: View) -> None:
        """Point both eyes of the scene along a view, and the sun at what it looks at."""
        half = 0.5 * view.height if view.is_parallel else view.near * math.tan(0.5 * view.fovy)
        for eye in self._scene.camera:
            eye.pos, eye.forward, eye.up = view.position, view.forward, view.up
            eye.orthographic = int(view.is_parallel)
            eye.frustum_center, eye.frustum_bottom, eye.frustum_top = 0.0, -half, half
            eye.frustum_width = half * self._width / self._height
            eye.frustum_near, eye.frustum_far = view.near, view.far
        for light in self._scene.lights[: self._scene.nlight]:
            light.pos = view.focus - _SUN_DISTANCE * view.shadow_radius * np.array(light.dir)
        self._gl.shadowClip = view.shadow_radius
        self._scene.flags[mujoco.mjtRndFlag.mjRND_HAZE] = not view.is_parallel  # at a horizon that it has not


def check_size(size: tuple[int, int]) -> tuple[int, int]:
    """Return a size of pictures as two whole numbers; raise SettingsError for none, or one that is too large."""
    accepted = f"two whole numbers from 16 to {_LARGEST}, width and height"
    try:
        width, height = (int(pixels) for pixels in size)
    except (TypeError, ValueError):
        raise SettingsError(f"the size is {size!r}; accepted: {accepted}") from None
    if (width, height) != tuple(size) or not (16 <= width <= _LARGEST and 16 <= height <= _LARGEST):
        raise SettingsError(f"the size is {width} x {height} pixels; accepted: {accepted}")
    return width, height


def track_start(world: World) -> tuple[float, float]:
    """Return the start of the race on a world's track, x and y [m]."""
    x, y, _ = world.track.start_pose()
    return float(x), float(y)


def _course_bounds(model: mujoco.MjModel, around: FloatArray | None) -> FloatArray:
    """Return least and greatest x and y of walls and obstacles (2, 2) [m]; without any, of `around` and 4 m about 0."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    points = []
    for geom in range(model.ngeom):
        name = model.geom(geom).name
        if (
            not name.startswith(("wall", "obstacle_", f"{LOOK_PREFIX}wall"))
            or model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_MESH
        ):
            continue
        mesh = model.geom_dataid[geom]
        first = model.mesh_vertadr[mesh]
        vertices = model.mesh_vert[first : first + model.mesh_vertnum[mesh]]
        points.append((vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])[:, :2])
    if not points:
        points = [np.array([[-4.0, -4.0], [4.0, 4.0]]), *([] if around is None else [around])]
    every = np.concatenate(points)
    return np.array([every.min(axis=0), every.max(axis=0)])


def _reduced(pixels: NDArray[np.uint8], factor: int) -> NDArray[np.uint8]:
    """Return a picture made smaller by the mean of each square of pixels."""
    if factor == 1:
        return np.ascontiguousarray(pixels)
    height, width = pixels.shape[0] // factor, pixels.shape[1] // factor
    squares = pixels.reshape(height, factor, width, factor, 3).astype(np.uint16)
    result: NDArray[np.uint8] = ((squares.sum(axis=(1, 3)) + factor * factor // 2) // (factor * factor)).astype(
        np.uint8
    )
    return result
