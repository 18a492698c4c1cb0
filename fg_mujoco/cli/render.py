"""The command `fg-mujoco render`, and what `race --video` does: a run folder to a video, or to one picture of it."""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..racing.run_folder import read_summary
from .command import ASKED, FORCE, command, number, option, require_ending, whole
from .out import given, require_new
from .progress import ProgressLine, to_go

if TYPE_CHECKING:
    from ..pictures.rendering import Film
    from ..racing.result import RaceResult

_USUAL_SIZE = (1280, 720)
_TIMED, _LONG = 20, 3.0  # after so many frames it is said how long the video takes, where that is longer [s]
_CAMERA_NAMES = "chase, onboard, top, track, orbit"
_SWITCHES = {
    "beams": "the LiDAR's beams, coloured by the planner's use of them",
    "trace": "the trace so far, coloured by friction utilisation",
    "forces": "the tires' forces in their friction circles",
    "strip": "speed, the law's limit, steering, lap and friction utilisation along the lower edge",
}


def size_of(text: str) -> tuple[int, int]:
    """Read a width and a height."""
    found = re.fullmatch(r"(\d{1,6})[xX](\d{1,6})", text)
    if found is None:
        raise argparse.ArgumentTypeError(f"{text!r}; accepted: width and height in pixels, as 1280x720")
    return int(found[1]), int(found[2])


def check_film(path: Path, options: argparse.Namespace) -> None:
    """Refuse a video that could not be made, before a race is driven for it."""
    from ..pictures.rendering.gl import open_context
    from ..pictures.rendering.video import check_video

    check_video(path, _USUAL_SIZE)
    require_new(path, force=options.force, reads=given(options, "out", "video"))
    open_context(*_USUAL_SIZE).free()


def film_race(result: RaceResult, path: Path) -> None:
    """Write a video of a race: the chase camera with its usual overlays."""
    from ..pictures.rendering import Film

    with Film(result, size=_USUAL_SIZE) as film:
        _write(film, path, fps=30.0, quality="good", start=None, end=None)


def _cameras() -> Iterable[str]:
    from ..pictures.rendering.cameras import CAMERAS  # takes a while to import

    return CAMERAS


def _qualities() -> Iterable[str]:
    from ..pictures.rendering.presets import QUALITIES  # takes a while to import

    return QUALITIES


@command(
    option("folder", "written by race --out", "DIR"),
    option(
        "--camera", f"{_CAMERA_NAMES}; default: chase", "NAME", default="chase", names=_cameras
    ),
    option("--car", "car that the camera follows; default: 0", "N", whole, 0),
    option("--size", "pixels; default: 1280x720", "WxH", size_of, _USUAL_SIZE),
    option("--fps", "frames a second of the video; default: 30", "N", number, 30.0),
    option(
        "--quality", "draft, good, best; default: good", "NAME", default="good", names=_qualities
    ),
    option("--from", "begin there; default: the best lap, else 0", "S", number, dest="start"),
    option("--to", "end there; default: that of the best lap, else of the run", "S", number, dest="end"),
    option("--frame", "one picture, of this time, as PNG", "S", number),
    option("--out", ".mp4, .gif, or .png with --frame; default: DIR-CAMERA.mp4 here", "FILE", Path),
    *(
        option(f"--{name}", f"{text}; default: by camera", action=argparse.BooleanOptionalAction)
        for name, text in _SWITCHES.items()
    ),
    ASKED,
    FORCE,
)
def render_command(options: argparse.Namespace) -> int:
    """Draw a run folder as a video, or one moment of it as a picture."""
    from ..pictures.rendering import Film, find_overlays, write_picture
    from ..pictures.rendering.cameras import find_camera
    from ..pictures.rendering.presets import find_quality
    from ..pictures.rendering.video import check_video

    find_camera(options.camera)
    find_quality(options.quality)
    read_summary(options.folder)  # a folder that is none is refused before all else
    one = options.frame is not None
    whose = f"-car_{options.car}" if options.car else ""
    name = f"{Path(options.folder).resolve().name}-{options.camera}{whose}{'.png' if one else '.mp4'}"
    path = options.out or Path(name)
    require_ending(path if one else None, ".png", what="a picture", when=" with --frame")
    if not one:
        check_video(path, options.size)
    require_new(path, force=options.force, reads=[options.folder])
    overlays = find_overlays(options.camera, **{name: getattr(options, name) for name in _SWITCHES})
    with Film(
        options.folder, camera=options.camera, car=options.car, size=options.size, quality=options.quality,
        overlays=overlays, controller=options.controller,
    ) as film:  # fmt: skip
        if film.note:
            print(f"fg-mujoco: of the planner only its beams are drawn: {film.note}", file=sys.stderr)
        if not one:
            _write(film, path, fps=options.fps, quality=options.quality, start=options.start, end=options.end)
            return 0
        write_picture(path, film.frame(options.frame))
        print(f"{path}: {film.size[0]} x {film.size[1]} pixels at {options.frame:g} s, {film.renderer.description}")
    return 0


def _write(film: Film, path: Path, *, fps: float, quality: str, start: float | None, end: float | None) -> None:
    """Write a video, say before how long it will take, and in the end what was written.

    Without a start and an end, of several laps only the best is filmed.
    """
    from ..pictures.rendering.video import write_video

    best, what = film.drive.best_lap if start is end is None else None, ""
    if best is not None:
        lap, start, end = best
        what = f"lap {lap}, the best (render --from 0 films all laps): "
    count = len(film.times(fps, start or 0.0, end))
    began = time.perf_counter()
    with ProgressLine("preparing frames") as line:

        def watched() -> Iterator[Any]:
            for index, frame in enumerate(film.frames(fps, start or 0.0, end), start=1):
                yield frame
                rate = index / (time.perf_counter() - began)
                if index == _TIMED and (count - index) / rate > _LONG:
                    line.say(f"fg-mujoco: {path}: {what}{count} frames take some {count / rate:.0f} s")
                if line.due:
                    line.write(f"frame {index}/{count}  {rate:5.1f} frames/s{to_go((count - index) / rate)}")

        write_video(path, watched(), size=film.size, fps=fps, quality=quality)
    rate = count / (time.perf_counter() - began)
    width, height = film.size
    print(
        f"{path}: {what}{count} frames of {width} x {height} pixels, {count / fps:.1f} s, "
        f"{path.stat().st_size / 1e6:.1f} MB; {rate:.1f} frames/s, {film.renderer.description}"
    )
