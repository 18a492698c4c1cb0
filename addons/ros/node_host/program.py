"""Reads the file that `ros:` names, a node's or a launch file of several nodes; only `start_launch_file` executes any.

A launch file of ours is YAML with a list `nodes` of _KEYS, paths from its own folder: docs/addons/ros/nodes.md.
"""

from __future__ import annotations

import ast
import importlib.util
import re
import shlex
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fg_mujoco.course.maps.map_server import plain_yaml
from fg_mujoco.errors import ControllerError, accepted_names, missing_extra

from .graph import Graph
from .imports import read_node
from .launch_files import launched
from .ros_parameters import flat, read_parameters
from .source import own_files, parse
from .workspace import is_launch_file, may_start

SCHEME = "ros:"
_KEYS = ("file", "class", "name", "parameters", "params_file", "remap", "args")
_OF_PYTHON_2 = (
    "Missing parentheses in call to", "exception types must be parenthesized", "leading zeros in decimal integer",
)  # fmt: skip
"""Beginnings of Python's messages about the syntax of Python 2."""


@dataclass(frozen=True, kw_only=True)
class NodeFile:
    """One node of a program."""

    path: Path
    text: bytes = field(repr=False)
    class_name: str  # empty: it is run as a script
    is_script: bool  # whether it has a part for `__name__ == "__main__"`
    has_main: bool
    line: int  # of the class, or of `main`
    name: str | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)
    remap: Mapping[str, str] = field(default_factory=dict)
    arguments: tuple[str, ...] = ()
    entry: str = ""  # function that is called once the file is executed as a module; empty: as the lines above say
    namespace: str = ""
    environment: Mapping[str, str] = field(default_factory=dict)  # variables that differ from those of this process
    takes_all: bool = False  # whether parameters that it has not are passed over, as ROS does


@dataclass(frozen=True, kw_only=True)
class Program:
    """The nodes that are a planner together."""

    path: Path  # of the node, or of the launch file
    text: bytes = field(repr=False)  # of the file, of all that it names, and of their own modules
    nodes: tuple[NodeFile, ...]  # none of a launch file of ROS 2, which says them when it is executed
    files: frozenset[Path] = frozenset()  # of a launch file of ROS 2: whose text is in `text`

    @property
    def name(self) -> str:
        """The name of the planner."""
        return self.nodes[0].class_name or self.path.stem if len(self.nodes) == 1 else self.path.stem


def read_program(source: str) -> Program:
    """Return the program of `ros:` and node.py:ClassName, node.py, launch.yaml or name.launch.py; ControllerError."""
    said = f"controller {source!r}"
    rest = source.removeprefix(SCHEME)
    path, colon, class_name = rest.rpartition(":") if re.search(r":\w*$", rest) else (rest, "", "")
    if not colon and is_launch_file(Path(path)):
        return _read_launch_of_ros(Path(path))
    elif path.endswith((".yaml", ".yml")) and not colon:
        return _read_launch(Path(path), said)
    elif path.endswith(".py"):
        node = read_node_file(Path(path), class_name, said)
        return Program(path=Path(path), text=_with_modules(node), nodes=(node,))
    raise ControllerError(
        f"{said}; accepted: ros:path/node.py:ClassName, ros:path/node.py, ros:path/launch.yaml or a "
        "launch file of ROS 2: ros:path/name.launch.py, .xml or .yaml"
    )


def _read_launch_of_ros(path: Path) -> Program:
    files = may_start(path)
    text = b"".join(b"\n# " + each.name.encode() + b"\n" + each.read_bytes() for each in files)
    return Program(path=path, text=text, nodes=(), files=frozenset(files))


def start_launch_file(program: Program, given: Mapping[str, Any], said: str, graph: Graph) -> tuple[NodeFile, ...]:
    """Execute a launch file of ROS 2 with arguments, and return the nodes that it starts, or ControllerError."""
    found = launched(program.path, given, said, graph)
    for file in (*found.read, *(each.path.resolve() for each in found.nodes)):
        if file not in program.files:
            raise ControllerError(
                f"{said}: it starts {file}, of a package that no file of its own package names; accepted: a launch "
                "file in which the name of the package is written"
            )
    nodes = []
    for number, each in enumerate(found.nodes, start=1):
        parameters: dict[str, Any] = {}
        for parameter_file in each.parameter_files:
            node = f"{each.namespace}/{each.name or each.path.stem}"
            parameters.update(parameters_in(parameter_file, node, said))
            graph.data.add(str(parameter_file))
        try:
            nodes.append(
                read_node_file(
                    each.path, "", said, name=each.name, parameters={**parameters, **each.parameters},
                    remap=each.remap, arguments=each.arguments, entry=each.entry, namespace=each.namespace,
                    environment=each.environment, takes_all=True,
                )
            )  # fmt: skip
        except ControllerError as error:  # as in ROS the others drive on
            if number == len(found.nodes) and not nodes:
                raise
            warnings.warn(f"{error}; the other nodes drive on", stacklevel=2)
    return tuple(nodes)


