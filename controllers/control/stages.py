"""What a planner makes of a scan, stage by stage, for pictures: the steps that its decision takes in one go.

    for name, ranges in stages(planner, scan).items(): ...

Stages are ranges (n,) [m], in the order of the work, of all beams of the scan:

raw        what was measured, without NaN and inf
extended   after edges were widened
bubble     after the nearest point's surroundings were taken out: 0 there
gap        the beams of the gap that was chosen; NaN elsewhere

A planner of your own says them by a method `stages(scan)`; one that does not has `raw`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from fg_mujoco.messages import FloatArray, LaserScan

from .. import disparity_extender, disparity_selection, follow_the_gap, gap_finder, threshold_gap, weighted_gap
from ..perception.gaps import deepest_run, longest_run, runs_beyond
from ..perception.scan_filters import (
    clip_to_lookahead,
    extend_disparities,
    mask_nearest,
    rolling_mean,
    valid_ranges,
    widen_all,
)
from ..perception.scan_geometry import beams_between, scan_record

Stages = dict[str, FloatArray]


def stages(planner: Any, scan: LaserScan) -> Stages:
    """Return the stages of a planner's work on a scan; names and arrays as above."""
    own = getattr(planner, "stages", None)
    if callable(own):
        return {name: np.asarray(ranges, dtype=np.float64) for name, ranges in own(scan).items()}
    valid = valid_ranges(scan.ranges, scan.range_max)
    work = _WORK.get(type(planner))
    return {"raw": valid} | (work(planner, scan, valid) if work is not None else {})


def _gap_finder(planner: gap_finder.GapFinder, scan: LaserScan, valid: FloatArray) -> Stages:
    settings, increment = planner.settings, scan.angle_increment
    reach = 0.5 * float(planner.record["driver"]["car"]["width"][0]) + settings.clearance
    clipped = clip_to_lookahead(valid, settings.lookahead)
    extended = extend_disparities(clipped, increment, settings.disparity_threshold, reach)
    bubble = mask_nearest(extended, increment, settings.nearest_bubble)
    shaped = rolling_mean(bubble, increment, settings.mean_radius)
    goal = planner.find_goal(scan)
    gap = np.full(len(valid), np.nan)
    if goal is not None:
        first, end = _field(scan, settings.field_of_view)
        beam = round((goal[0] - scan.angle_min) / increment)
        first, end = _run_round(shaped, beam, first, end)
        gap[first:end] = shaped[first:end]
    return {"extended": extended, "bubble": bubble, "gap": gap}


def _follow_the_gap(planner: follow_the_gap.FollowTheGap, scan: LaserScan, valid: FloatArray) -> Stages:
    settings = planner.record[0]["settings"]
    bubble = clip_to_lookahead(valid, planner.settings.lookahead)
    first, end = _field(scan, planner.settings.field_of_view)
    bubble[first:end] = follow_the_gap.free_space(bubble[first:end].copy(), scan.angle_increment, settings)
    start, stop = longest_run(bubble[first:end].copy())
    return {"bubble": bubble, "gap": _only(bubble, first + start, first + stop)}


def _disparity_extender(planner: disparity_extender.DisparityExtender, scan: LaserScan, valid: FloatArray) -> Stages:
    return {"extended": disparity_extender.reachable(scan_record(scan)[0], valid, planner.record[0])}


def _disparity_selection(planner: disparity_selection.DisparitySelection, scan: LaserScan, valid: FloatArray) -> Stages:
    settings, increment = planner.settings, scan.angle_increment
    bubble = clip_to_lookahead(valid, settings.lookahead)
    first, end = _field(scan, settings.field_of_view)
    seen = mask_nearest(bubble[first:end].copy(), increment, settings.bubble_radius)
    bubble[first:end] = seen
    start, stop = longest_run(seen)
    opening = disparity_selection.widest_opening(seen, start, stop, increment, settings.disparity_threshold)
    if opening[0] == opening[1]:
        opening = deepest_run(seen, start, stop, 0.0)
    return {"bubble": bubble, "gap": _only(bubble, first + opening[0], first + opening[1])}


def _threshold_gap(planner: threshold_gap.ThresholdGap, scan: LaserScan, valid: FloatArray) -> Stages:
    settings = planner.settings
    first, end = _field(scan, settings.field_of_view)
    seen = valid[first:end].copy()
    gaps = runs_beyond(seen, min(settings.threshold, 0.999 * scan.range_max), settings.least_readings)
    chosen = threshold_gap.choose_gap(seen, gaps, planner.record[0]["settings"])
    start, stop = gaps[chosen] if chosen >= 0 else (0, 0)
    return {"gap": _only(valid, first + int(start), first + int(stop))}


def _weighted_gap(planner: weighted_gap.WeightedGap, scan: LaserScan, valid: FloatArray) -> Stages:
    settings = planner.settings
    radius = 0.5 * float(planner.record["driver"]["car"]["width"][0]) + settings.clearance
    extended = widen_all(valid, scan.angle_increment, radius)
    first, end = _field(scan, settings.field_of_view)
    gaps = runs_beyond(extended[first:end].copy(), min(settings.horizon, 0.999 * scan.range_max), 1)
    start, stop = gaps[int(np.argmax(gaps[:, 1] - gaps[:, 0]))] if len(gaps) else (0, 0)
    return {"extended": extended, "gap": _only(extended, first + int(start), first + int(stop))}


def _field(scan: LaserScan, width: float) -> tuple[int, int]:
    """Return the beams of a field of view [rad]: first, and last + 1."""
    first, end = beams_between(scan_record(scan)[0], len(scan.ranges), -0.5 * width, 0.5 * width)
    return int(first), int(end)


def _run_round(ranges: FloatArray, beam: int, first: int, end: int) -> tuple[int, int]:
    """Return the run of readings above 0 that a beam is in, within `ranges[first:end]`."""
    blocked = np.flatnonzero(ranges[first:end] <= 0.0) + first
    place = int(np.searchsorted(blocked, beam))
    start = int(blocked[place - 1]) + 1 if place > 0 else first
    stop = int(blocked[place]) if place < len(blocked) else end
    return start, stop


def _only(ranges: FloatArray, first: int, end: int) -> FloatArray:
    result = np.full(len(ranges), np.nan)
    result[first:end] = ranges[first:end]
    return result


_WORK: dict[type, Callable[[Any, LaserScan, FloatArray], Stages]] = {
    gap_finder.GapFinder: _gap_finder,
    follow_the_gap.FollowTheGap: _follow_the_gap,
    disparity_extender.DisparityExtender: _disparity_extender,
    disparity_selection.DisparitySelection: _disparity_selection,
    threshold_gap.ThresholdGap: _threshold_gap,
    weighted_gap.WeightedGap: _weighted_gap,
}
