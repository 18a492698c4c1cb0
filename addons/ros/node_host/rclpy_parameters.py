"""Parameters of nodes of ROS 2: `rclpy.parameter`, and what rclpy raises of them."""

from __future__ import annotations

import array
import enum
from types import SimpleNamespace
from typing import Any, ClassVar

from .message_classes import message_class


class ParameterException(Exception):
    pass


class ParameterNotDeclaredException(ParameterException):
    pass


class ParameterAlreadyDeclaredException(ParameterException):
    pass


class InvalidParameterTypeException(ParameterException):
    pass


class InvalidParameterValueException(ParameterException):
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

    @classmethod
    def from_parameter_value(cls, parameter_value: Any) -> ParameterType:
        return type_of(parameter_value)


def type_of(value: Any) -> ParameterType:
    """Return the type of a parameter's value."""
    if value is None:
        return ParameterType.NOT_SET
    many = isinstance(value, (list, tuple, array.array))
    first = (value[0] if value else 0.0) if many else value
    if isinstance(first, bool):
        return ParameterType.BOOL_ARRAY if many else ParameterType.BOOL
    if isinstance(first, int):
        return ParameterType.INTEGER_ARRAY if many else ParameterType.INTEGER
    if isinstance(first, float):
        return ParameterType.DOUBLE_ARRAY if many else ParameterType.DOUBLE
    if isinstance(first, str):
        return ParameterType.STRING_ARRAY if many else ParameterType.STRING
    if many and isinstance(first, bytes):
        return ParameterType.BYTE_ARRAY
    raise TypeError(f"a parameter is {value!r}; accepted: bool, int, float, str, or a list of one of them")


class ParameterValue:
    """Result of `get_parameter_value()`: the value under the name of its type, 0 or empty under the others."""

    _EMPTY: ClassVar[dict[str, Any]] = {
        "bool_value": False, "integer_value": 0, "double_value": 0.0, "string_value": "", "byte_array_value": [],
        "bool_array_value": [], "integer_array_value": [], "double_array_value": [], "string_array_value": [],
    }  # fmt: skip

    def __init__(self, *, type: Any = 0, **values: Any) -> None:
        self.type = int(type)
        vars(self).update({name: values.get(name, empty) for name, empty in self._EMPTY.items()})


class Parameter:
    """rclpy.parameter.Parameter."""

    Type = ParameterType

    def __init__(self, name: str, type_: Any = None, value: Any = None) -> None:
        self.name, self.value = name, value
        self.type_ = type_of(value) if type_ is None else ParameterType(type_)

    def get_parameter_value(self) -> ParameterValue:
        found = ParameterValue(type=self.type_)
        if self.type_:
            setattr(found, f"{self.type_.name.lower()}_value", self.value)
        return found

    def to_parameter_msg(self) -> Any:
        return SimpleNamespace(name=self.name, value=self.get_parameter_value())

    @classmethod
    def from_parameter_msg(cls, param_msg: Any) -> Parameter:
        return cls(param_msg.name, ParameterType(param_msg.value.type), parameter_value_to_python(param_msg.value))


def parameter_value_to_python(parameter_value: Any) -> Any:
    """Return the value that a ParameterValue has under the name of its type; None where it has no type."""
    kind = ParameterType(parameter_value.type)
    return getattr(parameter_value, f"{kind.name.lower()}_value") if kind else None


def set_result(*, successful: bool, reason: str = "") -> Any:
    """Return rcl_interfaces/SetParametersResult."""
    return message_class("rcl_interfaces/msg/SetParametersResult")(successful=successful, reason=reason)
