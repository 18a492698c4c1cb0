"""The exception tree. Every message says what was wrong, where it came from, and what would be accepted."""

from __future__ import annotations

import difflib
import shlex
import sys
from collections.abc import Iterable
from importlib import metadata
from pathlib import Path
from typing import Any

_LEAST_PART = 3  # letters of a part by which a name is found


def nearest(name: object, known: Iterable[str], *, cutoff: float = 0.6) -> str | None:
    """Return the name that was probably meant: the most similar of the known ones, else the only one that holds it.

    None: no name is similar, and none or several hold the one that was given.

    Args:
      name: as it was given.
      known: names to choose from; capitals, hyphens and underscores make no difference.
      cutoff: least similarity, from 0 to 1 (difflib's ratio).
    """
    spelt = {_spelling(each): each for each in reversed(list(known))}
    given = _spelling(str(name))
    found = difflib.get_close_matches(given, spelt, n=1, cutoff=cutoff)
    if not found:
        held = [each for each in spelt if len(given) >= _LEAST_PART and given in each]
        found = held if len(held) == 1 else []
    return spelt[found[0]] if found else None


def accepted_names(name: object, known: Iterable[str], others: str = "", *, besides: Iterable[str] = ()) -> str:
    """Return the end of a message that refuses a name: "accepted: oval, tight; did you mean 'oval'?".

    Args:
      name: as it was given.
      known: names that are accepted.
      others: what else is accepted, in words, such as ", or path/to/file.xml".
      besides: further names that may have been meant, too many for the list.
    """
    known = list(known)
    meant = nearest(name, [*known, *besides])
    hint = "" if meant is None or meant == name else f"; did you mean {meant!r}?"
    return f"accepted: {', '.join(known)}{others}{hint}"


def _spelling(name: str) -> str:
    return name.casefold().replace("-", "_")


class FgMujocoError(Exception):
    """Anything this package refuses; the command line prints it in one line and exits 2."""


class MessageError(FgMujocoError, ValueError):
    """A scan, command or odometry message with a value that no sensor or actuator has."""


class SettingsError(FgMujocoError, ValueError):
    """A setting outside its accepted range, or a combination that cannot work."""


class TrackError(FgMujocoError, ValueError):
    """A track that cannot be read, or that no car can drive."""


class ModelError(FgMujocoError, ValueError):
    """An MJCF model that lacks a part the simulation needs, or has one it cannot represent."""


class ControllerError(FgMujocoError):
    """A controller that cannot be loaded, cannot be built, or answers something else than a command."""


class PlannerError(ControllerError):
    """A planner that failed while it drove: it raised, or answered something else than a command.

    Attributes:
      failure: PlannerFailure: the line of the planner's file, its traceback, and the scan that it was told.
      result: RaceResult of the race up to there; None where there was no race.
    """

    def __init__(self, message: str, failure: Any = None) -> None:
        super().__init__(message)
        self.failure = failure
        self.result: Any = None


class RunFolderError(FgMujocoError, OSError):
    """A run folder that cannot be written, or is not one."""


class BagError(FgMujocoError, OSError):
    """A bag that cannot be read or written, or a message in it that cannot be what it says."""


class MissingExtraError(FgMujocoError, ImportError):
    """An optional part that is not installed; the message says what needs it, and the command that installs it."""


def missing_extra(needs: str, extra: str) -> MissingExtraError:
    """Return the error for an extra that is not installed.

    Args:
      needs: what needs which packages, such as "pictures need matplotlib".
      extra: its name in pyproject.toml.
    """
    return MissingExtraError(f"{needs}: {install_command(extra)}")


def install_command(extra: str) -> str:
    """Return the shell command that installs an extra for the Python that runs, from any folder.

    Nothing is published yet. So it installs from the clone that this package was imported from; without a clone it
    names the packages of the extra. Once there is a release, this function is the only code to change.
    """
    clone = Path(__file__).parents[1]
    if (clone / "pyproject.toml").is_file():
        what = ["-e", f"{clone}[{extra}]"]
    else:
        marker = f'extra == "{extra}"'
        what = [line.partition(";")[0].strip() for line in metadata.requires("fg-mujoco") or () if marker in line]
    return shlex.join([sys.executable or "python3", "-m", "pip", "install", *what])


class EngineError(FgMujocoError, RuntimeError):
    """A part of the machinery that fails: MuJoCo's engine, or a cluster that cannot be reached or lost what it had."""
