"""A planner teaches a policy, before PPO trains it: the policy drives, and learns what the planner would have done.

In turns the policy and the planner drive each world: the policy sees where its own mistakes lead, and how the planner
comes back from there. In every step the planner is asked, and the actor is fitted to its answers of the last steps. The
planner is told the friction and the latency of each world; the policy has to tell them by what it sees. This is DAgger
(Ross, Gordon and Bagnell, "A Reduction of Imitation Learning and Structured Prediction to No-Regret Online Learning",
2011) with a teacher that knows more than its student (Chen et al., "Learning by Cheating", 2019). It needs the extra
`train`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.errors import missing_extra

try:
    import torch
    from stable_baselines3.common.callbacks import BaseCallback
except ImportError as error:
    raise missing_extra("training needs Stable-Baselines3", "train") from error

from fg_mujoco.envs.observer import FLAT, PRIVILEGED
from fg_mujoco.messages import Controller, FloatArray, PlannerContext, Reading
from fg_mujoco.racing.planners import make_controller
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.planner_adapter import Planners, PlannersOfEach, Surroundings, adapt
from fg_mujoco.simulation.planner_adapter import start as start_planner

from .stable_baselines3_env import F1TenthVecEnv
from .training_settings import Teacher, TrainingProgress

_STEPS = np.array((0.01, 1e-3, 1e-3))  # [-], [s], [s] planners are told rounded numbers, so that they can be used again
_EDGE = 0.3  # of an action's range to one side: errors beyond it count linearly
_EVERY = 2  # steps between two times at which the actor is fitted
_TOLD = 50_000  # steps between two calls of `watch`


_Told = tuple[float, ...]
"""Friction coefficient, by how much scans are late [s], and the delay of commands [s]."""


class Teachers:
    """A planner for each world of an environment, told its friction and its latency, that watches and drives the car.

    Args:
      source: of the planner, as `make_controller` takes it.
      env: whose worlds they are.
      max_speed: fastest that they command [m/s].

    Raises:
      ControllerError: it cannot be built.
    """

    def __init__(self, source: str, env: F1TenthVecEnv, max_speed: float) -> None:
        self._worlds, self._source, self._max_speed = env.envs.episodes.worlds, source, max_speed
        self._planners: list[tuple[_Told, Controller] | None] = [None] * env.num_envs
        self._free: dict[_Told, list[Controller]] = {}
        self._adapted: list[Planners] = []
        self._watched = _Watched(self._worlds.engine)
        self._together = PlannersOfEach([])
        for world in range(env.num_envs):
            self._adapted.append(adapt([self._take(world)]))
        self._group()

    def begin(self, which: NDArray[np.bool_]) -> None:
        """Begin anew in the worlds `which` (n,), whose episodes begin."""
        for world in np.flatnonzero(which).tolist():
            self._adapted[world] = adapt([self._take(world)])
        if which.any():
            self._group()

    def _take(self, world: int) -> Controller:
        """Return a planner that is told what holds in a world, and that no other world has."""
        had = self._planners[world]
        if had is not None:
            self._free.setdefault(had[0], []).append(had[1])
        worlds = self._worlds
        mu = worlds.engine.frictions[world * worlds.cars]
        true = np.array((mu, worlds.late[world], worlds.command_delays[world]))
        told: _Told = tuple((np.maximum(np.floor(true / _STEPS), (1.0, 0.0, 0.0)) * _STEPS).tolist())
        free = self._free.get(told)
        planner = free.pop() if free else make_controller(self._source, self._context(*told))
        start_planner(planner)
        self._planners[world] = told, planner
        return planner

    def _context(self, mu: float, late: float, command_delay: float) -> PlannerContext:
        world, drive = self._worlds.world, self._worlds.settings.driven(max_speed=self._max_speed)
        context = drive.context(replace(world.parameters, command_delay=command_delay), None)
        return replace(
            context, mu=mu, period=self._worlds.period, latency=late + command_delay,
            lidar=world.vehicle.lidar.beams.geometry,
        )  # fmt: skip

    def _group(self) -> None:
        cars = self._worlds.cars
        self._together = PlannersOfEach([
            (np.array([world * cars]), planners) for world, planners in enumerate(self._adapted)
        ])

    def commands(self) -> FloatArray:
        """Return what the planners command for what the cars sense now. Shape (n, 2) [rad, m/s]."""
        self._together(self._watched)
        return self._watched.commands[:: self._worlds.cars]


class _Watched:
    """The cars of an engine, with commands beside those that they are driven by; see Cars."""

    def __init__(self, engine: Engine) -> None:
        self._engine, self.commands = engine, np.zeros_like(engine.commands)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._engine, name)

    @property
    def running(self) -> NDArray[np.bool_]:
        """See Cars."""
        return self._engine.running

    def readings(self, row: int) -> Mapping[str, Reading]:
        """See Cars."""
        return self._engine.readings(row)

    def surroundings(self, row: int) -> Surroundings:
        """See Cars."""
        return self._engine.surroundings(row)


@dataclass(kw_only=True, eq=False)
class _Lessons:
    """What was seen, and what the planner would have answered, in the last steps."""

    seen: NDArray[np.float16]  # (room, width)
    actions: NDArray[np.float32]  # (room, 2) from -1 to 1
    count: int = 0
    place: int = 0

    @classmethod
    def of(cls, room: int, width: int) -> _Lessons:
        return cls(seen=np.zeros((room, width), np.float16), actions=np.zeros((room, 2), np.float32))

    def add(self, seen: NDArray[np.float32], actions: FloatArray) -> None:
        places = (self.place + np.arange(len(seen))) % len(self.seen)
        self.seen[places], self.actions[places] = seen, actions
        self.place = (self.place + len(seen)) % len(self.seen)
        self.count = min(self.count + len(seen), len(self.seen))


class Turns:
    """Whose turn it is in each of n worlds: the lengths of turns are drawn, exponentially distributed.

    Args:
      settings: of the teacher.
      count: of worlds, n.
      period: of a step [s].
      rng: that draws them.

    Attributes:
      of_policy: whether it is the policy's turn (n,).
    """

    def __init__(self, settings: Teacher, count: int, period: float, rng: np.random.Generator) -> None:
        self._planner, self._policy = settings.planner_turn / period, settings.policy_turn / period
        self._rng, self.of_policy = rng, np.zeros(count, np.bool_)
        self._left = rng.exponential(self._planner, count)

    def go_on(self, share: float) -> None:
        """Go on for a step, after a share of the lessons; the policy's turns grow to their length in half of them."""
        self._left -= 1.0
        over = self._left <= 0.0
        self.of_policy ^= over
        lengths = np.where(self.of_policy, self._policy * min(0.2 + 1.6 * share, 1.0), self._planner)
        self._left[over] = self._rng.exponential(lengths[over])


