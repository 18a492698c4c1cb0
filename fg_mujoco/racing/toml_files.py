"""Reads settings from TOML files, with the line of each key for messages, and writes them."""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..course.files import read_bytes
from ..errors import SettingsError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

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

        It is the key with whose value the message begins, as of a file that cannot be read, or the first that it names,
        which is then spelled as in the file.
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
    """Return the content of a TOML file.

    Raises:
      SettingsError: it cannot be read, is larger than settings are, or is no TOML.
    """
    path = Path(path)
    try:
        text = read_bytes(path, _MOST_BYTES).decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise SettingsError(f"{path}: cannot be read: {reason}; accepted: a TOML file, or a run folder") from error
    _check_text(path, text)
    try:
        return TomlFile(path=path, text=text, values=tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:  # it says which line
        raise SettingsError(f'{path}: {error}; accepted: TOML, as: track = "oval"') from error
    except (ValueError, RecursionError) as error:  # of thousands of digits or levels
        reason = "nested too deep" if isinstance(error, RecursionError) else error
        raise SettingsError(f'{path}: {reason}; accepted: TOML, as: track = "oval"') from error


def read_value(text: str) -> Any:
    """Return the value that a text is in TOML, as `0.5`, `[1, 2]` or `{mu = "0.5:1.1"}`; else the text itself."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError, KeyError):
        with suppress(ValueError):
            return float(text)  # as .5
        return text


def toml_text(values: Mapping[str, Any]) -> str:
    """Return values by name as the text of a TOML file: simple values first, then tables and lists of tables."""
    lines = [f"{_key(name)} = {_text(value)}" for name, value in values.items() if not _is_tables(value)]
    for name, value in values.items():
        for table in value if _is_tables(value) else ():
            lines += ["", f"[[{_key(name)}]]"]
            lines += [f"{_key(key)} = {_text(part)}" for key, part in table.items() if part is not None]
    return "\n".join(lines) + "\n"


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
    """Return the line on which a top-level key of a TOML text is first given, from 1.

    A statement begins after the longest run of whole lines that can be read without it: what TOML says, without a
    second grammar of it here.
    """
    lines, begins = text.splitlines(keepends=True), 1
    for count in range(1, len(lines) + 1):
        try:
            content = tomllib.loads("".join(lines[:count]))
        except tomllib.TOMLDecodeError:  # within a value of several lines
            continue
        if key in content:
            return begins
        begins = count + 1
    return begins
