"""Stubs of the packages that convert messages of sensors: point_cloud2, laser_geometry, tf2_sensor_msgs and cv_bridge.

Points are read and written with NumPy. Images are arrays of NumPy; only compressed images, and colours that are
computed, such as grey of bgr8, need OpenCV, which is the user's own to install.
"""

from __future__ import annotations

import re
from collections import namedtuple
from collections.abc import Iterable, Sequence
from types import ModuleType
from typing import Any

import numpy as np

from fg_mujoco.messages import FloatArray

from .imports import StandIn, to_install
from .message_classes import message_class
from .transform_modules import matrix

_POINT_TYPES = ("i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8")  # INT8 is 1, FLOAT64 is 8
_COLOURS = {"mono": 1, "rgb": 3, "bgr": 3, "rgba": 4, "bgra": 4, "bayer_rggb": 1}  # channels, by what bits follow
_FORMATS = {"U": "u", "S": "i", "F": "f"}


class CvBridgeError(TypeError):
    pass


def sensor_modules() -> dict[str, ModuleType]:
    """Return the modules."""
    found: dict[str, ModuleType] = {
        "sensor_msgs_py.point_cloud2": StandIn("sensor_msgs_py.point_cloud2", **_point_cloud2())
    }
    for name in ("laser_geometry", "laser_geometry.laser_geometry"):
        found[name] = StandIn(name, LaserProjection=_Projection)
    for name in ("tf2_sensor_msgs", "tf2_sensor_msgs.tf2_sensor_msgs"):
        found[name] = StandIn(name, do_transform_cloud=_moved)
    for name in ("cv_bridge", "cv_bridge.core"):
        found[name] = StandIn(name, CvBridge=_CvBridge, CvBridgeError=CvBridgeError)
    return found


# Points


def _dtype(fields: Iterable[Any], step: int | None = None) -> np.dtype[Any]:
    rows = [(each.name or f"unnamed_field_{i}", each) for i, each in enumerate(fields)]
    formats = [
        (_POINT_TYPES[each.datatype - 1], each.count) if each.count > 1 else _POINT_TYPES[each.datatype - 1]
        for _, each in rows
    ]
    found = {"names": [name for name, _ in rows], "formats": formats, "offsets": [each.offset for _, each in rows]}
    return np.dtype(found if step is None else {**found, "itemsize": step})  # type: ignore[call-overload, no-any-return]


def _points(cloud: Any) -> np.ndarray[Any, Any]:
    """Return the points of a cloud as records, (height * width,)."""
    kind = _dtype(cloud.fields, cloud.point_step)
    rows = np.frombuffer(bytes(cloud.data), np.uint8)
    rows = rows[: cloud.height * cloud.row_step].reshape(cloud.height, -1)[:, : cloud.width * cloud.point_step]
    found = np.ascontiguousarray(rows).view(kind).reshape(-1)
    return found.astype(kind.newbyteorder(">")) if cloud.is_bigendian else found


def _chosen(
    cloud: Any, field_names: Sequence[str] | None, skip_nans: bool, uvs: Iterable[Any] | None
) -> np.ndarray[Any, Any]:
    found = _points(cloud)
    if field_names is not None:
        found = found[[field_names] if isinstance(field_names, str) else list(field_names)]
    places = [] if uvs is None else list(uvs)
    if places:
        found = found[[each if np.ndim(each) == 0 else each[1] * cloud.width + each[0] for each in places]]
    if skip_nans:
        columns = [found[name].astype(float).reshape(len(found), -1) for name in found.dtype.names or ()]
        found = found[~np.isnan(np.hstack(columns)).any(axis=1)]
    return found


def _cloud(header: Any, fields: Sequence[Any], points: Any) -> Any:
    kind = _dtype(fields)
    if isinstance(points, np.ndarray) and points.dtype.names:
        rows = np.empty(points.shape, kind)
        for name in kind.names or ():
            rows[name] = points[name]
    else:
        rows = np.array([tuple(each) for each in points], kind)
    height, width = rows.shape if rows.ndim == 2 else (1, rows.size)
    return message_class("sensor_msgs/msg/PointCloud2")(
        header=header, height=height, width=width, is_dense=False, is_bigendian=False, fields=list(fields),
        point_step=kind.itemsize, row_step=kind.itemsize * width, data=rows.tobytes(),
    )  # fmt: skip


def _floats(names: Iterable[str]) -> list[Any]:
    kind = message_class("sensor_msgs/msg/PointField")
    return [kind(name=name, offset=4 * i, datatype=7, count=1) for i, name in enumerate(names)]


