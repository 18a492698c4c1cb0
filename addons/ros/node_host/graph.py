"""Topics, simulated time and threads of the nodes of one planner.

Each node has a thread. A thread runs only while `tick` waits for it, so that no two run at a time, and always in the
order of their start. So a node may wait anywhere, and the same seed gives the same bits. Between two ticks threads are
resumed at the simulated times that they wait for, in the order of these times. At a tick messages are delivered first.
"""

from __future__ import annotations

import copy
import ctypes
import math
import re
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import monotonic
from types import FrameType
from typing import Any

from fg_mujoco.simulation.showing import pass_on

NANOSECONDS = 1_000_000_000
"""In a second."""
BEGIN = 1_000_000_000 * NANOSECONDS
"""[ns] ROS time at which a race begins: nodes take 0 for "no time yet"."""

_LEAD = 1_000_000  # [ns] from when nodes are made to the first scan: some divide by the time between
_READING = 1_000  # [ns] from one reading of the clock to the next at the same instant
_MOST_ROUNDS = 100_000  # resumptions at one instant before a node is said to let no time pass
_MOST_QUESTIONS = 1000  # whether it is over, at one instant, before time goes on
_COMMANDS = ("ackermann_msgs/", "std_msgs/Float", "geometry_msgs/Twist")  # types of topics that command a car
_RESETS = ("/initialpose", "/reset", "/autodrive/reset_command")
_BRAKE = re.compile(r"/(?:brake|brake_bool|emergency_br(?:ake|aking|eak|eaking))$")
_CLOSING = 0.2  # [s] that a thread has to end
_LONGEST_IMPORTS = 600.0  # [s] of wall time beyond the limit that imports may take


THREAD = threading.local()
"""In the thread of a node `THREAD.graph` is the graph that it is part of."""


class NodeEnded(BaseException):
    """Ends the thread of a node. No Exception: a node that catches those does not catch it."""


class NodeBlockedError(Exception):
    """A node that did not come back within the limit of wall time."""


class NodeError(Exception):
    """A node that has ended, or that does not do what a planner must."""


@dataclass(eq=False)
class Subscription:
    """Who listens to a topic."""

    topic: str
    kind: type
    callback: Callable[[Any], Any]
    depth: int
    node: str
    place: str  # where it was made: "(file, line n)"
    queue: deque[tuple[int, Any]] = field(default_factory=deque)
    process: Process | None = field(default_factory=lambda: _running())

    def __post_init__(self) -> None:
        self.queue = deque(maxlen=max(1, self.depth))


@dataclass(eq=False)
class Publication:
    """Who publishes on a topic."""

    topic: str
    kind: type
    node: str
    place: str
    count: int = 0  # of messages so far
    at: int = 0  # [ns] when the last one was published
    process: Process | None = field(default_factory=lambda: _running())

    @property
    def commands(self) -> bool:
        """Whether its messages may command a car."""
        kind = getattr(self.kind, "_type", "")
        return kind.startswith(_COMMANDS) or self.is_drive_param or self.is_brake_switch

    @property
    def asks_for_reset(self) -> bool:
        """Whether its messages ask the simulator to put the car somewhere, unless they say False."""
        return self.topic in _RESETS

    @property
    def is_brake_switch(self) -> bool:
        """Whether its messages switch an emergency brake on and off."""
        return getattr(self.kind, "_type", "") == "std_msgs/Bool" and bool(_BRAKE.search(self.topic))

    @property
    def is_drive_param(self) -> bool:
        """Whether its messages are like `drive_param` of the F1/10 course, which users define: velocity and angle."""
        return {"velocity", "angle"} <= set(getattr(self.kind, "_makers", ()))


def _running() -> Process | None:
    """Return the thread of a node that runs and that this is; None: it is none."""
    graph: Graph | None = getattr(THREAD, "graph", None)
    return None if graph is None else graph.current


