"""The decisions of a recorded run: what the planner was told, what it made of it, its command, and what held that.

The run is driven again, bit for bit, and its planner is called along with it from the first tick on, because planners
remember. A planner shows its work by methods, of which it may have any:

    intermediate_scans(scan) -> {name: ranges (n,) [m]}    what it makes of the scan
    find_goal(scan) -> (bearing [rad], distance [m])       where it wants to go, seen from the LiDAR; None: nowhere
    motion() -> points (m, 2) [m]                          where it is led, in the frame of the rear axle
    reasons() -> [(name, steering_angle [rad], speed [m/s]), ...]    what each step made of the last command

The last three are asked after the call whose scan it is. `find_goal(odometry) -> (x, y)` on the map is accepted too.
What it shows by `fg_mujoco.show` while it decides, and the markers, paths and poses of nodes, are collected, too.
"""

from __future__ import annotations

import contextlib
import inspect
import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fg_mujoco.arguments import explain_class
from fg_mujoco.display import brief
from fg_mujoco.errors import ControllerError
from fg_mujoco.messages import CarParameters, Controller, DriveCommand, FloatArray, LaserScan, Odometry, Sketch
from fg_mujoco.pictures.rendering.planner_view import intermediate_scans
from fg_mujoco.simulation.planner_adapter import Surroundings, plan, short_text
from fg_mujoco.simulation.planner_failure import one_line
from fg_mujoco.simulation.telemetry import recorded_command

from ..intermediate_values import BASE, FARTHEST, MAP, NUMBER, SCAN, IntermediateValues, moved

_MOST_NAME = 60  # characters of a name or text that a planner gives


@dataclass(frozen=True, kw_only=True)
class Step:
    """What one step made of the reference on its way to the command."""

    name: str
    steering_angle: float  # [rad] after it; NaN: there is none
    speed: float  # [m/s] after it; NaN: there is none
    text: str = ""  # what the step does
    on_the_way: bool = False  # it says how fast the car gets to what the steps before it want
    clamps: bool = False  # it is the car, which holds the command within its limits


@dataclass(frozen=True, kw_only=True, eq=False)
class Drawn:
    """Points or lines that a planner has drawn over the scan, in the frame of the rear axle."""

    name: str  # in `fg_mujoco.show`, or the topic of a node
    points: FloatArray  # (k, 2) points, or (k, 2, 2) ends of pieces of lines [m]
    colour: tuple[int, int, int]  # red, green, blue in 0..255


@explain_class
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Decision:
    """One decision. Places are in the frame of the rear axle, x ahead and y to the left."""

    tick: int
    time: float  # [s]
    scan: LaserScan = field(repr=False)
    odometry: Odometry = field(repr=False)
    pose: FloatArray  # (3,) x [m], y [m] and heading [rad] of the rear axle in the world
    command: DriveCommand | None  # as recorded; None: the planner failed here
    answer: DriveCommand | None  # of the planner now; None: it was not asked, or failed
    scans: dict[str, FloatArray] = field(repr=False)  # intermediate scans (n,) [m] by name, "raw" first
    steps: tuple[Step, ...]  # from the reference to what the car got
    goal: FloatArray | None = None  # (2,) [m]
    motion: FloatArray = field(default_factory=lambda: np.empty((0, 2)))  # (m, 2) [m] that the car is led along
    numbers: dict[str, float] = field(default_factory=dict)  # that the planner has shown, by name
    drawn: tuple[Drawn, ...] = ()  # points and lines that the planner has shown
    colours: dict[str, tuple[int, int, int]] = field(default_factory=dict)  # of the scans that it has shown, by name
    failure: str = ""  # what the planner raised, and its traceback

    @property
    def speed_step(self) -> Step | None:
        """The step that chose the speed: the last one that changed it; None: not known."""
        return _held(self.steps, lambda step: step.speed)

    @property
    def steering_step(self) -> Step | None:
        """The step that chose the steering angle: the last one that changed it; None: not known."""
        return _held(self.steps, lambda step: step.steering_angle)

    def __repr__(self) -> str:
        return brief(self, f"t = {self.time:.3f} s", f"speed: {self.why_speed}", f"steering: {self.why_steering}")

    @property
    def why_speed(self) -> str:
        """The step that chose the speed, in a sentence."""
        command = None if self.command is None else self.command.speed
        return _why(self.speed_step, command, lambda step: step.speed, _in_metres)

    @property
    def why_steering(self) -> str:
        """The step that chose the steering angle, in a sentence."""
        command = None if self.command is None else self.command.steering_angle
        return _why(self.steering_step, command, lambda step: step.steering_angle, _in_degrees)


