"""Finds planners by the texts that name them, and builds them with their settings and their context.

A text is `gap_finder`, a bundled or registered name; `path/to/file.py:ClassName`, a class or a function in a file;
`policy.onnx`, a trained policy; or `ros:path/to/node.py`, of a scheme that an add-on registers. Settings follow in
brackets: `gap_finder[lookahead=8]`.

A planner is a class with `__call__(scan, odometry)` and `reset()`, or a function `f(scan, odometry)`, which keeps
nothing from scan to scan. Its settings are its keyword arguments, those of a class the keywords of its constructor; or
a class names their dataclass as its attribute `Settings`, and its constructor takes `settings`. Other packages register
planners as entry points of the group `fg_mujoco.controllers`:

    [project.entry-points."fg_mujoco.controllers"]
    my_planner = "my_package.my_module:MyPlanner"

A bundled name stays that of the bundled planner. A name that two packages register is refused.
"""

from __future__ import annotations

import hashlib
import inspect
import linecache
import math
import os
import re
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from fg_mujoco.controllers import BASELINES, CONTROLLERS

from ..course.files import LONGEST_NAME, file_sha256, is_file, kept_folder
from ..errors import ControllerError, SettingsError, accepted_names, gone, is_of_planner
from ..messages import CarParameters, Controller, DriveCommand, LaserScan, MapLine, Odometry, PlannerContext
from ..registry import Registry, added, package_of
from ..simulation.planner_adapter import short, short_text, wanted_sensors

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

PLANNERS: Registry[Any] = Registry(
    "controller",
    ControllerError,
    "fg_mujoco.controllers",
    {name: f"fg_mujoco.controllers.{place}" for name, place in (CONTROLLERS | BASELINES).items()} | added("PLANNERS"),
)

READ = "__fg_mujoco_read__"
"""Name in a module that was read from a user's file: the bytes that were read."""

Value = float | int | bool | str
"""Of a setting, as text can say it."""

_A_PLANNER = "one with __call__(scan, odometry) and reset(), or a function of (scan, odometry)"
_FILE = ", path/to/file.py:ClassName, or a policy's file"


# texts


@dataclass(frozen=True, kw_only=True)
class PlannerScheme:
    """Functions of an add-on that has planners of a scheme, by their texts."""

    find: Callable[[str], type]  # returns a class of planners
    code: Callable[[str], bytes]  # returns the code that the text names, unexecuted
    vehicle: Callable[[bytes], str | None] = lambda code: None  # returns which vehicle such code is for; None: any


SCHEMES: Registry[PlannerScheme] = Registry("scheme", ControllerError, own=added("SCHEMES"))
"""Kinds of planners that are no Python classes in a file, which add-ons register."""

POLICY = "policy"
"""The scheme of trained policies: a file that ends in one of POLICY_ENDINGS, or a folder with a POLICY_FILE."""

POLICY_ENDINGS = (".onnx", ".zip")
POLICY_FILE = "policy.onnx"

_NAME = re.compile(r":\w*$")  # behind the path in the text of a scheme


def scheme_of(source: str) -> str:
    """Return the scheme of a controller's text, such as "ros"; an empty text where it has none."""
    scheme, colon, _ = source.partition(":")
    if colon and scheme in SCHEMES and scheme != POLICY:
        return scheme
    folder = source not in PLANNERS and is_file(Path(source) / POLICY_FILE)
    return POLICY if folder or source.endswith(POLICY_ENDINGS) else ""


def file_in(source: str) -> Path | None:
    """Return the file that a controller's text names: of a class, a node, a launch file or a policy; None: a name."""
    scheme = scheme_of(source)
    if scheme == POLICY:
        return Path(source) if source.endswith(POLICY_ENDINGS) else Path(source) / POLICY_FILE
    if scheme:
        return Path(_NAME.sub("", source.removeprefix(f"{scheme}:")))
    path = source if source.endswith(".py") else source.rpartition(":")[0]
    return Path(path) if path.endswith(".py") else None


