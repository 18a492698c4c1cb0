"""The files that a planner reads besides its code are part of what a result depends on: weights, lines, parameters."""

import json
import os
import shutil

import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.cli.main import main
from fg_mujoco.errors import ControllerError, RunFolderError
from fg_mujoco.racing.planners import ControllerChoice, make_controller
from fg_mujoco.racing.trust import MOST_FILES, changed_file, planner_files
from refusals import refused
from rollout_worlds import stand_in

PLANNER = """
from dataclasses import dataclass
from pathlib import Path
from typing import Literal
from fg_mujoco.messages import DriveCommand
@dataclass(frozen=True, kw_only=True)
class Settings:
    weights: str = "policy"
    mode: Literal["fast", "slow"] = "fast"
class Learned:
    Settings = Settings
    def __init__(self, settings):
        place = Path(settings.weights)
        found = place / "speed" if place.is_dir() else place if place.is_file() else place.with_suffix(".txt")
        self.speed = float(found.read_text())
    def reset(self):
        pass
    def __call__(self, scan, odometry):
        return DriveCommand(steering_angle=0.0, speed=self.speed)
class Told(Learned):
    files = None
    def __init__(self, settings):
        super().__init__(settings)
        self.files = [Path("line.csv"), Path("policy").with_suffix(".txt")]
"""
SHORT = {"track": ["oval"], "laps": 1, "time_limit": 0.3, "workers": 1}


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(PLANNER)
    (tmp_path / "policy.txt").write_text("1.0")
    return tmp_path


def read_by(text):
    """Return the files that a planner reads, by their paths."""
    choice = ControllerChoice.of(text)
    planner = make_controller(
        choice.source, car=fg.Vehicle.load().parameters, mu=1.0, max_speed=8.0, settings=dict(choice.settings),
        map_line=fg.load_track("oval").map_line,
    )  # fmt: skip
    return planner_files(planner, dict(choice.settings))


def line(path, step):
    """Write every so many points of the oval's centreline."""
    rows = [f"{x:.4f}, {y:.4f}, 1, 1\n" for x, y in fg.load_track("oval").centreline[::step].tolist()]
    path.write_text("".join(rows))


# which files count


def test_a_file_that_a_setting_names_counts_with_and_without_its_ending(here):
    assert list(read_by("mine.py:Learned")) == ["policy.txt"]  # the default of the setting names it
    assert list(read_by("mine.py:Learned[weights=policy.txt]")) == ["policy.txt"]
    (here / "policy.png").write_text("a picture beside it")
    assert list(read_by("mine.py:Learned")) == ["policy.png", "policy.txt"]  # which it reads is not known
    assert list(read_by("mine.py:Told")) == ["line.csv", "policy.txt"]  # and here it is said


def test_a_folder_that_a_setting_names_counts_with_all_that_is_in_it(here):
    (here / "net" / "deep").mkdir(parents=True)
    (here / "net" / "speed").write_text("2.0")
    before = read_by("mine.py:Learned[weights=net]")
    assert list(before) == ["net"]
    (here / "net" / "deep" / "layer").write_text("0")
    after = read_by("mine.py:Learned[weights=net]")
    assert before["net"] != after["net"]
    (here / "net" / "deep" / "layer").rename(here / "net" / "layer")
    assert read_by("mine.py:Learned[weights=net]") not in (before, after)


def test_a_file_beside_the_planner_counts(here):
    (here / "sub").mkdir()
    shutil.move("mine.py", "sub/mine.py")
    (here / "sub" / "other.txt").write_text("3.0")
    (here / "other.txt").write_text("3.0")
    assert list(read_by("sub/mine.py:Learned[weights=other]")) == ["other.txt", "sub/other.txt"]


def test_it_is_the_contents_that_count_and_not_the_time(here):
    before = read_by("mine.py:Learned")
    os.utime("policy.txt", (1.0, 1.0))
    assert read_by("mine.py:Learned") == before and changed_file(before) is None
    (here / "policy.txt").write_text("1.5")
    os.utime("policy.txt", (1.0, 1.0))
    assert read_by("mine.py:Learned") != before
    assert changed_file(before).startswith("policy.txt, which it read, has sha256 ")


@each(
    ("files", "paths"),
    [("'a.csv'", ["a.csv"]), ("('a.csv', b'b.csv')", ["a.csv", "b.csv"]), ("lambda: ['a.csv']", ["a.csv"]), ("()", [])],
)
def test_files_are_a_list_one_path_or_a_method(here, files, paths):
    (here / "mine.py").write_text(PLANNER + f"        self.files = {files}\n")
    (here / "policy.txt").rename(here / "weights")
    assert list(read_by("mine.py:Told[weights=weights]")) == [*paths, "weights"]  # a file that is named counts always


def test_a_folder_of_too_many_files_is_refused_with_what_to_do(here, monkeypatch):
    monkeypatch.setattr("fg_mujoco.racing.trust.MOST_FILES", 2)
    (here / "net").mkdir()
    for name in ("speed", "a", "b"):
        (here / "net" / name).write_text("1.0")
    assert MOST_FILES == 10_000
    with pytest.raises(ControllerError, match=r"net: has more than 2 files; accepted: .*`files`"):
        read_by("mine.py:Learned[weights=net]")


