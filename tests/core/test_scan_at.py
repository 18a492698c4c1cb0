"""The scan that a planner decided on, read back from a result or a run folder."""

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from conftest import Straight


class Listener(Straight):
    """Keeps all that it was told."""

    def reset(self):
        self.told = []

    def __call__(self, scan, odometry):
        self.told.append((scan, odometry))
        return super().__call__(scan, odometry)


@pytest.fixture(scope="module")
def run():
    planner = Listener(3.0)
    effects = fg.LidarEffects(range_noise_std=0.02, dropout_probability=0.1, latency=0.03)
    result = fg.race("oval", planner, laps=1, effects=effects, seed=5, odometry_drift=0.1)
    assert result.car.end_reason == "crash"
    return result, planner.told


def same(found, told):
    for ours, theirs in zip(found, told, strict=True):
        assert {f: np.asarray(v).tobytes() for f, v in vars(ours).items()} == {
            f: np.asarray(v).tobytes() for f, v in vars(theirs).items()
        }


@pytest.mark.slow
def test_it_is_what_the_planner_was_told_bit_for_bit(run, tmp_path):
    result, told = run
    folder = fg.read_run(fg.write_run(result, tmp_path / "run", picture=False))
    for source in (result, folder):
        same(fg.scan_at(source), told[-1])
        same(fg.scan_at(source, 0.0), told[0])
        same(fg.scan_at(source, 0.25), told[10])
        same(fg.scan_at(source, 0.26), told[10])  # between two decisions
        same(fg.scan_at(source, result.sim_time_s), told[-1])
    assert not np.array_equal(told[10][0].ranges, told[11][0].ranges)


@each("time", [-0.1, 1e3, float("nan")])
def test_a_time_outside_of_the_run_is_refused(run, time):
    with pytest.raises(fg.SettingsError, match=r"accepted: 0 to \d+\.\d+ s"):
        fg.scan_at(run[0], time)
