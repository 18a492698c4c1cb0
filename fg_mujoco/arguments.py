"""Answers a call or an attribute that does not exist with what does: race has no argument 'map'; ... 'track'?"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import types
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar, cast

import numpy as np

from .errors import ArgumentError, SettingsError, accepted_names, gone, nearest

if TYPE_CHECKING:
    from typing_extensions import Self

_F = TypeVar("_F", bound=Callable[..., Any])
_C = TypeVar("_C", bound=type)

_VIEW = "`fg-mujoco view` shows a race as it goes"
_WRITE = "fg_mujoco.write_run(result, DIR) writes a run folder"
_VIDEO = "fg_mujoco.write_video makes a video of a result"
_RATHER = {
    "gui": _VIEW, "headless": _VIEW, "live": _VIEW, "output": _WRITE, "out": _WRITE, "record": _VIDEO,
    "render": _VIDEO, "render_mode": _VIDEO, "save": _WRITE, "show": _VIEW, "verbose": "`watch` is called once a tick",
    "video": _VIDEO, "vis": _VIEW, "visualize": _VIEW,
}  # fmt: skip
"""Arguments that others have -> what does the same here."""

_LEAST_SIMILARITY = 0.7  # of an attribute that may have been meant


def setting(default: Any, text: str, metavar: str, group: str, *, told: bool = False) -> Any:
    """Return a field of a dataclass of settings that the command line has as an option of its keyword.

    `{names}` in the text are those of `cli.options.NAMES`; no metavar: a flag; `group`: its title in the help; `told`:
    planners are told of it, see PLANNER_OPTIONS.
    """
    return dataclasses.field(default=default, metadata={"help": text, "metavar": metavar, "group": group, "told": told})


def explained(function: _F, name: str = "") -> _F:
    """Return a function whose wrong arguments are refused in one line that names the right ones.

    NumPy's numbers become Python's: settings are checked to be those, and JSON has no others.
    """

    @functools.wraps(function)
    def explaining(*args: Any, **named: Any) -> Any:
        for key, value in named.items():
            if isinstance(value, np.generic):
                named[key] = value.item()
        try:
            return function(*args, **named)
        except TypeError:
            refusal = _refusal(function, name or function.__name__, args, named)
            if refusal is None:  # the error is one of the function's own code
                raise
        raise ArgumentError(refusal)

    return cast(_F, explaining)


def _refusal(function: Callable[..., Any], name: str, args: tuple[Any, ...], named: dict[str, Any]) -> str | None:
    """Return the message for wrong arguments of a call; None: no fault is known here."""
    parameters = list(inspect.signature(function).parameters.values())
    if parameters and parameters[0].name == "self":
        parameters, args = parameters[1:], args[1:]
    kinds = {each.kind for each in parameters}
    taken = {each.name: each for each in parameters if each.kind in (each.POSITIONAL_OR_KEYWORD, each.KEYWORD_ONLY)}
    in_order = [each.name for each in parameters if each.kind in (each.POSITIONAL_OR_KEYWORD, each.POSITIONAL_ONLY)]
    needed = [each.name for each in parameters if each.default is each.empty and each.name in taken]
    call = [each for each in taken if each in in_order or each in (needed or taken)]
    accepted = f"{name}({', '.join(each if each in in_order else f'{each}=...' for each in call)})"
    known = [*taken, *_unpacked(function, parameters)]
    for given in named:
        if given not in known and (inspect.Parameter.VAR_KEYWORD not in kinds or len(known) > len(taken)):
            return unknown_argument(name, given, known)
    if len(args) > len(in_order) and inspect.Parameter.VAR_POSITIONAL not in kinds:
        most = f"{len(in_order)} at most" if in_order else "none"
        return f"{name} is given {len(args)} arguments without their names; accepted: {most}, as in {accepted}"
    lacking = [each for each in needed if each not in named and each not in in_order[: len(args)]]
    return f"{name} lacks {', '.join(lacking)}; accepted: {accepted}" if lacking else None


def _unpacked(function: Callable[..., Any], parameters: Iterable[inspect.Parameter]) -> Iterable[str]:
    """Return the keywords of a function's `**keywords: Unpack[Names]`, where `Names` is a TypedDict of its module."""
    for each in parameters:
        if each.kind is each.VAR_KEYWORD and str(each.annotation).startswith("Unpack["):
            names = inspect.unwrap(function).__globals__.get(str(each.annotation)[len("Unpack[") : -1])
            return list(getattr(names, "__annotations__", ()))
    return []


