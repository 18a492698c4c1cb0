"""Tables of studies, as texts: CSV for programs, Markdown for people."""

from __future__ import annotations

import csv
import io
from collections.abc import Collection, Iterable, Sequence
from typing import Any

import numpy as np


def csv_text(header: Sequence[str], rows: Iterable[Iterable[Any]]) -> str:
    """Return a CSV; None is empty."""
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(["" if value is None else value for value in row] for row in rows)
    return file.getvalue()


def quantile(values: Sequence[float], share: float) -> float | None:
    """Return a quantile of some values, linear between two of them; None of no values."""
    return float(np.quantile(values, share)) if len(values) else None


def quartiles(low: float | None, high: float | None) -> str:
    """Return two quartiles as a text for tables."""
    return "-" if low is None or high is None else f"{low:.2f} to {high:.2f}"


def difference_texts(
    value: float | None, low: float | None, high: float | None, *, scale: float = 1.0
) -> tuple[str, str]:
    """Return a difference and its interval for tables, with their signs; `scale` 100 for shares: percentage points."""
    form = "{:+.0f}" if scale == 100.0 else "{:+.2f}"
    ends = "-" if low is None or high is None else f"{form.format(scale * low)} to {form.format(scale * high)}"
    return "-" if value is None else form.format(scale * value), ends


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[str]], words: Collection[str]) -> str:
    """Return a Markdown table, its columns as wide as they must be for a terminal, too.

    Args:
      header: names of the columns.
      rows: their texts.
      words: the columns that begin at the left; numbers end at the right.
    """
    lines = [[text.replace("|", "\\|") for text in row] for row in (header, *rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    left = [name in words for name in header]
    rule = ["-" * width if word else "-" * (width - 1) + ":" for width, word in zip(widths, left, strict=True)]
    aligned = [
        [text.ljust(width) if word else text.rjust(width) for text, width, word in zip(line, widths, left, strict=True)]
        for line in (lines[0], rule, *lines[1:])
    ]
    return "\n".join(f"| {' | '.join(line)} |" for line in aligned) + "\n"
