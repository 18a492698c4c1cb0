"""ROS map_server files: a YAML and the image that it names, read into free and other pixels.

    occupancy = read_map_file("aut.yaml")
    occupancy.free[i, j]          # row i from below, column j from the left

A pixel of brightness x, the mean of its colours from 0 to 255, is occupied with p = (255 - x) / 255, or, with `negate:
1`, x / 255, or, with `mode: raw`, x / 100, where x is 100 at most. It is occupied above `occupied_thresh`, else free
up to `free_thresh`, and unknown otherwise, or where it is transparent. Unknown pixels are taken for walls: nobody has
seen that they can be driven on.

A key of ours, `walls`, says how walls of a grey level are built: `walls: {0: {walls: duct, height: 0.2}}`, with the
settings of built_walls.OF_EACH.

Source: the ROS packages map_server and nav2_map_server, whose documentation defines the format. At p equal to
`free_thresh` a pixel is free by nav2 since its pull request 5071 of 2025; map_server of ROS 1 has it unknown.
"""

from __future__ import annotations

import glob
import importlib.util
import math
import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import SettingsError, TrackError, accepted_names, missing_extra, nearest
from ...messages import FloatArray, shown
from ..files import is_file, read_text, require_regular

if TYPE_CHECKING:
    from ..built_walls import Walls

BoolArray = NDArray[np.bool_]

FREE, OCCUPIED, UNKNOWN = 0, 100, -1
"""Of a cell, as nav_msgs/OccupancyGrid has them."""
RESOLUTION = 0.05
"""[m] Side of a cell: that of most maps of F1TENTH courses."""

MOST_PIXELS = 4096**2
"""Images of more pixels are refused."""

SPECK = 9
"""[pixel] Islands of fewer are named when a map is loaded: a laser, a brush and a lossy image leave such specks."""

MARK_REACH = 5
"""[pixel] from a pixel of a level in the table of walls, within which others have its kind."""

_ALIKE = 5.0  # grey levels nearer than that are one
_RESOLUTIONS = (0.001, 1.0)  # [m] of a pixel: from a millimetre to more than a car
_FURTHEST = 1e4  # [m] from the world's origin: MuJoCo keeps meshes of walls in single precision, 1 mm there
_GREATEST = 1e300  # of a number at all: whole numbers of YAML have no end
_MOST_YAML = 2**17  # characters of a YAML
_MOST_BYTES, _MOST_CHARACTERS, _DEEPEST = 2**20, 1000, 20  # of a YAML, of one value in it, levels of it

_UNKNOWN, _UNKNOWN_THRESH = 205.0, 0.196
"""Grey that map savers write for unknown ground, and a free_thresh with which it is. ROS 2 writes .25 beside it."""

_REQUIRED = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")
_STARTS = ("starting_positions", "starting_angle")  # not of map_server, but of maps that are raced on
_MODES = ("trinary", "scale", "raw")  # the first two differ in what lies between the thresholds, which is unknown here
_IMAGES = (".png", ".pgm", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+\.[0-9]*)([eE][-+]?[0-9]+)?$|[-+]?[0-9]+[eE][-+]?[0-9]+$")  # in a YAML
_SIXTEEN_BITS = ("I;16", "I;16B", "I")  # kinds of images of one channel, as Pillow names them


