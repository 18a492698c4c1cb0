"""The observation of a policy: an object with a text form, which training and driving share.

    F1TenthEnv(observation="beams:108:max=10, speed:delay=0.05:noise=0.1, steering, previous_action, history:3, flat")

The text lists parts and words, with commas between them. A part is a name, with its options after colons:

| option | meaning |
| --- | --- |
| `beams:N` | the scan with N of its beams, evenly chosen (see `even_beams`); `scan` alone has every `beam_step`-th |
| `max=` | of the scan: a greater distance reads this [m] |
| `delay=` | the value is so old [s], rounded up to whole ticks; before there is one that old, its first |
| `noise=` | standard deviation of Gaussian noise, in the unit of the part |
| `history=K` | the part at K steps of the environment, oldest first, instead of the word's |
| `every=N` | these are N steps apart, and the last one is the present: `speed:history=32:every=8` |

Words, which apply to all parts:

| word | meaning |
| --- | --- |
| `history:K` | the parts at the last K steps of the environment, oldest first; the first fills what is before it |
| `normalised` | each part over a fixed scale (`SCALES`), about -1 to 1; a scan's distance d is d / (1 m + d) |
| `flat` | one vector of all parts, in their order; of a history step after step, or part after part |

Delay and noise imitate a car's sensors. They are part of the environment only: a policy that drives has the sensors
themselves. Noise is drawn from the episode's seed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import SettingsError
from ..messages import require, require_whole, shown
from .observations import DEFAULT_OBSERVATIONS, OBSERVATIONS, ObservationTerm, SensedTerm, Term

LONGEST_DELAY = 1.0
"""[s] Longest delay of a part that is accepted, as of the LiDAR's latency."""

LONGEST_HISTORY = 100

LONGEST_MEMORY = 1000
"""Greatest number of steps between the oldest and the present value of a part."""

SHORT = {"steering": "steering_angle", "offset": "cross_track_error"}
"""Short names of parts."""

_ACCEPTED = (
    "names of parts with their options, as in 'beams:108:max=10,speed:delay=0.05:noise=0.1', and the words history:K, "
    "normalised, flat; a list of these and of ObservationTerms; or an Observation"
)
_OPTIONS = {"max": "greatest", "delay": "delay", "noise": "noise", "history": "history", "every": "every"}
_WHOLE = ("history", "every")  # options that are whole numbers


@dataclass(frozen=True, kw_only=True)
class Part:
    """A part of an observation; SettingsError: an option that is out of its range, or that only the scan has."""

    term: Term
    beams: int | None = None  # of the scan, evenly chosen; None: every `beam_step`-th
    greatest: float | None = None  # [m] of the scan: a greater distance reads this; None: the LiDAR's range_max
    delay: float = 0.0  # [s]
    noise: float = 0.0  # standard deviation, in the unit of the part
    history: int | None = None  # how many steps of the environment are seen; None: as of the whole observation
    every: int = 1  # how many steps these are apart

    def __post_init__(self) -> None:
        require_whole("beams", self.beams, 1, optional=True)
        require_whole("history", self.history, 1, LONGEST_HISTORY, optional=True)
        require_whole("every", self.every, 1)
        if self.every > 1 and (self.history or 1) < 2:
            raise SettingsError(f"observation {self.name!r} with every={self.every}; accepted: with history=2 or more")
        if (reach := ((self.history or 1) - 1) * self.every) > LONGEST_MEMORY:
            said = f"observation {self.name!r} reaches back {reach} steps"
            raise SettingsError(f"{said}; accepted: (history - 1) * every up to {LONGEST_MEMORY}")
        accepted = f"0 to {LONGEST_DELAY:g} s"
        require(self, lambda value: 0.0 <= value <= LONGEST_DELAY, accepted, ("delay",), SettingsError)
        require(self, lambda value: 0.0 <= value < math.inf, "a finite number from 0 on", ("noise",), SettingsError)
        if self.greatest is not None:
            require(self, lambda value: 0.0 < value < math.inf, "a positive number", ("greatest",), SettingsError)
        if self.name != "scan" and (self.beams is not None or self.greatest is not None):
            raise SettingsError(f"observation {self.name!r} with beams or max; accepted: of the scan only")

    @property
    def name(self) -> str:
        """Name of the part in the observation."""
        return self.term.name

    def __str__(self) -> str:
        said = self.name if self.beams is None else f"beams:{self.beams}"
        options = {"max": self.greatest, "delay": self.delay, "noise": self.noise, "history": self.history}
        every = {"every": self.every} if self.every > 1 else {}
        return said + "".join(f":{name}={value!r}" for name, value in (options | every).items() if value)

    @classmethod
    def of(cls, given: Any) -> Part:
        """Return the part of a text, of a Term, or the one that is given.

        Raises:
          SettingsError: it is none.
        """
        if isinstance(given, Part):
            return given
        if isinstance(given, Term):
            return cls(term=given)
        if not isinstance(given, str):
            raise SettingsError(f"an observation is {shown(given)}; accepted: {_ACCEPTED}")
        name, *options = (piece.strip() for piece in given.split(":"))
        values: dict[str, Any] = {}
        if name == "beams":
            count = options.pop(0) if options else ""
            if not count.isascii() or not count.isdigit():
                raise SettingsError(f"observation {given!r} has no number of beams; accepted: beams:N, as beams:108")
            name, values["beams"] = "scan", int(count)
        for option in options:
            key, equals, value = (piece.strip() for piece in option.partition("="))
            if key not in _OPTIONS or not equals or _OPTIONS[key] in values:
                said = f"observation {given!r} has the option {option!r}"
                raise SettingsError(f"{said}; accepted: {', '.join(f'{name}=NUMBER' for name in _OPTIONS)}, each once")
            values[_OPTIONS[key]] = _number(value, given, whole=key in _WHOLE)
        term = OBSERVATIONS.find(SHORT.get(name, name), f", beams:N, {', '.join(SHORT)}, or an ObservationTerm")
        return cls(term=term, **values)


