"""The report of the lab, written from the rows of its cells.

report.html          one file, which needs no other: results, figures, tables, and the commands that make them again
NAME_TABLE.csv       a row a measurement, with all columns; a value that is missing is empty
NAME_FIGURE.svg      each figure by itself
"""

from __future__ import annotations

import csv
import io
import math
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from ...course.writing import write_file
from ..store import WRITABLE, blame
from .experiment import OF_TIRES, ON_CIRCLES, Figure, Row, Section, Tables
from .lab_figures import embedded, render

_FOLDED = 12  # rows of a table; a longer one is opened by the reader
_UNITS = {
    "m_s2": "m/s²", "m_s": "m/s", "rad_s": "rad/s", "deg": "°", "rad": "rad", "ms": "ms", "mm": "mm", "m": "m",
    "s": "s", "N": "N", "1_m": "1/m", "percent": "%",
}  # fmt: skip
_STYLE = """\
:root { color-scheme: light dark; --text: #1b1b1b; --page: #fff; --line: #d4d4d4; --faint: #666; --card: #f4f4f4; }
@media (prefers-color-scheme: dark) {
  :root { --text: #e2e2e2; --page: #16181b; --line: #3c4046; --faint: #a0a0a0; --card: #22262b; }
}
body { background: var(--page); color: var(--text); font: 16px/1.5 system-ui, sans-serif; margin: 0; }
main { margin: 0 auto; max-width: 52rem; padding: 2rem 1rem 4rem; }
h1 { font-size: 1.7rem; }
h2 { border-top: 1px solid var(--line); font-size: 1.3rem; margin-top: 3rem; padding-top: 1rem; }
.result { font-weight: 600; }
figure { margin: 1.5rem 0; }
figure svg, figure img { background: #fff; border-radius: 4px; display: block; height: auto; width: 100%; }
figcaption, summary { color: var(--faint); font-size: .9rem; margin: .4rem 0; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .88rem; margin: .5rem 0; }
th, td { border-bottom: 1px solid var(--line); padding: .2rem .7rem .2rem 0; text-align: left; vertical-align: top; }
td.number { font-variant-numeric: tabular-nums; text-align: right; }
pre { background: var(--card); border-radius: 4px; overflow-x: auto; padding: .6rem .8rem; }
code { overflow-wrap: anywhere; }
"""


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
        drawn: dict[str, str] = {}
        for chapter in chapters:
            for table, rows in chapter.tables.items():
                write_file(folder / f"{chapter.name}_{table}.csv", table_csv(rows).encode())
            for figure in chapter.section.figures if pictures else ():
                name = f"{chapter.name}_{figure.name}"
                svg = render(figure)
                write_file(folder / f"{name}.svg", svg)
                drawn[name] = embedded(figure, svg, name)
        write_file(folder / "report.html", report_html(chapters, settings, versions, drawn).encode())


def report_html(
    chapters: Sequence[Chapter], settings: Mapping[str, Any], versions: Mapping[str, str], drawn: Mapping[str, str]
) -> str:
    """Return the page.

    Args:
      chapters: in their order.
      settings: of the lab.
      versions: that measured.
      drawn: HTML of each figure by EXPERIMENT_FIGURE; of one that is missing, the caption alone is there.
    """
    lines = [
        (what, asked, measured, chapter) for chapter in chapters for what, asked, measured in chapter.section.expected
    ]
    rows = "".join(
        f'<tr><td>{escape(what)}</td><td>{escape(asked)}</td><td>{escape(measured)}</td><td><a href="#{chapter.name}">'
        f"{escape(chapter.name)}</a></td></tr>\n"
        for what, asked, measured, chapter in lines
    )
    parts = [
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>The friction lab</title>\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n<style>\n{_STYLE}</style>\n</head>\n'
        "<body>\n<main>\n<h1>The friction lab</h1>\n"
        "<p>How far the speed law v = √(g μ b / tan δ) holds, and the tires below it.</p>\n"
    ]
    if settings.get("quick"):
        parts.append("<p>A first look: a small part of each experiment.</p>\n")
    if rows:
        head = "<tr><th>what</th><th>expected</th><th>measured</th><th>section</th></tr>"
        parts.append(f"<h2>Expected and measured</h2>\n<div class=wide><table>\n{head}\n{rows}</table></div>\n")
    made_with = f"{_pairs(settings)}\n{_pairs(versions)}"
    parts.append(f"<details>\n<summary>Settings, versions and sources</summary>\n{made_with}\n</details>\n")
    parts += [_chapter_html(chapter, settings, drawn) for chapter in chapters]
    parts.append("</main>\n</body>\n</html>\n")
    return "".join(parts)


