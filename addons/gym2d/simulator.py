"""`env.sim` of f1tenth_gym: the cars, by the names under which planners and wrappers read them.

What a script writes into a car's `state` is where the car goes on from at the next step.
"""

from __future__ import annotations

import math
import re
import sys
import warnings
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fg_mujoco import portable
from fg_mujoco.course.course import Course
from fg_mujoco.display import brief
from fg_mujoco.errors import SettingsError, accepted_names
from fg_mujoco.messages import FloatArray, shown
from fg_mujoco.simulation.cars import WorldCar
from fg_mujoco.simulation.settings import FURTHEST
from fg_mujoco.vehicle.tires import Tires
from fg_mujoco.vehicle.vehicle import DEFAULT_VEHICLE, Vehicle

from .gym_track import Track
from .gym_world import BEAMS, FIELD_OF_VIEW, Driving, ScanErrors, shifted
from .maps import find_map
from .params import all_params, car_of, mapping, number, physics_timestep, whole

MOST_AGENTS, MOST_BEAMS = 8, 20_000

MODELS = {"ks": "kinematic", "st": "single-track", "mb": "multi-body", "std": "single-track drift"}
"""Car models of the gym; the car here is a MuJoCo model, whichever is asked for."""


class Integrator(Enum):
    """Integrators of the gym. MuJoCo has its own, `implicitfast`, so that both drive alike here."""

    RK4 = 1
    Euler = 2

    @property
    def type(self) -> str:
        """Its name in the gym's settings."""
        return self.name.lower()

    @staticmethod
    def from_string(integrator: str) -> Integrator:
        """Return the integrator of a name, rk4 or euler; ValueError: another name."""
        named = {each.type: each for each in Integrator}
        if integrator not in named:
            raise SettingsError(f"integrator is {integrator!r}; {accepted_names(integrator, named)}")
        return named[integrator]


class DynamicModel(Enum):
    """Car models of the gym."""

    KS = 1
    ST = 2
    MB = 3
    STD = 4

    state_dim = property(lambda self: {"KS": 5, "ST": 7, "MB": 29, "STD": 9}[self.name])

    @staticmethod
    def from_string(model: str) -> DynamicModel:
        """Return the model of a name, as `st`; SettingsError: another name."""
        if str(model).lower() not in MODELS:
            raise SettingsError(f"model is {shown(model)}; {accepted_names(model, MODELS)}")
        return DynamicModel[str(model).upper()]

    @staticmethod
    def of(model: Any) -> DynamicModel:
        """Return the model of a name, or of a member of this or of the gym's own enumeration; else SettingsError."""
        return DynamicModel.from_string(getattr(model, "name", model))


