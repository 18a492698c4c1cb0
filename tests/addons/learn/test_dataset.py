"""Recorded scans: what the planner was given and what it commanded, the same bits however they are driven."""

import json
import shutil
from types import SimpleNamespace

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.course.files import file_sha256
from fg_mujoco.errors import RunFolderError, SettingsError
from fg_mujoco.rollouts.recording import ScanLayout

WORLDS = {"n": 5, "randomize": {"start_s": (0.0, 30.0), "lidar_noise": (0.0, 0.02)}, "time_limit": 0.3, "seed": 3}
WITNESS = """
import json
from fg_mujoco.messages import DriveCommand


class Witness:
    '''Writes down what it is given and what it answers.'''

    def __init__(self, seed):
        self.path = {folder!r} + f"/{{seed}}.jsonl"

    def reset(self):
        open(self.path, "w").close()

    def __call__(self, scan, odometry):
        answer = DriveCommand(steering_angle=0.1 * odometry.stamp, speed=1.0 + odometry.stamp)
        row = {{"stamp": odometry.stamp, "speed": odometry.speed, "wheels": odometry.wheel_speeds.tolist()}}
        row |= {{"ranges": scan.ranges.tolist(), "command": [answer.steering_angle, answer.speed]}}
        with open(self.path, "a") as file:
            file.write(json.dumps(row) + "\\n")
        return answer
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder of two tracks and chunks of two worlds."""
    out = tmp_path_factory.mktemp("datasets") / "out"
    fg.rollout(["oval", "hairpins"], record="scans:10", out=out, executor=fg.Executor(chunk=2), workers=1, **WORLDS)
    return out


def same(one, other):
    return len(one) == len(other) and all(
        a.ticks.tobytes() == b.ticks.tobytes() and repr(a.result) == repr(b.result)  # NaN is NaN
        for a, b in zip(one, other, strict=True)
    )


def test_a_dataset_has_what_the_planner_was_given_and_what_it_commanded(tmp_path):
    (tmp_path / "witness.py").write_text(WITNESS.format(folder=str(tmp_path)))
    result = fg.rollout("oval", f"{tmp_path}/witness.py:Witness", record="scans:7", **WORLDS)
    for episode in result.dataset():
        rows = [json.loads(line) for line in (tmp_path / f"{episode.seed}.jsonl").read_text().splitlines()]
        assert len(rows) == len(episode) == 12
        ranges = np.array([row["ranges"] for row in rows])[:, 540 % 7 :: 7]
        ranges = np.where(np.isposinf(ranges), 30.0, ranges)
        np.testing.assert_allclose(episode.scans, ranges, atol=0.00051)
        assert episode["stamp"].tolist() == [row["stamp"] for row in rows]
        for name, key in (("speed", "speed"), ("wheel_speeds", "wheels"), ("command", "command")):
            np.testing.assert_array_equal(episode[name], np.array([row[key] for row in rows], np.float32))
        assert episode.end_reason == "time_limit"
        assert set(episode.drawn) == {"start_s", "lidar_noise"}


@each("options", [{"workers": 2}, {"executor": fg.Executor(chunk=5, memory_budget=0)}])
def test_chunks_and_workers_change_no_bit(options, folder):
    again = fg.rollout(["oval", "hairpins"], record="scans:10", **WORLDS, **options)
    assert same(fg.read_dataset(folder), again.dataset())
    assert [episode.world for episode in again.dataset()] == list(range(5))
    assert [episode.track for episode in again.dataset()] == ["oval", "hairpins"] * 2 + ["oval"]


