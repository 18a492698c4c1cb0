"""Stub of `gym` and `gymnasium` where these are not installed: environments, wrappers, spaces, make.

Where a library is installed it stays itself, and the environments are registered with it.
"""

from __future__ import annotations

import importlib
import importlib.machinery
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from fg_mujoco.errors import SettingsError, accepted_names
from fg_mujoco.messages import FloatArray


class Env:
    """An environment."""

    metadata: dict[str, Any] = {}  # noqa: RUF012  # as gym has it
    reward_range = (-float("inf"), float("inf"))
    render_mode: Any = None
    spec: Any = None
    action_space: Any = None
    observation_space: Any = None
    _np_random: np.random.Generator | None = None

    @property
    def unwrapped(self) -> Any:
        """Itself."""
        return self

    @property
    def np_random(self) -> np.random.Generator:
        """Its generator of random numbers."""
        if self._np_random is None:
            self._np_random = np.random.default_rng()
        return self._np_random

    @np_random.setter
    def np_random(self, generator: np.random.Generator) -> None:
        self._np_random = generator

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        """Seed its generator, where a seed is given."""
        if seed is not None:
            self._np_random = np.random.default_rng(seed)

    def step(self, action: Any) -> Any:
        """Be overridden."""
        raise NotImplementedError

    def render(self, *_: Any, **__: Any) -> Any:
        """Be overridden."""
        raise NotImplementedError

    def close(self) -> None:
        """Close nothing."""

    def __enter__(self) -> Any:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()


class Wrapper(Env):
    """An environment round another; what it does not have is that one's."""

    def __init__(self, env: Any) -> None:
        self.env = env

    def __getattr__(self, name: str) -> Any:
        if name in ("env", "_np_random") or name.startswith("__"):
            raise AttributeError(name)
        return getattr(self.env, name)

    def __getattribute__(self, name: str) -> Any:
        found = super().__getattribute__(name)
        # what the class Env alone says is asked of the environment inside
        if found is None and name in ("action_space", "observation_space", "render_mode", "spec"):
            return getattr(super().__getattribute__("env"), name, None)
        return found

    @property
    def unwrapped(self) -> Any:
        """The environment that is wrapped, to its core."""
        return self.env.unwrapped

    def get_wrapper_attr(self, name: str) -> Any:
        """Return an attribute of it, or of what is inside."""
        return getattr(self, name)

    def reset(self, *args: Any, **named: Any) -> Any:
        """Reset the environment inside."""
        return self.env.reset(*args, **named)

    def step(self, action: Any) -> Any:
        """Step it."""
        return self.env.step(action)

    def render(self, *args: Any, **named: Any) -> Any:
        """Draw it."""
        return self.env.render(*args, **named)

    def close(self) -> None:
        """Close it."""
        self.env.close()


class ObservationWrapper(Wrapper):
    """A wrapper with another observation."""

    def observation(self, observation: Any) -> Any:
        """Be overridden."""
        raise NotImplementedError

    def reset(self, *args: Any, **named: Any) -> Any:
        """Reset the environment inside, and turn the observation."""
        found = self.env.reset(*args, **named)
        if not isinstance(found, tuple):
            return self.observation(found)
        return (self.observation(found[0]), *found[1:])

    def step(self, action: Any) -> Any:
        """Step it, and turn the observation."""
        observation, *rest = self.env.step(action)
        return (self.observation(observation), *rest)


class ActionWrapper(Wrapper):
    """A wrapper with other actions."""

    def action(self, action: Any) -> Any:
        """Be overridden."""
        raise NotImplementedError

    def step(self, action: Any) -> Any:
        """Step with the action turned."""
        return self.env.step(self.action(action))


class RewardWrapper(Wrapper):
    """A wrapper with another reward."""

    def reward(self, reward: float) -> float:
        """Be overridden."""
        raise NotImplementedError

    def step(self, action: Any) -> Any:
        """Step, and turn the reward."""
        observation, reward, *rest = self.env.step(action)
        return (observation, self.reward(reward), *rest)


class TimeLimit(Wrapper):
    """Ends an episode after so many steps."""

    def __init__(self, env: Any, max_episode_steps: int) -> None:
        super().__init__(env)
        self._most, self._steps = max_episode_steps, 0

    def reset(self, *args: Any, **named: Any) -> Any:
        """Begin to count anew."""
        self._steps = 0
        return self.env.reset(*args, **named)

    def step(self, action: Any) -> Any:
        """Step, and end what is over."""
        self._steps += 1
        found = list(self.env.step(action))
        if self._steps >= self._most:
            found[-2] = True  # truncated, of five; done, of four
        return tuple(found)


