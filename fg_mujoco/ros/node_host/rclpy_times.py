"""Times and durations as nodes of ROS 2 have them: `rclpy.time.Time`, `rclpy.duration.Duration`."""

from __future__ import annotations

from functools import total_ordering
from typing import Any

from .message_classes import ROS2, made, message_class
from .rospy_times import NANOSECONDS


@total_ordering
class Duration:
    """rclpy.duration.Duration."""

    def __init__(self, *, seconds: float = 0, nanoseconds: float = 0) -> None:
        self._nanoseconds = int(seconds * NANOSECONDS) + int(nanoseconds)

    @property
    def nanoseconds(self) -> int:
        """All of it [ns]."""
        return self._nanoseconds

    def to_msg(self) -> Any:
        """Return builtin_interfaces/Duration."""
        return _message("Duration", self._nanoseconds)

    @classmethod
    def from_msg(cls, msg: Any) -> Duration:
        """Return the duration of a message."""
        return cls(nanoseconds=msg.sec * NANOSECONDS + msg.nanosec)

    def __repr__(self) -> str:
        return f"Duration(nanoseconds={self._nanoseconds})"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Duration) and self._nanoseconds == other._nanoseconds

    def __lt__(self, other: Duration) -> bool:
        return self._nanoseconds < other._nanoseconds

    def __hash__(self) -> int:
        return hash(self._nanoseconds)


@total_ordering
class Time:
    """rclpy.time.Time."""

    def __init__(self, *, seconds: float = 0, nanoseconds: float = 0, clock_type: Any = None) -> None:
        self._nanoseconds = int(seconds * NANOSECONDS) + int(nanoseconds)
        self.clock_type = clock_type

    @property
    def nanoseconds(self) -> int:
        """Since the clock's zero [ns]."""
        return self._nanoseconds

    def seconds_nanoseconds(self) -> tuple[int, int]:
        """Return whole seconds, and nanoseconds."""
        return divmod(self._nanoseconds, NANOSECONDS)

    def to_msg(self) -> Any:
        """Return builtin_interfaces/Time."""
        return _message("Time", self._nanoseconds)

    @classmethod
    def from_msg(cls, msg: Any, clock_type: Any = None) -> Time:
        """Return the time of a message."""
        return cls(nanoseconds=msg.sec * NANOSECONDS + msg.nanosec, clock_type=clock_type)

    def __add__(self, other: Duration) -> Time:
        if not isinstance(other, Duration):
            return NotImplemented
        return Time(nanoseconds=self._nanoseconds + other.nanoseconds, clock_type=self.clock_type)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        if isinstance(other, Time):
            return Duration(nanoseconds=self._nanoseconds - other._nanoseconds)
        if isinstance(other, Duration):
            return Time(nanoseconds=self._nanoseconds - other.nanoseconds, clock_type=self.clock_type)
        return NotImplemented

    def __repr__(self) -> str:
        return f"Time(nanoseconds={self._nanoseconds})"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Time) and self._nanoseconds == other._nanoseconds

    def __lt__(self, other: Time) -> bool:
        return self._nanoseconds < other._nanoseconds

    def __hash__(self) -> int:
        return hash(self._nanoseconds)


def _message(name: str, nanoseconds: int) -> Any:
    sec, nanosec = divmod(nanoseconds, NANOSECONDS)
    return made(message_class(f"builtin_interfaces/msg/{name}", ROS2), sec=sec, nanosec=nanosec)
