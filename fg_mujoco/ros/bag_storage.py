"""The files of bags, message by message: MCAP, the SQLite database of rosbag2, and .bag of ROS 1.

    with open_storage(Path("drive_0.mcap")) as file:
        for row in range(len(file)):
            file.times[row], file.channels[file.owners[row]].topic, file.data(row)

A file is recognised by its first bytes, and read from its beginning to its end, without the index that it may have
there. So one that was never closed, or that ends in the middle of a record, is read up to its last whole message;
`damage` says so. Messages come in the order in which they were written.

Sources: the MCAP specification; rosbag2's storage_sqlite3; the ROS wiki, Bags/Format/2.0.
"""

from __future__ import annotations

import bz2
import mmap
import shutil
import sqlite3
import struct
import tempfile
import zlib
from array import array
from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, ClassVar
from urllib.parse import quote

from ..errors import BagError

ACCEPTED = "an .mcap or .db3 file, a .bag of ROS 1, or a bag's folder"
"""The kinds of bags that can be read, in words."""

_ZSTD = b"\x28\xb5\x2f\xfd"
_KEPT_CHUNKS = 16  # uncompressed, of those read last
_PLACE_BITS = 40  # of a place, those within its buffer; the others number the buffer
_WITHIN = (1 << _PLACE_BITS) - 1


@dataclass(frozen=True, kw_only=True)
class Channel:
    """A topic in a file, with the type of its messages."""

    topic: str
    kind: str  # as sensor_msgs/msg/LaserScan
    definition: str = ""  # empty: the file has none
    language: str = "ros2msg"  # of the definition
    encoding: str = "cdr"  # of the messages


