"""Settings that all functions share: the car, the knowledge of its planner, its start, and the effects of its LiDAR.

A race, a rollout, an environment and the live view spell these settings alike and validate them here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, Field, asdict, dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, TypeVar, cast

import mujoco

from .. import from_addons
from ..arguments import explain_class, setting
from ..controllers.control.stages import names_in
from ..course.course import Course
from ..course.obstacles import Obstacle
from ..display import brief, changed
from ..errors import SettingsError, accepted_names
from ..lidar.beams import lidar_of
from ..lidar.effects import LidarEffects
from ..messages import CarParameters, MapLine, PlannerContext, require, require_whole, shown
from ..vehicle.car import command_delay
from ..vehicle.changes import ACCEPTED_MU, GREATEST_MU, CarChanges
from ..vehicle.friction_patches import Patch
from ..vehicle.tires import Tires
from ..vehicle.vehicle import DEFAULT_VEHICLE, Vehicle
from .cars import WorldCar, car_prefix, lidar_prefix
from .world import World

if TYPE_CHECKING:
    from typing_extensions import Self

    from ..vehicle.sensors import Sensor

_Part = TypeVar("_Part")
_F = TypeVar("_F", bound=Callable[..., Any])

FASTEST = 8.0
"""[m/s] The fastest that a planner may command unless it is told otherwise: that of the published lap times."""

GREATEST_SPEED = 100.0
"""[m/s] Greatest `max_speed` that is accepted: five times what the motor of an F1TENTH car gives."""

_ACCEPTED_SPEED = f"a positive number up to {GREATEST_SPEED:g} m/s; the motor of an F1TENTH car gives 20 m/s"

KNOWN = ("", "opponents")
"""Knowledge that `knows` accepts; each is the name of a sensor, too, which has noise, delay and rate as settings."""

ODOMETRIES = ("", "vesc")
"""Odometry that `odometry` accepts; each is the name of a sensor, too, as in KNOWN."""

FURTHEST = 1e6
"""[m], [rad] and [m/s] of a start: MuJoCo warns of positions beyond 1e10."""

LONGEST_RACE = 86400.0
"""[s] Longest time limit that is accepted, a day: a race keeps about 60 kB for each second."""

GREATEST_LAPS = 1000
"""Greatest number of laps that is accepted: a race keeps about 0.5 MB for each lap of the oval."""


def friction_text(mu: float | None, assumed: float | None, floor: str | None = None) -> str:
    """Return in words the friction of the tires and the assumed one, None: drawn; and the name of the floor."""
    tires, planner = ("as drawn" if value is None else f"{value:.4g}" for value in (mu, assumed))
    tires += f" on floor {floor}" if floor else ""
    return f"mu {tires}; the planner {'has no limit' if assumed == math.inf else f'assumes {planner}'}"


def require_laps(laps: object) -> None:
    """Raise SettingsError unless `laps` is None or a number of laps."""
    require_whole("laps", laps, 1, GREATEST_LAPS, why="a race keeps about 0.5 MB for each lap", optional=True)


def require_time_limit(settings: Any) -> None:
    """Raise SettingsError unless the field `time_limit` [s] is None or what a race may last."""
    if settings.time_limit is not None:
        accepted = f"a positive number up to {LONGEST_RACE:g} s, a day; a race keeps about 60 kB for each second"
        require(settings, lambda value: 0.0 < value <= LONGEST_RACE, accepted, ("time_limit",), SettingsError)


def known_settings(settings: Mapping[str, Any], kind: Any, what: str) -> dict[str, Any]:
    """Return settings by name; SettingsError: one is no field of the dataclass `kind`; it names the nearest."""
    names = [f.name for f in fields(kind)]
    for name in settings:
        if name not in names:
            raise SettingsError(f"{what} has no setting {name!r}; {accepted_names(name, names)}")
    return dict(settings)


def as_part(value: Any, kind: type[_Part], name: str) -> _Part:
    """Return an object of the dataclass `kind`, or made of a mapping of its fields; SettingsError: it is neither."""
    if isinstance(value, kind):
        return value
    if isinstance(value, Mapping):
        known = known_settings(value, kind, name)
        lacking = [f.name for f in fields(cast(Any, kind)) if f.name not in known and required(f)]
        if lacking:
            said = f"{name} is {shown(value)}, without {', '.join(lacking)}"
            raise SettingsError(f"{said}; accepted: {kind.__name__}, or its settings by name")
        return kind(**known)
    names = ", ".join(f.name for f in fields(cast(Any, kind)))
    raise SettingsError(f"{name} is {shown(value)}; accepted: {kind.__name__}, or any of {names} by name")


def as_parts(values: Any, kind: type[_Part], name: str) -> tuple[_Part, ...]:
    """Return objects of `kind`, each as by `as_part`; SettingsError: no sequence, or one of it, by its place."""
    if isinstance(values, (str, Mapping)) or not isinstance(values, Iterable):
        said = f"{name} is {shown(values)}"
        raise SettingsError(f"{said}; accepted: a sequence of {kind.__name__}, such as [{kind.__name__}(...)]")
    return tuple(as_part(value, kind, f"{name}[{index}]") for index, value in enumerate(values))


def required(of: Field[Any]) -> bool:
    """Return whether a field of a dataclass has no default."""
    return of.default is MISSING and of.default_factory is MISSING


@explain_class
@dataclass(frozen=True, kw_only=True)
class Start:
    """Start of a race, along the centreline.

    Raises:
      SettingsError: a value that is no number of at most a million.
    """

    s: float = setting(0.0, "progress at which the car starts [m]; default: 0", "M", "course and planner")
    offset: float = setting(0.0, "how far to the left of the line it starts [m]; default: 0", "M", "course and planner")
    heading: float = setting(0.0, "from the line's [rad], left positive; default: 0", "RAD", "course and planner")
    speed: float = setting(0.0, "with wheels rolling [m/s]; default: 0", "V", "course and planner")

    def __post_init__(self) -> None:
        names = ("s", "offset", "heading", "speed")
        require(self, lambda value: abs(value) <= FURTHEST, f"-{FURTHEST:g} to {FURTHEST:g}", names, SettingsError)


@dataclass(frozen=True, kw_only=True, repr=False)
class CarSettings:
    """Which car drives.

    Raises:
      SettingsError: an unknown vehicle, or a friction that is not positive or is another one in `changes`.
      ModelError: a file that is not that of a vehicle.
    """

    vehicle: Vehicle | str | Path | None = setting(
        None, f"{{names}}, or a file or folder of one; default: {DEFAULT_VEHICLE}, or that which the planner is for",
        "NAME|FILE", "car",
    )  # fmt: skip
    mu: float | None = setting(
        None, "friction coefficient of the tires, or their greatest peak; default: as published", "MU", "floor"
    )
    changes: CarChanges = field(default_factory=CarChanges)  # what else differs from the vehicle's MJCF
    tires: Tires | str | Path | None = setting(
        None, "{names}, or the file of a set; default: the vehicle's, f1tenth", "NAME|FILE.toml", "car"
    )
    patches: Sequence[Patch] = ()  # of the floor, on which the tires have another friction
    sensors: Sequence[Sensor | str | Mapping[str, Any]] = setting(
        (), "a further sensor: {names}, or path/to/file.py:Class; sensor=NAME,rate=100,noise_std=.1 "
        "with settings; again for each", "NAME", "sensors",
    )  # fmt: skip
    floor: Any = setting(
        None, "friction of a measured floor, in place of --mu: {names}, or the file of one",
        "NAME|FILE.toml", "floor",
    )  # fmt: skip
    knows: str = setting(  # of KNOWN: what the planner is told that nothing on its car measures
        "", "opponents: the planner reads the odometry of the other cars; default: nothing", "TEXT", "sensors",
        told=True,
    )  # fmt: skip
    odometry: str = setting(  # of ODOMETRIES
        "", "vesc: the odometry is that of a VESC, by the motor's turns and the commanded steering; default: of the "
        "wheels' encoders, the steering sensor and the gyro", "TEXT", "sensors", told=True,
    )  # fmt: skip
    pose: Any = setting(  # of a Pose, by name; None: the true pose
        None, "errors of the pose that a planner with a map reads, as rate=10,delay=.05,noise_std=.02; also drift, "
        "jumps, jump_size; default: none", "SETTING=VALUE,...", "sensors", told=True,
    )  # fmt: skip
    assist: str = setting(
        "full", "stages between the planner and its car: none, grip, safe, full, or names of stages joined by commas; "
        "default: full", "NAMES", "course and planner", told=True,
    )  # fmt: skip

    def __post_init__(self) -> None:
        vehicle = self._usual_vehicle() if self.vehicle is None else self.vehicle
        object.__setattr__(self, "vehicle", Vehicle.load(vehicle))
        self._make("changes", CarChanges)
        object.__setattr__(self, "patches", as_parts(self.patches, Patch, "patches"))
        if not isinstance(self.sensors, tuple) or self.sensors:
            from ..vehicle.sensors import as_sensors

            object.__setattr__(self, "sensors", as_sensors(self.sensors))
        for name, known in (("knows", KNOWN), ("odometry", ODOMETRIES)):
            value = getattr(self, name)
            if not isinstance(value, str) or value not in known:
                accepted = " or ".join(map(repr, known))
                raise SettingsError(f"{type(self).__name__}.{name} is {shown(value)}; accepted: {accepted}")
        if self.pose is not None:
            from ..vehicle.sensors.bundled import Pose

            object.__setattr__(self, "pose", Pose.told(self.pose).described())
        if self.odometry or self.pose is not None:
            _ = self.sensed
        if self.assist != "full":
            names_in(self.assist, f"{type(self).__name__}.assist")
        if self.tires is not None:
            object.__setattr__(self, "tires", Tires.load(self.tires))
        if self.mu is not None:
            require(self, lambda value: 0.0 < value <= GREATEST_MU, ACCEPTED_MU, ("mu",), SettingsError)
        if self.mu is not None and self.changes.mu not in (None, self.mu):
            raise SettingsError(
                f"mu is {self.mu!r} and CarChanges.mu is {self.changes.mu!r}; accepted: one of them, or the same twice"
            )
        if self.floor is not None:
            object.__setattr__(self, "floor", from_addons.Floor.load(self.floor))
            given = next((value for value in (self.mu, self.changes.mu) if value is not None), None)
            if given is not None:
                said = f"floor is {self.ground_name!r} and mu {given!r}"
                raise SettingsError(f"{said}; accepted: one of them, the floor has a friction of its own")

    def __repr__(self) -> str:
        plain = type(self)()  # its vehicle is loaded, too
        return brief(self, *changed(self, plain))

    def _usual_vehicle(self) -> str:
        """Return the vehicle where none is given."""
        return DEFAULT_VEHICLE

    def _make(self, name: str, kind: type) -> None:
        """Make an object of `kind` of a setting that may be a mapping."""
        object.__setattr__(self, name, as_part(getattr(self, name), kind, name))

    @property
    def car(self) -> Vehicle:
        """The vehicle, loaded."""
        return cast(Vehicle, self.vehicle)

    @property
    def tire_set(self) -> Tires:
        """The tires that the car stands on, loaded."""
        return self.car.tires if self.tires is None else cast(Tires, self.tires)

    @property
    def sensed(self) -> tuple[Sensor, ...]:
        """The sensors, made, and those of what the planner knows, its odometry and its pose."""
        found = cast("tuple[Sensor, ...]", self.sensors)
        if not self.knows and not self.odometry and self.pose is None:
            return found
        from ..vehicle.sensors import SENSORS, as_sensors

        if self.pose is not None:
            found = as_sensors((*found, *as_sensors([self.pose], "pose")))
        for name in filter(None, (self.knows, self.odometry)):
            if not any(sensor.name == name for sensor in found):
                found = (*found, SENSORS.find(name)())
        if not self.odometry:
            return found
        from ..vehicle.sensors.vesc import Vesc

        other = next((s for s in found if s.name == self.odometry and not isinstance(s, Vesc)), None)
        if other is not None:
            said = f"odometry is {self.odometry!r} and sensor {other.name!r} is a {type(other).__name__}"
            raise SettingsError(f"{said}; accepted: another name for it, or a Vesc")
        return tuple(replace(s, as_odometry=s.name == self.odometry) if isinstance(s, Vesc) else s for s in found)

    @property
    def tires_mu(self) -> float:
        """Friction coefficient of the tires as they are set, or their greatest peak."""
        return self.all_changes.mu or self.car.greatest_mu(self.tire_set)

    @property
    def ground(self) -> Any:
        """The Floor of the add-on realcar, loaded; None: the friction is of none."""
        return self.floor

    @property
    def ground_name(self) -> str | None:
        """Name of the floor; None: the friction is of none."""
        return None if self.ground is None else self.ground.name

    @property
    def set_mu(self) -> float | None:
        """The friction that `mu` or the floor sets; None: as in the file of the tires."""
        return self.mu if self.ground is None else self.ground.mu_of(self.tire_set)

    @property
    def all_changes(self) -> CarChanges:
        """Changes to the vehicle's MJCF, the friction included."""
        return self.changes if self.set_mu is None else replace(self.changes, mu=self.set_mu)

    def world(
        self,
        course: Course | str,
        *,
        lidar: str = "raycast",
        obstacles: tuple[Obstacle, ...] = (),
        others: Sequence[WorldCar] = (),
        keep: bool = False,
    ) -> World:
        """Return a compiled world with this car; arguments and errors as in World."""
        return World(
            course, self.car, mu=self.set_mu, lidar=lidar, obstacles=obstacles, changes=self.changes,
            tires=self.tire_set, patches=self.patches, others=others, keep=keep,
        )  # fmt: skip

    def driven(self, **given: Any) -> DriveSettings:
        """Return the settings of a drive of this car; `given` are those that DriveSettings has besides."""
        return DriveSettings(**{f.name: getattr(self, f.name) for f in fields(CarSettings)} | given)

    def described(self) -> dict[str, Any]:
        """Return those that differ from the defaults as they can stand in JSON; `of` reads them back."""
        plain = type(self)()
        found: dict[str, Any] = {}
        for name in (f.name for f in fields(self)):
            value = getattr(self, name)
            if value == getattr(plain, name):
                continue
            if isinstance(value, Vehicle):
                found |= {name: value.source, "vehicle_sha256": value.sha256}
            elif isinstance(value, Tires) or name == "floor":
                found[name] = value.described()
            elif name == "sensors":
                found[name] = [sensor.described() for sensor in value]
            elif name == "patches":
                found[name] = [asdict(patch) for patch in value]
            elif is_dataclass(value) and not isinstance(value, type):
                found[name] = asdict(value)
            else:
                found[name] = "off" if value == math.inf else value
        return found

    @classmethod
    def of(cls, description: Mapping[str, Any]) -> Self:
        """Return the settings that `described` told of.

        Raises:
          SettingsError: what cannot be, or a vehicle's file that is another one now.
        """
        values: dict[str, Any] = {name: math.inf if value == "off" else value for name, value in description.items()}
        sha256 = values.pop("vehicle_sha256", None)
        settings = cls(**values)
        if sha256 is not None and settings.car.sha256 != sha256:
            raise SettingsError(f"vehicle {values['vehicle']!r} is another one now; accepted: the file as it was")
        return settings