@dataclass(frozen=True, kw_only=True, eq=False)
class OccupancyMap:
    """Free ground on a grid that may be turned.

    Pixel (i, j) covers i to i + 1 upwards and j to j + 1 to the right of the lower left corner, in pixels.
    """

    path: Path
    free: BoolArray  # (rows, columns), row 0 below
    resolution: float  # [m] side of a pixel
    origin: tuple[float, float, float]  # x [m], y [m], yaw [rad] of the lower left corner in the world
    start: tuple[float, float] | None = None  # x and y [m], where the file has them
    heading: float | None = None  # [rad] at the start, where the file has it
    shares: str = ""  # of free, occupied and unknown pixels, in words
    grey: BoolArray | None = (
        None  # (rows, columns) pixels that free_thresh makes free, the saver's grey of unknown ground
    )
    kinds: tuple[Walls, ...] = ()  # of the walls of the grey levels in the table of its YAML
    marks: NDArray[np.uint16] | None = None  # (rows, columns) kind of a wall at each pixel, from 1; 0: none
    given: Mapping[str, str] = field(default_factory=dict)  # settings of the map's name that it was read with

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
        """Return whether a point (2,) of the world [m] is in a free pixel of the image."""
        column, row = np.floor(self.to_pixels(point)).astype(int)
        rows, columns = self.free.shape
        return bool(0 <= row < rows and 0 <= column < columns and self.free[row, column])

    def with_walled_border(self) -> OccupancyMap:
        """Return the map with a wall along the image's border, one pixel thick."""
        free = np.zeros_like(self.free)
        free[1:-1, 1:-1] = self.free[1:-1, 1:-1]
        return replace(self, free=free)

    def sizes(self) -> tuple[NDArray[np.int32], NDArray[np.intp]]:
        """Return the number of each pixel's group of pixels that are not free, and how many pixels each group has.

        Pixels that meet at a corner are of one group. Number 0 is what is free, and counts as endless.
        """
        from scipy import ndimage

        labels, count = ndimage.label(~self.free, np.ones((3, 3)))
        sizes = np.bincount(labels.ravel(), minlength=count + 1)
        sizes[0] = self.free.size
        return labels, sizes

    def without_specks(self, pixels: int) -> OccupancyMap:
        """Return the map in which groups of fewer than so many pixels that are not free are free."""
        labels, sizes = self.sizes()
        return replace(self, free=self.free | (sizes < pixels)[labels])

    def without_grey(self) -> tuple[OccupancyMap, dict[str, str]]:
        """Return the map in which grey ground is unknown, and the setting of its name that does this."""
        free = self.free if self.grey is None else self.free & ~self.grey
        return replace(self, free=free), {"free_thresh": f"{_UNKNOWN_THRESH:g}"}

    def named(self, **settings: str) -> str:
        """Return the name of the map with the settings that it was read with, and other ones."""
        return f"{self.path.name}[{','.join(f'{name}={value}' for name, value in {**self.given, **settings}.items())}]"

    def place(self, point: ArrayLike) -> str:
        """Say where a point (2,), column and row in pixels, is: in the world and in the image, rows from above."""
        column, row = np.asarray(point, np.float64)
        x, y = self.to_world((column, row))
        return f"({x:.2f}, {y:.2f}), column {int(column)}, row {int(len(self.free) - row)} of the image"


def require_maps_extra() -> None:
    """Raise MissingExtraError, with the command that installs it, if a part of what maps need is not there."""
    if any(importlib.util.find_spec(name) is None for name in ("PIL", "yaml", "scipy", "skimage")):
        raise missing_extra("ROS maps need Pillow, PyYAML, SciPy and scikit-image", "maps")


def read_map_file(
    path: str | Path,
    *,
    free_thresh: float | None = None,
    image: str | Path | None = None,
    outside_folder: bool = False,
) -> OccupancyMap:
    """Read a map_server YAML and its image.

    Args:
      path: the YAML.
      free_thresh: in place of the one of the YAML.
      image: read this one in place of the one that the YAML names.
      outside_folder: whether the YAML may name an image outside of its own folder.

    Raises:
      MissingExtraError, TrackError: no extra `maps`; whatever cannot be read, or is no map.
    """
    require_maps_extra()
    path = Path(path)
    settings = _read_yaml(path)
    low, high = _RESOLUTIONS
    sizes = f"the side of a pixel in metres, from {low} to {high:.0f}"
    resolution = _number(path, settings, "resolution", lambda value: low <= value <= high, sizes)
    thresholds = "a number from 0 to 1"
    if free_thresh is not None:
        settings["free_thresh"] = free_thresh
    occupied = _number(path, settings, "occupied_thresh", lambda value: 0.0 <= value <= 1.0, thresholds)
    free = _number(path, settings, "free_thresh", lambda value: 0.0 <= value <= 1.0, thresholds)
    negate = _number(path, settings, "negate", lambda value: value in (0.0, 1.0), "0 or 1")
    origin = settings["origin"]
    if not isinstance(origin, list) or len(origin) != 3 or not all(map(_is_near, origin)):
        raise TrackError(f"{path}: origin is {origin!r}; accepted: [x, y, yaw], three numbers within {_FURTHEST:g}")
    mode = settings.get("mode", _MODES[0])
    if mode not in _MODES:
        raise TrackError(f"{path}: mode is {mode!r}; {accepted_names(mode, _MODES)}")
    if mode == "raw" and negate:
        raise TrackError(
            f"{path}: mode is raw with negate: 1, which ROS 1 and ROS 2 read differently; accepted: negate: 0"
        )
    if free > occupied:
        warnings.warn(
            f"{path}: free_thresh is {free}, above occupied_thresh, {occupied}: what is above the latter is a wall",
            stacklevel=4,
        )
    levels, values = _read_image(
        Path(image) if image is not None else _image_path(path, settings["image"], outside_folder)
    )
    if mode == "raw":
        occupancy = np.where(values <= 100.0, values / 100.0, np.nan)
    else:
        occupancy = values / 255.0 if negate else (255.0 - values) / 255.0
    is_free = (occupancy <= free) & (occupancy <= occupied)
    is_grey = is_free & (occupancy >= _UNKNOWN_THRESH)
    is_saved = bool(np.bincount(levels.ravel(), minlength=len(values))[is_grey & (values == _UNKNOWN)].any())
    x, y, yaw = map(float, origin)
    start, heading = _start(path, settings)
    kinds, marks = _wall_kinds(path, settings.get("walls"), levels, values, occupancy, is_free)
    return OccupancyMap(
        path=path,
        free=np.ascontiguousarray(is_free[levels[::-1]]),
        grey=np.ascontiguousarray(is_grey[levels[::-1]]) if is_saved else None,
        shares=_shares(levels, is_free, occupancy > occupied, np.isnan(values)),
        resolution=resolution,
        origin=(x, y, yaw),
        start=start,
        heading=heading,
        kinds=kinds,
        marks=marks,
    )


