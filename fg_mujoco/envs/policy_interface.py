"""Observations and actions of a policy: from an environment's settings, stored in its file, used to drive.

    interface = env.policy_interface
    text = json.dumps(interface.described())
    driver = PolicyInterface.read(json.loads(text)).driver()
    command = driver.drive(policy, scan, odometry)

The environment makes its observations and commands with it, and a planner made of the policy does, too: the same
readings give the same bits. Delay and noise of the observation's parts are the environment's only.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import from_addons
from ..errors import MessageError, SettingsError, accepted_names
from ..lidar.beams import MOST_BEAMS, Beams
from ..messages import (
    ODOMETRY,
    CarParameters,
    Controller,
    DriveCommand,
    FloatArray,
    LaserScan,
    Odometry,
    PlannerContext,
    require,
    require_whole,
)
from ..simulation.planner_adapter import plan
from ..simulation.planner_adapter import start as start_planner
from ..simulation.settings import PLANNER_OPTIONS, DriveSettings, as_part
from .actions import (
    DEFAULT_ACTION,
    LONGEST_SMOOTHING,
    ActionBounds,
    ActionReader,
    CarLimits,
    as_action,
    checked_speeds,
    one_action,
)
from .observation_description import Observation
from .observations import ON_BOARD, ObservationTerm
from .observer import Observer, ScanBeams, Seen, SensorSize

Policy = Callable[[Any], ArrayLike]
"""A function of an observation of one car that returns an action."""

MOST_REPEATS = 40

_SAME_ANGLE = 1e-3  # [rad] by which the beams of a scan may differ


@dataclass(frozen=True, kw_only=True)
class LidarBeams:
    """The beams of the LiDAR that a policy was trained with."""

    count: int
    angle_min: float  # [rad]
    angle_max: float  # [rad]
    range_max: float  # [m]

    def __post_init__(self) -> None:
        require_whole("beams.count", self.count, 1, MOST_BEAMS)

    @cached_property
    def bearings(self) -> FloatArray:
        """Bearing of each beam from straight ahead (n,) [rad]."""
        return np.linspace(self.angle_min, self.angle_max, self.count)


@dataclass(frozen=True, kw_only=True)
class SensorReadings:
    """A sensor that a car has besides LiDAR and odometry: the name and the number of its values."""

    name: str
    values: int

    def __post_init__(self) -> None:
        require_whole("sensors.values", self.values, 1, MOST_BEAMS)

    def size(self, beams: int) -> int:
        """Return how many values a reading has."""
        return self.values


@dataclass(frozen=True, kw_only=True)
class PolicyInterface:
    """Observations and actions of a policy.

    Raises:
      SettingsError: a value outside of what is accepted.
    """

    observation: Observation
    privileged: tuple[str, ...] = ()  # names of the terms of the second vector
    beam_step: int = 1  # every how many-th beam is seen of a `scan`
    sensors: tuple[SensorReadings, ...] = ()  # that the car has besides LiDAR and odometry
    action: str = DEFAULT_ACTION
    action_repeat: int = 1  # how many ticks an action is held for
    smoothing: float = 0.0  # [s]
    speed_range: tuple[float, float]  # [m/s]
    normalised_actions: bool = False
    period: float  # [s] of a tick
    beams: LidarBeams
    car: CarLimits
    residual: Any = None  # a Residual of the add-on learn, whose planner the actions correct
    options: Mapping[str, Any] = field(default_factory=dict)  # of PLANNER_OPTIONS, that this planner is told of
    parameters: CarParameters | None = None  # of the car, where it has a residual; else None

    def __post_init__(self) -> None:
        object.__setattr__(self, "observation", Observation.of(self.observation))
        object.__setattr__(self, "privileged", tuple(self.privileged))
        object.__setattr__(self, "car", as_part(self.car, CarLimits, "car"))
        if self.parameters is not None:
            object.__setattr__(self, "parameters", _read_parameters(self.parameters))
        check_actions(self)
        if (self.parameters is None) != (self.residual is None):
            said = f"a residual {self.residual!r} with parameters {self.parameters}"
            accepted = "the car's parameters where a planner is corrected, and only there"
            raise SettingsError(f"{said}; accepted: {accepted}")
        object.__setattr__(self, "beams", as_part(self.beams, LidarBeams, "beams"))
        object.__setattr__(self, "speed_range", checked_speeds(self.car, self.speed_range))
        object.__setattr__(self, "sensors", tuple(as_part(each, SensorReadings, "sensors") for each in self.sensors))
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", ("period",), SettingsError)
        if not any(isinstance(part.term, ObservationTerm) for part in self.observation.parts):
            self.observer()  # refuses what does not go together

    @classmethod
    def of(
        cls,
        settings: Any,
        car: CarParameters,
        beams: Beams,
        period: float,
    ) -> PolicyInterface:
        """Return the interface of an environment's settings, its car, its LiDAR's beams and ticks of `period` [s]."""
        bearings, drive = beams.bearings, settings.driven(effects=settings.effects)
        return cls(
            observation=settings.observation, privileged=tuple(term.name for term in settings.privileged),
            beam_step=settings.beam_step, action=settings.action, action_repeat=settings.action_repeat,
            smoothing=settings.smoothing, speed_range=checked_speeds(car, settings.speed_range),
            normalised_actions=settings.normalised_actions, period=period,
            sensors=tuple(SensorReadings(name=each.name, values=each.size(len(bearings))) for each in settings.sensed),
            beams=LidarBeams(
                count=len(bearings), angle_min=beams.angle_min, angle_max=beams.angle_max, range_max=beams.range_max
            ),
            car=CarLimits(**{each.name: getattr(car, each.name) for each in fields(CarLimits)}),
            residual=settings.residual and settings.residual.with_latency(drive.context(car, None).latency),
            options={name: getattr(settings, name) for name in PLANNER_OPTIONS if settings.residual},
            parameters=None if settings.residual is None else car,
        )  # fmt: skip

    @classmethod
    def read(cls, described: Mapping[str, Any]) -> PolicyInterface:
        """Return the interface that `described()` has described; SettingsError: it is no such description."""
        return as_part(described, cls, "the policy's interface")

    def described(self) -> dict[str, Any]:
        """Return the interface as numbers, texts and lists by name, which JSON takes."""
        own = {each.name: getattr(self, each.name) for each in fields(self)}
        if self.residual is None:
            del own["residual"], own["options"]
        else:
            own["residual"] = self.residual.described()
        if self.parameters is None:
            del own["parameters"]
        else:
            numbers = asdict(self.parameters)
            own["parameters"] = {name: v if math.isfinite(v) else str(v) for name, v in numbers.items()}
        return own | {
            "observation": str(self.observation), "privileged": list(self.privileged),
            "speed_range": list(self.speed_range), "beams": asdict(self.beams), "car": asdict(self.car),
            "sensors": [asdict(sensor) for sensor in self.sensors],
        }  # fmt: skip

    @cached_property
    def bounds(self) -> ActionBounds:
        """The bounds of actions."""
        return ActionBounds(
            self.car, self.speed_range, normalised=self.normalised_actions, action=self.action,
            smoothing=self.smoothing, period=self.period, residual=self.residual,
        )  # fmt: skip

    @property
    def planner_context(self) -> PlannerContext:
        """What the planner is told whose commands the actions correct: nothing that an episode draws."""
        assert self.residual is not None and self.parameters is not None
        return replace(
            DriveSettings(**self.options).context(self.parameters, None), mu=self.residual.mu, sensors=(), lidar=None,
            max_speed=self.speed_range[1], period=self.period, latency=self.residual.latency or 0.0,
        )  # fmt: skip

    def base_planners(self, beams: Beams, count: int) -> Any:
        """Return BasePlanners of so many cars that the actions correct, or None; SettingsError: there are none such."""
        return None if self.residual is None else self.residual.planners(self.planner_context, beams, count)

    def observer(
        self,
        count: int = 1,
        *,
        car: CarParameters | None = None,
        beams: ScanBeams | None = None,
        sensors: Sequence[SensorSize] | None = None,
        privileged: Sequence[ObservationTerm] = (),
    ) -> Observer:
        """Return what makes the observations of `count` cars, with what an environment has in the place of its own."""
        return Observer(
            self.observation, car or self.car, beams or self.beams, self.period, count=count, beam_step=self.beam_step,
            sensors=self.sensors if sensors is None else sensors, privileged=privileged,
            actions=(self.bounds.low, self.bounds.high), speed_range=self.speed_range,
        )  # fmt: skip

    def actions(self, count: int = 1) -> ActionReader:
        """Return what converts the actions of so many cars to commands."""
        return ActionReader(self.bounds, count)

    def require_on_board(self) -> None:
        """Raise SettingsError if the policy needs what a car does not sense."""
        names = [*(part.name for part in self.observation.parts if part.name not in ON_BOARD), *self.privileged]
        if names:
            said = f"the policy observes {', '.join(names)}, which a car does not sense"
            raise SettingsError(f"{said}; accepted: {', '.join(ON_BOARD)}, and the car's sensors")

    def without_delays(self) -> PolicyInterface:
        """Return the same without the delay and the noise of the observation's parts, which a car has by itself."""
        plain = tuple(replace(part, delay=0.0, noise=0.0) for part in self.observation.parts)
        return replace(self, observation=replace(self.observation, parts=plain))

    def driver(self) -> PolicyDriver:
        """Return what drives a car by the policy; SettingsError: the policy needs what a car does not sense."""
        return PolicyDriver(self)


