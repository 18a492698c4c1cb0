"""Tab completion in bash, zsh and fish, by argcomplete, the extra `completion`; docs/start.md says how to switch it on.

The shell calls `fg-mujoco` with the variable _ARGCOMPLETE set; without it nothing here is imported.
"""

from __future__ import annotations

import argparse
import contextlib
import os
from collections.abc import Callable, Iterable
from typing import Any

from ..course.formats import track_names
from ..course.scenes.catalogue import PREFIX, scene_names
from ..lidar.lidar import LIDAR_BACKENDS
from ..racing.planners import controller_names
from ..racing.randomization import OF_ENVIRONMENTS, PARAMETERS
from ..rollouts.recording import RECORDS
from ..rollouts.rollouts import EXECUTORS
from ..vehicle.tires import tire_names
from ..vehicle.vehicle import vehicle_names


def complete(parser: argparse.ArgumentParser) -> None:
    """Answer the shell with what the word under the cursor may become, and exit, if it is the shell that asks."""
    if "_ARGCOMPLETE" not in os.environ:
        return
    with contextlib.suppress(ImportError):  # the shell completes nothing
        import argcomplete

        _offer_names(parser)
        argcomplete.autocomplete(parser)


def _offer_names(parser: argparse.ArgumentParser) -> None:
    """Give the options of all commands the names that they take; files are offered besides by the shell."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                _offer_names(command)
        elif action.dest in _NAMES:
            setattr(action, "completer", _completer(_NAMES[action.dest]))  # noqa: B010


def _completer(names: Callable[[], Iterable[str]]) -> Callable[..., list[str]]:
    """Return argcomplete's completer of names; of a list with commas it completes the last one."""

    def completer(prefix: str, **_: Any) -> list[str]:
        before, comma, _last = prefix.rpartition(",")
        return [f"{before}{comma}{name}" for name in names()]

    return completer


def _courses() -> list[str]:
    return [*track_names(), *(f"{PREFIX}{name}" for name in scene_names())]


def _cameras() -> Iterable[str]:
    from ..pictures.rendering.cameras import CAMERAS  # slow to import

    return CAMERAS


def _qualities() -> Iterable[str]:
    from ..pictures.rendering.presets import QUALITIES  # slow to import

    return QUALITIES


_NAMES: dict[str, Callable[[], Iterable[str]]] = {
    "track": _courses,
    "tracks": track_names,
    "scenes": scene_names,
    "controller": controller_names,
    "controllers": controller_names,
    "vehicle": vehicle_names,
    "tires": tire_names,
    "lidar": lambda: LIDAR_BACKENDS,
    "randomize": lambda: [f"{name}=" for name in PARAMETERS if name not in OF_ENVIRONMENTS],
    "record": lambda: RECORDS,
    "executor": lambda: EXECUTORS,
    "camera": _cameras,
    "quality": _qualities,
}
"""Destination of an option -> the names that it takes."""
