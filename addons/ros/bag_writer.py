"""A run folder as a ROS 2 bag in one MCAP file, which Foxglove, `ros2 bag` and rosbags open.

Its topics are in docs/addons/ros/bags.md. Of several cars, car 0 has these. The others have topics of the same kinds
by their own names, those of f1tenth_gym_ros, /opp_scan, /opp_racecar/odom, /ego_racecar/opp_odom and so on, then
/opp_scan2 and so on, with frames of their own under map.

Times are simulated: a run begins at 0. A message is logged at the tick in which it was delivered; its stamp is the
time of the measurement. The odometry of a run does not drift, so map and odom are one frame.

Sources: MCAP specification, profile ros2; rosbag2's metadata version 8 (QoS); f1tenth_gym_ros, config/sim.yaml and
gym_bridge.py (names).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import mujoco
import numpy as np

from fg_mujoco.course.writing import staged_file
from fg_mujoco.errors import BagError, PlannerError
from fg_mujoco.lidar.point_cloud import PointCaster
from fg_mujoco.messages import DriveCommand
from fg_mujoco.racing.resimulation import Sensed, load_world, recorded_sensors, resimulate
from fg_mujoco.racing.run_folder import Run, read_run
from fg_mujoco.simulation.cars import car_prefix, lidar_prefix
from fg_mujoco.simulation.telemetry import COMMAND
from fg_mujoco.vehicle.car import car_parameters, element_id
from fg_mujoco.vehicle.sensors import Sensor
from fg_mujoco.vehicle.sensors.livox import Mid360

from .bag_messages import (
    BASE_FRAME,
    CLOUD_TOPIC,
    DRIVE,
    GRID,
    IMU,
    IMU_FRAME,
    JOINTS,
    LASER_FRAME,
    MAP_FRAME,
    MOTOR,
    ODOM_FRAME,
    ODOMETRY,
    SCAN,
    TRANSFORMS,
    cloud_messages,
    definition,
    drive_message,
    grid_message,
    imu_message,
    joints_message,
    nanoseconds,
    odometry_message,
    reading_messages,
    require_ros_extra,
    scan_message,
    to_cdr,
    transform_message,
)
from .composed_topics import motor_message
from .occupancy_grid import grid_of

MOTOR_TOPIC = "/sensors/core"
TOPICS = {
    "/scan": SCAN, "/odom": ODOMETRY, "/imu": IMU, "/joint_states": JOINTS, "/drive": DRIVE, "/tf": TRANSFORMS,
    "/tf_static": TRANSFORMS, "/map": GRID, MOTOR_TOPIC: MOTOR,
}  # fmt: skip
LATCHED = ("/tf_static", "/map")
"""Topics whose last message late subscribers get, too: durability "transient local"."""

EGO, OPPONENT = "ego_racecar", "opp_racecar"
"""Namespaces of car 0 and car 1, as f1tenth_gym_ros has them."""

KEPT = (KeyboardInterrupt, PlannerError)
"""Errors that leave what was written up to there."""

_NO_ROTATION = np.array((1.0, 0.0, 0.0, 0.0))
_QOS = (  # rmw's numbers: keep last, reliable; durability 1 transient local, 2 volatile
    "- history: 1\n  depth: {depth}\n  reliability: 1\n  durability: {durability}\n"
    "  deadline:\n    sec: 9223372036\n    nsec: 854775807\n  lifespan:\n    sec: 9223372036\n    nsec: 854775807\n"
    "  liveliness: 1\n  liveliness_lease_duration:\n    sec: 9223372036\n    nsec: 854775807\n"
    "  avoid_ros_namespace_conventions: false"
)


class BagWriter:
    """Writes messages into an MCAP file, which gets its name when it is complete, or ended by an error of KEPT.

    `metadata` are texts to keep in it, by name. Raises MissingExtraError: the extra `ros`; BagError: it cannot be
    written.
    """

    def __init__(self, path: str | Path, metadata: dict[str, str] | None = None) -> None:
        require_ros_extra()
        from mcap.writer import Writer

        self._path = Path(path)
        with self._blame(), ExitStack() as stack:
            self._file = stack.enter_context(stack.enter_context(staged_file(path)).open("wb"))
            self._writer = Writer(self._file)
            self._writer.start(profile="ros2", library="fg_mujoco")
            # without texts of its own, rosbag2 reads QoS as before its version 9: as numbers
            self._writer.add_metadata("rosbag2", {"serialized_metadata": ""})
            if metadata:
                self._writer.add_metadata("fg_mujoco", metadata)
            self._staged = stack.pop_all()
        self._schemas: dict[str, int] = {}
        self._channels: dict[tuple[str, str], int] = {}
        self._counts: dict[str, int] = {}

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        whole = kind is None or issubclass(kind, KEPT)
        with self._blame():
            if not whole:
                self._staged.__exit__(kind, error, trace)  # leaves nothing
                return
            with self._staged:
                self._writer.finish()  # type: ignore[no-untyped-call]

    def write(self, topic: str, message: Any, time: int) -> None:
        """Add a message, logged at `time` [ns]; BagError: the file cannot be written."""
        count = self._counts[topic] = self._counts.get(topic, -1) + 1
        channel = self._channel(topic, message.__msgtype__)
        with self._blame():
            self._writer.add_message(channel, time, to_cdr(message), time, count)

    @contextmanager
    def _blame(self) -> Iterator[None]:
        """Turn an error of writing into one line that names the file."""
        try:
            yield
        except OSError as error:
            reason = error.strerror or error
            raise BagError(f"{self._path}: cannot be written: {reason}; accepted: a file that can be") from error

    def _channel(self, topic: str, kind: str) -> int:
        if (topic, kind) not in self._channels:
            if kind not in self._schemas:
                self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", definition(kind).encode())
            latched = topic in LATCHED
            qos = _QOS.format(depth=1 if latched else 10, durability=1 if latched else 2)
            self._channels[topic, kind] = self._writer.register_channel(
                topic, "cdr", self._schemas[kind], {"offered_qos_profiles": qos}
            )
        return self._channels[topic, kind]


def export_bag(
    folder: str | Path, path: str | Path, watch: Callable[[int, int], None] | None = None
) -> int:
    """Write a run folder as an MCAP file, in place of one that exists, and return how many ticks it has.

    `watch` is called once a tick with its number, from 1, and how many there are. Raises MissingExtraError: the extra
    `ros`; RunFolderError: a folder that is no run's, or damaged; BagError: the file cannot be written.
    """
    require_ros_extra()
    run = read_run(folder)
    world = load_world(run)
    model = world.model
    car = world.parameters
    ticks = len(run.ctrl)
    others = [_Other(run, model, index) for index in range(1, len(world.cars))]
    ends, own_sensors = _Ends.of(run, 0), recorded_sensors(run.summary)
    with BagWriter(path, {"summary": json.dumps(run.summary)}) as bag:
        for index, tick in enumerate(resimulate(run, world), start=1):
            time, sensed = nanoseconds(tick.time), tick.sensed
            if index == 1:
                grid = grid_of(model, sensed.position[:2])
                bag.write("/map", grid_message(time, grid.cells, grid.resolution, grid.origin), time)
                static = car_mounts(model, sensors=own_sensors) + [mount for other in others for mount in other.mounts]
                if others:
                    static.append((BASE_FRAME, f"{EGO}/{BASE_FRAME}", np.zeros(3), _NO_ROTATION))
                bag.write("/tf_static", transform_message(time, static), time)
            if others:
                _write_others(bag, others, index - 1, time, tick.sensed_by_each, ends)
            if index <= ends.leaves:
                moved = (ODOM_FRAME, BASE_FRAME, sensed.position, sensed.quaternion)
                bag.write("/tf", transform_message(time, [moved]), time)
                odometry = odometry_message(sensed.odometry, sensed.position, sensed.quaternion, sensed.lateral_speed)
                bag.write("/odom", odometry, time)
                bag.write("/imu", imu_message(sensed.odometry), time)
                bag.write("/joint_states", joints_message(sensed.odometry, car.wheel_radius), time)
                _write_readings(bag, "", own_sensors, sensed, car.mass, time)
            if index <= ends.drives:
                bag.write("/scan", scan_message(sensed.scan), time)
                bag.write("/drive", drive_message(tick.command, time), time)
            if watch is not None:
                watch(index, ticks)
    return ticks


def car_mounts(
    model: mujoco.MjModel, car: int = 0, sensors: Sequence[Sensor] = ()
) -> list[tuple[str, str, Any, Any]]:
    """Return the transforms of a car that never change; with those of car 0 map and odom are one."""
    within = f"{car_namespace(car)}/" if car else ""
    transforms: list[tuple[str, str, Any, Any]] = []
    if not car:
        transforms.append((MAP_FRAME, ODOM_FRAME, np.zeros(3), _NO_ROTATION))
    for frame, name in ((LASER_FRAME, "lidar_mount"), (IMU_FRAME, "imu")):
        site = element_id(model, mujoco.mjtObj.mjOBJ_SITE, car_prefix(car) + name)
        transforms.append((within + BASE_FRAME, within + frame, model.site_pos[site], model.site_quat[site]))
    if any(isinstance(sensor, Mid360) for sensor in sensors):
        mount = PointCaster(model, lidar_prefix(car)).mount
        mujoco.mju_mat2Quat(turn := np.empty(4), mount.offset_rotation.ravel())
        transforms.append((within + BASE_FRAME, within + Mid360.frame, mount.offset_position, turn))
    return transforms


def car_namespace(car: int) -> str:
    """Return the namespace of a car's frames and topics."""
    return _names(car)[0]


