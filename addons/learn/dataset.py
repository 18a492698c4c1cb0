"""Datasets: of each tick of many worlds the scan, the odometry and the command, for policies that learn from them.

    fg-mujoco rollout --track random:1 --n 64 --record scans:10 --out runs/expert

    dataset = read_dataset("runs/expert")
    for episode in dataset:                   # one world at a time is in memory
        print(episode.world, episode.end_reason, episode.scans.shape, episode.commands.shape)
    dataset.to_minari("fg-mujoco/expert-v0")

A rollout that was interrupted is a dataset of the chunks that it finished.
"""

from __future__ import annotations

import copy
import importlib
import importlib.util
import json
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.arguments import Suggesting, explain_class
from fg_mujoco.display import brief
from fg_mujoco.envs import ID
from fg_mujoco.errors import FgMujocoError, RunFolderError, SettingsError, accepted_names, missing_extra
from fg_mujoco.messages import FloatArray
from fg_mujoco.racing.randomization import Randomization
from fg_mujoco.rollouts.chunk_store import ChunkStore, FolderStore
from fg_mujoco.rollouts.recording import ScanLayout
from fg_mujoco.rollouts.store import blame
from fg_mujoco.simulation.settings import DriveSettings

TERMINATED = ("finished", "crash", "rolled_over")
"""Reasons after which there is no next state; worlds that end by any other are truncated."""

_TABLE = "worlds"  # of a chunk, one row a world


