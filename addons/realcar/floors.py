"""Floors: the friction of real tires on real ground, with where and how it was measured. Files of models/floors/.

Friction belongs to a tire and a floor together. A set of tires that says on which floor it was measured keeps its own
friction there, and on another floor has it times the ratio of the floors' `mu`. A set that does not say, or whose floor
is not among the files, gets the floor's `mu` as its greatest lateral peak, as of `--mu`; `coulomb` and `contact`, too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from fg_mujoco.arguments import explain_class
from fg_mujoco.course.documents import read_toml_table
from fg_mujoco.course.files import read_setting
from fg_mujoco.display import brief, quoted
from fg_mujoco.errors import SettingsError, accepted_names
from fg_mujoco.messages import require
from fg_mujoco.vehicle.changes import ACCEPTED_MU, GREATEST_MU
from fg_mujoco.vehicle.tires import Tires

_MOST_BYTES = 2**16  # of a file
_TEXTS = ("name", "ground", "where", "how", "car", "source")


@explain_class
@dataclass(frozen=True, kw_only=True, repr=False)
class Floor:
    """A floor, and the friction coefficient of the tires that it was measured with; SettingsError: of no tire."""

    name: str
    mu: float  # [-] of the tires of `car`
    least: float | None = None  # [-] of the range that the measurement leaves; None: not known
    greatest: float | None = None  # [-]
    ground: str = ""  # what it is made of
    where: str = ""  # and when it was measured
    how: str = ""  # the friction was measured
    car: str = ""  # with which car and tires
    source: str = ""  # of the figures

    def __post_init__(self) -> None:
        for name in _TEXTS:
            if not isinstance(getattr(self, name), str):
                raise SettingsError(f"Floor.{name} is {getattr(self, name)!r}; accepted: a text")
        known = [name for name in ("mu", "least", "greatest") if getattr(self, name) is not None]
        require(self, lambda value: 0.0 < value <= GREATEST_MU, ACCEPTED_MU, tuple(known), SettingsError)
        least, greatest = self.least or self.mu, self.greatest or self.mu
        if not least <= self.mu <= greatest:
            said = f"Floor.least is {self.least!r}, Floor.greatest {self.greatest!r}"
            raise SettingsError(f"{said}; accepted: a range that holds mu, {self.mu!r}")

    def __repr__(self) -> str:
        return brief(self, quoted(self.name), f"mu {self.mu:.4g}")

    @classmethod
    def load(cls, source: Floor | str | Path | Mapping[str, Any]) -> Floor:
        """Return a floor of a bundled name, a TOML file, its content or itself; SettingsError: none of these."""
        if isinstance(source, Floor):
            return source
        if isinstance(source, Mapping):
            return _of(source, "floor")
        if not isinstance(source, (str, Path)):
            raise SettingsError(f"floor is {source!r}; accepted: a bundled name, the path of a TOML file, or a Floor")
        if isinstance(source, str) and not source.endswith(".toml") and "/" not in source:
            return _bundled(source)
        path = Path(source).expanduser()
        text = read_setting(path, f"floor file {source}", "a TOML file", _MOST_BYTES)
        return _parsed(text, f"floor file {source}", path.stem)

    def mu_of(self, tires: Tires) -> float | None:
        """Return the greatest lateral peak of some tires on this floor [-]; None: that of their file, measured here."""
        own = tires.peak
        if own is None or tires.floor not in floor_names():
            return self.mu
        return None if tires.floor == self.name else min(own * self.mu / Floor.load(tires.floor).mu, GREATEST_MU)

    def described(self) -> dict[str, Any]:
        """Return the floor as its TOML file has it, as it can stand in JSON; `load` reads it."""
        return {f.name: getattr(self, f.name) for f in fields(self) if getattr(self, f.name) not in (None, "")}


def floor_names() -> tuple[str, ...]:
    """Return the names of the bundled floors."""
    return tuple(_files())


@lru_cache(maxsize=1)
def _files() -> dict[str, Any]:
    found = sorted((files("fg_mujoco.models") / "floors").iterdir(), key=lambda file: file.name)
    return {file.name.removesuffix(".toml"): file for file in found if file.name.endswith(".toml")}


@lru_cache(maxsize=32)
def _bundled(name: str) -> Floor:
    if name not in _files():
        raise SettingsError(f"floor is {name!r}; {accepted_names(name, floor_names(), ', or path/to/file.toml')}")
    return _parsed(_files()[name].read_text("utf-8"), f"floor file models/floors/{name}.toml", name)


def _parsed(text: str, where: str, name: str) -> Floor:
    table = read_toml_table(text, where, "as models/floors/ipz8.toml")
    return _of({"name": name, **table}, where)


def _of(table: Mapping[str, Any], where: str) -> Floor:
    names = [f.name for f in fields(Floor)]
    for name in table:
        if name not in names:
            raise SettingsError(f"{where}: has {name!r}; {accepted_names(name, names)}")
    for name in ("name", "mu"):
        if name not in table:
            raise SettingsError(f"{where}: has no {name}; accepted: {', '.join(names)}")
    try:
        return Floor(**table)
    except SettingsError as error:
        raise SettingsError(f"{where}: {str(error).replace('Floor.', '')}") from error
