"""Changes of files and values that programs, editors, disks and people make, drawn from a generator."""

import contextlib
import io
import json
import re
import zipfile

import numpy as np

NUMBERS = ("0", "-0", "1", "-1", "2", "0.5", "1e-9", "1e-300", "5e-324", "1e5", "1e9", "1e12", "1e150", "1e308",
           "-1e308", "1e309", "nan", "-nan", "inf", "-inf", "NaN", "Infinity", "2147483647", "2147483648",
           "-2147483649", "4294967296", "9223372036854775808", "9" * 400, "1" + "0" * 5000, "0x10", "1_000", "١٢",
           "1,5", "1e", "--1", "", " ", "true", "null")  # fmt: skip
"""Texts in the place of a number."""

WORDS = ("", " ", "\0", "\x1b[2J", "\ud7ff", "é", "‮", "a" * 300, "a" * 5000, "../../etc/passwd", "/dev/zero",
         "/dev/stdin", "~", "%s%n", "{}", "{0.__class__}", "$(id)", "`id`", "<script>alert(1)</script>", "'\"", "\\",
         "#", "--", "-", "=", ":", "[", "]", "[[", "a=b", "a:b", "\n", "\r\n", "\t", "None", "__class__", "__init__",
         "self", ",", ";", "|", "[a=1]", "[a=]", "[=1]")  # fmt: skip
"""Texts in the place of a name."""

VALUES = (None, True, 0, 1, -1, 3, 10**9, 10**400, 0.5, -0.5, 1e-300, 1e308, np.nan, np.inf, "", "a", "\0", "a" * 5000,
          "/dev/zero", "../x", "/", b"a", [], [1], [[]], (0.0, 1.0), [np.nan, 1.0], [1e308, -1e308], [np.inf, 0],
          [[0.0, 1.0]], [1j, 0], ["a", "b"], [None, None], (0, 10**400), slice(0, 2), {}, {"a": 1}, {1: None}, object(),
          np.zeros(2), np.zeros(3), np.zeros((2, 3)), np.array([0.1, 2.0], np.float32), np.array("a"),
          np.float32("nan"), np.int64(2), 1j, range(3), int, lambda *_: None, iter(()))  # fmt: skip
"""Values of every kind, in the place of any other."""

_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


def one_of(rng, values):
    """Return one of some values."""
    return values[int(rng.integers(len(values)))]


def mutated(content, rng):
    """Return a text file with one change to three."""
    for _ in range(int(one_of(rng, (1, 1, 1, 2, 3)))):
        content = one_of(rng, _TEXT_CHANGES)(content, rng)
    return content


def mutated_binary(content, rng):
    """Return a binary file with one change to three."""
    for _ in range(int(one_of(rng, (1, 1, 1, 2, 3)))):
        content = one_of(rng, _BINARY_CHANGES)(content, rng)
    return content


def _span(content, rng, longest=64):
    start = int(rng.integers(len(content) + 1))
    return start, min(len(content), start + int(rng.integers(longest + 1)))


def _flip(content, rng):
    if not content:
        return content
    place = int(rng.integers(len(content)))
    return content[:place] + bytes([content[place] ^ (1 << int(rng.integers(8)))]) + content[place + 1 :]


def _cut(content, rng):
    start, end = _span(content, rng)
    return content[:start] + content[end:]


def _truncate(content, rng):
    return content[: int(rng.integers(len(content) + 1))]


def _repeat(content, rng):
    start, end = _span(content, rng)
    return content[:end] + content[start:end] * int(one_of(rng, (1, 2, 100, 10_000))) + content[end:]


def _noise(content, rng):
    start, end = _span(content, rng)
    return content[:start] + rng.bytes(end - start) + content[end:]


def _extreme(content, rng):
    start, _ = _span(content, rng)
    value = one_of(rng,
        (b"\0" * 4, b"\xff" * 4, b"\xff\xff\xff\x7f", b"\0" * 8, b"\xff" * 8, b"\0\0\0\0\0\0\xf0\x7f", b"\1"))
    return content[:start] + value + content[start + len(value) :]


