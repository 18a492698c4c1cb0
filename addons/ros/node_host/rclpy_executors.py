"""Executors, futures and callback groups of rclpy. Callbacks come one after the other, whatever the executor."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Generator
from typing import Any

from .graph import NANOSECONDS
from .node_session import Session
from .rclpy_lifecycle import LifecycleNodeMixin


class Future:
    """rclpy.task.Future: what is not known yet."""

    def __init__(self, **_: Any) -> None:
        self._done = self._cancelled = False
        self._result: Any = None
        self._exception: BaseException | None = None
        self._callbacks: list[Callable[[Any], Any]] = []

    def done(self) -> bool:
        return self._done

    def result(self) -> Any:
        if self._exception is not None:
            raise self._exception
        return self._result

    def exception(self) -> BaseException | None:
        return self._exception

    def cancelled(self) -> bool:
        return self._cancelled

    def cancel(self) -> None:
        self._cancelled = self._done = True

    def set_result(self, result: Any) -> None:
        self._result = result
        self._end()

    def set_exception(self, exception: BaseException) -> None:
        self._exception = exception
        self._end()

    def add_done_callback(self, callback: Callable[[Any], Any]) -> None:
        if self._done:
            callback(self)
        else:
            self._callbacks.append(callback)

    def __await__(self) -> Generator[Any, None, Any]:
        while not self._done:
            yield self
        return self.result()

    def _end(self) -> None:
        self._done = True
        callbacks, self._callbacks = self._callbacks, []
        for callback in callbacks:
            callback(self)


class CallbackGroup:
    def can_execute(self, entity: Any) -> bool:
        return True

    def has_entity(self, entity: Any) -> bool:
        return False

    def add_entity(self, entity: Any) -> None:
        pass


class MutuallyExclusiveCallbackGroup(CallbackGroup):
    pass


class ReentrantCallbackGroup(CallbackGroup):
    pass


class Executor:
    """Calls what is due of its nodes, one after the other, however many threads it is said to have."""

    _session: Session

    def __init__(self, num_threads: Any = None, *, context: Any = None) -> None:
        self._nodes: list[Any] = []
        self._tasks: list[Callable[[], Any]] = []
        self._shut_down = False
        self.context = context

    def __enter__(self) -> Executor:
        return self

    def __exit__(self, *_: Any) -> None:
        self.shutdown()

    def add_node(self, node: Any) -> bool:
        if node in self._nodes:
            return False
        self._nodes.append(node)
        node.executor = self
        if isinstance(node, LifecycleNodeMixin):
            self._tasks.append(node.fg_begin)
        return True

    def remove_node(self, node: Any) -> None:
        if node in self._nodes:
            self._nodes.remove(node)

    def get_nodes(self) -> list[Any]:
        return list(self._nodes)

    def wake(self) -> None:
        pass

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        self._shut_down = True
        return True

    def create_task(self, callback: Any, *values: Any, **named: Any) -> Future:
        """Call a function, or run a coroutine, when the executor spins."""
        future = Future()

        def run() -> None:
            found = callback if inspect.iscoroutine(callback) else callback(*values, **named)
            future.set_result(self.finish(found))

        self._tasks.append(run)
        return future

    def finish(self, found: Any) -> Any:
        """Return the result of a callback; a coroutine is run to its end, and other callbacks come meanwhile."""
        if not inspect.iscoroutine(found):
            return found
        while True:
            try:
                waits_for = found.send(None)
            except StopIteration as end:
                return end.value
            self._once(None, waits_for.done if isinstance(waits_for, Future) else lambda: True)

    def spin(self) -> None:
        while self._session.ok and not self._shut_down:
            self._once(None)

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Call one callback; wait for it for so long at most. Without any wait, time goes on to the next tick."""
        if self._session.ok:
            self._once(self._until(timeout_sec))

    def spin_until_future_complete(self, future: Future, timeout_sec: float | None = None) -> None:
        until = self._until(timeout_sec)
        while self._session.ok and not future.done() and (until is None or self._session.graph.now < until):
            self._once(until, future.done)

    def spin_once_until_future_complete(self, future: Future, timeout_sec: float | None = None) -> None:
        if self._session.ok and not future.done():
            self._once(self._until(timeout_sec), future.done)

    def _until(self, timeout_sec: float | None) -> int | None:
        if timeout_sec is None or timeout_sec < 0:
            return None
        return self._session.graph.now + round(timeout_sec * NANOSECONDS)

    def _once(self, until: int | None, ready: Callable[[], bool] = lambda: False) -> None:
        session = self._session
        if self._tasks:
            self._tasks.pop(0)()
            return
        subscriptions = [each for node in self._nodes for each in node._fg.subscriptions]
        timers = [each for node in self._nodes for each in node._fg.timers]
        if session.run_next(subscriptions, timers) or ready():
            return
        session.wait(subscriptions, timers, until, ready=ready)
        session.run_next(subscriptions, timers)
