"""Launch files of ROS 2, in Python, XML or YAML: the nodes that they start, their parameters, topics and arguments.

Those in Python are executed, with the stubs of `launch_objects`; `launch_frontends` reads the others. A node is one of
a package of the same workspace, in Python; others, such as RViz, a driver or the simulator, are left out, and a warning
names them.
"""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fg_mujoco.course.maps.map_server import plain_yaml
from fg_mujoco.errors import ControllerError, accepted_names
from fg_mujoco.simulation.planner_failure import one_line

from .graph import Graph
from .launch_frontends import read_entities
from .launch_objects import Context, Lacking, LaunchImports, Made, executed, refusal
from .ros_parameters import flat, read_ros_arguments
from .source import data_file
from .workspace import executable, is_launch_file, packages

_DEEPEST = 10  # launch files that include each other
_SIMULATORS = ("f1tenth_gym_ros", "f1tenth_simulator", "autodrive_f1tenth", "autodrive_roboracer")
"""Packages of simulators, whose nodes this simulator replaces."""
_NODES = ("Node", "LifecycleNode")
_INCLUDES = ("IncludeLaunchDescription",)
_GROUPS = ("LaunchDescription", "GroupAction", "TimerAction", "RosTimer", "RegisterEventHandler", "OpaqueCoroutine")
_HANDLERS = ("OnProcessStart", "OnExecutionComplete")
_WITHOUT_NODES = (
    "LogInfo", "EmitEvent", "Shutdown", "AppendEnvironmentVariable", "SetUseSimTime",
    "UnsetEnvironmentVariable", "UnsetLaunchConfiguration",
)  # fmt: skip
_SAME_TEXT = (
    "TextSubstitution", "ParameterValue", "ParameterFile", "PathSubstitution", "BooleanSubstitution", "AnonName",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Launched:
    """One node that a launch file starts."""

    path: Path
    entry: str  # function that is its entry point; empty: the file is run
    name: str | None
    namespace: str
    parameters: Mapping[str, Any]
    parameter_files: tuple[Path, ...]
    remap: Mapping[str, str]
    arguments: tuple[str, ...]
    environment: Mapping[str, str]  # variables that differ from those of this process


@dataclass
class LaunchFiles:
    """The launch files that one includes, all `read`, and the `nodes` that they start, in their order."""

    first: Path
    said: str
    configurations: dict[str, str]
    graph: Graph
    nodes: list[Launched] = field(default_factory=list)
    read: dict[Path, None] = field(default_factory=dict)
    declared: set[str] = field(default_factory=set)
    left_out: list[str] = field(default_factory=list)
    _known: dict[str, Path] = field(default_factory=dict)
    _everywhere: dict[str, Any] = field(default_factory=dict)  # parameters of all nodes
    _namespaces: list[str] = field(default_factory=list)
    _remaps: list[tuple[str, str]] = field(default_factory=list)
    _files: list[Path] = field(default_factory=list)  # parameters of all nodes
    _environment: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._known = packages(self.first)
        self._context = Context(self._text)
        self._imports = LaunchImports(self.first.resolve(), self.graph, self._known.get, self._context)

    def include(self, path: Path, depth: int = 0) -> None:
        """Execute a launch file, and take what it starts; ControllerError: it fails, or lacks what a node needs."""
        if depth > _DEEPEST:
            raise ControllerError(f"{self.said}: launch files include each other more than {_DEEPEST} deep ({path})")
        path = path.resolve()
        self.read[path] = None
        try:
            python = path.suffix == ".py"
            self._take(executed(path, self._imports) if python else read_entities(path, self._context), depth)
        except ControllerError as error:
            if str(error).startswith(self.said):
                raise
            raise ControllerError(f"{self.said}: {error}{self.graph.place_of_error(error)}") from error
        except Exception as error:  # whatever it raises, arguments that an action of launch does not take among it
            said = one_line(error)
            place = self.graph.place_of_error(error) or f" ({path})"
            raise ControllerError(f"{self.said}: the launch file has failed: {said}{place}") from error

    # Actions

    def _take(self, action: Any, depth: int) -> None:
        if isinstance(action, (list, tuple)):
            for each in action:
                self._take(each, depth)
        elif isinstance(action, Lacking):
            self.left_out.append(action.text)
        if not isinstance(action, Made) or not self._applies(action):
            return
        place = f" ({action.file}, line {action.line})"
        if action.kind in _NODES:
            self._node(action, place)
        elif action.kind == "DeclareLaunchArgument":
            self._declare(action, place)
        elif action.kind in _INCLUDES:
            self._include(action, place, depth)
        elif action.kind == "SetLaunchConfiguration":
            name, value = (*action.values, *action.named.values())[:2]
            self.configurations[self._text(name)] = self._text(value)
        elif action.kind == "SetParameter":
            name = action.named.get("name", action.values[0] if action.values else "")
            value = action.named.get("value", action.values[-1] if action.values else None)
            self._everywhere[self._text(name)] = self._parameter(value)
        elif action.kind == "SetParametersFromFile":
            self._files += self._parameter_file((*action.values, *action.named.values())[0], place)
        elif action.kind == "SetEnvironmentVariable":
            name, value = (*action.values, *action.named.values())[:2]
            self._environment[self._text(name)] = self._text(value)
        elif action.kind == "PushRosNamespace":
            self._namespaces.append(self._text((*action.values, *action.named.values())[0]).strip("/"))
        elif action.kind == "SetRemap":
            source, target = (*action.values, *action.named.values())[:2]
            self._remaps.append((self._text(source), self._text(target)))
        elif action.kind == "OpaqueFunction":
            function: Any = action.named.get("function", action.values[0] if action.values else None)
            values, named = action.named.get("args") or (), action.named.get("kwargs") or {}
            self._context.launch_configurations = self.configurations
            self._take(function(self._context, *values, **named), depth)
        elif action.kind in _GROUPS:
            kept = (self.configurations.copy(), self._everywhere.copy(), self._namespaces.copy(), self._remaps.copy(),
                    self._files.copy(), self._environment.copy())  # fmt: skip
            for each in (*action.values, action.named.get("initial_entities"), action.named.get("actions")):
                self._take(each, depth)
            handler = action.named.get("event_handler", action.values[0] if action.values else None)
            if isinstance(handler, Made) and handler.kind in _HANDLERS:
                for name in ("on_start", "on_completion"):
                    self._take(handler.named.get(name), depth)
            if action.kind == "GroupAction" and self._truth(action.named.get("scoped", True), "scoped", place):
                (self.configurations, self._everywhere, self._namespaces, self._remaps, self._files,
                 self._environment) = kept  # fmt: skip
        elif action.kind not in _WITHOUT_NODES:
            self.left_out.append(f"{action.kind}{place}")

    def _applies(self, action: Made) -> bool:
        condition = action.named.get("condition")
        if condition is None:
            return True
        place = f" ({action.file}, line {action.line})"
        if not isinstance(condition, Made):
            self._refuse(condition, place)
            return True
        values = [*condition.values, *condition.named.values()]
        if condition.kind in ("IfCondition", "UnlessCondition"):
            holds = self._truth(values[0] if values else "", "a condition", place)
            return holds is (condition.kind == "IfCondition")
        if condition.kind in ("LaunchConfigurationEquals", "LaunchConfigurationNotEquals") and len(values) == 2:
            same = self.configurations.get(self._text(values[0])) == self._text(values[1])
            return same is (condition.kind == "LaunchConfigurationEquals")
        raise ControllerError(
            f"{self.said}: the condition {condition.kind} is not understood{place}; accepted: IfCondition, "
            "UnlessCondition, LaunchConfigurationEquals, LaunchConfigurationNotEquals"
        )

    def _truth(self, value: Any, said: str, place: str) -> bool:
        text = self._text(value).strip().lower()
        if text not in ("true", "1", "false", "0"):
            raise ControllerError(f"{self.said}: {said} is {text!r}{place}; accepted: true, false, 1, 0")
        return text in ("true", "1")

    def _declare(self, action: Made, place: str) -> None:
        name = self._text(action.named.get("name", action.values[0] if action.values else ""))
        self.declared.add(name)
        if name in self.configurations:
            choices = action.named.get("choices")
            if isinstance(choices, list) and self.configurations[name] not in choices:
                raise ControllerError(
                    f"{self.said}: launch.{name} is {self.configurations[name]!r}{place}; accepted: "
                    f"{', '.join(map(str, choices))}"
                )
            return
        default = action.named.get("default_value", action.values[1] if len(action.values) > 1 else None)
        if default is None:
            raise ControllerError(
                f"{self.said}: the launch argument {name!r} has no default{place}; accepted: [launch.{name}=VALUE]"
            )
        self.configurations[name] = "" if isinstance(default, Lacking) else self._text(default)

    def _include(self, action: Made, place: str, depth: int) -> None:
        source = action.named.get("launch_description_source", action.values[0] if action.values else None)
        inner = source
        if isinstance(source, Made) and source.kind.endswith("LaunchDescriptionSource"):
            inner = (*source.values, *source.named.values())[0]
        if isinstance(inner, Lacking):
            self.left_out.append(f"an included launch file: {inner.text}{place}")
            return
        path = Path(self._text(inner))
        if not path.is_file():
            self.left_out.append(f"the included launch file {path}, which is not here{place}")
            return
        if not is_launch_file(path):
            self.left_out.append(f"the included file {path}, which is no launch file of ROS 2{place}")
            return
        if any(name in path.parts for name in _SIMULATORS):
            self.left_out.append(f"the launch file of the simulator {path.name}{place}")
            return
        given = action.named.get("launch_arguments") or []
        self._refuse(given, place)
        rows = given.items() if isinstance(given, dict) else given
        for row in rows:
            if isinstance(row, (list, tuple)) and len(row) == 2:
                self._refuse(row[1], place)
                self.configurations[self._text(row[0])] = self._text(row[1])
        self.include(path, depth + 1)

    def _node(self, action: Made, place: str) -> None:
        named = {**dict(zip(("executable", "package"), action.values, strict=False)), **action.named}
        for name in ("package", "executable", "node_executable", "name", "namespace"):
            self._refuse(named.get(name), place)
        package = self._text(named.get("package") or "")
        said = self._text(named.get("executable") or named.get("node_executable") or "")
        folder = self._known.get(package)
        if folder is None or package in _SIMULATORS:
            why = "which this simulator replaces" if package in _SIMULATORS else "whose package is not here"
            self.left_out.append(f"{said or 'a node'} of {package or 'no package'}, {why}{place}")
            return
        found = executable(folder, said)
        if found is None:
            self.left_out.append(f"{said} of {package}, of which there is no Python file{place}")
            return
        parameters, files = dict(self._everywhere), list(self._files)
        rows = named.get("parameters", ())
        self._refuse(rows, place)
        for row in rows if isinstance(rows, (list, tuple)) else [rows or {}]:
            self._refuse(row, place)
            if isinstance(row, dict):
                for name, value in flat({self._text(key): value for key, value in row.items()}).items():
                    self._refuse(value, place)
                    parameters[name] = self._parameter(value)
            else:
                files += self._parameter_file(row, place)
        remap = dict(self._remaps)
        rows = named.get("remappings", ())
        self._refuse(rows, place)
        for row in rows or ():
            if not isinstance(row, (list, tuple)) or len(row) != 2:
                raise ControllerError(f"{self.said}: a remapping is {row!r}{place}; accepted: (from, to)")
            for each in row:
                self._refuse(each, place)
            remap[self._text(row[0])] = self._text(row[1])
        own = dict(named.get("additional_env") or named.get("env") or {})
        environment = {**self._environment, **{self._text(key): self._text(value) for key, value in own.items()}}
        given = named.get("arguments", ())
        self._refuse(given, place)
        arguments = [self._text(each) for each in given or () if not isinstance(each, Lacking)]
        called = self._text(named["name"]) if named.get("name") else None
        given = read_ros_arguments(arguments, called, self.said)
        namespace = "/".join(each for each in (*self._namespaces, self._text(named.get("namespace") or "")) if each)
        self.nodes.append(
            Launched(
                path=found[0], entry=found[1], name=given.name or called,
                namespace=(given.namespace or namespace).strip("/"), parameters={**parameters, **given.parameters},
                parameter_files=(*files, *given.files), remap={**remap, **given.remap}, arguments=given.plain,
                environment=environment,
            )
        )  # fmt: skip

    # Values

    def _parameter_file(self, value: Any, place: str) -> list[Path]:
        """Return a file of parameters, alone; as in ROS one that is not there gives a warning, and is left out."""
        allowed = isinstance(value, Made) and value.kind == "ParameterFile" and value.named.get("allow_substs", False)
        if isinstance(value, Made) and value.kind == "ParameterFile":
            value = (*value.values, *value.named.values())[0]
        path = Path(self._text(value))
        found = path if path.is_file() else data_file(str(path), self.first)
        if found is None:
            self.left_out.append(f"the parameters of {path}, which is no file{place}")
            return []
        if found != path:
            warnings.warn(f"{path} is not there; {found} is taken{place}", stacklevel=2)
        if self._truth(allowed, "allow_substs", place) and b"$(" in found.read_bytes():
            raise ControllerError(f"{self.said}: {found} has substitutions{place}; accepted: values")
        return [found]

    def _parameter(self, value: Any) -> Any:
        """Return the value of a parameter: a substitution's text is read as YAML, as launch_ros does."""
        if isinstance(value, Made) and value.kind in ("ParameterValue", "ParameterFile"):
            inner, kind = (*value.values, *value.named.values())[0], value.named.get("value_type")
            text = self._text(inner)
            return text if kind is str else kind(self._read(text)) if kind in (float, int, bool) else self._read(text)
        if isinstance(value, Made) and value.kind == "ParameterList":
            return [self._parameter(each) for each in value.values[0]]
        if isinstance(value, Made):
            return self._read(self._text(value))
        if isinstance(value, (list, tuple)):
            parts = [self._parameter(each) for each in value]
            return "".join(map(str, parts)) if any(isinstance(each, Made) for each in value) else parts
        return str(value) if isinstance(value, Path) else value

    def _read(self, text: str) -> Any:
        try:
            return plain_yaml(text)
        except Exception:  # YAML's own
            return text

    def _text(self, value: Any) -> str:
        """Return the text of a substitution, or of several behind each other."""
        if isinstance(value, (list, tuple)):
            return "".join(self._text(each) for each in value)
        self._refuse(value)
        if value is None or isinstance(value, (str, int, float, Path)):
            return "" if value is None else str(value)
        if not isinstance(value, Made):
            raise ControllerError(
                f"{self.said}: {self.first}: {value!r} is no text; accepted: a text or a substitution"
            )
        values = [*value.values, *value.named.values()]
        first = values[0] if values else ""
        place = f" ({value.file}, line {value.line})"
        if value.kind == "LaunchConfiguration":
            name = self._text(first)
            if name in self.configurations:
                return self.configurations[name]
            if "default" in value.named or len(value.values) > 1:
                return self._text(value.named.get("default", value.values[-1]))
            known = accepted_names(name, sorted(self.declared))
            raise ControllerError(f"{self.said}: the launch argument {name!r} is not declared{place}; {known}")
        if value.kind == "PathJoinSubstitution":
            return os.path.join(*(self._text(each) for each in first)) if first else ""
        if value.kind in ("FindPackageShare", "FindPackagePrefix"):
            found = self._known.get(self._text(first))
            return f"/{self._text(first)} is not here" if found is None else str(found)
        if value.kind == "PythonExpression":
            text = self._text(first)
            try:
                return str(eval(text, {**vars(math), "math": math, "true": True, "false": False}))
            except Exception as error:
                said = f"PythonExpression {text!r} has failed: {one_line(error)}"
                raise ControllerError(f"{self.said}: {said}{place}") from error
        if value.kind in ("EnvironmentVariable", "OptionalEnvironmentVariable"):
            default = value.named.get("default_value", value.values[1] if len(value.values) > 1 else "")
            return {**os.environ, **self._environment}.get(self._text(first), self._text(default))
        if value.kind in ("ThisLaunchFileDir", "ThisLaunchFile"):
            return str(value.file.resolve() if value.kind == "ThisLaunchFile" else value.file.resolve().parent)
        if value.kind in ("EqualsSubstitution", "NotEqualsSubstitution"):
            return str((self._text(values[0]) == self._text(values[1])) is (value.kind[0] == "E")).lower()
        if value.kind in ("AndSubstitution", "AllSubstitution", "OrSubstitution", "AnySubstitution"):
            truths = [self._text(each).lower() in ("true", "1") for each in values]
            return str(all(truths) if value.kind[:3] in ("And", "All") else any(truths)).lower()
        if value.kind == "NotSubstitution":
            return str(self._text(first).lower() not in ("true", "1")).lower()
        if value.kind == "IfElseSubstitution":
            chosen = "if_value" if self._text(first).strip().lower() in ("true", "1") else "else_value"
            parts = dict(zip(("if_value", "else_value"), value.values[1:], strict=False))
            return self._text({**parts, **value.named}.get(chosen, ""))
        if value.kind in _SAME_TEXT or value.kind.endswith("Source"):
            return self._text(first)
        raise ControllerError(
            f"{self.said}: {value.kind} is not understood{place}; accepted: LaunchConfiguration, PathJoinSubstitution, "
            "FindPackageShare, TextSubstitution, PythonExpression, EnvironmentVariable, ThisLaunchFileDir"
        )

    def _refuse(self, value: Any, place: str = "") -> None:
        if isinstance(value, Lacking):
            raise ControllerError(f"{self.said}: {refusal(value, place)}")


def launched(path: Path, given: Mapping[str, Any], said: str, graph: Graph) -> LaunchFiles:
    """Execute a launch file in a thread of a graph, whose limit of wall time holds, and return what it starts.

    `given` are launch arguments by name; the graph is closed at the end. Raises ControllerError: it fails, starts no
    node that is here, has no such argument, or a node depends on what is not here; NodeBlockedError: it does not come
    to its end.
    """
    found = LaunchFiles(path, said, {name: _as_text(value) for name, value in given.items()}, graph)
    graph.start(path.name, lambda: found.include(path))
    try:
        graph.settle()
    finally:
        graph.close()
    for name in given:
        if name not in found.declared:
            known = accepted_names(name, sorted(found.declared))
            raise ControllerError(f"{said}: {path} has no launch argument {name!r}; {known}")
    left = "; ".join(found.left_out)
    if not found.nodes:
        raise ControllerError(
            f"{said}: {path} starts no node that is here{': left out are ' + left if left else ''}; accepted: nodes in "
            "Python of a package of the same workspace, which has a package.xml"
        )
    if left:
        warnings.warn(f"{path}: left out are {left}", stacklevel=2)
    return found


def _as_text(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
