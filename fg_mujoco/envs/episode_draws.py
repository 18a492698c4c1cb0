"""Random values of each episode of an environment, from the generator of its world alone.

An episode's seed is drawn when the episode before it begins: so the build of the next episode is known, and made, while
the present one is driven. From the seed follow all values, and the number of the build, whose values stand in the
place of those that were drawn for what is compiled.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import SettingsError, accepted_names
from ..lidar.effects import LidarEffects
from ..racing.entries import Entry
from ..racing.randomization import PARAMETERS, Choice, Randomization, generator
from ..simulation.settings import Start, as_part
from ..vehicle.changes import CarChanges
from .builds import BUILT, Build, BuildPlan, Builds, Values
from .environment_settings import EnvironmentSettings, check_randomization
from .starts import DrawnStart


@dataclass(frozen=True, kw_only=True, eq=False)
class EpisodeDraw:
    """Values that were drawn for an episode."""

    values: Values  # by name
    build: Build
    changes: CarChanges | None  # of the cars that learn; None: they are as they were compiled
    effects: LidarEffects  # of their LiDARs
    odometry_drift: float
    opponents: tuple[Entry, ...]  # that take part
    start: Callable[[int], DrawnStart]  # what is drawn of the starts, at an attempt from 0


class EpisodeDraws:
    """Draws the episodes of n worlds, of what `randomization` says."""

    def __init__(self, settings: EnvironmentSettings, count: int, agents: int, forget: Callable[[Build], None]) -> None:
        self._settings, self._agents, self._forget = settings, agents, forget
        self.randomization = settings.randomization
        self._builds = Builds(BuildPlan(settings, self.randomization, agents), forget, count)
        self._ahead: list[tuple[np.random.Generator, int] | None] = [None] * count

    def first_build(self) -> Build:
        """Return build 0."""
        return self._builds.get(0)

    def begin(
        self, which: Sequence[int], generators: Sequence[np.random.Generator], given: Mapping[str, Any]
    ) -> list[EpisodeDraw]:
        """Return what is drawn for the episodes that begin in the worlds `which`; errors as of BuildPlan.make."""
        seeds, following = [], []
        for i in which:
            rng, ahead = generators[i], self._ahead[i]
            seeds.append(ahead[1] if ahead is not None and ahead[0] is rng else int(rng.integers(2**53)))
            self._ahead[i] = rng, int(rng.integers(2**53))
            following.append(self._ahead[i][1])  # type: ignore[index]
        for seed in (*(() if any(name in BUILT for name in given) else seeds), *following):
            self._builds.prepare(self._number(seed))
        return [self._draw(seed, given) for seed in seeds]

    def change(self, randomization: Randomization) -> None:
        """Draw otherwise from the next reset of each world on."""
        check_randomization(randomization, self._settings, laps=self._settings.laps)
        plan = BuildPlan(self._settings, randomization, self._agents)
        if plan.key != self._builds.plan.key:
            self._builds.close()
            self._builds = Builds(plan, self._forget, len(self._ahead))
        self.randomization = randomization

    def close(self) -> None:
        """End the thread that builds ahead."""
        self._builds.close()

    def _number(self, seed: int) -> int:
        """Return the number of the build of an episode."""
        builds = self._settings.builds
        return int(generator(seed, "build").integers(2**53 if builds is None else builds))

    def _draw(self, seed: int, given: Mapping[str, Any]) -> EpisodeDraw:
        settings, number = self._settings, self._number(seed)
        build = self._builds.get(number, {name: value for name, value in given.items() if name in BUILT})
        values = {**self.randomization.draw(seed), **build.values, **given}
        of: dict[Any, dict[str, Any]] = {CarChanges: {}, LidarEffects: {}, Start: {}}
        for name, value in values.items():
            owner, field = PARAMETERS[name]
            if owner in of:
                of[owner][field] = value

        def start(attempt: int) -> DrawnStart:
            if attempt == 0:
                return _start(of[Start], values)
            shares = dict(zip(PARAMETERS, generator(seed, f"start {attempt}").random(len(PARAMETERS)), strict=True))
            again = {name: each.at(float(shares[name])) for name, each in self.randomization.ranges.items()}
            again |= given
            found = {PARAMETERS[name][1]: each for name, each in again.items() if PARAMETERS[name][0] is Start}
            return _start(found, again)

        return EpisodeDraw(
            values=values, build=build,
            changes=replace(settings.all_changes, **of[CarChanges]) if of[CarChanges] else None,
            effects=replace(settings.effects, **of[LidarEffects]),
            odometry_drift=float(values.get("odometry_drift", 0.0)),
            opponents=settings.drawn_entries(values),
            start=start,
        )  # fmt: skip


def _start(fields: Mapping[str, Any], values: Mapping[str, Any]) -> DrawnStart:
    ahead = values.get("opponent_ahead")
    return DrawnStart(fields=fields, ahead=None if ahead is None else float(ahead))


def read_options(options: Mapping[str, Any] | None, randomization: Randomization) -> tuple[Start | None, Values]:
    """Return the start, and the values of parameters by name, that the options of a reset give for this episode.

    SettingsError: neither `start` nor drawn, or what cannot be had; TrackError: a course that cannot be built.
    """
    given: Values = {}
    start: Start | None = None
    for name, value in (options or {}).items():
        if name == "start":
            start = None if value is None else as_part(value, Start, "start")
            continue
        if name not in randomization.ranges:
            if name in PARAMETERS:
                said = f"reset sets {name!r}, which this environment does not draw"
                raise SettingsError(f'{said}; accepted: an environment made with randomize={{"{name}": ...}}')
            names = ["start", *randomization.ranges]
            raise SettingsError(f"reset has no option {name!r}; {accepted_names(name, names)}")
        plain = str(value) if isinstance(value, Path) else value.item() if isinstance(value, np.generic) else value
        given |= {name: Randomization({name: Choice((plain,))}).draw(0)[name]}
    return start, given
