"""The services of the node rosapi, by which clients of rosbridge ask what there is: topics, services, types, the time.

Answered are those whose answer is known here. There are no parameters and no actions. Source: rosbridge_suite, rosapi.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

from fg_mujoco.addons.ros.bag_messages import definition, type_store
from fg_mujoco.addons.ros.node_host.message_classes import ROS2, Definitions, Message, full_name, message_class
from fg_mujoco.errors import MessageError
from fg_mujoco.messages import shown

from ..live_race import SERVICES
from .json_messages import fields_of, kind_of

RACE, BRIDGE, ROSAPI = "/fg_mujoco", "/rosbridge_websocket", "/rosapi"
"""Nodes: the race, all clients, and the one that answers here."""

_NANOSECONDS = 1_000_000_000
_DISTRIBUTION = "humble"  # whose messages are spoken
_VALUES = ("float", "double", "boolean", "string", "wstring", "octet", "byte", "char")


class View(Protocol):
    """What the answers are about."""

    def topic_kinds(self) -> Mapping[str, str]:
        """Return the types of all topics that somebody publishes or takes."""

    def publishers(self, topic: str) -> list[str]:
        """Return the nodes that publish on a topic."""

    def subscribers(self, topic: str) -> list[str]:
        """Return the nodes that take a topic."""

    def now(self) -> int:
        """Return the time of ROS [ns]."""


class RosApi:
    """Answers the services of rosapi.

    Args:
      view: what there is.

    Attributes:
      kinds: types of the services, by name.
    """

    def __init__(self, view: View) -> None:
        self._view = view
        self._answers: dict[str, tuple[str, Callable[[Any], dict[str, Any]]]] = {
            "topics": ("Topics", self._topics),
            "topics_and_raw_types": ("TopicsAndRawTypes", self._topics_and_raw_types),
            "topics_for_type": ("TopicsForType", lambda kind: {"topics": _named(view.topic_kinds(), kind)}),
            "topic_type": ("TopicType", lambda topic: {"type": view.topic_kinds().get(topic, "")}),
            "publishers": ("Publishers", lambda topic: {"publishers": view.publishers(topic)}),
            "subscribers": ("Subscribers", lambda topic: {"subscribers": view.subscribers(topic)}),
            "services": ("Services", lambda _: {"services": list(self._services())}),
            "services_for_type": ("ServicesForType", lambda kind: {"services": _named(self._services(), kind)}),
            "service_type": ("ServiceType", lambda service: {"type": self._services().get(service, "")}),
            "service_node": ("ServiceNode", lambda service: {"node": next(iter(self._servers(service)), "")}),
            "nodes": ("Nodes", lambda _: {"nodes": [RACE, BRIDGE, ROSAPI]}),
            "node_details": ("NodeDetails", self._node_details),
            "message_details": ("MessageDetails", lambda kind: {"typedefs": _definitions(message_class(kind, ROS2))}),
            "service_request_details": ("ServiceRequestDetails", lambda kind: _part(kind, "Request")),
            "service_response_details": ("ServiceResponseDetails", lambda kind: _part(kind, "Response")),
            "action_servers": ("GetActionServers", lambda _: {"action_servers": []}),
            "get_param_names": ("GetParamNames", lambda _: {"names": []}),
            "get_time": ("GetTime", lambda _: {"time": self._time()}),
            "get_ros_version": ("GetROSVersion", lambda _: {"version": 2, "distro": _DISTRIBUTION}),
        }
        self.kinds = {f"{ROSAPI}/{name}": f"rosapi_msgs/srv/{kind}" for name, (kind, _) in self._answers.items()}

    def answer(self, service: str, request: Mapping[str, Any]) -> dict[str, Any]:
        """Return the response to a request; `service` is one of `kinds`.

        Raises:
          MessageError: a request that lacks a name, or an unknown type.
        """
        name = service.rpartition("/")[2]
        asked = _ASKED.get(name)
        value = request.get(asked) if asked else None
        if asked and not isinstance(value, str):
            raise MessageError(f"{asked} of {service} is {shown(value)}; accepted: a name")
        if asked == "type" and name in ("message_details", "topics_for_type"):
            value = kind_of(value)
        return self._answers[name][1](value)

    def _topics(self, _: Any) -> dict[str, Any]:
        kinds = self._view.topic_kinds()
        return {"topics": list(kinds), "types": list(kinds.values())}

    def _topics_and_raw_types(self, _: Any) -> dict[str, Any]:
        found = self._topics(None)
        return {**found, "typedefs_full_text": [_definition(kind) for kind in found["types"]]}

    def _services(self) -> dict[str, str]:
        return {**SERVICES, **self.kinds}

    def _servers(self, service: str) -> list[str]:
        return [ROSAPI] if service in self.kinds else [RACE] * (service in SERVICES)

    def _node_details(self, node: str) -> dict[str, Any]:
        view = self._view
        return {
            "subscribing": [topic for topic in view.topic_kinds() if node in view.subscribers(topic)],
            "publishing": [topic for topic in view.topic_kinds() if node in view.publishers(topic)],
            "services": [service for service in self._services() if node in self._servers(service)],
        }

    def _time(self) -> dict[str, int]:
        sec, nanosec = divmod(self._view.now(), _NANOSECONDS)
        return {"sec": sec, "nanosec": nanosec, "secs": sec, "nsecs": nanosec}  # roslibpy reads those of ROS 1


_ASKED = {
    "topics_for_type": "type", "topic_type": "topic", "publishers": "topic", "subscribers": "topic",
    "services_for_type": "type", "service_type": "service", "service_node": "service", "node_details": "node",
    "message_details": "type", "service_request_details": "type", "service_response_details": "type",
}  # fmt: skip
"""What a request must say."""


def _named(kinds: Mapping[str, str], kind: str) -> list[str]:
    """Return the names of a type, which may be said in the way of ROS 1."""
    return [name for name, each in kinds.items() if kind in (each, "/".join(each.split("/")[::2]))]


def _definition(kind: str) -> str:
    return definition(kind) if kind in type_store().fielddefs else ""


def _part(kind: str, part: str) -> dict[str, Any]:
    """Return the definitions of a service's request or response; none where they are not known."""
    package, _, name = kind.rpartition("/")
    found = Definitions(ROS2).parts(package.partition("/")[0], name).get(part)
    return {"typedefs": [] if found is None else _definitions(found)}


def _definitions(kind: type[Message]) -> list[dict[str, Any]]:
    """Return the definition of a type and of all types in it, each once."""
    found: dict[str, dict[str, Any]] = {}

    def add(kind: type[Message]) -> None:
        fields = fields_of(kind)
        found[kind._type] = {
            "type": kind._type, "fieldnames": [name for name, _, _ in fields],
            "fieldtypes": [element for _, element, _ in fields], "fieldarraylen": [length for *_, length in fields],
            "examples": [
                "[]" if length >= 0 else str(getattr(kind(), name)) if element in _VALUES or "int" in element else "{}"
                for name, element, length in fields
            ],
            "constnames": [], "constvalues": [],
        }  # fmt: skip
        for _, element, _ in fields:
            if "/" in element and element not in found:
                add(message_class(full_name(element), ROS2))

    add(kind)
    return list(found.values())
