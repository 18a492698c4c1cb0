"""Parameters of nodes as rcl reads them: files of parameters, and arguments behind `--ros-args`.

rcl has its own rules for values, which are not YAML's: 1e3, .5, inf and 08 are doubles, 0x10 and 010 are integers, y
and off are booleans, ~ and 12:30 are strings, and the values of a list are of one type.
"""

from __future__ import annotations

import importlib.util
import math
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fg_mujoco.course.maps.map_server import plain_loader, plain_yaml
from fg_mujoco.errors import ControllerError, missing_extra

_SECTION = "ros__parameters"
_TRUE = ("y", "Y", "yes", "Yes", "YES", "true", "True", "TRUE", "on", "On", "ON")
_FALSE = ("n", "N", "no", "No", "NO", "false", "False", "FALSE", "off", "Off", "OFF")
_INTEGER = re.compile(r"([-+]?)(0[xX][0-9a-fA-F]+|0[0-7]*|[1-9][0-9]*)")
_DOUBLE = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_NO_NUMBER = re.compile(r"([-+]?)\.?(inf|infinity|nan)", re.IGNORECASE)
_MOST = 2**63
_TAKE_A_VALUE = ("--log-level", "--log-config-file", "-e", "--enclave")


def rcl_value(text: str) -> Any:
    """Return the value of a text that is not quoted: a bool, an int, a float, or the text."""
    if text in _TRUE or text in _FALSE:
        return text in _TRUE
    whole = _INTEGER.fullmatch(text)
    if whole is not None:
        digits = whole[2]
        value = int(digits, 16 if digits[:2] in ("0x", "0X") else 8 if digits[0] == "0" else 10)
        value = -value if whole[1] == "-" else value
        if -_MOST <= value < _MOST:
            return value
    special = _NO_NUMBER.fullmatch(text)
    if special is not None:
        return float(special[1] + special[2])
    if _DOUBLE.fullmatch(text) and math.isfinite(number := float(text)):
        return number
    return text


def rcl_yaml(text: str | bytes, file: str = "") -> Any:
    """Return the values of a YAML text as rcl reads them, keys as texts; raises YAML's errors, and ValueError."""
    class Loader(plain_loader(file)):  # type: ignore[misc]
        yaml_implicit_resolvers: dict[Any, Any] = {}  # noqa: RUF012

        def construct_mapping(self, node: Any, deep: bool = False) -> dict[str, Any]:
            return {str(key.value): self.construct_object(value, deep=True) for key, value in node.value}

        def construct_sequence(self, node: Any, deep: bool = False) -> list[Any]:
            found: list[Any] = super().construct_sequence(node, deep=True)
            kinds = sorted({type(each).__name__ for each in found})
            if len(kinds) > 1:
                said = f"line {node.start_mark.line + 1}: a list of {' and '.join(kinds)}"
                raise ValueError(f"{said}, which rcl refuses; accepted: values of one type, as [1.0, 2.5]")
            return found

        def construct_rcl(self, node: Any) -> Any:
            if node.value == "":
                raise ValueError(f"line {node.start_mark.line + 1}: no value, which rcl refuses; accepted: one, or ''")
            return rcl_value(node.value)

    Loader.add_implicit_resolver("!rcl", re.compile(r"(?s).*"), None)
    Loader.add_constructor("!rcl", Loader.construct_rcl)
    return plain_yaml(text, Loader)


def read_parameters(path: Path, text: bytes, node: str, said: str) -> dict[str, Any]:
    """Return the parameters of a node in a YAML file of ROS 2, `node: ros__parameters: ...`.

    In names of nodes `*` stands for a name and `**` for any number of them. What stands under the node's own name,
    without its namespace, counts more than under such a pattern, and else what stands last; an empty name is any.
    Raises ControllerError: it cannot be read, or has no such entry.
    """
    if importlib.util.find_spec("yaml") is None:
        raise missing_extra(f"{path} needs PyYAML", "ros")
    try:
        found = rcl_yaml(text, str(path))
    except Exception as error:  # YAML's own, and whatever its values' readers raise
        raise ControllerError(f"{said}: {path} is no YAML: {' '.join(str(error).split())}") from error
    sections = list(_sections(found)) if isinstance(found, dict) else []
    if not sections:
        form = f"NODE: {{{_SECTION}: {{NAME: VALUE}}}}"
        raise ControllerError(f"{said}: {path} is no file of parameters; accepted: {form}")
    own = tuple(name for name in node.split("/") if name)
    chosen = [(names, values) for names, values in sections if not own or _matches(names, own)]
    if not chosen:
        names = ", ".join("/".join(names) for names, _ in sections)
        warnings.warn(f"{said}: {path} has parameters of {names}, and none of {node!r}", stacklevel=3)
    chosen.sort(key=lambda each: "*" not in "".join(each[0]))
    return {name: value for _, values in chosen for name, value in flat(values).items()}


