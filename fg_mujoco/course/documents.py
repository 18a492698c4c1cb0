"""Reads TOML and JSON that others may have written, with bounds on its numbers, and writes TOML.

Whole numbers have 64 bits at most, as TOML asks, so that none is too large to become a float. A file of settings also
knows the line of each key, for messages.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import SettingsError
from ..messages import MOST_WHOLE, shown
from .files import parse_toml, read_bytes

_MOST_BYTES, _MOST_LINES, _MOST_CHARACTERS = 2**20, 1000, 2000  # of a TOML file, the last of one line in it
_BARE = re.compile(r"[A-Za-z0-9_-]+")  # a key that needs no quotes


@dataclass(frozen=True, kw_only=True)
class TomlFile:
    """The content of a file."""

    path: Path
    text: str
    values: Mapping[str, Any]  # by key, as the file spells it

    def where(self, key: str) -> str:
        """Return the file and the line on which a top-level key is first given."""
        return f"{self.path}, line {_line(self.text, key)}"

    def located(self, message: str) -> str:
        """Return a message with the line of the key that it is about, or with the file alone if that is not known.

        It is the key with whose value the message begins, or the first that it names, then spelled as in the file.
        """
        for key, value in self.values.items():
            if isinstance(value, str) and value and message.startswith(value):
                return f"{self.where(key)}: {key}: {message}"
        names = {key.replace("-", "_"): key for key in self.values}
        for word in re.finditer(r"[A-Za-z_][A-Za-z0-9_]*", message):
            key = names.get(word[0], "")
            if key:
                return f"{self.where(key)}: {message if word.start() else key + message[word.end() :]}"
        return f"{self.path}: {message}"


def read_toml(path: str | Path) -> TomlFile:
    """Return the content of a TOML file; raise SettingsError for one that is none, or larger than settings are."""
    path = Path(path)
    try:
        text = read_bytes(path, _MOST_BYTES).decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise SettingsError(f"{path}: cannot be read: {reason}; accepted: a TOML file, or a run folder") from error
    _check_text(path, text)
    file = TomlFile(path=path, text=text, values=_toml(text, str(path), 'TOML, as: track = "oval"'))
    try:
        _require_bounded(file.values)
    except SettingsError as error:
        raise SettingsError(file.located(str(error))) from error
    return file


def read_toml_table(text: str, where: str, accepted: str) -> dict[str, Any]:
    """Return the content of a TOML text that is no file of settings, such as a set of tires.

    Raises:
      SettingsError: it is no TOML, or has a number that is too large; it has `where`, and what is `accepted`.
    """
    found = _toml(text, where, accepted)
    _require_bounded(found, f"{where}: ")
    return found


def _toml(text: str, where: str, accepted: str) -> dict[str, Any]:
    try:
        return parse_toml(text)
    except (ValueError, RecursionError) as error:  # a number of thousands of digits is no TOMLDecodeError
        reason = "nested too deep" if isinstance(error, RecursionError) else error
        raise SettingsError(f"{where}: is no TOML: {reason}; accepted: {accepted}") from error


def read_value(text: str) -> Any:
    """Return the value that a text is in TOML, as `0.5`, `[1, 2]` or `{mu = "0.5:1.1"}`; else the text itself.

    Raises:
      SettingsError: it has a number that is too large.
    """
    try:
        found = parse_toml(f"value = {text}")["value"]
    except (ValueError, RecursionError, KeyError):
        with suppress(ValueError):
            return float(text)  # as .5
        return text
    _require_bounded(found)
    return found


def parse_json(text: str | bytes) -> Any:
    """Return the value of a JSON text as it stands; raise ValueError, RecursionError for none, or a key twice."""
    return json.loads(text, object_pairs_hook=_once)


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return the object of some pairs of JSON, each with another key."""
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in found if keys.count(key) > 1)
        raise ValueError(f"the key {shown(twice)} is given twice")
    return found


