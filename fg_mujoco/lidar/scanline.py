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

import math

import numpy as np

from ..compiled.kernels import inlined, kernel
from ..messages import FloatArray
from .culling import TINY, Pose, bearing, is_hidden, skip, sort_by_distance, survey, whole_turn
from .round_shapes import into_shape, ray_distance
from .visible_surfaces import NO_END, SceneArrays, Scratch

_EDGE_ON = 1e-11  # [rad] that a surface spans, under which its two ends are in one direction
_PARALLEL = 1e-15  # mjMINVAL: MuJoCo's rays miss a plane that they approach more slowly
_NOT_CUT = -2  # column of an edge that the scan plane does not cut


@kernel
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
    """
    range_min, range_max = scene.limits[2], scene.limits[3]
    for beam in range(len(out)):  # until the end `out` holds 1 / distance; what is farther is not drawn
        out[beam] = (1.0 - 1e-12) / range_max
    for frame in range(len(scene.frames)):
        first_cluster, behind_cluster, first_plane, behind_plane, first_shape, behind_shape, tree = scene.frames[frame]
        if frame == 0:
            _look_from(position, rotation, scratch.poses[0])
        else:
            body = frame - 1
            at, turn = moving_positions[body], moving_rotations[body]
            if tree == own_tree or _is_off_plane(scene.spheres[frame], position, rotation, at, turn):
                skip(first_cluster, behind_cluster, scratch)
                continue
            _look_from_moving(position, rotation, at, turn, scratch.poses[frame])
        for plane in range(first_plane, behind_plane):
            _draw_plane(scene.planes[plane], _pose(scratch.poses, frame), scene.beams, out)
        for shape in range(first_shape, behind_shape):
            _draw_shape(scene, scene.shapes[shape], _pose(scratch.poses, frame), out)
        survey(scene, _pose(scratch.poses, frame), first_cluster, behind_cluster, scratch)
    turn = whole_turn(scene)
    for place in range(sort_by_distance(scene, scratch)):
        cluster = scratch.views[2, place]
        right, left = scratch.views[0, cluster], scratch.views[1, cluster]
        if not is_hidden(right, left, scratch.nearest[cluster], turn, out):
            _draw_cluster(scene, cluster, scratch, out)
    for beam in range(len(out)):
        distance = 1.0 / out[beam]
        distance = distance if distance < range_max else math.inf
        out[beam] = distance if distance >= range_min else -math.inf


@kernel
def _is_off_plane(
    sphere: FloatArray, position: FloatArray, rotation: FloatArray, body_position: FloatArray, body_rotation: FloatArray
) -> bool:
    """Return whether the scan plane misses the sphere around what a body carries."""
    height = 0.0
    for i in range(3):
        away = body_position[i] - position[i]
        for j in range(3):
            away += body_rotation[i, j] * sphere[j]
        height += rotation[i, 2] * away
    return bool(abs(height) > sphere[3])


@kernel
def _look_from(position: FloatArray, rotation: FloatArray, pose: FloatArray) -> None:
    """Write where the world's frame has the LiDAR: its position, and the rotation into the LiDAR's frame."""
    for i in range(3):
        pose[i] = position[i]
        for j in range(3):
            pose[3 + 3 * i + j] = rotation[j, i]


@kernel
def _look_from_moving(
    position: FloatArray, rotation: FloatArray, body_position: FloatArray, body_rotation: FloatArray, pose: FloatArray
) -> None:
    """Write where a body's frame has the LiDAR, as `_look_from`."""
    for i in range(3):
        pose[i] = 0.0
        for k in range(3):
            pose[i] += body_rotation[k, i] * (position[k] - body_position[k])
        for j in range(3):
            pose[3 + 3 * i + j] = 0.0
            for k in range(3):
                pose[3 + 3 * i + j] += rotation[k, i] * body_rotation[k, j]


@kernel
def _pose(poses: FloatArray, frame: int) -> Pose:
    p = poses[frame]
    return p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7], p[8], p[9], p[10], p[11]


@kernel
def _draw_cluster(scene: SceneArrays, cluster: int, scratch: Scratch, out: FloatArray) -> None:
    first_edge, behind_edge, first_triangle, behind_triangle, frame = scene.spans[cluster]
    _cut_edges(scene, _pose(scratch.poses, frame), first_edge, behind_edge, scratch)
    cuts, columns = scratch.cuts, scratch.columns
    for edge in range(behind_edge - first_edge):
        if columns[edge] != _NOT_CUT:
            columns[edge] = _exact_column(scene.beams, cuts[0, edge], cuts[1, edge], columns[edge])
    for triangle in range(first_triangle, behind_triangle):
        one, other, third = scene.triangles[triangle, 0], scene.triangles[triangle, 1], scene.triangles[triangle, 2]
        if columns[one] == _NOT_CUT:
            if columns[other] == _NOT_CUT:
                continue  # the plane cuts two edges of a triangle or none
            one = third
        elif columns[other] == _NOT_CUT:
            other = third
        if columns[one] != columns[other] or (cuts[1, one] >= 0.0) != (cuts[1, other] >= 0.0):  # else between beams
            _draw_line(
                scene.beams, cuts[0, one], cuts[1, one], columns[one], cuts[0, other], cuts[1, other], columns[other],
                out,
            )  # fmt: skip