def test_an_interrupted_rollout_is_a_dataset_of_what_it_finished_and_goes_on_with_the_same_bits(folder, tmp_path):
    part = tmp_path / "part"
    shutil.copytree(folder, part)
    for path in (*(part / "chunks").glob("000001.*"), part / "summary.json", part / "worlds.csv"):
        path.unlink()
    found = fg.read_dataset(part)
    assert [episode.world for episode in found] == [0, 1, 2, 3]  # world 4 is alone in chunk 1
    fg.rollout(["oval", "hairpins"], record="scans:10", out=part, **WORLDS)
    assert same(fg.read_dataset(part), fg.read_dataset(folder))
    assert file_sha256(part / "chunks/000001.scans.npy") == file_sha256(folder / "chunks/000001.scans.npy")


def test_only_car_0_is_recorded_and_only_while_it_races():
    result = fg.rollout("oval", n=1, opponents=["gap_finder"], time_limit=0.1, record="scans:100", seed=1)
    (episode,) = result.dataset()
    np.testing.assert_allclose(np.diff(episode["stamp"]), 0.025)
    assert len(episode) == 4


# -- ranges


@pytest.fixture(scope="module")
def beams():
    return fg.Setup(track="oval").first.car.lidar.beams


def test_ranges_are_kept_to_half_a_millimetre_and_codes_are_told_apart(beams):
    layout = ScanLayout.of(beams, 1)
    ranges = np.random.default_rng(0).uniform(0.06, 30.0, 1000)
    assert np.abs(layout.distances(layout.counts(ranges)) - ranges).max() < 0.000502
    odd = np.array([-np.inf, np.nan, np.inf, 0.0, 1e-9, 30.0])
    assert layout.counts(odd).tolist() == [0, 65534, 65535, 1, 1, 30000]
    np.testing.assert_allclose(layout.distances(layout.counts(odd)), [0.0, 0.0, 30.0, 0.001, 0.001, 30.0], rtol=1e-6)


@each("step", [1, 7, 10, 540, 541, 2000])
def test_the_beam_straight_ahead_is_among_the_recorded(step, beams):
    layout = ScanLayout.of(beams, step)
    assert np.abs(layout.bearings).min() < 1e-9
    np.testing.assert_allclose(layout.bearings, beams.bearings[layout.first :: step], atol=1e-12)


# -- what is refused


def test_a_folder_without_scans_is_refused(tmp_path):
    result = fg.rollout("oval", n=1, time_limit=0.1, out=tmp_path / "out")
    with pytest.raises(RunFolderError, match="has no scans, but 'summary'; accepted: a folder of `rollout"):
        fg.read_dataset(tmp_path / "out")
    with pytest.raises(SettingsError, match="accepted: a rollout with record='scans'"):
        result.dataset()
    with pytest.raises(RunFolderError, match=r"has no manifest.json"):
        fg.read_dataset(tmp_path)


# -- other formats


def test_minari_has_the_transitions(folder, monkeypatch):
    """What is given to Minari, which is not needed for that."""
    gymnasium = pytest.importorskip("gymnasium")
    kept, specs, stub = [], [], SimpleNamespace()
    stub.data_collector = SimpleNamespace(EpisodeBuffer=SimpleNamespace)
    stub.create_dataset_from_buffers = lambda buffer, env, **told: (kept.extend(buffer), specs.append(env))
    monkeypatch.setattr("fg_mujoco.addons.learn.dataset.require_minari", lambda: stub)
    found = fg.read_dataset(folder)
    found.to_minari("fg-mujoco/test-v0")
    assert len(kept) == 5
    for episode, given in zip(found, kept, strict=True):
        np.testing.assert_array_equal(given.observations["scan"], episode.scans)
        np.testing.assert_array_equal(given.actions, episode.commands[:-1])
        assert given.rewards.sum() == pytest.approx(episode["progress"][-1] - episode["progress"][0], abs=1e-5)
        assert given.truncations.tolist() == [False] * (len(episode) - 2) + [True]  # by the time limit
        assert not given.terminations.any()
    environment = gymnasium.make(gymnasium.envs.registration.EnvSpec.from_json(specs[0].to_json()))
    seen, _ = environment.reset(seed=0)
    for name, values in kept[0].observations.items():
        assert seen[name].shape == values.shape[1:], name
