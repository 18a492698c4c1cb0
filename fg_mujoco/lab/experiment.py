"""An experiment of the friction lab: cells of work of some seconds, which any process can measure, and their rows."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np

from ..course.formats import load_course
from ..errors import SettingsError
from ..messages import Odometry, require_whole, shown
from ..racing.entries import Entry
from ..vehicle.changes import ACCEPTED_MU, GREATEST_MU
from ..vehicle.tires import Tires
from .lab_ground import LabGround
from .speed_laws import DEFAULT_LAW, SpeedLaw, law_sha256, load_law
from .steady_circle import SteadyCircle

if TYPE_CHECKING:
    import matplotlib.figure

STEERINGS = (0.05, 0.1, 0.2, 0.3, 0.4)
"""[rad] Steering angles of circles, up to the car's lock, unless a setting names others."""

ONE_SET = ("mu", "tires", "floor")
"""Settings of an experiment that drives on one set of tires."""

TOLD = "Told is the friction that the law gets: the least peak of the tires."

_ROLLS = Odometry(
    stamp=0.0, speed=1.0, steering_angle=0.0, angular_velocity=np.zeros(3), linear_acceleration=np.zeros(3),
    wheel_speeds=np.ones(4),
)  # fmt: skip

Cell: TypeAlias = dict[str, Any]
"""One unit of work: names to JSON values."""

Row: TypeAlias = dict[str, "float | int | str | bool | None"]
"""One line of a CSV: names, with their units, to values. NaN where there is no number, and then `reason` says why."""


@dataclass(frozen=True, kw_only=True)
class LabSettings:
    """Settings that all experiments share; SettingsError, TrackError: one that no cell can be measured with."""

    entry: Entry = field(default_factory=Entry)  # the car, its tires and floor; its planner in laps and mismatch
    law: str = DEFAULT_LAW  # a name, or FILE.py:NAME, see `load_law`
    mus: tuple[float, ...] | None = None  # [-] of the tires, or their greatest peaks; None: as the entry has it
    planner_mus: tuple[float, ...] | None = None  # [-] that a planner is told in mismatch; None: shares of `mus`
    steerings: tuple[float, ...] | None = None  # [rad]; None: those of STEERINGS up to the lock
    tracks: tuple[str, ...] | None = None  # of laps and mismatch; None: the experiment's own
    laps: int | None = None  # likewise

    def __post_init__(self) -> None:
        if not isinstance(self.entry, Entry):
            raise SettingsError(f"LabSettings.entry is {shown(self.entry)}; accepted: an Entry")
        if not isinstance(self.law, str):
            raise SettingsError(f"LabSettings.law is {shown(self.law)}; accepted: a name, or FILE.py:NAME")
        require_whole("laps", self.laps, 2, optional=True)
        lock = self.entry.car.parameters.max_steering_angle
        _require("mu", self.mus, GREATEST_MU, f"friction coefficients {ACCEPTED_MU}")
        _require("planner_mu", self.planner_mus, GREATEST_MU, f"friction coefficients {ACCEPTED_MU}")
        _require("steering", self.steerings, lock, f"angles above 0, up to the car's lock of {lock:g} rad")
        if self.mus is not None and self.entry.set_mu is not None:
            where = "the floor" if self.entry.floor is not None else "mu of the car"
            raise SettingsError(f"mu is {shown(self.mus)}, and {where} sets one, too; accepted: one of them")
        if not (self.tracks is None or isinstance(self.tracks, (tuple, list))):
            raise SettingsError(f"LabSettings.tracks is {shown(self.tracks)}; accepted: one course or more")
        for track in self.tracks or ():
            load_course(track, self.entry.car.parameters)
        self.try_law(*self.angles)

    def try_law(self, *angles: float) -> None:
        """Make sure that the law answers at some steering angles [rad], at 1 m/s; SettingsError: it does not."""
        for mu in self.frictions:
            for angle in angles:
                self.speed_law(angle, _ROLLS, self.entry.car.parameters, self.told(mu))

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "speed_law"}  # its module may be a file

    @cached_property
    def speed_law(self) -> SpeedLaw:
        """The law, loaded."""
        return load_law(self.law)

    @property
    def tires(self) -> Tires:
        """The tires of the car."""
        return self.entry.tire_set

    @property
    def frictions(self) -> tuple[float, ...]:
        """Friction coefficients of the tires, or their greatest peaks [-]."""
        return self.mus or (self.entry.tires_mu,)

    @property
    def angles(self) -> tuple[float, ...]:
        """Steering angles of circles [rad]."""
        lock = self.entry.car.parameters.max_steering_angle
        return self.steerings or tuple(angle for angle in STEERINGS if angle <= lock)

    def told(self, mu: float) -> float:
        """Return the friction that a law is told on tires of `mu`: the least peak of the set [-]."""
        return self.entry.car.reliable_mu(self.tires, mu)

    def ground(self, mu: float) -> LabGround:
        """Return the car on open ground; `mu` is one of `frictions`."""
        return LabGround(mu, None, self.tires, self.entry.car, self.entry.changes)

    def circle(self, mu: float, steering: float) -> SteadyCircle:
        """Return the car on a circle; `mu` is one of `frictions`."""
        return SteadyCircle(self.told(mu), steering, None, self.tires, self.entry.car, self.entry.changes)

    def described(self) -> dict[str, Any]:
        """Return the settings as JSON has them."""
        numbers = {name: getattr(self, name) for name in ("mus", "planner_mus", "steerings", "tracks", "laps")}
        car = self.entry.described() | {"controller": str(self.entry.controller)}
        return {"car": car, "law": self.law, "law_file_sha256": law_sha256(self.law), **numbers}


