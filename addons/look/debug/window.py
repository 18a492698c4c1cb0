"""A window of a run's decisions, as the page takes it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from fg_mujoco.display import brief, quoted
from fg_mujoco.messages import FloatArray
from fg_mujoco.vehicle.car import WHEELS

from ..report.recorded import RecordedRun
from .decisions import Decision

AHEAD = 0.5  # [s] of a command that are shown, and of the way that was driven before and after it


@dataclass(frozen=True, kw_only=True)
class Moving:
    """How the car moves at a decision, of the telemetry of its tick. NaN where a run does not have it."""

    ground_speed: float  # [m/s] of the rear axle over the ground; the odometry has that of the wheels
    sideslip: float  # [rad] at the centre of gravity, left positive; NaN below 0.1 m/s
    slides: tuple[float, ...]  # (4,) [m/s] greatest sliding speed of each tire while the command is held
    friction_utilisation: tuple[float, ...]  # (4,) greatest friction utilisation; NaN: off the ground


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Window:
    """Some decisions in a row, and what they are shown with."""

    run: RecordedRun = field(repr=False)
    decisions: tuple[Decision, ...] = field(repr=False)  # in order
    at: int  # place among them of the one that was asked for
    notes: tuple[str, ...]  # what is missing or differs, a sentence each
    walls: list[FloatArray] = field(repr=False)  # outlines near the window, each (k, 2) [m], world frame
    moving: list[list[FloatArray]] = field(repr=False)  # outlines of what moves, in each decision

    def __repr__(self) -> str:
        first, last = self.decisions[0].time, self.decisions[-1].time
        span = f"{len(self.decisions)} decisions, {first:.3f} to {last:.3f} s"
        return brief(self, quoted(self.run.source), span, f"at {self.chosen.time:.3f} s")

    @property
    def chosen(self) -> Decision:
        """The decision that was asked for."""
        return self.decisions[self.at]

    def moving_at(self, decision: Decision) -> Moving | None:
        """Return how the car moves at a decision; None for one that failed: the race was over."""
        run, tick = self.run, decision.tick
        if tick >= len(run.telemetry):
            return None
        slides, use = (
            tuple(float(run.column(name.format(wheel))[tick]) for wheel in WHEELS)
            for name in ("slide_{}_m_s", "friction_utilisation_{}")
        )
        ahead, left = (float(run.column(name)[tick]) for name in ("vx_m_s", "vy_m_s"))
        return Moving(
            ground_speed=math.hypot(ahead, left), sideslip=float(run.column("sideslip_rad")[tick]), slides=slides,
            friction_utilisation=use,
        )  # fmt: skip

    @property
    def ticks_ahead(self) -> int:
        """Number of ticks in AHEAD."""
        return round(AHEAD / self.chosen.scan.scan_time)

    def driven(self, first: Decision, last: Decision) -> FloatArray:
        """Return where the rear axle was from AHEAD before one decision to AHEAD after another (k, 2) [m]."""
        begin, end = max(first.tick - self.ticks_ahead, 0), last.tick + self.ticks_ahead + 1
        return np.column_stack([self.run.column(name)[begin:end] for name in ("x_m", "y_m")])

    @property
    def laws(self) -> list[str]:
        """Name of the step that chose the speed, in each decision."""
        return [_law(decision) for decision in self.decisions]

    @property
    def stretches(self) -> list[tuple[int, int, str]]:
        """Runs of decisions in which one step chose the speed: first, last + 1, and the step's name."""
        laws = self.laws
        changes = [0, *(i for i in range(1, len(laws)) if laws[i] != laws[i - 1]), len(laws)]
        return [(first, end, laws[first]) for first, end in pairwise(changes)]


def _law(decision: Decision) -> str:
    step = decision.speed_step
    return "the planner failed" if decision.failure else "not known" if step is None else step.name
