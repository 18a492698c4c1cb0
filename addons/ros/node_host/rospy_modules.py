"""Stubs of rospy and its modules. Names, arguments and meanings are those of ROS 1 Noetic's rospy.

In ROS 1 callbacks come in threads of their own. Here they come while the node waits: in `spin`, `sleep`, `Rate.sleep`.
An exception of a callback is logged there, and ends at most that thread. So it is here: the node goes on without the
message, a timer ends.
"""

from __future__ import annotations

import math
import traceback
from collections.abc import Callable
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

from fg_mujoco.simulation.planner_failure import one_line

from .graph import Graph, NodeError, Publication, Subscription
from .imports import LackingError, StandIn
from .message_classes import Message1
from .node_session import NodeLogger, Session, Timer
from .rospy_times import NANOSECONDS, RosDuration, RosTime
from .services import ask, offer, offered, wait_for


class ROSException(Exception):
    pass


class ROSInitException(ROSException):
    pass


class ROSInterruptException(ROSException):
    pass


class ROSTimeMovedBackwardsException(ROSInterruptException):
    pass


class ROSSerializationException(ROSException):
    pass


class ROSInternalException(Exception):
    pass


class ServiceException(Exception):
    pass


class TransportException(ROSException):
    pass


class SubscribeListener:
    """Argument of a publisher's subscriber listener; it has no content here."""

    def peer_subscribe(self, topic_name: str, topic_publish: Any, peer_publish: Any) -> None:
        pass

    def peer_unsubscribe(self, topic_name: str, num_peers: int) -> None:
        pass


class MissingParameter(KeyError):
    def __str__(self) -> str:
        return str(self.args[0])