def _require(name: str, values: Any, greatest: float, accepted: str) -> None:
    if values is None:
        return
    numbers = isinstance(values, (tuple, list)) and all(isinstance(each, (int, float)) for each in values)
    if not numbers or not values or len(set(values)) < len(values):
        raise SettingsError(f"{name} is {shown(values)}; accepted: one number or more, each once")
    for value in values:
        if not 0.0 < value <= greatest:
            raise SettingsError(f"{name} is {value!r}; accepted: {accepted}")


@dataclass(frozen=True, kw_only=True)
class Section:
    """What an experiment found, the result first."""

    sentences: tuple[str, ...]  # with the measured numbers
    columns: dict[str, str] = field(default_factory=dict)  # of the table that is printed: heading -> name in the rows
    printed: tuple[Row, ...] | None = None  # rows of that table; None: all
    draw: Callable[[matplotlib.figure.Figure], None] | None = None  # its figure, as wide as two columns of a paper
    height: float = 3.2  # [in] of the figure


class Experiment(Protocol):
    """An experiment of the lab."""

    name: str  # on the command line, and of its files
    title: str  # of what is printed

    @property
    def uses(self) -> tuple[str, ...]:
        """Settings that it uses besides the car, as options of the command line are called."""

    def cells(self, settings: LabSettings) -> list[Cell]:
        """Return the whole work, in order; the same for the same settings."""

    def measure(self, cell: Cell, settings: LabSettings) -> list[Row]:
        """Measure one cell, in any process: the same cell, the same rows."""

    def section(self, rows: list[Row], settings: LabSettings) -> Section:
        """Return what is said of the rows of all cells, in the order of the cells."""


def number(row: Row, name: str) -> float:
    """Return a value of a row as a number; NaN where there is none."""
    value = row.get(name)
    return float(value) if isinstance(value, (int, float)) else math.nan


def share_of(rows: Iterable[Row], name: str) -> str:
    """Return in how many of some rows a value is true, as "3 of 20"."""
    values = [bool(row[name]) for row in rows]
    return f"{sum(values)} of {len(values)}"
