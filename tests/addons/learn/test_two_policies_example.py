"""The example of two policies in short form: they learn against each other, and drive better against gap_finder."""

import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("gymnasium")
pytest.importorskip("cma")

EXAMPLES = Path(__file__).parents[3] / "examples"
if not EXAMPLES.exists():
    pytest.skip("not a checkout of the repository", allow_module_level=True)
SHORT = {"generations": 2, "population": 8, "starts": 2, "seconds": 4.0}


@pytest.fixture(scope="module")
def example():
    sys.path.insert(0, str(EXAMPLES))
    import train_two_policies

    yield train_two_policies
    sys.path.remove(str(EXAMPLES))
    for name in ("train_policy", "train_two_policies"):
        sys.modules.pop(name)


@pytest.fixture(scope="module")
def trained(example):
    """The policies after each generation."""
    seen = []
    last = example.train(**SHORT, watch=lambda generation, policies: seen.append(policies.copy()))
    np.testing.assert_array_equal(seen[-1], last)
    return seen


def test_policies_get_further_beside_gap_finder_than_before(example, trained, monkeypatch):
    """Measured values are beside what is asserted; before training every world ends in a crash."""
    monkeypatch.setattr(example, "JUDGED", 8.0)
    envs = example.make("gap_finder", 4, "oval")
    before = example.judge(envs, np.zeros(example.PARAMETERS))
    after = [example.judge(envs, policy) for policy in trained[-1]]
    envs.close()
    assert before[1] == 0.0 and np.isnan(before[2])
    assert min(kept for _, kept, _ in after) > 0.7  # 1.0, 1.0
    assert np.mean([metres for metres, _, _ in after]) > 2.0 * before[0]  # (14.3 + 33.3) / 2 m over 9.5 m


def test_rival_drives_as_the_policy_does(example):
    rng, rival = np.random.default_rng(0), example.Rival()
    rival.parameters = rng.normal(size=example.PARAMETERS)
    seen = {"scan": rng.uniform(0.1, 12.0, 55), "speed": np.ones(1), "yaw_rate": np.ones(1)}
    many = [np.tile(seen[name], (2, 1)) for name in ("scan", "speed", "yaw_rate")]
    np.testing.assert_array_equal(rival(seen), example.act(np.tile(rival.parameters, (2, 1)), *many)[1])
