"""What a planner is told: the same at every door, its friction and its sensors too; and nothing that is drawn."""

import json
import math

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.look.live.live_session import LiveSession
from fg_mujoco.cli.main import main
from fg_mujoco.envs.environment_settings import EnvironmentSettings
from fg_mujoco.envs.worlds import Worlds
from fg_mujoco.errors import ControllerError
from fg_mujoco.racing.setup import Setup

PLANNER = """
import json
from pathlib import Path
import fg_mujoco as fg
class Told:
    def __init__(self, car, map_line, mu, max_speed, period, latency, seed):
        self.told = dict(mu=mu, max_speed=max_speed, period=period, latency=latency, seed=seed)
    def reset(self):
        pass
    def __call__(self, scan, odometry):
        read = odometry.readings
        told = self.told | {"stamp": odometry.stamp, "pose": read["pose"].values.tolist() if "pose" in read else None}
        with Path("told.jsonl").open("a") as kept:
            kept.write(json.dumps(told) + "\\n")
        return fg.DriveCommand(steering_angle=0.05, speed=min(told["mu"], 9.0))
class Reads(Told):
    sensors = ("pose", "imu")
"""
TOLD = "told.py:Told"
OWN = fg.Vehicle.load().nominal_mu


def least(mu):
    """What planners are told of the default tires at a friction."""
    return pytest.approx(mu * fg.Vehicle.load().tires.least_share, rel=1e-5)


NOISY = ["imu", {"sensor": "pose", "rate": 50, "noise_std": 0.1, "dropout_probability": 0.2}]
CAR = {
    "mu": 0.8, "max_speed": 3.0, "effects": fg.LidarEffects(latency=0.03),
    "changes": fg.CarChanges(command_delay=0.02), "sensors": NOISY,
}  # fmt: skip
ON_LINE, AHEAD = fg.Start(), fg.Start(s=4.0)
SHORT = {"laps": 1, "time_limit": 0.19}


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "told.py").write_text(PLANNER)
    return tmp_path


def lines(planner=TOLD, door=None):
    """What a door tells a planner, in the order of its decisions."""
    with open("told.jsonl", "w"):
        DOORS[door](planner)
    with open("told.jsonl") as file:
        return [json.loads(line) for line in file]


def entry(planner, **more):
    return fg.Entry(controller=planner, seed=7, **CAR, **more)


def in_live_view(setup):
    session = LiveSession(setup)
    session.reset()
    for _ in range(8):
        session.tick()


def in_environment(planner):
    gym_environment = pytest.importorskip("fg_mujoco.envs.gym_environment", exc_type=ImportError)
    env = gym_environment.F1TenthEnv(track="oval", opponents=[entry(planner)])
    env.reset(seed=0)
    for _ in range(8):
        env.step(np.zeros(2))


def in_debugger(planner):
    result = fg.race("oval", planner, seed=7, **SHORT, **CAR)
    with open("told.jsonl", "w"):
        fg.debug(result)


FIRST = {
    "race": lambda planner: fg.race("oval", planner, seed=7, **SHORT, **CAR),
    "entries": lambda planner: fg.race("oval", entries=[entry(planner, start=ON_LINE), fg.Entry(start=AHEAD)], **SHORT),
    "rollout": lambda planner: fg.rollout("oval", planner, seeds=[7], time_limit=0.19, **CAR),
    "live view": lambda planner: in_live_view(Setup.of(controller=planner, seed=7, **CAR)),
}
ELSEWHERE = {  # on the grid, or with a seed of its own
    "opponent in a rollout": lambda planner: fg.rollout("oval", n=1, time_limit=0.19, opponents=[entry(planner)]),
    "comparison": lambda planner: fg.compare(
        [planner], track=["oval"], seed=[7], out="out", workers=1, **SHORT, **CAR | {"max_speed": [3.0]}
    ),
    "environment": in_environment, "debug": in_debugger,
    "opponent in a live view": lambda planner: in_live_view(Setup.of(opponents=(entry(planner),))),
}  # fmt: skip
DOORS = FIRST | ELSEWHERE


