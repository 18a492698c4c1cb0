"""The Gymnasium environment: a lap to be driven on a scan and odometry. It needs the extra `gym`.

    import fg_mujoco  # registers it
    import gymnasium

    env = gymnasium.make("fg_mujoco/F1Tenth-v0", track="hairpins", laps=2, beam_step=10)
    observation, info = env.reset(seed=1)
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())

`gymnasium.make("fg_mujoco:fg_mujoco/F1Tenth-v0")` needs no import. `gymnasium.make_vec` makes the
vector environment of gym_vector. The keywords are those of EnvironmentSettings.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..arguments import Remade
from ..display import brief
from ..errors import SettingsError, accepted_names, missing_extra
from ..lidar.beams import LidarModel
from . import ID as ID
from . import register
from .actions import ActionBounds
from .environment_settings import EnvironmentSettings
from .episode_draws import read_options
from .episodes import Episodes
from .observations import Bounds
from .observer import CAMERA, FLAT
from .policy_interface import PolicyInterface, row_of
from .rendering import Window, WorldViews, usable_modes
from .worlds import Worlds

try:
    import gymnasium
except ImportError as error:
    raise missing_extra("Gymnasium environments need Gymnasium", "gym") from error

RENDER_MODES = ("human", "rgb_array")

Observation = Any
"""Arrays by name, or one array where the observation is flat."""

_ALL = np.ones(1, np.bool_)


class F1TenthEnv(Remade, gymnasium.Env[Observation, NDArray[np.float32]]):
    """One car on one course, alone or among opponents. A touch of cars does not end an episode.

    An episode is terminated by a crash, by the last lap and by a physics that breaks down; it is truncated by the time
    limit, by ten seconds without progress and by five metres the wrong way. `info` has `time_s`, `progress_m`, `laps`,
    `sliding` (share of the tick in which a tire slid; NaN of tires without a peak) and `clipped_actions`; with
    opponents `touches` (of other cars so far), `position` (1 in front) and `lead_m` (on the foremost other car); of
    each reward term `reward_NAME`, its part of the tick's reward, and `return_NAME`, the sum of the episode; and at the
    end `end_reason` and `lap_times_s`. A copy (copy.deepcopy, pickle) is a new environment of the same arguments.

    Args:
      render_mode: "rgb_array", "human" or None.
      settings: those of EnvironmentSettings, by name.

    Attributes:
      policy_interface: what a policy sees and answers; a planner made of the policy needs it.

    Raises:
      TrackError, SettingsError: what cannot be driven.
    """

    metadata = {  # noqa: RUF012
        "render_modes": list(RENDER_MODES), "render_fps": round(1.0 / LidarModel.load().beams.period),
    }  # fmt: skip

    def __init__(self, render_mode: str | None = None, **settings: Any) -> None:
        if render_mode not in (None, *RENDER_MODES):
            raise SettingsError(
                f"render_mode is {render_mode!r}; {accepted_names(render_mode, RENDER_MODES, ', None')}"
            )
        self.render_mode = render_mode
        chosen = EnvironmentSettings.of(settings)
        self._world = Worlds(chosen)
        self._episodes = Episodes(chosen, self._world)
        self.policy_interface = self._episodes.interface
        self.metadata = self.metadata | {
            "render_fps": frames_per_second(self.policy_interface), "render_modes": usable_modes(RENDER_MODES),
        }  # fmt: skip
        self.observation_space: gymnasium.Space[Any] = observation_space(self._episodes)
        self.action_space: gymnasium.Space[Any] = action_space(self._episodes.interface.bounds)
        self._views = WorldViews(self._world.engine)
        self._window: Window | None = None

    def __repr__(self) -> str:
        return brief(self, repr(self._world.world))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode.

        Args:
          seed: of all that is drawn; None: the environment goes on drawing from where it is.
          options: may have {"start": {"s": 3.0, "offset": 0.2, "heading": 0.1, "speed": 1.0}}, and values in the place
            of those that `randomize` draws, by name.

        Raises:
          SettingsError: an option that there is not, or one that cannot be had.
          TrackError: a course that cannot be driven.
        """
        super().reset(seed=seed)
        start, given = read_options(options, self._world.randomization)
        self._episodes.begin(_ALL, [self.np_random], start, given)
        observation = self._observe()
        if self.render_mode == "human":
            self.render()
        return observation, self._info()

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Drive for a tick of 25 ms, or for `action_repeat` of them.

        Raises:
          MessageError: a NaN, or an action of another shape. A value out of bounds is clipped and counted.
          gymnasium.error.ResetNeeded: no episode has begun, or it is over.
        """
        episodes = self._episodes
        if not episodes.running[0]:
            raise gymnasium.error.ResetNeeded("the episode is over, or none has begun; call reset()")
        episodes.step(np.asarray(action)[np.newaxis])
        observation, info = self._observe(), self._info()
        if not episodes.running[0]:
            info |= episodes.ending(0)
        if self.render_mode == "human":
            self.render()
        return (
            observation,
            float(episodes.rewards[0]),
            bool(episodes.terminated[0]),
            bool(episodes.truncated[0]),
            info,
        )

    def render(self) -> NDArray[np.uint8] | None:
        """Return a frame (480, 640, 3), or show it in MuJoCo's viewer; None in "human" mode and without a mode.

        Raises:
          MissingExtraError, EngineError: no OpenGL, or no display.
        """
        if self.render_mode is None:
            return None
        engine, world = self._world.engine, self._world.engine.world
        if self.render_mode == "rgb_array":
            return self._views.frames([0])[0]
        if self._window is None or self._window.world is not world:
            self._close_window()
            self._window = Window(world, mujoco.MjData(world.model), engine.period)
        engine.read(0, self._window.data)
        self._window.show()
        return None

    def set_randomization(self, ranges: Mapping[str, Any]) -> None:
        """Draw from other ranges from the next reset on; those of parameters not named stay as they are.

        Raises:
          SettingsError: what cannot be drawn, or an environment that was made to draw nothing.
        """
        self._episodes.randomize(ranges)
        self._note_call("set_randomization", dict(self._world.randomization.ranges))

    def close(self) -> None:
        """Close the renderer and the window, and end the threads."""
        self._episodes.close()
        self._views.close()
        self._close_window()

    def _close_window(self) -> None:
        if self._window is not None:
            self._window.close()
            self._window = None

    def _observe(self) -> Any:
        return row_of(self._episodes.observe(_ALL), 0)

    def _info(self) -> dict[str, Any]:
        return self._episodes.facts_of(0)


def observation_space(episodes: Episodes) -> gymnasium.Space[Any]:
    """Return the space of the observations of one car."""
    found, camera = episodes.observer.bounds, episodes.camera
    if isinstance(found, Bounds):
        if camera is None:
            return gymnasium.spaces.Box(found.low, found.high)
        found = {FLAT: found}
    boxes: dict[str, gymnasium.Space[Any]] = {
        name: gymnasium.spaces.Box(bounds.low, bounds.high) for name, bounds in found.items()
    }
    if camera is not None:
        boxes[CAMERA] = gymnasium.spaces.Box(0, 255, camera.shape, np.uint8)
    return gymnasium.spaces.Dict(boxes)


def frames_per_second(interface: PolicyInterface) -> int:
    """Return how many steps of an environment a second has, rounded."""
    return round(1.0 / (interface.period * interface.action_repeat))


def action_space(bounds: ActionBounds) -> gymnasium.spaces.Box[Any]:
    """Return the space of the actions of one car."""
    return gymnasium.spaces.Box(bounds.low, bounds.high)


register(gymnasium)
