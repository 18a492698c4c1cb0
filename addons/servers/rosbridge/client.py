"""A client of the rosbridge server: what it has subscribed to and advertised, and the texts on their way to it.

One thread, that of the race, owns all of a client but its inbox and its outbox. Those two are filled and emptied by the
thread of the network, too.
"""

from __future__ import annotations

import json
import math
import threading
import time
from collections import OrderedDict, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

LEVELS = ("info", "warning", "error", "none")
"""Levels of a status; a client is told those from its own on."""

DEPTH = 10
"""Messages of a topic that wait for a client to read them, where it has not said how many: the newest."""

_MOST_ANSWERS = 1000  # statuses and answers that wait; a client that leaves more unread is left
_MOST_LETTERS = 1 << 26  # of the texts that wait for a client; the oldest are lost
_MOST_HELD = 1 << 22  # letters of the messages of a topic that the throttle rate holds back
_TOLD_EVERY = 1.0  # [s] of wall time between two statuses of lost messages


class Outbox:
    """Texts in the order in which they are sent, at most so many of each topic, and 64 MB in all.

    Args:
      wake: is called after a text was put in.
    """

    def __init__(self, wake: Callable[[], Any]) -> None:
        self._wake, self._lock = wake, threading.Lock()
        self._texts: OrderedDict[int, tuple[str, str]] = OrderedDict()  # number -> topic, text
        self._waiting: dict[str, deque[int]] = {}  # of topics of which texts wait
        self._count = self._letters = 0

    def put(self, topic: str, text: str, limit: int) -> int:
        """Put a text behind all others; return how many were taken out for it, the oldest of the topic or of all."""
        with self._lock:
            lost = 0
            if len(self._waiting.get(topic, ())) >= limit:
                self._take_out(self._waiting[topic][0])
                lost += 1
            self._count += 1
            self._waiting.setdefault(topic, deque()).append(self._count)
            self._texts[self._count] = topic, text
            self._letters += len(text)
            while self._letters > _MOST_LETTERS and len(self._texts) > 1:
                self._take_out(next(iter(self._texts)))
                lost += 1
        self._wake()
        return lost

    def take(self) -> str | None:
        """Take out the first text; None: there is none."""
        with self._lock:
            return self._take_out(next(iter(self._texts))) if self._texts else None

    def _take_out(self, number: int) -> str:
        """Take out a text, the first of its topic."""
        topic, text = self._texts.pop(number)
        waiting = self._waiting[topic]
        waiting.popleft()
        if not waiting:
            del self._waiting[topic]
        self._letters -= len(text)
        return text


@dataclass(eq=False)
class Subscription:
    """What a client wants of a topic, which it may have subscribed to several times, with an id each.

    Of several requests the lowest throttle rate and the longest queue count.
    """

    name: str  # of the topic, as the client has it
    throttles: dict[Any, float] = field(default_factory=dict)  # id -> least simulated time between messages [s]
    depths: dict[Any, int] = field(default_factory=dict)  # id -> length of the queue
    waiting: deque[str] = field(default_factory=deque)  # held back by the throttle rate
    sent: float | None = None  # [s] simulated, of the last message
    lost: int = 0  # messages that the client has not read in time, since it was told
    told: float = 0.0  # [s] of wall time

    def due(self, text: str, now: float) -> str | None:
        """Take a message, and return the one to send now [s]; None: it is too early for one."""
        throttle = min(self.throttles.values())
        early = self.sent is not None and 0.0 <= now - self.sent < throttle - 1e-9
        depth = max(self.depths.values())
        if early and not depth:
            return None
        self.waiting.append(text)
        while len(self.waiting) > max(1, min(depth, _MOST_HELD // len(text))):
            self.waiting.popleft()
        if early:
            return None
        self.sent = now
        return self.waiting.popleft()


class Client:
    """Whoever is connected.

    Args:
      name: address and port, for messages.
      wake: is called after something was put into the outbox.
      leave: cuts the connection.

    Attributes:
      inbox: texts that it has sent, and None where it has gone.
      subscriptions: by topic.
      advertised: types of the topics that it publishes on, and whether their last message is kept for later clients.
      kept: those last messages, in JSON, by topic.
      level: of the statuses that it is told, one of LEVELS.
      logged: when a refusal was logged last, on the wall's clock [s].
    """

    def __init__(self, name: str, wake: Callable[[], Any], leave: Callable[[], Any]) -> None:
        self.name, self._leave = name, leave
        self.inbox: deque[str | bytes | None] = deque()
        self.outbox = Outbox(wake)
        self.subscriptions: dict[str, Subscription] = {}
        self.advertised: dict[str, tuple[str, bool]] = {}
        self.kept: dict[str, str] = {}
        self.level, self.logged = "warning", -math.inf

    def send(self, **operation: Any) -> None:
        """Send an operation."""
        if self.outbox.put("", json.dumps(operation), _MOST_ANSWERS):
            self._leave()  # it has not read a thousand answers, and does not mean to

    def status(self, level: str, text: str, id: Any = None) -> None:
        """Tell the client something, if it wants to hear it."""
        if LEVELS.index(level) >= LEVELS.index(self.level):
            self.send(op="status", level=level, msg=" ".join(text.split()), **_id(id))

    def respond(self, service: str, values: Any, result: bool, id: Any) -> None:
        """Answer a call of a service."""
        self.send(op="service_response", service=service, values=values, result=result, **_id(id))

    def publish(self, topic: str, text: str, now: float) -> None:
        """Send a message, in JSON, on a topic that it has subscribed to; `now` is simulated [s].

        Of a client that reads more slowly than messages come the oldest are lost, and it is told.
        """
        subscription = self.subscriptions[topic]
        due = subscription.due(text, now)
        if due is None:
            return
        depth = max(subscription.depths.values()) or DEPTH
        framed = f'{{"op": "publish", "topic": {json.dumps(subscription.name)}, "msg": {due}}}'
        subscription.lost += self.outbox.put(topic, framed, depth)
        wall = time.monotonic()
        if subscription.lost and wall - subscription.told >= _TOLD_EVERY:
            count, subscription.lost, subscription.told = subscription.lost, 0, wall
            self.status("warning", f"{count} messages on {topic} were lost: they come faster than this client reads")


def _id(id: Any) -> dict[str, Any]:
    return {} if id is None else {"id": id}
