"""Nodes of rclpy. All that a node has is in one attribute, so that what its author calls his own is in nobody's way."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

from fg_mujoco.errors import accepted_names

from .graph import NANOSECONDS, Publication, Subscription
from .message_classes import full_name
from .node_session import NodeLogger, Session, doubles
from .rclpy_executors import CallbackGroup, MutuallyExclusiveCallbackGroup
from .rclpy_handles import Clock, Handle, Publisher, Rate, SubscriptionHandle, TimerHandle
from .rclpy_parameters import (
    InvalidParameterTypeException,
    InvalidParameterValueException,
    Parameter,
    ParameterAlreadyDeclaredException,
    ParameterNotDeclaredException,
    ParameterType,
    set_result,
    type_of,
)
from .rclpy_qos import depth_of
from .rclpy_services import Client
from .services import offer


@dataclass(eq=False)
class Inside:
    """The parts of a node of rclpy."""

    node: Node
    session: Session
    name: str
    namespace: str
    logger: NodeLogger
    clock: Clock
    undeclared: bool  # whether parameters need no declaration
    overrides: dict[str, Any]
    subscriptions: list[Subscription] = field(default_factory=list)
    timers: list[Any] = field(default_factory=list)
    handles: list[Any] = field(default_factory=list)
    parameters: dict[str, Parameter] = field(default_factory=dict)
    read_only: set[str] = field(default_factory=set)
    limits: dict[str, tuple[ParameterType | None, list[Any]]] = field(default_factory=dict)  # types, and ranges
    on_set: list[Callable[[list[Parameter]], Any]] = field(default_factory=list)
    group: CallbackGroup = field(default_factory=MutuallyExclusiveCallbackGroup)

    def full(self, topic: str) -> str:
        """Return the full name of a topic or a service."""
        return self.session.topic(topic, self.name, self.namespace.rstrip("/"))

    def made(self, kind: type) -> list[Any]:
        """Return what the node has made of a kind."""
        return [each for each in self.handles if isinstance(each, kind)]

    def offer(self, name: str, answer: Callable[[Any], Any]) -> Subscription:
        """Offer a service, which the node's executor answers."""
        listens = offer(self.session, self.full(name), answer, self.name)
        self.subscriptions.append(listens)
        return listens

    def finish(self, found: Any) -> Any:
        """Return the result of a callback; a coroutine is run to its end."""
        executor = self.node.executor
        return executor.finish(found) if inspect.iscoroutine(found) and executor is not None else found

    def whole(self, callback: Callable[..., Any]) -> Callable[..., Any]:
        """Return a callback of which a coroutine is run to its end."""
        if not inspect.iscoroutinefunction(callback):
            return callback
        return lambda *values: self.finish(callback(*values))

    def declare(self, name: str, value: Any, descriptor: Any = None, *, override: bool = True) -> Parameter:
        """Declare a parameter: the value that is given, else its default."""
        kind = value if isinstance(value, ParameterType) else None
        if isinstance(value, (ParameterType, type)):  # says of which type it is, and has no default
            value = None
        elif not (getattr(descriptor, "dynamic_typing", False) or value in (None, [], ()) or isinstance(value, str)):
            kind = type_of(value)  # a text stands for anything, as in Foxy
        ranges = (getattr(descriptor, f"{each}_range", None) or () for each in ("floating_point", "integer"))
        self.limits[name] = kind, [(each.from_value, each.to_value) for two in ranges for each in two]
        asked = self.session.take(name, self.overrides.get(name, value))
        given, wrong = self.checked(name, asked if override else value)
        if wrong:
            said = f"parameter {name!r} of node {self.name!r} is {given!r}; accepted: {wrong}"
            raise (InvalidParameterValueException if "from" in wrong else InvalidParameterTypeException)(said)
        found = self.parameters[name] = Parameter(name, None, given)
        if getattr(descriptor, "read_only", False):
            self.read_only.add(name)
        self.session.parameters[name] = given
        self.asked_about([found])
        return found

    def checked(self, name: str, value: Any) -> tuple[Any, str]:
        """Return a value of a parameter, integers as doubles where it is one, and what is accepted if it is not."""
        kind, ranges = self.limits.get(name) or (None, [])
        if kind in (ParameterType.DOUBLE, ParameterType.DOUBLE_ARRAY):
            value = doubles(value)
        empty = value is None or (value in ([], ()) and "ARRAY" in (kind.name if kind else ""))
        if kind and not empty and type_of(value) != kind:
            return value, f"of the type of its default, {kind.name.lower()}"
        if any(not least <= value <= most for least, most in ranges if value is not None):
            return value, " or ".join(f"from {least:g} to {most:g}" for least, most in ranges)
        return value, ""

    def asked_about(self, changes: list[Parameter]) -> Any:
        """Return the result of the node's callbacks for changed parameters."""
        answers = [callback(changes) for callback in self.on_set]
        refused = [answer for answer in answers if not getattr(answer, "successful", True)]
        return refused[0] if refused else set_result(successful=True)


