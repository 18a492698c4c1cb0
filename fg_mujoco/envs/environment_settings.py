"""Settings of an environment for learning: course, episode, observations and rewards."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

from ..course.course import Course, laps_to_drive
from ..course.moving_obstacles import MovingObstacle, moving_or_text
from ..course.obstacles import Obstacle, obstacles_or_count
from ..errors import SettingsError, accepted_names
from ..lidar.effects import LidarEffects
from ..messages import require, require_whole, shown
from ..racing.entries import GRIDS, Entry
from ..racing.randomization import OF_OPPONENTS, OF_PLANNERS, PLANNER, Randomization, course_range
from ..racing.resolved import Ground
from ..racing.setup import FIELD_OF, OF_A_CAR, OF_A_COURSE, Setup
from ..simulation.cars import WorldCar
from ..simulation.course_loading import load_track
from ..simulation.engine import Engine
from ..simulation.settings import PLANNER_OPTIONS, CarSettings, Start, known_settings
from ..simulation.world import World
from ..vehicle.vehicle import Vehicle
from .actions import DEFAULT_ACTION
from .contacts import ON_CONTACT
from .end_conditions import EndCondition, as_end_conditions
from .environment_opponents import as_entries
from .observation_description import DEFAULT_OBSERVATION, Observation, as_privileged
from .observations import ObservationTerm
from .policy_interface import check_actions
from .rewards import Rewards
from .starts import GRID_ORDERS, StartGrid

if TYPE_CHECKING:
    from typing_extensions import Self

STARTS = ("random", "line")

ENDED_BY = ("ego", "any", "all")

_OF_FIRST = (*OF_A_CAR, "sensors", "effects", *PLANNER_OPTIONS)
_OF_RACE = (*OF_A_COURSE, "laps", "time_limit", "grid")
"""Fields of a Setup that an environment uses, and `start` and the opponents besides."""


@dataclass(frozen=True, kw_only=True, repr=False)
class EnvironmentSettings(CarSettings):
    """Settings of an environment; the same for dm_env, Gymnasium and its vector environment.

    `changes`, `start`, `effects` and `rewards` may be mappings of the fields of their classes. With more cars than one,
    `start` is where the first place of the grid is.

    Raises:
      SettingsError: a value outside what is accepted.
      ModelError: a file that is not that of a vehicle.
    """

    track: Course | str | Sequence[Course | str] = "oval"  # as `load_track` takes it; a list: drawn for each episode
    laps: int = 1  # to be driven; of a scene 1
    start: Start | str = "random"  # "random": anywhere on the lap; "line": standing on the start of the centreline
    time_limit: float | None = None  # [s] of an episode; None: what a car of 0.5 m/s needs, or the scene's own
    obstacles: Sequence[Obstacle] | int = 0  # on the track, or how many boxes at random places, which stay there
    obstacle_seed: int = 0  # of their places, and of `moving`
    moving: str | Sequence[MovingObstacle] = ""  # on the track: kinds at random places, as "pedestrian:2,crossing"
    effects: LidarEffects = field(default_factory=LidarEffects)  # what the LiDAR does to a scan
    beam_step: int = 1  # every how many-th beam is seen, counted from the one straight ahead to both sides
    speed_range: tuple[float, float] | None = None  # [m/s] that an action may ask for; None: what the car can
    action: str = DEFAULT_ACTION  # what its two parts are
    normalised_actions: bool = False  # both parts of an action are from -1 to 1
    action_repeat: int = 1  # ticks of an environment's step
    smoothing: float = 0.0  # [s] time constant of a filter of the commands
    residual: Any = None  # a planner whose commands the actions correct; a mapping of its fields, too
    rewards: Rewards = field(default_factory=Rewards)  # weights of the terms, by name
    end_conditions: Sequence[str | EndCondition] = ()  # that end an episode besides the race's own reasons
    on_contact: str = "end"  # what the touch of a wall or obstacle does: "end", "stop" the car there, or "continue"
    ended_by: str = "ego"  # whose end is that of an episode: "ego", its own; "any": also a crash of another car; "all"
    observation: Any = DEFAULT_OBSERVATION  # in any way that Observation.of takes
    camera: str = ""  # on board, whose pictures are seen: width and height [px], as "64x48", or "64x48:chase"
    privileged: Any = ()  # terms of a second vector, for a critic
    opponents: tuple[Entry, ...] = ()  # the cars that do not learn, in any of the ways that `as_entries` takes
    grid: str = "staggered"  # on which several cars start, as `race` takes it
    grid_order: str = "as_listed"  # from the front, car 0 first; "reversed": car 0 last; "random": drawn each time
    randomize: Mapping[str, Any] | Randomization = field(default_factory=dict)  # ranges of what each episode draws
    builds: int | None = 64  # how many courses, with all else that is compiled, there are; None: one for each episode
    build_seed: int = 0  # of what is drawn for them

    def __post_init__(self) -> None:
        super().__post_init__()
        self._make("effects", LidarEffects)
        object.__setattr__(self, "rewards", Rewards.of(self.rewards))
        object.__setattr__(self, "end_conditions", as_end_conditions(self.end_conditions))
        object.__setattr__(self, "observation", Observation.of(self.observation))
        object.__setattr__(self, "privileged", as_privileged(self.privileged))
        if self.camera != "":
            from .camera import read_camera  # which imports what draws

            read_camera(self.camera)
        for name, least in (("laps", 1), ("obstacle_seed", 0), ("beam_step", 1)):
            require_whole(name, getattr(self, name), least)
        object.__setattr__(self, "obstacles", obstacles_or_count(self.obstacles))
        object.__setattr__(self, "moving", moving_or_text(self.moving))
        if not isinstance(self.start, str):
            self._make("start", Start)
        elif self.start not in STARTS:
            raise SettingsError(f"start is {self.start!r}; {accepted_names(self.start, STARTS, ', or a Start')}")
        if self.time_limit is not None:
            require(self, lambda value: 0.0 < value < math.inf, "a positive number", ("time_limit",), SettingsError)
        check_actions(self)
        if self.effects.motion_distortion:
            raise SettingsError("motion distortion of the LiDAR, in an environment; accepted: in `race` only")
        for name, accepted in (
            ("grid", GRIDS), ("grid_order", GRID_ORDERS), ("on_contact", ON_CONTACT), ("ended_by", ENDED_BY),
        ):  # fmt: skip
            value = getattr(self, name)
            if value not in accepted:
                raise SettingsError(f"{name} is {value!r}; {accepted_names(value, accepted)}")
        if self.ended_by == "any" and self.on_contact != "end":
            said = f"ended_by is 'any' and on_contact is {self.on_contact!r}, with which no touch ends anything"
            raise SettingsError(f"{said}; accepted: 'any' with on_contact 'end'; 'ego', 'all'")
        require_whole("builds", self.builds, 1, optional=True)
        require_whole("build_seed", self.build_seed, 0)
        if isinstance(self.track, list):
            object.__setattr__(self, "track", tuple(self.track))
        opponents: Any = as_entries(self.opponents, self)
        drawn = read_randomization(self.randomize, self.track, self, laps=self.laps, opponents=len(opponents))
        if self.floor is not None and "mu" in drawn.ranges:
            said = f"randomize has mu, and floor is {self.ground_name!r}"
            raise SettingsError(f"{said}; accepted: one of them, the floor has a friction of its own")
        object.__setattr__(self, "randomize", drawn)
        if drawn.ranges:
            opponents = as_entries(all_opponents(drawn, opponents), self)
        object.__setattr__(self, "opponents", opponents)
        if self.assist != "full" and self.residual is None and not opponents:
            said = f"assist is {self.assist!r}, and no planner drives in this environment"
            raise SettingsError(f"{said}; accepted: with residual or opponents, whose stages it chooses")

    @classmethod
    def of(cls, description: Mapping[str, Any]) -> Self:
        """Return settings by their names: those of this class; `setup`, a Setup; and the FIELD_OF of one, as `mass`.

        Raises:
          SettingsError: an unknown name; the message has the nearest known one. A setting of a Setup that an
            environment cannot use: of the planner, whose place the policy takes, or of a whole race.
        """
        own = dict(description)
        setup, of_setup = own.pop("setup", None), {name: own.pop(name) for name in FIELD_OF if name in own}
        if setup is None and not of_setup:
            return cls(**known_settings(own, cls, "an environment"))
        of_setup |= {name: own.pop(name) for name in ("changes", "effects", "start") if _is_part(own.get(name))}
        base = setup if isinstance(setup, Setup) or setup is None else Setup.read(setup)
        given = _settings_of(Setup.of(base, caller="an environment", **of_setup))
        return cls(**given | known_settings(own, cls, "an environment"))

    @property
    def fixed_start(self) -> Start | None:
        """Start of each episode; None: it is drawn at random."""
        if isinstance(self.start, str):
            return Start() if self.start == "line" else None
        return self.start

    @property
    def looks_at_state(self) -> bool:
        """Whether any term is a function of the cars' state, besides the four rewards that are compiled."""
        assert isinstance(self.observation, Observation)
        parts = self.observation.parts
        seen = any(isinstance(part.term, ObservationTerm) for part in parts) or bool(self.privileged)
        return seen or len(self.rewards.others) + len(self.end_conditions) > 0

    @property
    def randomization(self) -> Randomization:
        """Ranges that each episode draws from; empty: no randomisation."""
        assert isinstance(self.randomize, Randomization)
        return self.randomize

    def without_randomization(self, values: Mapping[str, Any]) -> Self:
        """Return the settings of an environment that draws nothing, with some drawn values of what is compiled."""
        own = {name: values[name] for name in ("track", "vehicle", "tires") if name in values}
        return replace(self, **({"track": self.courses[0]} | own), randomize={})

    @property
    def courses(self) -> tuple[Course | str, ...]:
        """The courses that may be drawn, or the only one."""
        drawn = self.randomization.ranges.get("track")
        return (self.track,) if drawn is None else drawn.extremes  # type: ignore[return-value]

    def drawn_entries(self, values: Mapping[str, Any]) -> tuple[Entry, ...]:
        """Return the opponents of an episode that draws some values."""
        return self._entries_of(values.get("opponents"), values.get("opponent"), values.get("opponent_speed"))

    @cached_property
    def _entries_of(self) -> Callable[[Any, Any, Any], tuple[Entry, ...]]:
        @lru_cache(maxsize=256)  # the same object where it is the same, which keeps its planner
        def entries(count: int | None, controller: str | None, speed: float | None) -> tuple[Entry, ...]:
            own = self.opponents if count is None else self.opponents[:count]
            changed = {"controller": controller, "max_speed": speed}
            said: dict[str, Any] = {name: value for name, value in changed.items() if value is not None}
            return tuple(replace(entry, **said) for entry in own) if said else own

        return entries

    @property
    def drawn_opponents(self) -> tuple[Entry, ...]:
        """An opponent with each planner that may be drawn."""
        who = self.randomization.ranges.get("opponent")
        return () if who is None else tuple(replace(self.opponents[0], controller=str(name)) for name in who.extremes)

    def start_grid(self, world: World) -> StartGrid:
        """Return where the cars of a world start."""
        learners = len(world.cars) - len(self.opponents)
        own = [None] * learners + [entry.start for entry in self.opponents]
        return StartGrid(world, self.fixed_start, kind=self.grid, order=self.grid_order, own=own, learners=learners)

    def make_ground(self, agents: int = 1) -> Ground:
        """Return the ground of so many cars that learn; errors as of `Ground.of`."""
        return Ground.of(
            self.courses[0], car=self.car.parameters, obstacles=self.obstacles, obstacle_seed=self.obstacle_seed,
            moving=self.moving, start=(self.fixed_start or Start()).s, cars=agents + len(self.opponents),
        )  # fmt: skip

    def make_world(self, agents: int = 1) -> World:
        """Return the compiled world of so many cars that learn, all alike, and the opponents.

        Raises:
          TrackError, SettingsError: what cannot be driven.
        """
        ground = self.make_ground(agents)
        if math.isfinite(ground.course.length):  # open ground is driven on for its time
            laps_to_drive(ground.course, self.laps)  # refuses more than a scene has
        learner = WorldCar(vehicle=self.car, mu=self.set_mu, changes=self.changes, tires=self.tire_set)
        others = [learner] * (agents - 1) + [entry.world_car() for entry in self.opponents]
        return self.world(ground.course, obstacles=ground.boxes, others=others)

    def make_engine(
        self, count: int = 1, threads: int = 1, *, agents: int = 1, world: World | None = None, own_model: bool = False
    ) -> Engine:
        """Return an engine of so many worlds; of `world`, if it is given, and of its model itself with `own_model`.

        Raises:
          TrackError, SettingsError: what cannot be driven.
        """
        return Engine(
            world or self.make_world(agents), count, laps=self.laps, time_limit=self.time_limit, threads=threads,
            own_model=own_model,
        )  # fmt: skip


