"""ROS map_server files: what is free, where it is, and what is refused."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from cases import each
from fg_mujoco.course.maps.map_server import OccupancyMap, plain_yaml, read_map_file
from fg_mujoco.errors import TrackError
from map_oracles import box_room, draw_map

GREYS = np.arange(256, dtype=np.uint8)[None]


def write(folder, image, *, suffix="png", **settings):
    image.save(folder / f"greys.{suffix}")
    draw_map(folder, box_room(), name="greys", image=f"greys.{suffix}", **settings)
    image.save(folder / f"greys.{suffix}")
    return folder / "greys.yaml"


@each("negate", [0, 1])
@each("suffix", ["png", "pgm"])
@each(("free", "occupied"), [(0.196, 0.65), (0.2, 0.65), (0.2, 0.2), (0.25, 0.65), (1.0, 1.0), (0.0, 0.5)])
def test_free_is_what_is_up_to_the_threshold_as_nav2_has_it(tmp_path, negate, suffix, free, occupied):
    path = write(
        tmp_path, Image.fromarray(GREYS), suffix=suffix, negate=negate, free_thresh=free, occupied_thresh=occupied
    )
    p = [(x if negate else 255 - x) / 255 for x in range(256)]
    np.testing.assert_array_equal(read_map_file(path).free[0], [value <= free for value in p])


def test_what_is_occupied_is_not_free_although_the_threshold_for_free_is_higher(tmp_path):
    path = write(tmp_path, Image.fromarray(GREYS), free_thresh=0.9, occupied_thresh=0.5)
    with pytest.warns(UserWarning, match=r"free_thresh is 0.9, above occupied_thresh, 0.5") as warned:
        free = read_map_file(path).free[0]
    assert len(warned) == 1
    np.testing.assert_array_equal(free, [not (255 - x) / 255 > 0.5 for x in range(256)])


def test_raw_brightness_is_the_probability_in_percent(tmp_path):
    path = write(tmp_path, Image.fromarray(GREYS), mode="raw", free_thresh=0.25, occupied_thresh=0.65)
    np.testing.assert_array_equal(read_map_file(path).free[0], [x <= 25 for x in range(256)])


@each("suffix", ["png", "pgm"])
def test_images_of_sixteen_bits_and_of_one_are_read(tmp_path, suffix):
    path = write(tmp_path, Image.fromarray(np.array([[65535, 40000, 0]], np.uint16)), suffix=suffix)
    np.testing.assert_array_equal(read_map_file(path).free[0], [True, False, False])
    path = write(tmp_path, Image.fromarray(np.array([[255, 0]], np.uint8)).convert("1"))
    np.testing.assert_array_equal(read_map_file(path).free[0], [True, False])


def test_row_zero_is_the_lowest(tmp_path):
    path = write(tmp_path, Image.fromarray(np.array([[255, 255], [0, 255]], np.uint8)))
    np.testing.assert_array_equal(read_map_file(path).free, [[False, True], [True, True]])


@given(
    st.floats(0.01, 1.0), st.floats(-100, 100), st.floats(-100, 100), st.floats(-10, 10),
    st.floats(-50, 50), st.floats(-50, 50),
)  # fmt: skip
def test_the_origin_is_the_lower_left_corner_and_yaw_turns_about_it(resolution, x, y, yaw, column, row):
    occupancy = OccupancyMap(path=None, free=np.ones((1, 1), bool), resolution=resolution, origin=(x, y, yaw))
    place = complex(x, y) + complex(column, row) * resolution * complex(math.cos(yaw), math.sin(yaw))
    world = occupancy.to_world((column, row))
    np.testing.assert_allclose(world, (place.real, place.imag), atol=1e-9)
    np.testing.assert_allclose(occupancy.to_pixels(world), (column, row), atol=1e-6)


@each(
    ("settings", "message"),
    [
        ({"resolution": None}, "has no resolution; accepted: the keys image, resolution"),
        ({"negate": None, "origin": None}, "has no origin, negate"),
        ({"occupied_thresh": None, "occupied_tresh": 0.65}, "has no occupied_thresh, but occupied_tresh; accepted"),
        ({"resolution": 0}, "resolution is 0; accepted: the side of a pixel in metres, from 0.001 to 1"),
        ({"resolution": "coarse"}, "resolution is 'coarse'"),
        ({"negate": 2}, "negate is 2; accepted: 0 or 1"),
        ({"free_thresh": 1.1}, "free_thresh is 1.1; accepted: a number from 0 to 1"),
        ({"origin": [0, 0]}, r"origin is \[0, 0\]; accepted: \[x, y, yaw\]"),
        ({"mode": "binary"}, "mode is 'binary'; accepted: trinary, scale, raw"),
        ({"mode": "raw", "negate": 1}, "mode is raw with negate: 1, .*; accepted: negate: 0"),
        ({"image": 7}, "image is 7"),
        ({"image": "none.png"}, "none.png: no such file"),
        ({"image": "../map.png"}, "image '../map.png' is outside of the YAML's folder"),
        ({"image": "drawn.yaml"}, "drawn.yaml: cannot be read as an image"),
    ],
)
def test_a_yaml_that_is_wrong_is_refused(tmp_path, settings, message):
    path = draw_map(tmp_path, box_room(), **settings)
    with pytest.raises(TrackError, match=message) as refusal:
        read_map_file(path)
    assert str(tmp_path) in str(refusal.value)


@each("text", ["1e-06", "3e-1", "-2E3", "+1.5e+2", "1.0e5", "-.5", "7", "0.25", "1."])
def test_a_number_is_one_in_every_spelling_of_yaml_1_2(text):
    assert plain_yaml(f"x: {text}") == {"x": float(text)}


@each("text", ["e5", "1e", "1.2.3", "v1e5", "1e5m", ".", "'1e5'"])
def test_text_that_looks_like_a_number_stays_text(text):
    assert plain_yaml(f"x: {text}") == {"x": text.strip("'")}


@each(
    ("settings", "start", "heading"),
    [
        ({"starting_positions": [[1, 2, 0.5], [3, 4, 0.0]]}, (1.0, 2.0), 0.5),
        ({"starting_positions": [1.5, -2.0, 0.5], "starting_angle": 2.0}, (1.5, -2.0), 0.5),
        ({"starting_positions": [[1, 2]], "starting_angle": 2.0}, (1.0, 2.0), 2.0),
        ({"starting_angle": 1.5}, None, 1.5),
        ({}, None, None),
    ],
)
def test_where_cars_start_is_read_without_a_warning(tmp_path, recwarn, settings, start, heading):
    occupancy = read_map_file(draw_map(tmp_path, box_room(), **settings))
    assert (occupancy.start, occupancy.heading) == (start, heading)
    assert not [each for each in recwarn.list if str(tmp_path) in str(each.message)]  # threads of others warn, too


@each("settings", [{"starting_positions": "pole"}, {"starting_angle": ".nan"}])
def test_a_start_that_cannot_be_read_is_ignored_with_a_warning(tmp_path, settings):
    with pytest.warns(UserWarning, match=f"ignored: {next(iter(settings))} is "):
        occupancy = read_map_file(draw_map(tmp_path, box_room(), **settings))
    assert (occupancy.start, occupancy.heading) == (None, None)


def test_a_link_that_leads_outside_is_refused_unless_allowed(tmp_path):
    inside = tmp_path / "maps"
    inside.mkdir()
    path = draw_map(inside, box_room())
    (inside / "drawn.png").rename(tmp_path / "far.png")
    (inside / "drawn.png").symlink_to(tmp_path / "far.png")
    with pytest.raises(TrackError, match="outside of the YAML's folder"):
        read_map_file(path)
    assert read_map_file(path, outside_folder=True).free.any()


@each("image", ["/home/somebody/maps/drawn.png", "maps/drawn.png", "C:\\\\maps\\\\drawn.png"])
def test_an_image_that_lay_elsewhere_is_read_beside_the_yaml_with_a_warning(tmp_path, image):
    path = draw_map(tmp_path, box_room(), image=f'"{image}"')
    with pytest.warns(UserWarning, match=r"image is .*drawn.png', which is not there; drawn.png here is read"):
        assert read_map_file(path).free.any()
