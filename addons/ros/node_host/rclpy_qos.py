"""Qualities of service of rclpy. Only the depth of a queue and whether a topic is latched change anything here."""

from __future__ import annotations

import enum
from typing import Any

from fg_mujoco.errors import accepted_names


class PolicyEnum(enum.IntEnum):
    """Base class of the policies."""

    @classmethod
    def short_keys(cls) -> list[str]:
        return [name.lower() for name in cls.__members__ if not name.startswith("RMW")]

    @classmethod
    def get_from_short_key(cls, name: str) -> int:
        return int(cls[name.upper()].value)

    @property
    def short_key(self) -> str:
        return self.name.lower()


def _policy(name: str, prefix: str, **values: int) -> Any:
    """Return the enumeration of a policy, with the names that it had in Foxy, too."""
    kind: Any = PolicyEnum
    return kind(name, {**values, **{f"RMW_QOS_POLICY_{prefix}_{key}": number for key, number in values.items()}})


HistoryPolicy = _policy("HistoryPolicy", "HISTORY", SYSTEM_DEFAULT=0, KEEP_LAST=1, KEEP_ALL=2, UNKNOWN=3)
ReliabilityPolicy = _policy(
    "ReliabilityPolicy", "RELIABILITY", SYSTEM_DEFAULT=0, RELIABLE=1, BEST_EFFORT=2, UNKNOWN=3, BEST_AVAILABLE=4
)
DurabilityPolicy = _policy(
    "DurabilityPolicy", "DURABILITY", SYSTEM_DEFAULT=0, TRANSIENT_LOCAL=1, VOLATILE=2, UNKNOWN=3, BEST_AVAILABLE=4
)
LivelinessPolicy = _policy(
    "LivelinessPolicy", "LIVELINESS", SYSTEM_DEFAULT=0, AUTOMATIC=1, MANUAL_BY_TOPIC=3, UNKNOWN=4, BEST_AVAILABLE=5
)


class InvalidQoSProfileException(Exception):
    pass


class QoSProfile:
    """rclpy.qos.QoSProfile."""

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
        self.liveliness_lease_duration = values.get("liveliness_lease_duration")
        self.avoid_ros_namespace_conventions = values.get("avoid_ros_namespace_conventions", False)


def depth_of(qos: Any) -> int:
    """Return the number of messages in a queue, from a QoSProfile, a preset or a number."""
    qos = getattr(qos, "value", qos)
    depth = qos.depth if isinstance(qos, QoSProfile) else qos
    if not isinstance(depth, int) or isinstance(depth, bool) or depth < 0:
        raise TypeError(f"the QoS is {depth!r}; accepted: a depth, which is a whole number, or a QoSProfile")
    return depth or 10


def latches(qos: Any) -> bool:
    """Return whether a topic keeps its last message for those who come later."""
    qos = getattr(qos, "value", qos)
    return isinstance(qos, QoSProfile) and qos.durability == DurabilityPolicy.TRANSIENT_LOCAL


SENSOR_DATA = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
SYSTEM_DEFAULT, SERVICES_DEFAULT = QoSProfile(), QoSProfile()
PARAMETERS, PARAMETER_EVENTS = QoSProfile(depth=1000), QoSProfile(depth=1000)
ACTION_STATUS = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class QoSPresetProfiles(enum.Enum):
    """rclpy.qos.QoSPresetProfiles."""

    UNKNOWN = QoSProfile()
    SYSTEM_DEFAULT = SYSTEM_DEFAULT
    SENSOR_DATA = SENSOR_DATA
    SERVICES_DEFAULT = SERVICES_DEFAULT
    PARAMETERS = PARAMETERS
    PARAMETER_EVENTS = PARAMETER_EVENTS
    ACTION_STATUS_DEFAULT = ACTION_STATUS

    @classmethod
    def get_from_short_key(cls, name: str) -> QoSProfile:
        found: QoSProfile = cls[name.upper()].value
        return found


QOS_MEMBERS: dict[str, Any] = {
    "QoSProfile": QoSProfile, "HistoryPolicy": HistoryPolicy, "QoSHistoryPolicy": HistoryPolicy,
    "ReliabilityPolicy": ReliabilityPolicy, "QoSReliabilityPolicy": ReliabilityPolicy,
    "DurabilityPolicy": DurabilityPolicy, "QoSDurabilityPolicy": DurabilityPolicy,
    "LivelinessPolicy": LivelinessPolicy, "QoSLivelinessPolicy": LivelinessPolicy,
    "InvalidQoSProfileException": InvalidQoSProfileException, "QoSPresetProfiles": QoSPresetProfiles,
    "qos_profile_sensor_data": SENSOR_DATA, "qos_profile_system_default": SYSTEM_DEFAULT,
    "qos_profile_services_default": SERVICES_DEFAULT, "qos_profile_parameters": PARAMETERS,
    "qos_profile_parameter_events": PARAMETER_EVENTS, "qos_profile_action_status_default": ACTION_STATUS,
    "qos_profile_default": SYSTEM_DEFAULT,
}  # fmt: skip
"""Of the module rclpy.qos."""
