"""The pages of a study of planners alone: an index with its table, and the report of every run.

    write_comparison_report("runs/tracks")

    report/index.html       the table, with links to all runs
    report/bokeh.min.js     the one library of all pages
    report/RUN.html

The folder of a study has the figures of each run, but not what the tires did. So each run is driven again for its page,
from the folder in which the study was driven. The same setup and versions give the same bits, which the hash of the
trajectory shows. A planner that is not bundled is driven only where it is trusted, and is as it was. Pages that are
there already are kept.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from fg_mujoco.course.definitions import course_sha256
from fg_mujoco.course.files import is_file
from fg_mujoco.course.writing import write_file
from fg_mujoco.display import Html, element, escaped, html
from fg_mujoco.errors import ControllerError, FgMujocoError, RunFolderError
from fg_mujoco.pictures.pages.bokeh_plots import library, require_bokeh
from fg_mujoco.pictures.pages.page import LIBRARY, note, scroll, write_page
from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.racing.planners import ControllerChoice
from fg_mujoco.racing.race import race_setup
from fg_mujoco.racing.setup import Setup
from fg_mujoco.racing.trust import require_trusted
from fg_mujoco.registry import PARTS
from fg_mujoco.rollouts.store import WRITABLE, blame

from ..runs.run import RunRow
from .kinds import Comparison
from .plan import Loaded
from .store import RUNS, RunsFolder
from .tables import Cell

_FOLDER, _MANIFEST = "report", "manifest.json"
_ACCEPTED = "a folder that `compare --out` wrote"


@dataclass(frozen=True, kw_only=True)
class _Page:
    """Of a run."""

    name: str = ""  # of its file; empty: there is none
    remark: str = ""  # why not, or what is to be known of it


def is_comparison(folder: str | Path) -> bool:
    """Return whether a folder is one of a study; one of `race` is not."""
    return is_file(Path(folder) / _MANIFEST) and not is_file(Path(folder) / "summary.json")


def write_comparison_report(
    folder: str | Path, watch: Callable[[int, int, str], None] | None = None, *, trust: bool = False
) -> Path:
    """Write the pages of a study and return the path of their index.

    After Ctrl-C the pages that are finished stay, with an index of them, and the same call goes on.

    Args:
      folder: of a study of planners alone.
      watch: told how many pages are done, of how many, and the word "page".
      trust: whether to load planners that are not bundled, which runs their code, if their files are the recorded ones.

    Raises:
      RunFolderError: it is none, is damaged or of another version, or cannot be written.
      MissingExtraError: bokeh is not installed.
    """
    require_bokeh()
    store = RunsFolder(folder, "comparison")
    with blame(Path(folder) / _MANIFEST, _ACCEPTED):
        store.manifest()
    store.read(repair=False)
    rows = list(store.runs.values())
    if not rows or any(len(row.cars) > 1 or row.checks for row in rows):
        raise RunFolderError(f"{Path(folder) / RUNS}: has no finished run of a planner alone; accepted: {_ACCEPTED}")
    out, pages, loaded = Path(folder) / _FOLDER, dict[str, _Page](), Loaded()
    with blame(out, WRITABLE):
        out.mkdir(exist_ok=True)
        write_file(out / LIBRARY, library().encode())
    try:
        for done, row in enumerate(rows):
            if watch is not None:
                watch(done, len(rows), "page")
            pages[row.key] = _run_page(row, out, loaded, trust=trust)
    finally:
        _write_index(Path(folder), out / "index.html", rows, pages)
    return out / "index.html"


def _run_page(row: RunRow, out: Path, loaded: Loaded, *, trust: bool) -> _Page:
    """Drive a run again and write its page, unless it is there."""
    if row.trajectory_sha256 is None:
        return _Page(remark=row.car.message or "failed")
    name = f"{row.name}.html"
    if (out / name).exists():
        return _Page(name=name)
    try:
        setup = Setup.read(row.setup)
        _require_same(row, setup, loaded, trust=trust)
        result = race_setup(setup)
    except ControllerError as error:
        warnings.warn(str(error), stacklevel=2)
        return _Page(remark=" ".join(str(error).split()))
    except FgMujocoError as error:
        return _Page(remark=" ".join(str(error).split()))
    if any(car.end_reason == "interrupted" for car in result.cars):
        raise KeyboardInterrupt
    same = result.trajectory_sha256 == row.trajectory_sha256
    said = "the same run, bit for bit" if same else "another run than that in the table, which another version drove"
    note = f'Driven again for this page: {said}. <a href="index.html">All runs</a>'
    PARTS.find("run page")(result, out / name, clip_seconds=None, share_library=True, notes=(note,))
    return _Page(name=name, remark="" if same else said)


def _require_same(row: RunRow, setup: Setup, loaded: Loaded, *, trust: bool) -> None:
    """Refuse planners that are not trusted, and planners and a course that are others now than in the run.

    Raises:
      FgMujocoError: one is.
    """
    for entry, origin in zip(setup.entries, row.origins, strict=True):
        source = ControllerChoice.of(str(entry.controller)).source
        require_trusted(source, {"sha256": origin.sha256}, trust=trust, where=RUNS)
    course = loaded.course(setup)
    for entry, origin in zip(setup.entries, row.origins, strict=True):
        found = loaded.origin(entry, course)
        if found.files != origin.files:
            raise ControllerError(
                f"{RUNS}: planner {entry.controller!r}: {', '.join(found.files) or 'a file'}, which it reads, is "
                "another one now; accepted: the files as they were raced"
            )
    if course_sha256(course) != row.course_sha256:
        raise RunFolderError(f"{setup.track}: is another course than the one that was raced; accepted: the same file")


def _write_index(folder: Path, path: Path, rows: Sequence[RunRow], pages: Mapping[str, _Page]) -> None:
    told, name = _told_apart(rows), folder.resolve().name
    found = Comparison(
        suite=None, rows=tuple(told), cells=Comparison.make_cells(told), folder=folder, runs_driven=0, wall_time_s=0.0
    )  # fmt: skip
    table, *differences = found.tables()
    links: list[object] = []
    for cell in found.cells:
        own = [row for row in told if _is_of(row, cell)]
        parts = [part for row in own for part in (_link(row, pages.get(row.key, _Page())), " ")]
        links.append(element("div", parts, class_="runs"))
    table = replace(
        table, header=[table.header[0], "runs, by seed", *table.header[1:]], left=(*table.left, "runs, by seed"),
        rows=[[row[0], link, *row[1:]] for row, link in zip(table.rows, links, strict=True)],
    )  # fmt: skip
    remarks = [
        element("li", f"{', '.join(str(value) for value in row.place.values() if value is not None)}: {page.remark}")
        for row in rows
        if (page := pages.get(row.key, _Page())).remark
    ]
    wins = sum(row.car.success for row in rows)
    body = html(
        '<h1>{name}: {count} runs</h1><p class="result">{wins} of {count} finished without touching anything.</p>'
        '<p class="note">A click on a seed opens the report of that run.</p>{table}{differences}{remarks}',
        name=name, count=len(rows), wins=wins, table=_whole(table),
        differences=[part for each in differences for part in (element("h2", "Paired differences"), _whole(each))],
        remarks=html('<h2>Remarks</h2><ul class="note">{all}</ul>', all=remarks) if remarks else None,
    )  # fmt: skip
    write_page(path, f"{name}: comparison", body)


def _is_of(row: RunRow, cell: Cell) -> bool:
    names = list(cell)[: list(cell).index("runs")]
    return all(row.place[name] == cell[name] for name in names)


def _whole(table: Table) -> Html:
    """Return a table in all its height, and its legend."""
    return escaped([scroll(table.html(), "whole"), note(table.legend)])


def _told_apart(rows: Sequence[RunRow]) -> list[RunRow]:
    """Return rows in which planners of one name whose code or files differ have other names: with a number."""
    kinds: dict[str, list[object]] = {}
    told = []
    for row in rows:
        own = kinds.setdefault(row.car.planner, [])
        if row.origins[0] not in own:
            own.append(row.origins[0])
        number = own.index(row.origins[0])
        name = f"{row.car.planner} ({number + 1})" if number else row.car.planner
        told.append(replace(row, cars=(replace(row.car, planner=name),), place={**row.place, "planner": name}))
    return told


def _link(row: RunRow, page: _Page) -> Html:
    name = row.place.get("seed")
    reason, colour = row.car.end_reason.replace("_", " "), "good" if row.car.success else "bad"
    text = f"{'run' if name is None else name}{'✓' if row.car.success else '✗'}"
    if not page.name:
        return element("span", text, class_=colour, title=f"{reason}; no page")
    return element("a", text, class_=colour, href=page.name, title=reason)
