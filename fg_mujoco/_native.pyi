"""Functions of the native core, which is compiled from native/. Arrays are contiguous, of these very types."""

import numpy as np
from numpy.typing import NDArray

_Numbers = NDArray[np.float64]
_Whole = NDArray[np.int64]
_Short = NDArray[np.int32]

INTERFACE: int
SOURCES: str
"""Hash of the sources that it was built from."""

class Scene:
    """The input of a scan, checked: SceneArrays of lidar/visible_surfaces.py."""

    def __init__(
        self, beams: _Numbers, limits: _Numbers, edges: _Numbers, triangles: NDArray[np.uint16], boxes: _Numbers,
        spans: _Short, planes: _Numbers, frames: _Short, shapes: _Numbers, spheres: _Numbers,
    ) -> None: ...  # fmt: skip
    def along(self, beams: _Numbers, limits: _Numbers) -> Scene:
        """Return the same scene for other beams."""

class Scratch:
    """Working arrays of scans: Scratch of lidar/visible_surfaces.py."""

    def __init__(
        self, cuts: _Numbers, columns: _Short, nearest: _Numbers, views: _Short, bins: _Short, poses: _Numbers
    ) -> None: ...

class Poses:
    """Arrays of a BodyPoses."""

    def __init__(
        self, sources: _Short, offset_positions: _Numbers, offset_rotations: _Numbers, positions: _Numbers,
        rotations: _Numbers,
    ) -> None: ...  # fmt: skip

def scan(
    scene: Scene, scratch: Scratch, position: _Numbers, rotation: _Numbers, moving_positions: _Numbers,
    moving_rotations: _Numbers, out: _Numbers, own_tree: int,
) -> None:  # fmt: skip
    """Write the readings of one scan to `out`."""

def scan_poses(scene: Scene, scratch: Scratch, positions: _Numbers, rotations: _Numbers, out: _Numbers) -> None:
    """Write the readings with the LiDAR at the first of some poses, and what moves at the others."""

def scan_state(
    scene: Scene, scratch: Scratch, poses: Poses, qpos: _Numbers, mocap_pos: _Numbers, mocap_quat: _Numbers,
    xpos: _Numbers, xmat: _Numbers, out: _Numbers,
) -> None:  # fmt: skip
    """Do `read_poses`, then `scan_poses`."""

def read_poses(
    poses: Poses, qpos: _Numbers, mocap_pos: _Numbers, mocap_quat: _Numbers, xpos: _Numbers, xmat: _Numbers
) -> None:
    """Write the poses at the state of a mujoco.MjData."""

def mounted_pose(
    pose: _Numbers, level: bool, offset_position: _Numbers, offset_rotation: _Numbers, position: _Numbers,
    rotation: _Numbers,
) -> None:  # fmt: skip
    """Write the pose of what is fixed to a free body."""

def link_fields() -> dict[str, int]:
    """Return the offsets of the fields of a link [bytes]."""

def draw_shares(state: _Whole, out: _Numbers) -> None:
    """Draw numbers from 0 to 1."""

def draw_normals(state: _Whole, limits: _Whole, widths: _Numbers, heights: _Numbers, out: _Numbers) -> None:
    """Draw standard normal numbers."""

def apply_effects(
    rows: _Whole, ranges: _Numbers, states: _Whole, limits: _Whole, widths: _Numbers, heights: _Numbers,
    deviations: _Numbers, noise: _Numbers, dropouts: _Numbers, shares: _Numbers, no_returns: _Numbers, lates: _Whole,
    sweeps: _Whole, held: _Numbers, table_of: _Whole, knots: _Numbers, values: _Numbers, range_min: float,
    range_max: float,
) -> None:  # fmt: skip
    """Apply effects to some rows of ranges, in place."""

def add_noise(ranges: _Numbers, deviation: float, range_max: float, noise: _Numbers) -> None:
    """Turn noise into ranges with noise."""

def error_at(knots: _Numbers, values: _Numbers, which: int, distance: float) -> float:
    """Return noise, bias or dropout at a distance [m]."""

