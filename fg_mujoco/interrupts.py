"""Ctrl-C and SIGTERM end the command `fg-mujoco` in order: without a traceback, and wherever they come.

Python raises KeyboardInterrupt between any two steps of a program. While modules are imported that is a traceback, and
in a callback of the garbage collector it is printed and forgotten. So the first import of this package lets Ctrl-C end
the command at once, and while the command runs an interrupt that was forgotten is sent again.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterator
from typing import Any

_AGAIN = 0.01  # [s] after which a callback is over


def is_command() -> bool:
    """Return whether this process is the command `fg-mujoco`."""
    program = os.path.basename(sys.argv[0] if sys.argv else "").removesuffix(".exe")
    return program == "fg-mujoco" or sys.orig_argv[1:3] == ["-m", "fg_mujoco"]


def end_command(said: str) -> None:
    """End the command with a line and exit code 2, before its work; do nothing in another program."""
    if is_command():
        print("fg-mujoco:", said, file=sys.stderr)
        sys.exit(2)


def _end_at_once() -> None:
    """Let Ctrl-C end this process without a traceback, if it is the command and has not begun its work."""
    is_usual = _in_main_thread() and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if is_command() and is_usual and multiprocessing.parent_process() is None:
        signal.signal(signal.SIGINT, signal.SIG_DFL)


@contextlib.contextmanager
def ended_in_order(terminated: threading.Event) -> Iterator[None]:
    """Raise KeyboardInterrupt for Ctrl-C and for SIGTERM, for which `terminated` is set, so that folders are removed.

    Processes that the command forks, and a program that has a handler of its own, end as they would.
    """
    if not _in_main_thread() or signal.getsignal(signal.SIGTERM) != signal.SIG_DFL:
        yield
        return
    process, before, usual = os.getpid(), signal.getsignal(signal.SIGINT), sys.unraisablehook

    def end(number: int, frame: Any) -> None:
        if os.getpid() != process:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
            os.kill(os.getpid(), signal.SIGTERM)
        terminated.set()
        signal.default_int_handler(number, frame)

    def lost(error: Any) -> None:
        if not issubclass(error.exc_type, KeyboardInterrupt):
            usual(error)
        elif os.getpid() == process:
            timer = threading.Timer(_AGAIN, signal.pthread_kill, (threading.main_thread().ident, signal.SIGINT))
            timer.daemon = True
            timer.start()

    signal.signal(signal.SIGTERM, end)
    if before is signal.SIG_DFL:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.unraisablehook = lost
    try:
        yield
    except Exception as error:
        if _ended_an_import(error):
            raise KeyboardInterrupt from error
        raise
    finally:
        sys.unraisablehook = usual
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        if before is signal.SIG_DFL:
            signal.signal(signal.SIGINT, before)


def _ended_an_import(error: BaseException | None) -> bool:
    """Return whether an error comes of an interrupt of an import, which a module in C makes an ImportError."""
    while error is not None:
        below = error.__cause__ or error.__context__
        if isinstance(error, ImportError) and isinstance(below, KeyboardInterrupt):
            return True
        error = below
    return False


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()


_end_at_once()
