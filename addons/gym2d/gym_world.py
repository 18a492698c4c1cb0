"""The world behind both interfaces of f1tenth_gym: cars, their engine, the noise of their scans, and their laps."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from fg_mujoco import portable
from fg_mujoco.course.course import Course
from fg_mujoco.course.projection import follow
from fg_mujoco.course.standing import off_course, stands_in_something
from fg_mujoco.display import brief
from fg_mujoco.lidar.beams import lidar_of
from fg_mujoco.lidar.lidar import Lidar, RaycastLidar
from fg_mujoco.lidar.scan_pipeline import add_noise
from fg_mujoco.messages import FloatArray
from fg_mujoco.simulation.cars import WorldCar, first_overlap, lidar_prefix
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.settings import Start
from fg_mujoco.simulation.simulation import complete_state
from fg_mujoco.simulation.world import World
from fg_mujoco.vehicle import motion as car_motion
from fg_mujoco.vehicle.car import WHEELS
from fg_mujoco.vehicle.tire_rows import USERDATA, userdata_place
from fg_mujoco.vehicle.tires import tires_of

from .params import number
from .speed_controller import SpeedController

Motion = tuple[float, float, float, float, float, float]
"""Of a car: x [m], y [m], heading [rad], velocity ahead and to the left [m/s], yaw rate [rad/s]."""

BEAMS = 1080
FIELD_OF_VIEW = 4.7
"""[rad] From the first beam, the rightmost, to the last."""
SCAN_NOISE = 0.01
"""[m] Standard deviation of each range."""
RANGE_MAX = 30.0
"""[m] Where nothing is."""
_FAR = 1000.0  # [m] from the course: there cars come to rest
_SETTLING = 3.0  # [s] that they take
LAPS = 2
"""After how many an episode is done."""

_NEAR_LINE, _BESIDE_LINE = 0.1, 2.0  # [m^2, m] f1tenth_gym: a car this near to its start is at the start line


@dataclass(frozen=True, kw_only=True)
class ScanErrors:
    """What makes a scan other than what is there, in the order of the gym; SettingsError: a value out of its range."""

    noise_std: float | None = None  # standard deviation of each range [m]; None: the gym's, SCAN_NOISE
    range_bias_std: float = 0.0  # the same of a bias of each beam, which is drawn when the cars are placed [m]
    dropout_prob: float = 0.0  # of each range to read range_max
    range_min: float = 0.0  # [m] what is less or more reads this
    range_max: float = RANGE_MAX  # [m]

    def __post_init__(self) -> None:
        bounds = {"dropout_prob": (0.0, 1.0), "range_max": (0.1, RANGE_MAX)}
        for name, value in asdict(self).items():
            if value is not None:
                object.__setattr__(self, name, number(name, value, *bounds.get(name, (0.0, 10.0))))
        number("range_min", self.range_min, 0.0, self.range_max)

    def bias(self, rng: np.random.Generator, beams: int) -> FloatArray:
        """Return the bias of each beam. Shape (beams,) [m]."""
        return rng.normal(0.0, self.range_bias_std, beams) if self.range_bias_std > 0.0 else np.zeros(beams)

    def apply(self, ranges: FloatArray, bias: FloatArray, reach: float, rng: np.random.Generator) -> FloatArray:
        """Return what is read of true ranges (beams,) [m], which are `reach` where there is nothing."""
        noisy, most = rng.standard_normal(len(ranges)), min(self.range_max, reach)
        add_noise(ranges, SCAN_NOISE if self.noise_std is None else self.noise_std, reach, noisy)
        if self.range_bias_std > 0.0 or self.range_min > 0.0 or most < reach:
            noisy = np.clip(noisy + bias, self.range_min, most)
        if self.dropout_prob > 0.0:
            noisy[rng.random(len(ranges)) < self.dropout_prob] = most
        return noisy


class Driving:
    """Some cars on a course, driven step by step, with the engine's `motions`, their `laps`, and noise in their scans.

    Poses and velocities are those of the rear axles, or `ahead` [m] of them: cars on linear tires resemble the gym's
    single-track model. Theirs are those of the centre of gravity, and the speed controller makes up for the tires' slip
    and drag. `physics` [s] is the timestep of the physics, which divides `timestep` [s]; None: the vehicle's own.
    """

    def __init__(
        self,
        course: Course,
        builds: Sequence[WorldCar],
        *,
        timestep: float,
        physics: float | None = None,
        seed: int = 12345,
        beams: int = BEAMS,
        field_of_view: float = FIELD_OF_VIEW,
        errors: ScanErrors = ScanErrors(),
    ) -> None:
        first = builds[0]
        self.world = GymWorld(
            course, first.vehicle, mu=first.mu, tires=first.tires, changes=first.changes, others=builds[1:],
            beams=beams, field_of_view=field_of_view,
        )  # fmt: skip
        if physics is not None:
            self.world.model.opt.timestep = physics  # all digits, of which MJCF text has six
        self._seed, self._beams, self._errors = seed, beams, errors
        self._agents = range(len(builds))
        self._every = np.ones(len(builds), np.bool_)  # of the engine's rows
        self._data = mujoco.MjData(self.world.model)
        self.engine = Engine(self.world, period=timestep)
        self.laps: list[LapCount] = []
        self.motions: list[Motion] = []
        self._qpos, self._qvel = self.engine.qpos(0), self.engine.qvel(0)
        self._constants = [car.constants for car in self.world.cars]
        self.ahead, self._controllers = [], []
        for build, car in zip(builds, self.world.cars, strict=True):
            single_track = not build.tire_set.slides
            self.ahead.append(car.parameters.rear_axle_distance if single_track else 0.0)
            self._controllers.append(SpeedController(car.parameters, over_ground=single_track, timestep=timestep))

    def __repr__(self) -> str:
        return brief(self, repr(self.world), f"step {self.engine.period:g} s")

    @property
    def data(self) -> mujoco.MjData:
        """The world's mujoco.MjData at the present state, which is written when it is asked for: one object."""
        self.engine.read(0, self._data)
        return self._data

    @property
    def time(self) -> float:
        """Simulated since the cars were placed [s]."""
        return self.engine.time(0)

    def place(self, poses: Sequence[Sequence[float]]) -> None:
        """Let the cars stand at poses [m, m, rad], and begin laps and noise; a warning says which touch at once."""
        cars = self.world.cars
        axles = [shifted(pose, -ahead) for pose, ahead in zip(poses, self.ahead, strict=True)]
        pair = first_overlap(axles, [car.parameters for car in cars])
        if pair is not None:
            said = " and ".join(str(list(poses[agent])) for agent in pair)
            warnings.warn(
                f"poses of the cars {pair[0]} and {pair[1]} are {said}, where they touch: they collide at once",
                stacklevel=4,
            )
        self._warn_of_walls(poses, axles)
        qpos, userdata = self._at_rest
        self.engine.place([Start()] * len(cars))
        data = self.data
        data.qpos[:], data.userdata[:] = qpos, userdata
        for constants, (x, y, heading) in zip(self._constants, axles, strict=True):
            free = int(constants["free_qpos"][0])
            turned, rest = (math.cos(0.5 * heading), 0.0, 0.0, math.sin(0.5 * heading)), qpos[free + 3 : free + 7]
            data.qpos[free : free + 2] = x, y
            mujoco.mju_mulQuat(data.qpos[free + 3 : free + 7], np.array(turned), rest)
        mujoco.mj_forward(self.world.model, data)
        self.engine.load(complete_state(self.world.model, data))
        for controller in self._controllers:
            controller.reset()
        # the noise of a car is the same, however many others there are
        self._noise = [np.random.default_rng([self._seed, agent] if agent else self._seed) for agent in self._agents]
        self._biases = [self._errors.bias(rng, self._beams) for rng in self._noise]
        self.laps = [LapCount(self.world.track, *pose) for pose in poses]
        self.motions = [self.motion(agent) for agent in self._agents]

    @cached_property
    def _at_rest(self) -> tuple[FloatArray, FloatArray]:
        """Joint positions and user data of cars that have come to rest on their springs, far from the course."""
        engine = self.engine
        engine.place([Start()] * len(self.world.cars))
        data = self.data
        for row, car in enumerate(self.world.cars):
            car.set_pose(data, _FAR, _FAR + 10.0 * row, 0.0)
        engine.load(complete_state(self.world.model, data))
        engine.commands[:] = 0.0
        for _ in range(math.ceil(_SETTLING / engine.period)):
            engine.drive()
        return self.data.qpos.copy(), data.userdata.copy()

    def _warn_of_walls(self, poses: Sequence[Sequence[float]], axles: Sequence[Sequence[float]]) -> None:
        """Warn of poses in a wall, and of those beyond the walls, where a script drives as in the gym."""
        course = self.world.track
        for agent, (pose, axle, car) in enumerate(zip(poses, axles, self.world.cars, strict=True)):
            along = float(course.project([axle[:2]])[0][0]) - (course.origin or 0.0)
            said = ""
            if stands_in_something(course, axle, car.parameters):
                said = f"in a wall of {course.name!r}: it collides at once"
            elif course.edges and off_course(course, axle, course.start_pose(along)):
                said = f"beyond the walls of {course.name!r}: there it collides with nothing, and its laps mean nothing"
            if said:
                warnings.warn(f"pose of car {agent} is {list(map(float, pose))}, {said}", stacklevel=5)

    def put(self, agent: int, state: Sequence[float]) -> None:
        """Put one car into a state of the gym, as `state` returns it, while the others go on."""
        x, y, steering, speed, heading, yaw_rate, slip = (float(value) for value in state[:7])
        car, data, time = self.world.cars[agent], self.data, self.time
        car.write_pose(data, *shifted((x, y, heading), -self.ahead[agent]), speed)
        self._controllers[agent].reset()
        constants = car.constants
        free, at = int(constants["free_dof"][0]), int(constants["steering_qpos"][0])
        cos, sin = math.cos(heading), math.sin(heading)
        left = speed * math.tan(slip) - self.ahead[agent] * yaw_rate  # of the rear axle
        data.qvel[free : free + 2] = speed * cos - left * sin, speed * sin + left * cos
        data.qvel[free + 5], data.qpos[at] = yaw_rate, steering
        data.time = time
        if not tires_of(self.world.model, car.prefix).is_contact:
            first = userdata_place(self.world.model, car.prefix)
            data.userdata[first : first + USERDATA * len(WHEELS)] = 0.0
        mujoco.mj_forward(self.world.model, data)
        self.engine.load(complete_state(self.world.model, data))
        self.motions[agent] = self.motion(agent)

    def drive(self, commands: Any) -> NDArray[np.bool_]:
        """Hold steering angles [rad] and speeds [m/s] (cars, 2) for a step; return which cars touch or lie, (cars,)."""
        engine = self.engine
        engine.commands[:] = [
            (steering, controller.set_point(speed, *self._speeds(agent)))
            for agent, ((steering, speed), controller) in enumerate(zip(commands, self._controllers, strict=True))
        ]
        engine.crashed[:] = False  # a collision is of a step
        engine.drive()
        engine.sense(self._every)
        time = engine.time(0)
        collided: NDArray[np.bool_] = engine.crashed | engine.unstable(0)
        collided |= [car_motion.is_rolled_over(self._qpos, constants) for constants in self._constants]
        if len(self._agents) > 1:
            collided |= (engine.touched_at >= time).any(axis=1)
        self.motions = [self.motion(agent) for agent in self._agents]
        for laps, (x, y, *_) in zip(self.laps, self.motions, strict=True):
            laps.count(time, x, y)
        return collided

    def speed_for(self, agent: int, acceleration: float) -> float:
        """Return the commanded speed [m/s] by which a car's controller asks for an acceleration [m/s^2] now."""
        return self._controllers[agent].speed_for(acceleration, *self._speeds(agent))

    def scan(self, agent: int) -> FloatArray:
        """Return a car's ranges, noisy; `range_max` where nothing is, 0 where it is too near. Shape (beams,) [m]."""
        ranges, rng = self.engine.ranges[agent], self._noise[agent]
        return self._errors.apply(ranges, self._biases[agent], self.engine.beams.range_max, rng)

    def motion(self, agent: int) -> Motion:
        """Return the motion of a car, read off the engine."""
        return car_motion.point_motion(self._qpos, self._qvel, self.ahead[agent], self._constants[agent])

    def steering(self, agent: int) -> float:
        """Return a car's steering angle [rad]."""
        return float(self.engine.qpos(0)[int(self.world.cars[agent].constants["steering_qpos"][0])])

    def state(self, agent: int) -> FloatArray:
        """Return a car's state as the gym has it: x, y, steering angle, speed, heading, yaw rate, slip angle. (7,)."""
        x, y, heading, ahead, left, yaw_rate = self.motions[agent]
        slip = math.atan2(left, ahead) if math.hypot(ahead, left) >= car_motion.SIDESLIP_SPEED else 0.0
        return np.array([x, y, self.steering(agent), ahead, heading % math.tau % math.tau, yaw_rate, slip])

    def _speeds(self, agent: int) -> tuple[float, float]:
        """Return the speed of a car's wheels and its speed over the ground [m/s]."""
        _, _, _, ahead, left, _ = self.motions[agent]
        wheels = car_motion.surface_speed(self._qvel, self._constants[agent])
        return wheels, math.copysign(math.hypot(ahead, left), ahead)