@kernel
def _cut_edges(scene: SceneArrays, pose: Pose, first: int, behind: int, scratch: Scratch) -> None:
    """Write where the scan plane cuts edges, and the first beam left of that, give or take one; -1, n + 1: beyond."""
    ox, oy, oz, xx, xy, xz, yx, yy, yz, zx, zy, zz = pose
    per_radian = 1.0 / scene.limits[1]
    angle_min = scene.limits[0]
    beyond = float(scene.beams.shape[1] + 1)
    start_x, start_y, start_z = scene.edges[0, first:behind], scene.edges[1, first:behind], scene.edges[2, first:behind]
    end_x, end_y, end_z = scene.edges[3, first:behind], scene.edges[4, first:behind], scene.edges[5, first:behind]
    count = len(start_x)
    cut_x, cut_y, columns = scratch.cuts[0, :count], scratch.cuts[1, :count], scratch.columns[:count]
    for i in range(count):
        ax, ay, az = start_x[i] - ox, start_y[i] - oy, start_z[i] - oz
        bx, by, bz = end_x[i] - ox, end_y[i] - oy, end_z[i] - oz
        above, other_above = zx * ax + zy * ay + zz * az, zx * bx + zy * by + zz * bz
        share = above / (above - other_above)
        px, py, pz = ax + share * (bx - ax), ay + share * (by - ay), az + share * (bz - az)
        x = xx * px + xy * py + xz * pz
        y = yx * px + yy * py + yz * pz
        column = math.ceil((bearing(x, y) - angle_min) * per_radian)
        column = column if column > -1.0 else -1.0
        column = column if column < beyond else beyond
        cut_x[i], cut_y[i] = x, y
        columns[i] = np.int32(column) if (above >= 0.0) != (other_above >= 0.0) else np.int32(_NOT_CUT)


@inlined
def _exact_column(beams: FloatArray, x: float, y: float, column: int) -> int:
    """Return the first beam at or to the left of a point, from what may be one too many or too few."""
    count = int(beams.shape[1])
    if 0 < column <= count and x * beams[1, column - 1] - y * beams[0, column - 1] >= 0.0:
        column -= 1
    elif 0 <= column < count and x * beams[1, column] - y * beams[0, column] < 0.0:
        column += 1
    return min(max(column, 0), count)


@inlined
def _draw_line(beams: FloatArray, ax: float, ay: float, a: int, bx: float, by: float, b: int, out: FloatArray) -> None:
    """Draw the line between two points of the scan plane, whose first beams at or to the left are `a` and `b`."""
    ex, ey = bx - ax, by - ay
    cross = ax * ey - ay * ex  # positive where `b` is to the left of `a`
    edge_on = abs(cross) <= _EDGE_ON * (abs(ax) + abs(ay)) * (abs(ex) + abs(ey))
    if edge_on and ax * bx + ay * by > 0.0:
        # Which end is to the left is rounding. What is seen is the nearer end.
        x, y = (ax, ay) if ax * ax + ay * ay < bx * bx + by * by else (bx, by)
        inverse = 1.0 / (x * x + y * y)
        along_x, along_y = x * inverse, y * inverse
        right, left = min(a, b), max(a, b)
        behind = x < 0.0 and (ay >= 0.0) != (by >= 0.0)
        if behind:
            right, left = left, right
    else:
        inverse = math.copysign(1.0 / max(abs(cross), TINY), cross)
        along_x, along_y = ey * inverse, -ex * inverse
        if cross > 0.0:
            right, left, behind = a, b, ay >= 0.0 and by < 0.0
        else:
            right, left, behind = b, a, by >= 0.0 and ay < 0.0
    # From the right end to the left one, or over straight behind.
    _draw(beams, along_x, along_y, right, len(out) if behind else left, out)
    if behind:
        _draw(beams, along_x, along_y, 0, left, out)


