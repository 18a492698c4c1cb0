"""Whether a planner that a recorded run names may be loaded: loading a planner runs the code in its file.

A bundled planner always may. Any other one may where the user says so, and its file is the one that was recorded.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..course.files import is_file
from ..errors import ControllerError
from .planner_loading import bundled_names, origin


def recorded_sha256(summary: Mapping[str, Any]) -> str | None:
    """Return the hash of the file of a run's planner, as its summary has it; None where it has none."""
    found = summary.get("controller_origin")
    sha256 = found.get("sha256") if isinstance(found, dict) else None
    return sha256 if isinstance(sha256, str) else None


def require_trusted(source: str, sha256: str | None, *, trust: bool, where: str) -> None:
    """Refuse a planner that a file names and that may not be loaded. Without `trust` nothing of it is imported.

    Args:
      source: a name, or `path/to/file.py:ClassName`, without settings.
      sha256: of the planner's file, as it was recorded.
      trust: whether the user trusts the code.
      where: the planner was named, for the message.

    Raises:
      ControllerError: it is not bundled, and it is not trusted, or its file is not the one that was recorded.
    """
    if source in bundled_names():
        return
    said = f"{where}: planner {source!r}"
    if not trust:
        raise ControllerError(
            f"{said} is not a bundled one, and loading it runs its code; accepted: --trust (in Python trust=True), if "
            "you know that code"
        )
    path, colon, _ = source.rpartition(":")
    if not colon:  # of an installed package, whose code the user has chosen
        found = origin(source)["sha256"] if sha256 is not None else None
    elif is_file(path):
        found = hashlib.sha256(Path(path).read_bytes()).hexdigest()
    else:
        raise ControllerError(f"{said}: there is no file {path}; accepted with --trust: the file as it was raced")
    if found != sha256 or (colon and sha256 is None):
        raise ControllerError(
            f"{said} has sha256 {str(found)[:12]}, recorded is {sha256 and sha256[:12]}; accepted with --trust: the "
            "file as it was raced"
        )
