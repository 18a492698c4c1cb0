"""Settings in a file: the same names, the same checks, and the line that is wrong."""

import math

import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.cli.config import parse
from fg_mujoco.cli.main import _parser, main
from fg_mujoco.cli.options import setup_of


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


def test_opponents_are_a_list_with_commas_or_given_again():
    given = "wall_follow,gap_finder[lookahead=6,assist=grip+sight]", "pure_pursuit"
    entries = setup_of(options("--opponents", given[0], "--opponents", given[1])).entries
    names = ["gap_finder", "wall_follow", "gap_finder[lookahead=6,assist=grip+sight]", "pure_pursuit"]
    assert [entry.controller for entry in entries] == names


def test_opponents_can_be_a_list_in_a_file(config):
    path = config('mu = 0.7\nopponents = ["wall_follow", {controller = "gap_finder", max-speed = 3.5}]\n')
    _, second, third = setup_of(options("--config", path)).entries
    assert (second.controller, second.mu) == ("wall_follow", 0.7)
    assert (third.controller, third.max_speed, third.mu) == ("gap_finder", 3.5, None)
    for line, said in (
        ('opponents = ["wall_follow", 3]', "line 1: one of opponents is 3; accepted: the name of a planner"),
        ('opponents = "wall_follow"', "line 1: opponents is 'wall_follow'; accepted: a list"),
        ('opponent = "wall_follow"', "did you mean 'opponents'"),
    ):
        with pytest.raises(fg.SettingsError, match=said):
            options("--config", config(line))


def test_the_command_line_wins_over_the_file_in_any_order_even_with_a_default(config):
    path = config('seed = 7\nlaps = 3\nplanner-mu = "off"\ntrack = "hairpins"\n')
    for arguments in (("--seed", 0, "--config", path), ("--config", path, "--seed", 0)):
        read = setup_of(options(*arguments, "--track", "oval"))
        assert (read.first.seed, read.track, read.laps, read.first.planner_mu) == (0, "oval", 3, math.inf)


def test_options_of_a_file_are_not_those_of_the_next_command_line(config):
    before = vars(options())
    found = options("--config", config('out = "runs/first"\njson = true\n'))
    assert (found.out, found.json) == ("runs/first", True)
    assert vars(options()) == before and before["out"] is None


@each(
    ("text", "line", "named"),
    [
        ("laps = 1\nmax-sped = 3\n", 2, "'max-sped' is no setting; accepted: track, "),
        ("config = 'other.toml'\n", 1, "'config' is no setting"),
        ("out = '''\nlapps = 1\n'''\nlapps = 1\n", 4, "did you mean 'laps'?"),
        ("# laps = x\ntrack = 'laps = 0'\n", 2, "track"),
        ("[race]\nlaps = 1\n", 1, "'race' is no setting; accepted: track, "),
        ("seed = 1\n[lidar]\nnoise = 0.1\n", 2, "lidar is {'noise': 0.1}; accepted: raycast, rangefinder"),
        ("lidar.noise = 0.1\n", 1, "lidar is {'noise': 0.1}; accepted: raycast, rangefinder"),
        ("max-speed = 1\nmax_speed = 2\n", 2, "'max_speed' was given before"),
        # what the race itself would say, with the line
        ("controller = 'gap_finder['\n", 1, "NAME[SETTING=VALUE"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(config, capsys, text, line, named):
    assert main(["race", "--config", str(config(text))]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert f"race.toml, line {line}: " in error
    assert named in error


def test_a_folder_that_holds_no_settings_is_refused(tmp_path, short_race, capsys):
    assert main(["race", "--config", str(tmp_path)]) == 2
    assert "has no summary.json" in capsys.readouterr().err
    folder = fg.write_run(short_race, tmp_path / "run", picture=False)  # from Python, by a planner that is no name
    assert main(["race", "--config", str(folder)]) == 2
    error = capsys.readouterr().err
    assert "settings: there are none" in error and error.count("\n") == 1
