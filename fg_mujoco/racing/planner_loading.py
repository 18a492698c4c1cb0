"""Finds a planner by name or in a file, says where it comes from, builds it, and holds it to its contract.

A planner is a class with `__call__(scan, odometry)` and `reset()`, or a function `f(scan, odometry)`, which keeps
nothing from scan to scan. A planner with settings names their dataclass as class attribute `Settings`, and its
constructor takes `settings`.

Other packages register planners as entry points of the group `fg_mujoco.controllers`, as in their pyproject.toml:

    [project.entry-points."fg_mujoco.controllers"]
    my_planner = "my_package.my_module:MyPlanner"

A name that is bundled stays that of the bundled planner. A name that two packages register is refused.
"""

from __future__ import annotations

import hashlib
import importlib
import inspect
import linecache
import os
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points, packages_distributions, version
from pathlib import Path
from types import ModuleType
from typing import Any, Literal, get_args, get_origin, get_type_hints

from ..course.files import is_file
from ..errors import ControllerError, SettingsError, accepted_names
from ..messages import CarParameters, Controller, DriveCommand, LaserScan, MapLine, Odometry, PlannerContext
from ..simulation.planner_adapter import short, short_text
from ..simulation.planner_failure import file_of, is_of_planner, one_line, told, without_exit

GROUP = "fg_mujoco.controllers"
"""Group of the entry points of planners."""
ROS = "ros:"
"""Before the path of a node of ROS, see docs/ros_nodes.md."""

_A_PLANNER = "one with __call__(scan, odometry) and reset(), or a function of (scan, odometry)"
_TOLD = ["scan", "odometry"]  # names of a planner's arguments
_NODE = re.compile(r":\w*$")  # the class, behind a path


def bundled_names() -> tuple[str, ...]:
    """Return the names of the bundled controllers."""
    return tuple(sorted(_catalogue()))


def controller_names() -> tuple[str, ...]:
    """Return the names of the bundled controllers and of those that installed packages register."""
    return tuple(sorted({*_catalogue(), *(point.name for point in entry_points(group=GROUP))}))


def origin(source: str | Controller, found: Any = None) -> dict[str, str | None]:
    """Return where a controller comes from, for the manifest of a run.

    Args:
      source: as of `make_controller`.
      found: its class, if it is loaded already.

    Returns:
      distribution: the installed package that it is of; None for a file or object of the user's.
      version: of that package.
      file: the file that its class is defined in; None where there is none.
      sha256: of the contents of that file.

    Raises:
      ControllerError: an unknown name, or a file or class that cannot be loaded.
    """
    if found is None:
        found = find_controller(source) if isinstance(source, str) else type(source)
    text = source_code(found)
    place = source_file(found)
    distribution = _distribution_of(found, source)
    return {
        "distribution": distribution,
        "version": None if distribution is None else version(distribution),
        "file": None if place is None else str(place),
        "sha256": None if text is None else hashlib.sha256(text).hexdigest(),
    }


def source_code(found: Any) -> bytes | None:
    """Return the contents of the file that a controller's class is defined in; None where there is no such file.

    Of a class that `find_controller` read from a file these are the contents that it read.
    """
    module = sys.modules.get(getattr(found, "__module__", ""))
    read: bytes | None = getattr(module, _READ, None)
    place = source_file(found)
    if read is None and place is not None and place.is_file():
        read = place.read_bytes()
    return read


def describe(name: str) -> dict[str, Any]:
    """Return what a controller does, in one line, and its settings, for tables.

    Returns:
      name, summary, distribution and settings; of each setting its name, unit, default, text, and what is accepted. The
      default of a setting of the car is that of the F1TENTH car, and `scales` says that it is scaled to other cars.

    Raises:
      ControllerError: an unknown name, or a file or class that cannot be loaded.
    """
    found = find_controller(name)
    module = sys.modules.get(found.__module__)
    lines = (getattr(module, "__doc__", None) or found.__doc__ or "").strip().splitlines()
    kind = getattr(found, "Settings", None)
    return {
        "name": name,
        "summary": lines[0] if lines else "",
        "distribution": _distribution_of(found, name),
        "settings": describe_settings(kind) if isinstance(kind, type) and is_dataclass(kind) else [],
    }


