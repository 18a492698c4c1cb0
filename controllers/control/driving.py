"""Settings of driving, and the records of a car, its reference and its memory, which all planners share.

A planner writes a REFERENCE, by `refer` or `refer_to_goal`. How it becomes a command is in `decision`.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import astuple, dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import ODOMETRY, CarParameters, require
from fg_mujoco.native import core, record

from ..perception.scan_geometry import SCAN_GEOMETRY
from ..safety.friction_limiter import LIMITER, LIMITER_MEMORY, FrictionLimiter
from ..safety.guidance import GUIDANCE, GuidanceSettings
from ..safety.judge import JUDGE, JudgeSettings
from ..safety.plan_in_time import PLAN_IN_TIME
from ..safety.predictions import MOST_LATE, PREDICTIONS
from ..safety.recovery import RECOVERY, RecoverySettings
from .decision import SPEEDOMETER
from .planner_settings import (
    CAR_RECORD,
    FROM_ZERO,
    POSITIVE,
    Accepted,
    Settings,
    for_car,
    record_type,
    record_values,
    setting,
    setting_of_car,
    setting_of_method,
)
from .reasons import REASONS
from .slip import VELOCITY_FRAME
from .stages import names_in

SOURCE, BY_BEARING = 1, 1
"""Indices of the words of `method` and of `steering` in the records of settings."""


@dataclass(frozen=True, kw_only=True)
class DrivingSettings(Settings):
    """Parameters of driving, which all planners have; a planner may have other defaults.

    Raises:
      SettingsError: an assist that is not known; a length or gain that is not a positive number; an angle or distance
        below 0; a full-speed distance that is not above the safe one.
    """

    assist: str = setting("", text="its stages, in place of those of the race, such as none or grip+sight")
    safe_distance: float = setting_of_car(
        0.2, "m", "distance_ahead: nearer ahead of the LiDAR than this, the car stops", FROM_ZERO
    )
    full_speed_distance: float = setting_of_method(
        10.0, 1.5, "m", "distance_ahead: full speed beyond it; as the only law it has to slow the car for bends, too"
    )
    lookahead: float = setting(10.0, "m", "mean_range: longer readings count as this", POSITIVE)
    mean_range_gain: float = setting_of_method(
        1.0, 3.0, "", "mean_range: full speed at a mean range of lookahead / gain", POSITIVE
    )
    front_width: float = setting_of_method(
        4.0 * math.pi, math.radians(20.0), "rad",
        "mean_range: around the goal, for the mean range; 4 pi is the whole scan", FROM_ZERO,
    )  # fmt: skip
    pursuit_distance: float = setting_of_car(
        1.0, "m", "the arc leads through the point this far along the goal's direction", POSITIVE
    )
    pursuit_time: float = setting(0.0, "s", "the same point is at least the way of this time ahead", FROM_ZERO)
    method: Literal["", "source", "refined"] = setting(
        "", text="source: exactly the planner's source, the default without sight; refined: with improvements"
    )
    steering: Literal["arc", "bearing"] = setting_of_method(
        "bearing", "arc", "", "to the goal: along an arc, or by its bearing as the steering angle"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.assist != "":
            names_in(self.assist, f"{type(self).__name__}.assist")
        safe = 0.0 if self.safe_distance is None else self.safe_distance
        longer = Accepted(f"a number above safe_distance, {safe}", lambda value: safe < value < math.inf)
        if self.full_speed_distance is not None:
            require(self, longer.holds, longer.text, ("full_speed_distance",), SettingsError)


FLAGS = (
    "mean_range", "distance_ahead", "friction_law", "sight", "safety_filter", "recovery", "prediction", "guidance",
    "has_limiter",
)  # fmt: skip
"""Stages that driving asks for; `has_limiter`: the friction limiter."""

DRIVER = record(
    "Driver",
    [
        ("car", CAR_RECORD),
        ("max_speed", np.float64),  # [m/s]
        *((stage, np.bool_) for stage in FLAGS),  # whether the planner has these stages
        ("late", np.int64),  # ticks by which scans are older than the odometry
        ("settings", record_type(DrivingSettings, native=True)),
        ("limiter", LIMITER),
        ("judge_settings", record_type(JudgeSettings, native=True)),
        ("recovery_settings", record_type(RecoverySettings, native=True)),
        ("guidance_settings", record_type(GuidanceSettings, native=True)),
        ("trajectories", np.int64),  # which table of braking trajectories is its own
        ("line_first", np.int64),  # which points of the lines through the map are its own: the first,
        ("line_end", np.int64),  # and the one behind the last
    ],
)
"""Type of what driving reads of a planner."""

DRIVING_MEMORY = record(
    "DrivingMemory",
    [
        ("limiter", LIMITER_MEMORY),
        ("recovery", RECOVERY),
        ("guidance", GUIDANCE),
        ("lead", np.int64),  # who leads the car on, see PLANNER_LEADS of guidance,
        ("knows_speed", np.bool_),  # and whether the speed is that of a motion, which is free farther than is in sight
        ("speedometer", SPEEDOMETER),
        ("velocity_frame", VELOCITY_FRAME),
        ("predictions", PREDICTIONS),
        ("plan", PLAN_IN_TIME),
        ("judge", JUDGE),
        ("reasons", *REASONS),  # of the last decision; written, and never read
    ],
)
"""Type of what they keep of its car from tick to tick; zero at the beginning."""

MOST_LANE = 20
"""Greatest number of points of a lane beside another car."""

REFERENCE = record(
    "Reference",
    [
        ("steering_angle", np.float64),  # [rad]; NaN: there is no reference, and the car brakes
        ("speed", np.float64),  # [m/s] greatest
        ("bearing", np.float64),  # [rad] of the goal; NaN: there is none
        ("distance", np.float64),  # [m] of the goal from the LiDAR; of one on a line, from the rear axle
        ("point", np.int64),  # of the planner's line through the map, which is nearest to the rear axle
        ("off_line", np.float64),  # [m] of the rear axle from there
        ("own_speed", np.float64),  # [m/s] before any speed law
        ("plan", np.int64),  # of the tracker mpc, by which it is: 0 this tick's, 1 the last one, 2 none: the car brakes
        ("limit", np.float64),  # [m/s] greatest, whatever guidance makes of the rest; inf: none
        ("lane", np.float64, (MOST_LANE, 4)),  # motion beside another car, which guidance leaves, as in motions
        ("lane_points", np.int64),  # of the lane; 0: there is none
    ],
)
"""Type of the reference of a planner for one scan."""


def driver_record(
    car: CarParameters,
    max_speed: float,
    limiter: FrictionLimiter | None,
    settings: NDArray[np.void],
    stages: Collection[str],
    late: int = 0,
) -> NDArray[np.void]:
    """Return a row of type DRIVER, shape (1,).

    Args:
      car: that is driven.
      max_speed: fastest that it may command [m/s].
      limiter: None: of a planner that assumes no friction limit.
      settings: row of the planner's settings, shape (1,).
      stages: names of its stages.
      late: ticks by which scans are older than the odometry; too many, and nothing is predicted.
    """
    row = np.zeros(1, DRIVER)
    row["judge_settings"] = record_values(for_car(JudgeSettings(), car))
    row["guidance_settings"] = record_values(for_car(GuidanceSettings(), car))
    row["recovery_settings"] = record_values(for_car(RecoverySettings(), car))
    row["settings"] = settings[list(row["settings"].dtype.names or ())]
    row["car"], row["max_speed"], row["late"] = astuple(car), max_speed, late
    for flag in FLAGS:
        row[flag] = flag in stages
    row["has_limiter"] = "limiter" in stages
    row["prediction"] &= late < MOST_LATE
    if limiter is not None:
        row["limiter"] = limiter.record
    return row


TICK = record(
    "TickRecord",
    [
        ("driver", DRIVER),
        ("geometry", SCAN_GEOMETRY),  # of this tick; from guidance on in the velocity frame, see slip,
        ("odometry", ODOMETRY),  # of a car whose tires need slip angles
        ("reference", REFERENCE),
        ("memory", DRIVING_MEMORY),
        ("decided", np.bool_),  # there is a command for this tick
    ],
)
"""Type of all that the stages read and keep of one world."""

refer_to_goal = core.refer_to_goal
"""Write the reference that leads to a goal, along an arc or by the goal's bearing.

It takes, in this order:
  tick: of type TICK; its reference is written to.
  filtered: readings as the planner left them (n,) [m], for the mean range towards the goal.
  bearing: of the goal [rad]; NaN: there is none.
  distance: of the goal from the LiDAR [m].
"""

refer = core.refer
"""Write a reference, no faster than by the law of the mean range; arguments as in `refer_to_goal` and REFERENCE."""
