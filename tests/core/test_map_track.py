"""Tracks from maps: which course, which line, which walls, and what is refused."""

import math

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.course.centreline_csv import write_centreline
from fg_mujoco.course.maps.map_track import DIRECTIONS, load_map, read_map
from fg_mujoco.course.polyline import enclosed_area, self_crossings
from fg_mujoco.course.track import MapTrack
from fg_mujoco.errors import TrackError
from map_oracles import box_room, draw_map, loop_difference, real_map, ring

PIXEL = 0.05
LAPS = ("maps/aut", "maps/esp", "maps/gbr", "maps/mco", "circuits/Monza_map")


@pytest.mark.slow
@each("name", LAPS)
def test_real_maps_load_with_their_line_in_the_middle(name):
    track = load_map(str(real_map(name)))
    assert isinstance(track, MapTrack)
    assert len(self_crossings(track.centreline)[0]) == 0
    np.testing.assert_allclose(track.width_left, track.width_right, atol=0.35)  # smoothing cuts corners
    assert np.median(np.abs(track.width_left - track.width_right)) < PIXEL
    csv = real_map(name).with_name(f"{name.rpartition('/')[2].removesuffix('_map')}_centerline.csv")
    given = fg.read_centreline(csv)
    assert track.length == pytest.approx(given.length, rel=0.01)
    _, offset = track.project(given.centreline)
    assert np.quantile(np.abs(offset), 0.95) < 0.15


@each("yaw", [0.0, 0.7, -2.5])
def test_a_map_may_be_turned(tmp_path, yaw):
    plain = read_map(draw_map(tmp_path, ring()), start=(7.5, 2.25), direction="counterclockwise")
    turn = complex(math.cos(yaw), math.sin(yaw))
    start = complex(7.5, 2.25) * turn + complex(3.0, -2.0)
    turned = read_map(
        draw_map(tmp_path, ring(), name="turned", origin=(3.0, -2.0, yaw)),
        start=(start.real, start.imag), direction="counterclockwise",
    )  # fmt: skip
    for ours, theirs in zip(plain.definition.values(), turned.definition.values(), strict=True):
        if ours.ndim == 2:
            moved = (ours[:, 0] + 1j * ours[:, 1]) * turn + complex(3.0, -2.0)
            np.testing.assert_allclose(theirs, np.column_stack((moved.real, moved.imag)), atol=1e-6)
        else:
            np.testing.assert_allclose(theirs, ours, atol=1e-6)


def test_a_map_starts_where_the_robot_did_and_looks_where_it_looked(tmp_path):
    # the origin of the world is on the lower straight, 7.5 m from the left edge and 2.25 m from below
    track = read_map(draw_map(tmp_path, ring(), origin=(-7.5, -2.25, 0.0)))
    assert track.start_pose() == pytest.approx((0.0, 0.0, 0.0), abs=0.03)
    upper = read_map(draw_map(tmp_path, ring(), origin=(-7.5, -7.75, 0.0)))
    assert upper.start_pose() == pytest.approx((0.0, 0.0, 0.0), abs=0.03)
    assert enclosed_area(track.centreline) > 0.0 > enclosed_area(upper.centreline)


@each("direction", DIRECTIONS)
def test_start_and_direction_are_as_asked_for(tmp_path, direction):
    path = draw_map(tmp_path, ring())
    track = load_map(f"{path}[start=7.6:7.7,direction={direction}]")
    x, y, heading = track.start_pose()
    assert (x, y) == pytest.approx((7.6, 7.75), abs=0.03)
    assert math.cos(heading) == pytest.approx(1.0 if direction == "clockwise" else -1.0, abs=1e-3)
    assert (enclosed_area(track.centreline) > 0.0) == (direction == "counterclockwise")
    for wall in (track.left_wall, track.right_wall):
        assert enclosed_area(wall) * enclosed_area(track.centreline) > 0.0  # in driving order
    assert (abs(enclosed_area(track.left_wall)) < abs(enclosed_area(track.right_wall))) == (
        direction == "counterclockwise"
    )


def islands():
    free = ring()
    y, x = np.mgrid[:200, :300]
    free[(abs(x - 150) < 4) & (abs(y - 45) < 5)] = False  # a box, the lower side blocked more
    free[(x - 100) ** 2 + (y - 152) ** 2 < 36] = False
    free[150, 200] = False  # one pixel
    return free


