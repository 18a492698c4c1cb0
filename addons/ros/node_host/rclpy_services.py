"""Services and actions of rclpy. Requests are answered by the nodes of the same planner, or by nobody."""

from __future__ import annotations

import enum
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from .graph import NANOSECONDS
from .node_session import Session
from .rclpy_executors import Future
from .services import ask, offered, wait_for


class Client:
    """A client, as `create_client` returns it."""

    def __init__(self, session: Session, kind: Any, name: str) -> None:
        self._session, self.srv_type, self.srv_name = session, kind, name
        self.service_name = name

    def wait_for_service(self, timeout_sec: float | None = None) -> bool:
        graph = self._session.graph
        until = None if timeout_sec is None else graph.now + max(1, round(timeout_sec * NANOSECONDS))
        return wait_for(self._session, self.srv_name, until)

    def service_is_ready(self) -> bool:
        self._session.graph.breathe()
        return offered(self._session.graph, self.srv_name)

    def call_async(self, request: Any) -> Future:
        future = Future()
        ask(self._session.graph, self.srv_name, request, future.set_result)
        return future

    def call(self, request: Any) -> Any:
        future = self.call_async(request)
        if not future.done():
            self._session.graph.pause(None, future.done)
        return future.result()

    def remove_pending_request(self, future: Future) -> None:
        pass

    def destroy(self) -> None:
        pass


GoalStatus = enum.IntEnum(
    "GoalStatus", "UNKNOWN ACCEPTED EXECUTING CANCELING SUCCEEDED CANCELED ABORTED", start=0
)
"""action_msgs/GoalStatus."""
GoalResponse = enum.Enum("GoalResponse", {"REJECT": 1, "ACCEPT": 2})
CancelResponse = enum.Enum("CancelResponse", {"REJECT": 1, "ACCEPT": 2})


class ServerGoalHandle:
    """A goal, as the action's server has it."""

    def __init__(self, server: ActionServer, goal: Any, feedback: Callable[[Any], Any] | None) -> None:
        self._server, self._feedback = server, feedback
        self.request, self.status = goal, GoalStatus.ACCEPTED
        self.is_cancel_requested = False
        self.ended = Future()

    @property
    def is_active(self) -> bool:
        return self.status < GoalStatus.SUCCEEDED

    def publish_feedback(self, feedback: Any) -> None:
        if self._feedback is not None:
            self._feedback(SimpleNamespace(feedback=feedback))

    def execute(self, execute_callback: Any = None) -> None:
        self.status = GoalStatus.EXECUTING
        result = self._server.finish((execute_callback or self._server.execute_callback)(self))
        if self.is_active:
            self.status = GoalStatus.ABORTED
        self.ended.set_result(SimpleNamespace(status=int(self.status), result=result))

    def succeed(self) -> None:
        self.status = GoalStatus.SUCCEEDED

    def abort(self) -> None:
        self.status = GoalStatus.ABORTED

    def canceled(self) -> None:
        self.status = GoalStatus.CANCELED


class ActionServer:
    """rclpy.action.ActionServer."""

    def __init__(
        self,
        node: Any,
        action_type: Any,
        action_name: str,
        execute_callback: Any,
        *,
        goal_callback: Any = None,
        handle_accepted_callback: Any = None,
        cancel_callback: Any = None,
        **_: Any,
    ) -> None:
        self._node, self.execute_callback = node, execute_callback
        self._accepts = goal_callback or (lambda goal: GoalResponse.ACCEPT)
        self._accepted = handle_accepted_callback or ServerGoalHandle.execute
        self._cancels = cancel_callback or (lambda handle: CancelResponse.REJECT)
        node._fg.offer(f"{action_name}/goal", self._take)
        node._fg.offer(f"{action_name}/cancel", self._cancel)

    def finish(self, found: Any) -> Any:
        return self._node._fg.finish(found)

    def destroy(self) -> None:
        pass

    def _take(self, asked: Any) -> None:
        goal, feedback, answer = asked
        if self._accepts(goal) != GoalResponse.ACCEPT:
            answer(None)
            return
        handle = ServerGoalHandle(self, goal, feedback)
        answer(handle)
        self._accepted(handle)

    def _cancel(self, handle: ServerGoalHandle) -> Any:
        handle.is_cancel_requested = self._cancels(handle) == CancelResponse.ACCEPT
        return SimpleNamespace(goals_canceling=[handle] if handle.is_cancel_requested else [], return_code=0)


class ClientGoalHandle:
    """A goal, as the client has it."""

    def __init__(self, client: ActionClient, handle: ServerGoalHandle | None) -> None:
        self._client, self._handle, self.accepted = client, handle, handle is not None

    @property
    def status(self) -> int:
        return int(GoalStatus.UNKNOWN if self._handle is None else self._handle.status)

    def get_result_async(self) -> Future:
        return Future() if self._handle is None else self._handle.ended

    def get_result(self) -> Any:
        return self._client.wait(self.get_result_async())

    def cancel_goal_async(self) -> Future:
        future = Future()
        self._client.ask("cancel", self._handle, future.set_result)
        return future

    def cancel_goal(self) -> Any:
        return self._client.wait(self.cancel_goal_async())


class ActionClient:
    """rclpy.action.ActionClient."""

    def __init__(self, node: Any, action_type: Any, action_name: str, **_: Any) -> None:
        self._node, self._session, self._name = node, node._fg.session, action_name
        self._goals = Client(self._session, action_type, node._fg.full(f"{action_name}/goal"))

    def wait_for_server(self, timeout_sec: float | None = None) -> bool:
        return self._goals.wait_for_service(timeout_sec)

    def server_is_ready(self) -> bool:
        return self._goals.service_is_ready()

    def send_goal_async(self, goal: Any, feedback_callback: Any = None, goal_uuid: Any = None) -> Future:
        future = Future()
        answer = lambda handle: future.set_result(ClientGoalHandle(self, handle))  # noqa: E731
        self.ask("goal", (goal, feedback_callback, answer), lambda _: None)
        return future

    def send_goal(self, goal: Any, **named: Any) -> Any:
        handle = self.wait(self.send_goal_async(goal, **named))
        return handle.get_result() if handle.accepted else None

    def ask(self, part: str, request: Any, done: Callable[[Any], Any]) -> None:
        ask(self._session.graph, self._node._fg.full(f"{self._name}/{part}"), request, done)

    def wait(self, future: Future) -> Any:
        if not future.done():
            self._session.graph.pause(None, future.done)
        return future.result()

    def destroy(self) -> None:
        pass
