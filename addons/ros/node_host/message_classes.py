"""Message classes as Python nodes of ROS have them: fields, types and defaults of the real definitions.

Definitions are those of the package rosbags, or of a user's `.msg` files. Messages refuse a value of another type, as
rclpy does, and a field that the definition has not.
"""

from __future__ import annotations

import array
import importlib.util
import re
import warnings
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from fg_mujoco.errors import ControllerError, accepted_names, missing_extra

from ..bag_messages import type_store
from .graph import THREAD

_BASE, _NAME, _ARRAY, _SEQUENCE = 1, 2, 3, 4  # kinds of fields, as rosbags numbers them
_TYPE_CODES = {
    "float32": "f", "float64": "d", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i",
    "uint32": "I", "int64": "q", "uint64": "Q",
}  # fmt: skip
_DEFAULTS: Mapping[tuple[str, str], Any] = {("geometry_msgs/msg/Quaternion", "w"): 1.0}  # all others are 0

_STATE = "std_msgs/Header header\nstring[] joint_names\n" + "".join(
    f"trajectory_msgs/JointTrajectoryPoint {name}\n" for name in ("desired", "actual", "error")
)
_GRIP = "float64 position\nfloat64 effort\nbool stalled\nbool reached_goal\n"
_PID = "error error_dot p_error i_error d_error p_term i_term d_term i_max i_min output"
_JOINT_STATE = "set_point process_value process_value_dot error time_step command p i d i_clamp"
_CONTROL = {
    "GripperCommand": "float64 position\nfloat64 max_effort\n",
    "InterfaceValue": "string[] interface_names\nfloat64[] values\n",
    "DynamicJointState": (
        "std_msgs/Header header\nstring[] joint_names\ncontrol_msgs/InterfaceValue[] interface_values\n"
    ),
    "JointControllerState": "std_msgs/Header header\n"
    + "".join(f"float64 {name}\n" for name in _JOINT_STATE.split())
    + "bool antiwindup\n",
    "JointJog": (
        "std_msgs/Header header\nstring[] joint_names\nfloat64[] displacements\nfloat64[] velocities\n"
        "float64 duration\n"
    ),
    "JointTolerance": "string name\nfloat64 position\nfloat64 velocity\nfloat64 acceleration\n",
    "JointTrajectoryControllerState": _STATE,
    "PidState": "std_msgs/Header header\nduration timestep\n"
    + "".join(f"float64 {name}\n" for name in _PID.split()),
    "SteeringControllerStatus": "std_msgs/Header header\n"
    + "".join(
        f"float64[] {name}\n"
        for name in (
            "traction_wheels_position", "traction_wheels_velocity", "steer_positions", "linear_velocity_command",
            "steering_angle_command",
        )
    ),
}  # fmt: skip
"""Definitions of control_msgs."""
_SERVICES = {
    "control_msgs/FollowJointTrajectory": (
        "trajectory_msgs/JointTrajectory trajectory\ncontrol_msgs/JointTolerance[] path_tolerance\n"
        "control_msgs/JointTolerance[] goal_tolerance\nduration goal_time_tolerance\n---\nint32 error_code\n"
        f"string error_string\n---\n{_STATE}"
    ),
    "control_msgs/GripperCommand": f"control_msgs/GripperCommand command\n---\n{_GRIP}---\n{_GRIP}",
    "control_msgs/QueryCalibrationState": "---\nbool is_calibrated",
    "std_srvs/Empty": "---",
    "std_srvs/Trigger": "---\nbool success\nstring message",
    "std_srvs/SetBool": "bool data\n---\nbool success\nstring message",
    "nav_msgs/GetMap": "---\nnav_msgs/OccupancyGrid map",
    "nav_msgs/GetPlan": (
        "geometry_msgs/PoseStamped start\ngeometry_msgs/PoseStamped goal\nfloat32 tolerance\n---\nnav_msgs/Path plan"
    ),
}
SERVICE_PACKAGES = tuple({name.partition("/")[0] for name in _SERVICES})
"""Packages of which services are defined here."""


def require_rosbags() -> None:
    """Make sure that messages can be made; MissingExtraError: the extra `ros`, with the command that installs it."""
    if importlib.util.find_spec("rosbags") is None:
        raise missing_extra("ROS nodes need rosbags, for the definitions of messages", "ros")


