"""`--out`: a run is not written over, unless `--force` says so; `runs/` numbers itself; nothing else is removed."""

import argparse
import os
import shutil

import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.cli.main import main
from fg_mujoco.cli.out import RUN, STUDY, chosen_folder
from fg_mujoco.errors import RunFolderError
from fg_mujoco.racing.run_folder import read_summary

RACE = ("race", "--time-limit", "0.2")
PLANNER = """
from fg_mujoco.messages import DriveCommand
def P(scan, odometry):
    return DriveCommand(steering_angle=0.0, speed=1.0)
"""


@pytest.fixture(scope="module")
def raced(tmp_path_factory):
    """A run folder of a planner of one's own, which is in a file beside it."""
    folder = tmp_path_factory.mktemp("raced")
    (folder / "mine.py").write_text(PLANNER)
    result = fg.race("oval", f"{folder / 'mine.py'}:P", time_limit=0.2)
    fg.write_run(result, folder / "run", picture=False)
    return folder / "run"


@pytest.fixture
def run(raced, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(raced, tmp_path / "runs/first")
    return tmp_path / "runs/first"


WALKS = """
import os
from fg_mujoco.messages import DriveCommand
os.chdir("walked")
READ = open("weights").read()
class P:
    def __init__(self):
        os.chdir(os.path.abspath(os.sep + "tmp"))
    def __call__(self, scan, odometry):
        os.chdir("/")
        return DriveCommand(steering_angle=0.0, speed=1.0)
    def reset(self):
        pass
"""


@each(
    "command",
    [
        "race --time-limit 0.2 --out out",
        "rollout --n 2 --workers 1 --time-limit 0.2 --out out", "study lab.toml walks.py --workers 1 --out out",
        "debug runs/first --controller walks.py:P --out out.html",
    ],
)  # fmt: skip
def test_a_planner_that_changes_the_folder_moves_no_file_that_is_written(command, run, without_pictures):
    here = os.getcwd()
    os.makedirs("walked")
    with open("walks.py", "w") as file, open("lab.toml", "w") as lab, open("walked/weights", "w"):
        file.write(WALKS)
        lab.write("time_limit = 0.2\n[[checks]]\ncheck = 'no_crash'\n")
    before = sorted(os.listdir("/"))
    if "runs/first" in command:
        result = fg.race("oval", "walks.py:P", time_limit=0.2)
        fg.write_run(result, "runs/second", picture=False)
        command = command.replace("first", "second")
    named = "" if "runs" in command or "study" in command else " --controller walks.py:P"
    main((command + named).split())
    assert os.getcwd() == here and sum(name.startswith("out") for name in os.listdir()) == 1
    assert sorted(os.listdir("/")) == before and os.listdir("walked") == ["weights"]


def options(out, force=False):
    return argparse.Namespace(out=str(out), force=force)


def test_a_second_race_is_refused_with_both_ways_on(run, capsys):
    before = {path.name: path.read_bytes() for path in run.iterdir()}
    for given in ("runs/first", "runs/first/"):  # as a shell completes it
        assert main([*RACE, "--out", given]) == 2
        said = "runs/first: has a run; accepted: a new or empty folder, --force to replace it, or --out runs/, which"
        assert said in capsys.readouterr().err
    assert {path.name: path.read_bytes() for path in run.iterdir()} == before


def test_force_replaces_a_run(run, without_pictures, capsys):
    before = read_summary(run)["trajectory_sha256"]
    assert main([*RACE, "--out", "runs/first", "--force"]) in (0, 1)
    assert read_summary(run)["trajectory_sha256"] != before
    assert [path.name for path in run.parent.iterdir()] == ["first"]


@each("given", ["runs/", "runs"])
def test_a_folder_of_runs_numbers_itself(run, without_pictures, capsys, given):
    for number in ("001", "002"):
        assert main([*RACE, "--out", given]) in (0, 1)
        out, err = capsys.readouterr()
        assert f"fg-mujoco: --out is runs/{number}\n" in err and f"runs/{number}\n" in out
        read_summary(run.parent / number)


def test_two_processes_that_number_at_once_get_two_folders(tmp_path):
    first, second = options(f"{tmp_path}/"), options(f"{tmp_path}/")
    with chosen_folder(first, RUN), chosen_folder(second, RUN):
        assert {first.out, second.out} == {str(tmp_path / "001"), str(tmp_path / "002")}


def test_force_puts_the_old_run_back_where_the_new_one_fails(run):
    before = {path.name: path.read_bytes() for path in run.iterdir()}
    with pytest.raises(ZeroDivisionError), chosen_folder(options(run, force=True), RUN):
        assert not run.exists()
        raise ZeroDivisionError
    assert {path.name: path.read_bytes() for path in run.iterdir()} == before
    assert [path.name for path in run.parent.iterdir()] == ["first"]


@each("name", ["notes.txt", "report.html"])  # the second is a link
def test_force_removes_no_folder_with_files_of_others(run, name):
    said = f"has {name}, which is not of a run"
    (run / name).symlink_to(run.parent) if name == "report.html" else (run / name).write_text("mine")
    with pytest.raises(RunFolderError, match=said), chosen_folder(options(run, force=True), RUN):
        raise AssertionError
    assert (run / name).exists() and (run / "summary.json").exists()


def test_a_study_is_gone_on_with_and_another_one_is_refused_with_both_ways_on(tmp_path):
    (tmp_path / "study").mkdir()
    (tmp_path / "study" / "manifest.json").write_text('{"schema": 1}')
    given = options(tmp_path / "study")
    with chosen_folder(given, STUDY):
        assert given.out == str(tmp_path / "study")
    with (
        pytest.raises(RunFolderError, match=r"study: holds another; accepted: the same, --force to .*, or --out .*/, "),
        chosen_folder(given, STUDY),
    ):
        raise RunFolderError(f"{given.out}: holds another; accepted: the same")
    with chosen_folder(options(given.out, force=True), STUDY):
        os.mkdir(given.out)
        (tmp_path / "study" / "lab.json").write_text("new")
    assert os.listdir(given.out) == ["lab.json"] and os.listdir(tmp_path) == ["study"]
    said = "has a study; accepted: a new or empty folder, or --out"
    with pytest.raises(RunFolderError, match=said), chosen_folder(given, RUN):
        raise AssertionError
