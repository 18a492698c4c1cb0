"""A law of a user's own, as the native core knows it: its force, sampled.

A set that names a class in a file (docs/howto/own_tire_law.md) gets a table of its force, which moves a car: the native
core, worker processes and replays run no code of the file. Between two nodes the force is a cubic of the slip's root,
monotone where the nodes are, so it passes none of their peaks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from ...errors import SettingsError
from ...messages import FloatArray
from ...native import core
from .law import GREATEST_SLIP, Law

CELLS = 96
"""Between the nodes, which are even over the slip's root, and so closer together where it is less. MuJoCo reads at most
500 numbers of an axle, with both of its curves."""

_REACH, _PEAK, _PEAK_SLIP, _NODES = range(4)
_SIZE = _NODES + 2 * (CELLS + 1)
_MOST = 3.0  # [-] peak, which no such tire reaches
_NEAR = 0.01  # of the peak, or of the slope: how far what a law says of itself, or its table, may be off
_SMALL = 1e-7  # [-] slip at which the slope at none is measured
_STEP = 1e-4  # of a cell, for the rise at a node


@dataclass(frozen=True, kw_only=True)
class Sampled(Law):
    """A law by a table of its force; SettingsError: a table that is none."""

    model: ClassVar[str] = "sampled"

    table: tuple[float, ...]  # reach [-], peak [-], slip of the peak or 0; then force and rise over a cell of each node

    def __post_init__(self) -> None:
        object.__setattr__(self, "table", tuple(self.table))
        if len(self.table) != _SIZE or not all(math.isfinite(value) for value in self.table) or self.table[0] <= 0.0:
            raise SettingsError(f"{type(self).__name__}.table is none; accepted: what a set of a law of one's own says")

    def force(self, slip: float) -> float:
        """Return the force over the load [-] at a slip [rad or -], which has its sign."""
        return math.copysign(core.sampled_force(np.array(self.table), abs(slip)), slip)

    @property
    def slope(self) -> float:
        """Force over the load for each rad of slip, at none [1/rad]."""
        return (3.0 * self.table[_NODES + 2] - self.table[_NODES + 3]) * CELLS**2 / self.table[_REACH]

    @property
    def peak_slip(self) -> float:
        """Slip of the peak [rad or -]; infinite where there is none."""
        return self.table[_PEAK_SLIP] or math.inf

    @property
    def peak(self) -> float:
        """Greatest force over the load [-]; where there is none, the friction that its planner assumes."""
        return self.table[_PEAK]

    @property
    def numbers(self) -> tuple[float, ...]:
        """The table."""
        return self.table

    @classmethod
    def unpacked(cls, row: Sequence[float]) -> Law:
        """Return the law of the values of `packed`."""
        return cls(table=tuple(row))

    def scaled(self, by: float) -> Any:
        """Return it with all forces times a factor."""
        own = self.table
        return replace(self, table=(own[_REACH], by * own[_PEAK], own[_PEAK_SLIP], *(by * v for v in own[_NODES:])))


@dataclass(frozen=True, kw_only=True)
class SampledBristles(Sampled):
    """A law of bristles by a table of its force, up to the slip of its peak."""

    model: ClassVar[str] = "sampled_bristles"
    holds: ClassVar[bool] = True


def sampled(law: Law, where: str) -> Sampled:
    """Return a law of a user's own as the native core knows it; SettingsError: it is not so."""
    slope, peak, peak_slip = (_told(law, name, where) for name in ("slope", "peak", "peak_slip"))
    has_peak = law.slides and math.isfinite(peak_slip)
    reach = peak_slip if law.holds and has_peak else GREATEST_SLIP
    forces = _forces(law, np.linspace(0.0, 1.0, 8 * CELLS + 1) ** 2 * reach, where)
    nodes, rises = forces[::8], np.zeros(CELLS + 1)
    for node in range(1, CELLS + 1):
        ends = reach * ((node + np.array((-_STEP, _STEP if node < CELLS else 0.0))) / CELLS) ** 2
        before, after = _forces(law, ends, where)
        rises[node] = (after - before) / (_STEP * (2.0 if node < CELLS else 1.0))
        steps = np.diff(nodes)[node - 1 : node + 1]
        limit = 3.0 * np.abs(steps).min() if (steps > 0.0).all() or (steps < 0.0).all() else 0.0
        rises[node] = np.clip(rises[node], -limit, limit)
    _check(law, forces, reach, (slope, peak, peak_slip if has_peak else math.inf), where)
    kind = SampledBristles if law.holds else Sampled
    found = kind(table=(reach, peak, peak_slip if has_peak else 0.0, *np.column_stack((nodes, rises)).ravel().tolist()))
    slips = np.linspace(0.0, 1.0, 8 * CELLS + 1) ** 2 * reach
    off = np.abs([found.force(slip) for slip in slips.tolist()] - forces)
    if off.max() > _NEAR * np.abs(forces).max():
        at = slips[off.argmax()]
        raise SettingsError(f"{where}: the force jumps at a slip of {at:.3g}; accepted: one that changes steadily")
    return found


