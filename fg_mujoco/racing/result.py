"""Result of a race: the figures of the summary, one row of telemetry a tick, and every state."""

from __future__ import annotations

import hashlib
import math
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np

from ..arguments import Suggesting, explain_class
from ..display import Shown, brief, quoted
from ..lidar.effects import LidarEffects
from ..messages import CarParameters, FloatArray, read_only
from ..native_arrays import ArrayTable
from ..simulation.compiled_tick import KEPT
from ..simulation.telemetry import COMMAND, column_index, column_meant, statistics_figures
from ..simulation.termination import END_REASONS, WrongWay
from ..simulation.world import OBSTACLE_PREFIX
from ..vehicle.car import WHEELS
from .decision_times import FEWEST, MOST, DecisionTimes

if TYPE_CHECKING:
    from ..simulation.engine import Engine
    from ..simulation.planner_adapter import DecisionStep
    from ..simulation.planner_failure import PlannerFailure
    from ..simulation.settings import Start
    from ..simulation.world import World
    from .crash import Crash, Rollover
    from .entries import Entry
    from .off_the_wheels import Jump, Stuck
    from .rules import Contact, Overtake, Restart, Warned
    from .setup import Setup


@explain_class
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class CarResult(Suggesting):
    """How a car of a race fared. Fields and properties are named as in the JSON summary; arrays are read-only.

    `end_reason` is one of "finished", "crash", "rolled_over" (the car lies on its side or its roof), "wrong_way",
    "no_progress", "time_limit", "unstable" (MuJoCo warned of a bad state), "interrupted", "decision_limit" (the planner
    took longer for a decision than it was allowed), "planner_failed", and "disqualified" by race control.
    """

    name: str
    position: int  # from 1: by when they finished, then by how far they came
    entry: Entry  # what the car was entered with
    start: Start
    controller: str  # without settings in brackets; of an object its class
    controller_origin: dict[str, Any]  # as of `origin`, and `files` that it reads; or `commands` without a planner
    planner_settings: dict[str, Any]  # those that differ from its own
    assist: str  # stages between the planner and the command; none: also of one that decides by itself
    laps_completed: int
    lap_times_s: tuple[float, ...]  # the first from a standing start
    finished: bool
    end_reason: str
    end_time_s: float  # when its race was over; the others' may have gone on
    wrong_way: WrongWay | None  # where the car turned; None: its race did not end by going the wrong way
    crash: Crash | None  # into what, where, when, how fast; None: its race did not end in a crash
    jumps: tuple[Jump, ...]  # each time that no wheel touched the ground for a tenth of a second
    stuck: Stuck | None  # where its chassis rests on the ground; None: its race did not end without progress, and so
    planner_failure: PlannerFailure | None  # where and why the planner failed; None: it did not
    last_decision: tuple[DecisionStep, ...]  # what each step made of the last command, as the planner tells it
    collisions_wall: int  # with walls and obstacles
    collisions_car: int  # contacts with other cars
    max_slide_m_s: float  # greatest sliding speed of any tire (`TireSlip.sliding_speed`); NaN of tires without a peak
    max_lateral_slide_m_s: float  # the same, across the wheel's heading: sideways, and not by spinning or locked wheels
    slide_time_fraction: float  # share of the physics steps in which a tire slid (`TireSlip.slides`)
    mean_speed_m_s: float
    max_speed_m_s: float
    decision_times: DecisionTimes  # wall times that the planner took for its decisions
    clamped_commands: int  # outside the car's limits of steering angle or speed, which the car held within them
    mu: float
    controller_source: bytes | None = field(repr=False)  # the file that the planner's class is in, as it was read
    telemetry: FloatArray = field(repr=False)  # (ticks, len(TELEMETRY)) to the end of the last car's race

    def __post_init__(self) -> None:
        object.__setattr__(self, "telemetry", read_only(self.telemetry))

    @property
    def vehicle(self) -> str:
        """Name of the vehicle."""
        return self.entry.car.name

    @property
    def vehicle_sha256(self) -> str:
        """SHA-256 of its MJCF and its LiDAR's."""
        return self.entry.car.sha256

    @property
    def tires(self) -> str:
        """Name of the set of tires; `contact`: MuJoCo's own contacts."""
        return self.entry.tire_set.name

    @property
    def tires_model(self) -> str:
        """Law of the tires, or `contact`: it says when they slide."""
        return self.entry.tire_set.model

    @property
    def tires_sha256(self) -> str:
        """SHA-256 of the numbers of the tires."""
        return self.entry.tire_set.sha256

    @property
    def floor(self) -> str | None:
        """Name of the floor whose friction the tires had; None: it is of none, but of `mu` or of the tires' file."""
        return self.entry.ground_name

    @property
    def planner_mu(self) -> float:
        """Friction coefficient that the planner assumed."""
        return float(self.entry.assumed_mu)

    @property
    def speed_limit_m_s(self) -> float:
        """Fastest that the planner could command [m/s]."""
        return float(self.entry.max_speed)

    @property
    def lidar_effects(self) -> LidarEffects:
        """Effects of the LiDAR on a scan."""
        return self.entry.effects

    @property
    def odometry_drift(self) -> float:
        """Relative error of the speeds and the yaw rate that the planner was given."""
        return float(self.entry.odometry_drift)

    @property
    def seed(self) -> int:
        """Seed of the LiDAR's noise and dropouts."""
        return self.entry.seed

    @property
    def rollover(self) -> Rollover | None:
        """Place where the car rolled over; None: it did not."""
        if self.end_reason != "rolled_over":
            return None
        from .crash import Rollover

        return Rollover.of(self.end_reason, self.telemetry[self.column("time_s") < self.end_time_s])

    def _meant(self, name: str) -> str | None:
        return column_meant(name, super()._meant(name))

    def __repr__(self) -> str:
        best = f"best {min(self.lap_times_s):.2f} s" if self.lap_times_s else "no lap"
        driven = f"{self.laps_completed} laps, {best}, {self.end_reason}"
        return brief(self, f"{self.position}. {quoted(self.name)}", quoted(self.controller), driven)

    @property
    def max_slide_place(self) -> str:
        """Which tire slid the fastest, when and where, in words; empty: none slid."""
        raced = self.telemetry[self.column("time_s") < self.end_time_s]
        first = column_index(f"slide_{WHEELS[0]}_m_s")
        slides = np.nan_to_num(raced[:, first : first + len(WHEELS)])
        if not self.slide_time_fraction > 0.0 or not slides.size:
            return ""
        tick, wheel = np.unravel_index(int(slides.argmax()), slides.shape)
        time, x, y = (raced[tick, column_index(name)] for name in ("time_s", "x_m", "y_m"))
        return f"{WHEELS[wheel].replace('_', ' ')} tire at ({x:.2f}, {y:.2f}) m, t = {time:.2f} s"

    @property
    def end(self) -> str:
        """How its race ended, in words."""
        if self.planner_failure is not None:
            return f"the planner failed: {self.planner_failure}"
        if self.crash is not None or self.wrong_way is not None:
            return str(self.crash or f"wrong way: {self.wrong_way}")
        if self.rollover is not None:
            return f"rolled over {self.rollover}"
        if self.stuck is not None:
            return f"stuck {self.stuck}"
        return "no collision" if self.finished else f"ended by {self.end_reason}"

    def column(self, name: str) -> FloatArray:
        """Return one column of the telemetry by its name in TELEMETRY, with or without its unit. Shape (ticks,).

        Raises:
          SettingsError: there is none.
        """
        return self.telemetry[:, column_index(name)]

    def row(self) -> dict[str, Any]:
        """Return the row in `cars` of the JSON summary."""
        values = {name: getattr(self, name) for name in _OF_A_CAR}
        for name in ("wrong_way", "crash", "decision_times", "lidar_effects", "start"):
            values[name] = None if values[name] is None else asdict(values[name])
        values |= {"stuck": None if self.stuck is None else asdict(self.stuck), "jumps": [*map(asdict, self.jumps)]}
        values["last_decision"] = [step._asdict() for step in self.last_decision]
        failure = self.planner_failure
        sensors = {"sensors": [sensor.described() for sensor in self.entry.sensed]} if self.entry.sensed else {}
        return values | {"planner_failure": None if failure is None else failure.summary()} | sensors


