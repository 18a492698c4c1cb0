"""What is raced is said once, in a Setup, and each door takes it or its keywords."""

import json
import math
from dataclasses import fields

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fg_mujoco as fg
from cases import each
from fg_mujoco.cli.config import parse
from fg_mujoco.cli.main import _parser
from fg_mujoco.cli.options import setup_of
from fg_mujoco.racing.entries import Entry
from fg_mujoco.racing.randomization import PARAMETERS
from fg_mujoco.racing.setup import FIELD_OF, SETUP_KEYWORDS, Setup, SetupKeywords

VALUES = {
    "track": "random:3", "laps": 2, "time_limit": 4.5, "obstacles": 3, "obstacle_seed": 7, "lidar": "rangefinder",
    "decision_limit": 0.5, "controller": "gap_finder[lookahead=8]", "name": "mine", "vehicle": "nuc2",
    "tires": "forzaeth_nuc6",
    "mu": 0.75, "planner_mu": math.inf, "max_speed": 4.0, "odometry_drift": -0.02, "seed": 3, "lidar_noise": 0.02,
    "lidar_dropout": 0.1, "lidar_latency": 0.01, "motion_distortion": True, "start_s": 1.5, "start_offset": 0.1,
    "start_heading": 0.05, "start_speed": 2.0, "mass": 4.2, "cog_height": 0.08, "steering_gain": 1.2, "speed_gain": 0.9,
    "command_delay": 0.01, "patches": [{"x": 1.0, "y": 2.0, "length": 1.0, "width": 0.5, "mu": 0.4}],
    "moving": "crossing", "knows": "opponents", "odometry": "vesc", "assist": "grip", "sensors": ["imu"],
    "pose": "rate=10,noise_std=.05",
}  # fmt: skip
AMONG = {"opponents": ["pure_pursuit", fg.Entry(controller="wall_follow", max_speed=3.0)], "grid": "side_by_side"}


# -- one spelling


def test_the_keywords_are_the_fields_and_the_parts_of_a_car():
    own = {f.name for f in fields(Setup)} | {f.name for f in fields(Entry)} | {"opponents"} | set(FIELD_OF)
    assert set(SETUP_KEYWORDS) == own
    assert set(SetupKeywords.__annotations__) | {"track", "controller"} == own


def test_a_rollout_draws_by_the_same_names():
    assert {name for name in PARAMETERS if name in FIELD_OF} == set(FIELD_OF) - {"motion_distortion", "lidar_effects"}
    for name, (part, field) in FIELD_OF.items():
        if name in PARAMETERS:
            owner, own = PARAMETERS[name]
            assert (type(getattr(Setup.of(**{name: 0.01}).first, part)), field) == (owner, own)


def test_the_command_line_the_file_and_python_say_the_same(here):
    by_python = Setup.of(**VALUES)
    arguments = ["race"]
    for name, value in VALUES.items():
        option = f"--{name.replace('_', '-')}"
        if name == "patches":
            arguments += [option, ",".join(f"{key}={part}" for key, part in value[0].items())]
        elif name != "name":
            text = "off" if value == math.inf else str(value[0] if isinstance(value, list) else value)
            arguments += [option] if value is True else [option, text]
    by_options = setup_of(_parser().parse_args(arguments)).replace(name="mine")
    plain = {name: value for name, value in VALUES.items() if name not in ("planner_mu", "patches")}
    lines = [f"{name.replace('_', '-')} = {json.dumps(value)}" for name, value in plain.items()]
    patch = ", ".join(f"{key} = {part}" for key, part in VALUES["patches"][0].items())
    (here / "race.toml").write_text("\n".join([*lines, 'planner-mu = "off"', f"patches = [{{{patch}}}]"]))
    assert by_python == by_options == Setup.read("race.toml")


# -- equal, replaced, written


@given(chosen=st.sets(st.sampled_from(sorted(VALUES))), several=st.booleans())
@settings(max_examples=40, deadline=None)
def test_what_is_written_is_read_back_and_equal(tmp_path_factory, chosen, several):
    setup = Setup.of(**{name: VALUES[name] for name in sorted(chosen)} | (AMONG if several else {}))
    path = setup.write(tmp_path_factory.mktemp("setup") / "race.toml")
    again = Setup.read(path)
    assert again == setup and hash(again) == hash(setup) and again.sha256 == setup.sha256
    assert Setup.read(json.loads(json.dumps(setup.described(), allow_nan=False))) == setup
    assert "\n" not in repr(setup) and len(repr(setup)) <= 400


@each("name", VALUES)
def test_any_other_value_is_another_setup(name):
    assert Setup.of(**{name: VALUES[name]}) != Setup()


def test_what_is_replaced_leaves_the_other_as_it_is():
    setup = Setup.of("oval", mu=0.7, lidar_noise=0.01)
    other = setup.replace(laps=3, lidar_dropout=0.1)
    assert (setup.laps, other.laps) == (None, 3)
    both = fg.LidarEffects(range_noise_std=0.01, dropout_probability=0.1)
    assert (other.first.mu, other.first.effects) == (0.7, both)
    assert setup.first.effects == fg.LidarEffects(range_noise_std=0.01)
    with pytest.raises(AttributeError):
        setup.laps = 2


def test_a_course_or_a_planner_that_is_an_object_counts_but_cannot_be_written():
    def planner(scan, odometry):
        return fg.DriveCommand(steering_angle=0.0, speed=1.0)

    assert Setup.of(fg.load_track("oval")) == Setup.of(fg.load_track("oval")) != Setup.of(fg.load_track("tight"))
    assert Setup.of(controller=planner) == Setup.of(controller=planner) != Setup()
    for setup in (Setup.of(fg.load_track("oval")), Setup.of(controller=planner)):
        with pytest.raises(fg.SettingsError, match="an object, in a file; accepted: a name, or the path of a file"):
            setup.described()


def test_opponents_by_name_draw_noise_of_their_own():
    setup = Setup.of(opponents=["gap_finder", "wall_follow"], lidar_noise=0.01, seed=4)
    assert [entry.seed for entry in setup.entries] == [4, 5, 6]
    assert all(entry.effects == setup.first.effects for entry in setup.entries)


def test_options_beside_a_file_of_several_cars_are_for_all_of_them(here):
    Setup.of(opponents=["wall_follow"]).write("race.toml")
    options = parse(_parser(), ["race", "--config", "race.toml", "--mu", "0.5", "--controller", "pure_pursuit"])
    setup = setup_of(options)
    assert [(entry.controller, entry.mu) for entry in setup.entries] == [("pure_pursuit", 0.5), ("wall_follow", 0.5)]
