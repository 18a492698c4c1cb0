"""What the README shows works: its Python runs, its planner races, its commands and links exist."""

import re
from pathlib import Path

import pytest

import fg_mujoco as fg
from fg_mujoco.cli.main import _parser, main

README = Path(__file__).parent.parent / "README.md"
TEXT = README.read_text() if README.exists() else ""

pytestmark = pytest.mark.skipif(not TEXT, reason="not a checkout of the repository")


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL)


def planner_block():
    (text,) = [block for block in blocks("python") if "def reset" in block]
    return text


def test_python_examples_run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names = {}
    for block in blocks("python"):
        if block != planner_block():
            exec(block, names)
    race = names["race"]
    assert race.finished, race
    assert race.laps_completed == 5
    assert race.collisions == 0
    assert len(capsys.readouterr().out.splitlines()) >= 2


def test_planner_example_drives_a_lap(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_planner.py").write_text(planner_block())
    assert "my_planner.py:WidestView" in TEXT
    assert main(["race", "--controller", "my_planner.py:WidestView", "--laps", "1"]) == 0, capsys.readouterr().out


def test_planner_example_is_short():
    code = [line for line in planner_block().splitlines() if line.strip()]
    assert len(code) <= 20


def test_commands_shown_are_accepted():
    shown = [line.strip() for block in blocks("sh") for line in block.splitlines()]
    commands = [line.partition("#")[0].split() for line in shown if line.startswith("fg-mujoco ")]
    assert len(commands) >= 5
    for command in commands:
        _parser().parse_args(command[1:])


def test_options_shown_are_those_of_the_command():
    race = _parser()._subparsers._group_actions[0].choices["race"]
    known = {option for action in race._actions for option in action.option_strings} - {"-h", "--help"}
    shown = set(re.findall(r"`(--[a-z-]+)", TEXT))
    assert known <= shown, known - shown


def test_files_linked_exist():
    links = re.findall(r"\]\(([^)#]+)\)", TEXT)
    assert links
    assert not [link for link in links if "://" not in link and not (README.parent / link).exists()]


def test_the_table_of_circuits_says_what_they_measure():
    rows = re.findall(
        r"^\| `(\w+)` \| [^|]+ \| ([\d.]+) \| ([\d.]+(?: to [\d.]+)?) \| ([\d.]+) \|$", TEXT, re.MULTILINE
    )
    shown = {
        name: f"{length} m long, {width} m wide, tightest radius {radius} m" for name, length, width, radius in rows
    }
    assert shown == {name: fg.load_track(name).description for name in fg.track_names()}


def test_picture_is_small():
    (picture,) = (README.parent / "docs" / "images").glob("oval_trace.png")
    assert picture.stat().st_size < 200_000


def test_controllers_are_named():
    assert [name for name in fg.controller_names() if f"`{name}`" not in TEXT] == []
