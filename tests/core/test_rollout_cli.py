"""The command `rollout`: what it prints, writes and answers."""

import json
import os
import pty
import re
import signal
import subprocess
import sys
import time

import pytest

import fg_mujoco as fg
from fg_mujoco.cli.main import main
from fg_mujoco.errors import EngineError, install_command
from fg_mujoco.rollouts.intervals import wilson
from refusals import refused
from rollout_worlds import stand_in
from terminals import read_to_the_end

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


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def no_engine(monkeypatch):
    monkeypatch.setattr("fg_mujoco.rollouts.job.drive_worlds", stand_in)


def command(*arguments):
    return [sys.executable, "-m", "fg_mujoco", "rollout", *arguments]


def refusal(here, capsys, *arguments):
    return refused(here, capsys, "rollout", *arguments)


def test_worlds_are_driven_and_told_of_in_a_table_and_a_folder(here):
    arguments = ["--track", "oval", "--n", "6", "--randomize", "mu=0.6:1.2", "--time-limit", "0.5", "--out", "runs/a"]
    done = subprocess.run(command(*arguments), capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""  # nothing but the results in a pipe
    for text in ("oval, gap_finder", "0.6:1.2", "6: 6 time limit", "world-seconds/s", "written to", "runs/a"):
        assert text in done.stdout
    result = fg.read_rollout("runs/a")
    assert result["sim_time_s"] == pytest.approx(0.5)
    assert (here / "runs/a/worlds.csv").exists()


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
    assert summary["first_lap_s"]["count"] == summary["best_lap_s"]["count"] == finished  # the others drove no lap
    assert summary["max_slide_m_s"]["count"] == 20
    assert summary["world_seconds_per_second"] > 0


def test_the_table_says_of_how_many_worlds_its_figures_are(no_engine, capsys):
    assert main(["rollout", "--n", "20", "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert main(["rollout", "--n", "20"]) == 0
    out = capsys.readouterr().out
    low, high = (f"{100.0 * end:.1f}" for end in summary["finished_interval"])
    assert f" %; 95 % interval: {low} to {high} %\n" in out
    assert re.search(rf"first lap +median [0-9.]+ s; 5 to 95 %: .*; {summary['finished_count']} of 20 worlds\n", out)
    assert re.search(r"greatest sliding .*; 20 of 20 worlds\n", out)


def test_the_default_is_a_lap_of_the_oval_in_1024_worlds(no_engine, capsys):
    assert main(["rollout", "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["n"], summary["laps"], summary["tracks"][0]["name"]) == (1024, 1, "oval")


def test_a_finished_folder_is_told_of_again(no_engine, capsys):
    assert main(["rollout", "--n", "4", "--out", "out"]) == 0
    first = capsys.readouterr().out
    assert main(["rollout", "--n", "4", "--out", "out"]) == 0
    again = capsys.readouterr().out
    assert "4 worlds of an earlier call" in again
    laps = [line for line in first.splitlines() if "lap" in line]
    assert [line for line in again.splitlines() if "lap" in line] == laps


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--n", "0"), "n is 0; accepted: a whole number from 1"),
        (("--n", "many"), "'many'; accepted: a whole number"),
        (("--laps", "1.5"), "'1.5'; accepted: a whole number"),
        (("--time-limit", "-1"), "--time-limit is -1.0; accepted: a positive number"),
        (("--time-limit", "nan"), "--time-limit is nan"),
        (("--seed", "-1"), "seed is -1"),
        (("--workers", "0"), "workers is 0"),
        (("--chunk", "0"), "chunk is 0"),
        (("--memory-budget", "-1"), "--memory-budget is -1"),
        (("--memory-budget", "lots"), "'lots'; accepted: a whole number"),
        (("--executor", "slurm"), "--executor is 'slurm'; accepted: threads, processes, ray"),
        (("--record", "video", "--out", "run"), "record is 'video'; accepted: summary, telemetry, states"),
        (("--record", "states"), "--record states is kept nowhere; accepted: with --out DIR"),
        (("--track", "nowhere"), "unknown track 'nowhere'"),
        (("--controller", "nobody"), "'nobody' is not known; accepted: disparity_extender"),
        (("--randomize", "mu"), "--randomize 'mu'; accepted: NAME=RANGE, as mu=0.6:1.2"),
        (("--randomize", "mu=1", "--randomize", "mu=2"), "accepted: mu once"),
        (("--randomize", "mu="), "randomize mu: ''"),
        (("--randomize", "mu=1:2:3"), "randomize mu: '1:2:3'"),
        (("--randomize", "grip=1:2"), "no parameter; accepted: mu, mass"),
        (("--randomize", "planner.gain=1:2"), "gain"),
        (("--randomize", "obstacles=500"), "accepted: at most"),
        (("--tracks", "oval"), "did you mean '--track'"),
    ],
)
def test_a_bad_option_is_refused_with_what_is_accepted(here, capsys, arguments, said):
    line = refusal(here, capsys, *arguments)
    assert said in line
    assert "accepted" in line or "--help" in line


def test_a_folder_of_another_rollout_is_refused(no_engine, here, capsys):
    main(["rollout", "--n", "4", "--out", "out"])
    capsys.readouterr()
    assert "n is 4 there and 5 here" in refusal(here, capsys, "--n", "5", "--out", "out")


def test_without_ray_the_command_that_installs_it_is_said(no_engine, here, capsys, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert install_command("cluster") in refusal(here, capsys, "--executor", "ray")


def test_a_cluster_that_fails_exits_1(no_engine, capsys, monkeypatch):
    def lost(*arguments, **options):
        raise EngineError("a chunk was lost\nfor good")
        yield

    monkeypatch.setattr("fg_mujoco.rollouts.rollouts.require_ray", lambda: None)
    monkeypatch.setattr("fg_mujoco.rollouts.rollouts.drive_on_ray", lost)
    assert main(["rollout", "--executor", "ray"]) == 1
    assert capsys.readouterr() == ("", "fg-mujoco: a chunk was lost for good\n")


def test_ctrl_c_exits_130_and_the_same_command_goes_on(here):
    (here / "slow.py").write_text(SLOW)
    arguments = ["--controller", "slow.py:Planner", "--n", "36", "--time-limit", "1", "--chunk", "1", "--out", "out"]
    process = subprocess.Popen(command(*arguments), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
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
    assert 0 < found < 36
    done = subprocess.run(command(*arguments, "--json"), capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["worlds_driven"] == 36 - found


def test_progress_is_shown_on_a_terminal_and_what_planners_print_is_not_our_output(here):
    (here / "slow.py").write_text(SLOW)
    arguments = ["--controller", "slow.py:Planner", "--n", "8", "--time-limit", "0.5", "--chunk", "1"]
    ours, theirs = pty.openpty()
    process = subprocess.Popen(command(*arguments), stdout=subprocess.PIPE, stderr=theirs, text=True)
    os.close(theirs)
    shown = read_to_the_end(ours)
    out = process.communicate(timeout=60)[0]
    assert process.returncode == 0
    assert "ready" not in out
    assert "8: 8 time limit" in out
    assert b"/8 worlds  " in shown
    assert b" world-seconds/s" in shown
    assert b" to go" in shown
