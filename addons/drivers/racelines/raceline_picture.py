"""The picture of a raceline: from above, coloured by speed, and its accelerations in the g-g diagram of the car."""

from __future__ import annotations

import numpy as np

from fg_mujoco.pictures.course_drawing import draw_course, draw_line, draw_obstacles, extent
from fg_mujoco.pictures.pages.figure_kit import Target, picture

from .raceline import Raceline

_WIDTH, _HEIGHT = 10.5, (4.4, 8.0)  # [in]
_MAP_SHARE = 0.66  # of the width


def raceline_picture(line: Raceline, path: Target) -> None:
    """Draw a raceline as PNG: where it leads and how fast, and its accelerations; MissingExtraError, OSError."""
    from matplotlib.collections import LineCollection

    width, height = (extent(line.course, line.points)[1] - extent(line.course, line.points)[0]).tolist()
    tall = float(np.clip(_MAP_SHARE * _WIDTH * height / width + 0.8, *_HEIGHT))
    with picture(path, _WIDTH, tall) as figure:
        above, diagram = figure.subplots(1, 2, width_ratios=(_MAP_SHARE, 1.0 - _MAP_SHARE))
        draw_course(above, line.course, line.points)
        draw_line(above, line.course)
        draw_obstacles(above, line.obstacles, ())
        closed = np.vstack((line.points, line.points[:1]))
        pieces = LineCollection(
            list(np.stack((closed[:-1], closed[1:]), axis=1)), array=line.speeds, cmap="viridis", linewidth=2.0
        )
        pieces.set_clim(0.0, float(line.speeds.max()))
        above.add_collection(pieces)
        figure.colorbar(pieces, ax=above, label="speed [m/s]", shrink=0.85, pad=0.02)
        above.set_title(f"{line.course.name}: least {line.objective}, lap-time bound {line.lap_time:.2f} s")
        grip, use = line.grip, line.use
        lateral = np.linspace(0.0, grip.lateral, len(grip.braking))
        edge_x, edge_y = (
            np.concatenate((lateral, lateral[::-1])),
            np.concatenate((grip.accelerating, -grip.braking[::-1])),
        )
        for side in (1.0, -1.0):
            diagram.plot(side * edge_x, edge_y, color="0.25", linewidth=0.9)
        diagram.scatter(
            line.lateral, line.accelerations, c=line.speeds, s=4.0, cmap="viridis", vmin=0.0, linewidths=0.0
        )
        reach = 1.12 * max(grip.lateral, float(grip.accelerating.max()), float(grip.braking.max()))
        diagram.set(xlim=(reach, -reach), ylim=(-reach, reach), aspect="equal")  # left is left
        diagram.set(xlabel="acceleration to the left [m/s²]", ylabel="acceleration ahead [m/s²]")
        share = float(np.sum(line.steps / line.speeds * (use > 0.9)) / np.sum(line.steps / line.speeds))
        diagram.set_title(f"more than 90 % of the grip:\n{100.0 * share:.0f} % of the lap")