def _is_part(value: Any) -> bool:
    """Say whether a setting is an object or a mapping, and not left out or one of the words of an environment."""
    return value is not None and not isinstance(value, str)


def _settings_of(setup: Setup) -> dict[str, Any]:
    """Return the settings of an environment that a setup says."""
    setup.require_usable("an environment", *_OF_FIRST, *_OF_RACE, "start")
    first, usual = setup.first, Setup()
    own = {name: getattr(first, name) for name in _OF_FIRST}
    own |= {name: getattr(setup, name) for name in _OF_RACE if getattr(setup, name) != getattr(usual, name)}
    return (
        own
        | ({"opponents": setup.entries[1:]} if len(setup.entries) > 1 else {})
        | ({} if first.start is None else {"start": first.start})
    )


def read_randomization(
    given: Any, track: Course | str | Sequence[Course | str], settings: CarSettings, *, laps: int, opponents: int
) -> Randomization:
    """Return what an environment draws; a list of tracks is the range of the track.

    SettingsError: a name that is not drawn or is given, too, or a value that cannot be had; TrackError: such a course.
    """
    if not isinstance(given, (Mapping, Randomization)):
        raise SettingsError(f'randomize is {shown(given)}; accepted: ranges by name, such as {{"mu": (0.5, 1.1)}}')
    made = given if isinstance(given, Randomization) else Randomization.of(given)
    if isinstance(track, (list, tuple)):
        courses = course_range(track)
        if made.ranges.get("track", courses) != courses:
            raise SettingsError("track is a list, and in randomize; accepted: one of them")
        made = Randomization({**made.ranges, "track": courses})
    elif "track" in made.ranges and track != "oval":
        raise SettingsError("track is given for all worlds and in randomize; accepted: one of them")
    if "opponents" not in made.ranges and opponents == 0:
        made.require_usable("an environment", OF_OPPONENTS, "it has no opponents")
    if made.ranges and made != given:
        check_randomization(made, settings, laps=laps)
    return made


