"""Finds a planner by name or in a file, builds it, and holds it to its contract.

A planner with settings names their dataclass as class attribute `Settings`, and its constructor takes `settings`.
"""

from __future__ import annotations

import importlib
import inspect
import sys
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from ..errors import ControllerError
from ..messages import CarParameters, Controller, MapLine
from ..simulation.planner_adapter import one_line, short, short_text


def controller_names() -> tuple[str, ...]:
    """Return the names of the bundled controllers."""
    return tuple(sorted(_catalogue()))


def make_controller(
    source: str | Controller,
    *,
    car: CarParameters,
    mu: float,
    max_speed: float,
    settings: Mapping[str, Any] | None = None,
    map_line: MapLine | None = None,
) -> Controller:
    """Return a controller, built with those of these arguments that its constructor names.

    Args:
      source: a bundled name, `path/to/file.py:ClassName`, or a controller, which is taken as it is.
      car: parameters of the car.
      mu: friction coefficient that the controller is to believe in; inf switches its friction limits off.
      max_speed: fastest that it may command [m/s].
      settings: those of its settings that are to differ from its own, by name.
      map_line: the line through the course; None where there is no map, and a controller that names it is refused.

    Raises:
      ControllerError: an unknown name, a file or class that cannot be loaded, settings that it has not or cannot
        have, or an object that is no controller.
    """
    if not isinstance(source, str):
        origin = f"controller {type(source).__name__}"
        if settings:
            raise ControllerError(f"{origin} is made already; accepted: settings only for one that is yet to be built")
        return _checked(source, origin)
    return build_controller(
        find_controller(source), source, car=car, mu=mu, max_speed=max_speed, settings=settings, map_line=map_line
    )


def find_controller(source: str) -> Any:
    """Return the class of a bundled controller, or of one in a file, which is read afresh.

    Raises:
      ControllerError: an unknown name, or a file or class that cannot be loaded.
    """
    return _find_class(source, f"controller {source!r}")


def build_controller(
    factory: Any,
    source: str,
    *,
    car: CarParameters,
    mu: float,
    max_speed: float,
    settings: Mapping[str, Any] | None = None,
    map_line: MapLine | None = None,
) -> Controller:
    """Return a controller of the class that `find_controller(source)` returned; otherwise as `make_controller`."""
    origin = f"controller {source!r}"
    offered: dict[str, Any] = {"car": car, "mu": mu, "max_speed": max_speed}
    try:
        parameters = inspect.signature(factory).parameters.values()
    except ValueError as error:
        raise ControllerError(f"{origin} cannot be built: {one_line(error)}") from error
    wanted = [p.name for p in parameters if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)]
    required = [p.name for p in parameters if p.name in wanted and p.default is p.empty]
    if settings or ("settings" in required and hasattr(factory, "Settings")):
        offered["settings"] = _settings(factory, settings or {}, origin, taken="settings" in wanted)
    if map_line is not None:
        offered["map_line"] = map_line
    elif "map_line" in required:
        raise ControllerError(f"{origin} drives by a map; accepted: where there is one, as in a race")
    unknown = [name for name in required if name not in offered]
    if unknown:
        raise ControllerError(f"{origin} wants {', '.join(unknown)}; a constructor may name {', '.join(offered)}")
    try:
        controller = factory(**{name: value for name, value in offered.items() if name in wanted})
    except (Exception, SystemExit) as error:
        raise ControllerError(f"{origin} cannot be built: {one_line(error)}") from error
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
            raise ControllerError(f"{origin} has no setting {name!r}; accepted: {', '.join(defaults)}")
        accepted = _like(defaults[name], value)
        if accepted:
            raise ControllerError(f"{origin}: setting {name} is {short(value)}; accepted: {accepted}")
    try:
        return kind(**changes)
    except (Exception, SystemExit) as error:
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


def _find_class(source: str, origin: str) -> Any:
    catalogue = _catalogue()
    if source in catalogue:
        module_name, _, class_name = catalogue[source].partition(":")
        return getattr(importlib.import_module(f"fg_mujoco.controllers.{module_name}"), class_name)
    path, colon, class_name = source.rpartition(":")
    if not colon or not path.endswith(".py"):
        known = ", ".join(sorted(catalogue))
        raise ControllerError(f"{origin} is not known; accepted: {known}, or path/to/file.py:ClassName")
    module = _import_file(Path(path), origin)
    found = getattr(module, class_name, None)
    if not isinstance(found, type):
        classes = [n for n, v in vars(module).items() if isinstance(v, type) and v.__module__ == module.__name__]
        raise ControllerError(f"{origin}: no class {class_name!r} there; it has {', '.join(classes) or 'none'}")
    return found


def _import_file(path: Path, origin: str) -> ModuleType:
    if not path.is_file():
        raise ControllerError(f"{origin}: there is no file {path}")
    module = ModuleType(f"fg_mujoco_user_{path.stem}")
    module.__file__ = str(path)
    sys.modules[module.__name__] = module  # dataclasses look their module up there
    try:
        # not by the import system: its cache takes a file that was edited within a second for the old one
        exec(compile(path.read_bytes(), str(path), "exec"), module.__dict__)
    except (Exception, SystemExit) as error:
        raise ControllerError(f"{origin} does not import: {one_line(error)}") from error
    return module


def _checked(controller: Any, origin: str) -> Controller:
    if isinstance(controller, type):
        raise ControllerError(f"{origin} is the class {controller.__name__}; accepted: an object of it")
    if not callable(controller) or not callable(getattr(controller, "reset", None)):
        raise ControllerError(f"{origin} is no controller; accepted: one with __call__(scan, odometry) and reset()")
    return controller  # type: ignore[no-any-return]