class LapCount:
    """Counts the laps of a car: by progress on a closed course, in the direction in which it was placed.

    On a course without a loop they are counted as f1tenth_gym does: by how often the car comes back to its start
    (`at_start`). `time` [s] is when the second was completed, and until then the present time; `last` [s] is how long
    the lap took that was completed last, 0 for none.
    """

    def __init__(self, track: Course, x: float, y: float, heading: float) -> None:
        self._track, self._start = track, (x, y, heading)
        self._place = float(track.project([[x, y]])[0][0])
        self._progress = self._greatest_progress = 0.0
        self.completed, self.time, self.at_start = 0, 0.0, True
        self.last = self._completed_at = 0.0
        along = track.start_pose(self._place - (track.origin or 0.0))[2]
        self._forward = math.copysign(1.0, math.cos(heading - along))  # laps count in the direction that it looks in

    @property
    def along(self) -> float:
        """Driven in the direction of the course since the start, backward negative [m]; 0 on one without a loop."""
        return self._forward * self._progress

    def count(self, time: float, x: float, y: float) -> None:
        """Take where the car is at a time."""
        if self.completed < LAPS:
            self.time = time
        before = self.completed
        self._count(x, y)
        if self.completed > before:
            self.last, self._completed_at = time - self._completed_at, time

    def _count(self, x: float, y: float) -> None:
        track = self._track
        if not track.closed:
            near = self._near(x, y)
            self.completed += near and not self.at_start
            self.at_start = near
            return
        place, _ = follow(x, y, self._place, track.table, track.modulus)
        self._progress += self._forward * math.remainder(place - self._place, track.length)
        self._place = place
        self._greatest_progress = max(self._greatest_progress, self._progress)
        self.completed = int(self._greatest_progress // track.length)

    def _near(self, x: float, y: float) -> bool:
        start_x, start_y, heading = self._start
        cos, sin, x, y = math.cos(heading), math.sin(heading), x - start_x, y - start_y
        aside = max(abs(y * cos - x * sin) - _BESIDE_LINE, 0.0)
        return (x * cos + y * sin) ** 2 + aside**2 <= _NEAR_LINE


class GymWorld(World):
    """A world whose LiDARs measure along `beams` of the 2D gym over `field_of_view` [rad], in their own range."""

    def __init__(
        self, course: Course, vehicle: Any, *, beams: int = BEAMS, field_of_view: float = FIELD_OF_VIEW, **settings: Any
    ) -> None:
        self._count, self._field_of_view = beams, field_of_view
        super().__init__(course, vehicle, **settings)

    def make_lidar(self, car: int = 0) -> Lidar:
        """Return the LiDAR, where the car has its own."""
        own = lidar_of(self.model, lidar_prefix(car)).beams
        count, half = self._count, 0.5 * self._field_of_view
        bearings = np.linspace(-half, half, count)
        increment = self._field_of_view / (count - 1)
        beams = replace(
            own, directions=np.column_stack((portable.cos(bearings), portable.sin(bearings), np.zeros(count))),
            origins=np.zeros((count, 3)), bearings=bearings, angle_min=-half, angle_max=half,
            angle_increment=increment, time_increment=own.period * increment / math.tau,
        )  # fmt: skip
        return RaycastLidar(self.model, lidar_prefix(car), beams=beams)


def shifted(pose: Sequence[float], ahead: float) -> tuple[float, float, float]:
    """Return the pose of a point that is so far ahead of that of a pose [m]."""
    x, y, heading = pose
    return x + ahead * math.cos(heading), y + ahead * math.sin(heading), heading