@explain_class
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Episode(Suggesting):
    """What was recorded of car 0 in one world, one row a tick: what its planner was given, and what it commanded."""

    world: int  # its number
    seed: int
    track: str  # name of its course
    end_reason: str
    drawn: dict[str, Any]  # what was drawn for it, by name
    planner_mu: float  # friction coefficient that the planner was told; inf: no friction limits
    result: dict[str, Any]  # its row of the rollout's table, by column
    ticks: NDArray[np.void]  # (ticks,) of ScanLayout.dtype
    layout: ScanLayout

    def __repr__(self) -> str:
        return brief(
            self, f"world {self.world}", f"seed {self.seed}", f"track {self.track!r}", f"{len(self)} ticks",
            f"ended by {self.end_reason}",
        )  # fmt: skip

    def __len__(self) -> int:
        return len(self.ticks)

    @property
    def scans(self) -> NDArray[np.float32]:
        """Distances as environments observe them: no return reads range_max, too close or failed reads 0.

        Shape (ticks, beams) [m].
        """
        return self.layout.distances(self.ticks["ranges"])

    @property
    def commands(self) -> NDArray[np.float32]:
        """Commanded steering angle [rad] and speed [m/s]. Shape (ticks, 2)."""
        return np.ascontiguousarray(self.ticks["command"])

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return a field of Odometry, "progress" or "offset" [m]. First axis: ticks.

        Raises:
          SettingsError: there is none of that name.
        """
        names = self.layout.dtype.names or ()
        if name not in names:
            raise SettingsError(f"no field {name!r} is recorded; {accepted_names(name, names)}")
        return np.ascontiguousarray(self.ticks[name])


@explain_class
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Dataset(Sequence[Episode], Suggesting):
    """The episodes of a rollout that recorded scans, in the order of their worlds' numbers.

    `dataset[i]` and an iteration read one episode from disk at a time.
    """

    worlds: NDArray[np.void]  # (n,) rows of the rollout's table, of those that are finished
    settings: dict[str, Any]  # of the rollout
    layout: ScanLayout
    chunks: ChunkStore = field(repr=False)
    places: NDArray[np.int64] = field(repr=False)  # (n, 2) of each, its chunk and its place in there

    @classmethod
    def of(cls, chunks: ChunkStore, numbers: Sequence[int], settings: dict[str, Any]) -> Dataset:
        """Return the dataset of some chunks of a rollout that recorded scans."""
        tables, places = [], []
        for number in numbers:
            table = chunks.read(number)[_TABLE]
            tables.append(table)
            places.append(np.column_stack((np.full(len(table), number), np.arange(len(table)))))
        worlds = np.concatenate(tables)
        order = np.argsort(worlds["world"])
        return cls(
            worlds=worlds[order], settings=settings, layout=ScanLayout.read(settings["scan"]), chunks=chunks,
            places=np.concatenate(places)[order],
        )  # fmt: skip

    def __repr__(self) -> str:
        ends = ", ".join(f"{count} {reason}" for reason, count in Counter(self.worlds["end_reason"].tolist()).items())
        return brief(self, f"{len(self)} worlds", f"{self.layout.beams} beams", ends)

    def __len__(self) -> int:
        return len(self.worlds)

    def __getitem__(self, index: Any) -> Any:
        """Return an episode, or of a slice a list of episodes."""
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        if not isinstance(index, (int, np.integer)) or not -len(self) <= index < len(self):
            raise IndexError(f"no episode {index!r}; accepted: 0 to {len(self) - 1}")
        row = dict(zip(self.worlds.dtype.names or (), self.worlds[index].item(), strict=True))
        chunk, place = self.places[index].tolist()
        arrays = self.chunks.read(chunk)
        ends = np.cumsum(arrays["ticks"])
        ticks = np.array(arrays["scans"][ends[place] - arrays["ticks"][place] : ends[place]])
        ticks.flags.writeable = False
        told = row["planner_mu"] if "planner_mu" in self._drawn else self._base.assumed_mu
        return Episode(
            world=row["world"], seed=row["seed"], track=self.settings["tracks"][row["track"]]["name"],
            end_reason=row["end_reason"], drawn={name: row[name] for name in self._drawn},
            planner_mu=float(told), result=row, ticks=ticks, layout=self.layout,
        )  # fmt: skip

    def __iter__(self) -> Iterator[Episode]:
        return (self[i] for i in range(len(self)))

    @property
    def bearings(self) -> FloatArray:
        """Bearing of each recorded beam from straight ahead, left positive. Shape (beams,) [rad]."""
        return self.layout.bearings

    @cached_property
    def _drawn(self) -> tuple[str, ...]:
        return tuple(Randomization.of(self.settings["randomize"]).ranges)

    @cached_property
    def _base(self) -> DriveSettings:
        return DriveSettings.of(self.settings.get("drive", {}))

    def to_minari(self, name: str) -> Any:
        """Write a dataset of Minari, such as "fg-mujoco/gap-finder-v0", where Minari keeps its own, and return it.

        Observations have the names and shapes of the environments': `scan`, `speed`, `yaw_rate`, `steering_angle` and
        `acceleration`. Actions are the commands within the car's limits. The reward of a tick is the progress in it
        [m]. An episode ends with the observation of the last tick, so that the last command is left out, and worlds of
        fewer than two ticks are, too. `recover_environment` of the dataset makes the environment of the same courses
        and cars, with the same beams; one that cannot be made, as of a track that is not here, is named.

        Raises:
          MissingExtraError: Minari is not installed.
          RunFolderError: there is one of that name, or it cannot be written.
        """
        minari, spaces = require_minari(), importlib.import_module("gymnasium.spaces")
        car = self._base.car.parameters
        low = np.array([-car.max_steering_angle, car.min_speed], np.float32)
        high = np.array([car.max_steering_angle, car.max_speed], np.float32)
        shapes = {"speed": 1, "yaw_rate": 1, "steering_angle": 1, "acceleration": 2}
        seen = {each: spaces.Box(-np.inf, np.inf, (size,), np.float32) for each, size in shapes.items()}
        seen["scan"] = spaces.Box(0.0, self.layout.range_max, (self.layout.beams,), np.float32)

        env_spec = self._env_spec()

        def buffer(episode: Episode) -> Any:
            last = len(episode) - 1
            ended = np.arange(1, last + 1) == last
            final = episode.end_reason in TERMINATED
            return minari.data_collector.EpisodeBuffer(
                seed=episode.seed,
                observations={
                    "scan": episode.scans,
                    "speed": episode["speed"][:, np.newaxis],
                    "yaw_rate": episode["angular_velocity"][:, 2:],
                    "steering_angle": episode["steering_angle"][:, np.newaxis],
                    "acceleration": episode["linear_acceleration"][:, :2],
                },
                actions=np.clip(episode.commands[:last], low, high),
                rewards=np.diff(episode["progress"]),
                terminations=ended & final,
                truncations=ended & (not final),
            )

        with blame(Path(name), "the name of a new dataset, such as fg-mujoco/gap-finder-v0"), warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # on authors and links that a dataset should have
            return minari.create_dataset_from_buffers(
                dataset_id=name, buffer=(buffer(episode) for episode in self if len(episode) > 1),
                env=env_spec, observation_space=spaces.Dict(seen),
                action_space=spaces.Box(low, high, dtype=np.float32),
                algorithm_name=self.settings["controller"], description=json.dumps(self.settings),
            )  # fmt: skip


    def _env_spec(self) -> Any:
        """Return Gymnasium's specification of an environment of these worlds; None: it cannot be made, as is said."""
        gymnasium = importlib.import_module("gymnasium")
        said, tracks = self.settings, [each["name"] for each in self.settings["tracks"]]
        own = {name: said[name] for name in ("laps", "randomize") if said.get(name)}
        own |= {"track": tracks if len(tracks) > 1 else tracks[0], "beam_step": said["scan"]["step"]}
        spec = copy.deepcopy(gymnasium.spec(ID))
        drive = said.get("drive", {})  # with hashes of files, too
        spec.kwargs = {each.name: drive[each.name] for each in fields(DriveSettings) if each.name in drive} | own
        try:
            gymnasium.make(spec).close()
        except FgMujocoError as error:
            warnings.warn(f"the dataset has no environment to recover: {error}", stacklevel=3)
            return None
        return spec


def read_dataset(folder: str | Path) -> Dataset:
    """Read what a rollout with `record="scans"` has recorded in a folder, finished or not.

    Raises:
      RunFolderError: it is not such a folder, no chunk is finished, or a file in it is damaged.
    """
    store = FolderStore(folder)
    settings = store.manifest()["settings"]
    if "scan" not in settings:
        kind = settings.get("record", "summary")
        raise RunFolderError(f"{folder}: has no scans, but {kind!r}; accepted: a folder of `rollout --record scans`")
    numbers = store.written()
    if not numbers:
        raise RunFolderError(f"{folder}: no chunk is finished; accepted: one or more, which the same command drives")
    return Dataset.of(store, numbers, settings)


def require_minari() -> Any:
    """Return Minari.

    Raises:
      MissingExtraError: it is not installed; the message has the command that installs it.
    """
    if importlib.util.find_spec("minari") is None:
        raise missing_extra("Minari datasets need Minari", "datasets")
    return importlib.import_module("minari")
