"""Starts of episodes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import SettingsError
from ..racing.entries import check_starts, grid_starts
from ..simulation.settings import Start
from ..simulation.world import World

GRID_ORDERS = ("as_listed", "reversed", "random")

_TRIES = 50  # places of a grid that are drawn before it is said to fit nowhere


def draw_start(world: World, rng: np.random.Generator) -> Start:
    """Return a random standing start, clear of obstacles, of a scene its own; SettingsError: obstacles everywhere."""
    s, offset, heading = world.track.draw_start(rng, world.parameters, world.obstacles)
    return Start(s=s, offset=offset, heading=heading)


@dataclass(frozen=True, kw_only=True)
class DrawnStart:
    """Random values of the starts of an episode."""

    fields: Mapping[str, float]  # of the Start of the grid's first place
    ahead: float | None  # [m] of their places on the grid, where opponents start; None: it is not drawn


class StartGrid:
    """Starts of the cars of a world: one alone at the start, several on a grid behind it, the `learners` first.

    The first place of the grid is `fixed`, or random; `own` has each car's own start, or None.
    """

    def __init__(
        self,
        world: World,
        fixed: Start | None,
        *,
        kind: str = "staggered",
        order: str = "as_listed",
        own: Sequence[Start | None] = (None,),
        learners: int = 1,
    ) -> None:
        self._world, self._fixed, self._order, self._own = world, fixed, order, own
        self._learners = learners
        self._cars = [car.parameters for car in world.cars]
        self._places = grid_starts(world.track, self._cars, kind)

    def draw(
        self,
        rng: np.random.Generator,
        start: Start | None = None,
        drawn: Callable[[int], DrawnStart] | None = None,
    ) -> list[Start]:
        """Return where each car starts, from `start` or the settings, and what is `drawn` at attempts from 0.

        SettingsError: a car would start in a wall, in an obstacle or in another car.
        """
        fixed = start or self._fixed
        now = None if drawn is None else drawn(0)
        redraws = now is not None and (len(now.fields) > 0 or now.ahead is not None)
        if len(self._cars) == 1 and not redraws:
            return [fixed or draw_start(self._world, rng)]
        refused = SettingsError("")
        for attempt in range(1 if fixed and not redraws else _TRIES):
            first = fixed or draw_start(self._world, rng)
            if len(self._cars) > 1:
                first = fixed or Start(s=first.s)
            if drawn is not None:
                now = drawn(attempt)
                first = replace(first, **now.fields)
            ahead = 0.0 if now is None else now.ahead or 0.0
            starts = self._on_grid(first, ahead, rng) if len(self._cars) > 1 else [first]
            names = [f"car_{index}" for index in range(len(starts))]
            try:
                check_starts(self._world.track, starts, self._cars, names, self._world.obstacles)
            except SettingsError as error:
                refused = error
            else:
                return starts
        raise refused

    def _on_grid(self, first: Start, ahead: float, rng: np.random.Generator) -> list[Start]:
        """Return where each car starts when the first place of the grid is at `first`, opponents so far ahead."""
        order = list(range(len(self._cars)))
        if self._order == "random":
            order = rng.permutation(len(order)).tolist()
        elif self._order == "reversed":
            order.reverse()
        starts = [first] * len(order)
        for place, car in zip(self._places, order, strict=True):
            s = first.s + place.s + (ahead if car >= self._learners else 0.0)
            starts[car] = self._own[car] or replace(first, s=s, offset=first.offset + place.offset)
        return starts