class Simulator:
    """The cars of an environment on a map, by the attributes and arguments of f1tenth_gym's.

    `integrator`, `model` and `action_type` are kept; MuJoCo integrates, and the car is its model. `lidar_dist` [m] is
    ahead of the rear axle; None: where the vehicle has it. `noise_std` [m] is of each range, and `errors` has further
    settings of ScanErrors. `driving` is the Driving that the cars are in; None: there is no map yet.
    Raises SettingsError: no such number of cars, no such ego, or parameters that are no numbers.
    """

    def __init__(
        self,
        params: dict[str, Any] | None = None,
        num_agents: int = 2,
        seed: int = 12345,
        action_type: Any = None,
        integrator: Any = Integrator.RK4,
        model: Any = DynamicModel.ST,
        time_step: float = 0.01,
        ego_idx: int = 0,
        lidar_dist: float | None = None,
        *,
        num_beams: int = BEAMS,
        fov: float = FIELD_OF_VIEW,
        noise_std: float | None = None,
        errors: Mapping[str, Any] | None = None,
        vehicle: Vehicle | str | Path = DEFAULT_VEHICLE,
        tires: Tires | str | Path | None = None,
        maps: str | Path | None = None,
        **_: Any,
    ) -> None:
        num_agents = whole("num_agents", num_agents, 1, MOST_AGENTS)
        ego_idx = whole("ego_idx", ego_idx, 0, num_agents - 1)
        seed, num_beams = whole("seed", seed, 0), whole("num_beams", num_beams, 2, MOST_BEAMS)
        fov = number("fov", fov, 1e-3, math.tau)
        lidar_dist = None if lidar_dist is None else number("lidar_dist", lidar_dist)
        params = None if params is None else mapping("params", params)
        if maps is not None and not isinstance(maps, (str, Path)):
            raise SettingsError(f"maps is {shown(maps)}; accepted: a folder")
        self.num_agents, self.seed, self.ego_idx = num_agents, seed, ego_idx
        self.time_step = number("timestep", time_step)
        self.integrator, self.model, self.action_type = integrator, model, action_type
        self.num_beams, self.fov, self.lidar_dist = num_beams, fov, lidar_dist
        self._errors = ScanErrors(noise_std=noise_std, **(errors or {}))
        self._vehicle, self._tires = Vehicle.load(vehicle), None if tires is None else Tires.load(tires)
        self._maps = maps
        self.params = all_params(params, self._vehicle)
        self.agent_params = [self.params] * num_agents
        self._params_of: list[dict[str, Any] | None] = [params] * num_agents
        self._known_params = [dict(self.params)] * num_agents
        self._physics = physics_timestep(self.time_step, self._vehicle)
        self._builds = self._cars()
        self.driving: Driving | None = None
        self.map_file: Path | None = None
        self.course: Course | None = None
        self._own_track: Track | None = None
        self._scale = 1.0
        self.agent_scans: list[FloatArray] = [np.zeros(num_beams)] * num_agents
        self.collisions = np.zeros(num_agents)
        self.read: list[RaceCar] = []
        self.agents = [RaceCar.of(self, agent) for agent in range(num_agents)]
        self.agents[0].share()

    def __repr__(self) -> str:
        return brief(self, f"{self.num_agents} cars", repr(self.driving))

    @property
    def vehicle(self) -> Vehicle:
        """That the parameters change."""
        return self._vehicle

    @property
    def agent_poses(self) -> FloatArray:
        """Poses of the cars after the last step, (num_agents, 3)."""
        motions = self.driving.motions if self.driving is not None else []
        if len(motions) != self.num_agents:
            return np.zeros((self.num_agents, 3))
        poses = np.array(motions)[:, :3]
        poses[:, 2] = poses[:, 2] % math.tau % math.tau  # once alone makes 2 pi of -1e-17
        return poses

    @property
    def collision_idx(self) -> FloatArray:
        """With which car each car touches after the last step, else -1, (num_agents,)."""
        if self.driving is None:
            return np.full(self.num_agents, -1.0)
        touched = self.driving.engine.touched_at >= self.driving.time
        return np.where(touched.any(axis=1), touched.argmax(axis=1), -1).astype(np.float64)

    @property
    def state(self) -> SimulatorState:
        """All of the cars after the last step."""
        return SimulatorState(self)

    @property
    def track(self) -> Track:
        """The map with its lines."""
        if self._own_track is None:
            assert self.course is not None
            self._own_track = Track.of(self.course, self.map_file, self._scale)
        return self._own_track

    @property
    def agent_steerings(self) -> FloatArray:
        """Steering angles of the cars (num_agents,) [rad]."""
        return np.array([agent.state[2] for agent in self.agents])

    def set_map(self, map: Any, map_ext: str | float | None = None) -> None:
        """Drive on another map, a path, a name or a Track, from the next reset on.

        `map_ext` is of its image, as `.png`, None the image that the YAML names, and a number by which the map is
        larger. Raises SettingsError: a map or an extension of another kind.
        """
        named = isinstance(map_ext, str) and (not map_ext or re.fullmatch(r"\.?\w{1,20}", map_ext))
        if not (map_ext is None or named or isinstance(map_ext, (int, float))):
            raise SettingsError(f"map_ext is {shown(map_ext)}; accepted: an ending such as '.png'")
        scale = number("scale", map_ext, 0.01, 100.0) if isinstance(map_ext, (int, float)) else 1.0
        extension = map_ext if isinstance(map_ext, str) else None
        if not isinstance(map, (str, Path, Track)):
            raise SettingsError(f"map is {shown(map)}; accepted: a path, a name, or a Track")
        self._own_track, self._scale = map if isinstance(map, Track) else None, scale
        if isinstance(map, Track):
            assert map.course is not None
            self.course, self.map_file = map.course, map._file
        else:
            self.course, self.map_file = find_map(
                str(map), extension, folder=self._maps, scale=scale, car=self._vehicle.parameters
            )
        self._build()

    def update_params(self, params: dict[str, Any], agent_idx: int = -1) -> None:
        """Take other parameters from the next reset on, of one car or, with -1, of all; errors as RaceEnvironment's."""
        whole("index", agent_idx, -1, self.num_agents - 1)
        taken = all_params(mapping("params", params), self._vehicle)
        if agent_idx == -1:
            self.params = taken
        for agent in range(self.num_agents):
            if agent_idx in (-1, agent):
                self._params_of[agent], self.agent_params[agent] = params, taken
                self._known_params[agent] = dict(taken)
        self._rebuild()

    def _heed_params(self) -> None:
        """Take what a script has written into the dictionaries of parameters since they were taken."""
        if self.agent_params == self._known_params:
            return
        for agent, (own, known) in enumerate(zip(self.agent_params, self._known_params, strict=True)):
            if own != known:
                self._params_of[agent] = self._known_params[agent] = dict(own)
        self._rebuild()

    def _rebuild(self) -> None:
        """Build the cars, where their parameters make others of them."""
        builds = self._cars()
        if builds != self._builds:
            self._builds = builds
            if self.course is not None:
                self._build()

    def reset(self, poses: ArrayLike) -> None:
        """Place the cars at poses (num_agents, 3) [m, m, rad], without a map on open ground.

        Raises SettingsError: no poses.
        """
        placed = checked(poses, self.num_agents, 3, "poses", "x, y, heading", most=FURTHEST)
        if self.course is None:
            self.set_map(Track.from_refline([0.0, 10.0], [0.0, 0.0], [1.0, 1.0]))  # open ground, as a gym without a map
        self._take_scanner()
        self._heed_params()
        assert self.driving is not None
        self.driving.place(placed)
        self.collisions = np.zeros(self.num_agents)
        while self.read:
            self.read.pop().forget()

    def step(self, control_inputs: ArrayLike) -> dict[str, Any]:
        """Hold steering angle [rad] and speed [m/s] (num_agents, 2) for a step; return what is observed.

        Raises SettingsError.
        """
        commands = checked(control_inputs, self.num_agents, 2, "action", "steering angle, speed")
        driving = self.driving
        if driving is None or not driving.laps:
            raise SettingsError("a step before a reset; accepted: reset first")
        self.write_back()
        collided = driving.drive(commands)
        self.collisions = collided.astype(np.float64)
        self.agent_scans = [driving.scan(agent) for agent in range(self.num_agents)]
        x, y, heading, ahead, left, yaw_rate = map(list, zip(*driving.motions, strict=True))
        return {
            "ego_idx": self.ego_idx,
            "scans": self.agent_scans,
            "poses_x": x,
            "poses_y": y,
            "poses_theta": [angle % math.tau % math.tau for angle in heading],
            "linear_vels_x": ahead,
            "linear_vels_y": left,
            "ang_vels_z": yaw_rate,
            "collisions": self.collisions,
        }

    def write_back(self) -> None:
        """Put the cars where a script has written that they are."""
        while self.read:
            self.read.pop().write_back()

    def _cars(self) -> list[WorldCar]:
        return [
            car_of(params, self._vehicle, tires=self._tires, lidar_dist=self.lidar_dist) for params in self._params_of
        ]

    def _take_scanner(self) -> None:
        """Measure by the beams of the scanner that a script has put into the class RaceCar, where it has put one."""
        scanner = RaceCar.scan_simulator
        if not isinstance(scanner, ScanSimulator2D) or scanner.of_cars:
            return
        if (scanner.num_beams, scanner.fov) != (self.num_beams, self.fov):
            self.num_beams, self.fov = scanner.num_beams, scanner.fov
            self.agent_scans = [np.zeros(self.num_beams)] * self.num_agents
            for agent in self.agents:
                agent.take_beams()
            self._build()

    def _build(self) -> None:
        assert self.course is not None
        self.driving = Driving(
            self.course, self._builds, timestep=self.time_step, physics=self._physics, seed=self.seed,
            beams=self.num_beams, field_of_view=self.fov, errors=self._errors,
        )  # fmt: skip


