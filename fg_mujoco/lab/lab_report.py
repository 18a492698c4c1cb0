"""The report of the lab, written from the rows of its cells.

report.html          one file, which needs no other: results, figures, tables, and the commands that make them again
NAME_TABLE.csv       a row a measurement, with all columns; a value that is missing is empty
NAME_FIGURE.svg      each figure by itself
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..course.writing import write_file
from ..display import Html, element, html
from ..pictures.pages.figure_kit import inlined
from ..pictures.pages.page import data_url, names_and_values, scroll, write_page
from ..pictures.pages.table import Table
from ..rollouts.store import WRITABLE, blame
from .experiment import ON_CIRCLES, Figure, Row, Section, Tables

_FOLDED = 12  # rows of a table; a longer one is opened by the reader
_UNITS = {
    "m_s2": "m/s²", "m_s": "m/s", "rad_s": "rad/s", "deg": "°", "rad": "rad", "ms": "ms", "mm": "mm", "m": "m",
    "s": "s", "N": "N", "1_m": "1/m", "percent": "%",
}  # fmt: skip
_GREATEST_SVG = 300_000  # [bytes] of a figure that stands in the page as SVG; any other does as PNG


@dataclass(frozen=True, kw_only=True)
class Chapter:
    """An experiment as the report has it."""

    name: str
    title: str
    section: Section
    tables: Tables


def write_report(
    folder: Path,
    chapters: Sequence[Chapter],
    settings: Mapping[str, Any],
    versions: Mapping[str, str],
    *,
    pictures: bool,
) -> None:
    """Write report, CSVs and figures, in place of those of an earlier call.

    Raises:
      RunFolderError: they cannot be written.
    """
    with blame(folder, WRITABLE):
        for old in (*folder.glob("*.csv"), *folder.glob("*.svg")):
            old.unlink()
        drawn: dict[str, Html] = {}
        for chapter in chapters:
            for own, rows in chapter.tables.items():
                write_file(folder / f"{chapter.name}_{own}.csv", Table.of(map(_known, rows)).csv().encode())
            for figure in chapter.section.figures if pictures else ():
                name = f"{chapter.name}_{figure.name}"
                svg = figure.render()
                write_file(folder / f"{name}.svg", svg)
                drawn[name] = _embedded(figure, svg, name)
    table = expected_table(chapters, lambda name: element("a", name, href=f"#{name}"))
    made_with = [(heading(name), element("code", str(value))) for name, value in {**settings, **versions}.items()]
    body = html(
        "<h1>The friction lab</h1>"
        "<p>How far the speed law v = √(g μ b / tan δ) holds, and the tires below it.</p>"
        "{quick}{expected}{made}{chapters}",
        quick=element("p", "A first look: a small part of each experiment.") if settings.get("quick") else None,
        expected=[element("h2", "Expected and measured"), scroll(table.html(), "whole words")] if table.rows else None,
        made=_folded("Settings, versions and sources", names_and_values(made_with)),
        chapters=[_chapter(chapter, settings, drawn) for chapter in chapters],
    )
    write_page(folder / "report.html", "The friction lab", body)


def _embedded(figure: Figure, svg: bytes, prefix: str) -> Html:
    """Return a figure as a part of the page: as SVG, or as PNG where that would be long."""
    if len(svg) > _GREATEST_SVG:
        return element("img", alt="", src=data_url("image/png", figure.render("png")))
    return inlined(svg, prefix)


def again(name: str, settings: Mapping[str, Any]) -> str:
    """Return the command that makes a section again."""
    words = ["fg-mujoco", "friction", name, "--out", f"runs/{name}"]
    if settings.get("quick"):
        words.append("--quick")
    if settings.get("seed"):
        words += ["--seed", str(settings["seed"])]
    for option in ("mu", "steering"):
        values = settings.get(f"{option}s")
        if values and name == ON_CIRCLES:
            words += [f"--{option}", ",".join(f"{value:g}" for value in values)]
    return shlex.join(words)


def expected_table(chapters: Iterable[Chapter], section: Callable[[str], object] = str) -> Table:
    """Return what was expected and what was measured; `section` is how the name of a chapter is written."""
    header = ("quantity", "expected", "measured", "section")
    rows = [(*each, section(chapter.name)) for chapter in chapters for each in chapter.section.expected]
    return Table(header=header, rows=rows, left=header)


def heading(name: str) -> str:
    """Return the name of a column as a reader wants it: `top_speed_m_s` is "top speed [m/s]"."""
    for ending, unit in _UNITS.items():
        if name.endswith(f"_{ending}"):
            return f"{name.removesuffix(f'_{ending}').replace('_', ' ')} [{unit}]"
    return name.replace("_", " ")


def _chapter(chapter: Chapter, settings: Mapping[str, Any], drawn: Mapping[str, Html]) -> Html:
    first, *rest = chapter.section.sentences or ("",)
    missing = element("p", "(drawn where matplotlib is installed)")
    return html(
        '<section id="{name}"><h2>{title}</h2><p class="result">{first}</p>{rest}{figures}{tables}'
        "<p>Made again by</p><pre>{again}</pre></section>",
        name=chapter.name,
        title=chapter.title,
        first=first,
        rest=[element("p", sentence) for sentence in rest],
        figures=[
            element("figure", drawn.get(f"{chapter.name}_{each.name}", missing), element("figcaption", each.caption))
            for each in chapter.section.figures
        ],
        tables=[
            _table(f"{chapter.name}_{table}.csv", chapter.tables.get(table, []), names)
            for table, names in chapter.section.columns.items()
        ],
        again=again(chapter.name, settings),
    )


def _table(title: str, rows: Sequence[Row], names: Sequence[str]) -> Html:
    words = [heading(name) for name in names if any(isinstance(row.get(name), str) for row in rows)]
    table = Table(header=[*map(heading, names)], rows=Table.of(map(_known, rows), names).rows, left=words)
    return _folded(f"{title}, {len(rows)} rows", table.html(), unfolded=len(rows) <= _FOLDED)


def _folded(title: str, table: Html, *, unfolded: bool = False) -> Html:
    return element("details", element("summary", title), scroll(table, "whole"), open=unfolded)


def _known(row: Row) -> dict[str, Any]:
    """Return a row in which no number is NaN."""
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value for name, value in row.items()
    }
