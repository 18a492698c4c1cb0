"""Launch files of ROS 2 in XML and YAML: their entities as the objects that a launch file in Python makes.

Source: the frontends of ROS 2 (launch, launch_xml, launch_yaml, launch_ros), entities and substitutions by their names.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.parsers import expat

from fg_mujoco.course.maps.map_server import plain_loader, plain_yaml
from fg_mujoco.errors import ControllerError, accepted_names

from .launch_objects import Context, Made, new_object

_PROCESS = (
    "output", "cwd", "respawn", "respawn_delay", "respawn_max_retries", "launch-prefix", "exec_name", "shell",
    "emulate_tty", "sigterm_timeout", "sigkill_timeout", "machine",
)  # fmt: skip
"""Attributes of a process that change nothing here."""
_NODE = {
    "exec": "executable", "pkg": "package", "name": "name", "namespace": "namespace",
    **dict.fromkeys(("args", "ros_args", *_PROCESS), ""),
}  # fmt: skip
_IN_NODE = ("param", "remap", "env")
_ACTIONS: dict[str, tuple[str, dict[str, str], int, tuple[str, ...]]] = {
    "launch": ("LaunchDescription", {"version": ""}, 0, ()),
    "group": ("GroupAction", {"scoped": "scoped"}, 0, ()),
    "timer": ("TimerAction", {"period": "period"}, 1, ()),
    "ros_timer": ("RosTimer", {"period": "period"}, 1, ()),
    "arg": ("DeclareLaunchArgument", {"name": "name", "default": "default_value", "description": ""}, 1, ("choice",)),
    "bool_arg": ("DeclareLaunchArgument", {"name": "name", "default": "default_value", "description": ""}, 1, ()),
    "let": ("SetLaunchConfiguration", {"name": "name", "value": "value"}, 2, ()),
    "keep": ("SetLaunchConfiguration", {"name": "name", "value": "value"}, 2, ()),
    "include": ("IncludeLaunchDescription", {"file": "launch_description_source"}, 1, ("arg", "let")),
    "node": ("Node", _NODE, 1, _IN_NODE),
    "lifecycle_node": ("LifecycleNode", _NODE, 1, _IN_NODE),
    "push_ros_namespace": ("PushRosNamespace", {"namespace": "namespace"}, 1, ()),
    "set_remap": ("SetRemap", {"from": "src", "to": "dst"}, 2, ()),
    "set_parameter": ("SetParameter", {"name": "name", "value": ""}, 2, ()),
    "set_parameters_from_file": ("SetParametersFromFile", {"filename": "filename"}, 1, ()),
    "set_env": ("SetEnvironmentVariable", {"name": "name", "value": "value"}, 2, ()),
}
"""Entity -> class of the object, its attributes with the names that the class gives them, how many of these it must
have, the first ones, and what may be within it."""
_PARAM = ("name", "value", "value-sep", "type")
_WITH_ACTIONS = ("launch", "group", "timer", "ros_timer")
_LEFT_OUT = (
    "executable", "node_container", "load_composable_node", "composable_node", "for", "for_each", "test",
    "push_launch_configurations", "pop_launch_configurations", "reset", "push_env", "pop_env", "reset_env",
)  # fmt: skip
"""Entities that are left out with a warning."""
_WITHOUT_NODES = {
    **dict.fromkeys(("log", "log_debug", "log_info", "log_warning", "log_error"), "LogInfo"), "shutdown": "Shutdown",
    "set_use_sim_time": "SetUseSimTime", "unset": "UnsetLaunchConfiguration", "unset_env": "UnsetEnvironmentVariable",
    "append_env": "AppendEnvironmentVariable",
}  # fmt: skip
_SUBSTITUTIONS = {
    "var": "LaunchConfiguration", "env": "EnvironmentVariable", "optenv": "OptionalEnvironmentVariable",
    "eval": "PythonExpression", "dirname": "ThisLaunchFileDir", "filename": "ThisLaunchFile",
    "find-pkg-share": "FindPackageShare", "find-pkg-prefix": "FindPackagePrefix", "path-join": "PathJoinSubstitution",
    "anon": "AnonName", "equals": "EqualsSubstitution", "not-equals": "NotEqualsSubstitution", "not": "NotSubstitution",
    "and": "AndSubstitution", "or": "OrSubstitution", "all": "AllSubstitution", "any": "AnySubstitution",
    "if": "IfElseSubstitution", "command": "Command", "find-exec": "FindExecutable", "param": "Parameter",
    "exec-in-pkg": "ExecutableInPackage", "file-content": "FileContent",
}  # fmt: skip
"""Command and those behind it are refused where a node that is here depends on them."""
_KINDS = {name: kind for kind in (str, int, float, bool) for name in (kind.__name__, f"list_of_{kind.__name__}")}
_NAME, _GAP = re.compile(r"[A-Za-z][\w-]*"), re.compile(" +")
_LINE = "__line__"  # of a mapping in YAML
_MARK = 0xE000  # a character for private use, and those behind it


@dataclass(frozen=True, kw_only=True)
class _Entity:
    """An element in XML, or a mapping of one key in YAML."""

    kind: str
    line: int
    attributes: Mapping[str, Any] = field(default_factory=dict)
    children: list[_Entity] = field(default_factory=list)


def read_entities(path: Path, context: Context) -> Made:
    """Return the launch description of a file in XML or YAML; ControllerError: what is not known, or the parser's."""
    root = _of_xml(path) if path.suffix == ".xml" else _of_yaml(path)
    if root.kind != "launch":
        raise ControllerError(f"{path} begins with {root.kind!r}; accepted: launch")
    return _Frontend(path, context).action(root)


