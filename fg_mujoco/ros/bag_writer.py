"""A run folder as a ROS 2 bag in one MCAP file, which Foxglove, `ros2 bag` and rosbags open.

    export_bag("runs/oval", "oval.mcap")

    /scan          sensor_msgs/LaserScan                 measured again (resimulation), frame laser
    /odom          nav_msgs/Odometry                     odom -> base_link
    /imu           sensor_msgs/Imu                       frame imu
    /joint_states  sensor_msgs/JointState                steering angle, turning rates of the wheels
    /drive         ackermann_msgs/AckermannDriveStamped  the planner's command
    /tf            tf2_msgs/TFMessage                    odom -> base_link
    /tf_static     tf2_msgs/TFMessage                    map -> odom, base_link -> laser, base_link -> imu; latched
    /map           nav_msgs/OccupancyGrid                frame map; latched

Times are simulated: a run begins at 0. A message is logged at the tick in which it was delivered; its stamp is the
time of the measurement. The odometry of a run does not drift, so map and odom are one frame.

Sources: MCAP specification, profile ros2; rosbag2's metadata version 8 (QoS).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any

import mujoco
import numpy as np

from ..course.writing import staged_file
from ..errors import BagError, PlannerError
from ..racing.resimulation import load_world, resimulate
from ..racing.run_folder import read_run
from ..simulation.cars import CAR_PREFIX
from ..vehicle.car import element_id
from .bag_messages import (
    BASE_FRAME,
    DRIVE,
    GRID,
    IMU,
    IMU_FRAME,
    JOINTS,
    LASER_FRAME,
    MAP_FRAME,
    ODOM_FRAME,
    ODOMETRY,
    SCAN,
    TRANSFORMS,
    definition,
    drive_message,
    grid_message,
    imu_message,
    joints_message,
    nanoseconds,
    odometry_message,
    require_ros_extra,
    scan_message,
    to_cdr,
    transform_message,
)
from .grid import grid_of

TOPICS = {
    "/scan": SCAN, "/odom": ODOMETRY, "/imu": IMU, "/joint_states": JOINTS, "/drive": DRIVE, "/tf": TRANSFORMS,
    "/tf_static": TRANSFORMS, "/map": GRID,
}  # fmt: skip
LATCHED = ("/tf_static", "/map")
"""Topics whose last message late subscribers get, too: durability "transient local"."""

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

    Args:
      path: of the file; one that exists is replaced.
      metadata: texts to keep in it, by name.

    Raises:
      MissingExtraError: the extra `ros` is not installed.
      BagError: the file cannot be written.
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
        self._channels: dict[str, int] = {}
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
        """Add a message, logged at `time` [ns].

        Raises:
          BagError: the file cannot be written.
        """
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
        if topic not in self._channels:
            if kind not in self._schemas:
                self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", definition(kind).encode())
            latched = topic in LATCHED
            qos = _QOS.format(depth=1 if latched else 10, durability=1 if latched else 2)
            self._channels[topic] = self._writer.register_channel(
                topic, "cdr", self._schemas[kind], {"offered_qos_profiles": qos}
            )
        return self._channels[topic]


def export_bag(folder: str | Path, path: str | Path, watch: Callable[[int, int], None] | None = None) -> int:
    """Write a run folder as a bag, and return how many ticks it has.

    Args:
      folder: as `race --out` wrote it.
      path: of the MCAP file; one that exists is replaced.
      watch: called once a tick with its number, from 1, and how many there are.

    Raises:
      MissingExtraError: the extra `ros` is not installed.
      RunFolderError: the folder is not a run's, or is damaged.
      BagError: the file cannot be written.
    """
    require_ros_extra()
    run = read_run(folder)
    world = load_world(run)
    model = world.model
    radius = world.parameters.wheel_radius
    ticks = len(run.ctrl)
    with BagWriter(path, {"summary": json.dumps(run.summary)}) as bag:
        for index, tick in enumerate(resimulate(run, world), start=1):
            time, sensed = nanoseconds(tick.time), tick.sensed
            assert sensed is not None
            if index == 1:
                grid = grid_of(model, sensed.position[:2])
                bag.write("/map", grid_message(time, grid.cells, grid.resolution, grid.origin), time)
                bag.write("/tf_static", transform_message(time, _mounts(model)), time)
            moved = (ODOM_FRAME, BASE_FRAME, sensed.position, sensed.quaternion)
            bag.write("/tf", transform_message(time, [moved]), time)
            odometry = odometry_message(sensed.odometry, sensed.position, sensed.quaternion, sensed.lateral_speed)
            bag.write("/odom", odometry, time)
            bag.write("/imu", imu_message(sensed.odometry), time)
            bag.write("/joint_states", joints_message(sensed.odometry, radius), time)
            bag.write("/scan", scan_message(sensed.scan), time)
            bag.write("/drive", drive_message(tick.command, time), time)
            if watch is not None:
                watch(index, ticks)
    return ticks


def _mounts(model: mujoco.MjModel) -> list[tuple[str, str, Any, Any]]:
    """Return the transforms that never change."""
    transforms: list[tuple[str, str, Any, Any]] = [(MAP_FRAME, ODOM_FRAME, np.zeros(3), _NO_ROTATION)]
    for frame, name in ((LASER_FRAME, "lidar_mount"), (IMU_FRAME, "imu")):
        site = element_id(model, mujoco.mjtObj.mjOBJ_SITE, CAR_PREFIX + name)
        transforms.append((BASE_FRAME, frame, model.site_pos[site], model.site_quat[site]))
    return transforms
