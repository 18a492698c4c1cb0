"""Planners that find a goal in a scan: what they have in common, and the definitions of each, worked out slowly.

Where they head in scans that were worked out by hand is in test_goals.py.
"""

import cmath
import math
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from test_gaps import runs_where
from test_goals import SLIDE

from cases import each
from fg_mujoco.controllers import disparity_selection, follow_the_gap, threshold_gap, weighted_gap
from fg_mujoco.controllers.control.planner_settings import for_car
from fg_mujoco.controllers.disparity_extender import DisparityExtender, DisparityExtenderSettings
from fg_mujoco.controllers.disparity_selection import DisparitySelection
from fg_mujoco.controllers.follow_the_gap import FollowTheGap
from fg_mujoco.controllers.gap_finder import GapFinder
from fg_mujoco.controllers.perception.gaps import longest_run, middle_of, runs_beyond
from fg_mujoco.controllers.threshold_gap import ThresholdGap
from fg_mujoco.controllers.wall_follow import WallFollow
from fg_mujoco.controllers.weighted_gap import WeightedGap
from fg_mujoco.controllers.widest_gap import WidestGap
from fg_mujoco.messages import Odometry
from scan_worlds import CAR, INCREMENT, MU, corridor, mirrored, odometry_of, rough_scan, scan_of

GAPS = (DisparitySelection, FollowTheGap, ThresholdGap, WeightedGap)
CHOICES = [
    *((made, {}) for made in (*GAPS, DisparityExtender, GapFinder, WidestGap)),
    *((FollowTheGap, {"point": point}) for point in ("middle", "deepest")),
    (FollowTheGap, {"bubble": "points"}),
    (ThresholdGap, {"gap": "deepest"}),
]
BEARINGS = INCREMENT * (np.arange(1081) - 540)


@cache
def planner(kind, mu=MU, **settings):
    return kind(CAR, mu, 8.0, kind.Settings(**settings))


def row(kind, **settings):
    """Settings of a planner for the car."""
    return planner(kind, **settings).settings


def named(choice):
    return " ".join([choice[0].__name__, *choice[1].values()])


every_planner = each("made", CHOICES, ids=named, made=lambda choice: planner(choice[0], **choice[1]))


# -- in common


@each("choice", [*CHOICES, (WallFollow, {})], ids=named)
def test_a_mirrored_scan_gets_the_mirrored_command(choice):
    """Without guidance: the cells of its map have an orientation of their own."""
    made, settings = choice
    planner = made(CAR, MU, 8.0, made.Settings(**settings), assist="safe")
    motions = ((0.0, 0.0), (3.0, 0.1), (6.0, -0.05))
    for scan in map(rough_scan, range(20)):
        planner.reset()
        here = [planner(scan, odometry_of(speed, angle)) for speed, angle in motions]
        planner.reset()
        there = [planner(mirrored(scan), odometry_of(speed, -angle)) for speed, angle in motions]
        for one, other in zip(here, there, strict=True):
            assert one.steering_angle == pytest.approx(-other.steering_angle, abs=1e-9)
            assert one.speed == pytest.approx(other.speed, abs=1e-9)


@every_planner
@each("side", [1.0, -1.0])
def test_it_heads_for_the_side_that_is_open(made, side):
    left, right = (8.0, 0.8) if side > 0 else (0.8, 8.0)
    bearing, distance = made.find_goal(corridor(left, right, ahead=1.8))
    assert side * bearing > 0.2
    assert distance > 0.0


@each("kind", [*GAPS, DisparityExtender, GapFinder])
def test_in_the_middle_of_a_straight_corridor_it_goes_straight_on(kind):
    assert abs(planner(kind).find_goal(corridor(1.1, 1.1))[0]) <= INCREMENT


@each("kind", [*GAPS, GapFinder])
def test_the_goal_lies_within_the_field_of_view(kind):
    scan = corridor(math.inf, 0.5, ahead=2.0)  # the longest beams point to the left and back
    for width in (1.0, 2.0, math.pi):
        goal = planner(kind, field_of_view=width).find_goal(scan)
        assert goal is None or abs(goal[0]) <= 0.5 * width + 1e-6


@every_planner
def test_what_cannot_be_seen_and_an_empty_field_of_view_have_no_goal(made):
    for ranges in ([], [5.0], np.zeros(1081), np.full(1081, math.nan)):
        assert made.find_goal(scan_of(ranges)) is None
    assert made.find_goal(scan_of(np.full(100, 5.0), angle_min=2.0)) is None