def _of_xml(path: Path) -> _Entity:
    parser = expat.ParserCreate()
    open_: list[_Entity] = [_Entity(kind="", line=0)]

    def start(kind: str, attributes: dict[str, str]) -> None:
        entity = _Entity(kind=kind, line=parser.CurrentLineNumber, attributes=attributes)
        open_[-1].children.append(entity)
        open_.append(entity)

    parser.StartElementHandler, parser.EndElementHandler = start, lambda _: open_.pop()
    parser.Parse(path.read_bytes(), True)
    return open_[0].children[0]


def _of_yaml(path: Path) -> _Entity:
    class Loader(plain_loader()):  # type: ignore[misc]
        def construct_mapping(self, node: Any, deep: bool = False) -> dict[Any, Any]:
            return {**super().construct_mapping(node, deep=True), _LINE: node.start_mark.line + 1}

    def entity(each: Any) -> _Entity:
        names = [name for name in each if name != _LINE] if isinstance(each, dict) else []
        if len(names) != 1:
            raise ControllerError(f"{path}: {each!r} is no entity; accepted: one key, such as node: {{...}}")
        return made(names[0], each[names[0]], each[_LINE])

    def made(kind: str, body: Any, line: int) -> _Entity:
        if not isinstance(body, dict):
            return _Entity(kind=kind, line=line, children=[entity(each) for each in body or ()])
        inner = {name: value for name, value in body.items() if isinstance(value, list) and _are_mappings(value)}
        children = [entity(each) for each in inner.pop("children", ())]
        children += [made(name, each, each[_LINE]) for name, value in inner.items() for each in value]
        attributes = {name: value for name, value in body.items() if name not in (*inner, "children", _LINE)}
        return _Entity(kind=kind, line=body[_LINE], attributes=attributes, children=children)

    return entity(plain_yaml(path.read_bytes(), Loader))


def _are_mappings(values: Sequence[Any]) -> bool:
    return bool(values) and all(isinstance(each, dict) for each in values)


