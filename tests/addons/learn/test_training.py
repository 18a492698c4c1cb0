"""Training: a folder that is a planner, from which training goes on; and a table in which a policy is compared."""

import json

import numpy as np
import pytest

import fg_mujoco as fg
from fg_mujoco.addons.learn.policy_files import read_policy, save_policy
from fg_mujoco.addons.learn.training_settings import TrainingSettings
from fg_mujoco.cli.main import main
from fg_mujoco.envs.environment_settings import EnvironmentSettings
from fg_mujoco.envs.policy_interface import PolicyInterface
from small_policies import FLAT, network_for

SMALL = {"environment": {"observation": "beams:20,speed,flat", "privileged": "mu", "track": "oval", "time_limit": 1.0},
         "worlds": 2, "ppo": {"n_steps": 32, "minibatches": 2, "n_epochs": 1, "net": (8,)}}  # fmt: skip


@pytest.fixture
def train():
    pytest.importorskip("stable_baselines3", reason="Stable-Baselines3 is not installed")
    from fg_mujoco.addons.learn.training import train

    return train


def test_a_training_goes_on_and_its_folder_is_a_planner(train, tmp_path):
    folder = tmp_path / "first"
    assert train(folder, steps=128, checkpoints=2, **SMALL).steps == 128
    before = read_policy(folder)
    assert before.trained["steps"] == 128 and str(before.interface.observation).endswith("flat")
    assert before.interface.privileged == ()  # the actor does not see it
    assert train(folder, steps=256, checkpoints=2, **SMALL).steps == 256
    lines = [json.loads(line) for line in (folder / "progress.jsonl").read_text().splitlines()]
    assert [line["steps"] for line in lines] == [64, 128, 192, 256]
    assert sum(line["episode/count"] for line in lines) >= 2 and lines[1]["train/learning_rate"] > 0.0
    assert {"end/time_limit", "end/crash"} & set().union(*lines)
    names = [path.name for path in sorted((folder / "checkpoints").iterdir())]
    assert names[0] == "0000000064.zip" and names[-1] == "0000000256.zip"
    assert list((folder / "log").iterdir())
    races = [fg.race("oval", str(path), time_limit=0.3) for path in (folder, folder / "checkpoints" / names[-1])]
    np.testing.assert_allclose(races[0].ctrl, races[1].ctrl, atol=1e-5)
    seen = np.ones(21, np.float32)
    assert not np.array_equal(before.act(seen), read_policy(folder).act(seen))
    with pytest.raises(fg.RunFolderError, match=r"has a training with ppo.gamma 0.99, not 0.9; accepted"):
        train(folder, steps=512, **{**SMALL, "ppo": {**SMALL["ppo"], "gamma": 0.9}})


def test_the_same_training_has_the_same_bits(train, tmp_path):
    folders = [tmp_path / "one", tmp_path / "other"]
    for folder in folders:
        train(folder, steps=64, **SMALL)
    assert (folders[0] / "policy.onnx").read_bytes() == (folders[1] / "policy.onnx").read_bytes()


def test_a_correction_of_a_planner_has_usual_settings(tmp_path):
    """Refused is what cannot be driven, without torch."""
    settings = TrainingSettings(environment={"track": "oval", "residual": "gap_finder[assist=safe]"})
    assert "planner_command" in settings.environment["observation"]


def test_an_interrupted_training_leaves_a_policy(train, tmp_path, monkeypatch, capsys):
    from fg_mujoco.addons.learn.training_callbacks import Recording

    def interrupt(self):
        if self.num_timesteps >= 100:
            raise KeyboardInterrupt

    monkeypatch.setattr(Recording, "_on_step", lambda self: interrupt(self) or True)
    file, folder = tmp_path / "settings.toml", tmp_path / "first"
    file.write_text('worlds = 2\n[environment]\nobservation = "beams:20,speed,flat"\n[ppo]\nn-steps = 32\nnet = [8]\n')
    assert main(["train", str(file), "--out", str(folder), "--steps", "1000"]) == 130
    assert "interrupted; its policy races" in capsys.readouterr().err
    assert sorted(path.name for path in (folder / "checkpoints").iterdir()) == ["0000000064.zip", "0000000100.zip"]
    assert len(fg.race("oval", str(folder), time_limit=0.2).ctrl) == 8


def test_a_policy_is_compared_with_planners_for_each_friction(tmp_path):
    settings = EnvironmentSettings.of(FLAT)
    world = fg.World("oval")
    interface = PolicyInterface.of(settings, world.parameters, world.vehicle.lidar.beams, 0.025)
    save_policy(network_for(interface), tmp_path / "first", interface)
    ran = fg.compare([str(tmp_path / "first"), "gap_finder"], track=["oval"], mu=[0.6, 1.0], laps=1, seed=0,
                     out=tmp_path / "table", workers=1, time_limit=1.0)  # fmt: skip
    assert [(cell["planner"], cell["mu"], cell["runs"]) for cell in ran.cells] == [("first", 0.6, 1), ("first", 1.0, 1),
        ("gap_finder", 0.6, 1), ("gap_finder", 1.0, 1), ("first", "all", 2), ("gap_finder", "all", 2)]  # fmt: skip
