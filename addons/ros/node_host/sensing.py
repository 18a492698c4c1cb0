"""Messages of what the car senses, under the names of f1tenth_gym_ros and f1tenth_system.

Only those are made that a node listens to. Frames are `map`, `odom`, `base_link` and `laser`, and those of
f1tenth_gym_ros, `ego_racecar/base_link` and `ego_racecar/laser`, which lie on them.
"""

from __future__ import annotations

import array
import math
import re
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from types import SimpleNamespace
from typing import Any

import numpy as np

from fg_mujoco.course.lap_timer import LapTimer
from fg_mujoco.lidar.lidar import MID360
from fg_mujoco.lidar.point_cloud import Sheet
from fg_mujoco.messages import CarParameters, LaserScan, Odometry, Reading
from fg_mujoco.simulation.planner_adapter import Surroundings
from fg_mujoco.simulation.world import World
from fg_mujoco.vehicle.sensors.livox import Mid360

from ..bag_messages import (
    BASE_FRAME,
    CLOUD,
    CLOUD_TOPIC,
    IMU_FRAME,
    LASER_FRAME,
    MAP_FRAME,
    ODOM_FRAME,
    as_imu_tells,
    cloud_parts,
    nanoseconds,
)
from ..composed_topics import RANGE_MAX, RANGE_MIN, STEERING, THROTTLE, cars_in, motor_fields
from ..front_camera import FIELD_OF_VIEW, SIZE, FrontCamera
from ..occupancy_grid import Grid, grid_of
from .graph import BEGIN, NANOSECONDS, Graph
from .message_classes import made, message_class
from .transform_modules import matrix

_ODOMETRY = "nav_msgs/msg/Odometry"
_FLOAT, _COUNT, _TRUTH = "std_msgs/msg/Float32", "std_msgs/msg/Int32", "std_msgs/msg/Bool"
_IMAGE, _LENS = "sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo"

TOPICS: dict[str, tuple[str, str]] = {
    "/clock": ("rosgraph_msgs/msg/Clock", "clock"),
    "/scan": ("sensor_msgs/msg/LaserScan", "scan"),
    CLOUD_TOPIC: (CLOUD, "points"),
    "/tf": ("tf2_msgs/msg/TFMessage", "transforms"),
    "/map": ("nav_msgs/msg/OccupancyGrid", "map"),
    "/map_metadata": ("nav_msgs/msg/MapMetaData", "map_info"),
    "/imu": ("sensor_msgs/msg/Imu", "imu"),
    "/imu/data": ("sensor_msgs/msg/Imu", "imu"),
    "/sensors/imu/raw": ("sensor_msgs/msg/Imu", "imu"),
    "/sensors/core": ("vesc_msgs/msg/VescStateStamped", "vesc_state"),
    "/vesc/sensors/core": ("vesc_msgs/msg/VescStateStamped", "vesc_state"),
    "/odom": (_ODOMETRY, "odometry"),
    "/ego_racecar/odom": (_ODOMETRY, "odometry_on_map"),
    "/vesc/odom": (_ODOMETRY, "odometry"),
    "/pf/pose/odom": (_ODOMETRY, "localised"),
    "/pf/viz/inferred_pose": ("geometry_msgs/msg/PoseStamped", "pose"),
    "/gt_pose": ("geometry_msgs/msg/PoseStamped", "pose"),
    "/amcl_pose": ("geometry_msgs/msg/PoseWithCovarianceStamped", "pose_with_covariance"),
    **{f"{camera}/image_raw": (_IMAGE, "image") for camera in ("/camera", "/camera/color")},
    **{f"{camera}/camera_info": (_LENS, "lens") for camera in ("/camera", "/camera/color")},
}
"""The messages of each tick: type, and the method that makes it. The map is published once.

The order is this one, and scans come before all else but the clock, as in f1tenth_gym_ros: a node that drives when its
scan comes knows the pose of the tick before. AutoDRIVE sends its scan last.
"""