def describe_settings(kind: type) -> list[dict[str, Any]]:
    """Return name, unit, default, text, accepted and scales of the fields of a settings dataclass, in their order."""
    hints, rows = get_type_hints(kind), []
    for each in fields(kind):
        said, hint = each.metadata, hints.get(each.name)
        accepted = getattr(said.get("accepted"), "text", "")
        if get_origin(hint) is Literal:
            accepted = ", ".join(get_args(hint))
        rows.append(
            {
                "name": each.name, "unit": said.get("unit", ""), "default": said.get("of_f1tenth", each.default),
                "text": said.get("text", ""), "accepted": accepted, "scales": "of_f1tenth" in said,
            }
        )  # fmt: skip
    return rows


def make_controller(
    source: str | Controller,
    context: PlannerContext | None = None,
    *,
    settings: Mapping[str, Any] | None = None,
    car: CarParameters | None = None,
    mu: float | None = None,
    max_speed: float | None = None,
    map_line: MapLine | None = None,
) -> Controller:
    """Return a controller, built with its settings and with what it is told, as far as its constructor names them.

    Args:
      source: a bundled name, `path/to/file.py:NAME` of a class or a function, a controller, which is taken as it is, or
        a function `f(scan, odometry)`.
      context: all that it is told, as `DriveSettings.context` makes it; None: a PlannerContext of `car`, `mu`,
        `max_speed` and `map_line`, of which the first three must be there.
      settings: those of its settings that are to differ from its own, by name.
      car: parameters of the car.
      mu: friction coefficient that it is to believe in; inf switches its friction limits off.
      max_speed: fastest that it may command [m/s].
      map_line: the line through the course; None where there is no map, and a controller that names it is refused.

    Raises:
      ControllerError: an unknown name, a file or class that cannot be loaded, settings that it has not or cannot
        have, or an object that is no controller.
    """
    if isinstance(source, os.PathLike):
        source = os.fspath(source)
    if not isinstance(source, str):
        if inspect.isfunction(source):
            source = planner_of(source, f"controller {source.__name__}")()
        origin = f"controller {type(source).__name__}"
        if settings:
            raise ControllerError(f"{origin} is made already; accepted: settings only for one that is yet to be built")
        return _checked(source, origin)
    if context is None:
        if car is None or mu is None or max_speed is None:
            missing = [name for name, value in (("car", car), ("mu", mu), ("max_speed", max_speed)) if value is None]
            raise ControllerError(f"make_controller lacks {', '.join(missing)}; accepted: a context, or all three")
        context = PlannerContext(car=car, mu=mu, max_speed=max_speed, map_line=map_line)
    return build_controller(find_controller(source), source, context, settings)


@without_exit()
def find_controller(source: str) -> Any:
    """Return the class of a bundled controller, a registered one, or one in a file, which is read afresh.

    Raises:
      ControllerError: an unknown name, or a file or class that cannot be loaded.
    """
    return _find_class(source, f"controller {source!r}")


@without_exit()
def build_controller(
    factory: Any, source: str, context: PlannerContext, settings: Mapping[str, Any] | None = None
) -> Controller:
    """Return a controller of the class that `find_controller(source)` returned; otherwise as `make_controller`."""
    origin = f"controller {source!r}"
    offered = {each.name: getattr(context, each.name) for each in fields(context)}
    try:
        parameters = inspect.signature(factory).parameters.values()
    except ValueError as error:
        raise ControllerError(f"{origin} cannot be built: {one_line(error)}") from error
    wanted = [p.name for p in parameters if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)]
    required = [p.name for p in parameters if p.name in wanted and p.default is p.empty]
    if getattr(factory, "any_settings", False):  # parameters of nodes, which are known when these run
        offered["settings"] = dict(settings or {})
    elif settings or ("settings" in required and hasattr(factory, "Settings")):
        offered["settings"] = _settings(factory, settings or {}, origin, taken="settings" in wanted)
    if context.map_line is None:
        del offered["map_line"]
        if "map_line" in required:
            raise ControllerError(f"{origin} drives by a map; accepted: where there is one, as in a race")
    unknown = [name for name in required if name not in offered]
    if unknown:
        raise ControllerError(f"{origin} wants {', '.join(unknown)}; a constructor may name {', '.join(offered)}")
    try:
        controller = factory(**{name: value for name, value in offered.items() if name in wanted})
    except BaseException as error:
        if not is_of_planner(error):
            raise
        raise ControllerError(f"{origin} cannot be built: {told(error, file_of(factory))}") from error
    return _checked(controller, origin)


