"""Pictures of several cars: each its look, its colour and its number, and cameras that follow any of them."""

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.pictures.rendering import LABELS, Film, Overlays
from fg_mujoco.pictures.rendering.recorded_drive import read_drive
from fg_mujoco.pictures.rendering.ribbons import box_faces
from fg_mujoco.pictures.rendering.scenery import compile_scenery
from fg_mujoco.pictures.rendering.textures import car_number
from fg_mujoco.simulation.cars import BOX_HEIGHTS, BOX_SIDE, car_colour
from field_races import three_cars
from rendered import needs_gl, pixel

SIZE = (480, 320)
CAR = LABELS.index("car")
HEIGHT = BOX_HEIGHTS[1] - BOX_HEIGHTS[0]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return fg.write_run(three_cars(), tmp_path_factory.mktemp("runs") / "three")


def film(camera, car, **settings):
    overlays = settings.pop("overlays", Overlays())
    return Film(three_cars(), camera=camera, car=car, size=SIZE, quality="draft", overlays=overlays, **settings)


def on_box(data, car, *, x=0.0, y=0.0, z=0.0):
    """A point of a car's box, from its middle [m], in the world."""
    place = data.geom(f"{'car' if car == 0 else f'car_{car}'}/visible_box")
    return place.xpos + place.xmat.reshape(3, 3) @ (x, y, z)


def test_every_car_has_the_meshes_of_its_look_and_paint_of_its_colour():
    scenery = compile_scenery(three_cars().world.xml, start=(0.0, 0.0))
    for index, prefix in enumerate(("look/", "look/car_1/", "look/car_2/")):
        deck = scenery.geom(f"{prefix}deck")
        assert scenery.body(int(deck.bodyid[0])).name == ("car/base_link", "car_1/base_link", "car_2/base_link")[index]
        np.testing.assert_allclose(scenery.mat_rgba[int(deck.matid[0])], car_colour(index), atol=1e-6)
    assert not any(scenery.geom(geom).name.startswith("car_1/body") for geom in range(scenery.ngeom))


def test_faces_of_a_box_cover_it_and_do_not_distort_the_number():
    box = box_faces(BOX_SIDE, HEIGHT)
    corners = box.vertices[box.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = 0.5 * np.linalg.norm(across, axis=1)
    assert areas.sum() == pytest.approx(4.0 * BOX_SIDE * HEIGHT + BOX_SIDE**2)
    assert (np.einsum("ij,ij->i", across, corners.mean(axis=1)) > 0.0).all()  # fronts are outside
    edges = corners - np.roll(corners, 1, axis=1)
    of_texture = (box.texture[box.faces] - np.roll(box.texture[box.faces], 1, axis=1)) * (BOX_SIDE, HEIGHT)
    np.testing.assert_allclose(np.linalg.norm(of_texture, axis=2), np.linalg.norm(edges, axis=2), atol=1e-12)


@needs_gl
@each("car", [0, 1, 2])
def test_camera_follows_the_car_that_is_asked_for_and_the_box_has_its_colour(car):
    with film("top", car) as made:
        time = 2.0
        picture, labels, view = made.frame(time), made.segmentation(time), made.view(time)
        data = made._player.at(time)
        base = data.body(("car/base_link", "car_1/base_link", "car_2/base_link")[car])
        ahead = view.focus[:2] - base.xpos[:2]
        assert np.linalg.norm(ahead) == pytest.approx(1.6)  # as `top` looks
        for corner in ((0.9, 0.9), (-0.9, 0.9), (-0.9, -0.9), (0.9, -0.9)):
            half = 0.5 * BOX_SIDE * np.array(corner)
            column, row = pixel(view, on_box(data, car, x=half[0], y=half[1], z=0.5 * HEIGHT), SIZE)
            assert labels[row, column] == CAR
            shown, wanted = picture[row, column].astype(float), np.array(car_colour(car)[:3])
            assert shown @ wanted / np.linalg.norm(shown) / np.linalg.norm(wanted) > 0.97


@needs_gl
def test_number_is_upright_and_not_mirrored_from_behind():
    with Film(three_cars(), camera="chase", car=2, size=(960, 640), quality="draft", overlays=Overlays()) as made:
        picture, view, data = made.frame(0.0), made.view(0.0), made._player.at(0.0)
    side = car_number(2, car_colour(2))[::-1]  # from above
    rows, columns = np.mgrid[24:136:8, 12:84:6]
    shown = []
    for row, column in zip(rows.ravel(), columns.ravel(), strict=True):
        across, up = 0.5 - (column + 0.5) / 96.0, 0.5 - (row + 0.5) / 160.0
        x, y = pixel(view, on_box(data, 2, x=-0.5 * BOX_SIDE, y=across * BOX_SIDE, z=up * HEIGHT), (960, 640))
        shown.append(float(picture[y, x].mean()))
    wanted = side[rows, columns].mean(axis=-1)
    likeness = [np.corrcoef(shown, other.ravel())[0, 1] for other in (wanted, wanted[:, ::-1], wanted[::-1])]
    assert likeness[0] > 0.8 and likeness[0] > max(likeness[1:]) + 0.1


@needs_gl
def test_overlays_are_of_the_car_that_is_followed(folder):
    race = three_cars()
    with film("top", 1, overlays=Overlays(trace=True, forces=True, beams=True, strip=True)) as made:
        assert made.note == ""
        assert made.drive.summary["controller"] == "disparity_extender" and made.drive.summary["name"] == "blue one"
        np.testing.assert_array_equal(made.drive.telemetry, race.cars[1].telemetry)
        forces = made._forces.read(made._player.at(2.0))
        body = made._player.at(2.0).body("car_1/base_link").xpos
        assert (np.linalg.norm(forces.points - body, axis=1) < 0.6).all()
        np.testing.assert_array_equal(made.frame(2.0), made.frame(2.0))
    from_folder = read_drive(folder, 1)
    assert from_folder.start == pytest.approx(read_drive(folder, 2).start)  # one start line, whoever is followed