_OF_LAPS = {
    "lap_count": (_COUNT, "lap_count"),
    "lap_time": (_FLOAT, "lap_time"),
    "last_lap_time": (_FLOAT, "last_lap_time"),
    "best_lap_time": (_FLOAT, "best_lap_time"),
}
_OF_AUTODRIVE = {
    "ips": ("geometry_msgs/msg/Point", "position"),
    "imu": ("sensor_msgs/msg/Imu", "imu_with_orientation"),
    "odom": (_ODOMETRY, "odometry"),
    "speed": (_FLOAT, "speed"),
    "throttle": (_FLOAT, "throttle"),
    "steering": (_FLOAT, "steering"),
    "left_encoder": ("sensor_msgs/msg/JointState", "left_encoder"),
    "right_encoder": ("sensor_msgs/msg/JointState", "right_encoder"),
    "front_camera": (_IMAGE, "image"),
    "collision_count": (_COUNT, "collision_count"),
    **_OF_LAPS,
    "lidar": ("sensor_msgs/msg/LaserScan", "scan_of_autodrive"),
}
AUTODRIVE_VEHICLES = ("f1tenth_1", "roboracer_1")
"""Names of the car in AutoDRIVE's releases."""
TOPICS |= {f"{space}/{name}": made for space in ("", "/ego_racecar") for name, made in _OF_LAPS.items()}
TOPICS |= dict.fromkeys(("/collision", "/ego_racecar/collision"), (_TRUTH, "collision"))
TOPICS["/ego_racecar/lap_time"] = _FLOAT, "last_lap_time"  # as f1tenth_gym_ros has it
TOPICS |= {f"/autodrive/{car}/{name}": made for car in AUTODRIVE_VEHICLES for name, made in _OF_AUTODRIVE.items()}

OTHERS = (
    ("/opp_racecar/odom", "/ego_racecar/opp_odom", "/opp_odom", "/opponent_odom", "/opponent/odom"),
    ("/opp_racecar2/odom", "/ego_racecar/opp_odom2"),
    ("/opp_racecar3/odom", "/ego_racecar/opp_odom3"),
)
"""Odometry of the other cars: the names for the first, the second and the third."""
OWN_TO_OTHER = "/opp_racecar/opp_odom"
"""The own car's odometry, as the first of the others knows it."""
TAKEN_FOR = {"/scan": "", "/odom": "", "/pf/viz/inferred_pose": "pose", "/amcl_pose": ""}
"""Topics that one of another name is taken for, where a node listens to no other of the type, and what it must say."""
_NOT_OWN = re.compile(r"opp|goal|initial")  # in names of what is another car's, or a person's
MAP_SERVICES = ("/map_server/map", "/static_map", "/map_server/static_map", "/map_server/get_map")

_NEED_SURROUNDINGS = ("map", "map_info", "image")
_EARLY, _LATE = {"clock": 0, "scan": 1}, 2  # places in a tick
_EGO = "ego_racecar/"
CAMERA_FRAME = "camera"
_UPRIGHT = (0.0, 0.0, 0.0, 1.0)
_OPPONENT = "opp_racecar"