class PolicyDriver:
    """One car that a policy drives: its readings become observations, and actions become commands."""

    def __init__(self, interface: PolicyInterface) -> None:
        interface.require_on_board()
        self.interface = interface
        self._observer = interface.without_delays().observer()
        self._reader, self._one, self._clipped = interface.actions(), np.ones(1, np.bool_), np.zeros(1, np.int64)
        self._row = np.zeros(1, ODOMETRY)
        self._planner: Controller | None = None
        if interface.residual is not None:
            self._planner = interface.residual.make(interface.planner_context)
            self._reader.planned = np.zeros((1, 2))
        self.reset()

    def reset(self) -> None:
        """Forget everything seen and answered so far."""
        self._observer.begin(self._one, [0])
        self._reader.begin(self._one)
        self._commands = np.zeros((1, 2))
        self._tick = 0
        if self._planner is not None:
            start_planner(self._planner)
            self._reader.planned[:] = 0.0

    def drive(self, policy: Policy, scan: LaserScan, odometry: Odometry) -> DriveCommand:
        """Return the command of a tick; the policy is asked in the first of each `action_repeat` ticks.

        Raises:
          MessageError: a scan of another LiDAR, a sensor that is missing, or a policy that answers no action.
          PlannerError: the planner fails whose commands the policy corrects.
        """
        first, self._tick = self._tick % self.interface.action_repeat == 0, self._tick + 1
        if self._planner is not None:
            self._check(scan, odometry)
            planned = plan(self._planner, scan, odometry)
            self._reader.planned[0] = planned.steering_angle, planned.speed
        if first:
            seen = self.observe(scan, odometry)
            action = one_action(policy(seen), "the policy answered", self.interface.bounds)
            self._reader.read(action[np.newaxis], self._one, self._commands, self._clipped)
        else:
            self._reader.again(self._one, self._commands)
        steering, speed = self._commands[0].tolist()
        return DriveCommand(steering_angle=steering, speed=speed)

    def observe(self, scan: LaserScan, odometry: Odometry) -> Any:
        """Return a step's observation as the environment has it; MessageError: another LiDAR's scan, or no sensor."""
        self._check(scan, odometry)
        for name in ODOMETRY.names or ():
            self._row[name] = getattr(odometry, name)
        self._reader.sense(self._row, self._one)
        state: Any = OwnState(time=np.zeros(1), command=self._commands)
        seen = self._observer.read(
            self._one, scan.ranges[np.newaxis], self._row, state, [odometry.readings], self._reader.previous,
            self._reader.planned,
        )  # fmt: skip
        return row_of(seen, 0)

    def _check(self, scan: LaserScan, odometry: Odometry) -> None:
        known = self.interface.beams
        angles = scan.angle_min, scan.angle_min + scan.angle_increment * (len(scan.ranges) - 1)
        apart = max(abs(angles[0] - known.angle_min), abs(angles[1] - known.angle_max))
        if len(scan.ranges) != known.count or apart > _SAME_ANGLE:
            raise MessageError(
                f"the scan has {_beams(len(scan.ranges), *angles)}; accepted: those that the policy was trained with, "
                f"{_beams(known.count, known.angle_min, known.angle_max)}"
            )
        for sensor in self.interface.sensors:
            found = odometry.readings.get(sensor.name) if sensor.name in odometry.readings else None
            if found is None or len(found.values) != sensor.values:
                has = "no such sensor" if found is None else f"{len(found.values)} values of it"
                said = f"the policy observes sensor {sensor.name!r} of {sensor.values} values, and the car has {has}"
                raise MessageError(f"{said}; accepted: a car with the sensors that the policy was trained with")


