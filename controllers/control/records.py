"""Settings as rows of structured arrays, whose fields a kernel reads by name: `p.settings.lookahead`.

    PLANNER = np.dtype([("settings", record_type(GapFinderSettings)), ("car", CAR), ("max_speed", np.float64)])

The planners of a batch are an array of such rows, one for each world. A setting that is one of some words,
`point: Literal["furthest", "middle"]`, is in a row the place of its word: 0, 1. A plain `str`, such as a path, is no
number and stays out of it.
"""

from __future__ import annotations

from dataclasses import fields
from typing import Any, Literal, get_args, get_origin, get_type_hints

import numpy as np

from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import CarParameters

Record = Any
"""A row of a structured array, as a kernel gets it."""


def record_type(settings: type) -> np.dtype[np.void]:
    """Return the type of a row with the fields of a dataclass: floats, ints, bools, and words as ints; no strings."""
    hints, words = get_type_hints(settings), _words(settings)
    return np.dtype([(name, np.dtype(np.int64 if name in words else hints[name])) for name in _in_a_row(settings)])


def record_values(settings: Any) -> tuple[Any, ...]:
    """Return the values of a row of `record_type(type(settings))`."""
    words = _words(type(settings))
    values = ((name, getattr(settings, name)) for name in _in_a_row(type(settings)))
    return tuple(words[name].index(value) if name in words else value for name, value in values)


def require_words(settings: Any) -> None:
    """Raise SettingsError for the first field of a dataclass that should be one of some words and is not."""
    for name, words in _words(type(settings)).items():
        value = getattr(settings, name)
        if value not in words:
            raise SettingsError(f"{type(settings).__name__}.{name} is {value!r}; accepted: {', '.join(words)}")


def _in_a_row(settings: type) -> list[str]:
    hints = get_type_hints(settings)
    return [f.name for f in fields(settings) if hints[f.name] is not str]


def _words(settings: type) -> dict[str, tuple[str, ...]]:
    hints = get_type_hints(settings)
    return {f.name: get_args(hints[f.name]) for f in fields(settings) if get_origin(hints[f.name]) is Literal}


CAR = record_type(CarParameters)
