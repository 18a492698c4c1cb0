"""Touches of two cars that are staged by commands, and who is at fault.

A case says where each car is at first, as the middle of its chassis along a straight course and to the left of its
line, how it is turned, how fast it is, and what it is commanded from when on. `approaches` drives both by a
kinematic bicycle until they touch; the tests of race control stage the same cases in the simulator.
"""

import functools
import math
from dataclasses import dataclass, replace

import numpy as np

import fg_mujoco as fg
from fg_mujoco.addons.arena.race_control import fault
from fg_mujoco.addons.arena.race_control.fault import Approach, Incident
from fg_mujoco.addons.arena.race_control.recent_motion import contact_normal
from fg_mujoco.simulation.cars import footprint

CAR = fg.World("oval").parameters
LOCK = CAR.max_steering_angle
REACH = math.hypot(CAR.length, CAR.width)  # [m] of a car from the middle of its rear axle, at most
MIDDLE = 0.5 * CAR.length - CAR.rear_overhang  # [m] of the chassis, ahead of the rear axle
TICK, STEP = 0.025, 0.005  # [s]
GRIP = 10.0  # [m/s^2]


@dataclass(frozen=True, kw_only=True)
class Drive:
    """A car of a case: where its middle is at first, and what it is commanded."""

    s: float = 0.0  # [m]
    offset: float = 0.0  # [m]
    speed: float = 0.0  # [m/s]
    heading: float = 0.0  # [rad]
    commands: tuple[tuple[float, float, float], ...] = ()  # from when [s], steering [rad], speed [m/s]
    spin: float = 0.0  # [rad/s] about its middle, which goes straight on

    def command(self, time):
        """Return the steering angle [rad] and the speed [m/s] that are commanded at a time [s]."""
        found = (0.0, self.speed)
        for begins, steering, speed in self.commands:
            if time >= begins - 1e-9:
                found = (steering, speed)
        return found

    def mirrored(self):
        """Return the same on the other side of the line."""
        turned = tuple((time, -steering, speed) for time, steering, speed in self.commands)
        return replace(self, offset=-self.offset, heading=-self.heading, commands=turned, spin=-self.spin)


@dataclass(frozen=True, kw_only=True)
class Case:
    """Two cars, a and b, and who is at fault for their touch."""

    name: str
    a: Drive
    b: Drive
    fault: str  # a, b, both or no fault
    reason: str
    bend: bool = False
    cause: bool = False  # for a to brake
    simulated: bool = True  # whether the simulator can stage it


def turn(at, steering, speed, lasts=math.inf):
    """Return commands: straight on at a speed, a steering angle from a time on, and the same back again."""
    if math.isinf(lasts):
        return ((0.0, 0.0, speed), (at, steering, speed))
    return ((0.0, 0.0, speed), (at, steering, speed), (at + lasts, -steering, speed), (at + 2.0 * lasts, 0.0, speed))