@dataclass(frozen=True, kw_only=True)
class OwnState:
    """The part of a SensedState that a car knows by itself."""

    time: FloatArray
    command: FloatArray


def check_actions(settings: Any) -> None:
    """Raise SettingsError unless the fields that say what an action is are accepted."""
    object.__setattr__(settings, "action", as_action(settings.action))
    if settings.residual is not None:
        object.__setattr__(settings, "residual", from_addons.Residual.of(settings.residual))
    if settings.residual is not None and settings.action != DEFAULT_ACTION:
        said = f"action is {settings.action!r}, with a residual"
        raise SettingsError(f"{said}; accepted: {DEFAULT_ACTION!r}, which are corrections of a planner's commands")
    if settings.residual is not None and settings.smoothing != 0.0:
        said = f"smoothing is {settings.smoothing!r}, with a residual"
        raise SettingsError(f"{said}; accepted: 0, as it would delay what the planner commands")
    if settings.residual is None and any(part.name == "planner_command" for part in settings.observation.parts):
        raise SettingsError("observation 'planner_command' without a residual; accepted: with one")
    require_whole("action_repeat", settings.action_repeat, 1, MOST_REPEATS)
    smoothing = f"0 to {LONGEST_SMOOTHING:g} s"
    require(settings, lambda value: 0.0 <= value <= LONGEST_SMOOTHING, smoothing, ("smoothing",), SettingsError)
    if not isinstance(settings.normalised_actions, bool):
        value = settings.normalised_actions
        raise SettingsError(f"normalised_actions is {value!r}; {accepted_names(value, ('True', 'False'))}")


def _read_parameters(given: Any) -> CarParameters:
    """Return the parameters of a car, of which a file has what is not finite as text."""
    if isinstance(given, Mapping):
        given = {name: float(v) if v in ("inf", "-inf", "nan") else v for name, v in given.items()}
    return as_part(given, CarParameters, "parameters")


def row_of(seen: Seen, row: int) -> Any:
    """Return the observation of one of n cars."""
    return {name: values[row] for name, values in seen.items()} if isinstance(seen, dict) else seen[row]


def _beams(count: int, least: float, most: float) -> str:
    return f"{count} beams from {math.degrees(least):.1f} to {math.degrees(most):.1f} deg"
