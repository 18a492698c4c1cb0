"""Sets of tires: of which law they are, and with which numbers. The bundled ones are the files of models/tires/.

    tires = Tires.load("forzaeth_nuc2")
    tires.front.lateral.force(0.1)  # over the load, at a slip angle of 0.1 rad
    tires.peak

Axle sets apply to both tires of an axle. The set `contact` is MuJoCo's own contact with Coulomb friction; all others
have a law of ours (`laws`), which `tire_forces` turns into forces in each physics step.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mujoco

from ...arguments import explain_class
from ...course.files import parse_toml, read_setting
from ...display import brief, quoted
from ...errors import ModelError, SettingsError, accepted_names
from ...messages import require
from ...registry import Registry
from .law import Law
from .laws import CONTACT, LAW_OF, LAWS, MODELS, find_law, law_names
from .plain_laws import Coulomb
from .sampled import sampled

if TYPE_CHECKING:
    from importlib.abc import Traversable

DEFAULT_TIRES = "f1tenth"
"""The set that a vehicle stands on unless its MJCF or a setting names another: measured curves."""

IDEAL_TIRES = "coulomb"
"""The set on which the laws of Coulomb friction hold: it needs hardly any slip angle."""

OF_VEHICLE = "vehicle"
"""`friction` of a set whose greatest lateral peak is the friction of the vehicle's MJCF."""

NUMERIC = "{}_tires"
"""Name in a compiled model of the numbers of an axle's tires: the place of the law in LAWS, those of both curves,
lateral first, then AXLE_KEYS."""

AXLE_KEYS = (
    "relaxation_length", "load_sensitivity", "nominal_load", "vertical_stiffness", "vertical_damping",
    "rolling_resistance",
)  # fmt: skip

CONTACT_TIMESTEP = 0.0005
"""[s] Of the physics, at which tires that MuJoCo's contacts carry are right when they slide: see the friction lab."""

_MOST_BYTES = 2**16  # of a tire file
_AXLES = ("front", "rear")
_STIFF = 0.05  # [rad] slip of the peak, up to which planners need not know the curves: bristles of 20 /rad and more


