"""Times and durations as nodes of ROS 2 have them: `rclpy.time.Time`, `rclpy.duration.Duration`."""

from __future__ import annotations

from functools import total_ordering
from typing import Any

from .graph import NANOSECONDS
from .message_classes import made, message_class


@total_ordering
class _Rclpy:
    """What times and durations of ROS 2 share: whole nanoseconds, which messages have in two parts."""

    def __init__(self, *, seconds: float = 0, nanoseconds: float = 0) -> None:
        self._nanoseconds = int(seconds * NANOSECONDS) + int(nanoseconds)

    @property
    def nanoseconds(self) -> int:
        """All of it, of a time since the clock's zero [ns]."""
        return self._nanoseconds

    def to_msg(self) -> Any:
        """Return the message of builtin_interfaces that has this name."""
        sec, nanosec = divmod(self._nanoseconds, NANOSECONDS)
        return made(message_class(f"builtin_interfaces/msg/{type(self).__name__}"), sec=sec, nanosec=nanosec)

    @classmethod
    def from_msg(cls, msg: Any, *_: Any, **named: Any) -> Any:
        """Return the time or duration of a message."""
        return cls(nanoseconds=msg.sec * NANOSECONDS + msg.nanosec, **named)

    def __repr__(self) -> str:
        return f"{type(self).__name__}(nanoseconds={self._nanoseconds})"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, type(self)) and self._nanoseconds == other._nanoseconds

    def __lt__(self, other: _Rclpy) -> bool:
        return self._nanoseconds < other._nanoseconds

    def __hash__(self) -> int:
        return hash(self._nanoseconds)


class Duration(_Rclpy):
    """rclpy.duration.Duration."""


class Time(_Rclpy):
    """rclpy.time.Time."""

    def __init__(self, *, seconds: float = 0, nanoseconds: float = 0, clock_type: Any = None) -> None:
        super().__init__(seconds=seconds, nanoseconds=nanoseconds)
        self.clock_type = clock_type

    def seconds_nanoseconds(self) -> tuple[int, int]:
        """Return whole seconds, and nanoseconds."""
        return divmod(self._nanoseconds, NANOSECONDS)

    @classmethod
    def from_msg(cls, msg: Any, clock_type: Any = None) -> Any:
        """Return the time of a message."""
        return super().from_msg(msg, clock_type=clock_type)

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