class Process:
    """The thread of a node, or one that a node has started."""

    def __init__(self, graph: Graph, name: str, target: Callable[[], Any]) -> None:
        self.graph, self.name, self._target = graph, name, target
        self.done = self.running = self.spinning = False
        self.imported, self.importing_since = 0.0, math.inf  # [s] of wall time in the imports of other libraries
        self.error: BaseException | None = None
        self.wake: int | None = None
        self.ready: Callable[[], bool] = lambda: True
        self._go, self._back = threading.Lock(), threading.Lock()  # taken: each is released to hand over
        self._go.acquire()
        self._back.acquire()
        self._thread = threading.Thread(target=self._run, name=f"ros:{name}", daemon=True)
        self._thread.start()

    @property
    def due(self) -> bool:
        """Whether there is something for it to do now."""
        return not self.done and ((self.wake is not None and self.wake <= self.graph.now) or self.ready())

    def resume(self, limit: float) -> None:
        """Let it run until it waits, and raise what the node raises.

        Raises NodeBlockedError: it did not within a limit [s].
        """
        self.running = True
        self._go.release()
        self.imported, left = 0.0, limit
        began = monotonic()
        while not self._back.acquire(timeout=left):
            now = monotonic()
            imported = min(self.imported + max(0.0, now - self.importing_since), _LONGEST_IMPORTS)
            left = began + limit + imported - now
            if left <= 0.0:
                raise NodeBlockedError(
                    f"node {self.name!r} has not come back within {limit:g} s of wall time{self._where()}; accepted: "
                    "less to do at one instant, or a longer limit: [host.wall_limit=SECONDS]"
                )
        self.running = False
        if self.error is not None:
            error, self.error = self.error, None
            raise error

    def pause(self, wake: int | None, ready: Callable[[], bool]) -> None:
        """Wait, in its own thread, for a simulated time [ns] or until it is ready; NodeEnded: the race is over."""
        if self.graph.closed:
            raise NodeEnded
        self.wake, self.ready = wake, ready
        self._back.release()
        self._go.acquire()
        if self.graph.closed:
            raise NodeEnded

    def close(self) -> None:
        """End the thread: where it waits, or where it runs on and has not come back."""
        if not self.done and not self.running:
            self._go.release()
            self._thread.join(_CLOSING)
        elif not self.done and self._thread.ident is not None:
            thread = ctypes.c_ulong(self._thread.ident)
            ctypes.pythonapi.PyThreadState_SetAsyncExc(thread, ctypes.py_object(NodeEnded))

    def _run(self) -> None:
        self._go.acquire()
        THREAD.graph = self.graph
        try:
            if not self.graph.closed:
                pass_on(lambda: self.graph.listener)  # the thread that decides is another one
                self._target()
        except (NodeEnded, SystemExit, KeyboardInterrupt):  # the latter two a node raises to end itself
            pass
        except BaseException as error:
            self.error = error
        self.done = True
        self._back.release()

    def _where(self) -> str:
        frame = sys._current_frames().get(self._thread.ident or 0)
        found = self.graph.place_of(frame)
        del frame
        return found