def _told(law: Law, name: str, where: str) -> float:
    try:
        value = float(getattr(law, name))
    except (Exception, SystemExit) as error:
        said = " ".join(f"{type(error).__name__}: {error}".split())
        raise SettingsError(f"{where}: {name} fails: {said}; accepted: a number") from error
    if not value > 0.0 or (math.isinf(value) and name != "peak_slip"):
        raise SettingsError(f"{where}: {name} is {value:g}; accepted: a number above 0")
    return value


def _forces(law: Law, slips: FloatArray, where: str) -> FloatArray:
    """Return the forces at slips, of a law that answers with finite numbers and has no side."""
    found = np.empty(len(slips))
    for k, slip in enumerate(slips.tolist()):
        try:
            found[k], other = float(law.force(slip)), float(law.force(-slip))
        except (Exception, SystemExit) as error:
            said = f"{where}: force({slip:g}) fails: {' '.join(f'{type(error).__name__}: {error}'.split())}"
            raise SettingsError(f"{said}; accepted: force(self, slip) -> float") from error
        if not math.isfinite(found[k]) or not abs(found[k] + other) <= 1e-9 * max(abs(other), 1.0):
            said = f"{where}: force({slip:g}) is {found[k]:g} and force({-slip:g}) is {other:g}"
            raise SettingsError(f"{said}; accepted: finite numbers, the second with the other sign")
    return found


def _check(law: Law, forces: FloatArray, reach: float, told: tuple[float, float, float], where: str) -> None:
    """Refuse a law whose force is not that of the slope, the peak and its slip that it tells."""
    (slope, peak, peak_slip), top = told, int(forces.argmax())
    found = float(_forces(law, np.array((_SMALL,)), where)[0]) / _SMALL
    if not abs(found - slope) <= _NEAR * slope:
        raise SettingsError(f"{where}: slope is {slope:g}, but the force has {found:.4g} per rad; accepted: that")
    greatest, at = float(forces[top]), reach * (top / (len(forces) - 1)) ** 2
    if math.isinf(peak_slip) or peak > _MOST:
        if peak > min((1.0 + _NEAR) * greatest, _MOST):
            most = f"up to {min(greatest, _MOST):.4g}, the greatest force, or 3, which no such tire reaches"
            raise SettingsError(f"{where}: peak, the friction that planners assume, is {peak:g}; accepted: {most}")
        if forces[-1] < (1.0 - _NEAR) * greatest:
            raise SettingsError(f"{where}: it has no peak, but its force falls past a slip of {at:.3g}; accepted: one")
        return
    own = float(_forces(law, np.array((peak_slip,)), where)[0])
    if not abs(greatest - peak) <= _NEAR * peak or own < (1.0 - 2.0 * _NEAR) * greatest or peak_slip > GREATEST_SLIP:
        said = f"the peak is {peak:g} at a slip of {peak_slip:g}, but the force is {own:.4g} there and greatest, "
        raise SettingsError(
            f"{where}: {said}{greatest:.4g}, at {at:.3g}; accepted: the greatest up to a slip of {GREATEST_SLIP:g}"
        )
