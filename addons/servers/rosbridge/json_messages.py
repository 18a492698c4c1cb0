"""ROS 2 messages as JSON, as rosbridge writes and reads them.

    to_json(message, "sensor_msgs/msg/LaserScan")   # {"header": {"stamp": {"sec": ..., "nanosec": ...}, ...}, ...}
    from_json({"drive": {"speed": 1}}, "ackermann_msgs/msg/AckermannDriveStamped", now=0)

Written: a number that is not finite is null, bytes are base64, and a number of 32 bits has the digits of its 32 bits.
Read: a field that is missing has its default, a header without a stamp is stamped now, and times may have the names of
ROS 1, `secs` and `nsecs`. Anything else that is not of the type is refused, with the name of the field. Sources:
rosbridge_suite, ROSBRIDGE_PROTOCOL.md and rosbridge_library's message_conversion.py.
"""

from __future__ import annotations

import base64
import binascii
import math
import re
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from fg_mujoco.addons.ros.node_host.message_classes import ROS2, Message, full_name, made, message_class
from fg_mujoco.errors import MessageError, accepted_names
from fg_mujoco.messages import shown

_TIMES = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
_HEADER = "std_msgs/msg/Header"
_OF_ROS1 = {"secs": "sec", "nsecs": "nanosec"}
_BYTES = ("uint8", "char")  # an array of which is base64
_WHOLE = re.compile(r"(u?)int(8|16|32|64)")
_ARRAY = re.compile(r"sequence<(?P<element>[^,]+)(?:, \d+)?>|(?P<fixed>[^\[]+)\[(?P<length>\d+)\]")
_MOST_OF_32_BITS = float(np.finfo(np.float32).max)
_NANOSECONDS = 1_000_000_000

Write = Callable[[Any], Any]
Read = Callable[[Any, str, int], Any]
"""Of a value, the name of its field, and the time now [ns]."""


def kind_of(name: object) -> str:
    """Return `package/msg/Name` of a type that a client names, in the way of ROS 2 or of ROS 1.

    Raises:
      MessageError: a type that is not known.
    """
    if isinstance(name, str) and re.fullmatch(r"\w+/(?:msg/)?\w+", name):
        kind = full_name(name)
        try:
            message_class(kind, ROS2)
        except KeyError:
            pass
        else:
            return kind
    accepted = "a message of ROS 2 Humble, of ackermann_msgs or of vesc_msgs, such as sensor_msgs/msg/LaserScan"
    raise MessageError(f"type is {shown(name)}; accepted: {accepted}")


def to_json(message: Any, kind: str) -> dict[str, Any]:
    """Return a message of a type as what JSON can hold."""
    found: dict[str, Any] = _writer(kind)(message)
    return found


def from_json(values: Any, kind: str, now: int) -> Any:
    """Return the message of a type that a client has sent.

    Args:
      values: what the JSON has.
      kind: `package/msg/Name`.
      now: for headers without a stamp [ns].

    Raises:
      MessageError: it is not of the type; the message has the name of the field.
    """
    return _reader(kind)(values, "", now)


def fields_of(kind: type[Message]) -> list[tuple[str, str, int]]:
    """Return name, type and length of each field: -1 for a single value, 0 for any length."""
    found = []
    for name, said in kind.get_fields_and_field_types().items():
        array = _ARRAY.fullmatch(said)
        element = said if array is None else array["element"] or array["fixed"]
        found.append((name, element, -1 if array is None else int(array["length"] or 0)))
    return found


@cache
def _writer(kind: str) -> Write:
    writers = [(name, _field_writer(element, length)) for name, element, length in fields_of(message_class(kind, ROS2))]
    return lambda message: {name: write(getattr(message, name)) for name, write in writers}


def _field_writer(element: str, length: int) -> Write:
    if "/" in element:
        write = _writer(full_name(element))
        return write if length < 0 else lambda values: [write(value) for value in values]
    if element in ("float", "double"):
        size = np.float32 if element == "float" else np.float64
        return (lambda value: _numbers([value], size)[0]) if length < 0 else lambda values: _numbers(values, size)
    if length < 0:
        return _whole if element in ("octet", "byte") else lambda value: value
    if element in _BYTES:
        return lambda values: base64.standard_b64encode(bytes(values)).decode()
    return lambda values: [_whole(value) for value in (values.tolist() if hasattr(values, "tolist") else values)]