class SimulatorState:
    """`sim.state` of the later releases: of all cars after the last step, copies, the states as RaceCar has them."""

    def __init__(self, sim: Simulator) -> None:
        self.poses, self.scans, self.collisions = sim.agent_poses, np.array(sim.agent_scans), sim.collisions.copy()
        self.sim_time = 0.0 if sim.driving is None else sim.driving.time
        self._sim, placed = sim, sim.driving is not None and sim.driving.laps
        self.standard_state = np.array([agent.state if placed else np.zeros(7) for agent in sim.agents])
        self.state = self.standard_state.copy()

    @property
    def frenet(self) -> FloatArray:
        """Progress on the centreline [m], offset to its left [m] and relative heading [rad], (num_agents, 3)."""
        return np.array([self._sim.track.cartesian_to_frenet(*pose) for pose in self.poses.tolist()])


class RaceCar:
    """One car of a Simulator, as planners read it. A car that a script makes has a Simulator of its own.

    In the gym all cars have the beams of the class. A ScanSimulator2D that a script puts into the class is heeded: the
    next reset of a Simulator takes its number of beams and its field of view. `side_distances` (beams,) [m] are from
    the car's middle to its edge, along each beam.
    """

    scan_simulator: Any = None
    scan_angles: FloatArray = np.zeros(0)
    cosines: FloatArray = np.zeros(0)
    side_distances: FloatArray = np.zeros(0)
    _kept: FloatArray | None = None
    _read: FloatArray | None = None

    _sim: Simulator
    _index: int
    num_beams: int
    fov: float
    time_step: float
    seed: int
    is_ego: bool
    integrator: Any
    model: Any
    accel: float
    steer_angle_vel: float

    def __init__(self, params: dict[str, Any] | None = None, seed: int = 12345, *_: Any, **settings: Any) -> None:
        self._join(Simulator(params, 1, seed, **settings), 0)
        self._sim.agents = [self]
        self.is_ego = bool(settings.get("is_ego", False))

    @classmethod
    def of(cls, sim: Simulator, index: int) -> RaceCar:
        """Return a car of a simulator."""
        car = cls.__new__(cls)
        car._join(sim, index)
        return car

    def _join(self, sim: Simulator, index: int) -> None:
        self._sim, self._index, self.time_step, self.seed = sim, index, sim.time_step, sim.seed
        self.is_ego, self.integrator, self.model = index == sim.ego_idx, sim.integrator, sim.model
        self.accel = self.steer_angle_vel = 0.0
        self.take_beams()

    def take_beams(self) -> None:
        """Have the beams of its Simulator."""
        sim, params = self._sim, self.params
        self.num_beams, self.fov = sim.num_beams, sim.fov
        self.scan_angles = np.linspace(-0.5 * sim.fov, 0.5 * sim.fov, sim.num_beams)
        self.cosines = portable.cos(self.scan_angles)
        with np.errstate(divide="ignore"):  # to the edge of the car, along each beam
            to_side = 0.5 * params["width"] / np.abs(portable.sin(self.scan_angles))
            to_end = 0.5 * (params["lf"] + params["lr"]) / np.abs(self.cosines)
        self.side_distances = np.minimum(to_side, to_end)
        self.scan_simulator = ScanSimulator2D(sim.num_beams, sim.fov, seed=sim.seed, sim=sim)

    def share(self) -> None:
        """Let the class have its scanner and its beams, too, where scripts read and set them."""
        scanner = RaceCar.scan_simulator
        if scanner is None or getattr(scanner, "of_cars", False):
            RaceCar.scan_simulator, RaceCar.scan_angles = self.scan_simulator, self.scan_angles
            RaceCar.cosines, RaceCar.side_distances = self.cosines, self.side_distances

    def __repr__(self) -> str:
        return brief(self, f"car {self._index}")

    @property
    def params(self) -> dict[str, Any]:
        """Its parameters, by the gym's names; what a script writes into them holds from the next reset on."""
        return self._sim.agent_params[self._index]

    @property
    def state(self) -> FloatArray:
        """x, y [m], steering angle [rad], speed [m/s], heading, yaw rate, slip angle. (7,), one array until a step."""
        if self._read is None:
            driving = self._sim.driving
            placed = driving is not None and bool(driving.laps)
            self._read = driving.state(self._index) if placed and driving is not None else np.zeros(7)
            self._kept = self._read.copy()
            self._sim.read.append(self)
        return self._read

    @state.setter
    def state(self, values: ArrayLike) -> None:
        self.state[:] = np.asarray(values, np.float64).ravel()[:7]

    @property
    def standard_state(self) -> StandardState:
        """The same, by index or by name: x, y, delta, v_x, v_y, yaw, yaw_rate, slip."""
        return StandardState(self.state)

    @property
    def in_collision(self) -> bool:
        """Whether it touched something in the last step."""
        return bool(self._sim.collisions[self._index])

    @property
    def opp_poses(self) -> FloatArray:
        """Poses of the other cars, (num_agents - 1, 3)."""
        return np.delete(self._sim.agent_poses, self._index, axis=0)

    @property
    def current_scan(self) -> FloatArray:
        """The last scan."""
        return self._sim.agent_scans[self._index]

    def set_map(self, map_path: Any, map_ext: Any = None) -> None:
        """Drive on another map, as of the Simulator."""
        self._sim.set_map(map_path, map_ext)

    def update_params(self, params: dict[str, Any]) -> None:
        """Take other parameters, as of the Simulator."""
        self._sim.update_params(params, self._index)

    def reset(self, pose: ArrayLike) -> None:
        """Go on from a standstill at a pose (3,)."""
        x, y, heading = (float(value) for value in np.asarray(pose, np.float64).ravel()[:3])
        sim = self._sim
        if sim.num_agents == 1 and (sim.driving is None or not sim.driving.laps):
            sim.reset([[x, y, heading]])
            return
        self.state = np.array([x, y, 0.0, 0.0, heading, 0.0, 0.0])

    def update_pose(self, raw_steer: float, vel: float) -> FloatArray:
        """Drive a car of its own at [rad], [m/s] for a step, and return its scan; SettingsError: others are there."""
        if self._sim.num_agents != 1:
            raise SettingsError("update_pose of a car among others; accepted: step of their Simulator")
        scan: FloatArray = self._sim.step([[raw_steer, vel]])["scans"][0]
        return scan

    def forget(self) -> None:
        """Drop what was read and written."""
        self._read = self._kept = None

    def write_back(self) -> None:
        """Put the car where a script has written that it is."""
        if self._read is None or self._kept is None:
            return
        if not np.array_equal(self._read, self._kept):
            driving = self._sim.driving
            assert driving is not None
            driving.put(self._index, self._read.tolist())
        self.forget()


