"""Stubs of tf2_ros and tf_transformations: a tree of frames, of which the newest transforms are kept."""

from __future__ import annotations

import importlib.util
import math
from types import ModuleType
from typing import Any, ClassVar

import numpy as np

from fg_mujoco.messages import FloatArray

from .graph import NANOSECONDS, Graph
from .imports import StandIn
from .message_classes import Message, made, message_class
from .node_session import Session
from .rclpy_executors import Future
from .rclpy_times import Time


class TransformException(Exception):
    pass


class LookupException(TransformException):
    pass


class ConnectivityException(TransformException):
    pass


def matrix(position: Any, quaternion: Any) -> FloatArray:
    """Return the matrix (4, 4) of a position and a quaternion x, y, z, w."""
    found = quaternion_matrix(quaternion)
    found[:3, 3] = position
    return found


def lookup(graph: Graph, target: str, source: str) -> FloatArray:
    """Return the matrix (4, 4) from the frame `source` to `target`; LookupException, ConnectivityException: none."""
    to_root = [_chain(graph, frame.strip("/")) for frame in (target, source)]
    if to_root[0][0] != to_root[1][0]:
        raise ConnectivityException(f"frames {target!r} and {source!r} are not of one tree")
    return np.asarray(np.linalg.inv(to_root[0][1]) @ to_root[1][1], np.float64)


def _chain(graph: Graph, frame: str) -> tuple[str, FloatArray]:
    """Return the root of a frame's tree, and the matrix from the frame to it."""
    known = {*graph.transforms, *(parent for parent, _ in graph.transforms.values())}
    if frame not in known:
        raise LookupException(f"there is no frame {frame!r}; accepted: {', '.join(sorted(known))}")
    found, seen = np.eye(4), {frame}
    while frame in graph.transforms:
        parent, step = graph.transforms[frame]
        found, frame = step @ found, parent
        if frame in seen:
            raise ConnectivityException(f"the frames {', '.join(sorted(seen))} are a circle")
        seen.add(frame)
    return frame, found


def euler_from_quaternion(quaternion: Any, axes: str = "sxyz") -> tuple[float, float, float]:
    return euler_from_matrix(quaternion_matrix(quaternion), axes)


def euler_from_matrix(found: Any, axes: str = "sxyz") -> tuple[float, float, float]:
    m = np.asarray(found, float)
    if axes not in ("sxyz", "rzyx"):
        from scipy.spatial.transform import Rotation  # heavy, and few nodes want other axes

        a, b, c = Rotation.from_matrix(m[:3, :3]).as_euler(_axes(axes)).tolist()
        return a, b, c
    cosine = math.hypot(m[0, 0], m[1, 0])
    if cosine > 1e-12:
        angles = math.atan2(m[2, 1], m[2, 2]), math.atan2(-m[2, 0], cosine), math.atan2(m[1, 0], m[0, 0])
    else:
        angles = math.atan2(-m[1, 2], m[1, 1]), math.atan2(-m[2, 0], cosine), 0.0
    return angles if axes == "sxyz" else angles[::-1]


def _axes(axes: str) -> str:
    """Return axes such as `szyz` as SciPy has them: `zyz`, and in capitals those of a frame that turns along."""
    if len(axes) != 4 or axes[0] not in "sr" or not set(axes[1:]) <= set("xyz"):
        raise KeyError(f"axes {axes!r}; accepted: s or r, and three of x, y, z, as in sxyz")
    return axes[1:] if axes[0] == "s" else axes[1:].upper()


def quaternion_from_euler(ai: float, aj: float, ak: float, axes: str = "sxyz") -> FloatArray:
    if axes not in ("sxyz", "rzyx"):
        from scipy.spatial.transform import Rotation

        return np.asarray(Rotation.from_euler(_axes(axes), (ai, aj, ak)).as_quat())
    roll, pitch, yaw = (ai, aj, ak) if axes == "sxyz" else (ak, aj, ai)
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a / 2), math.sin(a / 2)) for a in (roll, pitch, yaw))
    return np.array(
        (
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        )
    )


