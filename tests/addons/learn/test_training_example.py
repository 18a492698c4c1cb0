"""The training examples in short form: they learn, and what they learned races."""

import importlib.util
import re
import sys
from pathlib import Path

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each

pytest.importorskip("gymnasium")
pytest.importorskip("cma")

EXAMPLE = Path(__file__).parents[3] / "examples" / "train_policy.py"
if not EXAMPLE.exists():
    pytest.skip("not a checkout of the repository", allow_module_level=True)
SHORT_TWO = {"generations": 3, "population": 8, "starts": 2, "seconds": 4.0}
SHORT = {"generations": 7, "population": 8, "starts": 2, "duration": 3.0}


@pytest.fixture(scope="module")
def example():
    spec = importlib.util.spec_from_file_location("train_policy", EXAMPLE)
    module = sys.modules["train_policy"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    yield module
    sys.modules.pop("train_policy", None)


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


def test_what_was_learned_races_as_a_planner(example, trained, here, capsys):
    """Driven by the planner's interface it does what it did in the environment, but for float32."""
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

    return F1TenthVectorEnv(1, start="line", beam_step=example.BEAM_STEP, speed_range=example.SPEED_RANGE,
                            normalised_actions=True)  # fmt: skip


@each("page", ["environments.md", "addons/learn/training.md", "addons/learn/policies.md"])
def test_python_in_the_docs_runs(page, capsys, here):
    text = (EXAMPLE.parent.parent / "docs" / page).read_text("utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    assert len(blocks) >= 2
    needs = {"parallel_env": "pettingzoo", "stable_baselines3": "stable_baselines3", "dm_environment": "dm_control"}
    for block in blocks:  # ```py is not run, and says so
        if all(importlib.util.find_spec(package) for word, package in needs.items() if word in block):
            exec(block, {})


@pytest.fixture(scope="module")
def two():
    sys.path.insert(0, str(EXAMPLE.parent))
    import train_two_policies

    yield train_two_policies
    sys.path.remove(str(EXAMPLE.parent))
    for name in ("train_policy", "train_two_policies"):
        sys.modules.pop(name, None)


@pytest.fixture(scope="module")
def rivals(two):
    """The policies after each generation."""
    seen = []
    last = two.train(**SHORT_TWO, watch=lambda generation, policies: seen.append(policies.copy()))
    np.testing.assert_array_equal(seen[-1], last)
    return seen


def test_policies_get_further_beside_gap_finder_than_before(two, rivals, monkeypatch):
    """Measured values are beside what is asserted; before training every world ends in a crash."""
    monkeypatch.setattr(two, "JUDGED", SHORT_TWO["seconds"])  # what they were trained for
    envs = two.make("gap_finder", 4, "oval")
    before = two.judge(envs, np.zeros(two.PARAMETERS))
    after = [two.judge(envs, policy) for policy in rivals[-1]]
    envs.close()
    assert before[1] == 0.0 and np.isnan(before[2])
    assert min(kept for _, kept, _ in after) > 0.7  # 1.0, 1.0
    assert np.mean([metres for metres, _, _ in after]) > 2.0 * before[0]  # (13.3 + 18.0) / 2 m over 5.5 m


def test_rival_drives_as_the_policy_does(two):
    rng, rival = np.random.default_rng(0), two.Rival()
    rival.parameters = rng.normal(size=two.PARAMETERS)
    seen = {"scan": rng.uniform(0.1, 12.0, 55), "speed": np.ones(1), "yaw_rate": np.ones(1)}
    many = [np.tile(seen[name], (2, 1)) for name in ("scan", "speed", "yaw_rate")]
    np.testing.assert_array_equal(rival(seen), two.act(np.tile(rival.parameters, (2, 1)), *many)[1])
