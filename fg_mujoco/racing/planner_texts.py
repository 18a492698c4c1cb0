"""The texts that name planners: `gap_finder`, `path/to/file.py:ClassName`, `ros:path/to/node.py`, `policy.onnx`.

A scheme is a kind of planners that are no Python classes in a file: nodes of ROS, whose texts begin with `ros:`, and
trained policies, whose texts are the path of a file that ends in one of POLICY_ENDINGS, or of a folder with such a
file `policy.json`.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from fg_mujoco.controllers import CONTROLLERS

from ..course.files import is_file
from ..errors import ControllerError
from ..registry import Registry, added


@dataclass(frozen=True, kw_only=True)
class PlannerScheme:
    """Functions of a room that has planners of a scheme, by their texts."""

    find: Callable[[str], type]  # returns a class of planners
    code: Callable[[str], bytes]  # returns the code that the text names, unexecuted


SCHEMES: Registry[PlannerScheme] = Registry("scheme", ControllerError, own=added("SCHEMES"))
"""Upper rooms have the planners of schemes; `fg_mujoco/__init__.py`, which is above all rooms, registers them here."""

POLICY = "policy"
"""The scheme of trained policies, the only one whose texts do not begin with its name."""

POLICY_ENDINGS = (".json", ".onnx", ".zip")
POLICY_FILE = "policy.json"
"""File of a policy's folder."""

_NAME = re.compile(r":\w*$")  # behind the path in the text of a scheme


def scheme_of(source: str) -> str:
    """Return the scheme of a controller's text, such as "ros"; an empty text where it has none."""
    scheme, colon, _ = source.partition(":")
    if colon and scheme in SCHEMES and scheme != POLICY:
        return scheme
    folder = source not in CONTROLLERS and is_file(Path(source) / POLICY_FILE)
    return POLICY if folder or source.endswith(POLICY_ENDINGS) else ""


def file_in(source: str) -> Path | None:
    """Return the file that a controller's text names: of a class, a node, a launch file or a policy; None: a name."""
    scheme = scheme_of(source)
    if scheme == POLICY:
        return Path(source) if source.endswith(POLICY_ENDINGS) else Path(source) / POLICY_FILE
    if scheme:
        return Path(_NAME.sub("", source.removeprefix(f"{scheme}:")))
    path = source if source.endswith(".py") else source.rpartition(":")[0]
    return Path(path) if path.endswith(".py") else None


def code_of(source: str) -> bytes | None:
    """Return the code that a controller's text names, unexecuted; of a launch file that of all its nodes.

    None: it is a name.

    Raises:
      ControllerError, OSError: it cannot be read.
    """
    path, scheme = file_in(source), scheme_of(source)
    if path is None:
        return None
    return SCHEMES.find(scheme).code(source) if scheme else path.read_bytes()


def moved_to(source: str, path: str | Path) -> str:
    """Return a controller's text with the same file in another place."""
    scheme = scheme_of(source)
    if scheme == POLICY:
        return str(path)
    if scheme:
        name = _NAME.search(source.removeprefix(f"{scheme}:"))
        return f"{scheme}:{path}{name.group() if name else ''}"
    return str(path) if source.endswith(".py") else f"{path}:{source.rpartition(':')[2]}"