class RescaleAction(ActionWrapper):
    """Actions from one pair of bounds to those of the environment."""

    def __init__(self, env: Any, min_action: Any, max_action: Any) -> None:
        super().__init__(env)
        self._low, self._high = np.asarray(min_action, float), np.asarray(max_action, float)
        inner = _bounded(self, env)
        self.action_space = Box(self._low, self._high, inner.shape, np.float32)

    def action(self, action: Any) -> Any:
        """Return the environment's action."""
        inner = self.env.action_space
        return inner.low + (inner.high - inner.low) * (np.asarray(action) - self._low) / (self._high - self._low)


class ClipAction(ActionWrapper):
    """Actions held within the bounds of the environment's."""

    def __init__(self, env: Any) -> None:
        super().__init__(env)
        _bounded(self, env)

    def action(self, action: Any) -> Any:
        """Return the action within the bounds."""
        return np.clip(action, self.env.action_space.low, self.env.action_space.high)


def _bounded(wrapper: Wrapper, env: Any) -> Any:
    """Return the space of an environment's actions.

    Raises:
      SettingsError: it has no bounds, as the environment of v0.2 has no spaces.
    """
    space = env.action_space
    if not hasattr(space, "low"):
        said = f"{type(wrapper).__name__} of an environment whose action_space is {space!r}"
        raise SettingsError(f"{said}; accepted: one with bounds, such as f1tenth_gym:f1tenth-v0")
    return space


class TransformObservation(ObservationWrapper):
    """Observations that a function has changed; their space is that of before, as in the old library."""

    def __init__(self, env: Any, f: Callable[[Any], Any], *_: Any) -> None:
        super().__init__(env)
        self.observation = f  # type: ignore[assignment, method-assign]


class FlattenObservation(ObservationWrapper):
    """Observations as one array."""

    def __init__(self, env: Any) -> None:
        super().__init__(env)
        inner = env.observation_space
        if inner is None:
            raise SettingsError("FlattenObservation of an environment without spaces; accepted: f1tenth_gym:f1tenth-v0")
        example = flatten(inner, inner.sample())
        self.observation_space = Box(-np.inf, np.inf, example.shape, np.float32)

    def observation(self, observation: Any) -> Any:
        """Return the array."""
        return flatten(self.env.observation_space, observation)


class TransformReward(RewardWrapper):
    """Rewards that a function has changed."""

    def __init__(self, env: Any, f: Callable[[float], float]) -> None:
        super().__init__(env)
        self.reward = f  # type: ignore[assignment, method-assign]


class RecordEpisodeStatistics(Wrapper):
    """Adds to the info of an episode's end `episode`: `r` return, `l` steps, `t` seconds since the wrapper was made."""

    def __init__(self, env: Any, *_: Any, **__: Any) -> None:
        super().__init__(env)
        self._began, self._sum, self._steps = time.perf_counter(), 0.0, 0

    def reset(self, *args: Any, **named: Any) -> Any:
        """Begin to count anew."""
        self._sum, self._steps = 0.0, 0
        return self.env.reset(*args, **named)

    def step(self, action: Any) -> Any:
        """Step, and count."""
        found = self.env.step(action)
        self._sum, self._steps = self._sum + found[1], self._steps + 1
        if any(found[2:-1]):
            found[-1]["episode"] = {"r": self._sum, "l": self._steps, "t": time.perf_counter() - self._began}
        return found


class RecordNothing(Wrapper):
    """Stub of the wrappers that record; nothing is recorded."""

    def __init__(self, env: Any, *_: Any, **__: Any) -> None:
        super().__init__(env)


class Space:
    """A set of values."""

    shape: Any = None
    dtype: Any = None

    def __init__(self, shape: Sequence[int] | None = None, dtype: Any = None, seed: int | None = None) -> None:
        self.shape, self.dtype = None if shape is None else tuple(shape), None if dtype is None else np.dtype(dtype)
        self._generator = np.random.default_rng(seed)

    @property
    def np_random(self) -> np.random.Generator:
        """Its generator of random numbers."""
        return self._generator

    def seed(self, seed: int | None = None) -> list[int | None]:
        """Begin its random numbers anew."""
        self._generator = np.random.default_rng(seed)
        return [seed]

    def sample(self, *_: Any) -> Any:
        """Return a value of it."""
        raise NotImplementedError

    def contains(self, value: Any) -> bool:
        """Return whether it has a value."""
        raise NotImplementedError

    def __contains__(self, value: Any) -> bool:
        return self.contains(value)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.shape}, {self.dtype})"

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and repr(self) == repr(other)

    __hash__ = None  # type: ignore[assignment]


