"""One spelling of settings: races, rollouts, the live view, environments and comparisons mean the same by it."""

import json
from pathlib import Path

import numpy as np
import pytest

import fg_mujoco as fg
from fg_mujoco.addons import gym2d as f110
from fg_mujoco.addons.arena.overtaking.overtaking import overtake
from fg_mujoco.addons.look.live.live_session import LiveSession
from fg_mujoco.cli.main import _parser, main
from fg_mujoco.cli.options import CAR as CAR_OPTIONS
from fg_mujoco.envs.environment_settings import EnvironmentSettings
from fg_mujoco.envs.worlds import Worlds
from fg_mujoco.lidar.beams import LidarModel
from fg_mujoco.racing.setup import Setup
from fg_mujoco.simulation.settings import CarSettings, DriveSettings, Scenario, Start
from refusals import refused
from vehicle_worlds import F1TENTH, made_file

TICKS = 60
START = Start(s=2.0, offset=0.15, heading=0.1, speed=1.0)
CAR = {"vehicle": "nuc2", "mu": 0.8, "changes": fg.CarChanges(mass=4.8)}
TOLD = {"planner_mu": 0.75, "max_speed": 4.0, "planner_settings": {"lookahead": 6.0}}
DRIFT = {"odometry_drift": 0.1}
NOISE = fg.LidarEffects(range_noise_std=0.02)


@pytest.fixture(scope="module")
def raced():
    return fg.race("oval", time_limit=TICKS * 0.025 - 0.01, start=START, effects=NOISE, seed=5, **CAR, **TOLD, **DRIFT)


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


# -- the same bits


def test_a_rollouts_world_is_the_race(raced):
    result = fg.rollout(
        "oval",
        seeds=[5],
        time_limit=TICKS * 0.025 - 0.01,
        record="states",
        start=START,
        effects=NOISE,
        **CAR,
        **TOLD,
        **DRIFT,
    )
    assert (result.states(0) == raced.states).all()
    assert (result.ctrl(0) == raced.ctrl).all()


def test_a_live_session_is_the_race(raced):
    session = LiveSession(Setup.of(start=START, effects=NOISE, seed=5, **CAR, **TOLD, **DRIFT))
    for state in raced.states[1:]:
        session.tick()
        assert (session.simulation.state == state).all()
    assert session.world.xml == raced.world.xml


def test_a_live_session_with_other_tires_keeps_its_settings(raced):
    session = LiveSession(Setup.of(start=START, effects=NOISE, seed=5, **CAR, **TOLD, **DRIFT))
    session.change("mu", 0.5)
    session.tick()
    assert session.message == "" and session.world.car.mu == 0.5
    assert session.world.parameters == raced.world.parameters
    assert session.settings.changes == CAR["changes"]


def test_an_environment_is_the_race(raced):
    settings = EnvironmentSettings(start=START, **CAR)
    assert settings.make_world().xml == raced.world.xml
    worlds = Worlds(settings, 2)
    worlds.begin(np.ones(2, np.bool_), [settings.fixed_start] * 2, [0, 0])
    commands = np.column_stack([raced.car.column(name) for name in ("command_steering_rad", "command_speed_m_s")])
    for command, state in zip(commands, raced.states[1:], strict=True):
        worlds.drive(np.tile(command, (2, 1)))
        assert (worlds.state(0) == state).all() and (worlds.state(1) == state).all()


def load(*args, **settings):
    """An environment of dm_env."""
    pytest.importorskip("dm_control", reason="there is no dm_control for this Python")
    from fg_mujoco.envs import dm_environment

    return dm_environment.load(*args, **settings)


def test_dm_env_starts_where_it_is_told(raced):
    env = load("oval", start={"s": 2.0, "offset": 0.15, "heading": 0.1, "speed": 1.0}, **CAR)
    env.reset()
    assert (env.physics.simulation.state == raced.states[0]).all()
    assert env.physics.simulation.world.xml == raced.world.xml


def test_a_comparisons_run_is_the_race(here):
    comparison = fg.compare(
        ["gap_finder[lookahead=6]"], track=["oval"], laps=1, planner_mu=0.75, max_speed=[4.0], time_limit=0.5,
        out="out", workers=1, pictures=False, **CAR,
    )  # fmt: skip
    raced = fg.race("oval", laps=1, time_limit=0.5, **CAR, **TOLD)
    assert comparison.rows[0].figures.trajectory_sha256 == raced.trajectory_sha256


