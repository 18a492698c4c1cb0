"""Stubs of rclpy and its modules. Names, arguments and meanings are those of ROS 2 Humble's rclpy."""

from __future__ import annotations

import enum
from types import ModuleType, SimpleNamespace
from typing import Any

from .graph import NANOSECONDS
from .imports import StandIn
from .node_session import NodeLogger, Session
from .rclpy_executors import (
    CallbackGroup,
    Executor,
    Future,
    MutuallyExclusiveCallbackGroup,
    ReentrantCallbackGroup,
)
from .rclpy_handles import Clock, Publisher, Rate, SubscriptionHandle, TimerHandle
from .rclpy_lifecycle import LifecycleNodeMixin, LifecyclePublisher, State, TransitionCallbackReturn
from .rclpy_node import Node, wait_for_message
from .rclpy_parameters import (
    InvalidParameterTypeException,
    InvalidParameterValueException,
    Parameter,
    ParameterAlreadyDeclaredException,
    ParameterException,
    ParameterNotDeclaredException,
    ParameterType,
    parameter_value_to_python,
)
from .rclpy_qos import QOS_MEMBERS
from .rclpy_services import (
    ActionClient,
    ActionServer,
    CancelResponse,
    Client,
    ClientGoalHandle,
    GoalResponse,
    GoalStatus,
    ServerGoalHandle,
)
from .rclpy_times import Duration, Time

ClockType = enum.IntEnum("ClockType", {"ROS_TIME": 1, "SYSTEM_TIME": 2, "STEADY_TIME": 3})
LoggingSeverity = enum.IntEnum(
    "LoggingSeverity", {"UNSET": 0, "DEBUG": 10, "INFO": 20, "WARN": 30, "ERROR": 40, "FATAL": 50}
)


_EXCEPTIONS: dict[str, type] = {each.__name__: each for each in (
    InvalidParameterTypeException, InvalidParameterValueException, ParameterAlreadyDeclaredException,
    ParameterException, ParameterNotDeclaredException,
)}  # fmt: skip
_OF_EXECUTORS = {
    name: type(name, (Exception,), {})
    for name in ("ExternalShutdownException", "TimeoutException", "ShutdownException", "ConditionReachedException")
}
_EXCEPTIONS |= {  # that nothing here raises
    name: type(name, (ParameterException if "Parameter" in name else Exception,), {})
    for name in (
        "InvalidHandle", "InvalidParameterException", "InvalidTopicNameException", "NotInitializedException",
        "ParameterImmutableException", "ParameterUninitializedException", "ROSInterruptException",
    )
}  # fmt: skip


