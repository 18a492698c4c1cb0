"""Changes of files and values that programs, editors, disks and people make, drawn from a generator."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import TypeVar

from numpy.random import Generator

T = TypeVar("T")

NUMBERS = (
    "0", "-0", "1", "-1", "2", "0.5", "1e-9", "1e-300", "5e-324", "1e5", "1e9", "1e12", "1e150", "1e308", "-1e308",
    "1e309",
    "nan", "-nan", "inf", "-inf", "NaN", "Infinity", "2147483647", "2147483648", "-2147483649", "4294967296",
    "9223372036854775808", "9" * 400, "1" + "0" * 5000, "0x10", "1_000", "١٢", "1,5", "1e", "--1", "", " ", "true",
    "null",
)  # fmt: skip
"""Texts in the place of a number."""

WORDS = (
    "", " ", "\0", "\x1b[2J", "\ud7ff", "é", "‮", "a" * 300, "a" * 5000, "../../etc/passwd", "/dev/zero",
    "/dev/stdin", "~",
    "%s%n", "{}", "{0.__class__}", "$(id)", "`id`", "<script>alert(1)</script>", "'\"", "\\", "#", "--", "-", "=",
    ":", "[", "]",
    "[[", "a=b", "a:b", "\n", "\r\n", "\t", "None", "__class__", "__init__", "self", ",", ";", "|", "[a=1]", "[a=]",
    "[=1]",
)  # fmt: skip
"""Texts in the place of a name."""

_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


def one_of(rng: Generator, values: Sequence[T]) -> T:
    """Return one of some values."""
    return values[int(rng.integers(len(values)))]


def mutated(content: bytes, rng: Generator) -> bytes:
    """Return a text file with one change to three."""
    for _ in range(int(one_of(rng, (1, 1, 1, 2, 3)))):
        content = one_of(rng, _TEXT_CHANGES)(content, rng)
    return content


def mutated_binary(content: bytes, rng: Generator) -> bytes:
    """Return a binary file with one change to three."""
    for _ in range(int(one_of(rng, (1, 1, 1, 2, 3)))):
        content = one_of(rng, _BINARY_CHANGES)(content, rng)
    return content


def _span(content: bytes, rng: Generator, longest: int = 64) -> tuple[int, int]:
    start = int(rng.integers(len(content) + 1))
    return start, min(len(content), start + int(rng.integers(longest + 1)))


def _flip(content: bytes, rng: Generator) -> bytes:
    if not content:
        return content
    place = int(rng.integers(len(content)))
    return content[:place] + bytes([content[place] ^ (1 << int(rng.integers(8)))]) + content[place + 1 :]


def _cut(content: bytes, rng: Generator) -> bytes:
    start, end = _span(content, rng)
    return content[:start] + content[end:]


def _truncate(content: bytes, rng: Generator) -> bytes:
    return content[: int(rng.integers(len(content) + 1))]


def _repeat(content: bytes, rng: Generator) -> bytes:
    start, end = _span(content, rng)
    return content[:end] + content[start:end] * int(one_of(rng, (1, 2, 100, 10_000))) + content[end:]


def _noise(content: bytes, rng: Generator) -> bytes:
    start, end = _span(content, rng)
    return content[:start] + rng.bytes(end - start) + content[end:]


def _extreme(content: bytes, rng: Generator) -> bytes:
    start, _ = _span(content, rng)
    value = one_of(
        rng, (b"\0" * 4, b"\xff" * 4, b"\xff\xff\xff\x7f", b"\0" * 8, b"\xff" * 8, b"\0\0\0\0\0\0\xf0\x7f", b"\1")
    )
    return content[:start] + value + content[start + len(value) :]


def _any_number(content: bytes, rng: Generator) -> re.Match[bytes] | None:
    """Return a number in a text: the first from some place on, or the first of all."""
    place = int(rng.integers(len(content) + 1))
    while place > 0 and content[place - 1 : place].isdigit():
        place -= 1
    return _NUMBER.search(content, place) or _NUMBER.search(content)


def _number(content: bytes, rng: Generator) -> bytes:
    match = _any_number(content, rng)
    if match is None:
        return content
    return content[: match.start()] + one_of(rng, NUMBERS).encode() + content[match.end() :]


def _nudge(content: bytes, rng: Generator) -> bytes:
    """Change one number to another that might be meant."""
    match = _any_number(content, rng)
    if match is None:
        return content
    value = float(match[0]) * rng.uniform(0.5, 2.0) if len(match[0]) < 30 else 1.0
    return content[: match.start()] + f"{value:.6g}".encode() + content[match.end() :]


def _word(content: bytes, rng: Generator) -> bytes:
    start, end = _span(content, rng, 16)
    return content[:start] + one_of(rng, WORDS).encode() + content[end:]


def _lines(content: bytes, rng: Generator) -> bytes:
    lines = content.splitlines(keepends=True)
    if len(lines) < 2:
        return content
    first, second = (int(i) for i in rng.integers(len(lines), size=2))
    change = int(rng.integers(4))
    if change == 0:
        lines[first], lines[second] = lines[second], lines[first]
    elif change == 1:
        lines[first:first] = [lines[second]] * int(one_of(rng, (1, 3, 1000)))
    elif change == 2:
        del lines[min(first, second) : max(first, second) + 1]
    else:
        lines.reverse()
    return b"".join(lines)


_BINARY_CHANGES: tuple[Callable[[bytes, Generator], bytes], ...] = (_flip, _cut, _truncate, _repeat, _noise, _extreme)
_TEXT_CHANGES = (_flip, _cut, _truncate, _repeat, _noise, _number, _number, _nudge, _nudge, _word, _lines)
