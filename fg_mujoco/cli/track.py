"""The commands `fg-mujoco track`: make, show, list and export courses."""

from __future__ import annotations

import argparse
import io
from pathlib import Path

from ..course.centreline_csv import load_centreline, write_centreline
from ..course.course import describe_course
from ..course.files import is_file, noting_files
from ..course.formats import TIGHT, parted, track_names
from ..course.line_file import raceline_columns, raceline_text, read_line_file
from ..course.maps.export import SUFFIXES, export_tracks, exported_files, require_track
from ..course.maps.map_server import RESOLUTION, image_yaml
from ..course.maps.map_track import is_map, map_loops
from ..course.scenes import describe_scene, scene_names
from ..course.track import MIN_POINTS
from ..course.writing import write_file, writing
from ..errors import TrackError
from ..pictures.plots import track_picture
from ..simulation.course_loading import load_track
from .command import FORCE, Commands, command, number, option, require_ending
from .options import NAMES
from .out import require_new


@command(
    option("--seed", "the same seed gives the same circuit", "SEED", required=True),
    option("--tight", "narrow lanes back to back, as random:SEED:tight"),
    FORCE,
    option("path", "of the file", "FILE.csv", Path),
)
def _new(options: argparse.Namespace) -> int:
    """Write a random circuit as a centreline CSV."""
    require_new(options.path, force=options.force)
    kind, option = (f":{TIGHT}", " --tight") if options.tight else ("", "")
    track = require_track(load_track(f"random:{options.seed}{kind}"))
    write_centreline(track, options.path, [f"made by: fg-mujoco track new --seed {options.seed}{option}"])
    print(f"{options.path}: {describe_course(track)}")
    return 0


@command(
    option("track", "NAME, random:SEED[:tight], scene:NAME:SEED, file.csv or map.yaml", "TRACK", names=NAMES["track"]),
    option("--out", "default: NAME.png here; of a map, which has that image, NAME_course.png", "FILE.png", Path),
    FORCE,
)
def _show(options: argparse.Namespace) -> int:
    """Draw a track or a scene as a PNG."""
    require_ending(options.out, ".png", what="a picture")
    with noting_files() as read:
        track = load_track(options.track)
    plain, _ = parted(options.track)
    beside = "_course" if is_map(plain) else ""
    path = options.out or Path(f"{track.name.replace(':', '_')}{beside}.png")
    require_new(path, force=options.force, reads=read)
    picture = io.BytesIO()
    track_picture(track, picture)
    with writing(path):
        write_file(path, picture.getvalue())
    print(f"{path}: {describe_course(track)}")
    if is_map(plain):
        for loop in map_loops(plain):
            if not loop.driven:
                x, y = loop.middle
                print(
                    f"another loop: {loop.length:.1f} m round ({x:.2f}, {y:.2f}), with the setting loop={loop.number}"
                )
    return 0


@command(
    option("image", "PNG, PGM, ...: seen from above, x to the right", "IMAGE", Path),
    option("--resolution", "metres of a pixel, as 0.05", "M", number, required=True),
    option("--negate", "dark is free, light is wall"),
    FORCE,
)
def _from_image(options: argparse.Namespace) -> int:
    """Write the YAML that makes a picture a map: light is free, dark is wall."""
    path = options.image.with_suffix(".yaml")
    require_new(path, force=options.force, reads=[options.image])
    text = image_yaml(options.image, options.resolution, negate=options.negate)
    with writing(path):
        write_file(path, text.encode())
    print(f"{path}: look at the course with fg-mujoco track show {path}")
    return 0


@command()
def _list(options: argparse.Namespace) -> int:
    """List the bundled tracks."""
    print("\n".join(describe_course(load_track(name)) for name in track_names()))
    return 0


@command()
def _scenes(options: argparse.Namespace) -> int:
    """List the scenes."""
    print("\n".join(map(describe_scene, scene_names())))
    return 0


@command(
    option("track", "NAME, random:SEED[:tight], file.csv or map.yaml", "TRACK", names=track_names),
    option("files", f"of each suffix what it says: {', '.join(SUFFIXES)}", "FILE", Path, nargs="+"),
    option("--resolution", f"of a map's pixels; default: {RESOLUTION}", "M", number, RESOLUTION),
    FORCE,
)
def _export(options: argparse.Namespace) -> int:
    """Write a track as a map, a centreline CSV or a mesh of its walls."""
    files = [file for path in options.files for file in exported_files(path)]
    with noting_files() as read:
        track = require_track(load_track(options.track))
    require_new(*files, force=options.force, reads=read)
    print(*export_tracks(track, options.files, resolution=options.resolution), sep="\n")
    return 0


@command(
    option(
        "file", "a centreline, a raceline or a boundary, with settings in brackets as --track takes them; or the name "
        "of a track", "FILE|NAME", names=track_names,
    ),
    option("out", "the CSV", "FILE.csv", Path),
    option("--raceline", "write s, x, y, psi, kappa and the speeds, in place of a centreline with widths"),
    option("--line", "line of this name, or with this in its name, in a file of several lines", "NAME"),
    FORCE,
)
def _convert(options: argparse.Namespace) -> int:
    """Write a file of another stack as a CSV of ours."""
    require_ending(options.out, ".csv", what="a converted line")
    require_new(options.out, force=options.force, reads=[options.file])
    name, comment = options.file, f"made by: fg-mujoco track convert {options.file}"
    named = not is_file(name.partition("[")[0])
    if options.raceline:
        with noting_files() as read:
            if named:
                points, speeds = require_track(load_track(name)).centreline, None
            else:
                file = read_line_file(name, course=False, line=options.line).note()
                points, speeds = file.points, file.values.get("speed")
        require_new(options.out, force=options.force, reads=read)
        if len(points) < MIN_POINTS:
            raise TrackError(f"{name}: {len(points)} points; accepted: at least {MIN_POINTS}")
        columns = raceline_columns(points, speeds)
        with writing(options.out):
            write_file(options.out, raceline_text(columns, [comment]).encode())
        print(f"{options.out}: {', '.join(columns)}, {len(points)} points, {columns['s_m'][-1]:.1f} m")
        return 0
    if options.line is not None:
        name = f"{name.removesuffix(']')}{',' if name.endswith(']') else '['}line={options.line}]"
    with noting_files() as read:
        track = require_track(load_track(name)) if named else load_centreline(name)
    require_new(options.out, force=options.force, reads=read)
    write_centreline(track, options.out, [comment])
    print(f"{options.out}: {describe_course(track)}")
    return 0


TRACK = Commands(
    "make, show and list tracks",
    {
        "new": _new, "show": _show, "from-image": _from_image, "list": _list, "scenes": _scenes, "export": _export,
        "convert": _convert,
    },
)  # fmt: skip
