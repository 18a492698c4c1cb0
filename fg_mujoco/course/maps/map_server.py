"""ROS map_server files: a YAML and the image that it names, read into free and other pixels.

    occupancy = read_map_file("aut.yaml")
    occupancy.free[i, j]          # row i from below, column j from the left

A pixel of brightness x, the mean of its colours from 0 to 255, is occupied with p = (255 - x) / 255, or, with `negate:
1`, x / 255. It is free below `free_thresh`, occupied above `occupied_thresh`, and unknown between the two, or where it
is transparent. Unknown pixels are taken for walls: nobody has seen that they can be driven on.

Source: the ROS packages map_server and nav2_map_server, whose documentation defines the format.
"""

from __future__ import annotations

import difflib
import importlib.util
import math
import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import MissingExtraError, TrackError
from ...messages import FloatArray

BoolArray = NDArray[np.bool_]

INSTALL_COMMAND = "pip install 'fg-mujoco[maps]'"
MOST_PIXELS = 100_000_000
"""Images larger than this are refused: ten thousand pixels square."""

_REQUIRED = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")
_STARTS = ("starting_positions", "starting_angle")  # not of map_server, but of maps that are raced on
_MODES = ("trinary", "scale")  # they differ in what lies between the thresholds, which is unknown here
_TO_255 = {"L": 1.0, "1": 255.0, "I;16": 1.0 / 257.0, "I;16B": 1.0 / 257.0, "I": 1.0 / 257.0}  # of kinds of one channel


@dataclass(frozen=True, kw_only=True, eq=False)
class OccupancyMap:
    """What of the ground is free, on a grid that may be turned.

    Pixel (i, j) covers i to i + 1 upwards and j to j + 1 to the right of the lower left corner, in pixels.
    """

    path: Path
    free: BoolArray  # (rows, columns), row 0 below
    resolution: float  # [m] side of a pixel
    origin: tuple[float, float, float]  # x [m], y [m], yaw [rad] of the lower left corner in the world
    start: tuple[float, float] | None = None  # x and y [m], where the file has them
    heading: float | None = None  # [rad] at the start, where the file has it

    def to_world(self, points: ArrayLike) -> FloatArray:
        """Turn points (..., 2), columns and rows in pixels from the lower left corner, into the world's [m]."""
        x, y, yaw = self.origin
        turn = np.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]])
        return np.asarray(np.asarray(points, np.float64) * self.resolution @ turn + (x, y))

    def to_pixels(self, points: ArrayLike) -> FloatArray:
        """Turn points (..., 2) of the world [m] into columns and rows in pixels from the lower left corner."""
        x, y, yaw = self.origin
        turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
        return np.asarray((np.asarray(points, np.float64) - (x, y)) @ turn / self.resolution)

    def is_free(self, point: ArrayLike) -> bool:
        """Say whether a point (2,) of the world [m] is in a free pixel of the image."""
        column, row = np.floor(self.to_pixels(point)).astype(int)
        rows, columns = self.free.shape
        return bool(0 <= row < rows and 0 <= column < columns and self.free[row, column])

    def with_walled_border(self) -> OccupancyMap:
        """Return the map with a wall along the image's border, one pixel thick."""
        free = np.zeros_like(self.free)
        free[1:-1, 1:-1] = self.free[1:-1, 1:-1]
        return replace(self, free=free)

    def place(self, point: ArrayLike) -> str:
        """Say where a point (2,), column and row in pixels, is: in the world and in the image, rows from above."""
        column, row = np.asarray(point, np.float64)
        x, y = self.to_world((column, row))
        return f"({x:.2f}, {y:.2f}), column {int(column)}, row {int(len(self.free) - row)} of the image"


def require_maps_extra() -> None:
    """Make sure that maps can be read and written.

    Raises:
      MissingExtraError: a part is not installed; the message is the command that installs it.
    """
    if any(importlib.util.find_spec(name) is None for name in ("PIL", "yaml", "scipy")):
        raise MissingExtraError(INSTALL_COMMAND)


def read_map_file(path: str | Path, *, image: str | Path | None = None, outside_folder: bool = False) -> OccupancyMap:
    """Read a map_server YAML and its image.

    Args:
      path: the YAML.
      image: read this one in place of the one that the YAML names.
      outside_folder: whether the YAML may name an image outside of its own folder.

    Raises:
      MissingExtraError: the extra `maps` is not installed.
      TrackError: a file that cannot be read; a key that is unknown, missing, or has a value of another kind; an image
        outside of the YAML's folder.
    """
    require_maps_extra()
    path = Path(path)
    settings = _read_yaml(path)
    resolution = _number(path, settings, "resolution", lambda value: value > 0.0, "a positive number of metres")
    thresholds = "two numbers, 0 <= free_thresh <= occupied_thresh <= 1"
    occupied = _number(path, settings, "occupied_thresh", lambda value: 0.0 <= value <= 1.0, thresholds)
    free = _number(path, settings, "free_thresh", lambda value: 0.0 <= value <= occupied, thresholds)
    negate = _number(path, settings, "negate", lambda value: value in (0.0, 1.0), "0 or 1")
    origin = settings["origin"]
    if not isinstance(origin, list) or len(origin) != 3 or not all(map(_is_finite, origin)):
        raise TrackError(f"{path}: origin is {origin!r}; accepted: [x, y, yaw], three numbers")
    if settings.get("mode", _MODES[0]) not in _MODES:
        raise TrackError(f"{path}: mode is {settings['mode']!r}; accepted: {', '.join(_MODES)}")
    brightness = _read_image(Path(image) if image is not None else _image_path(path, settings["image"], outside_folder))
    occupancy = brightness / 255.0 if negate else (255.0 - brightness) / 255.0
    x, y, yaw = map(float, origin)
    start, heading = _start(path, settings)
    return OccupancyMap(
        path=path,
        free=np.ascontiguousarray((occupancy < free)[::-1]),
        resolution=resolution,
        origin=(x, y, yaw),
        start=start,
        heading=heading,
    )


