"""What an environment for learning is made of: the course, the episode, what is seen and what is rewarded.

    settings = EnvironmentSettings.of({"track": "hairpins", "laps": 2, "beam_step": 10})
    world = settings.make_world()

What an observation, an action and a reward are is in modules of their own.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from ..course.course import Course, laps_to_drive
from ..course.random_obstacles import random_boxes
from ..errors import SettingsError
from ..lidar.effects import LidarEffects
from ..messages import require, require_whole
from ..simulation.course_loading import default_car, load_track
from ..simulation.engine import Engine
from ..simulation.world import World
from .rewards import Rewards

STARTS = ("random", "line")


@dataclass(frozen=True, kw_only=True)
class EnvironmentSettings:
    """Settings of an environment; the same for dm_env, Gymnasium and its vector environment.

    Raises:
      SettingsError: a value outside what is accepted.
    """

    track: Course | str = "oval"  # as `load_track` takes it
    laps: int = 1  # to be driven; of a scene 1
    start: str = "random"  # "random": anywhere on the lap; "line": standing on the start of the centreline
    time_limit: float | None = None  # [s] of an episode; None: what a car of 0.5 m/s needs, or the scene's own
    mu: float | None = None  # friction coefficient of the tires; None: as in the car's MJCF
    obstacles: int = 0  # boxes at random places of the track, which stay there
    obstacle_seed: int = 0  # of their places
    effects: LidarEffects = field(default_factory=LidarEffects)  # what the LiDAR does to a scan
    beam_step: int = 1  # every how many-th beam is seen, counted from the one straight ahead to both sides
    speed_range: tuple[float, float] | None = None  # [m/s] that an action may ask for; None: what the car can
    normalised_actions: bool = False  # both parts of an action are from -1 to 1
    rewards: Rewards = field(default_factory=Rewards)

    def __post_init__(self) -> None:
        for name, least in (("laps", 1), ("obstacles", 0), ("obstacle_seed", 0), ("beam_step", 1)):
            require_whole(name, getattr(self, name), least)
        if self.start not in STARTS:
            raise SettingsError(f"start is {self.start!r}; accepted: {', '.join(STARTS)}")
        if self.time_limit is not None:
            require(self, lambda value: 0.0 < value < math.inf, "a positive number", ("time_limit",), SettingsError)
        if not isinstance(self.normalised_actions, bool):
            raise SettingsError(f"normalised_actions is {self.normalised_actions!r}; accepted: True, False")
        if self.effects.motion_distortion:
            raise SettingsError("motion distortion of the LiDAR, in an environment; accepted: in `race` only")

    @classmethod
    def of(cls, settings: Mapping[str, Any]) -> EnvironmentSettings:
        """Return settings by their names; `rewards` and `effects` may be mappings too.

        Raises:
          SettingsError: an unknown name; the message has the nearest known one.
        """
        values = dict(_known(settings, cls, "an environment"))
        for name, kind in (("rewards", Rewards), ("effects", LidarEffects)):
            if isinstance(values.get(name), Mapping):
                values[name] = kind(**_known(values[name], kind, name))
        return cls(**values)

    def make_world(self) -> World:
        """Return the compiled world.

        Raises:
          TrackError, SettingsError: what cannot be driven.
        """
        course = load_track(self.track)
        laps_to_drive(course, self.laps)  # refuses more than a scene has
        boxes = random_boxes(course, self.obstacles, self.obstacle_seed, car=default_car())
        return World(course, mu=self.mu, obstacles=boxes)

    def make_engine(self, count: int = 1, threads: int = 1, *, world: World | None = None) -> Engine:
        """Return an engine of so many worlds; of `world` itself, if it is given, which then is the only one.

        Raises:
          TrackError, SettingsError: what cannot be driven.
        """
        return Engine(
            world or self.make_world(), count, laps=self.laps, time_limit=self.time_limit, threads=threads,
            own_model=world is not None,
        )  # fmt: skip


def _known(settings: Mapping[str, Any], kind: Any, what: str) -> Mapping[str, Any]:
    """Return `settings` if all are fields of the dataclass `kind`."""
    names = [f.name for f in fields(kind)]
    for name in settings:
        if name not in names:
            near = difflib.get_close_matches(str(name), names, n=1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            raise SettingsError(f"{what} has no setting {name!r}; {hint}accepted: {', '.join(names)}")
    return settings
