"""A live race as ROS has it: topics that sensors publish on, and topics that commands are taken from.

Published are the topics of the node host (`node_host.sensing`) but AutoDRIVE's, by the same names, and /tf_static, the
planner's command on /drive while it drives, _OWN, and of the first opponent _OF_OPPONENT.

Taken are commands on the drive topics that the node host knows and on /cmd_vel, those of the first opponent on
/opp_drive, which are held and no ticks of their own, and poses on /initialpose.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Collection, Sequence
from typing import Any

import numpy as np

from fg_mujoco.addons.look.live.live_session import LiveSession
from fg_mujoco.addons.ros.bag_messages import (
    BASE_FRAME,
    DRIVE,
    DRIVE_TOPICS,
    JOINTS,
    LASER_FRAME,
    MAP_FRAME,
    POSE,
    POSE_WITH_COVARIANCE,
    SCAN,
    TRANSFORMS,
    drive_message,
    joints_message,
    nanoseconds,
    scan_message,
    transform_message,
)
from fg_mujoco.addons.ros.bag_writer import EGO, LATCHED, OPPONENT, car_mounts, car_namespace
from fg_mujoco.addons.ros.node_host.drive_topics import DRIVE as DRIVE_TOPIC
from fg_mujoco.addons.ros.node_host.drive_topics import OPPONENT_DRIVE
from fg_mujoco.addons.ros.node_host.graph import BEGIN, Graph, Subscription
from fg_mujoco.addons.ros.node_host.message_classes import made, message_class
from fg_mujoco.addons.ros.node_host.sensing import MAP_SERVICES, OTHERS, OWN_TO_OTHER, TOPICS, Sensing
from fg_mujoco.errors import MessageError
from fg_mujoco.messages import STOP, DriveCommand
from fg_mujoco.simulation.planner_adapter import OtherCar

from .client_commands import ACKERMANN, HELD, TWIST, TWIST_STAMPED, command_of, pose_of

COMMANDS = {**dict.fromkeys(DRIVE_TOPICS, (DRIVE, ACKERMANN)), "/cmd_vel": (TWIST, TWIST_STAMPED)}
PLACE, GOAL = "/initialpose", "/goal_pose"
TAKEN = {**COMMANDS, OPPONENT_DRIVE: (DRIVE, ACKERMANN), PLACE: (POSE_WITH_COVARIANCE,), GOAL: (POSE,)}
"""Topics that are taken from, with their types, the usual one first. A goal changes nothing."""

STANDING = (*LATCHED, "/map_metadata")
"""Topics with one message, which late subscribers get, too."""

_CAR, _SCAN, _TF, _JOINTS, _OPPONENT_SCAN = "/car", "/scan", "/tf", "/joint_states", "/opp_scan"
_NODE = "clients"  # the subscriptions of all are one
_STRING, _TRUTH, _COUNT, _SECONDS = (f"std_msgs/msg/{name}" for name in ("String", "Bool", "Int32", "Float32"))
_COLLISION = "collision"
_RACE: dict[str, tuple[str, Callable[[LiveSession], Any]]] = {
    _COLLISION: (_TRUTH, lambda session: session.simulation.crashed),
    "lap_count": (_COUNT, lambda session: session.laps.laps_completed),
    "lap_time": (_SECONDS, lambda session: session.simulation.time - sum(session.laps.lap_times)),
    "last_lap_time": (_SECONDS, lambda session: (0.0, *session.laps.lap_times)[-1]),
    "best_lap_time": (_SECONDS, lambda session: min(session.laps.lap_times, default=0.0)),
}
_OWN = {f"{space}/{name}": told for space in ("", f"/{EGO}") for name, told in _RACE.items()}
_OWN[f"/{EGO}/lap_time"] = _RACE["last_lap_time"]  # as f1tenth_gym_ros has it
_OWN |= {
    _JOINTS: (JOINTS, lambda session: None),
    _CAR: (_STRING, lambda session: json.dumps(session.numbers())),
}
_OF_OPPONENT: dict[str, tuple[str, Callable[[LiveSession], Any]]] = {
    _OPPONENT_SCAN: (SCAN, lambda session: None),
    f"/{OPPONENT}/{_COLLISION}": (_TRUTH, lambda session: bool(session.simulation.engine.crashed[1])),
}
_FROM_HERE = _OWN | _OF_OPPONENT
"""Topics that the node host has not, or that the session knows better: type, and value of the field `data`."""


class LiveRace:
    """The race of a session, with `step_on_drive` a tick for each command, and time stands still between them.

    `encode` makes of a message and its type what is sent, `send` is called with topic and encoded message, `listened`
    returns the topics that somebody listens to, and `tell` is called with a level and a text when something has
    happened. `published` are the types of the topics by name, `map` the message on /map.
    """

    def __init__(
        self,
        session: LiveSession,
        *,
        step_on_drive: bool,
        encode: Callable[[Any, str], Any],
        send: Callable[[str, Any], None],
        listened: Callable[[], Collection[str]],
        tell: Callable[[str, str], None],
    ) -> None:
        self.session, self.step_on_drive = session, step_on_drive
        self._encode, self._send, self._listened, self._tell = encode, send, listened, tell
        self._graph = Graph(wall_limit=1.0)  # of no nodes: it only says what is listened to
        self._commanded = self._commanded_opponent = math.inf  # [s] on the wall's clock, of the last command
        self._said = ""  # the message of the session that was told last
        self._standing: dict[str, Any] = {}
        self.published: dict[str, str] = {}
        self._sense()
        others = [topic for names in OTHERS for topic in names] + [OWN_TO_OTHER]
        kinds = {topic: self._sensing.kind_of(topic) for topic in (*TOPICS, *others) if "/autodrive/" not in topic}
        self.published |= {topic: kind for topic, kind in kinds.items() if kind}
        own = _FROM_HERE if len(session.world.cars) > 1 else _OWN
        self.published |= {"/tf_static": TRANSFORMS, DRIVE_TOPIC: DRIVE}
        self.published |= {topic: kind for topic, (kind, _) in own.items()}
        self.map: Any = self._graph.answers[MAP_SERVICES[0]](None).map
        mounted = transform_message(self.now(), self._mounts())
        parts = {"/map": self.map, "/map_metadata": self.map.info, "/tf_static": mounted}
        self._standing = {topic: self._encode(part, self.published[topic]) for topic, part in parts.items()}

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.session.simulation.time

    @property
    def stands(self) -> bool:
        """Whether time stands still until somebody does something."""
        return self.step_on_drive or self.session.paused

    def now(self) -> int:
        """Return the time of ROS [ns]."""
        return BEGIN + nanoseconds(self.time)

    def tick(self) -> bool:
        """Drive on for a tick, and publish what the car senses then; answer whether it did."""
        session = self.session
        now = time.monotonic()
        if not self.step_on_drive:  # whoever has driven is gone, or has let go
            if now - self._commanded > HELD and session.held_from_outside:
                session.hold(STOP)
            if now - self._commanded_opponent > HELD:
                session.hold(STOP, opponent=True)
        driven = session.tick()
        if driven:
            self._publish()
        self._tell_what_happened("info" if driven else "error")
        return driven

    def take(self, topic: str, kind: str, message: Any) -> None:
        """Take a message on one of TAKEN, or a command on another; it is held, or a tick where each one is.

        Raises MessageError.
        """
        if topic == OPPONENT_DRIVE:
            if len(self.session.world.cars) < 2:
                raise MessageError(f"a message on {topic}: there is no second car; accepted: --opponents")
            wheelbase = self.session.world.cars[1].parameters.wheelbase
            self.session.hold(command_of(kind, message, wheelbase), opponent=True)
            self._commanded_opponent = time.monotonic()
        elif topic == PLACE:
            try:
                self.session.put(*pose_of(message))
            except ValueError as error:
                raise MessageError(f"a message on {topic}: {error}; accepted: a finite pose") from error
            self._place()
        elif topic != GOAL:
            self._commanded = time.monotonic()
            self.session.hold(command_of(kind, message, self.session.world.parameters.wheelbase))
            if self.step_on_drive:
                self._step()

    def reset(self) -> None:
        """Begin the race again, and publish the moment at which the car stands there; or MessageError."""
        self.session.reset()
        self._place()

    def moment(self, topics: Collection[str]) -> dict[str, Any]:
        """Return the present messages of topics, encoded, in the order in which they are published: the scan last."""
        session, sensing = self.session, self._sensing
        sensing.surroundings = session.simulation.engine.surroundings(0)
        kinds = {topic: kind for topic in topics if topic not in STANDING and (kind := self.published.get(topic))}
        heard = [topic for topic in kinds if topic not in _FROM_HERE]
        if [each.topic for each in self._graph.subscriptions] != heard:
            self._graph.subscriptions = [
                Subscription(topic, message_class(kinds[topic]), lambda message: None, 1, _NODE, "")
                for topic in heard
            ]
        sensed = dict(sensing.messages(session.scan, session.odometry))
        if _TF in sensed:
            sensed[_TF].transforms.extend(self._other_transforms(sensing.surroundings.others))
        sensed |= {topic: self._of_race(topic, kind) for topic, kind in kinds.items() if topic in _FROM_HERE}
        if DRIVE_TOPIC in kinds and not session.held_from_outside:
            steering_angle, speed = session.simulation.engine.commands[0].tolist()
            command = DriveCommand(steering_angle=steering_angle, speed=speed)
            sensed[DRIVE_TOPIC] = drive_message(command, self.now())
        found = {topic: self._encode(message, kinds[topic]) for topic, message in sensed.items()}
        found |= {topic: part for topic, part in self._standing.items() if topic in topics}
        return dict(sorted(found.items(), key=lambda each: each[0] == _SCAN))

    def _other_transforms(self, others: Sequence[OtherCar]) -> list[Any]:
        """Return where the other cars are, by the names of a bag."""
        moved = []
        for car, other in enumerate(others, start=1):
            x, y, heading = other.pose
            turned = np.array((math.cos(heading / 2), 0.0, 0.0, math.sin(heading / 2)))
            moved.append((MAP_FRAME, f"{car_namespace(car)}/{BASE_FRAME}", np.array((x, y, 0.0)), turned))
        return list(transform_message(self.now(), moved).transforms)

    def _of_race(self, topic: str, kind: str) -> Any:
        """Return the message of a topic that is none of the node host's."""
        session = self.session
        engine, odometry = session.simulation.engine, session.odometry
        if topic == _JOINTS:
            message = joints_message(odometry, session.world.parameters.wheel_radius)
        elif topic == _OPPONENT_SCAN:
            scan = engine.scans.get(1) or engine.beams.to_scan(engine.ranges[1], odometry.stamp)
            message = scan_message(scan, f"{OPPONENT}/{LASER_FRAME}")
        else:
            return made(message_class(kind), data=_FROM_HERE[topic][1](session))
        message.header.stamp.sec += BEGIN // 1_000_000_000
        return message

    def _step(self) -> None:
        if not self.tick():
            paused = self.session.paused and self.session.failure is None
            reason = "the race is paused; accepted: false on /pause_sim" if paused else self.session.message
            raise MessageError(f"no tick was driven: {reason}")

    def _place(self) -> None:
        """Put the car where it was asked to be, and publish the moment at which it stands there."""
        session = self.session
        session.message = ""
        session.obey()
        self._said = session.message  # whoever asked is told
        if session.message:
            raise MessageError(session.message)
        if session.held_from_outside:
            session.hold(STOP)
        self._sense()
        self._publish()

    def _publish(self) -> None:
        for topic, text in self.moment([each for each in self._listened() if each not in STANDING]).items():
            self._send(topic, text)

    def _sense(self) -> None:
        """Begin to sense: odometry and map are those of this moment."""
        self._sensing = Sensing(self._graph, self.session.world.parameters)
        self.moment([])

    def _mounts(self) -> list[tuple[str, str, Any, Any]]:
        world = self.session.world
        mounts = car_mounts(world.model, sensors=self.session.settings.sensed)
        laser = next(each for each in mounts if each[1] == LASER_FRAME)
        others = [mount for car in range(1, len(world.cars)) for mount in car_mounts(world.model, car)]
        return [*mounts, *others, (f"{EGO}/{BASE_FRAME}", f"{EGO}/{LASER_FRAME}", *laser[2:])]

    def _tell_what_happened(self, level: str) -> None:
        said, self._said = self._said, self.session.message
        if self._said not in ("", said):
            self._tell(level, self._said)
            if level == "error":
                self._send(_CAR, self._encode(self._of_race(_CAR, _STRING), _STRING))
