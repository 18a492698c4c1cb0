"""Judges who is at fault for a touch of two cars, from how both moved in the second before it.

    verdict = judge(incident)
    verdict.at_fault, verdict.reason

RoboRacer's rules leave fault to referees, forbid crowding and any abnormal change of direction, and let cars be passed
on either side. The rest is what racing rules have in common: who passes has to pass safely, who is beside is left room,
and who is ahead chooses the line. Here these are rules of geometry, in the frame of the course: along it and across it.

Two cars are apart while they are apart along the course, or across it. The one of the two gaps that closes last says
how they met. Where it is the gap across, they met side to side, and the car that moved over is at fault. Where it is
the gap along, they met end to end, and the car behind is at fault, unless the one ahead cut in, braked hard without
cause, or drove against the direction of the race. A car that stands is at fault for nothing. A share of a third or more
of the motion is a share of the fault.

`judge` reads its argument only: mirrored, with the cars swapped, or elsewhere on the map, its verdict is the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fg_mujoco import portable
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import FloatArray, read_only

LOOK_BACK = 1.0
"""[s] before a touch that are judged."""

NOTICEABLE = 0.02
"""[m] by which a car has to move over; less is nobody's fault."""

SHARE = 1.0 / 3.0
"""Of the motion towards each other, that makes a car share the fault."""

BESIDE = 0.5
"""Of the shorter car's length by which the car behind has to be beside the other to be left room. RoboRacer's rules
count a pass by half a length, too."""

LEFT_ROOM = 0.1
"""[m] that a car that passes has to leave beside the other, which may stray by as much where it is left less."""

PASSES = 0.5
"""[m/s] by which a car that was behind has to be faster to pass."""

ALIKE = math.radians(45.0)
"""Between the headings of two cars up to which their sides are those across the mean of both; else of the course."""

REACTION = 0.15
"""[s] within which a car need not have reacted to what another does: six scans of 40 Hz."""

BRAKING = 0.5
"""Of what friction allows: deceleration that is expected of a car that has to give way."""

HARD = 0.4
"""Of what friction allows: mean deceleration from which braking is hard."""

BRAKED_BY = 1.0
"""[m/s] that hard braking takes off at least."""

AGAINST = 0.3
"""[m/s] against the direction of the race from which a car is at fault for it; slower is manoeuvring."""

STANDS = 0.1
"""[m/s] below which a car stands."""

STOOD = 0.5
"""[s] for which a car that stands has to have stood, at less than STANDS on average, to be at fault for nothing."""

PAUSE = 0.2
"""[s] for which two cars must not come nearer to each other, so that what they did before does not count."""

LINE_SLOPE = math.tan(math.radians(20.0))
"""Greatest way across the course per way along it of a car that follows a line through a bend."""

_OVERLAPPING = 0.1  # [s] for which both gaps may have been closed, as cars are no boxes along the course
_CREEP = 0.05  # [m/s] at which a gap has to close; slower, it is held
_SPAN = 0.1  # [s] over which speeds are measured