def test_a_controllers_brackets_are_its_planner_settings():
    beside = fg.race("oval", time_limit=0.5, planner_settings={"lookahead": 6.0})
    inside = fg.race("oval", "gap_finder[lookahead=6.0]", time_limit=0.5)
    unlike = {"wall_time_s": 0, "realtime_factor": 0, "decision_times": 0}  # they differ from run to run
    told = [result.summary() | unlike for result in (inside, beside)]
    for summary in told:
        summary["cars"] = [row | {"decision_times": 0} for row in summary["cars"]]
    assert told[0] == told[1]
    rolled = fg.rollout("oval", "gap_finder[lookahead=6.0]", seeds=[0], time_limit=0.5, record="states")
    assert (rolled.states(0) == beside.states).all()


def test_the_f110_environment_drives_the_vehicle():
    env = f110.make(vehicle="nuc2", params={"m": 4.5, "mu": 0.8})
    assert env.world.xml == CarSettings(vehicle="nuc2", mu=0.8).world("oval").xml
    env.update_params({"m": 4.0})
    assert env.world.parameters.mass == pytest.approx(4.0)
    env.update_params({"m": 3.74})  # the gym's default, which scripts carry with them: the vehicle's own
    assert env.world.parameters.mass == pytest.approx(4.5)
    assert env.world.parameters.wheelbase == fg.Vehicle.load("nuc2").parameters.wheelbase


# -- the same names


DOORS = {
    "race": lambda **keywords: fg.race("oval", **keywords),
    "rollout": lambda **keywords: fg.rollout("oval", n=1, **keywords),
    "compare": lambda **keywords: fg.compare("gap_finder", track="oval", out="nowhere", **keywords),
    "overtake": lambda **keywords: overtake("overtaker", track="oval", out="nowhere", **keywords),
    "drive": lambda **keywords: fg.drive("brake", **keywords),
}


@pytest.mark.parametrize("name", DOORS)
def test_a_keyword_that_no_setup_has_is_refused_with_the_one_that_was_meant(here, name):
    said = rf"^{name} has no argument 'time_limt'; .* did you mean 'time_limit'\?$"
    with pytest.raises(fg.SettingsError, match=said):
        DOORS[name](time_limt=2.0)
    assert not list(here.iterdir())


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("race", "duration", "time_limit"), ("race", "planner", "controller"), ("rollout", "duration", "time_limit"),
        ("compare", "tracks", "track"), ("compare", "max_speeds", "max_speed"), ("overtake", "planners", "controller"),
        ("overtake", "seeds", "seed"),
    ],
)  # fmt: skip
def test_a_word_that_others_use_is_answered_with_the_keyword(here, name, old, new):
    with pytest.raises(fg.SettingsError, match=rf"did you mean '{new}'"):
        DOORS[name](**{old: 1})


@pytest.mark.parametrize("command", ["race", "rollout", "view", "compare"])
def test_commands_have_the_options_of_a_car_with_the_same_help(command):
    commands = _parser()._subparsers._group_actions[0].choices
    helps = {a.dest: a.help for a in commands[command]._actions}
    race = {a.dest: a.help for a in commands["race"]._actions}
    same = [name for name in CAR_OPTIONS if (command, name) != ("compare", "max_speed")]  # that one is a list
    assert {name: helps.get(name) for name in same} == {name: race[name] for name in same}


# -- what is refused

CONFLICT = {"mu": 0.8, "changes": fg.CarChanges(mu=0.5)}


@pytest.mark.parametrize(
    "door",
    [
        lambda **settings: fg.race("oval", **settings),
        lambda **settings: fg.rollout("oval", n=1, **settings),
        lambda **settings: fg.World("oval", **settings),
        lambda **settings: load("oval", **settings),
        lambda **settings: fg.compare(["gap_finder"], track=["oval"], out="nowhere", **settings),
        Scenario, Setup.of, EnvironmentSettings, CarSettings, fg.Vehicle.load().spec,
    ],
)  # fmt: skip
def test_a_friction_that_is_given_twice_is_refused(here, door):
    with pytest.raises(fg.SettingsError, match=r"mu is 0\.8 and CarChanges\.mu is 0\.5; accepted: one of them"):
        door(**CONFLICT)
    assert not list(here.iterdir())


@pytest.mark.parametrize(
    "door",
    [
        lambda **settings: fg.race("oval", **settings),
        lambda **settings: fg.rollout("oval", n=1, **settings),
        lambda **settings: LiveSession(Setup.of(**settings)),
    ],
)
def test_a_setting_of_the_planner_that_is_given_twice_is_refused(door):
    with pytest.raises(fg.SettingsError, match=r"lookahead is given in the brackets of .* and in planner_settings"):
        door(controller="gap_finder[lookahead=6]", planner_settings={"lookahead": 6.0})


