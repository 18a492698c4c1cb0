"""Pictures and videos of worlds and of recorded drives, drawn without a window. Needs OpenGL; `gl` says which, and how.

    import fg_mujoco as fg

    picture = fg.render("runs/oval", time=12.5, camera="chase", size=(1280, 720))  # (720, 1280, 3) uint8
    depth = fg.render("runs/oval", time=12.5, camera="onboard", output="depth")  # [m]

    with fg.Renderer(world, size=(84, 84)) as renderer:  # in a loop, to train on pixels
        picture = renderer.rgb(simulation.data, camera="onboard")

    with fg.Film("runs/oval", camera="top") as film:  # a recorded drive, frame by frame
        fg.write_video("oval.mp4", film.frames(fps=30.0), size=film.size)

`gl` opens an OpenGL context, `scenery` compiles the model that is drawn, and `renderer` turns states into arrays.
`cameras` has the cameras, and `recorded_drive` a recording at any time. `overlays`, `planner_view`, `force_arrows` and
`telemetry_strip` draw over a picture. `film` puts all of this together, and `video` writes files.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import SettingsError, accepted_names
from ...racing.result import RaceResult
from ...racing.run_folder import Run
from ...simulation.simulation import Simulation
from .cameras import CAMERAS, View
from .film import Film
from .overlays import OVERLAYS, Overlays, find_overlays
from .presets import QUALITIES
from .recorded_drive import Drive
from .renderer import LABELS, Renderer
from .video import write_picture, write_video

OUTPUTS = ("rgb", "depth", "segmentation")

__all__ = [
    "CAMERAS",
    "LABELS",
    "OUTPUTS",
    "OVERLAYS",
    "QUALITIES",
    "Drive",
    "Film",
    "Overlays",
    "Renderer",
    "View",
    "find_overlays",
    "render",
    "write_picture",
    "write_video",
]


def render(
    source: Simulation | Drive | Run | RaceResult | str | Path,
    *,
    time: float | Sequence[float] | None = None,
    camera: str = "chase",
    car: int = 0,
    size: tuple[int, int] = (640, 480),
    quality: str = "good",
    output: str = "rgb",
    overlays: Overlays | None = None,
    controller: str | None = None,
) -> NDArray[Any]:
    """Return pictures of a simulation as it is now, or of a recorded drive at one time or several.

    Each call prepares again (half a second). For many pictures in a row use a Renderer or a Film.

    Args:
      source: a Simulation, a run folder, a Run or a RaceResult.
      time: of a recorded drive [s]; several give one picture each, along the first axis; None: its end.
      camera: a name in CAMERAS.
      car: that the camera follows, of several.
      size: width and height [px].
      quality: a name in QUALITIES.
      output: "rgb" (height, width, 3) uint8; "depth" (height, width) float32, along the view's axis [m], inf where
        there is sky; "segmentation" (height, width) uint8, places in LABELS.
      overlays: of a recorded drive, laid over "rgb"; None: none.
      controller: as of a Film: the planner that a run folder is asked again with.

    Raises:
      SettingsError, RunFolderError, MissingExtraError: as a Film, an unknown output, or a time outside of the drive.
    """
    if output not in OUTPUTS:
        raise SettingsError(f"output is {output!r}; {accepted_names(output, OUTPUTS)}")
    if isinstance(source, Simulation):
        if time is not None or overlays is not None:
            raise SettingsError("time and overlays are of recorded drives; accepted with a Simulation: None")
        with Renderer(source.world, size=size, quality=quality, car=car) as renderer:
            picture: NDArray[Any] = getattr(renderer, output)(source.data, camera)
            return picture
    take: Callable[[float], NDArray[Any]]
    overlays = overlays or Overlays()
    with Film(
        source, camera=camera, car=car, size=size, quality=quality, overlays=overlays, controller=controller
    ) as film:
        take = film.frame if output == "rgb" else film.depth if output == "depth" else film.segmentation
        if time is None or isinstance(time, (int, float)):
            return take(film.drive.end if time is None else float(time))
        return np.stack([take(float(each)) for each in time])
