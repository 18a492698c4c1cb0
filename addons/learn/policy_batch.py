"""Policy files that drive many cars, asked together: the opponents of self-play.

The planner of each car stays the one that is built and reset, and that refuses what does not fit. A PolicyBatch gives
the commands that these would give, bit for bit: one observer reads the scans of all cars in compiled code, and the cars
of one file are evaluated in one call.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.envs.policy_interface import OwnState
from fg_mujoco.errors import PlannerError
from fg_mujoco.simulation.planner_adapter import Cars, Reasons

from .policy_files import Policy

if TYPE_CHECKING:
    from .policy_planner import PolicyPlanner

Mask = NDArray[np.bool_]


class PolicyBatch:
    """Cars that policies of one interface drive, as Planners.

    Args:
      policy: one of them.
      count: of cars, k; those that were never begun are left alone.
    """

    def __init__(self, policy: Policy, count: int) -> None:
        interface = policy.interface.without_delays()
        self.failures: dict[int, PlannerError] = {}  # a network of finite weights always answers
        self._repeat = interface.action_repeat
        self._observer, self._actions = interface.observer(count), interface.actions(count)
        self._commands, self._ticks = np.zeros((count, 2)), np.zeros(count, np.int64)
        self._fastest = np.zeros(count)
        self._policies: dict[int, Policy] = {}  # by row
        self._rows: list[tuple[Any, NDArray[np.int64]]] = []  # of each network
        self._driven = np.zeros(count, np.bool_)

    def begin(self, planners: Mapping[int, PolicyPlanner]) -> None:
        """Drive some cars as these planners do, from the beginning."""
        which = np.zeros(len(self._driven), np.bool_)
        for row, planner in planners.items():
            which[row], self._policies[row], self._fastest[row] = True, planner.policy, planner.max_speed
        self._driven |= which
        self._observer.begin(which, [0] * len(planners))
        self._actions.begin(which)
        self._commands[which], self._ticks[which] = 0.0, 0
        self._group()

    def leave(self, rows: list[int]) -> None:
        """Drive these cars no longer."""
        self._driven[rows] = False
        for row in rows:
            self._policies.pop(row, None)
        self._group()

    def _group(self) -> None:
        """Sort the cars by their networks."""
        found: dict[int, list[int]] = {}
        for row, policy in sorted(self._policies.items()):
            found.setdefault(id(policy), []).append(row)
        self._rows = [(self._policies[rows[0]].network, np.array(rows)) for rows in found.values()]

    def __bool__(self) -> bool:
        return bool(self._policies)

    def __call__(self, cars: Cars) -> Reasons | None:
        """See Planners."""
        running = cars.running & self._driven
        asked = running & (self._ticks % self._repeat == 0)
        self._ticks += running
        if asked.any():
            odometry = cars.odometry.copy()
            values = odometry.view(np.float64)
            values[~np.isfinite(values)] = 0.0
            state: Any = OwnState(time=np.zeros(len(asked)), command=self._commands)
            self._actions.sense(odometry, asked)
            seen: Any = self._observer.read(asked, cars.ranges, odometry, state, (), self._actions.previous)
            actions = self._answers(seen, asked)
            self._actions.read(actions, asked, self._commands, np.zeros(len(asked), np.int64))
        if self._repeat > 1:
            self._actions.again(running & ~asked, self._commands)
        commands = self._commands[running]
        commands[:, 1] = np.clip(commands[:, 1], -self._fastest[running], self._fastest[running])
        cars.commands[running] = commands
        return None

    def _answers(self, seen: NDArray[np.float32], asked: Mask) -> NDArray[np.float64]:
        """Return the actions (k, 2) for the observations (k, width) of the cars `asked` (k,)."""
        actions = np.zeros((len(asked), 2))
        for network, rows in self._rows:
            own = rows[asked[rows]]
            if len(own):
                found = network.of_each(seen[own])
                actions[own] = np.where(np.isnan(found), np.float32(0.0), found)
        return actions
