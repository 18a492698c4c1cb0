"""What a race leaves behind: the figures of the summary, one row of telemetry a tick, and every state."""

from __future__ import annotations

import hashlib
import time
from dataclasses import asdict, dataclass, field, fields
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from .car import WHEELS
from .car_motion import CarArray, ground_speed, planar_pose
from .kernels import kernel
from .lidar_effects import LidarEffects
from .messages import FloatArray, read_only
from .tire_slip import greatest_slip

if TYPE_CHECKING:
    from .simulation import Simulation
    from .world import World

TELEMETRY = (
    "time_s", "lap", "progress_m", "offset_m", "x_m", "y_m", "heading_rad",
    "speed_m_s", "yaw_rate_rad_s", "steering_angle_rad", "command_steering_rad", "command_speed_m_s",
    *(f"slide_{wheel}_m_s" for wheel in WHEELS),
    *(f"friction_use_{wheel}" for wheel in WHEELS),
    "sliding_steps", "steps",
)  # fmt: skip
"""Columns of the telemetry. A row is one tick: the state at its start, the command that the planner then gave, and
while it was held each tire's greatest sliding speed and friction use (NaN: off the ground all the while), and in how
many of the physics steps any tire slid."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RaceResult:
    """How a race went. The summary's fields are named as in its JSON; arrays are read-only.

    `end_reason` is one of "finished", "crash", "no_progress", "time_limit", "unstable" (MuJoCo warned of a bad
    state) and "interrupted".
    """

    track: str
    controller: str
    laps_requested: int
    laps_completed: int
    finished: bool
    end_reason: str
    lap_times_s: tuple[float, ...]  # the first from a standing start
    collisions: int
    max_slide_m_s: float  # fastest that any tire's contact point moved over the ground
    slide_time_fraction: float  # share of the physics steps in which a tire slid, faster than SLIDING_SPEED
    mean_speed_m_s: float
    max_speed_m_s: float
    sim_time_s: float
    wall_time_s: float
    realtime_factor: float  # from the second tick on: in the first, kernels are read from disk, or compiled
    seed: int
    mu: float
    planner_mu: float
    speed_limit_m_s: float
    lidar: str
    lidar_effects: LidarEffects
    obstacles: int  # how many stood on the track, besides what a scene has
    obstacle_seed: int | None  # of their random places; None: they were not placed at random
    planner_settings: dict[str, Any]  # those that differ from its own
    trajectory_sha256: str  # of all states and controls, bit for bit
    world: World = field(repr=False)
    telemetry: FloatArray = field(repr=False)  # (ticks, len(TELEMETRY))
    states: FloatArray = field(repr=False)  # (ticks + 1, n) mjSTATE_INTEGRATION at the start of each tick; the last
    ctrl: FloatArray = field(repr=False)  # (ticks, 2) what the actuators got: steering [rad], speed [m/s]

    def __post_init__(self) -> None:
        for name in ("telemetry", "states", "ctrl"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    def column(self, name: str) -> FloatArray:
        """Return one column of the telemetry by its name in TELEMETRY. Shape (ticks,)."""
        return self.telemetry[:, TELEMETRY.index(name)]

    def summary(self) -> dict[str, Any]:
        """Return what the JSON summary holds: everything but the arrays and the world."""
        arrays = ("world", "telemetry", "states", "ctrl")
        values = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in arrays}
        return values | {"lidar_effects": asdict(self.lidar_effects)}


class Trajectory(TypedDict):
    """The arrays of a RaceResult."""

    telemetry: FloatArray
    states: FloatArray
    ctrl: FloatArray


TALLY = np.dtype(
    [
        ("ticks", np.int64),
        ("steps", np.int64),
        ("sliding_steps", np.int64),
        ("max_slide", np.float64),  # [m/s]
        ("speed_sum", np.float64),  # [m/s] of all ticks, without sign
        ("max_speed", np.float64),  # [m/s]
    ]
)
"""The figures of a race, as far as it has gone."""


class TallyFigures(TypedDict):
    """What the summary says of a tally."""

    max_slide_m_s: float
    slide_time_fraction: float
    mean_speed_m_s: float
    max_speed_m_s: float


def tally_figures(tally: Any) -> TallyFigures:
    """Return the summary's figures of a row of TALLY."""
    ticks, steps = int(tally["ticks"]), int(tally["steps"])
    return {
        "max_slide_m_s": float(tally["max_slide"]),
        "slide_time_fraction": int(tally["sliding_steps"]) / steps if steps else 0.0,
        "mean_speed_m_s": float(tally["speed_sum"]) / ticks if ticks else 0.0,
        "max_speed_m_s": float(tally["max_speed"]),
    }


_SLIDE = TELEMETRY.index(f"slide_{WHEELS[0]}_m_s")
_SPEED = TELEMETRY.index("speed_m_s")
_COMMAND = TELEMETRY.index("command_steering_rad")