# -- disparity selection


def test_in_the_diagram_it_aims_at_the_middle_of_the_free_space():
    """The source's code takes the third reading, (1 + 4) // 2; of the three that are free the fourth is the middle."""
    diagram = np.array([0.4, 0.5, 2.5, 2.5, 2.5, 0.6, 0.5])
    assert middle_of(*disparity_selection.best_opening(diagram, 0.01, 0.5)) == 3.0


@given(ranges=arrays(np.float64, st.integers(0, 20), elements=st.sampled_from([0.5, 1.0, 1.7, 3.0, 3.2])))
def test_the_opening_is_the_widest_of_all_pairs_that_follow_each_other(ranges):
    steps = np.diff(ranges)
    disparities = [(beam + 1, step) for beam, step in enumerate(steps.tolist()) if abs(step) > 0.6]
    pairs = [(one, other) for (one, up), (other, down) in pairwise(disparities) if up > 0.0 > down]
    edges = [
        abs(cmath.rect(ranges[one - 1], 0.02 * (one - 1)) - cmath.rect(ranges[other], 0.02 * other))
        for one, other in pairs
    ]
    found = disparity_selection.widest_opening(ranges, 0, len(ranges), 0.02, 0.6)
    if not pairs:
        assert found == (0, 0)
    else:
        assert edges[pairs.index(found)] == pytest.approx(max(edges))


# -- follow the gap


def test_the_slides_bubble_masks_the_points_within_its_radius():
    """4.8 m is next to the nearest point and free, 4.5 m is two beams away and is not: it goes by distance."""
    free = follow_the_gap.free_space(SLIDE, 0.01, row(FollowTheGap, bubble="points", bubble_radius=1.6))
    assert free.tolist() == [4.8, 0.0, 0.0, 0.0, 6.0, 10.1, 8.3]


@pytest.mark.slow
@given(
    ranges=arrays(np.float64, st.integers(0, 30), elements=st.floats(0.0, 10.0)),
    increment=st.floats(1e-3, 0.2),
    radius=st.floats(0.01, 3.0),
)
def test_the_points_in_a_bubble_are_those_near_the_nearest_in_the_plane(ranges, increment, radius):
    points = [cmath.rect(distance, beam * increment) for beam, distance in enumerate(ranges)]
    nearest = points[int(np.argmin(ranges))] if points else 0.0
    masked_points = follow_the_gap.mask_points(ranges, increment, radius)
    for point, distance, masked in zip(points, ranges, masked_points, strict=True):
        if abs(abs(point - nearest) - radius) > 1e-9:
            assert masked == (0.0 if abs(point - nearest) < radius else distance)


@each(("chosen", "place"), [({"point": "furthest"}, 1.0), ({"point": "middle"}, 4.5),
                            ({"point": "deepest", "depth_tolerance": 0.5}, 2.0)])  # fmt: skip
def test_each_point_is_what_it_says(chosen, place):
    #                0    1    2    3    4    5    6    7    8
    free = np.array([0.0, 3.0, 2.8, 2.7, 1.0, 2.0, 2.9, 1.0, 1.0])
    assert follow_the_gap.best_position(free, *longest_run(free), row(FollowTheGap, **chosen)) == place


# -- threshold gap


@given(
    ranges=arrays(np.float64, st.integers(0, 25), elements=st.sampled_from([1.0, 3.0, 4.0, 5.0, 30.0])),
    gap=st.sampled_from(["widest", "deepest"]),
)
def test_the_gap_taken_is_the_first_in_the_order_that_the_docstring_gives(ranges, gap):
    runs = list(runs_where(ranges > 2.0))
    keys = [(end - first, ranges[first:end].max()) for first, end in runs]
    keys = keys if gap == "widest" else [key[::-1] for key in keys]
    expected = keys.index(max(keys)) if keys else -1
    assert threshold_gap.choose_gap(ranges, runs_beyond(ranges, 2.0, 1), row(ThresholdGap, gap=gap)) == expected


# -- weighted gap: the formulas of Sezer and Gokasan's paper