def _wall_kinds(
    path: Path, table: Any, levels: NDArray[Any], values: FloatArray, occupancy: FloatArray, is_free: BoolArray
) -> tuple[tuple[Walls, ...], NDArray[np.uint16] | None]:
    """Return the kinds of walls of a table of grey levels, and which each pixel has, row 0 below.

    A pixel has that of the nearest one, MARK_REACH away at most, that has a level of the table and beside none that is
    more occupied: on the soft edge of a black wall there is grey.
    """
    if table is None or table == {}:
        return (), None
    from scipy import ndimage

    from ..built_walls import OF_EACH, walls_of
    from ..centreline_csv import read_settings

    accepted = "accepted: {LEVEL: {SETTING: VALUE}}, as {0: {walls: duct, height: 0.2}}"
    if not isinstance(table, dict) or not all(isinstance(each, dict) for each in table.values()):
        raise TrackError(f"{path}: walls is {shown(table)}; {accepted}")
    kinds: list[Walls] = []
    of_level, there = np.zeros(len(values), np.uint16), np.bincount(levels.ravel(), minlength=len(values)) > 0
    for level, own in table.items():
        named = f"{path}: walls of level {level!r}"
        is_level = _is_finite(level) and 0 <= level <= 255
        alike = np.abs(values - level) < _ALIKE if is_level else np.zeros(len(values), np.bool_)
        if not (alike & there & ~is_free).any():
            raise TrackError(f"{named}, which no wall of the image has; accepted: grey levels of walls, from 0 to 255")
        told = read_settings(named, ",".join(f"{key}={value}" for key, value in own.items()), OF_EACH)
        try:
            kinds.append(walls_of(**told))
        except SettingsError as error:
            raise TrackError(f"{named}: {error}") from error
        of_level[alike & ~is_free] = len(kinds)
    marks, seen = of_level[levels[::-1]], np.nan_to_num(255.0 * occupancy)[levels[::-1]]
    marks[ndimage.maximum_filter(seen, 3) > seen + _ALIKE] = 0
    away, nearest_at = ndimage.distance_transform_edt(marks == 0, return_indices=True)
    return tuple(kinds), np.where(away <= MARK_REACH, marks[tuple(nearest_at)], 0).astype(np.uint16)


def image_yaml(image: Path, resolution: float, *, negate: bool = False) -> str:
    """Return the text of the YAML that makes an image, in its folder, a map with its lower left corner at the origin.

    The side of a pixel is `resolution` [m]; with `negate` dark pixels are free. Raises MissingExtraError and
    TrackError: a resolution that no map has, or a file that is no image.
    """
    require_maps_extra()
    import yaml

    low, high = _RESOLUTIONS
    if not low <= resolution <= high:
        raise TrackError(f"resolution is {resolution!r}; accepted: metres of a pixel, from {low} to {high:.0f}")
    _read_image(image)
    keys = dict(zip(_REQUIRED, (image.name, resolution, [0.0, 0.0, 0.0], int(negate), 0.65, 0.196), strict=True))
    return str(yaml.safe_dump(keys, sort_keys=False, allow_unicode=True))


def image_line(name: str) -> str:
    """Return the line of a map's YAML that names its image."""
    import yaml

    return str(yaml.safe_dump({"image": name}, allow_unicode=True, width=math.inf))


