"""The command `compare`: what it prints, writes and answers."""

import importlib.util
import os
import signal
import subprocess
import sys
import time

import pytest

import fg_mujoco as fg
from comparison_worlds import PLANNERS, files
from fg_mujoco.cli.main import main
from fg_mujoco.errors import install_command

SHORT = ["--track", "oval", "--laps", "1", "--time-limit", "0.6", "--workers", "1", "--out", "out"]


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "planners.py").write_text(PLANNERS)
    return tmp_path


def command(*arguments):
    return [sys.executable, "-m", "fg_mujoco", "compare", *arguments]


def test_the_command_is_the_function(here, capsys):
    arguments = ["--controller", "planners.py:Gentle[speed=2,steering=0.1],planners.py:Broken", "--track",
        "oval,l_corridor", "--seed", "1:3", "--max-speed", "4", "--obstacles", "1", "--lidar-noise", "0.01", "--laps",
        "1", "--mu", "0.9", "--planner-mu", "off", "--time-limit", "0.3", "--workers", "1", "--out", "out"]  # fmt: skip
    assert main(["compare", *arguments]) == 0
    out, err = capsys.readouterr()
    expected = fg.compare(["planners.py:Gentle[speed=2,steering=0.1]", "planners.py:Broken"],
                          track=["oval", "l_corridor"], seed=[1, 2], max_speed=[4.0], obstacles=1, lidar_noise=0.01,
                          laps=1, mu=0.9, planner_mu=float("inf"), time_limit=0.3, workers=1, out="mine")  # fmt: skip
    assert files(here / "out") == files(here / "mine")
    assert out == f"{expected.markdown()}\n8 runs; written to out\nmu 0.9; the planner has no limit\n"
    assert "\x1b" not in err  # what planners print is there, and no progress


def test_without_matplotlib_the_tables_are_written_and_the_install_command_is_said(here, capsys, monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "matplotlib" else find(name))
    assert main(["compare", "--controller", "planners.py:Gentle", *SHORT]) == 0
    assert install_command("plot") in capsys.readouterr().err
    assert (here / "out/table.md").exists()
    assert not (here / "out/table.png").exists()


def test_ctrl_c_exits_130_and_the_same_command_goes_on(here):
    arguments = ["--controller", "planners.py:Slow", "--track", "oval", "--obstacles", "1", "--seed", "0:20"]
    arguments += ["--laps", "1", "--time-limit", "2", "--workers", "2", "--out", "out"]
    process = subprocess.Popen(command(*arguments), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                               start_new_session=True)  # fmt: skip
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