class _Frontend:
    """Makes the objects of one file."""

    def __init__(self, path: Path, context: Context) -> None:
        self._path, self._context = path, context

    def action(self, entity: _Entity) -> Made:
        """Return the action that an entity is."""
        kind = entity.kind.replace("-", "_")  # push-ros-namespace, too
        if kind in _LEFT_OUT or kind in _WITHOUT_NODES:
            return self._new(entity, _WITHOUT_NODES.get(kind, kind), **self._condition(entity))
        if kind not in _ACTIONS:
            raise self._refused(entity, f"the entity {entity.kind!r} is not known; {accepted_names(kind, _ACTIONS)}")
        made, names, needed, within = _ACTIONS[kind]
        self._check(entity, (*names, "if", "unless"), needed, None if kind in _WITH_ACTIONS else within)
        named: dict[str, Any] = {
            name: self._text(entity, entity.attributes[attribute])
            for attribute, name in names.items()
            if name and attribute in entity.attributes
        }
        if kind in _WITH_ACTIONS:
            named["actions"] = [self.action(each) for each in entity.children]
        elif kind == "arg" and entity.children:
            named["choices"] = [str(each.attributes.get("value")) for each in entity.children]
        elif kind == "include":
            named["launch_arguments"] = [self._pair(each, "name", "value") for each in entity.children]
        elif kind == "set_parameter":
            named["value"] = self._value(entity)
        elif "node" in kind:
            named |= self._of_node(entity)
        return self._new(entity, made, **named, **self._condition(entity))

    def _of_node(self, entity: _Entity) -> dict[str, Any]:
        inner = {kind: [each for each in entity.children if each.kind == kind] for kind in ("param", "remap", "env")}
        files = [self._file(each) for each in inner["param"] if "from" in each.attributes]
        own = self._parameters([each for each in inner["param"] if "from" not in each.attributes])
        words = [self._words(entity, str(entity.attributes.get(name, ""))) for name in ("args", "ros_args")]
        return {
            "parameters": [*files, own],
            "remappings": [self._pair(each, "from", "to") for each in inner["remap"]],
            "additional_env": dict(self._pair(each, "name", "value") for each in inner["env"]),
            "arguments": [*words[0], *(["--ros-args", *words[1]] if words[1] else [])],
        }

    def _file(self, entity: _Entity) -> Made:
        self._check(entity, ("from", "allow_substs"), 1, ())
        allowed = self._text(entity, entity.attributes.get("allow_substs", False))
        return self._new(entity, "ParameterFile", self._text(entity, entity.attributes["from"]), allow_substs=allowed)

    def _parameters(self, entities: Sequence[_Entity]) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for each in entities:
            self._check(each, _PARAM, 0, ("param",))
            if "name" not in each.attributes or ("value" in each.attributes) == bool(each.children):
                raise self._refused(each, "a param; accepted: name and value, name and params within, or from")
            found[str(each.attributes["name"])] = (
                self._parameters(each.children) if each.children else self._value(each)
            )
        return found

    def _value(self, entity: _Entity) -> Any:
        """Return the value of a parameter: a text is read as YAML when its substitutions are known."""
        value, kind = entity.attributes.get("value"), entity.attributes.get("type")
        separator = entity.attributes.get("value-sep")
        value = value.split(separator) if separator and isinstance(value, str) else value
        if isinstance(value, list):
            return self._new(entity, "ParameterList", [self._one_value(entity, each, kind) for each in value])
        return self._one_value(entity, value, kind)

    def _one_value(self, entity: _Entity, value: Any, kind: Any) -> Any:
        text = self._text(entity, value) if isinstance(value, str) else value
        if kind in (None, "yaml"):
            return text
        if kind not in _KINDS:
            raise self._refused(entity, f"type is {kind!r}; {accepted_names(str(kind), (*_KINDS, 'yaml'))}")
        return self._new(entity, "ParameterValue", text, value_type=_KINDS[kind])

    def _pair(self, entity: _Entity, first: str, second: str) -> tuple[Made, Made]:
        self._check(entity, (first, second, "description"), 2, ())
        return self._text(entity, entity.attributes[first]), self._text(entity, entity.attributes[second])

    def _condition(self, entity: _Entity) -> dict[str, Made]:
        kinds = {"if": "IfCondition", "unless": "UnlessCondition"}
        found = [
            self._new(entity, kind, self._text(entity, entity.attributes[name]))
            for name, kind in kinds.items()
            if name in entity.attributes
        ]
        if len(found) > 1:
            raise self._refused(entity, f"{entity.kind} has both 'if' and 'unless'; accepted: one of them")
        return {"condition": found[0]} if found else {}

    def _check(self, entity: _Entity, attributes: Sequence[str], needed: int, within: Sequence[str] | None) -> None:
        for name in entity.attributes:
            if name not in attributes:
                raise self._refused(entity, f"{entity.kind} has {name!r}; {accepted_names(str(name), attributes)}")
        for name in attributes[:needed]:
            if name not in entity.attributes:
                raise self._refused(entity, f"{entity.kind} has no {name!r}; {accepted_names(name, attributes)}")
        for each in entity.children:
            if within is not None and each.kind not in within:
                raise self._refused(each, f"{entity.kind} has {each.kind!r}; {accepted_names(each.kind, within)}")

    # Texts

    def _text(self, entity: _Entity, value: Any) -> Made:
        """Return the substitution that a text is."""
        text = str(value).lower() if isinstance(value, bool) else str(value)
        return self._new(entity, "TextSubstitution", self._parts(entity, text, 0, "")[0])

    def _words(self, entity: _Entity, text: str) -> list[list[Any]]:
        """Return the words of a command line; a substitution is never split."""
        parts = self._parts(entity, text, 0, "")[0]
        marked = "".join(chr(_MARK + i) if isinstance(part, Made) else part for i, part in enumerate(parts))
        marks = {chr(_MARK + i): part for i, part in enumerate(parts) if isinstance(part, Made)}
        return [[marks.get(letter, letter) for letter in word] for word in shlex.split(marked)]

    def _parts(self, entity: _Entity, text: str, at: int, ends: str) -> tuple[list[Any], int]:
        """Return texts and substitutions from a place on up to one of some characters, and the place of that."""
        parts: list[Any] = []
        while at < len(text) and text[at] not in ends:
            if text.startswith("$(", at):
                made, at = self._substitution(entity, text, at + 2)
                parts.append(made)
            else:
                at += text[at] == "\\"
                parts.append(text[at : at + 1])
                at += 1
        return parts, at

    def _substitution(self, entity: _Entity, text: str, at: int) -> tuple[Made, int]:
        """Return the substitution whose name begins at a place, and the place behind its bracket."""
        found = _NAME.match(text, at)
        name = found[0] if found else ""
        if name not in _SUBSTITUTIONS:
            wrong = f"the substitution $({name or text[at:]}) is not known"
            raise self._refused(entity, f"{wrong}; {accepted_names(name, tuple(_SUBSTITUTIONS))}")
        at, values = at + len(name), []
        while gap := _GAP.match(text, at):
            at = gap.end()
            quote = text[at : at + 1] if text[at : at + 1] in ("'", '"') else ""
            value, at = self._parts(entity, text, at + len(quote), quote or " )")
            at += len(quote)
            values += [value] if value or quote else []
        if text[at : at + 1] != ")":
            raise self._refused(entity, f"{text!r} has a substitution without its end; accepted: $({name} ...)")
        if name == "eval" and len(values) > 2:
            values = [[part for value in values for part in (*value, " ")]]
        values = [values] if name == "path-join" else values
        return self._new(entity, _SUBSTITUTIONS[name], *values), at + 1

    def _new(self, entity: _Entity, kind: str, *values: Any, **named: Any) -> Made:
        return new_object(kind, self._context, self._path, entity.line, *values, **named)

    def _refused(self, entity: _Entity, said: str) -> ControllerError:
        return ControllerError(f"{said} ({self._path}, line {entity.line})")
