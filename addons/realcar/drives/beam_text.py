"""The comparison of recorded and cast beams as a text of tables."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from .beam_comparison import FURTHEST, HEADING_JUMP, MOST_MOVED, MOST_TURNED, POSE_JUMP, SAME_PLACE

if TYPE_CHECKING:
    from .beam_comparison import Band, BeamComparison


def comparison_text(found: BeamComparison) -> str:
    """Return a comparison as a text of tables; lengths are in centimetres."""
    mount, error = found.mount, found.mount_error
    lines = [
        f"Recorded less cast beams in {found.map_name}: {len(found.drives)} drives. Each is shown with the mount of",
        "the LiDAR, and with the errors of the map, that the others say.",
        "",
        f"LiDAR: {_both(mount.ahead, error.ahead, 100)} cm ahead of the pose, {_both(mount.left, error.left, 100)} cm "
        f"left, turned by {_both(mount.yaw, error.yaw, 1000)} mrad,",
        f"{_both(mount.delay, error.delay, 1000)} ms late; walls {_both(mount.wall_depth, error.wall_depth, 100)} cm "
        "deeper than in the map (mean of the drives, each fitted alone, and its standard error).",
        "",
        "By drive [cm]: |recorded - cast| from the recorded poses of all beams that return, and of those kept; from",
        "the poses fitted to each scan, walls as deep as above; then the spread square to the wall as recorded, with",
        "fitted poses, and less the map's errors.",
        "",
    ]
    rows = [
        (
            drive.name, str(drive.rows), f"{100 * drive.recorded.median:.1f}", f"{100 * drive.recorded.most:.0f}",
            f"{100 * drive.kept.median:.1f}", f"{100 * drive.kept.most:.1f}", f"{100 * drive.fitted.median:.1f}",
            f"{100 * drive.fitted.most:.1f}", *(f"{100 * each:.1f}" for each in drive.spreads),
            f"{100 * drive.jumps:.1f}", f"{100 * drive.lost:.1f}", f"{100 * drive.not_in_map:.1f}",
        )
        for drive in found.drives
    ]  # fmt: skip
    head = (
        "drive", "rows", "all: median", "95 %", "kept: median", "95 %", "fitted: median", "95 %", "spread", "pose out",
        "map out", "jumps %", "lost %", "not in map %",
    )  # fmt: skip
    lines += _columns(head, rows)
    lines += [
        "",
        f"Left out: rows whose pose jumps by {POSE_JUMP:g} m or {HEADING_JUMP:g} rad from what speed and yaw rate say;",
        f"rows whose pose is lost, {MOST_MOVED:g} m or {MOST_TURNED:g} rad from one that agrees with the map; beams "
        f"that differ by more",
        f"than {FURTHEST:g} m square to the wall from the fitted pose, because they do not see what is in the map.",
        "",
        "By range [cm]:",
        "",
        *_bands("range m", found.by_range, [f"{each.least:g} to {each.greatest:g}" for each in found.by_range]),
        "",
        "By bearing, left positive [cm]:",
        "",
        *_bands(
            "bearing deg", found.by_bearing,
            [f"{math.degrees(each.least):.0f} to {math.degrees(each.greatest):.0f}" for each in found.by_bearing],
        ),
        "",
        f"noise: of the sensor, from pairs of scans in which a beam meets the same place within {100 * SAME_PLACE:g} "
        "cm; left: noise and what no step",
        "takes out of recorded less cast, which is no noise of the sensor; nearer and farther: share of beams that see",
        "something before the map's wall, or through it; dropouts: no return, though the map has a wall in reach.",
    ]
    if found.still:
        ranges = ", ".join(
            f"{100 * each.noise:.2f} ({each.least:g} to {each.greatest:g} m, {each.pairs})" for each in found.still
        )
        lines += ["", f"Noise while the car stands, without map and pose [cm] (range, pairs): {ranges}."]
    return "\n".join(lines) + "\n"


def _bands(what: str, bands: Sequence[Band], names: Sequence[str]) -> list[str]:
    head = (
        what, "beams", "all: median", "95 %", "fitted: median", "95 %", "left", "noise", "pairs", "bias", "nearer %",
        "farther %", "dropouts %",
    )  # fmt: skip
    rows = [
        (
            name, str(band.recorded.count), f"{100 * band.recorded.median:.1f}", f"{100 * band.recorded.most:.0f}",
            f"{100 * band.fitted.median:.1f}", f"{100 * band.fitted.most:.1f}", f"{100 * band.left:.1f}",
            f"{100 * band.noise:.2f}", str(band.pairs), f"{100 * band.bias:+.1f}", f"{100 * band.nearer:.1f}",
            f"{100 * band.farther:.1f}", f"{100 * band.dropouts:.3f}",
        )
        for name, band in zip(names, bands, strict=True)
    ]  # fmt: skip
    return _columns(head, rows)


def _columns(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows of cells as lines, the first column to the left and the others to the right."""
    widths = [max(len(cell) for cell in column) for column in zip(head, *rows, strict=True)]
    return [
        "  ".join(
            cell.ljust(width) if place == 0 else cell.rjust(width)
            for place, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in (head, *rows)
    ]


def _both(value: float, error: float, times: float) -> str:
    return f"{times * value:.1f} +- {times * error:.1f}"
