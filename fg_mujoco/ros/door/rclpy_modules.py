"""Stand-ins for rclpy and its modules. Names, arguments and meanings are those of ROS 2 Humble's rclpy."""

from __future__ import annotations

import enum
from collections.abc import Callable, Sequence
from types import ModuleType, SimpleNamespace
from typing import Any, ClassVar

from ...errors import accepted_names
from .graph import Graph, Publication, Subscription
from .imports import StandIn
from .rclpy_times import Duration, Time
from .rospy_times import NANOSECONDS
from .session import NodeLogger, Session, Timer


class ParameterNotDeclaredException(Exception):
    pass


class ParameterAlreadyDeclaredException(Exception):
    pass


class InvalidParameterTypeException(Exception):
    pass


class ExternalShutdownException(Exception):
    pass


class ROSInterruptException(Exception):
    pass


class ParameterType(enum.IntEnum):
    NOT_SET = 0
    BOOL = 1
    INTEGER = 2
    DOUBLE = 3
    STRING = 4
    BYTE_ARRAY = 5
    BOOL_ARRAY = 6
    INTEGER_ARRAY = 7
    DOUBLE_ARRAY = 8
    STRING_ARRAY = 9


def _type_of(value: Any) -> ParameterType:
    if value is None:
        return ParameterType.NOT_SET
    many = isinstance(value, (list, tuple))
    first = (value[0] if value else 0.0) if many else value
    if isinstance(first, bool):
        return ParameterType.BOOL_ARRAY if many else ParameterType.BOOL
    if isinstance(first, int):
        return ParameterType.INTEGER_ARRAY if many else ParameterType.INTEGER
    if isinstance(first, float):
        return ParameterType.DOUBLE_ARRAY if many else ParameterType.DOUBLE
    return ParameterType.STRING_ARRAY if many else ParameterType.STRING


class ParameterValue:
    """What `get_parameter_value()` returns: the value under the name of its type, 0 or empty under the others."""

    _EMPTY: ClassVar[dict[str, Any]] = {
        "bool_value": False, "integer_value": 0, "double_value": 0.0, "string_value": "", "byte_array_value": [],
        "bool_array_value": [], "integer_array_value": [], "double_array_value": [], "string_array_value": [],
    }  # fmt: skip

    def __init__(self, *, type: Any = 0, **values: Any) -> None:
        self.type = int(type)
        vars(self).update({name: values.get(name, empty) for name, empty in self._EMPTY.items()})


class Parameter:
    Type = ParameterType

    def __init__(self, name: str, type_: Any = None, value: Any = None) -> None:
        self.name, self.value = name, value
        self.type_ = _type_of(value) if type_ is None else type_

    def get_parameter_value(self) -> ParameterValue:
        found = ParameterValue(type=self.type_)
        if self.type_:
            setattr(found, f"{self.type_.name.lower()}_value", self.value)
        return found

    def to_parameter_msg(self) -> Any:
        return SimpleNamespace(name=self.name, value=self.get_parameter_value())


class Clock:
    def __init__(self, graph: Graph, *, clock_type: Any = None) -> None:
        self._graph, self.clock_type = graph, clock_type

    def now(self) -> Time:
        return Time(nanoseconds=self._graph.now, clock_type=self.clock_type)

    def sleep_for(self, duration: Duration) -> bool:
        self._graph.pause(self._graph.now + duration.nanoseconds)
        return True

    def sleep_until(self, until: Time) -> bool:
        self._graph.pause(until.nanoseconds)
        return True


class Publisher:
    def __init__(self, session: Session, publication: Publication, qos: Any) -> None:
        self._session, self._publication = session, publication
        self._latch = _latches(qos)
        self.topic_name, self.topic, self.msg_type = publication.topic, publication.topic, publication.kind

    def publish(self, msg: Any) -> None:
        kind = self._publication.kind
        if not isinstance(msg, kind):
            raise TypeError(
                f"publish of a {type(msg).__name__} on {self.topic_name}; accepted: a {kind.__name__}, "
                "which is the type that create_publisher was given"
            )
        self._session.graph.publish(self._publication, msg, latch=self._latch)

    def get_subscription_count(self) -> int:
        return sum(each.topic == self.topic_name for each in self._session.graph.subscriptions)

    def destroy(self) -> None:
        pass