def _point_cloud2() -> dict[str, Any]:
    def read_points(cloud: Any, field_names: Any = None, skip_nans: bool = False, uvs: Any = None, *_: Any) -> Any:
        return _chosen(cloud, field_names, skip_nans, uvs)

    def read_points_numpy(
        cloud: Any, field_names: Any = None, skip_nans: bool = False, uvs: Any = None, *_: Any
    ) -> FloatArray:
        found = _chosen(cloud, field_names, skip_nans, uvs)
        return np.stack([found[name] for name in found.dtype.names or ()], axis=-1)

    def read_points_list(cloud: Any, field_names: Any = None, skip_nans: bool = False, uvs: Any = None) -> list[Any]:
        found = _chosen(cloud, field_names, skip_nans, uvs)
        point = namedtuple("Point", found.dtype.names or ())  # type: ignore[misc]
        return [point(*each) for each in found.tolist()]

    def create_cloud(header: Any, fields: Sequence[Any], points: Any, *_: Any) -> Any:
        return _cloud(header, fields, points)

    def create_cloud_xyz32(header: Any, points: Any, *_: Any) -> Any:
        return _cloud(header, _floats("xyz"), points)

    kinds = {name: message_class(f"sensor_msgs/msg/{name}") for name in ("PointCloud2", "PointField")}
    return {
        "read_points": read_points, "read_points_list": read_points_list, "create_cloud": create_cloud,
        "create_cloud_xyz32": create_cloud_xyz32, "read_points_numpy": read_points_numpy, "dtype_from_fields": _dtype,
        **kinds,
    }  # fmt: skip


def _moved(cloud: Any, transform: Any) -> Any:
    """Return a cloud whose points are taken into another frame, as `do_transform_cloud` does."""
    t, r = transform.transform.translation, transform.transform.rotation
    by = matrix((t.x, t.y, t.z), (r.x, r.y, r.z, r.w))
    points = _points(cloud).copy()
    moved = np.stack([points[name] for name in "xyz"], axis=-1) @ by[:3, :3].T + by[:3, 3]
    for i, name in enumerate("xyz"):
        points[name] = moved[:, i]
    values = {name: getattr(cloud, name) for name in cloud._makers}
    values |= {"header": transform.header, "data": points.tobytes(), "row_step": cloud.point_step * cloud.width}
    return type(cloud)(**values)


class _Projection:
    """laser_geometry.LaserProjection."""

    class ChannelOption:
        NONE, INTENSITY, INDEX, DISTANCE, TIMESTAMP, VIEWPOINT = 0, 1, 2, 4, 8, 16
        DEFAULT = INTENSITY | INDEX

    def projectLaser(  # noqa: N802
        self, scan_in: Any, range_cutoff: float = -1.0, channel_options: int = ChannelOption.DEFAULT
    ) -> Any:
        """Return the cloud of a scan's points, of those beams that are within the sensor's range and a limit [m]."""
        ranges = np.asarray(scan_in.ranges, float)
        furthest = scan_in.range_max if range_cutoff < 0.0 else min(range_cutoff, scan_in.range_max)
        kept = np.flatnonzero((ranges >= scan_in.range_min) & (ranges < furthest))
        bearings = scan_in.angle_min + scan_in.angle_increment * kept
        x, y = ranges[kept] * np.cos(bearings), ranges[kept] * np.sin(bearings)
        columns, option = {"x": x, "y": y, "z": np.zeros(len(kept))}, self.ChannelOption
        if channel_options & option.INTENSITY and len(scan_in.intensities):
            columns["intensity"] = np.asarray(scan_in.intensities, float)[kept]
        if channel_options & option.INDEX:
            columns["index"] = kept
        if channel_options & option.DISTANCE:
            columns["distances"] = ranges[kept]
        if channel_options & option.TIMESTAMP:
            columns["stamps"] = kept * scan_in.time_increment
        if channel_options & option.VIEWPOINT:
            columns |= {f"vp_{axis}": np.zeros(len(kept)) for axis in "xyz"}
        fields = _floats(columns)
        for each in fields:
            each.datatype = 5 if each.name == "index" else each.datatype
        return _cloud(scan_in.header, fields, zip(*(each.tolist() for each in columns.values())))  # noqa: B905


# Images


