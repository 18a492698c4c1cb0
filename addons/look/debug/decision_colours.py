"""Colours that the page and the picture share; they read on light and on dark. Most are after Okabe and Ito."""

from __future__ import annotations

from collections.abc import Sequence

SCANS = {"raw": "#59606b", "filtered": "#0a84c6", "extended": "#e07b00", "bubble": "#e0314b", "gap": "#12a066"}
GOAL, COMMAND, MOTION, DRIVEN = "#12a066", "#2f7ed8", "#a04bd0", "#e07b00"
UNKNOWN = "#8a8f98"

_LAWS = {
    "maximum speed": "#9aa1ab", "planner": "#2f7ed8", "last plan": "#b06a00", "no plan": "#7a1f2b",
    "mean range": "#59b4e0", "guidance": "#a04bd0",
    "turning in moves": "#d06bd0", "no reference": "#7a1f2b", "distance ahead": "#b8a200", "after recovery": "#c98a5a",
    "sight": "#e07b00", "safety filter": "#e0314b", "recovery": "#8a5a2b", "friction limiter": "#12a066",
    "clamped by the car": "#3b4252", "the planner failed": "#e0314b", "not known": UNKNOWN,
}  # fmt: skip
_OTHERS = ("#2f7ed8", "#e07b00", "#12a066", "#a04bd0", "#b8a200", "#59b4e0", "#c98a5a", "#d06bd0")


def hex_colour(colour: Sequence[int]) -> str:
    """Return a colour of red, green and blue in 0..255 as pages and pictures take it."""
    return "#{:02x}{:02x}{:02x}".format(*colour)


def law_colours(names: Sequence[str]) -> dict[str, str]:
    """Return a colour for each step, by name."""
    return _coloured(names, _LAWS)


def scan_colours(names: Sequence[str]) -> dict[str, str]:
    """Return a colour for each intermediate scan, by name."""
    return _coloured(names, SCANS)


def _coloured(names: Sequence[str], known: dict[str, str]) -> dict[str, str]:
    others = [name for name in names if name not in known]
    return {name: known.get(name) or _OTHERS[others.index(name) % len(_OTHERS)] for name in names}
