"""How far a long piece of work is, on stderr: on a terminal one line that is written over, elsewhere a line a minute.

    with ProgressLine("comparing") as line:
        for count, run in enumerate(runs):
            if line.due:
                line.write(f"{count}/{len(runs)} runs")

A thread writes while the work says nothing: at the beginning, while workers start, and while
one part of it takes long. So a terminal shows within a second that something goes on.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

from ..errors import EngineError

_Progress = TypeVar("_Progress")

REDRAW = 0.1  # [s] of wall time between two texts on a terminal
PATIENCE = 1.0  # [s] without a text after which a terminal is told how long it takes already
MINUTE = 60.0  # [s] between two lines where there is no terminal
KEPT_EVERY = 0.5  # [s] between two texts that are kept for the next of these lines


class ProgressLine:
    """The line of progress of one piece of work; leaving it ends the thread, and clears a terminal's line.

    Args:
      doing: what is shown before the first text, as "comparing".
      show: False: nothing is written, as with --json.

    Attributes:
      terminal: whether the line is written over.
    """

    def __init__(self, doing: str, *, show: bool = True) -> None:
        self._stream, self._text = sys.stderr, doing
        self.terminal = self._stream.isatty()
        self._began = self._shown = time.perf_counter()
        self._every = (REDRAW if self.terminal else KEPT_EVERY) if show else float("inf")
        self._writing, self._ended = threading.Lock(), threading.Event()
        self._thread = threading.Thread(target=self._watch, name="progress", daemon=True) if show else None

    def __enter__(self) -> ProgressLine:
        if self._thread is not None:
            self._thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._ended.set()
        if self._thread is not None:
            self._thread.join()
            if self.terminal:
                self._print("\r\x1b[K")

    @property
    def due(self) -> bool:
        """Whether it is time for another text."""
        return time.perf_counter() - self._shown >= self._every

    def write(self, text: str) -> None:
        """Show a text in place of the last one; where there is no terminal, keep it for the next line."""
        self._text, self._shown = text, time.perf_counter()
        if self.terminal:
            self._print(f"\r\x1b[K{text}")

    def say(self, text: str) -> None:
        """Write a line that stays."""
        self._print(f"\r\x1b[K{text}\n" if self.terminal else f"{text}\n")

    def _watch(self) -> None:
        """Write what was said last, with the time that it takes already."""
        while not self._ended.wait(PATIENCE if self.terminal else MINUTE):
            if self.terminal and time.perf_counter() - self._shown < PATIENCE:
                continue
            text = f"{self._text}  {clock(time.perf_counter() - self._began)} elapsed"
            self._print(f"\r\x1b[K{text}" if self.terminal else f"fg-mujoco: {text}\n")

    def _print(self, text: str) -> None:
        with self._writing, contextlib.suppress(OSError, ValueError):  # stderr may be closed
            self._stream.write(text)
            self._stream.flush()


@contextlib.contextmanager
def shown_as(
    text: Callable[[_Progress], str], doing: str, *, show: bool = True
) -> Iterator[Callable[[_Progress], None]]:
    """Yield what takes the progress of some work and shows it as a text; arguments as of ProgressLine."""
    with ProgressLine(doing, show=show) as line:

        def watch(progress: _Progress) -> None:
            if line.due:
                line.write(text(progress))

        yield watch


class UnfinishedError(Exception):
    """A study has ended before its end; the command says why in a line, and exits 1."""


@contextlib.contextmanager
def study(
    options: argparse.Namespace, noun: str, progress: Callable[[Any], Sequence[Any]]
) -> Iterator[Callable[[Any], None]]:
    """Yield the `watch` of a study, which shows how far it is; what planners print goes to stderr.

    Args:
      options: of the command; `out`, in which finished work is kept, and `json`, with which nothing is shown.
      noun: what is driven, as "worlds".
      progress: returns how many are done, how many there are, the time that is left [s], and what else is shown.

    Raises:
      UnfinishedError: a worker or a cluster failed.
    """

    def text(each: Any) -> str:
        done, of, left, *more = progress(each)
        return f"{done}/{of} {noun}{''.join(more)}{to_go(left)}"

    show = not getattr(options, "json", False)
    with contextlib.redirect_stdout(sys.stderr), shown_as(text, f"preparing {noun}", show=show) as watch:
        try:
            yield watch
        except EngineError as error:
            kept = "nothing is kept without --out" if options.out is None else f"finished {noun} are kept"
            raise UnfinishedError(f"{error}; {kept}") from error
        except KeyboardInterrupt:
            goes_on = "nothing is kept without --out" if options.out is None else "the same command goes on"
            print(f"fg-mujoco: {options.out or noun}: interrupted; {goes_on}", file=sys.stderr)
            raise


def clock(seconds: float) -> str:
    """Return a time in hours, minutes and seconds."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}"


def to_go(remaining: float | None) -> str:
    """Return the end of a text: the time that is left [s]; None: not known."""
    return "" if remaining is None else f"  {clock(remaining)} to go"
