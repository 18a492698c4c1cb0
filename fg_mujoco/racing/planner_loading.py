"""Builds a planner with its settings and its context, and holds it to its contract.

A planner is a class with `__call__(scan, odometry)` and `reset()`, or a function `f(scan, odometry)`, which keeps
nothing from scan to scan. A planner with settings names their dataclass as class attribute `Settings`, and its
constructor takes `settings`. `planner_sources` finds its class.
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any

from ..errors import ControllerError, SettingsError, accepted_names
from ..messages import CarParameters, Controller, MapLine, PlannerContext
from ..registry import PARTS
from ..simulation.course_loading import load_track
from ..simulation.planner_adapter import short, short_text, wanted_sensors
from ..simulation.planner_failure import error_text, file_of, is_of_planner, one_line, without_exit
from .planner_sources import A_PLANNER, find_controller, planner_of

POSE_SETTINGS = frozenset({"pose", "pose_start", "pose_map", "particles"})
"""Settings that every planner has besides its own, unless it has one of that name: see PoseSettings."""


@without_exit()
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
    """Return a controller, built with those of its settings and of the context that its constructor names.

    Args:
      source: a bundled name, `path/to/file.py:NAME` of a class or a function, a controller, which is taken as it is, or
        a function `f(scan, odometry)`.
      context: what it may know, as `DriveSettings.context` makes it; None: a PlannerContext of `car`, `mu`,
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
        return _checked(source, origin, context)
    if context is None:
        if car is None or mu is None or max_speed is None:
            missing = [name for name, value in (("car", car), ("mu", mu), ("max_speed", max_speed)) if value is None]
            raise ControllerError(f"make_controller lacks {', '.join(missing)}; accepted: a context, or all three")
        context = PlannerContext(car=car, mu=mu, max_speed=max_speed, map_line=map_line)
    return build_controller(find_controller(source), source, context, settings)


@without_exit()
def build_controller(
    factory: Any, source: str, context: PlannerContext, settings: Mapping[str, Any] | None = None
) -> Controller:
    """Return a controller of the class that `find_controller(source)` returned; otherwise as `make_controller`."""
    origin = f"controller {source!r}"
    factory, settings, context, localiser = _with_pose(factory, source, context, settings or {})
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
        raise ControllerError(f"{origin} cannot be built: {error_text(error, file_of(factory))}") from error
    if localiser is not None:
        controller.localiser = localiser
    return _checked(controller, origin, context)


def _with_pose(
    factory: Any, source: str, context: PlannerContext, settings: Mapping[str, Any]
) -> tuple[Any, Mapping[str, Any], PlannerContext, Any]:
    """Return the class to be built, its own settings, its context, and what finds its pose; None: it has the true one.

    Raises:
      ControllerError: settings of the pose that cannot be, or a map in which no pose can be found.
      TrackError: a map that cannot be read.
    """
    kind = getattr(factory, "Settings", None)
    own_names = {f.name for f in fields(kind)} if isinstance(kind, type) and is_dataclass(kind) else set[str]()
    if getattr(factory, "any_settings", False) and "pose" not in settings:
        return factory, settings, context, None  # they are parameters of its nodes
    chosen = {name: value for name, value in settings.items() if name in POSE_SETTINGS - own_names}
    if not chosen:
        return factory, settings, context, None
    origin, own = f"controller {source!r}", {name: settings[name] for name in settings if name not in chosen}
    try:
        pose = PARTS.find("pose settings")(**chosen)
        if pose.pose_map:
            context = replace(context, map_line=load_track(pose.pose_map).map_line)
        if pose.pose == "truth":
            return factory, own, context, None
        localiser = PARTS.find("localiser").of(pose, context.map_line, context.car, context.seed)
        return PARTS.find("localised")(factory), own, context, localiser
    except SettingsError as error:
        raise ControllerError(f"{origin}: {str(error).removeprefix('PoseSettings.')}") from error


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
    """Return the kind of value that a default asks for; an empty text where the value is of it, or any is accepted."""
    if isinstance(default, bool):
        return "" if isinstance(value, bool) else "True, False"
    if isinstance(default, int):
        return "" if isinstance(value, int) and not isinstance(value, bool) else "a whole number"
    if isinstance(default, float):
        return "" if isinstance(value, (int, float)) and not isinstance(value, bool) else "a number"
    return ""


def _checked(controller: Any, origin: str, context: PlannerContext | None) -> Controller:
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
        raise ControllerError(f"{origin} is no controller; accepted: {A_PLANNER}")
    if context is not None:
        for name in wanted_sensors(type(controller)):
            if name not in context.sensors:
                has = accepted_names(name, context.sensors) if context.sensors else f"accepted: sensors=[{name!r}]"
                raise ControllerError(f"{origin} reads sensor {name!r}, which its car does not have; {has}")
    return controller  # type: ignore[no-any-return]
