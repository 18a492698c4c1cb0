"""Episodes in some worlds, for all environments: each array has a row for each car that learns, in order of worlds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SettingsError
from ..lidar.effects import LidarEffects
from ..native import core
from ..native_arrays import ArrayTable
from ..racing.planners import Value
from ..racing.randomization import PARAMETERS, Randomization
from ..simulation.settings import Start
from ..simulation.slots import Share
from ..simulation.termination import END_REASONS
from .compiled_step import NAMES
from .end_conditions import OTHER_CRASHED, as_end_conditions
from .environment_settings import EnvironmentSettings
from .episode_draws import EpisodeDraw
from .observer import CAMERA, FLAT, Seen
from .policy_interface import PolicyInterface
from .rewards import write_values
from .tick_state import TickState, leads, positions
from .worlds import Mask, Worlds

if TYPE_CHECKING:
    from .camera import Cameras

TRUNCATIONS = ("wrong_way", "no_progress", "time_limit")
"""End reasons of a race that truncate an episode; the others terminate it."""

FACTS = ("time_s", "progress_m", "laps", "sliding", "clipped_actions")
"""Facts of an episode: seconds and metres since its beginning, laps completed, the share of the last tick in which a
tire slid, NaN of tires without a peak, and the number of clipped actions."""

FACTS_AMONG_CARS = ("touches", "position", "lead_m")
"""Further facts where there are other cars: how often the car has touched one, its position, 1 in front, and its lead
on the foremost other car along the course, negative behind it."""


class Episodes:
    """Episodes in n worlds, each with its own beginning and end; (n,) is one for each car that learns.

    Attributes:
      interface: what a policy sees and answers.
      observer, camera, actions: of the cars that learn; no camera: None.
      commands: of the last tick (n, 2) [rad, m/s].
      rewards: of the last step (n,).
      terminates: whether each reason terminates an episode, by its number; those of TRUNCATIONS do not.
      clipped: number of clipped actions of the episode (n,).
      fact_names: FACTS; FACTS_AMONG_CARS where there are other cars; "contacts", touches where these end nothing; of
        each reward term "reward_NAME", its part of the last tick's reward, and "return_NAME", the sum of the episode;
        and "drawn_NAME" of what is randomised.
    """

    def __init__(self, settings: EnvironmentSettings, worlds: Worlds) -> None:
        self.worlds = worlds
        self._others, self._end_conditions = settings.rewards.others, as_end_conditions(settings.end_conditions)
        self._weights, self._share = settings.rewards.of_tick(worlds.period), settings.rewards.share
        self._running_costs = np.array([term.running_cost for term in settings.rewards.terms])
        self._reasons = (*END_REASONS, *(condition.name for condition in self._end_conditions), OTHER_CRASHED)
        truncations = (*TRUNCATIONS, *(each.name for each in self._end_conditions if each.outcome == "truncated"))
        self._truncates = np.array([reason in truncations for reason in self._reasons])
        self.terminates = np.array([reason not in ("", *truncations) for reason in self._reasons])
        self._grid = settings.start_grid(worlds.world)
        car, count = worlds.world.parameters, len(worlds.times)
        beams = worlds.world.vehicle.lidar.beams
        self.interface = PolicyInterface.of(settings, car, beams, worlds.period)
        self.observer = self.interface.observer(
            count, car=car, beams=beams, sensors=settings.sensed, privileged=settings.privileged
        )
        self.camera: Cameras | None = None
        if settings.camera:
            from .camera import Cameras  # which imports what draws

            self.camera = Cameras(worlds.engine, worlds.rows, settings.camera)
        self.actions, self._repeats = self.interface.actions(count), settings.action_repeat
        self._planners = self.interface.base_planners(beams, count)
        if self._planners is not None:
            self.actions.planned = self._planners.commands
        # a scan and odometry that nothing changes from tick to tick need to be sensed in the last one only
        self._senses_every_tick = (
            self.observer.needs_every_tick or settings.effects != LidarEffects() or bool(settings.sensed)
            or len(worlds.randomization.ranges) > 0 or self._planners is not None
        )  # fmt: skip
        self.rewards = np.zeros(count)
        names = [term.name for term in settings.rewards.terms]
        self._term_names = (*(f"reward_{name}" for name in names), *(f"return_{name}" for name in names))
        self._drawn = _drawn_facts(worlds.randomization, count)
        self._name_facts()
        self._terms = np.zeros((2, len(names), count))  # of each reward term the last tick's value, and the sum
        self._flat_terms = self._terms.reshape(2 * len(names), count)  # a view
        self.clipped = np.zeros(count, np.int64)
        self.commands = np.zeros((count, 2))
        self._driven, self._every = np.zeros(count, np.bool_), np.ones(count, np.bool_)
        self._sensed = False  # all cars, since they were driven
        timers = worlds.monitor.timers
        self._progress, self._laps = timers["progress"], timers["laps_completed"]  # views, as the next
        self._slid, self._touches = (worlds.engine.statistics[name][worlds.rows] for name in ("max_slide", "touches"))
        self._runs = worlds.monitor.running  # which cars go on, a view
        self._waits = settings.ended_by == "all" and worlds.cars > 1
        self._ended_by_any = settings.ended_by == "any" and worlds.cars > 1
        self._before = self._progress.copy()  # [m] at the last reward
        self._table = self._make_table()
        self._compiled = core.StepArrays(self._table.address)

    def _make_table(self) -> ArrayTable:
        """Return the table of all arrays of a step."""
        engine, bounds, count = self.worlds.engine, self.actions.bounds, len(self.rewards)
        contacts = self.worlds.contacts
        numbers = (
            self.worlds.stride, bounds.share, bounds.slow, self._share, not self._others, self.observer.range_max,
            engine.substeps, 0.0 if contacts is None else contacts.number,
        )  # fmt: skip
        return ArrayTable(NAMES, {
            "running": engine.running, "timers": engine.monitor.timers, "crashed": engine.crashed,
            "reasons": engine.monitor.reasons, "telemetry": engine.telemetry, "held": engine.commands,
            "odometry": engine.odometry.view(np.float64).reshape(len(engine.commands), -1), "ranges": engine.ranges,
            "driven": self._driven, "commands": self.commands, "clipped": self.clipped, **self.actions.arrays,
            "progress": np.zeros(count), "wrecked": np.zeros(count, np.bool_), "impacts": self.worlds.speeds,
            "before": self._before, "sliding": self.worlds.sliding, "weights": self._weights, "rewards": self.rewards,
            "terms": self._terms, **({} if contacts is None else contacts.arrays), **self.observer.arrays,
            "numbers": np.array(numbers, np.float64),
        })  # fmt: skip

    def _name_facts(self) -> None:
        among = FACTS_AMONG_CARS if self.worlds.cars > 1 else ()
        contacts = () if self.worlds.contacts is None else ("contacts",)
        self.fact_names = (*FACTS, *among, *contacts, *self._term_names, *self._drawn)

    @property
    def running(self) -> Mask:
        """Which episodes go on (n,)."""
        return self.worlds.running

    @property
    def terminated(self) -> Mask:
        """See the attributes."""
        return self.ended(self.terminates)

    @property
    def truncated(self) -> Mask:
        """See the attributes."""
        return self.ended(self._truncates)

    def ended(self, outcomes: Mask, late: Mask | None = None) -> Mask:
        """Return whose episode is over for a reason with one of these outcomes, or would be now: `late` (n,)."""
        ended: Mask = outcomes.take(self.worlds.monitor.reasons)
        if not self._waits:
            return ended
        return ended & (~self.running if late is None else late | ~self.running)

    def begin(
        self,
        which: Mask,
        generators: Sequence[np.random.Generator],
        start: Start | None = None,
        given: Mapping[str, Value] | None = None,
    ) -> None:
        """Begin the episodes in the worlds `which` (n,); the generators of the others are not touched.

        SettingsError: a start in a wall or an obstacle; TrackError: a given course that cannot be driven.
        """
        starts: list[Start] = []
        seeds: list[int] = []
        draws = self.worlds.draw(which, generators, given or {})
        for k, i in enumerate(map(int, np.flatnonzero(which))):
            rng = generators[i]
            if draws is None:
                starts += self._grid.draw(rng, start)
            else:
                starts += draws[k].build.grid.draw(rng, start, draws[k].start)
                self._note(i, draws[k], starts[-self.worlds.cars])
            seeds += [int(rng.integers(2**63)) for _ in range(self.worlds.cars)]
        self.worlds.begin(which, starts, seeds, draws)
        self._sensed = False
        agents = np.repeat(which, self.worlds.agents)
        self.actions.begin(agents)
        if self._planners is not None:
            self._planners.begin(agents)
        self.observer.begin(agents, [seed for i, seed in enumerate(seeds) if i % self.worlds.cars < self.worlds.agents])
        self.rewards[agents] = 0.0
        self._terms[:, :, agents] = 0.0
        self.clipped[agents], self._driven[agents] = 0, True
        self._before[agents] = self._progress[agents]
        touching = self.worlds.touching(which)
        if touching.any():
            bad = starts[int(touching.argmax())]
            said = f"at {bad} the car touches a wall or an obstacle, or is beyond the walls"
            raise SettingsError(f"{said}; accepted: another start")

    def _note(self, world: int, draw: EpisodeDraw, start: Start) -> None:
        """Keep what was drawn for an episode of a world, as facts of its agents."""
        rows = slice(world * self.worlds.agents, (world + 1) * self.worlds.agents)
        for name in self.worlds.randomization.ranges:
            owner, field = PARAMETERS[name]
            self._drawn[f"drawn_{name}"][rows] = getattr(start, field) if owner is Start else draw.values[name]

    def randomize(self, ranges: Mapping[str, Any]) -> None:
        """Draw from other ranges from the next reset of each world on, as `F1TenthEnv.set_randomization`."""
        changed = Randomization({**self.worlds.randomization.ranges, **Randomization.of(ranges).ranges})
        self.worlds.randomize(changed)
        self._drawn = _drawn_facts(changed, len(self.rewards)) | self._drawn
        self._name_facts()

    def step(self, actions: ArrayLike, *, sense: bool = False) -> None:
        """Take the actions (n, 2) in the worlds whose episodes go on; MessageError: an action that is no number.

        `sense`: `observe` of all worlds follows at once, so that each thread may sense in the same go.
        """
        self.tick(actions, sense=sense and self._repeats == 1)
        if self._repeats > 1:
            self._repeat()

    def tick(self, actions: ArrayLike, *, sense: bool = False) -> None:
        """Do a tick, in one compiled call where no car waits for Python and one thread drives; `sense` as of `step`."""
        worlds = self.worlds
        if not worlds.engine.compiled:
            self.command(actions)
            if self._waits:
                self.rewards[~self._driven], self._terms[0][:, ~self._driven] = 0.0, 0.0
                worlds.sliding[~self._driven] = 0.0
            worlds.drive(self.commands)
            self.reward()
            return
        given, shares = self.actions.given(actions), worlds.engine.shares
        if len(shares) == 1:
            self.actions.refuse(self._compiled.step(shares[0].tables, shares[0].firsts, given))
        else:
            self.actions.refuse(self._compiled.act(given))
            self._sensed = sense = sense and worlds.tick_state is None  # which is of the tick that was driven

            def drive(share: Share) -> None:
                self._compiled.drive_worlds(share.tables, share.firsts)
                if sense:
                    core.sense_all(share.tables, share.firsts, self._every)

            worlds.engine.share_out(drive)
            self._compiled.reward()
        if worlds.tick_state is not None:
            worlds.note(self.actions)
            worlds.follow(self._driven)
            self._look(worlds.tick_state)

    def command(self, actions: ArrayLike) -> None:
        """Convert actions to commands; MessageError: an action that is no number."""
        self.actions.refuse(self._compiled.act(self.actions.given(actions)))
        self.worlds.note(self.actions)

    def reward(self) -> None:
        """End the episodes that a condition ends, and reward the tick; SettingsError: a function's wrong answer."""
        self._compiled.note()
        self._compiled.reward()
        if self.worlds.tick_state is not None:
            self._look(self.worlds.tick_state)
        if self._ended_by_any:
            self.worlds.end(self.worlds.others_crashed & self._runs, len(self._reasons) - 1)

    def _look(self, state: TickState) -> None:
        """End and reward episodes by what Python says of a state; errors as of `reward`."""
        worlds = self.worlds
        for number, condition in enumerate(self._end_conditions, start=len(END_REASONS)):
            worlds.end(condition.holds(state) & self._runs, number)
        for index, term in enumerate(self._others, start=len(self._weights)):
            write_values(term, state, self._terms[0, index])
        if self._others:
            bad = core.sum_terms(self._driven, self._running_costs, self._share, self.rewards, self._terms)
            if bad >= 0:
                index, car = divmod(bad, len(self.rewards))
                name, value = self._others[index - len(self._weights)].name, self._terms[0, index, car]
                said = f"reward term {name!r} is {value} for car {car} of {len(self.rewards)}"
                raise SettingsError(f"{said}; accepted: finite numbers")

    def close(self) -> None:
        """End the threads, and free what draws."""
        self.worlds.close()
        if self.camera is not None:
            self.camera.close()

    def stop(self, which: Mask) -> None:
        """Stop the episodes `which` (n,)."""
        self.worlds.stop(which)

    def observe(self, which: Mask, *, step: bool = True) -> Seen:
        """Return new observations of all worlds, (n, ...) by name; those of the worlds `which` (n,) are sensed anew."""
        worlds, (scan, numbers) = self.worlds, self.observer.room()
        if worlds.engine.compiled and self._planners is None and len(worlds.engine.shares) == 1:
            share, odometry = worlds.engine.shares[0], worlds.odometry
            self._compiled.observe(share.tables, share.firsts, which, scan, numbers)
            self.actions.sense(odometry, which)
        else:
            if not self._sensed:
                worlds.sense(which)
            self._sensed, odometry = False, worlds.odometry
            self.actions.sense(odometry, which)
            if self._planners is not None:
                self._planners.decide(which, worlds.ranges, odometry)
            self._compiled.read(scan, numbers)
        seen: Any = self.observer.seen(which, scan, numbers, worlds.sensed_state, worlds.readings, step=step)
        if self.camera is not None and step:
            seen = (seen if isinstance(seen, dict) else {FLAT: seen}) | {CAMERA: self.camera.draw(which)}
        if self._waits and not self._driven.all():
            for values in seen.values() if isinstance(seen, dict) else (seen,):
                values[~self._driven] = 0
        return seen  # type: ignore[no-any-return]

    def _repeat(self) -> None:
        """Hold the actions for the other ticks of a step, and sum the rewards."""
        rewards, terms = self.rewards.copy(), self._terms[0].copy()
        stepped = self._driven.copy()
        for _ in range(self._repeats - 1):
            if not self.running.any():
                break
            running = self._runs.copy()
            if self._senses_every_tick:
                self.observe(running, step=False)
            else:
                self.worlds.skip(running)
            self.tick(self.actions.previous)
            rewards += np.where(self._driven, self.rewards, 0.0)
            terms += np.where(self._driven, self._terms[0], 0.0)
        self.rewards[:], self._terms[0], self._driven[:] = rewards, terms, stepped

    def facts(self) -> dict[str, NDArray[Any]]:
        """Return the facts of all episodes, new arrays (n,) by name, in the order of `fact_names`."""
        worlds = self.worlds
        sliding = np.where(np.isnan(self._slid), np.nan, worlds.sliding)
        values = [worlds.times, self._progress.copy(), self._laps.copy(), sliding, self.clipped.copy()]
        if worlds.cars > 1:
            values += self._touches.copy(), *(each(worlds.engine)[worlds.rows] for each in (positions, leads))
        if worlds.contacts is not None:
            values.append(worlds.contacts.counts[worlds.rows].copy())
        drawn = [each.copy() for each in self._drawn.values()]
        return dict(zip(self.fact_names, [*values, *self._flat_terms.copy(), *drawn], strict=True))

    def facts_of(self, i: int) -> dict[str, Any]:
        """Return the facts of episode i, numbers by name."""
        worlds, time = self.worlds, self.worlds.engine.time(i // self.worlds.agents)
        sliding = worlds.sliding.item(i) if self._slid.item(i) >= 0.0 else np.nan
        values = [time, self._progress.item(i), self._laps.item(i), sliding, self.clipped.item(i)]
        if worlds.cars > 1:
            values += self._touches.item(i), *(each(worlds.engine)[worlds.rows].item(i) for each in (positions, leads))
        if worlds.contacts is not None:
            values.append(worlds.contacts.counts[worlds.rows].item(i))
        drawn = [each.item(i) for each in self._drawn.values()]
        return dict(zip(self.fact_names, [*values, *self._flat_terms[:, i].tolist(), *drawn], strict=True))

    def ending(self, i: int) -> dict[str, Any]:
        """Return how episode i, which is over, ended: its reason, and the times of its laps, NaN where not driven."""
        monitor = self.worlds.monitor
        return {"end_reason": self._reasons[monitor.reasons[i]], "lap_times_s": monitor.lap_times[i].copy()}


def _drawn_facts(randomization: Randomization, count: int) -> dict[str, NDArray[Any]]:
    """Return arrays (n,) of the facts that tell what was drawn, by name."""
    words, whole = ("track", "vehicle", "tires", "opponent"), ("obstacles", "patches", "opponents")
    facts: dict[str, NDArray[Any]] = {}
    for name in randomization.ranges:
        kind = object if name in words else np.int64 if name in whole else np.float64
        facts[f"drawn_{name}"] = np.full(count, "" if name in words else 0, kind)
    return facts
