"""Builds: the compiled worlds of a randomised environment, each made once, ahead of its use by a thread.

What is compiled into a world, in 0.1 to 0.3 s, is drawn for a number of builds, and each episode draws one of these.
The values of builds are spread over their ranges as in a Latin hypercube: of 64 builds on 4 courses 16 are on each.
"""

from __future__ import annotations

import threading
import weakref
from collections import OrderedDict, deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..course.course import Course
from ..course.track import Track
from ..errors import FgMujocoError, SettingsError
from ..messages import CarParameters
from ..racing.planners import Value
from ..racing.randomization import PARAMETERS, Randomization, generator
from ..simulation.world import World
from ..vehicle.changes import CarChanges
from ..vehicle.friction_patches import CLEAR, random_patches
from .starts import StartGrid

if TYPE_CHECKING:
    from .environment_settings import EnvironmentSettings

BUILT = ("track", "vehicle", "tires", "obstacles", "patches", "patch_mu")
"""Parameters whose values are compiled into a world."""

_TRIES = 20  # draws for a build, where a random circuit cannot be built
_KEPT = 256  # builds that are kept at most, some 4 GB once all of them were driven
_PATCH_LENGTH = 1.5  # [m]

Values = dict[str, Value]


@dataclass(frozen=True, kw_only=True, eq=False)
class Build:
    """A compiled world, and where its cars start."""

    values: Values  # that were drawn, by name; `obstacles` and `patches` as many as there was room for
    world: World
    grid: StartGrid


class BuildPlan:
    """Settings of each build of an environment."""

    def __init__(self, settings: EnvironmentSettings, randomization: Randomization, agents: int) -> None:
        self._settings, self._agents, self._all = settings, agents, randomization.ranges
        self._ranges = {name: values for name, values in randomization.ranges.items() if name in BUILT}

    @property
    def key(self) -> tuple[Any, ...]:
        """All that the builds of an environment depend on, besides its settings."""
        return tuple(self._ranges.items()), "command_delay" in self._all, self.changes_cars

    @property
    def one_for_each_episode(self) -> bool:
        """Whether no two episodes have the same build."""
        return self._settings.builds is None

    @property
    def changes_cars(self) -> bool:
        """Whether cars are changed for each episode, so that builds are compiled without what the settings change."""
        return any(PARAMETERS[name][0] is CarChanges for name in self._all)

    def values(self, number: int, attempt: int = 0) -> Values:
        """Return what is drawn for a build, by name."""
        seed, builds = self._settings.build_seed, self._settings.builds
        shares = generator(seed, f"build {number} {attempt}").random(len(PARAMETERS))
        if builds is not None and attempt == 0:
            each = np.tile(np.arange(builds), (len(PARAMETERS), 1))
            shares = (generator(seed, "strata").permuted(each, axis=1)[:, number] + shares) / builds
        of = dict(zip(PARAMETERS, shares.tolist(), strict=True))
        return {name: values.at(of[name]) for name, values in self._ranges.items()}

    def make(self, number: int, given: Mapping[str, Value]) -> Build:
        """Return a build, with some values as given; TrackError or SettingsError where none can be driven."""
        for attempt in range(_TRIES):
            values = {**self.values(number, attempt), **given}
            try:
                return self._compiled(values, generator(self._settings.build_seed, f"places {number} {attempt}"))
            except FgMujocoError as error:
                refused = error
                if "track" in given or not str(values.get("track", "")).startswith("random:"):
                    raise
        raise SettingsError(f"{_TRIES} courses drawn for build {number} cannot be driven, the last: {refused}")

    def _compiled(self, values: Values, rng: np.random.Generator) -> Build:
        own = self._settings.without_randomization(values)
        if self.changes_cars:
            delay = 0.0 if "command_delay" in self._all else own.changes.command_delay
            own = replace(own, mu=None, changes=CarChanges(command_delay=delay))
        car = own.car.parameters
        course = own.make_ground(self._agents).course
        course.check_car(car)
        kept: Values = dict(values)
        if "obstacles" in values:
            count = kept["obstacles"] = min(int(values["obstacles"]), _room(course, car))
            own = replace(own, obstacles=count, obstacle_seed=int(rng.integers(2**53)))
        if "patch_mu" in values:
            count = kept["patches"] = min(int(values.get("patches", 1)), _room_for_patches(course))
            if count > 0:
                assert isinstance(course, Track)
                mu = float(values["patch_mu"])
                own = replace(own, patches=random_patches(course, count, rng, mu=mu, length=_PATCH_LENGTH))
        world = replace(own, track=course, moving="").make_world(self._agents)
        seen = (world.lidar, world.all_seen) if len(world.cars) > 1 else (world.lidar,)
        assert all(seen) and world.distances and world.xml_of_cars  # worked out here, in the thread that builds ahead
        return Build(values=kept, world=world, grid=own.start_grid(world))


