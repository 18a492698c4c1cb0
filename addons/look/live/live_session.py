"""A race that goes on while somebody turns its knobs: pause, reset, drive by hand, another speed limit, other tires.

Knobs may be turned from any thread; what was asked for happens at the start of the next tick, in the thread that calls
`tick`. A value that cannot be is refused in `message`, and the old one stays.
"""

from __future__ import annotations

import inspect
import math
import threading
from collections import deque
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from fg_mujoco.course.files import kept_folder
from fg_mujoco.course.lap_timer import LapTimer
from fg_mujoco.errors import FgMujocoError, PlannerError, SettingsError, is_of_planner
from fg_mujoco.lidar.beams import lidar_body
from fg_mujoco.messages import DriveCommand, FloatArray, LaserScan, Odometry, Sketch
from fg_mujoco.racing.entries import check_starts
from fg_mujoco.racing.planners import make_controller, split_controller
from fg_mujoco.racing.resolved import Resolved
from fg_mujoco.racing.setup import OF_A_CAR, OF_A_COURSE, OF_A_DRIVER, Setup
from fg_mujoco.simulation.planner_adapter import Planners, PlannersOfEach, adapt, plan, start
from fg_mujoco.simulation.planner_failure import PlannerFailure
from fg_mujoco.simulation.settings import DriveSettings, Start
from fg_mujoco.simulation.simulation import Simulation
from fg_mujoco.simulation.telemetry import TELEMETRY
from fg_mujoco.simulation.world import LIDAR_PREFIX, World
from fg_mujoco.vehicle.motion import is_rolled_over
from fg_mujoco.vehicle.tire_slip import slides_above

from ..intermediate_values import IntermediateValues
from .hand_driver import HandDriver

_TRACE_STEP = 0.2  # [m] from one point of the trace to the next
_TRACE_LENGTH = 2000  # points
_HISTORY = 30.0  # [s] of speed that is kept


