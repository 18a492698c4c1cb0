"""Rollouts: each world is its own, whatever is driven with it; and what each mistake is told before anything runs."""

import math
import os
import signal
import threading
import time

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.errors import SettingsError, TrackError
from fg_mujoco.racing.result import trajectory_sha256
from rollout_worlds import stand_in

RANDOMIZE = {"mu": (0.6, 1.2), "max_speed": [4, 6, 8], "start_s": (0.0, 50.0), "start_speed": (0.0, 2.0)}
MANY = {"randomize": RANDOMIZE, "time_limit": 0.5, "opponents": ["disparity_extender"]}


@pytest.fixture
def no_engine(monkeypatch):
    """The stand-in in place of the engine."""
    monkeypatch.setattr("fg_mujoco.rollouts.job.drive_worlds", stand_in)


def same(a, b):
    """Whether all bits of two arrays are the same, those of NaN too."""
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()


# -- each world is its own


@pytest.fixture(scope="module")
def twelve():
    """A dozen worlds of two tracks, all recorded."""
    return fg.rollout(["oval", "hairpins"], n=12, record="states", **MANY)


@pytest.mark.slow
@each(
    "options",
    [
        {"executor": fg.Executor(chunk=1)}, {"executor": fg.Executor(chunk=5), "workers": 1}, {"workers": 3},
        {"executor": fg.Executor(chunk=2, memory_budget=0)},
    ],
)
def test_chunks_workers_and_budget_change_nothing(twelve, options):
    again = fg.rollout(["oval", "hairpins"], n=12, record="states", **MANY, **options)
    assert same(again.worlds, twelve.worlds)
    assert same(again.lap_times_s, twelve.lap_times_s)
    for world in range(12):
        for trace in ("telemetry", "states", "ctrl"):
            assert same(getattr(again, trace)(world), getattr(twelve, trace)(world))


def assert_is_its_race(result, world):
    race = fg.race(result.setup(world))
    assert trajectory_sha256(result.states(world), result.ctrl(world)) == race.trajectory_sha256
    assert same(result.telemetry(world), race.car.telemetry)
    for name in ("end_reason", "laps_completed", "collisions", "max_slide_m_s", "slide_time_fraction", "max_speed_m_s"):
        assert result.worlds[world][name] == race.summary()[name], name


@pytest.mark.slow
def test_so_it_is_where_everything_differs_from_world_to_world():
    everything = {
        "mass": (3.2, 4.5), "cog_height": (0.05, 0.09), "steering_gain": (0.5, 1.0), "speed_gain": (0.5, 1.0),
        "command_delay": (0.0, 0.1), "lidar_noise": (0.0, 0.05), "lidar_dropout": (0.0, 0.1),
        "start_offset": (-0.3, 0.3), "start_heading": (-0.2, 0.2), "planner_mu": [0.7, math.inf], "obstacles": "1|2",
        "planner.lookahead": (5.0, 12.0),
    }  # fmt: skip
    settings = {"randomize": RANDOMIZE | everything, "opponents": ["pure_pursuit"], "time_limit": 0.5}
    result = fg.rollout(["oval", "tight"], n=6, record="states", **settings)
    for world in range(6):
        assert_is_its_race(result, world)


# -- what a result says


def test_columns_are_what_was_drawn_and_how_it_went(twelve):
    assert set(RANDOMIZE) < set(twelve.names)
    assert ((twelve["mu"] >= 0.6) & (twelve["mu"] <= 1.2)).all()
    assert set(twelve["max_speed"].tolist()) <= {4, 6, 8}
    assert [twelve.setup(i).first.changes.mu for i in range(12)] == twelve["mu"].tolist()
    assert (twelve["sim_time_s"] <= 0.5 + 1e-9).all()
    assert not twelve["mu"].flags.writeable
    assert len(twelve) == 12
    with pytest.raises(SettingsError, match="no column 'grip'; accepted: world, track, mu"):
        twelve["grip"]


def test_the_summary_counts_all_worlds(no_engine):
    result = fg.rollout("oval", n=200, randomize={"mu": (0.5, 1.5)}, executor=fg.Executor(chunk=7))
    summary = result.summary()
    finished = sum(seed % 2 == 0 for seed in result["seed"].tolist())
    assert summary["end_reasons"] == {"finished": finished, "crash": 200 - finished}
    assert summary["finished"] == finished / 200
    assert summary["worlds_driven"] == 200
    assert summary["world_seconds"] == sum(seed % 10 for seed in result["seed"].tolist())
    assert summary["lap_times"][0]["first_lap_s"]["q50"] == pytest.approx(result.tracks[0].length / 8.0)
    assert summary["max_slide_m_s"]["q5"] == pytest.approx(0.55, abs=0.1)  # the stand-in has mu there
    assert summary["max_slide_m_s"]["q100"] == result["mu"].max()


# -- worlds that fail, and workers that are stopped


def test_ctrl_c_stops_the_workers_and_is_raised(no_engine, monkeypatch):
    before = threading.active_count()
    pressed = []

    def engine(scenarios, controller, *, stop, **options):
        pressed.append(len(pressed))
        if pressed[-1] == 1:
            os.kill(os.getpid(), signal.SIGINT)
        while not stop():
            time.sleep(0.01)
        return stand_in(scenarios, controller)

    monkeypatch.setattr("fg_mujoco.rollouts.job.drive_worlds", engine)
    with pytest.raises(KeyboardInterrupt):
        fg.rollout("oval", n=4, executor=fg.Executor(chunk=1), workers=2)
    assert threading.active_count() == before


# -- what is refused before anything runs


@pytest.fixture
def nothing_runs(monkeypatch):
    def engine(*args, **options):
        raise AssertionError("a world was driven")

    monkeypatch.setattr("fg_mujoco.rollouts.job.drive_worlds", engine)


def test_no_track_and_too_narrow_a_track_are_refused(nothing_runs):
    with pytest.raises(SettingsError, match="no track"):
        fg.rollout([])
    line = 8.0 * np.column_stack((np.cos(a := np.linspace(0, 2 * np.pi, 60, endpoint=False)), np.sin(a)))
    narrow = fg.Track(name="narrow", centreline=line, width_right=np.full(60, 0.1), width_left=np.full(60, 0.1))
    with pytest.raises(TrackError, match="wider than the car"):
        fg.rollout(["oval", narrow])


def test_settings_reach_the_planners(tmp_path):
    (tmp_path / "mine.py").write_text(
        "from dataclasses import dataclass\nfrom fg_mujoco.messages import DriveCommand\n\n"
        "@dataclass\nclass Settings:\n    speed: float = 1.0\n\n"
        "class Planner:\n    Settings = Settings\n    def __init__(self, settings): self.settings = settings\n"
        "    def reset(self): pass\n    def __call__(self, scan, odometry):\n"
        "        return DriveCommand(steering_angle=0.0, speed=self.settings.speed)\n"
    )
    result = fg.rollout(
        "oval", f"{tmp_path / 'mine.py'}:Planner", n=4, randomize={"planner.speed": (0.5, 2.0)}, time_limit=1.5,
        record="telemetry",
    )  # fmt: skip
    column = fg.TELEMETRY.index("command_speed_m_s")
    assert [result.telemetry(i)[-1, column] for i in range(4)] == result["planner.speed"].tolist()
