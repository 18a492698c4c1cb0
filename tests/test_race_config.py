"""Settings in a file: the same names, the same checks, and the line that is wrong."""

from __future__ import annotations

import json
import math

import pytest

import fg_mujoco as fg
from fg_mujoco.cli.config import _settable, parse, settings_of
from fg_mujoco.cli.main import _parser, main

FULL = """\
# every option of the command line
track = "l_corridor"
vehicle = "nuc2"
tires = "forzaeth_nuc2"
controller = "follow_the_gap[point=deepest]"
laps = 2
obstacles = 3
obstacle-seed = 4
mu = 0.9
planner_mu = "off"
max-speed = 5
lidar = "rangefinder"
lidar-noise = 0.01
"lidar-dropout" = 0.02
lidar_latency = 0.05
motion-distortion = true
odometry-drift = 0.05
seed = 6
opponent = "wall_follow"
opponent-max-speed = 3.5
grid = "side_by_side"
rules = "roboracer_2026"
time-limit = 7.5
decision-limit = 2.5
out = "here"
video = "race.mp4"
json = true
traceback = true
"""


def options(*arguments):
    return parse(_parser(), ["race", *map(str, arguments)])


@pytest.fixture
def config(tmp_path):
    """Write a text as race.toml and return its path."""

    def write(text):
        path = tmp_path / "race.toml"
        path.write_text(text)
        return path

    return write


def as_options(text):
    """The command line that says what a flat TOML text says, by hand."""
    for line in text.splitlines()[1:]:
        key, value = line.split(" = ")
        yield "--" + key.strip('"').replace("_", "-")
        if value != "true":
            yield value.strip('"')


def test_a_file_says_what_the_command_line_says(config):
    path = config(FULL)
    read, given = vars(options("--config", path)), vars(options(*as_options(FULL)))
    ours = {name for name in read if name not in ("config", "command", "run")}
    assert {name: read[name] for name in ours} == {name: given[name] for name in ours}
    assert {name: type(read[name]) for name in ours} == {name: type(given[name]) for name in ours}


def test_every_option_can_be_in_a_file():
    parser = options().command
    written = {key.strip('"').replace("-", "_") for key in (line.split(" = ")[0] for line in FULL.splitlines()[1:])}
    assert set(_settable(parser)) == written
    assert set(settings_of(options())) == written - {"out", "video", "json", "traceback"}


def test_opponents_can_be_a_list_in_a_file(config):
    path = config('opponent = ["wall_follow", "gap_finder"]\nopponent-max-speed = [2, 3.5]\n')
    read = options("--config", path)
    assert (read.opponent, read.opponent_max_speed) == (["wall_follow", "gap_finder"], [2.0, 3.5])
    with pytest.raises(fg.SettingsError, match=r"line 1: opponent is 3; accepted: a text in quotes, or a list of such"):
        options("--config", config('opponent = ["wall_follow", 3]\n'))


def test_the_command_line_wins_over_the_file_in_any_order_even_with_a_default(config):
    path = config('seed = 7\nlaps = 3\nplanner-mu = "off"\ntrack = "hairpins"\n')
    for arguments in (("--seed", 0, "--config", path), ("--config", path, "--seed", 0)):
        read = options(*arguments, "--track", "oval")
        assert (read.seed, read.track, read.laps, read.planner_mu) == (0, "oval", 3, math.inf)


def test_what_the_file_leaves_out_has_its_default(config):
    read = options("--config", config("laps = 2\n"))
    assert (read.track, read.controller, read.max_speed, read.mu) == ("oval", "gap_finder", 8.0, None)
    assert options().laps is None  # and the next command line knows nothing of it


