"""Boxes on the track of a race, at random places that a number repeats; and scenes, on the command line."""


import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from conftest import Straight
from fg_mujoco.cli.main import main
from fg_mujoco.course.random_obstacles import CLEAR_AHEAD
from fg_mujoco.simulation.course_loading import default_car


def race(track="oval", **settings):
    return fg.race(track, Straight(), time_limit=0.2, **settings)


def test_the_same_seed_places_the_same_boxes_and_the_result_says_which():
    first, again, other = (race(obstacles=5, obstacle_seed=seed) for seed in (3, 3, 4))
    expected = fg.load_track("oval").obstacle_sites(default_car()).place(5, 0.0, np.random.default_rng(3))
    assert first.world.obstacles == again.world.obstacles == expected != other.world.obstacles
    assert first.trajectory_sha256 == again.trajectory_sha256
    assert (first.obstacles, first.obstacle_seed) == (5, 3)
    assert (first.summary()["obstacles"], first.summary()["obstacle_seed"]) == (5, 3)


def test_the_start_is_clear_of_them_wherever_it_is():
    track = fg.load_track("oval")
    for s in (0.0, 7.0, 20.0):
        result = race(obstacles=6, obstacle_seed=1, start=fg.Start(s=s))
        stations, _ = track.project([(box.x, box.y) for box in result.world.obstacles])
        assert ((stations - s) % track.length).min() >= CLEAR_AHEAD - 0.1
        assert not result.car.collisions_wall


@each(
    "settings",
    (
        {"obstacles": -1},
        {"obstacles": True},
        {"obstacles": 1000},
        {"obstacles": 2, "obstacle_seed": -1},
        {"obstacles": 2, "obstacle_seed": 0.5},
    ),
)
def test_what_cannot_be_placed_is_refused(settings):
    with pytest.raises(fg.SettingsError, match=r"obstacle.*accepted"):
        race(**settings)


def test_a_race_with_obstacles_is_replayed_bit_for_bit(tmp_path):
    fg.write_run(race(obstacles=5, obstacle_seed=2), tmp_path / "run", picture=False)
    assert fg.replay(tmp_path / "run").identical
    assert fg.read_run(tmp_path / "run").summary["obstacle_seed"] == 2


# On the command line


@pytest.mark.slow
def test_race_drives_a_scene_and_leaves_a_whole_folder(capsys, tmp_path):
    assert main(["race", "--track", "scene:crossing_box:3", "--time-limit", "1", "--out", str(tmp_path / "run")]) == 1
    assert "0 of 1, time limit" in capsys.readouterr().out
    assert (tmp_path / "run" / "trace.png").stat().st_size > 10_000
    assert main(["replay", str(tmp_path / "run")]) == 0
    assert fg.read_run(tmp_path / "run").summary["track"] == "scene:crossing_box:3"


@each(
    ("arguments", "text"),
    (
        (["--track", "scene:nowhere"], "unknown scene 'scene:nowhere'; accepted: corridor_sparse,"),
        (["--track", "scene:nowhere"], ", as scene:NAME or scene:NAME:SEED"),
        (["--track", "scene:dead_end:x"], "accepted: scene:NAME:SEED"),
        (["--track", "scene:dead_end", "--laps", "3"], "accepted: 1"),
        (["--track", "scene:dead_end", "--obstacles", "3"], "accepted: on a track"),
        (["--obstacles", "-1"], "accepted: a whole number from 0"),
    ),
)
def test_what_a_scene_cannot_is_refused_in_one_line(arguments, text, capsys):
    assert main(["race", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == "" and text in err and err.count("\n") == 1
