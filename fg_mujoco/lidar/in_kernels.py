"""The functions of the native core that kernels of other rooms call: in C, by the addresses of arrays.

`native/lidar/for_kernels.cpp` has them. A scene and its scratch arrays are handed over as consecutive rows of an array
table, in the order of `SceneArrays` and `Scratch`.
"""

from __future__ import annotations

from typing import Any

import llvmlite.binding

from ..compiled.kernels import library_function
from ..native import library_path

llvmlite.binding.load_library_permanently(library_path())  # so that kernels, compiled or read from disk, find it


def _function(name: str, *arguments: str) -> Any:
    return library_function(library_path(), name, "void", *arguments)


_ADDRESS, _WHOLE = "uintp", "int64"

scan = _function("fg_scan", *[_ADDRESS] * 7, _WHOLE)
"""Arguments: rows of the scene, rows of the scratch arrays, position, rotation, moving positions, moving rotations,
out, own tree. See `scanline.scan`."""

place_links = _function(
    "fg_place_links", _ADDRESS, _WHOLE, _ADDRESS, _WHOLE, _ADDRESS, _ADDRESS, _ADDRESS, _WHOLE
)  # fmt: skip
"""Arguments: qpos and its length, links and how many they are, room for poses (links, 7), positions (bodies, 3) [m] and
rotations (bodies, 3, 3), which are written to, and the number of bodies. See `links.make_links`."""

mounted_pose = _function("fg_mounted_pose", _ADDRESS, _WHOLE, *[_ADDRESS] * 4)
"""Arguments: pose of the free body (7,), whether the LiDAR stays level, offsets, position, rotation. See
`body_poses.mounted_pose`."""