def _names(car: int) -> tuple[str, str, str]:
    """Return the namespace of a car, and its topics of scans and of commands."""
    if not car:
        return EGO, "/scan", "/drive"
    return f"{OPPONENT}{_suffix(car)}", f"/opp_scan{_suffix(car)}", f"/opp_drive{_suffix(car)}"


def _suffix(car: int) -> str:
    """Return what f1tenth_gym_ros appends to the names of the second opponent and those after it."""
    return str(car) if car > 1 else ""


@dataclass(frozen=True, kw_only=True)
class _Ends:
    """Number of ticks of a run in which a car is there."""

    drives: int  # driven by its planner, which gets its scans
    leaves: int  # on the course: one that has finished is taken off

    @classmethod
    def of(cls, run: Run, car: int) -> _Ends:
        """Return those of a car; one that was alone is there to the end."""
        ticks = len(run.ctrl)
        if not run.others:
            return cls(drives=ticks, leaves=ticks)
        row = run.summary["cars"][car]
        drives = int(np.searchsorted(run.time[:-1], float(row["end_time_s"]) - 1e-9))
        return cls(drives=drives, leaves=drives if row["finished"] else ticks)


class _Other:
    """The messages of a car other than car 0."""

    def __init__(self, run: Run, model: mujoco.MjModel, car: int) -> None:
        self.sensors = recorded_sensors(run.summary["cars"][car])
        self.car, self.mounts, self.ends = car, car_mounts(model, car, self.sensors), _Ends.of(run, car)
        self.namespace, self.scans, self.drive = _names(car)
        self.base = f"{self.namespace}/{BASE_FRAME}"
        self.commands = run.others[car - 1][:, COMMAND : COMMAND + 2]
        self.parameters = car_parameters(model, car_prefix(car))


