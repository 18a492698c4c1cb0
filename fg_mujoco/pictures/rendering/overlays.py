"""Overlays of a picture: beams coloured by the intermediate scans, the trace, tire forces, the telemetry strip."""

from __future__ import annotations

from dataclasses import dataclass, fields
from itertools import pairwise

import mujoco
import numpy as np

from ...errors import SettingsError, accepted_names
from ...messages import FloatArray
from .cameras import View
from .colours import STAGES, friction_colour
from .decor import Colour, line, ring, slat, sphere, triangle
from .planner_view import PlannerView
from .recorded_drive import Drive

_TRACE_PIECES = 900  # most of them: a longer trace has longer pieces
_TRACE_WIDTH = 0.05  # [m]
_ABOVE = 0.003  # [m] over the road
_EVERY = 8  # of the beams one is drawn, 2 degrees apart
_GAP_EVERY = 3  # of the gap's edge


@dataclass(frozen=True, kw_only=True)
class Overlays:
    """Switches."""

    beams: bool = False  # of the LiDAR, coloured by the planner's intermediate scans
    trace: bool = False  # of the rear axle so far, coloured by friction utilisation
    forces: bool = False  # of the tires, in their friction circles
    strip: bool = False  # with speed, its limit by the friction law, steering, lap, sliding


OVERLAYS = tuple(field.name for field in fields(Overlays))
"""Their names."""

USUAL_OVERLAYS = {
    "chase": Overlays(strip=True),
    "onboard": Overlays(strip=True),
    "top": Overlays(beams=True, trace=True, strip=True),
    "track": Overlays(trace=True, strip=True),
    "orbit": Overlays(forces=True, strip=True),
}
"""Default overlays of each camera."""


def find_overlays(camera: str, **switches: bool | None) -> Overlays:
    """Return the usual overlays of a camera with some switched on or off, None: as usual; raise SettingsError."""
    unknown = [name for name in switches if name not in OVERLAYS]
    if unknown:
        raise SettingsError(f"overlay {unknown[0]!r} is not known; {accepted_names(unknown[0], OVERLAYS)}")
    usual = USUAL_OVERLAYS.get(camera, Overlays())
    chosen = {name: getattr(usual, name) if switches.get(name) is None else bool(switches[name]) for name in OVERLAYS}
    return Overlays(**chosen)


def draw_beams(scene: mujoco.MjvScene, seen: PlannerView, origin: FloatArray, pixels: float, height: float) -> None:
    """Add the beams: the part that the planner keeps in the colour of its use, the part cut off in that of the filter.

    They start at `origin` (3,) [m], as the LiDAR moves on after its scan; a line is so many `pixels` wide, and the
    gap's surface at a `height` [m].
    """
    scans, scan = seen.intermediate_scans, seen.scan
    raw = np.minimum(scans["raw"], scan.range_max)
    kept, fate = _fates(scans, raw)
    beams = np.arange(0, len(raw), _EVERY)
    ends, hits = seen.points(kept, beams), seen.points(raw, beams)
    colours = {name: np.array(rgb) for name, rgb in STAGES.items()}
    for end, hit, beam in zip(ends, hits, beams, strict=True):
        name = fate[beam]
        colour = colours[name]
        if name == "bubble":
            line(scene, 1.5 * pixels, origin, hit, (*colour, 0.9))
            continue
        line(scene, pixels, origin, end, (*colour, 0.8))
        if raw[beam] - kept[beam] > 0.02:
            line(scene, pixels, end, hit, (*colours["extended"], 0.9))
    _draw_gap(scene, seen, fate, origin, height)
    if seen.goal is not None:
        magenta = (*STAGES["goal"], 1.0)
        line(scene, 3.0 * pixels, origin, seen.goal, magenta)
        sphere(scene, seen.goal, 0.09, magenta)


def _fates(scans: dict[str, FloatArray], raw: FloatArray) -> tuple[FloatArray, list[str]]:
    """Return the length that is left of each beam (n,) [m], and which intermediate scan decided it."""
    kept = np.minimum(raw, scans.get("extended", raw))
    fate = ["raw"] * len(raw)
    bubble, gap = scans.get("bubble"), scans.get("gap")
    for beam in range(len(raw)):
        if gap is not None and np.isfinite(gap[beam]):
            fate[beam] = "gap"
        elif bubble is not None and bubble[beam] <= 0.0:
            fate[beam] = "bubble"
    return kept, fate


def _draw_gap(scene: mujoco.MjvScene, seen: PlannerView, fate: list[str], origin: FloatArray, height: float) -> None:
    """Add the surface between the beams of the gap."""
    gap = seen.intermediate_scans.get("gap")
    if gap is None:
        return
    beams = np.flatnonzero([name == "gap" for name in fate])[::_GAP_EVERY]
    if len(beams) < 2:
        return
    ends = seen.points(np.nan_to_num(gap), beams)
    ends[:, 2] = height
    centre = np.array([origin[0], origin[1], height])
    for right, left in pairwise(ends):
        triangle(scene, centre, right, left, (*STAGES["gap"], 0.30))


def draw_trace(scene: mujoco.MjvScene, drive: Drive, time: float, here: FloatArray, view: View, rows: int) -> None:
    """Add the way of the rear axle up to a time [s], when it is `here` (3,) [m]; the picture has so many rows."""
    count = int(np.searchsorted(drive.time[:-1], time, side="right"))
    if count < 1:
        return
    width = max(_TRACE_WIDTH, 3.0 * _pixel(view, rows))
    every = max(1, -(-count // _TRACE_PIECES))
    ticks = np.append(np.arange(0, count, every), count) if count > 1 else np.array([0, 1])
    points = np.column_stack((drive.column("x_m")[:count], drive.column("y_m")[:count], np.full(count, _ABOVE)))
    points = np.vstack((points, (here[0], here[1], _ABOVE)))[np.minimum(ticks, count)]
    use = np.maximum.reduceat(drive.friction_utilisation[:count], ticks[:-1])
    for start, end, colour in zip(points[:-1], points[1:], friction_colour(use), strict=True):
        slat(scene, start, end, width, (*colour, 1.0))


def draw_marker(
    scene: mujoco.MjvScene, position: FloatArray, heading: float, view: View, colour: Colour | None = None
) -> None:
    """Add a ring round a car that is small in the picture, with a tip where it is heading; dark blue by default."""
    size = 0.022 * view.height
    ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
    aside = np.array([-ahead[1], ahead[0], 0.0])
    centre = np.array([position[0], position[1], 0.35]) + 0.165 * ahead
    colour = colour or (0.05, 0.10, 0.35, 1.0)
    ring(scene, centre, size, 0.22 * size, colour, 36)
    tip = centre + 1.75 * size * ahead
    triangle(
        scene, tip, centre + size * (1.1 * ahead + 0.55 * aside), centre + size * (1.1 * ahead - 0.55 * aside), colour
    )


def _pixel(view: View, rows: int) -> float:
    """Return the length of a pixel on the ground that is looked at [m]."""
    if view.is_parallel:
        return view.height / rows
    return 2.0 * float(np.linalg.norm(view.focus - view.position)) * float(np.tan(0.5 * view.fovy)) / rows
