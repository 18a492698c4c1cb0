"""Kills at any time, two processes at once, a full disk, no HOME: the same command ends well, and nothing is left."""

import json
import os
import resource
import shlex
import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "kills.py"
RACE = "race --time-limit 0.5 --out runs/a"


def test_a_killed_command_ends_as_one_that_was_not_when_it_is_run_again(tmp_path):
    """A folder that is filled in steps; benchmarks/kills.py kills all commands, often."""
    commands = ("rollout",)
    arguments = ["1", "--commands", ",".join(commands), "--seed", "1", "--json", "figures.json"]
    done = subprocess.run([sys.executable, SCRIPT, *arguments], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    figures = json.loads((tmp_path / "figures.json").read_text())
    assert [figures[name]["kills"] for name in commands] == [1]


def command(arguments, folder, **options):
    return subprocess.run(
        [sys.executable, "-m", "fg_mujoco", *shlex.split(arguments)], cwd=folder, capture_output=True, text=True,
        **options,
    )  # fmt: skip


def test_a_disk_that_fills_up_leaves_nothing(tmp_path):
    """A limit on the size of files stands for the disk."""

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (5_000, 5_000))

    done = command(RACE, tmp_path, preexec_fn=limit)
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith("fg-mujoco: runs/a: cannot be written: File too large; accepted: ")
    assert "time limit" in done.stdout  # what was driven is told
    assert list(tmp_path.iterdir()) == []


def test_without_a_home_a_race_is_written(tmp_path):
    environment = {name: value for name, value in os.environ.items() if name != "HOME"}
    assert command(RACE, tmp_path, env=environment).returncode == 1  # the time limit ends it
    assert (tmp_path / "runs" / "a" / "summary.json").exists()
