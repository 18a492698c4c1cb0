"""A policy that estimates what it is not told, such as the friction, from what it remembers, and acts on the estimate.

The estimator is a network that is fitted to the privileged terms while the policy is trained: it says a mean and a
standard deviation, by the likelihood of a Gaussian, and both are inputs of the actor, whose gradient does not change
it. Of a part that has a history of its own only the estimator takes the past: with hundreds of inputs that are nearly
alike PPO did not learn to drive. This is the concurrent training of Ji et al., "Concurrent Training of a Control Policy
and a State Estimator for Dynamic and Robust Legged Locomotion", IEEE Robotics and Automation Letters 7(2), 2022. It
needs the extra `train`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from fg_mujoco.errors import missing_extra

try:
    import torch
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.torch_layers import MlpExtractor
except ImportError as error:
    raise missing_extra("training needs Stable-Baselines3", "train") from error

from fg_mujoco.envs.observer import PRIVILEGED

from .stable_baselines3_env import AsymmetricPolicy

_WIDTHS = (128, 64)  # of the estimator's hidden layers
_LEARNING_RATE, _BATCH = 1e-3, 512


class EstimatingPolicy(AsymmetricPolicy):
    """An AsymmetricPolicy whose actor takes estimates of privileged terms besides.

    Args:
      args: as of AsymmetricPolicy.
      estimated: which of the privileged numbers.
      present: which numbers of the observation the actor takes; the estimator takes all.
      settings: as of AsymmetricPolicy.
    """

    def __init__(self, *args: Any, estimated: Sequence[int], present: Sequence[int], **settings: Any) -> None:
        self._estimated, self.present = list(estimated), list(present)
        super().__init__(*args, **settings)

    def _get_constructor_parameters(self) -> dict[str, Any]:
        found: dict[str, Any] = super()._get_constructor_parameters()
        return found | {"estimated": self._estimated, "present": self.present}

    def _build_mlp_extractor(self) -> None:
        super()._build_mlp_extractor()
        self.mlp_extractor = _EstimatingExtractor(
            self.mlp_extractor, self._places(), self.present, self.net_arch, self.activation_fn
        ).to(self.device)

    def _places(self) -> list[int]:
        """Return where the estimated numbers are in the joined observation."""
        first = 0
        for name, space in self.observation_space.spaces.items():
            if name == PRIVILEGED:
                break
            first += math.prod(space.shape)
        return [first + each for each in self._estimated]

    @property
    def estimator(self) -> Any:
        """The network of the estimates: means, then logarithms of standard deviations, of standardised terms."""
        return self.mlp_extractor.estimator


class _EstimatingExtractor(torch.nn.Module):  # type: ignore[misc]
    """Hidden layers of an actor that takes estimates besides what it sees, and of a critic that takes all."""

    def __init__(
        self, plain: Any, places: Sequence[int], present: Sequence[int], net_arch: Any, activation_fn: Any
    ) -> None:
        super().__init__()
        seen, count = plain.seen, len(places)
        self.value_net, self.latent_dim_vf = plain.value_net, plain.latent_dim_vf
        actor = MlpExtractor(len(present) + 2 * count, net_arch, activation_fn, "cpu")
        self.policy_net, self.latent_dim_pi = actor.policy_net, actor.latent_dim_pi
        widths = [len(seen), *_WIDTHS]
        hidden = [each for size in pairwise(widths) for each in (torch.nn.Linear(*size), torch.nn.Tanh())]
        self.estimator = torch.nn.Sequential(*hidden, torch.nn.Linear(widths[-1], 2 * count))
        self.register_buffer("seen", seen, persistent=False)
        self.register_buffer("_present", torch.tensor(list(present)), persistent=False)
        self.register_buffer("_places", torch.tensor(list(places)), persistent=False)
        self.register_buffer("_mean", torch.zeros(count))
        self.register_buffer("_std", torch.zeros(count))  # 0: not known yet

    def forward(self, features: Any) -> tuple[Any, Any]:
        """Return the last hidden layers of actor and critic."""
        return self.forward_actor(features), self.forward_critic(features)

    def forward_actor(self, features: Any) -> Any:
        """Return the last hidden layer of the actor."""
        seen = features[:, self.seen]
        return self.policy_net(torch.cat((seen[:, self._present], self.estimator(seen).detach()), dim=1))

    def forward_critic(self, features: Any) -> Any:
        """Return the last hidden layer of the critic."""
        return self.value_net(features)

    def standardise(self, features: Any) -> None:
        """Take the mean and the standard deviation of the terms as units of the estimates, if there are none yet."""
        if not self._std.any():
            terms = features[:, self._places]
            self._mean.copy_(terms.mean(0))
            self._std.copy_(terms.std(0).clamp(min=1e-6))

    def loss(self, features: Any) -> tuple[Any, Any]:
        """Return the mean negative logarithm of the likelihood, and the rms error of each term (k,) in its unit."""
        wanted = (features[:, self._places] - self._mean) / self._std
        mean, spread = self.estimator(features[:, self.seen]).chunk(2, dim=1)
        error = mean - wanted
        likelihood = 0.5 * (error * torch.exp(-spread)) ** 2 + spread
        return likelihood.mean(), (error.detach() ** 2).mean(0).sqrt() * self._std


class Estimation(BaseCallback):  # type: ignore[misc]
    """Fits the estimator of an EstimatingPolicy to each collection, once, after PPO has learned from it."""

    def _on_training_start(self) -> None:
        estimator = self.model.policy.estimator
        self._optimiser, self._features = torch.optim.Adam(estimator.parameters(), _LEARNING_RATE), None
        self._generator = torch.Generator().manual_seed(self.model.seed or 0)

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        """Keep the collection, whose actions were those of the estimator as it is until PPO has learned from them."""
        spaces = self.model.observation_space.spaces
        parts = [self.model.rollout_buffer.observations[name] for name in spaces]
        count = parts[0].shape[0] * parts[0].shape[1]
        self._features = torch.cat([torch.as_tensor(part).reshape(count, -1) for part in parts], dim=1).clone()

    def _on_rollout_start(self) -> None:
        if self._features is None:
            return
        extractor, features = self.model.policy.mlp_extractor, self._features
        extractor.standardise(features)
        errors = []
        for batch in torch.randperm(len(features), generator=self._generator).split(_BATCH):
            loss, error = extractor.loss(features[batch])
            self._optimiser.zero_grad()
            loss.backward()
            self._optimiser.step()
            errors.append(error)
        self._optimiser.zero_grad()  # so that PPO's own optimiser passes the estimator by
        for each, error in enumerate(torch.stack(errors).mean(0).tolist()):
            self.logger.record(f"estimate/error_{each}", error)
        self._features = None
