"""The command `fg-mujoco controllers`: which planners there are, and their settings."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable
from typing import Any

from ..racing.planner_origin import describe
from ..racing.planner_sources import controller_names

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
