"""Nonsense is refused before anything runs, in one line that names the option which asked for it, and a bound."""

import pytest

import fg_mujoco as fg
from fg_mujoco.cli.main import main
from fg_mujoco.lidar.effects import GREATEST_NOISE, LONGEST_LATENCY
from fg_mujoco.simulation.settings import GREATEST_LAPS, GREATEST_SPEED, LONGEST_RACE
from fg_mujoco.vehicle.changes import GREATEST_MU
from refusals import refused

RACE = {
    "--mu": ("-1", "0", "50", "nan", "inf"),
    "--planner-mu": ("-1", "0", "50", "nan"),
    "--max-speed": ("-3", "0", "1e9", "nan", "inf"),
    "--laps": ("-3", "0", "1000000000", "1e9"),
    "--obstacles": ("-1",),
    "--obstacle-seed": ("-1",),
    "--lidar": ("sonar",),
    "--lidar-noise": ("-0.1", "50", "nan"),
    "--lidar-dropout": ("-0.1", "1.5", "nan"),
    "--lidar-latency": ("-1", "100", "inf"),
    "--odometry-drift": ("-1", "3", "nan"),
    "--seed": ("-1", "0.5"),
    "--time-limit": ("-1", "0", "1e9", "inf"),
}
ROLLOUT = {name: RACE[name] for name in ("--mu", "--planner-mu", "--max-speed", "--laps", "--seed")} | {
    "--n": ("0", "-5"),
    "--time-limit": ("-1", "0", "nan", "inf"),
    "--workers": ("0",),
    "--memory-budget": ("-1",),
    "--chunk": ("0",),
    "--record": ("all",),
    "--executor": ("dask",),
    "--randomize": ("mu=0.5:50", "mu=-1:1", "lidar_noise=99", "speed=1"),
}
COMPARE = {name: RACE[name] for name in ("--mu", "--planner-mu", "--max-speed", "--laps", "--time-limit")} | {
    "--obstacles": ("-1",),
    "--lidar-noise": ("-0.1", "50"),
    "--seed": ("-1", "1,-4"),
    "--workers": ("0",),
}
VIEW = {name: RACE[name] for name in ("--mu", "--planner-mu", "--max-speed", "--obstacles", "--obstacle-seed")} | {
    "--port": ("0", "99999999"),
}
FRICTION = {"--mu": ("0", "50"), "--steering": ("0", "9"), "--seed": ("-1",), "--workers": ("0",)}
RENDER = {"--camera": ("drone",), "--quality": ("ultra",), "--size": ("big",)}
IDENTIFY = {"--front-drive": ("-0.1", "1.5", "nan", "all")}
EXPORT = {"--resolution": ("0", "-1", "1e-9")}
DOORS = {
    ("race", "--out", "run"): RACE,
    ("rollout", "--n", "1"): ROLLOUT,
    ("compare", "--out", "out"): COMPARE,
    ("view", "--web"): VIEW,
    ("friction", "skidpad"): FRICTION,
    ("render", "run"): RENDER,
    ("track", "export", "oval", "oval.yaml"): EXPORT,
    ("identify", "run", "--out", "tires.toml"): IDENTIFY,
}
CASES = [(door, name, value) for door, names in DOORS.items() for name, values in names.items() for value in values]


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(("door", "name", "value"), CASES, ids=[f"{d[0]} {n}={v}" for d, n, v in CASES])
def test_a_value_that_makes_no_sense_is_refused_by_the_name_of_its_option(here, capsys, door, name, value):
    if door[0] == "view":
        pytest.importorskip("viser")
    line = refused(here, capsys, *door, f"{name}={value}")
    said = line.split(": ", 1)[1].removeprefix("argument ")
    assert said.startswith((f"{name} is ", f"{name}: ", f"{name} "))
    assert "accepted: " in line
    assert "Settings." not in line and "LidarEffects." not in line and "CarChanges." not in line


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("mu = 50\n", "race.toml, line 1: mu is 50; accepted: a positive number up to 3"),
        ("\nlidar-latency = 100\n", "race.toml, line 2: lidar-latency is 100; accepted: 0 to 1 s"),
        ("laps = -3\n", "race.toml, line 1: laps is -3; accepted: a whole number from 1"),
        ("obstacle_seed = -3\n", "race.toml, line 1: obstacle_seed is -3; accepted: a whole number from 0"),
    ],
)
def test_a_value_of_a_file_is_refused_by_its_key(here, capsys, text, said):
    (here / "race.toml").write_text(text)
    assert said in refused(here, capsys, "race", "--config", "race.toml")


def test_a_message_about_something_else_keeps_its_words(here, capsys):
    (here / "planner.py").write_text(
        "from fg_mujoco.messages import *\nclass P:\n    def reset(self): pass\n"
        "    def __call__(self, scan, odometry): return DriveCommand(steering_angle=0.0, speed=float('nan'))\n"
    )
    assert main(["race", "--controller", str(here / "planner.py") + ":P"]) == 1
    assert "DriveCommand.speed is nan" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("make", "greatest"),
    [
        (lambda value: fg.Entry(mu=value), GREATEST_MU),
        (lambda value: fg.Entry(planner_mu=value), GREATEST_MU),
        (lambda value: fg.Entry(max_speed=value), GREATEST_SPEED),
        (lambda value: fg.CarChanges(mu=value), GREATEST_MU),
        (lambda value: fg.LidarEffects(range_noise_std=value), GREATEST_NOISE),
        (lambda value: fg.LidarEffects(latency=value), LONGEST_LATENCY),
        (lambda value: fg.Setup(time_limit=value), LONGEST_RACE),
        (lambda value: fg.Setup(laps=int(value)), GREATEST_LAPS),
    ],
)
def test_a_bound_itself_is_accepted_and_what_is_above_it_is_not(make, greatest):
    make(greatest)
    with pytest.raises(fg.SettingsError, match=rf"accepted: .*\b{greatest:g}\b"):
        make(greatest + 1)


def test_no_friction_limits_are_still_no_number():
    assert fg.Entry(planner_mu=float("inf")).assumed_mu == float("inf")