@dataclass(frozen=True, kw_only=True)
class AxleTires:
    """The tires of an axle.

    Raises:
      SettingsError: a value that no tire has.
    """

    lateral: Law
    longitudinal: Law
    relaxation_length: float  # [m] over which the force follows the slip
    load_sensitivity: float = 0.0  # [-] k of force over load = (load / nominal_load)^-k times the curve's
    nominal_load: float = 9.17  # [N] of a tire, at which the curve is as given
    vertical_stiffness: float = 11_700.0  # [N/m] of the tire under its load: as models/f1tenth.xml, which says why
    vertical_damping: float = 20.0  # [N s/m] ours: a third of what lets a wheel of .15 kg on this spring not swing
    rolling_resistance: float = 0.0  # [-] force against rolling, over the load

    def __post_init__(self) -> None:
        for name in ("lateral", "longitudinal"):
            curve = getattr(self, name)
            if type(curve) not in LAWS:
                object.__setattr__(self, name, sampled(curve, f"tire law {type(curve).__name__}"))
        require(self, lambda v: 1e-3 <= v <= 1.0, "0.001 to 1 m", ("relaxation_length",), SettingsError)
        require(self, lambda v: 0.0 <= v <= 0.5, "0 to 0.5", ("load_sensitivity",), SettingsError)
        require(self, lambda v: 0.0 < v <= 1000.0, "above 0, up to 1000 N", ("nominal_load",), SettingsError)
        require(self, lambda v: 100.0 <= v <= 1e6, "100 to 1000000 N/m", ("vertical_stiffness",), SettingsError)
        require(self, lambda v: 0.0 <= v <= 1000.0, "0 to 1000 N s/m", ("vertical_damping",), SettingsError)
        require(self, lambda v: 0.0 <= v <= 0.5, "0 to 0.5", ("rolling_resistance",), SettingsError)

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
    floor: str = field(default="", compare=False)  # on which it was measured: a name of `floors`, or in words
    law: str = field(default="", compare=False)  # that was sampled: its name, and the hash of its file
    friction: str = ""  # OF_VEHICLE: the greatest lateral peak is the vehicle's friction; empty: as the curves have it

    def __post_init__(self) -> None:
        if self.friction not in ("", OF_VEHICLE):
            raise SettingsError(f"Tires.friction is {self.friction!r}; accepted: {OF_VEHICLE!r}, or none")
        if self.model not in MODELS:
            raise SettingsError(f"Tires.model is {self.model!r}; {accepted_names(self.model, MODELS)}")
        for axle in _AXLES:
            found = getattr(self, axle)
            if (found is None) != (self.model == CONTACT):
                accepted = "none: contact has the friction of the vehicle" if found else "AxleTires of this axle"
                raise SettingsError(f"Tires.{axle} is {found!r} with model {self.model!r}; accepted: {accepted}")
            for curve in (found.lateral, found.longitudinal) if found is not None else ():
                if curve.model != self.model:
                    raise SettingsError(
                        f"Tires.{axle} has a curve of {curve.model!r} with model {self.model!r}; accepted: curves of "
                        f"{LAW_OF[self.model].__name__}"
                    )

    def __repr__(self) -> str:
        peak = "the vehicle's friction" if self.peak is None else f"peak {self.peak:.4g}"
        return brief(self, quoted(self.name), self.model, peak)

    @classmethod
    def load(cls, source: Tires | str | Path | Mapping[str, Any]) -> Tires:
        """Return the set of a bundled name, `contact`, the path of a TOML file, what `described` returned, or Tires.

        Raises:
          SettingsError: an unknown name, or a file that is not that of tires.
        """
        if isinstance(source, Tires):
            return source
        if isinstance(source, Mapping):
            return _of(source, "tires", Path())
        if not isinstance(source, (str, Path)):
            raise SettingsError(f"tires is {source!r}; accepted: a bundled name, the path of a TOML file, or Tires")
        if isinstance(source, str) and not source.endswith(".toml") and "/" not in source:
            return _bundled(source)
        path = Path(source).expanduser()
        text = read_setting(path, f"tire file {source}", "a TOML file", _MOST_BYTES)
        from ...course.documents import read_toml_table

        where = f"tire file {source}"
        table = read_toml_table(text, where, "as models/tires/forzaeth_nuc2.toml")
        return _of({"name": path.stem, **table}, where, path.parent)

    @property
    def is_contact(self) -> bool:
        """Whether MuJoCo's own contacts carry the car, friction included."""
        return self.model == CONTACT

    @property
    def sliding_timestep(self) -> float | None:
        """Timestep of the physics at which these tires are right when they slide [s]; None: the vehicle's own."""
        return CONTACT_TIMESTEP if self.is_contact else None

    @property
    def slides(self) -> bool:
        """Whether the tires have a peak, past which they slide."""
        return self.is_contact or all(axle.lateral.has_peak for axle in self.axles)

    @property
    def axles(self) -> tuple[AxleTires, AxleTires]:
        """Front and rear; not of the model `contact`."""
        assert self.front is not None and self.rear is not None
        return self.front, self.rear

    @property
    def peak(self) -> float | None:
        """Greatest lateral peak of the set [-], which `mu` sets; None: the friction is the vehicle's."""
        return None if self._of_vehicle else max(axle.lateral.peak for axle in self.axles)

    @property
    def least_peak(self) -> float | None:
        """Least peak of the set in any direction [-]: what the car can rely on; None: the friction is the vehicle's."""
        return None if self.peak is None else self.peak * self.least_share

    @property
    def least_share(self) -> float:
        """Least peak in any direction over the greatest lateral one [-]: what is left of `mu` for planners."""
        if self.is_contact:
            return 1.0
        least = min(curve.peak for axle in self.axles for curve in (axle.lateral, axle.longitudinal))
        return least / max(axle.lateral.peak for axle in self.axles)

    @property
    def _of_vehicle(self) -> bool:
        """Whether the friction is that of the vehicle's MJCF."""
        return self.is_contact or self.friction == OF_VEHICLE

    def on(self, front: float, rear: float | None = None) -> Tires:
        """Return the set on a vehicle of these frictions [-], to which its own is scaled; no rear: as in front."""
        if self.is_contact or not self._of_vehicle:
            return self
        frictions = front, front if rear is None else rear
        greatest = max(axle.lateral.peak for axle in self.axles)
        axles = [
            replace(axle, lateral=axle.lateral.scaled(share), longitudinal=axle.longitudinal.scaled(share))
            for axle, share in zip(self.axles, (mu / greatest for mu in frictions), strict=True)
        ]
        return replace(self, front=axles[0], rear=axles[1], friction="")

    @property
    def rolling_resistance(self) -> float:
        """Force against rolling, over the load [-]: the mean of both axles."""
        return 0.0 if self.is_contact else 0.5 * sum(axle.rolling_resistance for axle in self.axles)

    def for_planners(self) -> dict[str, float]:
        """Return the parameters of the tires for planners, as fields of CarParameters; none of stiff ones."""
        if self.is_contact or max(axle.lateral.peak_slip for axle in self.axles) <= _STIFF:
            return {}
        found = {"relaxation_length": max(axle.relaxation_length for axle in self.axles)}
        for name, axle in zip(_AXLES, self.axles, strict=True):
            found[f"{name}_cornering_stiffness"] = axle.lateral.slope
            found[f"{name}_peak"], found[f"{name}_peak_slip"] = axle.lateral.peak, axle.lateral.peak_slip
        return found

    def described(self) -> dict[str, Any]:
        """Return the set as its TOML file has it, as it can stand in JSON; `load` reads it."""
        found: dict[str, Any] = {"name": self.name, "model": self.model}
        found |= {key: getattr(self, key) for key in ("floor", "law", "friction") if getattr(self, key)}
        if not self.is_contact:
            for name, axle in zip(_AXLES, self.axles, strict=True):
                found[name] = _values(axle.lateral) | {key: getattr(axle, key) for key in AXLE_KEYS}
                if axle.longitudinal != axle.lateral:
                    found[name]["longitudinal"] = _values(axle.longitudinal)
        return found

    @property
    def sha256(self) -> str:
        """Hash of all its numbers."""
        numbers = {name: value for name, value in self.described().items() if name not in ("floor", "law")}
        return hashlib.sha256(json.dumps(numbers, sort_keys=True).encode()).hexdigest()