def _in_metres(speed: float) -> str:
    return f"{round(speed, 2) + 0.0:.2f} m/s"


def _in_degrees(angle: float) -> str:
    return f"{round(math.degrees(angle), 1) + 0.0:+.1f}°"


def _held(steps: tuple[Step, ...], value: Callable[[Step], float]) -> Step | None:
    held, last = None, math.nan
    for step in steps:
        if not step.on_the_way and not math.isnan(value(step)) and value(step) != last:
            held, last = step, value(step)
    return held


def _why(step: Step | None, command: float | None, value: Callable[[Step], float], text: Callable[[float], str]) -> str:
    if command is None:
        return "The planner failed: there is no command."
    if step is None:
        return "The steps to the command are not known."
    wanted, given = text(value(step) + 0.0), text(command + 0.0)
    if step.clamps:
        return f"The planner asked for {given}, beyond the car's limits: the car gets {wanted}."
    way = "" if wanted == given else f" On the way there the command is {given}."
    return f"{wanted}, chosen by {step.name}{f': {step.text}' if step.text else ''}.{way}"


def limited_by_car(command: DriveCommand, car: CarParameters) -> Step | None:
    """Return the step in which a car holds a command within its limits; None where the command is within them."""
    angle = min(max(command.steering_angle, -car.max_steering_angle), car.max_steering_angle)
    speed = min(max(command.speed, car.min_speed), car.max_speed)
    if (angle, speed) == (command.steering_angle, command.speed):
        return None
    return Step(
        name="clamped by the car", steering_angle=angle, speed=speed, text="the command is beyond the car's limits",
        clamps=True,
    )  # fmt: skip