CASES = (
    # end to end
    Case(name="B drives into a slower car ahead", a=Drive(s=1.5, speed=3.0), b=Drive(speed=6.0), fault="b",
         reason=fault.RAN_INTO),
    Case(name="B drives into a car that stands", a=Drive(s=2.0), b=Drive(speed=4.0), fault="b",
         reason=fault.RAN_INTO_STANDING),
    Case(name="B drives into the flank of a car that stands across the course", a=Drive(s=2.0, heading=1.57),
         b=Drive(speed=4.0, offset=0.1), fault="b", reason=fault.RAN_INTO_STANDING),
    Case(name="A brakes for a bend, B is close behind", a=Drive(s=0.9, speed=5.0, commands=((0.2, 0.0, 0.0),)),
         b=Drive(speed=5.0), fault="b", reason=fault.RAN_INTO, cause=True),
    Case(name="A brakes hard on a clear straight, B is close behind",
         a=Drive(s=0.9, speed=5.0, commands=((0.2, 0.0, 0.0),)), b=Drive(speed=5.0), fault="a", reason=fault.BRAKED),
    Case(name="A brakes hard on a clear straight, B is 3 m behind and drives on",
         a=Drive(s=3.6, speed=5.0, commands=((0.2, 0.0, 0.0),)), b=Drive(speed=5.0), fault="b",
         reason=fault.RAN_INTO_STANDING),
    Case(name="A lifts a little on a clear straight", a=Drive(s=0.8, speed=5.0, commands=((0.2, 0.0, 4.4),)),
         b=Drive(speed=5.0), fault="b", reason=fault.RAN_INTO),
    Case(name="A reverses into a car that stands", a=Drive(s=1.0, commands=((0.0, 0.0, -1.5),)), b=Drive(), fault="a",
         reason=fault.AGAINST_RACE),
    Case(name="A backs off slowly as B creeps up", a=Drive(s=0.68, speed=-0.25), b=Drive(speed=0.25), fault="both",
         reason=fault.BOTH_CLOSED),
    Case(name="A reverses slowly in view of B, which drives on at speed", a=Drive(s=3.0, speed=-0.8),
         b=Drive(speed=4.0), fault="both", reason=fault.BOTH_CLOSED),
    Case(name="A has turned round and meets B head on", a=Drive(s=5.0, speed=3.0, heading=math.pi), b=Drive(speed=4.0),
         fault="a", reason=fault.AGAINST_RACE),
    # side to side
    Case(name="A, half a length ahead, swerves at full lock into B beside it",
         a=Drive(s=0.25, offset=0.5, speed=4.0, commands=turn(0.3, -LOCK, 4.0)), b=Drive(speed=4.0), fault="a",
         reason=fault.MOVED_OVER),
    Case(name="A, half a length behind, swerves at full lock into B beside it",
         a=Drive(s=-0.25, offset=0.5, speed=4.0, commands=turn(0.3, -LOCK, 4.0)), b=Drive(speed=4.0), fault="a",
         reason=fault.MOVED_OVER),
    Case(name="A swerves at full lock when only B's nose is beside it",
         a=Drive(s=0.48, offset=0.42, speed=4.0, commands=turn(0.3, -LOCK, 4.0)), b=Drive(speed=4.0), fault="a",
         reason=fault.MOVED_OVER),
    Case(name="A drifts over when only B's nose is beside it",
         a=Drive(s=0.5, offset=0.66, speed=4.0, heading=-0.08), b=Drive(speed=4.0), fault="b", reason=fault.NOT_BESIDE),
    Case(name="A drifts over into B, which is wholly beside it", a=Drive(offset=0.6, speed=4.0, heading=-0.08),
         b=Drive(speed=4.0), fault="a", reason=fault.MOVED_OVER),
    Case(name="both drift towards each other alike", a=Drive(offset=0.3, speed=4.0, heading=-0.05),
         b=Drive(offset=-0.3, speed=4.0, heading=0.05), fault="both", reason=fault.BOTH_MOVED),
    Case(name="both drift, A three times as fast", a=Drive(offset=0.4, speed=4.0, heading=-0.09),
         b=Drive(offset=-0.2, speed=4.0, heading=0.03), fault="a", reason=fault.MOVED_OVER),
    Case(name="side by side 1 cm apart, neither holds its line to the centimetre",
         a=Drive(offset=0.16, speed=4.0, heading=-0.005), b=Drive(offset=-0.16, speed=4.0, heading=0.005),
         fault="no fault", reason=fault.NOBODY_MOVED),
    Case(name="A gives way to B, which comes after it", a=Drive(offset=0.45, speed=4.0, heading=0.05),
         b=Drive(speed=4.0, heading=0.2), fault="b", reason=fault.MOVED_OVER),
    Case(name="A passes and comes back too soon", a=Drive(s=0.1, offset=0.5, speed=5.0,
         commands=turn(0.1, -0.2, 5.0)), b=Drive(speed=4.5), fault="a", reason=fault.MOVED_OVER),
    Case(name="B pulls out too late and clips the rear corner of A", a=Drive(s=1.25, speed=2.0),
         b=Drive(speed=5.0, commands=turn(0.05, 0.15, 5.0)), fault="b", reason=fault.RAN_INTO),
    Case(name="B comes over into the flank of A ahead of it", a=Drive(s=0.45, speed=4.0),
         b=Drive(offset=-0.55, speed=4.2, commands=turn(0.1, 0.3, 4.2)), fault="b", reason=fault.MOVED_OVER),
    Case(name="A spins, and its tail swings into B beside it", a=Drive(s=0.1, offset=0.42, speed=3.0, spin=4.0),
         b=Drive(speed=3.0), fault="a", reason=fault.MOVED_OVER, simulated=False),
    Case(name="B passes A with 1 cm of room, A holds its line", a=Drive(s=1.0, offset=0.32, speed=2.5),
         b=Drive(speed=4.5, heading=0.006), fault="b", reason=fault.PASSED_CLOSE),
    Case(name="B passes A with 3 cm of room, A strays by as much", b=Drive(speed=4.5), fault="b",
         a=Drive(s=0.9, offset=0.37, speed=2.5, heading=-0.05), reason=fault.PASSED_CLOSE),
    Case(name="A comes over by 25 cm into B, which passes", a=Drive(s=0.6, offset=0.56, speed=2.5,
         commands=turn(0.2, -0.3, 2.5)), b=Drive(speed=4.5), fault="a", reason=fault.MOVED_OVER),
    Case(name="B passes inside and runs wide into A, whose nose is beside its tail", bend=True,
         a=Drive(s=0.5, offset=0.6, speed=3.0), b=Drive(speed=5.0, commands=turn(0.15, 0.12, 5.0)), fault="b",
         reason=fault.MOVED_OVER),
    Case(name="A closes the door on B, which comes from behind, and goes on when B is beside",
         a=Drive(s=1.3, offset=0.75, speed=4.0, heading=-0.12), b=Drive(speed=6.0), fault="both", reason=fault.CROWDED),
    # from one lane into the other
    Case(name="A cuts in right before a faster car", a=Drive(s=1.4, offset=0.5, speed=2.5,
         commands=turn(0.02, -LOCK, 2.5, 0.17)), b=Drive(speed=5.5), fault="a", reason=fault.CUT_IN),
    Case(name="A changes lanes far ahead, B drives on into it",
         a=Drive(s=5.0, offset=0.5, speed=2.5, commands=turn(0.4, -LOCK, 2.5, 0.15)), b=Drive(speed=6.0), fault="b",
         reason=fault.RAN_INTO),
    # in a bend
    Case(name="A turns in on its line, B has put its nose inside", bend=True,
         a=Drive(s=0.46, offset=0.5, speed=4.0, commands=turn(0.1, -0.1, 4.0)), b=Drive(speed=4.3), fault="b",
         reason=fault.NOT_BESIDE),
    Case(name="A turns in on B, which is beside it", bend=True,
         a=Drive(s=0.1, offset=0.5, speed=4.0, commands=turn(0.1, -0.1, 4.0)), b=Drive(speed=4.0), fault="a",
         reason=fault.MOVED_OVER),
    Case(name="B dives inside from behind as A turns in", bend=True,
         a=Drive(s=1.3, offset=0.5, speed=3.0, commands=turn(0.05, -0.14, 3.0)), b=Drive(speed=5.5), fault="b",
         reason=fault.NOT_BESIDE),
    Case(name="B passes inside and runs wide into A", bend=True, a=Drive(offset=0.5, speed=4.0),
         b=Drive(s=0.1, speed=4.2, commands=turn(0.2, 0.1, 4.2)), fault="b", reason=fault.MOVED_OVER),
    # a wreck
    Case(name="B moves over into a wreck that lies aslant", a=Drive(s=2.0, offset=0.73, heading=-0.3),
         b=Drive(speed=4.0, commands=turn(0.2, 0.15, 4.0)), fault="b", reason=fault.RAN_INTO_STANDING),
    Case(name="B passes a wreck that lies aslant, and leaves no room", a=Drive(s=2.0, offset=0.34, heading=-0.3),
         b=Drive(speed=5.0), fault="b", reason=fault.RAN_INTO_STANDING),
    Case(name="B drives on into a wreck that lies aslant", a=Drive(s=2.0, offset=0.48, heading=-0.5), bend=True,
         b=Drive(speed=2.0, commands=turn(0.2, 0.02, 2.0)), fault="b", reason=fault.RAN_INTO_STANDING),
    # a pause
    Case(name="A comes in on B beside it, which gives way for a moment and comes back a little",
         a=Drive(offset=0.72, speed=4.0, heading=-0.15), fault="a", reason=fault.MOVED_OVER,
         b=Drive(s=0.05, speed=4.0, commands=((0.0, 0.0, 4.0), (0.2, -0.13, 4.0), (0.3, 0.13, 4.0), (0.5, 0.0, 4.0)))),
)  # fmt: skip
"""Cars A and B of each; a third one that pushes is staged in the tests of race control."""