def again(name: str, settings: Mapping[str, Any]) -> str:
    """Return the command that makes a section again."""
    words = ["fg-mujoco", "friction", name, "--out", f"runs/{name}"]
    if settings.get("quick"):
        words.append("--quick")
    if settings.get("seed"):
        words += ["--seed", str(settings["seed"])]
    for option in ("mu", "steering"):
        values = settings.get(f"{option}s")
        if values and name in ON_CIRCLES:
            words += [f"--{option}", ",".join(f"{value:g}" for value in values)]
    if settings.get("tires") and name == OF_TIRES:
        words += ["--tires", ",".join(settings["tires"])]
    return shlex.join(words)


def expected_table(chapters: Iterable[Chapter]) -> str:
    """Return the table of what was expected as text."""
    lines = [("", "expected", "measured")]
    lines += [
        (f"{chapter.name}: {what}", asked, measured)
        for chapter in chapters
        for what, asked, measured in chapter.section.expected
    ]
    if len(lines) == 1:
        return ""
    widths = [max(len(line[i]) for line in lines) for i in range(2)]
    return "\n".join(
        f"{what:<{widths[0]}}  {asked:<{widths[1]}}  {measured}".rstrip() for what, asked, measured in lines
    )


def table_csv(rows: Sequence[Row]) -> str:
    """Return a CSV of all columns, in the order in which they appear; NaN is empty."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(["" if _is_nothing(row.get(name)) else row[name] for name in names] for row in rows)
    return file.getvalue()


def heading(name: str) -> str:
    """Return the name of a column as a reader wants it: `top_speed_m_s` is "top speed [m/s]"."""
    for ending, unit in _UNITS.items():
        if name.endswith(f"_{ending}"):
            return f"{name.removesuffix(f'_{ending}').replace('_', ' ')} [{unit}]"
    return name.replace("_", " ")


def _chapter_html(chapter: Chapter, settings: Mapping[str, Any], drawn: Mapping[str, str]) -> str:
    first, *rest = chapter.section.sentences or ("",)
    parts = [f'<section id="{chapter.name}">\n<h2>{escape(chapter.title)}</h2>\n<p class=result>{escape(first)}</p>\n']
    parts += [f"<p>{escape(sentence)}</p>\n" for sentence in rest]
    parts += [_figure_html(chapter.name, figure, drawn) for figure in chapter.section.figures]
    parts += [
        _table_html(f"{chapter.name}_{table}.csv", chapter.tables.get(table, []), names)
        for table, names in chapter.section.columns.items()
    ]
    parts.append(f"<p>Made again by</p>\n<pre>{escape(again(chapter.name, settings))}</pre>\n</section>\n")
    return "".join(parts)


def _figure_html(experiment: str, figure: Figure, drawn: Mapping[str, str]) -> str:
    picture = drawn.get(f"{experiment}_{figure.name}", "<p>(drawn where matplotlib is installed)</p>")
    return f"<figure>\n{picture}\n<figcaption>{escape(figure.caption)}</figcaption>\n</figure>\n"


def _table_html(title: str, rows: Sequence[Row], names: Sequence[str]) -> str:
    head = "".join(f"<th>{escape(heading(name))}</th>" for name in names)
    body = "".join(f"<tr>{''.join(_cell_html(row.get(name)) for name in names)}</tr>\n" for row in rows)
    unfolded = " open" if len(rows) <= _FOLDED else ""
    return (
        f"<details{unfolded}>\n<summary>{escape(title)}, {len(rows)} rows</summary>\n"
        f"<div class=wide><table>\n<tr>{head}</tr>\n{body}</table></div>\n</details>\n"
    )


def _cell_html(value: Any) -> str:
    if isinstance(value, (bool, str)):
        return f"<td>{escape('yes' if value is True else 'no' if value is False else value)}</td>"
    return f"<td class=number>{'-' if _is_nothing(value) else f'{value:.4g}'}</td>"


def _pairs(values: Mapping[str, Any]) -> str:
    rows = "".join(
        f"<tr><td>{escape(heading(name))}</td><td><code>{escape(str(value))}</code></td></tr>\n"
        for name, value in values.items()
    )
    return f"<div class=wide><table>\n{rows}</table></div>"


def _is_nothing(value: Any) -> bool:
    return value is None or (isinstance(value, float) and not math.isfinite(value))
