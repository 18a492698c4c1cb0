"""The state of one node of a planner: its name, parameters, remappings, and whether ROS is up."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partialmethod
from pathlib import Path
from typing import Any

from fg_mujoco.errors import accepted_names

from .graph import BEGIN, Graph, Subscription, next_message


@dataclass(eq=False)
class Timer:
    """A callback every so many simulated nanoseconds."""

    period: int
    callback: Callable[[], Any]
    due: int
    cancelled: bool = False

    def skip_to(self, now: int) -> None:
        """Plan the next call: a period after the last, and after now."""
        self.due += max(1, (now - self.due) // max(1, self.period) + 1) * max(1, self.period)


@dataclass(eq=False)
class Session:
    """One node: what `ros2 run`, or one entry of a launch file, starts.

    `given` are parameters that differ from the node's own, `undeclared` those that it need not have, and `given_to`
    returns what is given to a node of a full name, where its program names it. `remaps` are names of topics, as the
    node says them, and what they are here; `name` and `namespace` differ from its own; `arguments` are in its
    `sys.argv`, behind the file, and `environment` has variables that differ from those of this process.
    """

    graph: Graph
    file: Path
    given: dict[str, Any]
    remaps: Mapping[str, str]
    name: str | None = None
    arguments: tuple[str, ...] = ()
    namespace: str = ""
    environment: Mapping[str, str] = field(default_factory=dict)
    undeclared: frozenset[str] = frozenset()
    given_to: Callable[[str], dict[str, Any]] | None = None
    ok: bool = False
    ended: bool = False
    subscriptions: list[Subscription] = field(default_factory=list)
    timers: list[Timer] = field(default_factory=list)
    parameters: dict[str, Any] = field(default_factory=dict)  # that the node has declared, or asked for
    asked: set[str] = field(default_factory=set)
    takes_all: bool = False  # whether any parameter is accepted
    hooks: list[Callable[[], Any]] = field(default_factory=list)  # on shutdown
    waits: str = ""  # for what, where it has not come yet

    @property
    def argv(self) -> list[str]:
        """The node's `sys.argv`."""
        return [str(self.file), *self.arguments]

    def topic(self, name: str, node: str, namespace: str = "") -> str:
        """Return the full name of a topic that a node names."""
        full = name
        namespace = namespace or (f"/{self.namespace}" if self.namespace else "")
        if name.startswith("~"):
            full = f"{namespace}/{node}/{name[1:].lstrip('/')}"
        elif not name.startswith("/"):
            full = f"{namespace}/{name}"
        full = "/" + full.strip("/")
        for said in (name, full):
            if said in self.remaps:
                return "/" + self.remaps[said].strip("/")
        return full

    def named(self, node: str, namespace: str) -> None:
        """Take the parameters of a node of a name, which files may have for several."""
        if self.given_to is not None:
            self.given = self.given_to(f"{self.namespace or namespace}/{node}")

    def take(self, name: str, default: Any) -> Any:
        """Return the value of a parameter: the one that is given, else the default."""
        if name != "use_sim_time":
            self.asked.add(name)
        if name not in self.given:
            return default
        value = self.given[name]
        return doubles(value) if _are(float, default) else value

    def unknown_parameters(self) -> str:
        """Return the message for given parameters that the node does not have; an empty text where it has all."""
        if self.takes_all:
            return ""
        for name in self.given:
            if name not in self.asked and name not in self.undeclared:
                return f"has no parameter {name!r}; {accepted_names(name, sorted(self.asked))}"
        return ""

    def add_timer(self, period: int, callback: Callable[[], Any]) -> Timer:
        """Add a timer whose first call is a period [ns] from now, and not before the first scan."""
        since = max(self.graph.now, BEGIN - 1)  # timers of a node that starts before the race count from there
        timer = Timer(max(1, period), callback, since + max(1, period))
        self.timers.append(timer)
        return timer

    def run_next(self, subscriptions: list[Subscription], timers: list[Timer]) -> bool:
        """Call what is due first, messages before timers; return whether anything was."""
        found = next_message(subscriptions)
        if found is not None:
            _, message = found.queue.popleft()
            found.callback(message)
            return True
        due = [timer for timer in timers if not timer.cancelled and timer.due <= self.graph.now]
        if not due:
            return False
        timer = min(due, key=lambda each: each.due)
        timer.skip_to(self.graph.now)
        timer.callback()
        return True

    def wait(
        self,
        subscriptions: list[Subscription],
        timers: list[Timer],
        until: int | None = None,
        *,
        ready: Callable[[], bool] = lambda: False,
    ) -> None:
        """Wait until a callback is due, something else is ready, or a simulated time [ns] is reached; see Graph."""
        times = [timer.due for timer in timers if not timer.cancelled]

        def due() -> bool:
            return not self.ok or any(each.queue for each in subscriptions) or ready()

        if until is not None and until <= self.graph.now:
            self.graph.poll(due, min(times, default=None))
            return
        wake = min(times + ([] if until is None else [until]), default=None)
        self.graph.pause(wake, due, spinning=until is None)

    def shut_down(self) -> None:
        """End ROS for this node."""
        was, self.ok, self.ended = self.ok, False, True
        if was:
            for hook in self.hooks:
                hook()


class NodeLogger:
    """The logger of a node, under "fg_mujoco.addons.ros" of Python's logging: warnings and errors show by default."""

    def __init__(self, graph: Graph, name: str) -> None:
        self._graph, self.name = graph, name
        self._logger = logging.getLogger(f"fg_mujoco.addons.ros.{name}")
        self._last: dict[str, int] = {}
        self._skipped: set[str] = set()  # places whose first message has been left out

    def log(self, level: int, message: object, *values: object, **options: Any) -> bool:
        """Log a message; `once` and `throttle_duration_sec` [s simulated] are as in rclpy."""
        every = options.get("throttle_duration_sec")
        if options.get("skip_first") and self._graph.place() not in self._skipped:
            self._skipped.add(self._graph.place())
            return False
        if every is not None or options.get("once"):
            place, now = self._graph.place(), self._graph.now
            if place in self._last and (options.get("once") or now - self._last[place] < float(every or 0.0) * 1e9):
                return False
            self._last[place] = now
        if self._logger.isEnabledFor(level):
            text = str(message)
            self._logger.log(level, "%s", text % values if values else text)
        return True

    debug = partialmethod(log, logging.DEBUG)
    info = partialmethod(log, logging.INFO)
    warning = partialmethod(log, logging.WARNING)
    warn = warning
    error = partialmethod(log, logging.ERROR)
    fatal = partialmethod(log, logging.CRITICAL)

    def set_level(self, level: Any) -> None:
        """Show messages from a level on."""
        self._logger.setLevel(int(getattr(level, "value", level)))

    def get_effective_level(self) -> int:
        """Return the level from which on messages are shown."""
        return self._logger.getEffectiveLevel()

    def is_enabled_for(self, level: Any) -> bool:
        """Return whether messages of a level are shown."""
        return self._logger.isEnabledFor(int(getattr(level, "value", level)))

    def get_child(self, name: str) -> NodeLogger:
        """Return the logger of a part of the node."""
        return NodeLogger(self._graph, f"{self.name}.{name}")


def doubles(value: Any) -> Any:
    """Return an integer, or a list of integers, as doubles, and another value as it is."""
    if not _are(int, value):
        return value
    return list(map(float, value)) if isinstance(value, (list, tuple)) else float(value)


def _are(kind: type, value: Any) -> bool:
    """Return whether a value, or each of a list, is of a type."""
    return all(type(each) is kind for each in (value if isinstance(value, (list, tuple)) and value else [value]))