def _sections(found: Mapping[Any, Any], before: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield the names of nodes, behind their namespaces, and their parameters."""
    for key, value in found.items():
        names = (*before, *(name for name in str(key).split("/") if name))
        if isinstance(value, dict) and isinstance(value.get(_SECTION), dict):
            yield names, value[_SECTION]
        elif isinstance(value, dict):
            yield from _sections(value, names)


def _matches(names: Sequence[str], own: Sequence[str]) -> bool:
    """Return whether names with `*` and `**` are those of a node."""
    if not names:
        return not own
    if names[0] == "**":
        while names[1:2] == ("**",):  # which would be tried in all ways
            names = names[1:]
        return any(_matches(names[1:], own[skipped:]) for skipped in range(len(own) + 1))
    return bool(own) and names[0] in ("*", own[0]) and _matches(names[1:], own[1:])


def flat(values: Mapping[Any, Any], before: str = "") -> dict[str, Any]:
    """Return nested parameters under names with dots."""
    found: dict[str, Any] = {}
    for name, value in values.items():
        found.update(flat(value, f"{before}{name}.") if isinstance(value, dict) else {f"{before}{name}": value})
    return found


@dataclass(frozen=True, kw_only=True)
class RosArguments:
    """The arguments of a node, and what those behind `--ros-args` say."""

    plain: tuple[str, ...]
    parameters: dict[str, Any] = field(default_factory=dict)
    remap: dict[str, str] = field(default_factory=dict)
    files: tuple[Path, ...] = ()  # of parameters
    name: str | None = None  # of the node
    namespace: str | None = None


def read_ros_arguments(arguments: Sequence[str], node: str | None, said: str) -> RosArguments:
    """Return what a node's arguments say, by rules for its name, None: any; ControllerError: of another form."""
    plain: list[str] = []
    parameters: dict[str, Any] = {}
    remap: dict[str, str] = {}
    files: list[Path] = []
    special: dict[str, str] = {}
    of_ros, waiting = False, iter(arguments)
    for each in waiting:
        if each == "--ros-args":
            of_ros = True
        elif of_ros and each == "--":
            of_ros = False
        elif not of_ros:
            plain.append(each)
        elif each in ("-p", "--param", "-r", "--remap"):
            rule = next(waiting, "")
            name, assigned, value = rule.partition(":=")
            if not assigned or not name:
                form = "speed:=2.0" if each in ("-p", "--param") else "/scan:=/my_scan"
                raise ControllerError(f"{said}: {each} {rule}; accepted: NAME:=VALUE, as {each} {form}")
            of_node, colon, rest = name.partition(":")
            if colon and node is not None and of_node != node:
                continue
            name = rest if colon else name
            if each in ("-p", "--param"):
                parameters[name] = _argument(value, rule, said)
            elif name in ("__node", "__name", "__ns"):
                special[name] = value
            else:
                remap[name] = value
        elif each == "--params-file" or each in _TAKE_A_VALUE:
            given = next(waiting, None)
            if given is None:
                raise ControllerError(f"{said}: {each} has no value; accepted: one behind it")
            files += [Path(given)] if each == "--params-file" else []
    return RosArguments(
        plain=tuple(plain), parameters=parameters, remap=remap, files=tuple(files),
        name=special.get("__node", special.get("__name")), namespace=special.get("__ns"),
    )  # fmt: skip


def _argument(value: str, rule: str, said: str) -> Any:
    try:
        return rcl_yaml(value)
    except Exception as error:  # YAML's own
        raise ControllerError(f"{said}: -p {rule}: {' '.join(str(error).split())}") from error
