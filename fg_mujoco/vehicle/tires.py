"""Tires: how the force of a tire on the ground follows from its slip, and the sets of models/tires/.

    tires = Tires.load("forzaeth_nuc2")
    tires.front.lateral.force(0.1)  # over the load, at a slip angle of 0.1 rad
    tires.peak

`contact` is MuJoCo's own contact with Coulomb friction. `magic_formula` and `linear` have a curve, which
`tire_forces` turns into forces in each physics step. Axle sets apply to both tires of an axle.

The Magic Formula (Pacejka), of a slip s [rad or -], is D sin(C atan(B s - E (B s - atan(B s)))) of the load. Some of
the identified curves fall through zero soon behind their peak, where nothing was measured. So a curve never falls below
a share of its peak, `sliding_share`. Behind the slip where it would, it is constant.
"""

from __future__ import annotations

import hashlib
import json
import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property, lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from ..arguments import explain_class
from ..course.files import read_text
from ..display import brief, quoted
from ..errors import ModelError, SettingsError, accepted_names
from ..messages import require

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

CONTACT, MAGIC_FORMULA, LINEAR = "contact", "magic_formula", "linear"
MODELS = (CONTACT, MAGIC_FORMULA, LINEAR)

GREATEST_SLIP = 1.0
"""[-] Greatest slip that a tire takes on: that of a locked wheel. A wheel that slides more has the force of this."""

NUMERIC = "{}_tires"
"""Name in a compiled model of the numbers of an axle's tires: of both curves CURVE_KEYS, then AXLE_KEYS."""

CURVE_KEYS = ("B", "C", "D", "E", "stiffness", "sliding_share")
AXLE_KEYS = ("relaxation_length", "load_sensitivity", "nominal_load")

_MOST_BYTES = 2**16  # of a tire file
_NEAR_PEAK = 0.99  # [-] of a curve's greatest force: where a curve without a falling branch has its peak
_LEAST_OF_D = 0.9  # [-] a curve that reaches less of D up to GREATEST_SLIP has no peak
_STEP = 1e-3  # [-] of slip, in the search of the peak
_AXLES = ("front", "rear")
_LATERAL = ("B", "C", "D", "E")


@dataclass(frozen=True, kw_only=True)
class TireCurve:
    """Force over load of a tire, by its slip in one direction: a Magic Formula, or linear where `stiffness` is given.

    Raises:
      SettingsError: a value that no tire has, or a Magic Formula without a peak.
    """

    B: float = 0.0  # [1/rad] stiffness factor
    C: float = 0.0  # [-] shape factor
    D: float  # [-] peak of the force over the load; of a linear curve the friction that its planner is told
    E: float = 0.0  # [-] curvature factor
    stiffness: float | None = None  # [1/rad] of a linear curve: the force is load * D * stiffness * slip
    sliding_share: float = 0.7  # [-] of the peak, that the force never falls below behind it

    def __post_init__(self) -> None:
        require(self, lambda v: 0.0 < v <= 3.0, "above 0, up to 3, which no such tire reaches", ("D",), SettingsError)
        if self.stiffness is not None:
            require(self, lambda v: 0.0 < v <= 1000.0, "above 0, up to 1000 per rad", ("stiffness",), SettingsError)
            return
        require(self, lambda v: 0.0 < v <= 1000.0, "above 0, up to 1000 per rad", ("B",), SettingsError)
        require(self, lambda v: 0.5 <= v <= 10.0, "0.5 to 10", ("C",), SettingsError)
        require(self, lambda v: -100.0 <= v <= 2.0, "-100 to 2", ("E",), SettingsError)
        require(self, lambda v: 0.0 <= v <= 1.0, "0 to 1, of the peak", ("sliding_share",), SettingsError)
        if self.peak < _LEAST_OF_D * self.D:
            raise SettingsError(
                f"TireCurve has no peak: B {self.B:g}, C {self.C:g}, E {self.E:g} reach {self.peak / self.D:.2f} of D "
                f"up to a slip of {GREATEST_SLIP:g}; accepted: a curve that reaches {_LEAST_OF_D:g} of it"
            )

    def force(self, slip: float) -> float:
        """Return the force over the load [-] at a slip [rad or -], which has its sign."""
        size = abs(slip)
        linear = self.stiffness is not None
        return math.copysign(self.slope * size if linear else self._formula(min(size, self.hold_slip)), slip)

    @property
    def slope(self) -> float:
        """Force over the load for each rad of slip, at none [1/rad]: the cornering stiffness over the load."""
        return self.D * (self.B * self.C if self.stiffness is None else self.stiffness)

    @cached_property
    def peak_slip(self) -> float:
        """Slip of the peak [rad or -]; infinite for a linear curve.

        Where the curve does not fall up to GREATEST_SLIP, this is where it reaches 0.99 of its force there.
        """
        if self.stiffness is not None:
            return math.inf
        grid = np.arange(0.0, GREATEST_SLIP + 0.5 * _STEP, _STEP)
        values = [self._formula(slip) for slip in grid.tolist()]
        top = next((i for i in range(1, len(grid) - 1) if values[i + 1] < values[i]), None)
        if top is None:
            low, high = 0.0, GREATEST_SLIP
            while high - low > 1e-12:
                middle = 0.5 * (low + high)
                low, high = (middle, high) if self._formula(middle) < _NEAR_PEAK * values[-1] else (low, middle)
            return high
        low, high = grid[top] - _STEP, grid[top] + _STEP
        for _ in range(100):
            third = (high - low) / 3.0
            if self._formula(low + third) < self._formula(high - third):
                low += third
            else:
                high -= third
        return float(0.5 * (low + high))

    @property
    def falls(self) -> bool:
        """Whether the force falls behind the peak."""
        return self.stiffness is None and self._formula(self.peak_slip + 1e-3) < self._formula(self.peak_slip)

    @cached_property
    def peak(self) -> float:
        """Greatest force over the load [-]; of a linear curve, which has none, D."""
        if self.stiffness is not None:
            return self.D
        return self._formula(self.peak_slip if self.falls else GREATEST_SLIP)

    @cached_property
    def hold_slip(self) -> float:
        """Slip from which on the curve is constant, because it would fall below `sliding_share` of its peak [-]."""
        if self.stiffness is not None:
            return GREATEST_SLIP
        least, low = self.sliding_share * self.peak, self.peak_slip
        while low < GREATEST_SLIP and self._formula(low + _STEP) >= least:
            low += _STEP
        if low >= GREATEST_SLIP:
            return GREATEST_SLIP
        high = low + _STEP
        while high - low > 1e-12:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self._formula(middle) >= least else (low, middle)
        return low

    def _formula(self, slip: float) -> float:
        x = self.B * slip
        return self.D * math.sin(self.C * math.atan(x - self.E * (x - math.atan(x))))


