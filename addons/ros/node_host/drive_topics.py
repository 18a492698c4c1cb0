"""Reads commands from the topics that nodes publish on: selects those that command the car, and their speed and angle.

In this order: Ackermann messages, AutoDRIVE's throttle and steering, the VESC's motor and servo, the F1/10 course's
drive_param, a Twist. Of several Ackermann topics the first of DRIVE_TOPICS counts, as in the multiplexers of the field,
else the one that no node listens to. A brake topic overrides the drive topic.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from fg_mujoco.messages import CarParameters

from ..bag_messages import DRIVE_TOPICS
from ..composed_topics import BATTERY, SPEED_TO_ERPM, STEERING, THROTTLE, VOLTS_FOR_SPEED, steering_of_servo
from .graph import Graph, NodeError, Publication

DRIVE, OPPONENT_DRIVE = "/drive", "/opp_drive"

_STAMPED, _PLAIN = "ackermann_msgs/AckermannDriveStamped", "ackermann_msgs/AckermannDrive"
_TWIST, _TWIST_STAMPED = "geometry_msgs/Twist", "geometry_msgs/TwistStamped"
_DRIVE_PARAM = "drive_param"
_AUTODRIVE = re.compile(r"/autodrive/\w+/(throttle|steering)_command")
_VESC = re.compile(r"(?:/vesc)?/commands/(?:motor/(speed|duty_cycle|current|brake)|servo/position)")
_MOST_AHEAD = 1.0  # [m/s] of the speed that a motor's current asks for, of the car's
_GOES_ON = 100_000_000  # [ns] after which a motor's current begins anew
_MOST_BAD = 10  # commands in a row that are no numbers, of which the first ones hold the last command
_BRAKES = ("/brake", "/ego_racecar/brake")
_BRAKE_HOLDS = 200_000_000  # [ns] for which a command on /brake counts, as ackermann_mux of f1tenth_system has it
_MOST_OF_32_BITS = float(np.finfo(np.float32).max)
_SLOWEST = 0.05  # [m/s] below which a Twist's yaw rate says nothing of the steering angle


def steering_of_twist(speed: float, turning: float, wheelbase: float) -> float:
    """Return the steering angle [rad] at which a car turns at a rate [rad/s] while it drives at a speed [m/s]."""
    angle = math.atan2(turning * wheelbase, abs(speed)) if abs(speed) > _SLOWEST else 0.0
    return math.copysign(1.0, speed) * angle


class Driving:
    """The drive topics of some nodes; `said` returns what the nodes are called, for messages."""

    def __init__(self, graph: Graph, car: CarParameters, said: Callable[[], str]) -> None:
        self._graph, self._car, self._said = graph, car, said
        self._last: tuple[float, float] | None = None  # command that was made of numbers
        self._reset_told = self._motor_told = False
        self._of_current = (0.0, 0)  # speed [m/s] that the motor's current has asked for, and when [ns]
        self._bad, self._counted = 0, 0  # commands in a row that were not, and messages when that was found

    def topics(self) -> list[Publication]:
        """Return a publisher of each topic that commands the car, one or two.

        Raises NodeError: it is not known which counts.
        """
        for kinds in ((_STAMPED, _PLAIN), (), (_DRIVE_PARAM,), (_TWIST, _TWIST_STAMPED)):
            if not kinds:
                for pattern in (_AUTODRIVE, _VESC):
                    pair = self._pair(pattern)
                    if pair:
                        return pair
                continue
            found = self._of_kinds(kinds)
            if len(found) > 1:  # a brake overrides another drive topic, and is one where there is no other
                found = {topic: each for topic, each in found.items() if topic not in _BRAKES} or found
            if len(found) == 1:
                return list(found.values())
            for topic in DRIVE_TOPICS:
                if topic in found:
                    return [found[topic]]
            found.pop(OPPONENT_DRIVE, None)  # of the other car
            last = [topic for topic in found if not self._graph.listens(topic)]  # none goes on to another node
            if len(found) == 1 or len(last) == 1:
                return [found[topic] for topic in (last or found)]
            if found:
                places = "".join(each.place for each in found.values())
                topics = sorted(found)
                raise NodeError(
                    f"{self._said()} has {len(topics)} drive topics, {' and '.join(topics)}{places}; "
                    f"accepted: one, or one that is {DRIVE}: [remap.{topics[0]}={DRIVE}]"
                )
        return []

    def asked(self, speed: float) -> tuple[float, float] | None:
        """Return the speed [m/s] and the steering angle [rad] last asked for; None: nothing yet.

        A motor's current accelerates the car from its speed [m/s]. A command that is no number holds the last one, and
        a warning says so; the tenth in a row is a NodeError, as are several drive topics, see `topics`.
        """
        topics = self.topics()
        self._tell_of_resets()
        if topics:
            self._tell_of_motor(topics)
        brake = self._brake()
        if brake is not None:
            return brake
        messages: list[Any] = [self._graph.newest.get(each.topic) for each in topics]
        if all(message is None for message in messages):
            return None
        if len(topics) == 2:
            found, wrong = self._of_two(topics, messages, speed), ""
            if math.isnan(found[0]) or not math.isfinite(found[1]):
                data = " and ".join(repr(message.data) for message in messages if message is not None)
                wrong = f"{data} on {topics[0].topic} and {topics[1].topic}"
        else:
            found, wrong = self._of_one(messages[0], topics[0])
        if not wrong:
            self._last, self._bad = found, 0
            return found
        count = sum(each.count for each in topics)
        self._bad += count != self._counted  # the same message is one
        self._counted = count
        said = f"{self._said()} has published {wrong}{topics[0].place}"
        if self._bad >= _MOST_BAD:
            raise NodeError(f"{said}, {self._bad} times in a row; accepted: a finite number")
        held = "the car stands" if self._last is None else "the last command is held"
        warnings.warn(f"{said}, which is no command: {held}", stacklevel=2)
        return self._last

    def _tell_of_resets(self) -> None:
        """Warn once of a node that wants the simulator to put the car back: a race goes on."""
        for each in () if self._reset_told else self._graph.publications:
            wanted = each.asks_for_reset and each.count and not self._graph.listens(each.topic)
            if wanted and getattr(self._graph.newest.get(each.topic), "data", True):
                self._reset_told = True
                said = f"{self._said()} has published on {each.topic}{each.place}"
                warnings.warn(f"{said}: a race has no reset; the car does not move", stacklevel=3)

    def _tell_of_motor(self, topics: Sequence[Publication]) -> None:
        """Warn once of a node that commands the VESC's motor beside another topic that drives the car."""
        for each in () if self._motor_told else self._graph.publications:
            motor = _VESC.fullmatch(each.topic) if each.count else None
            if motor and motor[1] in ("duty_cycle", "current", "brake") and not _VESC.fullmatch(topics[0].topic):
                self._motor_told = True
                said = f"{self._said()} has published on {each.topic}{each.place}"
                warnings.warn(f"{said}, which is not read: {topics[0].topic} drives the car", stacklevel=3)

    def _of_one(self, message: Any, topic: Publication) -> tuple[tuple[float, float], str]:
        """Return speed and angle of a message, and what in it is no number: nothing, or name, value and topic."""
        kind = message._type
        if kind in (_TWIST, _TWIST_STAMPED):
            twist = message if kind == _TWIST else message.twist
            values = {"linear.x": float(twist.linear.x), "angular.z": float(twist.angular.z)}
            speed, turning = values.values()
            angle = steering_of_twist(speed, turning, self._car.wheelbase)
        else:
            drive = message.drive if kind == _STAMPED else message
            names = ("velocity", "angle") if topic.is_drive_param else ("speed", "steering_angle")
            values = {name: getattr(drive, name) for name in names}
            speed, angle = values.values()
        for i, (name, value) in enumerate(values.items()):
            infinite = abs(value) > _MOST_OF_32_BITS
            if value != value or (infinite and i == 1):  # a speed is limited
                return (speed, angle), f"{name} {value!r} on {topic.topic}"
        return (speed, angle), ""

    def _brake(self) -> tuple[float, float] | None:
        """Return the command of an emergency brake, which overrides the drive topic; None: it is not on."""
        graph = self._graph
        switches = [each for each in graph.publications if each.is_brake_switch and not graph.listens(each.topic)]
        if switches:
            braking = any(getattr(graph.newest.get(each.topic), "data", False) for each in switches)
            return (0.0, 0.0 if self._last is None else self._last[1]) if braking else None
        for each in graph.publications:
            brakes = each.topic in _BRAKES and getattr(each.kind, "_type", "") in (_STAMPED, _PLAIN)
            if brakes and each.count and graph.now - each.at < _BRAKE_HOLDS:
                found, wrong = self._of_one(graph.newest[each.topic], each)
                return None if wrong else found
        return None

    def _of_two(self, topics: Sequence[Publication], messages: Sequence[Any], speed: float) -> tuple[float, float]:
        """Return speed and angle of messages of numbers; a message that has not come yet is 0."""
        first, second = (None if message is None else float(message.data) for message in messages)
        if _AUTODRIVE.fullmatch(topics[0].topic):
            # steering comes before throttle; what is no number is 1 or -1 to `min` and `max`, and stays none here
            throttle, steering = (float(np.clip(value or 0.0, -1.0, 1.0)) for value in (second, first))
            return throttle * THROTTLE, steering * STEERING
        angle = 0.0 if second is None else steering_of_servo(second)
        return self._speed_of_motor(topics[0].topic.rpartition("/")[2], first or 0.0, speed), angle

    def _speed_of_motor(self, mode: str, value: float, speed: float) -> float:
        """Return the speed [m/s] that a command of the VESC's motor asks for: of a motor without losses."""
        if mode in ("speed", "duty_cycle"):
            return value / SPEED_TO_ERPM if mode == "speed" else value * BATTERY / VOLTS_FOR_SPEED
        (before, at), now = self._of_current, self._graph.now
        goes_on = now - at < _GOES_ON
        before = min(max(before, speed - _MOST_AHEAD), speed + _MOST_AHEAD) if goes_on else speed
        change = value * VOLTS_FOR_SPEED / self._car.mass * ((now - at) / 1e9 if goes_on else 0.0)
        braked = math.copysign(max(0.0, abs(before) - abs(change)), before)
        found = braked if mode == "brake" else before + change
        self._of_current = found if math.isfinite(found) else before, now
        return found

    def _pair(self, pattern: re.Pattern[str]) -> list[Publication]:
        """Return the publishers of two topics of numbers, by their names; none where one of them is missing."""
        found = self._of(
            lambda each: each.kind._type.startswith("std_msgs/Float") and bool(pattern.fullmatch(each.topic))
        )
        newest = list(self._graph.newest)
        motors = [topic for topic in found if "/motor/" in topic]
        motors.sort(key=lambda topic: newest.index(topic) if topic in newest else -1)
        names = [*motors[-1:], *sorted(found.keys() - set(motors))]
        return [found[topic] for topic in names[:2]] if len(names) >= 2 else []

    def _of_kinds(self, kinds: Sequence[str]) -> dict[str, Publication]:
        return self._of(lambda each: each.is_drive_param if kinds == (_DRIVE_PARAM,) else each.kind._type in kinds)

    def _of(self, wanted: Callable[[Any], bool]) -> dict[str, Publication]:
        """Return the last publisher of each topic that is wanted."""
        return {each.topic: each for each in self._graph.publications if hasattr(each.kind, "_type") and wanted(each)}
