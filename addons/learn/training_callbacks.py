"""What a training writes as it goes: checkpoints, the policy, and figures for people and for TensorBoard."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3.common.logger import KVWriter, TensorBoardOutputFormat

from fg_mujoco.course.writing import write_file
from fg_mujoco.envs.policy_interface import PolicyInterface

from .policy_files import save_policy
from .stable_baselines3_env import EpisodeLog
from .training_settings import CHECKPOINTS, LOG, PROGRESS, SCHEMA, SETTINGS, TrainingProgress, TrainingSettings


class Record:
    """The folder of a training.

    Args:
      folder: of the training.
      model: that is trained.
      settings: of the training.
      interface: of the policy.

    Attributes:
      figures: of the last iteration, by name.
    """

    def __init__(self, folder: Path, model: Any, settings: TrainingSettings, interface: PolicyInterface) -> None:
        self.folder, self.model, self.settings, self._interface = folder, model, settings, interface
        self.figures: Mapping[str, float] = {}
        self._formats: list[Any] = []

    def write_settings(self) -> None:
        """Write training.json."""
        versions = {name: version(name) for name in ("fg-mujoco", "mujoco", "numpy", "stable-baselines3", "torch")}
        found = {"schema": SCHEMA, "settings": self.settings.described(), "versions": versions}
        write_file(self.folder / SETTINGS, (json.dumps(found, indent=2) + "\n").encode())

    def formats(self) -> list[Any]:
        """Return where figures are written."""
        self._formats = [_Lines(self.folder / PROGRESS, self), TensorBoardOutputFormat(str(self.folder / LOG))]
        return self._formats

    def save(self) -> None:
        """Write a checkpoint and the policy."""
        steps, seed = int(self.model.num_timesteps), self.settings.seed
        trained = {"steps": steps, "seed": seed, "environment": self.settings.described()["environment"]}
        (self.folder / CHECKPOINTS).mkdir(exist_ok=True)
        save_policy(self.model, self.folder / CHECKPOINTS / f"{steps:010}.zip", self._interface, trained=trained)
        save_policy(self.model, self.folder, self._interface, trained=trained)

    def close(self) -> None:
        """Close the files of figures."""
        for each in self._formats:
            each.close()


class _Lines(KVWriter):  # type: ignore[misc]
    """Adds a line of JSON for each iteration."""

    def __init__(self, path: Path, record: Record) -> None:
        self._file, self._record = path.open("a", encoding="utf-8"), record

    def write(self, key_values: dict[str, Any], key_excluded: dict[str, tuple[str, ...]], step: int = 0) -> None:
        """Write the figures of an iteration."""
        numbers = {name: float(v) for name, v in key_values.items() if isinstance(v, (int, float, np.number))}
        self._record.figures = found = {"steps": step} | {name: v for name, v in numbers.items() if math.isfinite(v)}
        self._file.write(json.dumps(found) + "\n")
        self._file.flush()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


class Recording(EpisodeLog):
    """Logs the episodes, and writes checkpoints evenly, at the ends of iterations.

    Args:
      record: of the training.
      watch: called after each iteration; None: nobody is.
    """

    def __init__(self, record: Record, watch: Callable[[TrainingProgress], None] | None) -> None:
        super().__init__()
        self._record, self._watch = record, watch
        settings = record.settings
        self._every = max(settings.steps // settings.checkpoints, 1)

    def _on_training_start(self) -> None:
        self._began, self._first = time.perf_counter(), self.model.num_timesteps
        self._next = (self._first // self._every + 1) * self._every

    def _on_rollout_start(self) -> None:
        """Write what the last update left."""
        if self.model.num_timesteps >= self._next:
            self._record.save()
            self._next = (self.model.num_timesteps // self._every + 1) * self._every
        if self._watch is not None and self.model.num_timesteps > self._first:
            steps = self.model.num_timesteps
            rate = (steps - self._first) / (time.perf_counter() - self._began)
            total = self._record.settings.steps
            self._watch(TrainingProgress(steps=steps, total=total, rate=rate, figures=self._record.figures))
