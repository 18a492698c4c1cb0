"""A stub of ROS 1's dynamic_reconfigure: parameters that a `.cfg` file of the node's package describes.

    gen.add("speed", double_t, 0, "of the car", 1.5, 0.0, 8.0)   # in cfg/Control.cfg
    Server(ControlConfig, callback)                              # calls callback(config, -1) once
    Client("control").update_configuration({"speed": 2.0})       # in another node: calls it once more

The file is read, and not executed. Nobody moves the sliders here: a value is the one that is given as a parameter of
the node, else the default, until a Client of the same launch file changes it.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from fg_mujoco.errors import ControllerError, accepted_names

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


class _Reconfigure:
    """The service of dynamic_reconfigure: changes of parameters, and all of them as they are then."""

    class Request:
        def __init__(self, changes: Mapping[str, Any]) -> None:
            self.changes = changes

    class Response:
        def __init__(self, config: Config) -> None:
            self.config = config


def configurations(folders: Iterable[Path]) -> dict[str, Any]:
    """Return the members of a package's module `cfg`: `ControlConfig` of `Control.cfg`, with its `defaults`."""
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
            self.callback, self.type = callback, type
            self.config = Config({name: rospy.get_param(f"~{name}", value) for name, value in type.defaults.items()})
            self.update_configuration({})
            name = f"{rospy.get_name()}/{namespace}".rstrip("/")
            rospy.Service(f"{name}/set_parameters", _Reconfigure, self._answer)

        def update_configuration(self, changes: Mapping[str, Any]) -> Config:
            self.config = self.callback(Config({**self.config, **changes}), _ALL)
            return self.config

        def _answer(self, request: _Reconfigure.Request) -> _Reconfigure.Response:
            if request.changes:
                unknown = [name for name in request.changes if name not in self.config]
                if unknown:
                    raise ValueError(f"don't know parameter: {unknown[0]}; {accepted_names(unknown[0], self.config)}")
                self.update_configuration(request.changes)
            return _Reconfigure.Response(Config(self.config))

    return Server


def client_of(rospy: ModuleType) -> type:
    """Return the class `Client` of dynamic_reconfigure for one node, with its rospy.

    It changes the parameters of a Server of the same launch file; nobody else's are here.
    """

    class Client:
        def __init__(
            self, name: str, timeout: float | None = None, config_callback: Any = None, description_callback: Any = None
        ) -> None:
            self.name, self.config_callback = rospy.resolve_name(name), config_callback
            self._service = f"{self.name}/set_parameters"
            rospy.wait_for_service(self._service, timeout)
            self.config = self.update_configuration({})

        def get_configuration(self, timeout: float | None = None) -> Config:
            return self.update_configuration({})

        def update_configuration(self, changes: Mapping[str, Any]) -> Config:
            found = rospy.ServiceProxy(self._service, _Reconfigure)(_Reconfigure.Request(dict(changes)))
            self.config = found.config
            if changes and self.config_callback is not None:
                self.config_callback(self.config)
            return self.config

        def set_config_callback(self, value: Any) -> None:
            self.config_callback = value

        def get_parameter_descriptions(self, timeout: float | None = None) -> list[dict[str, Any]]:
            rows = self.config.items()
            return [{"name": name, "type": type(value).__name__, "default": value} for name, value in rows]

        def close(self) -> None:
            pass

    return Client