def _write_others(
    bag: BagWriter, others: list[_Other], tick: int, time: int, sensed: Sequence[Sensed], ends: _Ends
) -> None:
    """Write a tick of all cars but car 0, and car 0's odometry by its name among several."""
    if tick < ends.leaves:
        own = _told(sensed[0], f"{EGO}/{BASE_FRAME}")
        for topic in (f"/{EGO}/odom", *(f"/{other.namespace}/opp_odom" for other in others)):
            bag.write(topic, own, time)
    moved = []
    for other in others:
        if tick >= other.ends.leaves:
            continue
        seen, name = sensed[other.car], other.namespace
        moved.append((MAP_FRAME, other.base, seen.position, seen.quaternion))
        odometry = _told(seen, other.base)
        bag.write(f"/{name}/odom", odometry, time)
        bag.write(f"/{EGO}/opp_odom{_suffix(other.car)}", odometry, time)
        bag.write(f"/{name}/imu", imu_message(seen.odometry, f"{name}/{IMU_FRAME}"), time)
        car = other.parameters
        bag.write(f"/{name}/joint_states", joints_message(seen.odometry, car.wheel_radius, other.base), time)
        _write_readings(bag, f"/{name}", other.sensors, seen, car.mass, time)
        if tick < other.ends.drives:
            bag.write(other.scans, scan_message(seen.scan, f"{name}/{LASER_FRAME}"), time)
            steering_angle, speed = other.commands[tick].tolist()
            command = DriveCommand(steering_angle=steering_angle, speed=speed)
            bag.write(other.drive, drive_message(command, time, other.base), time)
    if moved:
        bag.write("/tf", transform_message(time, moved), time)


def _write_readings(
    bag: BagWriter, namespace: str, sensors: Sequence[Sensor], sensed: Sensed, mass: float, time: int
) -> None:
    """Write the motor's state and what each sensor of a car has delivered, in frames of the car's namespace."""
    if MOTOR_TOPIC not in {f"/sensors/{sensor.name}" for sensor in sensors}:  # one of that name goes before
        bag.write(f"{namespace}{MOTOR_TOPIC}", motor_message(sensed.odometry, mass), time)
    for sensor in sensors:
        within = "" if sensor.frame in (MAP_FRAME, ODOM_FRAME) or not namespace else f"{namespace[1:]}/"
        of_livox = isinstance(sensor, Mid360)
        topic = CLOUD_TOPIC if of_livox and sensor.name == sensor.kind else f"/sensors/{sensor.name}"
        messages = cloud_messages if of_livox else reading_messages
        for message in messages(sensed.odometry.readings[sensor.name], within + sensor.frame):
            bag.write(namespace + topic, message, time)


def _told(sensed: Sensed, child: str) -> Any:
    """Return the odometry of a car on the map."""
    return odometry_message(
        sensed.odometry, sensed.position, sensed.quaternion, sensed.lateral_speed, frame=MAP_FRAME, child=child
    )  # fmt: skip