def _image_kind(encoding: str) -> tuple[np.dtype[Any], int]:
    """Return the type and number of the channels of an encoding, such as bgr8, mono16 or 32FC1."""
    found = re.fullmatch(r"(8|16|32|64)([USF])C(\d*)", encoding)
    if found:
        return np.dtype(f"{_FORMATS[found[2]]}{int(found[1]) // 8}"), int(found[3] or 1)
    found = re.fullmatch(r"([a-z_]+)(8|16)", encoding)
    if not found or not (found[1] in _COLOURS or found[1].startswith("bayer_")):
        raise CvBridgeError(f"encoding {encoding!r} is not known; accepted: bgr8, rgb8, mono8, mono16, 32FC1 and alike")
    return np.dtype(f"u{int(found[2]) // 8}"), _COLOURS.get(found[1], 1)


def _recoloured(image: Any, source: str, target: str) -> Any:
    """Return an image in another encoding: channels change their order here, and OpenCV computes other colours."""
    if target in ("passthrough", source):
        return image
    (kind, channels), (wanted, count) = _image_kind(source), _image_kind(target)
    one, other = re.sub(r"\d+$", "", source), re.sub(r"\d+$", "", target)
    if "C" in source or "C" in target:  # of no colours: the same channels under another name
        if (kind, channels) != (wanted, count):
            raise CvBridgeError(f"an image of {source} is wanted as {target}; accepted: as many channels of that type")
        return image
    if kind != wanted:
        image = (image * (257 if wanted.itemsize == 2 else 1 / 257)).astype(wanted)
    if one == other:
        return image
    if sorted(one) == sorted(other):
        return np.ascontiguousarray(image[..., [one.index(each) for each in other]])
    cv2 = _opencv()
    names = [{"mono": "GRAY"}.get(each, each.upper()) for each in (one, other)]
    return cv2.cvtColor(image, getattr(cv2, f"COLOR_{names[0]}2{names[1]}"))


def _opencv() -> Any:
    try:
        import cv2  # type: ignore[import-not-found, unused-ignore]
    except ModuleNotFoundError as lack:
        raise to_install(lack) from None
    return cv2


class _CvBridge:
    """cv_bridge.CvBridge."""

    def imgmsg_to_cv2(self, img_msg: Any, desired_encoding: str = "passthrough") -> Any:
        kind, channels = _image_kind(img_msg.encoding)
        rows = np.frombuffer(bytes(img_msg.data), np.uint8).reshape(img_msg.height, img_msg.step)
        width = img_msg.width * channels * kind.itemsize
        image = np.ascontiguousarray(rows[:, :width]).view(kind.newbyteorder(">" if img_msg.is_bigendian else "<"))
        image = image.astype(kind).reshape(img_msg.height, img_msg.width, channels)
        return _recoloured(image[..., 0] if channels == 1 else image, img_msg.encoding, desired_encoding)

    def cv2_to_imgmsg(self, cvim: Any, encoding: str = "passthrough", header: Any = None) -> Any:
        if not isinstance(cvim, np.ndarray):
            raise TypeError("Your input type is not a numpy array")
        channels = cvim.shape[2] if cvim.ndim > 2 else 1
        if encoding == "passthrough":
            letter = next(each for each, kind in _FORMATS.items() if kind == cvim.dtype.kind)
            encoding = f"{8 * cvim.dtype.itemsize}{letter}C{channels}"
        elif _image_kind(encoding) != (cvim.dtype, channels):
            raise CvBridgeError(f"encoding {encoding} is given for an image of {cvim.dtype} with {channels} channels")
        found = message_class("sensor_msgs/msg/Image")(
            height=cvim.shape[0], width=cvim.shape[1], encoding=encoding, data=cvim.tobytes(),
            step=cvim.shape[1] * channels * cvim.dtype.itemsize,
        )  # fmt: skip
        if header is not None:
            found.header = header
        return found

    def compressed_imgmsg_to_cv2(self, cmprs_img_msg: Any, desired_encoding: str = "passthrough") -> Any:
        cv2 = _opencv()
        image = cv2.imdecode(np.frombuffer(bytes(cmprs_img_msg.data), np.uint8), cv2.IMREAD_UNCHANGED)
        return _recoloured(image, "mono8" if image.ndim == 2 else "bgr8", desired_encoding)

    def cv2_to_compressed_imgmsg(self, cvim: Any, dst_format: str = "jpg") -> Any:
        cv2 = _opencv()
        data = cv2.imencode(f".{dst_format}", cvim)[1].tobytes()
        return message_class("sensor_msgs/msg/CompressedImage")(format=dst_format, data=data)
