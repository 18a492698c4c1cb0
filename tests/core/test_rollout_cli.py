"""The command `rollout`: what it prints, writes and answers."""

import json
import signal
import subprocess
import sys
import time

import pytest

import fg_mujoco as fg
from fg_mujoco.cli.main import main
from fg_mujoco.rollouts.shares import wilson
from rollout_worlds import stand_in

pytestmark = pytest.mark.usefixtures("here")

SLOW = """
import time
from fg_mujoco.messages import DriveCommand
class Planner:
    def reset(self):
        print("ready")
    def __call__(self, scan, odometry):
        time.sleep(0.005)
        return DriveCommand(steering_angle=0.0, speed=0.1)
"""


@pytest.fixture
def no_engine(monkeypatch):
    monkeypatch.setattr("fg_mujoco.rollouts.job.drive_worlds", stand_in)


def test_the_command_is_the_function(no_engine, here, capsys):
    arguments = [
        "--track", "oval", "--track", "tight", "--n", "9", "--seed", "4", "--laps", "2", "--time-limit", "30",
        "--randomize", "mu=0.6:1.2", "--randomize", "max_speed=6|8", "--chunk", "2", "--workers", "1",
        "--memory-budget", "1", "--record", "states", "--out", "out",
    ]  # fmt: skip
    assert main(["rollout", *arguments]) == 0
    expected = fg.rollout(
        ["oval", "tight"], n=9, seed=4, laps=2, time_limit=30.0, randomize={"mu": (0.6, 1.2), "max_speed": [6, 8]},
        record="states",
    )  # fmt: skip
    read = fg.read_rollout("out")
    assert read.worlds.tobytes() == expected.worlds.tobytes()
    assert read.settings == expected.settings
    assert read.states(5).tobytes() == expected.states(5).tobytes()
    assert capsys.readouterr().err == ""


def test_json_is_one_object_without_nan(no_engine, here, capsys):
    assert main(["rollout", "--n", "20", "--json", "--time-limit", "3"]) == 0

    def refuse(constant):
        raise AssertionError(constant)

    summary = json.loads(capsys.readouterr().out, parse_constant=refuse)
    assert summary["n"] == 20
    assert sum(summary["end_reasons"].values()) == 20
    assert summary["end_reasons"]["crash"] > 0  # and yet it exits 0: all worlds were driven
    finished = summary["end_reasons"]["finished"]
    assert (summary["finished_count"], summary["finished_interval"]) == (finished, list(wilson(finished, 20)))
    (laps,) = summary["lap_times"]
    assert laps["first_lap_s"]["count"] == laps["best_lap_s"]["count"] == finished  # the others drove no lap
    assert summary["max_slide_m_s"]["count"] == 20
    assert summary["world_seconds_per_second"] > 0


def test_lap_times_are_told_for_each_track_and_names_keep_apart_from_values(no_engine, here, capsys):
    """A median over tracks of other lengths says nothing."""
    drawn = ["--controller", "follow_the_gap", "--randomize", "planner.bubble_radius=0.2:0.8"]
    assert main(["rollout", "--track", "oval", "--track", "tight", "--n", "40", *drawn]) == 0
    lines = capsys.readouterr().out.splitlines()
    for track in ("oval", "tight"):
        (told,) = [line for line in lines if line.strip().startswith(f"first lap, {track}")]
        assert f"median {fg.load_track(track).length / 8.0:.3f} s" in told and "of 20 worlds" in told
    assert "  planner.bubble_radius 0.2:0.8" in lines


def test_ctrl_c_exits_130_and_the_same_command_goes_on(here, capfd):
    (here / "slow.py").write_text(SLOW)
    arguments = ["--controller", "slow.py:Planner", "--n", "12", "--time-limit", "1", "--chunk", "1", "--out", "out"]
    command = [sys.executable, "-m", "fg_mujoco", "rollout", *arguments]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    until = time.monotonic() + 60
    while not list(here.glob("out/chunks/*.npz")) and time.monotonic() < until:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert out == ""
    assert "out: interrupted; the same command goes on" in err
    assert "Traceback" not in err
    found = len(list(here.glob("out/chunks/*.npz")))
    assert 0 < found < 12
    assert main(["rollout", *arguments, "--json"]) == 0
    assert json.loads(capfd.readouterr().out)["worlds_driven"] == 12 - found
