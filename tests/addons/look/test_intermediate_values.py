"""`fg_mujoco.show`: values reach whoever looks, in the right place, and nobody else; and the race does not change."""

import math
import re
import threading
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.look.debug import debug_page
from fg_mujoco.addons.look.intermediate_values import BASE, COLOURS, FRAMES, LASER, MAP, IntermediateValues, moved
from fg_mujoco.addons.look.live.browser_scene import LEGEND
from fg_mujoco.simulation.showing import show
from scan_worlds import CAR, corridor
from shown_values import SHOWS, file_of_shows

SCAN = corridor(1.0, 1.0, 5.0)
BEAMS = len(SCAN.ranges)


def shown(*arguments, scan=SCAN, **settings):
    """What is collected of one call of `show`: the values, and the remarks."""
    values = IntermediateValues()
    with values.of(scan):
        assert show(*arguments, **settings) is None
    return values.now, values.remarks


class Unreadable:
    """Counts who reads it."""

    read = 0

    def __array__(self, *arguments, **settings):
        Unreadable.read += 1
        raise RuntimeError("may not be read")

    def __repr__(self):
        raise RuntimeError("may not be written")


def test_a_value_is_not_looked_at_where_nobody_looks():
    Unreadable.read = 0
    show("mine", Unreadable())
    show(Unreadable(), None, draw=7, frame=[])
    assert Unreadable.read == 0


def test_a_race_with_a_planner_that_shows_values_has_the_bits_of_the_same_without(tmp_path):
    lines = [line for line in SHOWS.splitlines() if "fg.show" not in line and "% 2" not in line]
    (tmp_path / "silent.py").write_text("\n".join(lines))
    silent = f"{tmp_path / 'silent.py'}:Shows"
    looked, plain = (fg.race("oval", planner, time_limit=0.6) for planner in (file_of_shows(tmp_path), silent))
    assert looked.states.tobytes() == plain.states.tobytes()


@each("value, kind, shape",
      [(3, "number", ()), (np.float32(0.5), "number", ()), (True, "number", ()), (np.array(2), "number", ()),
       (math.inf, "number", ()), ((1.0, 2.0), "points", (1, 2)), ([(0, 0), (1, 0), (1, 1)], "points", (3, 2)),
       (np.zeros(BEAMS, np.float32), "scan", (BEAMS,)), ([1.0] * BEAMS, "scan", (BEAMS,)),
       ([(math.nan, 0.0), (1.0, 2.0)], "points", (1, 2))])  # fmt: skip
def test_a_value_is_what_its_shape_says(value, kind, shape):
    now, remarks = shown("mine", value)
    assert remarks == []
    assert (now["mine"].kind, now["mine"].array.shape) == (kind, shape)
    assert not now["mine"].array.flags.writeable


def test_no_value_has_a_colour_of_what_the_pages_draw_themselves():
    page = debug_page.__file__
    drawn = {colour for file in (page, page.replace(".py", ".js").replace("_page", ""))
             for colour in re.findall('"#([0-9a-f]{6})"', Path(file).read_text("utf-8").split("_LAWS")[0])}  # fmt: skip
    own = [*LEGEND.values(), *(tuple(bytes.fromhex(colour)) for colour in drawn)]
    assert len(own) > 9 and min(math.dist(one, other) for one in COLOURS for other in own) > 50


@each("value", [None, [], np.empty((0, 2))])
def test_what_is_empty_shows_nothing_and_is_no_mistake(value):
    now, remarks = shown("mine", value)
    assert all(not each.array.size for each in now.values()) and remarks == []


@each("arguments, settings, said",
      [(("mine", "text"), {}, "of type str"),
       (("mine", np.zeros(7)), {}, r"shape \(7,\)"),
       (("mine", np.zeros((2, 3))), {}, r"accepted: a number, a point \(2,\), points \(m, 2\)"),
       (("mine", [[1.0], [1.0, 2.0]]), {}, "reading it raised ValueError"),
       (("mine", np.zeros((9000, 2))), {}, "at most"),
       (("mine", 1j), {}, "of type complex"),
       (("mine", Unreadable()), {}, "reading it raised RuntimeError"),
       ((3, 1.0), {}, "its name is 3; accepted: a text"),
       ((Unreadable(), 1.0), {}, "reading it raised RuntimeError"),
       (("n" * 99, 1.0), {}, "1 to 60 characters"),
       (("mine", (1.0, 2.0)), {"draw": "poligon"}, "did you mean 'polygon'"),
       (("mine", (1.0, 2.0)), {"frame": "lazer"}, "did you mean 'laser'"),
       (("mine", 1.0), {"draw": "points"}, "accepted")])  # fmt: skip
