"""A scanline z-buffer: all beams leave one point in one plane, so the scan is a picture of one row.

The plane of the beams, the scan plane, cuts a triangle in a line from one of its edges to another. In the frame of the
LiDAR, 1 / distance along such a line is linear in the cosine and the sine of the bearing, and so it is for the ground.
So a surface is drawn into the beams between its ends by two multiplications a beam. Each beam keeps the nearest surface
and takes one division at the end. Nothing is approximate: the sign of a cross product decides which beam lies left of
an end, once for all the triangles that share the end, so that no beam slips through between neighbours. Clusters of
triangles are skipped where the scan plane misses them, out of range, behind the LiDAR, or behind nearer surfaces.

Source: the depth buffer is Catmull's (A subdivision algorithm for computer display of curved surfaces, 1974), leaving
out clusters by it Greene's (Hierarchical Z-buffer visibility, SIGGRAPH 1993); here in a picture of one row.
"""

from __future__ import annotations

from ..messages import FloatArray
from ..native import core
from .visible_surfaces import SceneArrays, Scratch


def scan(
    scene: SceneArrays,
    position: FloatArray,
    rotation: FloatArray,
    moving_positions: FloatArray,
    moving_rotations: FloatArray,
    scratch: Scratch,
    out: FloatArray,
    own_tree: int = -1,
) -> None:
    """Write the readings of one scan: distances [m], +inf from `range_max` on, -inf below `range_min` (REP 117).

    Args:
      position, rotation: (3,) [m] and (3, 3) of the LiDAR, into the world's frame.
      moving_positions, moving_rotations: (m, 3) [m] and (m, 3, 3) of the bodies ScanlineScene.moving.
      scratch: ScanlineScene.scratch(), of this thread alone.
      out: (beams,) [m], written to.
      own_tree: of the car that carries the LiDAR, of which it sees nothing, as in SceneArrays.frames; -1: none.

    Raises:
      TypeError: an array is not contiguous or of another type.
      ValueError: the arrays do not fit together.
    """
    native_scene, native_scratch = core.Scene(*scene), core.Scratch(*scratch)
    core.scan(native_scene, native_scratch, position, rotation, moving_positions, moving_rotations, out, own_tree)
