"""Hears when numba begins and ends to compile something, where it has been imported."""

from __future__ import annotations

from typing import Any, Protocol

from numba.core import event

LOADING = "fg_mujoco:kernel"
"""Event of numba's kind: a kernel is compiled, or loaded from disk, by numba."""


class Measuring(Protocol):
    """What is told of it."""

    def begin(self) -> None:
        """Note that something begins."""

    def end(self) -> None:
        """Note that it ended."""


class Listener(event.Listener):  # type: ignore[misc]
    """Tells something of all that numba compiles, until it is to stop."""

    def __init__(self, measuring: Measuring) -> None:
        self._measuring = measuring
        for kind in (LOADING, "numba:compile"):
            event.register(kind, self)

    def stop(self) -> None:
        """Tell nothing any more."""
        for kind in (LOADING, "numba:compile"):
            event.unregister(kind, self)

    def on_start(self, _: Any) -> None:
        """Tell that something begins to be compiled."""
        self._measuring.begin()

    def on_end(self, _: Any) -> None:
        """Tell that it is compiled, or that compiling it failed."""
        self._measuring.end()
