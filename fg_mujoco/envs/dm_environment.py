"""The dm_env environment: tasks for a car in the form of dm_control's suite.

    env = load("oval", task="race", seed=1)
    time_step = env.reset()
    while not time_step.last():
        time_step = env.step(policy(time_step.observation))

Its world is that of `race`, its control timestep the LiDAR's period. `env.physics` is a dm_control Physics: named
access, `render`, and `dm_control.viewer.launch(env)`. Observations are described in `observations`, rewards in
`rewards`. An episode that is terminated ends with discount 0, one that is truncated with discount 1.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arguments import Remade, Uncopied
from ..display import brief
from ..errors import SettingsError, accepted_names, missing_extra
from ..simulation.simulation import Simulation
from .actions import action_names
from .environment_settings import EnvironmentSettings
from .episodes import Episodes
from .observations import Bounds
from .observer import FLAT
from .policy_interface import row_of
from .worlds import Worlds

try:
    from dm_control import mujoco as dm_mujoco
    from dm_control.mujoco import wrapper
    from dm_control.mujoco.wrapper.mjbindings import sizes
    from dm_control.rl import control
    from dm_env import specs
except ImportError as error:
    needs = f"dm_env environments need dm-control, on Python 3.10 to 3.12 ({error})"
    raise missing_extra(needs, "dm-control") from error


def _forget_absent_arrays() -> None:
    """Take from dm_control's tables the arrays that this MuJoCo lacks: 1.0.50 names nine that 4.0 has no more."""
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    for kind, structure in (("mjmodel", model), ("mjdata", mujoco.MjData(model))):
        for name in [name for name in sizes.array_sizes[kind] if not hasattr(structure, name)]:
            del sizes.array_sizes[kind][name]


_forget_absent_arrays()

TASKS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        # five laps from a standing start on the line: progress, less collision and sliding
        "race": MappingProxyType({"laps": 5, "start": "line"}),
        # one lap from the same start, in which sliding costs nothing but the time that it loses
        "time_trial": MappingProxyType({"laps": 1, "start": "line", "rewards": {"sliding": 0.0}}),
        # one lap from anywhere, among boxes
        "obstacles": MappingProxyType({"laps": 1, "start": "random", "obstacles": 4}),
    }
)
"""Name -> the settings in which a task differs from EnvironmentSettings."""

_ALL = np.ones(1, np.bool_)


def load(
    track: Any = "oval",
    task: str = "race",
    *,
    seed: int | None = None,
    flat_observation: bool = False,
    **settings: Any,
) -> CarEnvironment:
    """Return an environment.

    Args:
      task: one of TASKS.
      seed: of starts and of the LiDAR's noise, and of the places of obstacles unless `obstacle_seed` is given; None: of
        the first two, another each time.
      flat_observation: one array, `observations`, in the order of the names.
      settings: those of EnvironmentSettings that are to differ from the task's.

    Raises:
      TrackError, SettingsError: what cannot be driven.
    """
    return CarEnvironment(track, task, seed=seed, flat_observation=flat_observation, **settings)


class CarEnvironment(Remade, control.Environment):  # type: ignore[misc]
    """The environment that `load` returns, of the same arguments. A copy is a new one of these."""

    def __init__(self, track: Any, task: str, *, seed: int | None, flat_observation: bool, **settings: Any) -> None:
        if task not in TASKS:
            raise SettingsError(f"task is {task!r}; {accepted_names(task, TASKS)}")
        if seed is not None and (not isinstance(seed, int) or isinstance(seed, bool) or seed < 0):
            raise SettingsError(f"seed is {seed!r}; accepted: a whole number from 0, or None")
        chosen = EnvironmentSettings.of({"track": track, "obstacle_seed": seed or 0} | dict(TASKS[task]) | settings)
        if chosen.opponents:
            raise SettingsError(
                f"{len(chosen.opponents)} opponents in a dm_env environment; accepted: in Gymnasium's and PettingZoo's"
            )
        if chosen.action_repeat != 1:
            said = f"action_repeat is {chosen.action_repeat} in a dm_env environment"
            raise SettingsError(f"{said}; accepted: 1; more in Gymnasium's and PettingZoo's")
        for name, usual in (("on_contact", "end"), ("camera", "")):
            if (value := getattr(chosen, name)) != usual:
                said = f"{name} is {value!r} in a dm_env environment"
                raise SettingsError(f"{said}; accepted: {usual!r}; others in Gymnasium's and PettingZoo's")
        if chosen.randomization.ranges:
            drawn = ", ".join(chosen.randomization.ranges)
            raise SettingsError(f"{drawn} drawn in a dm_env environment; accepted: in Gymnasium's and PettingZoo's")
        physics = Physics.of(chosen)
        super().__init__(
            physics,
            CarTask(chosen, physics, np.random.default_rng(seed), flat_observation=flat_observation),
            control_timestep=physics.simulation.period,
            flat_observation=flat_observation,
            legacy_step=False,
        )

    def __repr__(self) -> str:
        return brief(self, repr(self.physics.simulation))


