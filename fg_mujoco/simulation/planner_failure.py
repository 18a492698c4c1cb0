"""Describes a planner's failure: the line of its file, its part of the traceback, and the messages it was given."""

from __future__ import annotations

import inspect
import sys
import traceback
from dataclasses import FrozenInstanceError, dataclass, field
from types import FunctionType
from typing import Any

from ..display import brief
from ..messages import LaserScan, Odometry


@dataclass(frozen=True, kw_only=True, repr=False)
class PlannerFailure:
    """A planner's exception, or an answer that is no command.

    Its text is for people: "ZeroDivisionError: division by zero (my_planner.py, line 31), t = 2.600 s".
    """

    error: str  # kind and message, in one line
    time_s: float  # of the scan
    file: str | None  # of the planner; None: it is in none
    line: int | None  # in it, the innermost that was reached, or where `__call__` is defined; None: neither is in it
    traceback: str  # from the planner's file on, many lines; empty where nothing was raised
    whole_traceback: str  # with the frames that called the planner, and what caused the error
    scan: LaserScan = field(repr=False)  # that the planner was given
    odometry: Odometry = field(repr=False)

    def __repr__(self) -> str:
        return brief(self, str(self))

    def __str__(self) -> str:
        return f"{self.error}{place(self.file, self.line)}, t = {self.time_s:.3f} s"

    def summary(self) -> dict[str, Any]:
        """Return the entries for the JSON summary: everything but the messages."""
        names = ("error", "time_s", "file", "line", "traceback")
        return {name: getattr(self, name) for name in names}


def one_line(error: BaseException) -> str:
    """Return the kind and message of an error in one line."""
    said = " ".join(str(error).split())
    return f"{type(error).__name__}: {said}{_advice(error, said)}"


def _advice(error: BaseException, said: str) -> str:
    """Return advice for an error of a planner that writes to its scan; an empty text for any other error."""
    if type(error) is FrozenInstanceError or (type(error) is ValueError and "read-only" in said):
        return "; scans and odometry are read-only: change a copy, such as ranges = scan.ranges.copy()"
    return ""


def place(file: str | None, line: int | None) -> str:
    """Return a file and a line in it in brackets; nothing where there is no line."""
    return f" ({file}, line {line})" if file is not None and line is not None else ""


def error_text(error: BaseException, file: str | None) -> str:
    """Return the kind and the message of an error, and the line of a planner's file in which it was raised."""
    return one_line(error) + ("" if isinstance(error, SyntaxError) else place(file, line_of(error, file)))


def failed_in(what: str, error: BaseException, kind: type) -> str:
    """Return that a method of a planner of a class failed with an error."""
    return f"controller {kind.__name__} failed in {what}: {error_text(error, file_of(kind))}"


def file_of(kind: Any) -> str | None:
    """Return the file that a planner's class is defined in, as its code names it; None where there is none."""
    for member in vars(kind).values() if isinstance(kind, type) else ():
        function = _plain(member)
        code = None if function is None else getattr(inspect.unwrap(function), "__code__", None)
        if code is not None and code.co_filename != "<string>":  # a dataclass writes such methods
            return str(code.co_filename)
    return getattr(sys.modules.get(getattr(kind, "__module__", "")), "__file__", None)


def line_of(error: BaseException, file: str | None) -> int | None:
    """Return the innermost line of a file in the traceback of an error; None: there is none."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    return lines[-1] if lines else None


def own_traceback(error: BaseException, file: str | None) -> str:
    """Return the traceback from the first frame in a planner's file on, or all."""
    frames = list(traceback.extract_tb(error.__traceback__))
    first = next((i for i, frame in enumerate(frames) if frame.filename == file), 0)
    lines = [*traceback.format_list(frames[first:]), *traceback.format_exception_only(error)]
    return "Traceback of the planner:\n" + "".join(lines)


def failure_of(error: BaseException | str, kind: type, scan: LaserScan, odometry: Odometry) -> PlannerFailure:
    """Return the failure of a planner of a class, which raised an error, or whose answer is no command, in words."""
    file = file_of(kind)
    said, line, own, whole = str(error), _definition(kind, file), "", ""
    if isinstance(error, BaseException):
        said, line, own = one_line(error), line_of(error, file) or line, own_traceback(error, file)
        whole = "".join(traceback.format_exception(error))
    return PlannerFailure(
        error=said, time_s=scan.stamp, file=file, line=line, traceback=own, whole_traceback=whole, scan=scan,
        odometry=odometry,
    )  # fmt: skip


def _definition(kind: Any, file: str | None) -> int | None:
    """Return the line of a file in which the `__call__` of a planner's class begins; None: it is in no such file."""
    code = getattr(inspect.unwrap(kind.__call__), "__code__", None)
    return code.co_firstlineno if code is not None and code.co_filename == file else None


def _plain(member: Any) -> FunctionType | None:
    """Return the function of a member of a class, be it static or a class method, and call nothing of it."""
    if issubclass(type(member), (staticmethod, classmethod)):
        member = member.__func__
    return member if type(member) is FunctionType else None