class Message:
    """Base class of all messages."""

    __slots__ = ("__weakref__",)
    _type: ClassVar[str]  # as package/Name
    _makers: ClassVar[dict[str, Callable[[], Any]]]
    _checks: ClassVar[dict[str, Callable[[Any], Any]]]
    _fields_and_field_types: ClassVar[dict[str, str]]

    def __init__(self, **named: Any) -> None:
        for name, value in named.items():
            setattr(self, name, value)

    def __setattr__(self, name: str, value: Any) -> None:
        check = self._checks.get(name)
        if check is None:
            raise AttributeError(f"{self._type} has no field {name!r}; {self._accepted(name)}")
        object.__setattr__(self, name, check(value))

    def __getattr__(self, name: str) -> Any:
        """Return the default of a field that has not been set: it is made when it is asked for first."""
        make = self._makers.get(name)
        if make is not None:
            value = make()
            object.__setattr__(self, name, value)
            return value
        if name.startswith("__"):
            raise AttributeError(name)
        raise AttributeError(f"{self._type} has no field {name!r}; {self._accepted(name)}")

    def __eq__(self, other: object) -> bool:
        same: bool = type(other) is type(self) and all(
            np.array_equal(getattr(self, name), getattr(other, name)) for name in self._makers
        )
        return same

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        inside = ", ".join(f"{name}={getattr(self, name)!r}" for name in self._makers)
        return f"{self._type.replace('/', '.msg.')}({inside})"

    def __deepcopy__(self, memo: Any) -> Message:
        copy = object.__new__(type(self))
        for name in self._makers:
            try:
                value = object.__getattribute__(self, name)
            except AttributeError:
                continue  # it has its default
            object.__setattr__(copy, name, _copied(value, memo))
        return copy

    __copy__ = None

    def __reduce__(self) -> Any:
        return _restored, (self._type, {name: getattr(self, name) for name in self._makers})

    @classmethod
    def _accepted(cls, name: str) -> str:
        inner = [
            f"{field}.{name}"
            for field, make in cls._makers.items()
            if isinstance(make, type) and issubclass(make, Message) and name in make._makers
        ]
        return accepted_names(name, cls._makers) + (f"; did you mean {inner[0]}?" if inner else "")

    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]:
        """Return the fields, in their order, and the names of their types."""
        return dict(cls._fields_and_field_types)


def made(kind: type[Message], **values: Any) -> Any:
    """Return a message of fields that are known to be right, without looking at them."""
    message = object.__new__(kind)
    for name, value in values.items():
        object.__setattr__(message, name, value)
    return message


def full_name(kind: str) -> str:
    """Return `package/msg/Name` of `package/Name`."""
    package, _, name = kind.rpartition("/")
    return f"{package.partition('/')[0]}/msg/{name}"


class Definitions:
    """The messages of one planner's nodes, those of users' `.msg` files included."""

    def __init__(self) -> None:
        self._own: dict[str, tuple[Any, Any]] = {}
        self._own_defaults: dict[tuple[str, str], Any] = {}
        self._own_classes: dict[str, type[Message]] = {}

    def names(self, package: str) -> list[str]:
        """Return the names of the messages of a package; none where it is not known."""
        known = [*_standard(), *self._own]
        return sorted({kind.rpartition("/")[2] for kind in known if kind.startswith(f"{package}/msg/")})

    def kind(self, name: str) -> type[Message]:
        """Return the class of `package/msg/Name`; KeyError: it is not known."""
        if name in self._own_classes:
            return self._own_classes[name]
        if name not in self._own:
            return message_class(name)
        found = _built(name, self._own[name], self.kind, self._own_defaults)
        self._own_classes[name] = found
        return found

    def add_files(self, package: str, folder: Path) -> None:
        """Read the `.msg` files of a folder as messages of a package; ControllerError: one is no definition."""
        from rosbags.typesys import get_types_from_msg

        for path in sorted(folder.glob("*.msg")):
            name = f"{package}/msg/{path.stem}"
            try:
                text = path.read_text("utf-8")
                self._own.update(
                    {kind: found for kind, found in get_types_from_msg(text, name).items() if kind == name}
                )
            except Exception as error:
                raise ControllerError(
                    f"{path}: is no definition of a message: {' '.join(str(error).split())}; accepted: lines of "
                    "TYPE NAME"
                ) from error
            for kind, field, value in re.findall(r"^\s*(\S+)\s+(\w+)\s+([^#\s=]\S*)\s*(?:#.*)?$", text, re.MULTILINE):
                if kind.startswith(("float", "int", "uint", "bool")) and not kind.endswith("]"):
                    number = value.lower() == "true" if kind == "bool" else float(value)
                    self._own_defaults[name, field] = number if kind[0] in "fb" else int(number)

    def parts(self, package: str, name: str, text: str | None = None, where: str = "") -> dict[str, type[Message]]:
        """Return the classes of a service's Request and Response, or of an action's Goal, Result and Feedback.

        Without a text the definition is that of ROS's own, and there are none where it is not here. `where` it stands
        is for messages. Raises ControllerError: it is no definition.
        """
        from rosbags.typesys import get_types_from_msg

        text = _SERVICES.get(f"{package}/{name}") if text is None else text
        if text is None:
            return {}
        found = {}
        sections = re.split(r"^---.*$", text, flags=re.MULTILINE)
        for part, section in zip(
            ("Request", "Response") if len(sections) < 3 else ("Goal", "Result", "Feedback"), sections, strict=False
        ):
            full = f"{package}/msg/{name}_{part}"
            try:
                self._own[full] = get_types_from_msg(section, full)[full]
            except Exception as error:
                said = " ".join(str(error).split())
                raise ControllerError(f"{where}: is no definition: {said}; accepted: lines of TYPE NAME") from error
            found[part] = self.kind(full)
        return found