def test_a_value_that_cannot_be_shown_is_left_out_and_told_once(arguments, settings, said):
    values = IntermediateValues()
    for _ in range(3):
        with values.of(SCAN):
            show(*arguments, **settings)
            show("good", 1.0)
        assert list(values.now) == ["good"]
    (remark,) = values.remarks

    assert re.search(said, remark)


def test_a_name_has_one_kind_and_names_have_an_end():
    values = IntermediateValues()
    with values.of(SCAN):
        show("mine", 1.0)
        show("mine", (1.0, 2.0))
        for number in range(100):
            show(f"more {number}", number)
    assert values.now["mine"].array == 1.0
    assert len(values.now) == 60
    assert "accepted: one kind for a name" in values.remarks[0]
    assert 2 <= len(values.remarks) <= 61


def test_an_array_that_the_planner_changes_later_is_kept_as_it_was():
    values, ranges = IntermediateValues(), np.ones(BEAMS)
    with values.of(SCAN):
        show("mine", ranges)
        ranges[:] = 7.0
    assert (values.now["mine"].array == 1.0).all()


def test_each_decision_has_its_own_values_and_nothing_is_left_behind():
    values = IntermediateValues()
    with values.of(SCAN):
        show("first", 1.0)
    show("between", 2.0)
    assert list(values.now) == ["first"]
    with pytest.raises(ZeroDivisionError), values.of(SCAN):
        show("second", 1.0)
        raise ZeroDivisionError
    assert list(values.now) == ["second"]
    show("after", 3.0)
    assert list(values.now) == ["second"]


def test_threads_that_decide_at_the_same_time_do_not_see_each_others_values():
    together, found = threading.Barrier(4), {}

    def decide(number):
        values = IntermediateValues()
        for tick in range(20):
            with values.of(SCAN):
                together.wait(10.0)
                show("mine", 100.0 * number + tick)
                together.wait(10.0)
            found.setdefault(number, []).append(float(values.now["mine"].array))

    threads = [threading.Thread(target=decide, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == {number: [100.0 * number + tick for tick in range(20)] for number in range(4)}


@given(st.sampled_from(FRAMES), st.sampled_from(FRAMES), st.tuples(*3 * [st.floats(-50.0, 50.0)]))
def test_a_place_is_the_same_in_all_frames(frame, to, pose):
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0]])
    there = moved(points, frame, to, np.array(pose), CAR.lidar_offset)
    np.testing.assert_allclose(moved(there, to, frame, np.array(pose), CAR.lidar_offset), points, atol=1e-9)


def test_places_are_those_of_rep_103():
    pose = np.array((10.0, 5.0, math.pi / 2.0))  # the car looks along y
    ahead, left = np.array([[1.0, 0.0]]), np.array([[0.0, 1.0]])
    np.testing.assert_allclose(moved(ahead, LASER, BASE, pose, 0.25), [[1.25, 0.0]])
    np.testing.assert_allclose(moved(ahead, LASER, MAP, pose, 0.25), [[10.0, 6.25]])
    np.testing.assert_allclose(moved(left, BASE, MAP, pose, 0.25), [[9.0, 5.0]], atol=1e-12)


def test_a_polygon_is_closed_and_a_line_is_not():
    corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]
    polygon, line, points = (shown("mine", corners,
                                   draw=draw)[0]["mine"].drawing(SCAN) for draw in (None, "line", "points"))
    assert polygon.tolist() == [[[0, 0], [1, 0]], [[1, 0], [1, 1]], [[1, 1], [0, 0]]]
    assert line.tolist() == polygon[:2].tolist()
    assert points.tolist() == [list(corner) for corner in corners]


def test_a_scan_is_drawn_where_its_beams_end_and_gaps_stay_gaps():
    ranges = SCAN.ranges.copy()
    ranges[100] = math.inf
    drawn = shown("mine", ranges)[0]["mine"].drawing(SCAN)
    assert drawn.shape == (BEAMS - 3, 2, 2)
    np.testing.assert_allclose(np.abs(drawn[:300, :, 1]), 1.0, atol=1e-6)  # the wall at the right is 1 m away
    np.testing.assert_allclose(drawn[0, 0, 0], SCAN.ranges[0] * math.cos(SCAN.angle_min))
