"""One spelling of settings: races, rollouts, the live view, environments and comparisons mean the same by it."""

import json
import math
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons import gym2d as f110
from fg_mujoco.addons.gym2d.environment import simulator_of
from fg_mujoco.addons.look.live.live_session import LiveSession
from fg_mujoco.cli.main import _parser, main
from fg_mujoco.envs.environment_settings import EnvironmentSettings
from fg_mujoco.envs.worlds import Worlds
from fg_mujoco.racing.setup import CAR_KEYWORDS, Setup
from fg_mujoco.simulation.settings import CarSettings, Start
from refusals import refused
from vehicle_worlds import F1TENTH, made_file

START = Start(s=2.0, offset=0.15, heading=0.1, speed=1.0)
CAR = {"vehicle": "nuc2", "mu": 0.8, "changes": fg.CarChanges(mass=4.8)}
NOISE = fg.LidarEffects(range_noise_std=0.02, latency=0.03)


# -- the same bits

PATCH = {"x": 4.0, "y": 0.0, "length": 4.0, "width": 4.0, "mu": 0.3}
CHANGES = fg.CarChanges(mass=4.2, center_of_gravity_height=0.08, steering_gain=0.9, command_delay=0.0223)
SENSORS = ("imu", {"sensor": "pose", "rate": 50, "delay": 0.013, "noise_std": 0.02, "dropout_probability": 0.2})
PHYSICS = {
    "vehicle": st.just("nuc2"), "mu": st.sampled_from([0.8, 0.9123456]), "changes": st.just(CHANGES),
    "tires": st.sampled_from(["forzaeth_nuc6", "slipx_reference", "contact"]), "obstacles": st.integers(1, 3),
    "obstacle_seed": st.integers(0, 5), "moving": st.just("pedestrian:1"), "patches": st.just([PATCH]),
    "effects": st.sampled_from([NOISE, fg.LidarEffects(dropout_probability=0.1, no_return="range_max")]),
    "sensors": st.just(SENSORS), "start": st.sampled_from([START, Start(s=7.0, heading=-0.1)]),
}  # fmt: skip
PLANNED = {
    "planner_mu": st.sampled_from([0.75, math.inf]), "max_speed": st.just(4.0), "odometry_drift": st.just(0.1),
    "controller": st.sampled_from(["disparity_extender", "gap_finder[lookahead=6]", "pure_pursuit"]),
    "opponents": st.sampled_from([["wall_follow"], [fg.Entry(max_speed=2.0, mu=0.8), "pure_pursuit"]]),
}  # fmt: skip
SCENE = {"obstacles", "obstacle_seed", "moving", "start"}  # which a scene has, of its own


@given(
    track=st.sampled_from(["oval", "hairpins", "random:4", "scene:crossing_box:1"]), seed=st.integers(0, 9),
    world=st.fixed_dictionaries({}, optional=PHYSICS), planned=st.fixed_dictionaries({}, optional=PLANNED),
)  # fmt: skip
@settings(max_examples=8, deadline=None)
def test_a_setup_is_the_same_drive_at_every_door(tmp_path_factory, track, world, planned, seed):
    """A race is its rollout, beside another world, too; its live view; its environment; and its replay."""
    if track.startswith("scene") or "opponents" in planned:
        world = {name: value for name, value in world.items() if name not in SCENE}
    setup = Setup.of(track, time_limit=0.49, seed=seed, **world, **planned)
    raced = fg.race(setup)
    rolled = fg.rollout(setup, seeds=[seed + 1, seed], record="states")
    assert (rolled.states(1) == raced.states).all() and (rolled.ctrl(1) == raced.ctrl).all()
    assert np.array_equal(rolled.telemetry(1), raced.car.telemetry, equal_nan=True)
    for name in ("end_reason", "sim_time_s", "collisions", "max_slide_m_s", "mean_speed_m_s", "laps_completed"):
        assert rolled[name][1] == raced.summary()[name], name
    session = LiveSession(setup.replace(time_limit=None))
    assert session.world.xml == raced.world.xml
    for state in raced.states[1:]:
        session.tick()
        assert (session.simulation.state == state).all()
    if "opponents" not in planned:
        worlds, start = Worlds(EnvironmentSettings.of({"setup": Setup.of(track, **world)}), 2), setup.first.start
        worlds.begin(np.ones(2, np.bool_), [start or Start()] * 2, [seed, 0])
        commands = np.column_stack([raced.car.column(name) for name in ("command_steering_rad", "command_speed_m_s")])
        for command, state in zip(commands, raced.states[1:], strict=True):
            worlds.drive(np.tile(command, (2, 1)))
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


def test_the_f110_environment_drives_the_vehicle():
    env = f110.make(vehicle="nuc2", params={"m": 4.5, "mu": 0.8})
    assert env.world.xml == CarSettings(vehicle="nuc2", mu=0.8).world("oval").xml
    env.update_params({"m": 4.0})
    assert env.world.parameters.mass == pytest.approx(4.0)
    env.update_params({"m": 3.74})  # the gym's default, which scripts carry with them: the vehicle's own
    assert env.world.parameters.mass == pytest.approx(4.5)


