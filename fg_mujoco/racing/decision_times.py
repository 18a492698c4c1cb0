"""The times of a planner's decisions, and the limit at which a race ends.

    clock = DecisionClock(limit=1.0)
    with clock:
        clock.time(engine.decide)
    DecisionTimes.of(clock.seconds, period=0.025)

A decision is all that is between a scan and its command: the planner, and the messages to and from it.

In the main thread a timer of the system (SIGALRM) interrupts a planner that takes longer than the limit. It ends loops
in Python, and waiting: `time.sleep`, locks, sockets. It cannot interrupt compiled code that does not come back to
Python, as an endless loop in C, nor a planner that catches BaseException and goes on. In other
threads, and on systems without this timer, the limit is checked when the planner has answered.
"""

from __future__ import annotations

import math
import signal
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from ..errors import DecisionLimitReached

_Answer = TypeVar("_Answer")

MOST, FEWEST = 0.5, 20
"""Hints are of more than this share of the decisions, and of so many decisions at least."""

_AGAIN = 0.05  # [s] after which a planner that went on all the same is interrupted once more


@dataclass(frozen=True, kw_only=True)
class DecisionTimes:
    """The times of a planner's decisions in a race. Wall times: they differ from run to run.

    Fields are as in the JSON. Times are None where there was no decision.
    """

    decisions: int
    median_s: float | None
    percentile_99_s: float | None  # 99 % of the decisions took no longer
    worst_s: float | None
    over_period: int  # how many took longer than `period_s`, so that a real car would have missed a scan
    period_s: float  # of the LiDAR

    @classmethod
    def of(cls, seconds: Sequence[float], period: float) -> DecisionTimes:
        """Return the figures of decisions that took so many seconds; `period` is the LiDAR's [s]."""
        times = np.array(seconds, dtype=np.float64)
        shares = (0.5, 0.99, 1.0)  # each is one of the times
        figures = np.quantile(times, shares, method="inverted_cdf").tolist() if len(times) else (None, None, None)
        median, most, worst = figures
        return cls(
            decisions=len(times), median_s=median, percentile_99_s=most, worst_s=worst,
            over_period=int((times > period).sum()), period_s=float(period),
        )  # fmt: skip

    def __str__(self) -> str:
        if self.median_s is None or self.percentile_99_s is None or self.worst_s is None:
            return "none"
        of = ", ".join(
            f"{name} {1e3 * value:.2f} ms"
            for name, value in (("median", self.median_s), ("99 %", self.percentile_99_s), ("worst", self.worst_s))
        )
        return f"{of}; {self.over_period} of {self.decisions} over {1e3 * self.period_s:g} ms"


def late_hint(times: Mapping[str, Any]) -> str:
    """Return what is said of a race most of whose decisions were late; `times` are as DecisionTimes has them."""
    late, count, median = times["over_period"], times["decisions"], times["median_s"]
    if count < FEWEST or late <= MOST * count:
        return ""
    period, half = 1e3 * times["period_s"], 1e3 * median
    return (
        f"{late} of {count} decisions took longer than {period:g} ms, half of them {half:.3g} ms or more. The "
        "simulation waits for a planner, and a car does not: it would drive on with the command before. Try "
        f"--lidar-latency {median:.2g}, which shows what such a delay does, or a planner that is faster"
    )


def decision_limit_text(limit: float | None, time: float) -> str:
    """Return the message for a race that ended by its limit of a decision [s], at a simulated time [s]."""
    return f"no command within {limit:g} s at t = {time:.3f} s"


class DecisionClock:
    """Times decisions, and interrupts one that takes longer than a limit.

    Args:
      limit: [s]; None: there is none.

    Attributes:
      seconds: that each decision took, in their order; one that was interrupted is the last.
      limit: [s]; inf: there is none.
    """

    def __init__(self, limit: float | None = None) -> None:
        self.seconds: list[float] = []
        self.limit = math.inf if limit is None else limit
        self._deciding = False
        self._began = 0.0
        in_main = threading.current_thread() is threading.main_thread()
        self._interrupts = limit is not None and in_main and hasattr(signal, "setitimer")

    def __enter__(self) -> DecisionClock:
        if self._interrupts:
            self._handler_before = signal.signal(signal.SIGALRM, self._interrupt)
        return self

    def __exit__(self, *exception: object) -> None:
        if self._interrupts:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, self._handler_before or signal.SIG_DFL)

    def time(self, decide: Callable[[], _Answer]) -> _Answer:
        """Call what decides, keep how long it took, and return its answer.

        Raises:
          DecisionLimitReached: it took longer than the limit.
        """
        self._began = time.perf_counter()
        self._deciding = True
        if self._interrupts:
            signal.setitimer(signal.ITIMER_REAL, self.limit, _AGAIN)
        try:
            try:
                answer = decide()
            finally:  # the signal may still come in here, before the assignment
                self._deciding = False
        finally:
            self._deciding = False
            if self._interrupts:
                signal.setitimer(signal.ITIMER_REAL, 0.0)
            self.seconds.append(self._elapsed)
        if self.seconds[-1] > self.limit:  # nothing could interrupt it
            raise DecisionLimitReached
        return answer

    def note(self, seconds: float) -> None:
        """Keep how long a decision took that was timed otherwise, in the native core.

        Raises:
          DecisionLimitReached: it took longer than the limit.
        """
        self.seconds.append(seconds)
        if seconds > self.limit:
            raise DecisionLimitReached

    @property
    def _elapsed(self) -> float:
        """Time since the decision began [s]."""
        return time.perf_counter() - self._began

    def _interrupt(self, *signal_and_frame: object) -> None:
        """Handle the timer's signal."""
        if self._deciding and self._elapsed >= self.limit:
            raise DecisionLimitReached
