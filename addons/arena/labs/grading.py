"""Grades planners by a lab: drives each through the drives of its checks, and adds up the points.

    grades = grade("lab3.toml", ["alice.py", "bob.py:Planner"], out="grades")
    print(grades.markdown())

Students' files are read by `recorded_commands` in a new process for each drive, which they may end. What comes back are
the commands of each tick. The drive is driven again by them here, and judged, so that a student's code has no say in
the checks. A planner that cannot be loaded, that raises, that takes too long for a decision, or that ends its process
has no points for the checks of that drive, with the reason. The points of its other drives stay, and the other planners
go on.

The folder has, besides what `store` says of it:

    table.md, table.csv    a row for each planner
    grades.json            the points of each planner, and each check with what was measured
    NAME.html              the page of a planner
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fg_mujoco.arguments import explain_class
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import require_whole
from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.racing.planners import ControllerChoice
from fg_mujoco.racing.race import race_setup
from fg_mujoco.racing.resolved import ground_of
from fg_mujoco.racing.result import RaceResult
from fg_mujoco.racing.setup import Setup
from fg_mujoco.registry import PARTS
from fg_mujoco.rollouts.store import as_json, digest, of_kind

from ..grid_study import (
    GridFolder,
    GridKey,
    GridRow,
    Study,
    StudyProgress,
    as_axis,
    drive_grid,
    require_axes,
    why_failed,
)
from .checks import Drive
from .grade_page import page_names, write_grade_page
from .grades import Checked, Grade, checks_table, grades_table
from .lab_file import Lab, LabCheck, read_lab
from .recorded_commands import FAILED, RecordedCommands, record


@dataclass(frozen=True)
class DriveKey(GridKey):
    """What a drive depends on, but for the versions."""

    planner: str  # as it was given
    planner_sha256: str | None  # of its file; None: it is bundled, or cannot be read
    drive: int  # of the lab, from 0
    drive_sha256: str  # of its setup and its checks
    planner_files_sha256: str | None = None  # not known: no student's code is run to ask it


@dataclass(frozen=True, kw_only=True)
class DriveFigures:
    """How a drive went. None: there is no such figure, as of a planner that could not be loaded."""

    end_reason: str
    message: str | None  # why the planner failed
    sim_time_s: float | None
    trajectory_sha256: str | None


@dataclass(frozen=True)
class DriveRow(GridRow):
    """A drive of a planner, with its checks and a picture."""

    key: DriveKey
    figures: DriveFigures
    checks: tuple[Checked, ...] = ()
    picture: str = ""  # SVG; empty: there is none

    def line(self) -> dict[str, Any]:
        """Return all of it, as JSON has it."""
        return self.as_dict() | {"checks": [vars(each) for each in self.checks], "picture": self.picture}

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> DriveRow:
        """Return the row that `line` made the values of; errors as `of_kind`."""
        checks = tuple(of_kind(Checked, each) for each in values["checks"])
        return replace(super().of(values), checks=checks, picture=str(values["picture"]))


@dataclass(frozen=True)
class GradedDrive:
    """A drive to be graded. It travels to a worker process."""

    key: DriveKey
    planner: str
    setup: Setup
    checks: tuple[tuple[int, LabCheck], ...]

    def __str__(self) -> str:
        return f"{self.planner}, drive {self.key.drive}"

    def drive(self) -> DriveRow:
        """Drive it, and return its row.

        Raises:
          KeyboardInterrupt: Ctrl-C.
        """
        try:
            recorded = record(self.planner, self.setup)
            if recorded.failed is not None and not len(recorded.commands):
                return self._failed(recorded.message, recorded.failed)
            first = replace(self.setup.first, controller=RecordedCommands(recorded.commands), planner_settings={})
            result = race_setup(replace(self.setup, entries=(first, *self.setup.entries[1:])))
            if result.car.end_reason == "interrupted":
                raise KeyboardInterrupt
            if recorded.failed is not None:
                return self._failed(recorded.message, recorded.failed, result)
            if result.car.end_reason in FAILED:
                return self._failed(str(result.car.planner_failure), "worker_died", result)
            drive = Drive(result=result, ground=ground_of(self.setup))
            found = [(number, each, each.check.judge(drive)) for number, each in self.checks]
            checks = tuple(
                Checked(
                    number=number, name=each.name, asked=each.check.asked, measured=verdict.measured,
                    passed=bool(verdict.passed), of=each.points,
                )
                for number, each, verdict in found
            )  # fmt: skip
            return DriveRow(self.key, _figures(result, result.car.end_reason, None), checks, self._picture(result))
        except Exception as error:
            return self._failed(f"the drive cannot be judged: {why_failed(error)}", "not_judged")

    def died(self, how: str) -> DriveRow:
        """Return the row of a drive whose worker process ended, with its end in words."""
        return self._failed(how, "worker_died")

    def _failed(self, message: str, reason: str, result: RaceResult | None = None) -> DriveRow:
        said = " ".join(message.split())
        checks = tuple(
            Checked(number=number, name=each.name, asked=each.check.asked, measured=said, passed=False, of=each.points)
            for number, each in self.checks
        )
        picture = "" if result is None else self._picture(result)
        return DriveRow(self.key, _figures(result, reason, said), checks, picture)

    def _picture(self, result: RaceResult) -> str:
        car = result.car
        ends = (("crash", car.crash), ("turned", car.wrong_way), ("rolled over", car.rollover))
        line, speed = (
            values[car.column("time_s") < car.end_time_s - 1e-9]
            for values in (car.telemetry[:, [4, 5]], car.column("speed_m_s"))
        )
        marks = [(text, (place.x_m, place.y_m)) for text, place in ends if place is not None]
        picture: str = PARTS.find("driven line")(
            result.world, line, speed, time=result.sim_time_s, marks=marks, title=str(self)
        )
        return picture


def _figures(result: RaceResult | None, reason: str, message: str | None) -> DriveFigures:
    return DriveFigures(
        end_reason=reason, message=message, sim_time_s=None if result is None else result.sim_time_s,
        trajectory_sha256=None if result is None else result.trajectory_sha256,
    )  # fmt: skip


class GradesFolder(GridFolder):
    """Keeps the finished drives of a lab, with their checks and pictures."""

    def __init__(self, folder: str | Path) -> None:
        super().__init__(folder, DriveRow.of, title="grading", command="grade", file="drives.jsonl")

    def keep(self, run: Any, answer: DriveRow) -> None:
        """Keep the row of a drive.

        Raises:
          RunFolderError: it cannot be written.
        """
        self.runs.add(run.key, answer, answer.line())


def make_grades(rows: Sequence[DriveRow]) -> tuple[Grade, ...]:
    """Return the grades of some drives, in the order in which the planners appear."""
    grades = []
    for planner in dict.fromkeys(row.key.planner for row in rows):
        own = [row for row in rows if row.key.planner == planner]
        checks = tuple(sorted((each for row in own for each in row.checks), key=lambda each: each.number))
        reasons = dict.fromkeys(row.figures.message for row in own if row.figures.message is not None)
        grades.append(
            Grade(
                planner=planner, points=sum(each.points for each in checks), of=sum(each.of for each in checks),
                passed=sum(each.passed for each in checks), reason="; ".join(reasons) or None, checks=checks,
            )
        )  # fmt: skip
    return tuple(grades)


@explain_class
class Grades(Study[DriveRow, Grade]):
    """The grades of some planners."""

    noun = "drives"
    make_cells = staticmethod(make_grades)

    def _summed_up(self) -> str:
        return f"{len(self.cells)} planners"

    def _table(self, *, chosen: bool) -> Table:
        return checks_table(self.cells[0]) if len(self.cells) == 1 else grades_table(self.cells)

    def texts(self) -> dict[str, str]:
        """Return the tables as they are in the folder, by the names of their files."""
        found = [each.as_dict() | {"checks": [vars(check) for check in each.checks]} for each in self.cells]
        return super().texts() | {"grades.json": as_json({"grades": found}) + "\n"}


def grade(
    lab: Lab | str | Path,
    planners: str | Sequence[str],
    *,
    out: str | Path,
    workers: int | None = None,
    watch: Callable[[StudyProgress], None] | None = None,
) -> Grades:
    """Grade planners by a lab, and write tables and pages to a folder.

    A planner whose code was graded already is not driven again.

    Args:
      lab: or the path of its file.
      planners: one or more: path/to/file.py, or file.py:NAME where it has several planners, or as `race` takes them.
      out: a new or empty folder, or one of a grading.
      workers: drives at once; None: as many as there are cores.
      watch: called several times a second.

    Raises:
      SettingsError, TrackError: a lab that cannot be used, or a planner that is given twice; nothing has run then.
      RunFolderError: the folder is in use, has something else, or cannot be written.
      EngineError: a worker process could not be started.
    """
    require_whole("workers", workers, 1, optional=True)
    read, named = lab if isinstance(lab, Lab) else read_lab(lab), as_axis(planners)
    require_axes([("planner", named)])
    drives = plan_drives(read, named)

    def write(found: Grades) -> None:
        for each, name in zip(found.cells, page_names(found.cells), strict=True):
            pictures = [row.picture for row in found.rows if row.key.planner == each.planner and row.picture]
            write_grade_page(read, each, pictures, found.folder / name)

    return drive_grid(
        Grades, drives, GradesFolder(out), {"lab": read.title}, workers=workers, watch=watch, draw=write
    )  # fmt: skip


def plan_drives(lab: Lab, planners: Sequence[str]) -> list[GradedDrive]:
    """Return the drives of some planners, in their order."""
    setups = list(dict.fromkeys(each.setup for each in lab.checks))
    found = []
    for planner in planners:
        if not isinstance(planner, str):
            raise SettingsError(f"a planner is {planner!r}; accepted: a text, as path/to/file.py")
        sha256 = _sha256(planner)
        for place, setup in enumerate(setups):
            checks = tuple((number, each) for number, each in enumerate(lab.checks) if each.setup == setup)
            said = digest(
                setup.described(), [(number, each.name, each.points, repr(each.check)) for number, each in checks]
            )
            found.append(GradedDrive(DriveKey(planner, sha256, place, said), planner, setup, checks))
    return found


def _sha256(planner: str) -> str | None:
    """Return the hash of a planner's file, unexecuted; None: it has none, or it cannot be read."""
    try:
        text = planner if re.search(r":\w+$", planner) or not planner.endswith(".py") else f"{planner}:"
        return ControllerChoice.of(text).sha256
    except Exception:  # the drive says why
        return None
