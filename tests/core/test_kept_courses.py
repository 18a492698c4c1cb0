"""Courses and their models are kept on disk, and a kept one is what would be made anew, to the bit."""

import errno
import os
import pickle
import warnings
from pathlib import Path

import numpy as np
import pytest
import recipes

import fg_mujoco as fg
from fg_mujoco import kept as keeping
from fg_mujoco.controllers.safety import braking_trajectories
from fg_mujoco.course import formats
from fg_mujoco.course.definitions import course_sha256
from fg_mujoco.course.maps import map_track
from fg_mujoco.errors import Note
from fg_mujoco.simulation import world as worlds
from map_oracles import draw_map, ring


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """The folder of kept courses, empty, and how often a course is read and a world composed with its walls."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    keeping._folder.cache_clear()
    made = {"course": 0, "world": 0}

    def count(name, true):
        def counting(*args, **options):
            made[name] += 1
            return true(*args, **options)

        return counting

    monkeypatch.setattr(map_track, "read_map", count("course", map_track.read_map))
    monkeypatch.setattr(worlds, "_add_walls", count("world", worlds._add_walls))
    yield tmp_path / "cache" / "fg_mujoco" / "kept", made
    keeping._folder.cache_clear()


def as_in_a_new_process():
    for function in (worlds._kept, worlds._text_of, worlds._compiled, braking_trajectories._table):
        function.cache_clear()


def raced(path, **settings):
    as_in_a_new_process()
    result = fg.race(str(path), time_limit=0.5, **settings)
    return result.world, (result.car.telemetry.tobytes(), result.world.xml)


def test_a_kept_map_and_its_model_are_those_that_were_made(kept, tmp_path):
    """With an island so small that the reader warns of it."""
    folder, made = kept
    free = ring()
    free[45, 150] = False
    path = draw_map(tmp_path, free)
    said = []
    for times in (1, 1):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            track = fg.load_track(str(path))
        said.append([str(each.message) for each in caught])
        assert made["course"] == times
    assert said[0] == said[1] and "1 island" in said[0][0]
    fresh = map_track.load_map(str(path))
    assert type(track) is type(fresh) and track.name == fresh.name and course_sha256(track) == course_sha256(fresh)
    assert not any(line.flags.writeable for line in track.definition.values())
    anew, first = raced(path)
    again, second = raced(path)
    assert made["world"] == 1 and first == second
    for name in dir(anew.model):
        if isinstance(getattr(anew.model, name), np.ndarray):
            assert getattr(anew.model, name).tobytes() == getattr(again.model, name).tobytes(), name
    assert {each.name.partition("-")[0] for each in folder.iterdir()} == {"course", "world", "trajectories"}


def test_the_file_of_a_bundled_circuit_says_what_was_understood_and_its_name_does_not(kept, recwarn):
    path = Path(recipes.__file__).parents[1] / "tracks" / "oval.csv"
    for _ in range(2):
        formats._bundled.cache_clear()
        fg.load_track("oval")
        assert not recwarn.list
        with pytest.warns(Note, match="285 points of x_m, y_m"):
            fg.load_track(path)


def test_what_differs_is_made_anew(kept, tmp_path):
    _, made = kept
    path = draw_map(tmp_path, ring())
    length = fg.load_track(str(path)).length
    assert fg.load_track(f"{path}[direction=clockwise]").length == pytest.approx(length) and made["course"] == 2
    draw_map(tmp_path, ring(inner=45.0))
    assert fg.load_track(str(path)).length > length and made["course"] == 3
    path.write_text(path.read_text().replace("0.05", "0.06"))
    assert fg.load_track(str(path)).length > 1.1 * length and made["course"] == 4
    for count, settings in enumerate(({}, {"mu": 0.7}, {"obstacles": 1}, {"vehicle": "ipz"}), start=1):
        raced(path, **settings)
        raced(path, **settings)
        assert made["world"] == count


@pytest.mark.parametrize("damage", ["cut", "another object", "a folder", "full disk", "read-only"])
def test_what_cannot_be_read_or_kept_is_made_anew(kept, tmp_path, monkeypatch, capsys, damage):
    folder, made = kept
    path = draw_map(tmp_path, ring())
    if damage == "full disk":

        def fail(file, *_):
            file.touch()
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        monkeypatch.setattr(Path, "write_bytes", fail)
    elif damage == "read-only":
        folder.parent.parent.mkdir()
        folder.parent.write_text("in the place of the folder")
    _, first = raced(path)
    for file in list(folder.iterdir()) if folder.is_dir() else []:
        if damage == "cut":
            file.write_bytes(file.read_bytes()[:-1])
        elif damage == "another object":
            keeping._write(file, pickle.dumps(("neither", 1)))
        elif damage == "a folder":
            file.unlink()
            file.mkdir()
    assert raced(path)[1] == first and made == {"course": 2, "world": 2}
    assert "course" not in capsys.readouterr().err
    if damage == "full disk":
        assert list(folder.iterdir()) == []
    if damage in ("cut", "another object"):
        assert raced(path)[1] == first and made == {"course": 2, "world": 2}


def test_the_folder_does_not_grow_without_end(kept, tmp_path, monkeypatch):
    """What was used last stays."""
    folder, made = kept
    path = draw_map(tmp_path, ring())
    fg.load_track(str(path))
    (first,) = folder.iterdir()
    (folder / "a_folder").mkdir()  # which is no entry
    monkeypatch.setattr(keeping, "MOST_BYTES", int(2.5 * first.stat().st_size))
    for number in range(4):
        for file in folder.iterdir():
            os.utime(file, (number, number))
        fg.load_track(str(path))
        fg.load_track(f"{path}[close=0.{number + 1}]")
    assert sum(map(Path.is_file, folder.iterdir())) == 2 and first.is_file() and made["course"] == 5