class SubscriptionHandle:
    """What `create_subscription` returns."""

    def __init__(self, subscription: Subscription) -> None:
        self._subscription = subscription
        self.topic_name, self.msg_type, self.callback = subscription.topic, subscription.kind, subscription.callback

    def destroy(self) -> None:
        pass


class TimerHandle:
    """What `create_timer` returns."""

    def __init__(self, session: Session, timer: Timer) -> None:
        self._session, self._timer = session, timer

    @property
    def timer_period_ns(self) -> int:
        return self._timer.period

    @timer_period_ns.setter
    def timer_period_ns(self, value: int) -> None:
        self._timer.period = int(value)

    def cancel(self) -> None:
        self._timer.cancelled = True

    def reset(self) -> None:
        self._timer.cancelled = False
        self._timer.due = self._session.graph.now + self._timer.period

    def is_canceled(self) -> bool:
        return self._timer.cancelled

    def is_ready(self) -> bool:
        return not self._timer.cancelled and self._timer.due <= self._session.graph.now

    def time_since_last_call(self) -> int:
        return self._session.graph.now - (self._timer.due - self._timer.period)

    def time_until_next_call(self) -> int:
        return self._timer.due - self._session.graph.now

    def destroy(self) -> None:
        self._timer.cancelled = True


class Rate:
    def __init__(self, session: Session, hz: float) -> None:
        self._session, self._period = session, round(NANOSECONDS / hz)
        self._next = session.graph.now + self._period

    def sleep(self) -> None:
        self._session.graph.pause(self._next)
        self._next = max(self._next + self._period, self._session.graph.now + 1)

    def destroy(self) -> None:
        pass


class Future:
    def __init__(self, **_: Any) -> None:
        self._done, self._result, self._callbacks = False, None, list[Callable[[Any], Any]]()

    def done(self) -> bool:
        return self._done

    def result(self) -> Any:
        return self._result

    def exception(self) -> Any:
        return None

    def cancelled(self) -> bool:
        return False

    def cancel(self) -> None:
        pass

    def set_result(self, result: Any) -> None:
        self._result, self._done = result, True
        for callback in self._callbacks:
            callback(self)

    def add_done_callback(self, callback: Callable[[Any], Any]) -> None:
        self._callbacks.append(callback)


class Client:
    """Of a service or an action that nobody offers here."""

    def __init__(self, session: Session, name: str) -> None:
        self._session, self.srv_name = session, name

    def wait_for_service(self, timeout_sec: float | None = None) -> bool:
        graph = self._session.graph
        graph.pause(None if timeout_sec is None else graph.now + max(1, round(timeout_sec * NANOSECONDS)))
        return False

    wait_for_server = wait_for_service

    def service_is_ready(self) -> bool:
        return False

    server_is_ready = service_is_ready

    def call_async(self, *_: Any, **__: Any) -> Future:
        return Future()

    send_goal_async = call_async

    def call(self, *_: Any, **__: Any) -> Any:
        self._session.graph.pause(None)

    send_goal = call

    def destroy(self) -> None:
        pass


