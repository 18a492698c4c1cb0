"""The training example in short form: it learns, and what it learned races."""

import importlib.util
import re
import sys
from pathlib import Path

import numpy as np
import pytest

import fg_mujoco as fg
from case_loops import cases

pytest.importorskip("gymnasium")
pytest.importorskip("cma")

EXAMPLE = Path(__file__).parents[3] / "examples" / "train_policy.py"
if not EXAMPLE.exists():
    pytest.skip("not a checkout of the repository", allow_module_level=True)
SHORT = {"generations": 7, "population": 8, "starts": 2, "duration": 3.0}


@pytest.fixture(scope="module")
def example():
    spec = importlib.util.spec_from_file_location("train_policy", EXAMPLE)
    module = sys.modules["train_policy"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    yield module
    del sys.modules["train_policy"]


@pytest.fixture(scope="module")
def trained(example):
    """Policies and learning curves of three seeds, chosen before any was run; the size was then chosen for its time."""
    return {seed: example.train("oval", seed=seed, **SHORT) for seed in (1, 2, 3)}


def test_learning_curve_rises(trained):
    """Rewards per second. Margins as measured are beside what is asserted."""
    rises, best = [], []
    for _, curve in trained.values():
        assert curve.shape == (7, 8)
        first, last = curve[0], curve[-3:]
        rises.append(last.mean() - first.mean())
        best.append(last.max(axis=1).mean() - first.max())
    assert min(rises) > 1.0  # measured: 1.5, 8.0, 6.8
    assert np.mean(rises) > 3.0  # 5.5
    assert min(best) > 0.0  # .5, 4.4, 4.7: the best of a first generation is luck
    assert np.mean(best) > 1.5  # 3.2


def test_what_was_learned_races_as_a_planner(example, trained, tmp_path, monkeypatch, capsys):
    """Driven by the planner's interface it does what it did in the environment, but for float32."""
    monkeypatch.chdir(tmp_path)
    parameters = trained[3][0]
    np.savez("policy.npz", parameters=parameters)
    race = fg.race("oval", example.LearnedPolicy(example.Settings()), laps=1, time_limit=1.0)
    envs = gym_environment(example)
    seen, _ = envs.reset()
    positions = []
    for _ in range(40):
        action = example.act(parameters[np.newaxis], *(seen[name] for name in ("scan", "speed", "yaw_rate")))
        seen, *_, infos = envs.step(action)
        positions.append(infos["progress_m"][0])
    np.testing.assert_allclose(race.car.column("progress_m")[1:], positions[: len(race.car.telemetry) - 1], atol=1e-3)
    assert positions[-1] > 0.5


def gym_environment(example):
    from fg_mujoco.envs.gym_vector import F1TenthVectorEnv

    return F1TenthVectorEnv(
        1, start="line", beam_step=example.BEAM_STEP, speed_range=example.SPEED_RANGE, normalised_actions=True
    )


def test_python_in_the_docs_runs(capsys, tmp_path, monkeypatch):
    for page in cases("environments.md", "addons/learn/training.md", "addons/learn/policies.md"):
        monkeypatch.chdir(tmp_path)
        text = (EXAMPLE.parent.parent / "docs" / page).read_text("utf-8")
        blocks = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
        assert len(blocks) >= 2
        needs = {"parallel_env": "pettingzoo", "stable_baselines3": "stable_baselines3", "dm_environment": "dm_control"}
        for block in blocks:  # ```py is not run, and says so
            if all(importlib.util.find_spec(package) for word, package in needs.items() if word in block):
                exec(block, {})