def rclpy_modules(session: Session) -> dict[str, ModuleType]:
    """Return the modules of rclpy, for one node."""
    graph = session.graph
    node_kind = type("Node", (Node,), {"_fg_session": session, "__doc__": Node.__doc__})
    lifecycle_kind = type("LifecycleNode", (LifecycleNodeMixin, node_kind), {"__doc__": LifecycleNodeMixin.__doc__})
    executor_kind = type("Executor", (Executor,), {"_session": session})
    single = type("SingleThreadedExecutor", (executor_kind,), {})
    several = type("MultiThreadedExecutor", (executor_kind,), {})
    shared: list[Any] = []  # the global executor

    class Context:
        def init(self, *_: Any, **__: Any) -> None:
            session.ok = True

        def ok(self) -> bool:
            return ok()

        def on_shutdown(self, callback: Any) -> None:
            session.hooks.append(callback)

        def shutdown(self) -> None:
            session.shut_down()

        try_shutdown = shutdown

    def init(*, args: Any = None, context: Any = None, **_: Any) -> Context:
        session.ok = True
        return Context()

    def create_node(node_name: str, **named: Any) -> Any:
        return node_kind(node_name, **named)

    def ok(*, context: Any = None) -> bool:
        graph.breathe()
        return session.ok and not graph.closed

    def get_global_executor() -> Any:
        if not shared:
            shared.append(single())
        return shared[0]

    def executor_of(node: Any, executor: Any) -> Any:
        if not isinstance(node, Node):
            raise TypeError(f"spin of {node!r}; accepted: a Node")
        executor = executor or node.executor or get_global_executor()
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

    def try_shutdown(**_: Any) -> None:
        session.shut_down()

    def get_logger(name: str) -> NodeLogger:
        return NodeLogger(graph, name)

    def set_logger_level(name: str, level: Any, **_: Any) -> None:
        get_logger(name).set_level(level)

    clock = type("Clock", (Clock,), {"__init__": lambda self, *, clock_type=None: Clock.__init__(
        self, graph, clock_type=clock_type)})  # fmt: skip
    executors: dict[str, Any] = {
        "Executor": executor_kind, "SingleThreadedExecutor": single, "MultiThreadedExecutor": several,
        **_OF_EXECUTORS,
    }  # fmt: skip
    parameters: dict[str, Any] = {
        "Parameter": Parameter, "ParameterType": ParameterType, "parameter_value_to_python": parameter_value_to_python,
        "PARAMETER_SEPARATOR_STRING": ".",
    }  # fmt: skip
    actions: dict[str, Any] = {
        "ActionClient": ActionClient, "ActionServer": ActionServer, "GoalResponse": GoalResponse,
        "CancelResponse": CancelResponse, "GoalStatus": GoalStatus,
    }  # fmt: skip
    contexts: dict[str, Any] = {"ok": ok, "get_default_context": lambda **_: Context(), "try_shutdown": try_shutdown}
    groups: dict[str, Any] = {
        "CallbackGroup": CallbackGroup, "ReentrantCallbackGroup": ReentrantCallbackGroup,
        "MutuallyExclusiveCallbackGroup": MutuallyExclusiveCallbackGroup,
    }  # fmt: skip
    handles: dict[str, Any] = {
        "Publisher": Publisher, "Subscription": SubscriptionHandle, "Timer": TimerHandle, "Rate": Rate,
        "Client": Client, "Service": SimpleNamespace,
    }  # fmt: skip
    of_modules: dict[str, dict[str, Any]] = {
        "rclpy": {
            "init": init, "create_node": create_node, "spin": spin, "spin_once": spin_once, "shutdown": shutdown,
            "spin_until_future_complete": spin_until_future_complete, "Parameter": Parameter, "Node": node_kind,
            "get_global_executor": get_global_executor, "Context": Context, "Future": Future, **contexts,
            "get_rmw_implementation_identifier": lambda: "fg_mujoco", "uninstall_signal_handlers": lambda: None,
        },
        "rclpy.node": {"Node": node_kind, "Parameter": Parameter, "Clock": clock, **handles, **groups},
        "rclpy.qos": QOS_MEMBERS,
        "rclpy.qos_overriding_options": {"QoSOverridingOptions": SimpleNamespace},
        "rclpy.time": {"Time": Time, "Duration": Duration, "CONVERSION_CONSTANT": NANOSECONDS},
        "rclpy.duration": {"Duration": Duration, "Infinite": Duration(seconds=9e9)},
        "rclpy.clock": {"Clock": clock, "ROSClock": clock, "ClockType": ClockType},
        "rclpy.clock_type": {"ClockType": ClockType},
        "rclpy.executors": executors,
        "rclpy.callback_groups": groups,
        "rclpy.parameter": parameters,
        "rclpy.logging": {
            "get_logger": get_logger, "LoggingSeverity": LoggingSeverity, "set_logger_level": set_logger_level,
        },
        "rclpy.impl.rcutils_logger": {"RcutilsLogger": NodeLogger},
        "rclpy.impl.logging_severity": {"LoggingSeverity": LoggingSeverity},
        "rclpy.exceptions": _EXCEPTIONS,
        "rclpy.action": actions,
        "rclpy.action.client": {"ActionClient": ActionClient, "ClientGoalHandle": ClientGoalHandle, **actions},
        "rclpy.action.server": {"ServerGoalHandle": ServerGoalHandle, **actions},
        "rclpy.timer": {"Timer": TimerHandle, "Rate": Rate},
        "rclpy.publisher": {"Publisher": Publisher},
        "rclpy.subscription": {"Subscription": SubscriptionHandle},
        "rclpy.client": {"Client": Client},
        "rclpy.service": {"Service": SimpleNamespace},
        "rclpy.task": {"Future": Future, "Task": Future},
        "rclpy.context": {"Context": Context},
        "rclpy.utilities": {
            "remove_ros_args": lambda args=None: list(args or [str(session.file)]), "shutdown": shutdown,
            "timeout_sec_to_nsec": lambda seconds: round(seconds * NANOSECONDS), **contexts,
        },
        "rclpy.wait_for_message": {"wait_for_message": wait_for_message},
        "rclpy.signals": {"SignalHandlerOptions": enum.Enum("SignalHandlerOptions", "NO ALL SIGINT SIGTERM")},
        **dict.fromkeys(("rclpy.qos_event", "rclpy.event_handler"), dict.fromkeys(
            ("SubscriptionEventCallbacks", "PublisherEventCallbacks", "QoSSubscriptionEventType",
             "QoSPublisherEventType"), SimpleNamespace)),
        "rclpy.lifecycle": {
            "LifecycleNode": lifecycle_kind, "Node": lifecycle_kind, "LifecycleState": State, "State": State,
            "TransitionCallbackReturn": TransitionCallbackReturn, "LifecyclePublisher": LifecyclePublisher,
            "Publisher": LifecyclePublisher,
        },
        "rclpy.lifecycle.node": {"LifecycleNode": lifecycle_kind, "TransitionCallbackReturn": TransitionCallbackReturn},
        "rclpy.constants": {"S_TO_NS": NANOSECONDS},
    }  # fmt: skip
    return {name: StandIn(name, **members) for name, members in of_modules.items()}
