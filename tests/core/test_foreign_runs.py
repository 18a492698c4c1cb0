"""Folders from others run no code: a planner that one names is loaded only if bundled, or unchanged and trusted."""

import hashlib
import json
import shutil

import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.cli.main import main
from fg_mujoco.errors import ControllerError
from fg_mujoco.pictures.rendering.planner_view import PlannerEye
from fg_mujoco.pictures.rendering.recorded_drive import read_drive
from fg_mujoco.racing.replay import replay
from fg_mujoco.racing.trust import require_trusted

PLANNER = """
from pathlib import Path
from fg_mujoco.messages import DriveCommand
Path({marker!r}).write_text("this file was imported")
class Slow:
    def reset(self):
        pass
    def __call__(self, scan, odometry):
        return DriveCommand(steering_angle=0.0, speed=1.0)
    def intermediate_scans(self, scan):
        return {{"gap": scan.ranges}}
"""


@pytest.fixture(scope="module")
def raced(tmp_path_factory):
    """A run folder of a user's own planner, as `race --out` writes it."""
    place = tmp_path_factory.mktemp("raced")
    (place / "slow.py").write_text(PLANNER.format(marker=str(place / "marker")), "utf-8")
    controller = f"{place / 'slow.py'}:Slow"
    result = fg.race("oval", controller, laps=1, time_limit=0.25)
    return fg.write_run(result, place / "run", picture=False)