def _room_for_patches(course: Course) -> int:
    """Return how many patches there is room for on a course; only circuits have any."""
    return max(int((course.length - 2.0 * CLEAR) / _PATCH_LENGTH), 0) if isinstance(course, Track) else 0


def _room(course: Course, car: CarParameters) -> int:
    """Return how many boxes there is room for on a course."""
    try:
        return int(course.obstacle_sites(car).most)
    except SettingsError:  # it takes none
        return 0


Key = tuple[int, tuple[tuple[str, Value], ...]]
"""Number of a build, and the values that are given in the place of those drawn."""


class Builds:
    """Makes the builds of a plan, ahead of their use in a thread of its own, and keeps those used last.

    For n worlds twice as many are made ahead at most; the oldest that nobody asked for are dropped. Where each episode
    has a build of its own, n are kept, as none is used again.
    """

    def __init__(self, plan: BuildPlan, forget: Callable[[Build], None], worlds: int) -> None:
        self.plan, self._forget, self._most_ahead = plan, forget, 2 * worlds
        self._most_kept = worlds if plan.one_for_each_episode else _KEPT
        self._kept: OrderedDict[Key, Build] = OrderedDict()
        self._coming: dict[Key, Future[Build]] = {}
        self._maker: _Maker | None = None

    def prepare(self, number: int) -> None:
        """Start making a build."""
        key: Key = (number, ())
        if key not in self._kept and key not in self._coming:
            if self._maker is None:
                self._maker = _Maker(self.plan.make)
                weakref.finalize(self, self._maker.close)  # when Python ends, too: a thread that is in C would break it
            self._coming[key] = self._maker.add(key)
            if len(self._coming) > self._most_ahead:
                self._coming.pop(next(iter(self._coming))).cancel()

    def get(self, number: int, given: Mapping[str, Value] | None = None) -> Build:
        """Return a build; wait for it where it is being made; TrackError, SettingsError: as BuildPlan.make."""
        key: Key = (number, tuple(sorted((given or {}).items())))
        build = self._kept.get(key)
        if build is None:
            coming = self._coming.pop(key, None)
            build = self.plan.make(number, given or {}) if coming is None else coming.result()
            self._kept[key] = build
        self._kept.move_to_end(key)
        while len(self._kept) > self._most_kept:
            _, old = self._kept.popitem(last=False)
            self._forget(old)
        return build

    def close(self) -> None:
        """End the thread."""
        if self._maker is not None:
            self._maker.close()
            self._maker = None
        self._coming.clear()


class _Maker:
    """A thread that makes builds, in the order in which they were asked for."""

    def __init__(self, make: Callable[[int, Mapping[str, Value]], Build]) -> None:
        self._make = make
        self._todo: deque[tuple[Key, Future[Build]]] = deque()
        self._ready = threading.Semaphore(0)
        self._closed = False
        self._thread = threading.Thread(target=self._work, name="fg_mujoco builds", daemon=True)
        self._thread.start()

    def add(self, key: Key) -> Future[Build]:
        """Return the future of a build."""
        future: Future[Build] = Future()
        self._todo.append((key, future))
        self._ready.release()
        return future

    def close(self) -> None:
        """End the thread, once the build that it makes is made; the others never are."""
        self._closed = True
        self._ready.release()
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _work(self) -> None:
        while True:
            self._ready.acquire()
            if self._closed:
                return
            (number, given), future = self._todo.popleft()
            if not future.set_running_or_notify_cancel():
                continue
            try:
                future.set_result(self._make(number, dict(given)))
            except BaseException as error:
                future.set_exception(error)