def check_randomization(randomization: Randomization, settings: CarSettings, *, laps: int) -> None:
    """Refuse what an environment of some settings cannot draw; arguments and errors as of `read_randomization`."""
    ranges = randomization.ranges
    randomization.require_usable("an environment", (*OF_PLANNERS, PLANNER), "a policy drives in the planner's place")
    if "patches" in ranges and "patch_mu" not in ranges:
        raise SettingsError("randomize patches without patch_mu; accepted: the range of their friction, too")
    if "patch_mu" in ranges and settings.patches:
        raise SettingsError("patches is given for all worlds and patch_mu in randomize; accepted: one of them")
    randomization.check_base(settings, besides=("track", "opponents"))
    drawn = ranges["vehicle"].extremes if "vehicle" in ranges else (settings.car,)
    vehicles = [Vehicle.load(vehicle) for vehicle in drawn]  # type: ignore[arg-type]
    for vehicle in vehicles[1:]:
        if vehicle.lidar.beams.geometry != vehicles[0].lidar.beams.geometry:
            names = f"{vehicles[0].name!r} and {vehicle.name!r}"
            raise SettingsError(f"randomize vehicle: {names} have LiDARs with other beams; accepted: the same in all")
    for source in dict.fromkeys(ranges["track"].extremes if "track" in ranges else ()):
        if not str(source).startswith("random:"):
            for vehicle in vehicles:
                course = load_track(str(source), car=vehicle.parameters)
                course.check_car(vehicle.parameters)
                laps_to_drive(course, laps)


def all_opponents(randomization: Randomization, given: Sequence[Entry]) -> tuple[Any, ...]:
    """Return the opponents of each world, of which as many take part in an episode as it draws."""
    ranges = randomization.ranges
    if "opponents" not in ranges:
        return tuple(given)
    most = max(int(number) for number in ranges["opponents"].extremes)
    who = ranges["opponent"].extremes[0] if "opponent" in ranges else "gap_finder"
    return (*given, *[who] * (most - len(given)))
