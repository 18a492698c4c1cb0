"""A name that is mistyped is refused with the one that was probably meant, at every door."""

from pathlib import Path

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco import controllers
from fg_mujoco.envs.environment_settings import EnvironmentSettings
from fg_mujoco.errors import FgMujocoError, accepted_names, nearest
from fg_mujoco.lab.lab import load_experiment
from fg_mujoco.lidar.beams import LidarModel
from fg_mujoco.lidar.effects import LidarEffects
from fg_mujoco.pictures.rendering.cameras import find_camera
from fg_mujoco.pictures.rendering.overlays import find_overlays
from fg_mujoco.simulation.settings import as_part
from refusals import refused

PACKAGE = Path(fg.__file__).parent
PLANNERS = """
from fg_mujoco.messages import STOP


class Helper:
    pass


class Planner:
    def reset(self): pass
    def __call__(self, scan, odometry): return STOP


class Other(Planner):
    pass
"""


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(PLANNERS)
    (tmp_path / "line.csv").write_text("0,0\n10,0\n10,10\n0,10\n")
    (tmp_path / "key.toml").write_text("lapz = 2\n")
    (tmp_path / "value.toml").write_text("vehicle = 'f1tent'\n")
    return tmp_path


COMMANDS = [
    # commands and options
    ("rase", "race"),
    ("track lst", "list"),
    ("race --lapz 3", "--laps"),
    # tracks and scenes
    ("race --track ovall", "oval"),
    ("race --track random:7:tigth", "random:7:tight"),
    ("race --track line.csv[width=2,direction=clokwise]", "clockwise"),
    ("track show hairpin", "hairpins"),
    # vehicles
    ("race --vehicle F1TENT", "f1tenth"),
    ("vehicles nuc", "nuc2"),
    # planners and their settings
    ("race --controller gap_findr", "gap_finder"),
    ("race --controller mine.py:planner", "Planner"),
    ("compare --out out --controller gap_finder,gapfindr", "gap_finder"),
    ("controllers follow_gap", "follow_the_gap"),
    # what is drawn for each world
    ("rollout --n 1 --randomize planer_mu=1", "planner_mu"),
    ("rollout --n 1 --randomize planner.lookahed=1:2", "lookahead"),
    # files of settings
    ("race --config key.toml", "laps"),
    ("race --config value.toml", "f1tenth"),
    # words of options
    ("rollout --n 1 --record sumary", "summary"),
    ("render run --camera chas", "chase"),
    ("export run --format mcp", "mcap"),
    ("replay-scans a.mcap --controller gap_findr", "gap_finder"),
]


@each(("line", "meant"), COMMANDS, ids=[line for line, _ in COMMANDS])
def test_the_command_line_says_which_name_was_probably_meant(here, capsys, line, meant):
    said = refused(here, capsys, *line.split())
    assert f"did you mean {meant!r}?" in said


@each(
    ("call", "meant"),
    [
        (lambda: fg.load_track("hairpin"), "hairpins"),
        (lambda: fg.race("oval", "gap_findr"), "gap_finder"),
        (lambda: fg.race("oval", planner_settings={"lookahed": 2.0}), "lookahead"),
        (lambda: fg.World("oval", "nuc"), "nuc2"),
        (lambda: fg.rollout("oval", n=1, randomize={"cog_heigth": 0.1}), "cog_height"),
        (lambda: fg.rollout("oval", n=1, record="state"), "states"),
        (lambda: EnvironmentSettings.of({"vehicel": "nuc2"}), "vehicle"),
        (lambda: as_part({"range_noise": 0.1}, LidarEffects, "effects"), "range_noise_std"),
        (lambda: LidarEffects(no_return="range-max "), "range_max"),
        (lambda: LidarModel.load().beams.to_scan(np.zeros(1), 0.0, no_return="range_mx"), "range_max"),
        (lambda: load_experiment("skid_pad"), "skidpad"),
        (lambda: find_camera("orbital"), "orbit"),
        (lambda: find_overlays("chase", beam=True), "beams"),
    ],
)
def test_a_call_in_python_says_which_name_was_probably_meant(call, meant):
    with pytest.raises(FgMujocoError) as refusal:
        call()
    assert str(refusal.value).endswith(f"did you mean {meant!r}?")


def test_a_name_that_resembles_nothing_gets_no_hint():
    assert accepted_names("zzz", ("oval", "tight"), ", or FILE") == "accepted: oval, tight, or FILE"
    assert (
        accepted_names("ovel", ("oval", "tight"), ", or FILE") == "accepted: oval, tight, or FILE; did you mean 'oval'?"
    )
    assert accepted_names(3.5, ("oval",)) == "accepted: oval"


def test_a_part_of_one_name_is_that_name_and_a_part_of_several_is_none():
    tires = ("contact", "forzaeth_nuc5", "forzaeth_nuc6", "forzaeth_sim")
    assert nearest("nuc5", tires) == "forzaeth_nuc5"
    assert nearest("nuc", tires) is None  # two
    assert nearest("im", tires) is None  # too short to say anything


def test_there_is_one_place_that_compares_names():
    """A second one would have another wording and other rules."""
    users = [path.name for path in PACKAGE.rglob("*.py") if "difflib" in path.read_text(encoding="utf-8")]
    assert users == ["errors.py"]


def test_no_two_modules_have_the_same_name():
    """Modules of commands are named after the command, which another room may have the verb of."""
    names = [path.stem for path in PACKAGE.rglob("*.py") if "__" not in path.name and path.parent.name != "cli"]
    names += [path.stem for path in Path(controllers.__file__).parent.rglob("*.py") if "__" not in path.name]
    assert {name for name in names if names.count(name) > 1} == set()
