"""The page of a planner's grade: each check with what was asked and measured, and pictures of the drives."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from fg_mujoco.display import Html, element, html
from fg_mujoco.pictures.pages.page import boxes, note, result, scroll, write_page

from .grades import Grade, checks_table
from .lab_file import Lab

_BODY = """<h1>{title}</h1>{result}{figures}{reason}
<h2>Checks</h2>{checks}
<h2>Drives</h2>{pictures}
"""


def page_names(grades: Sequence[Grade]) -> list[str]:
    """Return the name of the page's file of each grade."""
    names: list[str] = []
    for each in grades:
        stem = re.sub(r"[^A-Za-z0-9.+-]+", "_", each.planner)[-80:].strip("._") or "planner"
        number = sum(name.startswith(f"{stem}.") or name.startswith(f"{stem}_") for name in names)
        names.append(f"{stem}{f'_{number + 1}' if number else ''}.html")
    return names


def write_grade_page(lab: Lab, grade: Grade, pictures: Sequence[str], path: Path) -> Path:
    """Write the page of a grade and return its path.

    Raises:
      RunFolderError: it cannot be written.
    """
    passed = grade.points >= lab.passing
    figures = [
        (f"{grade.points:g} of {grade.of:g}", "points"), (f"{grade.passed} of {len(grade.checks)}", "checks"),
        (f"{lab.passing:g}", "points to pass"),
    ]  # fmt: skip
    body = html(
        _BODY, title=f"{lab.title}: {grade.planner}",
        result=result("passed" if passed else "not passed", passed, f"{grade.points:g} of {grade.of:g} points"),
        figures=boxes(figures), reason=element("p", f"The planner failed: {grade.reason}") if grade.reason else None,
        checks=scroll(checks_table(grade).html("words"), "whole"),
        pictures=[element("figure", Html(each)) for each in pictures] or note("None."),
    )  # fmt: skip
    return write_page(path, f"{lab.title}: {grade.planner}", body)