@pytest.fixture
def foreign(raced, tmp_path, monkeypatch):
    """The same folder at another place, its planner beside it; whoever imports that leaves tmp_path / "marker"."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "run"
    shutil.copytree(raced, folder)
    planner = folder / "controller.py"
    planner.write_text(PLANNER.format(marker=str(tmp_path / "marker")), "utf-8")
    name_planner(folder, f"{planner}:Slow", hashlib.sha256(planner.read_bytes()).hexdigest())
    return folder


def name_planner(folder, source, sha256, **settings):
    """Write a planner into a summary, as whoever sends a folder can."""
    path = folder / "summary.json"
    summary = json.loads(path.read_text("utf-8"))
    summary["controller"] = source
    summary["controller_origin"] = {"distribution": None, "version": None, "file": None, "sha256": sha256}
    summary["settings"] = {**summary["settings"], "controller": source, **settings}
    path.write_text(json.dumps(summary), "utf-8")


def refusal(capsys, *arguments):
    """Return the one line with which the command line refuses."""
    assert main([*map(str, arguments)]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and "Traceback" not in err
    return err


def imported(foreign):
    return (foreign.parent / "marker").exists()


def test_a_run_is_raced_again_with_its_own_planner_only_if_trusted(foreign, capsys):
    err = refusal(capsys, "race", "--config", foreign, "--out", "again")
    assert "controller.py:Slow" in err and "summary.json" in err and "--trust" in err
    assert not imported(foreign) and not (foreign.parent / "again").exists()
    assert main(["race", "--config", str(foreign), "--trust", "--json"]) == 1  # the time limit ends it
    assert imported(foreign)
    summary = json.loads((foreign / "summary.json").read_text("utf-8"))
    assert json.loads(capsys.readouterr().out)["trajectory_sha256"] == summary["trajectory_sha256"]


def test_a_trusted_planner_is_the_recorded_one_and_no_other(foreign, capsys):
    with (foreign / "controller.py").open("a", encoding="utf-8") as file:
        file.write("# edited\n")
    err = refusal(capsys, "race", "--config", foreign, "--trust")
    assert "sha256" in err and "--trust" in err
    assert not imported(foreign)


def test_a_planner_without_a_recorded_hash_is_not_trusted(foreign, capsys):
    name_planner(foreign, f"{foreign / 'controller.py'}:Slow", None)
    assert "sha256" in refusal(capsys, "race", "--config", foreign, "--trust")
    assert not imported(foreign)


@each("options", [[], ["--controller", "gap_finder"], ["--trust"]])
@each("place", ["entries", "entries in one car's folder", "opponents"])
def test_no_planner_of_further_cars_is_loaded_that_the_rows_do_not_have(place, options, foreign, capsys):
    theirs = f"{foreign / 'controller.py'}:Slow"
    both = {"entries": [{"controller": "gap_finder"}, {"controller": theirs}]}
    name_planner(foreign, "gap_finder", None, **(both if "entries" in place else {"opponents": [theirs]}))
    path = foreign / "summary.json"
    summary = json.loads(path.read_text("utf-8"))
    if "entries" in place:
        del summary["settings"]["controller"]
    if place == "entries":
        summary["cars"] = None
    path.write_text(json.dumps(summary), "utf-8")
    assert "Slow" in refusal(capsys, "race", "--config", foreign, *options)
    assert not imported(foreign)


@each("door", ["replay", "debug", "race"])
def test_a_folder_reads_no_file_by_the_settings_of_a_planner_or_a_lidar(door, foreign, capsys):
    secret = foreign.parent / "secret.toml"
    secret.write_text("noise = 'hidden'\n")
    arguments = {"replay": ["replay", foreign], "debug": ["debug", foreign], "race": ["race", "--config", foreign]}
    path = foreign / "summary.json"
    summary = json.loads(path.read_text("utf-8"))
    if door == "replay":
        summary["lidar_effects"]["measured"] = str(secret)
    name = {"planner_settings": {"line": str(secret)}}
    summary |= {"controller": "pure_pursuit", "settings": summary["settings"] | {"controller": "pure_pursuit"} | name}
    path.write_text(json.dumps(summary | (name if door == "debug" else {})), "utf-8")
    accepted = "no file's name" if door == "replay" else "the files that are recorded with their SHA-256"
    if door == "debug":
        main([*map(str, arguments[door])])
        said = capsys.readouterr()
        assert accepted in said.out + said.err and "hidden" not in said.out + said.err
    else:
        assert accepted in refusal(capsys, *arguments[door])


@each("option", ["trust", "out", "video", "json"])
def test_a_folder_says_neither_that_it_is_trusted_nor_what_is_written(foreign, option, capsys):
    value = {"trust": True, "json": True}.get(option, str(foreign.parent / "file.mp4"))
    name_planner(foreign, "gap_finder", None, **{option: value})
    assert repr(option) in refusal(capsys, "race", "--config", foreign)
    assert not (foreign.parent / "file.mp4").exists()


@pytest.mark.slow
def test_pictures_of_a_run_need_no_planner(foreign):
    eye = PlannerEye(read_drive(foreign))
    assert "--trust" in eye.missing and not imported(foreign)
    assert set(eye.at_tick(3).intermediate_scans) == {"raw"}
    eye = PlannerEye(read_drive(foreign), trust=True)
    assert eye.missing == "" and imported(foreign)
    assert set(eye.at_tick(3).intermediate_scans) == {"raw", "gap"}


@pytest.mark.slow
def test_render_imports_nothing_that_a_folder_names(foreign, capsys):
    from rendered import _missing

    if _missing():
        pytest.skip(_missing())
    arguments = ["render", str(foreign), "--camera", "top", "--frame", "0.1", "--size", "64x48", "--quality", "draft"]
    assert main([*arguments, "--out", "one.png"]) == 0
    assert not imported(foreign) and (foreign.parent / "one.png").exists()
    (line,) = capsys.readouterr().err.splitlines()
    assert "--trust" in line
    assert main([*arguments, "--out", "two.png", "--trust"]) == 0
    assert imported(foreign) and capsys.readouterr().err == ""


@pytest.mark.slow
def test_replay_and_reports_never_import_the_planner(foreign):
    pytest.importorskip("bokeh")
    (foreign / "report.html").unlink(missing_ok=True)
    assert replay(foreign).identical
    assert main(["report", str(foreign), "--no-clip"]) == 0
    assert not imported(foreign)


@each("source", ["nowhere.py:X", "no_such_planner", "gap_finder:X", "/dev/zero.py:X", "", "os:system"])
def test_what_is_not_there_is_not_trusted(source, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ControllerError, match="--trust"):
        require_trusted(source, {"sha256": "0" * 64}, trust=False, where="here")
    with pytest.raises(ControllerError):
        require_trusted(source, {"sha256": "0" * 64}, trust=True, where="here")