class Rospy:
    """rospy's functions for one node."""

    def __init__(self, session: Session) -> None:
        self.session, self.graph = session, session.graph
        self.name = "unnamed"
        self.running: set[Any] = set()  # subscriptions and timers in whose callbacks the node is
        self._failures: dict[tuple[str, str], int] = {}  # of callbacks: how often each
        self._logger = NodeLogger(self.graph, self.name)

    def init_node(self, name: str, *_: Any, **__: Any) -> None:
        self.name = self.session.name or name
        self._logger = NodeLogger(self.graph, self.name)
        self.session.ok = True

    def get_name(self) -> str:
        return f"/{self.name}"

    def get_namespace(self) -> str:
        return "/"

    def is_shutdown(self) -> bool:
        if self.graph.breathe():
            while self.session.run_next(*self._free()):
                pass
        return self.graph.closed or self.session.ended

    def signal_shutdown(self, reason: str = "") -> None:
        self.session.shut_down()

    def on_shutdown(self, hook: Callable[[], Any]) -> None:
        self.session.hooks.append(hook)

    def spin(self) -> None:
        if not self.session.ok and not self.session.ended:
            raise ROSInitException("rospy.spin() before rospy.init_node()")
        while self.session.ok:
            self._once(None)

    def sleep(self, duration: Any) -> None:
        """Wait for seconds, or a Duration, in simulated time; callbacks come meanwhile."""
        seconds = duration.to_sec() if isinstance(duration, RosDuration) else float(duration)
        self.wait_until(self.graph.now + max(1, round(seconds * NANOSECONDS)))

    def wait_until(self, time: int) -> None:
        while self.graph.now < time and not self.session.ended:
            self._once(time)

    def wait_for_message(self, topic: str, topic_type: Any, timeout: Any = None) -> Any:
        got: list[Any] = []
        subscription = Subscription(self._full(topic), topic_type, got.append, 1, self.name, self.graph.place())
        self.session.subscriptions.append(subscription)
        self.graph.subscribe(subscription)
        until = None if timeout is None else self.graph.now + round(float(timeout) * NANOSECONDS)
        while not got and not self.session.ended:
            if until is not None and self.graph.now >= until:
                raise ROSException(f"timeout exceeded while waiting for message on topic {topic}")
            self._once(until, spinning=False)
        self.session.subscriptions.remove(subscription)
        self.graph.subscriptions.remove(subscription)
        return got[0] if got else None

    def get_param(self, name: str, default: Any = KeyError) -> Any:
        short = self._short(name)
        if short not in self.session.given and short in self.session.parameters:
            return self.session.parameters[short]
        value = self.session.take(short, KeyError)
        if value is KeyError:
            value = self._below(short) or default
        if value is KeyError:
            raise MissingParameter(
                f"parameter {name} is not given, and has no default; accepted: [{short}=VALUE], or a file: "
                "[host.params=FILE.yaml]"
            )
        return float(value) if isinstance(default, float) and type(value) is int else value

    def _below(self, short: str) -> dict[str, Any]:
        """Return the parameters of a namespace, nested."""
        found: dict[str, Any] = {}
        for name, value in {**self.session.parameters, **self.session.given}.items():
            if name.startswith(f"{short}."):
                self.session.asked.add(name)
                inner = found
                *folders, last = name[len(short) + 1 :].split(".")
                for folder in folders:
                    inner = inner.setdefault(folder, {})
                inner[last] = value
        return found

    def set_param(self, name: str, value: Any) -> None:
        self.session.parameters[self._short(name)] = value
        self.session.given.pop(self._short(name), None)

    def has_param(self, name: str) -> bool:
        short = self._short(name)
        self.session.asked.add(short)
        return short in self.session.given or short in self.session.parameters or bool(self._below(short))

    def delete_param(self, name: str) -> None:
        self.session.parameters.pop(self._short(name), None)
        self.session.given.pop(self._short(name), None)

    def search_param(self, name: str) -> str | None:
        return name if self.has_param(name) else None

    def wait_for_service(self, service: str, timeout: Any = None) -> None:
        seconds = timeout.to_sec() if isinstance(timeout, RosDuration) else timeout
        until = None if seconds is None else self.graph.now + round(float(seconds) * NANOSECONDS)
        if not wait_for(self.session, self._full(service), until):
            raise ROSException(f"timeout exceeded while waiting for service {service}")

    def get_param_names(self) -> list[str]:
        return [*self.session.given, *self.session.parameters]

    def get_published_topics(self, namespace: str = "/") -> list[list[str]]:
        return [[each.topic, str(getattr(each.kind, "_type", ""))] for each in self.graph.publications]

    def log(self, level: str) -> Callable[..., Any]:
        def say(message: object, *values: object, **_: Any) -> None:
            getattr(self._logger, level)(message, *values)

        return say

    def log_throttled(self, level: str) -> Callable[..., Any]:
        def say(period: float, message: object, *values: object) -> None:
            getattr(self._logger, level)(message, *values, throttle_duration_sec=period)

        return say

    def log_once(self, level: str) -> Callable[..., Any]:
        def say(message: object, *values: object) -> None:
            getattr(self._logger, level)(message, *values, once=True)

        return say

    def _short(self, name: str) -> str:
        """Return a parameter's name without the node's: `~speed`, `/my_node/speed` and `/speed` are `speed`.

        Namespaces are separated by dots, as they are in files of parameters here. A name that is given without its
        namespace is that one.
        """
        found = name.lstrip("~/").removeprefix(f"{self.name}/").strip("/")
        for each in list(self.session.given):
            if "/" in each:
                self.session.given[each.strip("/").replace("/", ".")] = self.session.given.pop(each)
        dotted = found.replace("/", ".")
        last = dotted.rpartition(".")[2]
        return last if dotted not in self.session.given and last in self.session.given else dotted

    def _full(self, topic: str) -> str:
        return self.session.topic(topic, self.name)

    def _once(self, until: int | None, *, spinning: bool = True, ready: Callable[[], bool] = lambda: False) -> None:
        session = self.session
        subscriptions, timers = self._free()
        if not session.run_next(subscriptions, timers):
            session.wait(subscriptions, timers, until, spinning=spinning, ready=ready)

    def _free(self) -> tuple[list[Subscription], list[Timer]]:
        """Return who may be called: a callback that waits is not called again before it has come back."""
        session, running = self.session, self.running
        if not running:
            return session.subscriptions, session.timers
        subscriptions = [each for each in session.subscriptions if each not in running]
        return subscriptions, [each for each in session.timers if each not in running]

    def call(self, source: Any, callback: Callable[..., Any], *values: Any) -> bool:
        """Call back for a subscription or a timer; return whether it came back without an exception, which is logged.

        Raises:
          LackingError, NodeError: what is not here, which a real rospy has.
        """
        self.running.add(source)
        try:
            callback(*values)
        except (LackingError, NodeError):
            raise
        except Exception as error:
            self._log_failure(callback, error)
            return False
        finally:
            self.running.discard(source)
        return True

    def answer(self, handler: Callable[[Any], Any], request: Any) -> Any:
        """Return the response of a service's handler; for an exception, which is logged, what its client raises."""
        got: list[Any] = []
        if self.call(handler, lambda: got.append(handler(request))):
            return got[0]
        return ServiceException(f"service cannot process request: {self.session.failed}")

    def _log_failure(self, callback: Callable[..., Any], error: Exception) -> None:
        """Log an exception as rospy does; one that comes again and again in a line, the 10th, 100th, ... time."""
        said, place = one_line(error), self.graph.place_of_error(error)
        count = self._failures[said, place] = self._failures.get((said, place), 0) + 1
        self.session.failed = f"{said}{place}"
        if count == 1:
            self._logger.error(f"bad callback: {callback}\n{traceback.format_exc().rstrip()}")
        elif math.log10(count).is_integer():
            self._logger.error(f"bad callback, the {count}th time: {said}{place}")


