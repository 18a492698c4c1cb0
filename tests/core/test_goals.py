"""Where each planner heads in scans whose answer was worked out by hand; `method=source` is its text to the letter."""

import math

import numpy as np
import pytest
from test_gaps import SLIDES

from cases import each
from fg_mujoco.racing.planners import make_controller
from scan_worlds import CAR, INCREMENT, MU, scan_of

BEARINGS = INCREMENT * (np.arange(1081) - 540)
SOURCE = {"method": "source"}
NO_FILTER = {"disparity_threshold": 100.0, "nearest_bubble": 0.001, "mean_radius": 1e-6}  # which does much
SLIDE = np.array([4.8, 3.1, 4.3, 4.5, 6.0, 10.1, 8.3])  # the slides', with one reading of 6 m for ".."
TWO_GAPS = np.where(np.isinf(SLIDES), 20.0, SLIDES) + (np.arange(12) == 8)  # as deep, the narrower a metre farther
NARROW = CAR.width + 0.1  # [m] at 1 m, the margins of the weighted gap included


def all_round(distance, *parts, **geometry):
    """A scan of one distance, but for some beams: (first, end, distance)."""
    ranges = np.full(1081, float(distance))
    for first, end, other in parts:
        ranges[first:end] = other
    return scan_of(ranges, **geometry)


def opening(right, left):
    """A scan of 1 m all round, and of 9 m between two bearings [rad]."""
    return scan_of(np.where((right < BEARINGS) & (left > BEARINGS), 9.0, 1.0))


def at(beam):
    return (beam - 540) * INCREMENT


def near(bearing):
    """A bearing at an edge that is between two beams."""
    return pytest.approx(bearing, abs=2.0 * INCREMENT)


DEEP = all_round(2.0, (600, 641, 5.0), (635, 636, 9.0))
SEVEN = scan_of([4.0, 4.0, 4.0, 2.0, 4.0, 4.0, 40.0], 0.1)
STEP = scan_of([2.2, 2.0, 4.0, 4.0, 4.0, 4.0, 4.0], 0.1)
PEAK = all_round(5.0, (800, 801, 6.0))
# readings 600 and 601 at 15 and 15.25 degrees: C = (5 cos 15 + 2 cos 15.25, 5 sin 15 + 2 sin 15.25) / 2
CENTRE = math.atan2(0.910087, 3.379602), math.hypot(0.910087, 3.379602)

