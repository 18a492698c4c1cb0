"""A live race for Foxglove: its car in 3D, scan, map, transforms and plots; commands, parameters and services back.

The topics are those of a bag (`bag_writer`), as ROS 2 messages in CDR, with /clock, /scene (foxglove.SceneUpdate, its
frames are bodies of the model) and /car (JSON, numbers to plot). A client may publish on ACCEPTED, in JSON or CDR:
commands, which are held from then on, or a pose, where the car is put, standing. It may call SERVICES, and read and set
the parameters `mu`, `planner_mu`, `max_speed`, `paused`, `driver` and `planner.SETTING`. The server is that of
foxglove-sdk (the extra `foxglove`). It listens on 127.0.0.1 unless another address is given: whoever reaches it may
drive the car.
"""

from __future__ import annotations

import contextlib
import json
import logging
import math
import queue
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

import mujoco
import numpy as np

from fg_mujoco.addons.look.live.browser import check_port
from fg_mujoco.addons.look.live.browser_shapes import Shape, world_shapes
from fg_mujoco.addons.look.live.live_session import LiveSession
from fg_mujoco.addons.ros.bag_messages import (
    BASE_FRAME,
    DRIVE,
    MAP_FRAME,
    ODOM_FRAME,
    POSE_WITH_COVARIANCE,
    clock_message,
    definition,
    drive_message,
    from_cdr,
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
from fg_mujoco.addons.ros.bag_writer import LATCHED, MOTOR_TOPIC, car_mounts
from fg_mujoco.addons.ros.composed_topics import motor_message
from fg_mujoco.addons.ros.occupancy_grid import grid_of
from fg_mujoco.course.documents import parse_json
from fg_mujoco.errors import FgMujocoError, MessageError, SettingsError, missing_extra
from fg_mujoco.messages import STOP, DriveCommand, shown
from fg_mujoco.simulation.physics import STATE

from .client_commands import HELD, TWIST, command_of, pose_of

HOST, PORT = "127.0.0.1", 8765

ACCEPTED = {"/drive": DRIVE, "/cmd_vel": TWIST, "/initialpose": POSE_WITH_COVARIANCE}
"""Topics that clients may publish on, with their types."""

SERVICES = ("/reset", "/pause")

PROTOCOL = (
    "the protocol foxglove.sdk.v1, which Foxglove since 2025 and Lichtblick newer than 1.21 speak, "
    "and not the older foxglove.websocket.v1"
)
"""What clients must speak."""

_LOGS = ("foxglove", "foxglove_py")  # of the library, and of its calls of this module
_SCENE, _CAR = "/scene", "/car"
_DRIVERS = ("planner", "commands")
_FRAME_OF_BODY = "body_{}"
_MOST_WAITING = 400  # commands, 10 s of ticks
_SLOW = 0.25  # [s] between two messages to which parameters and status belong


class FoxgloveServer:
    """Serves a session to Foxglove, and to whatever speaks its WebSocket protocol, at `url`; port 0: any that is free.

    With `step_on_drive` a tick is driven for each command, in the order in which they come, and time stands still
    between them. At most 400 commands wait for their ticks. Further ones are dropped, and clients are told. `log` takes
    lines that say who was refused, at most one a second.
    Raises MissingExtraError: the extra `foxglove` is not installed; SettingsError: an address that cannot be listened
    on.
    """

    def __init__(
        self,
        session: LiveSession,
        *,
        host: str = HOST,
        port: int = PORT,
        step_on_drive: bool = False,
        log: Callable[[str], None] | None = None,
    ) -> None:
        require_foxglove()
        if port:
            check_port(host, port)
        import foxglove
        from foxglove.websocket import Capability

        self.session, self._step_on_drive = session, step_on_drive
        self._stop = threading.Event()
        self._waiting: queue.Queue[DriveCommand | None] = queue.Queue(_MOST_WAITING)  # None: nothing more comes
        self._refusals = _Refusals(log or (lambda line: None))
        self._refusals.listen()
        self._context = foxglove.Context()
        self._channels: dict[str, Any] = {}
        self._last: dict[str, tuple[bytes, int]] = {}  # of the latched topics
        self._asked: set[str] = set()  # latched topics that somebody has subscribed to since the last tick
        self._commanded: float | None = None  # [s] on the wall's clock, of the last command from outside
        self._world: Any = None  # whose scene was sent
        self._said = ""  # the message of the session that clients were told last
        wanted = (Capability.ClientPublish, Capability.Parameters, Capability.Services, Capability.Time)
        self._server = foxglove.start_server(
            name="fg_mujoco", host=host, port=port, capabilities=list(wanted), supported_encodings=["json", "cdr"],
            server_listener=_Listener(self), services=[_service(name, self._serve) for name in SERVICES],
            context=self._context,
        )  # fmt: skip
        self.port = int(self._server.port)
        self.url = f"ws://{'localhost' if host in ('127.0.0.1', '0.0.0.0', '::1', '::') else host}:{self.port}"
        self.publish()

    def __enter__(self) -> FoxgloveServer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End `run`, and stop serving."""
        self._stop.set()
        with contextlib.suppress(queue.Full):  # then nobody waits for a command
            self._waiting.put_nowait(None)
        self._server.stop()
        self._refusals.close()

    def run(self) -> None:
        """Drive on in real time, or a tick for each command, until `close` or Ctrl-C."""
        due = slow = time.monotonic()
        while not self._stop.is_set():
            if not self._step_on_drive:
                self.tick()
            elif not self.step(_SLOW):
                self._publish_slowly()
                continue
            now = time.monotonic()
            if now - slow >= _SLOW:
                slow = now
                self._publish_slowly()
            if not self._step_on_drive:
                due = max(due + self.session.period, now - 4.0 * self.session.period)
                self._stop.wait(max(0.0, due - time.monotonic()))

    def step(self, patience: float) -> bool:
        """Drive a tick by the next command that waits; answer whether there was one within a time [s]."""
        try:
            command = self._waiting.get(timeout=patience)
        except queue.Empty:
            return False
        if command is None:
            return False
        self.session.hold(command)
        self.tick()
        return True

    def tick(self) -> None:
        """Drive on for a tick, and publish what the car senses then."""
        late = self._commanded is not None and time.monotonic() - self._commanded > HELD
        if late and not self._step_on_drive and self.session.held_from_outside:
            self.session.hold(STOP)  # whoever has driven is gone, or has let go
        self.session.tick()
        self.publish()

    def publish(self) -> None:
        """Publish the present moment."""
        session, simulation = self.session, self.session.simulation
        now = nanoseconds(simulation.time)
        self._server.broadcast_time(now)
        self._log("/clock", clock_message(now), now)
        if self._world is not session.world:
            self._world = session.world
            self._send_scene(now)
        pose, (vx, vy) = simulation.engine.free_joint(0)
        position, quaternion, heading = pose[:3], pose[3:], simulation.pose[2]
        lateral = float(vy * math.cos(heading) - vx * math.sin(heading))
        odometry = session.odometry
        moved = [(ODOM_FRAME, BASE_FRAME, position, quaternion), *self._body_frames(simulation.state)]
        self._log("/tf", transform_message(now, moved), now)
        self._log("/odom", odometry_message(odometry, position, quaternion, lateral), now)
        self._log("/imu", imu_message(odometry), now)
        self._log("/joint_states", joints_message(odometry, session.world.parameters.wheel_radius), now)
        self._log(MOTOR_TOPIC, motor_message(odometry, session.world.parameters.mass), now)
        self._log("/scan", scan_message(session.scan), now)
        steering_angle, speed = simulation.engine.commands[0].tolist()
        self._log("/drive", drive_message(DriveCommand(steering_angle=steering_angle, speed=speed), now), now)
        self._channel(_CAR).log(session.numbers(), log_time=now)
        asked, self._asked = self._asked, set()
        for topic in asked & set(self._last):
            self._channels[topic].log(self._last[topic][0], log_time=self._last[topic][1])

    def parameters(self) -> dict[str, Any]:
        """Return the parameters and their values, by name."""
        session = self.session
        values: dict[str, Any] = {
            "mu": float(session.world.car.mu), "planner_mu": float(session.settings.assumed_mu),
            "max_speed": float(session.settings.max_speed), "paused": session.paused,
            "driver": _DRIVERS[session.held_from_outside],
        }  # fmt: skip
        defaults = session.planner_defaults
        for name in () if defaults is None else defaults.__dataclass_fields__:
            value = session.planner_settings.get(name, getattr(defaults, name))
            if isinstance(value, (bool, int, float, str)):
                values[f"planner.{name}"] = value
        return {name: value for name, value in values.items() if not isinstance(value, float) or math.isfinite(value)}

    def set_parameter(self, name: str, value: Any) -> None:
        """Set a parameter, of the car or its planner at the next tick; SettingsError: none, or its value."""
        known = self.parameters()
        if name not in known:
            raise SettingsError(f"{name} is no parameter; accepted: {', '.join(known)}")
        if name == "paused":
            if not isinstance(value, bool):
                raise SettingsError(f"paused is {shown(value)}; accepted: true or false")
            self.session.paused = value
        elif name == "driver":
            if value not in _DRIVERS:
                raise SettingsError(f"driver is {shown(value)}; accepted: {' or '.join(_DRIVERS)}")
            self.session.hold(None if value == _DRIVERS[0] else STOP)
        else:
            self.session.change(name, value)

    def take(self, topic: str, encoding: str, content: bytes) -> None:
        """Take a message of a client; MessageError: another topic, not of its type, or too many wait for ticks."""
        if topic not in ACCEPTED:
            raise MessageError(f"nobody listens to {topic}; accepted: {', '.join(ACCEPTED)}")
        message = _read(topic, encoding, content)
        try:
            if topic == "/initialpose":
                self.session.put(*pose_of(message))
                return
            command = command_of(ACCEPTED[topic], message, self.session.world.parameters.wheelbase)
        except (AttributeError, TypeError, ValueError, OverflowError) as error:
            said = " ".join(str(error).split())
            accepted = f"finite numbers of {ACCEPTED[topic]}"
            raise MessageError(f"a message on {topic}: {said}; accepted: {accepted}") from error
        self._commanded = time.monotonic()
        if not self._step_on_drive:
            self.session.hold(command)
            return
        try:
            self._waiting.put_nowait(command)
        except queue.Full:
            raise MessageError(
                f"a command on {topic} is dropped: {_MOST_WAITING} wait for their ticks; accepted: one for each scan"
            ) from None

    def subscribed(self, topic: str) -> None:
        """Send a latched topic once more, to who has just subscribed."""
        if topic in LATCHED or topic == _SCENE:
            self._asked.add(topic)

    def _serve(self, name: str) -> dict[str, Any]:
        if name == "/reset":
            self.session.reset()
        else:
            self.session.paused = not self.session.paused
        return {"success": True, "message": ""}

    def _publish_slowly(self) -> None:
        from foxglove import Parameter
        from foxglove.websocket import StatusLevel

        self._server.publish_parameter_values([
            Parameter(name, value=value) for name, value in self.parameters().items()
        ])
        said, self._said = self._said, self.session.message
        if self._said and self._said != said:
            self._server.publish_status(self._said, StatusLevel.Info, "race")
        elif said and not self._said:
            self._server.remove_status(["race"])

    def report(self, error: FgMujocoError) -> None:
        """Tell clients what was refused."""
        from foxglove.websocket import StatusLevel

        self._server.publish_status(" ".join(str(error).split()), StatusLevel.Warning, "refused")

    def _send_scene(self, now: int) -> None:
        """Publish what belongs to the world: the map, what is mounted where, and the shapes."""
        world = self.session.world
        self._model, shapes = world_shapes(world)
        self._data = mujoco.MjData(self._model)
        self._bodies = sorted({shape.body for shape in shapes if shape.body})
        start = np.array(world.track.start_pose()[:2])
        grid = grid_of(world.model, start)
        self._log("/map", grid_message(now, grid.cells, grid.resolution, grid.origin), now)
        self._log("/tf_static", transform_message(now, car_mounts(world.model)), now)
        from foxglove.messages import SceneEntity, SceneUpdate

        entities = [
            SceneEntity(
                id=str(number), frame_id=_FRAME_OF_BODY.format(shape.body) if shape.body else MAP_FRAME,
                triangles=[_triangles(shape)],
            )
            for number, shape in enumerate(shapes)
        ]  # fmt: skip
        self._send(_SCENE, SceneUpdate(entities=entities).encode(), now)

    def _body_frames(self, state: Any) -> list[tuple[str, str, Any, Any]]:
        mujoco.mj_setState(self._model, self._data, state, int(STATE))
        mujoco.mj_kinematics(self._model, self._data)
        return [
            (MAP_FRAME, _FRAME_OF_BODY.format(body), self._data.xpos[body].copy(), self._data.xquat[body].copy())
            for body in self._bodies
        ]

    def _log(self, topic: str, message: Any, now: int) -> None:
        self._send(topic, to_cdr(message), now, message.__msgtype__)

    def _send(self, topic: str, content: bytes, now: int, kind: str = "") -> None:
        if topic in LATCHED or topic == _SCENE:
            self._last[topic] = content, now
        self._channel(topic, kind).log(content, log_time=now)

    def _channel(self, topic: str, kind: str = "") -> Any:
        if topic not in self._channels:
            from foxglove import Channel, Schema
            from foxglove.messages import SceneUpdate

            if kind:
                schema = Schema(name=kind, encoding="ros2msg", data=definition(kind).encode())
                made = Channel(topic, schema=schema, message_encoding="cdr", context=self._context)
            elif topic == _SCENE:
                schema = SceneUpdate.get_schema()
                made = Channel(topic, schema=schema, message_encoding="protobuf", context=self._context)
            else:
                made = Channel(topic, context=self._context)
            self._channels[topic] = made
        return self._channels[topic]


class _Refusals(logging.Handler):
    """Says whose handshake the library has refused, and what failed here, which its log alone knows."""

    def __init__(self, log: Callable[[str], None]) -> None:
        super().__init__(logging.ERROR)
        self._log, self._logged = log, -math.inf

    def listen(self) -> None:
        """Begin to listen to the library's log."""
        import foxglove

        for name in _LOGS:
            logging.getLogger(name).propagate = False
            logging.getLogger(name).addHandler(self)
        root = logging.getLogger()
        handlers = root.handlers[:]
        foxglove.set_log_level(logging.ERROR)
        root.handlers[:] = handlers  # the library sets up Python's logging, which is not ours to do

    def close(self) -> None:
        """Listen no more."""
        for name in _LOGS:
            logging.getLogger(name).removeHandler(self)
        super().close()

    def emit(self, record: logging.LogRecord) -> None:
        """Take an entry of the log: "Dropping client ADDRESS: handshake failed" or "Callback failed: ERROR"."""
        said, now = record.getMessage(), time.monotonic()
        refused = said.endswith("handshake failed")
        if (refused or said.startswith("Callback failed")) and now - self._logged >= 1.0:
            self._logged = now
            self._log(f"{said}; accepted: {PROTOCOL}" if refused else said)


class _Listener:
    """Passes what clients do on to a server; see foxglove.websocket.ServerListener."""

    def __init__(self, server: FoxgloveServer) -> None:
        self._server = server
        self._topics: dict[tuple[int, int], tuple[str, str]] = {}  # of each client's channels: topic and encoding

    def on_subscribe(self, client: Any, channel: Any) -> None:
        """Send latched topics again."""
        self._server.subscribed(channel.topic)

    def on_unsubscribe(self, client: Any, channel: Any) -> None:
        """Do nothing."""

    def on_client_advertise(self, client: Any, channel: Any) -> None:
        """Remember the topic of a client's channel."""
        self._topics[client.id, channel.id] = channel.topic, channel.encoding

    def on_client_unadvertise(self, client: Any, client_channel_id: int) -> None:
        """Forget it."""
        self._topics.pop((client.id, client_channel_id), None)

    def on_message_data(self, client: Any, client_channel_id: int, data: bytes) -> None:
        """Take a message; say what was wrong with one that is refused."""
        topic, encoding = self._topics.get((client.id, client_channel_id), ("", ""))
        try:
            self._server.take(topic, encoding, data)
        except FgMujocoError as error:
            self._server.report(error)

    def on_get_parameters(self, client: Any, param_names: list[str], request_id: str | None = None) -> list[Any]:
        """Return the parameters of these names, or all."""
        from foxglove import Parameter

        known = self._server.parameters()
        return [Parameter(name, value=known[name]) for name in (param_names or known) if name in known]

    def on_set_parameters(self, client: Any, parameters: list[Any], request_id: str | None = None) -> list[Any]:
        """Set parameters; say what was wrong with those that are refused."""
        for parameter in parameters:
            try:
                self._server.set_parameter(parameter.name, parameter.get_value())
            except FgMujocoError as error:
                self._server.report(error)
        return self.on_get_parameters(client, [])

    def on_parameters_subscribe(self, param_names: list[str]) -> None:
        """Do nothing: all get the parameters four times a second."""

    def on_parameters_unsubscribe(self, param_names: list[str]) -> None:
        """Do nothing."""

    def on_connection_graph_subscribe(self) -> None:
        """Do nothing."""

    def on_connection_graph_unsubscribe(self) -> None:
        """Do nothing."""


def require_foxglove() -> None:
    """Make sure that Foxglove can be served; MissingExtraError: foxglove-sdk, or a part of the extra `ros`."""
    require_ros_extra()
    from importlib.util import find_spec

    if find_spec("foxglove") is None:
        raise missing_extra("a view in Foxglove needs foxglove-sdk", "foxglove")


def _read(topic: str, encoding: str, content: bytes) -> Any:
    """Return a client's message, whose fields are attributes."""
    try:
        if encoding == "cdr":
            return from_cdr(content, ACCEPTED[topic])
        if encoding == "json":
            return _Fields(parse_json(content))
    except Exception as error:  # whatever is wrong with bytes that somebody has sent
        raise MessageError(f"a message on {topic} cannot be read as {encoding}; accepted: {ACCEPTED[topic]}") from error
    raise MessageError(f"a message on {topic} is encoded as {shown(encoding)}; accepted: json or cdr")


class _Fields:
    """Values of a JSON object as attributes; one that it lacks is 0, as in a message of ROS."""

    def __init__(self, values: Any) -> None:
        if not isinstance(values, Mapping):
            raise ValueError(f"{shown(values)} is no object")
        self._values = values

    def __getattr__(self, name: str) -> Any:
        value = self._values.get(name, 0.0)
        return _Fields(value) if isinstance(value, Mapping) else value


def _service(name: str, serve: Any) -> Any:
    from foxglove import Service, ServiceSchema

    def handle(request: Any) -> bytes:
        return json.dumps(serve(request.service_name)).encode()

    return Service(name, schema=ServiceSchema(name="std_srvs/srv/Trigger"), handler=handle)


def _triangles(shape: Shape) -> Any:
    """Return the triangles of a shape."""
    from foxglove.messages import Color, Point3, Pose, Quaternion, TriangleListPrimitive, Vector3

    red, green, blue = (value / 255.0 for value in shape.colour)
    return TriangleListPrimitive(
        pose=Pose(position=Vector3(x=0.0, y=0.0, z=0.0), orientation=Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)),
        points=[Point3(x=x, y=y, z=z) for x, y, z in shape.vertices.tolist()],
        color=Color(r=red, g=green, b=blue, a=shape.opacity), indices=shape.faces.ravel().tolist(),
    )  # fmt: skip
