"""Options of the command line: texts to numbers, each refusal in the words of all others; and a line of progress."""

from __future__ import annotations

import argparse
import math
import sys
import time

_REDRAW = 0.1  # [s] of wall time between two lines of progress


def whole(text: str) -> int:
    """Read a whole number."""
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}; accepted: a whole number") from None


def number(text: str) -> float:
    """Read a number."""
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}; accepted: a number") from None


def number_or_off(text: str) -> float:
    """Read a number, or `off`, which is infinity."""
    if text == "off":
        return math.inf
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}; accepted: a number, or off") from None


class ProgressLine:
    """A line on stderr that is written over and over, several times a second."""

    def __init__(self, *, show: bool) -> None:
        self._show = show
        self._shown = time.perf_counter()

    @property
    def due(self) -> bool:
        """Whether it is time for another text."""
        return self._show and time.perf_counter() - self._shown >= _REDRAW

    def write(self, text: str) -> None:
        """Show a text in place of the last one."""
        self._shown = time.perf_counter()
        print(f"\r\x1b[K{text}", end="", file=sys.stderr, flush=True)

    def clear(self) -> None:
        """Leave the line empty."""
        if self._show:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
