"""Every setting x a value that makes no sense x every door: refused before anything runs, in a line that names it.

A setting that a door lacks is left out there, so that a new door or a new setting needs one word here.
"""

import json
import math
from dataclasses import fields

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.cli.main import _parser, main
from fg_mujoco.envs.environment_settings import EnvironmentSettings
from fg_mujoco.envs.observations import ObservationTerm
from fg_mujoco.lidar.effects import GREATEST_NOISE, LONGEST_LATENCY
from fg_mujoco.racing.setup import PARTS, SETUP_KEYWORDS, Setup
from fg_mujoco.simulation.settings import GREATEST_LAPS, GREATEST_SPEED, LONGEST_RACE
from fg_mujoco.vehicle.changes import GREATEST_MU
from refusals import refused

NUMBER = (math.nan, "many", True, [], {}, np.zeros(3))  # is none of a setting
WHOLE = (*NUMBER, -1, 0.5, math.inf)
POSITIVE = (*NUMBER, 0.0, -1.0)
BAD = {
    "laps": (*WHOLE, 0, 10**9), "seed": WHOLE, "obstacle_seed": WHOLE, "obstacles": (math.nan, "many", {}, -1, 0.5),
    "time_limit": (*POSITIVE, math.inf, 1e9), "decision_limit": (*POSITIVE,), "mu": (*POSITIVE, math.inf, 50.0),
    "planner_mu": (*POSITIVE, -math.inf, 50.0), "max_speed": (*POSITIVE, math.inf, 1e9),
    "odometry_drift": (*NUMBER, math.inf, 3.0), "lidar": ("sonar", 3, []), "track": ({}, 3, b"x"),
    "vehicle": ("nobody", 3, []), "tires": ("rubber", 3), "floor": ("ice", 3), "knows": ("all", 3),
    "assist": ("some", "", 3, "full,full"),
    "sensors": (3, ["eye"]),
    "controller": (3, []), "grid": ("round", 3), "rules": ("roborace", 3), "opponents": ("gap_finder", [3], 3),
    "entries": ([], ["gap_finder"], 3), "moving": ("dragon:1", 3), "name": (3, ""),
    "patches": ([{"x": 1}], [{"x": 1, "lenght": 2}], [(1, 0, 2, 1, 0.4)], {"x": 1}, 5), "changes": ({"weight": 4.0}, 3),
    "planner_settings": ({"lookahed": 2.0}, 3), "start": ({"sped": 1.0}, {"s": math.nan}, "here", 3.0),
    "effects": ({"range_noise": 0.1}, 3), "lidar_effects": ({"range_noise": 0.1}, 3),
    "lidar_noise": (*NUMBER, -0.1, 50.0), "lidar_dropout": (*NUMBER, -0.1, 1.5),
    "lidar_latency": (*NUMBER, -1.0, 100.0),
    "motion_distortion": (3, "yes"), "start_s": NUMBER, "start_offset": NUMBER, "start_heading": NUMBER,
    "start_speed": NUMBER, "mass": (*POSITIVE,), "cog_height": (*POSITIVE,), "steering_gain": (*POSITIVE,),
    "speed_gain": (*POSITIVE,), "command_delay": (*NUMBER, -0.1, 1.0),
}  # fmt: skip
OF_ENVIRONMENTS = {
    "beam_step": (*WHOLE, 0, 541), "speed_range": ((0.0, 21.0), (3.0, 3.0), 3.0), "normalised_actions": (1, "yes"),
    "action_repeat": (*WHOLE, 0), "smoothing": (-1.0, True, "much"), "grid_order": ("upside_down", 3),
    "builds": (0, 0.5),
    "rewards": (3, {"colision": 1.0}, {"collision": -1.0}, {"lap": math.nan}, {"my": (3.0, 1)}, {"lap": (len, 1.0)}),
    "end_conditions": ("turned_round", ["turned"], [len], ["turned_round"] * 2),
    "observation": (
        3, [], ["scam"], ["scan", "scan"], "beams", "beams:2000", "speed:late=3", "speed:delay=9", "speed:noise=-1",
        "speed:max=3", "speed:every=4", "speed:history=100:every=20",
        *([ObservationTerm(name="mine", function=len, bounds=bounds)] for bounds in ((1.0, 1.0), (0.0, math.inf))),
    ),
    "action": (3, "speed,steering"), "randomize": ([0.5], {"mue": (0.5, 1.0)}), "privileged": ("speed",),
    "render_mode": ("ansi",),
}  # fmt: skip
NAMES = {name: field for name, (_, field) in PARTS.items()} | {
    "lidar_effects": "LidarEffects", "entries": "entr", "start": "Start.", "opponents": "opponent", "rewards": "eward",
    "end_conditions": "end condition", "planner_settings": "setting", "observation": "Part.",
}  # fmt: skip
"""What a refusal says in place of the keyword: the field of the part that it is, or a word for one of several."""
UNBOUNDED = {("laps", 10**9), ("time_limit", 1e9)}  # in an environment, which keeps nothing of its ticks


