"""The class of targets, and what all targets share.

An attempt is a call without arguments. It returns an exit code, or, of Python's targets, 0; any error that it raises is
a finding. It runs in a folder that is empty but for what the try has put there.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from numpy.random import Generator

from fg_mujoco.cli.main import main
from fg_mujoco.errors import FgMujocoError

Attempt = Callable[[], object]

SHORT = ("--time-limit", "0.03")
"""Of a race whose drive does not matter."""


@dataclass(frozen=True, kw_only=True)
class Target:
    """A kind of files or values that is read.

    Attributes:
      attempt: takes the folder of samples, the present folder and the generator; puts a changed input there.
      prepare: writes the samples.
    """

    attempt: Callable[[Path, Path, Generator], Attempt]
    prepare: Callable[[Path], None] = lambda samples: None


def command(*arguments: object) -> Attempt:
    """Return a call of the command line."""
    return lambda: main([str(argument) for argument in arguments])


def ignore_refusal(call: Callable[[], object]) -> Attempt:
    """Return a call of Python's, which may raise errors of this package only."""

    def attempt() -> int:
        with contextlib.suppress(FgMujocoError):
            call()
        return 0

    return attempt


def as_text(content: bytes) -> str:
    return content.decode("utf-8", errors="surrogateescape")