class StandardState(np.ndarray[Any, np.dtype[np.float64]]):
    """A state (7,) that can be read by name, too."""

    _PLACES = ("x", "y", "delta", "v", "yaw", "yaw_rate", "slip")

    def __new__(cls, state: FloatArray) -> StandardState:
        """Return a state as a copy."""
        return state.copy().view(cls)

    def __getitem__(self, key: Any) -> Any:
        if not isinstance(key, str):
            return super().__getitem__(key)
        speed, slip = float(super().__getitem__(3)), float(super().__getitem__(6))
        if key in ("v_x", "v_y"):
            return speed if key == "v_x" else speed * math.tan(slip)
        if key not in self._PLACES:
            raise KeyError(f"{key!r}; {accepted_names(key, (*self._PLACES, 'v_x', 'v_y'))}")
        return float(super().__getitem__(self._PLACES.index(key)))


class ScanSimulator2D:
    """Measures scans from any pose of a map: the LiDAR stands at the pose.

    `eps`, `theta_dis` and `max_range` are accepted as in the gym; the greatest range is the LiDAR's own. `of_cars` says
    whether it is a Simulator's own.
    """

    def __init__(
        self,
        num_beams: int = BEAMS,
        fov: float = FIELD_OF_VIEW,
        eps: float = 1e-4,
        theta_dis: int = 2000,
        max_range: float = 30.0,
        seed: int = 12345,
        sim: Simulator | None = None,
        **_: Any,
    ) -> None:
        self.num_beams, self.fov, self.eps, self.theta_dis = num_beams, fov, eps, theta_dis
        self.max_range = Vehicle.load().lidar.beams.range_max if sim is not None else max_range
        self.angle_increment = fov / (num_beams - 1)
        self.scan_rng = np.random.default_rng(seed)
        self._sim, self._driving, self.of_cars = sim, None, sim is not None

    _driving: Driving | None

    def set_map(self, map_path: Any, map_ext: Any = None) -> bool:
        """Measure on another map; arguments as of the Simulator."""
        self._sim = Simulator(None, 1, num_beams=self.num_beams, fov=self.fov)
        self._sim.set_map(map_path, map_ext)
        self._driving = None
        return True

    def scan(self, pose: ArrayLike, rng: np.random.Generator | None = None, std_dev: float = 0.01) -> FloatArray:
        """Return the ranges (beams,) [m] from a pose x, y, heading; with a generator, noisy."""
        if self._sim is None or self._sim.course is None:
            raise SettingsError("a ScanSimulator2D without a map; accepted: set_map first")
        if self._driving is None or self._driving.world.track is not self._sim.course:
            self._driving = Driving(
                self._sim.course, [WorldCar(vehicle=self._sim.vehicle)], timestep=0.05, beams=self.num_beams,
                field_of_view=self.fov,
            )  # fmt: skip
        back = self._driving.ahead[0] - self._driving.world.car.parameters.lidar_offset
        self._driving.place([shifted(np.asarray(pose, np.float64).ravel()[:3].tolist(), back)])
        self._driving.engine.sense(np.ones(1, np.bool_))
        ranges: FloatArray = np.clip(self._driving.engine.ranges[0], 0.0, self.max_range)
        return ranges if rng is None else ranges + rng.normal(0.0, std_dev, self.num_beams)

    def get_increment(self) -> float:
        """Return the angle from a beam to the next [rad]."""
        return self.angle_increment


def checked(
    values: ArrayLike, count: int, columns: int, name: str, meaning: str, *, most: float = sys.float_info.max
) -> list[list[float]]:
    """Return the rows of an array (count, columns) of finite numbers of at most `most`; else SettingsError."""
    shape = (count, columns)
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        accepted = f"finite numbers of shape {shape}, {meaning}"
        raise SettingsError(f"{name} is {shown(values)}; accepted: {accepted}") from error
    if array.shape != shape or not (np.abs(array) <= most).all():
        up_to = "" if most == sys.float_info.max else f" up to {most:g}"
        raise SettingsError(f"{name} is {array.tolist()}; accepted: finite numbers{up_to} of shape {shape}, {meaning}")
    rows: list[list[float]] = array.tolist()
    return rows


def say_of_model(model: DynamicModel) -> None:
    """Warn that a model other than the single-track one is not here."""
    if model is not DynamicModel.ST:
        name = model.name.lower()
        warnings.warn(
            f"model {name!r} ({MODELS[name]}) is not here: the car is a MuJoCo model with tires", stacklevel=3
        )