@pytest.mark.parametrize(
    ("fixed", "drawn"),
    [
        ({"mu": 0.8}, "mu"),
        ({"changes": fg.CarChanges(mu=0.8)}, "mu"),
        ({"changes": fg.CarChanges(mass=4.0)}, "mass"),
        ({"planner_mu": 1.0}, "planner_mu"),
        ({"max_speed": 5.0}, "max_speed"),
        ({"start": Start(speed=1.0)}, "start_speed"),
        ({"effects": NOISE}, "lidar_noise"),
        ({"planner_settings": {"lookahead": 6.0}}, "planner.lookahead"),
        ({"controller": "gap_finder[lookahead=6]"}, "planner.lookahead"),
    ],
)
def test_a_setting_that_is_fixed_and_randomised_is_refused(fixed, drawn):
    with pytest.raises(fg.SettingsError, match=f"{drawn} is given for all worlds and in randomize"):
        fg.rollout("oval", n=1, randomize={drawn: (0.9, 1.0)}, **fixed)


def test_drawn_changes_are_those_that_the_vehicle_can_have():
    with pytest.raises(fg.SettingsError, match=r"randomize mass=0\.1:4\.0: .* more than"):
        fg.rollout("oval", n=1, vehicle="nuc2", randomize={"mass": (0.1, 4.0)})


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: EnvironmentSettings.of({"vehicel": "nuc2"}), "did you mean 'vehicle'"),
    ],
)
def test_a_name_that_changed_is_answered_with_the_new_one(call, said):
    with pytest.raises(fg.SettingsError, match=said):
        call()


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"start": "here"}, "start is 'here'; accepted: random, line, or a Start"),
        ({"start": 3.0}, "start is 3.0; accepted: Start, or any of s, offset, heading, speed by name"),
        ({"start": {"sped": 1.0}}, "start has no setting 'sped'; accepted: .*; did you mean 'speed'"),
        ({"start": {"s": float("nan")}}, "a finite number"),
        ({"changes": {"weight": 4.0}}, "changes has no setting 'weight'"),
        ({"vehicle": 3}, "vehicle is 3; accepted: a bundled name"),
        ({"vehicle": "nuc3"}, "did you mean 'nuc2'"),
    ],
)
def test_bad_settings_of_an_environment_are_refused(settings, said):
    with pytest.raises(fg.SettingsError, match=said):
        EnvironmentSettings.of(settings)


@pytest.mark.parametrize("command", ["race", "rollout", "view", "compare", "replay-scans"])
@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ('<body name="rear_right_wheel">', '<body name="rear_left_wheel">', "body 'rear_left_wheel' is there twice"),
        ('mass="3.12"', 'mass="0"', "mass or inertia of body 'base_link' is not positive"),
        ('name="lidar_mount"', 'name="mount"', "has no site named 'lidar_mount'"),
    ],
)
def test_a_bad_vehicle_is_refused_by_every_command(here, capsys, command, before, after, said):
    (here / "bad.xml").write_text(F1TENTH.replace(before, after))
    arguments = {"compare": ("--out", "out"), "replay-scans": ("a.mcap",)}.get(command, ())
    line = refused(here, capsys, command, *arguments, "--vehicle", "bad.xml")
    assert said in line and "bad.xml" in line and "accepted: " in line


@pytest.mark.parametrize("command", ["race", "rollout", "view", "compare"])
def test_a_vehicle_that_is_not_there_is_refused_by_every_command(here, capsys, command):
    arguments = ("--out", "out") if command == "compare" else ()
    assert "accepted: f1tenth, ipz, nuc2, or" in refused(here, capsys, command, *arguments, "--vehicle", "f1tent")
    assert "No such file" in refused(here, capsys, command, *arguments, "--vehicle", "none.xml")


def test_a_bad_vehicle_in_a_file_of_settings_is_refused_with_its_line(here, capsys):
    (here / "race.toml").write_text('laps = 1\nvehicle = "nuc3"\n')
    said = refused(here, capsys, "race", "--config", "race.toml")
    assert "race.toml, line 2: vehicle 'nuc3' is not known; accepted: " in said
    (here / "race.toml").write_text('laps = 1\nvehicle = "none.xml"\n')
    said = refused(here, capsys, "race", "--config", "race.toml")
    assert "race.toml, line 2: vehicle file none.xml: No such file" in said


# -- what is written down