# -- the same names


@each("command", ["race", "rollout", "view", "compare"])
def test_commands_have_the_options_of_a_car_with_the_same_help(command):
    commands = _parser()._subparsers._group_actions[0].choices
    for name in (command, "race"):
        commands[name].fill()
    helps = {a.dest: a.help for a in commands[command]._actions}
    race = {a.dest: a.help for a in commands["race"]._actions}
    lists = ("max_speed", "mu", "assist") if command == "compare" else ()  # axes there, and another default
    others = (*lists, "controller", "motion_distortion", "seed")  # not the same for all, or not of all
    same = [name for name in CAR_KEYWORDS if name in race and name not in others]
    assert {name: helps.get(name) for name in same} == {name: race[name] for name in same}


# -- what is written down


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
        assert (row["mass_kg"], row["mu"]) == (vehicle.parameters.mass, vehicle.greatest_mu())  # what `mu` sets
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


# -- what is refused of a setup


# every field of a Setup and of an Entry, with a value that is not the default
OTHER = {
    "track": "fast", "laps": 3, "time_limit": 0.1, "obstacles": 2, "obstacle_seed": 3, "moving": "pedestrian:1",
    "patches": [{"x": 1.0, "y": 0.0, "length": 1.0, "width": 1.0, "mu": 0.5}], "lidar": "rangefinder",
    "decision_limit": 5.0, "vehicle": "ipz", "tires": "ipz", "mu": 0.7, "floor": "ipz8", "changes": {"mass": 4.0},
    "controller": "wall_follow", "planner_settings": {"lookahead": 3.0}, "planner_mu": 0.4, "max_speed": 3.0,
    "knows": "opponents", "odometry": "vesc", "pose": "rate=10", "assist": "safe",
    "sensors": ["imu"], "effects": {"latency": 0.02}, "odometry_drift": 0.1,
    "seed": 4, "start": fg.Start(s=1.0), "name": "mine", "grid": "behind", "rules": "roboracer_2026",
}  # fmt: skip
OF_CAR = {"vehicle", "tires", "mu", "floor", "changes"}
TOLD = {"planner_mu", "max_speed", "knows", "odometry", "pose", "assist", "sensors", "effects", "odometry_drift"}
COURSE = {"track", "obstacles", "obstacle_seed", "moving", "patches"}
DRIVER = TOLD | {"controller"}
PLACE = {"planner_settings", "start", "seed", "grid"}
STUDY = DRIVER - {"controller"} | OF_CAR | {"obstacles", "moving", "patches", "laps", "time_limit"}
STUDY |= {"lidar", "decision_limit"}
USED = {
    "drive": OF_CAR | {"sensors", "start", "lidar", "name", "patches"},
    "a comparison": STUDY | {"controller", "track", "start", "grid", "rules"},
    "a rollout": OF_CAR | COURSE | DRIVER | PLACE | {"laps", "time_limit", "decision_limit"},
    "a live view": OF_CAR | COURSE | DRIVER | PLACE | {"name"},
    "an environment": OF_CAR | COURSE | TOLD - {"planner_mu", "max_speed", "odometry_drift"}
    | {"start", "laps", "time_limit", "grid"},
    "an environment of f1tenth_gym": {"vehicle", "tires"},
}  # fmt: skip


class ReachedError(Exception):
    """A door has taken a setup."""


def through(door, given, out):
    """Give a door a setup of some keywords, or the keywords."""
    setup = Setup.of(**given)
    return {
        "a comparison": lambda: fg.compare("gap_finder", track="oval", setup=setup, out=out),
        "a rollout": lambda: fg.rollout(setup, n=1), "drive": lambda: fg.drive("brake", setup=setup),
        "a live view": lambda: LiveSession(setup), "an environment": lambda: EnvironmentSettings.of({"setup": setup}),
        "an environment of f1tenth_gym": lambda: simulator_of(setup=setup, vehicle=None, tires=None),
    }[door]()  # fmt: skip


@each("door", USED)
def test_a_door_takes_the_fields_of_a_setup_that_it_uses_and_refuses_all_others(door, here, monkeypatch):
    known = {field.name for kind in (Setup, fg.Entry) for field in fields(kind)} - {"entries"}
    assert known == set(OTHER)  # a new field has a value here, and a place in USED or nowhere
    real = Setup.require_usable

    def reach(self, *arguments, **keywords):
        real(self, *arguments, **keywords)
        raise ReachedError

    monkeypatch.setattr(Setup, "require_usable", reach)
    for name, value in OTHER.items():
        among = {"opponents": ["gap_finder"]} if name in ("grid", "rules") else {}
        accepts = name in USED[door]
        said = None if accepts else rf"{name} is .* in {door}, which cannot use|2 entries in {door}; accepted: one car"
        with pytest.raises(ReachedError if accepts else fg.SettingsError, match=said):
            through(door, {name: value} | among, here / "out")
    assert not list(here.iterdir())