@each("direction", DIRECTIONS)
def test_islands_are_kept_and_the_line_goes_past_them_by_the_wide_side(tmp_path, direction):
    track = read_map(draw_map(tmp_path, islands()), direction=direction)
    assert len(track.islands) == 3
    assert all(enclosed_area(island) > 0.0 for island in track.islands)
    areas = sorted(enclosed_area(island) / PIXEL**2 for island in track.islands)
    assert areas == pytest.approx([0.5, 63.0, 112.0], rel=0.1)  # the pixel is a diamond through its edges' middles
    for island in track.islands:
        _, offset = track.project(island)
        assert np.all(np.sign(offset) == np.sign(offset[0]))
    assert min(track.width_left.min(), track.width_right.min()) > 4.8 * PIXEL  # of the 6 that the narrowest has
    world = fg.World(track)
    assert world.model.ngeom > len(track.left_wall) + len(track.right_wall) + 12


def test_a_given_centreline_is_kept(tmp_path):
    path = draw_map(tmp_path, ring())
    found = read_map(path)
    line = fg.Track(
        name="given", centreline=np.add(found.centreline[::-1], (0.0, 0.1)), width_left=found.width_left,
        width_right=found.width_right,
    )  # fmt: skip
    write_centreline(line, tmp_path / "given.csv")
    track = load_map(f"{path}[centreline={tmp_path / 'given.csv'}]")
    np.testing.assert_array_equal(track.centreline, line.centreline)
    assert loop_difference(track.left_wall, found.right_wall) < 1e-9  # it goes the other way round
    started = load_map(f"{path}[centreline={tmp_path / 'given.csv'},start=7.5:2.25]")
    assert started.start_pose()[:2] == pytest.approx((7.5, 2.35), abs=0.01)
    assert enclosed_area(started.centreline) * enclosed_area(line.centreline) > 0.0


@each(("shift", "message"), [((0.0, 1.2), "is not free"), ((100.0, 0.0), "outside of the image")])
def test_a_centreline_off_the_map_is_refused(tmp_path, shift, message):
    path = draw_map(tmp_path, ring())
    found = read_map(path)
    line = fg.Track(name="x", centreline=found.centreline + shift, width_left=found.width_left,
                    width_right=found.width_right)  # fmt: skip
    write_centreline(line, tmp_path / "off.csv")
    with pytest.raises(TrackError, match=message):
        read_map(path, centreline=tmp_path / "off.csv")


def corridor():
    free = np.zeros((100, 300), dtype=bool)
    free[40:60, 10:290] = True
    return free


def test_a_corridor_is_a_scene_from_end_to_end(tmp_path):
    path = draw_map(tmp_path, corridor())
    there, back = read_map(path), read_map(path, start=(14.0, 2.5))
    assert isinstance(there, fg.Scene) and isinstance(back, fg.Scene)
    assert there.start_pose() == pytest.approx((2.8, 2.5, 0.0), abs=0.1)
    x, y, heading = back.start_pose()
    assert (x, y, abs(heading)) == pytest.approx((12.2, 2.5, math.pi), abs=0.1)
    assert there.length == pytest.approx(13.9 - 5.0, abs=0.7)
    race = fg.race(there, "gap_finder")
    assert race.car.finished


@each(
    ("free", "message"),
    [
        (np.zeros((50, 50), bool), "no free ground is large enough"),
        (np.ones((200, 200), bool), r"free ground runs out of the image at \(0.03, 0.03\), column 0, row 199"),
        (box_room(60, 70), "no closed course, and the longest open way is of 2.. m"),
        (np.pad(np.ones((30, 120), bool), 20), "longest open way is of 5.. m; accepted: .* a way of 8.0 m, 2 m of it"),
    ],
    ids=["solid", "empty", "closet", "short-way"],
)
def test_a_map_without_a_course_is_refused(tmp_path, free, message):
    with pytest.raises(TrackError, match=message):
        read_map(draw_map(tmp_path, free))


@each(
    ("settings", "message"),
    [
        ("start=7.5:5", r"\(7.50, 5.00\) is not free; accepted: a point on the course"),
        ("start=70:5", r"\(70.00, 5.00\) is outside of the image"),
        ("start=1", "start is '1'; accepted: X:Y"),
        ("begin=1:2", "setting 'begin=1:2'; accepted: each once, of centreline"),
        ("direction=left", "direction is 'left'; accepted: clockwise, counterclockwise"),
        ("outside_folder=maybe", "outside_folder is 'maybe'; accepted: yes or no"),
        ("centreline=none.csv", "none.csv: no such file"),
    ],
)
def test_settings_that_are_wrong_are_refused(tmp_path, settings, message):
    path = draw_map(tmp_path, ring())
    with pytest.raises(TrackError, match=message):
        fg.load_track(f"{path}[{settings}]")