def test_settings_read_back_from_their_description():
    settings = DriveSettings(planner_mu=float("inf"), start=START, effects=NOISE, **CAR)
    description = json.loads(json.dumps(settings.described(), allow_nan=False))
    assert DriveSettings.of(description) == settings
    assert description["planner_mu"] == "off" and description["vehicle"] == "nuc2"


def test_a_file_that_has_the_name_of_a_bundled_vehicle_is_described_by_its_path(here):
    (here / "nuc2.xml").write_text(Path(made_file()).read_text())
    settings = CarSettings(vehicle="nuc2.xml")
    description = settings.described()
    assert (settings.car.name, description["vehicle"]) == ("nuc2", "nuc2.xml")
    assert CarSettings.of(description) == settings
    (here / "nuc2.xml").write_text(F1TENTH)
    with pytest.raises(fg.SettingsError, match="is another one now"):
        CarSettings.of(description)


def test_a_run_of_a_file_vehicle_is_raced_again_while_the_file_is_the_same(here, capsys, without_pictures):
    (here / "mine.xml").write_text(Path(made_file()).read_text())
    main(["race", "--vehicle", "mine.xml", "--time-limit", "0.5", "--out", "first"])
    assert capsys.readouterr().out.startswith("oval, gap_finder, mine\n")
    main(["race", "--config", "first", "--json"])
    first, again = fg.read_run("first").summary, json.loads(capsys.readouterr().out)
    assert first["trajectory_sha256"] == again["trajectory_sha256"]
    assert (first["vehicle"], first["settings"]["vehicle"]) == ("mine", "mine.xml")
    assert first["vehicle_sha256"] == again["vehicle_sha256"] == fg.Vehicle.load("mine.xml").sha256
    (here / "mine.xml").write_text(F1TENTH)
    assert "vehicle 'mine.xml' is another one now" in refused(here, capsys, "race", "--config", "first")
    (here / "mine.xml").unlink()
    assert "No such file" in refused(here, capsys, "race", "--config", "first")
    assert fg.replay("first").identical  # scene.xml has the whole world


def test_a_comparison_goes_on_with_the_same_vehicle_only(here):
    grid = {"track": ["oval"], "laps": 1, "time_limit": 0.3, "out": "out", "workers": 1, "pictures": False}
    fg.compare(["gap_finder"], vehicle="nuc2", **grid)
    assert json.loads(Path("out/manifest.json").read_text())["settings"]["vehicle"] == "nuc2"
    with pytest.raises(fg.RunFolderError, match='vehicle is "nuc2" there and null here'):
        fg.compare(["gap_finder"], **grid)
    assert fg.compare(["gap_finder"], vehicle="nuc2", **grid).runs_driven == 0


def test_vehicles_are_listed(capsys):
    assert main(["vehicles"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(fg.vehicle_names())
    assert "3.74 kg, wheelbase 0.330 m, width 0.31 m, mu 1.0489, LiDAR 1081 beams over 270 deg" in lines[0]
    assert main(["vehicles", "--json"]) == 0
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)}
    for name, row in rows.items():
        vehicle = fg.Vehicle.load(name)
        assert (row["mass_kg"], row["mu"]) == (vehicle.parameters.mass, vehicle.nominal_mu)
        assert row["lidar"]["beams"] == len(LidarModel.load(row["lidar"]["file"]).beams.bearings)


def test_a_vehicle_file_is_listed_or_refused(here, capsys):
    assert main(["vehicles", "nuc2", made_file()]) == 0
    assert "made      5.50 kg, wheelbase 0.400 m, width 0.36 m, mu 0.8" in capsys.readouterr().out
    (here / "bad.xml").write_text(F1TENTH.replace('name="lidar_mount"', 'name="mount"'))
    assert "has no site named 'lidar_mount'" in refused(here, capsys, "vehicles", "bad.xml")


def test_render_fps_is_that_of_the_vehicles_lidar(here):
    """A LiDAR of half the rate, beside a vehicle of one's own."""
    pytest.importorskip("gymnasium")
    from fg_mujoco.envs.gym_environment import F1TenthEnv
    from fg_mujoco.envs.gym_vector import F1TenthVectorEnv

    plain = fg.Vehicle.load().lidar.text
    assert 'interval="0.025"' in plain
    (here / "slow.xml").write_text(plain.replace('interval="0.025"', 'interval="0.05"'))
    (here / "mine.xml").write_text(F1TENTH.replace('"hokuyo_ust10lx.xml"', '"slow.xml"'))
    assert F1TenthEnv(vehicle="mine.xml").metadata["render_fps"] == 20
    assert F1TenthVectorEnv(vehicle="mine.xml").metadata["render_fps"] == 20
    assert F1TenthEnv.metadata["render_fps"] == 40
