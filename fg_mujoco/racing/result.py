"""What a race leaves behind: the figures of the summary, one row of telemetry a tick, and every state."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np

from ..arguments import Suggesting, explain_class
from ..array_table import ArrayTable, Table
from ..display import Shown, brief, quoted, table
from ..lidar.effects import LidarEffects
from ..messages import CarParameters, FloatArray, read_only
from ..simulation.compiled_tick import KEPT
from ..simulation.planner_failure import PlannerFailure
from ..simulation.settings import friction_text
from ..simulation.telemetry import COMMAND, column_index, column_meant
from ..simulation.termination import WrongWay
from ..vehicle.tires import CONTACT, MagicFormula
from .crash import Crash
from .decision_times import DecisionTimes
from .driven_line_svg import driven_line, driven_lines
from .rollover import Rollover

if TYPE_CHECKING:
    from ..simulation.engine import Engine
    from ..simulation.settings import Start
    from ..simulation.world import World
    from .race_control import Contact, Overtake, Restart, Warned


@explain_class
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class CarResult(Suggesting):
    """How one of several cars fared. Fields are as in RaceResult; arrays are read-only."""

    name: str
    position: int  # from 1: by when they finished, then by how far they came
    vehicle: str
    vehicle_sha256: str
    tires: str
    tires_model: str
    tires_sha256: str
    controller: str
    controller_origin: dict[str, Any]
    laps_completed: int
    lap_times_s: tuple[float, ...]
    finished: bool
    end_reason: str  # "disqualified", too: by race control
    end_time_s: float  # when its race was over; the others' may have gone on
    wrong_way: WrongWay | None
    crash: Crash | None  # into a wall or an obstacle
    planner_failure: PlannerFailure | None
    collisions_wall: int
    collisions_car: int  # contacts with other cars
    max_slide_m_s: float
    max_lateral_slide_m_s: float
    slide_time_fraction: float
    mean_speed_m_s: float
    max_speed_m_s: float
    decision_times: DecisionTimes
    clamped_commands: int
    seed: int
    mu: float
    planner_mu: float
    speed_limit_m_s: float
    lidar_effects: LidarEffects
    odometry_drift: float
    planner_settings: dict[str, Any]
    start: Start
    controller_source: bytes | None = field(repr=False)
    telemetry: FloatArray = field(repr=False)  # (ticks, len(TELEMETRY)) to the end of the last car's race

    def __post_init__(self) -> None:
        object.__setattr__(self, "telemetry", read_only(self.telemetry))

    def _meant(self, name: str) -> str | None:
        return column_meant(name, super()._meant(name))

    def __repr__(self) -> str:
        best = f"best {min(self.lap_times_s):.2f} s" if self.lap_times_s else "no lap"
        driven = f"{self.laps_completed} laps, {best}, {self.end_reason}"
        return brief(self, f"{self.position}. {quoted(self.name)}", quoted(self.controller), driven)

    def column(self, name: str) -> FloatArray:
        """Return one column of the telemetry by its name in TELEMETRY, with or without its unit. Shape (ticks,).

        Raises:
          SettingsError: there is none.
        """
        return self.telemetry[:, column_index(name)]

    def row(self) -> dict[str, Any]:
        """Return the row in `cars` of the JSON summary."""
        values = {
            f.name: getattr(self, f.name) for f in fields(self) if f.name not in ("controller_source", "telemetry")
        }
        parts = ("wrong_way", "crash", "decision_times", "lidar_effects", "start")
        for name in parts:
            values[name] = None if values[name] is None else asdict(values[name])
        failure = self.planner_failure
        return values | {"planner_failure": None if failure is None else failure.summary()}


@explain_class
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class RaceResult(Shown):
    """How a race went. The summary's fields are named as in its JSON; arrays are read-only.

    `end_reason` is one of "finished", "crash", "rolled_over" (the car lies on its side or its roof), "wrong_way",
    "no_progress", "time_limit", "unstable" (MuJoCo warned of a bad state), "interrupted", "decision_limit" (the planner
    took longer for a decision than it was allowed) and "planner_failed" (of a result that a PlannerError carries).
    """

    track: str
    vehicle: str
    vehicle_sha256: str  # of its MJCF and its LiDAR's
    tires: str  # the name of their set; `contact`: MuJoCo's own contacts
    tires_model: str  # of their law, or `contact`: it says when they slide
    tires_sha256: str  # of their numbers
    controller: str
    controller_origin: dict[str, Any]  # of the planner: distribution and version, or file; hashes of source and `files`
    laps_requested: int
    laps_completed: int
    finished: bool
    end_reason: str
    wrong_way: WrongWay | None  # where the car turned; None: the race did not end by going the wrong way
    crash: Crash | None  # into what, where, when, how fast; None: the race did not end in a crash
    planner_failure: PlannerFailure | None  # where and why the planner failed; None: it did not
    lap_times_s: tuple[float, ...]  # the first from a standing start
    collisions: int
    max_slide_m_s: float  # greatest sliding speed of any tire (`TireSlip.sliding_speed`)
    max_lateral_slide_m_s: float  # the same, across the wheel's heading: sideways, and not by spinning or locked wheels
    slide_time_fraction: float  # share of the physics steps in which a tire slid (`TireSlip.slides`)
    mean_speed_m_s: float
    max_speed_m_s: float
    sim_time_s: float
    wall_time_s: float
    decision_times: DecisionTimes  # wall times that the planner took for its decisions
    decision_limit_s: float | None  # that it was allowed for each; None: any
    clamped_commands: (
        int  # commands outside the car's limits of steering angle or speed, which the car held within them
    )
    realtime_factor: float  # from the second tick on: in the first, kernels are read from disk, or compiled
    seed: int
    mu: float
    planner_mu: float
    speed_limit_m_s: float
    lidar: str
    lidar_effects: LidarEffects
    odometry_drift: float  # relative error of the speeds and the yaw rate that the planner was told
    obstacles: int  # how many stood on the track, besides what a scene has
    obstacle_seed: int | None  # of their random places; None: they were not placed at random
    planner_settings: dict[str, Any]  # those that differ from its own
    trajectory_sha256: str  # of all states and controls, bit for bit
    controller_source: bytes | None = field(repr=False)  # the file that the planner's class is in, as it was read
    world: World = field(repr=False)
    telemetry: FloatArray = field(repr=False)  # (ticks, len(TELEMETRY))
    states: FloatArray = field(repr=False)  # (ticks + 1, n) mjSTATE_INTEGRATION at the start of each tick; the last
    ctrl: FloatArray = field(repr=False)  # (ticks, 2) what the actuators got: steering [rad], speed [m/s], of each car
    # of several cars; all else is of car 0
    car_results: tuple[CarResult, ...] = ()  # how each car fared; none where car 0 was alone
    grid: str | None = None
    rules: str | None = None
    winner: str | None = None  # name of the car that finished first
    overtakes: tuple[Overtake, ...] = ()
    contacts: tuple[Contact, ...] = ()
    warnings: tuple[Warned, ...] = ()
    restarts: tuple[Restart, ...] = ()

    def __post_init__(self) -> None:
        for name in ("telemetry", "states", "ctrl"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    def _meant(self, name: str) -> str | None:
        return column_meant(name, super()._meant(name))

    def __repr__(self) -> str:
        best = f", best {min(self.lap_times_s):.2f} s" if self.lap_times_s else ""
        laps = f"{self.laps_completed} of {self.laps_requested} laps in " if self.laps_requested else ""
        laps += f"{self.sim_time_s:.1f} s{best}"
        return brief(self, f"{quoted(self.controller)} on {quoted(self.track)}: {laps}, {self._end()}")

    @property
    def rollover(self) -> Rollover | None:
        """Where the car rolled over; None: the race did not end so, or was one of several cars."""
        return None if self.car_results else Rollover.of(self.end_reason, self.telemetry)

    def _end(self) -> str:
        """Return how the race ended, in words."""
        if self.planner_failure is not None:
            return f"the planner failed: {self.planner_failure}"
        if self.crash is not None or self.wrong_way is not None:
            return str(self.crash or f"wrong way: {self.wrong_way}")
        if self.rollover is not None:
            return f"rolled over {self.rollover}"
        return "no collision" if self.finished else f"ended by {self.end_reason}"

    def _repr_html_(self) -> str:
        if len(self.car_results) > 1:
            return self._html_of_several()
        rows = [
            ("planner, track, car", f"{self.controller}, {self.track}, {self.vehicle}"),
            ("end", f"{self.end_reason.replace('_', ' ')}: {self._end()}"),
            *(self._lap_rows() if self.laps_requested else [("time", f"{self.sim_time_s:.2f} s")]),
            ("speed", f"mean {self.mean_speed_m_s:.2f} m/s, greatest {self.max_speed_m_s:.2f} m/s"),
            ("greatest sliding", f"{self.max_slide_m_s:.3f} m/s, {100.0 * self.slide_time_fraction:.2f} % of the time"),
            ("friction coefficient", friction_text(self.mu, self.planner_mu)),
        ]
        ends = (("crashed here", self.crash), ("turned here", self.wrong_way), ("rolled over here", self.rollover))
        marks = [(text, (place.x_m, place.y_m)) for text, place in ends if place is not None]
        line = np.column_stack((self.column("x_m"), self.column("y_m")))
        picture = driven_line(
            self.world, line, self.column("speed_m_s"), time=self.sim_time_s, marks=marks, title=repr(self)
        )
        return table((), rows) + picture

    def _html_of_several(self) -> str:
        """Return what a notebook shows of several cars: a row for each, and the lines of all."""
        head = [
            ("track, laps", f"{self.track}, {self.laps_requested}"),
            ("winner", self.winner or "nobody finished"),
            ("overtakes, contacts", f"{len(self.overtakes)}, {len(self.contacts)}"),
        ]
        rows = []
        for index in sorted(range(len(self.car_results)), key=lambda index: self.car_results[index].position):
            car = self.car_results[index]
            best = f"{min(car.lap_times_s):.2f} s" if car.lap_times_s else "-"
            end = f"{car.end_reason.replace('_', ' ')} at {car.end_time_s:.2f} s"
            rows.append((
                f"{car.position}.", index, car.name, f"{car.controller}, {car.vehicle}", car.laps_completed, best, end,
                car.collisions_car, f"{car.max_slide_m_s:.3f} m/s",
            ))  # fmt: skip
        header = ("", "car", "name", "planner, vehicle", "laps", "best lap", "end", "contacts", "greatest sliding")
        lines = []
        for car in self.car_results:
            raced = car.column("time_s") < car.end_time_s - 1e-9  # one that has finished is taken off the course
            lines.append(np.column_stack((car.column("x_m"), car.column("y_m")))[raced])
        contacts = [(contact.x_m, contact.y_m) for contact in self.contacts]
        picture = driven_lines(self.world, lines, time=self.sim_time_s, contacts=contacts, title=repr(self))
        return table((), head) + table(header, rows) + picture

    def _lap_rows(self) -> list[tuple[str, str]]:
        """Return what a notebook shows of the laps."""
        laps = ", ".join(f"{time:.2f}" for time in self.lap_times_s[:10])
        more = f" and {len(self.lap_times_s) - 10} more" if len(self.lap_times_s) > 10 else ""
        return [
            ("laps", f"{self.laps_completed} of {self.laps_requested} in {self.sim_time_s:.2f} s"),
            ("lap times", f"{laps}{more} s" if laps else "no lap completed"),
        ]

    def column(self, name: str) -> FloatArray:
        """Return one column of the telemetry by its name in TELEMETRY, with or without its unit. Shape (ticks,).

        Raises:
          SettingsError: there is none.
        """
        return self.telemetry[:, column_index(name)]

    @property
    def cars(self) -> tuple[dict[str, Any], ...]:
        """How each car fared, one row a car; the other fields are those of car 0."""
        return tuple(result.row() for result in self.car_results) or (car_row(vars(self)),)

    def summary(self) -> dict[str, Any]:
        """Return what the JSON summary holds: everything but the arrays, the world and the planner's source."""
        left_out = ["world", "telemetry", "states", "ctrl", "controller_source", "car_results"]
        left_out += [] if self.car_results else ["grid", "rules", "winner", *_OF_SEVERAL]
        values = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in left_out}
        wrong_way = asdict(self.wrong_way) if self.wrong_way is not None else None
        failure = self.planner_failure.summary() if self.planner_failure is not None else None
        return values | {
            "planner_failure": failure, "decision_times": asdict(self.decision_times),
            "wrong_way": wrong_way, "crash": asdict(self.crash) if self.crash is not None else None,
            "lidar_effects": asdict(self.lidar_effects), "cars": list(self.cars),
            **{name: [asdict(part) for part in values[name]] for name in _OF_SEVERAL if name in values},
        }  # fmt: skip