@given(phi1=st.floats(-1.5, 1.5), wide=st.floats(0.05, 3.0), d1=st.floats(0.1, 10.0), d2=st.floats(0.1, 10.0))
def test_the_gaps_centre_is_that_of_the_papers_formula(phi1, wide, d1, d2):
    """With the angle to the first obstacle counted to the right, to the second to the left."""
    phi2 = wide - phi1
    median = math.sqrt(d1**2 + d2**2 + 2.0 * d1 * d2 * math.cos(phi1 + phi2))
    expected = math.acos((d1 + d2 * math.cos(phi1 + phi2)) / median) - phi1
    centre = weighted_gap.gap_centre(-phi1, d1, phi2, d2)
    assert math.remainder(centre - expected, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-6)


@given(gap=st.floats(-1.5, 1.5), goal=st.floats(-1.5, 1.5), nearest=st.floats(0.01, 30.0), alpha=st.floats(0.1, 20.0))
def test_the_heading_is_that_of_the_papers_formula(gap, goal, nearest, alpha):
    weight = alpha / nearest
    assert weighted_gap.blended(gap, goal, nearest, alpha) == pytest.approx((weight * gap + goal) / (weight + 1.0))


def test_three_or_four_metres_away_it_makes_no_sharp_turn():
    """The slides' question: the same gap, with the nearest obstacle at 4 m and at half a metre."""
    open_left = np.where((BEARINGS > 0.5) & (BEARINGS < 1.1), 9.0, 4.0)
    near = np.where(BEARINGS < -1.0, 0.5, open_left)
    far, close = (planner(WeightedGap, horizon=6.0).find_goal(scan_of(each))[0] for each in (open_left, near))
    assert far == pytest.approx(close * (2.0 / 6.0) / (2.0 / 2.5), rel=0.05)
    assert 0.1 < far < 0.3 < close


# -- widest gap


def at(x, y, heading):
    zeros = np.zeros(3)
    return Odometry(
        stamp=0.0, speed=0.0, steering_angle=0.0, angular_velocity=zeros, linear_acceleration=zeros,
        wheel_speeds=np.zeros(4), pose=(x, y, heading),
    )  # fmt: skip


def stepped(beam, distance):
    """1081 readings of 5 m up to a beam, and from it on of another distance."""
    return scan_of(np.where(np.arange(1081) < beam, 5.0, distance))


def centres_by_definition(scan, jump, half):
    """The middles of the widest pairs of neighbouring points, in the car frame; all by points in the plane."""
    points = np.column_stack((scan.ranges * np.cos(scan.bearings), scan.ranges * np.sin(scan.bearings)))
    gaps = []
    for i in range(len(points) - 1):
        inside = abs(scan.bearings[i]) <= half + 1e-9 and abs(scan.bearings[i + 1]) <= half + 1e-9
        if inside and abs(scan.ranges[i + 1] - scan.ranges[i]) > jump:
            centre = 0.5 * (points[i] + points[i + 1]) + (CAR.lidar_offset, 0.0)
            gaps.append((math.dist(points[i], points[i + 1]), *centre))
    widest = max(gaps)[0] if gaps else 0.0
    return [centre for width, *centre in gaps if width >= widest * (1.0 - 1e-9)]


@settings(max_examples=150, deadline=None)
@given(
    ranges=arrays(np.float64, st.integers(2, 60), elements=st.floats(0.0, 20.0), unique=True),
    increment=st.sampled_from([0.01, 0.05, 0.3]),
)
@pytest.mark.slow
def test_the_centre_is_the_middle_of_the_widest_jump_within_45_degrees(ranges, increment):
    scan = scan_of(ranges, increment)
    expected, found = centres_by_definition(scan, 0.5, math.pi / 4), planner(WidestGap).find_centre(scan)
    if found is None:
        assert not expected
    else:
        assert any(found == pytest.approx(tuple(centre), abs=1e-9) for centre in expected)


@each("far", [math.inf, 30.0, 1e6])
def test_no_return_is_a_reading_at_the_greatest_range(far):
    x, y = planner(WidestGap).find_centre(stepped(540, far))
    assert math.hypot(x - CAR.lidar_offset, y) == pytest.approx(0.5 * (5.0 + 30.0), rel=1e-4)


