"""Worlds driven together give the bits of the same worlds driven alone, and one that fails harms no other."""

import numpy as np
import pytest
from mujoco.batch import Batch

import fg_mujoco as fg
from cases import each
from fg_mujoco.lidar.effects import LidarEffects
from fg_mujoco.rollouts.drive_worlds import drive_worlds
from fg_mujoco.simulation.cars import CAR_PREFIX
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.settings import Scenario, Start
from fg_mujoco.vehicle.changes import CarChanges, change_worlds

NOISY = LidarEffects(range_noise_std=0.01, dropout_probability=0.01, latency=0.025, no_return="range_max")
SCENARIOS = (
    Scenario(),
    Scenario(changes=CarChanges(mu=0.8)),
    Scenario(changes=CarChanges(mass=4.2, center_of_gravity_height=0.08)),
    Scenario(changes=CarChanges(steering_gain=0.7, speed_gain=1.3)),
    Scenario(changes=CarChanges(command_delay=0.0223), planner_mu=0.7),
    Scenario(changes=CarChanges(command_delay=0.01, mu=0.9123456)),
    Scenario(seed=3, effects=NOISY, max_speed=5.0),
    Scenario(start=Start(s=7.0, offset=0.2, heading=0.1, speed=2.0), planner_mu=float("inf")),
    Scenario(obstacles=(fg.Box(x=6.0, y=0.3, length=0.3, width=0.3),)),
    Scenario(tires="forzaeth_nuc2", mu=0.8, changes=CarChanges(mass=4.2)),
    Scenario(tires="slipx_reference", start=Start(s=7.0, speed=2.0)),
    Scenario(tires="contact", seed=4),
    Scenario(track="chicanes", seed=5, effects=LidarEffects(range_noise_std=0.02)),
)
DURATION = 2.0


@pytest.fixture(scope="module")
def together():
    return drive_worlds(SCENARIOS, "gap_finder", time_limit=DURATION, record="states")


def alone(scenario, **settings):
    names = ("planner_mu", "max_speed", "seed", "obstacles", "effects", "changes", "start", "mu", "tires")
    told = {name: getattr(scenario, name) for name in names}
    return fg.race(scenario.track, laps=100, time_limit=DURATION, **told, **settings)


@each(
    "changes",
    (
        CarChanges(mu=0.7654321), CarChanges(mass=4.5), CarChanges(center_of_gravity_height=0.09),
        CarChanges(mass=3.3, center_of_gravity_height=0.0612345), CarChanges(steering_gain=1.234567, speed_gain=0.5),
        CarChanges(command_delay=0.0333333),
    ),
)  # fmt: skip
def test_a_changed_car_is_the_same_compiled_alone_or_in_a_batch(changes):
    """Oracle: the model compiled from the changed MJCF, every array of it."""
    plain = fg.World("oval", changes=CarChanges(command_delay=0.0) if changes.command_delay is not None else None)
    compiled = fg.World("oval", changes=changes).model
    batch = Batch(plain.model, 2, nthread=1, persistent=True)
    change_worlds(batch, [CarChanges(), changes], plain.vehicle.compile(), CAR_PREFIX)
    changed = batch.get_model(1)
    for name in dir(compiled):
        value = getattr(compiled, name)
        if isinstance(value, np.ndarray):
            assert value.tobytes() == getattr(changed, name).tobytes(), name
    assert batch.get_model(0).body_mass.tobytes() == plain.model.body_mass.tobytes()


PLANNERS = '''
import math
from fg_mujoco.messages import DriveCommand, STOP
class Straight:
    def __init__(self, max_speed):
        self.speed = max_speed
    def reset(self):
        self.ticks = 0
    def __call__(self, scan, odometry):
        self.ticks += 1
        return self.answer(scan)
    def answer(self, scan):
        return DriveCommand(steering_angle=0.0, speed=self.speed)
class Raises(Straight):
    def answer(self, scan):
        if self.speed > 2.0 and self.ticks > 3:
            raise RuntimeError("no idea")
        return DriveCommand(steering_angle=0.0, speed=1.0)
class Together(Straight):
    """Decides for many worlds at once; one command is no number."""
    @classmethod
    def batch(cls, planners):
        speeds = [planner.speed for planner in planners]
        def decide(geometry, ranges, odometry, running, commands):
            assert len(geometry.bearings) == ranges.shape[1] == 1081
            for i, speed in enumerate(speeds):
                commands[i] = 0.0, math.nan if speed == 3.0 and odometry[i]["stamp"] > 0.11 else 1.0
        return decide
'''


@pytest.fixture(scope="module")
def planners(tmp_path_factory):
    path = tmp_path_factory.mktemp("planners") / "planners.py"
    path.write_text(PLANNERS)
    return path


@each(("name", "ticks"), (("Raises", 3), ("Together", 5)))
def test_a_planner_that_fails_ends_its_world_and_no_other(planners, name, ticks):
    scenarios = [Scenario(max_speed=speed) for speed in (1.0, 3.0, 2.0)]
    results = drive_worlds(scenarios, f"{planners}:{name}", time_limit=0.5, record="telemetry")
    assert results.rows["end_reason"].tolist() == ["time_limit", "planner_failed", "time_limit"]
    assert results.rows["sim_time_s"] == pytest.approx([0.5, ticks * 0.025, 0.5])
    assert [len(telemetry) for telemetry in results.telemetry] == [20, ticks, 20]
    assert results.telemetry[0][:, 1:].tobytes() == results.telemetry[2][:, 1:].tobytes()


def test_a_state_that_mujoco_warns_of_ends_its_world_and_no_other(monkeypatch):
    place = Engine.place

    def place_badly(self, *args, **kwargs):
        place(self, *args, **kwargs)
        self.state(1)[1:4] = 1e12  # time comes first, then positions

    monkeypatch.setattr(Engine, "place", place_badly)
    results = drive_worlds([Scenario(), Scenario()], "gap_finder", time_limit=0.5)
    assert results.rows["end_reason"].tolist() == ["time_limit", "unstable"]


@each("latency", [0.0, 0.03])
def test_what_is_told_of_the_work_is_what_was_simulated(latency):
    """A latency of the LiDAR keeps worlds from doing many ticks in one call; some of them end before the others."""
    scenarios = [Scenario(effects=LidarEffects(latency=latency), seed=seed) for seed in range(3)]
    told = []
    results = drive_worlds(scenarios, "gap_finder", time_limit=2.0, watch=told.append)
    assert sum(told) == pytest.approx(results.rows["sim_time_s"].sum())


def test_stop_ends_what_still_runs(monkeypatch):
    monkeypatch.setattr("fg_mujoco.rollouts.drive_worlds._WORLD_TICKS", 4)
    told = []
    results = drive_worlds(
        [Scenario(), Scenario(seed=1)], "gap_finder", laps=1, stop=lambda: len(told) >= 2, watch=told.append
    )
    assert told == pytest.approx([0.1, 0.1])  # two ticks of two worlds
    assert results.rows["end_reason"].tolist() == ["interrupted"] * 2
    assert results.rows["sim_time_s"] == pytest.approx([0.1, 0.1])
    assert np.isnan(results.rows["first_lap_s"]).all() and np.isnan(results.lap_times_s).all()
