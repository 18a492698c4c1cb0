"""The interface of f1tenth_gym v1.0 round this simulator, so that a script written for the 2D gym runs in 3D.

    from fg_mujoco import f110 as gym

    env = gym.make("f110_gym:f110-v0", map="maps/aut", map_ext=".png", num_agents=1)
    obs, reward, done, info = env.reset(np.array([[0.0, 0.0, 0.0]]))
    while not done:
        obs, reward, done, info = env.step(np.array([[steering_angle, speed]]))

What is as there: names, shapes, units and order of actions, observations and results; 1080 beams over 4.7 rad, with
noise of 10 mm; a step of 10 ms, after each of which there is a scan; `done` on a collision or after two laps,
`lap_times` that run until then; `map` without its extension; with more cars than one, whose the rows of poses and
actions are, `done` when the ego has collided or all cars have driven two laps, and collisions with other cars.

What is not: this is a car with tires and a suspension. `linear_vels_y` is its lateral velocity, which there is zero.
Poses and velocities are those of the rear axle, and the LiDAR is where it is on the car, 0.275 m ahead of it. Steering
follows its command as the servo lets it; speed follows by the gains of the 2D gym's controller. With linear tires, as
`tires="f1tenth_gym"` puts them on, the car resembles the gym's single-track model: poses and velocities are those of
the centre of gravity, which is near the ground, so that no load moves from tire to tire, and the controller makes up
for the tires' slip and drag, which that model does not have, either. The map's thresholds are honoured. `num_agents` is
1 unless another number is given. Cars that touch push each other and drive on; each carries the box that makes it
visible.

Written afresh from the documentation of f1tenth_gym.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .course.course import Course
from .course.maps.map_track import is_map, read_map
from .course.track import follow
from .display import brief
from .errors import SettingsError, accepted_names
from .lidar.beams import lidar_of
from .lidar.effects import add_noise
from .lidar.lidar import Lidar, RaycastLidar
from .messages import CarParameters, FloatArray, require_whole
from .simulation.cars import WorldCar, first_overlap, lidar_prefix
from .simulation.course_loading import load_track
from .simulation.engine import Engine
from .simulation.settings import Start
from .simulation.simulation import complete_state
from .simulation.world import World
from .vehicle import motion as car_motion
from .vehicle.car import Car
from .vehicle.changes import CarChanges
from .vehicle.speed_controller import SpeedController
from .vehicle.tires import LINEAR, Tires
from .vehicle.vehicle import DEFAULT_VEHICLE, Vehicle

Observation = dict[str, Any]
Motion = tuple[float, float, float, float, float, float]

BEAMS = 1080
FIELD_OF_VIEW = 4.7
"""[rad] From the first beam, the rightmost, to the last."""
SCAN_NOISE = 0.01
"""[m] Standard deviation of each range."""
LAPS = 2
"""After how many an episode is done."""

_STIFFNESSES = {"C_Sf": 4.718, "C_Sr": 5.4562}  # [1/rad] of the 2D gym's linear tires; these here have none to set
_GROUND = 0.002  # [m] height of a centre of gravity near the ground, so that hardly any load moves
_SAME = 0.01  # share by which a parameter may differ from that of the car
_MOST_AGENTS = 8


def make(name: str = "f110_gym:f110-v0", **settings: Any) -> F110Env:
    """Return the environment, as gym.make does; `settings` are those of F110Env.

    Raises:
      SettingsError: another environment's name.
    """
    if name.rpartition(":")[2] != "f110-v0":
        raise SettingsError(f"environment {name!r}; accepted: f110_gym:f110-v0")
    return F110Env(**settings)


class F110Env:
    """Some cars on a map, one by default.

    Args:
      map: path of a map_server YAML without `.yaml`; or whatever `load_track` takes, as `oval` or `random:7`.
      map_ext: of the map's image, as `.png`; None: the image that the YAML names.
      params: the car's physical parameters under the 2D gym's names; all but `mu` must be those of the vehicle.
      num_agents: how many cars, 1 to 8.
      timestep: of a step [s], a multiple of the physics' own of 5 ms.
      ego_idx: the car whose collision ends an episode, from 0.
      seed: of the scans' noise.
      integrator: accepted and not used, for MuJoCo has its own.
      vehicle: of all cars: a bundled name, the path of a vehicle's MJCF file, or a Vehicle; the 2D gym does not have
        this keyword.
      tires: of all cars: a bundled set, as "f1tenth_gym" with the linear tires of the 2D gym's single-track model; the
        path of a TOML file, or Tires. None: the vehicle's; those of the bundled car are MuJoCo's contacts, which let
        go at `mu`, as the gym's never do. The 2D gym does not have this keyword.

    Attributes:
      world: the World; its LiDAR has the 1080 beams.

    Raises:
      SettingsError: no such number of agents, no such ego, or no such tires; a timestep that is no multiple of the
        physics' own, or other parameters than the car has.
      TrackError: a map that cannot be read.
    """

    def __init__(
        self,
        *,
        map: str = "oval",
        map_ext: str | None = None,
        params: dict[str, float] | None = None,
        num_agents: int = 1,
        timestep: float = 0.01,
        ego_idx: int = 0,
        seed: int = 12345,
        integrator: object = None,
        vehicle: Vehicle | str | Path = DEFAULT_VEHICLE,
        tires: Tires | str | Path | None = None,
    ) -> None:
        require_whole("num_agents", num_agents, 1, _MOST_AGENTS)
        require_whole("ego_idx", ego_idx, 0, num_agents - 1)
        self.timestep = float(timestep)
        self._seed = seed
        self._ego, self._agents = ego_idx, range(num_agents)
        self._every = np.ones(num_agents, np.bool_)  # of the engine's rows
        self._map, self._params = (map, map_ext), [params] * num_agents
        self._vehicle = Vehicle.load(vehicle)
        self._tires = self._vehicle.tires if tires is None else Tires.load(tires)
        self._viewer: Any = None
        self._build()

    def __repr__(self) -> str:
        return brief(self, repr(self.world), f"step {self.timestep:g} s")

    @property
    def data(self) -> mujoco.MjData:
        """The world's mujoco.MjData at the present state, which is written when it is asked for: one object."""
        self._engine.read(0, self._data)
        return self._data

    def update_map(self, map_path: str, map_ext: str | None = None) -> None:
        """Drive on another map from the next reset on; arguments as `map` and `map_ext`."""
        self._map = (map_path, map_ext)
        self._build()

    def update_params(self, params: dict[str, float], index: int = -1) -> None:
        """Take other parameters, as `params`, from the next reset on.

        Args:
          params: as of the environment.
          index: of the car that has them; -1: all have.

        Raises:
          SettingsError: no such car, or parameters that the car does not have.
        """
        require_whole("index", index, -1, len(self._agents) - 1)
        self._params = [params if index in (-1, agent) else own for agent, own in enumerate(self._params)]
        self._build()

    def reset(self, poses: ArrayLike) -> tuple[Observation, float, bool, dict[str, Any]]:
        """Place the cars, let them stand for one step, and return what `step` returns.

        Args:
          poses: of the rear axles, or with linear tires of the centres of gravity: x [m], y [m], heading [rad], of
            shape (num_agents, 3).

        Raises:
          SettingsError: another shape, a number that is not finite, or two cars in one place.
        """
        placed = [
            [x - ahead * math.cos(heading), y - ahead * math.sin(heading), heading]
            for ahead, (x, y, heading) in zip(
                self._ahead, self._checked(poses, 3, "poses", "x, y, heading"), strict=True
            )
        ]
        cars = self.world.cars
        pair = first_overlap(placed, [car.parameters for car in cars])
        if pair is not None:
            said = " and ".join(str(placed[agent]) for agent in pair)
            raise SettingsError(
                f"poses of the cars {pair[0]} and {pair[1]} are {said}, where they touch; accepted: poses apart"
            )
        self._engine.place([Start()] * len(cars))
        data = self.data
        for car, pose in zip(cars, placed, strict=True):
            car.set_pose(data, *pose)
        self._engine.load(complete_state(self.world.model, data))
        for controller in self._controllers:
            controller.reset()
        # the noise of a car is the same, however many others there are
        self._noise = [np.random.default_rng([self._seed, agent] if agent else self._seed) for agent in self._agents]
        self._laps = [_LapCount(self.world.track, *pose) for pose in placed]
        return self.step(np.zeros((len(cars), 2)))

    def step(self, action: ArrayLike) -> tuple[Observation, float, bool, dict[str, Any]]:
        """Hold an action for a timestep.

        Args:
          action: steering angle [rad] and speed [m/s] of each car, shape (num_agents, 2), held within its limits.

        Returns:
          The observation, the reward, which is the timestep [s], whether the ego has collided or all cars have driven
          two laps, and `checkpoint_done`, whether each car has driven two laps.

        Raises:
          SettingsError: another shape, or a number that is not finite.
        """
        commands = self._checked(action, 2, "action", "steering angle, speed")
        engine = self._engine
        engine.commands[:] = [self._driven(agent, *command) for agent, command in enumerate(commands)]
        engine.drive()
        engine.sense(self._every)
        time = engine.time(0)
        collided = engine.crashed | engine.unstable(0)
        if len(self._agents) > 1:
            collided |= (engine.touched_at >= time).any(axis=1)
        motions = [self._motion(agent) for agent in self._agents]
        for laps, (x, y, *_) in zip(self._laps, motions, strict=True):
            laps.count(time, x, y)
        finished = np.array([laps.completed >= LAPS for laps in self._laps])
        if self._viewer is not None:
            engine.read(0, self._data)
            self._viewer.sync()
        done = bool(collided[self._ego]) or bool(finished.all())
        return self._observe(motions, collided), self.timestep, done, {"checkpoint_done": finished}

    def render(self, mode: str = "human") -> FloatArray | None:
        """Show the world: "human" or "human_fast" in MuJoCo's viewer, "rgb_array" as a picture (480, 640, 3).

        Raises:
          SettingsError: another mode.
        """
        if mode == "rgb_array":
            with mujoco.Renderer(self.world.model, 480, 640) as renderer:
                camera = mujoco.MjvCamera()
                camera.lookat[:] = (*self._motion(self._ego)[:2], 0.0)
                camera.distance, camera.elevation, camera.azimuth = 8.0, -60.0, 90.0
                renderer.update_scene(self.data, camera)
                picture: FloatArray = renderer.render()
                return picture
        if mode not in ("human", "human_fast"):
            raise SettingsError(f"render mode {mode!r}; accepted: human, human_fast, rgb_array")
        if self._viewer is None:
            from mujoco import viewer

            self._viewer = viewer.launch_passive(self.world.model, self.data)
        return None

    def add_render_callback(self, callback: object) -> None:
        """Take a callback that draws into the 2D gym's window, which is not here: it is never called."""
        warnings.warn("fg_mujoco.f110 never calls render callbacks: they draw into the 2D gym's window", stacklevel=2)

    def close(self) -> None:
        """Close the viewer, if there is one."""
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None

    def _build(self) -> None:
        self.close()
        course = _load(*self._map, self._vehicle.parameters)
        mus = [None if params is None else params.get("mu") for params in self._params]
        single_track = self._tires.model == LINEAR
        changes = CarChanges(center_of_gravity_height=_GROUND) if single_track else CarChanges()
        others = [WorldCar(vehicle=self._vehicle, mu=mu, changes=changes, tires=self._tires) for mu in mus[1:]]
        self.world = _GymWorld(
            course, self._vehicle, mu=mus[0], changes=changes, tires=self._tires, others=others
        )  # fmt: skip
        for params, car in zip(self._params, self.world.cars, strict=True):
            if params is not None:
                _check_parameters(params, car, self._vehicle)
        self._data = mujoco.MjData(self.world.model)
        physics = float(self.world.model.opt.timestep)
        steps = round(self.timestep / physics)
        if steps < 1 or abs(steps * physics - self.timestep) > 1e-9:
            raise SettingsError(f"timestep is {self.timestep} s; accepted: a multiple of the physics' own, {physics} s")
        self._engine = Engine(self.world, period=self.timestep)
        self._qpos, self._qvel = self._engine.qpos(0), self._engine.qvel(0)
        cars = [car.parameters for car in self.world.cars]
        self._ahead = [car.rear_axle_distance if single_track else 0.0 for car in cars]  # [m] of poses, from rear axles
        self._controllers = [
            SpeedController(car, over_ground=single_track, timestep=self.timestep) for car in cars
        ]  # fmt: skip

    def _observe(self, motions: list[Motion], collided: NDArray[np.bool_]) -> Observation:
        x, y, heading, ahead, left, yaw_rate = map(list, zip(*motions, strict=True))
        return {
            "ego_idx": self._ego,
            "scans": [self._scan(agent) for agent in self._agents],
            "poses_x": x,
            "poses_y": y,
            "poses_theta": [angle % math.tau for angle in heading],
            "linear_vels_x": ahead,
            "linear_vels_y": left,
            "ang_vels_z": yaw_rate,
            "collisions": collided.astype(np.float64),
            "lap_times": np.array([laps.time for laps in self._laps]),
            "lap_counts": np.array([float(laps.completed) for laps in self._laps]),
        }

    def _scan(self, agent: int) -> FloatArray:
        """Return a car's ranges, noisy; `range_max` where nothing is, 0 where it is too near. Shape (1080,) [m]."""
        noisy = self._noise[agent].standard_normal(BEAMS)
        add_noise(self._engine.ranges[agent], SCAN_NOISE, self._engine.beams.range_max, noisy)
        return noisy

    def _driven(self, agent: int, steering_angle: float, speed: float) -> tuple[float, float]:
        """Return the command that has the engine drive a car as the 2D gym's controller would."""
        _, _, _, ahead, left, _ = self._motion(agent)
        wheels = car_motion.surface_speed(self._qvel, self.world.cars[agent].constants)
        return steering_angle, self._controllers[agent].set_point(
            speed, wheels, math.copysign(math.hypot(ahead, left), ahead)
        )

    def _motion(self, agent: int) -> Motion:
        """Return a car's pose [m, m, rad], its velocity ahead and to the left [m/s], and its yaw rate [rad/s]."""
        return car_motion.point_motion(self._qpos, self._qvel, self._ahead[agent], self.world.cars[agent].constants)

    def _checked(self, values: ArrayLike, columns: int, name: str, meaning: str) -> list[list[float]]:
        """Return the rows of an array (num_agents, columns) of finite numbers."""
        array, shape = np.asarray(values, dtype=np.float64), (len(self._agents), columns)
        if array.shape != shape or not np.isfinite(array).all():
            raise SettingsError(f"{name} is {array.tolist()}; accepted: finite numbers of shape {shape}, {meaning}")
        rows: list[list[float]] = array.tolist()
        return rows


