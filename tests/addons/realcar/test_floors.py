"""Floors: their friction reaches the tires and the planner at every door, and is named by what is said of a race."""

from __future__ import annotations

import gymnasium
import pytest

import fg_mujoco as fg
from fg_mujoco.addons.realcar.floors import Floor, floor_names
from fg_mujoco.envs.environment_settings import EnvironmentSettings
from fg_mujoco.errors import SettingsError
from fg_mujoco.simulation.settings import friction_text
from fg_mujoco.vehicle.tires import Tires, tire_names

SHORT = {"laps": 1, "time_limit": 0.2}


def test_every_floor_says_where_how_and_by_whom_it_was_measured():
    for name in floor_names():
        floor = Floor.load(name)
        assert floor.name == name
        assert all((floor.where, floor.how, floor.car, floor.ground, floor.source))
    assert Floor.load("icra2026").mu == pytest.approx(20.0 / (3.8 * 9.81), abs=5e-5)
    assert fg.Setup.of(floor="f1tenth_gym").first.tires_mu == fg.Setup().first.tires_mu == 1.0489


def test_every_set_of_tires_from_elsewhere_says_its_floor():
    ours = {"coulomb", "contact"}
    assert {name for name in tire_names() if not Tires.load(name).floor} == ours


def test_tires_are_scaled_from_the_floor_that_they_were_measured_on():
    measured = Tires.load("forzaeth_nuc2").described() | {"floor": "ipz8"}
    tires, here, there = Tires.load(measured), Floor.load("ipz8"), Floor.load("icra2026")
    assert here.mu_of(tires) is None
    assert there.mu_of(tires) == pytest.approx(tires.peak * there.mu / here.mu)
    assert there.mu_of(Tires.load("forzaeth_nuc2")) == there.mu_of(Tires.load("coulomb")) == there.mu
    assert tires.sha256 == Tires.load("forzaeth_nuc2").sha256  # the numbers are the same
    setup = fg.Setup.of(floor="icra2026", tires=measured)
    assert setup.first.tires_mu == pytest.approx(tires.peak * there.mu / here.mu)
    assert fg.Setup.of(floor="ipz8", tires=measured).first.tires_mu == tires.peak


def test_a_race_on_a_floor_is_that_at_its_friction_and_says_the_floor(tmp_path):
    on_floor = fg.race("oval", **SHORT, floor="icra2026")
    mu = Floor.load("icra2026").mu
    plain = fg.race("oval", **SHORT, mu=mu)
    assert on_floor.trajectory_sha256 == plain.trajectory_sha256
    assumed = pytest.approx(mu * on_floor.setup.first.tire_set.least_share, rel=1e-5)
    assert (on_floor.car.mu, on_floor.car.planner_mu, on_floor.car.floor) == (mu, assumed, "icra2026")
    assert plain.car.floor is None
    summary = fg.read_run(fg.write_run(on_floor, tmp_path / "run", picture=False)).summary
    assert summary["floor"] == "icra2026"
    assert fg.Setup.read(summary["settings"]) == on_floor.setup
    assert friction_text(mu, mu, "icra2026") == "mu 0.5365 on floor icra2026; the planner assumes 0.5365"


def test_rollouts_and_environments_have_it_too(tmp_path):
    mu = Floor.load("ipz8").mu
    rollout = fg.rollout("oval", n=1, **SHORT, floor="ipz8", out=tmp_path / "out")
    assert rollout.setup(0).first.tires_mu == mu
    gymnasium.make("fg_mujoco/F1Tenth-v0", track="oval", floor="ipz8").reset(seed=0)
    settings = EnvironmentSettings.of({"track": "oval", "floor": "ipz8", "opponents": ["wall_follow"]})
    assert [car.mu for car in settings.make_world().cars] == [mu, mu]
    with pytest.raises(SettingsError, match="randomize has mu, and floor is 'ipz8'; accepted: one of them"):
        EnvironmentSettings.of({"floor": "ipz8", "randomize": {"mu": (0.5, 0.9)}})