@dataclass(frozen=True, kw_only=True)
class Observation:
    """The observation of a policy: `str(observation)` is its text, and `Observation.of(text)` reads it.

    Raises:
      SettingsError: no part, a part twice, or a history out of its range.
    """

    parts: tuple[Part, ...]
    history: int = 1  # how many steps of the environment are seen
    normalised: bool = False
    flat: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "parts", tuple(map(Part.of, self.parts)))
        require_whole("history", self.history, 1, LONGEST_HISTORY)
        names = [part.name for part in self.parts]
        if not names:
            raise SettingsError(f"observation has no part; accepted: {_ACCEPTED}")
        for name in names:
            if names.count(name) > 1:
                raise SettingsError(f"observation {name!r} stands twice in observation; accepted: once")

    def __str__(self) -> str:
        words = ["history:" + str(self.history)] * (self.history > 1)
        words += ["normalised"] * self.normalised + ["flat"] * self.flat
        return ",".join([*map(str, self.parts), *words])

    @classmethod
    def of(cls, given: Any) -> Observation:
        """Return the Observation of a text or a list, or the one that is given.

        Raises:
          SettingsError: it is none.
        """
        if isinstance(given, Observation):
            return given
        listed = given.split(",") if isinstance(given, str) else given
        if not isinstance(listed, Iterable) or isinstance(listed, (bytes, dict)):
            raise SettingsError(f"observation is {shown(given)}; accepted: {_ACCEPTED}")
        words: dict[str, Any] = {}
        parts: list[Part] = []
        for each in listed:
            word, colon, value = each.strip().partition(":") if isinstance(each, str) else ("", "", "")
            if word in ("normalised", "flat") and not colon:
                words[word] = True
            elif word == "history":
                if not value.isascii() or not value.isdigit():
                    raise SettingsError(f"observation has {each!r}; accepted: history:K, as history:3")
                words[word] = int(value)
            else:
                parts.append(Part.of(each))
        return cls(parts=tuple(parts), **words)

    @property
    def plain(self) -> bool:
        """Whether it is what the sensors read now, part by part."""
        changed = any(part.delay or part.noise or part.history for part in self.parts)
        return not (changed or self.history > 1 or self.normalised or self.flat)


DEFAULT_OBSERVATION = Observation.of(DEFAULT_OBSERVATIONS)


def as_privileged(given: Any) -> tuple[ObservationTerm, ...]:
    """Return the terms of a text such as "pose,offset,mu", or of a list of names and ObservationTerms.

    SettingsError: no such list, a name that is none or that a car senses itself, or one twice.
    """
    listed = [each for each in given.split(",") if each.strip()] if isinstance(given, str) else given
    if not isinstance(listed, Iterable) or isinstance(listed, (bytes, dict)):
        said = f"privileged is {shown(given)}"
        raise SettingsError(f"{said}; accepted: names such as 'pose,offset,mu', or a list of them and ObservationTerms")
    found: list[ObservationTerm] = []
    for each in listed:
        part = Part.of(each)
        if isinstance(part.term, SensedTerm) or part != Part(term=part.term):
            known = [name for name in OBSERVATIONS.names() if isinstance(OBSERVATIONS.find(name), ObservationTerm)]
            raise SettingsError(f"privileged has {shown(each)}; accepted: {', '.join(known)}, without options")
        if part.term in found:
            raise SettingsError(f"{part.name!r} stands twice in privileged; accepted: once")
        found.append(part.term)
    return tuple(found)


def even_beams(count: int, chosen: int) -> NDArray[np.int64]:
    """Return which beams are seen, evenly chosen: from the first to the last, and on both sides the same. Shape (n,).

    Beam k of n is at k (count - 1) / (n - 1), rounded; the left half mirrors the right. One alone is straight ahead.
    SettingsError: more than the LiDAR has.
    """
    if not 1 <= chosen <= count:
        raise SettingsError(f"observation has beams:{chosen} of {count}; accepted: beams:1 to beams:{count}")
    if chosen == 1:
        return np.array([(count - 1) // 2])
    places = np.arange(chosen, dtype=np.int64)
    right = (2 * places * (count - 1) + (chosen - 1)) // (2 * (chosen - 1))  # rounded
    half = chosen // 2
    right[chosen - half :] = count - 1 - right[:half][::-1]
    return right


def _number(text: str, given: str, *, whole: bool) -> float:
    try:
        return int(text) if whole else float(text)
    except ValueError as error:
        accepted = "a whole number" if whole else "a number"
        raise SettingsError(f"observation {given!r} has {text!r}; accepted: {accepted}") from error