@each("door", DOORS)
def test_every_door_tells_the_same(door):
    told, raced = lines(door=door), lines(door="race")
    assert len({str(each["pose"]) for each in raced}) > 4 and len(raced) == 8
    if door in FIRST:
        assert told[: len(raced)] == raced
    names = {"mu": least(0.8), "max_speed": 3.0, "period": 0.025, "latency": pytest.approx(0.05 + 0.02)}  # two sweeps
    assert told and all(each[name] == value for each in told for name, value in names.items())
    assert all(each["pose"] is not None for each in told)


def test_a_planner_that_reads_a_sensor_that_its_car_lacks_is_refused():
    named = ["imu", {"sensor": "pose", "name": "poses"}]
    for sensors, accepted in ((named, "imu, poses"), ([], r"sensors=\['pose'\]")):
        for call in (lambda **own: fg.race("oval", "told.py:Reads", **own),
                     lambda **own: LiveSession(Setup.of(controller="told.py:Reads", **own))):  # fmt: skip
            with pytest.raises(ControllerError, match=rf"reads sensor 'pose', .*accepted: {accepted}"):
                call(sensors=sensors)


# -- friction


@each(
    ("settings", "expected"),
    [
        ({}, OWN), ({"mu": 0.6}, least(0.6)), ({"changes": fg.CarChanges(mu=0.6)}, least(0.6)),
        ({"mu": 0.6, "planner_mu": 0.9}, 0.9), ({"mu": 0.6, "planner_mu": math.inf}, math.inf),
        ({"mu": 0.6, "patches": (fg.Patch(x=0.0, y=0.0, length=9.0, width=9.0, mu=0.3),)}, least(0.6)),
        ({"tires": "forzaeth_nuc2"}, fg.Tires.load("forzaeth_nuc2").least_peak),
        ({"tires": "forzaeth_nuc2", "mu": 0.5 * fg.Tires.load("forzaeth_nuc2").peak},
         pytest.approx(0.5 * fg.Tires.load("forzaeth_nuc2").least_peak)),
    ],
)  # fmt: skip
def test_what_is_set_is_told_and_read_back_from_a_file(settings, expected):
    setup = Setup.of(controller=TOLD, time_limit=0.02, **settings)
    race = fg.race(setup)
    assert race.car.planner_mu == expected and race.car.column("command_speed_m_s")[0] == min(race.car.planner_mu, 9.0)
    assert Setup.read(json.loads(json.dumps(setup.described(), allow_nan=False))).first.assumed_mu == expected


def test_an_opponent_in_a_car_like_the_learning_one_is_told_what_that_is_set_to():
    worlds = Worlds(EnvironmentSettings(mu=0.6, opponents=(TOLD, {"controller": TOLD, "mu": 0.8})))
    worlds.begin(np.ones(1, np.bool_), [fg.Start(s=4.0), fg.Start(s=2.0), fg.Start(s=0.0)], [0, 0, 0])
    worlds.drive(np.zeros((1, 2)))
    assert worlds.engine.commands[1:, 1].tolist() == [least(0.6), least(0.8)]


def test_what_is_drawn_is_not_told():
    result = fg.rollout("oval", TOLD, n=4, time_limit=0.02, record="telemetry", randomize={"mu": (0.5, 0.7)})
    column = fg.TELEMETRY.index("command_speed_m_s")
    assert (result["mu"] < 0.7).all() and [result.telemetry(i)[0, column] for i in range(4)] == [OWN] * 4
    alone = fg.race(result.setup(0))
    assert alone.car.planner_mu == OWN and alone.car.mu == pytest.approx(result["mu"][0], rel=1e-5)


def test_a_live_view_whose_tires_change_tells_the_planner_until_it_was_given_another():
    session = LiveSession(Setup.of(controller=TOLD))
    for name, value, expected in (("mu", 0.5, least(0.5)), ("planner_mu", 0.7, 0.7), ("mu", 0.4, 0.7)):
        session.change(name, value)
        session.tick()
        assert session.simulation.engine.commands[0, 1] == expected and session.message == ""


def test_the_command_line_turns_the_limit_off(capsys):
    main(["race", "--mu", "0.6", "--planner-mu", "off", "--time-limit", "0.1"])
    assert "mu 0.6; the planner has no limit" in capsys.readouterr().out
