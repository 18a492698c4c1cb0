"""The wrappers of the later releases of f1tenth_gym, `envs.wrappers`. Written afresh from their documentation."""

from __future__ import annotations

from collections import deque
from copy import deepcopy
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import ArrayLike

from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import require_whole


class SingleAgentWrapper(gymnasium.Wrapper[Any, Any, Any, Any], gymnasium.utils.RecordConstructorArgs):
    """An environment of one car without the level of the car; SettingsError: more cars, or not by car."""

    def __init__(self, env: Any) -> None:
        gymnasium.utils.RecordConstructorArgs.__init__(self)
        gymnasium.Wrapper.__init__(self, env)
        cars = env.unwrapped.num_agents
        if cars != 1:
            raise SettingsError(f"SingleAgentWrapper of {cars} cars; accepted: num_agents=1")
        self._car = env.unwrapped.agent_ids[0]
        spaces = getattr(env.observation_space, "spaces", {})
        if self._car not in spaces:
            kind = env.unwrapped.observation_type.type
            said = f"SingleAgentWrapper of observations of type {kind!r}, which are not by car"
            raise SettingsError(f"{said}; accepted: kinematic_state, dynamic_state, features, direct")
        self.observation_space, both = spaces[self._car], env.action_space
        self.action_space = gymnasium.spaces.Box(both.low[0], both.high[0], dtype=both.dtype)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Return the car's observation, and the info as it is."""
        seen, info = self.env.reset(seed=seed, options=options)
        return seen[self._car], info

    def step(self, action: ArrayLike) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Take an action (2,)."""
        seen, reward, terminated, truncated, info = self.env.step(np.reshape(np.asarray(action, np.float32), (1, -1)))
        return seen[self._car], reward, terminated, truncated, info


class ObservationDelayWrapper(gymnasium.Wrapper[Any, Any, Any, Any], gymnasium.utils.RecordConstructorArgs):
    """An environment whose observations are some steps old, and the one of the reset before there is one.

    Rewards, ends and info are those of now. Raises SettingsError for no whole number from 0.
    """

    def __init__(self, env: Any, delay_steps: int = 1) -> None:
        gymnasium.utils.RecordConstructorArgs.__init__(self, delay_steps=delay_steps)
        gymnasium.Wrapper.__init__(self, env)
        require_whole("delay_steps", delay_steps, 0)
        self._frames: deque[Any] = deque(maxlen=delay_steps + 1)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Return the first observation."""
        seen, info = self.env.reset(seed=seed, options=options)
        self._frames.clear()
        self._frames.append(deepcopy(seen))
        return seen, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Return the observation of `delay_steps` ago."""
        seen, *others = self.env.step(action)
        self._frames.append(deepcopy(seen))
        return (deepcopy(self._frames[0]), *others)
