"""Scenes of other distributions: found by their entry points, made from a seed and for a car, refused in one line."""

from __future__ import annotations

import textwrap

import pytest

import fg_mujoco as fg
from fg_mujoco.cli.main import main
from fg_mujoco.course.definitions import course_sha256
from fg_mujoco.course.scenes import SCENES, load_scene
from fg_mujoco.vehicle.vehicle import Vehicle

MODULE = '''
    import numpy as np
    import fg_mujoco as fg
    def doorway(name, seed, car):
        """A wall with a door of 2 car widths.

        More of it, which no list shows.
        """
        half, y = car.width, 0.2 * seed
        sides = ((-1.2, y - half), (y + half, 1.2))
        boxes = tuple(fg.Box(x=6.0, y=0.5 * (a + b), length=0.2, width=b - a) for a, b in sides)
        walls = tuple(fg.Box(x=7.0, y=side, length=24.0, width=0.2) for side in (-1.3, 1.3))
        return fg.Scene(
            name=name, way=np.array([[-2.5, 0.0], [15.0, 0.0]]), start=2.5, goal=12.5, walls=walls, obstacles=boxes,
            time_limit=20.0,
        )
    def nothing(name, seed, car):
        return None
    def misnamed(name, seed, car):
        return doorway("door", seed, car)
    def raises(name, seed, car):
        return 1 / 0
'''


@pytest.fixture
def register(tmp_path, monkeypatch):
    """Return what makes a distribution with some scenes, `name = object` each, and puts it on the path."""

    def make(*entries, distribution="yard", version="1.2"):
        folder = tmp_path / f"{distribution}-{version}.dist-info"
        folder.mkdir()
        (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {distribution}\nVersion: {version}\n")
        (folder / "entry_points.txt").write_text("\n".join(("[fg_mujoco.scenes]", *entries)) + "\n")
        (tmp_path / "yard_scenes.py").write_text(textwrap.dedent(MODULE))

    monkeypatch.syspath_prepend(tmp_path)
    return make


def test_a_registered_scene_is_listed_with_its_distribution(register, capsys):
    register("doorway = yard_scenes:doorway")
    assert fg.scene_names() == (*SCENES, "doorway")
    assert main(["track", "scenes"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1] == "scene:doorway: A wall with a door of 2 car widths. (yard 1.2)"
    assert not any("(yard" in line for line in lines[:-1])


def test_it_is_made_for_the_car_and_from_the_seed(register):
    register("doorway = yard_scenes:doorway")
    car = Vehicle.load().parameters
    same, again, other = (course_sha256(load_scene(f"scene:doorway:{seed}", car)) for seed in (1, 1, 2))
    assert same == again != other
    low, high = fg.load_track("scene:doorway").obstacles
    assert high.y - 0.5 * high.width - (low.y + 0.5 * low.width) == pytest.approx(2.0 * car.width)


@pytest.mark.parametrize(
    ("entry", "name", "said"),
    (
        ("nothing = yard_scenes:nothing", "nothing", "yard_scenes:nothing is None; accepted: a name such as"),
        ("misnamed = yard_scenes:misnamed", "misnamed", ".* is named 'door'; accepted: 'scene:misnamed:3'"),
        ("raises = yard_scenes:raises", "raises", ".* cannot be made: ZeroDivisionError: division by zero"),
        ("lost = yard_scenes:lost", "lost", ".*AttributeError: .*lost"),
        ("gone = yard_gone:gone", "gone", ".*ModuleNotFoundError: No module named 'yard_gone'"),
        ("number = yard_scenes:np.pi", "number", r".* is a float; accepted: a function \(name, seed, car\)"),
    ),
)
def test_one_that_fails_is_refused_with_its_distribution(register, entry, name, said):
    register(entry)
    with pytest.raises(fg.TrackError, match=f"scene '{name}' of yard 1.2, {said}"):
        fg.load_track(f"scene:{name}:3")


def test_the_name_of_a_bundled_scene_is_refused_and_the_bundled_one_stays(register, capsys):
    before = course_sha256(fg.load_track("scene:dead_end:1"))
    register("dead_end = yard_scenes:doorway")
    assert course_sha256(fg.load_track("scene:dead_end:1")) == before
    assert main(["track", "scenes"]) == 2
    error = capsys.readouterr().err
    assert (
        "scene 'dead_end' of yard 1.2, yard_scenes:doorway has the name of a bundled scene; accepted: a name of"
        in error
    )
    assert error.count("\n") == 1


def test_bundled_scenes_have_room_for_cars_up_to_a_width():
    from dataclasses import replace

    car = Vehicle.load().parameters
    for name in SCENES:
        for seed in range(5):
            load_scene(f"scene:{name}:{seed}", replace(car, width=0.6, length=1.1))
    with pytest.raises(fg.TrackError, match=r"for a car 0.61 m wide; accepted: at most 0.6 m"):
        load_scene("scene:dead_end", replace(car, width=0.61))