def _values(curve: Law) -> dict[str, float]:
    """Return the values of a curve as a tire file has them."""
    return {key: getattr(curve, key) for key in curve.value_names()}


def numbers_of(axle: AxleTires, law: str) -> list[float]:
    """Return the numbers that `tires_of` reads from a compiled model: see NUMERIC."""
    found = [float([own.model for own in LAWS].index(law))]
    for curve in (axle.lateral, axle.longitudinal):
        found += curve.packed()
    return found + [getattr(axle, key) for key in AXLE_KEYS]


def tires_of(model: mujoco.MjModel, prefix: str = "") -> Tires:
    """Return the tires of a compiled model, peaks as before `mu` was set; ModelError: numbers that are no tires'."""
    axles, law = {}, LAWS[0]
    for name in _AXLES:
        index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, prefix + NUMERIC.format(name))
        if index < 0:
            return Tires()
        first = model.numeric_adr[index]
        values = model.numeric_data[first : first + model.numeric_size[index]].tolist()
        law = LAWS[int(values[0])] if values[0] in range(len(LAWS)) else LAWS[0]
        size = (len(values) - 1 - len(AXLE_KEYS)) // 2
        curves = values[1 : 1 + size], values[1 + size : 1 + 2 * size]
        try:
            if values[0] not in range(len(LAWS)) or len(values) != 1 + 2 * size + len(AXLE_KEYS):
                raise ValueError
            lateral, longitudinal = (law.unpacked(curve) for curve in curves)
        except ValueError as error:
            raise ModelError(
                f"numeric {model.numeric(index).name!r} is not that of tires of this version; accepted: a model that "
                "World writes, or a run that is raced again"
            ) from error
        rest = dict(zip(AXLE_KEYS, values[1 + 2 * size :], strict=True))
        axles[name] = AxleTires(lateral=lateral, longitudinal=longitudinal, **rest)
    return Tires(model=law.model, name="of the model", front=axles["front"], rear=axles["rear"])


def tire_names() -> tuple[str, ...]:
    """Return the names of the bundled sets and of those that installed packages register."""
    return _sets().names()