class Sensing:
    """Makes the messages of one planner's nodes.

    The beams of a scan are spread evenly over the LiDAR's angles, each with the nearest beam's range; None: the
    LiDAR's. `surroundings` are the last known of the car. `opponent`: the nodes drive as the opponent of
    f1tenth_gym_ros does, by the names of that car.
    """

    def __init__(self, graph: Graph, car: CarParameters, beams: int | None = None) -> None:
        self._beams = beams
        self._graph, self._wheel_radius, self._mass = graph, car.wheel_radius, car.mass
        self._wheelbase, self._half_track, self._gravity = car.wheelbase, car.track_width / 2, car.gravity
        self._pose = np.zeros(3)  # by dead reckoning, where there is no map
        self._before: float | None = None
        self._points: Reading | None = None
        self.surroundings: Surroundings | None = None
        self.opponent = False
        self.command = (0.0, 0.0)  # speed [m/s] and steering angle [rad], last commanded
        self._turned = np.zeros(4)  # [rad] of the wheels, since the start
        self._mapped: Any = None  # the model whose map has been published
        self._camera, self._laps = FrontCamera(), LapsSoFar()
        self._known: tuple[Any, dict[str, str]] | None = None
        self._cars: tuple[str, ...] = AUTODRIVE_VEHICLES
        graph.provided.update({topic: kind for topic, (kind, _) in TOPICS.items() if kind != CLOUD})
        mount = matrix((car.lidar_offset, 0.0, 0.0), _UPRIGHT)
        league, inside = AUTODRIVE_VEHICLES[-1], matrix((0.08, 0.0, 0.055), _UPRIGHT)  # as public DevKits have it
        for child, parent, found in (
            (LASER_FRAME, BASE_FRAME, mount), (_EGO + LASER_FRAME, _EGO + BASE_FRAME, mount),
            (ODOM_FRAME, MAP_FRAME, np.eye(4)), ("world", MAP_FRAME, np.eye(4)),
            ("lidar", league, matrix((car.lidar_offset, 0.0, 0.096), _UPRIGHT)), ("imu", league, inside),
            ("ips", league, inside), (_EGO + "laser_model", _EGO + BASE_FRAME, mount),
        ):  # fmt: skip
            graph.transforms[child] = parent, found
        for side, y in (("left", self._half_track), ("right", -self._half_track)):
            graph.transforms[f"{_EGO}back_{side}_wheel"] = _EGO + BASE_FRAME, matrix((0.0, y, 0.0), _UPRIGHT)

    def messages(self, scan: LaserScan, odometry: Odometry) -> Iterator[tuple[str, Any]]:
        """Make the messages of one tick, in the order of TOPICS, and take the pose as the newest transform."""
        self._scan, self._odometry = scan, odometry
        self._points = odometry.readings.get(MID360)
        if self._points is not None and CLOUD_TOPIC not in self._graph.provided:
            self._graph.provided[CLOUD_TOPIC] = CLOUD
            self._graph.transforms[Mid360.frame] = LASER_FRAME, matrix(tuple(Sheet.load().mount.tolist()), _UPRIGHT)
        self._move()
        x, y, heading = self._pose.tolist()
        self._at = x, y, math.sin(heading / 2), math.cos(heading / 2)
        found = matrix((x, y, 0.0), (0.0, 0.0, self._at[2], self._at[3]))
        self._integrate()
        own = matrix((*self._in_odom[:2], 0.0), (0.0, 0.0, *self._in_odom[2:]))
        self._graph.transforms[BASE_FRAME] = ODOM_FRAME, own
        if self._in_odom is not self._at:
            self._graph.transforms[ODOM_FRAME] = MAP_FRAME, found @ np.linalg.inv(own)
        self._graph.transforms[_EGO + BASE_FRAME] = MAP_FRAME, found
        for frame in self._cars:
            self._graph.transforms[frame] = "world", found
        half = self.command[1] / 2
        for side, y in (("left", self._half_track), ("right", -self._half_track)):
            turned = matrix((self._wheelbase, y, 0.0), (0.0, 0.0, math.sin(half), math.cos(half)))
            self._graph.transforms[f"{_EGO}front_{side}_wheel"] = _EGO + BASE_FRAME, turned
        listened = {each.topic for each in self._graph.subscriptions}
        self._map(listened)
        if not listened.isdisjoint(_RACE_TOPICS):
            self._laps.see(self.surroundings, odometry.stamp, *self._at[:2])
        made_already: dict[str, Any] = {}
        for topic, maker in self._topics().items():
            unknown = self.surroundings is None and maker in _NEED_SURROUNDINGS
            unknown |= maker == "points" and (self._points is None or not len(self._points.stamps))
            if topic in listened and maker not in ("map", "map_info") and not unknown:
                if maker not in made_already:
                    kind, _, number = maker.partition(" ")
                    make = getattr(self, f"_make_{kind}", lambda *_, of=kind: self._make_number(of))
                    made_already[maker] = make(int(number)) if number else make()
                yield topic, made_already[maker] if maker == "scan" else made_already[maker].__deepcopy__({})

    def kind_of(self, topic: str) -> str | None:
        """Return the type of a topic that is published here; None where it is not."""
        maker = self._topics().get(topic)
        if maker in _NEED_SURROUNDINGS and self.surroundings is None:
            return None
        if maker is None or (maker == "points" and self._points is None):
            return None
        if topic in TOPICS:
            return TOPICS[topic][0]
        of_autodrive = _OF_AUTODRIVE.get(topic.rpartition("/")[2]) if topic.startswith("/autodrive/") else None
        if of_autodrive is not None:
            return of_autodrive[0]
        return "sensor_msgs/msg/LaserScan" if maker == "scan" else _ODOMETRY

    def taken_for(self, topic: str, kind: type) -> str | None:
        """Return the topic that a node means by one of another name, where it is the only one of its type."""
        for ours, said in TAKEN_FOR.items():
            if kind is message_class(TOPICS[ours][0]):
                return ours if said in topic and not is_anothers(topic) else None
        return None

    def _topics(self) -> dict[str, str]:
        """Return the topics that are published now, and what makes their messages."""
        others = 0 if self.surroundings is None else len(self.surroundings.others)
        count = len(self._graph.subscriptions)
        if self._known is None or self._known[0] != (others, self.opponent, count):
            found = {topic: maker for topic, (_, maker) in TOPICS.items()}
            self._cars = (*AUTODRIVE_VEHICLES, *self._other_cars())
            for car in self._cars[len(AUTODRIVE_VEHICLES) :]:
                found.update({f"/autodrive/{car}/{name}": maker for name, (_, maker) in _OF_AUTODRIVE.items()})
            for number, names in enumerate(OTHERS[:others]):
                found.update(dict.fromkeys(names, f"other {number}"))
            if others:
                found[OWN_TO_OTHER] = "odometry_on_map"
            if self.opponent:  # the other car is the ego
                found.update({"/opp_scan": "scan", "/opp_racecar/odom": "odometry", "/opponent/odom": "odometry"})
                if others:
                    found.update({OWN_TO_OTHER: "other 0", "/ego_racecar/odom": "other 0"})
            found = dict(sorted(found.items(), key=_rank))
            self._known = (others, self.opponent, count), found
        return self._known[1]

    def _other_cars(self) -> list[str]:
        """Return the name that nodes give their AutoDRIVE car, where it is the only one and none of the releases'."""
        topics = [each.topic for each in self._graph.subscriptions]
        cars = cars_in([*topics, *(each.topic for each in self._graph.publications)])
        return cars if len(cars) == 1 and cars[0] not in AUTODRIVE_VEHICLES else []

    def _map(self, listened: set[str]) -> None:
        """Publish the map of a world that is new, and answer who asks for it."""
        if self.surroundings is None or self.surroundings.world.model is self._mapped:
            return
        for service in MAP_SERVICES:
            self._graph.answers[service] = lambda request: SimpleNamespace(map=self._make_map())
        if listened.isdisjoint(("/map", "/map_metadata")):
            return
        self._mapped = self.surroundings.world.model
        message = self._make_map()
        for topic, found in (("/map", message), ("/map_metadata", message.info)):
            self._graph.latched[topic] = found
            self._graph.deliver(topic, found.__deepcopy__({}))

    def _make_map(self) -> Any:
        assert self.surroundings is not None
        world = self.surroundings.world
        x, y = world.track.start_pose(0.0)[:2] if world.track.walls else self._pose[:2].tolist()
        grid = _grid(world, x, y)
        rows, columns = grid.cells.shape
        numbers = array.array("b", grid.cells.astype(np.int8).tobytes())
        x, y = grid.origin.tolist()
        info = made(
            self._kind("nav_msgs/msg/MapMetaData"), map_load_time=self._time(self._odometry.stamp),
            resolution=_single(grid.resolution), width=columns, height=rows,
            origin=self._plain_pose(x, y, 0.0, 1.0),
        )  # fmt: skip
        return made(
            self._kind("nav_msgs/msg/OccupancyGrid"), header=self._header(self._odometry.stamp, MAP_FRAME), info=info,
            data=numbers,
        )  # fmt: skip

    def _move(self) -> None:
        """Take the pose of the odometry, or integrate speed and yaw rate."""
        pose, stamp = self._odometry.pose, self._odometry.stamp
        if not np.isnan(pose).any():
            self._pose = pose
        elif self._before is not None:
            x, y, heading = self._pose.tolist()
            passed, speed = stamp - self._before, self._odometry.speed
            turned = self._odometry.yaw_rate * passed
            along = heading + turned / 2
            self._pose = np.array(
                (x + speed * passed * math.cos(along), y + speed * passed * math.sin(along), heading + turned)
            )
        if self._before is not None:
            self._turned += self._odometry.wheel_speeds * ((stamp - self._before) / self._wheel_radius)
        self._before = stamp

    def _integrate(self) -> None:
        """Take the pose in the frame `odom` from a VESC, and that frame's on the map; else they are one frame."""
        told = self._odometry.readings.get("vesc")
        self._in_odom, self._of_odom = self._at, _UPRIGHT
        if told is not None and told.received:
            x, y, heading = (told[name] for name in ("x", "y", "heading"))
            self._in_odom = x, y, math.sin(heading / 2), math.cos(heading / 2)
            half = 0.5 * (float(self._pose[2]) - heading)
            turn = math.sin(half), math.cos(half)
            at = self._pose[:2] - matrix((0.0, 0.0, 0.0), (0.0, 0.0, *turn))[:2, :2] @ (x, y)
            self._of_odom = *at.tolist(), *turn

    def _make_scan(self) -> Any:
        return self._scan_message(self._scan, LASER_FRAME)

    def _make_scan_of_autodrive(self) -> Any:
        ranges = self._scan.ranges
        seen = np.where((ranges >= RANGE_MIN) & (ranges <= RANGE_MAX), ranges, math.inf)
        return self._scan_message(replace(self._scan, ranges=seen, range_min=RANGE_MIN, range_max=RANGE_MAX), "lidar")

    def _scan_message(self, scan: LaserScan, frame: str) -> Any:
        scan = scan if self._beams is None else resampled(scan, self._beams)
        numbers = array.array("f")
        numbers.frombytes(scan.ranges.astype(np.float32).tobytes())
        first = scan.stamp - scan.time_increment * max(0, len(scan.ranges) - 1)
        names = ("angle_min", "angle_max", "angle_increment", "time_increment", "scan_time", "range_min", "range_max")
        return made(
            self._kind("sensor_msgs/msg/LaserScan"),
            header=self._header(first, frame),
            ranges=numbers,
            **{name: _single(getattr(scan, name)) for name in names},
        )

    def _make_odometry(self) -> Any:
        return self._own_odometry(BASE_FRAME if not self.opponent else f"{_OPPONENT}/{BASE_FRAME}")

    def _make_odometry_on_map(self) -> Any:
        """As f1tenth_gym_ros has it."""
        return self._own_odometry(_EGO + BASE_FRAME)

    def _own_odometry(self, frame: str) -> Any:
        at = self._in_odom if frame == BASE_FRAME else self._at
        return self._odometry_of(at, self._odometry.speed, self._odometry.yaw_rate, frame)

    def _make_localised(self) -> Any:
        return self._odometry_of(self._at, self._odometry.speed, self._odometry.yaw_rate, BASE_FRAME)

    def _make_other(self, number: int) -> Any:
        assert self.surroundings is not None
        other = self.surroundings.others[number]
        x, y, heading = other.pose
        at = x, y, math.sin(heading / 2), math.cos(heading / 2)
        ego = self.opponent and not number
        frame = _EGO + BASE_FRAME if ego else f"{_OPPONENT}{number + 1 if number else ''}/{BASE_FRAME}"
        return self._odometry_of(at, other.speed, other.yaw_rate, frame)

    def _odometry_of(self, at: tuple[float, ...], speed: float, yaw_rate: float, frame: str) -> Any:
        twist = made(
            self._kind("geometry_msgs/msg/Twist"), linear=self._vector((speed, 0.0, 0.0)),
            angular=self._vector((0.0, 0.0, yaw_rate)),
        )  # fmt: skip
        return made(
            self._kind(_ODOMETRY),
            header=self._header(self._odometry.stamp, ODOM_FRAME if frame == BASE_FRAME else MAP_FRAME),
            child_frame_id=frame,
            pose=made(self._kind("geometry_msgs/msg/PoseWithCovariance"), pose=self._plain_pose(*at)),
            twist=made(self._kind("geometry_msgs/msg/TwistWithCovariance"), twist=twist),
        )

    def _make_vesc_state(self) -> Any:
        return made(
            self._kind("vesc_msgs/msg/VescStateStamped"), header=self._header(self._odometry.stamp, ""),
            state=made(self._kind("vesc_msgs/msg/VescState"), **motor_fields(self._odometry, self._mass)),
        )  # fmt: skip

    def _make_pose(self) -> Any:
        return made(
            self._kind("geometry_msgs/msg/PoseStamped"), header=self._header(self._odometry.stamp, MAP_FRAME),
            pose=self._plain_pose(*self._at),
        )  # fmt: skip

    def _make_pose_with_covariance(self) -> Any:
        return made(
            self._kind("geometry_msgs/msg/PoseWithCovarianceStamped"),
            header=self._header(self._odometry.stamp, MAP_FRAME),
            pose=made(self._kind("geometry_msgs/msg/PoseWithCovariance"), pose=self._plain_pose(*self._at)),
        )

    def _make_position(self) -> Any:
        x, y, _, _ = self._at
        return made(self._kind("geometry_msgs/msg/Point"), x=x, y=y, z=0.0)

    def _make_left_encoder(self) -> Any:
        return self._encoder("left_encoder", 2)

    def _make_right_encoder(self) -> Any:
        return self._encoder("right_encoder", 3)

    def _make_number(self, name: str) -> Any:
        """Return the message of one number, or whether something is so."""
        laps, (speed, steering_angle) = self._laps, self.command
        found: float = {
            "speed": self._odometry.speed, "throttle": speed / THROTTLE, "steering": steering_angle / STEERING,
            "collision": laps.touching, "collision_count": laps.touches, "lap_count": len(laps.times),
            "lap_time": self._odometry.stamp - sum(laps.times), "last_lap_time": (0.0, *laps.times)[-1],
            "best_lap_time": min(laps.times, default=0.0),
        }[name]  # fmt: skip
        kind = next(kind for kind, maker in TOPICS.values() if maker == name)
        return made(self._kind(kind), data=_single(found) if kind == _FLOAT else found)

    def _make_points(self) -> Any:
        assert self._points is not None
        first, fields, parts = cloud_parts(self._points.values, BEGIN + nanoseconds(self._points.stamp))
        made_fields = [made(self._kind("sensor_msgs/msg/PointField"), **field) for field in fields]
        header = self._header((first - BEGIN) / NANOSECONDS, Mid360.frame)
        parts["data"] = array.array("B", parts["data"].tobytes())
        return made(self._kind(CLOUD), header=header, fields=made_fields, **parts)

    def _make_image(self) -> Any:
        assert self.surroundings is not None
        pixels = self._camera.picture(self.surroundings).tobytes()
        return made(
            self._kind(_IMAGE), header=self._header(self._odometry.stamp, CAMERA_FRAME), height=SIZE[1], width=SIZE[0],
            encoding="rgb8", is_bigendian=0, step=3 * SIZE[0], data=array.array("B", pixels),
        )  # fmt: skip

    def _make_lens(self) -> Any:
        width, height = SIZE
        focus = 0.5 * height / math.tan(0.5 * FIELD_OF_VIEW)  # [px]
        message = self._kind(_LENS)(
            header=self._header(self._odometry.stamp, CAMERA_FRAME), height=height, width=width,
            distortion_model="plumb_bob",
        )  # fmt: skip
        rows = np.array(((focus, 0.0, 0.5 * width), (0.0, focus, 0.5 * height), (0.0, 0.0, 1.0)))
        projection = np.column_stack((rows, np.zeros(3)))
        for name, values in {"k": rows, "r": np.eye(3), "p": projection, "d": np.zeros(5)}.items():
            setattr(message, name, values.ravel().tolist())
        return message

    def _encoder(self, name: str, wheel: int) -> Any:
        turned = float(self._turned[wheel])
        return made(
            self._kind("sensor_msgs/msg/JointState"), header=self._header(self._odometry.stamp, name), name=[name],
            position=array.array("d", (turned,)),
        )  # fmt: skip

    def _plain_pose(self, x: float, y: float, qz: float, qw: float) -> Any:
        return made(
            self._kind("geometry_msgs/msg/Pose"),
            position=made(self._kind("geometry_msgs/msg/Point"), x=x, y=y, z=0.0),
            orientation=made(self._kind("geometry_msgs/msg/Quaternion"), x=0.0, y=0.0, z=qz, w=qw),
        )

    def _make_imu(self) -> Any:
        told = as_imu_tells(self._odometry)
        message = made(
            self._kind("sensor_msgs/msg/Imu"), header=self._header(told.stamp, IMU_FRAME),
            angular_velocity=self._vector(told.angular_velocity),
            linear_acceleration=self._vector(told.linear_acceleration),
        )  # fmt: skip
        message.orientation.w = 1.0  # a rotation, though there is no estimate
        message.orientation_covariance[0] = -1.0
        return message

    def _make_imu_with_orientation(self) -> Any:
        """AutoDRIVE's has the true orientation, too, and no gravity in its acceleration: the velocity's derivative."""
        message = self._make_imu()
        up = (0.0, 0.0, 1.0) if self.surroundings is None else self.surroundings.up
        for axis, share in zip("xyz", up, strict=True):
            level = getattr(message.linear_acceleration, axis) - self._gravity * share
            setattr(message.linear_acceleration, axis, level)
        message.orientation.z, message.orientation.w = self._at[2:]
        message.orientation_covariance[0] = 0.0
        return message

    def _make_clock(self) -> Any:
        return made(self._kind("rosgraph_msgs/msg/Clock"), clock=self._time(self._odometry.stamp))

    def _make_transforms(self) -> Any:
        kind, quaternion = self._kind("geometry_msgs/msg/Transform"), self._kind("geometry_msgs/msg/Quaternion")
        moved = [(ODOM_FRAME, BASE_FRAME, self._in_odom), (MAP_FRAME, _EGO + BASE_FRAME, self._at)]
        if self._in_odom is not self._at:
            moved.append((MAP_FRAME, ODOM_FRAME, self._of_odom))
        return made(
            self._kind("tf2_msgs/msg/TFMessage"),
            transforms=[
                made(
                    self._kind("geometry_msgs/msg/TransformStamped"),
                    header=self._header(self._odometry.stamp, parent), child_frame_id=child,
                    transform=made(kind, translation=self._vector((x, y, 0.0)),
                                   rotation=made(quaternion, x=0.0, y=0.0, z=qz, w=qw)),
                )
                for parent, child, (x, y, qz, qw) in moved
            ],
        )  # fmt: skip

    def _kind(self, name: str) -> Any:
        return message_class(name)

    def _header(self, stamp: float, frame: str) -> Any:
        return made(self._kind("std_msgs/msg/Header"), stamp=self._time(stamp), frame_id=frame)

    def _time(self, stamp: float) -> Any:
        sec, nanosec = divmod(BEGIN + nanoseconds(stamp), NANOSECONDS)
        return made(self._kind("builtin_interfaces/msg/Time"), sec=sec, nanosec=nanosec)

    def _vector(self, values: Any) -> Any:
        x, y, z = map(float, values)
        return made(self._kind("geometry_msgs/msg/Vector3"), x=x, y=y, z=z)


