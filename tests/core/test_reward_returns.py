"""What a crash is worth, and that no reward makes it worth more than driving on."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.envs.rewards import PRESETS, RUNNING_COSTS, Rewards

PATH = Path(__file__).parents[2] / "benchmarks" / "reward_returns.py"
CRASHES = ("crash at once", "sprint into a wall")
ONWARDS = [None, *(name for name in PRESETS if Rewards(preset=name).progress > 0.0)]  # `drift` is not worth driving on


@pytest.fixture(scope="module")
def benchmark():
    spec = importlib.util.spec_from_file_location("reward_returns", PATH)
    module = importlib.util.module_from_spec(spec)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(PATH.parent)  # as for a script
        spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def drives(benchmark):
    """Terms of each behaviour's drive of at most five seconds, of the first seed whose noise leads into no wall."""
    names = sorted({term.name for name in PRESETS for term in Rewards(preset=name).terms} | set(RUNNING_COSTS))
    found = {name: benchmark.driven("hairpins", name, 5.0, 2, names) for name in benchmark.BEHAVIOURS}
    assert [name for name, drive in found.items() if drive["collision"].any()] == list(CRASHES)
    return found


@each("gamma", [0.99, 0.995, 1.0])
@each("preset", ONWARDS)
def test_a_crash_is_worth_less_than_anything_else_and_driving_most(benchmark, drives, preset, gamma):
    worth = {name: benchmark.returns(Rewards(preset=preset), drive, gamma) for name, drive in drives.items()}
    others = {name: value for name, value in worth.items() if name not in CRASHES}
    assert max(worth[name] for name in CRASHES) < min(others.values())
    assert worth["stand"] < worth["crawl"] < worth["drive"] == max(worth.values())


@each("weights", [{"sliding": 20.0}, dict.fromkeys(RUNNING_COSTS, 1000.0)], ids=["sliding", "all"])
def test_no_weight_of_a_running_cost_rewards_a_crash(benchmark, drives, weights):
    """A tick without a crash costs no more than the way that is lost. A plain sum of these weights rewards a crash."""
    noisy, bounded = drives["drive noisily"], Rewards(**weights)
    on = noisy["collision"] == 0.0
    ticks = benchmark.tick_rewards(bounded, noisy)
    assert (ticks[on] >= np.minimum(noisy["progress"][on], 0.0) - 1e-12).all() and on.sum() > 30
    worth = {name: benchmark.returns(bounded, drives[name], 0.99) for name in drives}
    assert max(worth[name] for name in CRASHES) < worth["drive noisily"] < worth["drive"]
    plain = Rewards(**weights, bounded=False)
    assert benchmark.returns(plain, noisy, 0.99) < benchmark.returns(plain, drives["crash at once"], 0.99)


def test_what_cannot_gain_is_not_bounded():
    """A plain cost of time stays one; a term of one's own that gains bounds it again."""
    assert Rewards(progress=0.0, time=1.0).share == Rewards(bounded=False).share == float("inf")
    assert Rewards(progress=0.0, time=1.0, speed=1.0).share == Rewards().share < 1.0


def test_presets_are_weights():
    assert Rewards.of("no_slide") == Rewards.of({"preset": "no_slide"}) == Rewards(sliding=10.0, slip=1.0, impact=0.5)
    changed = Rewards.of({"preset": "no_slide", "sliding": 2.0})
    assert (changed.sliding, changed.slip, changed.collision) == (2.0, 1.0, 10.0)
    for given in ("noslide", {"preset": 3}, {"preset": "no_slid"}, {"bounded": 1}, 3):
        with pytest.raises(fg.SettingsError, match="accepted: ") as found:
            Rewards.of(given)
        assert "\n" not in str(found.value)
    with pytest.raises(fg.SettingsError, match="did you mean 'no_slide'"):
        Rewards.of("noslide")
