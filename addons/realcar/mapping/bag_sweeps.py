"""The scans of a bag, each with where the LiDAR was.

    with Recording("drive.mcap") as bag:
        sweeps = read_sweeps(bag, car)
        sweeps.poses[7], sweeps.scans[7].ranges

Poses are taken from the first of these that the bag has:

1. the topic that is asked for, of PoseStamped, PoseWithCovarianceStamped or Odometry
2. the transforms from map to the LiDAR, of a localisation or of a mapping
3. the only topic of PoseStamped or PoseWithCovarianceStamped with a pose in two seconds at least
4. Odometry whose frame is map
5. Odometry in another frame, or the transforms from odom to the LiDAR: these drift

The LiDAR is on the car where the transforms say, else where the vehicle has it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fg_mujoco.addons.ros.bag_frames import FrameTree, flat, plain, planar
from fg_mujoco.addons.ros.bag_messages import MAP_FRAME, ODOMETRY, SCAN, stamp_of
from fg_mujoco.addons.ros.bag_reader import POSES, Clock, ScanFaults, pose_of
from fg_mujoco.addons.ros.bag_recording import Heard, Recording, Topic
from fg_mujoco.addons.ros.bag_scans import mount_of, to_scan
from fg_mujoco.errors import BagError
from fg_mujoco.messages import CarParameters, FloatArray, LaserScan

from .sweeps import Sweeps, interpolated

_APART = 500_000_000  # [ns] between the clocks of two topics, above which the recorder's counts for both
_LATE = 0.5  # [s] before the first pose and after the last, within which a scan counts
_DRIFTING = ("odom", "odom_combined")


def read_sweeps(
    bag: Recording,
    car: CarParameters,
    *,
    scan_topic: str | None = None,
    pose_topic: str | None = None,
    odometry_topic: str | None = None,
) -> Sweeps:
    """Return the scans of a bag with the poses of the LiDAR.

    Args:
      bag: open.
      car: with a LiDAR where it is taken to be without transforms.
      scan_topic: None: /scan, or the only one there is.
      pose_topic: None: as the module says.
      odometry_topic: None: /odom, or the only one there is.

    Raises:
      BagError: no scans; several topics to choose from; no poses.
    """
    scan = bag.choose((SCAN,), wanted=scan_topic, option="--scan-topic")
    if scan is None:
        raise BagError(f"{bag.path}: holds no scans; accepted: a bag with {SCAN}; it has {bag.held()}")
    frames = bag.mounting_frames()
    sensor = next((plain(heard.message.header.frame_id) for heard in bag.messages({scan}, most=1)), "")
    source = _source(bag, frames, sensor, pose_topic, odometry_topic)
    heard_scans: list[tuple[int, int, LaserScan]] = []  # stamp, recorder's growing time
    faults, clock = ScanFaults(bag), Clock()
    left_out: dict[str, int] = {}
    for heard in bag.messages({scan}):
        if not faults.accepts(heard):
            left_out["recorded twice"] = left_out.get("recorded twice", 0) + 1
        elif faults.again:
            left_out["sent again with the same stamp"] = left_out.get("sent again with the same stamp", 0) + 1
        else:
            shift, period = clock.shift(stamp_of(heard.message), heard)
            mount = mount_of(frames, heard.message.header.frame_id)
            taken = to_scan(heard.message, mount, period=period)
            ends = round(abs(taken.time_increment) * (len(taken.ranges) - 1) * 1e9)
            stamp = stamp_of(heard.message) + shift + ends
            heard_scans.append((stamp, heard.time, taken))
    faults.warn(clock)
    if not heard_scans:
        raise BagError(f"{bag.path}: none of its scans can be read; accepted: a bag with {SCAN}")
    rows, offset = _poses(bag, frames, sensor, source, car)
    scans = np.array([row[:2] for row in heard_scans], np.int64)
    if len(rows) < 2:
        raise BagError(f"{bag.path}: has {len(rows)} poses by {source.text}; accepted: two at least")
    column = _common_clock(bag, scans, np.array([row[:2] for row in rows], np.int64).reshape(-1, 2))
    begin = int(scans[0, column])
    times = (scans[:, column] - begin) / 1e9
    track = np.array([((row[column] - begin) / 1e9, *row[2]) for row in rows])
    track = track[np.unique(track[:, 0], return_index=True)[1]]  # sorted, each time once
    track[:, 3] = np.unwrap(track[:, 3])
    keep = (times > track[0, 0] - _LATE) & (times < track[-1, 0] + _LATE)
    if not keep.all():
        bag.warn(f"{np.count_nonzero(~keep)} of {len(keep)} scans have no pose at their time, and are left out")
        for why, which in (("before the first pose", times <= track[0, 0] - _LATE),
                           ("after the last pose", times >= track[-1, 0] + _LATE)):  # fmt: skip
            left_out[why] = int(np.count_nonzero(which))
    if not keep.any():
        said = f"no scan has a pose at its time, by {source.text}"
        raise BagError(f"{bag.path}: {said}; accepted: poses at the times of scans")
    found = interpolated(track, times)
    return Sweeps(
        scans=[row[2] for row, kept in zip(heard_scans, keep, strict=True) if kept],
        times=times[keep],
        poses=found[keep],
        offset=offset,
        source=source.text,
        drifts=source.drifts,
        track=track,
        left_out={why: count for why, count in left_out.items() if count},
    )


@dataclass(frozen=True, kw_only=True)
class _Source:
    kind: str  # "topic" or "transforms"
    text: str
    drifts: bool
    topic: Topic | None = None
    world: str = ""  # frame that transforms are followed from


def _source(
    bag: Recording, frames: FrameTree, sensor: str, pose_topic: str | None, odometry_topic: str | None
) -> _Source:
    """Return the source of the poses."""
    if pose_topic is not None:
        topic = bag.choose((*POSES, ODOMETRY), wanted=pose_topic, option="--pose-topic")
        assert topic is not None
        return _Source(kind="topic", text=f"the poses on {topic[1]}", topic=topic, drifts=False)
    if odometry_topic is None and frames.find(sensor, MAP_FRAME) is not None:
        return _Source(kind="transforms", text="the transforms from map", world=MAP_FRAME, drifts=False)
    if odometry_topic is None:
        topic = bag.choose(POSES, option="--pose-topic", sparse=False)
        if topic is not None:
            return _Source(kind="topic", text=f"the poses on {topic[1]}", topic=topic, drifts=False)
        placed = [topic for topic in bag.counts if topic[0] == ODOMETRY and _frame_of(bag, topic) == MAP_FRAME]
        if len(placed) == 1:
            return _Source(kind="topic", text=f"the poses on {placed[0][1]}", topic=placed[0], drifts=False)
    topic = bag.choose((ODOMETRY,), wanted=odometry_topic, option="--odom-topic")
    if topic is not None:
        drifts = _frame_of(bag, topic) != MAP_FRAME
        return _Source(kind="topic", text=f"the odometry on {topic[1]}", topic=topic, drifts=drifts)
    for world in _DRIFTING:
        if frames.find(sensor, world) is not None:
            return _Source(kind="transforms", text=f"the transforms from {world}", world=world, drifts=True)
    raise BagError(
        f"{bag.path}: does not say where the LiDAR was: it has {bag.held()}; accepted: {ODOMETRY}, {POSES[0]}, "
        f"{POSES[1]}, or transforms from map or odom to {sensor or 'the LiDAR'}"
    )


def _frame_of(bag: Recording, topic: Topic) -> str:
    return next((plain(heard.message.header.frame_id) for heard in bag.messages({topic}, most=1)), "")


def _poses(
    bag: Recording, frames: FrameTree, sensor: str, source: _Source, car: CarParameters
) -> tuple[list[tuple[int, int, FloatArray]], tuple[float, float]]:
    """Return the stamp, the recorder's time and the pose of the LiDAR, turned as the car is, and its place on it."""
    base = frames.base_of(sensor)
    mounted = None if base is None else frames.find(sensor, base, {MAP_FRAME, *_DRIFTING})
    yaw = 0.0 if mounted is None else mount_of(frames, sensor).yaw
    place = planar(car.lidar_offset, 0.0, 0.0) if mounted is None else planar(mounted[0, 3], mounted[1, 3], 0.0)
    offset = (float(place[0, 3]), float(place[1, 3]))
    rows: list[tuple[int, int, FloatArray]] = []
    clock = Clock()
    if source.topic is not None:
        # the pose of a frame of the LiDAR's own is where the LiDAR is; any other is the car's
        for heard in bag.messages({source.topic}):
            pose = planar(*pose_of(heard.message))
            child = plain(getattr(heard.message, "child_frame_id", ""))
            at = pose @ _turned(-yaw) if child and child == sensor else pose @ place
            _add(rows, heard, clock, stamp_of(heard.message), at)
        if mounted is None and rows:
            bag.warn(f"no transforms say where the LiDAR is on the car; taken: {offset[0]:.3f} m ahead of base_link")
    elif source.kind == "transforms":
        live = FrameTree()
        for heard in bag.messages(bag.transform_topics):
            live.hear(heard.message)
            found = live.find(sensor, source.world)
            if found is not None and not heard.topic[1].endswith("tf_static"):
                stamp = max((stamp_of(entry) for entry in heard.message.transforms), default=0)
                upright = found if found[2, 2] > 0.0 else found @ np.diag((1.0, -1.0, -1.0, 1.0))
                _add(rows, heard, clock, stamp, upright @ _turned(-yaw))
    return rows, offset


def _turned(angle: float) -> FloatArray:
    return planar(0.0, 0.0, angle)


def _add(
    rows: list[tuple[int, int, FloatArray]], heard: Heard, clock: Clock, stamp: int, transform: FloatArray
) -> None:
    pose = flat(transform)
    if np.isfinite(pose).all():
        rows.append((stamp + clock.shift(stamp, heard)[0], heard.time, pose))


def _common_clock(bag: Recording, scans: Any, poses: Any) -> int:
    """Return 0 where the stamps of scans and poses are of one clock, else 1, the recorder's."""
    apart = float(np.median(scans[:, 1] - scans[:, 0]) - np.median(poses[:, 1] - poses[:, 0]))
    if abs(apart) < _APART:
        return 0
    bag.warn(f"the stamps of scans and poses are {abs(apart) / 1e9:.1f} s apart; the recorder's times are taken")
    return 1
