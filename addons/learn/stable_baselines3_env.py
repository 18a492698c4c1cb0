"""The vector environment as a VecEnv of Stable-Baselines3, and what its training tells of episodes.

    from stable_baselines3 import PPO
    from fg_mujoco.addons.learn.stable_baselines3_env import EpisodeLog, F1TenthVecEnv

    env = F1TenthVecEnv(64, track="oval", observation="beams:108,speed,normalised,flat", normalised_actions=True)
    model = PPO("MlpPolicy", env, tensorboard_log="logs")
    model.learn(100_000, callback=EpisodeLog())

It needs the extra `train`. World i is the world i of `F1TenthVectorEnv`: all are stepped in C threads of this process,
without workers.
"""

from __future__ import annotations

import math
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.arguments import Remade
from fg_mujoco.display import brief
from fg_mujoco.errors import missing_extra

try:
    import torch
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.policies import MultiInputActorCriticPolicy
    from stable_baselines3.common.torch_layers import MlpExtractor
    from stable_baselines3.common.vec_env import VecEnv
except ImportError as error:
    raise missing_extra("training with Stable-Baselines3 needs Stable-Baselines3", "train") from error

# isort: split
# Stable-Baselines3 needs Gymnasium itself
from gymnasium.vector import AutoresetMode

from fg_mujoco.envs.gym_vector import F1TenthVectorEnv
from fg_mujoco.envs.observer import PRIVILEGED

_NO_INFO: dict[str, Any] = {}
_DECIMALS = 6  # of an episode's return and length, as Monitor has them


class F1TenthVecEnv(Remade, VecEnv):  # type: ignore[misc]
    """Worlds with a car each, for the algorithms of Stable-Baselines3. A finished world is reset in the same step.

    The info of a world is empty but for the end of an episode. Then it has `terminal_observation`,
    `TimeLimit.truncated`, `episode` (`r` return, `l` steps, `t` seconds since the environment was made), all facts of
    the episode, `end_reason`, `lap_times_s`, and `sliding_share` of the episode's steps in which a tire slid.

    Args:
      num_envs: how many worlds.
      threads: that step the worlds; None: one for each core.
      render_mode: "rgb_array" or None.
      settings: those of EnvironmentSettings, by name.

    Attributes:
      envs: the F1TenthVectorEnv.
      policy_interface: what a policy sees and answers, for `save_policy`.

    Raises:
      TrackError, SettingsError: what cannot be driven.
    """

    def __init__(
        self, num_envs: int = 1, *, threads: int | None = None, render_mode: str | None = None, **settings: Any
    ) -> None:
        self.envs = F1TenthVectorEnv(
            num_envs, autoreset_mode=AutoresetMode.SAME_STEP, threads=threads, render_mode=render_mode, **settings
        )
        self.policy_interface = self.envs.policy_interface
        super().__init__(num_envs, self.envs.single_observation_space, self.envs.single_action_space)
        self._began = time.monotonic()
        self._actions: Any = None
        self._returns, self._slid = np.zeros(num_envs), np.zeros(num_envs)
        self._lengths = np.zeros(num_envs, np.int64)
        self._infos: list[dict[str, Any]] = [_NO_INFO] * num_envs

    def __repr__(self) -> str:
        return brief(self, repr(self.envs))

    def reset(self) -> Any:
        """Begin the episodes of all worlds, with the seeds and options that `seed` and `set_options` have set."""
        seed = None if all(each is None for each in self._seeds) else self._seeds
        if all(options == self._options[0] for options in self._options):
            observation, _ = self.envs.reset(seed=seed, options=self._options[0])
        else:
            for i, options in enumerate(self._options):
                mask = np.arange(self.num_envs) == i
                observation, _ = self.envs.reset(seed=seed, options={**options, "reset_mask": mask})
        for counts in (self._returns, self._slid, self._lengths):
            counts[:] = 0
        self._reset_seeds()
        self._reset_options()
        return observation

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """Keep the actions (n, 2) for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[Any, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Drive for a step; return observations, rewards (n,), which episodes are over (n,), and infos."""
        observation, rewards, terminated, truncated, facts = self.envs.step(self._actions)
        self._returns += rewards
        self._lengths += 1
        over = terminated | truncated
        infos = self._infos.copy()
        self._slid += facts["sliding"]  # 0 where an episode begins
        for i in map(int, np.flatnonzero(over)):
            infos[i] = self._ending(i, facts, bool(truncated[i] and not terminated[i]))
        return observation, rewards.astype(np.float32), over, infos

    def _ending(self, i: int, facts: Mapping[str, Any], cut: bool) -> dict[str, Any]:
        """Return the info of a world whose episode is over, and begin its counts anew."""
        final = {name: _plain(values[i]) for name, values in facts["final_info"].items() if not name.startswith("_")}
        length, seconds = int(self._lengths[i]), time.monotonic() - self._began
        final |= {
            "terminal_observation": _row(facts["final_obs"], i),
            "TimeLimit.truncated": cut,
            "sliding_share": float(self._slid[i] + final["sliding"]) / length,
            "episode": {"r": round(float(self._returns[i]), _DECIMALS), "l": length, "t": round(seconds, _DECIMALS)},
        }
        self._returns[i] = self._slid[i] = self._lengths[i] = 0
        return final

    def close(self) -> None:
        """Close the thread pool and the renderer."""
        self.envs.close()

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """Return a frame of each world."""
        return self.envs.render() or [None] * self.num_envs

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of the vector environment once for each of the worlds; all share it."""
        return [getattr(self.envs, attr_name)] * self._count(indices)

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of the vector environment, which all worlds share."""
        setattr(self.envs, attr_name, value)

    def env_method(self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any) -> list[Any]:
        """Call a method of the vector environment once; return its result for each of the worlds."""
        return [getattr(self.envs, method_name)(*method_args, **method_kwargs)] * self._count(indices)

    def env_is_wrapped(self, wrapper_class: type[Any], indices: Any = None) -> list[bool]:
        """Return whether each world has a wrapper: Monitor, whose `episode` is in the infos, and no other."""
        return [wrapper_class.__name__ == "Monitor"] * self._count(indices)

    def _count(self, indices: Any) -> int:
        return len(list(self._get_indices(indices)))


