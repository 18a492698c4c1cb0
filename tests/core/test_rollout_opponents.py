"""Rollouts and comparisons with opponents: each world is its own, and is its race; what is told, and refused."""

import pytest

import fg_mujoco as fg
from comparison_worlds import PLANNERS, files
from fg_mujoco.errors import SettingsError
from fg_mujoco.racing.entries import Entry


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(PLANNERS)
    return tmp_path


# -- each world is its own


def test_the_whole_grid_moves_with_the_start_of_car_0():
    options = {"time_limit": 0.1, "opponents": ["gap_finder"]}
    placed = fg.rollout("oval", n=1, start=fg.Start(s=7.0, offset=0.2, speed=1.0), **options).setup(0).entries
    plain = fg.rollout("oval", n=1, **options).setup(0).entries
    assert [entry.start.s for entry in plain] == [0.0, -0.8]
    assert [entry.start.s for entry in placed] == [7.0, pytest.approx(6.2)]
    assert placed[0].start.offset == pytest.approx(plain[0].start.offset + 0.2)
    assert placed[1].start.offset == plain[1].start.offset
    assert [entry.start.speed for entry in placed] == [1.0, 0.0]


# -- folders


def test_other_opponents_are_another_rollout(tmp_path):
    options = {"n": 1, "time_limit": 0.1, "out": tmp_path / "out"}
    fg.rollout("oval", opponents=[Entry(max_speed=2.0)], **options)
    before = files(tmp_path)
    for changed in (
        {"opponents": ()}, {"opponents": [Entry(max_speed=3.0)]}, {"opponents": [Entry(max_speed=2.0, name="b")]},
        {"opponents": [Entry(max_speed=2.0)] * 2}, {"opponents": [Entry(max_speed=2.0)], "grid": "side_by_side"},
    ):  # fmt: skip
        with pytest.raises(fg.RunFolderError, match=r"holds another rollout: (opponents|grid) is"):
            fg.rollout("oval", **options | changed)
        assert files(tmp_path) == before


# -- what is refused


def test_a_world_in_which_a_box_stands_on_the_grid_is_named(here):
    with pytest.raises(SettingsError, match=r"^world \d+, seed \d+: 'car_\d+' does not fit on 'oval'"):
        fg.rollout("oval", n=8, time_limit=0.1, opponents=["gap_finder"] * 7, randomize={"obstacles": 9})
