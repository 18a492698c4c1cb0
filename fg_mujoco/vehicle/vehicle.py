"""A vehicle: one MJCF file that keeps the documented names, with the LiDAR that it mounts and its look.

The MJCF is the source of every constant of the car; docs/howto/own_car.md lists the names that it must have.
"""

from __future__ import annotations

import hashlib
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mujoco

from .. import from_addons
from ..arguments import explain_class
from ..course.files import foreign_kind, is_file, is_folder, read_setting
from ..course.mjcf import MOST_MJCF
from ..errors import ModelError, SettingsError
from ..lidar.beams import LidarModel
from ..messages import CarParameters
from ..registry import Registry
from .bodywork import add_hull
from .car import WHEELS, car_parameters, command_delay
from .changes import ACCEPTED_MU, GREATEST_MU, CarChanges, change_spec, set_mu
from .tire_rows import put_on
from .tires import DEFAULT_TIRES, Tires
from .vehicle_mjcf import OWN_CAR, compiled, find_lidar, find_look, find_tires, parsed

if TYPE_CHECKING:
    from importlib.abc import Traversable

    from .command_response import CommandResponse

DEFAULT_VEHICLE = "f1tenth"

_OF_OTHERS = (".yaml", ".yml", ".json", ".txt", ".ini", ".urdf", ".xacro")  # of which `formats` makes vehicles
_WRONG_IF_SPARSE = "4.0.0"  # MuJoCo, whose Newton solver has a wrong Hessian for some branched bodies; 4.0.1 mends it
_MOUNT = 'name="lidar_mount"'  # the files of models/ that have it are the bundled vehicles


def vehicle_names() -> tuple[str, ...]:
    """Return the names of the bundled vehicles and of those that installed packages register."""
    return _vehicles().names()


@lru_cache(maxsize=1)
def _vehicles() -> Registry[Path | Traversable]:
    """Return the MJCF files of vehicles by name: of models/ those that have a site `lidar_mount`."""
    sources = sorted(files("fg_mujoco.models").iterdir(), key=lambda file: file.name)
    own = {file.name.removesuffix(".xml"): file for file in sources if file.name.endswith(".xml")}
    own = {name: file for name, file in own.items() if _MOUNT in file.read_text("utf-8")}
    return Registry("vehicle", SettingsError, "fg_mujoco.vehicles", own, Path)