def read_json(text: str | bytes, accepted: str) -> Any:
    """Return the value of a JSON text; `accepted` is said in the place of another.

    Raises:
      SettingsError: it is no JSON, is nested too deep, or has a number that is not finite or too large.
    """
    try:
        found = parse_json(text)
    except (ValueError, RecursionError) as error:
        reason = "nested too deep" if isinstance(error, RecursionError) else error
        raise SettingsError(f"is no JSON: {reason}; accepted: {accepted}") from error
    _require_bounded(found, finite=True)
    return found


def _require_bounded(values: Any, where: str = "", *, finite: bool = False) -> None:
    """Raise SettingsError for the first number in some values that is too large, or, if asked for, not finite."""
    for name, number in _numbers(values):
        if isinstance(number, int) and abs(number) > MOST_WHOLE:
            accepted = f"whole numbers from -{MOST_WHOLE} to {MOST_WHOLE}"
            raise SettingsError(f"{where}{name} is {shown(number)}; accepted: {accepted}")
        if finite and not math.isfinite(number):
            raise SettingsError(f"{where}{name} is {number}; accepted: finite numbers")


def _numbers(values: Any, name: str = "") -> Iterator[tuple[str, int | float]]:
    """Yield all numbers in some values, each with the names that lead to it."""
    if isinstance(values, Mapping):
        for key, each in values.items():
            yield from _numbers(each, f"{name}.{key}" if name else key)
    elif isinstance(values, list):
        for each in values:
            yield from _numbers(each, name)
    elif isinstance(values, (int, float)):
        yield name or "it", values


def toml_text(values: Mapping[str, Any]) -> str:
    """Return values by name as the text of a TOML file: simple values first, then tables and lists of tables."""
    lines = [f"{_key(name)} = {_text(value)}" for name, value in values.items() if not _is_tables(value)]
    for name, value in values.items():
        for table in value if _is_tables(value) else ():
            lines += ["", f"[[{_key(name)}]]"]
            lines += [f"{_key(key)} = {_text(part)}" for key, part in table.items() if part is not None]
    return "\n".join(lines) + "\n"


def comment(text: str) -> str:
    """Return a text as it can stand in a comment: in one line, with control characters as `repr` has them."""
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode() for each in text)


def xml_comment(lines: Iterable[str]) -> str:
    """Return lines as they can stand in a comment of XML, which has no two hyphens in a row."""
    return re.sub("-(?=-)", "- ", "\n  ".join(("", *map(comment, lines), "")))


def _is_tables(value: Any) -> bool:
    return isinstance(value, (list, tuple)) and bool(value) and all(isinstance(each, Mapping) for each in value)


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else f"{'-' if value < 0.0 else ''}inf"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, Mapping):
        inside = ", ".join(f"{_key(name)} = {_text(part)}" for name, part in value.items() if part is not None)
        return f"{{{inside}}}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_text, value))}]"
    return json.dumps(str(value), ensure_ascii=False).replace("\x7f", "\\u007f")


def _key(name: str) -> str:
    return name if _BARE.fullmatch(name) else json.dumps(name)


def _check_text(path: Path, text: str) -> None:
    """Refuse a text that is no settings before it is read, which takes the square of its size."""
    lines = text.split("\n")
    if len(lines) > _MOST_LINES:
        raise SettingsError(f"{path}: {len(lines)} lines; accepted: {_MOST_LINES} at most")
    for place, line in enumerate(lines, start=1):
        if len(line) > _MOST_CHARACTERS:
            raise SettingsError(
                f"{path}, line {place}: {len(line)} characters; accepted: {_MOST_CHARACTERS} at most in a line"
            )


def _line(text: str, key: str) -> int:
    """Return the line on which a top-level key begins, from 1: behind the longest run of whole lines without it."""
    lines, begins = text.splitlines(keepends=True), 1
    for count in range(1, len(lines) + 1):
        try:
            content = parse_toml("".join(lines[:count]))
        except ValueError:  # within a value of several lines
            continue
        if key in content:
            return begins
        begins = count + 1
    return begins
