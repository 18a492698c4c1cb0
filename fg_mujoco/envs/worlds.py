"""The worlds of an environment: places their cars, drives them for a tick, and senses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import portable
from ..errors import SettingsError
from ..messages import FloatArray, Reading
from ..racing.randomization import Randomization
from ..simulation.engine import Engine
from ..simulation.settings import Start
from ..simulation.telemetry import TELEMETRY
from ..simulation.termination import END_REASONS
from ..vehicle.changes import CarChanges
from .actions import ActionReader
from .builds import Build
from .contacts import Contacts
from .environment_opponents import Opponents
from .environment_settings import EnvironmentSettings
from .episode_draws import EpisodeDraw, EpisodeDraws
from .tick_state import SensedState, TickState, TickStates

Mask = NDArray[np.bool_]

_SLIDING_STEPS, _AHEAD, _LEFT = (TELEMETRY.index(name) for name in ("sliding_steps", "vx_m_s", "vy_m_s"))
_CRASHES = [END_REASONS.index(reason) for reason in ("crash", "rolled_over", "unstable")]


class Worlds:
    """Worlds of one engine. Each is reset while the others go on.

    In each world the first cars are those that learn, the agents; the others are its opponents. Arrays are overwritten
    by the next call; (a,) is one for each agent, those of world 0 first. While others of its world go on, an agent that
    has finished is off the course; one whose episode is over otherwise brakes and stays where it is.

    Attributes:
      period: of a tick [s].
      agents, cars: of each world; more agents than one in one world only.
      rows, stride: of the agents among the engine's rows.
      monitor: of the agents' episodes: laps, which run, and why they ended.
      sliding: share of the last tick's physics steps in which any tire slid, (a,).
      speeds: over the ground at the start of the last tick, (a,) [m/s].
      contacts: touches of all cars that end nothing; None: with them a race is over.
      tick_state, sensed_state: of the agents after the last tick; None: no term of the settings looks at it.
    """

    def __init__(
        self,
        settings: EnvironmentSettings,
        count: int = 1,
        threads: int = 1,
        engine: Engine | None = None,
        agents: int = 1,
    ) -> None:
        self.settings = settings
        self._draws: EpisodeDraws | None = None
        if settings.randomization.ranges:
            self._draws = EpisodeDraws(settings, count, agents, self._forget)
            self._apart = np.zeros(count, np.bool_)  # the worlds with a model of their own
        self.engine = engine or settings.make_engine(
            count, threads, agents=agents, world=None if self._draws is None else self._draws.first_build().world
        )
        self.world, self.period, self.agents = self.engine.world, self.engine.period, agents
        self.cars = m = self.engine.cars_per_world
        self.rows = slice(0, agents) if count == 1 else slice(0, None, m)  # of the agents
        self.stride = 1 if count == 1 else m
        self.monitor = self.engine.monitor.part(self.rows)
        if engine is None:
            self.engine.no_messages[self.rows] = True
        if settings.builds is not None:  # as many as there are of each on average
            self.engine.room = max(round(count / (threads * settings.builds)), 1)
        entries = settings.opponents
        self._effects = [settings.effects] * agents + [entry.effects for entry in entries]
        self._drifts = [0.0] * agents + [entry.odometry_drift for entry in entries]
        for sensor in settings.sensed:
            sensor.steps(self.world.model.opt.timestep, self.engine.substeps)  # refuses a rate that there is not
        self._sensors = [settings.sensed] * agents + [entry.sensed for entry in entries]
        self._states = TickStates(self.engine, apart=self._draws is not None) if settings.looks_at_state else None
        self.tick_state: TickState | None = None
        self.sensed_state: SensedState | None = None
        if self._states is not None:
            self.tick_state = self._states.of(self.rows, self.world.parameters)
            self.sensed_state = self._states.sensed(self.tick_state, self.rows)
        self._odometry = self.engine.odometry[self.rows]
        self._opponents: Opponents | None = None
        if entries:
            self._opponents = self.engine.planners = Opponents(
                entries, self.engine, settings=settings, period=self.period, states=self._states,
            )  # fmt: skip
            self._opponents.check(settings.drawn_opponents)
        self.sliding, self.speeds = np.zeros(count * agents), np.zeros(count * agents)
        self.contacts = None if settings.on_contact == "end" else Contacts(self.engine, settings.on_contact)
        self._sensed = np.zeros(count * m, np.bool_)  # the cars that have sensed what they can at the present moment

    @property
    def times(self) -> FloatArray:
        """Simulated since the beginning of each agent's episode. Shape (a,) [s]."""
        times = self.engine.times
        return times if self.agents == 1 else np.repeat(times, self.agents)

    @property
    def ranges(self) -> FloatArray:
        """Last sensed, as in LaserScan. Shape (a, beams) [m]."""
        return np.ascontiguousarray(self.engine.ranges[self.rows])

    @property
    def odometry(self) -> NDArray[np.void]:
        """Last sensed. Shape (a,) of ODOMETRY."""
        return np.ascontiguousarray(self._odometry)

    @property
    def readings(self) -> list[Mapping[str, Reading]]:
        """Readings of the sensors of each agent, by their names."""
        engine = self.engine
        return [engine.readings(row) for row in range(len(engine.commands))[self.rows]] if self._sensors[0] else []

    @property
    def randomization(self) -> Randomization:
        """Ranges that each episode draws from."""
        return Randomization({}) if self._draws is None else self._draws.randomization

    def randomize(self, randomization: Randomization) -> None:
        """Draw otherwise from the next reset of each world on; SettingsError: what cannot be drawn."""
        if self._draws is None:
            raise SettingsError("this environment draws nothing; accepted: one that was made with randomize=...")
        self._draws.change(randomization)

    def draw(
        self, which: Mask, generators: Sequence[np.random.Generator], given: Mapping[str, Any]
    ) -> list[EpisodeDraw] | None:
        """Draw the episodes of the worlds `which` (n,) and make these what was drawn; None: nothing is drawn."""
        if self._draws is None:
            return None
        worlds = np.flatnonzero(which).tolist()
        draws = self._draws.begin(worlds, generators, given)
        self.engine.rebuild_worlds({
            i: draw.build.world for i, draw in zip(worlds, draws, strict=True)
            if not self._apart[i] or self.engine.world_of(i) is not draw.build.world
        })  # fmt: skip
        self._apart[which] = True
        others = [CarChanges()] * (self.cars - self.agents)
        for i, draw in zip(worlds, draws, strict=True):
            if draw.changes is not None:
                self.engine.change(i, [*[draw.changes] * self.agents, *others])
        return draws

    def _forget(self, build: Build) -> None:
        self.engine.forget([build.world])

    def begin(
        self, which: Mask, starts: Sequence[Start], seeds: Sequence[int], draws: Sequence[EpisodeDraw] | None = None
    ) -> None:
        """Place the cars of the worlds `which` (n,); one start and one seed of the LiDAR's noise for each of them."""
        worlds = int(np.count_nonzero(which))
        effects, drifts = self._effects * worlds, self._drifts * worlds
        if draws is not None:
            m, a = self.cars, self.agents
            for k, draw in enumerate(draws):
                effects[k * m : k * m + a], drifts[k * m : k * m + a] = [draw.effects] * a, [draw.odometry_drift] * a
        self.engine.place(
            starts, np.repeat(which, self.cars), effects=effects, seeds=seeds, odometry_drifts=drifts,
            sensors=self._sensors * worlds,
        )  # fmt: skip
        if self.contacts is not None:
            self.contacts.begin(np.repeat(which, self.cars))
        if self._opponents is not None:
            self._opponents.begin(which, seeds, None if draws is None else [draw.opponents for draw in draws])
        self._take_off(which, draws or ())
        self.sliding[np.repeat(which, self.agents)] = 0.0
        self._sensed[np.repeat(which, self.cars)] = False
        if self._states is not None:
            self._states.begin(np.repeat(which, self.cars))

    def _take_off(self, which: Mask, draws: Sequence[EpisodeDraw]) -> None:
        """Take the opponents off the course that take no part in the episodes that begin in the worlds `which`."""
        for i, draw in zip(np.flatnonzero(which).tolist(), draws, strict=False):
            for car in range(self.agents + len(draw.opponents), self.cars):
                self.engine.take_off(i * self.cars + car)

    def touching(self, which: Mask) -> Mask:
        """Return which cars of the worlds `which` (n,) have touched a wall or an obstacle, in a row each."""
        return self.engine.crashed[np.repeat(which, self.cars)]

    def note(self, actions: ActionReader) -> None:
        """Take note of the last actions of the agents, for the terms that are functions of them."""
        if self._states is not None:
            self._states.actions[self.rows] = actions.from_minus_1_to_1

    def follow(self, driven: Mask) -> None:
        """Take note of a tick for which compiled code alone has driven the agents `driven` (a,), and judged them."""
        if self._states is not None:
            self._states.drive(driven & ~self.engine.failed)
            self._states.judge()

    def drive(self, commands: FloatArray) -> None:
        """Hold the commands (a, 2) [rad, m/s] for a tick in the worlds that run, and judge; errors as of Opponents."""
        engine = self.engine
        if self._opponents is not None:
            opponents = np.zeros(len(engine.commands), np.bool_)
            opponents[self._opponents.rows] = True
            engine.sense(engine.running & opponents)
            engine.decide()
        engine.commands[self.rows] = commands
        if self.cars > 1:
            engine.commands[self.rows][~self.monitor.running, 1] = 0.0
        if self.contacts is not None:
            self.contacts.clear()
        engine.drive()
        if self.contacts is not None:
            self.contacts.take()
        self.measure()
        if self.cars > 1:  # who finishes is taken off the course, and has seen the end of it
            self.sense(self.monitor.running.copy())
            self._sensed[self.rows] = self.monitor.running
        self.judge()

    def measure(self) -> None:
        """Note how the tick was that the engine was driven for, before the cars sense and the next one begins."""
        engine, running = self.engine, self.monitor.running
        telemetry = engine.telemetry[self.rows]
        np.divide(telemetry[:, _SLIDING_STEPS], engine.substeps, out=self.sliding, where=running)
        self.speeds[:] = portable.hypot(telemetry[:, _AHEAD], telemetry[:, _LEFT])
        if self._states is not None:
            self._states.drive(engine.running)

    def judge(self) -> None:
        """Judge the races after a tick that was measured; a world ends with the last of its agents."""
        self.engine.judge()
        if self.contacts is not None:
            self.contacts.tell()
        if self._states is not None:
            self._states.judge()
        self._stop_without_agents()

    def end(self, which: Mask, reason: int) -> None:
        """End the episodes of the agents `which` (a,), with a number for the reason."""
        self.monitor.reasons[which], self.monitor.running[which] = reason, False
        self._stop_without_agents()

    @property
    def running(self) -> Mask:
        """Which episodes of agents go on (a,): where the settings say so, until the last car of a world has ended."""
        if self.settings.ended_by != "all":
            return self.monitor.running
        each: Mask = np.repeat(self.engine.running.reshape(-1, self.cars).any(axis=1), self.agents)
        return each

    @property
    def others_crashed(self) -> Mask:
        """Which agents have a crashed or rolled-over car, or broken physics, in their world (a,)."""
        out = np.isin(self.engine.monitor.reasons, _CRASHES).reshape(-1, self.cars).any(axis=1)
        found: Mask = np.repeat(out, self.agents)
        return found

    def stop(self, which: Mask) -> None:
        """Stop the cars of the worlds `which` (n,)."""
        self.engine.running.reshape(-1, self.cars)[which] = False

    def _stop_without_agents(self) -> None:
        """Stop the worlds in which no agent's episode goes on, or where the settings say so, no car's."""
        if self.cars > 1 and self.settings.ended_by != "all":
            goes_on: Mask = np.asarray(self.monitor.running.reshape(-1, self.agents).any(axis=1))
            self.stop(~goes_on)

    def sense(self, which: Mask) -> None:
        """Take the scans and odometry of the agents `which` (a,); once for each moment."""
        rows = which
        if self.cars > 1:
            rows = np.zeros(len(self.engine.commands), np.bool_)
            rows[self.rows] = which
            rows &= ~self._sensed
            self._sensed[:] = False
        self.engine.sense(rows)

    def skip(self, which: Mask) -> None:
        """Begin a tick of the agents `which` (a,) whose scans nobody looks at."""
        if self.cars > 1:
            self.sense(which)
        else:
            self.engine.read_odometry(which)

    def state(self, i: int) -> FloatArray:
        """Return the complete state of world i (mjSTATE_INTEGRATION), a copy."""
        return self.engine.state(i).copy()

    def close(self) -> None:
        """End the threads."""
        self.engine.close()
        if self._draws is not None:
            self._draws.close()
