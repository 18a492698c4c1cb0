"""A drive of a planner through checks that give points. Students' code has no say in them.

A student's file is read by `recorded_commands` in a new process for each drive, which it may end. What comes back are
the commands of each tick. The drive is driven again by them here, and judged. A planner that cannot be loaded, that
raises, that takes too long for a decision, or that ends its process has no points for the checks of that drive, with
the reason. The points of its other drives stay, and the other planners go on.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from fg_mujoco.racing.race import race_setup
from fg_mujoco.racing.resolved import ground_of
from fg_mujoco.racing.result import RaceResult
from fg_mujoco.rollouts.store import digest

from .checks import Drive, SuiteCheck
from .recorded_commands import FAILED, RecordedCommands, record
from .run import Checked, Run, RunRow, why_failed


@dataclass(frozen=True, kw_only=True, eq=False)
class GradedDrive(Run):
    """A drive to be graded; the planner of its `setup` is not yet in it."""

    checks: tuple[SuiteCheck, ...]

    @property
    def key(self) -> str:
        """See Run; and of its checks."""
        return digest(super().key, [(each.number, each.name, each.points, repr(each.check)) for each in self.checks])

    def drive(self) -> RunRow:
        """See Run."""
        try:
            recorded = record(str(self.place["planner"]), self.setup)
            if recorded.failed is not None and not len(recorded.commands):
                return self._without_points(recorded.failed, recorded.message)
            first = replace(self.setup.first, controller=RecordedCommands(recorded.commands), planner_settings={})
            result = race_setup(replace(self.setup, entries=(first, *self.setup.entries[1:])))
            if result.car.end_reason == "interrupted":
                raise KeyboardInterrupt
            if recorded.failed is not None:
                return self._without_points(recorded.failed, recorded.message, result)
            if result.car.end_reason in FAILED:
                return self._without_points("worker_died", str(result.car.planner_failure), result)
            drive = Drive(result=result, ground=ground_of(self.setup))
            verdicts = [(each, each.check.judge(drive)) for each in self.checks]
            checks = [self._checked(each, verdict.measured, bool(verdict.passed)) for each, verdict in verdicts]
            return self.row(result, checks=tuple(checks))
        except Exception as error:
            return self._without_points("not_judged", f"the drive cannot be judged: {why_failed(error)}")

    def died(self, how: str) -> RunRow:
        """See Run."""
        return self._without_points("worker_died", how)

    def _checked(self, each: SuiteCheck, measured: str, passed: bool) -> Checked:
        return Checked(
            number=each.number, name=each.name, asked=each.check.asked, measured=measured, passed=passed, of=each.points
        )

    def _without_points(self, reason: str, message: str, result: RaceResult | None = None) -> RunRow:
        said = " ".join(message.split())
        checks = tuple(self._checked(each, said, passed=False) for each in self.checks)
        row = self.failed(reason, said, checks=checks)
        if result is None:
            return row
        driven = self.row(result, checks=checks)
        return replace(driven, car=replace(driven.car, end_reason=reason, message=said, success=False))
