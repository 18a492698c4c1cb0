"""Times and durations as nodes of ROS 1 have them (genpy): `rospy.Time`, `rospy.Duration`."""

from __future__ import annotations

from functools import total_ordering
from typing import Any

NANOSECONDS = 1_000_000_000
"""In a second."""


@total_ordering
class _Rospy:
    """Base class of times and durations of ROS 1 (genpy.TVal)."""

    def __init__(self, secs: float = 0, nsecs: int = 0) -> None:
        whole = round(secs * NANOSECONDS) if isinstance(secs, float) else int(secs) * NANOSECONDS
        self.secs, self.nsecs = divmod(whole + int(nsecs), NANOSECONDS)

    @classmethod
    def from_nanoseconds(cls, nanoseconds: int) -> Any:
        """Return one of so many nanoseconds."""
        return cls(0, nanoseconds)

    @classmethod
    def from_sec(cls, seconds: float) -> Any:
        """Return one of so many seconds."""
        return cls(float(seconds))

    def to_nsec(self) -> int:
        """Return it in nanoseconds."""
        return self.secs * NANOSECONDS + self.nsecs

    def to_sec(self) -> float:
        """Return it in seconds."""
        return self.secs + self.nsecs / NANOSECONDS

    def to_time(self) -> float:
        """Return it in seconds."""
        return self.to_sec()

    def is_zero(self) -> bool:
        """Return whether it is 0."""
        return self.to_nsec() == 0

    def __bool__(self) -> bool:
        return not self.is_zero()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Rospy) and self.to_nsec() == other.to_nsec()

    def __lt__(self, other: _Rospy) -> bool:
        return self.to_nsec() < other.to_nsec()

    def __hash__(self) -> int:
        return hash(self.to_nsec())

    def __repr__(self) -> str:
        return f"{type(self).__name__.removeprefix('Ros')}({self.secs}, {self.nsecs})"


class RosDuration(_Rospy):
    """rospy.Duration."""

    def __add__(self, other: RosDuration) -> RosDuration:
        return RosDuration(0, self.to_nsec() + other.to_nsec())

    def __sub__(self, other: RosDuration) -> RosDuration:
        return RosDuration(0, self.to_nsec() - other.to_nsec())

    def __neg__(self) -> RosDuration:
        return RosDuration(0, -self.to_nsec())

    def __abs__(self) -> RosDuration:
        return RosDuration(0, abs(self.to_nsec()))

    def __floordiv__(self, other: Any) -> Any:
        if isinstance(other, RosDuration):
            return self.to_nsec() // other.to_nsec()
        return RosDuration(0, self.to_nsec() // NANOSECONDS // int(other) * NANOSECONDS)

    def __mod__(self, other: RosDuration) -> RosDuration:
        return RosDuration(0, self.to_nsec() % other.to_nsec())

    def __mul__(self, factor: float) -> RosDuration:
        return RosDuration(0, round(self.to_nsec() * factor))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        if isinstance(other, RosDuration):
            return self.to_nsec() / other.to_nsec()
        return RosDuration(0, round(self.to_nsec() / other))


class RosTime(_Rospy):
    """rospy.Time."""

    def __add__(self, other: RosDuration) -> RosTime:
        return type(self).from_nanoseconds(self.to_nsec() + other.to_nsec())  # type: ignore[no-any-return]

    def __sub__(self, other: Any) -> Any:
        if isinstance(other, RosTime):
            return RosDuration(0, self.to_nsec() - other.to_nsec())
        return type(self).from_nanoseconds(self.to_nsec() - other.to_nsec())