@inlined
def _draw(beams: FloatArray, along_x: float, along_y: float, first: int, behind: int, out: FloatArray) -> None:
    """Draw a surface, 1 / distance of which is along_x * cosine + along_y * sine of the bearing, into some beams."""
    cosine, sine = beams[0], beams[1]
    for beam in range(np.uintp(first), np.uintp(behind)):  # unsigned: else numba asks of each index if it is negative
        inverse = along_x * cosine[beam] + along_y * sine[beam]
        out[beam] = inverse if inverse > out[beam] else out[beam]


@kernel
def _draw_plane(plane: FloatArray, pose: Pose, beams: FloatArray, out: FloatArray) -> None:
    """Draw the front of a plane; where it ends is asked of each beam."""
    ox, oy, oz, xx, xy, xz, yx, yy, yz, _, _, _ = pose
    gx, gy, gz = ox - plane[0], oy - plane[1], oz - plane[2]
    height = gx * plane[5] + gy * plane[8] + gz * plane[11]
    if not height >= 0.0:
        return
    slope_x, slope_y = xx * plane[5] + xy * plane[8] + xz * plane[11], yx * plane[5] + yy * plane[8] + yz * plane[11]
    if plane[12] == NO_END and plane[13] == NO_END and height > 1e-9:
        _draw(beams, -slope_x / height, -slope_y / height, 0, len(out), out)
        return
    # The place on the plane is start + distance * (slope_x * cosine + slope_y * sine), on each axis.
    start_1 = gx * plane[3] + gy * plane[6] + gz * plane[9]
    slope_x1, slope_y1 = xx * plane[3] + xy * plane[6] + xz * plane[9], yx * plane[3] + yy * plane[6] + yz * plane[9]
    start_2 = gx * plane[4] + gy * plane[7] + gz * plane[10]
    slope_x2, slope_y2 = xx * plane[4] + xy * plane[7] + xz * plane[10], yx * plane[4] + yy * plane[7] + yz * plane[10]
    for i in range(len(out)):
        cosine, sine = beams[0, i], beams[1, i]
        approach = -(slope_x * cosine + slope_y * sine)
        inverse = approach / max(height, TINY)
        seen = (
            approach > _PARALLEL
            and abs(start_1 * inverse + slope_x1 * cosine + slope_y1 * sine) <= plane[12] * inverse
            and abs(start_2 * inverse + slope_x2 * cosine + slope_y2 * sine) <= plane[13] * inverse
        )
        if seen and inverse > out[i]:
            out[i] = inverse


@kernel
def _draw_shape(scene: SceneArrays, shape: FloatArray, pose: Pose, out: FloatArray) -> None:
    """Draw a round shape into the beams that may meet it, each of which is asked."""
    ox, oy, oz, xx, xy, xz, yx, yy, yz, zx, zy, zz = pose
    cx, cy, cz, radius = shape[4] - ox, shape[5] - oy, shape[6] - oz, shape[16]
    if abs(zx * cx + zy * cy + zz * cz) > radius + 1e-9:
        return
    x, y = xx * cx + xy * cy + xz * cz, yx * cx + yy * cy + yz * cz
    ratio = radius / (math.sqrt(x * x + y * y) + TINY)
    spread = ratio + 0.5708 * ratio * ratio * ratio if ratio < 1.0 else 1e6 * scene.limits[1]  # as in culling.survey
    middle, spread = (bearing(x, y) - scene.limits[0]) / scene.limits[1], spread / scene.limits[1]
    beams, turn = len(out), whole_turn(scene)
    right, left = int(middle - spread - 2.0), int(middle + spread + 3.0)
    _draw_shape_into(scene, shape, pose, max(right, 0), min(left, beams), out)
    if right + turn < beams:  # what goes on beyond straight behind
        _draw_shape_into(scene, shape, pose, max(right + turn, 0), beams, out)
    if left - turn > 0:
        _draw_shape_into(scene, shape, pose, 0, min(left - turn, beams), out)


@kernel
def _draw_shape_into(
    scene: SceneArrays, shape: FloatArray, pose: Pose, first: int, behind: int, out: FloatArray
) -> None:
    ox, oy, oz, xx, xy, xz, yx, yy, yz, _, _, _ = pose
    px, py, pz = into_shape(shape, ox - shape[4], oy - shape[5], oz - shape[6])
    ax, ay, az = into_shape(shape, xx, xy, xz)
    bx, by, bz = into_shape(shape, yx, yy, yz)
    for beam in range(first, behind):
        cosine, sine = scene.beams[0, beam], scene.beams[1, beam]
        distance = ray_distance(
            shape[0], shape[1], shape[2], shape[3], px, py, pz,
            cosine * ax + sine * bx, cosine * ay + sine * by, cosine * az + sine * bz,
        )  # fmt: skip
        if distance >= 0.0 and distance * out[beam] < 1.0:
            out[beam] = 1.0 / max(distance, TINY)
