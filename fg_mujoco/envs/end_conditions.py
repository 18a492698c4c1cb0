"""End conditions: functions of the state of the cars after a tick that say whose episodes end.

    env = F1TenthEnv(end_conditions=["touched_car"])

They come after the reasons for which a race ends, a crash, the last lap and so on. The name of a condition is the
`end_reason`. It says itself whether an episode is terminated, because something has happened to the car, or truncated,
because there is nothing more to be seen. Own conditions are made with `@end_condition`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SettingsError, accepted_names
from ..messages import shown
from ..registry import Registry
from ..simulation.termination import END_REASONS
from .tick_state import TickState

_MADE = "or an EndCondition, as @end_condition makes it"

OUTCOMES = ("terminated", "truncated")

OTHER_CRASHED = "other_crashed"
"""End reason of an episode that the crash of another car ends, see `ended_by` of EnvironmentSettings."""

_TAKEN = (*END_REASONS, OTHER_CRASHED)

EndFunction = Callable[[TickState], ArrayLike]


@dataclass(frozen=True, kw_only=True)
class EndCondition:
    """A condition that ends the episodes of cars.

    Raises:
      SettingsError: a name that is no word or is that of another end reason, no function, or another outcome.
    """

    name: str
    function: EndFunction  # of a TickState: one bool for each car
    outcome: str  # one of OUTCOMES

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.isidentifier() or self.name in _TAKEN:
            taken = ", ".join(_TAKEN[1:])
            raise SettingsError(f"an end condition is called {shown(self.name)}; accepted: one word other than {taken}")
        if not callable(self.function):
            raise SettingsError(f"end condition {self.name!r} is {shown(self.function)}; accepted: a function")
        if self.outcome not in OUTCOMES:
            said = f"the outcome of end condition {self.name!r} is {shown(self.outcome)}"
            raise SettingsError(f"{said}; {accepted_names(self.outcome, OUTCOMES)}")

    def holds(self, state: TickState) -> NDArray[np.bool_]:
        """Return for which cars it holds. Shape (n,).

        Raises:
          SettingsError: the function returned something else than one bool for each car.
        """
        found = np.asarray(self.function(state))
        if found.shape != state.time.shape or found.dtype != np.bool_:
            raise SettingsError(
                f"end condition {self.name!r} returned {found.dtype} of shape {found.shape}; accepted: one bool for "
                f"each car, shape {state.time.shape}"
            )
        return found


END_CONDITIONS: Registry[EndCondition] = Registry("end condition", SettingsError, "fg_mujoco.end_conditions")
"""The conditions that are known by name."""


def end_condition(outcome: str) -> Callable[[EndFunction], EndCondition]:
    """Make an end condition of a function and register it by the function's name, for use as a decorator.

    Args:
      outcome: "terminated" or "truncated".

    Raises:
      SettingsError: as EndCondition, or a bundled condition has that name.
    """

    def register(function: EndFunction) -> EndCondition:
        made = EndCondition(name=function.__name__, function=function, outcome=outcome)
        if made.name in END_CONDITIONS and END_CONDITIONS.find(made.name).function.__module__ == __name__:
            raise SettingsError(f"end condition {made.name!r} is a bundled one; accepted: another name")
        END_CONDITIONS[made.name] = made
        return made

    return register


@end_condition("terminated")
def touched_car(state: TickState) -> NDArray[np.bool_]:
    """The car touches another car (as in f1tenth_gym, where it is a collision)."""
    return state.touches > 0


@end_condition("truncated")
def turned_round(state: TickState) -> NDArray[np.bool_]:
    """The heading is more than 90 degrees from the direction of the course, as after a spin."""
    return np.abs(state.heading_error) > 0.5 * math.pi


def as_end_conditions(given: Any) -> tuple[EndCondition, ...]:
    """Return the conditions of a list of names and EndConditions.

    Raises:
      SettingsError: no such list, an unknown name, or the same name twice.
    """
    if isinstance(given, str) or not isinstance(given, Sequence):
        raise SettingsError(f"end_conditions is {shown(given)}; accepted: a list of names and EndConditions")
    found: list[EndCondition] = []
    for each in given:
        condition = END_CONDITIONS.find(each, f", {_MADE}") if isinstance(each, str) else each
        if not isinstance(condition, EndCondition):
            raise SettingsError(f"an end condition is {shown(each)}; accepted: a name, {_MADE}")
        if any(condition.name == other.name for other in found):
            raise SettingsError(f"end condition {condition.name!r} stands twice in end_conditions; accepted: once")
        found.append(condition)
    return tuple(found)