class Box(Space):
    """Arrays between two bounds."""

    def __init__(
        self, low: Any, high: Any, shape: Sequence[int] | None = None, dtype: Any = np.float32, seed: int | None = None
    ) -> None:
        if shape is None:
            shape = np.shape(low) if np.ndim(low) else np.shape(high)
        super().__init__(shape, dtype, seed)
        self.low: FloatArray = np.broadcast_to(np.asarray(low, self.dtype), self.shape).copy()
        self.high: FloatArray = np.broadcast_to(np.asarray(high, self.dtype), self.shape).copy()

    def sample(self, *_: Any) -> Any:
        """Return a random array; without bounds, one of a normal distribution."""
        bounded = np.isfinite(self.low) & np.isfinite(self.high)
        low, high = np.where(bounded, self.low, 0.0), np.where(bounded, self.high, 1.0)
        drawn = self._generator.uniform(low, high)
        return np.where(bounded, drawn, self._generator.normal(size=self.shape)).astype(self.dtype)

    def contains(self, value: Any) -> bool:
        """Return whether an array has this shape and is between the bounds."""
        array = np.asarray(value)
        return bool(array.shape == self.shape and (array >= self.low).all() and (array <= self.high).all())

    def __repr__(self) -> str:
        return f"Box({self.low.min()}, {self.high.max()}, {self.shape}, {self.dtype})"


class Discrete(Space):
    """Whole numbers from a start on."""

    def __init__(self, n: int, seed: int | None = None, start: int = 0) -> None:
        super().__init__((), np.int64, seed)
        self.n, self.start = int(n), int(start)

    def sample(self, *_: Any) -> Any:
        """Return one of them."""
        return int(self._generator.integers(self.n)) + self.start

    def contains(self, value: Any) -> bool:
        """Return whether a number is one of them."""
        return float(value).is_integer() and self.start <= int(value) < self.start + self.n

    def __repr__(self) -> str:
        return f"Discrete({self.n})"


class MultiDiscrete(Space):
    """Several whole numbers."""

    def __init__(self, nvec: Any, dtype: Any = np.int64, seed: int | None = None) -> None:
        self.nvec = np.asarray(nvec, np.int64)
        super().__init__(self.nvec.shape, dtype, seed)

    def sample(self, *_: Any) -> Any:
        """Return some."""
        return self._generator.integers(self.nvec).astype(self.dtype)

    def contains(self, value: Any) -> bool:
        """Return whether some numbers are each below its bound."""
        array = np.asarray(value)
        return bool(array.shape == self.shape and (array >= 0).all() and (array < self.nvec).all())


class MultiBinary(MultiDiscrete):
    """Several zeros and ones."""

    def __init__(self, n: Any, seed: int | None = None) -> None:
        super().__init__(np.full(n, 2), np.int8, seed)
        self.n = n


class Dict(Space):
    """Values by name."""

    def __init__(self, spaces: Mapping[str, Any] | None = None, seed: int | None = None, **named: Any) -> None:
        super().__init__(None, None, seed)
        self.spaces: dict[str, Any] = dict(spaces or {}) | named

    def __getitem__(self, key: str) -> Any:
        return self.spaces[key]

    def __setitem__(self, key: str, space: Any) -> None:
        self.spaces[key] = space

    def __iter__(self) -> Any:
        return iter(self.spaces)

    def __len__(self) -> int:
        return len(self.spaces)

    def keys(self) -> Any:
        """Return the names."""
        return self.spaces.keys()

    def values(self) -> Any:
        """Return the spaces."""
        return self.spaces.values()

    def items(self) -> Any:
        """Return names and spaces."""
        return self.spaces.items()

    def sample(self, *_: Any) -> Any:
        """Return a value of each."""
        return {key: space.sample() for key, space in self.spaces.items()}

    def contains(self, value: Any) -> bool:
        """Return whether each has its value."""
        return set(value) == set(self.spaces) and all(self.spaces[key].contains(each) for key, each in value.items())

    def __repr__(self) -> str:
        return f"Dict({', '.join(f'{key}: {space}' for key, space in self.spaces.items())})"