def test_the_current_folder_is_a_place_to_look_in_and_no_data(here):
    (here / "speed").write_text("1.0")
    for around in (".", str(here), str(here.parent)):
        (here.parent / "speed").write_text("1.0")
        assert read_by(f"mine.py:Learned[weights={around}]") == {}


# the studies


def compare(**options):
    return fg.compare(["mine.py:Learned"], out="out", **(SHORT | options))


@each("change", ["weights", "time"])
def test_a_comparison_drives_a_planner_with_other_weights_again(here, change):
    first = compare()
    assert compare().runs_driven == 0
    (here / "policy.txt").write_text("3.0" if change == "weights" else "1.0")
    again = compare()
    assert again.runs_driven == (change == "weights")
    faster = again.rows[0].car.mean_speed_m_s > 1.1 * first.rows[0].car.mean_speed_m_s
    assert faster == (change == "weights")


def test_a_rollout_with_other_weights_is_another_one(here, monkeypatch):
    monkeypatch.setattr("fg_mujoco.rollouts.job.drive_worlds", stand_in)

    def rollout(**options):
        return fg.rollout("oval", "mine.py:Learned", n=4, laps=1, workers=1, **options)

    rollout(out="out")
    assert rollout(out="out").worlds_driven == 0
    settings = json.loads((here / "out" / "manifest.json").read_text())["settings"]
    assert list(settings["controller_files"]) == ["policy.txt"]
    (here / "policy.txt").write_text("3.0")
    with pytest.raises(RunFolderError, match=r"controller_files is .*policy.txt.* there and .*; accepted: the same"):
        rollout(out="out")
    (here / "fast.txt").write_text("4.0")
    rollout(out="drawn", randomize={"planner.weights": ["policy", "fast"]})
    (here / "fast.txt").write_text("5.0")
    with pytest.raises(RunFolderError, match="controller_files"):
        rollout(out="drawn", randomize={"planner.weights": ["policy", "fast"]})


# run folders


def race(*words):
    return main(["race", "--laps", "1", "--time-limit", "0.2", "--json", *words])


def test_a_run_folder_has_the_hashes_and_a_race_again_says_which_file_is_another(here, capsys, without_pictures):
    assert race("--controller", "mine.py:Learned", "--out", "run") == 1  # the time limit ends it
    summary = json.loads((here / "run" / "summary.json").read_text())
    files = summary["controller_origin"]["files"]
    assert list(files) == ["policy.txt"]
    assert race("--config", "run", "--trust") == 1
    capsys.readouterr()
    (here / "policy.txt").write_text("3.0")
    said = refused(here, capsys, "race", "--config", "run", "--trust")
    assert f"policy.txt, which it read, has sha256 {read_by('mine.py:Learned')['policy.txt'][:12]}" in said
    assert f"recorded is {files['policy.txt'][:12]}; accepted with --trust: the file as it was raced" in said
    assert "policy.txt, which it read, has sha256" in " ".join(fg.debug("run", trust=True).notes)
    (here / "policy.txt").unlink()
    assert "policy.txt, which it read, is not there" in refused(here, capsys, "race", "--config", "run", "--trust")


def test_a_summary_whose_files_are_none_is_refused(here, without_pictures):
    race("--controller", "mine.py:Learned", "--out", "run")
    path = here / "run" / "summary.json"
    summary = json.loads(path.read_text())
    summary["controller_origin"]["files"] = {"policy.txt": 7}
    path.write_text(json.dumps(summary))
    with pytest.raises(RunFolderError, match=r"controller_origin is .*accepted: texts by name"):
        fg.read_run("run")


# nodes of ROS


NODE = """
import os
import numpy as np
import rclpy
from rclpy.node import Node
from ackermann_msgs.msg import AckermannDriveStamped
class Mine(Node):
    def __init__(self):
        super().__init__("mine")
        self.declare_parameter("gain", 1.0)
        self.publisher = self.create_publisher(AckermannDriveStamped, "/drive", 10)
        folder = os.path.join("maps")
        {read}
"""


@each(
    ("read", "files"),
    [
        ("pass", []),
        ("np.loadtxt('maps/line.csv', delimiter=',')", ["maps/line.csv"]),
        ("np.loadtxt(os.path.join(folder, 'line.csv'), delimiter=',')", ["maps/line.csv"]),
        ("open(folder + '/line.csv').read()", ["maps/line.csv"]),
        ("self.later = 'maps/line.csv'", ["maps/line.csv"]),  # it may be read in a callback
        ("open('maps/line.csv', 'a').close()", []),
    ],
)
def test_the_files_of_data_that_a_node_reads_count(here, read, files):
    pytest.importorskip("rosbags")
    (here / "maps").mkdir()
    line(here / "maps" / "line.csv", 5)
    (here / "node.py").write_text(NODE.format(read=read))
    before = read_by("ros:node.py:Mine")
    assert list(before) == files
    line(here / "maps" / "line.csv", 6)
    assert (read_by("ros:node.py:Mine") == before) == (not files)
