"""Stubs of rosidl_runtime_py: messages as dictionaries, YAML and CSV, and filled from dictionaries."""

from __future__ import annotations

import array
import re
import sys
from collections import OrderedDict
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from .message_classes import Message

_LISTS = (list, tuple, array.array, np.ndarray)


def rosidl_modules(interface: Callable[[str], Any]) -> dict[str, dict[str, Any]]:
    """Return the members of the modules of rosidl_runtime_py; `interface` returns the class of `package/msg/Name`."""

    def set_message_fields(
        msg: Any, values: Any, expand_header_auto: bool = False, expand_time_now: bool = False
    ) -> list[Any]:
        """Set fields, and return functions that set the stamps for which `auto` or `now` is given."""
        if not isinstance(values, dict):
            said = f"Value '{values}' is expected to be a dictionary but is a {type(values).__name__}"
            raise TypeError(said)
        setters: list[Any] = []
        for name, given in values.items():
            field, said = getattr(msg, name), msg._fields_and_field_types.get(name, "")
            element = re.fullmatch(r"sequence<(\w+/\w+)>|(\w+/\w+)\[\d+\]", said)
            if said == "std_msgs/Header" and given == "auto" and expand_header_auto:
                setters.append(partial(setattr, field, "stamp"))
            elif said == "builtin_interfaces/Time" and given == "now" and expand_time_now:
                setters.append(partial(setattr, msg, name))
            elif element is not None:
                made = [interface(element[1] or element[2])() for _ in given]
                for each, value in zip(made, given, strict=True):
                    setters += set_message_fields(each, value, expand_header_auto, expand_time_now)
                setattr(msg, name, made)
            elif isinstance(field, Message) and not isinstance(given, Message):
                setters += set_message_fields(field, given, expand_header_auto, expand_time_now)
            elif isinstance(field, (array.array, np.ndarray)):
                numbers = array.array(field.typecode, given) if isinstance(field, array.array) else given
                setattr(msg, name, np.array(given, field.dtype) if isinstance(field, np.ndarray) else numbers)
            else:
                setattr(msg, name, given if type(given) is type(field) else type(field)(given))
        return setters

    convert: dict[str, Any] = {
        "message_to_ordereddict": message_to_ordereddict, "message_to_yaml": message_to_yaml,
        "message_to_csv": message_to_csv,
        "get_message_slot_types": lambda msg: OrderedDict(msg.get_fields_and_field_types()),
    }  # fmt: skip
    utilities = dict.fromkeys(("get_message", "get_service", "get_action", "get_interface"), interface)
    setting = {"set_message_fields": set_message_fields}
    return {
        "rosidl_runtime_py": {**convert, **setting}, "rosidl_runtime_py.convert": convert,
        "rosidl_runtime_py.set_message": setting, "rosidl_runtime_py.utilities": utilities,
    }  # fmt: skip


def message_to_ordereddict(
    msg: Any, *, truncate_length: int | None = None, no_arr: bool = False, no_str: bool = False
) -> OrderedDict[str, Any]:
    found = OrderedDict()
    for name, said in msg.get_fields_and_field_types().items():
        value = getattr(msg, name)
        shown = _abbreviated(value, said) if no_arr and isinstance(value, _LISTS) else None
        found[name] = shown or _plain(value, truncate_length, no_arr, no_str)
    return found


def message_to_yaml(msg: Any, *, flow_style: bool = False, **options: Any) -> str:
    import yaml

    class Dumper(yaml.Dumper):  # type: ignore[misc]
        pass

    Dumper.add_representer(OrderedDict, lambda dumper, data: dumper.represent_dict(list(data.items())))
    found: str = yaml.dump(
        message_to_ordereddict(msg, **options), Dumper=Dumper, allow_unicode=True, width=sys.maxsize,
        default_flow_style=flow_style, sort_keys=False,
    )  # fmt: skip
    return found


def message_to_csv(msg: Any, **options: Any) -> str:
    def text(value: Any) -> str:
        if isinstance(value, dict):
            return ",".join(map(text, value.values()))
        return ",".join(map(text, value)) if isinstance(value, (list, tuple)) else str(value)

    return text(message_to_ordereddict(msg, **options))


def _plain(value: Any, length: int | None, no_arr: bool, no_str: bool) -> Any:
    """Return a value as rosidl_runtime_py shows it."""
    if isinstance(value, Message):
        return message_to_ordereddict(value, truncate_length=length, no_arr=no_arr, no_str=no_str)
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, (str, bytes)):
        text = value if isinstance(value, str) else value.decode("latin-1")
        if no_str and isinstance(value, str):
            return f"<string length: <{len(text)}>>"
        return text if length is None or len(text) <= length else f"{text[:length]}..."
    if isinstance(value, _LISTS):
        cut = length is not None and len(value) > length
        shown = [_plain(each, length, no_arr, no_str) for each in value[:length]]
        return [*shown, "..."] if cut else shown
    return value


def _abbreviated(value: Any, said: str) -> str:
    """Return what stands for an array: its type, and the length of one that has none of its own."""
    inner = re.fullmatch(r"sequence<(.*)>", said)
    return f"<sequence type: {inner[1]}, length: {len(value)}>" if inner else f"<array type: {said}>"