def code_of(source: str) -> bytes | None:
    """Return the code that a controller's text names, unexecuted; of a launch file that of all its nodes.

    None: it is a name.

    Raises:
      ControllerError, OSError: it cannot be read.
    """
    path, scheme = file_in(source), scheme_of(source)
    if path is None:
        return None
    return SCHEMES.find(scheme).code(source) if scheme else path.read_bytes()


def usual_vehicle(controller: str | Controller) -> str | None:
    """Return the vehicle that the code of a controller of a scheme is for; None: any, or it cannot be read."""
    try:
        source, _ = split_controller(controller, None)
        if isinstance(source, str) and (scheme := scheme_of(source)):
            found = SCHEMES.find(scheme)
            return found.vehicle(found.code(source))
    except (ControllerError, OSError):  # which is told when the planner is made
        pass
    return None


def moved_to(source: str, path: str | Path) -> str:
    """Return a controller's text with the same file in another place."""
    scheme = scheme_of(source)
    if scheme == POLICY:
        return str(path)
    if scheme:
        name = _NAME.search(source.removeprefix(f"{scheme}:"))
        return f"{scheme}:{path}{name.group() if name else ''}"
    return str(path) if source.endswith(".py") else f"{path}:{source.rpartition(':')[2]}"


# settings in brackets

_CHOICE = re.compile(r"([^\[\]]+?)\s*(?:\[([^\[\]]*)\])?")
_WORD = re.compile(r"[A-Za-z_./~][\w./+~@%# -]*|[^\[\],|:=\x00-\x1f]*/[^\[\],|:=\x00-\x1f]*")  # and paths
_WORDS: dict[str, Value] = {"true": True, "false": False, "off": math.inf, "inf": math.inf}


@dataclass(frozen=True)
class ControllerChoice:
    """A controller and those of its settings that differ from its own."""

    source: str  # its text without brackets
    settings: tuple[tuple[str, Value], ...] = ()

    @classmethod
    def of(cls, text: str, what: str = "controller") -> ControllerChoice:
        """Read `name` or `name[setting=value,...]`; a value is a number, true, false or a word.

        Args:
          text: to be read.
          what: the text names, for messages.

        Raises:
          SettingsError: a text of another form.
        """
        if len(text) > LONGEST_NAME:
            said = f"controller {text[:60]!r}... has {len(text)} characters"
            raise SettingsError(f"{said}; accepted: {LONGEST_NAME} at most")
        match = _CHOICE.fullmatch(text.strip())
        if match is None:
            raise SettingsError(f"{what} {text!r}; accepted: NAME, or NAME[SETTING=VALUE,SETTING=VALUE]")
        source, inside = match.groups()
        try:
            settings = {} if inside is None else read_settings_text(inside)
        except SettingsError as error:
            raise SettingsError(f"{what} {text!r}: {error}") from error
        return cls(source, tuple(settings.items()))

    @property
    def label(self) -> str:
        """Its name in tables: a file without its folder."""
        return with_settings(Path(self.source).name, dict(self.settings))

    @property
    def sha256(self) -> str | None:
        """SHA-256 of the user's code that the text names; None of a bundled or registered planner."""
        if scheme_of(self.source):
            return hashlib.sha256(code_of(self.source) or b"").hexdigest()
        path = file_in(self.source)
        return None if path is None else file_sha256(path)

    def settings_with(self, others: Mapping[str, Any]) -> dict[str, Any]:
        """Return the settings in its brackets and `others`, which are given outside them.

        Raises:
          SettingsError: one is given twice.
        """
        twice = [name for name, _ in self.settings if name in others]
        if twice:
            said = f"{twice[0]} is given in the brackets of controller {self.label!r} and in planner_settings"
            raise SettingsError(f"{said}; accepted: one of them")
        return {**dict(self.settings), **others}

    def load(self) -> Any:
        """Return the class or function of the planner; errors are those of `find_controller`."""
        return find_controller(self.source)