class Graph:
    """The nodes of one planner; `wall_limit` [s] is of wall time in which a node must wait again."""

    def __init__(self, wall_limit: float) -> None:
        self.wall_limit = wall_limit
        self.now = BEGIN - _LEAD
        self.closed = False
        self.files: set[str] = set()  # of the nodes, as their code names them
        self.data: set[str] = set()  # paths of files that the nodes have read
        self.processes: list[Process] = []
        self.current: Process | None = None
        self.subscriptions: list[Subscription] = []
        self.publications: list[Publication] = []
        self.latched: dict[str, Any] = {}
        self.newest: dict[str, Any] = {}  # message that a node has published, by topic
        self.journal: list[tuple[int, str, Any]] | None = None  # time, topic and message of all that nodes publish
        self.listener: Any = None  # what takes the values that nodes show by `fg_mujoco.show`; None: nobody looks
        self.provided: dict[str, str] = {}  # types of the topics that the host publishes on
        self.spares: Callable[[Process, Exception], bool] = lambda *_: False  # whether a failed thread ends alone
        self.answers: dict[str, Callable[[Any], Any]] = {}  # services that the host answers, by name
        self.transforms: dict[str, tuple[str, Any]] = {}  # child frame -> parent frame, matrix (4, 4)
        self.waiting_for_transforms: list[tuple[Any, Callable[[], Any]]] = []  # future, and what looks for it again
        self._read = 0  # [ns] last time that a node has read
        self.ticks = 0
        self.told_of_numpy = False  # whether a warning of NumPy's scalars has been given
        self._count = self._asked = 0
        self._asked_at = 0

    def start(self, name: str, target: Callable[[], Any]) -> Process:
        """Add a thread, which runs for the first time when its turn comes."""
        process = Process(self, name, target)
        self.processes.append(process)
        return process

    def close(self) -> None:
        """End all threads."""
        self.closed = True
        for process in self.processes:
            process.close()

    def tick(self, time: int, messages: Iterable[tuple[str, Any]]) -> None:
        """Go on to a time [ns], deliver messages, and let nodes do all that is due; raises what a node raises."""
        while True:
            self.settle()
            nearest = min((p.wake for p in self.processes if not p.done and p.wake is not None), default=time)
            if nearest >= time:
                break
            self._go_on_to(nearest)
        self._go_on_to(time)
        for topic, message in messages:
            self.deliver(topic, message)
        self.ticks += 1
        self.settle()

    def settle(self) -> None:
        """Let each thread run that has something to do now, in order, until none has."""
        for _ in range(_MOST_ROUNDS):
            due = [process for process in self.processes if process.due]
            if not due:
                return
            for process in due:
                self.current = process
                try:
                    process.resume(self.wall_limit)
                except Exception as error:
                    if not self.spares(process, error):
                        raise
                self.current = None
        raise NodeError(f"node {due[0].name!r} lets no simulated time pass: it is always ready to do something more")

    def pause(self, wake: int | None, ready: Callable[[], bool] = lambda: False, *, spinning: bool = False) -> None:
        """Let the thread wait for a time [ns], None: any, or until it is ready; `spinning`: for callbacks only."""
        process = self.current
        if process is None:
            raise NodeEnded
        process.spinning = spinning
        process.pause(wake, ready)

    @contextmanager
    def importing(self) -> Iterator[None]:
        """Leave what is done within out of the wall time that the thread that runs may take."""
        process = self.current
        if process is None:
            yield
            return
        process.importing_since = monotonic()
        try:
            yield
        finally:
            process.imported += monotonic() - process.importing_since
            process.importing_since = math.inf

    def poll(self, ready: Callable[[], bool] = lambda: False, wake: int | None = None) -> None:
        """Let the thread that runs wait for the next tick: it asked without waiting, and there was nothing."""
        tick = self.ticks
        self.pause(wake, lambda: self.ticks > tick or ready())

    def breathe(self) -> None:
        """Let time go on for a loop that asks "is it over?" again and again, and waits for nothing."""
        if self.current is None or self.closed:
            return
        self._asked = self._asked + 1 if self._asked_at == self.now else 1
        self._asked_at = self.now
        if self._asked > _MOST_QUESTIONS:
            self._asked = 0
            self.poll()

    def deliver(self, topic: str, message: Any) -> None:
        """Put a message into the queues of those who listen; each but the first gets a copy of its own."""
        first = True
        for subscription in self.subscriptions:
            if subscription.topic == topic and isinstance(message, subscription.kind):
                self.queue(subscription, message if first else copy.deepcopy(message))
                first = False

    def queue(self, subscription: Subscription, message: Any) -> None:
        """Put a message behind all that were sent before."""
        self._count += 1
        subscription.queue.append((self._count, message))

    def subscribe(self, subscription: Subscription) -> None:
        """Add one who listens; the last message of a latched topic comes at once."""
        self.subscriptions.append(subscription)
        kept = self.latched.get(subscription.topic)
        if isinstance(kept, subscription.kind):
            self.queue(subscription, copy.deepcopy(kept))

    def bury(self, process: Process) -> None:
        """Leave out what a thread that has failed publishes and listens to."""
        self.publications = [each for each in self.publications if each.process is not process]
        self.subscriptions = [each for each in self.subscriptions if each.process is not process]

    def forget(self, subscription: Subscription) -> None:
        """Leave out one who listens no longer."""
        if subscription in self.subscriptions:
            self.subscriptions.remove(subscription)

    def publish(self, publication: Publication, message: Any, *, latch: bool = False) -> None:
        """Send a copy of a message to all who listen."""
        publication.count += 1
        publication.at = self.now
        listened = self.listens(publication.topic)
        if not (publication.commands or publication.asks_for_reset or latch or listened or self.journal is not None):
            return  # nobody sees it
        self.newest.pop(publication.topic, None)  # the topic that was published on last is the last
        kept = self.newest[publication.topic] = copy.deepcopy(message)
        if self.journal is not None:
            self.journal.append((self.now, publication.topic, kept))
        if latch:
            self.latched[publication.topic] = kept
        if listened:
            self.deliver(publication.topic, copy.deepcopy(kept))

    def listens(self, topic: str) -> bool:
        """Return whether a node listens to a topic."""
        return any(subscription.topic == topic for subscription in self.subscriptions)

    def read(self) -> int:
        """Return simulated time [ns]; each further reading at one instant is a microsecond later."""
        self._read = max(self.now, self._read + _READING)
        return self._read

    def wall_time(self) -> float:
        """Return the wall clock's time as nodes read it [s]."""
        return self.read() / 1e9

    def place(self) -> str:
        """Return the line of a node's file that is being executed: " (file, line n)"."""
        return self.place_of(sys._getframe(1))

    def place_of(self, frame: FrameType | None) -> str:
        """Return the innermost line of a node's file from a frame on; nothing where there is none."""
        while frame is not None and frame.f_code.co_filename not in self.files:
            frame = frame.f_back
        return "" if frame is None else f" ({frame.f_code.co_filename}, line {frame.f_lineno})"

    def place_of_error(self, error: BaseException) -> str:
        """Return the innermost line of a node's file from which an error came; nothing where there is none."""
        trace, found = error.__traceback__, ""
        while trace is not None:
            if trace.tb_frame.f_code.co_filename in self.files:
                found = f" ({trace.tb_frame.f_code.co_filename}, line {trace.tb_lineno})"
            trace = trace.tb_next
        return found

    def _go_on_to(self, time: int) -> None:
        if time > self.now:
            self.now = time


def next_message(subscriptions: Sequence[Subscription]) -> Subscription | None:
    """Return the subscription whose first message was sent first; None: none has any."""
    waiting = [each for each in subscriptions if each.queue]
    return min(waiting, key=lambda each: each.queue[0][0]) if waiting else None
