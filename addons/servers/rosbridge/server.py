"""Serves a live race to programs that speak rosbridge: roslibpy, roslibjs and whatever speaks its protocol in JSON.

    session = LiveSession(Setup.of("oval"))
    with RosbridgeServer(session, port=9090) as server:
        server.run()  # until Ctrl-C

Topics and services are those of `live_race`, and those of rosapi; clients also publish to each other. The
thread that calls `run` owns the race and all clients; a second thread reads from the network and writes to it.
"""

from __future__ import annotations

import json
import queue
import time
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import Any

from fg_mujoco.addons.look.live.live_session import LiveSession
from fg_mujoco.addons.ros.bag_messages import GRID
from fg_mujoco.addons.ros.node_host.sensing import MAP_SERVICES
from fg_mujoco.course.documents import parse_json
from fg_mujoco.errors import FgMujocoError, MessageError, accepted_names
from fg_mujoco.messages import shown

from ..live_race import SERVICES, STANDING, TAKEN, LiveRace
from .client import LEVELS, Client, Subscription
from .json_messages import from_json, kind_of, to_json
from .network import Network, require_rosbridge
from .rosapi import BRIDGE, RACE, RosApi

HOST, PORT = "127.0.0.1", 9090

_COMPRESSIONS = ("none", "png", "cbor")
_SLOWEST = 3_600_000  # [ms] of a throttle rate
_LONGEST_QUEUE = 1000  # messages
_MOST_NAMES = 1000  # topics and ids of a client
_LONGEST_NAME = 255  # letters, as in ROS 2
_MOST_KEPT = 1 << 26  # letters of the last messages of a client's topics
_LOGGED_EVERY = 1.0  # [s] of wall time
_MOST_LATE = 4.0  # ticks that are made up for, where the machine was too slow


