"""Why a command is what it is: what each step of driving made of the reference, in the order of the work.

    for reason in planner.reasons():  # of its last decision
        print(reason.name, reason.steering_angle, reason.speed)

Before the judge's choice (safety filter) stands each of its proposals, with what it would have met, and which one won.

What decides (native/controllers/control) writes a row for every step that it takes, and reads none: no command depends
on them. The law
that holds the speed is the last step that changed it; so it is with the steering angle.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fg_mujoco.messages import FloatArray

MAXIMUM, PLANNER, LAST_PLAN, NO_PLAN, MEAN_RANGE, GUIDANCE, MOVES, REMEMBERED_LINE, NO_REFERENCE, AHEAD = range(10)
LAW, AFTER_RECOVERY, SIGHT, PLAN_IN_TIME, SAFETY_FILTER, RECOVERY, LOCK, GRIP, TRANSIENTS, SPEEDOMETER = range(10, 20)

_STEPS = (
    ("maximum speed", "the fastest that the planner may command"),
    ("planner", "the planner's own reference"),
    ("last plan", "tracker mpc: its program did not converge, and the car steers by the last plan"),
    ("no plan", "tracker mpc: the last plan is over, too; the car brakes, and keeps its last angle"),
    ("mean range", "slower where the mean range towards the goal is short"),
    ("guidance", "leads the car along a motion, or slows it, if the planner's goal does not lead on"),
    ("turning in moves", "guidance turns the car in several moves, forward and in reverse"),
    ("remembered line", "follows a line through the ground of the first lap"),
    ("no reference", "there is no goal, or no odometry: the car brakes and keeps its steering angle"),
    ("distance ahead", "slower where the distance straight ahead is short"),
    ("friction law", "v = sqrt(g mu b / tan|d|) of the steering angle only"),
    ("after recovery", "slow, after the car has reversed"),
    ("sight", "the car can stop within what it sees"),
    ("plan in time", "among moving things: a motion without a contact, or with the latest one; the car may back off"),
    ("safety filter", "the simulated stop after the reference has to be free; else another direction, or brakes"),
    ("recovery", "the car stands without a frontier, and reverses along its path"),
    ("steering lock", "the car's greatest steering angle"),
    ("friction limiter", "speed and steering angle of a circle that the tires hold: v = sqrt(g mu b / tan|d|)"),
    ("tires, on the way there", "how fast the tires let the car brake, accelerate and turn its wheels"),
    ("speedometer", "corrects for the error of the speed servo"),
)  # fmt: skip
REASONS = (np.float64, (len(_STEPS), 2))
"""Type of what is kept of a decision: steering angle [rad] and speed [m/s] after each step; NaN: it did not apply."""

REFERENCE, STOP, ASIDE, AS_IT_STANDS, BESIDE, MOTION, LAST_STOP, ON_LINE, OWN, LEFT_OUT = range(10)
"""Why something was proposed, see safety.judge."""

_WHY = (
    ("reference", "what the planner or guidance wants, at its speed"),
    ("stop", "the reference's way, braking"),
    ("aside", "another direction, no faster than the crawl speed"),
    ("as it stands", "braking with the wheels as they are"),
    ("beside", "a direction next to the reference's, at its speed"),
    ("motion", "braking along the motion of guidance"),
    ("last stop", "braking along the motion on which the car could last stop"),
    ("line", "the remembered line, at its speed or braking"),
    ("of a stage", "a motion that a stage of your own proposed"),
    ("left out", "a motion that a stage of your own proposed"),
)
PROPOSALS = (np.float64, (len(_WHY), 5))
"""Type of what was proposed: the command's steering angle [rad] and speed [m/s] (NaN: it was not), the speed [m/s] at
which the car would have met something, when [s], and what, see rollout. Of several with one name the best one."""

_MET = ("nothing", "what stands", "what moves")

NOT_FINITE, NO_POINTS, TOO_SHARP, REVERSES, TOO_MANY, DECIDED, NO_JUDGE = range(7)
"""Why a motion that a stage proposed is left out."""

_LEFT_OUT = (
    "a number in it is not finite", "it has no points", "it bends more sharply than the wheels can turn",
    "its speed is below 0", "eight were proposed before it in this tick", "the command is decided already",
    "the planner has no safety_filter, or there is no scan or no odometry",
)  # fmt: skip


class Reason(NamedTuple):
    """The change that one step made to the reference, or what was proposed to the judge."""

    name: str
    steering_angle: float  # [rad] after it; NaN: there is none yet
    speed: float  # [m/s] after it
    text: str = ""  # what the step does, in one line
    on_the_way: bool = False  # it says how fast the car gets to what the steps before it want, and wants nothing itself


def reasons_in(reasons: FloatArray, judged: np.void) -> list[Reason]:
    """Return the steps of a decision that applied, in their order; none where nothing was decided yet.

    What was proposed to the judge comes before the step that is its choice. `judged` is of type safety.judge.JUDGE.
    """
    found: list[Reason] = []
    if not reasons[MAXIMUM, 1] > 0.0:  # a planner's memory is zero at the beginning
        return found
    for step, (name, text) in enumerate(_STEPS):
        if step == SAFETY_FILTER:
            found += _proposals_in(judged)
        if not math.isnan(reasons[step, 1]):
            steering_angle, speed = reasons[step].tolist()
            found.append(Reason(name, steering_angle, speed, text, step >= TRANSIENTS))
    return found


def _proposals_in(judged: np.void) -> list[Reason]:
    """Return what was proposed, what each would have met, and which one won."""
    found = []
    for why, (name, text) in enumerate(_WHY):
        steering_angle, speed, met, time, what = judged["proposals"][why].tolist()
        if not math.isnan(speed):
            if why == LEFT_OUT:
                says = _LEFT_OUT[int(what)] + (f", and {met:.0f} more are left out" if met > 0.0 else "")
            else:
                says = "meets nothing" if what == 0 else f"meets {_MET[int(what)]} at {met:.2f} m/s after {time:.2f} s"
            won = " and is driven" if why == judged["best"]["why"] else ""
            found.append(Reason(f"proposal: {name}", steering_angle, speed, f"{text}; {says}{won}", True))
    return found
