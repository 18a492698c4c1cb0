"""Slow, independent answers to what tracks compute: every segment against every ray or point, no search structure."""

import numpy as np


def ray_distances(origins, directions, wall):
    """Distance along each ray (k, 2) to a closed wall (m, 2); inf where it misses. Shape (k,)."""
    along = np.roll(wall, -1, axis=0) - wall
    away = wall - origins[:, None]
    scale = directions[:, None, 0] * along[:, 1] - directions[:, None, 1] * along[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (away[..., 0] * along[:, 1] - away[..., 1] * along[:, 0]) / scale
        share = (away[..., 0] * directions[:, None, 1] - away[..., 1] * directions[:, None, 0]) / scale
    hit = (share >= -1e-9) & (share <= 1.0 + 1e-9) & (distance > 0.0)
    return np.where(hit, distance, np.inf).min(axis=1)


def distances_to_line(points, line):
    """Distance of each point (k, 2) to each segment of a closed line (n, 2). Shape (k, n)."""
    along = np.roll(line, -1, axis=0) - line
    share = np.sum((points[:, None] - line) * along, axis=2) / np.sum(along * along, axis=1)
    foot = line + np.clip(share, 0.0, 1.0)[..., None] * along
    return np.linalg.norm(points[:, None] - foot, axis=2)


def room_beside(track):
    """From each centreline point square to the line to the left and the right wall, less the width. Shape (2, n)."""
    left = np.column_stack((-np.sin(track.headings), np.cos(track.headings)))
    return np.array(
        [
            ray_distances(track.centreline, left, track.left_wall) - track.corridor_left,
            ray_distances(track.centreline, -left, track.right_wall) - track.corridor_right,
        ]
    )


def winding(points, loop):
    """How often a closed loop (m, 2) goes round each point (k, 2), counterclockwise. Shape (k,)."""
    away = loop - points[:, None]
    following = np.roll(away, -1, axis=1)
    turn = np.arctan2(
        away[..., 0] * following[..., 1] - away[..., 1] * following[..., 0], np.sum(away * following, axis=2)
    )
    return np.round(turn.sum(axis=1) / (2.0 * np.pi)).astype(int)


def inside_prisms(points, prisms):
    """Tell which points (k, 2) lie in the footprint of any prism (m, 8, 3). Shape (k,)."""
    feet = prisms[:, :4, :2]
    edges = np.roll(feet, -1, axis=1) - feet
    inside = np.zeros(len(points), dtype=bool)
    for corners, sides in zip(feet, edges, strict=True):
        away = points[:, None] - corners
        inside |= np.all(sides[:, 0] * away[..., 1] - sides[:, 1] * away[..., 0] > 0.0, axis=1)
    return inside