RAN_INTO = "ran into the car ahead"
RAN_INTO_STANDING = "ran into a car that stands"
MOVED_OVER = "moved into the car beside it"
BOTH_MOVED = "both moved over"
PASSED_CLOSE = "passed without leaving room"
NOT_BESIDE = "did not overlap enough to be left room"
CROWDED = "one overlapped late, the other went on moving over"
CUT_IN = "came into the way of a car behind it"
BRAKED = "braked hard without cause"
AGAINST_RACE = "drove against the direction of the race"
BOTH_CLOSED = "both drove into each other"
NOBODY_MOVED = "nobody moved over"
PUSHED = "was pushed by another car"
REASONS = (
    RAN_INTO, RAN_INTO_STANDING, MOVED_OVER, BOTH_MOVED, PASSED_CLOSE, NOT_BESIDE, CROWDED, CUT_IN, BRAKED,
    AGAINST_RACE, BOTH_CLOSED, NOBODY_MOVED, PUSHED,
)  # fmt: skip
"""Of verdicts."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Approach:
    """How a car moved until a touch. Arrays have one value a sample, (k,), the last of them at the touch.

    Raises:
      SettingsError: arrays of other shapes, a value that is not finite, or a size that is not positive.
    """

    length: float  # [m] of the chassis
    width: float  # [m]
    along: FloatArray  # [m] of the chassis' middle along the course, from anywhere, the same for both cars
    across: FloatArray  # [m] to the left of the course's line
    heading: FloatArray  # [rad] from the direction of the course there
    grip: float  # [m/s^2] greatest deceleration that friction allows
    cause: bool = True  # whether there was something to brake for: a bend, an obstacle, a car ahead
    pushed: bool = False  # whether another car has pushed it here, and is at fault for that

    def __post_init__(self) -> None:
        for name in ("along", "across", "heading"):
            values = read_only(np.array(getattr(self, name), dtype=np.float64))
            if values.ndim != 1 or not len(values) or not np.isfinite(values).all():
                raise SettingsError(f"{name} of an approach has shape {values.shape}; accepted: finite numbers, (k,)")
            object.__setattr__(self, name, values)
        if not (len(self.along) == len(self.across) == len(self.heading)):
            raise SettingsError("the arrays of an approach differ in length; accepted: one value a sample in each")
        for name in ("length", "width", "grip"):
            value = getattr(self, name)
            if not 0.0 < value < math.inf:
                raise SettingsError(f"{name} of an approach is {value!r}; accepted: a positive number")

    def half_size(self, turned: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return half of what the chassis takes up along and across a direction it is turned from [rad]. (k,) [m]."""
        cos, sin = np.abs(portable.cos(turned)), np.abs(portable.sin(turned))
        return 0.5 * (self.length * cos + self.width * sin), 0.5 * (self.length * sin + self.width * cos)

    @cached_property
    def half_along(self) -> FloatArray:
        """Half of what the chassis takes up along the course [m]. Shape (k,)."""
        return self.half_size(self.heading)[0]

    @cached_property
    def half_across(self) -> FloatArray:
        """Half of what the chassis takes up across the course [m]. Shape (k,)."""
        return self.half_size(self.heading)[1]


@dataclass(frozen=True, kw_only=True, eq=False)
class Incident:
    """A touch of two cars, and the time before it.

    Raises:
      SettingsError: times that do not go on, or are not one for each sample; a normal that is no direction.
    """

    time: FloatArray  # (k,) [s] of the samples
    cars: tuple[Approach, Approach]
    normal: tuple[float, float]  # of the contact, from the first car to the second: along the course, and to its left
    bend: bool = False  # whether the course bends there, so that a line through the bend goes across it

    def __post_init__(self) -> None:
        time = read_only(np.array(self.time, dtype=np.float64))
        if any(len(car.along) != len(time) for car in self.cars) or np.any(np.diff(time) < 0.0):
            raise SettingsError("the times of an incident are not one for each sample, in order; accepted: such times")
        if not 0.5 < math.hypot(*self.normal) < 1.5:
            raise SettingsError(f"the normal of an incident is {self.normal}; accepted: a unit vector")
        object.__setattr__(self, "time", time)


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """Who is at fault for an incident, and why."""

    at_fault: tuple[int, ...]  # of the incident's cars: neither, one, or both
    reason: str  # one of REASONS


def judge(incident: Incident) -> Verdict:
    """Return who is at fault for an incident."""
    at_fault, reason = _Meeting(incident).verdict()
    guilty = tuple(car for car in at_fault if not incident.cars[car].pushed)
    return Verdict(at_fault=guilty, reason=reason if guilty == at_fault else PUSHED)