class CarKeywords(TypedDict, total=False):
    """The settings of a car as keywords: those of DriveSettings, but for axes of studies, and of its parts by name.

    A new setting stands here, and as a field of DriveSettings. One that planners are told of is a field of CarSettings
    with `arguments.setting(..., told=True)`, which makes it an option of the command line and one of PLANNER_OPTIONS.
    """

    vehicle: Vehicle | str | Path | None
    tires: Tires | str | Path | None
    mu: float | None
    floor: Any
    changes: CarChanges | Mapping[str, Any]
    planner_mu: float | None
    planner_settings: Mapping[str, Any]
    start: Start | Mapping[str, Any] | None
    effects: LidarEffects | Mapping[str, Any]
    odometry_drift: float
    sensors: Sequence[Sensor | str | Mapping[str, Any]]
    knows: str
    odometry: str
    pose: Any
    assist: str
    lidar_effects: Any
    lidar_noise: float
    lidar_dropout: float
    lidar_latency: float
    motion_distortion: bool
    floor_angle: float
    through_cars: float
    start_s: float
    start_offset: float
    start_heading: float
    start_speed: float
    mass: float | None
    cog_height: float | None
    steering_gain: float | None
    speed_gain: float | None
    command_delay: float | None


PLANNER_OPTIONS = tuple(f.name for f in fields(CarSettings) if f.metadata.get("told"))
"""Settings of a car that its planner is told of; every study, environment and command has them."""


