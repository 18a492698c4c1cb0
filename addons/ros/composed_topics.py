"""Topics of bare numbers, AutoDRIVE's and the VESC's: what they mean, and what they make together in a bag.

AutoDRIVE's bridge has one topic for each quantity, `/autodrive/CAR/throttle_command` and so on, without stamps. What
reads bags knows AckermannDriveStamped, Odometry and JointState. Those are composed here:

| composed topic | type | of |
| --- | --- | --- |
| `/autodrive/CAR/command` | AckermannDriveStamped | `throttle_command`, `steering_command` |
| `/autodrive/CAR/odometry` | Odometry, frame `map` | `ips`, the heading and the yaw rate of `imu`, `speed` |
| `/autodrive/CAR/wheels` | JointState of the rear wheels | `left_encoder`, `right_encoder` |
| `/commands`, `/vesc/commands` | AckermannDriveStamped | the VESC's `motor/speed`, `servo/position` |

Their stamps are the recorder's times. The bridge broadcasts the position as that of the car's frame, at the rear axle.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fg_mujoco.messages import DriveCommand, Odometry
from fg_mujoco.vehicle.sensors.vesc import AMBIENT, Electrics

from .bag_messages import (
    DRIVE,
    IMU,
    JOINTS,
    MAP_FRAME,
    MOTOR,
    NUMBER,
    NUMBER_32,
    ODOMETRY,
    WHEEL_JOINTS,
    drive_message,
    heading_of,
    imu_message,
    joints_message,
    measures,
    odometry_message,
    stamp_of,
    type_store,
)

THROTTLE, STEERING = 25.25, 0.5236
"""[m/s] of the wheels, [rad] at a command of 1. Sources: AutoDRIVE-Simulator at bb0c5018, whose wheels turn at 2.5 m/s
at a throttle of 0.1, as a team of the league measured, and whose drag leaves 22.88 m/s of the 25.25; RoboRacer Sim
Racing League, technical guide of 2026."""
RANGE_MIN, RANGE_MAX = 0.06, 10.0
"""[m] that AutoDRIVE's LiDAR measures; of all else it says inf. Source: the same guide."""

_CAR = Electrics.bundled()
SPEED_TO_ERPM, BATTERY, VOLTS_FOR_SPEED = _CAR.erpm_per_speed, _CAR.full_voltage, _CAR.volts_per_speed
"""[1/m 1/min s] of the VESC's motor, [V] of the battery without a load, [V s/m] of the motor: the default car's."""
_TEMPERATURES = ("temp_fet", "temp_motor", "ntc_temp_mos1", "ntc_temp_mos2", "ntc_temp_mos3")

VESC = re.compile(r"(?P<driver>(?:/vesc)?)/commands/(?P<name>motor/speed|servo/position)")
STEERING_TO_SERVO, SERVO_OFFSET = -1.2135, 0.5304  # the same

TOPIC = re.compile(r"/autodrive/(?P<car>\w+)/(?P<name>\w+)")
_POINT = "geometry_msgs/msg/Point"
_FASTEST = 2_000_000  # [ns] between two readings of an encoder, below which a difference says nothing

Topic = tuple[str, str]


def steering_of_servo(position: float) -> float:
    """Return the steering angle [rad] of a position of the VESC's servo, 0 to 1."""
    return (position - SERVO_OFFSET) / STEERING_TO_SERVO


def motor_fields(odometry: Odometry, mass: float) -> dict[str, float]:
    """Return the fields of a VescState of ROS 2 that are not 0.

    They are those of the car's VESC, its reading `vesc`. Of a car without one they are those of the default car's motor
    and battery, for a force that is the mass [kg] times the acceleration ahead.
    """
    told = odometry.readings.get("vesc")
    if told is not None and told.received:
        numbers = told.values[told.columns.index("erpm") :].tolist()
    else:
        electric = _CAR.at(odometry.speed, mass * float(odometry.linear_acceleration[0]))
        numbers = [odometry.speed * SPEED_TO_ERPM, *electric, AMBIENT]
    names = ("speed", "voltage_input", "duty_cycle", "current_motor", "current_input")
    fields = dict(zip(names, numbers, strict=False))
    return fields | {"avg_iq": fields["current_motor"], **dict.fromkeys(_TEMPERATURES, numbers[-1])}


