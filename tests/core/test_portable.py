"""The core's own sines and the like, against those of Python's math."""

import math
import re
from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import fg_mujoco as fg
from cases import each
from fg_mujoco import portable

ANGLE, SHARE = st.floats(-1e6, 1e6), st.floats(-1.0, 1.0)
ANY = st.floats(allow_nan=False, width=64)
ROOMS = [Path(fg.__file__).parent / name for name in ("course", "lidar", "simulation")]
ROOMS += [
    Path(fg.controllers.__file__).parent,
    *(Path(fg.addons.__file__).parent / name for name in ("arena", "drivers")),
]


def close(found, expected):
    """Whether a number is another one, up to three units in the last place and one of math's."""
    if math.isnan(expected) or math.isinf(expected) or expected == 0.0:
        alike = math.copysign(1.0, found) == math.copysign(1.0, expected)
        return alike and np.array_equal(found, expected, equal_nan=True)
    return abs(found - expected) <= 4.0 * math.ulp(expected)


@each(
    ("name", "values"),
    [
        ("sin", ANGLE),
        ("cos", ANGLE),
        ("tan", ANGLE),
        ("arcsin", SHARE),
        ("arccos", SHARE),
        ("exp", st.floats(-800.0, 709.0)),
    ],
)
def test_a_function_is_that_of_math(name, values):
    expected = getattr(math, name.replace("arc", "a"))

    @given(values)
    def check(x):
        assert close(getattr(portable, name)(x), expected(x))

    check()


@given(ANY, ANY)
def test_an_arctangent_of_two_is_that_of_math(y, x):
    assert close(portable.arctan2(y, x), math.atan2(y, x))


@given(ANY, ANY)
def test_a_hypotenuse_is_that_of_math(x, y):
    assert close(portable.hypot(x, y), math.hypot(x, y))


@each("y", [0.0, -0.0, 1.0, -1.0, math.inf, -math.inf])
@each("x", [0.0, -0.0, 1.0, -1.0, math.inf, -math.inf])
def test_quarter_turns_are_those_of_math(y, x):
    assert close(portable.arctan2(y, x), math.atan2(y, x))


def test_what_is_no_number_stays_so_and_what_has_no_end_has_none():
    for function in (portable.sin, portable.cos, portable.tan, portable.exp, portable.arcsin):
        assert math.isnan(function(math.nan))
    assert math.isnan(portable.sin(math.inf)) and math.isnan(portable.arcsin(1.1))
    assert portable.exp(math.inf) == math.inf
    assert portable.exp(-math.inf) == portable.exp(-746.0) == 0.0 < portable.exp(-745.0)


def test_arrays_have_the_shapes_of_numpys():
    y, x = np.arange(3.0)[:, None], np.arange(-2.0, 2.0)
    np.testing.assert_allclose(portable.arctan2(y, x), np.arctan2(y, x), rtol=1e-15)
    assert portable.sin(np.zeros((0, 2))).shape == (0, 2) and isinstance(portable.cos(1), float)


def test_what_a_race_is_made_of_takes_no_function_of_numpy_that_depends_on_the_processor():
    """Of a room that builds courses, beams and cars, or plans."""
    found = re.compile(r"np\.(sin|cos|tan|arctan2?|arcsin|arccos|exp|log|log1p|power)\((?!1j)")
    taken = {
        f"{path.name}: {line.strip()}"
        for room in ROOMS
        for path in room.rglob("*.py")
        for line in path.read_text("utf-8").split("\n")
        if found.search(line)
    }
    assert not taken