def staged(case, *, mirrored=False, swapped=False):
    """Return the drives of the first and the second car of a case, and the verdict as it is to be."""
    drives = (case.a, case.b)
    wanted = {"a": (0,), "b": (1,), "both": (0, 1), "no fault": ()}[case.fault]
    if mirrored:
        drives = tuple(drive.mirrored() for drive in drives)
    if swapped:
        drives, wanted = drives[::-1], tuple(sorted(1 - car for car in wanted))
    return drives, wanted


@functools.cache
def paths(drives, longest=3.0):
    """Return the times (k,) and the poses of the rear axles (k, 2, 3) at ticks until two cars touch, and then."""
    poses = [np.array([drive.s - MIDDLE * math.cos(drive.heading), drive.offset - MIDDLE * math.sin(drive.heading),
                       drive.heading, drive.speed, 0.0]) for drive in drives]  # fmt: skip
    times, kept = [], []
    for step in range(round(longest / STEP)):
        time = step * STEP
        touch = math.dist(poses[0][:2], poses[1][:2]) < 2.0 * REACH and apart(poses) <= 0.0
        if touch or step % round(TICK / STEP) == 0:
            times.append(time)
            kept.append([pose[:3].copy() for pose in poses])
        if touch:
            return np.array(times), np.array(kept)
        for pose, drive in zip(poses, drives, strict=True):
            steering, speed = drive.command(time)
            pose[4] += min(max(steering - pose[4], -3.2 * STEP), 3.2 * STEP)
            pose[3] += min(max(speed - pose[3], -8.0 * STEP), 8.0 * STEP)
            if drive.spin:
                pose[2] = drive.spin * (time + STEP)
                middle = drive.s + drive.speed * (time + STEP), drive.offset
                pose[:2] = np.array(middle) - MIDDLE * np.array([math.cos(pose[2]), math.sin(pose[2])])
                continue
            pose[:2] += pose[3] * STEP * np.array([math.cos(pose[2]), math.sin(pose[2])])
            pose[2] += pose[3] * math.tan(pose[4]) / CAR.wheelbase * STEP
    raise AssertionError("the cars do not touch")


def apart(poses):
    """Return how far two cars are apart along the contact's normal [m]."""
    first, second = (footprint(pose[:3], CAR) for pose in poses)
    normal = contact_normal(first, second)
    return float((second @ normal).min() - (first @ normal).max())


def incident(case, *, mirrored=False, swapped=False, turned=0.0, moved=0.0):
    """Return the incident of a case as its drives end; `turned` as a whole by no more than the frame's name."""
    times, poses = paths(staged(case, mirrored=mirrored)[0])
    poses = poses[:, ::-1] if swapped else poses
    recent = times >= times[-1] - fault.LOOK_BACK - 1e-9
    times, poses = times[recent], poses[recent]
    normal = contact_normal(*(footprint(poses[-1, car], CAR) for car in (0, 1)))
    cars = []
    for car in (0, 1):
        x, y, heading = poses[:, car].T
        cars.append(Approach(
            length=CAR.length, width=CAR.width, along=x + MIDDLE * np.cos(heading) + moved, heading=heading + turned,
            across=y + MIDDLE * np.sin(heading), grip=GRIP, cause=case.cause,
        ))  # fmt: skip
    return Incident(time=times, cars=tuple(cars), normal=tuple(normal), bend=case.bend)
