"""Export of a track as a ROS map, a centreline CSV, or a mesh of its walls.

export_track(load_track("oval"), "oval.yaml")     # and oval.png
export_track(load_track("oval"), "oval.glb")
"""

from __future__ import annotations

import importlib.util
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ...errors import SettingsError, TrackError, missing_extra
from ...messages import FloatArray
from ..centreline_csv import centreline_text
from ..course import Course
from ..documents import comment
from ..polyline import enclosed_area
from ..track import Track
from ..track_mesh import Surface
from ..writing import write_files
from .map_server import RESOLUTION, image_line, require_maps_extra
from .walls import outlines

SUFFIXES = (".yaml", ".csv", ".obj", ".stl", ".glb")
"""Endings of the files that are written."""

_MARGIN = 10  # [pixel] round the walls
_FREE, _OCCUPIED = 254, 0  # as map_server's map_saver writes them
_MOST_PIXELS = 10_000  # along a side
_Y_UP = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


def require_track(course: Course) -> Track:
    """Return a course that can be written to a file; raise TrackError for one without centreline and widths."""
    if not {"centreline", "width_right", "width_left"} <= set(course.definition):
        raise TrackError(f"{course.name!r} has no centreline with widths that a file could hold; accepted: a track")
    return cast(Track, course)


def require_trimesh() -> None:
    """Raise MissingExtraError, with the command that installs it, if there is no trimesh to write meshes."""
    if importlib.util.find_spec("trimesh") is None:
        raise missing_extra("meshes of walls need trimesh", "meshes")


def exported_files(path: str | Path) -> tuple[Path, ...]:
    """Return the files that `export_track` writes for a path; raise SettingsError for an unknown suffix."""
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise SettingsError(f"{path}: is no format of a track; accepted: a file that ends in {', '.join(SUFFIXES)}")
    return (path, path.with_suffix(".png")) if suffix == ".yaml" else (path,)


def export_track(track: Track, path: str | Path, *, resolution: float = RESOLUTION) -> tuple[Path, ...]:
    """Write a track in the format of the path's suffix, and return the files written; those that exist are replaced.

    Args:
      track: what to write.
      path: `.yaml`, a map_server map, with its `.png` next to it; `.csv`, the centreline; or the walls in 3D, in
        metres, `.obj` and `.stl` with z up, `.glb` with y up, as glTF 2.0 wants it.
      resolution: of a map, side of a pixel [m].

    Raises:
      MissingExtraError: a map, and the extra `maps` is not installed; a mesh, and `meshes` is not.
      SettingsError: another suffix, or a resolution that is not positive.
      TrackError: a file that cannot be written; a resolution at which walls or ways would vanish.
    """
    return export_tracks(track, [path], resolution=resolution)


def export_tracks(track: Track, paths: Sequence[str | Path], *, resolution: float = RESOLUTION) -> tuple[Path, ...]:
    """Write a track in several formats, as `export_track` does: all files, or none."""
    contents: dict[Path, bytes] = {}
    for path in paths:
        contents |= _contents(track, exported_files(path), resolution)
    try:
        write_files(contents)
    except OSError as error:
        raise TrackError(f"{', '.join(map(str, paths))}: cannot be written: {error.strerror or error}") from error
    return tuple(contents)


def _contents(track: Track, files: tuple[Path, ...], resolution: float) -> dict[Path, bytes]:
    suffix = files[0].suffix.lower()
    if suffix == ".csv":
        return {files[0]: centreline_text(track, [f"made by: fg-mujoco track export {track.name}"]).encode()}
    if suffix == ".yaml":
        require_maps_extra()
        free, origin = occupancy_image(track, resolution)
        return dict(zip(files, _map_files(track, files[1].name, free, resolution, origin), strict=True))
    require_trimesh()
    import trimesh  # heavy

    vertices, faces = cast(Surface, track.wall_surface())
    vertices = vertices if track.ground is None else track.ground.lifted(vertices)
    mesh = trimesh.Trimesh(vertices=vertices, faces=faces, process=False)
    if suffix == ".glb":
        mesh.apply_transform(_Y_UP)
    exported: Any = mesh.export(file_type=suffix[1:])  # text or bytes, as the format wants
    return {files[0]: exported.encode() if isinstance(exported, str) else exported}


