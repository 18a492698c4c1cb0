"""Types of ROS messages as DDS has them: their names on the wire, and classes for topics of the package cyclonedds.

A sample holds the CDR of a message, and is written and read as these bytes. The fields of the type only say to other
participants what it is, and let cyclonedds drop samples that are not of it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from fg_mujoco.addons.ros.bag_messages import type_store
from fg_mujoco.addons.ros.node_host.message_classes import full_name
from fg_mujoco.errors import SettingsError, accepted_names

_BASE, _NAME, _ARRAY, _SEQUENCE = 1, 2, 3, 4  # kinds of fields, as rosbags numbers them
_BYTES = ("byte", "char", "octet")  # one byte each in ROS


def known_kind(name: str, accepted: Sequence[str]) -> str:
    """Return `package/msg/Name` of an accepted type that a user names, with or without `msg`; or SettingsError."""
    known = type_store().fielddefs
    kind = full_name(name) if name.count("/") in (1, 2) else name
    if kind not in known:
        raise SettingsError(f"type {name!r} is not known; {accepted_names(kind, accepted, besides=known)}")
    return kind


def kind_of(name: str) -> str:
    """Return `package/msg/Name` of a type's name on DDS; the same name where it is none of ROS 2."""
    return re.sub(r"^(\w+)::msg::dds_::(\w+)_$", r"\1/msg/\2", name)


def cdr_of(message: Any, kind: str) -> bytes:
    """Return a message as a robot would send it: little-endian CDR, arrays of numbers copied as a whole."""
    for name, numbers in _sequences(kind):
        value = getattr(message, name)
        if not isinstance(value, np.ndarray):
            object.__setattr__(message, name, np.asarray(value, numbers))
    return bytes(type_store().serialize_cdr(message, kind))


@cache
def _sequences(kind: str) -> tuple[tuple[str, str], ...]:
    """Return name and type of the fields that are sequences of numbers."""
    found = []
    for name, (field, said) in type_store().fielddefs[kind][1]:
        if field == _SEQUENCE and said[0][0] == _BASE and said[0][1][0] != "string":
            base = said[0][1][0]
            found.append((name, "uint8" if base in _BYTES else base))
    return tuple(found)


@cache
def dds_type(kind: str, distribution: str = "") -> Any:
    """Return the class of samples of a type `package/msg/Name`, as a distribution of ROS 2 defines it."""
    from cyclonedds.idl import make_idl_struct

    fields = {name: _field(said, distribution) for name, said in type_store(distribution).fielddefs[kind][1]}
    package, _, name = kind.split("/")
    made: Any = make_idl_struct(name, f"{package}.msg.dds_.{name}_", fields, dataclassify=False)
    made.__init__, made.serialize = _hold, _held
    made.deserialize = made.deserialize_key = classmethod(_holding)  # of a key: that a publisher has gone
    return made


def _hold(self: Any, content: bytes) -> None:
    self.content = content


def _held(self: Any, buffer: Any = None, endianness: Any = None, use_version_2: Any = None) -> Any:
    return self.content


def _holding(kind: Any, data: bytes, has_header: bool = True, use_version_2: Any = None) -> Any:
    return kind(data)


def _field(described: Any, distribution: str) -> Any:
    """Return the type of a field for cyclonedds."""
    import cyclonedds.idl.types

    types: Any = cyclonedds.idl.types
    kind, said = described
    if kind == _NAME:
        return dds_type(said, distribution)
    if kind == _BASE:
        base, bound = said
        if base == "string":
            return types.bounded_str[bound] if bound else str
        return bool if base == "bool" else getattr(types, "uint8" if base in _BYTES else base)
    inner, count = _field(said[0], distribution), said[1]
    if kind == _ARRAY:
        return types.array[inner, count]
    return types.sequence[inner, count] if count else types.sequence[inner]
