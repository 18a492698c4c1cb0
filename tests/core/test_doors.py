"""One spelling of settings: races, rollouts, the live view, environments and comparisons mean the same by it."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons import gym2d as f110
from fg_mujoco.addons.arena.study.functions import overtake
from fg_mujoco.addons.look.live.live_session import LiveSession
from fg_mujoco.cli.main import _parser, main
from fg_mujoco.cli.options import CAR as CAR_OPTIONS
from fg_mujoco.envs.environment_settings import EnvironmentSettings
from fg_mujoco.envs.worlds import Worlds
from fg_mujoco.racing.setup import Setup
from fg_mujoco.simulation.settings import CarSettings, DriveSettings, Scenario, Start
from refusals import refused
from vehicle_worlds import F1TENTH, made_file

START = Start(s=2.0, offset=0.15, heading=0.1, speed=1.0)
CAR = {"vehicle": "nuc2", "mu": 0.8, "changes": fg.CarChanges(mass=4.8)}
TOLD = {"planner_mu": 0.75, "max_speed": 4.0, "planner_settings": {"lookahead": 6.0}}
NOISE = fg.LidarEffects(range_noise_std=0.02, latency=0.03)


# -- the same bits

PATCH = {"x": 4.0, "y": 0.0, "length": 4.0, "width": 4.0, "mu": 0.3}
PHYSICS = {
    **CAR, "tires": "forzaeth_nuc6", "obstacles": 2, "obstacle_seed": 3, "moving": "pedestrian:1", "patches": [PATCH],
    "effects": NOISE,
}  # fmt: skip
PLANNED = {**TOLD, "odometry_drift": 0.1, "controller": "disparity_extender"}


@given(
    physics=st.sets(st.sampled_from(sorted(PHYSICS))), planned=st.sets(st.sampled_from(sorted(PLANNED))),
    seed=st.integers(0, 9),
)  # fmt: skip
@settings(max_examples=8, deadline=None)
def test_a_setup_is_the_same_drive_at_every_door(tmp_path_factory, physics, planned, seed):
    if "controller" in planned:
        planned = planned - {"planner_settings"}  # which are those of another planner
    world = {name: PHYSICS[name] for name in physics} | {"start": START}
    setup = Setup.of("oval", time_limit=0.49, seed=seed, **world, **{name: PLANNED[name] for name in planned})
    raced = fg.race(setup)
    rolled = fg.rollout(setup, seeds=[seed], record="states")
    assert (rolled.states(0) == raced.states).all() and (rolled.ctrl(0) == raced.ctrl).all()
    session = LiveSession(setup.replace(time_limit=None))
    assert session.world.xml == raced.world.xml
    worlds = Worlds(EnvironmentSettings.of({"setup": Setup.of("oval", **world)}), 2)
    worlds.begin(np.ones(2, np.bool_), [START] * 2, [seed, 0])
    commands = np.column_stack([raced.car.column(name) for name in ("command_steering_rad", "command_speed_m_s")])
    for command, state in zip(commands, raced.states[1:], strict=True):
        session.tick()
        worlds.drive(np.tile(command, (2, 1)))
        assert (session.simulation.state == state).all()
        assert (worlds.state(0) == state).all() and (worlds.state(1) == state).all()
    run = fg.write_run(raced, tmp_path_factory.mktemp("doors") / "run", picture=False)
    assert fg.replay(run).holds
    assert fg.race(Setup.read(fg.read_run(run).summary["settings"])).trajectory_sha256 == raced.trajectory_sha256


def test_dm_env_starts_where_it_is_told():
    pytest.importorskip("dm_control", reason="there is no dm_control for this Python")
    from fg_mujoco.envs import dm_environment

    raced = fg.race("oval", time_limit=0.02, start=START, **CAR)
    env = dm_environment.load("oval", start={"s": 2.0, "offset": 0.15, "heading": 0.1, "speed": 1.0}, **CAR)
    env.reset()
    assert (env.physics.simulation.state == raced.states[0]).all()
    assert env.physics.simulation.world.xml == raced.world.xml


def test_a_comparisons_run_is_the_race(here):
    setup = Setup.of(
        "oval", laps=1, time_limit=0.5, effects=NOISE, odometry_drift=0.1, planner_mu=0.75, max_speed=4.0, **CAR
    )
    told = fg.compare("gap_finder[lookahead=6]", setup=setup, seed=[3], out="out", workers=1, pictures=False)
    raced = fg.race(setup.replace(seed=3, planner_settings={"lookahead": 6.0}))
    assert told.rows[0].trajectory_sha256 == raced.trajectory_sha256
    inside = fg.race(setup.replace(seed=3, controller="gap_finder[lookahead=6]"))
    assert inside.trajectory_sha256 == raced.trajectory_sha256


def test_the_f110_environment_drives_the_vehicle():
    env = f110.make(vehicle="nuc2", params={"m": 4.5, "mu": 0.8})
    assert env.world.xml == CarSettings(vehicle="nuc2", mu=0.8).world("oval").xml
    env.update_params({"m": 4.0})
    assert env.world.parameters.mass == pytest.approx(4.0)
    env.update_params({"m": 3.74})  # the gym's default, which scripts carry with them: the vehicle's own
    assert env.world.parameters.mass == pytest.approx(4.5)


# -- the same names


DOORS = {
    "race": lambda **keywords: fg.race("oval", **keywords),
    "rollout": lambda **keywords: fg.rollout("oval", n=1, **keywords),
    "compare": lambda **keywords: fg.compare("gap_finder", track="oval", out="nowhere", **keywords),
    "overtake": lambda **keywords: overtake("overtaker", track="oval", out="nowhere", **keywords),
    "drive": lambda **keywords: fg.drive("brake", **keywords),
}


@each("name", DOORS)
def test_a_keyword_that_no_setup_has_is_refused_with_the_one_that_was_meant(here, name):
    said = rf"^{name} has no argument 'time_limt'; .* did you mean 'time_limit'\?$"
    with pytest.raises(fg.SettingsError, match=said):
        DOORS[name](time_limt=2.0)
    assert not list(here.iterdir())


@each("command", ["race", "rollout", "view", "compare"])
def test_commands_have_the_options_of_a_car_with_the_same_help(command):
    commands = _parser()._subparsers._group_actions[0].choices
    for name in (command, "race"):
        commands[name].fill()
    helps = {a.dest: a.help for a in commands[command]._actions}
    race = {a.dest: a.help for a in commands["race"]._actions}
    lists = ("max_speed", "mu") if command == "compare" else ()  # axes there
    same = [name for name in CAR_OPTIONS if name not in lists]
    assert {name: helps.get(name) for name in same} == {name: race[name] for name in same}


# -- what is refused


@each(
    "door", [*(DOORS[name] for name in ("race", "rollout", "compare")), Scenario, Setup.of, EnvironmentSettings]
)
def test_a_friction_that_is_given_twice_is_refused(here, door):
    with pytest.raises(fg.SettingsError, match=r"mu is 0\.8 and CarChanges\.mu is 0\.5; accepted: one of them"):
        door(mu=0.8, changes=fg.CarChanges(mu=0.5))
    assert not list(here.iterdir())


@each("door", [DOORS["race"], DOORS["rollout"], lambda **given: LiveSession(Setup.of(**given))])
def test_a_setting_of_the_planner_that_is_given_twice_is_refused(door):
    with pytest.raises(fg.SettingsError, match=r"lookahead is given in the brackets of .* and in planner_settings"):
        door(controller="gap_finder[lookahead=6]", planner_settings={"lookahead": 6.0})


@each(
    ("fixed", "drawn"),
    [
        ({"mu": 0.8}, "mu"), ({"changes": fg.CarChanges(mass=4.0)}, "mass"), ({"planner_mu": 1.0}, "planner_mu"),
        ({"max_speed": 5.0}, "max_speed"), ({"start": Start(speed=1.0)}, "start_speed"),
        ({"effects": NOISE}, "lidar_noise"), ({"planner_settings": {"lookahead": 6.0}}, "planner.lookahead"),
        ({"controller": "gap_finder[lookahead=6]"}, "planner.lookahead"),
    ],
)  # fmt: skip
def test_a_setting_that_is_fixed_and_randomised_is_refused(fixed, drawn):
    with pytest.raises(fg.SettingsError, match=f"{drawn} is given for all worlds and in randomize"):
        fg.rollout("oval", n=1, randomize={drawn: (0.9, 1.0)}, **fixed)


# -- what is written down


def test_settings_read_back_from_their_description():
    settings = DriveSettings(planner_mu=float("inf"), start=START, effects=NOISE, **CAR)
    description = json.loads(json.dumps(settings.described(), allow_nan=False))
    assert DriveSettings.of(description) == settings
    assert description["planner_mu"] == "off" and description["vehicle"] == "nuc2"


def test_a_run_of_a_file_vehicle_is_raced_again_while_the_file_is_the_same(here, capsys, without_pictures):
    (here / "nuc2.xml").write_text(Path(made_file()).read_text())  # a bundled one's name, and another car
    main(["race", "--vehicle", "nuc2.xml", "--time-limit", "0.5", "--out", "first"])
    capsys.readouterr()
    main(["race", "--config", "first", "--json"])
    first, again = fg.read_run("first").summary, json.loads(capsys.readouterr().out)
    assert first["trajectory_sha256"] == again["trajectory_sha256"]
    assert (first["vehicle"], first["settings"]["vehicle"]) == ("nuc2", "nuc2.xml")
    assert first["vehicle_sha256"] == again["vehicle_sha256"] == fg.Vehicle.load("nuc2.xml").sha256
    (here / "nuc2.xml").write_text(F1TENTH)
    assert "vehicle 'nuc2.xml' is another one now" in refused(here, capsys, "race", "--config", "first")
    (here / "nuc2.xml").unlink()
    assert "No such file" in refused(here, capsys, "race", "--config", "first")
    assert fg.replay("first").identical  # scene.xml has the whole world


def test_vehicles_are_listed_as_they_are(capsys):
    assert main(["vehicles", "--json"]) == 0
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)}
    assert list(rows) == list(fg.vehicle_names())
    for name, row in rows.items():
        vehicle = fg.Vehicle.load(name)
        assert (row["mass_kg"], row["mu"]) == (vehicle.parameters.mass, vehicle.nominal_mu)
    assert main(["vehicles", "nuc2", made_file()]) == 0
    assert "5.50 kg, wheelbase 0.400 m, width 0.36 m, mu 0.8" in capsys.readouterr().out


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