def with_settings(source: str, settings: Mapping[str, Any]) -> str:
    """Return a controller's name with settings in brackets, where there are any."""
    inside = ",".join(f"{name}={str(v).lower() if isinstance(v, bool) else v}" for name, v in settings.items())
    return source + (f"[{inside}]" if inside else "")


def split_controller(
    controller: str | Controller, planner_settings: Mapping[str, Any] | None
) -> tuple[str | Controller, dict[str, Any]]:
    """Return a controller without the settings in its brackets, and these together with `planner_settings`.

    Raises:
      SettingsError: a text that is no controller, or a setting that is given twice.
    """
    if isinstance(controller, os.PathLike):
        controller = os.fspath(controller)
    if not isinstance(controller, str):
        return controller, dict(planner_settings or {})
    choice = ControllerChoice.of(controller)
    return choice.source, choice.settings_with(planner_settings or {})


def read_settings_text(text: str) -> dict[str, Value]:
    """Return the settings in `setting=value,setting=value` by name; a value is a number, true, false or a word.

    Raises:
      SettingsError: a part of another form, or a setting that is given twice.
    """
    settings: dict[str, Value] = {}
    for part in text.split(","):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not (name and equals and value) or name in settings or set(value) & set("|:"):
            raise SettingsError(f"{part!r}; accepted: SETTING=VALUE, each setting once")
        settings[name] = read_value(value)
    return settings


def read_value(text: str) -> Value:
    """Return the number, the truth value or the word that a text is."""
    text = text.strip()
    for read in (int, float):
        try:
            return _WORDS[text] if text in _WORDS else read(text)
        except ValueError:
            continue
    if not _WORD.fullmatch(text):
        raise SettingsError(f"{text!r}; accepted: LOW:HIGH, or values A|B|C that are numbers, true, false or words")
    return text


# finding a class


def bundled_names() -> tuple[str, ...]:
    """Return the names of the bundled controllers."""
    return tuple(sorted(PLANNERS))


def controller_names() -> tuple[str, ...]:
    """Return the names of the bundled controllers and of those that installed packages register; without baselines."""
    return tuple(sorted(set(PLANNERS.names()) - set(BASELINES)))


@kept_folder()
def find_controller(source: str) -> Any:
    """Return the class of a controller without settings; one in a file is read afresh.

    Raises:
      ControllerError: an unknown name, or a file or class that cannot be loaded.
    """
    said = f"controller {source!r}"
    if source in PLANNERS:
        return PLANNERS.find(source)
    if scheme := scheme_of(source):
        return SCHEMES.find(scheme).find(source)
    if source.endswith(".json") or is_file(Path(source) / "policy.json"):
        raise ControllerError(f"{said}: {gone('policy.json')}")
    path, class_name = file_in(source), "" if source.endswith(".py") else source.rpartition(":")[2]
    if path is None:
        return _load(PLANNERS.entry_point(source, _FILE), said)
    if not class_name and not is_file(path):
        known = accepted_names(source, controller_names(), _FILE)
        raise ControllerError(f"{said}: there is no file {source}; {known}")
    module = import_file(path, said)
    found = getattr(module, class_name, None)
    if inspect.isfunction(found):
        return _planner_of(found, said)
    if isinstance(found, type):
        return found
    names = _planners_in(module)
    if not names:
        raise ControllerError(f"{said}: there is no class in the file; accepted: {_A_PLANNER}")
    if not class_name:
        ways = ", ".join(f"{source.removesuffix(':')}:{name}" for name in names)
        raise ControllerError(f"{said}: the name of its class is missing; accepted: {ways}")
    raise ControllerError(f"{said}: the file has no class {class_name!r}; {accepted_names(class_name, names)}")


@kept_folder()
def only_planner(source: str) -> str:
    """Return the text of a planner's file with the name of the only planner in it; any other text as it is.

    Raises:
      ControllerError: the file cannot be loaded.
    """
    if not source.endswith(".py") or not is_file(source):
        return source
    names = _planners_in(import_file(Path(source), f"controller {source!r}"))
    return f"{source}:{names[0]}" if len(names) == 1 else source


