"""Describes a planner: the package, file and hash that it comes from, its summary and its settings."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import lru_cache
from importlib.metadata import packages_distributions, version
from typing import Any, Literal, get_args, get_origin, get_type_hints

from ..messages import Controller
from .planner_sources import PLANNERS, READ, find_controller, source_file
from .planner_texts import file_in


def origin(source: str | Controller, found: Any = None) -> dict[str, str | None]:
    """Return the package, file and hash of a controller, for the manifest of a run.

    Args:
      source: as of `make_controller`.
      found: its class, if it is loaded already.

    Returns:
      distribution: the installed package that it is of; None for a file or object of the user's.
      version: of that package.
      file: the file that its class is defined in; None where there is none.
      sha256: of the contents of that file.

    Raises:
      ControllerError: an unknown name, or a file or class that cannot be loaded.
    """
    if found is None:
        found = find_controller(source) if isinstance(source, str) else type(source)
    text = source_code(found)
    place = source_file(found)
    distribution = _distribution_of(found, source)
    return {
        "distribution": distribution,
        "version": None if distribution is None else version(distribution),
        "file": None if place is None else str(place),
        "sha256": None if text is None else hashlib.sha256(text).hexdigest(),
    }


def source_code(found: Any) -> bytes | None:
    """Return the contents of the file that a controller's class is defined in; None where there is no such file.

    Of a class that `find_controller` read from a file these are the contents that it read.
    """
    module = sys.modules.get(getattr(found, "__module__", ""))
    read: bytes | None = getattr(module, READ, None)
    place = source_file(found)
    if read is None and place is not None and place.is_file():
        read = place.read_bytes()
    return read


def describe(name: str) -> dict[str, Any]:
    """Return a controller's summary, in one line, and its settings, for tables.

    Returns:
      name, summary, distribution and settings; of each setting its name, unit, default, text, and what is accepted. The
      default of a setting of the car is that of the F1TENTH car, and `scales` says that it is scaled to other cars.

    Raises:
      ControllerError: an unknown name, or a file or class that cannot be loaded.
    """
    found = find_controller(name)
    module = sys.modules.get(found.__module__)
    lines = (getattr(module, "__doc__", None) or found.__doc__ or "").strip().splitlines()
    kind = getattr(found, "Settings", None)
    return {
        "name": name,
        "summary": lines[0] if lines else "",
        "distribution": _distribution_of(found, name),
        "settings": describe_settings(kind) if isinstance(kind, type) and is_dataclass(kind) else [],
    }


def describe_settings(kind: type) -> list[dict[str, Any]]:
    """Return name, unit, default, text, accepted and scales of the fields of a settings dataclass, in their order."""
    hints, rows = get_type_hints(kind), []
    for each in fields(kind):
        said, hint = each.metadata, hints.get(each.name)
        accepted = getattr(said.get("accepted"), "text", "")
        if get_origin(hint) is Literal:
            accepted = ", ".join(get_args(hint))
        rows.append(
            {
                "name": each.name, "unit": said.get("unit", ""), "default": said.get("of_f1tenth", each.default),
                "text": said.get("text", ""), "accepted": accepted, "scales": "of_f1tenth" in said,
            }
        )  # fmt: skip
    return rows


def _distribution_of(found: Any, source: str | Controller) -> str | None:
    """Return the name of the installed package of a class; None where it is of none."""
    if isinstance(source, str) and source not in PLANNERS and file_in(source) is None:
        point = PLANNERS.entry_point(source)
        return point.dist.name if point.dist is not None else None
    package = str(getattr(found, "__module__", "")).partition(".")[0]
    if package == "fg_mujoco":
        return "fg-mujoco"
    if package in ("", "__main__") or getattr(sys.modules.get(package), "__spec__", None) is None:
        return None  # no module that was found by the import system, such as a user's file
    return next(iter(_distributions().get(package, ())), None)


@lru_cache(maxsize=1)  # it looks through all that is installed
def _distributions() -> Mapping[str, Sequence[str]]:
    return packages_distributions()
