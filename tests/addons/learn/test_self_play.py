"""Self-play: who is drawn from the pool of opponents, how snapshots drive, and which are kept."""

from collections import Counter

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.learn.policy_files import save_policy
from fg_mujoco.addons.learn.policy_planner import PolicyPlanner
from fg_mujoco.addons.learn.self_play import SelfPlay, Snapshots
from fg_mujoco.envs.environment_settings import EnvironmentSettings
from fg_mujoco.envs.policy_interface import PolicyInterface
from small_policies import FLAT, network_for


def snapshot(path, settings, seed, **network):
    """A policy file of random weights for the car of the oval."""
    world = fg.World("oval")
    beams = world.vehicle.lidar.beams
    interface = PolicyInterface.of(EnvironmentSettings.of(settings), world.parameters, beams, beams.period)
    return save_policy(network_for(interface, seed=seed, **network), path, interface)


def test_the_pool_draws_snapshots_for_their_share_and_each_member_as_often(tmp_path):
    own = SelfPlay(share=0.75, planners=("gap_finder", "pure_pursuit"))
    snapshots = [tmp_path / f"{i}.json" for i in range(3)]
    drawn = Counter(own.pool(snapshots).at((i + 0.5) / 2400) for i in range(2400))
    assert drawn == {"gap_finder": 300, "pure_pursuit": 300} | {str(path): 600 for path in snapshots}
    before = Counter(own.pool().at((i + 0.5) / 100) for i in range(100))
    assert before == {"gap_finder": 50, "pure_pursuit": 50}
    for share, expected in ((0.0, {"gap_finder", "pure_pursuit"}), (1.0, set(map(str, snapshots)))):
        pool = SelfPlay(share=share, planners=own.planners).pool(snapshots)
        assert {pool.at(i / 50) for i in range(50)} == expected


def test_the_last_snapshots_are_kept_and_later_ones_than_the_checkpoint_forgotten(tmp_path):
    settings = SelfPlay(every=100, kept=2)
    snapshots = Snapshots(tmp_path, settings)
    for steps in (64, 128, 192, 256, 320):
        if snapshots.due(steps):
            snapshots.add(steps, b"{}")
    assert [path.name for path in snapshots.files] == ["0000000256.json", "0000000320.json"]
    again = Snapshots(tmp_path, settings, 300)
    assert [int(path.stem) for path in again.files] == [256] and not again.due(299) and again.due(300)
    assert [path.name for path in (tmp_path / "opponents").iterdir()] == ["0000000256.json"]


TICKS, COUNT = 30, 3


def drive(settings, pool, count=COUNT, seed=3):
    """The bits of what each of some worlds is told, and who was drawn; a world is reset every ten ticks."""
    vector = pytest.importorskip("fg_mujoco.envs.gym_vector")
    envs = vector.F1TenthVectorEnv(count, threads=1, autoreset_mode="Disabled", **settings)
    envs.set_randomization({"opponent": pool})
    observation, info = envs.reset(seed=seed)
    told = [observation.tobytes() if count == 1 else [row.tobytes() for row in observation]]
    drawn = [list(info["drawn_opponent"])]
    for tick in range(TICKS):
        if tick % 10 == 9:
            mask = np.arange(count) % 2 == tick // 10 % 2 if count > 1 else np.ones(1, bool)
            observation, info = envs.reset(options={"reset_mask": mask})
            drawn.append(list(info["drawn_opponent"]))
        else:
            observation, rewards, *_, info = envs.step(np.tile(np.float32([0.1, 0.5]), (count, 1)))
            told.append([*(row.tobytes() for row in observation), rewards.tobytes(), info["lead_m"].tobytes()])
    envs.close()
    return told, drawn


@each("other", [{}, {"action": "steering,speed", "smoothing": 0.0, "action_repeat": 1}])
def test_snapshots_asked_together_drive_as_planners_do(other, tmp_path, monkeypatch):
    seen = {**FLAT, "observation": "beams:54:max=10:delay=0.05,speed,command,history:2,normalised,flat", **other}
    files = [snapshot(tmp_path / f"{i}.json", seen, i, normalised=True) for i in range(2)]
    randomize = {"opponents": (1, 2), "opponent": ["gap_finder"], "opponent_speed": (1.0, 7.0)}
    settings = {**seen, "track": "oval", "grid_order": "random", "randomize": randomize}
    pool = SelfPlay(share=0.8).pool(files)
    together = drive(settings, pool)
    assert len({name for names in together[1] for name in names if name}) == 3  # all of the pool were drawn
    monkeypatch.setattr(PolicyPlanner, "batch_key", None)
    assert drive(settings, pool) == together


SMALL = {"environment": {"observation": "beams:20,speed,flat", "privileged": "mu", "track": "oval", "time_limit": 0.5,
                         "opponents": ["gap_finder"]}, "worlds": 2,
         "ppo": {"n_steps": 32, "minibatches": 2, "n_epochs": 1, "net": (8,)}, "self_play": {"every": 64, "kept": 2}}


def test_a_training_meets_its_snapshots_and_goes_on_with_them(tmp_path, monkeypatch):
    pytest.importorskip("stable_baselines3", reason="Stable-Baselines3 is not installed")
    from fg_mujoco.addons.learn import training
    from fg_mujoco.addons.learn.stable_baselines3_env import F1TenthVecEnv

    folder, pools = tmp_path / "race", []

    class Watched(F1TenthVecEnv):
        def __init__(self, *args, **settings):
            pools.append([len(settings["randomize"]["opponent"].values)])
            super().__init__(*args, **settings)

        def step_wait(self):
            pools[-1].append(len(self.envs._worlds.randomization.ranges["opponent"].values))
            return super().step_wait()

    monkeypatch.setattr("fg_mujoco.addons.learn.stable_baselines3_env.F1TenthVecEnv", Watched)
    training.train(folder, steps=192, **SMALL)
    assert [int(path.stem) for path in sorted((folder / "opponents").iterdir())] == [64, 128]
    training.train(folder, steps=320, **SMALL)
    assert [sorted(set(counts)) for counts in pools] == [[1, 2, 3], [3]]
    assert pools[1][0] == 3  # from the first reset on
    assert [int(path.stem) for path in sorted((folder / "opponents").iterdir())] == [192, 256]
    assert len(fg.race("oval", entries=[fg.Entry(controller=str(folder)), fg.Entry()], time_limit=0.2).cars) == 2
