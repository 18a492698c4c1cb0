"""Settings of planners: what each field says of itself, what is accepted, and rows that the native core reads.

    @dataclass(frozen=True, kw_only=True)
    class BubbleSettings(Settings):
        radius: float = setting(0.4, "m", "of the bubble", POSITIVE)
        margin: float = setting_of_car(0.05, "m", "to the side of the car", FROM_ZERO)
        point: Literal["furthest", "middle"] = setting("furthest", text="of the gap")

    PLANNER = np.dtype([("settings", record_type(BubbleSettings)), ("car", CAR_RECORD)])

The value of a setting of the car, `setting_of_car`, was found on the F1TENTH car. Its default, None, means that value
scaled to the planner's car: lengths in proportion to the wheelbase, speeds in proportion to its square root (dynamic
similarity at equal friction, Froude's law), times in proportion to the time constant of the steering servo and the
delay of commands. `for_car` does the scaling.

A setting of the method, `setting_of_method`, has two defaults: the value of the planner's source, and the one that is
refined here. Its default, None, means the one of the planner's `method`; `for_method` replaces it.

In a row a setting that is one of some words is the index of its word: 0, 1. A plain `str`, such as a path, is not in
it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache
from typing import Any, Literal, NamedTuple, TypeVar, cast, get_args, get_origin, get_type_hints

import numpy as np

from fg_mujoco.errors import SettingsError, accepted_names
from fg_mujoco.messages import CarParameters, require
from fg_mujoco.native import record

Record = Any
"""A row of a structured array, or a view of one whose fields are attributes (native_arrays)."""

_F1TENTH_WHEELBASE = 0.3302  # [m] of the car on which the settings of the car were found
F1TENTH_STEERING = 0.02
"""[s] Time constant of the steering servo of that car."""
_SCALES: dict[str, Callable[[CarParameters], float]] = {
    "m": lambda car: relative_size(car),
    "m/s": lambda car: math.sqrt(relative_size(car)),
    "s": lambda car: (car.steering_time_constant + car.command_delay) / F1TENTH_STEERING,
}
"""By unit: of a setting for a car over that for the F1TENTH car."""


_F = TypeVar("_F", bound=Callable[..., Any])


def _once_for_each_class(function: _F) -> _F:
    """Return a function of a class, with a cache of its results."""
    return cast(_F, lru_cache(maxsize=64)(function))


class Accepted(NamedTuple):
    """Numbers that a setting accepts, in words and as a condition."""

    text: str
    holds: Callable[[float], bool]


POSITIVE = Accepted("a positive number", lambda value: 0.0 < value < math.inf)
FROM_ZERO = Accepted("a number from 0", lambda value: 0.0 <= value < math.inf)
SHARE = Accepted("a share above 0, at most 1", lambda value: 0.0 < value <= 1.0)


def setting(default: Any, unit: str = "", text: str = "", accepted: Accepted | None = None) -> Any:
    """Return a field of a settings dataclass.

    Args:
      default: value.
      unit: such as "m" or "m/s"; empty for a number without unit, a word or a switch.
      text: what it is, in a few words.
      accepted: which numbers are; None: any.
    """
    return field(default=default, metadata={"unit": unit, "text": text, "accepted": accepted})


def setting_of_car(value: float, unit: str, text: str, accepted: Accepted | None = None) -> Any:
    """Return a field whose default, None, is `value` [m, m/s, s] scaled from the F1TENTH car to the planner's car."""
    metadata = {"unit": unit, "text": text, "accepted": accepted, "of_f1tenth": value}
    return field(default=None, metadata=metadata)


def setting_of_method(source: Any, refined: Any, unit: str, text: str, accepted: Accepted | None = None) -> Any:
    """Return a field whose default, None, is the value of the planner's method: `source` or `refined`."""
    metadata = {"unit": unit, "text": text, "accepted": accepted, "of_method": {"source": source, "refined": refined}}
    return field(default=None, metadata=metadata)


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Parameters, which are checked against what their fields accept.

    Raises:
      SettingsError: a value that its field does not accept.
    """

    def __post_init__(self) -> None:
        hints, words = _hints(type(self)), _words(type(self))
        for each in fields(self):
            value, accepted = getattr(self, each.name), each.metadata.get("accepted")
            if value is None and ("of_f1tenth" in each.metadata or "of_method" in each.metadata):
                continue
            if each.name in words and value not in words[each.name]:
                self._refuse(each.name, accepted_names(value, words[each.name]))
            if hints[each.name] is bool and not isinstance(value, bool):
                self._refuse(each.name, "accepted: True, False")
            if accepted is not None:
                require(self, accepted.holds, accepted.text, (each.name,), SettingsError)

    def _refuse(self, name: str, said: str) -> None:
        raise SettingsError(f"{type(self).__name__}.{name} is {getattr(self, name)!r}; {said}")


_S = TypeVar("_S", bound=Settings)


def relative_size(car: CarParameters) -> float:
    """Return the size of a car relative to the F1TENTH car, by the wheelbase: 1 for the F1TENTH car itself."""
    return car.wheelbase / _F1TENTH_WHEELBASE


def for_car(settings: _S, car: CarParameters) -> _S:
    """Return settings in which each None that means "from the car" is the value for `car`."""
    scaled = {
        each.name: each.metadata["of_f1tenth"] * _SCALES[each.metadata["unit"]](car)
        for each in fields(settings)
        if "of_f1tenth" in each.metadata and getattr(settings, each.name) is None
    }
    return replace(settings, **scaled) if scaled else settings


def for_method(settings: _S, method: str) -> _S:
    """Return settings of a method, source or refined, in which each None that means "by the method" is its value."""
    chosen: dict[str, Any] = {"method": method} | {
        each.name: each.metadata["of_method"][method]
        for each in fields(settings)
        if "of_method" in each.metadata and getattr(settings, each.name) is None
    }
    return replace(settings, **chosen)


@_once_for_each_class
def record_type(settings: type, native: bool = False) -> np.dtype[np.void]:
    """Return the type of a row with the fields of a dataclass: floats, ints, bools, and words as ints; no strings.

    `native`: the native core has a structure of the class's name, with which the type is compared.
    """
    hints, words = _hints(settings), _words(settings)
    kinds = {each.name: np.int64 if each.name in words else hints[each.name] for each in fields(settings)}
    stored = [(name, kind) for name, kind in kinds.items() if kind is not str]
    return record(settings.__name__, stored) if native else np.dtype(stored, align=True)


def record_values(settings: Any) -> tuple[Any, ...]:
    """Return the values of a row of `record_type(type(settings))`."""
    words = _words(type(settings))
    values = ((name, getattr(settings, name)) for name in record_type(type(settings)).names or ())
    return tuple(words[name].index(value) if name in words else value for name, value in values)


@_once_for_each_class
def _hints(settings: type) -> dict[str, Any]:
    """Return the type of each field of a dataclass."""
    return get_type_hints(settings)


@_once_for_each_class
def _words(settings: type) -> dict[str, tuple[str, ...]]:
    hints = _hints(settings)
    return {f.name: get_args(hints[f.name]) for f in fields(settings) if get_origin(hints[f.name]) is Literal}


CAR_RECORD = record_type(CarParameters, native=True)
"""Type of a row with the parameters of a car."""