def motor_message(odometry: Odometry, mass: float) -> Any:
    """Return vesc_msgs/VescStateStamped of ROS 2, as the VESC's driver has it."""
    kind, store, told = "vesc_msgs/msg/VescState", type_store(), motor_fields(odometry, mass)
    # of a field: its name, and what it is of: (1, (name of the type, bound))
    values = {name: told.get(name, 0.0 if said[0] == "float64" else 0) for name, (_, said) in store.fielddefs[kind][1]}
    header = imu_message(odometry, frame="").header
    return store.types[MOTOR](header=header, state=store.types[kind](**values))


@dataclass(frozen=True)
class Composed:
    """A topic that others make together, its `sources`, of about `count` messages.

    Sources in `hides` are not to be chosen by themselves. `begin` returns what takes the sources' messages in turn,
    each with its time [ns], and returns a message or None.
    """

    sources: frozenset[Topic]
    count: int
    hides: frozenset[Topic]
    begin: Callable[[], Callable[[Topic, Any, int], Any]]


def composed_topics(counts: Mapping[Topic, int]) -> dict[Topic, Composed]:
    """Return the topics that can be composed of those of a bag."""
    cars: dict[str, dict[str, Topic]] = {}
    drivers: dict[str, dict[str, Topic]] = {}
    for kind, name in counts:
        found = VESC.fullmatch(name)
        if found is not None and kind in (NUMBER, NUMBER_32):
            drivers.setdefault(found["driver"], {})[found["name"]] = (kind, name)
        found = TOPIC.fullmatch(name)
        if found is not None:
            cars.setdefault(found["car"], {})[found["name"]] = (kind, name)
    made: dict[Topic, Composed] = {
        (DRIVE, f"{driver}/commands"): _composed(counts, topics, _VescCommands, "servo/position")
        for driver, topics in drivers.items()
        if len(topics) == 2
    }
    for car, topics in cars.items():
        commands = _of(topics, {"throttle_command": NUMBER_32, "steering_command": NUMBER_32})
        if "steering_command" in commands:
            made[DRIVE, f"/autodrive/{car}/command"] = _composed(counts, commands, _Commands, "steering_command")
        places = _of(topics, {"ips": _POINT, "imu": IMU, "speed": NUMBER_32})
        if {"ips", "imu"} <= set(places) and "odom" not in topics:
            made[ODOMETRY, f"/autodrive/{car}/odometry"] = _composed(counts, places, _Places, "ips")
        encoders = _of(topics, {"left_encoder": JOINTS, "right_encoder": JOINTS})
        if len(encoders) == 2:
            made[JOINTS, f"/autodrive/{car}/wheels"] = _composed(counts, encoders, _Wheels, "right_encoder", hides=True)
    return made


def _of(topics: Mapping[str, Topic], kinds: Mapping[str, str]) -> dict[str, Topic]:
    return {name: topics[name] for name, kind in kinds.items() if name in topics and topics[name][0] == kind}


def _composed(
    counts: Mapping[Topic, int], sources: Mapping[str, Topic], kind: Any, each: str, *, hides: bool = False
) -> Composed:
    names = {topic: name for name, topic in sources.items()}

    def begin() -> Callable[[Topic, Any, int], Any]:
        composer = kind()
        return lambda topic, message, time: composer.hear(names[topic], message, time)

    found = frozenset(names)
    return Composed(found, counts[sources[each]], found if hides else frozenset(), begin)