@dataclass(frozen=True, kw_only=True)
class AxleTires:
    """The tires of an axle.

    Raises:
      SettingsError: a value that no tire has.
    """

    lateral: TireCurve
    longitudinal: TireCurve
    relaxation_length: float  # [m] over which the force follows the slip
    load_sensitivity: float = 0.0  # [-] k of force over load = (load / nominal_load)^-k times the curve's
    nominal_load: float = 9.17  # [N] of a tire, at which the curve is as given

    def __post_init__(self) -> None:
        require(self, lambda v: 1e-3 <= v <= 1.0, "0.001 to 1 m", ("relaxation_length",), SettingsError)
        require(self, lambda v: 0.0 <= v <= 0.5, "0 to 0.5", ("load_sensitivity",), SettingsError)
        require(self, lambda v: 0.0 < v <= 1000.0, "above 0, up to 1000 N", ("nominal_load",), SettingsError)

    def load_factor(self, load: float) -> float:
        """Return by how much force over load differs from the curve's at a load [N]."""
        return float((load / self.nominal_load) ** -self.load_sensitivity)


@explain_class
@dataclass(frozen=True, kw_only=True, repr=False)
class Tires:
    """A set of tires.

    Raises:
      SettingsError: an unknown model, or one that lacks the curves of an axle.
    """

    model: str = CONTACT
    front: AxleTires | None = None  # None: of the model `contact`, whose friction is in the vehicle's MJCF
    rear: AxleTires | None = None
    name: str = field(default="contact", compare=False)

    def __post_init__(self) -> None:
        if self.model not in MODELS:
            raise SettingsError(f"Tires.model is {self.model!r}; {accepted_names(self.model, MODELS)}")
        for axle in _AXLES:
            found = getattr(self, axle)
            if (found is None) != (self.model == CONTACT):
                accepted = "none: contact has the friction of the vehicle" if found else "AxleTires of this axle"
                raise SettingsError(f"Tires.{axle} is {found!r} with model {self.model!r}; accepted: {accepted}")
            for curve in (found.lateral, found.longitudinal) if found is not None else ():
                if (curve.stiffness is not None) != (self.model == LINEAR):
                    raise SettingsError(
                        f"Tires.{axle} has stiffness {curve.stiffness!r} with model {self.model!r}; accepted: a "
                        f"stiffness with {LINEAR!r} only"
                    )

    def __repr__(self) -> str:
        peak = "the vehicle's friction" if self.peak is None else f"peak {self.peak:.4g}"
        return brief(self, quoted(self.name), self.model, peak)

    @classmethod
    def load(cls, source: Tires | str | Path | Mapping[str, Any]) -> Tires:
        """Return a set of tires.

        Args:
          source: a bundled name, `contact`, the path of a TOML file, what `described` returned, or Tires.

        Raises:
          SettingsError: an unknown name, or a file that is not that of tires.
        """
        if isinstance(source, Tires):
            return source
        if isinstance(source, Mapping):
            return _of(source, "tires")
        if not isinstance(source, (str, Path)):
            raise SettingsError(f"tires is {source!r}; accepted: a bundled name, the path of a TOML file, or Tires")
        if isinstance(source, str) and not source.endswith(".toml") and "/" not in source:
            return _bundled(source)
        path = Path(source).expanduser()
        try:
            text = read_text(path, _MOST_BYTES)
        except (OSError, UnicodeDecodeError) as error:
            reason = getattr(error, "strerror", None) or "it is not UTF-8 text"
            raise SettingsError(f"tire file {source}: {reason}; accepted: a TOML file") from error
        return _parsed(text, f"tire file {source}", path.stem)

    @property
    def is_contact(self) -> bool:
        """Whether MuJoCo's own contacts carry the car, friction included."""
        return self.model == CONTACT

    @property
    def axles(self) -> tuple[AxleTires, AxleTires]:
        """Front and rear; not of the model `contact`."""
        assert self.front is not None and self.rear is not None
        return self.front, self.rear

    @property
    def peak(self) -> float | None:
        """Greatest lateral peak of the set [-], which `mu` sets; None: of the model `contact`."""
        return None if self.is_contact else max(axle.lateral.peak for axle in self.axles)

    @property
    def least_peak(self) -> float | None:
        """Least peak of the set in any direction [-]: what the car can rely on; None: of the model `contact`."""
        if self.is_contact:
            return None
        return min(curve.peak for axle in self.axles for curve in (axle.lateral, axle.longitudinal))

    def told(self) -> dict[str, float]:
        """Return what a planner is told of the tires, as fields of CarParameters; nothing of the model `contact`."""
        if self.is_contact:
            return {}
        found = {"relaxation_length": max(axle.relaxation_length for axle in self.axles)}
        for name, axle in zip(_AXLES, self.axles, strict=True):
            found[f"{name}_cornering_stiffness"] = axle.lateral.slope
            found[f"{name}_peak"], found[f"{name}_peak_slip"] = axle.lateral.peak, axle.lateral.peak_slip
        return found

    def described(self) -> dict[str, Any]:
        """Return the set as its TOML file has it, as it can stand in JSON; `load` reads it."""
        found: dict[str, Any] = {"name": self.name, "model": self.model}
        if not self.is_contact:
            for name, axle in zip(_AXLES, self.axles, strict=True):
                found[name] = _curve_keys(axle.lateral, self.model)
                for key in ("relaxation_length", "load_sensitivity", "nominal_load"):
                    found[name][key] = getattr(axle, key)
                if axle.longitudinal != axle.lateral:
                    found[name]["longitudinal"] = _curve_keys(axle.longitudinal, self.model)
        return found

    @property
    def sha256(self) -> str:
        """Hash of all its numbers."""
        return hashlib.sha256(json.dumps(self.described(), sort_keys=True).encode()).hexdigest()