def _shares(levels: NDArray[Any], free: BoolArray, occupied: BoolArray, transparent: BoolArray) -> str:
    """Return the numbers of free, occupied, unknown and transparent pixels, by the meaning of each brightness."""
    counts = np.bincount(levels.ravel(), minlength=len(free)) / levels.size
    kinds = {"free": free, "occupied": occupied & ~free, "unknown": ~(free | occupied | transparent)}
    if counts[transparent].sum() > 0.0:
        kinds["transparent, which is unknown"] = transparent
    return ", ".join(f"{100.0 * counts[which].sum():.1f} % {kind}" for kind, which in kinds.items())


def _start(path: Path, settings: dict[str, Any]) -> tuple[tuple[float, float] | None, float | None]:
    """Return the first starting position [m] of a YAML, and the heading there [rad]; None what it lacks."""
    rows: Any = settings.get("starting_positions")
    angle: Any = settings.get("starting_angle")
    heading = float(angle) if _is_near(angle) else None
    row = rows[0] if isinstance(rows, list) and rows and isinstance(rows[0], list) else rows
    if isinstance(row, list) and len(row) in (2, 3) and all(map(_is_near, row)):
        return (float(row[0]), float(row[1])), float(row[2]) if len(row) == 3 else heading
    if (rows is not None) or (angle is not None and heading is None):
        given = f"starting_positions is {rows!r}" if rows is not None else f"starting_angle is {angle!r}"
        warnings.warn(f"{path}: ignored: {given}; read are rows of [x, y, yaw], and one angle", stacklevel=4)
    return None, heading


def _read_yaml(path: Path) -> dict[str, Any]:
    """Return the keys of a map_server YAML: all that are required, and none that is unknown."""
    known = (*_REQUIRED, "mode", "walls")
    try:
        text = read_text(path, _MOST_BYTES)
    except FileNotFoundError:
        raise TrackError(f"{path}: no such file; accepted: a map_server .yaml of {', '.join(_REQUIRED)}") from None
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise TrackError(
            f"{path}: cannot be read: {reason}; accepted: a map_server .yaml of {', '.join(_REQUIRED)}"
        ) from error
    try:
        settings = plain_yaml(text)
    except Exception as error:  # YAML's own, and whatever its values' readers raise
        reason = " ".join(str(error).split()) or type(error).__name__
        raise TrackError(f"{path}: is no YAML: {reason}; accepted: the keys {', '.join(_REQUIRED)}") from error
    if not isinstance(settings, dict):
        raise TrackError(f"{path}: is no map_server YAML; accepted: the keys {', '.join(_REQUIRED)}")
    unknown = [str(key) for key in settings if key not in known]
    missing = [key for key in _REQUIRED if key not in settings]
    if missing:
        near = [name for name in (nearest(key, unknown) for key in missing) if name is not None]
        instead = f", but {', '.join(near)}" if near else ""
        raise TrackError(f"{path}: has no {', '.join(missing)}{instead}; accepted: the keys {', '.join(_REQUIRED)}")
    ignored = [key for key in unknown if key not in _STARTS]
    if ignored:
        warnings.warn(f"{path}: ignored: {', '.join(ignored)}; read are {', '.join((*known, *_STARTS))}", stacklevel=5)
    return settings


def plain_yaml(text: str | bytes, loader: Any = None) -> Any:
    """Return what a YAML has, of a map or of a node's parameters; `loader` is one of `plain_loader()`.

    Raises:
      Exception: YAML's own, and whatever its values' readers raise.
    """
    import yaml

    if len(text) > _MOST_YAML:  # it takes 20 us a character
        raise ValueError(f"it has more than {_MOST_YAML} characters")
    return yaml.load(text, loader or plain_loader())


