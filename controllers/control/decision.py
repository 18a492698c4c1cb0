"""From a reference command to a safe one: speed laws, guidance, sight, safety filter, recovery, friction limiter.

A planner gives a reference: a steering angle, a greatest speed, and the bearing it looks towards. What happens then is
the same for all planners, as far as they have the stages, each of which is named here:

1. `mean_range`: the law of the mean range towards the goal lowers the speed (speed).
2. `prediction`: what moves is tracked (predictions); near it 6 is a plan in time, or what keeps out of where it may be.
3. `guidance`: a reference that leads into a pocket, or back, is replaced by one that leads on. While guidance turns the
   car in several moves, only 8 applies.
4. `distance_ahead`, `friction_law`: the speed is lowered by the distance straight ahead, and to v = sqrt(g mu b /
   tan|d|) of the reference's steering angle (speed).
5. `sight`: the speed is lowered to one from which the car stops within what it sees (braking_trajectories), unless a
   motion through the local map says how fast the car may go.
6. `safety_filter`: of all that is proposed, the first after which the car can stop is driven (safety.judge).
7. `recovery`: a car that stands without a frontier reverses along its path.
8. `limiter`: the friction limiter turns the result into a command that the tires can follow (friction_limiter).
9. The wheels are turned by the slip angles that soft tires need more, and roll faster or slower than the ground (slip).
10. The speed is corrected for the error of the odometry. The friction limiter asks for an acceleration a by commanding
   the speed v + (a + drag) tau, tau the time constant of the speed servo. Odometry that reads 5 % too much, as with
   worn tires, adds 0.05 v / tau that nobody asked for: 4 m/s^2 at 8 m/s. The error is measured while driving: in each
   tick the measured speed moves by the share 1 - exp(-period / tau) of the way to the command less drag tau. Errors
   within 1 % are left alone: a car whose odometry is right measures as much. On the remembered line, which needs most
   of the braking, the whole error is corrected.

A planner that assumes no friction limit, mu = inf, has only the laws of the mean range and of the distance ahead.

The work is done in native/controllers/control/decision.cpp and actuation.cpp.
"""

from __future__ import annotations

import numpy as np

from fg_mujoco.messages import FloatArray
from fg_mujoco.native import core, record

from ..safety.friction_limiter import FELT_GROUND
from .stages import NativeStep, Stage, Tick

LEFT_ALONE = 0.01
"""Error of the measured speed, as a share, that is left alone."""

SPEEDOMETER = record(
    "Speedometer",
    [
        ("command", np.float64),  # [m/s] that was last given; 0: none
        ("speed", np.float64),  # [m/s] that was measured then
        ("error", np.float64),  # of the measured speed, as a share of the motor's
    ],
)
"""Type of what is kept from tick to tick; zero at the beginning."""

read_speedometer = core.read_speedometer
command_speed = core.command_speed


def propose(tick: Tick, path: FloatArray, speed: float) -> bool:
    """Propose a motion to the judge in place of the planner's; return whether the car drives it: it can stop on it.

    A stage calls it at `after_guidance`. What no car can follow is left out, and so is more than eight in a tick;
    `reasons()` says so.

    Args:
      tick: of one world; its command is written to.
      path: motion (n, 4) in the frame of the rear axle, from where it is on: x, y [m], heading [rad], curvature [1/m].
      speed: that is commanded [m/s]; the friction limiter slows the car for bends.
    """
    scans = tick.ranges, tick.ranges_without_movers
    points = np.ascontiguousarray(path, np.float64)
    return core.propose(tick.record, tick.trajectories, *scans, tick.command, points, speed)


MEAN_RANGE_STAGE = Stage(text="speed law: slower where the mean range towards the goal is short")
DISTANCE_AHEAD_STAGE = Stage(text="speed law: slower where the distance straight ahead is short")
FRICTION_LAW_STAGE = Stage(text="speed law: v = sqrt(g mu b / tan|d|) of the steering angle only", needs_friction=True)
PREDICTION_STAGE = Stage(
    text="tracks moving things, and avoids where they may be", needs=("safety_filter",), needs_friction=True,
    before_reference=NativeStep("predict"),
)  # fmt: skip
GUIDANCE_STAGE = Stage(
    text="closes the way back; leads the car on if the planner would turn back", needs=("limiter",),
    needs_friction=True, guide=NativeStep("guide_reference"),
)  # fmt: skip
SIGHT_STAGE = Stage(
    text="the car stops within what the scan shows", needs_friction=True, drive=NativeStep("drive_in_sight"),
)  # fmt: skip
SAFETY_FILTER_STAGE = Stage(
    text="replaces a reference after which the car could not stop", needs=("sight", "limiter"), needs_friction=True,
    drive=NativeStep("drive_filtered"),
)  # fmt: skip
RECOVERY_STAGE = Stage(
    text="a car that stands without a frontier reverses and tries again", needs=("safety_filter",), needs_friction=True
)
IMU_STAGE = Stage(
    text="the friction limiter takes load, bank and twist of the road into account, as the IMU feels them",
    needs=("limiter",), needs_friction=True, before_reference=NativeStep("feel_ground"), state_type=FELT_GROUND,
)  # fmt: skip
LIMITER_STAGE = Stage(
    text="the command is one that the tires can follow without sliding", needs_friction=True,
    drive=NativeStep("drive_held"),
)  # fmt: skip