@cache
def _standard() -> dict[str, tuple[Any, Any]]:
    """Return the definitions of the message packages of ROS: name -> (constants, fields)."""
    require_rosbags()
    from rosbags.typesys import get_types_from_msg

    control = {f"control_msgs/msg/{name}": text for name, text in _CONTROL.items()}
    more = {name: get_types_from_msg(text, name)[name] for name, text in control.items()}
    return {**more, **type_store().fielddefs}


@cache
def message_class(name: str) -> type[Message]:
    """Return the class of a message of ROS, `package/msg/Name`; KeyError: it is not known; MissingExtraError."""
    return _built(name, _standard()[name], message_class, {})


def _built(
    name: str, found: tuple[Any, Any], kind_of: Callable[[str], Any], defaults: Mapping[Any, Any]
) -> type[Message]:
    """Return the class of a definition."""
    constants, fields = found
    short = f"{name.partition('/')[0]}/{name.rpartition('/')[2]}"
    known = {**_DEFAULTS, **defaults}
    makers, checks = {}, {}
    for field, described in fields:
        if field == "structure_needs_at_least_one_member":
            continue
        maker, check = _field(f"{short}.{field}", described, kind_of)
        if (name, field) in known:
            maker = _constant(known[name, field])
        makers[field], checks[field] = maker, check
    body = {
        "__slots__": tuple(makers), "__doc__": f"{name} of ROS 2.",
        "__module__": f"{name.partition('/')[0]}.msg",
        "_type": short, "_makers": makers, "_checks": checks,
        "_fields_and_field_types": {
            field: _type_name(described) for field, described in fields if field in makers
        },
        **{constant: value for constant, _, value in constants},
    }  # fmt: skip
    return type(name.rpartition("/")[2], (Message,), body)


def _field(said: str, described: Any, kind_of: Callable[[str], Any]) -> tuple[Any, Callable[[Any], Any]]:
    """Return two functions: one makes the default of a field, one checks a value and returns it as it is kept."""
    node, inside = int(described[0]), described[1]
    if node == _NAME:
        kind = kind_of(inside)
        return kind, _instance(said, kind, kind.__name__)
    if node == _BASE:
        base = inside[0]
        if base == "string":
            return str, _instance(said, str, "str")
        if base == "bool":
            return bool, _instance(said, bool, "bool")
        if base.startswith("float"):
            return float, _instance(said, float, "float")
        if base in ("byte", "octet"):
            return _constant(b"\x00"), _instance(said, bytes, "bytes")
        if base == "char":
            return int, _instance(said, int, "int")
        return int, _whole(said, base)
    (inner, element), length = inside
    fixed = length if node == _ARRAY else None
    if int(inner) == _NAME:
        kind = kind_of(element)
        make = list if fixed is None else (lambda: [kind() for _ in range(fixed)])
        return make, _list_of(said, kind, kind.__name__, fixed)
    base = element[0]
    code = _TYPE_CODES.get(base)
    if code is None:
        plain = {"string": str, "bool": bool}.get(base, float if base.startswith("float") else int)
        make = list if fixed is None else (lambda: [plain()] * fixed)
        return make, _list_of(said, plain, plain.__name__, fixed)
    if fixed is not None:
        kind = np.dtype(base)
        return (lambda: np.zeros(fixed, kind)), _fixed_array(said, kind, fixed)
    return (lambda: array.array(code)), _numbers(said, code, float if code in "fd" else int)


def _type_name(described: Any) -> str:
    """Return the name of a field's type as rclpy has it: `double`, `sequence<float>`, `std_msgs/Header`."""
    node, inside = int(described[0]), described[1]
    if node == _NAME:
        return f"{inside.partition('/')[0]}/{inside.rpartition('/')[2]}"
    if node == _BASE:
        return {"float64": "double", "float32": "float", "bool": "boolean"}.get(inside[0], str(inside[0]))
    element, length = inside
    return f"{_type_name(element)}[{length}]" if node == _ARRAY else f"sequence<{_type_name(element)}>"


def _constant(value: Any) -> Callable[[], Any]:
    return lambda: value