class Publisher:
    _rospy: Rospy

    def __init__(
        self, name: str, data_class: Any, subscriber_listener: Any = None, tcp_nodelay: bool = False,
        latch: bool = False, headers: Any = None, queue_size: Any = None,
    ) -> None:  # fmt: skip
        graph = self._rospy.graph
        kind = _kind(data_class, name)
        self._publication = Publication(self._rospy._full(name), kind, self._rospy.name, graph.place())
        self._latch = latch
        graph.publications.append(self._publication)
        self.name = self.resolved_name = self._publication.topic
        self.data_class, self.type, self.impl = kind, kind._type, self  # type: ignore[attr-defined]

    def publish(self, *values: Any, **named: Any) -> None:
        if len(values) == 1 and not named and isinstance(values[0], self.data_class):
            message: Any = values[0]
        elif len(values) == 1 and hasattr(values[0], "_makers"):
            raise ROSException(
                f"publish of a {type(values[0]).__name__} on {self.name}; accepted: a {self.data_class.__name__}, "
                "which is the type that the Publisher was given"
            )
        else:
            message = self.data_class(*values, **named)
        if self._publication.commands:
            wrong = message.unpackable()
            if wrong:
                raise ROSSerializationException(wrong)
        if "header" in message._makers:
            message.header.seq += 1
        self._rospy.graph.publish(self._publication, message, latch=self._latch)

    def get_num_connections(self) -> int:
        drives = int("ackermann_msgs/" in getattr(self.data_class, "_type", ""))
        return drives + sum(each.topic == self.name for each in self._rospy.graph.subscriptions)

    def unregister(self) -> None:
        if self._publication in self._rospy.graph.publications:
            self._rospy.graph.publications.remove(self._publication)


class Subscriber:
    _rospy: Rospy

    def __init__(
        self, name: str, data_class: Any, callback: Any = None, callback_args: Any = None, queue_size: Any = None,
        buff_size: int = 65536, tcp_nodelay: bool = False,
    ) -> None:  # fmt: skip
        rospy = self._rospy

        def call(message: Any) -> None:
            if hasattr(data_class, "_plain"):
                message.__class__ = data_class
            if callback is not None:
                values = (message,) if callback_args is None else (message, callback_args)
                rospy.call(self._subscription, callback, *values)

        self._subscription = Subscription(
            rospy._full(name), _kind(data_class, name), call, queue_size or 1000, rospy.name, rospy.graph.place()
        )
        rospy.session.subscriptions.append(self._subscription)
        rospy.graph.subscribe(self._subscription)
        self.name = self.resolved_name = self._subscription.topic
        self.data_class, self.callback, self.impl = data_class, callback, self
        self.type = getattr(data_class, "_type", "*")

    def unregister(self) -> None:
        if self._subscription in self._rospy.session.subscriptions:
            self._rospy.session.subscriptions.remove(self._subscription)
            self._rospy.graph.subscriptions.remove(self._subscription)

    def get_num_connections(self) -> int:
        return 1


class Rate:
    _rospy: Rospy

    def __init__(self, hz: float, reset: bool = False) -> None:
        self._period = round(NANOSECONDS / float(hz))
        self._next = self._rospy.graph.now + self._period
        self.sleep_dur = RosDuration(0, self._period)

    def sleep(self) -> None:
        graph = self._rospy.graph
        if self._next > graph.now:
            self._rospy.wait_until(self._next)
        else:
            graph.breathe()
        if self._rospy.session.ended:
            raise ROSInterruptException("rospy shutdown")
        self._next = self._next + self._period if self._next + self._period > graph.now else graph.now + self._period

    def remaining(self) -> RosDuration:
        return RosDuration(0, max(0, self._next - self._rospy.graph.now))