def unknown_argument(name: str, given: str, taken: Iterable[str]) -> str:
    """Return the refusal of an argument that a function has not: those that it has, and the one that was meant."""
    names = list(dict.fromkeys(taken))
    meant = nearest(given, names)
    only_within_a_word = meant is not None and given in meant and given not in meant.split("_")
    rather = gone(f"--{given}") or (_RATHER.get(given) if meant is None or only_within_a_word else None)
    accepted = accepted_names("" if rather else given, names)
    return f"{name} has no argument {given!r}; {accepted}" + (f"; {rather}" if rather else "")


def explain_class(kind: _C) -> _C:
    """Explain the arguments of a class and of its public methods, in place."""
    made = "__init__"  # its own or that of a base
    if isinstance(getattr(kind, made), types.FunctionType):
        setattr(kind, made, explained(getattr(kind, made), kind.__name__))
    for name, member in list(vars(kind).items()):
        if not name.startswith("_") and isinstance(member, types.FunctionType):
            setattr(kind, name, explained(member, f"{kind.__name__}.{name}"))
    return kind


class Suggesting:
    """An attribute that such an object has not is answered with the one that was probably meant."""

    if not TYPE_CHECKING:  # a checker of types is to find those that do not exist

        def __getattr__(self, name: str) -> Any:
            owner = type(self).__name__
            if name.startswith("_"):
                raise AttributeError(f"{owner!r} object has no attribute {name!r}")
            meant = self._meant(name)
            raise AttributeError(f"{owner} has no {name!r}" + ("" if meant is None else f"; did you mean {meant!r}?"))

    def _meant(self, name: str) -> str | None:
        """Return the attribute that was probably meant; None: it is not known."""
        return nearest(name, self._names(), cutoff=_LEAST_SIMILARITY)

    def _names(self) -> list[str]:
        """Return the names of its attributes."""
        return [each for each in dir(self) if not each.startswith("_")]


class Uncopied:
    """Base of what holds addresses of memory: a copy would write to the memory of the original, so there is none."""

    def __reduce_ex__(self, protocol: Any) -> Any:
        """Refuse a copy, and pickling; ArgumentError: always; it is a TypeError."""
        said = f"{type(self).__name__} cannot be copied or pickled, for it holds addresses of memory"
        raise ArgumentError(f"{said}; accepted: another one, made in the same way")


class Remade(Uncopied):
    """Base of what is copied and pickled by making it again, with the calls that it noted with `_note_call`."""

    __signature__: ClassVar[inspect.Signature]
    _made_of: tuple[tuple[Any, ...], dict[str, Any]]
    _calls_since: dict[Any, tuple[Any, ...]]

    def __init_subclass__(cls, **named: Any) -> None:
        """Say by which arguments it is made: before Python 3.11.3 `inspect` finds those of `__new__`."""
        super().__init_subclass__(**named)
        signature = inspect.signature(cls.__init__)
        cls.__signature__ = signature.replace(parameters=[*signature.parameters.values()][1:])

    def __new__(cls, *args: Any, **named: Any) -> Self:
        """Note the arguments that it is made of."""
        made = super().__new__(cls)
        made._made_of, made._calls_since = (args, named), {}
        return made

    def _note_call(self, method: str, *args: Any, of: Any = None) -> None:
        """Note a call that a copy repeats; it takes the place of an earlier one of the same method and `of`."""
        self._calls_since.pop((method, of), None)
        self._calls_since[method, of] = args

    def __reduce_ex__(self, protocol: Any) -> Any:
        """Return what makes it again."""
        kept = {name: vars(self)[name] for name in ("spec",) if name in vars(self)}  # Gymnasium's, of `make`
        return _made_again, (type(self), *self._made_of, self._calls_since), kept


def _made_again(kind: Any, args: tuple[Any, ...], named: dict[str, Any], since: dict[Any, tuple[Any, ...]]) -> Any:
    made = kind(*args, **named)
    for (method, _), given in since.items():
        getattr(made, method)(*given)
    return made


def with_underscores(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values by name, hyphens in names as underscores; SettingsError: a name is there with both."""
    found: dict[str, Any] = {}
    for name, value in values.items():
        plain = name.replace("-", "_")
        if plain in found:
            raise SettingsError(f"{name!r} was given before; accepted: each setting once")
        found[plain] = value
    return found