GOALS = {
    "selection: in the largest gap, not in an opening of a smaller": (
        "disparity_selection", {}, all_round(2.0, (400, 440, 0.7), (300, 330, 2.9), (700, 760, 2.9)), (at(729.5), 2.9),
    ),
    "selection: between two boxes": (
        "disparity_selection", {}, all_round(2.9, (0, 200, 0.6), (620, 700, 1.5), (800, 900, 1.5)), (at(749.5), None),
    ),
    # .6 m is masked, atan(.4 / .6) / .3 is 1.96, one beam; of the rest the longest run is the left one
    "selection, source: the first beam of the longest run": (
        "disparity_selection", SOURCE, scan_of([2.0, 0.6, 2.0, 2.0, 2.8, 2.8, 2.8, 2.8, 2.0, 2.0], 0.3), (0.15, 2.8),
    ),
    "follow: beyond the lookahead all is as far": ("follow_the_gap", {"lookahead": 3.0}, DEEP, (at(620), 3.0)),
    "follow: within it the furthest": ("follow_the_gap", {"lookahead": 30.0}, DEEP, (at(635), 9.0)),
    # atan(1 / 3.1) is .312 rad: three beams to either side
    "follow, source: the furthest": (
        "follow_the_gap", SOURCE | {"bubble_radius": 1.0}, scan_of(SLIDE, 0.1), (0.2, 10.1),
    ),
    "follow, source: the first of several": (
        "follow_the_gap", SOURCE | {"bubble_radius": 1.0}, scan_of([*SLIDE[:4], *[math.inf] * 3], 0.1), (0.2, None),
    ),
    "threshold: the widest": (
        "threshold_gap", {"threshold": 5.0, "least_readings": 2, "gap": "widest"}, scan_of(TWO_GAPS, 0.1), (-0.3, None),
    ),
    "threshold: the deepest": (
        "threshold_gap", {"threshold": 5.0, "least_readings": 2, "gap": "deepest"}, scan_of(TWO_GAPS, 0.1), (0.3, None),
    ),
    "threshold: a sensor that sees less far has a gap where nothing returns": (
        "threshold_gap", {"threshold": 5.0}, all_round(1.0, (600, 700, math.inf), range_max=4.0), (at(649.5), 4.0),
    ),
    "threshold, source: the slides' n and t": ("threshold_gap", SOURCE, scan_of(SLIDES, 0.1), (-0.3, 6.0)),
    # both sides at 1 m: the middle of the opening, times (2 / 1) / (2 / 1 + 1)
    **{f"weighted: between {right} and {left}": (
           "weighted_gap", {}, opening(right, left), (near((right + left) / 3.0), None))
       for right, left in ((-0.3, 0.5), (-1.0, -0.4), (0.2, 0.8))},
    "weighted: a gap narrower than the car is none": ("weighted_gap", {}, opening(-0.45 * NARROW, 0.45 * NARROW), None),
    "weighted: a wider one is one": ("weighted_gap", {}, opening(-0.55 * NARROW, 0.55 * NARROW), (near(0.0), None)),
    "weighted: where all is open straight on": ("weighted_gap", {}, all_round(math.inf), (0.0, None)),
    "widest, source: the middle of the two points": ("widest_gap", SOURCE, all_round(5.0, (601, 1081, 2.0)), CENTRE),
    "widest, source: not the last jump": (  # the source's loop would keep its a and b
        "widest_gap", SOURCE, all_round(5.0, (601, 640, 2.0), (640, 1081, 1.0)), CENTRE,
    ),
    "widest: without a gap where it sees furthest": ("widest_gap", {}, all_round(5.0), (0.0, None)),
    # a near wall on the right, to straight ahead and a little beyond; the longest beams are beside its edge
    **{f"extender: past an edge by half its width and {tolerance} m": (
           "disparity_extender", {"tolerance": tolerance},
           scan_of(np.where(BEARINGS <= 0.1, 3.0, 8.0 - np.abs(BEARINGS - 0.1))),
           (near(0.1 + (0.5 * CAR.width + tolerance) / 3.0), None))
       for tolerance in (0.0, 0.15, 0.3)},
    # half the width of .31 m and .15 m, over arcs of .2 m: two beams
    "extender, source: it covers the farther side only": ("disparity_extender", SOURCE, STEP, (0.1, 4.0)),
    "extender: and both sides": ("disparity_extender", {}, STEP, (0.2, 4.0)),
    "finder, source: its components one after the other": ("gap_finder", SOURCE, SEVEN, (0.3, 3.0)),
    "finder, source: of equal ranges straight on": ("gap_finder", SOURCE, scan_of(np.full(7, 3.0), 0.1), (0.0, 3.0)),
    # a window of .3 m / (6 m * .25 degrees), rounded up: 12 beams to either side
    "finder: a longer beam counts as the mean of its bubble": (
        "gap_finder", {"disparity_threshold": 100.0, "mean_radius": 0.3}, PEAK, (None, 5.0 + 1.0 / 25),
    ),
    "finder: of a small bubble": (
        "gap_finder", {"disparity_threshold": 100.0, "mean_radius": 1e-6}, PEAK, (None, 5.0 + 1.0 / 3),
    ),
    "finder: the top of a tent": (
        "gap_finder", NO_FILTER, scan_of(3.0 - np.abs(BEARINGS)), (0.0, pytest.approx(3.0, abs=0.01)),
    ),
}  # fmt: skip


@each("case", GOALS)
def test_it_heads_where_it_was_worked_out_to(case):
    name, chosen, scan, expected = GOALS[case]
    found = make_controller(name, car=CAR, mu=MU, max_speed=8.0, settings=chosen).find_goal(scan)
    assert (found is None) == (expected is None)
    for value, known in zip(found or (), expected or (), strict=True):
        assert known is None or value == (pytest.approx(known, abs=1e-5) if isinstance(known, float) else known)
