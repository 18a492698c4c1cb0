"""The server of a live race on ROS 2: publishes the race's topics where somebody reads them, and takes commands.

Topics are those of `live_race`, and /reset (std_msgs/Empty) and /pause_sim (std_msgs/Bool).
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

from fg_mujoco.addons.look.live.live_session import LiveSession
from fg_mujoco.addons.ros.bag_messages import DRIVE, from_cdr
from fg_mujoco.addons.ros.node_host.drive_topics import DRIVE as DRIVE_TOPIC
from fg_mujoco.addons.ros.node_host.drive_topics import OPPONENT_DRIVE
from fg_mujoco.addons.ros.node_host.sensing import is_anothers
from fg_mujoco.errors import FgMujocoError, MessageError, SettingsError, accepted_names

from ..client_commands import ACKERMANN, TWIST, TWIST_STAMPED
from ..live_race import GOAL, PLACE, STANDING, TAKEN, LiveRace
from .dds_types import cdr_of, known_kind
from .participant import Participant

NODE = "fg_mujoco"
RESET, PAUSE = "/reset", "/pause_sim"
_SCAN = "/scan"
_SHARED = ("/tf", "/tf_static", DRIVE_TOPIC)  # topics that many publish on
_ESTIMATED = ("/map", "/map_metadata", "/pf/pose/odom", "/pf/viz/inferred_pose", "/amcl_pose")
"""Topics that are left to a node that publishes on them: they are of a map server, or of a localization."""
_SWITCHES = {RESET: "std_msgs/msg/Empty", PAUSE: "std_msgs/msg/Bool"}
_NO_COMMANDS = (*_SWITCHES, PLACE, OPPONENT_DRIVE)  # for the car
_OF_ALL = ("/rosout", "/parameter_events")  # that each node of ROS publishes on
_MOST_NAMED = 5  # topics in a message
_COMMAND_KINDS = (DRIVE, ACKERMANN, TWIST, TWIST_STAMPED)
_TOPIC = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")
_LOOK_EVERY = 0.1  # [s] of wall time between two looks at who reads and publishes
_SETTLED = 0.4  # [s] after which a node that has come knows the topics here, too
_UNANSWERED = 5.0  # [s] without a command after which the present moment is published again; then twice as long
_LOOK_FIRST = 0.5  # [s] for which other simulators are looked for
_ALONE = 10.0  # [s] without a node after which it is said what may be wrong
_LOGGED_EVERY = 1.0  # [s] of wall time
_MOST_LATE = 4.0  # ticks that are made up for, where the machine was too slow


class Ros2Server:
    """Serves a session as a node of ROS 2; `url` is the domain and the node, as text.

    With `step_on_drive` a tick is driven for each command, and time stands still between them. `types` are those of
    commands by topic, `package/msg/Name`, where it is another than usual, or another topic. `log` takes lines that say
    what was refused, at most one a second. Further settings are those of the Participant.
    Raises MissingExtraError: the extra `ros2` is not installed; SettingsError: a setting that cannot be, or a domain
    with another simulator of these topics.
    """

    def __init__(
        self,
        session: LiveSession,
        *,
        step_on_drive: bool = False,
        types: Mapping[str, str] | None = None,
        log: Callable[[str], None] | None = None,
        **participant: Any,
    ) -> None:
        self._log: Callable[[str], None] = log or (lambda line: None)
        self._logged = -_LOGGED_EVERY
        self._open = True
        self._fresh: set[str] = set()  # topics with readers that have not got the present moment
        self._came = 0.0  # [s] of wall time, when the last reader or publisher came
        self._driving = 0  # publishers of commands
        self._asked: set[str] = set()  # topics of the present moment that nobody has answered
        self._others: dict[str, str] = {}  # types of further topics of commands that have a publisher
        self._unread: dict[str, str] = {}  # types of other topics that have a publisher, until it is told of
        self._told: set[str] = set()  # those of them that it was said of what becomes of them
        self._alone = math.inf  # [s] when to say that no node has come
        self._again, self._patience = math.inf, _UNANSWERED  # [s] when they are published again
        self._race = LiveRace(
            session, step_on_drive=step_on_drive, encode=cdr_of, send=self._send,
            listened=lambda: self._participant.listened, tell=lambda level, text: self._log(text),
        )  # fmt: skip
        taken = _taken(types or {}, self._race.published)
        self._participant = joined = Participant(NODE, log=self._log, **participant)
        self.url = f"domain {joined.domain} of ROS 2, node {joined.node}"
        self._two = (
            f"{_SCAN} on domain {joined.domain} has a publisher, another simulator or a robot; "
            "accepted: another domain, --domain N, or topics below a name, --namespace NAME"
        )
        if joined.is_published(_SCAN, _LOOK_FIRST):
            joined.close()
            raise SettingsError(self._two)
        for topic, kind in self._race.published.items():
            joined.offer(topic, kind)
        self._taken = {topic: {kind} for topic, kind in taken.items()}
        for topic, kind in taken.items():
            joined.read(topic, kind)
        joined.announce()
        for topic, content in self._race.moment(STANDING).items():
            joined.write(topic, content)

    def __enter__(self) -> Ros2Server:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End `run`, and leave the domain when it has ended."""
        self._open = False

    def run(self) -> None:
        """Drive on in real time, or a tick for each command, until `close` or Ctrl-C."""
        period, steps, joined = self._race.session.period, self._race.step_on_drive, self._participant
        due = look = time.monotonic()
        self._alone = look + _ALONE
        try:
            while self._open:
                joined.wait((look if steps else min(look, due)) - time.monotonic())
                for topic, kind, content in joined.take():
                    self._take(topic, kind, content)
                now = time.monotonic()
                if now >= look:
                    self._look(now)
                    look = now + _LOOK_EVERY
                if not steps and now >= due:
                    self._race.tick()
                    due = max(due + period, now - _MOST_LATE * period)
        finally:
            joined.close()

    def _look(self, now: float) -> None:
        """See who reads and publishes; who has begun to read while time stands still gets the present moment."""
        for topic, who, kind in self._participant.come():
            self._alone = math.inf
            if who == "publisher" and topic in self._taken:
                self._take_type(topic, kind)
                self._came = now
            elif who == "publisher" and topic in self._race.published:
                self._share(topic)
            elif who == "publisher" and topic.startswith("/") and not (topic in _OF_ALL or is_anothers(topic)):
                (self._others if kind in _COMMAND_KINDS else self._unread)[topic] = kind
                self._came = now
        driving = [topic for topic in self._participant.publishers() if topic not in _NO_COMMANDS]
        if self._others:
            driving = self._take_others(driving, settled=now - self._came > _SETTLED)
        if self._race.step_on_drive and len(driving) > max(1, self._driving):
            where = ", ".join(dict.fromkeys(driving))
            self._log(f"each command of {len(driving)} publishers, on {where}, is a tick; accepted: one publisher")
        self._driving = len(driving)
        if self._unread and now - self._came > _ALONE:
            if not driving and self._race.session.held_from_outside:
                found = ", ".join(f"{topic} ({kind})" for topic, kind in list(self._unread.items())[:_MOST_NAMED])
                said = f"no topic of commands has a publisher; accepted: {DRIVE} on {DRIVE_TOPIC}"
                self._log(f"{said}; there are {found}")
            self._unread.clear()
        if now >= self._alone:
            self._alone = math.inf
            self._log(
                f"no node has come to domain {self._participant.domain}; accepted: nodes with this ROS_DOMAIN_ID on "
                "DDS, by RMW_IMPLEMENTATION=rmw_fastrtps_cpp or rmw_cyclonedds_cpp, not by rmw_zenoh_cpp, which there "
                "is since Jazzy; for those on other machines --host, and where there is no multicast --peer ADDRESS"
            )
        fresh = self._participant.look() - set(STANDING)
        if fresh:
            self._fresh |= fresh
            self._came = now
        if self._fresh and now - self._came > _SETTLED:
            self._asked |= self._fresh
            self._again, self._patience = now, _UNANSWERED
            self._fresh.clear()
        if now >= self._again:
            if self._race.stands:
                for topic, content in self._race.moment(self._asked).items():
                    self._participant.write(topic, content)
            self._again = now + self._patience if self._race.step_on_drive else math.inf
            self._patience *= 2.0

    def _take_others(self, driving: list[str], *, settled: bool) -> list[str]:
        """Read a further topic of commands, the only one of its type, or say that it is not. Return those read."""
        usual = [each for each in driving if each not in self._others]
        for topic in self._others.keys() & self._taken.keys() if usual else ():
            self._participant.unread(topic)
            self._taken.pop(topic)
            self._told.discard(topic)
        driving = usual or driving
        ackermann = [topic for topic, kind in self._others.items() if kind in (DRIVE, ACKERMANN)]
        only = ackermann or list(self._others)
        for topic in sorted(self._others.keys() - self._told) if settled else ():
            kind = self._others[topic]
            self._told.add(topic)
            if only == [topic] and not driving:
                self._taken[topic] = {kind}
                self._participant.read(topic, kind)
                self._log(f"{topic} is the only topic of {kind} that has a publisher, and is taken for {DRIVE_TOPIC}")
                self._participant.announce()
            else:
                accepted = f"{DRIVE_TOPIC}, or --type {topic}={kind}"
                self._log(f"{topic} has a publisher of {kind}, which is not read; accepted: {accepted}")
        return driving

    def _share(self, topic: str) -> None:
        """Say that another publishes on a topic, too, or leave it to that."""
        if topic == _SCAN:
            self._log(self._two)
        elif topic in _ESTIMATED:
            self._participant.withdraw(topic)
            self._participant.announce()
            self._log(f"{topic} has a publisher, to which it is left")
        elif topic not in _SHARED:
            self._log(f"{topic} has a publisher, too, and who reads it gets both; accepted: one publisher")

    def _take_type(self, topic: str, kind: str) -> None:
        """Read commands of a type that somebody has begun to publish; log one that is none of commands."""
        if kind in self._taken[topic]:
            return
        self._taken[topic].add(kind)
        accepted = _kinds(topic)
        if kind in accepted:
            self._participant.read(topic, kind)
            self._participant.announce()
        else:
            self._log(f"{topic} has a publisher of {kind}; accepted: {', '.join(accepted)}")

    def _send(self, topic: str, content: bytes) -> None:
        self._fresh.discard(topic)
        self._asked.clear()
        self._again = math.inf
        self._participant.write(topic, content)

    def _take(self, topic: str, kind: str, content: bytes) -> None:
        """Do what a message asks for; log what is refused."""
        try:
            try:
                message = from_cdr(content, kind)
            except Exception as error:  # of bytes that are not what the type says
                raise MessageError(f"{len(content)} bytes are no {kind}; accepted: its CDR") from error
            if topic == RESET:
                self._race.reset()
            elif topic == PAUSE:
                self._race.session.paused = bool(message.data)
            else:
                self._race.take(topic, kind, message)
        except (FgMujocoError, AttributeError, TypeError, ValueError, OverflowError) as error:
            self._refuse(topic, " ".join(str(error).split()))

    def _refuse(self, topic: str, text: str) -> None:
        now = time.monotonic()
        if now - self._logged >= _LOGGED_EVERY:
            self._logged = now
            self._log(f"{topic}: {text}")