@dataclass(eq=False)
class Witness:
    """Calls the planner of a run along with it, and asks what it made of a scan.

    `differing` counts the decisions in which the planner's answer is another than the recorded one; `remarks` are what
    its own methods raised, and which values cannot be shown. Without a planner there are scans and commands alone.
    """

    planner: Controller | None
    car: CarParameters
    differing: int = 0
    asked: int = 0
    remarks: list[str] = field(default_factory=list)
    _stopped: bool = False
    _values: IntermediateValues = field(default_factory=IntermediateValues)
    _sketches: list[Sketch] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._sketches = self._ask(self._drawings, [])  # nodes keep theirs from the first question on

    def look_round(self, surroundings: Surroundings) -> None:
        """Tell a planner that asks for it what surrounds the car, before `decide`."""
        if hasattr(self.planner, "look_round"):
            self._ask(lambda: self.planner.look_round(surroundings), None)  # type: ignore[union-attr]

    def decide(self, scan: LaserScan, odometry: Odometry, command: DriveCommand | None) -> DriveCommand | None:
        """Return the planner's answer, and compare it with the recorded command; None: it does not answer."""
        if self.planner is None or self._stopped:
            return None
        try:
            with _its_prints_aside(), self._values.of(scan):
                answer = plan(self.planner, scan, odometry)
        except ControllerError as error:
            self._stopped = True
            if command is not None:
                self.differing += 1
                self._remark(f"the planner failed now, and not in the race: {error}")
            return None
        for said in self._values.remarks:
            self._remark(said)
        self._sketches = self._ask(self._drawings, [])
        if command is not None:
            self.asked += 1
            self.differing += int(recorded_command(answer) != command)
        return answer

    def look(
        self,
        tick: int,
        scan: LaserScan,
        odometry: Odometry,
        command: DriveCommand | None,
        answer: DriveCommand | None,
        failure: str = "",
    ) -> Decision:
        """Return all that is known of a decision, after `decide`."""
        scans = {"raw": np.nan_to_num(scan.ranges, nan=0.0, posinf=scan.range_max, neginf=0.0)}
        steps: list[Step] = []
        goal, motion = None, np.empty((0, 2))
        if self.planner is not None:
            for name, ranges in self._ask(lambda: intermediate_scans(self.planner, scan), {}).items():
                if ranges.shape == scan.ranges.shape:
                    scans[short_text(str(name))] = ranges
                else:
                    self._remark(f"intermediate scan {name!r} has shape {ranges.shape}; accepted: {scan.ranges.shape}")
            goal = self._ask(lambda: self._goal(scan, odometry), None)
            scans |= {name: value.array for name, value in self._values.now.items() if value.kind == SCAN}
        if answer is not None:
            motion = self._ask(lambda: _points(getattr(self.planner, "motion", None)), motion)
            steps = self._ask(lambda: _steps(getattr(self.planner, "reasons", None)), [])
        if command is not None:
            if not steps:
                steps = [Step(name="planner", steering_angle=command.steering_angle, speed=command.speed)]
            clamped = limited_by_car(command, self.car)
            steps += [clamped] if clamped is not None else []
        return Decision(
            tick=tick, time=scan.stamp if failure else odometry.stamp, scan=scan, odometry=odometry,
            pose=odometry.pose, command=command, answer=answer, scans=scans, steps=tuple(steps), goal=goal,
            motion=motion, failure=failure, drawn=tuple(self._drawn(scan, odometry)),
            colours={name: value.colour for name, value in self._values.now.items() if value.kind == SCAN},
            numbers={name: float(value.array) for name, value in self._values.now.items() if value.kind == NUMBER},
        )  # fmt: skip

    def _drawings(self) -> list[Sketch]:
        """Return what nodes show now: markers, paths and poses."""
        drawings = getattr(self.planner, "drawings", None)
        return list(drawings()) if callable(drawings) else []

    def _drawn(self, scan: LaserScan, odometry: Odometry) -> Iterator[Drawn]:
        """Yield the points and lines of the last decision, in the frame of the rear axle."""
        for name, value in self._values.now.items():
            if value.kind not in (NUMBER, SCAN):
                points = moved(value.drawing(scan), value.frame, BASE, odometry.pose, self.car.lidar_offset)
                yield from _finite(Drawn(name=name, points=points, colour=value.colour))
        for sketch in self._sketches:
            points = moved(sketch.points[..., :2], MAP, BASE, odometry.pose, self.car.lidar_offset)
            yield from _finite(Drawn(name=sketch.name, points=points, colour=sketch.colour))

    def _goal(self, scan: LaserScan, odometry: Odometry) -> FloatArray | None:
        """Return the goal in the frame of the rear axle; see the module."""
        find = getattr(self.planner, "find_goal", None)
        wanted = tuple(inspect.signature(find).parameters) if callable(find) else ()
        if find is None or wanted not in (("scan",), ("odometry",)):
            return None
        found = find(scan if wanted == ("scan",) else odometry)
        if found is None:
            return None
        first, second = map(float, found)
        if wanted == ("scan",):
            place = [self.car.lidar_offset + second * math.cos(first), second * math.sin(first)]
        else:
            x, y, heading = odometry.pose.tolist()
            cos, sin = math.cos(heading), math.sin(heading)
            place = [cos * (first - x) + sin * (second - y), cos * (second - y) - sin * (first - x)]
        return np.array(place) if all(map(math.isfinite, place)) else None

    def _ask(self, ask: Callable[[], Any], otherwise: Any) -> Any:
        """Return what a method of the planner says, or something else where it raises."""
        try:
            with _its_prints_aside():
                return ask()
        except Exception as error:  # its code is not ours
            self._remark(f"the planner's methods for this page fail: {one_line(error)}")
            return otherwise

    def _remark(self, text: str) -> None:
        if text not in self.remarks:
            self.remarks.append(text)


def _finite(drawn: Drawn) -> Iterator[Drawn]:
    """Yield what is drawn where there is something, and its place is known."""
    if drawn.points.size and (np.abs(drawn.points) <= FARTHEST).all():
        yield drawn


def _points(motion: Any) -> FloatArray:
    points = np.asarray(motion() if callable(motion) else np.empty((0, 2)), dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise ValueError(f"motion() has shape {points.shape}; accepted: (m, 2) finite")
    return points


def _steps(reasons: Any) -> list[Step]:
    steps = []
    for name, steering_angle, speed, *more in reasons() if callable(reasons) else ():
        text, on_the_way = (*more, "", False)[:2] if len(more) < 2 else more[:2]
        steps.append(
            Step(
                name=str(name)[:_MOST_NAME], steering_angle=float(steering_angle), speed=float(speed),
                text=short_text(str(text)) if len(str(text)) > 2 * _MOST_NAME else str(text),
                on_the_way=bool(on_the_way),
            )
        )  # fmt: skip
    return steps


@contextlib.contextmanager
def _its_prints_aside() -> Iterator[None]:
    """Print on stderr what a planner prints: stdout is not its."""
    with contextlib.redirect_stdout(sys.stderr):
        yield
