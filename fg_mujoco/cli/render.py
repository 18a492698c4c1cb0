"""The command `fg-mujoco render`, and what `race --video` does: a run folder to a video, or to one picture of it."""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import SettingsError
from ..racing.run_folder import read_summary
from .options import add_trust_option, number, whole
from .progress import ProgressLine, to_go

if TYPE_CHECKING:
    from ..pictures.rendering import Film
    from ..racing.result import RaceResult

_DONE = 0
_USUAL_SIZE = (1280, 720)
_TIMED, _LONG = 20, 3.0  # after so many frames it is said how long the video takes, where that is longer [s]
_CAMERA_NAMES = "chase, onboard, top, track, orbit"
_SWITCHES = {
    "beams": "the LiDAR's beams, coloured by what the planner made of them",
    "trace": "the trace so far, coloured by friction utilisation",
    "forces": "the tires' forces in their friction circles",
    "strip": "speed, the law's limit, steering, lap and friction utilisation along the lower edge",
}


def add_render(add_command: Callable[..., argparse.ArgumentParser], commands: Any) -> None:
    """Add the command; `add_command` is the one that adds the others."""
    command = add_command(commands, "render", _render, "draw a run folder as a video, or one moment of it as a picture")
    add = command.add_argument
    add("folder", metavar="DIR", help="written by race --out")
    add("--camera", default="chase", metavar="NAME", help=f"{_CAMERA_NAMES}; default: chase")
    add("--car", type=whole, default=0, metavar="N", help="that the camera follows, of several; default: 0")
    add("--size", type=size_of, default=_USUAL_SIZE, metavar="WxH", help="pixels; default: 1280x720")
    add("--fps", type=number, default=30.0, metavar="N", help="frames a second of the video; default: 30")
    add("--quality", default="good", metavar="NAME", help="draft, good, best; default: good")
    add("--from", dest="start", type=number, metavar="S", help="begin there; default: the best lap, else 0")
    add("--to", dest="end", type=number, metavar="S", help="end there; default: that of the best lap, else of the run")
    add("--frame", type=number, metavar="S", help="one picture, of this time, as PNG")
    add("--out", type=Path, metavar="FILE", help=".mp4, .gif, or .png with --frame; default: DIR-CAMERA.mp4 here")
    for name, text in _SWITCHES.items():
        add(f"--{name}", action=argparse.BooleanOptionalAction, default=None, help=f"{text}; default: by camera")
    add_trust_option(add)


def size_of(text: str) -> tuple[int, int]:
    """Read a width and a height."""
    found = re.fullmatch(r"(\d{1,6})[xX](\d{1,6})", text)
    if found is None:
        raise argparse.ArgumentTypeError(f"{text!r}; accepted: width and height in pixels, as 1280x720")
    return int(found[1]), int(found[2])


def check_film(path: Path) -> None:
    """Refuse a video that could not be made, before a race is driven for it."""
    from ..pictures.rendering.gl import open_context
    from ..pictures.rendering.video import check_video

    check_video(path, _USUAL_SIZE)
    open_context(*_USUAL_SIZE).free()


def film_race(result: RaceResult, path: Path) -> None:
    """Write a video of a race: the chase camera with its usual overlays."""
    from ..pictures.rendering import Film

    with Film(result, size=_USUAL_SIZE) as film:
        _write(film, path, fps=30.0, quality="good", start=None, end=None)


def _render(options: argparse.Namespace) -> int:
    from ..pictures.rendering import Film, find_overlays, write_picture
    from ..pictures.rendering.cameras import find_camera
    from ..pictures.rendering.presets import find_quality
    from ..pictures.rendering.video import check_place, check_video

    find_camera(options.camera)
    find_quality(options.quality)
    read_summary(options.folder)  # a folder that is none is refused before all else
    one = options.frame is not None
    whose = f"-car_{options.car}" if options.car else ""
    name = f"{Path(options.folder).resolve().name}-{options.camera}{whose}{'.png' if one else '.mp4'}"
    path = options.out or Path(name)
    if one and path.suffix.lower() != ".png":
        raise SettingsError(f"{path}: is no name for a picture; accepted with --frame: one that ends in .png")
    check_place(path) if one else check_video(path, options.size)
    overlays = find_overlays(options.camera, **{name: getattr(options, name) for name in _SWITCHES})
    with Film(
        options.folder,
        camera=options.camera,
        car=options.car,
        size=options.size,
        quality=options.quality,
        overlays=overlays,
        trust=options.trust,
    ) as film:
        if film.note:
            print(f"fg-mujoco: of the planner only its beams are drawn: {film.note}", file=sys.stderr)
        if not one:
            _write(film, path, fps=options.fps, quality=options.quality, start=options.start, end=options.end)
            return _DONE
        write_picture(path, film.frame(options.frame))
        print(f"{path}: {film.size[0]} x {film.size[1]} pixels at {options.frame:g} s, {film.renderer.description}")
    return _DONE


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