@kernel
def begin_row(
    time: float, qpos: FloatArray, qvel: FloatArray, car: CarArray, timers: NDArray[np.void], i: int, row: FloatArray
) -> None:
    """Write the first columns of a tick's row of telemetry: the state at its start.

    Args:
      time: [s].
      qpos: of the model.
      qvel: of the model.
      car: (1,) of CAR.
      timers: (n,) of LAP_TIMER.
      i: which of them is the car's.
      row: (len(TELEMETRY),), written to.
    """
    row[0] = time
    row[1], row[2], row[3] = timers[i].laps_completed + 1, timers[i].progress, timers[i].offset
    row[4], row[5], row[6] = planar_pose(qpos, car)
    row[7] = ground_speed(qpos, qvel, car)
    row[8], row[9] = qvel[car[0].free_dof + 5], qpos[car[0].steering_qpos]


@kernel
def tally_tick(tallies: NDArray[np.void], i: int, row: FloatArray, slip: FloatArray) -> None:
    """Fill in what the tires did in the row of telemetry of a tick, and add the row to a tally.

    Args:
      tallies: (n,) of TALLY, written to.
      i: which of them.
      row: (len(TELEMETRY),), its last ten columns written to.
      slip: (4, steps, 4) of `measure_slip`.
    """
    tally = tallies[i]
    row[-2] = greatest_slip(slip, row[_SLIDE : _SLIDE + 8])
    row[-1] = slip.shape[1]
    tally.ticks += 1
    tally.steps += slip.shape[1]
    tally.sliding_steps += int(row[-2])
    for tire in range(4):
        if row[_SLIDE + tire] > tally.max_slide:
            tally.max_slide = row[_SLIDE + tire]
    tally.speed_sum += abs(row[_SPEED])
    tally.max_speed = max(tally.max_speed, abs(row[_SPEED]))


@kernel
def end_row(
    row: FloatArray,
    steering_angle: float,
    speed: float,
    slip: FloatArray,
    ctrl: FloatArray,
    ctrl_row: FloatArray,
    tally: NDArray[np.void],
) -> None:
    """Complete a row of telemetry, keep the controls, and add the row to a tally (1,)."""
    row[_COMMAND], row[_COMMAND + 1] = steering_angle, speed
    for i in range(len(ctrl_row)):  # an assignment of the row takes numba two seconds to compile
        ctrl_row[i] = ctrl[i]
    tally_tick(tally, 0, row, slip)


class RaceLog:
    """Grows by one row a tick.

    Args:
      state: at the start of the race.
    """

    def __init__(self, state: FloatArray) -> None:
        self.ticks = 0
        self.first_end: float | None = None  # when the first tick was over, on time.perf_counter's clock [s]
        self._tally = np.zeros(1, TALLY)
        self._telemetry = np.empty((512, len(TELEMETRY)))
        self._ctrl = np.empty((512, 2))
        self._states = np.empty((513, len(state)))
        self._states[0] = state

    def begin(self, simulation: Simulation, timers: NDArray[np.void]) -> None:
        """Begin a tick: where the car is, and how fast; `timers` is its lap timer, (1,) of LAP_TIMER."""
        if self.ticks == len(self._telemetry):
            for name in ("_telemetry", "_ctrl", "_states"):
                rows = getattr(self, name)
                setattr(self, name, np.concatenate((rows, np.empty_like(rows))))
        data, row = simulation.data, self._telemetry[self.ticks]
        begin_row(data.time, data.qpos, data.qvel, simulation.world.car.constants, timers, 0, row)

    def end(self, simulation: Simulation, steering_angle: float, speed: float) -> None:
        """End it: what the planner commanded [rad, m/s], and what the car then did."""
        tick = self.ticks
        simulation.write_state(self._states[tick + 1])
        ctrl, slip = simulation.data.ctrl, simulation.slip_values
        end_row(self._telemetry[tick], steering_angle, speed, slip, ctrl, self._ctrl[tick], self._tally)
        self.first_end = self.first_end or time.perf_counter()
        self.ticks += 1  # last: an interrupted tick leaves no row

    @property
    def tally(self) -> Any:
        """The figures so far, a row of TALLY."""
        return self._tally[0]

    def arrays(self) -> Trajectory:
        """Return telemetry, states and ctrl as in RaceResult, of the ticks that are complete."""
        return {
            "telemetry": self._telemetry[: self.ticks],
            "states": self._states[: self.ticks + 1],
            "ctrl": self._ctrl[: self.ticks],
        }


def trajectory_sha256(states: FloatArray, ctrl: FloatArray) -> str:
    """Return the SHA-256 of a trajectory's bits, little-endian float64, states (ticks + 1, n) then ctrl (ticks, 2)."""
    digest = hashlib.sha256()
    for array in (states, ctrl):
        digest.update(np.ascontiguousarray(array, dtype="<f8").tobytes())
    return digest.hexdigest()