_OF_A_CAR = (
    "name", "position", "vehicle", "vehicle_sha256", "tires", "tires_model", "tires_sha256", "controller",
    "controller_origin", "assist", "laps_completed", "lap_times_s", "finished", "end_reason", "end_time_s",
    "wrong_way", "crash", "jumps", "stuck", "planner_failure", "last_decision", "collisions_wall", "collisions_car",
    "max_slide_m_s", "max_lateral_slide_m_s",
    "slide_time_fraction", "mean_speed_m_s", "max_speed_m_s", "decision_times", "clamped_commands", "seed", "mu",
    "floor", "planner_mu", "speed_limit_m_s", "lidar_effects", "odometry_drift", "planner_settings", "start",
)  # fmt: skip
"""Keys of a car's row in the JSON summary, in their order."""

OF_CAR_0 = tuple(
    name
    for name in _OF_A_CAR
    if name not in ("name", "position", "end_time_s", "collisions_wall", "collisions_car", "start")
)
"""Keys of a car's row that the summary has for car 0 besides, with `collisions`."""

_OF_ALL = (
    "track", "laps_requested", "sim_time_s", "wall_time_s", "realtime_factor", "obstacles", "obstacle_seed",
    "moving", "trajectory_sha256", "winner",
)  # fmt: skip
_ELSEWHERE = {
    "collisions": "car.collisions_wall", "decision_limit_s": "setup.decision_limit",
    **{name: f"setup.{name}" for name in ("decision_limit", "grid", "lidar", "rules")},
}  # fmt: skip
"""What is looked for in a result -> where it is."""

