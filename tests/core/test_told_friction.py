"""The friction that planners are told: what `mu` sets, unless `planner_mu` says otherwise; nothing that is drawn."""

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
from fg_mujoco.racing.setup import Setup
from fg_mujoco.simulation.settings import DriveSettings
from fg_mujoco.simulation.telemetry import COMMAND

TELLS = """
from fg_mujoco.messages import DriveCommand


class Tells:  # the friction coefficient that it is told, as a speed
    def __init__(self, *, mu):
        self.mu = mu

    def reset(self):
        pass

    def __call__(self, scan, odometry):
        return DriveCommand(steering_angle=0.0, speed=min(self.mu, 9.0))
"""
TOLD = "tells.py:Tells"
OWN = fg.Vehicle.load().nominal_mu
SPEED = COMMAND + 1

SETTINGS = [
    ({}, OWN),
    ({"mu": 0.6}, 0.6),
    ({"changes": fg.CarChanges(mu=0.6)}, 0.6),
    ({"mu": 0.6, "planner_mu": 0.9}, 0.9),
    ({"mu": 0.6, "planner_mu": math.inf}, 9.0),
    ({"mu": 0.6, "patches": (fg.Patch(x=0.0, y=0.0, length=9.0, width=9.0, mu=0.3),)}, 0.6),
]


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tells.py").write_text(TELLS)
    return tmp_path


def told(telemetry):
    return telemetry[0, SPEED]


@each(("settings", "expected"), SETTINGS)
def test_a_race_a_rollout_and_the_live_view_tell_what_is_set(settings, expected):
    race = fg.race("oval", TOLD, time_limit=0.02, **settings)
    assert told(race.car.telemetry) == expected
    assert min(race.car.planner_mu, 9.0) == expected
    rollout = fg.rollout("oval", TOLD, n=1, time_limit=0.02, record="telemetry", **settings)
    assert told(rollout.telemetry(0)) == expected
    session = LiveSession(Setup.of(controller=TOLD, **settings))
    session.tick()
    assert session.simulation.engine.commands[0, 1] == expected


def test_tires_with_a_curve_tell_their_least_peak_by_as_much_less():
    plain, tires = fg.race("oval", TOLD, tires="forzaeth_nuc2", time_limit=0.02), fg.Tires.load("forzaeth_nuc2")
    scaled = fg.race("oval", TOLD, tires="forzaeth_nuc2", mu=0.5 * tires.peak, time_limit=0.02)
    assert told(plain.car.telemetry) == tires.least_peak
    assert told(scaled.car.telemetry) == pytest.approx(0.5 * tires.least_peak)


def test_each_of_several_cars_is_told_its_own():
    entries = [fg.Entry(controller=TOLD, mu=0.6), fg.Entry(controller=TOLD), fg.Entry(controller=TOLD, planner_mu=0.5)]
    race = fg.race("oval", entries=entries, time_limit=0.02)
    assert [told(car.telemetry) for car in race.cars] == [0.6, OWN, 0.5]
    assert [car.planner_mu for car in race.cars] == [0.6, OWN, 0.5]


def test_an_opponent_in_a_car_like_the_learning_one_is_told_what_that_is_set_to():
    worlds = Worlds(EnvironmentSettings(mu=0.6, opponents=(TOLD, {"controller": TOLD, "mu": 0.8})))
    worlds.begin(np.ones(1, np.bool_), [fg.Start(s=4.0), fg.Start(s=2.0), fg.Start(s=0.0)], [0, 0, 0])
    worlds.drive(np.zeros((1, 2)))
    assert worlds.engine.commands[1:, 1].tolist() == [0.6, 0.8]


def test_what_is_drawn_is_not_told():
    result = fg.rollout("oval", TOLD, n=4, time_limit=0.02, record="telemetry", randomize={"mu": (0.5, 0.7)})
    assert (result["mu"] < 0.7).all()
    assert [told(result.telemetry(i)) for i in range(4)] == [OWN] * 4
    alone = fg.race(result.setup(0))
    assert told(alone.car.telemetry) == OWN and alone.car.mu == pytest.approx(result["mu"][0], rel=1e-5)


def test_a_live_view_whose_tires_change_tells_the_planner_until_it_was_given_another():
    session = LiveSession(Setup.of(controller=TOLD))
    for name, value, expected in (("mu", 0.5, 0.5), ("planner_mu", 0.7, 0.7), ("mu", 0.4, 0.7)):
        session.change(name, value)
        session.tick()
        assert session.simulation.engine.commands[0, 1] == expected and session.message == ""


# -- what is written


def test_settings_that_are_read_back_assume_the_same():
    for told in ({"mu": 0.6}, {"mu": 0.6, "planner_mu": math.inf}, {}, {"planner_mu": 0.9}):
        settings, setup = DriveSettings(**told), Setup.of(**told)
        described = json.loads(json.dumps(settings.described(), allow_nan=False))
        assert DriveSettings.of(described).assumed_mu == settings.assumed_mu == setup.first.assumed_mu
        assert Setup.read(json.loads(json.dumps(setup.described()))).first.assumed_mu == settings.assumed_mu


# -- where both are shown


@pytest.mark.slow
def test_table_and_report_show_both(here, capsys):
    pytest.importorskip("bokeh", reason="no bokeh here: pip install -e '.[report]'")
    main(["race", "--mu", "0.6", "--planner-mu", "off", "--time-limit", "0.3", "--out", "run"])
    assert "  friction          mu 0.6; the planner has no limit\n" in capsys.readouterr().out
    page = (here / "run" / "report.html").read_text()
    assert "<b>0.6</b><span>μ of the tires</span>" in page
    assert "<b>off</b><span>μ that the planner assumes</span>" in page
