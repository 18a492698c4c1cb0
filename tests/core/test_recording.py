import hashlib
import json
import math
import shutil

import mujoco
import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.racing.run_folder import check_run_folder
from fg_mujoco.racing.summary import summary_json

FILES = {"summary.json", "scene.xml", "states.npz", "telemetry.csv", "trace.png", "controller.py"}


@pytest.fixture(scope="module")
def written(short_race, tmp_path_factory):
    return fg.write_run(short_race, tmp_path_factory.mktemp("runs") / "short")


@pytest.fixture
def folder(written, tmp_path):
    """A copy to spoil."""
    return shutil.copytree(written, tmp_path / "run")


def edit_states(folder, change):
    """Edit a run whose summary does not say which files it had, as those of an older version."""
    edit_summary(folder, files={})
    with np.load(folder / "states.npz") as file:
        arrays = dict(file)
    change(arrays)
    np.savez_compressed(folder / "states.npz", **arrays)


def edit_summary(folder, **changes):
    summary = json.loads((folder / "summary.json").read_text())
    (folder / "summary.json").write_text(json.dumps(summary | changes))


@pytest.mark.slow
def test_run_folder_has_its_files_and_nothing_else(written):
    assert {file.name for file in written.iterdir()} == FILES
    assert {file.name for file in written.parent.iterdir()} == {"short"}


def test_summary_says_what_the_result_says_and_which_versions_made_it(written, short_race):
    summary = fg.read_run(written).summary
    expected = json.loads(json.dumps(short_race.summary()))  # tuples are lists there
    assert {name: summary[name] for name in expected} == expected
    assert summary["schema"] == 1
    assert summary["mujoco_version"] == mujoco.__version__
    assert summary["fg_mujoco_version"] == fg.__version__


def test_a_planner_of_ones_own_is_kept_with_the_hash_of_its_source(written, tmp_path):
    kept = (written / "controller.py").read_bytes()
    origin = fg.read_run(written).summary["controller_origin"]
    assert hashlib.sha256(kept).hexdigest() == origin["sha256"] and origin["distribution"] is None
    assert b"class Straight" in kept
    bundled = fg.race("oval", laps=1, time_limit=0.05)
    assert bundled.car.controller_origin["distribution"] == "fg-mujoco"
    assert bundled.car.controller_origin["version"] == fg.__version__
    fg.write_run(bundled, tmp_path / "bundled", picture=False)
    assert not (tmp_path / "bundled" / "controller.py").exists()


def test_what_is_no_number_is_null_in_json():
    class Result:
        setup = fg.Setup()

        def summary(self):
            return {"planner_mu": math.inf, "max_slide_m_s": math.nan, "lap_times_s": (1.0,)}

    def refuse(constant):
        raise AssertionError(constant)

    summary = json.loads(summary_json(Result()), parse_constant=refuse)
    assert summary["planner_mu"] is None
    assert summary["max_slide_m_s"] is None
    assert summary["lap_times_s"] == [1.0]


@each("tick", [0, 39])
def test_replay_finds_the_tick_of_a_changed_command(folder, tick):
    def change(arrays):
        arrays["ctrl"][tick, 1] += 1e-3

    edit_states(folder, change)
    report = fg.replay(folder)
    assert not report.identical
    assert report.first_difference == tick + 1
    assert report.time == pytest.approx(0.025 * (tick + 1))
    assert report.greatest_difference > 0.0
    assert f"from tick {tick + 1} of 40" in str(report)


def test_replay_finds_one_flipped_bit_in_one_state_and_names_the_versions_that_are_others(folder):
    def change(arrays):
        arrays["state"].view(np.uint64)[20, 5] ^= 1

    edit_states(folder, change)
    report = fg.replay(folder)
    assert report.first_difference == 20
    assert report.greatest_difference < 1e-12 and "versions" not in str(report)
    edit_summary(folder, mujoco_version="9.8.7")
    assert str(fg.replay(folder)).endswith(f"other versions: MuJoCo (recorded 9.8.7, here {mujoco.__version__})")


def test_a_folder_that_cannot_be_used_is_refused_before_and_left_alone(tmp_path):
    (tmp_path / "file").write_text("mine")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "summary.json").write_text("mine")
    for path, reason in [
        (tmp_path / "file", "is a file"),
        (tmp_path / "full", "is not empty"),
        (tmp_path / "file" / "run", "cannot be written"),
        (tmp_path / ("x" * 300), "cannot be written"),
    ]:
        with pytest.raises(fg.RunFolderError, match=reason):
            check_run_folder(path)
    assert (tmp_path / "full" / "summary.json").read_text() == "mine"
    assert {path.name for path in tmp_path.rglob("*")} == {"file", "full", "summary.json"}
