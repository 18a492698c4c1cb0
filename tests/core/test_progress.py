"""Long work says how far it is: on a terminal at once and over and over, in a pipe by a line a minute."""

import io
import re
import sys
import threading

import pytest

from fg_mujoco.cli import progress
from fg_mujoco.cli.progress import ProgressLine, shown_as, to_go


class Stderr(io.StringIO):
    """What is written, and an event when there is some of it."""

    def __init__(self, terminal):
        super().__init__()
        self.terminal, self.written = terminal, threading.Event()

    def isatty(self):
        return self.terminal

    def flush(self):
        self.written.set()


@pytest.fixture
def stderr(monkeypatch):
    """Put a terminal or a pipe in the place of stderr, whose second and minute take an instant."""

    def place(*, terminal):
        stream = Stderr(terminal)
        monkeypatch.setattr(sys, "stderr", stream)
        monkeypatch.setattr(progress, "PATIENCE", 0.01)
        monkeypatch.setattr(progress, "MINUTE", 0.01)
        return stream

    return place


def test_a_terminal_is_told_of_work_that_says_nothing(stderr):
    stream = stderr(terminal=True)
    with ProgressLine("preparing runs"):
        assert stream.written.wait(60.0)
    assert "\r\x1b[Kpreparing runs  0:00:00 elapsed" in stream.getvalue()
    assert stream.getvalue().endswith("\r\x1b[K") and "\n" not in stream.getvalue()


def test_a_pipe_is_told_the_last_text_in_a_line(stderr, monkeypatch):
    stream = stderr(terminal=False)
    monkeypatch.setattr(progress, "KEPT_EVERY", 0.0)
    with shown_as(lambda done: f"{done}/3 runs{to_go(65.0)}", "preparing runs") as watch:
        watch(1)
        watch(2)
        stream.written.clear()
        assert stream.written.wait(60.0)
    assert re.search(r"^fg-mujoco: 2/3 runs  0:01:05 to go  0:00:00 elapsed$", stream.getvalue(), re.MULTILINE)
    assert "\r" not in stream.getvalue() and stream.getvalue().endswith("\n")


def test_the_thread_ends_with_the_work_and_a_closed_stderr_does_no_harm(stderr):
    stream = stderr(terminal=True)
    threads = threading.active_count()
    with pytest.raises(ValueError, match="of the work"), ProgressLine("preparing runs") as line:
        assert threading.active_count() == threads + 1
        stream.close()
        line.write("1/3 runs")
        raise ValueError("of the work")
    assert threading.active_count() == threads
