"""The commands `fg-mujoco track`: make, show, list and export courses."""

from __future__ import annotations

import argparse
import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..course.centreline_csv import write_centreline
from ..course.course import describe_course
from ..course.formats import TIGHT, track_names
from ..course.maps.export import SUFFIXES, export_tracks, exported_files, require_track
from ..course.maps.map_server import RESOLUTION, image_yaml
from ..course.maps.map_track import is_map, map_loops
from ..course.scenes.catalogue import describe_scene, scene_names
from ..course.writing import write_file
from ..errors import SettingsError
from ..pictures.plots import track_picture
from ..simulation.course_loading import load_track
from .options import number
from .out import require_new

_DONE = 0


def add_track(add: Callable[..., argparse.ArgumentParser], commands: Any) -> None:
    """Add the commands; `add` makes a command."""
    tracks = commands.add_parser("track", help="make, show and list tracks").add_subparsers(
        title="commands", required=True
    )
    command = add(tracks, "new", _new, "write a random circuit as a centreline CSV")
    command.add_argument("--seed", required=True, help="the same seed gives the same circuit")
    command.add_argument("--tight", action="store_true", help="narrow lanes back to back, as random:SEED:tight")
    command.add_argument("--force", action="store_true", help="replace the file if it exists")
    command.add_argument("path", metavar="FILE.csv", type=Path)

    command = add(tracks, "show", _show, "draw a track or a scene as a PNG")
    command.add_argument(
        "track", metavar="TRACK", help="NAME, random:SEED[:tight], scene:NAME:SEED, file.csv or map.yaml"
    )
    command.add_argument("--out", metavar="FILE.png", type=Path, help="default: NAME.png here")

    command = add(
        tracks, "from-image", _from_image, "write the YAML that makes a picture a map: light is free, dark is wall"
    )
    command.add_argument("image", metavar="IMAGE", type=Path, help="PNG, PGM, ...: seen from above, x to the right")
    command.add_argument("--resolution", type=number, required=True, metavar="M", help="metres of a pixel, as 0.05")
    command.add_argument("--negate", action="store_true", help="dark is free, light is wall")
    command.add_argument("--force", action="store_true", help="replace the YAML if it exists")

    add(tracks, "list", _list, "list the bundled tracks")
    add(tracks, "scenes", _scenes, "list the scenes")

    command = add(tracks, "export", _export, "write a track as a map, a centreline CSV or a mesh of its walls")
    command.add_argument("track", metavar="TRACK", help="NAME, random:SEED[:tight], file.csv or map.yaml")
    command.add_argument(
        "files", metavar="FILE", nargs="+", type=Path, help=f"of each suffix what it says: {', '.join(SUFFIXES)}"
    )
    command.add_argument(
        "--resolution", type=number, default=RESOLUTION, metavar="M", help=f"of a map's pixels; default: {RESOLUTION}"
    )
    command.add_argument("--force", action="store_true", help="replace files that exist")


def _new(options: argparse.Namespace) -> int:
    require_new(options.path, force=options.force)
    kind, option = (f":{TIGHT}", " --tight") if options.tight else ("", "")
    track = require_track(load_track(f"random:{options.seed}{kind}"))
    write_centreline(track, options.path, [f"made by: fg-mujoco track new --seed {options.seed}{option}"])
    print(f"{options.path}: {describe_course(track)}")
    return _DONE


def _show(options: argparse.Namespace) -> int:
    track = load_track(options.track)
    path = options.out or Path(f"{track.name.replace(':', '_')}.png")
    if path.suffix.lower() != ".png":
        raise SettingsError(f"{path}: is no name for a picture; accepted: one that ends in .png")
    picture = io.BytesIO()
    track_picture(track, picture)
    try:
        write_file(path, picture.getvalue())
    except OSError as error:
        raise SettingsError(f"{path}: cannot be written: {error.strerror or error}") from error
    print(f"{path}: {describe_course(track)}")
    if is_map(options.track):
        for loop in map_loops(options.track):
            if not loop.driven:
                x, y = loop.middle
                print(
                    f"another loop: {loop.length:.1f} m round ({x:.2f}, {y:.2f}), with the setting loop={loop.number}"
                )
    return _DONE


def _from_image(options: argparse.Namespace) -> int:
    path = options.image.with_suffix(".yaml")
    require_new(path, force=options.force)
    text = image_yaml(options.image, options.resolution, negate=options.negate)
    try:
        write_file(path, text.encode())
    except OSError as error:
        raise SettingsError(f"{path}: cannot be written: {error.strerror or error}") from error
    print(f"{path}: look at the course with fg-mujoco track show {path}")
    return _DONE


def _list(options: argparse.Namespace) -> int:
    print("\n".join(describe_course(load_track(name)) for name in track_names()))
    return _DONE


def _scenes(options: argparse.Namespace) -> int:
    print("\n".join(map(describe_scene, scene_names())))
    return _DONE


def _export(options: argparse.Namespace) -> int:
    for file in (file for path in options.files for file in exported_files(path)):
        require_new(file, force=options.force)
    track = require_track(load_track(options.track))
    print(*export_tracks(track, options.files, resolution=options.resolution), sep="\n")
    return _DONE
