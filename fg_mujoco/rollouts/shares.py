"""Shares of a rollout's worlds by a parameter that was drawn: finished, crashed and slid, each with its interval.

    shares = result.by("mu")
    print(shares.text())       # and up to where all worlds finish
    shares.picture("mu.svg")
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..course.writing import write_file
from ..display import brief
from ..messages import FloatArray
from ..pictures.pages.figure_kit import COLOURS, MARKERS, finish, render, require_matplotlib
from ..pictures.pages.table import Table

KINDS = ("finished", "crashed", "slid")
"""What is counted. `slid`: a tire slid at any time; not of tires without a peak."""

_Z = 1.959963984540054  # of 95 %


def wilson(successes: int, count: int) -> tuple[float, float]:
    """Return the interval of a share at 95 %, from 0 to 1; of nothing, 0 and 1.

    Source: E. Wilson, Probable Inference, the Law of Succession, and Statistical Inference, Journal of the American
    Statistical Association 22, 1927.
    """
    if count == 0:
        return 0.0, 1.0
    share, square = successes / count, _Z * _Z
    middle = (share + 0.5 * square / count) / (1.0 + square / count)
    half = _Z * math.sqrt(share * (1.0 - share) / count + 0.25 * square / count**2) / (1.0 + square / count)
    return (
        0.0 if successes == 0 else max(middle - half, 0.0),
        1.0 if successes == count else min(middle + half, 1.0),
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Shares:
    """Counts of worlds in even ranges of a parameter, n of them."""

    name: str  # of the parameter
    edges: FloatArray  # (n + 1,) of the ranges
    worlds: NDArray[np.int64]  # (n,) in each
    counts: dict[str, NDArray[np.int64]]  # (n,) by KINDS; without `slid` of tires without a peak

    @classmethod
    def of(
        cls, name: str, values: FloatArray, reasons: Sequence[str], slides: FloatArray | None, ranges: int
    ) -> Shares:
        """Count worlds.

        Args:
          name: of the parameter.
          values: of it (m,).
          reasons: why each world ended.
          slides: greatest sliding speed [m/s] above which a tire slides; None: not measured.
          ranges: number of even ranges.
        """
        low, high = float(values.min()), float(values.max())
        edges = np.linspace(low, high, ranges + 1) if high > low else np.array([low, high])
        place = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
        ended = np.asarray(reasons)
        found = {"finished": ended == "finished", "crashed": ended == "crash"}
        if slides is not None:
            found["slid"] = slides > 0.0
        every = np.ones(len(place), np.bool_)
        worlds, *counts = (
            np.bincount(place[held], minlength=len(edges) - 1).astype(np.int64) for held in (every, *found.values())
        )
        return cls(name=name, edges=edges, worlds=worlds, counts=dict(zip(found, counts, strict=True)))

    def __repr__(self) -> str:
        return brief(self, f"{self.name} {self.edges[0]:.4g} to {self.edges[-1]:.4g}", f"{self.worlds.sum()} worlds")

    def share(self, kind: str) -> FloatArray:
        """Return the share of worlds, NaN in a range without any. Shape (n,)."""
        pairs = zip(self.counts[kind].tolist(), self.worlds.tolist(), strict=True)
        return np.array([count / worlds if worlds else math.nan for count, worlds in pairs])

    def interval(self, kind: str) -> FloatArray:
        """Return the intervals of the shares at 95 %. Shape (n, 2)."""
        pairs = zip(self.counts[kind].tolist(), self.worlds.tolist(), strict=True)
        return np.array([wilson(count, worlds) for count, worlds in pairs])

    @property
    def safe(self) -> tuple[float, float] | None:
        """The longest run of ranges in which all worlds finish, and no tire slides where that is measured."""
        fine = (self.worlds > 0) & (self.counts["finished"] == self.worlds)
        fine &= self.counts.get("slid", np.zeros(len(fine))) == 0
        runs, begun = [(0, 0)], None
        for at, good in enumerate([*fine.tolist(), False]):
            if good and begun is None:
                begun = at
            elif not good and begun is not None:
                runs.append((begun, at))
                begun = None
        first, last = max(runs, key=lambda run: run[1] - run[0])
        return (float(self.edges[first]), float(self.edges[last])) if last > first else None

    def text(self) -> str:
        """Return the table, and up to where the planner is safe, as Markdown."""
        rows = []
        for at, worlds in enumerate(self.worlds.tolist()):
            row: list[object] = [f"{self.edges[at]:.3f} to {self.edges[at + 1]:.3f}", worlds]
            for kind in self.counts:
                low, high = (100.0 * self.interval(kind)[at]).tolist()
                row.append(f"{100.0 * self.share(kind)[at]:.0f} % ({low:.0f} to {high:.0f})" if worlds else "-")
            rows.append(row)
        table = Table(header=(self.name, "worlds", *self.counts), rows=rows).markdown()
        what = "all worlds finish" + (", and no tire slides" if "slid" in self.counts else "")
        found = self.safe
        where = f"from {self.name} {found[0]:.3f} to {found[1]:.3f}" if found else f"in no range of {self.name}"
        return f"{table}\nSafe, {what}: {where}. In brackets: Wilson's interval at 95 %.\n"

    def picture(self, path: str | Path) -> None:
        """Write the shares with their intervals as a figure: a path that ends in .svg, .pdf or .png.

        Raises:
          MissingExtraError: matplotlib is not installed.
        """
        require_matplotlib()

        def draw(figure: object) -> None:
            axes = figure.add_subplot()  # type: ignore[attr-defined]
            middle = 0.5 * (self.edges[1:] + self.edges[:-1])
            for place, (kind, colour, marker) in enumerate(zip(self.counts, COLOURS, MARKERS, strict=False)):
                share, bounds = 100.0 * self.share(kind), 100.0 * self.interval(kind)
                spread = np.maximum(np.stack((share - bounds[:, 0], bounds[:, 1] - share)), 0.0)
                look = {"color": colour, "marker": marker, "capsize": 2.0, "linewidth": 0.8}
                aside = 0.1 * (place - 1) * (self.edges[1] - self.edges[0])  # so that intervals stand side by side
                axes.errorbar(middle + aside, share, spread, label=kind, **look)
            name = f"{self.name} [-]" if self.name == "mu" else self.name
            finish(axes, name, "share of the worlds [%]", legend=False)
            figure.legend(loc="outside upper center", ncols=len(self.counts))  # type: ignore[attr-defined]

        write_file(Path(path), render(draw, 3.0, Path(path).suffix.removeprefix(".")))