class _Meeting:
    """How two cars met, sample by sample.

    Attributes:
      gap_along, gap_across: between the cars (k,) [m], negative where they overlap.
    """

    def __init__(self, incident: Incident) -> None:
        self.incident, self.cars, self.time = incident, incident.cars, incident.time
        first, second = incident.cars
        self.gap_along = np.abs(first.along - second.along) - first.half_along - second.half_along
        self.gap_across = np.abs(first.across - second.across) - first.half_across - second.half_across
        self.last = len(self.time) - 1

    def verdict(self) -> tuple[tuple[int, ...], str]:
        """Return the cars at fault and the reason."""
        sideways, met = self._closed_last()
        found = self._side_to_side(met) if sideways else self._end_to_end()
        stood = [self._stood(car) for car in self.cars]
        if stood[0] != stood[1]:  # however it lies, and wherever it is hit
            found = (stood.index(False),), RAN_INTO_STANDING
        return self._with_those_against_the_race(found, sideways, met)

    def _closed_last(self) -> tuple[bool, int]:
        """Return whether the gap between the cars' sides closed last, and the sample in which the one across had."""
        along, across = self._gaps_between()
        opened = np.flatnonzero(self.gap_across[:-1] > 0.0)
        met = int(opened[-1]) + 1 if len(opened) else self.last
        if max(along[-1], across[-1]) > 0.0:  # by less than the last sample is uncertain
            return bool(across[-1] > along[-1]), met
        for i in range(self.last - 1, -1, -1):
            if self.time[-1] - self.time[i] > _OVERLAPPING:
                break
            shares = [float(gap[i] / (gap[i] - gap[i + 1])) if gap[i] > 0.0 else 0.0 for gap in (along, across)]
            if shares[0] != shares[1]:  # where both closed between two samples, the one that did later
                return shares[1] > shares[0], met
        normal = self.incident.normal
        return abs(normal[1]) > abs(normal[0]), met

    def _gaps_between(self) -> tuple[FloatArray, FloatArray]:
        """Return the gaps (k,) [m] along and across the mean heading of both cars; of unlike cars, the course."""
        first, second = self.cars
        along, across = second.along - first.along, second.across - first.across
        turned = np.remainder(second.heading - first.heading + math.pi, 2.0 * math.pi) - math.pi
        mean = np.where(np.abs(turned) <= ALIKE, first.heading + 0.5 * turned, 0.0)
        sizes = [car.half_size(car.heading - mean) for car in self.cars]
        cos, sin = portable.cos(mean), portable.sin(mean)
        return (
            np.abs(along * cos + across * sin) - sizes[0][0] - sizes[1][0],
            np.abs(across * cos - along * sin) - sizes[0][1] - sizes[1][1],
        )

    def _side_to_side(self, met: int) -> tuple[tuple[int, ...], str]:
        """Judge cars that met side to side: who moved over."""
        began = self._nearer_since(met)
        moved = self._moved_over(began, self.last)
        passes = self._passes()
        if passes is not None and self.gap_across[began] < LEFT_ROOM:
            moved[1 - passes] -= LEFT_ROOM
        if max(moved) < NOTICEABLE:
            if passes is not None:
                return (passes,), PASSED_CLOSE
            return ((), NOBODY_MOVED) if self._is_beside(self.last) else ((self._behind(self.last),), RAN_INTO)
        guilty = _shared(moved)
        behind = self._behind(began)
        if 1 - behind in guilty and self._had_to_give_way(behind, began, moved[1 - behind]):
            return ((0, 1), CROWDED) if self._crowded(1 - behind) else ((behind,), NOT_BESIDE)
        if guilty == (1 - behind,) and self.gap_along[began] > 0.0:
            return guilty, CUT_IN
        return guilty, MOVED_OVER if len(guilty) == 1 else BOTH_MOVED

    def _end_to_end(self) -> tuple[tuple[int, ...], str]:
        """Judge cars that met end to end: who drove into whom, and whether the one ahead let it come to that."""
        behind = self._behind(self.last)
        ahead = 1 - behind
        nose = self._speed(self.cars[behind].along + self.cars[behind].half_along, self.last)
        tail = self._speed(self.cars[ahead].along - self.cars[ahead].half_along, self.last)
        closing = [0.0, 0.0]
        closing[behind], closing[ahead] = max(nose, 0.0), max(-tail, 0.0)
        if tail < -STANDS or nose <= 0.0:
            guilty = _shared(closing)
            reason = {(behind,): RAN_INTO_STANDING, (ahead,): AGAINST_RACE, (): NOBODY_MOVED}.get(guilty, BOTH_CLOSED)
            return guilty, reason
        if self._cut_in(behind):
            return (ahead,), CUT_IN
        if self._braked(behind):
            return (ahead,), BRAKED
        return (behind,), RAN_INTO if self._speed(self.cars[ahead].along, self.last) > STANDS else RAN_INTO_STANDING

    def _with_those_against_the_race(
        self, found: tuple[tuple[int, ...], str], sideways: bool, met: int
    ) -> tuple[tuple[int, ...], str]:
        """Return a verdict with the car that drove against the direction of the race, if it is only one.

        The other one stays at fault if it made more than two thirds of the motion towards each other.
        """
        speeds = [self._speed(car.along, self.last) for car in self.cars]
        wrong = [car for car in (0, 1) if speeds[car] < -AGAINST]
        if len(wrong) != 1:
            return found
        guilty, reason = found
        if guilty == (1 - wrong[0],):
            return (0, 1), BOTH_CLOSED
        return (wrong[0],), AGAINST_RACE if not sideways or guilty != (wrong[0],) else reason

    def _cut_in(self, behind: int) -> bool:
        """Return whether the car ahead came into the way of the one behind, which did not have to give way."""
        lanes = np.flatnonzero(self.gap_across[:-1] > 0.0)
        if not len(lanes):
            return False
        entered = int(lanes[-1]) + 1
        began = self._nearer_since(entered)
        moved = self._moved_over(began, entered)
        ahead = 1 - behind
        if max(moved) < NOTICEABLE or ahead not in _shared(moved):
            return False
        return len(_shared(moved)) == 1 and not self._had_to_give_way(behind, began, moved[ahead])

    def _braked(self, behind: int) -> bool:
        """Return whether the car ahead braked hard without cause, and left the one behind no way to avoid it."""
        car = self.cars[1 - behind]
        if car.cause:
            return False
        speeds = [self._speed(car.along, i) for i in range(self.last + 1)]
        fastest = max(speeds)
        began = max(i for i in range(self.last + 1) if speeds[i] >= fastest - _CREEP)
        taken, slower = float(self.time[-1] - self.time[began]), fastest - speeds[-1]
        hard = slower >= BRAKED_BY and slower >= HARD * car.grip * taken
        return hard and not self._could_avoid(behind, began)

    def _had_to_give_way(self, behind: int, began: int, moved: float) -> bool:
        """Return whether the car behind had to give way to one ahead that moved over since a sample, by so much [m].

        It need not if it was beside by half a length, nor to a car that has passed it in the last second. If neither,
        the car ahead chooses its line through a bend; elsewhere the car behind has to give way to what it could
        foresee, and if braking would have been enough.
        """
        car, ahead = self.cars[behind], self.cars[1 - behind]
        if ahead.along[began] == car.along[began] or ahead.along[0] < car.along[0]:
            return False
        if self._is_beside(began):
            return False
        if self.gap_along[began] > 0.0 and self._was_foreseen(behind, began, moved):
            return True
        driven = float(ahead.along[-1] - ahead.along[began])
        return (self.incident.bend and moved <= LINE_SLOPE * driven) or self._could_avoid(behind, began)

    def _crowded(self, ahead: int) -> bool:
        """Return whether a car went on moving over, by LEFT_ROOM or more, when the other was beside it, or past it."""
        first = self.last
        while first > 0 and (self._is_beside(first - 1) or self._behind(first - 1) == ahead):
            first -= 1
        return self._moved_over(first, self.last)[ahead] >= LEFT_ROOM

    def _was_foreseen(self, behind: int, began: int, moved: float) -> bool:
        """Return whether the car ahead came over by no more than it was about to at first, and LEFT_ROOM [m]."""
        first = int(np.searchsorted(self.time, self.time[began] + _SPAN - 1e-9))
        if first > self.last:
            return False
        shown, lasted = self._moved_over(began, first)[1 - behind], float(self.time[-1] - self.time[began])
        return LEFT_ROOM < moved <= shown / _SPAN * lasted + LEFT_ROOM

    def _could_avoid(self, behind: int, began: int) -> bool:
        """Return whether the car behind would be clear of the one ahead had it braked since a sample.

        It brakes after REACTION with BRAKING of its friction. At the touch, it has to be so far behind that it can go
        on braking down to the speed of the car ahead.
        """
        car, ahead = self.cars[behind], self.cars[1 - behind]
        lasted = float(self.time[-1] - self.time[began])
        speed, slowing = max(self._speed(car.along, began), 0.0), BRAKING * car.grip
        slowed = max(speed - slowing * max(lasted - REACTION, 0.0), 0.0)
        driven = speed * min(REACTION, lasted) + (speed * speed - slowed * slowed) / (2.0 * slowing)
        gap = float(self.gap_along[began] + ahead.along[-1] - ahead.along[began]) - driven
        too_fast = max(slowed - max(self._speed(ahead.along, self.last), 0.0), 0.0)
        return gap > too_fast * too_fast / (2.0 * slowing)

    def _passes(self) -> int | None:
        """Return which car passes the other: it was behind and is faster; None: neither."""
        speeds = [self._speed(car.along, self.last) for car in self.cars]
        for car in (0, 1):
            was_behind = self.cars[car].along[0] < self.cars[1 - car].along[0] and not self._is_beside(0)
            if speeds[car] - speeds[1 - car] > PASSES and was_behind:
                return car
        return None

    def _is_beside(self, i: int) -> bool:
        """Return whether the cars overlap along the course by half the length of the shorter one in a sample."""
        return bool(-self.gap_along[i] >= BESIDE * min(car.length for car in self.cars))

    def _stood(self, car: Approach) -> bool:
        """Return whether no part of a car moved faster than STANDS, in all, in the time STOOD before the touch."""
        first = int(np.searchsorted(self.time, self.time[-1] - STOOD - 1e-9))
        way = np.hypot(car.along[first:] - car.along[-1], car.across[first:] - car.across[-1])
        turned = np.abs(np.remainder(car.heading[first:] - car.heading[-1] + math.pi, 2.0 * math.pi) - math.pi)
        lasted = float(self.time[-1] - self.time[first])
        return bool(np.max(way + 0.5 * car.length * turned) <= STANDS * lasted)

    def _behind(self, i: int) -> int:
        """Return which car is behind in a sample."""
        return 0 if self.cars[0].along[i] < self.cars[1].along[i] else 1

    def _nearer_since(self, met: int) -> int:
        """Return the sample since which the gap across has closed, with no pause of PAUSE, until it was closed."""
        began, gap = met, self.gap_across
        if not np.any(gap > 0.0):  # the boxes along the course overlap where the cars, turned from it, do not
            gap = self._gaps_between()[1]
        for i in range(met - 1, -1, -1):
            taken = float(self.time[began] - self.time[i])
            if gap[i] - gap[began] >= _CREEP * taken:
                began = i
            elif taken >= PAUSE - 1e-9:
                break
        return began

    def _moved_over(self, began: int, met: int) -> list[float]:
        """Return how far the near side of each car moved towards the other between two samples [m]."""
        apart, moved = float(self.cars[0].across[began] - self.cars[1].across[began]), [0.0, 0.0]
        if apart == 0.0:
            return moved
        left = 0 if apart > 0.0 else 1
        for car, sign in ((left, 1.0), (1 - left, -1.0)):
            side = self.cars[car].across - sign * self.cars[car].half_across
            moved[car] = sign * float(side[began] - side[met])
        return moved

    def _speed(self, values: FloatArray, end: int) -> float:
        """Return how fast a length (k,) grew in the last tenth of a second before a sample [m/s]."""
        first = min(int(np.searchsorted(self.time, self.time[end] - _SPAN - 1e-9)), max(end - 1, 0))
        taken = float(self.time[end] - self.time[first])
        return float(values[end] - values[first]) / taken if taken > 0.0 else 0.0


def _shared(parts: list[float]) -> tuple[int, ...]:
    """Return which of two cars have a share in their motion towards each other; neither where there is none."""
    toward = [max(part, 0.0) for part in parts]
    return tuple(car for car in (0, 1) if toward[car] > 0.0 and toward[car] >= SHARE * sum(toward))