def plain_loader(last_counts: str = "") -> Any:
    """Return a loader of YAML that refuses aliases, which multiply, deep nesting, long values, and a key twice.

    With `last_counts`, the name of a file, the last of a key's values counts, as for ROS, which is said.
    """
    import yaml

    class PlainLoader(yaml.SafeLoader):  # type: ignore[misc]
        depth = 0

        def compose_node(self, parent: Any, index: Any) -> Any:
            event = self.peek_event()
            wrong = ""
            if isinstance(event, yaml.AliasEvent):
                wrong = "an alias in the place of a value"
            elif self.depth >= _DEEPEST:
                wrong = f"more than {_DEEPEST} levels"
            elif len(getattr(event, "value", "")) > _MOST_CHARACTERS:
                wrong = f"a value of {len(event.value)} characters, more than {_MOST_CHARACTERS}"
            if wrong:
                raise ValueError(f"line {event.start_mark.line + 1}: {wrong}")
            self.depth += 1
            try:
                return super().compose_node(parent, index)
            finally:
                self.depth -= 1

        def compose_mapping_node(self, anchor: Any) -> Any:
            node = super().compose_mapping_node(anchor)
            seen: set[str] = set()
            for key, _ in node.value:
                if str(key.value) in seen:
                    said = f"line {key.start_mark.line + 1}: the key {key.value!r} is given twice"
                    if not last_counts:
                        raise ValueError(said)
                    warnings.warn(f"{last_counts}: {said}; the last counts, as for ROS", stacklevel=2)
                seen.add(str(key.value))
            return node

    # YAML 1.2, which map_server and ROS 2 read: for PyYAML, which reads YAML 1.1, 1e-06 and -.5 are no numbers
    PlainLoader.add_implicit_resolver("tag:yaml.org,2002:float", _FLOAT, list("-+.0123456789"))
    return PlainLoader


def _number(path: Path, settings: dict[str, Any], key: str, accepts: Any, accepted: str) -> float:
    value = settings[key]
    if isinstance(value, bool) and key == "negate":
        value = int(value)
    if not _is_finite(value) or not accepts(float(value)):
        raise TrackError(f"{path}: {key} is {value!r}; accepted: {accepted}")
    return float(value)


def _is_finite(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and -_GREATEST < value < _GREATEST


def _is_near(value: Any) -> bool:
    return _is_finite(value) and abs(value) <= _FURTHEST


def _image_path(path: Path, name: Any, outside_folder: bool) -> Path:
    """Return the path of the image that the YAML names."""
    if not isinstance(name, str) or not name:
        raise TrackError(f"{path}: image is {name!r}; accepted: the name of a file in its folder")
    image = path.parent / name
    if "\0" in name or len(name) > _MOST_CHARACTERS:
        raise TrackError(f"{path}: image is {name[:60]!r}; accepted: the name of a file in its folder")
    local = path.parent / Path(name.replace("\\", "/")).name
    inside, is_local = (file.resolve().is_relative_to(path.parent.resolve()) for file in (image, local))
    if not (is_file(image) if inside else outside_folder) and is_local and is_file(local):  # as map_saver wrote it
        warnings.warn(f"{path}: image is {name!r}, which is not there; {local.name} here is read", stacklevel=4)
        return local
    if not outside_folder and not inside:
        raise TrackError(
            f"{path}: image {name!r} is outside of the YAML's folder; accepted: a file inside it, or outside_folder=yes"
        )
    return image


def _read_image(path: Path) -> tuple[NDArray[Any], FloatArray]:
    """Return the level of each pixel, the upper row first, and each level's brightness: 0 black, NaN transparent."""
    from PIL import Image

    try:
        require_regular(path)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of Pillow: the limit here is lower than its own
            opened = Image.open(path)  # reads the header alone
        with opened as image:
            if image.width * image.height > MOST_PIXELS:
                raise _too_large(path, f"{image.width} x {image.height}")
            if "transparency" not in image.info:
                if image.mode in ("L", "1"):
                    return np.asarray(image.convert("L")), np.arange(256.0)
                if image.mode in _SIXTEEN_BITS:
                    return np.clip(np.asarray(image), 0, 65535).astype(np.uint16), np.arange(65536.0) / 257.0
            pixels = np.asarray(image.convert("RGBA"))
    except FileNotFoundError:
        there = sorted(
            other.name for other in path.parent.glob(f"{glob.escape(path.stem)}.*") if other.suffix in _IMAGES
        )
        hint = f"; did you mean {there[0]!r}?" if there else ""
        raise TrackError(f"{path}: no such file; accepted: a PNG or PGM image of the map{hint}") from None
    except Image.DecompressionBombError:
        raise _too_large(path, "hundreds of millions of") from None
    except TrackError:
        raise
    except (OSError, ValueError, SyntaxError) as error:
        reason = getattr(error, "strerror", None) or error
        raise TrackError(f"{path}: cannot be read as an image: {reason}; accepted: PNG or PGM") from error
    levels = pixels[..., :3].sum(axis=2, dtype=np.uint16)
    levels[pixels[..., 3] < 255] = 766
    return levels, np.append(np.arange(766.0) / 3.0, np.nan)


def _too_large(path: Path, pixels: str) -> TrackError:
    return TrackError(
        f"{path}: {pixels} pixels; accepted: {MOST_PIXELS} at most; cut the course out, or scale the image down and "
        "give a coarser resolution"
    )
