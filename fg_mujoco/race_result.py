"""What a race leaves behind: the figures of the summary, one row of telemetry a tick, and every state."""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass, field, fields
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np

from .car import WHEELS
from .lidar_effects import LidarEffects
from .messages import DriveCommand, FloatArray, Odometry, read_only
from .tire_slip import TireSlip

if TYPE_CHECKING:
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
    realtime_factor: float
    seed: int
    mu: float
    planner_mu: float
    speed_limit_m_s: float
    lidar: str
    lidar_effects: LidarEffects
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


class RaceLog:
    """Grows by one row a tick.

    Args:
      state: at the start of the race.
    """

    def __init__(self, state: FloatArray) -> None:
        self._rows: list[tuple[float, ...]] = []
        self._states = [state]
        self._ctrl: list[FloatArray] = []

    def add(
        self,
        *,
        state: FloatArray,
        ctrl: FloatArray,
        place: tuple[float, float, float],
        pose: tuple[float, float, float],
        speed: float,
        odometry: Odometry,
        command: DriveCommand,
        slip: TireSlip,
    ) -> None:
        """Add one tick.

        Args:
          state: at its end.
          ctrl: what the actuators got.
          place: lap, progress [m] and offset [m] at its start.
          pose: x [m], y [m], heading [rad] at its start.
          speed: true forward speed at its start [m/s].
          odometry: what the planner was told.
          command: what it answered.
          slip: of the tires while the command was held.
        """
        self._states.append(state)
        self._ctrl.append(ctrl)
        self._rows.append(  # last: an interrupted tick leaves no row
            (
                odometry.stamp,
                *place,
                *pose,
                speed,
                odometry.yaw_rate,
                odometry.steering_angle,
                command.steering_angle,
                command.speed,
                *_greatest(slip.sliding_speed),
                *_greatest(slip.friction_use),
                int(slip.slides.any(axis=1).sum()),
                len(slip.slides),
            )
        )

    def arrays(self) -> Trajectory:
        """Return telemetry, states and ctrl as in RaceResult, of the ticks that are complete."""
        ticks = len(self._rows)
        return {
            "telemetry": np.array(self._rows, dtype=np.float64).reshape(ticks, len(TELEMETRY)),
            "states": np.array(self._states[: ticks + 1]),
            "ctrl": np.array(self._ctrl[:ticks]).reshape(ticks, 2),
        }


def trajectory_sha256(states: FloatArray, ctrl: FloatArray) -> str:
    """Return the SHA-256 of a trajectory's bits, little-endian float64, states (ticks + 1, n) then ctrl (ticks, 2)."""
    digest = hashlib.sha256()
    for array in (states, ctrl):
        digest.update(np.ascontiguousarray(array, dtype="<f8").tobytes())
    return digest.hexdigest()


def _greatest(values: FloatArray) -> list[float]:
    """Return the greatest of each column, shape (4,); NaN only where the column has nothing else."""
    greatest = np.fmax.reduce(values, axis=0)
    return [float(value) for value in greatest]