def test_a_gap_is_at_the_same_place_of_the_map_from_wherever_it_is_seen():
    """A gap with its centre 7 m ahead of the LiDAR, from poses all round it; C + X_car is elsewhere each time."""
    place, scan, finder = np.array([3.0, -2.0]), stepped(540, 9.0), planner(WidestGap)
    for heading in np.linspace(-math.pi, math.pi, 7):
        x, y = place - (7.0 + CAR.lidar_offset) * np.array([math.cos(heading), math.sin(heading)])
        assert finder.goal_in_map(scan, at(x, y, heading)) == pytest.approx(tuple(place), abs=7.0 * INCREMENT)
    assert finder.goal_in_map(scan, odometry_of()) is None
    assert finder.goal_in_map(stepped(0, 5.0), at(0.0, 0.0, 0.0)) is None


@each(("beam", "far", "side"), [(600, 9.0, 1.0), (480, 9.0, 1.0), (480, 2.0, -1.0)])
@each("passing", [0.0, 0.3, 0.6])
def test_it_drives_past_the_near_end_of_the_gap_on_its_open_side(beam, far, side, passing):
    finder, scan = planner(WidestGap, passing_distance=passing), stepped(beam, far)
    x, y = finder.find_centre(scan)
    beside = finder.find_goal(scan)[0] - math.atan2(y, x - CAR.lidar_offset)
    assert min(5.0, far) * math.sin(side * beside) == pytest.approx(passing, abs=1e-9)


# -- disparity extender


def furthest_by_definition(ranges, increment, threshold, radius):
    """Step 2 and 3 of the source, beam by beam: the greatest length within 90 degrees after all extensions."""
    extended = list(ranges)
    for i in range(1, len(ranges)):
        if abs(ranges[i] - ranges[i - 1]) > threshold:
            edge = i if ranges[i] < ranges[i - 1] else i - 1
            for j in range(len(ranges)):
                # the arc between the beams, at the nearer range; half a turn covers all
                near = max(ranges[edge], radius / math.pi)
                if abs(j - edge) <= math.ceil(radius / (increment * near)):
                    extended[j] = min(extended[j], ranges[edge])
    centre = (len(ranges) - 1) / 2
    return max(r for j, r in enumerate(extended) if abs(j - centre) * increment <= 0.5 * math.pi + 1e-9)


@settings(max_examples=60, deadline=None)
@given(
    ranges=arrays(np.float64, st.integers(2, 60), elements=st.floats(0.1, 9.0)),
    threshold=st.floats(0.0, 2.0),
    tolerance=st.floats(0.0, 0.5),
)
def test_the_goal_is_the_furthest_reading_that_extensions_leave(ranges, threshold, tolerance):
    chosen = DisparityExtenderSettings(disparity_threshold=threshold, tolerance=tolerance)
    bearing, distance = DisparityExtender(CAR, MU, 8.0, chosen).find_goal(scan_of(ranges, 0.05))
    assert distance == furthest_by_definition(ranges, 0.05, threshold, 0.5 * CAR.width + tolerance)
    assert abs(bearing) <= 0.5 * math.pi + 1e-6


def scan_beside(distance, first=97.0, last=110.0):
    """Open to the left ahead, and something at the left between two bearings [deg], without an edge to be extended."""
    corners = np.radians([first - 12.0, first, last, last + 12.0])
    beside = np.interp(BEARINGS, corners, [8.0, distance, distance, 8.0])
    return scan_of(np.where((BEARINGS > 0.4) & (BEARINGS < 1.2), 12.0, beside))


def wished_steering(scan):
    """The steering angle [rad] of the command, with no friction limiter between the planner and it."""
    free = planner(DisparityExtender, math.inf)
    free.reset()
    return free(scan, odometry_of(1.0)).steering_angle


@each("side", [1.0, -1.0])
def test_it_does_not_turn_into_a_side_that_is_too_close_behind(side):
    def view(distance):
        return scan_beside(distance) if side > 0.0 else mirrored(scan_beside(distance))

    limit = for_car(DisparityExtenderSettings(), CAR).side_distance
    for distance in (0.9 * limit, 1.1 * limit):  # without the rule
        assert side * planner(DisparityExtender, side_distance=0.0).find_goal(view(distance))[0] > 0.3
    assert wished_steering(view(0.9 * limit)) == 0.0
    assert side * wished_steering(view(1.1 * limit)) > 0.1


def test_a_scan_that_does_not_reach_behind_holds_nothing_back():
    whole = scan_beside(0.1, first=100.0, last=110.0)
    half = scan_of(whole.ranges[180:-180], angle_min=float(BEARINGS[180]))
    assert wished_steering(whole) == 0.0
    assert wished_steering(half) > 0.1
