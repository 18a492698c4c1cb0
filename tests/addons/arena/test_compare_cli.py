"""The command `compare`: what it prints, writes and answers."""

import importlib.util
import json
import os
import pty
import signal
import subprocess
import sys
import time

import pytest

import fg_mujoco as fg
from comparison_worlds import PLANNERS, files
from fg_mujoco.cli.main import main
from fg_mujoco.course.scenes.catalogue import scene_names
from fg_mujoco.errors import install_command
from refusals import refused
from terminals import read_to_the_end

SHORT = ["--track", "oval", "--laps", "1", "--time-limit", "0.6", "--workers", "1", "--out", "out"]


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "planners.py").write_text(PLANNERS)
    return tmp_path


def command(*arguments):
    return [sys.executable, "-m", "fg_mujoco", "compare", *arguments]


def refusal(here, capsys, *arguments):
    return refused(here, capsys, "compare", *arguments)


def test_the_command_is_the_function(here, capsys):
    arguments = [
        "--controller", "planners.py:Gentle[speed=2,steering=0.1],planners.py:Broken", "--track", "oval,l_corridor",
        "--seed", "1:3", "--max-speed", "4", "--obstacles", "1", "--lidar-noise", "0.01", "--laps", "1",
        "--mu", "0.9", "--planner-mu", "off", "--time-limit", "0.3", "--workers", "1", "--out", "out",
    ]  # fmt: skip
    assert main(["compare", *arguments]) == 0
    out, err = capsys.readouterr()
    expected = fg.compare(
        ["planners.py:Gentle[speed=2,steering=0.1]", "planners.py:Broken"], track=["oval", "l_corridor"],
        seed=[1, 2], max_speed=[4.0], obstacles=1, lidar_noise=0.01, laps=1, mu=0.9, planner_mu=float("inf"),
        time_limit=0.3, workers=1, out="mine",
    )  # fmt: skip
    assert files(here / "out") == files(here / "mine")
    assert out == f"{expected.markdown()}\n8 runs; written to out\nmu 0.9; the planner has no limit\n"
    assert "\x1b" not in err  # what planners print is there, and no progress


def test_json_is_one_object_and_finished_runs_are_not_driven_again(capsys):
    assert main(["compare", "--controller", "planners.py:Gentle", *SHORT, "--json"]) == 0
    first = json.loads(capsys.readouterr().out)
    assert (first["runs"], first["runs_driven"]) == (1, 1)
    assert first["table"][0]["controller"] == "planners.py:Gentle"
    assert main(["compare", "--controller", "planners.py:Gentle", *SHORT]) == 0
    assert "1 runs, 1 of them by an earlier call; written to out" in capsys.readouterr().out


def test_by_default_all_controllers_meet_all_scenes(monkeypatch, capsys):
    asked = []

    def stand_in(*arguments, **options):
        asked.append((arguments, options))
        raise KeyboardInterrupt

    monkeypatch.setattr("fg_mujoco.addons.arena.commands_compare.compare", stand_in)
    assert main(["compare", "--out", "out"]) == 130
    assert main(["compare", "--out", "out", "--track", "oval"]) == 130
    assert [arguments for arguments, _ in asked] == [(fg.controller_names(),)] * 2
    assert [list(options["track"]) for _, options in asked] == [[f"scene:{name}" for name in scene_names()], ["oval"]]
    assert list(asked[0][1]["seed"]) == list(range(10))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--out", "out", "--controller", "nobody"), "'nobody' is not known"),
        (("--out", "out", "--controller", "gap_finder,"), "accepted: names"),
        (("--out", "out", "--controller", "gap_finder[lookahead]"), "accepted: SETTING=VALUE"),
        (("--out", "out", "--track", "nowhere"), "unknown track 'nowhere'"),
        (("--out", "out", "--track", "scene:nowhere"), "unknown scene"),
        (("--out", "out", "--seed", "1:x"), "accepted: FIRST:END"),
        (("--out", "out", "--seed", "5:5"), "no seed is given"),
        (("--out", "out", "--max-speed", "4,fast"), "accepted: a number"),
        (("--out", "out", "--track", "oval", "--obstacles", "500"), "accepted: at most"),
        (("--track", "oval"), "--out"),
    ],
)
def test_a_bad_option_is_refused_with_what_is_accepted(here, capsys, arguments, said):
    assert said in refusal(here, capsys, *arguments)


def test_a_folder_of_another_comparison_is_refused(here, capsys):
    arguments = ["--controller", "planners.py:Gentle", *SHORT]
    assert main(["compare", *arguments]) == 0
    capsys.readouterr()
    assert "laps is 1 there and 2 here" in refusal(here, capsys, *arguments, "--laps", "2")


def test_without_matplotlib_the_tables_are_written_and_the_install_command_is_said(here, capsys, monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "matplotlib" else find(name))
    assert main(["compare", "--controller", "planners.py:Gentle", *SHORT]) == 0
    assert install_command("plot") in capsys.readouterr().err
    assert (here / "out/table.md").exists()
    assert not (here / "out/table.png").exists()


def test_a_worker_that_dies_exits_1(capsys):
    arguments = ["--controller", "planners.py:Deadly", *SHORT, "--max-speed", "4,6", "--workers", "2"]
    assert main(["compare", *arguments]) == 1
    out, err = capsys.readouterr()
    assert out.count("1 worker died") == 2
    assert "fg-mujoco: warning: planners.py:Deadly on oval: the worker ended by SIGKILL" in err.splitlines()


def test_ctrl_c_exits_130_and_the_same_command_goes_on(here):
    arguments = ["--controller", "planners.py:Slow", "--track", "oval", "--obstacles", "1", "--seed", "0:20"]
    arguments += ["--laps", "1", "--time-limit", "2", "--workers", "2", "--out", "out"]
    process = subprocess.Popen(
        command(*arguments), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    until = time.monotonic() + 100
    while not list(here.glob("out/runs.jsonl")) and time.monotonic() < until:
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: the workers get it too
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert out == ""
    assert err == "fg-mujoco: out: interrupted; the same command goes on\n"
    found = len((here / "out/runs.jsonl").read_text().splitlines())
    assert 0 <= found < 20  # the line may just be on its way
    assert main(["compare", *arguments, "--json", "--seed", f"0:{found + 1}"]) == 0


def test_progress_is_shown_on_a_terminal(here):
    ours, theirs = pty.openpty()
    arguments = ["--controller", "planners.py:Slow", *SHORT, "--max-speed", "4,5,6"]
    process = subprocess.Popen(command(*arguments), stdout=subprocess.PIPE, stderr=theirs, text=True)
    os.close(theirs)
    shown = read_to_the_end(ours)
    out = process.communicate(timeout=100)[0]
    assert process.returncode == 0
    assert out.startswith("| controller ")
    assert b"/3 runs" in shown
    assert b" to go" in shown