class _Commands:
    """A command for each message of the steering, with the throttle last heard."""

    def __init__(self) -> None:
        self._throttle = 0.0

    def hear(self, name: str, message: Any, time: int) -> Any:
        value = float(message.data)
        if name == "throttle_command":
            self._throttle = value
            return None
        if not math.isfinite(value) or not math.isfinite(self._throttle):
            return None
        throttle, steering = np.clip((self._throttle, value), -1.0, 1.0).tolist()
        return drive_message(DriveCommand(steering_angle=steering * STEERING, speed=throttle * THROTTLE), time)


class _VescCommands:
    """A command for each position of the servo, with the speed of the motor last heard."""

    def __init__(self) -> None:
        self._speed = 0.0

    def hear(self, name: str, message: Any, time: int) -> Any:
        value = float(message.data)
        if name == "motor/speed":
            self._speed = value / SPEED_TO_ERPM
        if name == "motor/speed" or not math.isfinite(value) or not math.isfinite(self._speed):
            return None
        return drive_message(DriveCommand(steering_angle=steering_of_servo(value), speed=self._speed), time)


class _Places:
    """An odometry for each position, with the heading, the yaw rate and the speed last heard."""

    def __init__(self) -> None:
        self._imu: Any = None
        self._speed = 0.0

    def hear(self, name: str, message: Any, time: int) -> Any:
        if name == "imu" and measures(message, "orientation"):
            self._imu = message
        elif name == "speed":
            self._speed = float(message.data)
        if name != "ips" or self._imu is None or not math.isfinite(message.x + message.y + self._speed):
            return None
        half = 0.5 * heading_of(self._imu.orientation)
        turning = np.full(3, math.nan)
        if measures(self._imu, "angular_velocity"):
            turning = np.array([getattr(self._imu.angular_velocity, axis) for axis in "xyz"])
        odometry = Odometry(
            stamp=time / 1e9, speed=self._speed, steering_angle=0.0,
            angular_velocity=turning, linear_acceleration=np.zeros(3),
            wheel_speeds=np.full(4, self._speed), pose=np.array((message.x, message.y, 2.0 * half)),
        )  # fmt: skip
        made = odometry_message(
            odometry, np.array((message.x, message.y, 0.0)), np.array((math.cos(half), 0.0, 0.0, math.sin(half))), 0.0,
            frame=MAP_FRAME,
        )  # fmt: skip
        made.header.stamp.sec, made.header.stamp.nanosec = divmod(time, 1_000_000_000)
        return made


class _Wheels:
    """Speed of the rear wheels [rad/s], from one reading of an encoder to the next."""

    def __init__(self) -> None:
        self._last: dict[str, tuple[int, float]] = {}
        self._turning: dict[str, float] = {}

    def hear(self, name: str, message: Any, time: int) -> Any:
        angle = float(message.position[0]) if len(message.position) else math.nan
        at = stamp_of(message) or time
        before = self._last.get(name)
        if before is not None and at - before[0] < _FASTEST:
            return None
        if before is not None:
            self._turning[name] = (angle - before[1]) / ((at - before[0]) / 1e9)
        self._last[name] = at, angle
        if name != "right_encoder" or len(self._turning) < 2 or not all(map(math.isfinite, self._turning.values())):
            return None
        left, right = self._turning["left_encoder"], self._turning["right_encoder"]
        odometry = Odometry(
            stamp=at / 1e9, speed=0.0, steering_angle=0.0, angular_velocity=np.zeros(3),
            linear_acceleration=np.zeros(3), wheel_speeds=np.array((left, right, left, right)), pose=np.zeros(3),
        )  # fmt: skip
        made = joints_message(odometry, 1.0)
        keep = [list(made.name).index(wheel) for wheel in WHEEL_JOINTS[2:]]
        made.name = [made.name[each] for each in keep]
        made.position, made.velocity = made.position[keep], made.velocity[keep]
        made.header.stamp.sec, made.header.stamp.nanosec = divmod(at, 1_000_000_000)
        return made


def cars_in(topics: Collection[str]) -> list[str]:
    """Return the names of the cars whose AutoDRIVE topics are among these, in their order."""
    return list(dict.fromkeys(found["car"] for topic in topics if (found := TOPIC.fullmatch(topic)) is not None))
