"""The PettingZoo environment: several cars of one world, each driven by an agent. It needs the extra `pettingzoo`.

    env = fg_mujoco.parallel_env(agents=2, track="oval", beam_step=10)
    observations, infos = env.reset(seed=1)
    while env.agents:
        actions = {agent: policy(observations[agent]) for agent in env.agents}
        observations, rewards, terminations, truncations, infos = env.step(actions)

An agent's observation, action, reward and info are those of the Gymnasium environment, and so are the keywords.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.arguments import Remade
from fg_mujoco.display import brief
from fg_mujoco.envs.actions import one_action
from fg_mujoco.envs.environment_settings import EnvironmentSettings
from fg_mujoco.envs.episode_draws import read_options
from fg_mujoco.envs.episodes import Episodes
from fg_mujoco.envs.rendering import WorldViews
from fg_mujoco.envs.worlds import Worlds
from fg_mujoco.errors import MessageError, SettingsError, accepted_names, missing_extra
from fg_mujoco.messages import require_whole, shown
from fg_mujoco.simulation.cars import GREATEST_CARS

try:
    import gymnasium
    import pettingzoo
except ImportError as error:
    raise missing_extra("PettingZoo environments need PettingZoo", "pettingzoo") from error

# isort: split
# where Gymnasium is missing, the line above has said which command installs both
from fg_mujoco.envs.gym_environment import action_space, frames_per_second, observation_space
from fg_mujoco.envs.policy_interface import row_of

_WORLD = np.ones(1, np.bool_)


class F1TenthParallelEnv(Remade, pettingzoo.ParallelEnv):  # type: ignore[misc]
    """Cars `car_0`, `car_1` and so on in one world, which start on a grid.

    An agent's episode ends as in F1TenthEnv. Its car is then off the course if it has finished; else it brakes and
    stays an obstacle to the others. With ended_by="all" it stays an agent until all have ended, as vectors of SuperSuit
    need it: its reward is 0, its observation zeros, its actions are ignored. Touches of cars end nothing. `info` has
    what F1TenthEnv's has with opponents; `progress_m` is counted from where car_0 starts.

    Args:
      agents: how many cars learn, from 1 to 16 with the opponents.
      render_mode: "rgb_array" or None.
      settings: those of EnvironmentSettings, by name.

    Attributes:
      possible_agents: names of all agents.
      agents: names of those whose episode goes on.
      policy_interface: what a policy sees and answers; a planner made of the policy needs it.

    Raises:
      TrackError, SettingsError: what cannot be driven.
      ControllerError: an opponent that cannot be loaded.
    """

    metadata: dict[str, Any] = {"name": "fg_mujoco_f1tenth_v0", "render_modes": ["rgb_array"]}  # noqa: RUF012

    def __init__(self, agents: int = 2, *, render_mode: str | None = None, **settings: Any) -> None:
        require_whole("agents", agents, 1, GREATEST_CARS)
        if render_mode not in (None, "rgb_array"):
            raise SettingsError(f"render_mode of many cars is {render_mode!r}; accepted: rgb_array, None")
        self.render_mode = render_mode
        chosen = EnvironmentSettings.of(settings)
        self._worlds = Worlds(chosen, agents=agents)
        self._episodes = Episodes(chosen, self._worlds)
        self.policy_interface = interface = self._episodes.interface
        self.metadata = self.metadata | {"render_fps": frames_per_second(interface)}
        self.possible_agents = [f"car_{index}" for index in range(agents)]
        self.agents: list[str] = []
        self._observation_spaces = {agent: observation_space(self._episodes) for agent in self.possible_agents}
        self._action_spaces = {agent: action_space(interface.bounds) for agent in self.possible_agents}
        self._generator: np.random.Generator | None = None
        self._views = WorldViews(self._worlds.engine)

    def __repr__(self) -> str:
        return brief(self, f"{len(self.possible_agents)} agents", repr(self._worlds.world))

    def observation_space(self, agent: str) -> Any:
        """Return the space of an agent's observations, the same object each time.

        Raises:
          SettingsError: no such agent.
        """
        return self._observation_spaces[self._known(agent)]

    def action_space(self, agent: str) -> Any:
        """Return the space of an agent's actions, the same object each time.

        Raises:
          SettingsError: no such agent.
        """
        return self._action_spaces[self._known(agent)]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Begin the episodes of all agents.

        Args:
          seed: of starts and noise; None: the environment goes on drawing from where it is.
          options: may have {"start": {"s": 3.0}}, where the first place of the grid is, and values of what is drawn.
            Others are ignored, for the tests of PettingZoo pass such.

        Raises:
          SettingsError: a start in a wall, in an obstacle or in another car.
        """
        if seed is not None or self._generator is None:
            self._generator, _ = gymnasium.utils.seeding.np_random(seed)
        drawn = self._worlds.randomization
        known = {name: value for name, value in (options or {}).items() if name == "start" or name in drawn.ranges}
        start, given = read_options(known, drawn)
        self._episodes.begin(_WORLD, [self._generator], start, given)
        self.agents = list(self.possible_agents)
        rows = {agent: row for row, agent in enumerate(self.agents)}
        return self._observations(np.ones(len(rows), np.bool_), rows), self._infos(rows)

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[
        dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]
    ]:  # fmt: skip
        """Drive for a tick of 25 ms.

        Args:
          actions: of each agent whose episode goes on. A value out of bounds is clipped and counted.

        Returns:
          Observations, rewards, terminations, truncations and infos of these agents.

        Raises:
          MessageError: an action that is none, or is missing, or is that of no such agent.
          gymnasium.error.ResetNeeded: no episode goes on.
        """
        if not self.agents:
            raise gymnasium.error.ResetNeeded("all episodes are over, or none has begun; call reset()")
        episodes, rows = self._episodes, {agent: self.possible_agents.index(agent) for agent in self.agents}
        live = self._worlds.monitor.running.copy()
        episodes.step(self._read(actions))
        observations, infos = self._observations(live, rows), self._infos(rows)
        for agent, row in rows.items():
            if not self._worlds.monitor.running[row]:
                infos[agent] |= episodes.ending(row)
        rewards = {agent: float(episodes.rewards[row]) for agent, row in rows.items()}
        terminations = {agent: bool(episodes.terminated[row]) for agent, row in rows.items()}
        truncations = {agent: bool(episodes.truncated[row]) for agent, row in rows.items()}
        self.agents = [agent for agent, row in rows.items() if episodes.running[row]]
        return observations, rewards, terminations, truncations, infos

    def render(self) -> NDArray[np.uint8] | None:
        """Return a frame (480, 640, 3) from behind car_0; None without a render mode.

        Raises:
          MissingExtraError: no OpenGL.
        """
        if self.render_mode is None:
            return None
        return self._views.frames([0])[0]

    def set_randomization(self, ranges: Mapping[str, Any]) -> None:
        """Draw from other ranges from the next reset on; see F1TenthEnv.set_randomization."""
        self._episodes.randomize(ranges)
        self._note_call("set_randomization", dict(self._worlds.randomization.ranges))

    def close(self) -> None:
        """Close the renderer, and end the threads."""
        self._episodes.close()
        self._views.close()

    def _known(self, agent: str) -> str:
        if agent not in self._action_spaces:
            raise SettingsError(f"agent is {shown(agent)}; {accepted_names(str(agent), self.possible_agents)}")
        return agent

    def _read(self, actions: Mapping[str, Any]) -> NDArray[np.float64]:
        """Return the actions of all agents (n, 2), 0 where an episode is over.

        Raises:
          MessageError: one is missing, is that of no agent whose episode goes on, or has another shape.
        """
        if not isinstance(actions, Mapping) or set(actions) != set(self.agents):
            given = sorted(map(str, actions)) if isinstance(actions, Mapping) else shown(actions)
            raise MessageError(f"actions are of {given}; accepted: one of each of {self.agents}, by name")
        rows = np.zeros((len(self.possible_agents), 2))
        for agent, action in actions.items():
            said, row = f"the action of {agent} is", self.possible_agents.index(agent)
            rows[row] = one_action(action, said, self.policy_interface.bounds)
        return rows

    def _observations(self, sensed: NDArray[np.bool_], rows: Mapping[str, int]) -> dict[str, Any]:
        seen = self._episodes.observe(sensed)
        return {agent: row_of(seen, row) for agent, row in rows.items()}

    def _infos(self, rows: Mapping[str, int]) -> dict[str, dict[str, Any]]:
        facts = self._episodes.facts()
        return {agent: {name: values.item(row) for name, values in facts.items()} for agent, row in rows.items()}
