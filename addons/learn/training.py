"""Trains a policy by PPO of Stable-Baselines3, in a folder from which training goes on. It needs the extra `train`.

    train("first", environment={"track": "oval"}, steps=1_000_000)
    fg.race("oval", "first")

    training.json       the settings, the versions, and how far it is
    policy.onnx         the policy as it is now: the folder is a planner
    checkpoints/        policy.zip files with the optimiser and the statistics of rewards, one every few steps
    progress.jsonl      one line an iteration: returns, ends, lap times, sliding, losses
    log/                the same for TensorBoard

The same call goes on with the last checkpoint; `steps` may then be more. Ctrl-C writes a checkpoint and the policy.
Training that went on has other bits than training without an interruption, as all episodes begin anew.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fg_mujoco.course.documents import read_json
from fg_mujoco.course.files import is_file, read_text
from fg_mujoco.display import brief, quoted
from fg_mujoco.envs.policy_interface import PolicyInterface
from fg_mujoco.errors import ControllerError, RunFolderError, SettingsError, missing_extra
from fg_mujoco.messages import shown
from fg_mujoco.racing.run_folder import check_run_folder
from fg_mujoco.simulation.settings import known_settings

from .policy_files import read_content
from .stable_baselines3_policy import load_model, restore_normalize, zip_description
from .training_settings import CHECKPOINTS, LOG, MAY_CHANGE, SCHEMA, SETTINGS, TrainingProgress, TrainingSettings

if TYPE_CHECKING:
    from .stable_baselines3_env import F1TenthVecEnv

_LOG_STD = -0.7  # of the actions' noise, where nothing else is said


@dataclass(frozen=True, kw_only=True, repr=False)
class Training:
    """A training that has come to its end: its folder is a planner."""

    folder: Path
    steps: int
    seconds: float  # of wall time, of this call
    figures: Mapping[str, float]  # of the last iteration

    def __repr__(self) -> str:
        return brief(self, quoted(self.folder), f"{self.steps} steps")


def train(
    out: str | Path,
    *,
    watch: Callable[[TrainingProgress], None] | None = None,
    callbacks: Sequence[Any] = (),
    **settings: Any,
) -> Training:
    """Train a policy in a folder, or go on with the training there.

    Loading a checkpoint, of `out` or `start_from`, runs the code in it.

    Args:
      out: a new or empty folder, or one of a training with the same settings.
      watch: called after each iteration.
      callbacks: further ones of Stable-Baselines3.
      settings: those of TrainingSettings, by name.

    Raises:
      SettingsError, TrackError: what cannot be driven or learned; nothing is written then.
      RunFolderError: the folder has something else, or a training with other settings.
      ControllerError: a checkpoint that cannot be read.
      MissingExtraError: Stable-Baselines3 or torch are not installed.
      KeyboardInterrupt: Ctrl-C, after a checkpoint and the policy are written.
    """
    chosen, folder = TrainingSettings(**known_settings(settings, TrainingSettings, "a training")), Path(out)
    last = _last_checkpoint(folder, chosen)
    begins_with = chosen.first_weights() if last is None else last
    content = b"" if begins_with is None else read_content(begins_with)
    try:
        import torch
        from stable_baselines3.common.logger import Logger

        from .stable_baselines3_env import F1TenthVecEnv
    except ImportError as error:
        raise missing_extra("training needs Stable-Baselines3", "train") from error
    from .training_callbacks import Record, Recording

    began = time.perf_counter()
    torch.set_num_threads(chosen.threads)
    env = F1TenthVecEnv(chosen.worlds, threads=chosen.threads, **chosen.environment)
    try:
        model = _new_model(chosen, env) if last is None else _old_model(chosen, env, last, content)
        if last is None and begins_with is not None:
            _take_weights(model, env.policy_interface, begins_with, content)
            if chosen.ppo.log_std is not None:
                model.policy.log_std.data.fill_(chosen.ppo.log_std)
        folder.mkdir(parents=True, exist_ok=True)
        record = Record(folder, model, chosen, env.policy_interface)
        record.write_settings()
        model.set_logger(Logger(str(folder / LOG), record.formats()))
        if model.num_timesteps < chosen.steps:
            try:
                model.learn(
                    chosen.steps - model.num_timesteps, callback=[Recording(record, watch), *callbacks],
                    reset_num_timesteps=last is None,
                )  # fmt: skip
            finally:
                record.save()
                record.close()
        return Training(
            folder=folder, steps=model.num_timesteps, seconds=time.perf_counter() - began, figures=record.figures
        )
    finally:
        env.close()


def _new_model(settings: TrainingSettings, env: F1TenthVecEnv) -> Any:
    """Return the algorithm before its first step."""
    import stable_baselines3
    import torch
    from stable_baselines3.common.utils import LinearSchedule

    own = settings.ppo
    activations = {"tanh": torch.nn.Tanh, "relu": torch.nn.ReLU, "elu": torch.nn.ELU, "silu": torch.nn.SiLU}
    names = ("n_steps", "n_epochs", "gamma", "gae_lambda", "clip_range", "ent_coef", "vf_coef", "max_grad_norm",
             "target_kl")  # fmt: skip
    env.seed(settings.seed)
    model = stable_baselines3.PPO(
        _policy_class(env), _normalised(settings, env),
        learning_rate=LinearSchedule(own.learning_rate, 0.05 * own.learning_rate, 1.0),
        batch_size=own.n_steps * settings.worlds // own.minibatches,
        policy_kwargs={
            "net_arch": list(own.net), "activation_fn": activations[own.activation],
            "log_std_init": _LOG_STD if own.log_std is None else own.log_std,
        },
        seed=settings.seed, device="cpu", **{name: getattr(own, name) for name in names},
    )  # fmt: skip
    if env.policy_interface.residual is not None:  # it begins as the planner
        for parameter in model.policy.action_net.parameters():
            parameter.data.zero_()
    return model


def _take_weights(model: Any, interface: PolicyInterface, file: Path, content: bytes) -> None:
    """Give an algorithm the weights of a policy.zip.

    Raises:
      ControllerError: the policy sees or answers something else, or has another network; both are named. One that
        answers accelerations may have another range of speeds.
    """
    try:
        described = zip_description(content)
        trained, now = (each.described() for each in (PolicyInterface.read(described["interface"]), interface))
        free = {"privileged", "car"} | ({"speed_range"} if "acceleration" in str(now["action"]) else set())
        for name in (each for each in now | trained if each not in free and now.get(each) != trained.get(each)):
            raise SettingsError(f"its policy has {name} {trained.get(name)}, not {now.get(name)}; accepted: the same")
        model.policy.load_state_dict(load_model(content, described).policy.state_dict())
    except (SettingsError, RuntimeError, KeyError) as error:
        said = " ".join(str(error).split())
        raise ControllerError(f"start_from {file}: {said}") from error


def _policy_class(env: F1TenthVecEnv) -> Any:
    """Return the class of the policy: the actor does not see what is privileged."""
    if env.policy_interface.privileged:
        from .stable_baselines3_env import AsymmetricPolicy

        return AsymmetricPolicy
    return "MultiInputPolicy" if env.observation_space.shape is None else "MlpPolicy"


def _old_model(settings: TrainingSettings, env: F1TenthVecEnv, checkpoint: Path, content: bytes) -> Any:
    """Return the algorithm of a checkpoint, ready to go on."""
    try:
        described, wrapped = zip_description(content), _normalised(settings, env)
        model = load_model(content, described, env=wrapped)
    except SettingsError as error:
        raise ControllerError(f"{checkpoint}: {error}") from error
    restore_normalize(wrapped, described.get("vec_normalize") or {})
    env.seed(settings.seed + model.num_timesteps)  # other worlds than in the beginning
    return model


def _normalised(settings: TrainingSettings, env: F1TenthVecEnv) -> Any:
    """Return the environment with the statistics of rewards and observations around it."""
    from stable_baselines3.common.vec_env import VecNormalize

    own = settings.ppo
    return VecNormalize(
        env, norm_obs=own.normalise_observation, norm_reward=own.normalise_reward, gamma=own.gamma, clip_reward=math.inf
    )


def _last_checkpoint(folder: Path, settings: TrainingSettings) -> Path | None:
    """Return the checkpoint from which training goes on; None: it begins.

    Raises:
      RunFolderError: the folder has something else, or a training with other settings.
    """
    path = folder / SETTINGS
    if not is_file(path):
        check_run_folder(folder)
        return None
    try:
        found = read_json(read_text(path), "as a training wrote it")
        if found["schema"] != SCHEMA:
            raise ValueError(f"schema {found['schema']}")
        before, now = dict(found["settings"]), settings.described()
    except (OSError, ValueError, KeyError, TypeError) as error:
        said = f"{path}: cannot be read: {type(error).__name__}: {error}"
        raise RunFolderError(f"{said}; accepted: as a training wrote it") from error
    for name in now:
        if name not in MAY_CHANGE and now[name] != before.get(name):
            said = f"has a training with {_difference(name, before.get(name), now[name])}"
            raise RunFolderError(f"{folder}: {said}; accepted: the same settings, or a new folder")
    checkpoints = sorted((folder / CHECKPOINTS).glob("*.zip"))
    return checkpoints[-1] if checkpoints else None


def _difference(name: str, before: Any, now: Any) -> str:
    """Return in words the first setting that differs."""
    if isinstance(before, dict) and isinstance(now, dict):
        for each in dict.fromkeys((*before, *now)):
            if before.get(each) != now.get(each):
                return _difference(f"{name}.{each}", before.get(each), now.get(each))
    return f"{name} {shown(before)}, not {shown(now)}"