def _numbers(values: Any, size: Any) -> list[float | None]:
    """Return numbers as floats; None for those that are not finite."""
    with np.errstate(over="ignore"):
        numbers = np.asarray(values, size).astype(np.float64)
    found: list[float | None] = numbers.tolist()
    for i in np.flatnonzero(~np.isfinite(numbers)).tolist():
        found[i] = None
    return found


def _whole(value: Any) -> Any:
    return int.from_bytes(value, "little") if isinstance(value, bytes) else value


@cache
def _reader(kind: str) -> Read:
    made_of = message_class(kind, ROS2)
    readers = {name: _field_reader(element, length) for name, element, length in fields_of(made_of)}

    def read(values: Any, where: str, now: int) -> Any:
        if not isinstance(values, dict):
            raise _refused(where, values, f"an object of {kind}")
        if kind in _TIMES:
            values = {_OF_ROS1.get(name, name): value for name, value in values.items()}
        if kind == _HEADER:
            sec, nanosec = divmod(now, _NANOSECONDS)
            given = {name: value for name, value in values.items() if name != "seq" and value is not None}
            values = {"stamp": {"sec": sec, "nanosec": nanosec}, **given}
        elif "header" in readers:
            values = {"header": {}, **values}
        found = {}
        for name, value in values.items():
            at = f"{where}.{name}" if where else name
            if name not in readers:
                raise MessageError(f"{at} is no field of {kind}; {accepted_names(name, readers)}")
            found[name] = readers[name](value, at, now)
        return made(made_of, **found)

    return read


def _field_reader(element: str, length: int) -> Read:
    read = _reader(full_name(element)) if "/" in element else _value_reader(element)
    if length < 0:
        return read

    def read_all(values: Any, where: str, now: int) -> list[Any]:
        if element in _BYTES and isinstance(values, str):
            try:
                values = list(base64.b64decode(values, validate=True))
            except (binascii.Error, ValueError):
                raise _refused(where, values, "bytes in base64, or a list") from None
        if not isinstance(values, list) or length not in (0, len(values)):
            raise _refused(where, values, f"a list of {f'{length} ' if length else ''}{element}")
        return [read(value, f"{where}[{i}]", now) for i, value in enumerate(values)]

    return read_all


def _value_reader(element: str) -> Read:
    if element in ("string", "wstring"):
        return _of_type(str, "a string")
    if element in ("boolean", "bool"):
        return _of_type(bool, "true or false")
    if element in ("float", "double"):
        return _number_reader(element)
    whole = _WHOLE.fullmatch(element)
    unsigned, bits = (whole[1] == "u", int(whole[2])) if whole else (True, 8)
    low, high = (0, 2**bits - 1) if unsigned else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)

    def read(value: Any, where: str, now: int) -> int:
        if type(value) is not int or not low <= value <= high:
            raise _refused(where, value, f"a whole number from {low} to {high}")
        return value

    return read


def _number_reader(element: str) -> Read:
    single = element == "float"
    most, accepted = (_MOST_OF_32_BITS, "a finite number of 32 bits") if single else (math.inf, "a finite number")

    def read(value: Any, where: str, now: int) -> float:
        try:
            number = float(value) if type(value) in (int, float) else math.nan
        except OverflowError:
            number = math.inf
        if not math.isfinite(number) or abs(number) > most:
            raise _refused(where, value, accepted)
        return float(np.float32(number)) if single else number

    return read


def _of_type(kind: type, accepted: str) -> Read:
    def read(value: Any, where: str, now: int) -> Any:
        if type(value) is not kind:
            raise _refused(where, value, accepted)
        return value

    return read


def _refused(where: str, value: Any, accepted: str) -> MessageError:
    return MessageError(f"{where or 'msg'} is {shown(value)}; accepted: {accepted}")
