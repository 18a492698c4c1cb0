"""The raceline of a circuit: the line, its speeds and its lap time, for one car; and the file of it.

Walls are those of the circuit, with its islands, and the obstacles that the setup puts there. Each obstacle is passed
on the side that has more room. The speeds are the fastest quasi-steady ones by all the grip that the friction limiter
finds, and the lap time is their bound, and not a prediction (`lab.lap_time_bound`).

The file has the columns of TUM's optimiser, `s_m; x_m; y_m; psi_rad; kappa_radpm; vx_mps; ax_mps2`, as `pure_pursuit`
and the community's planners read it. The line is that of the rear axle, and its last row repeats the first place.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from fg_mujoco import portable
from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter, FrictionLimiterSettings
from fg_mujoco.controllers.safety.line_optimizer import Grip, limited_grip
from fg_mujoco.course.clearance import clearances
from fg_mujoco.course.course import Course, outline
from fg_mujoco.course.line_file import raceline_text
from fg_mujoco.course.line_names import RACELINE
from fg_mujoco.course.obstacles import Obstacle
from fg_mujoco.course.track import Track
from fg_mujoco.course.writing import write_file
from fg_mujoco.display import brief, quoted
from fg_mujoco.errors import SettingsError, TrackError, accepted_names
from fg_mujoco.lab.lap_time_bound import fastest_speeds, lap_time, smooth_line
from fg_mujoco.messages import CarParameters, FloatArray
from fg_mujoco.racing.entries import Entry
from fg_mujoco.racing.resolved import ground_of
from fg_mujoco.racing.setup import Setup

from ..map_raceline import Objective, Walls, optimize_line

OBJECTIVES = ("time", "curvature")
MARGIN = 0.1
"""[m] Between the car's outline and walls, if nothing else is said."""

LONGEST = 8000.0
"""[m] Of a circuit: the time that its line takes grows with it."""