def tires_of(model: mujoco.MjModel, prefix: str = "") -> Tires:
    """Return the tires of a compiled model, peaks as before `mu` was set."""
    axles = {}
    for name in ("front", "rear"):
        index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, prefix + NUMERIC.format(name))
        if index < 0:
            return Tires()
        first = model.numeric_adr[index]
        values = model.numeric_data[first : first + model.numeric_size[index]].tolist()
        if len(values) != 2 * len(CURVE_KEYS) + len(AXLE_KEYS):
            raise ModelError(f"numeric {model.numeric(index).name!r} is no tires'; accepted: as World writes it")
        lateral, longitudinal = (
            _curve_of(values[k * len(CURVE_KEYS) : (k + 1) * len(CURVE_KEYS)]) for k in range(2)
        )  # fmt: skip
        rest = dict(zip(AXLE_KEYS, values[2 * len(CURVE_KEYS) :], strict=True))
        axles[name] = AxleTires(lateral=lateral, longitudinal=longitudinal, **rest)
    linear = axles["front"].lateral.stiffness is not None
    return Tires(model=LINEAR if linear else MAGIC_FORMULA, name="of the model", **axles)


def _curve_of(values: list[float]) -> TireCurve:
    found: dict[str, Any] = dict(zip(CURVE_KEYS, values, strict=True))
    if found["stiffness"] == 0.0:
        found["stiffness"] = None
    return TireCurve(**found)