class Tuple(Space):
    """Values in order."""

    def __init__(self, spaces: Iterable[Any], seed: int | None = None) -> None:
        super().__init__(None, None, seed)
        self.spaces = tuple(spaces)

    def __getitem__(self, index: int) -> Any:
        return self.spaces[index]

    def __len__(self) -> int:
        return len(self.spaces)

    def sample(self, *_: Any) -> Any:
        """Return a value of each."""
        return tuple(space.sample() for space in self.spaces)

    def contains(self, value: Any) -> bool:
        """Return whether each has its value."""
        return len(value) == len(self.spaces) and all(map(lambda s, v: s.contains(v), self.spaces, value))

    def __repr__(self) -> str:
        return f"Tuple({', '.join(map(repr, self.spaces))})"


class EnvSpec:
    """Entry of an environment in the registry."""

    def __init__(self, id: str, entry_point: Any, kwargs: Mapping[str, Any], max_episode_steps: int | None) -> None:
        self.id, self.entry_point, self.kwargs = id, entry_point, dict(kwargs)
        self.max_episode_steps = max_episode_steps

    def make(self, **settings: Any) -> Any:
        """Return such an environment."""
        entry = self.entry_point
        if isinstance(entry, str):
            module, _, name = entry.partition(":")
            entry = getattr(importlib.import_module(module), name)
        env = entry(**(self.kwargs | settings))
        env.spec = self
        return env if self.max_episode_steps is None else TimeLimit(env, self.max_episode_steps)


class Registry(dict[str, EnvSpec]):
    """The environments that can be made, by name, of one of the two libraries."""

    def register(
        self,
        id: str,
        entry_point: Any = None,
        kwargs: Mapping[str, Any] | None = None,
        max_episode_steps: int | None = None,
        **_: Any,
    ) -> None:
        """Take an environment."""
        self[id] = EnvSpec(id, entry_point, kwargs or {}, max_episode_steps)

    def find(self, id: Any) -> EnvSpec:
        """Return the registry's entry of a name, `module:name` or `name`; the module is imported first.

        Raises:
          SettingsError: nothing is.
        """
        if isinstance(id, EnvSpec):
            return id
        module, _, name = str(id).rpartition(":")
        if module:
            importlib.import_module(module)
        if name not in self:
            known = ["f110_gym:f110-v0", "f1tenth_gym:f1tenth-v0", *self]
            raise SettingsError(f"environment {id!r}; {accepted_names(id, dict.fromkeys(known))}")
        return self[name]

    def make(self, id: Any, **settings: Any) -> Any:
        """Return an environment; `settings` are its own."""
        for name in ("disable_env_checker", "autoreset", "apply_api_compatibility", "new_step_api"):
            settings.pop(name, None)
        most = settings.pop("max_episode_steps", None)
        env = self.find(id).make(**settings)
        return env if most is None else TimeLimit(env, most)

    def all(self) -> Any:
        """Return all that is registered, as gym's registry does."""
        return self.values()

    @property
    def env_specs(self) -> dict[str, EnvSpec]:
        """Itself, as gym's registry has it."""
        return self


def really_installed(name: str) -> bool:
    """Return whether a library is installed; a folder of its name without `__init__.py` is none."""
    spec = importlib.machinery.PathFinder.find_spec(name)
    return spec is not None and spec.loader is not None and spec.origin is not None


def installed_base(name: str) -> type:
    """Return the class Env of gym or gymnasium where it is installed, else the stub's."""
    found: type = importlib.import_module(name).Env if really_installed(name) else Env
    return found


def spaces() -> Any:
    """Return gymnasium's spaces where it is installed, else the stubs."""
    return importlib.import_module("gymnasium.spaces") if really_installed("gymnasium") else Spaces


class Spaces:
    """The spaces of the stub, by name."""

    Space, Box, Discrete, MultiDiscrete, MultiBinary, Dict, Tuple = (
        Space, Box, Discrete, MultiDiscrete, MultiBinary, Dict, Tuple,
    )  # fmt: skip


def flatten(space: Any, value: Any) -> Any:
    """Return a value of a space as one array."""
    inside = getattr(space, "spaces", None)  # of Gymnasium's spaces, too
    if isinstance(inside, Mapping):
        return np.concatenate([flatten(inner, value[key]) for key, inner in sorted(inside.items())])
    if inside is not None:
        return np.concatenate([flatten(inner, each) for inner, each in zip(inside, value, strict=True)])
    return np.asarray(value, np.float32).ravel()


def np_random(seed: int | None = None) -> tuple[np.random.Generator, int | None]:
    """Return a generator and its seed, as gym's seeding does."""
    return np.random.default_rng(seed), seed


class EzPickle:
    """Pickles what it is of by the arguments that made it, as gym's."""

    def __init__(self, *args: Any, **named: Any) -> None:
        self._made_with = (args, named)