def _instance(said: str, kind: Any, name: str) -> Callable[[Any], Any]:
    def check(value: Any) -> Any:
        if type(value) is kind or isinstance(value, kind):
            return value
        plain = _plain(value)
        if plain is not None and kind in (float, bool, str) and (kind is float or isinstance(plain, kind)):
            _warn_of_numpy(said, value)
            return kind(plain)
        alone = isinstance(value, np.ndarray) and value.size == 1
        hint = "; rclpy takes no array, with any NumPy: write value.item()" if alone else ""
        raise AssertionError(f"{said} is {_shown(value)}; accepted by rclpy: of type {name}{hint}")

    return check


def _whole(said: str, base: str) -> Callable[[Any], Any]:
    bits = int(base.lstrip("uint") or 8) if base.lstrip("uint").isdigit() else 8
    low, high = (0, 2**bits - 1) if base.startswith("u") else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)

    def check(value: Any) -> Any:
        if isinstance(value, int) and low <= value <= high:
            return value
        plain = _plain(value)
        if isinstance(plain, int) and low <= plain <= high:
            _warn_of_numpy(said, value)
            return plain
        raise AssertionError(f"{said} is {_shown(value)}; accepted by rclpy: of type int, from {low} to {high}")

    return check


def _list_of(said: str, kind: Any, name: str, fixed: int | None) -> Callable[[Any], Any]:
    def check(value: Any) -> Any:
        if isinstance(value, (list, tuple)) and fixed in (None, len(value)) and all(isinstance(v, kind) for v in value):
            return value
        raise AssertionError(f"{said} is {_shown(value)}; accepted by rclpy: a list of {name}")

    return check


def _numbers(said: str, code: str, kind: type) -> Callable[[Any], Any]:
    def check(value: Any) -> Any:
        if isinstance(value, array.array) and value.typecode == code:
            return value
        if isinstance(value, (list, tuple)) and all(isinstance(each, kind) for each in value):
            return array.array(code, value)
        if isinstance(value, (list, tuple)):
            plain = [each if isinstance(each, kind) else _plain(each) for each in value]
            accepted_kinds = (float, int) if kind is float else int
            if all(isinstance(each, accepted_kinds) for each in plain):
                _warn_of_numpy(said, next(each for each in value if not isinstance(each, kind)))
                return array.array(code, plain)
        if isinstance(value, (bytes, bytearray)) and code in "bB":
            return array.array(code, bytes(value))
        accepted = f"a list of {kind.__name__}, or array.array('{code}')"
        hint = "; an array of NumPy has .tolist()" if isinstance(value, np.ndarray) else ""
        raise AssertionError(f"{said} is {_shown(value)}; accepted by rclpy: {accepted}{hint}")

    return check


def _fixed_array(said: str, kind: np.dtype[Any], count: int) -> Callable[[Any], Any]:
    def check(value: Any) -> Any:
        if isinstance(value, np.ndarray) and value.dtype == kind and value.shape == (count,):
            return value
        if isinstance(value, (list, tuple)) and len(value) == count:
            return np.array(value, kind)
        raise AssertionError(f"{said} is {_shown(value)}; accepted by rclpy: {count} numbers")

    return check


def _plain(value: Any) -> Any:
    """Return the value of Python's that a scalar of NumPy's is; None for anything else."""
    scalar = isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.ndim == 0)
    found = value.item() if scalar else None
    return found if isinstance(found, (float, int, bool, str)) else None


def _warn_of_numpy(said: str, value: Any) -> None:
    """Warn, once for each planner, of a value that Humble's rclpy refuses and that Jazzy's may read wrongly."""
    graph = getattr(THREAD, "graph", None)
    if graph is not None and graph.told_of_numpy:
        return
    place = ""
    if graph is not None:
        graph.told_of_numpy, place = True, graph.place()
    warnings.warn(
        f"{said} is {_shown(value)}, a scalar of NumPy{place}; it is taken here, and a real rclpy may refuse it: write "
        f"{type(value.item()).__name__}(...)",
        stacklevel=2,
    )


def _shown(value: Any) -> str:
    text = " ".join(repr(value).split())
    return f"{text if len(text) <= 60 else text[:57] + '...'} of type {type(value).__name__}"


def _copied(value: Any, memo: Any) -> Any:
    if isinstance(value, (str, int, float, bytes)):
        return value
    if isinstance(value, (list, tuple)):
        return type(value)(_copied(each, memo) for each in value)
    if isinstance(value, (np.ndarray, array.array)):
        return value[:] if isinstance(value, array.array) else value.copy()
    return value.__deepcopy__(memo) if hasattr(value, "__deepcopy__") else value


def _restored(kind: str, values: dict[str, Any]) -> Any:
    return made(message_class(full_name(kind)), **values)