_OF_SEVERAL = ("overtakes", "contacts", "warnings", "restarts")


def tires_model(summary: Mapping[str, Any]) -> str:
    """Return the model of the tires in a summary.

    Older runs lack it: theirs stood on contacts, or on a curve, whatever it was called.
    """
    known = summary.get("tires_model")
    if known is not None:
        return str(known)
    return CONTACT if summary.get("tires", CONTACT) == CONTACT else MagicFormula.model


def car_row(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the row in `cars` of the only car, of the values of a RaceResult or a summary by name."""
    same = (
        "vehicle", "controller", "laps_completed", "lap_times_s", "finished", "end_reason", "max_slide_m_s",
        "max_lateral_slide_m_s",
    )  # fmt: skip
    row = {"name": "car_0", "position": 1, "collisions_wall": values["collisions"], "collisions_car": 0}
    return row | {name: values[name] for name in same}


def clamped_commands(telemetry: FloatArray, car: CarParameters) -> int:
    """Return how many commands of a telemetry (ticks, len(TELEMETRY)) are outside a car's limits."""
    steering_angle, speed = telemetry[:, COMMAND], telemetry[:, COMMAND + 1]
    beyond = (np.abs(steering_angle) > car.max_steering_angle) | (speed > car.max_speed) | (speed < car.min_speed)
    return int(beyond.sum())


class Trajectory(TypedDict):
    """The arrays of a RaceResult."""

    telemetry: FloatArray
    states: FloatArray
    ctrl: FloatArray


class History:
    """What happened in world 0 of an engine, one row a tick.

    Args:
      engine: at the start of the race.
      capacity: of how many ticks at first; it doubles when it is full.
    """

    def __init__(self, engine: Engine, capacity: int = 512) -> None:
        self.first_end: float | None = None  # when the first tick was over, on time.perf_counter's clock [s]
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
        if self.first_end is None:
            self.first_end = time.perf_counter()

    def room(self) -> Table:
        """Return a table of compiled_tick.KEPT, in which compiled code keeps another tick."""
        if self._ticks[0] == 1 and self.first_end is None:
            self.first_end = time.perf_counter()
        self._make_room()
        if self._table is None:
            rows = {"telemetry": self._telemetry, "states": self._states, "controls": self._ctrl}
            self._table = ArrayTable(KEPT, {"ticks": self._ticks, **rows})
        return self._table.rows

    def _make_room(self) -> None:
        """See to it that another tick has room."""
        if self._ticks[0] == len(self._telemetry):
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
