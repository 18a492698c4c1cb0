"""Which course a map has: the right loop among several, holes that are closed on request, and starts in the file."""

import math
import re

import numpy as np
import pytest
from PIL import Image
from scipy import ndimage

from cases import each
from fg_mujoco.cli.main import main
from fg_mujoco.course.maps import walls
from fg_mujoco.course.maps.map_server import read_map_file
from fg_mujoco.course.maps.map_track import load_map, map_loops, read_map
from fg_mujoco.course.maps.region import encloses
from fg_mujoco.course.track import MapTrack
from fg_mujoco.errors import TrackError
from map_oracles import building, draw_map, march, real_map, ring

PIXEL = 0.05
LENGTHS = {
    "f": 86.3, "fisica": 13.4, "hangar": 45.5, "icra2022": 64.4, "ipz33": 25.8, "jfr_v5": 57.3, "jfr_v6": 38.2,
    "lausitzring1": 33.1, "levine_slam": 64.0, "milan1": 35.2, "rca2": 105.3, "track_1": 198.0,
}  # fmt: skip
"""[m] Of the courses that were raced, each looked at."""


def double_wall(hole=None, *, inner=None):
    """Return a drawing of the stadium: black lines on white, with a hole of so many pixels in the outer, inner line."""
    lines = ring(inner=68, outer=71) | ring(inner=39, outer=42)
    if hole:
        lines[100 - hole // 2 : 100 + hole // 2, 270:290] = False
    if inner:
        lines[100 - inner // 2 : 100 + inner // 2, 240:260] = False
    return ~lines


@each("name", LENGTHS)
def test_real_race_maps_load_with_the_course_that_was_raced(name):
    settings = "[close=1.5]" if name == "levine_slam" else ""
    path = real_map(f"race_maps/{name}")
    track = load_map(f"{path}{settings}")
    assert isinstance(track, MapTrack)
    assert track.length == pytest.approx(LENGTHS[name], abs=0.1)
    assert (track.corridor_left + track.corridor_right).min() > 0.8
    occupancy = read_map_file(path)
    assert all(occupancy.is_free(point) for point in track.centreline)
    # in thin barriers' hairpins, too, each side's wall is no further than a ray square to the line goes
    for width, side in ((track.width_left, 1.0), (track.width_right, -1.0)):
        headings = track.headings + side * 0.5 * math.pi + occupancy.origin[2]
        padded = np.pad(occupancy.free, 1)
        square = march(padded, occupancy.to_pixels(track.centreline) + 1.0, headings, 200.0)
        assert np.all(width / occupancy.resolution <= square + 1.0)


def test_the_loop_round_the_rooms_is_the_course_and_not_that_round_a_counter(tmp_path):
    path = draw_map(tmp_path, building(), origin=(-12.0, -2.0, 0.0))
    track = read_map(path)
    line = read_map_file(path).to_pixels(track.centreline)
    assert all(
        encloses(line, np.array(room)) for room in ((70.0, 70.0), (150.0, 200.0), (330.0, 200.0), (410.0, 330.0))
    )
    assert track.start_pose() == pytest.approx((0.0, 0.0, 0.0), abs=0.1)


def test_every_other_loop_is_listed_with_what_it_goes_round_and_can_be_chosen(tmp_path):
    path = draw_map(tmp_path, building())
    loops = map_loops(str(path))
    assert [loop.number for loop in loops] == list(range(1, len(loops) + 1))
    assert [loop.driven for loop in loops] == [True] + [False] * (len(loops) - 1)
    counter = next(loop for loop in loops if np.hypot(loop.middle[0] - 25.0, loop.middle[1] - 10.0) < 0.1)
    track = load_map(f"{path}[loop={counter.number}]")
    line = track.centreline / PIXEL
    assert encloses(line, np.array([500.0, 200.0])) and not encloses(line, np.array([150.0, 200.0]))
    assert track.length == pytest.approx(counter.length, rel=0.1)
    assert [loop.number for loop in map_loops(f"{path}[loop={counter.number}]") if loop.driven] == [counter.number]
    with pytest.raises(TrackError, match=rf"loop is 99; accepted: 1 to {len(loops)}"):
        load_map(f"{path}[loop=99]")
    with pytest.raises(TrackError, match="loop is 0; accepted"):
        load_map(f"{path}[loop=0]")


@each("hole", [6, 12, 20])
def test_a_hole_is_refused_with_the_option_that_closes_it(tmp_path, hole):
    whole = read_map(draw_map(tmp_path, double_wall(), name="whole"), direction="clockwise")
    path = draw_map(tmp_path, double_wall(hole))
    with pytest.raises(TrackError, match=rf"a hole, {hole * PIXEL:.2f} m wide") as refusal:
        read_map(path)
    option = str(refusal.value).rpartition("drawn.yaml[close=")[2].rstrip("]")
    assert hole * PIXEL < float(option) <= hole * PIXEL + 0.11
    for close in (option, f"{hole * PIXEL}", "2.5"):
        closed = load_map(f"{path}[close={close},direction=clockwise]")
        assert closed.length == pytest.approx(whole.length, rel=1e-3)
        np.testing.assert_allclose(np.sort(closed.width_right)[:50], np.sort(whole.width_right)[:50], atol=PIXEL)
        assert not encloses(closed.left_wall, np.array([290.5, 100.5]) * PIXEL)  # the wall is where the hole was
    with pytest.raises(TrackError, match=rf"close={option}"):
        load_map(f"{path}[close={hole * PIXEL - 0.05:.2f}]")


def saved_map(folder, course, grey, **settings):
    """A map as savers of ROS 2 write it: unknown ground is grey and free_thresh is .25, so that it counts as free."""
    path = draw_map(folder, course, free_thresh=0.25, **settings)
    with Image.open(folder / "drawn.png") as image:
        pixels = np.array(image)
    pixels[grey[::-1]] = 205
    Image.fromarray(pixels).save(folder / "drawn.png")
    return path


def test_grey_of_unknown_ground_that_counts_as_free_is_named_with_the_setting_that_makes_it_a_wall(tmp_path):
    course = ring()
    wall = ndimage.binary_dilation(course, iterations=2) & ~course
    wall[:, 148:154] = False  # walls that the laser has not seen
    path = saved_map(tmp_path, course, ~(course | wall))
    with pytest.raises(
        TrackError, match=r"grey 205, .* free_thresh \(\d\d % .*, or drawn\.yaml\[free_thresh=0\.196\]$"
    ):
        read_map(path)
    track, expected = load_map(f"{path}[free_thresh=0.196]"), read_map(draw_map(tmp_path, course, name="other"))
    np.testing.assert_array_equal(track.centreline, expected.centreline)
    course[28:34, 148:154] = course[:28, 150] = True  # and a way out that it has seen
    path = saved_map(tmp_path, course, ~(course | wall))
    with pytest.raises(TrackError, match=r"drawn\.yaml\[free_thresh=0\.196,close=0\.\d\]$"):
        read_map(path)
    course[:] = True
    course[60:140, 60:240] = False
    path = saved_map(tmp_path, course, course)
    with pytest.warns(UserWarning, match=r"the course leads over it; drawn\.yaml\[border=wall,free_thresh=0\.196\]"):
        load_map(f"{path}[border=wall]")


def test_the_images_border_is_a_wall_on_request(tmp_path):
    free = np.ones((200, 300), dtype=bool)
    free[60:140, 60:240] = False
    path = draw_map(tmp_path, free)
    with pytest.raises(TrackError, match=r"accepted: a course with walls all round, or drawn\.yaml\[border=wall\]"):
        read_map(path)
    track = load_map(f"{path}[border=wall]")
    assert (track.length, track.start_pose()[0]) == (
        pytest.approx(2 * (9 + 4) + 2 * math.pi * 1.5, rel=0.1),
        pytest.approx(1.5, abs=0.5),
    )


def test_a_start_in_the_file_is_the_start_of_the_course(tmp_path):
    rows = [[7.5, 7.7, 0.1], [7.5, 2.2, 0.0]]
    track = read_map(draw_map(tmp_path, ring(), starting_positions=rows))
    assert track.start_pose() == pytest.approx((7.5, 7.75, 0.0), abs=0.03)
    turned = read_map(draw_map(tmp_path, ring(), starting_positions=[[7.5, 7.7, 3.0]]))
    assert abs(turned.start_pose()[2]) == pytest.approx(math.pi, abs=0.03)
    asked = read_map(tmp_path / "drawn.yaml", start=(7.5, 2.2), direction="clockwise")
    assert asked.start_pose()[:2] == pytest.approx((7.5, 2.25), abs=0.03)


def speckled(share=0.0008):
    """Return the ring with single pixels that are not free, and how many there are on its course."""
    free = ring()
    specks = free & (np.random.default_rng(0).random(free.shape) < share)
    specks[:, 130:170] = False  # clear of the start, and none beside another
    return free & ~specks, np.count_nonzero(specks)


def test_specks_are_counted_and_the_setting_that_is_named_drops_them(tmp_path):
    free, specks = speckled(0.004)
    path = draw_map(tmp_path, free)
    with pytest.warns(UserWarning, match=r"(\d+) islands of fewer than \d pixels are kept as obstacles") as told:
        noisy = load_map(str(path))
    assert len(noisy.islands) >= int(str(told[0].message).split(": ")[1].split()[0]) > 0.8 * specks
    setting = re.search(r"drawn\.yaml(\[specks=\d\])", str(told[0].message))[1]
    whole = load_map(str(draw_map(tmp_path, ring(), name="whole")))
    clean = load_map(f"{path}{setting}")
    assert clean.islands == ()
    assert clean.length == pytest.approx(whole.length, rel=2e-3) and noisy.length > 1.01 * whole.length
    again = load_map(f"{draw_map(tmp_path, ring(), name='again')}[specks=9]")
    for ours, theirs in zip(again.definition.values(), whole.definition.values(), strict=True):
        np.testing.assert_array_equal(ours, theirs)  # where there are none nothing changes


@each(("hole", "option"), [(40, "close=2.1"), (90, "border=wall")])
def test_a_hole_much_wider_than_the_course_is_not_closed_but_the_border_is_a_wall(tmp_path, hole, option):
    free = double_wall()
    free[29:33, 150 - hole // 2 : 150 + hole // 2] = True  # in the lower straight, of a course of 1.3 m
    path = draw_map(tmp_path, free)
    with pytest.raises(TrackError, match=rf"a hole, .* m wide, .*, or drawn\.yaml\[{option}\]$"):
        load_map(str(path))
    assert isinstance(load_map(f"{path}[{option}]"), MapTrack)


def test_a_wall_of_thousands_of_corners_is_traced_as_with_a_full_matrix(monkeypatch):
    noise = np.random.default_rng(2).random((90, 90)) > 0.3
    outline = walls.outlines(noise)[0]
    full = walls.trace(outline)
    monkeypatch.setattr(walls, "MOST_DENSE", 0)
    assert len(full) > 100
    np.testing.assert_allclose(walls.trace(outline), full, atol=1e-9)


@each(("options", "free"), [((), ring()), (("--negate",), ~ring())])
def test_a_picture_becomes_a_map(tmp_path, capsys, options, free):
    path = draw_map(tmp_path, free)
    path.unlink()
    arguments = ("track", "from-image", str(tmp_path / "drawn.png"), "--resolution", "0.05", *options)
    assert main(arguments) == 0
    assert f"{path}: " in capsys.readouterr().out
    assert load_map(str(path)).length == pytest.approx((2 * math.pi * 55 + 240) * PIXEL, rel=0.01)
    assert main(arguments) == 2 and "drawn.yaml" in capsys.readouterr().err  # it is there