def check(name, value, call):
    with pytest.raises(fg.FgMujocoError) as refusal:
        call()
    said = str(refusal.value)
    assert "\n" not in said and len(said) < 2000 and "accepted: " in said, (name, value, said)
    assert name in said or NAMES.get(name, name) in said, (name, value, said)


def test_every_setting_is_here():
    assert set(SETUP_KEYWORDS) == set(BAD)
    made = {field.name for field in fields(EnvironmentSettings)} - set(BAD)
    assert made - set(OF_ENVIRONMENTS) <= {"residual", "build_seed", "setup"}


@each("name", sorted(BAD))
def test_a_race_refuses_it(name):
    for value in BAD[name]:
        check(name, value, lambda value=value: fg.race(Setup.of(**{name: value}), time_limit=0.01))


@each("name", sorted(BAD | OF_ENVIRONMENTS))
def test_an_environment_refuses_it(name):
    environment = pytest.importorskip("fg_mujoco.envs.gym_environment").F1TenthEnv
    for value in (BAD | OF_ENVIRONMENTS)[name]:
        if not isinstance(value, (int, float)) or (name, value) not in UNBOUNDED:
            check(name, value, lambda value=value: environment(**{name: value}))


def options_of(command):
    return {each.dest for each in _parser(command)._subparsers._group_actions[0].choices[command]._actions}


def texts_of(command):
    """The options of a command, with their bad values that are texts; 3 may be the path of a planner or a track."""
    names = options_of(command) & set(BAD) - {"opponents"} - ({"controller", "track"} if command == "view" else set())
    return {
        name: [f"{each}" for each in BAD[name] if isinstance(each, (int, float, str)) and each is not True]
        for name in sorted(names)
    }


DOORS = {"race": (), "rollout": ("--n", "1"), "compare": ("--out", "out"), "view": ("--web",)}
OF_COMMANDS = {
    ("rollout", "--n=1"): {
        "n": ("0", "-5"), "workers": ("0",), "memory-budget": ("-1",), "chunk": ("0",), "record": ("all",),
        "executor": ("dask",), "randomize": ("mu=0.5:50", "mu=-1:1", "lidar_noise=99", "speed=1"),
    },
    ("compare", "--out=out"): {"seed": ("-1", "1,-4"), "workers": ("0",)},
    ("view", "--web"): {"port": ("0", "99999999")},
    ("friction", "skidpad"): {"mu": ("0", "50"), "steering": ("0", "9"), "seed": ("-1",), "workers": ("0",)},
    ("render", "run"): {"camera": ("drone",), "quality": ("ultra",), "size": ("big",)},
    ("track", "export", "oval", "oval.yaml"): {"resolution": ("0", "-1", "1e-9")},
    ("identify", "run", "--out", "tires.toml"): {"front-drive": ("-0.1", "1.5", "nan", "all")},
}  # fmt: skip
"""What commands take besides settings, with values that none takes."""


