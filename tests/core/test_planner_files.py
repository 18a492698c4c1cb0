"""The files that a planner reads besides its code are part of what a result depends on: weights, lines, parameters."""

import json
import os
import shutil

import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.cli.main import main
from fg_mujoco.errors import ControllerError, RunFolderError
from fg_mujoco.racing.planner_origin import changed_file, planner_files
from fg_mujoco.racing.planners import ControllerChoice, make_controller
from rollout_worlds import stand_in

PLANNER = """
from dataclasses import dataclass
from pathlib import Path
from typing import Literal
from fg_mujoco.messages import DriveCommand
@dataclass(frozen=True, kw_only=True)
class Settings:
    weights: str = "policy.txt"
    mode: Literal["fast", "slow"] = "fast"
class Learned:
    Settings = Settings
    def __init__(self, settings):
        self.speed = float(Path(settings.weights).read_text())
    def reset(self):
        pass
    def __call__(self, scan, odometry):
        return DriveCommand(steering_angle=0.0, speed=self.speed)
class Told(Learned):
    files = None
    def __init__(self, settings):
        super().__init__(settings)
        self.files = [Path("line.csv")]
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


def test_a_file_that_a_setting_names_counts_and_those_that_the_planner_lists(here):
    assert list(read_by("mine.py:Learned")) == ["policy.txt"]  # the default of the setting names it
    (here / "other.txt").write_text("3.0")
    assert list(read_by("mine.py:Learned[weights=other.txt]")) == ["other.txt"]
    assert list(read_by("mine.py:Told")) == ["line.csv", "policy.txt"]


def test_a_file_beside_the_planner_counts(here):
    (here / "sub").mkdir()
    shutil.move("mine.py", "sub/mine.py")
    for folder in (here, here / "sub"):
        (folder / "other.txt").write_text("3.0")
    assert list(read_by("sub/mine.py:Learned[weights=other.txt]")) == ["other.txt", "sub/other.txt"]


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
    assert list(read_by("mine.py:Told")) == [*paths, "policy.txt"]  # a file that is named counts always


def test_a_folder_in_that_list_is_refused(here):
    (here / "mine.py").write_text(PLANNER + "        self.files = '.'\n")
    with pytest.raises(ControllerError, match=r"\.: is a folder; accepted: its files, one by one"):
        read_by("mine.py:Told")


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
    rollout(out="drawn", randomize={"planner.weights": ["policy.txt", "fast.txt"]})
    (here / "fast.txt").write_text("5.0")
    with pytest.raises(RunFolderError, match="controller_files"):
        rollout(out="drawn", randomize={"planner.weights": ["policy.txt", "fast.txt"]})


# run folders


def race(*words):
    return main(["race", "--laps", "1", "--time-limit", "0.2", "--json", *words])


def test_a_run_folder_has_the_hashes(here, without_pictures):
    assert race("--controller", "mine.py:Learned", "--out", "run") == 1  # the time limit ends it
    summary = json.loads((here / "run" / "summary.json").read_text())
    assert summary["controller_origin"]["files"] == read_by("mine.py:Learned")


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