def _row(observation: Any, i: int) -> Any:
    if isinstance(observation, dict):
        return {name: values[i] for name, values in observation.items() if not name.startswith("_")}
    return observation[i]


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


class AsymmetricPolicy(MultiInputActorCriticPolicy):  # type: ignore[misc]
    """A policy for an environment with `privileged` terms: only the critic sees them, the actor does not.

    So the actor drives a car that does not sense them. It is for PPO and A2C.
    """

    def _build_mlp_extractor(self) -> None:
        spaces = self.observation_space.spaces.items()  # in this order their values are joined
        seen = [name != PRIVILEGED for name, space in spaces for _ in range(math.prod(space.shape))]
        self.mlp_extractor = _AsymmetricExtractor(seen, self.net_arch, self.activation_fn, self.device)


class _AsymmetricExtractor(torch.nn.Module):  # type: ignore[misc]
    """Hidden layers of an actor that takes the features that are `seen` (features,), and of a critic that takes all."""

    def __init__(self, seen: Sequence[bool], net_arch: Any, activation_fn: Any, device: Any) -> None:
        super().__init__()
        actor, critic = (MlpExtractor(size, net_arch, activation_fn, device) for size in (sum(seen), len(seen)))
        self.policy_net, self.value_net = actor.policy_net, critic.value_net
        self.register_buffer("seen", torch.tensor(np.flatnonzero(seen)), persistent=False)
        self.latent_dim_pi, self.latent_dim_vf = actor.latent_dim_pi, critic.latent_dim_vf

    def forward(self, features: Any) -> tuple[Any, Any]:
        """Return the last hidden layers of actor and critic."""
        return self.forward_actor(features), self.forward_critic(features)

    def forward_actor(self, features: Any) -> Any:
        """Return the last hidden layer of the actor."""
        return self.policy_net(features[:, self.seen])

    def forward_critic(self, features: Any) -> Any:
        """Return the last hidden layer of the critic."""
        return self.value_net(features)


class EpisodeLog(BaseCallback):  # type: ignore[misc]
    """Logs what the episodes of each collection were like: means by name, and the shares of the end reasons.

    `episode/return`, `steps`, `laps`, `progress_m`, `lap_time_s` of the laps driven, `speed_m_s`, `sliding` (share of
    the steps), with other cars `position` at the end and `touches`, `end/crash` and so on, and `reward/NAME`, the sum
    of each reward term in an episode.
    """

    def __init__(self) -> None:
        super().__init__()
        self._values: dict[str, list[float]] = defaultdict(list)
        self._ends: Counter[str] = Counter()

    def _on_step(self) -> bool:
        for info in self.locals["infos"]:
            if "episode" in info:
                self._take(info)
        return True

    def _take(self, info: Mapping[str, Any]) -> None:
        values = self._values
        values["episode/return"].append(info["episode"]["r"])
        values["episode/steps"].append(info["episode"]["l"])
        values["episode/sliding"].append(info["sliding_share"])
        values["episode/speed_m_s"].append(info["progress_m"] / max(info["time_s"], 1e-9))
        for name in ("laps", "progress_m", "position", "touches"):
            if name in info:
                values[f"episode/{name}"].append(info[name])
        laps: Iterable[float] = np.asarray(info.get("lap_times_s", ()), np.float64)
        values["episode/lap_time_s"] += [lap for lap in laps if lap == lap]
        for name, value in info.items():
            if name.startswith("return_"):
                values[f"reward/{name.removeprefix('return_')}"].append(value)
        self._ends[str(info.get("end_reason") or "steps")] += 1

    def _on_rollout_end(self) -> None:
        for name, found in self._values.items():
            if found:
                self.logger.record(name, float(np.mean(found)))
        count = sum(self._ends.values())
        for reason, times in self._ends.items():
            self.logger.record(f"end/{reason}", times / count)
        self.logger.record("episode/count", count)
        self._values.clear()
        self._ends.clear()