def _settings(factory: Any, changes: Mapping[str, Any], origin: str, *, taken: bool) -> Any:
    """Return the settings of a controller's class with some of them changed."""
    kind = getattr(factory, "Settings", None)
    if not taken or not isinstance(kind, type) or not is_dataclass(kind):
        raise ControllerError(
            f"{origin} has no settings, such as {', '.join(changes)}; accepted: a class that names a dataclass as its "
            "attribute Settings and takes `settings`"
        )
    defaults = {field.name: field.default for field in fields(kind) if field.init}
    for name, value in changes.items():
        now = getattr(kind, "renamed", {}).get(name)
        if name not in defaults and now:
            raise ControllerError(f"{origin} has no setting {name!r} any more: it is called {now!r} now")
        if name not in defaults:
            raise ControllerError(f"{origin} has no setting {name!r}; {accepted_names(name, defaults)}")
        kind_of_value = _like(defaults[name], value)
        if kind_of_value:
            raise ControllerError(f"{origin}: setting {name} is {short(value)}; accepted: {kind_of_value}")
    try:
        return kind(**changes)
    except SettingsError as error:
        of_a_field = str(error).startswith(f"{kind.__name__}.")
        said = f"setting {str(error).removeprefix(f'{kind.__name__}.')}" if of_a_field else str(error)
        raise ControllerError(f"{origin}: {said}") from error
    except BaseException as error:
        if not is_of_planner(error):
            raise
        given = ", ".join(f"{name}={value!r}" for name, value in changes.items())
        raise ControllerError(f"{origin} cannot have settings {short_text(given)}: {one_line(error)}") from error


def _like(default: Any, value: Any) -> str:
    """Return what a value should be to be of the kind of a default; nothing where it is, or the kind is another."""
    if isinstance(default, bool):
        return "" if isinstance(value, bool) else "True, False"
    if isinstance(default, int):
        return "" if isinstance(value, int) and not isinstance(value, bool) else "a whole number"
    if isinstance(default, float):
        return "" if isinstance(value, (int, float)) and not isinstance(value, bool) else "a number"
    return ""


def _catalogue() -> dict[str, str]:
    """Return the bundled controllers: name -> "module:Class". The engine names no planner; the folder does."""
    catalogue: dict[str, str] = importlib.import_module("fg_mujoco.controllers").CONTROLLERS
    return catalogue


def _find_class(source: str, said: str) -> Any:
    catalogue = _catalogue()
    if source in catalogue:
        module_name, _, class_name = catalogue[source].partition(":")
        return getattr(importlib.import_module(f"fg_mujoco.controllers.{module_name}"), class_name)
    if source.startswith(ROS):
        return _ros_door().find_node(source)
    path, _, class_name = (source, "", "") if is_file(source) or source.endswith(".py") else source.rpartition(":")
    if source.endswith(".py") and not is_file(source):
        known = accepted_names(source, controller_names(), ", or path/to/file.py:ClassName")
        raise ControllerError(f"{said}: there is no file {source}; {known}")
    if not path.endswith(".py"):
        return _load(_registered(source, said), said)
    module = _import_file(Path(path), said)
    found = getattr(module, class_name, None)
    if inspect.isfunction(found):
        return planner_of(found, said)
    if not isinstance(found, type):
        names = _planners_in(module)
        if not names:
            raise ControllerError(f"{said}: there is no class in the file; accepted: {_A_PLANNER}")
        if not class_name:
            ways = ", ".join(f"{path}:{name}" for name in names)
            raise ControllerError(f"{said}: the name of its class is missing; accepted: {ways}")
        raise ControllerError(f"{said}: the file has no class {class_name!r}; {accepted_names(class_name, names)}")
    return found


def _ros_door() -> Any:
    """Return the module that runs nodes of ROS. No room below it names it but here, by its name."""
    return importlib.import_module("fg_mujoco.ros.node_host.ros_planner")


def file_in(source: str) -> Path | None:
    """Return the file that a controller's text names: that of a class, of a node or a launch file; None for a name."""
    if source.startswith(ROS):
        return Path(_NODE.sub("", source.removeprefix(ROS)))
    path, colon, _ = source.rpartition(":")
    return Path(path) if colon else None


def text_of(source: str) -> bytes | None:
    """Return the code that a controller's text names, unexecuted; of a launch file that of all its nodes.

    Raises:
      ControllerError, OSError: it cannot be read.
    """
    path = file_in(source)
    if path is None:
        return None
    return bytes(_ros_door().source_text(source)) if source.startswith(ROS) else path.read_bytes()