class Physics(Uncopied, dm_mujoco.Physics):  # type: ignore[misc]
    """A Simulation as a Physics of dm_control; both use the same data.

    Attributes:
      simulation: the Simulation.
    """

    simulation: Simulation

    def __repr__(self) -> str:
        return brief(self, repr(self.simulation))

    @classmethod
    def of(cls, settings: EnvironmentSettings) -> Physics:
        """Return the physics of a new world."""
        world = settings.make_world()
        physics: Physics = cls.from_model(wrapper.MjModel(world.model))
        engine = settings.make_engine(world=world, own_model=True)
        physics.simulation = Simulation(world, engine=engine, data=physics.data.ptr)
        physics._command = np.zeros(2)
        return physics

    def set_control(self, control: ArrayLike) -> None:
        """Set the command of the next steps, [steering angle, speed] (2,) [rad, m/s]."""
        self._command = np.array(control, dtype=np.float64)

    def step(self, nstep: int | None = None) -> None:
        """Hold the command for so many physics steps, whole ticks of the LiDAR; None: one tick.

        Raises:
          SettingsError: a part of a tick.
        """
        substeps = self.simulation.substeps
        ticks, rest = divmod(substeps if nstep is None else nstep, substeps)
        if rest:
            raise SettingsError(f"{nstep} physics steps; accepted: a multiple of {substeps}, which are a tick")
        for _ in range(ticks):
            self.simulation.drive(*self._command.tolist())

    def render(self, height: int = 240, width: int = 320, camera_id: int | str = -1, **options: Any) -> NDArray[Any]:
        """Return a picture, as dm_control's Physics does; without shadows, which are coarse on a whole circuit."""
        if not (options.get("depth") or options.get("segmentation")):
            options.setdefault("render_flag_overrides", {"shadow": False})
        picture: NDArray[Any] = super().render(height, width, camera_id, **options)
        return picture

    def after_reset(self) -> None:
        """Bring the poses up to date; no more, so that an episode has the bits of a race."""
        mujoco.mj_kinematics(self.model.ptr, self.data.ptr)


class CarTask(control.Task):  # type: ignore[misc]
    """Laps to be driven; `episodes.facts()` has what `info` of the Gymnasium environment has."""

    def __init__(
        self,
        settings: EnvironmentSettings,
        physics: Physics,
        rng: np.random.Generator,
        *,
        flat_observation: bool = False,
    ) -> None:
        self._world = Worlds(settings, engine=physics.simulation.engine)
        self.episodes = Episodes(settings, self._world)
        self._rng = rng
        self._flat = flat_observation
        self._observation: Any = {}

    def initialize_episode(self, physics: Physics) -> None:
        """Place the car."""
        self.episodes.begin(_ALL, [self._rng])
        self._world.engine.read(0, physics.data.ptr)
        self._observation = self.episodes.observe(_ALL)

    def before_step(self, action: ArrayLike, physics: Physics) -> None:
        """Take an action.

        Raises:
          MessageError: a NaN, or an action of another shape. A value out of bounds is clipped and counted.
        """
        self.episodes.command(np.asarray(action)[np.newaxis])
        physics.set_control(self.episodes.commands[0])

    def after_step(self, physics: Physics) -> None:
        """End the episode where it is over, compute the reward, and sense."""
        self._world.measure()
        self._world.judge()
        self.episodes.reward()
        self._observation = self.episodes.observe(_ALL)

    def get_observation(self, physics: Physics) -> OrderedDict[str, NDArray[np.float32]]:
        """Return the observation."""
        seen = row_of(self._observation, 0)
        return OrderedDict(seen if isinstance(seen, dict) else {FLAT: seen})

    def get_reward(self, physics: Physics) -> float:
        """Return the reward of the last tick."""
        return float(self.episodes.rewards[0])

    def get_termination(self, physics: Physics) -> float | None:
        """Return the discount of an episode that is over; None while it goes on."""
        if self.episodes.running[0]:
            return None
        return 1.0 if self.episodes.truncated[0] else 0.0

    def action_spec(self, physics: Physics) -> specs.BoundedArray:
        """Return the bounds of an action."""
        bounds = self.episodes.interface.bounds
        return specs.BoundedArray((2,), np.float32, bounds.low, bounds.high, name=",".join(action_names(bounds)))

    def observation_spec(self, physics: Physics) -> OrderedDict[str, specs.BoundedArray]:
        """Return the bounds of each part of an observation."""
        found = self.episodes.observer.bounds
        by_name = {FLAT: found} if isinstance(found, Bounds) else found
        bounds = OrderedDict((name, (bound.low, bound.high)) for name, bound in by_name.items())
        if self._flat:
            flat = tuple(np.concatenate(ends) for ends in zip(*bounds.values(), strict=True))
            bounds = OrderedDict({control.FLAT_OBSERVATION_KEY: flat})
        return OrderedDict(
            (name, specs.BoundedArray(low.shape, low.dtype, low, high, name=name))
            for name, (low, high) in bounds.items()
        )