HistoryPolicy = enum.IntEnum(
    "HistoryPolicy",
    {"SYSTEM_DEFAULT": 0, "KEEP_LAST": 1, "KEEP_ALL": 2, "UNKNOWN": 3, "RMW_QOS_POLICY_HISTORY_KEEP_LAST": 1,
     "RMW_QOS_POLICY_HISTORY_KEEP_ALL": 2},
)  # fmt: skip
ReliabilityPolicy = enum.IntEnum(
    "ReliabilityPolicy",
    {"SYSTEM_DEFAULT": 0, "RELIABLE": 1, "BEST_EFFORT": 2, "UNKNOWN": 3, "RMW_QOS_POLICY_RELIABILITY_RELIABLE": 1,
     "RMW_QOS_POLICY_RELIABILITY_BEST_EFFORT": 2},
)  # fmt: skip
DurabilityPolicy = enum.IntEnum(
    "DurabilityPolicy",
    {"SYSTEM_DEFAULT": 0, "TRANSIENT_LOCAL": 1, "VOLATILE": 2, "UNKNOWN": 3,
     "RMW_QOS_POLICY_DURABILITY_TRANSIENT_LOCAL": 1, "RMW_QOS_POLICY_DURABILITY_VOLATILE": 2},
)  # fmt: skip
LivelinessPolicy = enum.IntEnum("LivelinessPolicy", {"SYSTEM_DEFAULT": 0, "AUTOMATIC": 1, "MANUAL_BY_TOPIC": 3})


class QoSProfile:
    def __init__(self, **values: Any) -> None:
        known = ("history", "depth", "reliability", "durability", "lifespan", "deadline", "liveliness",
                 "liveliness_lease_duration", "avoid_ros_namespace_conventions")  # fmt: skip
        for name in values:
            if name not in known:
                raise AssertionError(f"QoSProfile has no {name!r}; {accepted_names(name, known)}")
        self.history = values.get("history", HistoryPolicy.KEEP_LAST)
        self.depth = values.get("depth", 10)
        self.reliability = values.get("reliability", ReliabilityPolicy.RELIABLE)
        self.durability = values.get("durability", DurabilityPolicy.VOLATILE)
        self.liveliness = values.get("liveliness", LivelinessPolicy.SYSTEM_DEFAULT)
        self.lifespan, self.deadline = values.get("lifespan"), values.get("deadline")


def _depth(qos: Any) -> int:
    depth = qos.depth if isinstance(qos, QoSProfile) else qos
    if not isinstance(depth, int) or isinstance(depth, bool) or depth < 0:
        raise TypeError(f"the QoS is {depth!r}; accepted: a depth, which is a whole number, or a QoSProfile")
    return depth or 10


def _latches(qos: Any) -> bool:
    return isinstance(qos, QoSProfile) and qos.durability == DurabilityPolicy.TRANSIENT_LOCAL


class CallbackGroup:
    pass


class MutuallyExclusiveCallbackGroup(CallbackGroup):
    pass


class ReentrantCallbackGroup(CallbackGroup):
    pass


