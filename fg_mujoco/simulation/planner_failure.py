"""Where and why a planner failed: the line of its file, its own part of the traceback, and what it was told then."""

from __future__ import annotations

import inspect
import re
import sys
import traceback
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..display import brief
from ..messages import LaserScan, Odometry

_COLOURS = re.compile(r"\x1b\[[0-9;]*m")  # of numba's messages in a terminal


@dataclass(frozen=True, kw_only=True, repr=False)
class PlannerFailure:
    """A planner's exception, or an answer that is no command.

    Its text is for people: "ZeroDivisionError: division by zero (my_planner.py, line 31), t = 2.600 s".
    """

    error: str  # kind and message, in one line
    time_s: float  # of the scan
    file: str | None  # of the planner; None: it is in none
    line: int | None  # in it, the innermost that was reached; None: none was
    traceback: str  # from the planner's file on, many lines; empty where nothing was raised
    scan: LaserScan = field(repr=False)  # that the planner was told
    odometry: Odometry = field(repr=False)

    def __repr__(self) -> str:
        return brief(self, str(self))

    def __str__(self) -> str:
        return f"{self.error}{place(self.file, self.line)}, t = {self.time_s:.3f} s"

    def summary(self) -> dict[str, Any]:
        """Return what the JSON summary holds: everything but the messages."""
        names = ("error", "time_s", "file", "line", "traceback")
        return {name: getattr(self, name) for name in names}


def one_line(error: BaseException) -> str:
    """Return the kind and the message of an error in one line; of numba's many lines, the ones that say what it is."""
    lines = _COLOURS.sub("", str(error)).splitlines()
    if _of_numba(error):
        saying = [line for line in lines if line.strip() and not line.startswith("Failed in ")]
        ends = (i for i, line in enumerate(saying) if line.startswith(("During: ", "File ")))
        lines = saying[: next(ends, None)] or lines
    return f"{type(error).__name__}: {' '.join(' '.join(lines).split())}"


def place(file: str | None, line: int | None) -> str:
    """Return a file and a line in it in brackets; nothing where there is no line."""
    return f" ({file}, line {line})" if file is not None and line is not None else ""


def told(error: BaseException, file: str | None) -> str:
    """Return the kind and the message of an error, and the line of a planner's file in which it was raised."""
    return one_line(error) + ("" if isinstance(error, SyntaxError) else place(file, line_of(error, file)))


def file_of(kind: Any) -> str | None:
    """Return the file that a planner's class is defined in, as its code names it; None where there is none."""
    for member in vars(kind).values() if isinstance(kind, type) else ():
        code = getattr(inspect.unwrap(_plain(member)), "__code__", None)
        if code is not None and code.co_filename != "<string>":  # a dataclass writes such methods
            return str(code.co_filename)
    return getattr(sys.modules.get(getattr(kind, "__module__", "")), "__file__", None)


def line_of(error: BaseException, file: str | None) -> int | None:
    """Return the innermost line of a file in the traceback of an error, or in numba's message; None: there is none."""
    if file is not None and _of_numba(error):
        said = re.findall(rf'File "[^"]*{re.escape(Path(file).name)}", line (\d+)', _COLOURS.sub("", str(error)))
        return int(said[-1]) if said else None
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    return lines[-1] if lines else None


def own_traceback(error: BaseException, file: str | None) -> str:
    """Return the traceback of an error from the first frame in a planner's file on; where none is in it, all of it."""
    frames = traceback.extract_tb(error.__traceback__)
    first = next((i for i, frame in enumerate(frames) if frame.filename == file), 0)
    lines = [*traceback.format_list(frames[first:]), *traceback.format_exception_only(error)]
    return _COLOURS.sub("", "Traceback of the planner:\n" + "".join(lines))


def failure_of(error: BaseException, kind: type, scan: LaserScan, odometry: Odometry) -> PlannerFailure:
    """Return the failure of a planner of a class that raised an error."""
    file = file_of(kind)
    return PlannerFailure(
        error=one_line(error), time_s=scan.stamp, file=file, line=line_of(error, file),
        traceback=own_traceback(error, file), scan=scan, odometry=odometry,
    )  # fmt: skip


def wrong_answer(text: str, kind: type, scan: LaserScan, odometry: Odometry) -> PlannerFailure:
    """Return the failure of a planner of a class that answered something else than a command; its line is `def`."""
    file = file_of(kind)
    code = getattr(inspect.unwrap(kind.__call__), "__code__", None)
    line = code.co_firstlineno if code is not None and code.co_filename == file else None
    return PlannerFailure(
        error=text, time_s=scan.stamp, file=file, line=line, traceback="", scan=scan, odometry=odometry
    )  # fmt: skip


def _of_numba(error: BaseException) -> bool:
    """Say whether numba could not compile something."""
    return type(error).__module__.startswith("numba.")


def _plain(member: Any) -> Any:
    """Return the function that a member of a class was made of: a static or class method, or a kernel."""
    member = getattr(member, "__func__", member)
    return getattr(member, "py_func", member)