def tire_names() -> tuple[str, ...]:
    """Return the names of the bundled sets: `contact`, and the files of models/tires/."""
    folder = files("fg_mujoco.models") / "tires"
    found = sorted(file.name.removesuffix(".toml") for file in folder.iterdir() if file.name.endswith(".toml"))
    return (CONTACT, *found)


@lru_cache(maxsize=32)
def _bundled(name: str) -> Tires:
    known = tire_names()
    if name not in known:
        raise SettingsError(f"tires {name!r} are not known; {accepted_names(name, known, ', or path/to/file.toml')}")
    if name == CONTACT:
        return Tires()
    text = (files("fg_mujoco.models") / "tires" / f"{name}.toml").read_text("utf-8")
    return _parsed(text, f"tire file models/tires/{name}.toml", name)


def _parsed(text: str, where: str, name: str) -> Tires:
    try:
        table = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # a number of thousands of digits is no TOMLDecodeError
        reason = "nested too deep" if isinstance(error, RecursionError) else error
        raise SettingsError(f"{where}: is no TOML: {reason}; accepted: as models/tires/forzaeth_nuc2.toml") from error
    return _of({"name": name, **table}, where)


def _of(table: Mapping[str, Any], where: str) -> Tires:
    """Return the tires of a table as TOML has it."""
    _known(table, ("name", "model", *_AXLES), where)
    model = table.get("model")
    if model not in MODELS:
        raise SettingsError(f"{where}: model is {model!r}; {accepted_names(model, MODELS)}")
    axles: dict[str, AxleTires] = {}
    for axle in _AXLES:
        if model == CONTACT:
            if axle in table:
                raise SettingsError(f"{where}: has a table [{axle}]; accepted: none with the model {CONTACT!r}")
            continue
        axles[axle] = _axle(_table(table, axle, where), model, f"{where}, [{axle}]")
    return Tires(model=model, name=str(table.get("name", "tires")), **axles)


def _axle(table: Mapping[str, Any], model: str, where: str) -> AxleTires:
    of_axle = [f.name for f in fields(AxleTires) if f.name not in ("lateral", "longitudinal")]
    curve = _curve_names(model)
    _known(table, (*curve, "sliding_share", *of_axle, "longitudinal"), where)
    lateral = _curve({name: table[name] for name in (*curve, "sliding_share") if name in table}, model, where)
    longitudinal = lateral
    if "longitudinal" in table:
        own, where_own = _table(table, "longitudinal", where), f"{where[:-1]}.longitudinal]"
        _known(own, (*curve, "sliding_share"), where_own)
        longitudinal = _curve(own, model, where_own)
    if "relaxation_length" not in table:
        raise SettingsError(f"{where}: has no relaxation_length; accepted: a length in metres")
    settings = {name: table[name] for name in of_axle if name in table}
    axle: AxleTires = _made(AxleTires, where, lateral=lateral, longitudinal=longitudinal, **settings)
    return axle


def _curve(table: Mapping[str, Any], model: str, where: str) -> TireCurve:
    for name in _curve_names(model):
        if name not in table:
            raise SettingsError(f"{where}: has no {name}; accepted: {', '.join(_curve_names(model))} of {model!r}")
    curve: TireCurve = _made(TireCurve, where, **table)
    return curve


def _made(kind: Any, where: str, **values: Any) -> Any:
    try:
        return kind(**values)
    except SettingsError as error:
        raise SettingsError(f"{where}: {str(error).replace(f'{kind.__name__}.', '')}") from error


def _curve_names(model: str) -> tuple[str, ...]:
    return ("stiffness", "D") if model == LINEAR else _LATERAL


def _curve_keys(curve: TireCurve, model: str) -> dict[str, float]:
    return {name: getattr(curve, name) for name in (*_curve_names(model), "sliding_share")}


def _known(table: Mapping[str, Any], names: tuple[str, ...], where: str) -> None:
    for name in table:
        if name not in names:
            raise SettingsError(f"{where}: has {name!r}; {accepted_names(name, names)}")


def _table(table: Mapping[str, Any], name: str, where: str) -> Mapping[str, Any]:
    found = table.get(name)
    if not isinstance(found, Mapping):
        said = f"has no table [{name}]" if found is None else f"{name} is {found!r}"
        raise SettingsError(f"{where}: {said}; accepted: a table of its values")
    return found