def _start(path: Path, settings: dict[str, Any]) -> tuple[tuple[float, float] | None, float | None]:
    """Return the place [m] and the heading [rad] of the first starting position of a YAML, None what it lacks.

    Starting positions are rows of x, y, yaw, of which the first counts; a starting angle is that of no place.
    """
    rows, angle = settings.get("starting_positions"), settings.get("starting_angle")
    heading = float(angle) if _is_finite(angle) else None
    row = rows[0] if isinstance(rows, list) and rows and isinstance(rows[0], list) else rows
    if isinstance(row, list) and len(row) in (2, 3) and all(map(_is_finite, row)):
        return (float(row[0]), float(row[1])), float(row[2]) if len(row) == 3 else heading
    if (rows is not None) or (angle is not None and heading is None):
        given = f"starting_positions is {rows!r}" if rows is not None else f"starting_angle is {angle!r}"
        warnings.warn(f"{path}: ignored: {given}; read are rows of [x, y, yaw], and one angle", stacklevel=4)
    return None, heading


def _read_yaml(path: Path) -> dict[str, Any]:
    """Return the keys of a map_server YAML: all that are required, and none that is unknown."""
    import yaml

    known = (*_REQUIRED, "mode")
    try:
        settings = yaml.safe_load(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise TrackError(f"{path}: no such file; accepted: a map_server .yaml of {', '.join(_REQUIRED)}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise TrackError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from error
    except yaml.YAMLError as error:
        raise TrackError(f"{path}: is no YAML: {' '.join(str(error).split())}") from error
    if not isinstance(settings, dict):
        raise TrackError(f"{path}: is no map_server YAML; accepted: the keys {', '.join(_REQUIRED)}")
    unknown = [str(key) for key in settings if key not in known]
    missing = [key for key in _REQUIRED if key not in settings]
    if missing:
        near = [name for key in missing for name in difflib.get_close_matches(key, unknown, n=1)]
        instead = f", but {', '.join(near)}" if near else ""
        raise TrackError(f"{path}: has no {', '.join(missing)}{instead}; accepted: the keys {', '.join(_REQUIRED)}")
    ignored = [key for key in unknown if key not in _STARTS]
    if ignored:
        warnings.warn(f"{path}: ignored: {', '.join(ignored)}; read are {', '.join((*known, *_STARTS))}", stacklevel=5)
    return settings


def _number(path: Path, settings: dict[str, Any], key: str, accepts: Any, accepted: str) -> float:
    value = settings[key]
    if isinstance(value, bool) and key == "negate":
        value = int(value)
    if not _is_finite(value) or not accepts(float(value)):
        raise TrackError(f"{path}: {key} is {value!r}; accepted: {accepted}")
    return float(value)


def _is_finite(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _image_path(path: Path, name: Any, outside_folder: bool) -> Path:
    """Return where the image is that the YAML names."""
    if not isinstance(name, str) or not name:
        raise TrackError(f"{path}: image is {name!r}; accepted: the name of a file beside it")
    image = path.parent / name
    if not outside_folder and not image.resolve().is_relative_to(path.parent.resolve()):
        raise TrackError(
            f"{path}: image {name!r} is outside of the YAML's folder; accepted: a file inside it, or outside_folder=yes"
        )
    return image


def _read_image(path: Path) -> FloatArray:
    """Return the brightness of each pixel, 0 black and 255 white, nan where it is transparent; the upper row first."""
    from PIL import Image

    try:
        with Image.open(path) as image:
            if image.width * image.height > MOST_PIXELS:
                raise TrackError(f"{path}: {image.width} x {image.height} pixels; accepted: {MOST_PIXELS} at most")
            if image.mode in _TO_255 and "transparency" not in image.info:
                return np.asarray(image, np.float64) * _TO_255[image.mode]
            pixels = np.asarray(image.convert("RGBA"), np.float64)
    except FileNotFoundError:
        raise TrackError(f"{path}: no such file; accepted: a PNG or PGM image of the map") from None
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise TrackError(f"{path}: cannot be read as an image: {error}; accepted: PNG or PGM") from error
    brightness = pixels[..., :3].mean(axis=2)
    brightness[pixels[..., 3] < 255.0] = np.nan  # neither below nor above a threshold
    return np.asarray(brightness)