def quaternion_matrix(quaternion: Any) -> FloatArray:
    q = np.array([float(each) for each in quaternion])
    norm = float(q @ q)
    found = np.eye(4)
    if norm > 1e-16:
        x, y, z, w = q / math.sqrt(norm)
        found[:3, :3] = (
            (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
            (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
            (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
        )
    return found


def quaternion_from_matrix(found: Any) -> FloatArray:
    return quaternion_from_euler(*euler_from_matrix(found))


def quaternion_multiply(one: Any, other: Any) -> FloatArray:
    x0, y0, z0, w0 = other
    x1, y1, z1, w1 = one
    return np.array(
        (
            x1 * w0 + y1 * z0 - z1 * y0 + w1 * x0, -x1 * z0 + y1 * w0 + z1 * x0 + w1 * y0,
            x1 * y0 - y1 * x0 + z1 * w0 + w1 * z0, -x1 * x0 - y1 * y0 - z1 * z0 + w1 * w0,
        )
    )  # fmt: skip


def quaternion_conjugate(quaternion: Any) -> FloatArray:
    x, y, z, w = quaternion
    return np.array((-x, -y, -z, w))


def quaternion_inverse(quaternion: Any) -> FloatArray:
    q = np.asarray(quaternion, float)
    return quaternion_conjugate(q) / float(q @ q)


def quaternion_about_axis(angle: float, axis: Any) -> FloatArray:
    a = np.asarray(axis, float)
    return np.append(a / np.linalg.norm(a) * math.sin(angle / 2), math.cos(angle / 2))


def translation_matrix(direction: Any) -> FloatArray:
    return matrix(direction, (0.0, 0.0, 0.0, 1.0))


def translation_from_matrix(found: Any) -> FloatArray:
    return np.array(found)[:3, 3].copy()


def euler_matrix(ai: float, aj: float, ak: float, axes: str = "sxyz") -> FloatArray:
    return quaternion_matrix(quaternion_from_euler(ai, aj, ak, axes))


def rotation_matrix(angle: float, direction: Any, point: Any = None) -> FloatArray:
    return quaternion_matrix(quaternion_about_axis(angle, direction))


def concatenate_matrices(*matrices: Any) -> FloatArray:
    found = np.eye(4)
    for each in matrices:
        found = found @ each
    return found


def identity_matrix() -> FloatArray:
    return np.eye(4)


def inverse_matrix(found: Any) -> FloatArray:
    return np.asarray(np.linalg.inv(found), np.float64)


def vector_norm(data: Any, axis: Any = None) -> Any:
    return np.linalg.norm(data, axis=axis)


def unit_vector(data: Any, axis: Any = None) -> FloatArray:
    found = np.array(data, float)
    return np.asarray(found / np.linalg.norm(found, axis=axis, keepdims=axis is not None))


def quaternion_slerp(quat0: Any, quat1: Any, fraction: float, spin: int = 0, shortestpath: bool = True) -> FloatArray:
    one, other = unit_vector(quat0), unit_vector(quat1)
    along = float(one @ other)
    if shortestpath and along < 0.0:
        along, other = -along, -other
    angle = math.acos(min(1.0, along))
    if angle < 1e-9:
        return one
    return (one * math.sin((1.0 - fraction) * angle) + other * math.sin(fraction * angle)) / math.sin(angle)


def euler2quat(ai: float, aj: float, ak: float, axes: str = "sxyz") -> FloatArray:
    return np.roll(quaternion_from_euler(ai, aj, ak, axes), 1)


def quat2euler(quaternion: Any, axes: str = "sxyz") -> tuple[float, float, float]:
    return euler_from_quaternion(np.roll(quaternion, -1), axes)


def quat2mat(q: Any) -> FloatArray:
    return quaternion_matrix(np.roll(q, -1))[:3, :3]


def mat2quat(found: Any) -> FloatArray:
    whole = np.eye(4)
    whole[:3, :3] = np.asarray(found)[:3, :3]
    return np.roll(quaternion_from_matrix(whole), 1)


def euler2mat(ai: float, aj: float, ak: float, axes: str = "sxyz") -> FloatArray:
    return euler_matrix(ai, aj, ak, axes)[:3, :3]


_TRANSFORMATIONS = (
    identity_matrix, inverse_matrix, vector_norm, unit_vector, quaternion_slerp,
    euler_from_quaternion, euler_from_matrix, quaternion_from_euler, quaternion_matrix, quaternion_from_matrix,
    quaternion_multiply, quaternion_conjugate, quaternion_inverse, quaternion_about_axis, translation_matrix,
    translation_from_matrix, euler_matrix, rotation_matrix, concatenate_matrices,
)  # fmt: skip


class Frames:
    """The transforms of one graph, in messages."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph

    def kind(self, name: str) -> type[Message]:
        return message_class(f"geometry_msgs/msg/{name}")

    def add(self, stamped: Any) -> None:
        """Take a TransformStamped, or a list of them, as the newest."""
        for each in stamped if isinstance(stamped, (list, tuple)) else [stamped]:
            t, r = each.transform.translation, each.transform.rotation
            parent, child = each.header.frame_id.strip("/"), each.child_frame_id.strip("/")
            self.graph.transforms[child] = parent, matrix((t.x, t.y, t.z), (r.x, r.y, r.z, r.w))
        for _, look in list(self.graph.waiting_for_transforms):
            look()

    def stamped(self, target: str, source: str) -> Any:
        """Return the TransformStamped from `source` to `target`."""
        found = lookup(self.graph, target, source)
        (x, y, z), q = found[:3, 3].tolist(), quaternion_from_matrix(found).tolist()
        header = message_class("std_msgs/msg/Header")()
        header.frame_id = target
        header.stamp.sec, header.stamp.nanosec = divmod(self.graph.now, NANOSECONDS)
        vector, quaternion = self.kind("Vector3"), self.kind("Quaternion")
        transform = made(
            self.kind("Transform"), translation=made(vector, x=x, y=y, z=z),
            rotation=made(quaternion, x=q[0], y=q[1], z=q[2], w=q[3]),
        )  # fmt: skip
        return made(self.kind("TransformStamped"), header=header, child_frame_id=source, transform=transform)

    def moved(self, stamped: Any, transform: Any) -> Any:
        """Return a PointStamped, PoseStamped, Pose or Vector3Stamped, moved by a TransformStamped."""
        t, r = transform.transform.translation, transform.transform.rotation
        by = unit(r)
        answer = stamped.__deepcopy__({})
        if hasattr(type(answer), "header"):
            answer.header.frame_id = transform.header.frame_id
        names = answer._makers
        pose = answer.pose if "pose" in names else answer if "position" in names else None
        while pose is not None and "pose" in pose._makers:  # of a PoseWithCovariance
            pose = pose.pose
        point = pose.position if pose is not None else answer.point if "point" in names else answer.vector
        x, y, z = turned(by, (point.x, point.y, point.z))
        shift = (0.0, 0.0, 0.0) if "vector" in names else (t.x, t.y, t.z)
        point.x, point.y, point.z = x + shift[0], y + shift[1], z + shift[2]
        if pose is not None:
            o = pose.orientation
            o.x, o.y, o.z, o.w = product(by, unit(o))
        return answer


Quaternion = tuple[float, float, float, float]


def unit(message: Any) -> Quaternion:
    """Return the quaternion of a message, of length 1; of nothing but zeros no rotation."""
    x, y, z, w = float(message.x), float(message.y), float(message.z), float(message.w)
    length = math.sqrt(x * x + y * y + z * z + w * w)
    return (x / length, y / length, z / length, w / length) if length > 1e-8 else (0.0, 0.0, 0.0, 1.0)


def product(one: Quaternion, other: Quaternion) -> Quaternion:
    """Return the rotation `other`, and then `one`."""
    ax, ay, az, aw = one
    bx, by, bz, bw = other
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def turned(by: Quaternion, vector: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return a vector, turned."""
    qx, qy, qz, qw = by
    x, y, z = vector
    tx, ty, tz = 2 * (qy * z - qz * y), 2 * (qz * x - qx * z), 2 * (qx * y - qy * x)
    return x + qw * tx + qy * tz - qz * ty, y + qw * ty + qz * tx - qx * tz, z + qw * tz + qx * ty - qy * tx


class TransformRegistration:
    """What moves messages of a type: functions of a message and a TransformStamped."""

    def __init__(self) -> None:
        self._functions: dict[Any, Any] = {}

    def add(self, key: Any, callback: Any) -> None:
        self._functions[key] = callback

    def get(self, key: Any) -> Any:
        return self._functions[key]

    def print_me(self) -> None:
        print(self._functions)


class TransformBuffer:
    """tf2_ros.Buffer: the newest transforms count, whatever times are asked for; it waits in simulated time."""

    _frames: ClassVar[Frames]
    registration: ClassVar[Any]

    def __init__(self, *_: Any, **__: Any) -> None:
        self._transforms = self._frames.graph.transforms

    def lookup_transform(self, target_frame: str, source_frame: str, time: Any = None, timeout: Any = None) -> Any:
        self.can_transform(target_frame, source_frame, time, timeout)
        return self._frames.stamped(target_frame, source_frame)

    def can_transform(
        self, target_frame: str, source_frame: str, time: Any = None, timeout: Any = None,
        return_debug_tuple: bool = False,
    ) -> Any:  # fmt: skip
        graph = self._frames.graph
        until = graph.now + int(getattr(timeout, "nanoseconds", 0))
        while True:
            found = self.can_transform_core(target_frame, source_frame)
            if found[0] or graph.now >= until:
                return found if return_debug_tuple else found[0]
            graph.poll(lambda: self.can_transform_core(target_frame, source_frame)[0], until)

    def can_transform_core(self, target_frame: str, source_frame: str, time: Any = None) -> tuple[bool, str]:
        try:
            lookup(self._frames.graph, target_frame, source_frame)
        except TransformException as error:
            return False, str(error)
        return True, ""

    def lookup_transform_core(self, target_frame: str, source_frame: str, time: Any = None) -> Any:
        return self.lookup_transform(target_frame, source_frame)

    def lookup_transform_full(
        self, target_frame: str, target_time: Any, source_frame: str, source_time: Any, fixed_frame: str,
        timeout: Any = None,
    ) -> Any:  # fmt: skip
        self.lookup_transform(fixed_frame, source_frame, timeout=timeout)
        return self.lookup_transform(target_frame, source_frame, timeout=timeout)

    def can_transform_full(
        self, target_frame: str, target_time: Any, source_frame: str, source_time: Any, fixed_frame: str,
        timeout: Any = None, return_debug_tuple: bool = False,
    ) -> Any:  # fmt: skip
        through = self.can_transform(fixed_frame, source_frame, None, timeout, return_debug_tuple=True)
        found = self.can_transform(target_frame, source_frame, None, timeout, return_debug_tuple=True)
        found = found if through[0] else through
        return found if return_debug_tuple else found[0]

    def can_transform_full_core(
        self, target_frame: str, target_time: Any, source_frame: str, source_time: Any, fixed_frame: str
    ) -> Any:
        return self.can_transform_full(target_frame, None, source_frame, None, fixed_frame, return_debug_tuple=True)

    lookup_transform_full_core = lookup_transform_full

    def wait_for_transform_async(self, target_frame: str, source_frame: str, time: Any = None) -> Future:
        future, waiting = Future(), self._frames.graph.waiting_for_transforms

        def look() -> None:
            if not future.done() and self.can_transform_core(target_frame, source_frame)[0]:
                future.set_result(self.lookup_transform(target_frame, source_frame))

        look()
        waiting[:] = [each for each in waiting if not each[0].done()] + [(future, look)] * (not future.done())
        return future

    def wait_for_transform_full_async(self, target_frame: str, _: Any, source_frame: str, *__: Any) -> Future:
        return self.wait_for_transform_async(target_frame, source_frame)

    async def lookup_transform_async(self, target_frame: str, source_frame: str, time: Any = None) -> Any:
        return await self.wait_for_transform_async(target_frame, source_frame)

    async def lookup_transform_full_async(self, target_frame: str, _: Any, source_frame: str, *__: Any) -> Any:
        return await self.wait_for_transform_async(target_frame, source_frame)

    def transform(self, object_stamped: Any, target_frame: str, timeout: Any = None, new_type: Any = None) -> Any:
        found = self.lookup_transform(target_frame, object_stamped.header.frame_id, timeout=timeout)
        try:
            move = self.registration.get(type(object_stamped))
        except KeyError:
            move = self._frames.moved
        return move(object_stamped, found)

    def transform_full(
        self, object_stamped: Any, target_frame: str, target_time: Any, fixed_frame: str, timeout: Any = None,
        new_type: Any = None,
    ) -> Any:  # fmt: skip
        self.lookup_transform(fixed_frame, object_stamped.header.frame_id, timeout=timeout)
        return self.transform(object_stamped, target_frame, timeout)

    def set_transform(self, transform: Any, authority: str = "") -> None:
        self._frames.add(transform)

    set_transform_static = set_transform

    def clear(self) -> None:
        """Forget nothing: each transform comes again with the next tick."""

    def get_latest_common_time(self, target_frame: str, source_frame: str) -> Any:
        lookup(self._frames.graph, target_frame, source_frame)
        return Time(nanoseconds=self._frames.graph.now)

    def all_frames_as_string(self) -> str:
        return "".join(f"Frame {name} exists with parent {parent}.\n" for name, (parent, _) in self._transforms.items())

    def all_frames_as_yaml(self) -> str:
        now = self._frames.graph.now / NANOSECONDS
        shown = (
            f"{name}: \n  parent: '{parent}'\n  broadcaster: 'default_authority'\n  rate: 10000.000\n"
            f"  most_recent_transform: {now:.6f}\n  oldest_transform: {now:.6f}\n  buffer_length: 0.000\n"
            for name, (parent, _) in self._transforms.items()
        )
        return "".join(shown) or "{}"

    def _allFramesAsDot(self, *_: Any) -> str:  # noqa: N802
        edges = "".join(f'"{parent}" -> "{name}"[label=""];\n' for name, (parent, _) in self._transforms.items())
        return f"digraph G {{\n{edges}}}"

    def _frameExists(self, frame_id: str) -> bool:  # noqa: N802
        return frame_id in self._getFrameStrings()

    def _getFrameStrings(self) -> list[str]:  # noqa: N802
        return sorted({*self._transforms, *(parent for parent, _ in self._transforms.values())})


def transform_modules(session: Session) -> dict[str, ModuleType]:
    """Return the modules of tf2_ros, tf2_geometry_msgs and tf_transformations, for one node."""
    frames = Frames(session.graph)

    class Buffer(TransformBuffer):
        _frames, registration = frames, TransformRegistration()

    class TransformListener:
        def __init__(self, *_: Any, **__: Any) -> None:
            pass

    class TransformBroadcaster:
        def __init__(self, *_: Any, **__: Any) -> None:
            pass

        def sendTransform(self, transform: Any) -> None:  # noqa: N802
            frames.add(transform)

    exceptions: dict[str, Any] = {
        "TransformException": TransformException, "LookupException": LookupException,
        "ConnectivityException": ConnectivityException,
    }  # fmt: skip
    for name in ("ExtrapolationException", "InvalidArgumentException", "TimeoutException"):  # that nothing here raises
        exceptions[name] = type(name, (TransformException,), {})
    maths: dict[str, Any] = {each.__name__: each for each in _TRANSFORMATIONS}
    members: dict[str, Any] = {
        "Buffer": Buffer, "TransformListener": TransformListener, "TransformBroadcaster": TransformBroadcaster,
        "StaticTransformBroadcaster": TransformBroadcaster, "BufferInterface": Buffer, **exceptions,
        "TransformRegistration": lambda: Buffer.registration, "BufferCore": Buffer,
    }  # fmt: skip
    geometry: dict[str, Any] = dict.fromkeys(
        ("do_transform_point", "do_transform_pose", "do_transform_vector3"), frames.moved
    )
    geometry["do_transform_pose_stamped"] = geometry["do_transform_pose_with_covariance_stamped"] = frames.moved
    for name in ("PointStamped", "PoseStamped", "Vector3Stamped", "PoseWithCovarianceStamped"):
        geometry[name] = frames.kind(name)
    modules: dict[str, ModuleType] = {
        "tf2_ros": StandIn("tf2_ros", **members),
        "tf2_ros.buffer": StandIn("tf2_ros.buffer", Buffer=Buffer),
        "tf2_ros.transform_listener": StandIn("tf2_ros.transform_listener", TransformListener=TransformListener),
        "tf2_ros.transform_broadcaster": StandIn(
            "tf2_ros.transform_broadcaster", TransformBroadcaster=TransformBroadcaster
        ),
        "tf2_ros.static_transform_broadcaster": StandIn(
            "tf2_ros.static_transform_broadcaster", StaticTransformBroadcaster=TransformBroadcaster
        ),
        "tf2_geometry_msgs": StandIn("tf2_geometry_msgs", **geometry),
        "tf2_geometry_msgs.tf2_geometry_msgs": StandIn("tf2_geometry_msgs.tf2_geometry_msgs", **geometry),
        "tf2_py": StandIn("tf2_py", BufferCore=Buffer, **exceptions),
        "tf_transformations": StandIn("tf_transformations", **maths),
    }
    if importlib.util.find_spec("transforms3d") is None:  # whose quaternions are w, x, y, z
        eulers = {each.__name__: each for each in (euler2quat, quat2euler, euler2mat)}
        modules["transforms3d.euler"] = StandIn("transforms3d.euler", mat2euler=euler_from_matrix, **eulers)
        modules["transforms3d.quaternions"] = StandIn("transforms3d.quaternions", quat2mat=quat2mat, mat2quat=mat2quat)
    return modules
