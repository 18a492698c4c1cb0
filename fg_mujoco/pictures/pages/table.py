"""A table, which is written as HTML for pages and notebooks, as Markdown for terminals, and as CSV for programs."""

from __future__ import annotations

import csv
import io
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ...display import Html, element, escaped, paragraph
from ...display import table as notebook_table


@dataclass(frozen=True, kw_only=True)
class Table:
    """Rows under a header. Values are texts, Html and numbers; None is "-" for people, and empty in a CSV."""

    header: Sequence[str]
    rows: Sequence[Sequence[object]]
    left: Collection[str] = ()  # columns of words, which begin at the left
    times: Sequence[float] = ()  # of each row: a click on it puts the cursor of the page there [s]
    legend: str = ""  # stands below it

    @classmethod
    def of(cls, records: Iterable[Mapping[str, Any]], names: Sequence[str] | None = None) -> Table:
        """Return the table of some records; without names it has all of theirs, in the order in which they appear."""
        listed = list(records)
        names = list(dict.fromkeys(name for record in listed for name in record)) if names is None else names
        return cls(header=names, rows=[[record.get(name) for name in names] for record in listed])

    def html(self, kind: str | None = None) -> Html:
        """Return it for a page, without its legend; `kind` is its class."""
        sides = ["left" if name in self.left else None for name in self.header]
        head = [element("th", name, class_=side) for name, side in zip(self.header, sides, strict=True)]
        lines = []
        for place, row in enumerate(self.rows):
            cells = [element("td", shown(value), class_=side) for value, side in zip(row, sides, strict=True)]
            here = {"class_": "here", "data_time": f"{self.times[place]:.3f}"} if self.times else {}
            lines.append(element("tr", cells, **here))
        return element("table", element("thead", element("tr", head)), element("tbody", lines), class_=kind)

    def notebook(self) -> Html:
        """Return it for a notebook, with its legend."""
        table = notebook_table(self.header, [[shown(value) for value in row] for row in self.rows])
        return escaped([table, paragraph(self.legend) if self.legend else None])

    def markdown(self) -> str:
        """Return it as Markdown, with its legend; its columns are as wide as they must be for a terminal, too."""
        lines = [[str(shown(value)).replace("|", "\\|") for value in row] for row in (self.header, *self.rows)]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        left = [name in self.left for name in self.header]
        rule = ["-" * width if word else "-" * (width - 1) + ":" for width, word in zip(widths, left, strict=True)]
        aligned = [
            [f"{cell:{'<' if word else '>'}{width}}" for cell, width, word in zip(line, widths, left, strict=True)]
            for line in (lines[0], rule, *lines[1:])
        ]
        text = "\n".join(f"| {' | '.join(line)} |" for line in aligned) + "\n"
        return f"{text}\n{self.legend}\n" if self.legend else text

    def csv(self) -> str:
        """Return it as CSV, with all digits of its numbers."""
        file = io.StringIO()
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(self.header)
        writer.writerows(["" if value is None else value for value in row] for row in self.rows)
        return file.getvalue()


def shown(value: object) -> object:
    """Return a value as people read it."""
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else value