@pytest.mark.parametrize(
    ("text", "line", "named"),
    [
        ("laps = 1\nmax-sped = 3\n", 2, "'max-sped' is no setting; accepted: track, "),
        ("\n\nlidar_nois = 0.1\n", 3, "did you mean 'lidar-noise'?"),
        ("config = 'other.toml'\n", 1, "'config' is no setting"),
        ("out = '''\nlapps = 1\n'''\nlapps = 1\n", 4, "did you mean 'laps'?"),
        ("# laps = x\ntrack = 'laps = 0'\n", 2, "track"),
        ("[race]\nlaps = 1\n", 1, "'race' is no setting; accepted: track, "),
        ("seed = 1\n[lidar]\nnoise = 0.1\n", 2, "lidar is {'noise': 0.1}; accepted: a text in quotes"),
        ("lidar.noise = 0.1\n", 1, "accepted: a text in quotes"),
        ("max-speed = 1\nmax_speed = 2\n", 2, "'max_speed' was given before"),
        ("seed = 1\nlaps = '5'\n", 2, "laps is '5'; accepted: a whole number"),
        ("laps = 2.0\n", 1, "accepted: a whole number"),
        ("laps = true\n", 1, "accepted: a whole number"),
        ("mu = '0.9'\n", 1, "accepted: a number"),
        ("planner-mu = 'on'\n", 1, 'accepted: a number, or "off"'),
        ("motion-distortion = 1\n", 1, "accepted: true or false"),
        ("track = 7\n", 1, "accepted: a text in quotes"),
        # what the race itself would say, with the line
        ("seed = 3\nlaps = 0\n", 2, "laps is 0; accepted: a whole number from 1"),
        ("\nmu = -0.5\n", 2, "mu"),
        ("max-speed = inf\n", 1, "a positive number"),
        ("lidar-dropout = 1.5\n", 1, "0 to 1"),
        ("lidar-noise = -1\n", 1, "lidar-noise is -1.0; accepted: 0 to 10 m"),
        ("odometry-drift = 1\n", 1, "more than -1 and less than 1"),
        ("lidar = 'sonar'\n", 1, "accepted: raycast, rangefinder"),
        ("laps = 1\ntrack = 'ovall'\n", 2, "unknown track 'ovall'"),
        ("controller = 'gapfinder'\n", 1, "controller 'gapfinder' is not known"),
        ("controller = 'gap_finder['\n", 1, "NAME[SETTING=VALUE"),
        ("obstacles = -1\n", 1, "obstacles"),
        ("obstacle-seed = -1\n", 1, "obstacle-seed"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(config, capsys, text, line, named):
    assert main(["race", "--config", str(config(text))]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert f"race.toml, line {line}: " in error
    assert named in error


def test_a_text_that_is_no_toml_is_refused_with_its_line(config, capsys):
    assert main(["race", "--config", str(config("laps = 1\ntrack = oval\n"))]) == 2
    error = capsys.readouterr().err
    assert "race.toml: Invalid value (at line 2, column 9)" in error and error.count("\n") == 1


def test_a_file_that_cannot_be_read_is_refused(tmp_path, capsys):
    assert main(["race", "--config", str(tmp_path / "none.toml")]) == 2
    assert "none.toml: cannot be read: No such file" in capsys.readouterr().err
    (tmp_path / "bad.toml").write_bytes(b"track = '\xff'\n")
    assert main(["race", "--config", str(tmp_path / "bad.toml")]) == 2
    assert "bad.toml: cannot be read" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [
        ("--track", "l_corridor", "--time-limit", 0.5, "--planner-mu", "off", "--lidar-noise", 0.02, "--seed", 3),
        ("--track", "scene:crossing_box:2", "--controller", "follow_the_gap[point=deepest]", "--time-limit", 0.5),
        ("--odometry-drift", -0.1, "--time-limit", 0.5),
        ("--obstacles", 2, "--obstacle-seed", 5, "--mu", 0.8, "--lidar-latency", 0.05, "--motion-distortion",
         "--time-limit", 0.5, "--max-speed", 3),
    ],
)  # fmt: skip
def test_a_run_folder_is_raced_again_bit_for_bit(arguments, tmp_path, capsys, monkeypatch, without_pictures):
    monkeypatch.chdir(tmp_path)
    main(["race", *map(str, arguments), "--out", "first"])
    main(["race", "--config", "first", "--out", "again"])
    first, again = fg.read_run("first"), fg.read_run("again")
    assert len(first.ctrl) == 20
    assert again.summary["trajectory_sha256"] == first.summary["trajectory_sha256"]
    assert again.summary["settings"] == first.summary["settings"]
    assert again.scene.read_text() == first.scene.read_text()
    capsys.readouterr()
    main(["race", "--config", "first", "--time-limit", "0.25", "--json"])
    shorter = json.loads(capsys.readouterr().out)
    assert shorter["trajectory_sha256"] != first.summary["trajectory_sha256"]
    assert shorter["settings"] == first.summary["settings"] | {"time_limit": 0.25}


def test_a_folder_that_holds_no_settings_is_refused(tmp_path, short_race, capsys):
    assert main(["race", "--config", str(tmp_path)]) == 2
    assert "has no summary.json" in capsys.readouterr().err
    folder = fg.write_run(short_race, tmp_path / "run", picture=False)  # from Python, by a planner that is no name
    assert main(["race", "--config", str(folder)]) == 2
    error = capsys.readouterr().err
    assert "settings: there are none" in error and error.count("\n") == 1


def test_settings_of_a_folder_that_were_changed_are_checked_as_any_file(tmp_path, short_race, capsys):
    folder = fg.write_run(short_race, tmp_path / "run", picture=False, settings={"laps": 0, "track": "oval"})
    assert main(["race", "--config", str(folder)]) == 2
    assert "summary.json, settings: laps is " in capsys.readouterr().err


PLANNER = """
from fg_mujoco.messages import DriveCommand


class Slow:
    def reset(self): pass
    def __call__(self, scan, odometry): return DriveCommand(steering_angle=0.1, speed=SPEED)
"""


@pytest.fixture
def raced(tmp_path, monkeypatch, without_pictures):
    """The folder of a race by a planner's file that lies beside it; the present folder."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "planner.py").write_text(PLANNER.replace("SPEED", "0.5"))
    main(["race", "--controller", "planner.py:Slow", "--time-limit", "0.2", "--out", "first"])
    return tmp_path


def raced_again(folder, capsys, *arguments):
    capsys.readouterr()
    main(["race", "--config", str(folder), "--trust", "--json", *arguments])
    return json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("change", ["nothing", "another folder", "edited", "removed"])
def test_a_planners_file_is_found_again_in_the_run_folder(raced, capsys, monkeypatch, change):
    if change == "another folder":
        (raced / "elsewhere").mkdir()
        monkeypatch.chdir(raced / "elsewhere")
    elif change == "edited":
        (raced / "planner.py").write_text(PLANNER.replace("SPEED", "1.5"))
    elif change == "removed":
        (raced / "planner.py").unlink()
    again, first = raced_again(raced / "first", capsys), fg.read_run(raced / "first").summary
    assert again["trajectory_sha256"] == first["trajectory_sha256"]
    kept = f"{raced / 'first' / 'controller.py'}:Slow"
    assert again["settings"]["controller"] == ("planner.py:Slow" if change == "nothing" else kept)


def test_an_option_wins_over_the_copy_in_the_run_folder(raced, capsys):
    (raced / "planner.py").write_text(PLANNER.replace("SPEED", "1.5"))
    again = raced_again(raced / "first", capsys, "--controller", "planner.py:Slow")
    assert again["trajectory_sha256"] != fg.read_run(raced / "first").summary["trajectory_sha256"]


def test_a_copy_in_the_run_folder_that_was_edited_is_refused(raced, capsys):
    (raced / "first" / "controller.py").write_text(PLANNER.replace("SPEED", "1.5"))
    capsys.readouterr()
    assert main(["race", "--config", "first"]) == 2
    assert "controller.py: is another one now" in capsys.readouterr().err