@explain_class
@dataclass(frozen=True, kw_only=True)
class Vehicle:
    """A vehicle, as its MJCF describes it, made and checked by `Vehicle.load`. Two are equal if all that makes them is.

    Attributes:
      name: of a bundled vehicle, or of the file without its ending.
      file, text: where the MJCF was read from, and what it is.
      lidar: the LiDAR that stands on its site `lidar_mount`.
      look: the MJCF of its meshes for pictures, a file of models/ or an absolute path; None: its plain shapes.
      tires: that it stands on.
    """

    name: str
    file: str
    text: str = field(repr=False)
    lidar: LidarModel
    look: str | None
    tires: Tires = field(default_factory=lambda: Tires.load(DEFAULT_TIRES))

    @classmethod
    def load(cls, source: str | Path | Vehicle = DEFAULT_VEHICLE) -> Vehicle:
        """Return a vehicle, checked once for each file.

        Args:
          source: a bundled name, the path of an MJCF file (it ends in .xml or has a slash), a file or folder that
            another stack has of a car, or a Vehicle.

        Raises:
          SettingsError: an unknown name, or a file that cannot be read.
          ModelError: a file that is not the MJCF of a vehicle.
        """
        if isinstance(source, Vehicle):
            return source
        if not isinstance(source, (str, Path)):
            raise SettingsError(f"vehicle is {source!r}; accepted: a bundled name, the path of a file, or a Vehicle")
        named = isinstance(source, str) and not source.endswith(".xml") and "/" not in source
        if named and not is_file(source) and (source in _vehicles() or not is_folder(source)):
            return _bundled(str(source))
        path = Path(source).expanduser()
        if is_folder(path) or (path.suffix.lower() in _OF_OTHERS and is_file(path)):
            return from_addons.load_car(path)
        if is_file(path) and (kind := foreign_kind(path)) is not None:
            raise ModelError(f"vehicle file {source}: is {kind}; accepted: {OWN_CAR}")
        text = read_setting(path, f"vehicle file {source}", "an MJCF file", MOST_MJCF)
        return _checked(path.stem, str(path), text, path.parent.absolute())

    @property
    def source(self) -> str:
        """Argument with which `Vehicle.load` returns it: its name if that is registered, else its file."""
        bundled = self.name in vehicle_names() and self == _bundled(self.name)
        return self.name if bundled else self.file

    @cached_property
    def sha256(self) -> str:
        """Hash of its MJCF, of its LiDAR's, and of its tires if they have a law of ours."""
        tires = "" if self.tires.is_contact else self.tires.sha256
        return hashlib.sha256(self.text.encode() + self.lidar.text.encode() + tires.encode()).hexdigest()

    @cached_property
    def parameters(self) -> CarParameters:
        """Its parameters for planners, those of a world that it is in: of MJCF text, which keeps six digits."""
        return car_parameters(mujoco.MjModel.from_xml_string(add_hull(self.spec()).to_xml()))

    @cached_property
    def command_delay(self) -> float:
        """Time from a command to its servos, as its MJCF has it [s]."""
        return command_delay(self._model)

    @cached_property
    def command_response(self) -> CommandResponse:
        """How the real car answers the commands that it is sent, as its MJCF says."""
        from .command_response import command_response

        return command_response(self._model)

    @cached_property
    def nominal_mu(self) -> float:
        """Friction coefficient of its tires, as its MJCF has it [-]; of tires with a curve the least peak."""
        return self.reliable_mu()

    def reliable_mu(self, tires: Tires | None = None, mu: float | None = None) -> float:
        """Return the friction that the car can rely on [-], as its planners do; None: its own tires, with their mu."""
        tires = tires or self.tires
        if tires.peak is not None:
            return tires.least_share * (mu or tires.peak)
        peaks = self._lateral_peaks(mu, tires)
        return min(*peaks, max(peaks) * tires.least_share)

    def greatest_mu(self, tires: Tires | None = None) -> float:
        """Return the friction of tires, None: its own, or their greatest lateral peak [-]: what `mu` sets."""
        tires = tires or self.tires
        return tires.peak or max(self._lateral_peaks(None, tires))

    def _lateral_peaks(self, mu: float | None, tires: Tires) -> list[float]:
        spec = self.spec(mu, tires=tires)
        return [float(spec.pair(f"{wheel}_tire").friction[0]) for wheel in WHEELS]

    def spec(
        self, mu: float | None = None, changes: CarChanges | None = None, tires: Tires | None = None
    ) -> mujoco.MjSpec:
        """Return its MJCF as a new MjSpec, without the LiDAR and without the hull, which follows the chassis.

        A world that attaches it has its own `option` block; the car is made for this spec's.

        Args:
          mu: friction coefficient of the tires, or the greatest peak of those with a curve [-]; None: as in the MJCF.
          tires: that it stands on; None: its own.

        Raises:
          SettingsError: a friction that is not positive, another one in `changes`, or changes that it cannot have.
        """
        changes = changes or CarChanges()
        if mu is not None and not 0.0 < mu <= GREATEST_MU:
            raise SettingsError(f"mu, the friction coefficient of the tires, is {mu!r}; accepted: {ACCEPTED_MU}")
        if mu is not None and changes.mu not in (None, mu):
            raise SettingsError(
                f"mu is {mu!r} and CarChanges.mu is {changes.mu!r}; accepted: one of them, or the same in both"
            )
        spec = parsed(self.text, f"vehicle {self.name!r}")
        if mujoco.__version__ == _WRONG_IF_SPARSE:
            spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        put_on(spec, tires or self.tires)
        if mu is not None:
            set_mu(spec, mu)
        if self.look is not None:
            spec.text("look").data = self.look
        if changes != CarChanges():
            change_spec(spec, changes, self._model)
        return spec

    def compile(self, mu: float | None = None, changes: CarChanges | None = None) -> mujoco.MjModel:
        """Return it compiled, alone on its ground, without the LiDAR; arguments and errors are those of `spec`."""
        if mu is None and changes is None:
            return copy(self._model)
        return add_hull(self.spec(mu, changes)).compile()

    @cached_property
    def _model(self) -> mujoco.MjModel:
        return add_hull(self.spec()).compile()  # never given away, because a model's arrays can be written to

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle without the caches."""
        return _as_it_was, (self.name, self.file, self.text, self.lidar, self.look, self.tires)


def _as_it_was(name: str, file: str, text: str, lidar: LidarModel, look: str | None, tires: Tires) -> Vehicle:
    return Vehicle(name=name, file=file, text=text, lidar=lidar, look=look, tires=tires)


@lru_cache(maxsize=32)
def _bundled(name: str) -> Vehicle:
    file = _vehicles().find(name, ", or path/to/file.xml")
    if name not in _vehicles():
        return Vehicle.load(Path(str(file)))
    return _read(name, f"models/{name}.xml", file.read_text("utf-8"), None)


@lru_cache(maxsize=32)
def _checked(name: str, file: str, text: str, folder: Path) -> Vehicle:
    """Return the vehicle of a user's MJCF, which is checked; `folder` is where its files may lie."""
    from .contract import check_drive, check_model, check_names, hint_at_another

    where = f"vehicle file {file}"
    check_names(parsed(text, where, hint_at_another), where)
    vehicle = _read(name, file, text, folder)
    check_model(compiled(add_hull(parsed(text, where)), where), vehicle.lidar.beams, where)
    try:
        check_drive(vehicle.compile())
    except (ModelError, mujoco.FatalError) as error:
        raise ModelError(f"{where}: {' '.join(str(error).split())}") from error
    return vehicle


def _read(name: str, file: str, text: str, folder: Path | None) -> Vehicle:
    where = f"vehicle file {file}"
    spec = parsed(text, where)
    return Vehicle(
        name=name, file=file, text=text, lidar=find_lidar(spec, folder, where), look=find_look(spec, folder, where),
        tires=find_tires(spec, folder, where),
    )  # fmt: skip