_RACE_TOPICS = frozenset(
    topic for topic, (_, maker) in TOPICS.items() if maker.endswith(("lap_time", "lap_count")) or "collision" in maker
)


class LapsSoFar:
    """The laps driven (`times` [s]) and the touches of a car, from when somebody listens to them."""

    def __init__(self) -> None:
        self._timer: LapTimer | None = None
        self.times: tuple[float, ...] = ()
        self.touching, self.touches = False, 0

    def see(self, surroundings: Surroundings | None, stamp: float, x: float, y: float) -> None:
        """Take where the car is at a time [s]."""
        if surroundings is None:
            return
        self.touches += surroundings.contact and not self.touching
        self.touching = surroundings.contact
        if self._timer is None:
            self._timer = LapTimer(surroundings.world.track)
        if math.isfinite(surroundings.world.track.length):
            self._timer.update(stamp, (x, y))
            self.times = self._timer.lap_times


def _rank(entry: tuple[str, str]) -> int:
    """Return when in a tick a topic's message comes: the clock, the scan, the rest, AutoDRIVE's in its own order."""
    topic, maker = entry
    return _LATE if topic.startswith("/autodrive/") else _EARLY.get(maker, _LATE)


def resampled(scan: LaserScan, beams: int) -> LaserScan:
    """Return a scan of another number of beams over the same angles; each has the range of the nearest there was."""
    count = len(scan.ranges)
    if count < 2 or beams == count:
        return scan
    nearest = np.round(np.linspace(0.0, count - 1.0, beams)).astype(int)
    ratio = (count - 1) / (beams - 1)
    return replace(
        scan, ranges=scan.ranges[nearest], angle_increment=scan.angle_increment * ratio,
        time_increment=scan.time_increment * ratio,
    )  # fmt: skip


def is_anothers(topic: str) -> bool:
    """Return whether a topic, by its name, is of another car, or of a person: not what this car senses."""
    return bool(_NOT_OWN.search(topic))


@lru_cache(maxsize=2)
def _grid(world: World, x: float, y: float) -> Grid:
    """Return the map of a world, for which many planners may ask, seen from a free place [m]."""
    return grid_of(world.model, np.array((x, y)))


@lru_cache(maxsize=64)
def _single(value: float) -> float:
    """Return a number as a field of 32 bits has it."""
    return float(np.float32(value))