@each("door", DOORS)
def test_the_command_line_refuses_it_by_its_option(door, tmp_path, monkeypatch, capsys):
    if door == "view":
        pytest.importorskip("viser", reason="no viser here: pip install -e '.[live]'")
    monkeypatch.chdir(tmp_path)
    for name, values in texts_of(door).items():
        option = f"--{name.replace('_', '-')}"
        for value in values:
            said = refused(tmp_path, capsys, door, *DOORS[door], f"{option}={value}")
            assert name in said or option[2:] in said or NAMES.get(name, name) in said, (name, value, said)
            assert "Settings." not in said and "LidarEffects." not in said and "CarChanges." not in said


@each("command", OF_COMMANDS, ids=" ".join)
def test_a_command_refuses_it_by_its_option(command, tmp_path, monkeypatch, capsys):
    if command[0] == "view":
        pytest.importorskip("viser", reason="no viser here: pip install -e '.[live]'")
    monkeypatch.chdir(tmp_path)
    for name, values in OF_COMMANDS[command].items():
        for value in values:
            said = refused(tmp_path, capsys, *command, f"--{name}={value}").split(": ", 1)[1].removeprefix("argument ")
            assert said.startswith((f"--{name} is ", f"--{name}: ", f"--{name} ")) and "accepted: " in said, value


@each(
    ("made", "greatest"),
    [
        (lambda value: fg.Entry(mu=value), GREATEST_MU), (lambda value: fg.Entry(planner_mu=value), GREATEST_MU),
        (lambda value: fg.Entry(max_speed=value), GREATEST_SPEED),
        (lambda value: fg.CarChanges(mu=value), GREATEST_MU),
        (lambda value: fg.LidarEffects(range_noise_std=value), GREATEST_NOISE),
        (lambda value: fg.LidarEffects(latency=value), LONGEST_LATENCY),
        (lambda value: fg.Setup(time_limit=value), LONGEST_RACE),
        (lambda value: fg.Setup(laps=int(value)), GREATEST_LAPS),
    ],
)  # fmt: skip
def test_a_bound_itself_is_accepted_and_what_is_above_it_is_not(made, greatest):
    made(greatest)
    with pytest.raises(fg.SettingsError, match=rf"accepted: .*\b{greatest:g}\b"):
        made(greatest + 1)
    assert fg.Entry(planner_mu=math.inf).assumed_mu == math.inf  # no friction limits


def toml_of(value):
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {toml_of(part)}" for key, part in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(toml_of, value)) + "]"
    return json.dumps(value).replace("NaN", "nan").replace("Infinity", "inf")


def test_a_file_of_settings_refuses_it_with_its_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name in BAD.keys() - {"controller", "planner_settings"}:  # which the planner refuses, not the file
        for value in BAD[name]:
            if not isinstance(value, (np.ndarray, bytes)):
                (tmp_path / "race.toml").write_text(f"# settings\n{name} = {toml_of(value)}\n")
                said = refused(tmp_path, capsys, "race", "--config", "race.toml")
                line = "" if isinstance(value, dict) else ", line 2"
                assert f"race.toml{line}: " in said.replace(", line 2", line) and "accepted: " in said, (value, said)


def test_a_message_about_something_else_keeps_its_words(tmp_path, capsys):
    (tmp_path / "planner.py").write_text(
        "from fg_mujoco.messages import *\nclass P:\n    def reset(self): pass\n"
        "    def __call__(self, scan, odometry): return DriveCommand(steering_angle=0.0, speed=float('nan'))\n"
    )
    assert main(["race", "--controller", f"{tmp_path / 'planner.py'}:P"]) == 1
    assert "DriveCommand.speed is nan" in capsys.readouterr().err
