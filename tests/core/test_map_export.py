"""The way back: a track as a map, a centreline or a mesh, and what is read from those again."""

import os
import re

import numpy as np
import pytest
import trimesh

import fg_mujoco as fg
from cases import each
from fg_mujoco.cli.main import main
from fg_mujoco.course.maps.export import export_track
from fg_mujoco.course.maps.map_track import read_map
from fg_mujoco.course.track_mesh import WALL_HEIGHT, WALL_THICKNESS
from fg_mujoco.errors import SettingsError, TrackError
from map_oracles import draw_map, loop_difference, ring


def own_settings(path):
    """Return the settings that a map's first line names, with which it starts as its track did."""
    return re.search(r"\[.*\]", path.read_text().splitlines()[0])[0]


@pytest.mark.slow
@each("name", ["oval", "hairpins", "random:3", "random:7:tight"])
def test_walls_come_back_from_a_map_within_a_pixel(name, tmp_path):
    track = fg.load_track(name)
    yaml, image = export_track(track, tmp_path / "track.yaml", resolution=0.05)
    assert yaml.exists() and image.exists()
    again = fg.load_track(f"{yaml}{own_settings(yaml)}")
    assert loop_difference(track.left_wall, again.left_wall) <= 0.05
    assert loop_difference(track.right_wall, again.right_wall) <= 0.05
    # along the first side: at a square corner the found line is rounded, and turns before the corner
    assert again.start_pose() == pytest.approx(track.start_pose(), abs=0.1)
    _, offset = track.project(again.centreline)
    assert np.abs(offset).max() < 0.7 * max(track.width_left.max(), track.width_right.max())


def test_islands_come_back_from_a_map(tmp_path):
    free = ring()
    free[146:154, 146:154] = False
    track = read_map(draw_map(tmp_path, free))
    export_track(track, tmp_path / "again.yaml", resolution=0.02)
    (island,) = read_map(tmp_path / "again.yaml").islands
    assert loop_difference(track.islands[0], island) <= 0.02


@each("suffix", [".obj", ".stl", ".glb"])
def test_a_mesh_comes_back_with_the_walls_where_they_are(suffix, tmp_path):
    track = fg.load_track("oval")
    (path,) = export_track(track, tmp_path / f"oval{suffix}")
    vertices = np.asarray(trimesh.load(path, force="mesh").vertices)
    if suffix == ".glb":
        vertices = np.column_stack((vertices[:, 0], -vertices[:, 2], vertices[:, 1]))  # y is up there
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    walls = np.concatenate((track.left_wall, track.right_wall))
    assert low == pytest.approx([*(walls.min(axis=0) - WALL_THICKNESS), 0.0], abs=1e-3)
    assert high == pytest.approx([*(walls.max(axis=0) + WALL_THICKNESS), WALL_HEIGHT], abs=1e-3)
    distance = np.linalg.norm(vertices[:, None, :2] - track.left_wall, axis=2).min(axis=0)
    assert distance.max() < 1e-5  # each point of the wall is in the mesh


def test_a_mesh_has_ducts_on_banked_ground(tmp_path):
    track = fg.load_track("oval[walls=duct,height=0.2,bank=10]")
    export_track(track, tmp_path / "a.stl")
    vertices = track.ground.lifted(track.wall_surface()[0])
    assert vertices[:, 2].max() > 0.3
    bounds = trimesh.load(tmp_path / "a.stl").bounds
    assert bounds == pytest.approx(np.stack((vertices.min(axis=0), vertices.max(axis=0))), abs=1e-5)


@each(
    ("name", "resolution", "error", "message"),
    [
        ("oval.bmp", 0.05, SettingsError, "accepted: a file that ends in .yaml, .csv, .obj, .stl, .glb"),
        ("oval.yaml", 0.0, SettingsError, "resolution is 0.0 m; accepted: a positive number"),
        ("oval.yaml", float("nan"), SettingsError, "resolution is nan m"),
        ("oval.yaml", 1e-4, SettingsError, "resolution is 0.0001 m on track 'oval'; accepted: from 0.00"),
        ("oval.yaml", 4.0, TrackError, "at 4.0 m a pixel, walls or ways of track 'oval' vanish; accepted: a finer"),
        ("none/oval.yaml", 0.05, TrackError, "cannot be written"),
        ("none/oval.glb", 0.05, TrackError, "cannot be written"),
    ],
)
def test_what_cannot_be_written_is_refused_and_nothing_is(tmp_path, name, resolution, error, message):
    with pytest.raises(error, match=message):
        export_track(fg.load_track("oval"), tmp_path / name, resolution=resolution)
    assert os.listdir(tmp_path) == []


def test_the_command_writes_what_it_names_and_keeps_what_exists(tmp_path, capsys):
    files = [str(tmp_path / name) for name in ("oval.yaml", "oval.csv", "oval.glb")]
    assert main(["track", "export", "oval", *files]) == 0
    written = {"oval.yaml", "oval.png", "oval.csv", "oval.glb"}
    assert {line.rpartition("/")[2] for line in capsys.readouterr().out.split()} == written
    assert set(os.listdir(tmp_path)) == written
    assert main(["track", "export", "oval", files[0]]) == 2
    assert "oval.yaml: exists; accepted: a new file, or --force" in capsys.readouterr().err
    assert main(["track", "export", "oval", files[0], "--force", "--resolution", "0.1"]) == 0
    assert read_map(files[0]).length == pytest.approx(57.0, abs=0.3)
