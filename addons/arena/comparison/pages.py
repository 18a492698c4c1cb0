"""The pages of a comparison: an index with its table, and the report of every run.

    write_comparison_report("runs/tracks")

    report/index.html       the table, with links to all runs
    report/bokeh.min.js     the one library of all pages
    report/COURSE-CONTROLLER-SPEED-SEED-KEY.html

The folder of a comparison has the poses and the figures of each run, but not what the tires did. So each run is driven
again for its page. The same key and versions give the same bits, which the hash of the trajectory shows. A planner or
track of a user's own is looked for in the current folder, by its name and its hash; if it is missing, the index says
so. One that is not bundled is driven only where it is trusted. Pages that are there already are kept.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from fg_mujoco.course.files import is_file
from fg_mujoco.course.scenes import PREFIX
from fg_mujoco.course.writing import write_file
from fg_mujoco.display import Html, element, escaped, html
from fg_mujoco.errors import ControllerError, FgMujocoError, RunFolderError
from fg_mujoco.pictures.pages.bokeh_plots import library, require_bokeh
from fg_mujoco.pictures.pages.page import LIBRARY, note, scroll, write_page
from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.racing.planners import ControllerChoice
from fg_mujoco.racing.trust import check_planner, files_sha256, require_trusted
from fg_mujoco.registry import PARTS
from fg_mujoco.rollouts.store import WRITABLE, blame

from .comparison_tables import DIFFERENCES, cells_table, make_cells
from .ground import ground_sha256
from .run import ComparisonSettings, Run, RunKey, RunRow
from .run_store import ComparisonFolder

_FOLDER, _MANIFEST, _RUNS = "report", "manifest.json", "runs.jsonl"
_ACCEPTED = "a folder that `compare --out` wrote"
_LINKS = 4  # columns before that of the runs, which is to be seen without scrolling


@dataclass(frozen=True, kw_only=True)
class _Page:
    """Of a run."""

    name: str = ""  # of its file; empty: there is none
    remark: str = ""  # why not, or what is to be known of it


def is_comparison(folder: str | Path) -> bool:
    """Return whether a folder is one of `compare`; one of `race` is not."""
    return is_file(Path(folder) / _MANIFEST) and not is_file(Path(folder) / "summary.json")


def write_comparison_report(
    folder: str | Path, watch: Callable[[int, int, str], None] | None = None, *, trust: bool = False
) -> Path:
    """Write the pages of a comparison and return the path of their index.

    After Ctrl-C the pages that are finished stay, with an index of them, and the same call goes on.

    Args:
      folder: of a comparison.
      watch: told how many pages are done, of how many, and the word "page".
      trust: whether to load planners that are not bundled, which runs their code, if their files are the recorded ones.

    Raises:
      RunFolderError: it is none, is damaged or of another version, or cannot be written.
      MissingExtraError: bokeh is not installed.
    """
    require_bokeh()
    settings, rows = _read(Path(folder))
    out = Path(folder) / _FOLDER
    with blame(out, WRITABLE):
        out.mkdir(exist_ok=True)
        write_file(out / LIBRARY, library().encode())
    pages: dict[RunKey, _Page] = {}
    try:
        for done, row in enumerate(rows):
            if watch is not None:
                watch(done, len(rows), "page")
            pages[row.key] = _run_page(row, settings, out, trust=trust)
    finally:
        _write_index(Path(folder), out / "index.html", settings, rows, pages)
    return out / "index.html"


def _read(folder: Path) -> tuple[ComparisonSettings, list[RunRow]]:
    store = ComparisonFolder(folder)
    with blame(folder / _MANIFEST, _ACCEPTED):
        manifest = store.manifest()
        if not isinstance(manifest["settings"].get("laps"), int):
            raise ValueError("settings that are not those of a comparison")
        settings = ComparisonSettings.of(manifest["settings"])
    store.read(repair=False)
    if not store.runs:
        raise RunFolderError(f"{folder / _RUNS}: has no finished run; accepted: {_ACCEPTED}")
    return settings, list(store.runs.values())


def _run_page(row: RunRow, settings: ComparisonSettings, out: Path, *, trust: bool) -> _Page:
    """Drive a run again and write its page, unless it is there."""
    if row.figures.trajectory_sha256 is None:
        return _Page(remark=row.figures.message or "failed")
    key = row.key
    seed = "" if key.seed is None else f"-{key.seed}"
    words = f"{key.course}-{key.controller}-{key.max_speed_m_s:g}{seed}"
    name = f"{re.sub(r'[^A-Za-z0-9._-]+', '_', words)[:80]}-{key.sha256[:8]}.html"
    if (out / name).exists():
        return _Page(name=name)
    try:
        result = _find_run(key, settings, trust=trust).race()
    except ControllerError as error:
        warnings.warn(str(error), stacklevel=2)
        return _Page(remark=" ".join(str(error).split()))
    except FgMujocoError as error:
        return _Page(remark=" ".join(str(error).split()))
    if result.car.end_reason == "interrupted":
        raise KeyboardInterrupt
    same = result.trajectory_sha256 == row.figures.trajectory_sha256
    said = "the same run, bit for bit" if same else "another run than that in the table, which another version drove"
    note = f'Driven again for this page: {said}. <a href="index.html">All runs</a>'
    PARTS.find("run page")(result, out / name, clip_seconds=None, share_library=True, notes=(note,))
    return _Page(name=name, remark="" if same else said)


def _find_run(key: RunKey, settings: ComparisonSettings, *, trust: bool) -> Run:
    """Return a run to be driven again, with the planner and the course that its key means.

    Raises:
      FgMujocoError: one of them is not here.
    """
    choice = ControllerChoice.of(key.controller)
    require_trusted(choice.source, {"sha256": key.controller_sha256}, trust=trust, where=_RUNS)
    opponents = settings.opponents
    for label, sha256 in zip(opponents.labels, opponents.recorded, strict=True):
        require_trusted(ControllerChoice.of(label).source, {"sha256": sha256}, trust=trust, where=_MANIFEST)
    for course in (key.course, f"{key.course}.csv"):
        try:
            if ground_sha256(course, key.seed, car=settings.car.parameters) != key.course_sha256:
                continue
            run = Run(key, choice, course, settings)
        except FgMujocoError:
            continue
        _require_same_files(run)
        return run
    missing = key.course if key.course.startswith(PREFIX) else f"{key.course}.csv"
    raise RunFolderError(f"{missing}: is not in this folder as it was; accepted: call from where its file is")


def _require_same_files(run: Run) -> None:
    """Refuse a planner that reads other files now than in the run of the table; older versions did not keep which.

    Raises:
      ControllerError: it does.
    """
    opponents, course = run.settings.opponents, run.ground().course
    changed = []
    if run.key.controller_files_sha256 is not None:
        found = check_planner(run.controller, course, run.settings.drive(max_speed=run.key.max_speed_m_s))
        if files_sha256(found) != run.key.controller_files_sha256:
            changed.append((run.key.controller, found))
    if any(opponents.files):
        both = zip(opponents.labels, opponents.checked(course).files, opponents.files, strict=True)
        changed += [(label, found) for label, found, recorded in both if found != recorded]
    for label, found in changed:
        raise ControllerError(
            f"{_RUNS}: planner {label!r}: {', '.join(found) or 'a file'}, which it reads, is another one now; "
            "accepted: the files as they were raced"
        )


def _write_index(
    folder: Path, path: Path, settings: ComparisonSettings, rows: Sequence[RunRow], pages: Mapping[RunKey, _Page]
) -> None:
    told, name = _told_apart(rows), folder.resolve().name
    links: dict[tuple[str, str, float], list[object]] = {}
    for row, named in zip(rows, told, strict=True):
        links.setdefault(_cell_of(named.key), []).extend((_link(row, pages.get(row.key, _Page())), " "))
    cells = make_cells(told)
    table = cells_table(cells)
    left_out = table.header.index("not finished")  # which the marks say

    def with_links(row: Sequence[object], links: object) -> list[object]:
        return [*row[:_LINKS], links, *row[_LINKS:left_out], *row[left_out + 1 :]]

    table = replace(
        table,
        header=[str(each) for each in with_links(table.header, "runs, by seed")],
        rows=[
            with_links(row, element("div", links[cell.controller, cell.course, cell.max_speed_m_s], class_="runs"))
            for cell, row in zip(cells, table.rows, strict=True)
        ],
        left=(*table.left, "runs, by seed"),
    )
    remarks = [
        element("li", f"{row.key.controller} on {row.key.course}{_seed(row)}: {page.remark}")
        for row in rows
        if (page := pages.get(row.key, _Page())).remark
    ]
    common = settings.manifest()
    if settings.opponents.entries:
        common["opponents"] = " and ".join(settings.opponents.labels)
    shared = ", ".join(f"{key} {value}" for key, value in common.items() if value is not None)
    wins = sum(row.figures.success for row in rows)
    differences = DIFFERENCES.table(DIFFERENCES.of(told))
    body = html(
        '<h1>{name}: {count} runs</h1><p class="result">{wins} of {count} finished without touching anything.</p>'
        '<p class="note">{shared}. A click on a seed opens the report of that run.</p>{table}{differences}{remarks}',
        name=name, count=len(rows), wins=wins, shared=shared, table=_whole(table),
        differences=[element("h2", "Paired differences"), _whole(differences)] if differences else None,
        remarks=html('<h2>Remarks</h2><ul class="note">{all}</ul>', all=remarks) if remarks else None,
    )  # fmt: skip
    write_page(path, f"{name}: comparison", body)


def _whole(table: Table) -> Html:
    """Return a table in all its height, and its legend."""
    return escaped([scroll(table.html(), "whole"), note(table.legend)])


def _cell_of(key: RunKey) -> tuple[str, str, float]:
    return key.controller, key.course, key.max_speed_m_s


def _told_apart(rows: Sequence[RunRow]) -> list[RunRow]:
    """Return rows in which planners of one name whose files differ have other names: with the beginning of a hash."""
    found: dict[str, set[tuple[str | None, str | None]]] = {}
    for row in rows:
        found.setdefault(row.key.controller, set()).add((row.key.controller_sha256, row.key.controller_files_sha256))

    def name(key: RunKey) -> str:
        of_one = found[key.controller]
        own = (key.controller_sha256, key.controller_files_sha256)
        parts = [
            f"{what} {str(own[place])[:8]}"
            for place, what in enumerate(("code", "files"))
            if len({each[place] for each in of_one}) > 1
        ]
        return f"{key.controller} ({', '.join(parts)})" if parts else key.controller

    return [replace(row, key=replace(row.key, controller=name(row.key))) for row in rows]


def _link(row: RunRow, page: _Page) -> Html:
    name = "run" if row.key.seed is None else row.key.seed
    reason, colour = row.figures.end_reason.replace("_", " "), "good" if row.figures.success else "bad"
    text = f"{name}{'✓' if row.figures.success else '✗'}"
    if not page.name:
        return element("span", text, class_=colour, title=f"{reason}; no page")
    return element("a", text, class_=colour, href=page.name, title=reason)


def _seed(row: RunRow) -> str:
    return "" if row.key.seed is None else f", seed {row.key.seed}"