class Executor:
    """Calls what is due of its nodes, one after the other, however many threads it is said to have."""

    _session: Session

    def __init__(self, num_threads: Any = None, *, context: Any = None) -> None:
        self._nodes: list[Node] = []
        self._shut_down = False

    def add_node(self, node: Node) -> bool:
        if node in self._nodes:
            return False
        self._nodes.append(node)
        node.executor = self
        return True

    def remove_node(self, node: Node) -> None:
        if node in self._nodes:
            self._nodes.remove(node)

    def get_nodes(self) -> list[Node]:
        return list(self._nodes)

    def wake(self) -> None:
        pass

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        self._shut_down = True
        return True

    def create_task(self, callback: Callable[..., Any], *values: Any, **named: Any) -> Future:
        future = Future()
        future.set_result(callback(*values, **named))
        return future

    def spin(self) -> None:
        while self._session.ok and not self._shut_down:
            self._once(None)

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Call one callback; wait for it for so long at most. Without any wait, time goes on to the next tick."""
        if self._session.ok:
            now = self._session.graph.now
            self._once(None if timeout_sec is None or timeout_sec < 0 else now + round(timeout_sec * NANOSECONDS))

    def spin_until_future_complete(self, future: Future, timeout_sec: float | None = None) -> None:
        now = self._session.graph.now
        until = None if timeout_sec is None or timeout_sec < 0 else now + round(timeout_sec * NANOSECONDS)
        while self._session.ok and not future.done() and (until is None or self._session.graph.now < until):
            self._once(until)

    def _once(self, until: int | None) -> None:
        session = self._session
        subscriptions = [each for node in self._nodes for each in node._subscriptions]
        timers = [each for node in self._nodes for each in node._timers]
        if session.run_next(subscriptions, timers):
            return
        session.wait(subscriptions, timers, until)
        session.run_next(subscriptions, timers)


class Node:
    """rclpy.node.Node."""

    _session: Session

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
    ) -> None:
        session = self._session
        if not session.ok:
            raise RuntimeError(f"node {node_name!r} is made before rclpy.init(), or after rclpy.shutdown()")
        self._name, self._namespace = session.name or node_name, "/" + (namespace or "").strip("/")
        self._subscriptions: list[Subscription] = []
        self._timers: list[Timer] = []
        self._parameters: dict[str, Parameter] = {}
        self._overrides = {each.name: each.value for each in parameter_overrides or ()}
        self._undeclared = allow_undeclared_parameters
        self._on_set: list[Callable[[list[Parameter]], Any]] = []
        self._logger, self._clock = NodeLogger(session.graph, self._name), Clock(session.graph)
        self._group = MutuallyExclusiveCallbackGroup()
        self._handles: list[Any] = []
        self.executor: Any = None
        if automatically_declare_parameters_from_overrides:
            session.takes_all = True
            for name, value in session.given.items():
                self.declare_parameter(name, value)
        self._declare("use_sim_time", True)

    def get_name(self) -> str:
        return self._name

    def get_namespace(self) -> str:
        return self._namespace

    def get_fully_qualified_name(self) -> str:
        return f"{self._namespace.rstrip('/')}/{self._name}"

    def get_logger(self) -> NodeLogger:
        return self._logger

    def get_clock(self) -> Clock:
        return self._clock

    @property
    def default_callback_group(self) -> CallbackGroup:
        return self._group

    @property
    def context(self) -> Any:
        return SimpleNamespace(ok=lambda: self._session.ok)

    @property
    def publishers(self) -> list[Any]:
        return [each for each in self._handles if isinstance(each, Publisher)]

    @property
    def subscriptions(self) -> list[Any]:
        return [each for each in self._handles if isinstance(each, SubscriptionHandle)]

    @property
    def timers(self) -> list[Any]:
        return [each for each in self._handles if isinstance(each, TimerHandle)]

    def create_publisher(self, msg_type: Any, topic: str, qos_profile: Any, **_: Any) -> Publisher:
        _depth(qos_profile)
        graph = self._session.graph
        publication = Publication(self._full(topic), _kind(msg_type, topic), self._name, graph.place())
        graph.publications.append(publication)
        handle = Publisher(self._session, publication, qos_profile)
        self._handles.append(handle)
        return handle

    def create_subscription(
        self, msg_type: Any, topic: str, callback: Callable[[Any], Any], qos_profile: Any, **_: Any
    ) -> SubscriptionHandle:
        if not callable(callback):
            raise TypeError(f"the callback of {topic} is {callback!r}; accepted: a function")
        graph = self._session.graph
        subscription = Subscription(
            self._full(topic), _kind(msg_type, topic), callback, _depth(qos_profile), self._name, graph.place()
        )
        self._subscriptions.append(subscription)
        graph.subscribe(subscription)
        handle = SubscriptionHandle(subscription)
        self._handles.append(handle)
        return handle

    def create_timer(self, timer_period_sec: float, callback: Callable[[], Any], *_: Any, **__: Any) -> TimerHandle:
        if not timer_period_sec >= 0.0:
            raise ValueError(f"the period of a timer is {timer_period_sec!r}; accepted: seconds from 0")
        timer = self._session.add_timer(round(float(timer_period_sec) * NANOSECONDS), callback)
        self._timers.append(timer)
        handle = TimerHandle(self._session, timer)
        self._handles.append(handle)
        return handle

    def create_rate(self, frequency: float, *_: Any, **__: Any) -> Rate:
        return Rate(self._session, frequency)

    def create_client(self, srv_type: Any, srv_name: str, **_: Any) -> Client:
        return Client(self._session, srv_name)

    def create_service(self, srv_type: Any, srv_name: str, callback: Any, **_: Any) -> Any:
        return SimpleNamespace(srv_name=srv_name, callback=callback, destroy=lambda: None)

    def create_guard_condition(self, callback: Any, **_: Any) -> Any:
        return SimpleNamespace(trigger=callback, destroy=lambda: None)

    def destroy_node(self) -> bool:
        for each in self._subscriptions:
            if each in self._session.graph.subscriptions:
                self._session.graph.subscriptions.remove(each)
        self._subscriptions.clear()
        self._timers.clear()
        return True

    def destroy_timer(self, timer: Any) -> bool:
        timer.cancel()
        return True

    def destroy_subscription(self, subscription: Any) -> bool:
        found = subscription._subscription
        if found in self._subscriptions:
            self._subscriptions.remove(found)
            self._session.graph.subscriptions.remove(found)
        return True

    def destroy_publisher(self, publisher: Any) -> bool:
        if publisher._publication in self._session.graph.publications:
            self._session.graph.publications.remove(publisher._publication)
        return True

    def count_publishers(self, topic_name: str) -> int:
        return sum(each.topic == self._full(topic_name) for each in self._session.graph.publications)

    def count_subscribers(self, topic_name: str) -> int:
        return sum(each.topic == self._full(topic_name) for each in self._session.graph.subscriptions)

    def declare_parameter(self, name: str, value: Any = None, *_: Any, **__: Any) -> Parameter:
        if name in self._parameters and name != "use_sim_time":
            raise ParameterAlreadyDeclaredException(f"parameter {name!r} is declared twice")
        return self._declare(name, value)

    def _declare(self, name: str, value: Any) -> Parameter:
        if isinstance(value, (ParameterType, type)):  # says of which type it is, and has no default
            value = None
        given = self._session.take(name, self._overrides.get(name, value))
        lists = isinstance(given, (list, tuple)) and isinstance(value, (list, tuple))
        if value is not None and _type_of(given) != _type_of(value) and not lists:
            accepted = f"of the type of its default, {value!r}"
            raise InvalidParameterTypeException(
                f"parameter {name!r} of node {self._name!r} is {given!r}; accepted: {accepted}"
            )
        found = self._parameters[name] = Parameter(name, None, given)
        self._session.parameters[name] = given
        return found

    def declare_parameters(self, namespace: str, parameters: Sequence[Any], ignore_override: bool = False) -> Any:
        prefix = f"{namespace}." if namespace else ""
        return [self.declare_parameter(prefix + each[0], *each[1:]) for each in parameters]

    def has_parameter(self, name: str) -> bool:
        return name in self._parameters

    def undeclare_parameter(self, name: str) -> None:
        self._parameters.pop(name, None)

    def get_parameter(self, name: str) -> Parameter:
        if name in self._parameters:
            return self._parameters[name]
        if self._undeclared:
            return Parameter(name, None, self._session.take(name, None))
        raise ParameterNotDeclaredException(
            f"node {self._name!r} has declared no parameter {name!r}; {accepted_names(name, self._parameters)}"
        )

    def get_parameters(self, names: Sequence[str]) -> list[Parameter]:
        return [self.get_parameter(name) for name in names]

    def get_parameter_or(self, name: str, alternative_value: Any = None) -> Parameter:
        return self._parameters.get(name) or alternative_value or Parameter(name)

    def get_parameters_by_prefix(self, prefix: str) -> dict[str, Parameter]:
        start = f"{prefix}." if prefix else ""
        return {name[len(start) :]: each for name, each in self._parameters.items() if name.startswith(start)}

    def set_parameters(self, parameter_list: Sequence[Parameter]) -> list[Any]:
        results = []
        for each in parameter_list:
            if each.name not in self._parameters and not self._undeclared:
                raise ParameterNotDeclaredException(f"node {self._name!r} has declared no parameter {each.name!r}")
            answers = [callback([each]) for callback in self._on_set]
            result = next((a for a in answers if not a.successful), SimpleNamespace(successful=True, reason=""))
            if result.successful:
                self._parameters[each.name] = each
            results.append(result)
        return results

    def set_parameters_atomically(self, parameter_list: Sequence[Parameter]) -> Any:
        return self.set_parameters(parameter_list)[-1]

    def add_on_set_parameters_callback(self, callback: Any) -> None:
        self._on_set.append(callback)

    def set_parameters_callback(self, callback: Any) -> None:
        self._on_set = [callback]

    def describe_parameter(self, name: str) -> Any:
        return SimpleNamespace(name=name, type=int(self.get_parameter(name).type_))

    def _full(self, topic: str) -> str:
        return self._session.topic(topic, self._name, self._namespace.rstrip("/"))


def _kind(found: Any, topic: str) -> type:
    if not isinstance(found, type) or not hasattr(found, "_makers"):
        raise TypeError(f"the type of {topic} is {found!r}; accepted: a class of messages, such as LaserScan")
    return found


def rclpy_modules(session: Session) -> dict[str, ModuleType]:
    """Return the modules of rclpy, for one node."""
    graph = session.graph
    bound: dict[str, Any] = {"_session": session}
    node_kind = type("Node", (Node,), {**bound, "__doc__": Node.__doc__})
    executor_kind = type("Executor", (Executor,), bound)
    single = type("SingleThreadedExecutor", (executor_kind,), {})
    several = type("MultiThreadedExecutor", (executor_kind,), {})

    def init(*, args: Any = None, context: Any = None, **_: Any) -> None:
        session.ok = True

    def create_node(node_name: str, **named: Any) -> Any:
        return node_kind(node_name, **named)

    def ok(*, context: Any = None) -> bool:
        graph.breathe()
        return session.ok and not graph.closed

    def executor_of(node: Any, executor: Any) -> Any:
        if not isinstance(node, Node):
            raise TypeError(f"spin of {node!r}; accepted: a Node")
        executor = executor or node.executor or single()
        executor.add_node(node)
        return executor

    def spin(node: Any, executor: Any = None) -> None:
        executor_of(node, executor).spin()

    def spin_once(node: Any, *, executor: Any = None, timeout_sec: float | None = None) -> None:
        executor_of(node, executor).spin_once(timeout_sec)

    def spin_until_future_complete(
        node: Any, future: Future, executor: Any = None, timeout_sec: float | None = None
    ) -> None:
        executor_of(node, executor).spin_until_future_complete(future, timeout_sec)

    def shutdown(*, context: Any = None, **_: Any) -> None:
        if not session.ok and not session.ended:
            raise RuntimeError("rclpy.shutdown() before rclpy.init()")
        session.shut_down()

    def get_logger(name: str) -> NodeLogger:
        return NodeLogger(graph, name)

    ClockType = enum.IntEnum("ClockType", {"ROS_TIME": 1, "SYSTEM_TIME": 2, "STEADY_TIME": 3})  # noqa: N806
    clock = type("Clock", (Clock,), {"__init__": lambda self, *, clock_type=None: Clock.__init__(
        self, graph, clock_type=clock_type)})  # fmt: skip
    LoggingSeverity = enum.IntEnum(  # noqa: N806
        "LoggingSeverity", {"UNSET": 0, "DEBUG": 10, "INFO": 20, "WARN": 30, "ERROR": 40, "FATAL": 50}
    )
    sensors = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
    presets = SimpleNamespace(
        SENSOR_DATA=SimpleNamespace(value=sensors), SYSTEM_DEFAULT=SimpleNamespace(value=QoSProfile()),
        SERVICES_DEFAULT=SimpleNamespace(value=QoSProfile()), PARAMETERS=SimpleNamespace(value=QoSProfile(depth=1000)),
    )  # fmt: skip
    executors: dict[str, Any] = {
        "Executor": executor_kind, "SingleThreadedExecutor": single, "MultiThreadedExecutor": several,
        "ExternalShutdownException": ExternalShutdownException, "TimeoutException": TimeoutError,
    }  # fmt: skip
    action = type("ActionClient", (), {"__new__": lambda cls, node, kind, name, **_: Client(session, name)})
    server = type("ActionServer", (), {"__init__": lambda self, *_, **__: None, "destroy": lambda self: None})
    modules = {
        "rclpy": StandIn(
            "rclpy", init=init, create_node=create_node, ok=ok, spin=spin, spin_once=spin_once, shutdown=shutdown,
            try_shutdown=shutdown, spin_until_future_complete=spin_until_future_complete, Parameter=Parameter,
            get_default_context=lambda **_: SimpleNamespace(ok=ok, on_shutdown=session.hooks.append),
            get_global_executor=lambda: single(),
        ),
        "rclpy.node": StandIn("rclpy.node", Node=node_kind, Parameter=Parameter, Publisher=Publisher),
        "rclpy.qos": StandIn(
            "rclpy.qos", QoSProfile=QoSProfile, HistoryPolicy=HistoryPolicy, QoSHistoryPolicy=HistoryPolicy,
            ReliabilityPolicy=ReliabilityPolicy, QoSReliabilityPolicy=ReliabilityPolicy,
            DurabilityPolicy=DurabilityPolicy, QoSDurabilityPolicy=DurabilityPolicy, LivelinessPolicy=LivelinessPolicy,
            QoSLivelinessPolicy=LivelinessPolicy, qos_profile_sensor_data=sensors, QoSPresetProfiles=presets,
            qos_profile_system_default=QoSProfile(), qos_profile_services_default=QoSProfile(),
            qos_profile_parameters=QoSProfile(depth=1000),
        ),
        "rclpy.time": StandIn("rclpy.time", Time=Time, Duration=Duration),
        "rclpy.duration": StandIn("rclpy.duration", Duration=Duration, Infinite=Duration(seconds=9e9)),
        "rclpy.clock": StandIn("rclpy.clock", Clock=clock, ROSClock=clock, ClockType=ClockType),
        "rclpy.executors": StandIn("rclpy.executors", **executors),
        "rclpy.callback_groups": StandIn(
            "rclpy.callback_groups", CallbackGroup=CallbackGroup, ReentrantCallbackGroup=ReentrantCallbackGroup,
            MutuallyExclusiveCallbackGroup=MutuallyExclusiveCallbackGroup,
        ),
        "rclpy.parameter": StandIn("rclpy.parameter", Parameter=Parameter, ParameterType=ParameterType),
        "rclpy.logging": StandIn(
            "rclpy.logging", get_logger=get_logger, LoggingSeverity=LoggingSeverity,
            set_logger_level=lambda name, level: get_logger(name).set_level(level),
        ),
        "rclpy.exceptions": StandIn(
            "rclpy.exceptions", ParameterNotDeclaredException=ParameterNotDeclaredException,
            ParameterAlreadyDeclaredException=ParameterAlreadyDeclaredException,
            InvalidParameterTypeException=InvalidParameterTypeException, ROSInterruptException=ROSInterruptException,
        ),
        "rclpy.action": StandIn("rclpy.action", ActionClient=action, ActionServer=server),
        "rclpy.timer": StandIn("rclpy.timer", Timer=TimerHandle, Rate=Rate),
        "rclpy.publisher": StandIn("rclpy.publisher", Publisher=Publisher),
        "rclpy.subscription": StandIn("rclpy.subscription", Subscription=SubscriptionHandle),
        "rclpy.client": StandIn("rclpy.client", Client=Client),
        "rclpy.task": StandIn("rclpy.task", Future=Future),
        "rclpy.utilities": StandIn("rclpy.utilities", remove_ros_args=lambda args=None: list(args or ()), ok=ok),
        "rclpy.signals": StandIn("rclpy.signals", SignalHandlerOptions=enum.Enum("SignalHandlerOptions", "NO ALL")),
        "rclpy.constants": StandIn("rclpy.constants", S_TO_NS=NANOSECONDS),
    }  # fmt: skip
    return dict(modules)