@dataclass(frozen=True, kw_only=True, repr=False)
class DriveSettings(CarSettings):
    """Which car drives, what its planner is told, where it starts, and what its LiDAR and its odometry do.

    Raises:
      SettingsError: a value outside of what is accepted.
      ModelError: a file that is not that of a vehicle.
    """

    planner_mu: float | None = setting(  # inf: no friction limits
        None, "friction coefficient that the planner assumes; off: no friction limits; default: that of --mu", "MU",
        "floor",
    )  # fmt: skip
    max_speed: float = setting(
        FASTEST, f"fastest that the planner may command [m/s]; default: {FASTEST:g}", "V", "course and planner"
    )
    planner_settings: Mapping[str, Any] = field(default_factory=dict)  # that differ from the planner's own
    start: Start = field(default_factory=Start)
    effects: LidarEffects = field(default_factory=LidarEffects)  # what the LiDAR does to a scan
    odometry_drift: float = setting(
        0.0, "relative error of measured speeds and yaw rate, .05 is 5 %%; default: 0", "D", "sensors"
    )
    seed: int = setting(0, "seed of noise and dropouts; default: 0", "N", "course and planner")

    def __post_init__(self) -> None:
        super().__post_init__()
        self._make("start", Start)
        self._make("effects", LidarEffects)
        require(
            self, lambda value: abs(value) < 1.0, "more than -1 and less than 1", ("odometry_drift",), SettingsError
        )
        require(self, lambda value: 0.0 < value <= GREATEST_SPEED, _ACCEPTED_SPEED, ("max_speed",), SettingsError)
        if self.planner_mu is not None:
            holds: Callable[[float], bool] = lambda value: 0.0 < value <= GREATEST_MU or value == math.inf  # noqa: E731
            require(self, holds, f"{ACCEPTED_MU}; or inf, no friction limits", ("planner_mu",), SettingsError)
        require_whole("seed", self.seed, 0)

    @property
    def assumed_mu(self) -> float:
        """Friction coefficient that the planner assumes: `planner_mu`, or else the least peak of the tires as set."""
        if self.planner_mu is not None:  # which may be a whole number beyond all floats
            return math.inf if self.planner_mu > GREATEST_MU else float(self.planner_mu)
        return self.car.reliable_mu(self.tire_set, self.all_changes.mu)

    def context(
        self, car: CarParameters, map_line: MapLine | None, *, model: mujoco.MjModel | None = None, index: int = 0
    ) -> PlannerContext:
        """Return all that the planner of these settings is told.

        Args:
          car: parameters of the car that it drives, as they are in the compiled world.
          map_line: the line through the course; None: it has no map.
          model: of a recorded world, which says what LiDAR and delay car `index` had; None: as set.
        """
        if model is None:
            beams, changed = self.car.lidar.beams, self.all_changes.command_delay
            delay = self.car.command_delay if changed is None else changed
        else:
            beams = lidar_of(model, lidar_prefix(index)).beams
            delay = command_delay(model, car_prefix(index))
        period = beams.period
        return PlannerContext(
            car=car, mu=self.assumed_mu, max_speed=float(self.max_speed), period=period,
            latency=self.effects.sweeps_late(period) * period + delay, seed=self.seed, map_line=map_line,
            sensors=tuple(sensor.name for sensor in self.sensed), lidar=beams.geometry, assist=self.assist,
        )  # fmt: skip

    @property
    def friction(self) -> str:
        """`friction_text` of these settings."""
        return friction_text(self.tires_mu, self.assumed_mu, self.ground_name)


@explain_class
@dataclass(frozen=True, kw_only=True, repr=False)
class Scenario(DriveSettings):
    """Everything that a world's result depends on, but for the controller and when to end.

    Raises:
      SettingsError: a value out of its range.
    """

    track: Course | str = "oval"  # as `load_track` takes it
    obstacles: tuple[Obstacle, ...] = ()
