"""The rules of a race, and what race control keeps of one: contacts, overtakes, warnings, restarts.

    control = race_control(engine, names=("a", "b"), rules="roboracer_2026")
    while engine.running.any():
        engine.tick()
        control.after_tick()
    control.finish()
    control.contacts, control.overtakes, control.warnings

RaceControl of the add-on arena watches several cars and enforces rules. One car without rules needs none: no
other car can touch it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from .. import from_addons
from ..arguments import explain_class
from ..errors import SettingsError, accepted_names
from ..messages import shown
from ..simulation.termination import END_REASONS
from .entries import BOTH

if TYPE_CHECKING:
    from ..simulation.engine import Engine


@dataclass(frozen=True, kw_only=True)
class Rules:
    """The interventions of race control, which otherwise only keeps a record. Lengths in metres."""

    name: str
    free_displacement: float = math.inf  # a touch that displaces a car by less is free; inf: all are, long pushes, too
    restart_behind: float = 2.0  # the car at fault starts again so far behind the other
    restart_behind_driving: float = 3.0  # and so far where the other drove on by itself
    most_warnings: int = 3  # the last of them disqualifies
    checkpoints: int = 0  # of a lap: a car that touches a wall starts again at the last one; 0: the wall ends its race
    wall_penalty: float = 0.0  # [s] for each such touch, added to the time of the race
    most_wall_contacts: int = 0  # one more disqualifies


RULES = {
    "none": Rules(name="none"),
    "roboracer_2026": Rules(name="roboracer_2026", free_displacement=0.05),
    "autodrive_2026": Rules(name="autodrive_2026", checkpoints=21, wall_penalty=10.0, most_wall_contacts=10),
}
"""By name. Sources of the numbers: RoboRacer rules, version 3.2026-draft; rules of 2026 of the RoboRacer Sim Racing
League, in AutoDRIVE's simulator; 21 checkpoints has its scene of ICRA 2026 (AutoDRIVE-Simulator at bb0c5018)."""


@explain_class
@dataclass(frozen=True, kw_only=True)
class Contact:
    """Two cars that touched, from their first touch until they were apart. Fields are as in the JSON."""

    time_s: float  # of the first touch, at the start of its tick
    cars: tuple[str, str]
    impulse_Ns: float  # noqa: N815  # of the one on the other, summed over all touches
    closing_speed_m_s: float  # before it, where they first touched, along the contact's normal
    displacement_m: float  # how far the force would have pushed the more easily pushed of them, standing, tires sliding
    at_fault: str  # name of the car, "both" or "no fault", see docs/addons/arena/race_control.md
    x_m: float  # where they first touched
    y_m: float
    reason: str = ""  # why it is at fault, see there; empty in older runs

    def blames(self, name: str) -> bool:
        """Return whether a car is at fault, alone or with the other."""
        return self.at_fault == name or (self.at_fault == BOTH and name in self.cars)


@explain_class
@dataclass(frozen=True, kw_only=True)
class Overtake:
    """A car passed another. Fields are as in the JSON."""

    time_s: float  # when it first led by half its length
    by: str
    of: str
    s_m: float  # progress of the passing car then


@dataclass(frozen=True, kw_only=True)
class Warned:
    """A warning of race control. Fields are as in the JSON."""

    time_s: float
    car: str
    reason: str


@dataclass(frozen=True, kw_only=True)
class Restart:
    """A car that was put back. Fields are as in the JSON; a replay puts it back, too."""

    time_s: float
    tick: int  # at the end of which, from 1
    car: int
    s_m: float  # of its new start, as in Start
    offset_m: float


class RaceRecord:
    """The record of a race of one car without rules: no events. Race control extends it.

    Args:
      engine: with its cars placed.
      names: of the cars.

    Attributes:
      contacts, overtakes, warnings, restarts: so far.
      wall_contacts: after which each car was put back, (m,).
      puts_back_at_walls: whether a car that touches a wall starts again and goes on.
    """

    def __init__(self, engine: Engine, *, names: Sequence[str]) -> None:
        self.contacts: list[Contact] = []
        self.overtakes: list[Overtake] = []
        self.warnings: list[Warned] = []
        self.restarts: list[Restart] = []
        self.wall_contacts = [0] * len(names)
        self._engine, self._names = engine, tuple(names)

    @property
    def puts_back_at_walls(self) -> bool:
        """Whether a car that touches a wall starts again, and goes on."""
        return False

    def after_tick(self) -> None:
        """Look at the tick that was driven and judged."""

    def finish(self) -> None:
        """Close what is still open, at the end of the race."""

    def order(self) -> list[int]:
        """Return the cars in the order of the result."""
        return [0]

    @property
    def winner(self) -> str | None:
        """Name of the car that finished first; None: none has."""
        return self._names[0] if END_REASONS[self._engine.monitor.reasons[0]] == "finished" else None


def race_control(engine: Engine, *, names: Sequence[str], rules: str, world: int = 0) -> RaceRecord:
    """Return what watches the cars of a world of an engine; arguments are those of RaceControl, rules by name."""
    if len(names) == 1 and rules == "none":
        return RaceRecord(engine, names=names)
    return from_addons.RaceControl(engine, names=names, rules=find_rules(rules), world=world)


def find_rules(name: str) -> Rules:
    """Return the rules of a name.

    Raises:
      SettingsError: there are none.
    """
    if not isinstance(name, str) or name not in RULES:
        raise SettingsError(f"rules is {shown(name)}; {accepted_names(name, RULES)}")
    return RULES[name]
