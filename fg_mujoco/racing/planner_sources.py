"""Finds the class of a planner: by its name, in a Python file, in a policy's file, or by a scheme such as `ros:`.

Other packages register planners as entry points of the group `fg_mujoco.controllers`, as in their pyproject.toml:

    [project.entry-points."fg_mujoco.controllers"]
    my_planner = "my_package.my_module:MyPlanner"

A name that is bundled stays that of the bundled planner. A name that two packages register is refused.
"""

from __future__ import annotations

import inspect
import linecache
import sys
from collections.abc import Callable
from importlib.metadata import EntryPoint
from pathlib import Path
from types import ModuleType
from typing import Any

from fg_mujoco.controllers import CONTROLLERS

from ..course.files import is_file
from ..errors import ControllerError, accepted_names
from ..messages import DriveCommand, LaserScan, Odometry
from ..registry import Registry, added, package_of
from ..simulation.planner_adapter import short
from ..simulation.planner_failure import error_text, is_of_planner, one_line, without_exit
from .planner_texts import SCHEMES, file_in, scheme_of

PLANNERS: Registry[Any] = Registry(
    "controller",
    ControllerError,
    "fg_mujoco.controllers",
    {name: f"fg_mujoco.controllers.{place}" for name, place in CONTROLLERS.items()} | added("PLANNERS"),
)

A_PLANNER = "one with __call__(scan, odometry) and reset(), or a function of (scan, odometry)"
READ = "__fg_mujoco_read__"
"""Name in a module that was read from a user's file: the bytes that were read."""

_ARGUMENTS = ["scan", "odometry"]  # names of a planner's arguments
_FILE = ", path/to/file.py:ClassName, or a policy's file"


def bundled_names() -> tuple[str, ...]:
    """Return the names of the bundled controllers."""
    return tuple(sorted(PLANNERS))


def controller_names() -> tuple[str, ...]:
    """Return the names of the bundled controllers and of those that installed packages register."""
    return tuple(sorted(PLANNERS.names()))


@without_exit()
def find_controller(source: str) -> Any:
    """Return the class of a bundled controller, a registered one, or one in a file, which is read afresh.

    Raises:
      ControllerError: an unknown name, or a file or class that cannot be loaded.
    """
    return _find_class(source, f"controller {source!r}")


@without_exit()
def only_planner(source: str) -> str:
    """Return the text of a planner's file with the name of the only planner in it; any other text as it is.

    Raises:
      ControllerError: a file that cannot be loaded, or that has none or several.
    """
    if not source.endswith(".py") or not is_file(source):
        return source
    names = _planners_in(_import_file(Path(source), f"controller {source!r}"))
    return f"{source}:{names[0]}" if len(names) == 1 else source


def _find_class(source: str, said: str) -> Any:
    if source in PLANNERS:
        return PLANNERS.find(source)
    if scheme := scheme_of(source):
        return SCHEMES.find(scheme).find(source)
    path, class_name = file_in(source), "" if source.endswith(".py") else source.rpartition(":")[2]
    if path is None:
        return _load(PLANNERS.entry_point(source, _FILE), said)
    if not class_name and not is_file(path):
        known = accepted_names(source, controller_names(), _FILE)
        raise ControllerError(f"{said}: there is no file {source}; {known}")
    module = _import_file(path, said)
    found = getattr(module, class_name, None)
    if inspect.isfunction(found):
        return planner_of(found, said)
    if not isinstance(found, type):
        names = _planners_in(module)
        if not names:
            raise ControllerError(f"{said}: there is no class in the file; accepted: {A_PLANNER}")
        if not class_name:
            ways = ", ".join(f"{source.removesuffix(':')}:{name}" for name in names)
            raise ControllerError(f"{said}: the name of its class is missing; accepted: {ways}")
        raise ControllerError(f"{said}: the file has no class {class_name!r}; {accepted_names(class_name, names)}")
    return found


def _planners_in(module: ModuleType) -> list[str]:
    """Return the names of the classes and functions of a user's file that plan; of all its classes where none does."""
    own = [value for value in vars(module).values() if getattr(value, "__module__", None) == module.__name__]
    classes = [value for value in own if isinstance(value, type)]
    planners: list[Any] = [each for each in classes if any("__call__" in vars(base) for base in each.__mro__)]
    planners += [each for each in own if inspect.isfunction(each) and _arguments(each) == _ARGUMENTS]
    return [each.__name__ for each in planners or classes]


def _arguments(function: Callable[..., Any]) -> list[str]:
    return list(inspect.signature(function).parameters)


def planner_of(function: Callable[[LaserScan, Odometry], DriveCommand], said: str) -> type:
    """Return a class of planners that answer what a function answers. It has the name and the file of the function.

    Raises:
      ControllerError: the function cannot be called with a scan and odometry.
    """
    name, signature = function.__name__, inspect.signature(function)
    try:
        signature.bind(None, None)
    except TypeError:
        raise ControllerError(f"{said} is the function {name}{signature}; accepted: {name}(scan, odometry)") from None
    members = {"__call__": staticmethod(function), "reset": lambda self: None, **vars(function)}
    return type(name, (), {**members, "__module__": function.__module__, "__doc__": function.__doc__})


def _load(point: EntryPoint, said: str) -> Any:
    try:
        found = point.load()
    except BaseException as error:
        if not is_of_planner(error):
            raise
        raise ControllerError(f"{said}, of {package_of(point)}, does not load: {one_line(error)}") from error
    if inspect.isfunction(found):
        return planner_of(found, said)
    if not isinstance(found, type):
        raise ControllerError(f"{said}, of {package_of(point)}, is {short(found)}; accepted: a class or a function")
    return found


def source_file(found: Any) -> Path | None:
    """Return the file that a controller's class is defined in; None where there is none."""
    path = getattr(sys.modules.get(getattr(found, "__module__", "")), "__file__", None)
    return None if path is None else Path(path)


def _import_file(path: Path, origin: str) -> ModuleType:
    if not is_file(path):
        raise ControllerError(f"{origin}: there is no file {path}")
    module = ModuleType(f"fg_mujoco_user_{path.stem}")
    module.__file__ = str(path)
    sys.modules[module.__name__] = module  # dataclasses look their module up there
    linecache.checkcache(str(path))  # what is compiled is kept under a hash of the file's lines, not of older ones
    try:
        # not by the import system: its cache takes a file that was edited within a second for the old one
        text = path.read_bytes()
        setattr(module, READ, text)
        exec(compile(text, str(path), "exec"), module.__dict__)
    except BaseException as error:
        if not is_of_planner(error):
            raise
        raise ControllerError(f"{origin} does not import: {error_text(error, str(path))}") from error
    return module
