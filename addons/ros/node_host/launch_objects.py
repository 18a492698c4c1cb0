"""Stubs of `launch` and `launch_ros`, with which a launch file of ROS 2 in Python is executed where no ROS is.

Actions, substitutions and conditions are recorded as `Made`; `launch_files` knows what they mean. What is not
installed, or belongs to a package that is not here, is `Lacking`: it may be passed on, and is refused where a node
depends on it.
"""

from __future__ import annotations

import builtins
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar

from fg_mujoco.errors import ControllerError

from .graph import Graph
from .imports import Imports, Overlay, StandIn
from .message_classes import Definitions
from .node_session import Session
from .other_modules import overlays, random_overlays

_OF_LAUNCH = ("launch", "launch_ros", "nav2_common", "launch_xml", "launch_yaml", "launch_testing")
_OPERATORS = ("add", "radd", "truediv", "rtruediv", "mod", "mul", "eq", "ne", "lt", "le", "gt", "ge", "or", "and")


class Context:
    """What an OpaqueFunction is called with."""

    def __init__(self, text_of: Callable[[Any], str]) -> None:
        self.launch_configurations: dict[str, str] = {}  # of the group that is taken
        self.perform_substitution = text_of


class Made:
    """An object of `launch` or `launch_ros`: an action, a substitution or a condition."""

    kind: ClassVar[str] = ""  # name of its class
    context: ClassVar[Context]

    def __init__(self, *values: Any, **named: Any) -> None:
        frame = sys._getframe(1)
        self.values, self.named = list(values), named
        self.line, self.file = frame.f_lineno, Path(frame.f_code.co_filename)

    def __getattr__(self, name: str) -> Any:
        if name in self.__dict__.get("named", {}):
            return self.named[name]
        raise AttributeError(f"{self.kind} has no {name!r} here")

    def __truediv__(self, other: Any) -> Made:
        return self._of("PathJoinSubstitution", [self, other])

    def __rtruediv__(self, other: Any) -> Made:
        return self._of("PathJoinSubstitution", [other, self])

    def _of(self, kind: str, value: Any) -> Made:
        return new_object(kind, self.context, self.file, self.line, value)

    def perform(self, context: Any) -> str:
        """Return the text of a substitution."""
        return self.context.perform_substitution(self)

    def find(self, package_name: str) -> str:
        """Return the share directory of a package, as FindPackageShare does."""
        return self.perform(None)

    def add_action(self, action: Any) -> None:
        """Add an action to a description."""
        self.values.append(action)

    add_entity = add_action


def new_object(kind: str, context: Context, file: Path, line: int, *values: Any, **named: Any) -> Made:
    """Return an object of a class of `launch` or `launch_ros`, made in a line of a file."""
    found: Made = type(kind, (Made,), {"kind": kind, "context": context})(*values, **named)
    found.line, found.file = line, file
    return found


class Lacking:
    """What is not here; what is made of it is not here either."""

    __hash__ = object.__hash__

    def __init__(self, text: str) -> None:
        self.text = text  # what is not here, and why

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return self

    def __call__(self, *_: Any, **__: Any) -> Lacking:  # noqa: D102
        return self

    def __getitem__(self, key: Any) -> Lacking:
        return self

    def __setitem__(self, key: Any, value: Any) -> None:
        pass

    def __enter__(self) -> Lacking:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def __str__(self) -> str:
        return f"/{self.text}"

    __fspath__ = __str__

    def _refused(self, *_: Any) -> Any:
        raise ControllerError(refusal(self))

    __bool__ = __iter__ = __int__ = __float__ = __len__ = __contains__ = _refused


for _name in _OPERATORS:
    setattr(Lacking, f"__{_name}__", lambda self, _: self)


def refusal(value: Lacking, place: str = "") -> str:
    """Return the message for a value that a node depends on and that is not here."""
    return (
        f"{value.text}{place}; accepted: what is installed, packages of the workspace, or a launch file of this "
        "package's own form: ros:launch.yaml"
    )


