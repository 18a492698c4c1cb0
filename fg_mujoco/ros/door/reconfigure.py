"""Stands in for ROS 1's dynamic_reconfigure: parameters that a `.cfg` file of the node's package describes.

    gen.add("speed", double_t, 0, "of the car", 1.5, 0.0, 8.0)   # in cfg/Control.cfg
    Server(ControlConfig, callback)                              # calls callback(config, -1) once

The file is read, and not executed. Nobody moves the sliders here: a value is the one that is given as a parameter of
the node, else the default.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from ...errors import ControllerError

_EMPTY: Mapping[str, Any] = {"double_t": 0.0, "int_t": 0, "bool_t": False, "str_t": ""}
_DEFAULT = 4  # place of the default among the arguments of `add`
_ALL = -1  # level of the first call: everything has changed


class Config(dict[str, Any]):
    """Values by name, as items and as attributes."""

    def __getattr__(self, name: str) -> Any:
        if name in self:
            return self[name]
        raise AttributeError(f"the configuration has no {name!r}; accepted: {', '.join(self)}")

    def __setattr__(self, name: str, value: Any) -> None:
        self[name] = value


def configurations(folders: Iterable[Path]) -> dict[str, Any]:
    """Return what a package's module `cfg` has: `ControlConfig` of `Control.cfg`, with its `defaults`."""
    return {
        f"{file.stem}Config": type(f"{file.stem}Config", (), {"defaults": _defaults(file)})
        for folder in folders
        for file in sorted(folder.glob("*.cfg"))
    }


def _defaults(file: Path) -> dict[str, Any]:
    """Return the defaults of the parameters of a file.

    Raises:
      ControllerError: it cannot be read, or a default is no plain value.
    """
    try:
        tree = ast.parse(file.read_bytes(), str(file))
    except (OSError, SyntaxError, ValueError) as error:
        raise ControllerError(f"{file} cannot be read: {error}") from error
    found: dict[str, Any] = {}
    for call in ast.walk(tree):
        if not (isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute) and call.func.attr == "add"):
            continue
        kind = getattr(call.args[1], "id", "") if len(call.args) > 1 else ""
        if kind not in _EMPTY or not isinstance(call.args[0], ast.Constant):
            continue
        named = [each.value for each in call.keywords if each.arg == "default"]
        given = [*call.args[_DEFAULT : _DEFAULT + 1], *named]
        try:
            value = ast.literal_eval(given[0]) if given else None
        except ValueError:
            raise ControllerError(
                f"the default of {call.args[0].value!r} is {ast.unparse(given[0])} ({file}, line {call.lineno}); "
                "accepted: a plain value"
            ) from None
        empty = _EMPTY[kind]
        found[str(call.args[0].value)] = empty if value is None else type(empty)(value)
    return found


def server_of(rospy: ModuleType) -> type:
    """Return the class `Server` of dynamic_reconfigure for one node, with its rospy."""

    class Server:
        def __init__(self, type: Any, callback: Callable[..., Any], namespace: str = "") -> None:
            self.callback = callback
            self.config = Config({name: rospy.get_param(f"~{name}", value) for name, value in type.defaults.items()})
            self.update_configuration({})

        def update_configuration(self, changes: Mapping[str, Any]) -> Config:
            self.config = self.callback(Config({**self.config, **changes}), _ALL)
            return self.config

    return Server