class RosbridgeServer:
    """Serves a session to clients of rosbridge, version 2 of its protocol.

    Args:
      session: to be driven on.
      host: address to listen on.
      port: to listen on; 0: any that is free.
      step_on_drive: a tick is driven for each command, and time stands still between them.
      log: takes lines that say what was refused to whom, at most one a second of each client; None: nobody does.

    Attributes:
      port: that it listens on.
      url: where clients connect to.

    Raises:
      MissingExtraError: the extra `rosbridge` is not installed.
      SettingsError: an address that cannot be listened on.
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
        require_rosbridge()
        self._log: Callable[[str], None] = log or (lambda line: None)
        self._clients: dict[Client, None] = {}  # in the order in which they were first heard
        self._race = LiveRace(
            session, step_on_drive=step_on_drive, send=self._send,
            encode=lambda message, kind: json.dumps(to_json(message, kind)),
            listened=lambda: {topic for client in self._clients for topic in client.subscriptions},
            tell=self._tell,
        )  # fmt: skip
        self._api = RosApi(self)
        operations = (
            self._advertise, self._unadvertise, self._publish, self._subscribe, self._unsubscribe, self._call_service,
            self._set_level, self._status,
        )  # fmt: skip
        self._operations: dict[str, Callable[[Client, dict[str, Any]], None]] = {
            each.__name__[1:]: each for each in operations
        }
        self._jobs: queue.SimpleQueue[Client | None] = queue.SimpleQueue()  # who has sent something; None: the end
        self._network = Network(self._jobs, host, port)
        self.port = self._network.port
        self.url = f"ws://{'localhost' if host in ('127.0.0.1', '0.0.0.0', '::1', '::') else host}:{self.port}"

    def __enter__(self) -> RosbridgeServer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End `run`, and stop serving."""
        self._jobs.put(None)
        self._network.close()

    def run(self) -> None:
        """Drive on in real time, or a tick for each command, until `close` or Ctrl-C."""
        period, steps = self._race.session.period, self._race.step_on_drive
        due = time.monotonic()
        while True:
            try:
                job = self._jobs.get(timeout=None if steps else max(0.0, due - time.monotonic()))
            except queue.Empty:
                pass
            else:
                if job is None:
                    return
                self._serve(job)
            now = time.monotonic()
            if not steps and now >= due:
                self._race.tick()
                due = max(due + period, now - _MOST_LATE * period)

    # What rosapi asks

    def topic_kinds(self) -> Mapping[str, str]:
        """Return the types of all topics that somebody publishes or takes."""
        taken = {topic: kinds[0] for topic, kinds in TAKEN.items()}
        advertised = {topic: kind for client in self._clients for topic, (kind, _) in client.advertised.items()}
        return {**self._race.published, **taken, **advertised}

    def publishers(self, topic: str) -> list[str]:
        """Return the nodes that publish on a topic."""
        advertised = any(topic in client.advertised for client in self._clients)
        return [RACE] * (topic in self._race.published) + [BRIDGE] * advertised

    def subscribers(self, topic: str) -> list[str]:
        """Return the nodes that take a topic."""
        subscribed = any(topic in client.subscriptions for client in self._clients)
        return [RACE] * (topic in TAKEN) + [BRIDGE] * subscribed

    def now(self) -> int:
        """Return the time of ROS [ns]."""
        return self._race.now()

    # Clients

    def _serve(self, client: Client) -> None:
        """Do what a client has sent; tell it what was wrong with what is refused."""
        text = client.inbox.popleft()
        if text is None:
            self._clients.pop(client, None)
            return
        self._clients[client] = None
        id = None
        try:
            operation = _read(text)
            id = operation.get("id")
            if id is not None and not (isinstance(id, (str, int, float)) and len(str(id)) <= _LONGEST_NAME):
                given, id = id, None
                accepted = f"a text of at most {_LONGEST_NAME} letters or a number"
                raise MessageError(f"id is {shown(given)}; accepted: {accepted}")
            name = operation["op"]
            if not isinstance(name, str) or name not in self._operations:
                raise MessageError(f"op is {shown(name)}; {accepted_names(name, self._operations)}")
            self._operations[name](client, operation)
        except FgMujocoError as error:
            self._refuse(client, str(error), id)
        except Exception as error:  # whatever a peer has thought of, the race of the others goes on
            self._refuse(client, f"it cannot be done: {type(error).__name__}: {error}", id)

    def _refuse(self, client: Client, text: str, id: Any) -> None:
        """Tell a client what was refused; and who has started the server, as roslibpy shows no status."""
        client.status("error", text, id)
        now = time.monotonic()
        if now - client.logged >= _LOGGED_EVERY:
            client.logged = now
            self._log(f"{client.name}: {' '.join(text.split())}")

    def _send(self, topic: str, text: str) -> None:
        """Send a message to all that have subscribed to its topic."""
        for client in self._clients:
            if topic in client.subscriptions:
                client.publish(topic, text, self._race.time)

    def _tell(self, level: str, text: str) -> None:
        for client in self._clients:
            client.status(level, text)

    def _kinds_of(self, topic: str) -> tuple[str, ...]:
        """Return the types that a topic may have; none: it is not known."""
        kind = self.topic_kinds().get(topic)
        return TAKEN.get(topic) or (() if kind is None else (kind,))

    # Operations

    def _advertise(self, client: Client, operation: dict[str, Any]) -> None:
        topic, kind = _name(operation, "topic"), kind_of(operation.get("type"))
        _check_kind(topic, kind, self._kinds_of(topic))
        client.advertised[topic] = kind, operation.get("latch") is True
        _check_count(client.advertised, "topics")

    def _unadvertise(self, client: Client, operation: dict[str, Any]) -> None:
        topic = _name(operation, "topic")
        client.kept.pop(topic, None)
        if client.advertised.pop(topic, None) is None:
            client.status("warning", f"this client has not advertised {topic}", operation.get("id"))

    def _publish(self, client: Client, operation: dict[str, Any]) -> None:
        topic = _name(operation, "topic")
        if topic in self._race.published and topic not in TAKEN:
            raise MessageError(f"{topic} is published by the race; accepted: {', '.join(TAKEN)}, or a name of your own")
        kind, latch = client.advertised.get(topic) or (next(iter(self._kinds_of(topic)), ""), False)
        if not kind:
            raise MessageError(f"{topic} is not known; accepted: a topic that was advertised with its type")
        try:
            message = from_json(operation.get("msg"), kind, self.now())
        except MessageError as error:
            raise MessageError(f"a message on {topic}: {error}") from error
        text = json.dumps(to_json(message, kind))
        if latch:
            client.kept[topic] = text
            if sum(map(len, client.kept.values())) > _MOST_KEPT:
                del client.kept[topic]
                raise MessageError(f"{topic} is not latched: accepted: {_MOST_KEPT} letters of a client in all")
        self._send(topic, text)
        if topic in TAKEN:
            self._race.take(topic, kind, message)

    def _subscribe(self, client: Client, operation: dict[str, Any]) -> None:
        topic, id = _name(operation, "topic"), operation.get("id")
        known = self._kinds_of(topic)
        if operation.get("type") is not None:
            _check_kind(topic, kind_of(operation["type"]), known)
        elif not known:
            accepted = accepted_names(topic, self.topic_kinds(), ", or another with its type")
            raise MessageError(f"{topic} is not known; {accepted}")
        throttle = _count(operation, "throttle_rate", _SLOWEST)
        depth = _count(operation, "queue_length", _LONGEST_QUEUE)
        compression = operation.get("compression", "none")
        if compression not in _COMPRESSIONS:
            raise MessageError(f"compression is {shown(compression)}; accepted: {', '.join(_COMPRESSIONS)}")
        if compression != "none" or operation.get("fragment_size") is not None:
            client.status("warning", f"messages on {topic} come as JSON in one piece, not compressed", id)
        wanted = client.subscriptions.setdefault(topic, Subscription(operation["topic"]))
        wanted.throttles[id], wanted.depths[id] = throttle / 1000.0, depth
        _check_count(wanted.throttles, f"subscriptions to {topic}")
        _check_count(client.subscriptions, "topics")
        kept = next((each.kept[topic] for each in self._clients if topic in each.kept), None)
        if kept is not None:
            client.publish(topic, kept, self._race.time)
        elif topic in STANDING or self._race.stands:
            for text in self._race.moment([topic]).values():
                client.publish(topic, text, self._race.time)

    def _unsubscribe(self, client: Client, operation: dict[str, Any]) -> None:
        topic, id = _name(operation, "topic"), operation.get("id")
        wanted = client.subscriptions.get(topic)
        if wanted is None or (id is not None and id not in wanted.throttles):
            client.status("warning", f"this client has not subscribed to {topic}, or not by this id", id)
            return
        if id is not None:
            del wanted.throttles[id], wanted.depths[id]
        if id is None or not wanted.throttles:
            del client.subscriptions[topic]

    def _call_service(self, client: Client, operation: dict[str, Any]) -> None:
        service, id, request = _name(operation, "service"), operation.get("id"), operation.get("args") or {}
        try:
            values: Any = self._values(service, request)
        except FgMujocoError as error:
            client.respond(service, " ".join(str(error).split()), False, id)
        else:
            client.respond(service, values, True, id)

    def _values(self, service: str, request: Any) -> dict[str, Any]:
        """Return the response of a service that is answered here."""
        if service in SERVICES:
            found = self._race.call(service)
            return found if service not in MAP_SERVICES else {"map": to_json(found["map"], GRID)}
        if service not in self._api.kinds:
            accepted = accepted_names(service, SERVICES, ", or one of rosapi", besides=self._api.kinds)
            raise MessageError(f"service {service} is not known; {accepted}")
        if not isinstance(request, dict):
            raise MessageError(f"args is {shown(request)}; accepted: an object")
        return self._api.answer(service, request)

    def _set_level(self, client: Client, operation: dict[str, Any]) -> None:
        level = operation.get("level")
        if level not in LEVELS:
            raise MessageError(f"level is {shown(level)}; accepted: {', '.join(LEVELS)}")
        client.level = str(level)

    def _status(self, client: Client, operation: dict[str, Any]) -> None:
        """Do nothing: a client's status is not of the race."""