class _Module(ModuleType):
    """A module of `launch` or `launch_ros`: each name in it is a module, a class of `Made`, or a function."""

    def __init__(self, name: str, context: Context) -> None:
        super().__init__(name)
        self.__path__: list[str] = []
        self._context = context

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        functions = {
            "LaunchContext": lambda *_, **__: self._context,
            "perform_substitutions": lambda _, given: self._context.perform_substitution(given),
            "normalize_to_list_of_substitutions": lambda given: given,
        }
        found: Any = functions.get(name)
        if found is None and name[:1].isupper():
            found = type(name, (Made,), {"kind": name, "context": self._context})
        if found is None:
            found = _Module(f"{self.__name__}.{name}", self._context)
        setattr(self, name, found)
        return found

    def __call__(self, *_: Any, **__: Any) -> Lacking:
        return Lacking(f"{self.__name__} is not known here")


class LaunchImports(Imports):
    """The modules of launch files; `share` returns the share directory of a package, None where it is not here."""

    def __init__(self, path: Path, graph: Graph, share: Callable[[str], Path | None], context: Context) -> None:
        session = Session(graph, path, {}, {})
        self._launch = {name: _Module(name, context) for name in _OF_LAUNCH}

        def share_of(package_name: str, *_: Any, **__: Any) -> Any:
            found = share(str(package_name))
            return Lacking(f"package {package_name!r} is not here") if found is None else found

        def directory(package_name: str, *_: Any, **__: Any) -> Any:
            found = share_of(package_name)
            return found if isinstance(found, Lacking) else str(found)

        index = {
            "get_package_share_directory": directory, "get_package_prefix": directory,
            "get_package_share_path": share_of, "PackageNotFoundError": KeyError,
        }  # fmt: skip
        stubs = {name: StandIn(name, **index) for name in ("ament_index_python", "ament_index_python.packages")}
        super().__init__(
            path, graph, Definitions(), stubs, overlays(session, lambda _: None), random_overlays(0)
        )  # fmt: skip
        self._builtins["open"] = _opened

    def _find(
        self,
        name: str,
        globals: Mapping[str, Any] | None,
        locals: Mapping[str, Any] | None,
        wanted: tuple[str, ...],
        level: int,
        unused: set[str],
    ) -> Any:
        """Return a module; what is not installed is `Lacking`."""
        top, *rest = name.split(".")
        if level == 0 and top in self._launch:
            found: Any = self._launch[top]
            for part in rest if wanted else ():
                found = getattr(found, part)
            return found
        try:
            found = super()._find(name, globals, locals, wanted, level, unused)
        except ModuleNotFoundError as error:
            if top in self._fixed:
                raise
            return Lacking(str(error))
        return _yaml(found) if name == "yaml" else found


class _Writing:
    """A file that is written, and into which what is `Lacking` is not."""

    def __init__(self, file: Any) -> None:
        self._file = file

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)

    def __enter__(self) -> _Writing:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def write(self, text: Any) -> Any:
        return text if isinstance(text, Lacking) else self._file.write(text)


def _opened(file: Any, mode: str = "r", *values: Any, **named: Any) -> Any:
    """Open a file; one that is not there and is to be read is `Lacking`."""
    if isinstance(file, Lacking):
        return file
    if set(mode) & set("wax+"):
        return _Writing(builtins.open(file, mode, *values, **named))
    try:
        return builtins.open(file, mode, *values, **named)
    except FileNotFoundError:
        return Lacking(f"there is no file {str(file)!r}")


def _yaml(found: Any) -> ModuleType:
    """Return PyYAML, which reads of what is `Lacking` what is so too, and does not write it."""

    def reading(read: Callable[..., Any]) -> Callable[..., Any]:
        return lambda stream, *values, **named: (
            stream if isinstance(stream, Lacking) else read(stream, *values, **named)
        )

    def writing(write: Callable[..., Any]) -> Callable[..., Any]:
        def dump(data: Any, *values: Any, **named: Any) -> Any:
            try:
                return write(data, *values, **named)
            except found.representer.RepresenterError as error:
                return Lacking(str(error))

        return dump

    readers = {name: reading(getattr(found, name)) for name in ("safe_load", "load", "full_load")}
    return Overlay(found, **readers, **{name: writing(getattr(found, name)) for name in ("dump", "safe_dump")})


def executed(path: Path, imports: LaunchImports) -> Any:
    """Execute a launch file, and return what its `generate_launch_description`, else ControllerError, returns."""
    module = imports.run(path, path.read_bytes(), path.stem)
    make = getattr(module, "generate_launch_description", None)
    if not callable(make):
        raise ControllerError(f"{path} has no function generate_launch_description; accepted: one")
    return make()
