"""How nodes drive: which of the topics that they publish on command the car, and what speed and angle they ask for.

In this order: Ackermann messages, AutoDRIVE's throttle and steering, the VESC's motor and servo, the F1/10 course's
drive_param, a Twist. Of several Ackermann topics the first of KNOWN counts, as in the multiplexers of the field, else
the one that no node listens to; /brake never stands alone.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from typing import Any

from ...messages import CarParameters
from .graph import Graph, NodeError, Publication
from .sensing import SPEED_TO_ERPM, STEERING, THROTTLE

DRIVE, OPPONENT_DRIVE = "/drive", "/opp_drive"
KNOWN = (
    DRIVE, "/ego_racecar/drive", "/nav", "/vesc/low_level/ackermann_cmd_mux/input/navigation",
    "/vesc/ackermann_cmd_mux/input/navigation", "/vesc/high_level/ackermann_cmd_mux/input/nav_0", "/ackermann_cmd",
)  # fmt: skip
"""Drive topics of f1tenth_system, f1tenth_gym_ros, f1tenth_simulator and the MIT racecar, the first before the next."""

_STAMPED, _PLAIN = "ackermann_msgs/AckermannDriveStamped", "ackermann_msgs/AckermannDrive"
_TWIST, _TWIST_STAMPED = "geometry_msgs/Twist", "geometry_msgs/TwistStamped"
_DRIVE_PARAM = "drive_param"
_AUTODRIVE = re.compile(r"/autodrive/\w+/(throttle|steering)_command")
_VESC = re.compile(r"(?:/vesc)?/commands/(motor/speed|servo/position)")
_SLOWEST = 0.05  # [m/s] below which a Twist's yaw rate says nothing of the steering angle

_STEERING_TO_SERVO, _SERVO_OFFSET = -1.2135, 0.5304  # the same


class Driving:
    """The drive topics of some nodes.

    Args:
      graph: of the nodes.
      car: that they drive.
      said: returns what the nodes are called, for messages.
    """

    def __init__(self, graph: Graph, car: CarParameters, said: Callable[[], str]) -> None:
        self._graph, self._car, self._said = graph, car, said

    def topics(self) -> list[Publication]:
        """Return one publisher of each topic that commands the car: one, or two where speed and angle have their own.

        Raises:
          NodeError: there are several drive topics, and it is not known which counts.
        """
        for kinds in ((_STAMPED, _PLAIN), (), (_DRIVE_PARAM,), (_TWIST, _TWIST_STAMPED)):
            if not kinds:
                for pattern in (_AUTODRIVE, _VESC):
                    pair = self._pair(pattern)
                    if pair:
                        return pair
                continue
            found = self._of_kinds(kinds)
            if len(found) == 1:
                return list(found.values())
            for topic in KNOWN:
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

    def asked(self) -> tuple[float, float] | None:
        """Return the speed [m/s] and the steering angle [rad] last asked for; None: nothing yet."""
        topics = self.topics()
        messages: list[Any] = [self._graph.newest.get(each.topic) for each in topics]
        if all(message is None for message in messages):
            return None
        if len(topics) == 2:
            return self._of_two(topics, messages)
        message = messages[0]
        kind = message._type
        if kind in (_TWIST, _TWIST_STAMPED):
            twist = message if kind == _TWIST else message.twist
            speed, turning = float(twist.linear.x), float(twist.angular.z)
            angle = math.atan2(turning * self._car.wheelbase, abs(speed)) if abs(speed) > _SLOWEST else 0.0
            return speed, math.copysign(1.0, speed) * angle
        drive = message.drive if kind == _STAMPED else message
        names = ("velocity", "angle") if topics[0].is_drive_param else ("speed", "steering_angle")
        for name in names:
            value = getattr(drive, name)
            if not (math.isfinite(value) or (name == names[0] and not math.isnan(value))):  # a speed is limited
                raise NodeError(
                    f"{self._said()} has published {name} {getattr(drive, name)!r} on {topics[0].topic}"
                    f"{topics[0].place}; accepted: a finite number"
                )
        return getattr(drive, names[0]), getattr(drive, names[1])

    def _of_two(self, topics: Sequence[Publication], messages: Sequence[Any]) -> tuple[float, float]:
        """Return speed and angle of messages of numbers; a message that has not come yet is 0."""
        first, second = (None if message is None else float(message.data) for message in messages)
        if _AUTODRIVE.fullmatch(topics[0].topic):
            limited = (max(-1.0, min(1.0, value or 0.0)) for value in (second, first))  # steering comes before throttle
            throttle, steering = limited
            return throttle * THROTTLE, steering * STEERING
        angle = 0.0 if second is None else (second - _SERVO_OFFSET) / _STEERING_TO_SERVO
        return (first or 0.0) / SPEED_TO_ERPM, angle

    def _pair(self, pattern: re.Pattern[str]) -> list[Publication]:
        """Return the publishers of two topics of numbers, by their names; none where one of them is missing."""
        found = self._of(
            lambda each: each.kind._type.startswith("std_msgs/Float") and bool(pattern.fullmatch(each.topic))
        )
        return [found[topic] for topic in sorted(found)][:2] if len(found) >= 2 else []

    def _of_kinds(self, kinds: Sequence[str]) -> dict[str, Publication]:
        return self._of(lambda each: each.is_drive_param if kinds == (_DRIVE_PARAM,) else each.kind._type in kinds)

    def _of(self, wanted: Callable[[Any], bool]) -> dict[str, Publication]:
        """Return the last publisher of each topic that is wanted."""
        return {each.topic: each for each in self._graph.publications if hasattr(each.kind, "_type") and wanted(each)}