EVENTS = ("overtakes", "contacts", "warnings", "restarts")


@explain_class
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class RaceResult(Shown):
    """How a race went: its setup, how each car fared, and the trajectory of all. Arrays are read-only."""

    setup: Setup
    track: str
    laps_requested: int
    obstacles: int  # how many stood on the track, besides what a scene has
    cars: tuple[CarResult, ...]  # in the order of the entries
    winner: str | None  # name of the car that finished first
    overtakes: tuple[Overtake, ...]
    contacts: tuple[Contact, ...]  # of cars with each other
    warnings: tuple[Warned, ...]  # of race control
    restarts: tuple[Restart, ...]
    sim_time_s: float  # until the last car's race was over
    wall_time_s: float  # of the drive
    realtime_factor: float  # sim_time_s / wall_time_s
    trajectory_sha256: str  # of all states and controls, bit for bit
    world: World = field(repr=False)
    states: FloatArray = field(repr=False)  # (ticks + 1, n) mjSTATE_INTEGRATION at the start of each tick; the last
    ctrl: FloatArray = field(repr=False)  # (ticks, 2) what the actuators got: steering [rad], speed [m/s], of each car

    def __post_init__(self) -> None:
        for name in ("states", "ctrl"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def car(self) -> CarResult:
        """How car 0 fared."""
        return self.cars[0]

    @property
    def obstacle_seed(self) -> int | None:
        """Seed of the random places of obstacles and of what moves; None: none were placed at random."""
        placed, moving = self.setup.obstacles, self.setup.moving
        drawn = (isinstance(placed, int) and placed) or (isinstance(moving, str) and moving)
        return self.setup.obstacle_seed if drawn else None

    @property
    def moving(self) -> str | int | None:
        """Moving things on the track: `moving` of its setup, or their number; None: none, or a scene's own."""
        moving = self.setup.moving
        return (moving if isinstance(moving, str) else len(moving)) or None

    def _meant(self, name: str) -> str | None:
        """Return what was probably meant, of the race or of car 0."""
        meant = _ELSEWHERE.get(name) or column_meant(name, super()._meant(name))
        return meant if meant is None or "." in meant or meant in super()._names() else f"car.{meant}"

    def _names(self) -> list[str]:
        return [*super()._names(), *self.car._names()]

    def __repr__(self) -> str:
        car = self.car
        best = f", best {min(car.lap_times_s):.2f} s" if car.lap_times_s else ""
        laps = f"{car.laps_completed} of {self.laps_requested} laps in " if self.laps_requested else ""
        laps += f"{self.sim_time_s:.1f} s{best} at mu {car.mu:.4g}" + (f" on floor {car.floor}" if car.floor else "")
        others = f" among {len(self.cars)} cars" if len(self.cars) > 1 else ""
        return brief(self, f"{quoted(car.controller)} on {quoted(self.track)}{others}: {laps}, {car.end}")

    def summary(self) -> dict[str, Any]:
        """Return what the JSON summary holds: the race, each car in `cars`, and the figures of car 0 besides."""
        rows = [car.row() for car in self.cars]
        limit = self.setup.decision_limit
        return {
            **{name: rows[0][name] for name in (*OF_CAR_0, "sensors") if name in rows[0]},
            "collisions": self.car.collisions_wall,
            **{name: getattr(self, name) for name in _OF_ALL},
            "decision_limit_s": None if limit is None else float(limit),
            **{name: getattr(self.setup, name) for name in ("lidar", "grid", "rules")},
            **{name: [asdict(part) for part in getattr(self, name)] for name in EVENTS},
            "cars": rows,
        }


def clamped_commands(telemetry: FloatArray, car: CarParameters) -> int:
    """Return how many commands of a telemetry (ticks, len(TELEMETRY)) are outside a car's limits."""
    steering_angle, speed = telemetry[:, COMMAND], telemetry[:, COMMAND + 1]
    beyond = (np.abs(steering_angle) > car.max_steering_angle) | (speed > car.max_speed) | (speed < car.min_speed)
    return int(beyond.sum())


def clamped_hint(telemetry: FloatArray, car: CarParameters) -> str:
    """Return what is said of a drive most of whose commands were beyond the car's limits; empty: they were not.

    Args:
      telemetry: (ticks, len(TELEMETRY)).
      car: whose limits they are.
    """
    clamped, count, lock = clamped_commands(telemetry, car), len(telemetry), car.max_steering_angle
    if count < FEWEST or clamped <= MOST * count:
        return ""
    angles, speeds = np.abs(telemetry[:, COMMAND]), telemetry[:, COMMAND + 1]
    said = f"{clamped} of {count} commands were beyond the car's limits"
    if (angles > lock).sum() < ((speeds > car.max_speed) | (speeds < car.min_speed)).sum():
        limits = f"{car.min_speed:g} to {car.max_speed:g} m/s"
        return f"{said} of {limits}, up to {np.abs(speeds).max():.3g} m/s. Speeds are in metres per second"
    typical = float(np.median(angles[angles > lock]))
    asked = f"{said}: half of them asked for a steering angle of {typical:.3g} rad or more, the car has {lock:.3g}"
    if typical > math.pi / 3.0:
        return f"{asked}. Steering angles are in radians: if these are degrees, try math.radians(angle)"
    return f"{asked}. Try less gain, or the steering angle held within car.max_steering_angle"


class Trajectory(TypedDict):
    """The arrays of a RaceResult."""

    telemetry: FloatArray
    states: FloatArray
    ctrl: FloatArray


class History:
    """History of world 0 of an engine, one row a tick.

    Args:
      engine: at the start of the race.
      capacity: of how many ticks at first; it doubles when it is full.
    """

    def __init__(self, engine: Engine, capacity: int = 4096) -> None:
        self._ticks = np.zeros(1, np.int64)
        state, ctrl = engine.state(0), engine.ctrl(0)
        self._now = (engine.telemetry, state, ctrl)  # live
        self._telemetry = np.empty((capacity, *engine.telemetry.shape))  # of all cars
        self._states = np.empty((capacity + 1, len(state)))
        self._ctrl = np.empty((capacity, len(ctrl)))
        self._states[0] = state
        self._table: ArrayTable | None = None

    @property
    def ticks(self) -> int:
        """How many are complete."""
        return int(self._ticks[0])

    def append(self) -> None:
        """Keep the tick that was driven."""
        self._make_room()
        tick = self._ticks[0]
        telemetry, state, ctrl = self._now
        self._telemetry[tick], self._states[tick + 1], self._ctrl[tick] = telemetry, state, ctrl
        self._ticks[0] = tick + 1  # last: an interrupted tick leaves no row

    def room(self, ticks: int) -> ArrayTable:
        """Return a table of compiled_tick.KEPT, in which compiled code keeps so many more ticks."""
        self._make_room(ticks)
        if self._table is None:
            rows = {"telemetry": self._telemetry, "states": self._states, "controls": self._ctrl}
            self._table = ArrayTable(KEPT, {"ticks": self._ticks, **rows})
        return self._table

    def _make_room(self, ticks: int = 1) -> None:
        """See to it that so many more ticks have room, which are fewer than the capacity at first."""
        if self._ticks[0] + ticks > len(self._telemetry):
            for name in ("_telemetry", "_ctrl", "_states"):
                rows = getattr(self, name)
                setattr(self, name, np.concatenate((rows, np.empty_like(rows))))
            self._table = None

    def arrays(self, row: int = 0) -> Trajectory:
        """Return telemetry of a car, states and ctrl as in RaceResult, of the ticks that are complete."""
        return {
            "telemetry": self._telemetry[: self.ticks, row],
            "states": self._states[: self.ticks + 1],
            "ctrl": self._ctrl[: self.ticks],
        }


def trajectory_sha256(states: FloatArray, ctrl: FloatArray) -> str:
    """Return the SHA-256 of a trajectory's bits, little-endian float64, states (ticks + 1, n) then ctrl (ticks, 2)."""
    digest = hashlib.sha256()
    for array in (states, ctrl):
        digest.update(np.ascontiguousarray(array, dtype="<f8").tobytes())
    return digest.hexdigest()


# figures that follow from what was driven: a race takes them, and a replay takes them again


COURSE_FIGURES = (
    "laps_completed", "lap_times_s", "finished", "end_reason", "wrong_way", "crash", "jumps", "stuck", "track",
    "obstacles",
)  # fmt: skip
"""Names of `course_figures` and `track_figures`."""


def driven_figures(engine: Engine, telemetry: FloatArray, row: int = 0, put_back: int = 0) -> dict[str, Any]:
    """Return the figures of a car of world 0 that need no course.

    Args:
      engine: at the end of the race.
      telemetry: of the car (ticks, len(TELEMETRY)).
      row: of the car.
      put_back: how often race control has put it back after it had touched a wall.
    """
    car = engine.world.cars[row]
    return {
        **statistics_figures(engine.statistics[row]),
        "collisions_wall": put_back + int(engine.crashed[row]),
        "clamped_commands": clamped_commands(telemetry, car.parameters),
        "mu": car.mu,
    }


def world_figures(trajectory: Trajectory) -> dict[str, Any]:
    """Return the figures of all cars together."""
    states = trajectory["states"]
    return {
        "sim_time_s": float(states[-1, 0]),  # mjSTATE_TIME comes first in a state
        "trajectory_sha256": trajectory_sha256(states, trajectory["ctrl"]),
    }


def track_figures(engine: Engine) -> dict[str, Any]:
    """Return the name of the course, and how many obstacles stand on it besides its own."""
    model, course = engine.world.model, engine.world.track
    geoms = (model.geom(i).name for i in range(model.ngeom))
    placed = sum(name.startswith(OBSTACLE_PREFIX) for name in geoms) - len(course.obstacles)
    return {"track": course.name, "obstacles": placed}


def course_figures(engine: Engine, trajectory: Trajectory, row: int = 0) -> dict[str, Any]:
    """Return the figures of the race of a car of world 0 on its course, as its monitor has judged it.

    The trajectory ends with the tick in which that car's race was over.
    """
    world, monitor = engine.world, engine.monitor
    course, timer, laps = world.track, monitor.timers[row], monitor.laps
    reason = END_REASONS[monitor.reasons[row]]
    crash = None
    if reason == "crash":
        from .crash import crash_of

        crash = crash_of(world, **trajectory, timer=timer, laps=laps, period=engine.period, row=row)
    wrong_way = None
    if reason == "wrong_way":
        time, speed = (trajectory["telemetry"][:, column_index(name)] for name in ("time_s", "vx_m_s"))
        wrong_way = WrongWay.of(timer, course.length, laps, float(speed[time >= timer["furthest_time"]].mean()))
    jumps: tuple[Jump, ...] = ()
    stuck = None
    telemetry, loads = trajectory["telemetry"], column_index(f"load_{WHEELS[0]}_N")
    flies = ~(telemetry[:, loads : loads + len(WHEELS)] > 0.0).any(axis=1)  # nor is NaN
    if flies.any() or reason == "no_progress":
        from .off_the_wheels import jumps_of, stuck_of

        jumps = jumps_of(telemetry)
        if reason == "no_progress":
            stuck = stuck_of(world, telemetry, trajectory["states"][-1], row)
    lap_times = tuple(monitor.lap_times[row, : int(timer["laps_completed"])].tolist())
    return {
        "laps_completed": len(lap_times),
        "lap_times_s": lap_times,
        "finished": reason == "finished",
        "end_reason": reason,
        "wrong_way": wrong_way,
        "crash": crash,
        "jumps": jumps,
        "stuck": stuck,
    }
