"""A drive through one camera: pictures of any of its moments, with overlays.

with Film("runs/oval", camera="chase", size=(1280, 720)) as film:
    picture = film.frame(12.5)
    for picture in film.frames(fps=30.0): ...
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from ...arguments import explain_class
from ...display import brief
from ...errors import SettingsError
from ...lidar.beams import lidar_body
from ...messages import FloatArray
from ...racing.result import RaceResult
from ...racing.run_folder import Run
from ...simulation.cars import car_colour, car_prefix, lidar_prefix
from ...vehicle.car import car_parameters
from .cameras import Moment, View, find_camera
from .colours import STAGES
from .force_arrows import TireForceMeter, draw_arrows, draw_circles
from .overlays import Overlays, draw_beams, draw_marker, draw_trace, find_overlays
from .planner_view import PlannerEye, PlannerView
from .recorded_drive import Drive, Player, read_drive
from .renderer import Renderer
from .telemetry_strip import draw_legend, draw_strip, require_pillow, strip_height

_MARKED = 14.0  # [m] of a picture's height from which on the car gets a marker


@explain_class
class Film:
    """Pictures of a recorded drive. One frame does not depend on another.

    Args:
      source: a run folder, a Run or a RaceResult.
      camera: a name in CAMERAS.
      car: that it follows, of several; overlays are of it. A Drive has its own.
      size: width and height [px].
      quality: a name in QUALITIES.
      overlays: to be drawn; None: those that are usual for the camera.
      controller: planner that the overlay `beams` asks again for a run folder, which loads none by itself. None: there
        is only the scan. Of a RaceResult it is the one that raced.

    Attributes:
      drive: the recording.
      renderer: of its world.
      overlays: that are drawn.
      note: what is left out, and why, in one line; empty if nothing is.

    Raises:
      RunFolderError: no run folder, or a damaged one, or one of another version.
      SettingsError: an unknown camera or quality, a size that cannot be drawn, or a car that is not there.
      MissingExtraError: no OpenGL or no Pillow here; the message has the command that installs it.
    """

    def __init__(
        self,
        source: Drive | Run | RaceResult | str | Path,
        *,
        camera: str = "chase",
        car: int = 0,
        size: tuple[int, int] = (1280, 720),
        quality: str = "good",
        overlays: Overlays | None = None,
        controller: str | None = None,
    ) -> None:
        self._camera = find_camera(camera)
        self.overlays = overlays if overlays is not None else find_overlays(camera)
        self.drive = read_drive(source, car)
        prefix = car_prefix(self.drive.car)
        if self.overlays != Overlays():
            require_pillow()
        line = np.column_stack((self.drive.column("x_m"), self.drive.column("y_m")))
        self.renderer = Renderer(
            self.drive.xml, size=size, quality=quality, start=self.drive.start, around=line, car=self.drive.car
        )
        self._player = Player(self.drive, self.renderer)
        self._car = car_parameters(self.renderer.model, prefix)
        self._forces = TireForceMeter(self.renderer.model, prefix)
        self._lidar = lidar_body(self.renderer.model, lidar_prefix(self.drive.car))
        self._eye = PlannerEye(self.drive, controller=controller) if self.overlays.beams else None
        self.note = self._eye.missing if self._eye is not None else ""

    def __repr__(self) -> str:
        return brief(self, repr(self.renderer))

    def __enter__(self) -> Film:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def close(self) -> None:
        """Free what the graphics library holds."""
        self.renderer.close()

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [px]."""
        return self.renderer.size

    def times(self, fps: float = 30.0, start: float = 0.0, end: float | None = None) -> FloatArray:
        """Return the times of the frames from one time to another [s], at so many a second. Shape (n,) [s].

        Raises:
          SettingsError: a frame rate that is not positive or above 1000, or times that are not in the drive or order.
        """
        if not 0.0 < fps <= 1000.0:
            raise SettingsError(f"fps is {fps!r}; accepted: a number above 0, at most 1000")
        last = self.drive.end if end is None else end
        if not (0.0 <= start <= last <= self.drive.end + 1e-9):
            raise SettingsError(
                f"from {start:g} s to {last:g} s is not in {self.drive.name}; accepted: 0 to {self.drive.end:.3f} s, "
                "the earlier first"
            )
        return start + np.arange(math.floor((last - start) * fps + 1e-6) + 1) / fps

    def frames(self, fps: float = 30.0, start: float = 0.0, end: float | None = None) -> Iterator[NDArray[np.uint8]]:
        """Yield the frames one by one, (height, width, 3) uint8; arguments and errors as `times`."""
        for time in self.times(fps, start, end):
            yield self.frame(float(time))

    def frame(self, time: float) -> NDArray[np.uint8]:
        """Return the picture at a time [s], (height, width, 3) uint8; raise SettingsError outside of the drive."""
        show = self.overlays
        seen = self._eye.at_tick(self.drive.tick_at(time)) if self._eye is not None else None
        data, moment, view = self._look(time)
        forces = self._forces.read(data) if show.forces else None

        def decorate(scene: mujoco.MjvScene) -> None:
            if show.trace:
                draw_trace(scene, self.drive, time, moment.position, view, self.size[1])
            if forces is not None:
                draw_circles(scene, forces)
            if seen is not None:
                self._draw_beams(scene, seen, data, view)
            if view.is_parallel and view.height > _MARKED:
                poses = self.renderer.poses(data)
                for index, (position, heading) in enumerate(poses):
                    draw_marker(scene, position, heading, view, car_colour(index) if len(poses) > 1 else None)

        picture = self.renderer.rgb(data, view, decorate)
        if forces is not None:
            draw_arrows(picture, forces, view)
        if show.beams or show.trace:
            shown = tuple(name for name in STAGES if seen is not None and self._has(seen, name))
            draw_legend(picture, shown, show.trace)
        if show.strip:
            draw_strip(picture, self.drive, time, self._car)
        return picture

    def depth(self, time: float) -> NDArray[np.float32]:
        """Return the distances along the view's axis at a time [s]; see Renderer.depth."""
        data, _, view = self._look(time)
        return self.renderer.depth(data, view)

    def segmentation(self, time: float) -> NDArray[np.uint8]:
        """Return the label of each pixel at a time [s]; see Renderer.segmentation."""
        data, _, view = self._look(time)
        return self.renderer.segmentation(data, view)

    def view(self, time: float) -> View:
        """Return the View at a time [s]: where things are in the picture."""
        return self._look(time)[2]

    def _look(self, time: float) -> tuple[mujoco.MjData, Moment, View]:
        data = self._player.at(time)
        moment = self.renderer.moment(data, self.drive.time[:-1], self.drive.headings)
        height = self.size[1]
        rows = height - strip_height(height) * self.overlays.strip
        return data, moment, self.renderer.view(data, self._camera, moment, rows)

    def _draw_beams(self, scene: mujoco.MjvScene, seen: PlannerView, data: mujoco.MjData, view: View) -> None:
        pixels = max(self.size[1] / 720.0, 1.0) * self.renderer.oversampling
        draw_beams(scene, seen, data.xpos[self._lidar], pixels, 0.006)

    @staticmethod
    def _has(seen: PlannerView, name: str) -> bool:
        return name in seen.intermediate_scans or (name == "goal" and seen.goal is not None)