class Storage:
    """A file of messages.

    Attributes:
      channels: by number.
      times: when each message was recorded [ns].
      owners: the number of its channel.
      damage: what cannot be read, in words; empty: nothing.
      distribution: of ROS 2 that wrote it, where the file says so.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.channels: dict[int, Channel] = {}
        self.times, self.owners, self._places = array("q"), array("q"), array("q")
        self.damage = ""
        self.distribution = ""
        self._stack = ExitStack()
        try:
            self._open()
        except BaseException:
            self._stack.close()
            raise

    def __len__(self) -> int:
        return len(self.times)

    def __enter__(self) -> Storage:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._stack.close()

    def data(self, row: int) -> bytes:
        """Return the bytes of a message."""
        raise NotImplementedError

    def _open(self) -> None:
        raise NotImplementedError

    def _add(self, owner: int, time: int, place: int) -> None:
        self.owners.append(owner)
        self.times.append(time)
        self._places.append(place)


def open_storage(path: Path) -> Storage:
    """Return the messages of a file, whichever of the formats it has.

    Raises:
      BagError: it has none of them.
    """
    stack = ExitStack()
    with stack:
        begin = _first_bytes(path)
        if begin.startswith(_ZSTD):  # one file compressed as a whole, by rosbag2 or by hand
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            path = _decompressed(path, folder / path.stem)
            begin = _first_bytes(path)
        for storage in (_Mcap, _Ros1, _Sqlite):
            if begin.startswith(storage.MAGIC):
                file = storage(path)
                file._stack.push(stack.pop_all())
                return file
    what = "is empty" if not begin else "is no file of a bag"
    raise BagError(f"{path}: cannot be read: it {what}; accepted: {ACCEPTED}")


def is_storage(path: Path) -> bool:
    """Return whether a file begins as one of a bag does."""
    begin = _first_bytes(path) if path.is_file() else b""
    compressed = begin.startswith(_ZSTD) and path.suffix in (".zstd", ".zst")
    return compressed or any(begin.startswith(storage.MAGIC) for storage in (_Mcap, _Ros1, _Sqlite))


def uncompressed(data: bytes) -> bytes:
    """Return a message; rosbag2 compresses them one by one where it is asked to, and CDR never begins so."""
    return _zstd(data) if data[:4] == _ZSTD else data


class _TornError(Exception):
    """A record ends behind the end of what there is."""


class _Records(Storage):
    """A file of records, some of them chunks of compressed records."""

    MAGIC: ClassVar[bytes]

    def _open(self) -> None:
        file = self._stack.enter_context(self.path.open("rb"))
        self._map = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        self._stack.callback(self._map.close)
        self._chunks: list[tuple[int, int, str]] = []  # begin, end and compression of each
        self._buffers: OrderedDict[int, bytes] = OrderedDict()
        self._finished = False
        lost = 0
        try:
            for begin, end, compression, checksum in self._read(0, self._map, len(self.MAGIC)):
                self._chunks.append((begin, end, compression))
                number = len(self._chunks)
                try:
                    records = self._buffer(number)
                    if checksum and zlib.crc32(records) != checksum:
                        raise ValueError("another checksum")
                    for _ in self._read(number, records, 0):
                        pass
                except Exception:  # of a decompressor, or a record that is torn
                    lost += 1
        except (_TornError, struct.error, UnicodeDecodeError, KeyError, ValueError):
            self.damage = "it ends in the middle of a record"
        if lost and not self.damage:
            self.damage = f"{lost} of its {len(self._chunks)} chunks are damaged"
        elif not self._finished and not self.damage:
            self.damage = "it was never closed"

    def _buffer(self, number: int) -> Any:
        """Return the file, number 0, or the records of a chunk, from 1."""
        if number == 0:
            return self._map
        if number not in self._buffers:
            begin, end, compression = self._chunks[number - 1]
            self._buffers[number] = _DECOMPRESSORS[compression](self._map[begin:end])
            if len(self._buffers) > _KEPT_CHUNKS:
                self._buffers.popitem(last=False)
        self._buffers.move_to_end(number)
        return self._buffers[number]

    def data(self, row: int) -> bytes:
        number, at = self._places[row] >> _PLACE_BITS, self._places[row] & _WITHIN
        return self._message(self._buffer(number), at)

    def _read(self, number: int, buffer: Any, at: int) -> Iterator[tuple[int, int, str, int]]:
        """Take the channels and messages from a place on, and yield the chunks.

        Yields:
          Begin, end and compression, and the checksum of what is in it, 0 where there is none.
        """
        raise NotImplementedError

    def _message(self, buffer: Any, at: int) -> bytes:
        raise NotImplementedError


class _Mcap(_Records):
    MAGIC = b"\x89MCAP0\r\n"

    _FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 0x02, 0x03, 0x04, 0x05, 0x06

    def _read(self, number: int, buffer: Any, at: int) -> Iterator[tuple[int, int, str, int]]:
        schemas: dict[int, tuple[str, str, str]] = self.__dict__.setdefault("_schemas", {})
        size = len(buffer)
        while at < size:
            kind, length = struct.unpack_from("<BQ", buffer, at)
            begin, at = at + 9, at + 9 + length
            if kind == self._CHUNK and number == 0:
                compression, records = _text(buffer, begin + 28)
                if records + 8 > size:
                    raise _TornError
                checksum = struct.unpack_from("<I", buffer, begin + 24)[0] if at <= size else 0
                yield records + 8, min(at, size), compression, checksum
            if at > size:
                raise _TornError
            if kind == self._FOOTER and number == 0:
                self._finished = True
                return
            if kind == self._MESSAGE:
                channel, _, time = struct.unpack_from("<HIQ", buffer, begin)
                if channel in self.channels:
                    self._add(channel, time, (number << _PLACE_BITS) | begin - 9)
            elif kind == self._SCHEMA:
                name, place = _text(buffer, begin + 2)
                language, place = _text(buffer, place)
                schemas[struct.unpack_from("<H", buffer, begin)[0]] = name, language, _text(buffer, place)[0]
            elif kind == self._CHANNEL:
                channel, schema = struct.unpack_from("<HH", buffer, begin)
                topic, place = _text(buffer, begin + 4)
                name, language, definition = schemas.get(schema, ("", "", ""))
                self.channels[channel] = Channel(
                    topic=topic,
                    kind=_normal(name),
                    definition=definition,
                    language=language,
                    encoding=_text(buffer, place)[0],
                )

    def _message(self, buffer: Any, at: int) -> bytes:
        (length,) = struct.unpack_from("<Q", buffer, at + 1)
        return bytes(buffer[at + 9 + 22 : at + 9 + length])


class _Ros1(_Records):
    MAGIC = b"#ROSBAG V2.0\n"

    _MESSAGE, _BAG, _CHUNK, _CONNECTION = 0x02, 0x03, 0x05, 0x07

    def _read(self, number: int, buffer: Any, at: int) -> Iterator[tuple[int, int, str, int]]:
        size = len(buffer)
        while at < size:
            place = at
            fields, at = _fields(buffer, at)
            (length,) = struct.unpack_from("<I", buffer, at)
            begin, at = at + 4, at + 4 + length
            kind = fields[b"op"][0]
            if kind == self._CHUNK and number == 0:
                yield begin, min(at, size), fields[b"compression"].decode(), 0
            if at > size:
                raise _TornError
            if kind == self._BAG:
                self._finished = struct.unpack("<Q", fields[b"index_pos"])[0] != 0
            elif kind == self._MESSAGE:
                (channel,) = struct.unpack("<I", fields[b"conn"])
                seconds, nanoseconds = struct.unpack("<II", fields[b"time"])
                if channel in self.channels:
                    self._add(channel, seconds * 10**9 + nanoseconds, (number << _PLACE_BITS) | place)
            elif kind == self._CONNECTION:
                (channel,) = struct.unpack("<I", fields[b"conn"])
                about = dict(_split(bytes(buffer[begin:at])))
                self.channels[channel] = Channel(
                    topic=fields[b"topic"].decode(),
                    kind=_normal(about[b"type"].decode()),
                    definition=about[b"message_definition"].decode("utf-8", "replace"),
                    language="ros1msg",
                    encoding="ros1",
                )

    def _message(self, buffer: Any, at: int) -> bytes:
        _, at = _fields(buffer, at)
        (length,) = struct.unpack_from("<I", buffer, at)
        return bytes(buffer[at + 4 : at + 4 + length])


class _Sqlite(Storage):
    MAGIC = b"SQLite format 3\0"

    def _open(self) -> None:
        path, flags = self.path, "mode=ro&immutable=1"
        log = path.with_name(f"{path.name}-wal")
        if log.is_file() and log.stat().st_size:  # the last messages are there; the user's own files stay as they are
            folder = Path(self._stack.enter_context(tempfile.TemporaryDirectory()))
            path, flags = Path(shutil.copy(path, folder)), "mode=rw"
            shutil.copy(log, folder)
            self.damage = "it was never closed"
        self._base = sqlite3.connect(f"file:{quote(str(path))}?{flags}", uri=True)
        self._stack.callback(self._base.close)
        try:
            self._read_channels()
            for row, time, topic in self._base.execute("SELECT id, timestamp, topic_id FROM messages ORDER BY id"):
                if topic in self.channels:
                    self._add(topic, time, row)
        except sqlite3.Error as error:
            if not self.channels:
                raise BagError(f"{self.path}: cannot be read: {error}; accepted: {ACCEPTED}") from error
            self.damage = f"its database is damaged ({error})"

    def _read_channels(self) -> None:
        tables = {name for (name,) in self._base.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if not {"topics", "messages"} <= tables:
            raise BagError(f"{self.path}: cannot be read: it has no topics and messages; accepted: {ACCEPTED}")
        definitions = {}
        if "message_definitions" in tables:
            rows = self._base.execute(
                "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            )
            definitions = {kind: (language, text) for kind, language, text in rows}
        if "schema" in tables:
            self.distribution = next(iter(self._base.execute("SELECT ros_distro FROM schema")), ("",))[0]
        for number, topic, kind, encoding in self._base.execute(
            "SELECT id, name, type, serialization_format FROM topics"
        ):
            language, text = definitions.get(kind, ("", ""))
            self.channels[number] = Channel(
                topic=topic, kind=_normal(kind), definition=text, language=language, encoding=encoding
            )

    def data(self, row: int) -> bytes:
        try:
            found = self._base.execute("SELECT data FROM messages WHERE id = ?", (self._places[row],)).fetchone()
        except sqlite3.Error as error:
            raise ValueError(str(error)) from error
        return bytes(found[0])


def _first_bytes(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(16)
    except OSError as error:
        raise BagError(f"{path}: cannot be read: {error.strerror or error}; accepted: {ACCEPTED}") from error


def _normal(kind: str) -> str:
    """Return the name of a type as ROS 2 writes it."""
    package, _, name = kind.rpartition("/")
    if name == "tfMessage":  # of tf, before tf2: the same message
        return "tf2_msgs/msg/TFMessage"
    return kind if not package or "/" in package else f"{package}/msg/{name}"


def _text(buffer: Any, at: int) -> tuple[str, int]:
    """Return the text at a place, and the place behind it."""
    (length,) = struct.unpack_from("<I", buffer, at)
    if at + 4 + length > len(buffer):
        raise _TornError
    return bytes(buffer[at + 4 : at + 4 + length]).decode(), at + 4 + length


def _fields(buffer: Any, at: int) -> tuple[dict[bytes, bytes], int]:
    """Return the header of a record of ROS 1, and the place behind it."""
    (length,) = struct.unpack_from("<I", buffer, at)
    if at + 8 + length > len(buffer):
        raise _TornError
    return dict(_split(bytes(buffer[at + 4 : at + 4 + length]))), at + 4 + length


def _split(header: bytes) -> Iterator[tuple[bytes, bytes]]:
    at = 0
    while at < len(header):
        (length,) = struct.unpack_from("<I", header, at)
        name, _, value = header[at + 4 : at + 4 + length].partition(b"=")
        yield name, value
        at += 4 + length


def _zstd(data: bytes) -> bytes:
    import zstandard

    return zstandard.ZstdDecompressor().decompressobj().decompress(data)


def _lz4(data: bytes) -> bytes:
    from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]

    return bytes(LZ4FrameDecompressor().decompress(data))


def _bz2(data: bytes) -> bytes:
    return bz2.BZ2Decompressor().decompress(data)


# each gives what there is of data that ends too early
_DECOMPRESSORS: dict[str, Callable[[bytes], bytes]] = {
    "": bytes, "none": bytes, "zstd": _zstd, "lz4": _lz4, "bz2": _bz2,
}  # fmt: skip


def _decompressed(path: Path, target: Path) -> Path:
    """Write a file of zstd uncompressed, as far as it goes."""
    import zstandard

    with path.open("rb") as source, target.open("wb") as file:
        decompressor = zstandard.ZstdDecompressor().decompressobj()
        while piece := source.read(1 << 20):
            file.write(decompressor.decompress(piece))
    return target