def _read(text: str | bytes) -> dict[str, Any]:
    """Return the operation that a client has sent.

    Raises:
      MessageError: it is none.
    """
    if isinstance(text, bytes):
        raise MessageError(f"{len(text)} bytes were sent; accepted: a text, one object of JSON")
    try:
        found = parse_json(text)
    except (ValueError, RecursionError) as error:
        raise MessageError(f"{shown(text)} is no JSON: {error}; accepted: one object") from error
    if not isinstance(found, dict) or "op" not in found:
        raise MessageError(f"{shown(found)} is no operation; accepted: an object with the field op")
    return found


def _name(operation: dict[str, Any], field: str) -> str:
    """Return the name of a topic or a service, with a slash in front.

    Raises:
      MessageError: there is none.
    """
    name = operation.get(field)
    if not isinstance(name, str) or not name.strip("/") or len(name) > _LONGEST_NAME:
        accepted = f"a name of at most {_LONGEST_NAME} letters, such as /scan"
        raise MessageError(f"{field} is {shown(name)}; accepted: {accepted}")
    return f"/{name.lstrip('/')}"


def _count(operation: dict[str, Any], field: str, most: int) -> int:
    """Return a whole number of an operation; 0: there is none.

    Raises:
      MessageError: it is something else.
    """
    value = operation.get(field)
    if value is None:
        return 0
    if type(value) is not int or not 0 <= value <= most:
        raise MessageError(f"{field} is {shown(value)}; accepted: a whole number from 0 to {most}")
    return value


def _check_count(named: dict[Any, Any], what: str) -> None:
    """Take the last out again where there are too many."""
    if len(named) > _MOST_NAMES:
        named.popitem()
        raise MessageError(f"{_MOST_NAMES} {what} are there; accepted: no more of a client")


def _check_kind(topic: str, kind: str, known: tuple[str, ...]) -> None:
    """Refuse another type than those that a topic has; any is accepted where it is not known."""
    if known and kind not in known:
        raise MessageError(f"type of {topic} is {kind}; accepted: {' or '.join(known)}")
