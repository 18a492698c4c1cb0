"""Lines through a map: both formats of a CSV, what is refused, and speed profiles against closed forms."""

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cases import each
from fg_mujoco.addons.drivers.line_profile import SPACING, SPEED, STEP, curvature, line_table, read_line
from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter, longitudinal_share
from fg_mujoco.errors import SettingsError
from scan_worlds import CAR, MU

LIMITER = FrictionLimiter(CAR, MU)
TURNS = np.linspace(0.0, 2.0 * math.pi, 400, endpoint=False)


def circle(radius):
    return radius * np.column_stack((np.cos(TURNS), np.sin(TURNS)))


def table_of(points, *, speeds=None, closed=True, limiter=LIMITER, max_speed=8.0, span=0.8, cornering=0.9, braking=0.6):
    speeds = np.full(len(points), math.inf) if speeds is None else np.asarray(speeds, dtype=float)
    return line_table(np.asarray(points, dtype=float), speeds, closed=closed, limiter=limiter, max_speed=max_speed,
                      curvature_span=span, cornering_use=cornering, braking_use=braking)  # fmt: skip


def written(tmp_path, text):
    path = tmp_path / "line.csv"
    path.write_text(text)
    return path


# -- files


@each("text, speeds",
      [("# x_m, y_m, w_tr_right_m, w_tr_left_m\n0, 1, 2, 3\n\n4.5, -1, 2, 3\n", None),
       ("0, 1\n4.5, -1\n", None),
       ("0, 1, 5\n4.5, -1, 12\n", [5.0, 12.0]),
       ("# s_m; x_m; y_m; psi_rad; kappa_radpm; vx_mps; ax_mps2\n0;0;1;3;4;5;6\n6;4.5;-1;10;11;12;13\n", [5.0, 12.0]),
       ("s_m,x_m,y_m,psi_rad,kappa_radpm,vx_mps,ax_mps2\n0,0,1,3,4,5,6\n6,4.5,-1,10,11,12,13\n", [5.0, 12.0]),
       ("x y yaw v\n0 1 3 5\n4.5 -1 3 12\n", [5.0, 12.0]),
       ("speed [km/h],y [cm],x [m]\n18,100,0\n43.2,-100,4.5\n", [5.0, 12.0])])  # fmt: skip
def test_a_line_is_read_as_a_course_is_and_has_the_speeds_that_its_file_names(text, speeds, tmp_path):
    points, found = read_line(written(tmp_path, text))
    np.testing.assert_allclose(points, [[0.0, 1.0], [4.5, -1.0]])
    np.testing.assert_allclose(found, [math.inf, math.inf] if speeds is None else speeds)


@each("text, said",
      [("", r"line .*line\.csv: is empty"),
       ("0, 0, 1, 1\n", r"line\.csv: 1 points"),
       ("x,y,v\n0,0,1\n1,0,0\n", r"line\.csv: line 3: v is 0; accepted: a number above 0"),
       ("0,0\n30001,0\n", "30001 m long"),
       ("2000000,0\n2000001,0\n", "up to 2000001 m from the origin")])  # fmt: skip
def test_a_file_that_is_no_line_is_refused_in_one_line_by_name_and_row(text, said, tmp_path):
    with pytest.raises(SettingsError, match=said) as refusal:
        read_line(written(tmp_path, text))
    assert "\n" not in str(refusal.value)


# -- tables


@each("closed", [True, False])
def test_the_points_of_a_table_are_evenly_spaced(closed):
    table = table_of([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]], closed=closed)
    length = 12.0 if closed else 7.0
    steps = np.hypot(*np.diff(table[:, :2], axis=0).T)
    assert steps.max() <= table[0, STEP] + 1e-12 <= SPACING + 1e-12
    assert table[:, STEP].sum() == pytest.approx(length)
    assert (table[-1, STEP] == 0.0) == (not closed)
    np.testing.assert_array_equal(table[0, :2], (0.0, 0.0))


@each("direction, radius", product((1, -1), (1.0, 3.0, 6.0)))
def test_the_curvature_of_a_circle_is_one_over_its_radius(direction, radius):
    table = table_of(circle(radius)[::direction])
    np.testing.assert_allclose(curvature(table, 0.8, closed=True), direction / radius, rtol=1e-2)


def test_the_curvature_of_a_square_corner_is_that_of_the_span_it_is_rounded_over():
    table = table_of([[-5.0, 0.0], [0.0, 0.0], [0.0, 5.0]], closed=False)
    # legs of .8 m at a right angle: their circle has radius .8 / sqrt(2)
    assert curvature(table, 0.8, closed=False).max() == pytest.approx(math.sqrt(2.0) / 0.8, rel=1e-6)


# -- speeds


@each("radius", [1.0, 3.0])
def test_on_a_circle_the_speed_is_that_of_the_tires(radius):
    expected = math.sqrt(0.9 * LIMITER.lateral * radius)
    np.testing.assert_allclose(table_of(circle(radius))[:, SPEED], expected, rtol=2e-3)


def test_on_a_straight_to_its_end_it_brakes_evenly():
    table = table_of([[0.0, 0.0], [20.0, 0.0]], closed=False)
    left = 20.0 - table[:, 0]
    expected = np.minimum(np.sqrt(2.0 * 0.6 * LIMITER.braking * left), 8.0)
    np.testing.assert_allclose(table[:, SPEED], expected, rtol=1e-9, atol=1e-9)


def test_after_a_slow_place_it_accelerates_evenly():
    table = table_of([[0.0, 0.0], [20.0, 0.0]], speeds=[2.0, 8.0], closed=False)
    beginning = table[:5]
    accelerating = np.sqrt(2.0**2 + 2.0 * 0.6 * LIMITER.accelerating * beginning[:, 0])
    np.testing.assert_allclose(beginning[:, SPEED], np.minimum(accelerating, 2.0 + 0.3 * beginning[:, 0]), rtol=1e-9)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 1000), mu=st.floats(0.3, 1.2), own=st.floats(1.0, 10.0), first=st.integers(0, 399))
def test_everywhere_the_tires_hold_it_and_no_speed_is_beyond_the_lines_own(seed, mu, own, first):
    rng, limiter = np.random.default_rng(seed), FrictionLimiter(CAR, mu)
    radius = 6.0 + sum(rng.uniform(-1.0, 1.0) / n * np.cos(n * TURNS + rng.uniform(0.0, 6.0)) for n in (2, 3, 4))
    line = radius[:, None] * np.column_stack((np.cos(TURNS), np.sin(TURNS)))
    speeds = own + 2.0 * rng.random(400)
    table = table_of(np.roll(line, -first, axis=0), speeds=np.roll(speeds, -first), limiter=limiter)
    speed, bend = table[:, SPEED], curvature(table, 0.8, closed=True)
    lateral = speed**2 * np.abs(bend)
    assert (lateral <= 0.9 * limiter.lateral * (1.0 + 1e-9)).all()
    assert (speed <= min(8.0, speeds.max()) + 1e-9).all() and (speed > 0.0).all()
    # braking is by what is left at the place where it ends, accelerating by that where it begins
    after = (np.roll(speed, -1) ** 2 - speed**2) / (2.0 * table[0, STEP])
    row = limiter.record[0]
    use = (lateral / (mu * CAR.gravity)).tolist()
    speeding, slowing = (np.array([longitudinal_share(row, value, way) for value in use]) for way in (False, True))
    assert (after <= 0.6 * limiter.accelerating * speeding + 1e-6).all()
    assert (-after <= 0.6 * limiter.braking * np.roll(slowing, -1) + 1e-6).all()
