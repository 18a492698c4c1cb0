"""Shares of a rollout's worlds by a parameter: counts, intervals, and from where to where all is well."""

import math

import numpy as np
import pytest

import fg_mujoco as fg
from fg_mujoco.cli.main import main
from fg_mujoco.rollouts.shares import Shares, wilson

MU = np.array([0.2, 0.25, 0.35, 0.5, 0.55, 0.7, 0.9, 1.0])
ENDS = ["crash", "crash", "timeout", "finished", "finished", "finished", "finished", "finished"]


def test_worlds_are_counted_by_hand_and_the_safe_range_is_the_longest():
    shares = Shares.of("mu", MU, ENDS, np.array([1.0, 0.5, 0, 0, 0, 0.1, 0, 0]), 4)
    assert shares.edges.tolist() == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0])
    assert shares.worlds.tolist() == [3, 2, 1, 2]
    assert {kind: own.tolist() for kind, own in shares.counts.items()} == {
        "finished": [0, 2, 1, 2], "crashed": [2, 0, 0, 0], "slid": [2, 0, 1, 0]
    }  # fmt: skip
    assert shares.interval("crashed")[0].tolist() == pytest.approx(wilson(2, 3))
    assert shares.safe == pytest.approx((0.4, 0.6)) and "from mu 0.400 to 0.600" in shares.text()
    unmeasured = Shares.of("mu", MU, ENDS, None, 4)
    assert "slid" not in unmeasured.counts and unmeasured.safe == pytest.approx((0.4, 1.0))
    none = Shares.of("mu", np.array([0.3, 0.9]), ["crash", "crash"], None, 3)
    assert none.safe is None and np.isnan(none.share("crashed")[1]) and "in no range" in none.text()
    assert Shares.of("mu", np.array([0.5, 0.5]), ["finished"] * 2, None, 8).worlds.tolist() == [2]


def test_by_is_of_a_rollouts_columns_and_draws(tmp_path, capsys):
    out = tmp_path / "out"
    arguments = ["rollout", "--n", "6", "--laps", "1", "--randomize", "mu=0.7:1.0", "--time-limit", "0.5"]
    assert main([*arguments, "--by", "mu", "--out", str(out)]) == 0
    assert "Safe, all worlds finish" in capsys.readouterr().out
    assert (out / "by_mu.svg").read_bytes().startswith(b"<?xml") and "Wilson" in (out / "by_mu.md").read_text()
    result = fg.read_rollout(out)
    assert result.by("mu", 3).worlds.sum() == 6
    with pytest.raises(fg.SettingsError, match="has no numbers; accepted: "):
        result.by("end_reason")
    with pytest.raises(fg.SettingsError, match="no column 'my'"):
        result.by("my")
    assert main([*arguments, "--by", "my"]) == 2


def test_a_share_covers_what_it_should():
    """How often Wilson's interval of 10 runs covers a share of .3 is counted exactly: in 92.4 % of the outcomes."""
    covered = [k for k in range(11) if wilson(k, 10)[0] <= 0.3 <= wilson(k, 10)[1]]
    assert sum(math.comb(10, k) * 0.3**k * 0.7 ** (10 - k) for k in covered) == pytest.approx(0.924, abs=5e-4)