class TimerHandle:
    """rospy.Timer."""

    _rospy: Rospy

    def __init__(self, period: Any, callback: Callable[[Any], Any], oneshot: bool = False, reset: bool = False) -> None:
        graph = self._rospy.graph
        last: list[RosTime | None] = [None]

        def call() -> None:
            now = RosTime.from_nanoseconds(graph.now)
            event = SimpleNamespace(
                current_real=now, current_expected=now, last_real=last[0], last_expected=last[0], last_duration=0.0
            )
            last[0] = now
            if not self._rospy.call(self._timer, callback, event):
                self._timer.cancelled = True  # rospy's thread of the timer has ended

        self._timer: Timer = self._rospy.session.add_timer(round(period.to_sec() * NANOSECONDS), call, oneshot=oneshot)

    def shutdown(self) -> None:
        self._timer.cancelled = True

    def is_alive(self) -> bool:
        return not self._timer.cancelled


class ServiceProxy:
    _rospy: Rospy

    def __init__(self, name: str, service_class: Any, *_: Any, **__: Any) -> None:
        self.name, self.service_class = name, service_class
        self.resolved_name = self._rospy._full(name)

    def __call__(self, *values: Any, **named: Any) -> Any:
        session, got = self._rospy.session, list[Any]()
        if not offered(session.graph, self.resolved_name):
            raise ServiceException(f"service [{self.resolved_name}] unavailable")
        kind = self.service_class.Request
        request = values[0] if len(values) == 1 and isinstance(values[0], kind) else kind(*values, **named)
        ask(session.graph, self.resolved_name, request, got.append)
        while not got and not session.ended:  # the node's own services and callbacks go on meanwhile
            self._rospy._once(None, spinning=False, ready=lambda: bool(got))
        if got and isinstance(got[0], ServiceException):
            raise got[0]
        return got[0] if got else None

    call = __call__

    def wait_for_service(self, timeout: Any = None) -> None:
        self._rospy.wait_for_service(self.name, timeout)

    def close(self) -> None:
        pass


class Service:
    _rospy: Rospy

    def __init__(self, name: str, service_class: Any, handler: Callable[[Any], Any], *_: Any, **__: Any) -> None:
        rospy, kind = self._rospy, service_class.Response

        def answer(request: Any) -> Any:
            found = rospy.answer(handler, request)
            if isinstance(found, (kind, ServiceException)):
                return found
            if isinstance(found, dict):
                return kind(**found)
            return kind(*found) if isinstance(found, (list, tuple)) else kind() if found is None else kind(found)

        self._listens = offer(rospy.session, rospy._full(name), answer, rospy.name)
        rospy.session.subscriptions.append(self._listens)
        self.resolved_name = rospy._full(name)

    def shutdown(self, reason: str = "") -> None:
        self._rospy.session.subscriptions.remove(self._listens)
        self._rospy.graph.forget(self._listens)

    def spin(self) -> None:
        self._rospy.spin()


def _kind(found: Any, topic: str) -> type:
    if not isinstance(found, type):
        raise ValueError(f"the type of {topic} is {found!r}; accepted: a class of messages, such as LaserScan")
    return getattr(found, "_plain", found)


def _time_kind(graph: Graph) -> Any:
    """Return rospy.Time, whose `now` is the simulated one."""
    return type("Time", (RosTime,), {
        "now": staticmethod(lambda: RosTime.from_nanoseconds(graph.read())), "from_seconds": RosTime.from_sec,
    })  # fmt: skip


