"""The objects that nodes of rclpy make: publishers, subscriptions, timers, rates; and their clock."""

from __future__ import annotations

from typing import Any

from .graph import NANOSECONDS, Graph, Publication, Subscription
from .node_session import Session, Timer
from .rclpy_qos import latches
from .rclpy_times import Duration, Time


class Handle:
    """rclpy's `handle` of a node, a publisher and so on: a context manager that does nothing."""

    def __init__(self, name: str, namespace: str = "/") -> None:
        self.name, self.namespace = name, namespace

    def __enter__(self) -> Handle:
        return self

    def __exit__(self, *_: Any) -> None:
        pass

    def get_namespace(self) -> str:
        return self.namespace

    def get_fully_qualified_name(self) -> str:
        return f"{self.namespace.rstrip('/')}/{self.name}"


class Clock:
    def __init__(self, graph: Graph, *, clock_type: Any = None) -> None:
        self._graph, self.clock_type = graph, clock_type

    def now(self) -> Time:
        return Time(nanoseconds=self._graph.read(), clock_type=self.clock_type)

    def sleep_for(self, duration: Duration) -> bool:
        self._graph.pause(self._graph.now + duration.nanoseconds)
        return True

    def sleep_until(self, until: Time) -> bool:
        self._graph.pause(until.nanoseconds)
        return True


class Publisher:
    def __init__(self, session: Session, publication: Publication, qos: Any) -> None:
        self._session, self._publication = session, publication
        self._latch = latches(qos)
        self.topic_name, self.topic, self.msg_type = publication.topic, publication.topic, publication.kind
        self.qos_profile, self.handle = qos, Handle(publication.topic)

    def publish(self, msg: Any) -> None:
        kind = self._publication.kind
        if not isinstance(msg, kind):
            raise TypeError(
                f"publish of a {type(msg).__name__} on {self.topic_name}; accepted: a {kind.__name__}, "
                "which is the type that create_publisher was given"
            )
        self._session.graph.publish(self._publication, msg, latch=self._latch)

    def get_subscription_count(self) -> int:
        """Return the number of subscribers; the car is one of a drive topic."""
        self._session.graph.breathe()
        drives = int("ackermann_msgs/" in getattr(self.msg_type, "_type", ""))
        return drives + sum(each.topic == self.topic_name for each in self._session.graph.subscriptions)

    def assert_liveliness(self) -> None:
        pass

    def wait_for_all_acked(self, timeout: Any = None) -> bool:
        return True

    def destroy(self) -> None:
        pass


class SubscriptionHandle:
    """A subscription, as `create_subscription` returns it."""

    def __init__(self, session: Session, subscription: Subscription, qos: Any, group: Any) -> None:
        self._session, self._subscription = session, subscription
        self.qos_profile, self.callback_group, self.handle = qos, group, Handle(subscription.topic)
        self.raw = False
        self.topic_name, self.msg_type, self.callback = subscription.topic, subscription.kind, subscription.callback

    def get_publisher_count(self) -> int:
        """Return the number of publishers on its topic."""
        graph = self._session.graph
        return (self.topic_name in graph.provided) + sum(each.topic == self.topic_name for each in graph.publications)

    def destroy(self) -> None:
        self._session.graph.forget(self._subscription)


class TimerHandle:
    """A timer, as `create_timer` returns it."""

    def __init__(self, session: Session, timer: Timer, callback: Any, group: Any) -> None:
        self._session, self._timer = session, timer
        self.callback, self.callback_group, self.handle = callback, group, Handle("timer")
        self.clock = Clock(session.graph)

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
