"""The Gymnasium vector environment: many worlds, stepped in C threads of this process.

    envs = gymnasium.make_vec("fg_mujoco.envs.gym_environment:fg_mujoco/F1Tenth-v0", num_envs=64, beam_step=10)
    observations, infos = envs.reset(seed=1)
    observations, rewards, terminations, truncations, infos = envs.step(envs.action_space.sample())

World i returns the same bits as `F1TenthEnv` with seed + i and the same actions, for any number of worlds and threads,
in the form of `gymnasium.vector.SyncVectorEnv`. Worlds are reset one by one, as `gymnasium.vector.AutoresetMode` says.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arguments import Remade
from ..display import brief
from ..errors import SettingsError, accepted_names
from ..rollouts.workers import usable_cores
from .environment_settings import EnvironmentSettings
from .episode_draws import read_options
from .episodes import Episodes
from .gym_environment import F1TenthEnv, Observation, action_space, frames_per_second, observation_space
from .policy_interface import row_of
from .rendering import WorldViews
from .worlds import Worlds

# isort: split
# where Gymnasium is missing, the import of gym_environment has said which command installs it
import gymnasium
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

Flags = NDArray[np.bool_]


class F1TenthVectorEnv(Remade, VectorEnv[Observation, NDArray[np.float32], NDArray[Any]]):
    """Cars on one course, each in a world of its own, with the same opponents.

    Args:
      autoreset_mode: when a finished world is reset: NEXT_STEP, SAME_STEP, DISABLED, or their values.
      max_episode_steps: an episode is truncated after so many; None: by its time limit only.
      threads: that step the worlds; None: one for each core.
      render_mode: "rgb_array" or None.
      settings: those of EnvironmentSettings, by name.

    Attributes:
      policy_interface: what a policy sees and answers; a planner made of the policy needs it.

    Raises:
      TrackError, SettingsError: what cannot be driven.
    """

    def __init__(
        self,
        num_envs: int = 1,
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        threads: int | None = None,
        render_mode: str | None = None,
        **settings: Any,
    ) -> None:
        for name, value in (("num_envs", num_envs), ("threads", threads), ("max_episode_steps", max_episode_steps)):
            whole = isinstance(value, int) and not isinstance(value, bool) and value > 0
            if not whole and (name == "num_envs" or value is not None):
                raise SettingsError(f"{name} is {value!r}; accepted: a whole number from 1")
        if render_mode not in (None, "rgb_array"):
            raise SettingsError(f"render_mode of many worlds is {render_mode!r}; accepted: rgb_array, None")
        self.num_envs, self.render_mode = num_envs, render_mode
        self._mode = _autoreset_mode(autoreset_mode)
        chosen = EnvironmentSettings.of(settings)
        self._worlds = Worlds(chosen, num_envs, threads or min(usable_cores(), num_envs))
        self.episodes = Episodes(chosen, self._worlds)
        self.policy_interface = self.episodes.interface
        self.metadata = F1TenthEnv.metadata | {
            "autoreset_mode": self._mode, "render_modes": ["rgb_array"],
            "render_fps": frames_per_second(self.policy_interface),
        }  # fmt: skip
        self.single_observation_space = observation_space(self.episodes)
        self.single_action_space = action_space(self.episodes.interface.bounds)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._max_steps = max_episode_steps
        self._steps = np.zeros(num_envs, np.int64)
        self._every, self._none = np.ones(num_envs, np.bool_), np.zeros(num_envs, np.bool_)
        self._begun = self._none.copy()
        self._generators: list[np.random.Generator | None] = [None] * num_envs
        self._seeds: list[int | None] = [None] * num_envs
        self._views = WorldViews(self._worlds.engine)

    def __repr__(self) -> str:
        return brief(self, f"{self.num_envs} environments", repr(self._worlds.world))

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin the episodes of all worlds, or of those of the mask options["reset_mask"] (n,).

        Args:
          seed: of world i seed + i, or one for each; None: the worlds go on drawing from where they are.
          options: besides the mask, those of F1TenthEnv.reset, for all worlds.
        """
        others = dict(options or {})
        mask = self._checked_mask(others.pop("reset_mask", None))
        seeds = self._seeds_of(seed)
        start, given = read_options(others, self._worlds.randomization)
        for i in map(int, np.flatnonzero(mask)):
            if seeds[i] is not None or self._generators[i] is None:
                self._generators[i], self._seeds[i] = seeding.np_random(seeds[i])
        self._begin(mask, start, given)
        return self.episodes.observe(mask), self._infos(mask)

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[Observation, NDArray[np.float64], Flags, Flags, dict[str, Any]]:
        """Drive for a tick of 25 ms, or for `action_repeat` of them.

        The action of a world that is reset in this step is ignored.

        Raises:
          MessageError: a NaN, or actions of another shape. A value out of bounds is clipped and counted.
          gymnasium.error.ResetNeeded: a world was never reset; without autoreset, an episode is over.
        """
        episodes = self.episodes
        anew = None if self._all_run() else ~episodes.running
        if anew is not None and not (self._mode is AutoresetMode.NEXT_STEP and self._begun.all()):
            waiting = np.flatnonzero(anew).tolist()
            raise gymnasium.error.ResetNeeded(f"no episode runs in the worlds {waiting}; reset() them")
        episodes.step(actions, sense=anew is None)
        self._steps += 1
        if anew is not None:
            self._begin(anew)
        rewards, observation = episodes.rewards.copy(), episodes.observe(self._every)
        late = self._none.copy() if self._max_steps is None else self._steps >= self._max_steps
        if self._all_run() and not np.count_nonzero(late):  # as nearly always
            return observation, rewards, self._none.copy(), late, self._infos()
        terminated, truncated = episodes.ended(episodes.terminates, late), late | episodes.truncated
        over = terminated | truncated
        if self._mode is AutoresetMode.SAME_STEP:
            observation, infos = self._begin_over(over, observation)
        else:
            infos = self._infos()
            for i in map(int, np.flatnonzero(over & ~episodes.running)):
                infos = self._add_info(infos, episodes.ending(i), i)
            episodes.stop(over)
        return observation, rewards, terminated, truncated, infos

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Return a frame (480, 640, 3) of each world; None without a render mode.

        Raises:
          MissingExtraError: no OpenGL.
        """
        if self.render_mode is None:
            return None
        return tuple(self._views.frames(range(self.num_envs)))

    def set_randomization(self, ranges: Mapping[str, Any]) -> None:
        """Draw from other ranges from the next reset of each world on; see F1TenthEnv.set_randomization."""
        self.episodes.randomize(ranges)
        self._note_call("set_randomization", dict(self._worlds.randomization.ranges))

    def call(self, name: str, *args: Any, **settings: Any) -> tuple[Any, ...]:
        """Call a method of this environment, which speaks for all its worlds; return what it returns, once for each.

        Raises:
          SettingsError: there is no such method.
        """
        method = getattr(self, name, None)
        if name.startswith("_") or not callable(method):
            raise SettingsError(f"call of {name!r}; {accepted_names(name, ['set_randomization', 'render'])}")
        return (method(*args, **settings),) * self.num_envs

    def close_extras(self, **_: Any) -> None:
        """Close the thread pool and the renderer."""
        self.episodes.close()
        self._views.close()

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator | None, ...]:  # type: ignore[override]
        """The generator of each world; None before its first reset."""
        return tuple(self._generators)

    @property
    def np_random_seed(self) -> tuple[int | None, ...]:  # type: ignore[override]
        """The seed of each world; None before its first reset."""
        return tuple(self._seeds)

    def _all_run(self) -> bool:
        return int(np.count_nonzero(self.episodes.running)) == self.num_envs  # sooner said than all()

    def _begin(self, which: Flags, start: Any = None, given: Any = None) -> None:
        self.episodes.begin(which, self._generators, start, given)  # type: ignore[arg-type]
        self._steps[which] = 0
        self._begun |= which

    def _begin_over(self, over: Flags, observation: Observation) -> tuple[Observation, dict[str, Any]]:
        """Reset finished worlds; return their first observation and info, with the final ones under `final_*`."""
        episodes, facts = self.episodes, self.episodes.facts()
        final: dict[str, Any] = {}
        for i in map(int, np.flatnonzero(over)):
            known = {name: values.item(i) for name, values in facts.items()}
            if not episodes.running[i]:
                known |= episodes.ending(i)
            seen = row_of(observation, i)
            final = self._add_info(final, {"final_obs": seen, "final_info": known}, i)
        self._begin(over)
        return episodes.observe(over), final | self._infos()

    def _infos(self, which: Flags | None = None) -> dict[str, Any]:
        """Return the facts of the worlds `which`, or of all, in Gymnasium's form: an array and its mask by name."""
        infos: dict[str, Any] = self.episodes.facts()
        if which is not None:
            infos = {name: np.where(which, values, _nothing_like(values)) for name, values in infos.items()}
        mask = (self._every if which is None else which).copy()
        return infos | {f"_{name}": mask for name in infos}

    def _checked_mask(self, mask: Any) -> Flags:
        if mask is None:
            return np.ones(self.num_envs, np.bool_)
        if not (isinstance(mask, np.ndarray) and mask.dtype == np.bool_ and mask.shape == (self.num_envs,)):
            raise SettingsError(f"options['reset_mask'] is {mask!r}; accepted: an array ({self.num_envs},) of bool")
        if not mask.any():
            raise SettingsError("options['reset_mask'] names no world; accepted: one or more")
        return mask.copy()

    def _seeds_of(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, (int, np.integer)):
            return [int(seed) + i for i in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise SettingsError(f"{len(seed)} seeds for {self.num_envs} worlds; accepted: one number, or one for each")
        return list(seed)


def _autoreset_mode(mode: AutoresetMode | str) -> AutoresetMode:
    try:
        return AutoresetMode(mode)
    except ValueError as error:
        modes = [known.value for known in AutoresetMode]
        raise SettingsError(f"autoreset_mode is {mode!r}; {accepted_names(mode, modes)}") from error


def _nothing_like(values: NDArray[Any]) -> NDArray[Any]:
    """Return what Gymnasium has in infos of worlds that say nothing."""
    return np.full_like(values, None) if values.dtype == object else np.zeros_like(values)