def rospy_modules(session: Session) -> dict[str, ModuleType]:
    """Return the modules of rospy, for one node."""
    rospy, graph = Rospy(session), session.graph
    bound = {"_rospy": rospy}
    levels = {"debug": "debug", "info": "info", "warn": "warning", "err": "error", "fatal": "fatal"}
    logs: dict[str, Any] = {}
    for said, level in levels.items():
        logs[f"log{said}"] = rospy.log(level)
        logs[f"log{said}_throttle"] = rospy.log_throttled(level)
        logs[f"log{said}_throttle_identical"] = logs[f"log{said}_throttle"]
        logs[f"log{said}_once"] = rospy.log_once(level)
    exceptions: dict[str, Any] = {
        "ROSException": ROSException, "ROSInitException": ROSInitException, "ServiceException": ServiceException,
        "ROSInterruptException": ROSInterruptException,
        "ROSTimeMovedBackwardsException": ROSTimeMovedBackwardsException,
        "ROSSerializationException": ROSSerializationException, "ROSInternalException": ROSInternalException,
        "TransportException": TransportException, "TransportInitError": TransportException,
        "TransportTerminated": TransportException,
    }  # fmt: skip

    members: dict[str, Any] = {
        "init_node": rospy.init_node, "spin": rospy.spin, "sleep": rospy.sleep, "is_shutdown": rospy.is_shutdown,
        "signal_shutdown": rospy.signal_shutdown, "on_shutdown": rospy.on_shutdown, "get_param": rospy.get_param,
        "set_param": rospy.set_param, "has_param": rospy.has_param, "search_param": rospy.search_param,
        "get_param_names": rospy.get_param_names, "get_name": rospy.get_name, "get_namespace": rospy.get_namespace,
        "wait_for_message": rospy.wait_for_message, "get_published_topics": rospy.get_published_topics,
        "get_time": lambda: graph.read() / NANOSECONDS, "get_rostime": lambda: RosTime.from_nanoseconds(graph.read()),
        "myargv": lambda argv=None: session.argv, "resolve_name": rospy._full,
        "wait_for_service": rospy.wait_for_service, "ServiceProxy": type("ServiceProxy", (ServiceProxy,), bound),
        "Service": type("Service", (Service,), bound), "delete_param": rospy.delete_param,
        "is_initialized": lambda: session.ok, "add_preshutdown_hook": rospy.on_shutdown, "remap_name": rospy._full,
        "add_client_shutdown_hook": rospy.on_shutdown, "SubscribeListener": SubscribeListener,
        "get_ros_root": lambda *_, **__: "", "get_caller_id": rospy.get_name, "get_node_uri": lambda: "",
        "TimerEvent": SimpleNamespace, "FATAL": 16, "get_param_cached": rospy.get_param, "Message": Message1,
        "is_shutdown_requested": rospy.is_shutdown, "configure_logging": lambda *_, **__: None,
        "add_log_handler": lambda *_: None, "get_master": lambda *_, **__: _Master(rospy), "logout": logs["loginfo"],
        "logerror": logs["logerr"], **{f"rospy{name}": logs[f"log{name}"] for name in levels},
        "Time": _time_kind(graph), "Duration": RosDuration, "Publisher": type("Publisher", (Publisher,), bound),
        "Subscriber": type("Subscriber", (Subscriber,), bound), "Rate": type("Rate", (Rate,), bound),
        "Timer": type("Timer", (TimerHandle,), bound), "AnyMsg": object, "DEBUG": 1, "INFO": 2, "WARN": 4, "ERROR": 8,
        **logs, **exceptions,
    }  # fmt: skip
    parts = ("core", "client", "topics", "timer", "service", "msg", "impl.tcpros")
    of_modules: dict[str, dict[str, Any]] = {
        "rospy": members,
        "rospy.numpy_msg": {"numpy_msg": numpy_message},
        "rospy.exceptions": exceptions,
        "rospy.rostime": {
            "wallsleep": rospy.sleep,
            "is_wallclock": lambda: False,
            "is_rostime_initialized": lambda: True,
            **{name: members[name] for name in ("Time", "Duration", "get_time", "get_rostime")},
        },
        "rospy.names": {name: members[name] for name in ("get_namespace", "get_name", "resolve_name", "remap_name")},
        **{f"rospy.{part}": members for part in parts},
        "genpy": {"Time": RosTime, "Duration": RosDuration},
        "genpy.rostime": {"Time": RosTime, "Duration": RosDuration},
    }
    return {name: StandIn(name, **found) for name, found in of_modules.items()}


class _Master:
    """The master, as a node may ask it; each answer is (1, message, value)."""

    def __init__(self, rospy: Rospy) -> None:
        self._rospy = rospy

    def getPublishedTopics(self, subgraph: str = "") -> tuple[int, str, Any]:  # noqa: N802
        return 1, "", self._rospy.get_published_topics()

    getTopicTypes = getPublishedTopics  # noqa: N815

    def getPid(self) -> tuple[int, str, int]:  # noqa: N802
        return 1, "", 1


def numpy_message(kind: Any) -> Any:
    """Return a class of messages as `rospy.numpy_msg` has it, whose lists of numbers are arrays; it listens to both."""
    makers = kind._makers

    class Arrays(kind):  # type: ignore[misc]
        __slots__ = ()

        def __getattribute__(self, name: str) -> Any:
            value = super().__getattribute__(name)
            return np.array(value) if name in makers and isinstance(value, (list, tuple)) else value

    Arrays.__name__, Arrays._plain = kind.__name__, kind
    return Arrays