def teach(
    model: Any, env: F1TenthVecEnv, settings: Teacher, seed: int, watch: Callable[[TrainingProgress], None] | None
) -> dict[str, float]:
    """Fit the actor of a PPO to what a planner does, and return the figures of the end.

    Args:
      model: of Stable-Baselines3, before its first step.
      env: that it learns in, with one flat observation.
      settings: of the teacher.
      seed: of the turns and of the lessons' order.
      watch: called now and then; None: nobody is.

    Raises:
      ControllerError: the planner cannot be built.
      PlannerError: it fails.
    """
    began = time.perf_counter()
    episodes, policy = env.envs.episodes, model.policy
    rng = np.random.default_rng((seed, env.num_envs))
    observation = env.reset()
    teachers = Teachers(settings.planner, env, episodes.interface.speed_range[1])
    turns = Turns(settings, env.num_envs, episodes.worlds.period * episodes.interface.action_repeat, rng)
    low, high = episodes.interface.bounds.low, episodes.interface.bounds.high
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    lessons = _Lessons.of(settings.lessons, _flat(observation).shape[1])
    actor = [each for name, each in policy.named_parameters() if not _of_critic(name)]
    optimiser = torch.optim.Adam(actor, lr=settings.learning_rate)
    figures: dict[str, float] = {}
    losses, slid, ends, done = [0.0], [0.0], [0, 0], 0
    while done < settings.steps:
        share = done / settings.steps
        wanted = episodes.actions.towards(teachers.commands())
        lessons.add(_flat(observation), (wanted - middle) / half)
        own = model.predict(observation, deterministic=True)[0]
        turns.go_on(share)
        observation, _, over, infos = env.step(np.where(turns.of_policy[:, np.newaxis], own, wanted))
        teachers.begin(over)
        slid += [float(infos[i]["sliding_share"]) for i in np.flatnonzero(over)]
        crashes = sum(infos[i]["end_reason"] == "crash" for i in np.flatnonzero(over))
        ends = [ends[0] + int(over.sum()), ends[1] + crashes]
        before, done = done, done + env.num_envs
        if done // (_EVERY * env.num_envs) > before // (_EVERY * env.num_envs):
            for group in optimiser.param_groups:
                group["lr"] = settings.learning_rate * (1.0 - 0.95 * share)
            for _ in range(max(round(settings.passes * _EVERY * env.num_envs / settings.batch), 1)):
                losses.append(_fit(policy, optimiser, lessons, rng.integers(lessons.count, size=settings.batch)))
        if done // _TOLD > before // _TOLD or done >= settings.steps:
            figures = {"teacher/loss": float(np.mean(losses)), "teacher/sliding": float(np.mean(slid)),
                       "teacher/crashes": ends[1] / max(ends[0], 1)}  # fmt: skip
            losses, slid, ends = [losses[-1]], [slid[-1]], [0, 0]
            if watch is not None:
                rate = done / (time.perf_counter() - began)
                watch(TrainingProgress(steps=done, total=settings.steps, rate=rate, figures=figures))
    return figures


