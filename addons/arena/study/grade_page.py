"""The page of a planner's grade: each check with what was asked and measured, and pictures of the drives."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fg_mujoco.display import Html, element, html
from fg_mujoco.pictures.pages.page import boxes, note, result, scroll, write_page
from fg_mujoco.pictures.pages.table import Table

from .store import Study

_BODY = """<h1>{title}</h1>{result}{figures}{reason}
<h2>Checks</h2>{checks}
<h2>Drives</h2>{pictures}
"""


def write_grade_page(found: Study, grade: Mapping[str, Any], checks: Table, path: Path) -> Path:
    """Write the page of a planner's grade, a cell of Grades, with the table of its checks, and return its path.

    Raises:
      RunFolderError: it cannot be written.
    """
    assert found.suite is not None
    planner, points, passing = grade["planner"], f"{grade['points']:g} of {grade['of']:g}", found.suite.passing
    title, passed = f"{found.suite.name}: {planner}", grade["points"] >= passing
    pictures = [row.picture for row in found.rows if row.car.planner == planner and row.picture]
    figures = [(points, "points"), (f"{grade['passed']} of {len(checks.rows) - 1}", "checks"),
               (f"{passing:g}", "points to pass")]  # fmt: skip
    body = html(
        _BODY, title=title, result=result("passed" if passed else "not passed", passed, f"{points} points"),
        figures=boxes(figures),
        reason=element("p", f"The planner failed: {grade['reason']}") if grade["reason"] else None,
        checks=scroll(checks.html("words"), "whole"),
        pictures=[element("figure", Html(each)) for each in pictures] or note("None."),
    )  # fmt: skip
    return write_page(path, title, body)