def _any_number(content, rng):
    """Return a number in a text: the first from some place on, or the first of all."""
    place = int(rng.integers(len(content) + 1))
    while place > 0 and content[place - 1 : place].isdigit():
        place -= 1
    return _NUMBER.search(content, place) or _NUMBER.search(content)


def _number(content, rng):
    match = _any_number(content, rng)
    if match is None:
        return content
    return content[: match.start()] + one_of(rng, NUMBERS).encode() + content[match.end() :]


def _nudge(content, rng):
    """Change one number to another that might be meant."""
    match = _any_number(content, rng)
    if match is None:
        return content
    value = float(match[0]) * rng.uniform(0.5, 2.0) if len(match[0]) < 30 else 1.0
    return content[: match.start()] + f"{value:.6g}".encode() + content[match.end() :]


def _word(content, rng):
    start, end = _span(content, rng, 16)
    return content[:start] + one_of(rng, WORDS).encode() + content[end:]


def _lines(content, rng):
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


_BINARY_CHANGES = (_flip, _cut, _truncate, _repeat, _noise, _extreme)
_TEXT_CHANGES = (_flip, _cut, _truncate, _repeat, _noise, _number, _number, _nudge, _nudge, _word, _lines)


# -- documents and arrays


def any_json(value, rng):
    """Return a JSON value with one of its leaves or branches replaced."""
    if isinstance(value, dict) and value and rng.random() < 0.85:
        key = one_of(rng, list(value))
        return {**value, key: any_json(value[key], rng)}
    if isinstance(value, list) and value and rng.random() < 0.7:
        place = int(rng.integers(len(value)))
        return [*value[:place], any_json(value[place], rng), *value[place + 1 :]]
    deep = 1
    for _ in range(200):
        deep = [deep]
    return one_of(rng,
                  (None, True, 0, -1, 1e308, float("inf"), 10**12, 2**63, 10**30, 10**400, "", *WORDS[:12], [], {}, [1],
                   [[1]], {"a": 1}, deep, [[]] * 9999, "x" * 9999, 0.5))  # fmt: skip


def any_json_file(path, rng):
    """Change a file of JSON: its text, one of its values, or which names it has."""
    content = json.loads(path.read_text(encoding="utf-8"))
    change = rng.random()
    if change < 0.3:
        path.write_bytes(mutated(path.read_bytes(), rng))
        return
    if change < 0.6:
        del content[one_of(rng, list(content))]
    if change > 0.5:
        content = any_json(content, rng)
    path.write_text(json.dumps(content), encoding="utf-8")


def changed_arrays(path, rng):
    """Change a file of arrays: its bytes, or one of its arrays."""
    if rng.random() < 0.3:
        path.write_bytes(mutated_binary(path.read_bytes(), rng))
        return
    with np.load(path) as file:
        arrays = dict(file)
    name = one_of(rng, list(arrays))
    array = np.atleast_1d(arrays[name])
    first, second = (array.flat[int(rng.integers(max(1, array.size)))] if array.size else 0 for _ in range(2))
    changes = (lambda: array[:-1], lambda: array[:0], lambda: array.T, lambda: array.reshape(-1), lambda: np.zeros(()),
        lambda: array.astype(str), lambda: array.astype(np.complex64), lambda: array.astype(np.float16),
        lambda: np.where(array == first, np.nan, array), lambda: np.where(array == first, 1e300, array),
        lambda: np.where(array == first, second, array), lambda: array[::-1], lambda: np.zeros((0, *array.shape)),
        lambda: np.tile(array, (2,) * max(1, array.ndim)), lambda: np.zeros(3_000_000))  # fmt: skip
    with np.errstate(all="ignore"), contextlib.suppress(TypeError, ValueError):
        arrays[name] = one_of(rng, changes)()
    if rng.random() < 0.1:
        del arrays[name]
    if rng.random() < 0.05:
        arrays["more"] = np.zeros(3)
    np.savez_compressed(path, **arrays)
    if rng.random() < 0.1:  # a member that says of itself what is not so
        header = io.BytesIO()
        np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (10**12,)})
        with zipfile.ZipFile(path, "a") as file:
            file.writestr(f"{name}.npy", header.getvalue())