def _fit(policy: Any, optimiser: Any, lessons: _Lessons, chosen: NDArray[np.int64]) -> float:
    """Take a step of the actor towards the planner's answers of some lessons; return the loss."""
    seen = {FLAT: torch.from_numpy(lessons.seen[chosen].astype(np.float32))}
    if hasattr(policy.observation_space, "spaces"):
        unseen = policy.observation_space[PRIVILEGED].shape
        observation: Any = seen | {PRIVILEGED: torch.zeros((len(chosen), *unseen))}
    else:
        observation = seen[FLAT]
    found = policy.get_distribution(observation).distribution.mean
    loss = torch.nn.functional.smooth_l1_loss(found, torch.from_numpy(lessons.actions[chosen]), beta=_EDGE)
    optimiser.zero_grad()
    loss.backward()
    optimiser.step()
    return float(loss.item())


def _flat(observation: Any) -> NDArray[np.float32]:
    found: NDArray[np.float32] = observation[FLAT] if isinstance(observation, dict) else observation
    return found


def _of_critic(name: str) -> bool:
    """Return whether a parameter of a policy is the critic's alone, or the width of the noise."""
    return name.startswith("value_net") or ".value_net." in name or name == "log_std"


class CriticFirst(BaseCallback):  # type: ignore[misc]
    """Lets only the critic learn in the first steps of PPO, as one that knows nothing would undo what was taught.

    Args:
      steps: how many.
    """

    def __init__(self, steps: int) -> None:
        super().__init__()
        self._steps = steps

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        learns = self.model.num_timesteps >= self._steps
        for name, parameter in self.model.policy.named_parameters():
            if name == "log_std" or not _of_critic(name):
                parameter.requires_grad = learns
