"""Opponents: the cars of an environment that do not learn, and the planners and policies that drive them.

A policy is a function of an observation that returns an action, both as the environment has them.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..course.files import kept_folder
from ..errors import ControllerError, MessageError, PlannerError, SettingsError
from ..messages import Controller, shown
from ..racing.entries import Entry
from ..racing.planners import build_controller, find_controller, split_controller
from ..simulation.engine import Engine
from ..simulation.planner_adapter import Cars, Planners, PlannersOfEach, Reasons, adapt
from ..simulation.planner_adapter import start as start_planner
from ..simulation.settings import PLANNER_OPTIONS, CarSettings, known_settings
from ..simulation.world import World
from .actions import one_action
from .observer import Observer
from .policy_interface import Policy, PolicyInterface, row_of
from .tick_state import SensedState, TickStates

_ACCEPTED = (
    "a planner's name, path/to/file.py:ClassName, an Entry or its fields by name, or a policy: a function of an "
    "observation that returns an action"
)


def as_entries(opponents: Any, own: CarSettings) -> tuple[Entry, ...]:
    """Return the entries of opponents, of whom one without a car has that of `own`; SettingsError: what is none."""
    if isinstance(opponents, (str, Mapping)) or not isinstance(opponents, Sequence):
        raise SettingsError(f"opponents is {shown(opponents)}; accepted: a list, each {_ACCEPTED}")
    return tuple(_as_entry(opponent, number, own) for number, opponent in enumerate(opponents, start=1))


def _as_entry(opponent: Any, number: int, own: CarSettings) -> Entry:
    alike = ("vehicle", "tires", "mu", "floor", "changes", "sensors", *PLANNER_OPTIONS)
    same: dict[str, Any] = {name: getattr(own, name) for name in alike}
    if isinstance(opponent, Mapping):
        given = known_settings(opponent, Entry, f"opponent {number}")
        entry = Entry(**(given if "vehicle" in given else same | given))
    elif isinstance(opponent, Entry):
        entry = opponent
    else:
        entry = Entry(controller=opponent, **same)
    controller: Any = entry.controller
    if not isinstance(controller, str) and (
        isinstance(controller, type) or not callable(controller) or hasattr(controller, "reset")
    ):
        raise SettingsError(f"opponent {number} is {shown(controller)}; accepted: {_ACCEPTED}")
    if entry.effects.motion_distortion:
        raise SettingsError(f"motion distortion of the LiDAR of opponent {number}; accepted: in `race` only")
    return entry


class Opponents:
    """Planners and policies that drive the last cars of each world: Planners of the `rows` (n, opponents) of an engine.

    `settings` say what policies see and answer, nothing privileged. ControllerError, SettingsError: who cannot drive.
    """

    def __init__(
        self,
        entries: Sequence[Entry],
        engine: Engine,
        *,
        settings: Any,
        period: float,
        states: TickStates | None,
    ) -> None:
        count, m, world = engine.count, engine.cars_per_world, engine.world
        first = m - len(entries)
        self._engine, self._entries, self._found = engine, entries, dict[str, type]()
        self.rows = np.arange(count * m).reshape(count, m)[:, first:]
        self._planners: dict[int, Controller] = {}  # by row
        self._built_for: dict[int, tuple[Entry, World]] = {}
        self._policies: list[tuple[NDArray[np.int64], PolicyCars]] = []
        for number, entry in enumerate(entries, start=1):
            rows, car = self.rows[:, number - 1], world.cars[first + number - 1].parameters
            if isinstance(entry.controller, str):
                for row in rows.tolist():
                    self._build(row, entry)
            else:
                beams = world.vehicles[first + number - 1].lidar.beams
                interface = PolicyInterface.of(settings, car, beams, period)
                observer = interface.observer(count, car=car, beams=beams, sensors=entry.sensed)
                state, own = None, slice(first + number - 1, None, m)
                if states is not None:
                    state = states.sensed(states.of(own, car), own)
                planners = interface.base_planners(beams, count)
                cars = PolicyCars(entry.controller, number, interface, observer, state, planners)  # type: ignore[arg-type]
                self._policies.append((rows, cars))
        self._adapted: dict[int, Planners] = {}
        self._of_each = PlannersOfEach([])

    def check(self, entries: Sequence[Entry]) -> None:
        """Refuse entries that may be drawn and whose planner cannot be built; ControllerError: there is one."""
        for entry in entries:
            self._build(int(self.rows[0, 0]), entry)

    def _build(self, row: int, entry: Entry) -> None:
        """Build the planner of a car, unless it has that of the same entry on the same course."""
        i, car = divmod(row, self._engine.cars_per_world)
        world = self._engine.world_of(i)
        own, built = self._built_for.get(row, (None, None))
        if own is entry and built is world:
            return
        source, settings = split_controller(entry.controller, entry.planner_settings)
        assert isinstance(source, str)
        try:
            if source not in self._found:  # once: what is in a file becomes a new class each time
                self._found[source] = find_controller(source)
            context = entry.context(world.cars[car].parameters, world.track.map_line)
            self._planners[row] = build_controller(self._found[source], source, context, settings)
        except ControllerError as error:
            number = car - (self._engine.cars_per_world - len(self._entries)) + 1
            raise ControllerError(f"opponent {number}: {error}") from error
        self._built_for[row] = entry, world

    @property
    def failures(self) -> dict[int, PlannerError]:
        """Errors of the planners that have failed in the present episodes, by row."""
        return self._of_each.failures

    def begin(
        self, worlds: NDArray[np.bool_], seeds: Sequence[int], drawn: Sequence[Sequence[Entry]] | None = None
    ) -> None:
        """Reset the planners of some worlds (n,), with the entries `drawn` in each; ControllerError: one fails."""
        of_cars = np.array(seeds, np.uint64).reshape(int(np.count_nonzero(worlds)), -1)
        for rows, policy in self._policies:
            policy.begin(worlds, of_cars[:, rows[0] % of_cars.shape[1]].tolist())
        for k, rows in enumerate(self.rows[worlds].tolist()):
            for row, entry in zip(rows, self._entries if drawn is None else drawn[k], strict=False):
                if isinstance(entry.controller, str):
                    with warnings.catch_warnings():
                        if drawn is not None:  # a speed that is drawn is meant
                            warnings.simplefilter("ignore")
                        self._build(row, entry)
                    start_planner(self._planners[row])
                    self._adapted[row] = adapt([self._planners[row]])
        of_planners = [(np.array([row]), planners) for row, planners in self._adapted.items()]
        self._of_each = PlannersOfEach([*of_planners, *self._policies])

    @kept_folder()
    def __call__(self, cars: Cars) -> Reasons | None:
        """See Planners; MessageError: a policy answers no action. What a policy raises is not caught."""
        return self._of_each(cars)


class PolicyCars:
    """The cars of a policy in some worlds: Planners that call it with the observation of each."""

    def __init__(
        self,
        policy: Policy,
        number: int,
        interface: PolicyInterface,
        observer: Observer,
        state: SensedState | None,
        planners: Any,
    ) -> None:
        count = observer.count
        self._policy, self._number, self._interface, self._observer = policy, number, interface, observer
        self._actions, self._state, self._ticks = interface.actions(count), state, np.zeros(count, np.int64)
        self._planners = planners
        if planners is not None:
            self._actions.planned = planners.commands
        self.failures: dict[int, PlannerError] = {}  # a policy's error is the caller's own

    def begin(self, which: NDArray[np.bool_], seeds: Sequence[int]) -> None:
        """Forget what the cars `which` (n,) have seen; one seed of their observations' noise for each of them."""
        self._observer.begin(which, seeds)
        self._actions.begin(which)
        self._ticks[which] = 0
        if self._planners is not None:
            self._planners.begin(which)

    def __call__(self, cars: Cars) -> Reasons | None:
        """See Planners."""
        running, count = cars.running, len(cars.running)
        asked = running & (self._ticks % self._interface.action_repeat == 0)
        self._ticks += running
        self._actions.sense(cars.odometry, running)
        if self._planners is not None:
            self._planners.decide(running, cars.ranges, cars.odometry)
        readings = [cars.readings(row) for row in range(count)]
        parts = cars.ranges, cars.odometry, self._state, readings, self._actions.previous, self._actions.planned
        if self._observer.needs_every_tick:
            self._observer.read(running & ~asked, *parts, step=False)
        seen = self._observer.read(asked, *parts)
        actions = np.zeros((count, 2))
        for world in map(int, np.flatnonzero(asked)):
            action = self._policy(row_of(seen, world))
            said = f"the policy of opponent {self._number} answered"
            actions[world] = one_action(action, said, self._interface.bounds)
        try:
            self._actions.again(running & ~asked, cars.commands)
            self._actions.read(actions, asked, cars.commands, np.zeros(count, np.int64))
        except MessageError as error:
            raise MessageError(f"the policy of opponent {self._number}: {error}") from error
        return None