def _with_modules(node: NodeFile) -> bytes:
    """Return the text of a node's file, and behind it that of the user's own modules that it imports."""
    own = own_files(node.path, node.text)
    return b"".join([node.text, *(b"\n# " + path.name.encode() + b"\n" + path.read_bytes() for path in own)])


def read_node_file(path: Path, class_name: str, said: str, **more: Any) -> NodeFile:
    """Return one node of a file; ControllerError: the file cannot be read, is no Python, or has no such class."""
    text = read_node(path, said)
    try:
        tree = parse(text, path)
    except (SyntaxError, ValueError) as error:
        line = getattr(error, "lineno", None)
        where = f" ({path}, line {line})" if line else f" ({path})"
        hint = "; it is Python 2" if any(each in str(error) for each in _OF_PYTHON_2) else ""
        raise ControllerError(f"{said} does not import: {getattr(error, 'msg', error)}{where}{hint}") from error
    classes = {each.name: each.lineno for each in tree.body if isinstance(each, ast.ClassDef)}
    if class_name and class_name not in classes and not _binds(tree, class_name):
        raise ControllerError(f"{said}: the file has no class {class_name!r}; {accepted_names(class_name, classes)}")
    mains = [each.lineno for each in tree.body if isinstance(each, ast.FunctionDef) and each.name == "main"]
    guards = [each.lineno for each in tree.body if isinstance(each, ast.If) and "__name__" in ast.dump(each.test)]
    line = classes.get(class_name, 1) if class_name else (mains or guards or [1])[0]
    return NodeFile(
        path=path, text=text, class_name=class_name, is_script=bool(guards), has_main=bool(mains), line=line, **more,
    )  # fmt: skip


def _binds(tree: ast.Module, name: str) -> bool:
    """Return whether a file imports a name."""
    imports = [each for each in tree.body if isinstance(each, (ast.Import, ast.ImportFrom))]
    return any(name in (each.asname, each.name) for statement in imports for each in statement.names)


def _read_launch(path: Path, said: str) -> Program:
    text = read_node(path, said)
    found = _yaml(path, text, said)
    rows = found.get("nodes") if isinstance(found, dict) else found
    if not isinstance(rows, list) or not rows or not all(isinstance(row, dict) for row in rows):
        raise ControllerError(f"{said}: {path} has no list of nodes; accepted: nodes: with a list of {{file: ...}}")
    nodes, parts = [], [text]
    for number, row in enumerate(rows, start=1):
        where = f"{said}: {path}, node {number}"
        for key in row:
            if key not in _KEYS:
                raise ControllerError(f"{where} has {key!r}; {accepted_names(str(key), _KEYS)}")
        if not isinstance(row.get("file"), str):
            raise ControllerError(f"{where} has no file; accepted: file: path/to/node.py")
        parameters, remap = row.get("parameters") or {}, row.get("remap") or {}
        if not isinstance(parameters, dict) or not isinstance(remap, dict):
            raise ControllerError(f"{where}: parameters and remap; accepted: {{name: value}}")
        if row.get("params_file"):
            file = path.parent / str(row["params_file"])
            parameters = {**parameters_in(file, str(row.get("name") or ""), where), **parameters}
            parts.append(b"\n# " + file.name.encode() + b"\n" + read_node(file, where))
        nodes.append(
            read_node_file(
                path.parent / row["file"], str(row.get("class") or ""), where, name=row.get("name"),
                parameters=flat(parameters), remap={str(key): str(value) for key, value in remap.items()},
                arguments=read_arguments(row.get("args"), where),
            )
        )  # fmt: skip
    parts += [b"\n# " + node.path.name.encode() + b"\n" + _with_modules(node) for node in nodes]
    return Program(path=path, text=b"".join(parts), nodes=tuple(nodes))


def parameters_in(path: Path, node: str, said: str) -> dict[str, Any]:
    """Return the parameters of a node in a file, see `read_parameters`; ControllerError: no file of parameters."""
    return read_parameters(path, read_node(path, said), node, said)


def read_arguments(given: Any, said: str) -> tuple[str, ...]:
    """Return a node's arguments, given as a shell takes them, or as a list; else ControllerError."""
    if given is None:
        return ()
    if isinstance(given, list) and not any(isinstance(each, (list, dict)) for each in given):
        return tuple(str(each) for each in given)
    try:
        if isinstance(given, (list, dict)):
            raise ValueError
        return tuple(shlex.split(str(given)))
    except ValueError:
        raise ControllerError(f"{said}: args are {given!r}; accepted: words, such as car_1 --fast") from None


def _yaml(path: Path, text: bytes, said: str) -> Any:
    if importlib.util.find_spec("yaml") is None:
        raise missing_extra(f"{path} needs PyYAML", "ros")
    try:
        return plain_yaml(text)
    except Exception as error:  # YAML's own, and whatever its values' readers raise
        raise ControllerError(f"{said}: {path} is no YAML: {' '.join(str(error).split())}") from error