@lru_cache(maxsize=1)
def _sets() -> Registry[Path | Traversable]:
    """Return the TOML files of sets by name, those of models/tires/; `contact`, which comes first, has none."""
    folder = files("fg_mujoco.models") / "tires"
    sources = sorted(folder.iterdir(), key=lambda file: file.name)
    own = {file.name.removesuffix(".toml"): file for file in sources if file.name.endswith(".toml")}
    return Registry("tires", SettingsError, "fg_mujoco.tires", {CONTACT: folder, **own}, Path)


@lru_cache(maxsize=32)
def _bundled(name: str) -> Tires:
    if name == CONTACT:
        return Tires()
    file = _sets().find(name, ", or path/to/file.toml")
    if name not in _sets():
        return Tires.load(Path(str(file)))
    where = f"tire file models/tires/{name}.toml"
    return _of({"name": name, **parse_toml(file.read_text("utf-8"))}, where, Path())


def _of(table: Mapping[str, Any], where: str, folder: Path) -> Tires:
    """Return the tires of a table as TOML has it; `folder` is where the file of its law may lie."""
    _known(table, ("name", "like", "model", "law", "floor", "friction", *_AXLES), where)
    if "like" in table:
        table = {**_like(table["like"], where).described(), **table}
    model, law, floor, friction = (table.get(key, "") for key in ("model", "law", "floor", "friction"))
    if not isinstance(floor, str):
        raise SettingsError(f"{where}: floor is {floor!r}; accepted: the name of a floor, or a description")
    if model == Coulomb.model and not any("D" in _table(table, axle, where) for axle in _AXLES):
        friction = friction or OF_VEHICLE
    if not isinstance(law, str):
        raise SettingsError(f"{where}: law is {law!r}; accepted: what a run says of it")
    kind = LAW_OF.get(str(model))
    if kind is None and model != CONTACT:
        if not isinstance(model, str) or (".py" not in model and model not in law_names()):
            accepted = accepted_names(model, MODELS, ", or path/to/law.py:Class")
            raise SettingsError(f"{where}: model is {model!r}; {accepted}")
        kind, law = find_law(model, folder, where)
    axles: dict[str, AxleTires] = {}
    for axle in _AXLES:
        if kind is None:
            if axle in table:
                raise SettingsError(f"{where}: has a table [{axle}]; accepted: none with the model {CONTACT!r}")
            continue
        axles[axle] = _axle(_table(table, axle, where), kind, f"{where}, [{axle}]")
    name = str(table.get("name", "tires"))
    model = axles["front"].lateral.model if axles else CONTACT
    tires: Tires = _made(Tires, where, model=model, name=name, law=law, floor=floor, friction=friction, **axles)
    return tires


def _like(name: Any, where: str) -> Tires:
    if not isinstance(name, str) or name.endswith(".toml"):
        raise SettingsError(f"{where}: like is {name!r}; accepted: the name of a bundled set")
    try:
        return Tires.load(name)
    except SettingsError as error:
        raise SettingsError(f"{where}: like: {error}") from error


def _axle(table: Mapping[str, Any], law: type[Law], where: str) -> AxleTires:
    _known(table, (*law.value_names(), *AXLE_KEYS, "longitudinal"), where)
    lateral = _curve({name: table[name] for name in law.value_names() if name in table}, law, where)
    longitudinal = lateral
    if "longitudinal" in table:
        own, where_own = _table(table, "longitudinal", where), f"{where[:-1]}.longitudinal]"
        _known(own, law.value_names(), where_own)
        longitudinal = _curve(own, law, where_own)
    if "relaxation_length" not in table:
        raise SettingsError(f"{where}: has no relaxation_length; accepted: a length in metres")
    settings = {name: table[name] for name in AXLE_KEYS if name in table}
    axle: AxleTires = _made(AxleTires, where, lateral=lateral, longitudinal=longitudinal, **settings)
    return axle


def _curve(table: Mapping[str, Any], law: type[Law], where: str) -> Law:
    for name in law.needed():
        if name not in table:
            of = f"{', '.join(law.needed())} of {law.model or law.__name__!r}"
            raise SettingsError(f"{where}: has no {name}; accepted: {of}")
    curve: Law = _made(law, where, **table)
    return curve


def _made(kind: Any, where: str, **values: Any) -> Any:
    try:
        return kind(**values)
    except SettingsError as error:
        raise SettingsError(f"{where}: {str(error).replace(f'{kind.__name__}.', '')}") from error


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