class _LapCount:
    """Counts the laps of a car by progress in the direction in which it was placed; a scene has none.

    Args:
      track: the course.
      x: where the car is placed [m].
      y: the same [m].
      heading: its own [rad].

    Attributes:
      completed: laps, two at most.
      time: when the last was completed, and until then the present time [s].
    """

    def __init__(self, track: Course, x: float, y: float, heading: float) -> None:
        self._track = track
        self._place = float(track.project([[x, y]])[0][0])
        self._progress = self._greatest_progress = 0.0
        self.completed, self.time = 0, 0.0
        along = track.start_pose(self._place - (track.origin or 0.0))[2]
        self._forward = math.copysign(1.0, math.cos(heading - along))  # laps count in the direction that it looks in

    def count(self, time: float, x: float, y: float) -> None:
        """Take where the car is at a time."""
        if self.completed >= LAPS:
            return
        self.time = time
        track = self._track
        if not track.closed:
            return
        place, _ = follow(x, y, self._place, track.table, track.modulus)
        self._progress += self._forward * math.remainder(place - self._place, track.length)
        self._place = place
        self._greatest_progress = max(self._greatest_progress, self._progress)
        self.completed = int(self._greatest_progress // track.length)


class _GymWorld(World):
    """A world whose LiDAR measures along the 2D gym's beams, in the range of its own."""

    def make_lidar(self, car: int = 0) -> Lidar:
        """Return the LiDAR, where the car has its own."""
        own = lidar_of(self.model, lidar_prefix(car)).beams
        bearings = np.linspace(-0.5 * FIELD_OF_VIEW, 0.5 * FIELD_OF_VIEW, BEAMS)
        increment = FIELD_OF_VIEW / (BEAMS - 1)
        beams = replace(
            own, directions=np.column_stack((np.cos(bearings), np.sin(bearings), np.zeros(BEAMS))),
            origins=np.zeros((BEAMS, 3)), bearings=bearings, angle_min=-0.5 * FIELD_OF_VIEW,
            angle_max=0.5 * FIELD_OF_VIEW, angle_increment=increment,
            time_increment=own.period * increment / math.tau,
        )  # fmt: skip
        return RaycastLidar(self.model, lidar_prefix(car), beams=beams)


def _load(name: str, extension: str | None, car: CarParameters) -> Course:
    """Return the track of a map without its extension, or what `load_track` makes of the name."""
    if is_map(name) and extension is None:
        return load_track(name, car=car)
    path = Path(name if is_map(name) else f"{name}.yaml")
    if extension is not None or path.is_file():
        return read_map(path, image=None if extension is None else path.with_suffix(extension))
    return load_track(name, car=car)


def _check_parameters(params: dict[str, float], tested: Car, vehicle: Vehicle) -> None:
    """Refuse parameters that a car of the world, of that vehicle, does not have."""
    car = tested.parameters
    own = {
        "mu": tested.mu, "lf": car.front_axle_distance, "lr": car.rear_axle_distance, "m": car.mass,
        "h": vehicle.parameters.center_of_gravity_height, "I": car.yaw_inertia, "s_min": -car.max_steering_angle,
        "s_max": car.max_steering_angle, "sv_min": -car.max_steering_rate, "sv_max": car.max_steering_rate,
        "v_switch": car.power_limit_speed, "a_max": car.max_acceleration, "v_min": car.min_speed,
        "v_max": car.max_speed, "width": car.width, "length": car.length, **_STIFFNESSES,
    }  # fmt: skip
    for name, value in params.items():
        if name not in own:
            raise SettingsError(f"params has {name!r}; {accepted_names(name, own)}")
        if not math.isclose(value, own[name], rel_tol=_SAME):
            raise SettingsError(
                f"params[{name!r}] is {value!r}; accepted: {own[name]:.6g}, as {vehicle.name} has it; only mu "
                "can be set here, and `vehicle` gives another car"
            )