_TOLERANCE = 0.002  # [m] of the smoothed line, of which curvature and speeds are taken
_ROW = 0.1  # [m] from one row of the file to the next
_BLOCK = 200  # points of a line, whose clearance is found at once
_TOUCHES = 0.01  # [m] of the least clearance
_ALL = FrictionLimiterSettings(lateral_use=1.0, braking_use=1.0, accelerating_use=1.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class GripLimits:
    """A grip as `lab.lap_time_bound` takes it."""

    grip: Grip

    @cached_property
    def _tables(self) -> tuple[list[float], list[float]]:
        return self.grip.accelerating.tolist(), self.grip.braking.tolist()

    @property
    def max_speed(self) -> float:
        """Anywhere [m/s]."""
        return float(self.grip.max_speed)

    def corner_speed(self, curvature: float) -> float:
        """Return the greatest speed at a curvature [1/m] [m/s]."""
        return float(math.sqrt(self.grip.lateral / max(abs(curvature), 1e-12)))

    def acceleration(self, curvature: float, squared_speed: float) -> float:
        """Return what the tires or the motor leave at a curvature [1/m] and a speed squared [m^2/s^2] [m/s^2]."""
        left = self._left(self._tables[0], abs(curvature) * squared_speed)
        return float(min(left, self.grip.power / math.sqrt(max(squared_speed, 1e-9))))

    def braking(self, curvature: float, squared_speed: float) -> float:
        """Return the greatest deceleration, likewise."""
        return self._left(self._tables[1], abs(curvature) * squared_speed)

    def _left(self, table: list[float], lateral: float) -> float:
        """Return what a table has at a lateral acceleration [m/s^2], between two of its entries; 0 beyond the last."""
        place = lateral / self.grip.lateral * (len(table) - 1)
        at = int(place)
        return table[at] + (place - at) * (table[at + 1] - table[at]) if at < len(table) - 1 else 0.0


def acceleration_left(grip: Grip, lateral: FloatArray, *, braking: bool) -> FloatArray:
    """Return the greatest acceleration ahead, or back, at lateral accelerations (n,) [m/s^2]; 0 beyond the greatest."""
    table = grip.braking if braking else grip.accelerating
    return np.asarray(np.interp(np.abs(lateral), np.linspace(0.0, grip.lateral, len(table)), table, right=0.0))


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Raceline:
    """A closed line through a circuit, of the rear axle, with the fastest speeds."""

    course: Course
    car: CarParameters
    grip: Grip
    objective: Objective
    margin: float  # [m]
    obstacles: tuple[Obstacle, ...]
    points: FloatArray  # (n, 2) [m] in driving order
    headings: FloatArray  # (n,) [rad] from 0 to 2 pi
    curvature: FloatArray  # (n,) [1/m] left positive
    steps: FloatArray  # (n,) [m] to the next point
    speeds: FloatArray  # (n,) [m/s]
    accelerations: FloatArray  # (n,) [m/s^2] ahead
    lap_time: float  # [s] of the quasi-steady lap
    clearance: float  # [m] least between the car's outline and anything that stands

    def __repr__(self) -> str:
        return brief(self, quoted(self.course.name), f"{self.length:.1f} m", f"{self.lap_time:.2f} s")

    @property
    def length(self) -> float:
        """Of a lap on the line [m]."""
        return float(self.steps.sum())

    @property
    def lateral(self) -> FloatArray:
        """Acceleration to the left at each point, (n,) [m/s^2]."""
        return self.curvature * self.speeds**2

    @property
    def use(self) -> FloatArray:
        """Share of the grip that is used at each point: 1 on the edge of the g-g diagram. Shape (n,) [-]."""
        shares = np.zeros(len(self.points))
        for braking in (False, True):
            chosen = (self.accelerations < 0.0) == braking
            low, high = np.zeros(len(shares)), np.full(len(shares), 1.5)
            for _ in range(40):  # the share of the diagram's edge, on the way from the middle to the point
                middle = 0.5 * (low + high)
                scaled = np.maximum(middle, 1e-9)
                left = acceleration_left(self.grip, self.lateral / scaled, braking=braking)
                outside = np.abs(self.accelerations) / scaled > left
                low, high = np.where(outside, middle, low), np.where(outside, high, middle)
            shares[chosen] = high[chosen]
        return shares

    def summary(self) -> str:
        """Return length, lap time, speeds and clearance in one line."""
        return (
            f"{self.course.name}: {self.length:.1f} m, lap-time bound {self.lap_time:.3f} s, "
            f"{self.speeds.min():.2f} to {self.speeds.max():.2f} m/s, {self.clearance:.2f} m to the nearest wall"
        )

    def write(self, path: str | Path) -> Path:
        """Write the file of the line and return its path; OSError: it cannot be written."""
        along = np.concatenate(([0.0], np.cumsum(self.steps)))
        count = max(4, round(self.length / _ROW))
        places = np.linspace(0.0, self.length, count + 1)
        headings = np.unwrap(np.append(self.headings, self.headings[0]))
        around = [
            np.append(each, each[0]) for each in (*self.points.T, self.curvature, self.speeds, self.accelerations)
        ]
        around.insert(2, headings)
        columns = [places, *(np.interp(places, along, each) for each in around)]
        columns[3] %= 2.0 * math.pi
        comments = [
            f"{self.course.name}: raceline of least {self.objective}, lap-time bound {self.lap_time:.3f} s",
            f"of the rear axle of a car {self.car.width:.3f} m wide, {self.margin:g} m to the walls, at most "
            f"{self.grip.lateral:.3f} m/s^2 in corners and {self.grip.max_speed:g} m/s",
        ]
        write_file(Path(path), raceline_text(dict(zip(RACELINE, columns, strict=True)), comments).encode())
        return Path(path)


def make_raceline(setup: Setup, *, objective: Objective = "time", margin: float = MARGIN) -> Raceline:
    """Return the raceline of a setup's circuit for its first car, by the least lap `time` or the least `curvature`.

    `margin` [m] is between the car's outline and everything that stands. Raises SettingsError: an objective or a margin
    that there is not, or a solver that does not converge; TrackError: a course that is no circuit, is longer than
    LONGEST, or is narrower somewhere than the car and the margins.
    """
    if objective not in OBJECTIVES:
        raise SettingsError(f"objective is {objective!r}; {accepted_names(objective, OBJECTIVES)}")
    if not 0.0 <= margin < math.inf:
        raise SettingsError(f"margin is {margin!r}; accepted: a number from 0, in metres")
    ground, car = ground_of(setup), setup.first.car.parameters
    course = ground.course
    if not isinstance(course, Track):
        raise TrackError(f"course {course.name!r} is driven once, from a start to a goal; accepted: a circuit")
    if course.length > LONGEST:
        raise TrackError(f"track {course.name!r} is {course.length:.0f} m long; accepted: up to {LONGEST:g} m")
    course.check_car(car)
    grip = _grip_of(setup.first, course)
    walls = walls_of(course, ground.boxes, car, margin)
    found = optimize_line(course.centreline, walls, car, grip, margin=margin, objective=objective)
    line = smooth_line(_from_start(found.points, course), _TOLERANCE)
    limits = GripLimits(grip=grip)
    speeds = fastest_speeds(line, limits)
    ahead = np.roll(line.points, -1, axis=0) - np.roll(line.points, 1, axis=0)
    headings = portable.arctan2(ahead[:, 1], ahead[:, 0])
    standing = np.concatenate([outline(each) for each in (*course.edges, *(solid.corners() for solid in ground.boxes))])
    reach = car.length + float((course.corridor_left + course.corridor_right).max())
    clear = _clearances(np.column_stack((line.points, headings)), standing, car, reach)
    _require_clear(course, line.points, clear, car, margin)
    return Raceline(
        course=course, car=car, grip=grip, objective=objective, margin=margin, obstacles=ground.boxes,
        points=line.points,
        headings=headings % (2.0 * math.pi), curvature=line.curvature, steps=line.steps, speeds=speeds,
        accelerations=0.5 * (np.roll(speeds, -1) ** 2 - speeds**2) / line.steps, lap_time=lap_time(line, speeds),
        clearance=float(clear.min()),
    )  # fmt: skip


def _grip_of(entry: Entry, course: Course) -> Grip:
    """Return all that a car has by what a planner knows of it, up to its greatest commanded speed."""
    car, mu = entry.world(course).car.parameters, entry.car.reliable_mu(entry.tire_set, entry.all_changes.mu)
    limiter, max_speed = FrictionLimiter(car, mu, _ALL).record[0], min(float(entry.max_speed), car.max_speed)
    return limited_grip(limiter, max_speed, (1.0, 1.0, 1.0), math.inf)


def _clearances(poses: FloatArray, standing: FloatArray, car: CarParameters, reach: float) -> FloatArray:
    """Return the least distance from the car to what stands within `reach` [m], at each pose (n, 3) of a line, (n,)."""
    least, greatest = (each(standing[:, :2], standing[:, 2:]) for each in (np.minimum, np.maximum))
    found = np.empty(len(poses))
    for first in range(0, len(poses), _BLOCK):
        block = poses[first : first + _BLOCK]
        places = block[:, :2]
        near = (greatest > places.min(axis=0) - reach) & (least < places.max(axis=0) + reach)
        found[first : first + _BLOCK] = clearances(block, standing[near.all(axis=1)], car)
    return found


def _from_start(points: FloatArray, course: Track) -> FloatArray:
    """Return the points of a closed line (n, 2) [m] from the one on that is nearest to the start."""
    x, y, _ = course.start_pose()
    return np.roll(points, -int(np.argmin(np.hypot(*(points - (x, y)).T))), axis=0)


def walls_of(course: Track, obstacles: tuple[Obstacle, ...], car: CarParameters, margin: float) -> Walls:
    """Return the walls of a circuit, and its islands and obstacles, each on the side where the car does not pass it.

    Raises TrackError: a place where car and margins do not fit between the walls, or past an obstacle.
    """
    needed = car.width + 2.0 * margin
    too_narrow = partial(_too_narrow, course, needed, margin)
    wide = course.corridor_left + course.corridor_right
    if wide.min() < needed:
        too_narrow(float(wide.min()), course.centreline[int(wide.argmin())])
    left: list[FloatArray] = []
    right: list[FloatArray] = []
    for solid in (*course.islands, *(each.corners() for each in obstacles)):
        places, offsets = course.project(solid)
        sides = [
            float(np.interp(places, course.arc_length, width, period=course.length).min())
            for width in (course.corridor_left, course.corridor_right)
        ]
        if offsets.max() - offsets.min() > sum(sides):
            continue  # not on the lane
        gaps = sides[0] - offsets.max(), sides[1] + offsets.min()
        if max(gaps) < needed:
            too_narrow(float(max(gaps)), solid.mean(axis=0), "past an obstacle ")
        (right if gaps[0] > gaps[1] else left).append(solid)
    return Walls.of([course.left_wall], [course.right_wall], left, right)


def _too_narrow(course: Track, needed: float, margin: float, width: float, place: FloatArray, where: str = "") -> None:
    x, y = place.tolist()
    raise TrackError(
        f"track {course.name!r} leaves {width:.2f} m {where}at ({x:.2f}, {y:.2f}); accepted: {needed:.2f} m, the car "
        f"and a margin of {margin:g} m to either side"
    )


def _require_clear(
    course: Track, points: FloatArray, ranges_without_movers: FloatArray, car: CarParameters, margin: float
) -> None:
    """Raise TrackError for a line on which the car touches something."""
    worst = int(ranges_without_movers.argmin())
    if ranges_without_movers[worst] < min(_TOUCHES, 0.5 * margin):
        x, y = points[worst].tolist()
        raise TrackError(
            f"track {course.name!r}: a car of {car.length:.2f} x {car.width:.2f} m touches a wall on the line at "
            f"({x:.2f}, {y:.2f}); accepted: a course with more room for it to turn"
        )