class LiveSession:
    """A car, its planner and whoever drives along; knobs change its `setup`, whose race has no end, and no rules.

    `setup` stays as it was at the beginning; `settings` of the car and those of the planner that differ from its own
    are as they are now. `world` is another one after `mu` was changed. `hand` is what the keys ask for, and `by_hand`:
    they drive. `message` is what happened last, `failure` how the planner failed, which pauses, since the reset or the
    last change of a knob. `values` are what the planner has shown by `fg_mujoco.show` in its last decision. Raises
    TrackError, ControllerError, SettingsError: what cannot be driven.
    """

    def __init__(self, setup: Setup | None = None) -> None:
        self.setup = setup or Setup()
        self.setup.require_usable("a live view", *OF_A_CAR, *OF_A_DRIVER, *OF_A_COURSE, "start", "seed", "grid", "name")
        self.settings = self.setup.drive_settings
        self.planner_settings: dict[str, Any]
        planner = self.setup.first.controller
        self._source, self.planner_settings = split_controller(planner, self.settings.planner_settings)
        raced = Resolved.of(self.setup)
        raced.check_starts()
        self._ground, self.world, self._start = raced.ground, raced.world, raced.starts[0]
        self._opponents = tuple(
            replace(entry, start=start) for entry, start in zip(raced.entries[1:], raced.starts[1:], strict=True)
        )
        self.simulation = self._make_simulation(self.world)
        self.laps = LapTimer(self.world.track)
        self._planner = self._make_planner(self.planner_settings, self.settings)
        self.hand = HandDriver(self.world.parameters)
        self.paused = self.by_hand = False
        self._lock = threading.Lock()
        self._wishes: dict[str, Any] = {}
        self._reset = False
        self._outside: DriveCommand | None = None
        self._outside_opponent: DriveCommand | None = None
        self._place_asked: tuple[float, float, float] | None = None
        self._trace: deque[tuple[float, float]] = deque(maxlen=_TRACE_LENGTH)
        self._history: deque[tuple[float, float, float]] = deque(maxlen=round(_HISTORY / self.period))
        self.values, self._remarked = IntermediateValues(), 0
        self._sketches: list[Sketch] = []  # of the values
        self.scan: LaserScan
        self.odometry: Odometry
        self.message = ""
        self.failure: PlannerFailure | None = None
        self._reported: set[int] = set()  # rows of the opponents whose planner's failure was reported
        self._place()

    @property
    def period(self) -> float:
        """Time that a tick takes [s]."""
        return self.simulation.period

    @property
    def planner_defaults(self) -> Any:
        """The planner's own settings, a dataclass object; None: it has none."""
        kind = getattr(type(self._planner), "Settings", None)
        return kind() if kind is not None else None

    def change(self, name: str, value: Any) -> None:
        """Ask for another `mu`, `planner_mu`, `max_speed` or `planner.SETTING`; of several the last counts."""
        with self._lock:
            self._wishes[name] = value

    def reset(self) -> None:
        """Ask for the car to be put back on the start."""
        with self._lock:
            self._reset = True

    def hold(self, command: DriveCommand | None, *, opponent: bool = False) -> None:
        """Hold a command from outside from the next tick on, of the car or the first opponent; None: the planner's."""
        with self._lock:
            if opponent:
                self._outside_opponent = command
            else:
                self._outside = command

    @property
    def held_from_outside(self) -> bool:
        """Whether a command from outside is held."""
        return self._outside is not None

    def put(self, x: float, y: float, heading: float) -> None:
        """Ask for the car to be put at a pose on the course, standing [m, m, rad]."""
        with self._lock:
            self._place_asked = (x, y, heading)

    def key(self, name: str) -> None:
        """Press one of the keys of `hand`: from now on it drives."""
        self.by_hand = True
        self.hand.press(name, self.simulation.time)

    @kept_folder()
    def obey(self) -> None:
        """Do what was asked for, without driving on."""
        self._obey()

    @kept_folder()
    def tick(self) -> bool:
        """Do what was asked for, and drive on for one tick unless paused; answer whether it did."""
        self._obey()
        if self.paused:
            return False
        if self.simulation.crashed or self.simulation.unstable:
            self.message = "crashed: reset to go on"
            return False
        if self.simulation.rolled_over:
            self.message = "rolled over: reset to go on"
            return False
        try:
            command = self._command()
            if self._opponents:
                self.simulation.engine.decide()
                if self._outside_opponent is not None and self.simulation.engine.running[1]:
                    held = self._outside_opponent
                    self.simulation.engine.commands[1] = held.steering_angle, held.speed
            self._take_values()
        except FgMujocoError as error:
            self.message, self.paused = " ".join(str(error).split()), True
            self.failure = error.failure if isinstance(error, PlannerError) else None
            return False
        self.scan, self.odometry = self.simulation.step(command)
        self._watch_opponents()
        self._history.append((self.simulation.time, self.simulation.speed, command.speed))
        x, y, _ = self.simulation.pose
        if not self._trace or math.dist(self._trace[-1], (x, y)) >= _TRACE_STEP:
            self._trace.append((x, y))
        before = self.laps.laps_completed
        if self.laps.update(self.simulation.time, (x, y)) > before:
            self.message = f"lap {before + 1}: {self.laps.lap_times[-1]:.3f} s"
        return True

    @property
    def trace(self) -> FloatArray:
        """Positions of the rear axle since the reset. Shape (n, 2) [m]."""
        return np.array(self._trace, dtype=np.float64).reshape(-1, 2)

    @property
    def history(self) -> FloatArray:
        """Time [s], speed [m/s] and commanded speed [m/s] of the last 30 s since the reset. Shape (n, 3)."""
        return np.array(self._history, dtype=np.float64).reshape(-1, 3)

    @property
    def limit_speed(self) -> float:
        """The law's limit at the present steering angle, sqrt(g mu b / tan|steering|) [m/s]; inf: straight on."""
        car = self.world.parameters
        tangent = math.tan(abs(self.odometry.steering_angle))
        return math.sqrt(car.gravity * self.world.car.mu * car.wheelbase / tangent) if tangent > 1e-6 else math.inf

    @property
    def friction_utilisation(self) -> float:
        """Of the tire with the greatest, in the last tick [-]; 0 where all are in the air."""
        if self._opponents:
            return self._last_in("friction_utilisation_front_left")
        return _greatest(self.simulation.slip.friction_utilisation)

    @property
    def sliding_speed(self) -> float:
        """Of the tire with the greatest, in the last tick [m/s]; 0 where all are in the air, NaN without a peak."""
        if not self.settings.tire_set.slides:
            return math.nan
        if self._opponents:
            return self._last_in("slide_front_left_m_s")
        return _greatest(self.simulation.slip.sliding_speed)

    @property
    def slides(self) -> bool:
        """Whether a tire slid in the last tick."""
        return self.sliding_speed > slides_above(self.settings.tire_set.model)

    def numbers(self) -> dict[str, Any]:
        """Return numbers to plot by name and unit, those that are known, with `laps` and `message`."""
        laps = self.laps
        steering_angle, speed = self.simulation.engine.commands[0].tolist()
        values = {
            "speed_m_s": self.simulation.speed, "command_speed_m_s": speed, "command_steering_rad": steering_angle,
            "steering_angle_rad": self.odometry.steering_angle, "yaw_rate_rad_s": self.odometry.yaw_rate,
            "limit_speed_m_s": self.limit_speed, "friction_utilisation": self.friction_utilisation,
            "sliding_speed_m_s": self.sliding_speed, "progress_m": laps.progress, "offset_m": laps.offset,
            "best_lap_s": min(laps.lap_times, default=math.nan),
        }  # fmt: skip
        finite = {name: float(value) for name, value in values.items() if math.isfinite(value)}
        return {**finite, "laps": laps.laps_completed, "message": self.message}

    def scan_points(self, step: int = 1) -> FloatArray:
        """Return the end of every `step`-th beam in the world, without those that have no reading. (n, 3) [m]."""
        ranges = self.scan.ranges[::step]
        seen = np.isfinite(ranges)
        bearings = self.scan.bearings[::step][seen]
        ends = ranges[seen, None] * np.column_stack((np.cos(bearings), np.sin(bearings), np.zeros(len(bearings))))
        position, rotation = self._lidar_pose()
        points: FloatArray = position + ends @ rotation.T
        return points

    @kept_folder()
    def goal(self) -> FloatArray | None:
        """Return the goal of the planner, (3,) [m] in the world; None: it has none, or does not say."""
        try:
            return self._goal()
        except BaseException as error:
            if not is_of_planner(error):
                raise
            return None  # as `tick` tells: here it would end the view

    @kept_folder()
    def drawings(self) -> list[Sketch]:
        """Return the planner's drawings: its intermediate values, and the markers, paths and poses of nodes."""
        try:
            of_nodes = self._planner.drawings() if hasattr(self._planner, "drawings") else []
            return [*self._sketches, *of_nodes]
        except BaseException as error:
            if not is_of_planner(error):
                raise
            return []  # as of the goal

    def _goal(self) -> FloatArray | None:
        find = getattr(self._planner, "find_goal", None)
        wanted = tuple(inspect.signature(find).parameters) if find is not None else ()
        position, rotation = self._lidar_pose()
        if find is not None and wanted == ("scan",):
            found = find(self.scan)
            if found is not None:
                bearing, distance = found
                return np.asarray(
                    position + rotation @ (distance * np.array([math.cos(bearing), math.sin(bearing), 0.0]))
                )
        if find is not None and wanted == ("odometry",):
            place = find(self.odometry)
            return None if place is None else np.array([*place, position[2]])
        return None

    def _lidar_pose(self) -> tuple[FloatArray, FloatArray]:
        body = lidar_body(self.world.model, LIDAR_PREFIX)
        data = self.simulation.data
        return data.xpos[body].copy(), data.xmat[body].reshape(3, 3).copy()

    def _command(self) -> DriveCommand:
        if self.by_hand:
            return self.hand.command(self.simulation.time, self.period, self.settings.max_speed)
        outside = self._outside
        if outside is not None:
            return outside
        if hasattr(self._planner, "look_round"):
            self._planner.look_round(self.simulation.engine.surroundings(0))
        with self.values.of(self.scan):
            return plan(self._planner, self.scan, self.odometry)

    def _take_values(self) -> None:
        """Take what the planner has shown, where the car is now, and say why a value is not shown."""
        if self.by_hand or self.held_from_outside:
            self.values.now = {}
        car, pose = self.world.parameters, np.array(self.simulation.pose)
        self._sketches = self.values.sketches(self.scan, pose, car.lidar_offset)
        if len(self.values.remarks) > self._remarked:
            self._remarked, self.message = len(self.values.remarks), self.values.remarks[-1]

    def _obey(self) -> None:
        with self._lock:
            wishes, self._wishes = self._wishes, {}
            reset, self._reset = self._reset, False
            asked, self._place_asked = self._place_asked, None
        for name, value in wishes.items():
            try:
                self._change(name, value)
                self.message, self.failure = "", None
            except FgMujocoError as error:
                self.message = " ".join(str(error).split())
        if reset or asked is not None:
            try:
                own = self._start if asked is None else self._start_at(*asked)
            except FgMujocoError as error:  # of the pose: the car stays where it is
                self.message = " ".join(str(error).split())
                return
            try:
                self._place(own)
            except FgMujocoError as error:  # the planner's reset
                self.message, self.paused = " ".join(str(error).split()), True

    def _change(self, name: str, value: Any) -> None:
        if name == "mu":
            settings = replace(self.settings, mu=value, floor=None, changes=replace(self.settings.changes, mu=None))
            changed = settings.assumed_mu != self.settings.assumed_mu
            planner = self._make_planner(self.planner_settings, settings) if changed else self._planner
            self._change_mu(settings)
            self._planner = planner
        elif name in ("max_speed", "planner_mu"):
            settings = replace(self.settings, **{name: value})
            self._planner = self._make_planner(self.planner_settings, settings)
            self.settings = settings
        elif name.startswith("planner."):
            wanted = self.planner_settings | {name.removeprefix("planner."): value}
            self._planner = self._make_planner(wanted, self.settings)
            self.planner_settings = wanted
        else:
            raise SettingsError(f"{name} is no knob; accepted: mu, planner_mu, max_speed, planner.SETTING")

    def _change_mu(self, settings: DriveSettings) -> None:
        """Give the car other tires where it is, as fast as it is: a new world takes the state of the old one."""
        state = self.simulation.state
        world = self._make_world(settings)
        simulation = self._make_simulation(world)
        cars, engine, before = (settings, *self._opponents), simulation.engine, self.simulation.engine
        engine.load(
            state, effects=[car.effects for car in cars], seed=[car.seed for car in cars],
            odometry_drift=[car.odometry_drift for car in cars], sensors=[car.sensed for car in cars],
        )  # fmt: skip
        engine.crashed[:], engine.planners = before.crashed, before.planners
        engine.running[1:] = before.running[1:]
        engine.read(0, simulation.data)
        self.world, self.simulation, self.settings = world, simulation, settings

    def _make_simulation(self, world: World) -> Simulation:
        settings = self.settings
        return Simulation(
            world, effects=settings.effects, seed=settings.seed, odometry_drift=settings.odometry_drift,
            sensors=settings.sensed, others=self._opponents,
        )  # fmt: skip

    def _make_world(self, settings: DriveSettings) -> World:
        others = [opponent.world_car() for opponent in self._opponents]
        return settings.world(self._ground.course, obstacles=self._ground.boxes, others=others)

    def _make_opponents(self) -> Planners:
        """Return the opponents' planners, as new."""
        groups: list[tuple[Any, Planners]] = []
        for row, opponent in enumerate(self._opponents, start=1):
            source, settings = split_controller(opponent.controller, opponent.planner_settings)
            context = opponent.context(self.world.cars[row].parameters, self.world.track.map_line)
            planner = make_controller(source, context, settings=settings)
            start(planner)
            groups.append((np.array([row]), adapt([planner])))
        return PlannersOfEach(groups)

    def _watch_opponents(self) -> None:
        """Stop those that have crashed into a wall or rolled over, and say so; likewise who failed."""
        engine, qpos = self.simulation.engine, self.simulation.engine.qpos(0)
        for row, opponent in enumerate(self._opponents, start=1):
            if not engine.running[row]:
                continue
            rolled_over = is_rolled_over(qpos, self.world.cars[row].constants)
            if engine.crashed[row] or rolled_over:
                reason, said = ("crash", "crashed") if engine.crashed[row] else ("rolled_over", "rolled over")
                engine.monitor.end(np.arange(len(engine.running)) == row, reason)
                self.message = f"{opponent.name} {said}"
        if self._opponents and engine.planners is not None:
            for row, error in engine.planners.failures.items():
                if row not in self._reported:
                    self._reported.add(row)
                    self.message = f"{self._opponents[row - 1].name}: {' '.join(str(error).split())}"

    def _last_in(self, column: str) -> float:
        """Return the greatest of the four values of the tires of car 0 from a column of the telemetry on."""
        first = TELEMETRY.index(column)
        return _greatest(self.simulation.engine.telemetry[0, first : first + 4])

    def _make_planner(self, settings: dict[str, Any], shared: DriveSettings) -> Any:
        context = shared.context(self.world.parameters, self.world.track.map_line)
        planner = make_controller(self._source, context, settings=settings)
        start(planner)
        return planner

    def _start_at(self, x: float, y: float, heading: float) -> Start:
        """Return the start that is a pose on the map."""
        course = self._ground.course
        place, offset = (float(values[0]) for values in course.project(np.array([[x, y]])))
        s = place - (course.origin or 0.0)
        along = course.start_pose(s, offset)[2]
        start = Start(s=s, offset=offset, heading=math.remainder(heading - along, math.tau))
        check_starts(course, [start], [self.world.parameters], [""], self._ground.boxes)
        return start

    def _place(self, own: Start | None = None) -> None:
        """Put all cars on their starts; `own` is that of the car, None: as set up."""
        self.scan, self.odometry = self.simulation.reset(**asdict(own or self._start))
        if self._opponents:
            self.simulation.engine.planners, self._reported = self._make_opponents(), set()
        start(self._planner)
        self.hand.release()
        self._outside_opponent = None
        self.laps.reset()
        self._trace.clear()
        self._history.clear()
        self.values.now, self._sketches = {}, []
        self.message, self.failure = "", None


def _greatest(values: FloatArray) -> float:
    return float(np.nan_to_num(values, nan=0.0).max(initial=0.0))
