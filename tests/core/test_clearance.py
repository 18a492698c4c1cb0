"""The clearance is the distance between the car's rectangle and what stands about, and nothing else."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fg_mujoco as fg
from cases import each
from fg_mujoco.course.clearance import least_clearance, rectangle_distance
from fg_mujoco.course.course import outline

CAR = fg.Vehicle.load().parameters
FRONT = CAR.length - CAR.rear_overhang
HALF = 0.5 * CAR.width


@pytest.fixture(scope="module", autouse=True)
def compiled():
    """Hypothesis times each example; the first would compile."""
    rectangle_distance(1.0, 1.0, 2.0, 2.0, 0.5, 0.5)
    least_clearance(np.zeros((1, 3)), np.zeros((1, 4)), CAR)


places, angles, halves = st.floats(-3, 3), st.floats(-7, 7), st.floats(0.05, 2)


def sampled_distance(a, b, half_length, half_width, count=1001):
    """The slow computation: the least distance to the rectangle of many points of the segment."""
    points = a + np.linspace(0.0, 1.0, count)[:, None] * (b - a)
    outside = np.maximum(np.abs(points) - (half_length, half_width), 0.0)
    return float(np.hypot(*outside.T).min())


@pytest.mark.slow
@given(places, places, places, places, halves, halves)
def test_the_distance_to_a_segment_is_that_of_its_nearest_point(ax, ay, bx, by, half_length, half_width):
    a, b = np.array([ax, ay]), np.array([bx, by])
    exact = rectangle_distance(ax, ay, bx, by, half_length, half_width)
    sampled = sampled_distance(a, b, half_length, half_width)
    step = math.dist(a, b) / 1000
    assert sampled - step - 1e-9 <= exact <= sampled + 1e-9


@each(
    ("segment", "distance"),
    [
        ((FRONT + 0.7, -5.0, FRONT + 0.7, 5.0), 0.7),  # a wall ahead: the pose is that of the rear axle
        ((-CAR.rear_overhang - 0.2, 0.0, -9.0, 0.0), 0.2),  # a wall behind, seen from its end
        ((-9.0, HALF + 0.1, 9.0, HALF + 0.1), 0.1),
        ((FRONT + 0.3, HALF + 0.4, 9.0, 9.0), 0.5),  # off a corner
        ((-9.0, 0.01, 9.0, 0.0), 0.0),  # through it, with both ends outside
        ((0.0, 0.0, 0.1, 0.05), 0.0),  # inside
        ((FRONT, -1.0, FRONT, 1.0), 0.0),  # touching
        ((FRONT + 1.0, 0.0, FRONT + 1.0, 0.0), 1.0),  # a point
    ],
)
def test_known_distances(segment, distance):
    assert least_clearance(np.zeros((1, 3)), np.array([segment]), CAR) == pytest.approx(distance, abs=1e-12)


def test_what_moves_is_met_where_it_is_at_that_time():
    poses = np.zeros((3, 3))
    square = outline(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]))
    shifts = np.array([5.0, 2.0, 3.0])[:, None, None]
    assert least_clearance(poses, square + shifts * (1, 0, 1, 0), CAR) == pytest.approx(2.0 - FRONT)
    with pytest.raises(ValueError, match="at each of the 2"):
        least_clearance(poses[:2], square + shifts * (1, 0, 1, 0), CAR)
