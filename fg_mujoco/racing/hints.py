"""Likely mistakes of a planner that a race shows, each in one line with a remedy.

    for hint in race_hints(result):
        print(hint)

Four mistakes are looked for: angles in degrees, or other commands that no car can follow; a car that is not asked to
move; decisions that take longer than the car would wait; and a scan that is read in another order than it has. The last
is seen only of a planner that
is not bundled, and whose car crashed, turned round or came no further after it steered away from the side with more
room in front of it. Of four simple planners on six circuits at three speeds that finds 71 of 72 crashes with a mirrored
scan, 77 of 126 with two other wrong layouts, and none of 34 crashes of planners that read the scan rightly.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..display import quoted
from ..messages import CarParameters, FloatArray
from ..simulation.engine import Engine
from ..simulation.telemetry import COMMAND, TELEMETRY
from .result import RaceResult, clamped_commands

_MOST = 0.5  # share of the decisions from which on they are most
_FEWEST = 20  # decisions; of fewer nothing is said
_LATEST = 60  # ticks before the end, 1.5 s, in which the scans are looked at
_FEWEST_ASIDE = 10  # decisions among them with more room to one side; of fewer nothing is said
_DEPTH = 8.0  # [m] up to which more room counts more
_IN_FRONT = 1.6  # [rad] to either side: room behind the car, which has just left it, says nothing of the way on
_ASIDE = 0.05  # [rad] of the room and of the steering angle, from which on they have a side
_AWAY = 0.8  # share of the decisions away from the room, from which on it is said
_ENDS = ("crash", "wrong_way", "no_progress")
_LEAST_ANGLE = 0.1  # [rad] of a planner's greatest steering angle, from which on it may be cut off
_EACH_SIDE = 0.05  # share of the decisions with that angle, to each side, from which on it is said
_STANDING = 2.0  # [s] of such commands until the end, from which on they are said
_STILL = 0.05  # [m/s] a slower command does not move the car on
_SPEED = TELEMETRY.index("speed_m_s")


def race_hints(result: RaceResult) -> tuple[str, ...]:
    """Return the hints of a race; of several cars each begins with the name of its car."""
    alone, hints = len(result.cars) == 1, []
    for row, car in enumerate(result.cars):
        parameters = result.world.cars[row].parameters
        ticks = len(car.telemetry) if alone else round(car.end_time_s / car.decision_times.period_s)
        own = car.telemetry[:ticks]
        found = [clamped_hint(own, parameters), late_hint(vars(car.decision_times))]
        if car.end_reason in ("no_progress", "time_limit"):
            found.append(_still_hint(own, car.decision_times.period_s))
        if car.end_reason in _ENDS and _is_a_users(car.controller_origin):
            found.append(_scan_hint(result, row, own))
        hints += [f"{quoted(car.name)}: {hint}" if not alone else hint for hint in found if hint]
    return tuple(hints)


def clamped_hint(telemetry: FloatArray, car: CarParameters) -> str:
    """Return what is said of a drive most of whose commands were beyond the car's limits, or cut off; empty: not so.

    Args:
      telemetry: (ticks, len(TELEMETRY)).
      car: whose limits they are.
    """
    clamped, count = clamped_commands(telemetry, car), len(telemetry)
    if count < _FEWEST:
        return ""
    if clamped <= _MOST * count:
        return _cut_off_hint(np.clip(telemetry[:, COMMAND], -car.max_steering_angle, car.max_steering_angle))
    angles, speeds = np.abs(telemetry[:, COMMAND]), telemetry[:, COMMAND + 1]
    lock = car.max_steering_angle
    said = f"{clamped} of {count} commands were beyond the car's limits"
    if (angles > lock).sum() >= ((speeds > car.max_speed) | (speeds < car.min_speed)).sum():
        typical = float(np.median(angles[angles > lock]))
        asked = f"{said}: half of them asked for a steering angle of {typical:.3g} rad or more, the car has {lock:.3g}"
        if typical > math.pi / 3.0:
            return f"{asked}. Steering angles are in radians: if these are degrees, try math.radians(angle)"
        return f"{asked}. Try less gain, or the steering angle held within car.max_steering_angle"
    fastest = float(np.abs(speeds).max())
    limits = f"{car.min_speed:g} to {car.max_speed:g} m/s"
    return f"{said} of {limits}, up to {fastest:.3g} m/s. Speeds are in metres per second"


def _cut_off_hint(angles: FloatArray) -> str:
    """Return what is said of steering angles (n,) [rad] most of which are the greatest, to one side or the other.

    Planners that give radians steer so far in up to a quarter of their decisions, on the tightest circuits.
    """
    greatest = float(np.abs(angles).max())
    far_left, far_right = angles > 0.999 * greatest, angles < -0.999 * greatest
    most, count = int(far_left.sum() + far_right.sum()), len(angles)
    if greatest < _LEAST_ANGLE or most <= _MOST * count or min(far_left.mean(), far_right.mean()) < _EACH_SIDE:
        return ""
    return (
        f"{most} of {count} commands steered as far as ever, {greatest:.3g} rad, to one side or the other. Steering "
        "angles are in radians: if these are degrees that were cut off there, try math.radians(angle)"
    )


def _still_hint(telemetry: FloatArray, period: float) -> str:
    """Return what is said of a planner that asked for no speed, from a moment on until the end of its race."""
    moves = np.flatnonzero(np.abs(telemetry[:, COMMAND + 1]) > _STILL)
    still = len(telemetry) - (int(moves[-1]) + 1 if len(moves) else 0)
    if still < _FEWEST or still * period < _STANDING:
        return ""
    which = f"all {still}" if still == len(telemetry) else f"the last {still} of {len(telemetry)}"
    greatest = float(np.abs(telemetry[-still:, COMMAND + 1]).max())
    return (
        f"{which} commands asked for a speed of {greatest:.2g} m/s{' or less' if greatest else ''}, and the car stood. "
        "Try DriveCommand(steering_angle=..., speed=1.0), in rad and m/s"
    )


def late_hint(times: Mapping[str, Any]) -> str:
    """Return what is said of a race most of whose decisions were late; `times` are as DecisionTimes has them."""
    late, count, median = times["over_period"], times["decisions"], times["median_s"]
    if count < _FEWEST or late <= _MOST * count:
        return ""
    period = 1e3 * times["period_s"]
    return (
        f"{late} of {count} decisions took longer than {period:g} ms, half of them {1e3 * median:.3g} ms or more. The "
        "simulation waits for a planner, and a car does not: it would drive on with the command before. Try "
        f"--lidar-latency {median:.2g}, which shows what such a delay does, or a planner that is faster"
    )


def _is_a_users(origin: Mapping[str, Any]) -> bool:
    """Return whether a planner is no bundled one, of what its result says of its origin."""
    return origin.get("distribution") != "fg-mujoco"


def _scan_hint(result: RaceResult, row: int, telemetry: FloatArray) -> str:
    """Return what is said of a planner that steered away from the room there was, until its car hit something.

    Where the room is: the mean bearing of the beams in front, each weighted with the cube of its range up to _DEPTH.
    """
    engine, away, sides = Engine(result.world), 0, 0
    bearings = engine.beams.bearings
    in_front = np.abs(bearings) < _IN_FRONT
    for tick in range(max(len(telemetry) - _LATEST, 0), len(telemetry)):
        if abs(telemetry[tick, COMMAND]) <= _ASIDE or abs(telemetry[tick, _SPEED]) < 0.1:
            continue
        engine.load(result.states[tick])
        engine.sense()
        weights = in_front * np.clip(engine.ranges[row], 0.0, _DEPTH) ** 3
        room = float(weights @ bearings) / max(float(weights.sum()), 1e-9)
        if abs(room) > _ASIDE:
            sides += 1
            away += room * telemetry[tick, COMMAND] < 0.0
    if sides < _FEWEST_ASIDE or away < _AWAY * sides:
        return ""
    beams, first = len(bearings), math.degrees(engine.beams.angle_min)
    return (
        f"in {away} of the last {sides} decisions with more room to one side the planner steered to the other. Does it "
        f"read the scan as it is? ranges[0] of {beams} is the rightmost beam, at {first:.0f} degrees, "
        f"ranges[{beams // 2}] looks straight ahead, and bearings grow to the left. Try scan.bearings; a positive "
        "steering angle is to the left"
    )