class Node:
    """rclpy.node.Node."""

    _fg_session: Session

    def __init__(
        self,
        node_name: str,
        *,
        context: Any = None,
        cli_args: Any = None,
        namespace: str | None = None,
        use_global_arguments: bool = True,
        enable_rosout: bool = True,
        start_parameter_services: bool = True,
        parameter_overrides: Sequence[Parameter] | None = None,
        allow_undeclared_parameters: bool = False,
        automatically_declare_parameters_from_overrides: bool = False,
        enable_logger_service: bool = False,
    ) -> None:
        session = self._fg_session
        if not session.ok:
            raise RuntimeError(f"node {node_name!r} is made before rclpy.init(), or after rclpy.shutdown()")
        name = session.name or node_name
        session.named(name, namespace or "")
        self._fg = Inside(
            self, session, name, "/" + (namespace or "").strip("/"), NodeLogger(session.graph, name),
            Clock(session.graph), allow_undeclared_parameters,
            {each.name: each.value for each in parameter_overrides or ()},
        )  # fmt: skip
        self._fg_executor: Any = None
        if automatically_declare_parameters_from_overrides:
            session.takes_all = True
            for each, value in session.given.items():
                self._fg.declare(each, value)
        if "use_sim_time" not in self._fg.parameters:
            self._fg.declare("use_sim_time", True)

    def __getattr__(self, name: str) -> Any:
        """Return rclpy's attribute, with one underscore as in Humble or two, that the author has not used."""
        if name == "_fg":  # not made yet
            raise AttributeError("a node is used before super().__init__(name)")
        inside = self._fg
        known: dict[str, Callable[[], Any]] = {
            "_logger": lambda: inside.logger, "_clock": lambda: inside.clock, "_parameters": lambda: inside.parameters,
            "_publishers": lambda: self.publishers, "_subscriptions": lambda: self.subscriptions,
            "_timers": lambda: self.timers, "_clients": lambda: self.clients, "_services": lambda: self.services,
            "handle": lambda: Handle(inside.name, inside.namespace), "_context": lambda: self.context,
            "_default_callback_group": lambda: inside.group, "_allow_undeclared_parameters": lambda: inside.undeclared,
            "_executor": lambda: self.executor, "_parameter_overrides": lambda: inside.overrides,
            "_descriptors": lambda: {each: self.describe_parameter(each) for each in inside.parameters},
            "_parameters_callbacks": lambda: inside.on_set,
        }  # fmt: skip
        found = known.get(name.replace("_Node__", "_", 1))
        if found is None:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        return found()

    def __enter__(self) -> Node:
        return self

    def __exit__(self, *_: Any) -> None:
        self.destroy_node()

    @property
    def executor(self) -> Any:
        return self._fg_executor

    @executor.setter
    def executor(self, value: Any) -> None:
        self._fg_executor = value

    @property
    def context(self) -> Any:
        session = self._fg.session
        return SimpleNamespace(ok=lambda: session.ok, on_shutdown=session.hooks.append)

    @property
    def default_callback_group(self) -> CallbackGroup:
        return self._fg.group

    publishers = property(lambda self: self._fg.made(Publisher))
    subscriptions = property(lambda self: self._fg.made(SubscriptionHandle))
    timers = property(lambda self: self._fg.made(TimerHandle))
    clients = property(lambda self: self._fg.made(Client))
    services = property(lambda self: self._fg.made(SimpleNamespace))

    def get_name(self) -> str:
        return self._fg.name

    def get_namespace(self) -> str:
        return self._fg.namespace

    def get_fully_qualified_name(self) -> str:
        return f"{self._fg.namespace.rstrip('/')}/{self._fg.name}"

    def get_logger(self) -> NodeLogger:
        return self._fg.logger

    def get_clock(self) -> Clock:
        return self._fg.clock

    def resolve_topic_name(self, topic: str, *, only_expand: bool = False) -> str:
        return self._fg.full(topic)

    def resolve_service_name(self, service: str, *, only_expand: bool = False) -> str:
        return self._fg.full(service)

    # What it makes

    def create_publisher(self, msg_type: Any, topic: str, qos_profile: Any, **_: Any) -> Publisher:
        depth_of(qos_profile)
        graph = self._fg.session.graph
        publication = Publication(self._fg.full(topic), _kind(msg_type, topic), self._fg.name, graph.place())
        graph.publications.append(publication)
        handle = Publisher(self._fg.session, publication, qos_profile)
        self._fg.handles.append(handle)
        return handle

    def create_subscription(
        self, msg_type: Any, topic: str, callback: Callable[[Any], Any], qos_profile: Any, **named: Any
    ) -> SubscriptionHandle:
        if not callable(callback):
            raise TypeError(f"the callback of {topic} is {callback!r}; accepted: a function")
        graph = self._fg.session.graph
        subscription = Subscription(
            self._fg.full(topic), _kind(msg_type, topic), self._fg.whole(callback), depth_of(qos_profile),
            self._fg.name, graph.place(),
        )  # fmt: skip
        self._fg.subscriptions.append(subscription)
        graph.subscribe(subscription)
        group = named.get("callback_group") or self._fg.group
        handle = SubscriptionHandle(self._fg.session, subscription, qos_profile, group)
        self._fg.handles.append(handle)
        return handle

    def create_timer(
        self, timer_period_sec: float, callback: Callable[[], Any], *values: Any, autostart: bool = True, **named: Any
    ) -> TimerHandle:
        if not timer_period_sec >= 0.0:
            raise ValueError(f"the period of a timer is {timer_period_sec!r}; accepted: seconds from 0")
        session = self._fg.session
        timer = session.add_timer(round(float(timer_period_sec) * NANOSECONDS), self._fg.whole(callback))
        timer.cancelled = not autostart
        self._fg.timers.append(timer)
        group = named.get("callback_group", values[0] if values else None) or self._fg.group
        handle = TimerHandle(session, timer, callback, group)
        self._fg.handles.append(handle)
        return handle

    def create_rate(self, frequency: float, *_: Any, **__: Any) -> Rate:
        return Rate(self._fg.session, frequency)

    def create_client(self, srv_type: Any, srv_name: str, **_: Any) -> Client:
        client = Client(self._fg.session, srv_type, self._fg.full(srv_name))
        self._fg.handles.append(client)
        return client

    def create_service(self, srv_type: Any, srv_name: str, callback: Any, **_: Any) -> Any:
        listens = self._fg.offer(srv_name, lambda request: self._fg.finish(callback(request, srv_type.Response())))
        handle = SimpleNamespace(
            srv_name=self._fg.full(srv_name), srv_type=srv_type, callback=callback, destroy=lambda: None,
            _subscription=listens,
        )  # fmt: skip
        self._fg.handles.append(handle)
        return handle

    def create_guard_condition(self, callback: Any, **_: Any) -> Any:
        return SimpleNamespace(trigger=callback, destroy=lambda: None)

    def destroy_node(self) -> bool:
        for each in list(self._fg.subscriptions):
            self._fg.session.graph.forget(each)
        self._fg.subscriptions.clear()
        self._fg.timers.clear()
        return True

    def destroy_timer(self, timer: Any) -> bool:
        timer.cancel()
        return True

    def destroy_subscription(self, subscription: Any) -> bool:
        found = subscription._subscription
        if found in self._fg.subscriptions:
            self._fg.subscriptions.remove(found)
            self._fg.session.graph.forget(found)
        return True

    destroy_service = destroy_subscription

    def destroy_publisher(self, publisher: Any) -> bool:
        if publisher._publication in self._fg.session.graph.publications:
            self._fg.session.graph.publications.remove(publisher._publication)
        return True

    def destroy_client(self, client: Any) -> bool:
        return True

    destroy_rate = destroy_guard_condition = destroy_client

    # Who else there is

    def count_publishers(self, topic_name: str) -> int:
        return len(self.get_publishers_info_by_topic(topic_name))

    def count_subscribers(self, topic_name: str) -> int:
        return len(self.get_subscriptions_info_by_topic(topic_name))

    def get_publishers_info_by_topic(self, topic_name: str, no_mangle: bool = False) -> list[Any]:
        graph, topic = self._fg.session.graph, self._fg.full(topic_name)
        own = [(topic, graph.provided[topic])] if topic in graph.provided else []
        found = [(each.node, full_name(each.kind._type)) for each in graph.publications if each.topic == topic]  # type: ignore[attr-defined]
        return [SimpleNamespace(node_name=node, topic_type=kind) for node, kind in own + found]

    def get_subscriptions_info_by_topic(self, topic_name: str, no_mangle: bool = False) -> list[Any]:
        topic = self._fg.full(topic_name)
        found = [each for each in self._fg.session.graph.subscriptions if each.topic == topic]
        return [SimpleNamespace(node_name=each.node, topic_type=full_name(each.kind._type)) for each in found]  # type: ignore[attr-defined]

    def get_topic_names_and_types(self, no_demangle: bool = False) -> list[tuple[str, list[str]]]:
        graph = self._fg.session.graph
        found = {**graph.provided, **{each.topic: full_name(each.kind._type) for each in graph.publications}}  # type: ignore[attr-defined]
        return [(topic, [kind]) for topic, kind in sorted(found.items())]

    def get_service_names_and_types(self) -> list[tuple[str, list[str]]]:
        return [(each.srv_name, [str(getattr(each.srv_type, "__name__", ""))]) for each in self.services]

    def get_node_names(self) -> list[str]:
        graph = self._fg.session.graph
        publishing, listening = {each.node for each in graph.publications}, {each.node for each in graph.subscriptions}
        return sorted({self._fg.name} | publishing | listening)

    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]:
        return [(name, "/") for name in self.get_node_names()]

    # Parameters

    def declare_parameter(
        self, name: str, value: Any = None, descriptor: Any = None, ignore_override: bool = False
    ) -> Parameter:
        if name in self._fg.parameters and name != "use_sim_time":
            raise ParameterAlreadyDeclaredException(f"parameter {name!r} is declared twice")
        return self._fg.declare(name, value, descriptor, override=not ignore_override)

    def declare_parameters(self, namespace: str, parameters: Sequence[Any], ignore_override: bool = False) -> Any:
        prefix, found = f"{namespace}." if namespace else "", []
        for name, value, descriptor in ((*each, None, None)[:3] for each in parameters):
            found.append(self.declare_parameter(prefix + name, value, descriptor, ignore_override))
        return found

    def has_parameter(self, name: str) -> bool:
        return name in self._fg.parameters

    def undeclare_parameter(self, name: str) -> None:
        if name not in self._fg.parameters:
            raise ParameterNotDeclaredException(self._fg_undeclared(name))
        del self._fg.parameters[name]

    def get_parameter(self, name: str) -> Parameter:
        if name in self._fg.parameters:
            return self._fg.parameters[name]
        if self._fg.undeclared:
            return Parameter(name, None, self._fg.session.take(name, None))
        raise ParameterNotDeclaredException(self._fg_undeclared(name))

    def get_parameters(self, names: Sequence[str]) -> list[Parameter]:
        return [self.get_parameter(name) for name in names]

    def get_parameter_or(self, name: str, alternative_value: Any = None) -> Parameter:
        return self._fg.parameters.get(name) or alternative_value or Parameter(name)

    def get_parameter_type(self, name: str) -> ParameterType:
        return self.get_parameter(name).type_

    def get_parameters_by_prefix(self, prefix: str) -> dict[str, Parameter]:
        start = f"{prefix}." if prefix else ""
        found = self._fg.parameters.items()
        return {name[len(start) :]: each for name, each in found if name.startswith(start)}

    def set_parameters(self, parameter_list: Sequence[Parameter]) -> list[Any]:
        results = []
        for each in parameter_list:
            if each.name not in self._fg.parameters and not self._fg.undeclared:
                raise ParameterNotDeclaredException(self._fg_undeclared(each.name))
            if each.name in self._fg.read_only:
                results.append(set_result(successful=False, reason=f"parameter {each.name!r} is read-only"))
                continue
            value, wrong = self._fg.checked(each.name, each.value)
            if wrong:
                results.append(set_result(successful=False, reason=f"parameter {each.name!r}; accepted: {wrong}"))
                continue
            changed = Parameter(each.name, None, value)
            result = self._fg.asked_about([changed])
            if result.successful:
                self._fg.parameters[each.name] = changed
            results.append(result)
        return results

    def set_parameters_atomically(self, parameter_list: Sequence[Parameter]) -> Any:
        return self.set_parameters(parameter_list)[-1]

    def add_on_set_parameters_callback(self, callback: Any) -> None:
        self._fg.on_set.insert(0, callback)

    def add_post_set_parameters_callback(self, callback: Any) -> None:
        self._fg.on_set.append(callback)

    add_pre_set_parameters_callback = add_post_set_parameters_callback

    def remove_on_set_parameters_callback(self, callback: Any) -> None:
        self._fg.on_set.remove(callback)

    def set_parameters_callback(self, callback: Any) -> None:
        self._fg.on_set = [callback]

    def list_parameters(self, prefixes: Sequence[str], depth: int = 0) -> Any:
        names = [each for each in self._fg.parameters if not prefixes or each.startswith(tuple(prefixes))]
        return SimpleNamespace(names=names, prefixes=list(prefixes))

    def describe_parameters(self, names: Sequence[str]) -> list[Any]:
        return [self.describe_parameter(name) for name in names]

    def get_parameter_types(self, names: Sequence[str]) -> list[ParameterType]:
        return [self.get_parameter_type(name) for name in names]

    def describe_parameter(self, name: str) -> Any:
        return SimpleNamespace(name=name, type=int(self.get_parameter(name).type_))

    def set_descriptor(self, name: str, descriptor: Any, alternative_value: Any = None) -> Any:
        return self.get_parameter(name).get_parameter_value()

    def _fg_undeclared(self, name: str) -> str:
        known = accepted_names(name, self._fg.parameters)
        return f"node {self._fg.name!r} has declared no parameter {name!r}; {known}"


def _kind(found: Any, topic: str) -> type:
    if not isinstance(found, type) or not hasattr(found, "_makers"):
        raise TypeError(f"the type of {topic} is {found!r}; accepted: a class of messages, such as LaserScan")
    return found


def wait_for_message(
    msg_type: Any, node: Node, topic: str, *, qos_profile: Any = 1, time_to_wait: float = -1
) -> tuple[bool, Any]:
    """Return whether a message has come within a time [s], and the message; below 0: within any time."""
    graph, got = node._fg.session.graph, list[Any]()
    subscription = Subscription(
        node._fg.full(topic), _kind(msg_type, topic), got.append, 1, node.get_name(), graph.place()
    )  # fmt: skip
    graph.subscribe(subscription)
    wake = None if time_to_wait < 0 else graph.now + round(time_to_wait * NANOSECONDS)
    graph.pause(wake, lambda: bool(subscription.queue))
    graph.forget(subscription)
    return (True, subscription.queue.popleft()[1]) if subscription.queue else (False, None)
