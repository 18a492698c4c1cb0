"""Self-play: the opponents of each episode are drawn from a pool of planners and of earlier versions of the policy.

The pool has the planners, and a snapshot of the policy every so many steps, of which the last ones are kept. An earlier
version is drawn uniformly, as in Bansal et al., "Emergent complexity via multi-agent competition" (ICLR 2018): a policy
that meets its latest version only learns to beat that one. Planners stay in the pool, so that the policy goes on
meeting those that it is to beat, as in Wurman et al. (Nature 602, 2022). Each world draws with its own generator, as
all that is randomised.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fg_mujoco.course.writing import write_file
from fg_mujoco.envs.environment_settings import EnvironmentSettings
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import require, require_whole, shown
from fg_mujoco.racing.planners import ControllerChoice, Value, find_controller
from fg_mujoco.racing.randomization import Choice, Randomization

SNAPSHOTS = "opponents"
"""Folder of a training with the earlier versions of its policy."""

USUAL_RACE: Mapping[str, Any] = {"grid_order": "random", "rewards": "race", "randomize": {}}
"""Settings of the environment that differ with self-play, unless they are given. All cars have the same friction."""

_NAME = re.compile(r"[0-9]{10,}\.json")


@dataclass(frozen=True, kw_only=True)
class SelfPlay:
    """Who the opponents of a training's episodes are.

    Raises:
      SettingsError, ControllerError: a value that is not accepted.
    """

    share: float = 0.5  # of the episodes against earlier versions; until there is one, all are against planners
    every: int = 250_000  # steps of all worlds from one snapshot to the next
    kept: int = 10  # snapshots, the last ones
    planners: tuple[str, ...] = ("gap_finder",)  # each as likely

    def __post_init__(self) -> None:
        require(self, lambda value: 0.0 <= value <= 1.0, "a number from 0 to 1", ("share",), SettingsError)
        require_whole("self_play.every", self.every, 1)
        require_whole("self_play.kept", self.kept, 1, 10_000)
        given: Any = self.planners
        names = (given,) if isinstance(given, str) else given
        if not isinstance(names, Sequence) or not names or not all(isinstance(name, str) for name in names):
            raise SettingsError(f"self_play.planners is {shown(given)}; accepted: one or more planners, by name")
        object.__setattr__(self, "planners", tuple(names))
        for name in self.planners:
            find_controller(ControllerChoice.of(name).source)

    def pool(self, snapshots: Sequence[Path] = ()) -> OpponentPool:
        """Return the pool with some snapshots."""
        share = self.share if snapshots else 0.0
        return OpponentPool((*self.planners, *map(str, snapshots)), len(snapshots), share)

    def environment(self, settings: Mapping[str, Any], snapshots: Sequence[Path] = ()) -> dict[str, Any]:
        """Return the settings of an environment whose opponents are drawn from the pool.

        Args:
          settings: of the environment, by name.
          snapshots: files of earlier versions.

        Raises:
          SettingsError: the environment has no opponents, or draws them otherwise.
        """
        given = settings.get("randomize", {})
        ranges = dict((given if isinstance(given, Randomization) else Randomization.of(given)).ranges)
        if "opponent" in ranges:
            raise SettingsError("opponent is in randomize and drawn by self_play; accepted: one of them")
        entries = EnvironmentSettings.of(settings).opponents
        if not entries:
            said = "self_play, in an environment without opponents"
            raise SettingsError(f"{said}; accepted: one with them, such as opponents=['gap_finder']")
        for number, entry in enumerate(entries, start=1):
            if not isinstance(entry.controller, str):
                said = f"opponent {number} is {shown(entry.controller)}, in an environment of self_play"
                raise SettingsError(f"{said}; accepted: a planner's name, in whose place the pool's are drawn")
        return {**settings, "randomize": {**ranges, "opponent": self.pool(snapshots)}}


@dataclass(frozen=True, repr=False)
class OpponentPool(Choice):
    """Planners, and after them snapshots, of which one is drawn for a share of the episodes."""

    snapshots: int = 0  # how many of the values
    share: float = 0.0  # of the episodes

    def at(self, share: float) -> Value:
        """Return the value at a share of the pool from 0 to 1."""
        first = len(self.values) - self.snapshots
        if share < self.share or self.share == 1.0:
            return Choice(self.values[first:]).at(share / self.share)
        return Choice(self.values[:first]).at((share - self.share) / (1.0 - self.share))


class Snapshots:
    """The snapshots in a folder, the last ones of which are kept.

    Args:
      folder: of the training.
      settings: of self-play.
      steps: of the policy as it is. Later snapshots are of a training that was killed after them, and are deleted.
    """

    def __init__(self, folder: Path, settings: SelfPlay, steps: int = 0) -> None:
        self._folder, self._settings = folder / SNAPSHOTS, settings
        found = sorted(self._folder.iterdir()) if self._folder.is_dir() else []
        self.files = [path for path in found if _NAME.fullmatch(path.name)]
        for path in [path for path in self.files if int(path.stem) > steps]:
            path.unlink()
            self.files.remove(path)
        self._forget()

    def due(self, steps: int) -> bool:
        """Return whether the policy after so many steps is to be added."""
        return steps // self._settings.every > (int(self.files[-1].stem) // self._settings.every if self.files else 0)

    def add(self, steps: int, content: bytes) -> None:
        """Add the policy.json of the policy after so many steps."""
        self._folder.mkdir(exist_ok=True)
        path = self._folder / f"{steps:010}.json"
        write_file(path, content)
        self.files.append(path)
        self._forget()

    def pool(self) -> OpponentPool:
        """Return the pool of opponents with these snapshots."""
        return self._settings.pool(self.files)

    def _forget(self) -> None:
        """Delete the oldest snapshots."""
        while len(self.files) > self._settings.kept:
            self.files.pop(0).unlink()