def _planners_in(module: ModuleType) -> list[str]:
    """Return the names of the classes and functions of a user's file that plan; of all its classes where none does."""
    own = [value for value in vars(module).values() if getattr(value, "__module__", None) == module.__name__]
    classes = [value for value in own if isinstance(value, type)]
    planners: list[Any] = [each for each in classes if any("__call__" in vars(base) for base in each.__mro__)]
    for each in own:
        parameters = list(inspect.signature(each).parameters.values()) if inspect.isfunction(each) else []
        settings = all(p.default is not p.empty for p in parameters[2:])
        if [p.name for p in parameters[:2]] == ["scan", "odometry"] and settings:
            planners.append(each)
    return [each.__name__ for each in planners or classes]


def _planner_of(function: Callable[[LaserScan, Odometry], DriveCommand], said: str) -> type:
    """Return a class of planners that answer what a function answers. It has the name and the file of the function."""
    name, signature = function.__name__, inspect.signature(function)
    try:
        signature.bind(None, None)
    except TypeError:
        raise ControllerError(f"{said} is the function {name}{signature}; accepted: {name}(scan, odometry)") from None
    settings = [
        p.replace(kind=p.KEYWORD_ONLY) for p in list(signature.parameters.values())[2:] if p.default is not p.empty
    ]

    def call(self: Any, scan: LaserScan, odometry: Odometry) -> DriveCommand:
        return function(scan, odometry, **self.settings)

    members = {"__call__": call if settings else staticmethod(function), "reset": lambda self: None, **vars(function)}
    if settings:
        members |= {"__init__": lambda self, **given: setattr(self, "settings", given)}
        members |= {"__signature__": inspect.Signature(settings)}
    return type(name, (), {**members, "__module__": function.__module__, "__doc__": function.__doc__})


def _load(point: EntryPoint, said: str) -> Any:
    try:
        found = point.load()
    except BaseException as error:
        if not is_of_planner(error):
            raise
        raise ControllerError(f"{said}, of {package_of(point)}, does not load: {_why(error)}") from error
    if inspect.isfunction(found):
        return _planner_of(found, said)
    if not isinstance(found, type):
        raise ControllerError(f"{said}, of {package_of(point)}, is {short(found)}; accepted: a class or a function")
    return found


def import_file(path: Path, origin: str) -> ModuleType:
    """Return the module of a user's file, read afresh; `origin` names what is looked for there, in messages.

    Raises:
      ControllerError: there is no such file, or it does not import; with the line.
    """
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
        raise ControllerError(f"{origin} does not import: {_why(error, path)}") from error
    return module


# building one


@kept_folder()
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
      mu: friction coefficient that it is to assume; inf switches its friction limits off.
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
            source = _planner_of(source, f"controller {source.__name__}")()
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


@kept_folder()
def build_controller(
    factory: Any, source: str, context: PlannerContext, settings: Mapping[str, Any] | None = None
) -> Controller:
    """Return a controller of the class that `find_controller(source)` returned; otherwise as `make_controller`."""
    origin = f"controller {source!r}"
    offered = {each.name: getattr(context, each.name) for each in fields(context)}
    try:
        parameters = inspect.signature(factory).parameters.values()
    except ValueError as error:
        raise ControllerError(f"{origin} cannot be built: {_why(error)}") from error
    wanted = [p.name for p in parameters if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)]
    required = [p.name for p in parameters if p.name in wanted and p.default is p.empty]
    if getattr(factory, "any_settings", False):  # parameters of nodes, which are known when these run
        offered["settings"] = dict(settings or {})
    elif _settings_class(factory) is not None:
        if settings or "settings" in required:
            offered["settings"] = _settings(factory, settings or {}, origin)
    elif settings:
        offered |= _known_settings(factory, settings, origin)
    if context.map_line is None:
        del offered["map_line"]
        if "map_line" in required:
            raise ControllerError(f"{origin} drives by a map; accepted: where there is one, as in a race")
    if "assist" not in wanted and context.assist not in ("full", "none"):
        said = f"{origin} decides by itself, and assist is {context.assist!r}"
        raise ControllerError(f"{said}; accepted: none, or a class of Planner, whose stages can be chosen")
    unknown = [name for name in required if name not in offered]
    if unknown:
        raise ControllerError(f"{origin} wants {', '.join(unknown)}; a constructor may name {', '.join(offered)}")
    try:
        controller = factory(**{name: value for name, value in offered.items() if name in wanted})
    except SettingsError as error:
        raise ControllerError(f"{origin}: {error}") from error
    except BaseException as error:
        if not is_of_planner(error):
            raise
        raise ControllerError(f"{origin} cannot be built: {_why(error, factory)}") from error
    return _checked(controller, origin, context)


