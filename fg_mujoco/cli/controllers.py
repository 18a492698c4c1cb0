"""The command `fg-mujoco controllers`: which planners there are, and their settings."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Any, Literal, get_args, get_origin, get_type_hints

from ..racing.planners import controller_names, find_controller
from ..racing.trust import distribution

_TEXT_COLUMN = 46


def add_controllers(add_command: Callable[..., argparse.ArgumentParser], commands: Any) -> None:
    """Add the command; `add_command` is the one that adds the others."""
    add = add_command(commands, "controllers", _controllers, "list the controllers and their settings").add_argument
    add("names", metavar="NAME", nargs="*", help="of a controller, or path/to/file.py:ClassName; default: all")
    add("--json", action="store_true", help="print one JSON array and nothing else")


def _controllers(options: argparse.Namespace) -> int:
    described = [describe(name) for name in options.names or controller_names()]
    if options.json:
        print(json.dumps(described, indent=2, default=str))
    else:
        print("\n\n".join(_table(each) for each in described))
    return 0


def describe(name: str) -> dict[str, Any]:
    """Return a controller's summary, in one line, and its settings, for tables.

    Returns:
      name, summary, distribution and settings; of each setting its name, unit, default, text, and what is accepted. The
      default of a setting of the car is that of the F1TENTH car, and `scales` says that it is scaled to other cars.

    Raises:
      ControllerError: an unknown name, or a file or class that cannot be loaded.
    """
    found = find_controller(name)
    module, kind = sys.modules.get(found.__module__), getattr(found, "Settings", None)
    lines = (getattr(module, "__doc__", None) or found.__doc__ or "").strip().splitlines()
    return {
        "name": name,
        "summary": lines[0] if lines else "",
        "distribution": distribution(found, name),
        "settings": describe_settings(kind) if isinstance(kind, type) and is_dataclass(kind) else [],
    }


def describe_settings(kind: type) -> list[dict[str, Any]]:
    """Return name, unit, default, text, accepted and scales of the fields of a settings dataclass, in their order."""
    hints, rows = get_type_hints(kind), []
    for each in fields(kind):
        hint, of_field = hints.get(each.name), each.metadata
        accepted = getattr(of_field.get("accepted"), "text", "")
        if get_origin(hint) is Literal:
            accepted = ", ".join(get_args(hint))
        rows.append(
            {
                "name": each.name, "unit": of_field.get("unit", ""),
                "default": of_field.get("of_f1tenth", each.default), "text": of_field.get("text", ""),
                "accepted": accepted, "scales": "of_f1tenth" in of_field,
            }
        )  # fmt: skip
    return rows


def _table(described: dict[str, Any]) -> str:
    package = described["distribution"]
    by = "" if package in ("fg-mujoco", None) else f" ({package})"
    lines = [f"{described['name']}{by}: {described['summary']}"]
    for each in described["settings"]:
        value = f"  {each['name']} = {_value(each['default'])} {each['unit']}".rstrip()
        notes = [each["text"], f"({each['accepted']})" if each["accepted"] else ""]
        if each["scales"]:
            notes.append("[F1TENTH car; scaled to others]")
        lines.append(f"{value:<{_TEXT_COLUMN}} {' '.join(filter(None, notes))}".rstrip())
    return "\n".join(lines)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and math.isfinite(value):
        return f"{value:.4g}"
    return str(value)
