"""Lifecycle nodes of rclpy. Nobody asks for transitions here: a node is configured and activated when it is spun.

A transition that fails leaves the node where it was, and the race ends: it would not drive.
"""

from __future__ import annotations

import enum
from typing import Any

from .graph import NodeError
from .rclpy_handles import Publisher

TransitionCallbackReturn = enum.IntEnum("TransitionCallbackReturn", {"SUCCESS": 97, "FAILURE": 98, "ERROR": 99})


class State(enum.IntEnum):
    """lifecycle_msgs/State, with the names that rclpy's states have."""

    unconfigured = 1
    inactive = 2
    active = 3
    finalized = 4

    @property
    def state_id(self) -> int:
        return int(self)

    @property
    def label(self) -> str:
        return self.name


class LifecyclePublisher:
    """A publisher that is silent while its node is not active."""

    def __init__(self, node: Any, publisher: Publisher) -> None:
        self._node, self._publisher = node, publisher

    def __getattr__(self, name: str) -> Any:
        return getattr(self._publisher, name)

    @property
    def is_activated(self) -> bool:
        return bool(self._node._fg_state is State.active)

    def publish(self, msg: Any) -> None:
        if self.is_activated:
            self._publisher.publish(msg)


class LifecycleNodeMixin:
    """The methods that LifecycleNode adds to Node. Its callbacks do nothing and succeed unless overridden."""

    _fg: Any
    _fg_state = State.unconfigured

    def on_configure(self, state: State) -> TransitionCallbackReturn:
        return TransitionCallbackReturn.SUCCESS

    on_activate = on_deactivate = on_cleanup = on_shutdown = on_error = on_configure

    def create_lifecycle_publisher(self, *values: Any, **named: Any) -> LifecyclePublisher:
        return LifecyclePublisher(self, self.create_publisher(*values, **named))  # type: ignore[attr-defined]

    def trigger_configure(self) -> TransitionCallbackReturn:
        return self._fg_go("configure", State.unconfigured, State.inactive)

    def trigger_activate(self) -> TransitionCallbackReturn:
        return self._fg_go("activate", State.inactive, State.active)

    def trigger_deactivate(self) -> TransitionCallbackReturn:
        return self._fg_go("deactivate", State.active, State.inactive)

    def trigger_cleanup(self) -> TransitionCallbackReturn:
        return self._fg_go("cleanup", State.inactive, State.unconfigured)

    def trigger_shutdown(self) -> TransitionCallbackReturn:
        return self._fg_go("shutdown", self._fg_state, State.finalized)

    def fg_begin(self) -> None:
        """Configure and activate the node, where nobody has; NodeError: it does not succeed."""
        for name, state in (("configure", State.unconfigured), ("activate", State.inactive)):
            if self._fg_state is state and getattr(self, f"trigger_{name}")() != TransitionCallbackReturn.SUCCESS:
                raise NodeError(f"lifecycle node {self._fg.name!r} does not {name}: on_{name} has not returned SUCCESS")

    def _fg_go(self, name: str, begin: State, end: State) -> TransitionCallbackReturn:
        if self._fg_state is not begin:
            return TransitionCallbackReturn.FAILURE
        found = getattr(self, f"on_{name}")(begin)
        if found == TransitionCallbackReturn.SUCCESS:
            self._fg_state = end
        return TransitionCallbackReturn(found)
