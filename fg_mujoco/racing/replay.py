"""The proof that a run can be driven again, bit for bit.

report = replay("runs/oval")
assert report.identical
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..display import brief
from .resimulation import load_world, resimulate
from .result import trajectory_sha256
from .run_folder import SUMMARY, read_run


@dataclass(frozen=True, kw_only=True, repr=False)
class ReplayReport:
    """How a replay compares with what was recorded; its text is one line."""

    identical: bool  # every bit of every state, and the summary's trajectory_sha256
    ticks: int
    trajectory_sha256: str  # of what was replayed
    first_difference: int | None = None  # tick, from 1, that first ends in another state; None: none does
    time: float | None = None  # [s] at its end
    greatest_difference: float | None = None  # there, of any component of the state

    def __repr__(self) -> str:
        return brief(self, str(self))

    def __str__(self) -> str:
        if self.identical:
            return f"bit-identical: {self.ticks} ticks, trajectory_sha256 {self.trajectory_sha256}"
        if self.first_difference is None:
            return f"not identical: the states are, but {SUMMARY} has not their hash, {self.trajectory_sha256}"
        return (
            f"not identical: differs from tick {self.first_difference} of {self.ticks} on, at t = {self.time:.3f} s by "
            f"up to {self.greatest_difference:.3g} in a component of the state"
        )


def replay(folder: str | Path) -> ReplayReport:
    """Simulate a run again from its first state and recorded controls, and compare every state bit for bit.

    Raises:
      RunFolderError: the folder is not a run folder, or is damaged.
    """
    run = read_run(folder)
    ticks = resimulate(run, load_world(run), sense=False, follow=False)
    states = np.array([run.states[0], *(tick.state for tick in ticks)])
    sha256 = trajectory_sha256(states, run.ctrl)
    differs = (states.view(np.uint64) != run.states.view(np.uint64)).any(axis=1)  # as bits: NaN is NaN, -0 is not 0
    if not differs.any():
        same_hash = sha256 == run.summary.get("trajectory_sha256")
        return ReplayReport(identical=same_hash, ticks=len(run.ctrl), trajectory_sha256=sha256)
    first = int(differs.argmax())
    return ReplayReport(
        identical=False,
        ticks=len(run.ctrl),
        trajectory_sha256=sha256,
        first_difference=first,
        time=float(run.time[first]),
        greatest_difference=float(np.abs(states[first] - run.states[first]).max()),
    )