def occupancy_image(track: Track, resolution: float = RESOLUTION) -> tuple[NDArray[np.bool_], FloatArray]:
    """Return a mask of the pixels with their middle between the walls of a track, and the lower left corner.

    Shape (rows, columns), row 0 below; x, y [m] of the lower left corner of the image, shape (2,).

    Raises:
      SettingsError, TrackError: a resolution that no image can have, or at which walls or ways would vanish.
    """
    if not 0.0 < resolution < np.inf:
        raise SettingsError(f"resolution is {resolution!r} m; accepted: a positive number")
    walls = [track.left_wall, track.right_wall, *track.islands]
    points = np.concatenate(walls)
    origin = points.min(axis=0) - _MARGIN * resolution
    columns, rows = np.ceil((points.max(axis=0) - origin) / resolution).astype(int) + _MARGIN
    if max(columns, rows) > _MOST_PIXELS:
        finest = float(np.ptp(points, axis=0).max()) / (_MOST_PIXELS - 2 * _MARGIN)
        raise SettingsError(f"resolution is {resolution} m on track {track.name!r}; accepted: from {finest:.4f} m")
    free = _inside([(wall - origin) / resolution for wall in walls], int(rows), int(columns))
    edges = outlines(free)
    if len(edges) != len(walls) or sum(enclosed_area(edge) > 0.0 for edge in edges) != 1:
        raise TrackError(
            f"at {resolution} m a pixel, walls or ways of track {track.name!r} vanish; accepted: a finer resolution"
        )
    return free, np.asarray(origin)


def _inside(loops: list[FloatArray], rows: int, columns: int) -> NDArray[np.bool_]:
    """Return a mask of the pixels with their middle inside an odd number of closed polylines, in pixels."""
    toggles = np.zeros((rows, columns + 1), dtype=np.int64)
    for loop in loops:
        start, end = loop, np.roll(loop, -1, axis=0)
        low, high = np.ceil(np.sort((start[:, 1], end[:, 1]), axis=0) - 0.5).astype(int)  # rows whose middle is crossed
        segment = np.repeat(np.arange(len(loop)), high - low)
        row = np.arange(len(segment)) - np.repeat(np.cumsum(high - low) - (high - low), high - low) + low[segment]
        (x, y), (end_x, end_y) = start[segment].T, end[segment].T
        at = x + (row + 0.5 - y) / (end_y - y) * (end_x - x)
        np.add.at(toggles, (row, np.ceil(at - 0.5).astype(int)), 1)
    return np.asarray(np.cumsum(toggles, axis=1)[:, :-1] % 2 == 1)


def _map_files(
    track: Track, image: str, free: NDArray[np.bool_], resolution: float, origin: FloatArray
) -> tuple[bytes, bytes]:
    """Return the contents of the YAML and of the PNG."""
    from PIL import Image

    picture = io.BytesIO()
    Image.fromarray(np.where(free[::-1], _FREE, _OCCUPIED).astype(np.uint8)).save(picture, "PNG", optimize=True)
    (x, y), counterclockwise = track.centreline[0], enclosed_area(track.centreline) > 0.0
    settings = f"start={x:.3f}:{y:.3f},direction={'counterclockwise' if counterclockwise else 'clockwise'}"
    heading = f"track {track.name}; its own start and direction: {Path(image).stem}.yaml[{settings}]"
    text = (
        f"# {comment(heading)}\n{image_line(image)}"
        f"resolution: {resolution!r}\n"
        f"origin: [{float(origin[0])!r}, {float(origin[1])!r}, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\nmode: trinary\n"
    )
    return text.encode(), picture.getvalue()
