"""Stable-Baselines3: the VecEnv is the vector environment, and its models race with the commands of the environment."""

import numpy as np
import pytest

from cases import each
from driven_environments import race_as_environment

sb3 = pytest.importorskip("stable_baselines3", reason="Stable-Baselines3 is not installed")

from stable_baselines3.common.env_checker import check_env  # noqa: E402
from stable_baselines3.common.vec_env import VecNormalize  # noqa: E402

from fg_mujoco.addons.learn.policy_files import read_policy, save_policy  # noqa: E402
from fg_mujoco.addons.learn.stable_baselines3_env import EpisodeLog, F1TenthVecEnv  # noqa: E402
from fg_mujoco.envs.gym_environment import F1TenthEnv  # noqa: E402
from fg_mujoco.envs.gym_vector import F1TenthVectorEnv  # noqa: E402

FLAT = {"track": "hairpins", "observation": "beams:54:max=10,speed,steering,previous_action,normalised,flat",
        "action": "steering_rate,acceleration", "normalised_actions": True, "speed_range": (0.5, 6.0), "start": "line"}
PARTS = {"track": "hairpins", "observation": "speed,beams:54", "speed_range": (0.5, 6.0), "start": "line"}


@each("settings", [FLAT, PARTS])
def test_its_checker_finds_nothing_in_the_environment(settings, recwarn):
    check_env(F1TenthEnv(**settings), skip_render_check=True)
    assert all("normalized" in str(each.message) for each in recwarn)  # an action that is no share of a range


def test_the_vec_env_is_the_vector_environment(tmp_path):
    env, plain = (F1TenthVecEnv(3, threads=1, time_limit=1.0, **FLAT),
                  F1TenthVectorEnv(3, threads=1, time_limit=1.0, autoreset_mode="SameStep", **FLAT))  # fmt: skip
    env.seed(7)
    rng, returns = np.random.default_rng(0), np.zeros(3)
    seen, (expected, _) = env.reset(), plain.reset(seed=7)
    assert seen.tobytes() == expected.tobytes()
    ended = 0
    for _ in range(59):
        actions = rng.uniform(-1.0, 1.0, (3, 2)).astype(np.float32)
        actions[0] = (0.0, -1.0)  # stands until the time is over
        seen, rewards, over, infos = env.step(actions)
        expected, true_rewards, terminated, truncated, facts = plain.step(actions)
        assert seen.tobytes() == expected.tobytes()
        np.testing.assert_array_equal(rewards, true_rewards.astype(np.float32))
        np.testing.assert_array_equal(over, terminated | truncated)
        returns += true_rewards
        for i in map(int, np.flatnonzero(over)):
            info, ended = infos[i], ended + 1
            assert info["terminal_observation"].tobytes() == facts["final_obs"][i].tobytes()
            assert info["TimeLimit.truncated"] == truncated[i]
            assert info["end_reason"] == facts["final_info"]["end_reason"][i]
            assert info["episode"]["r"] == pytest.approx(returns[i], abs=1e-5)
            assert 0.0 <= info["sliding_share"] <= 1.0
            returns[i] = 0.0
        assert all(not infos[i] for i in np.flatnonzero(~over))
    assert ended >= 3 and infos[0] == {}
    assert env.get_attr("num_envs", indices=[0, 2]) == [3, 3] and env.env_is_wrapped(object) == [False] * 3
    env.close()
    plain.close()


@pytest.fixture(scope="module", params=["PPO flat", "PPO parts", "SAC flat", "TD3 flat"])
def model(request):
    """A model after its first update, whose VecNormalize has seen something."""
    name, kind = request.param.split()
    env = VecNormalize(F1TenthVecEnv(2, threads=1, **(FLAT if kind == "flat" else PARTS)))
    policy = "MlpPolicy" if kind == "flat" else "MultiInputPolicy"
    usual = {"seed": 0, "device": "cpu", "policy_kwargs": {"net_arch": [16]}}
    if name == "PPO":
        made = sb3.PPO(policy, env, n_steps=16, batch_size=16, n_epochs=1, **usual)
    else:
        made = getattr(sb3, name)(policy, env, learning_starts=8, buffer_size=64, batch_size=8, **usual)
    return made.learn(32, callback=EpisodeLog())


@each("form", ["policy.zip", "policy.onnx"])
def test_a_model_races_with_the_commands_that_it_gives_in_the_environment(form, model, tmp_path):
    env, normaliser = F1TenthEnv(**(FLAT if model.observation_space.shape else PARTS)), model.get_vec_normalize_env()

    def check(seen, action):
        expected = model.predict(normaliser.normalize_obs(seen), deterministic=True)[0]
        np.testing.assert_allclose(np.clip(action, env.action_space.low, env.action_space.high), expected, atol=2e-5)

    race_as_environment(env, save_policy(model, tmp_path / form), 15, check=check)


def test_an_actor_that_does_not_see_all_becomes_onnx_and_zip_alike(tmp_path):
    pytest.importorskip("onnxscript", reason="onnxscript is not installed")
    from fg_mujoco.addons.learn.stable_baselines3_env import AsymmetricPolicy

    env = F1TenthVecEnv(1, threads=1, time_limit=0.5, privileged="mu", observation="beams:20,speed,flat")
    made = sb3.PPO(AsymmetricPolicy, env, n_steps=8, batch_size=8, device="cpu", policy_kwargs={"net_arch": [16]})
    policies = [read_policy(save_policy(made, tmp_path / name)) for name in ("policy.onnx", "policy.zip")]
    seen = np.random.default_rng(1).normal(size=21).astype(np.float32)
    actions = [policy.act(seen) for policy in policies]
    np.testing.assert_allclose(actions[0], actions[1], atol=1e-6)


def test_a_convolutional_policy_becomes_onnx(tmp_path):
    pytest.importorskip("onnxscript", reason="onnxscript is not installed")
    import torch

    class Convolution(torch.nn.Module):
        def __init__(self):
            super().__init__()
            self.inner, self.last = torch.nn.Conv1d(1, 2, 5, stride=2), torch.nn.Linear(51, 2)

        def forward(self, speed, scan):
            features = torch.relu(self.inner(scan[:, None, :])).flatten(1)
            return torch.tanh(self.last(torch.cat((features, speed), dim=1)))

    env, module = F1TenthEnv(**PARTS), Convolution()
    path = save_policy(module, tmp_path / "policy.onnx", env.policy_interface)
    seen, _ = env.reset(seed=0)
    with torch.no_grad():
        expected = module(*(torch.as_tensor(seen[name])[None] for name in ("speed", "scan")))[0].numpy()
    np.testing.assert_allclose(read_policy(path).act(seen), expected, atol=1e-6)