def moved_to(source: str, path: str | Path) -> str:
    """Return a controller's text with the same file in another place."""
    if source.startswith(ROS):
        name = _NODE.search(source.removeprefix(ROS))
        return f"{ROS}{path}{name.group() if name else ''}"
    return f"{path}:{source.rpartition(':')[2]}"


def _planners_in(module: ModuleType) -> list[str]:
    """Return the names of the classes and functions of a user's file that plan; of all its classes where none does."""
    own = [value for value in vars(module).values() if getattr(value, "__module__", None) == module.__name__]
    classes = [value for value in own if isinstance(value, type)]
    planners: list[Any] = [each for each in classes if any("__call__" in vars(base) for base in each.__mro__)]
    planners += [each for each in own if inspect.isfunction(each) and list(inspect.signature(each).parameters) == _TOLD]
    return [each.__name__ for each in planners or classes]


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
    members = {"__call__": staticmethod(function), "reset": lambda self: None}
    return type(name, (), {**members, "__module__": function.__module__, "__doc__": function.__doc__})


def _registered(name: str, said: str) -> EntryPoint:
    """Return the entry point of a name that an installed package registers."""
    points = list(entry_points(group=GROUP, name=name))
    if not points:
        raise ControllerError(
            f"{said} is not known; {accepted_names(name, controller_names(), ', or path/to/file.py:ClassName')}"
        )
    if len({point.value for point in points}) > 1:
        packages = " and ".join(sorted(_of_package(point) for point in points))
        raise ControllerError(f"{said} is registered by {packages}; accepted: a name that one package registers")
    return points[0]


def _load(point: EntryPoint, said: str) -> Any:
    try:
        found = point.load()
    except BaseException as error:
        if not is_of_planner(error):
            raise
        raise ControllerError(f"{said}, of {_of_package(point)}, does not load: {one_line(error)}") from error
    if inspect.isfunction(found):
        return planner_of(found, said)
    if not isinstance(found, type):
        raise ControllerError(f"{said}, of {_of_package(point)}, is {short(found)}; accepted: a class or a function")
    return found


def _of_package(point: EntryPoint) -> str:
    return f"{point.dist.name} {point.dist.version}" if point.dist is not None else point.value


def _distribution_of(found: Any, source: str | Controller) -> str | None:
    """Return the name of the installed package of a class; None where it is of none."""
    if isinstance(source, str) and source not in _catalogue() and ":" not in source:
        point = _registered(source, f"controller {source!r}")
        return point.dist.name if point.dist is not None else None
    package = str(getattr(found, "__module__", "")).partition(".")[0]
    if package == "fg_mujoco":
        return "fg-mujoco"
    if package in ("", "__main__") or getattr(sys.modules.get(package), "__spec__", None) is None:
        return None  # no module that was found by the import system, such as a user's file
    return next(iter(_distributions().get(package, ())), None)


@lru_cache(maxsize=1)  # it looks through all that is installed
def _distributions() -> Mapping[str, Sequence[str]]:
    return packages_distributions()


def source_file(found: Any) -> Path | None:
    """Return the file that a controller's class is defined in; None where there is none."""
    path = getattr(sys.modules.get(getattr(found, "__module__", "")), "__file__", None)
    return None if path is None else Path(path)


_READ = "__fg_mujoco_read__"  # name in a module that was read from a user's file: what was read


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
        setattr(module, _READ, text)
        exec(compile(text, str(path), "exec"), module.__dict__)
    except BaseException as error:
        if not is_of_planner(error):
            raise
        raise ControllerError(f"{origin} does not import: {told(error, str(path))}") from error
    return module


def _checked(controller: Any, origin: str) -> Controller:
    if isinstance(controller, type):
        raise ControllerError(
            f"controller {controller.__name__} is a class; accepted: an object of it, such as {controller.__name__}()"
        )
    lacking = [name for name in ("__call__", "reset") if not callable(getattr(controller, name, None))]
    if lacking == ["reset"]:
        said = f"{origin} is no controller: it has no reset(), which is called before each race and forgets all"
        accepted = "accepted: __call__(scan, odometry) and reset(), `def reset(self): pass` where it keeps nothing"
        raise ControllerError(f"{said}; {accepted}")
    if lacking:
        raise ControllerError(f"{origin} is no controller; accepted: {_A_PLANNER}")
    return controller  # type: ignore[no-any-return]
