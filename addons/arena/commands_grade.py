"""The command `fg-mujoco grade`.

Exit codes: 0 all planners have passed; 1 one has not; 2 a lab that cannot be used; 130 Ctrl-C.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from fg_mujoco.cli.options import whole
from fg_mujoco.cli.out import STUDY, add_out_options
from fg_mujoco.cli.progress import shown_as, to_go
from fg_mujoco.errors import EngineError
from fg_mujoco.rollouts.grid_study import StudyProgress
from fg_mujoco.rollouts.store import as_json

from .labs.grading import grade
from .labs.lab_file import read_lab

_PASSED, _NOT_PASSED = 0, 1


def add_grade(add_command: Callable[..., argparse.ArgumentParser], commands: Any) -> None:
    """Add the command; `add_command` is the one that adds the others."""
    text = "grade planners by a lab of a course: checks with points, a table, and a page for each planner"
    command = add_command(commands, "grade", _grade, text)
    add = command.add_argument
    add("lab", metavar="LAB.toml", help="the checks and their points")
    add(
        "planners", nargs="+", metavar="PLANNER",
        help="path/to/file.py, or file.py:NAME where it has several planners; also NAME, ros:path/to/node.py, or a "
        "policy's file",
    )  # fmt: skip
    add("--workers", type=whole, metavar="N", help="processes; default: as many as there are cores")
    add_out_options(
        command, STUDY, "tables, a page for each planner, grades.json; a planner graded there is not driven again"
    )
    add("--json", action="store_true", help="print one JSON object and nothing else")


def _grade(options: argparse.Namespace) -> int:
    lab = read_lab(options.lab)

    def text(progress: StudyProgress) -> str:
        return f"{progress.runs_found + progress.runs_driven}/{progress.runs} drives{to_go(progress.remaining_s)}"

    with (
        TemporaryDirectory(prefix="fg_mujoco-grade-") as aside,
        contextlib.redirect_stdout(sys.stderr),
        shown_as(text, "preparing drives", show=not options.json) as watch,
    ):
        try:
            grades = grade(
                lab, options.planners, out=options.out or Path(aside) / "grades", workers=options.workers, watch=watch
            )
        except EngineError as error:
            print("fg-mujoco:", *str(error).split(), file=sys.stderr)
            return _NOT_PASSED
    passed = [each.points >= lab.passing for each in grades.cells]
    if options.json:
        print(as_json(grades.summary()))
    else:
        written = "" if options.out is None else f"; written to {options.out}"
        print(f"{lab.title}\n\n{grades.markdown()}\n{sum(passed)} of {len(passed)} passed{written}")
        for each in grades.cells:
            if each.reason is not None and len(passed) == 1:
                print(f"{each.planner} failed: {each.reason}")
    return _PASSED if all(passed) else _NOT_PASSED
