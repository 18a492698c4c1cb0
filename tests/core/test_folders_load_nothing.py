"""A run folder never loads a planner or a file by itself: commands work from what it records; users name planners."""

import json
import shutil

import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.cli.main import main
from fg_mujoco.pictures.rendering.planner_view import PlannerEye
from fg_mujoco.pictures.rendering.recorded_drive import read_drive
from refusals import refused

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
    """The same folder at another place, with its planner in it; whoever imports that leaves tmp_path / "marker"."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "run"
    shutil.copytree(raced, folder)
    (folder / "controller.py").write_text(PLANNER.format(marker=str(tmp_path / "marker")), "utf-8")
    changed(folder, controller=theirs(folder))
    return folder


def theirs(folder):
    return f"{folder / 'controller.py'}:Slow"


def changed(folder, **settings):
    """Write other settings into a summary, as whoever sends a folder can."""
    path = folder / "summary.json"
    summary = json.loads(path.read_text("utf-8"))
    summary |= {name: settings[name] for name in ("controller", "planner_settings") if name in settings}
    settings = summary["settings"] | settings
    path.write_text(json.dumps(summary | {"settings": {k: v for k, v in settings.items() if v is not None}}), "utf-8")


def imported(folder):
    return (folder.parent / "marker").exists()


def test_a_run_is_raced_again_with_its_own_planner_only_if_that_is_named(foreign, capsys, tmp_path):
    said = refused(tmp_path, capsys, "race", "--config", "run", "--out", "again")
    assert f"accepted: --controller {theirs(foreign)}, if you know its code" in said
    assert not imported(foreign) and not (tmp_path / "again").exists()
    assert main(["race", "--config", "run", "--controller", "run/controller.py:Slow", "--json"]) == 1  # the time limit
    summary = json.loads((foreign / "summary.json").read_text("utf-8"))
    assert json.loads(capsys.readouterr().out)["trajectory_sha256"] == summary["trajectory_sha256"]
    assert imported(foreign)


@each("options", [[], ["--controller", "gap_finder"]])
@each("place", ["entries", "opponents"])
def test_no_planner_of_further_cars_is_loaded(place, options, foreign, capsys, tmp_path):
    own = theirs(foreign)
    both = {"controller": None, "entries": [{"controller": "gap_finder"}, {"controller": own}]}
    changed(foreign, **(both if place == "entries" else {"controller": "gap_finder", "opponents": [own]}))
    assert "accepted: --opponents" in refused(tmp_path, capsys, "race", "--config", "run", *options)
    assert not imported(foreign)


@each("door", ["replay", "debug", "race"])
def test_a_folder_reads_no_file_by_the_settings_of_a_planner(door, foreign, capsys, tmp_path):
    secret = tmp_path / "secret.toml"
    secret.write_text("noise = 'hidden'\n")
    changed(foreign, controller="pure_pursuit", planner_settings={"line": str(secret)})
    for named in ([], ["--controller", "pure_pursuit"]):
        capsys.readouterr()
        main([door, *(["--config"] if door == "race" else []), "run", *named])
        said = "".join(capsys.readouterr())
        assert "hidden" not in said
        if named or door == "race":
            assert f"accepted: --controller pure_pursuit[line={secret}]" in said


def test_a_folder_reads_no_file_of_a_lidar(foreign, capsys, tmp_path):
    path = foreign / "summary.json"
    summary = json.loads(path.read_text("utf-8"))
    summary["lidar_effects"]["measured"] = str(tmp_path / "secret.toml")
    path.write_text(json.dumps(summary), "utf-8")
    assert "no file's name" in refused(tmp_path, capsys, "replay", "run")


@each("option", ["out", "video", "json"])
def test_a_folder_does_not_say_what_is_written(foreign, option, capsys, tmp_path):
    changed(foreign, controller="gap_finder", **{option: True if option == "json" else "file.mp4"})
    assert repr(option) in refused(tmp_path, capsys, "race", "--config", "run")
    assert not (tmp_path / "file.mp4").exists()


def test_beams_are_a_planners_where_it_is_named(foreign):
    eye = PlannerEye(read_drive(foreign))
    assert eye.missing == "" and set(eye.at_tick(3).intermediate_scans) == {"raw"} and not imported(foreign)
    eye = PlannerEye(read_drive(foreign), controller=theirs(foreign))
    assert eye.missing == "" and set(eye.at_tick(3).intermediate_scans) == {"raw", "gap"} and imported(foreign)


def test_replay_and_debug_work_from_the_recorded_commands(foreign, capsys):
    pytest.importorskip("bokeh")
    for command in (["replay", "run"], ["report", "run", "--no-clip", "--force"], ["debug", "run"]):
        assert main(command) == 0
    assert not imported(foreign)
    out, err = capsys.readouterr()
    assert "bit-identical" in out and "asked again" not in out and f"accepted: --controller {theirs(foreign)}" in err
    assert main(["replay", "run", "--controller", "run/controller.py:Slow"]) == 0
    assert "planner asked again: the same commands in all" in capsys.readouterr().out and imported(foreign)


@each("command", ["race", "replay", "debug", "render", "report", "rollout"])
def test_trust_is_refused_with_what_serves_instead(command, capsys):
    with pytest.raises(SystemExit) as ended:
        main([command, "run", "--trust"])
    assert ended.value.code == 2 and "instead: --controller FILE" in capsys.readouterr().err