def types_in(texts: Sequence[str]) -> dict[str, str]:
    """Return types by topic, of texts TOPIC=TYPE; SettingsError: a text that is not of this form."""
    found = {}
    for text in texts:
        topic, equals, kind = text.partition("=")
        if not equals or not _TOPIC.fullmatch(topic):
            raise SettingsError(f"type is {text!r}; accepted: TOPIC=TYPE, such as /cmd_vel={TWIST_STAMPED}")
        found[topic] = kind
    return found


def _kinds(topic: str) -> tuple[str, ...]:
    """Return the types that a topic is read with, the usual one first."""
    return (_SWITCHES[topic],) if topic in _SWITCHES else TAKEN.get(topic, _COMMAND_KINDS)


def _taken(types: Mapping[str, str], published: Collection[str]) -> dict[str, str]:
    """Return the type of each topic that is read."""
    found = {topic: _kinds(topic)[0] for topic in (*TAKEN, *_SWITCHES) if topic != GOAL}
    for topic, name in types.items():
        if topic == GOAL or (topic in published and topic not in found):
            accepted = f"{', '.join(found)}, and topics of yours"
            raise SettingsError(f"type of {topic}, which is not read; accepted: {accepted}")
        kind = known_kind(name, _kinds(topic))
        if kind not in _kinds(topic):
            raise SettingsError(f"type of {topic} is {kind}; {accepted_names(kind, _kinds(topic))}")
        found[topic] = kind
    return found