def settings_of(factory: Any) -> dict[str, Any]:
    """Return the settings of a planner's class and their defaults: of `Settings`, or keywords of its constructor."""
    kind = _settings_class(factory)
    if kind is not None:
        return {field.name: field.default for field in fields(kind) if field.init}
    told = {each.name for each in fields(PlannerContext)}
    parameters = inspect.signature(factory).parameters.values()
    return {p.name: p.default for p in parameters if p.default is not p.empty and p.name not in told}


def _settings_class(factory: Any) -> Any:
    """Return the dataclass of a class's settings, which its constructor takes; None: it has none."""
    kind = getattr(factory, "Settings", None)
    taken = isinstance(kind, type) and is_dataclass(kind) and "settings" in inspect.signature(factory).parameters
    return kind if taken else None


def _known_settings(factory: Any, changes: Mapping[str, Any], origin: str) -> Mapping[str, Any]:
    """Refuse settings that a controller's class does not have, or values of another kind than its own."""
    defaults = settings_of(factory)
    for name, value in changes.items():
        if name not in defaults:
            accepted = accepted_names(name, defaults) if defaults else "accepted: none, for it has no settings"
            raise ControllerError(f"{origin} has no setting {name!r}; {_gone(name) or accepted}")
        kind_of_value = _kind_unlike(defaults[name], value)
        if kind_of_value:
            raise ControllerError(f"{origin}: setting {name} is {short(value)}; accepted: {kind_of_value}")
    return changes


def _settings(factory: Any, changes: Mapping[str, Any], origin: str) -> Any:
    """Return the settings of a controller's class with some of them changed."""
    kind, _ = _settings_class(factory), _known_settings(factory, changes, origin)
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
        raise ControllerError(f"{origin} cannot have settings {short_text(given)}: {_why(error)}") from error


def _gone(name: str) -> str | None:
    return gone(f"setting {name}")


def _kind_unlike(default: Any, value: Any) -> str:
    """Return the kind of value that a default asks for, if `value` is of another kind; else an empty text."""
    if isinstance(default, bool):
        return "" if isinstance(value, bool) else "True, False"
    if isinstance(default, int):
        return "" if isinstance(value, int) and not isinstance(value, bool) else "a whole number"
    if isinstance(default, float):
        return "" if isinstance(value, (int, float)) and not isinstance(value, bool) else "a number"
    return ""


def _checked(controller: Any, origin: str, context: PlannerContext | None) -> Controller:
    """Return a controller that has what its contract asks for, and whose sensors the car has."""
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
    if context is not None:
        for name in wanted_sensors(type(controller)):
            if name not in context.sensors:
                has = accepted_names(name, context.sensors) if context.sensors else f"accepted: sensors=[{name!r}]"
                raise ControllerError(f"{origin} reads sensor {name!r}, which its car does not have; {has}")
    return controller  # type: ignore[no-any-return]


def _why(error: BaseException, found: Any = None) -> str:
    """Return the kind and message of an error, and the line in a planner's file, or in that of what was found."""
    from ..simulation.planner_failure import error_text, file_of

    return error_text(error, str(found) if isinstance(found, Path) else file_of(found))
