"""The library `gym` for scripts that import it where only Gymnasium is installed. Needs the extra `gym`.

Its modules have the names of gymnasium's. What differs is here: `make` returns environments bare, `f110-v0` is the one
of v0.2, and wrappers pass on whatever the environment inside takes and returns, four values a step or five. Wrappers of
Gymnasium that are not here work on environments of five.
"""

from __future__ import annotations

import importlib
import importlib.machinery
import time
from typing import Any

import gymnasium


def really_installed(name: str) -> bool:
    """Return whether a library is installed; a folder of its name without `__init__.py` is none."""
    spec = importlib.machinery.PathFinder.find_spec(name)
    return spec is not None and spec.loader is not None and spec.origin is not None


def base_of_gym() -> type:
    """Return the class Env of gym where it is installed, else Gymnasium's."""
    found: type = importlib.import_module("gym").Env if really_installed("gym") else gymnasium.Env
    return found


class Wrapper(gymnasium.Wrapper[Any, Any, Any, Any]):
    """An environment round another; what it does not have is that one's."""

    def __getattr__(self, name: str) -> Any:
        if name == "env" or name.startswith("__"):
            raise AttributeError(name)
        return getattr(self.env, name)

    def reset(self, *args: Any, **named: Any) -> Any:
        """Reset the environment inside."""
        return self.env.reset(*args, **named)


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

    def reward(self, reward: Any) -> Any:
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
        found: list[Any] = list(self.env.step(action))
        if self._steps >= self._most:
            found[-2] = True  # truncated, of five; done, of four
        return tuple(found)


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
        found: Any = self.env.step(action)
        self._sum, self._steps = self._sum + found[1], self._steps + 1
        if any(found[2:-1]):
            found[-1]["episode"] = {"r": self._sum, "l": self._steps, "t": time.perf_counter() - self._began}
        return found


def make(id: str, *, max_episode_steps: int | None = None, **settings: Any) -> Any:
    """Return an environment, bare but for its limit of steps; gymnasium.error.Error: it is not registered."""
    for name in ("disable_env_checker", "autoreset", "apply_api_compatibility", "new_step_api"):
        settings.pop(name, None)
    module, _, name = id.rpartition(":")
    if module:
        importlib.import_module(module)
    if name == "f110-v0":
        from . import environment_of_gym

        env = environment_of_gym(**settings)
    else:
        spec = gymnasium.spec(name)
        entry: Any = spec.entry_point
        if isinstance(entry, str):
            place, _, attribute = entry.partition(":")
            entry = getattr(importlib.import_module(place), attribute)
        env = entry(**(spec.kwargs | settings))
        max_episode_steps = max_episode_steps or spec.max_episode_steps
    return env if max_episode_steps is None else TimeLimit(env, max_episode_steps)


_WRAPPERS = {each.__name__: each for each in (Wrapper, ObservationWrapper, ActionWrapper, RewardWrapper)}
_OTHERS: dict[str, dict[str, Any]] = {
    "gym": {**_WRAPPERS, "make": make, "__version__": "0.21.0"},
    "gym.core": _WRAPPERS,
    "gym.envs.registration": {"make": make},
    "gym.logger": {"set_level": lambda level: None, "INFO": 20, "DEBUG": 10, "DISABLED": 50},
    "gym.wrappers": {"TimeLimit": TimeLimit, "RecordEpisodeStatistics": RecordEpisodeStatistics},
}
_OF_A_MODULE = ("__name__", "__spec__", "__loader__", "__path__", "__package__", "__file__", "__cached__")


def names_of_gym(module: str) -> dict[str, Any] | None:
    """Return the names of a module of gym; None: there is no such module."""
    if module.startswith("gym.wrappers."):  # gym had a file for each
        module = "gym.wrappers"
    try:
        behind = importlib.import_module(f"gymnasium{module.removeprefix('gym')}")
    except ModuleNotFoundError:
        return None
    kept = {name: value for name, value in vars(behind).items() if name not in _OF_A_MODULE}
    return kept | _OTHERS.get(module, {})


def parts_of_gym(module: str) -> list[str]:
    """Return the modules in a module of gym that are not those of gymnasium."""
    return [name for name in ("gym.core", "gym.envs", "gym.envs.registration", "gym.logger", "gym.wrappers")
            if name.rpartition(".")[0] == module]  # fmt: skip
