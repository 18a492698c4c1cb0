"""The files of bags, message by message: MCAP, the SQLite database of rosbag2, and .bag of ROS 1.

A file is recognised by its first bytes. The package mcap reads MCAP, rosbags reads .bag, and sqlite3 reads databases.
A file that was never closed, or that is damaged, is refused in a line that names the tool which recovers it.
"""

from __future__ import annotations

import sqlite3
import tempfile
from array import array
from collections.abc import Collection, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar
from urllib.parse import quote

from fg_mujoco.errors import BagError

ACCEPTED = "an .mcap or .db3 file, a .bag of ROS 1, or a bag's folder"
"""The kinds of bags that can be read, in words."""

Message = tuple[int, int, bytes]
"""Number of the channel, when it was recorded [ns], and its bytes."""

_ZSTD = b"\x28\xb5\x2f\xfd"


@dataclass(frozen=True, kw_only=True)
class Channel:
    """A topic in a file, with the type of its messages."""

    topic: str
    kind: str  # as sensor_msgs/msg/LaserScan
    definition: str = ""  # empty: the file has none
    language: str = "ros2msg"  # of the definition
    encoding: str = "cdr"  # of the messages


class Storage:
    """A file of messages, which errors name by the path `shown`, and the stack closes.

    `channels` are by number; `owners` and `times` [ns] are each message's channel and when it was recorded, in the
    order of reading; `distribution` is that of ROS 2, where the file says so.
    Raises BagError: the file is unfinished or damaged. `read` raises it, too.
    """

    MAGIC: ClassVar[bytes]
    RECOVER: ClassVar[str]  # command that recovers a file

    def __init__(self, path: Path, shown: Path, stack: ExitStack) -> None:
        self.path, self.shown = path, shown
        self.channels: dict[int, Channel] = {}
        self.owners, self.times = array("q"), array("q")
        self.distribution = ""
        with self._explained():
            self._open(stack)
            for owner, time in self._index():
                self.owners.append(owner)
                self.times.append(time)

    def read(self, wanted: Collection[int]) -> Iterator[Message]:
        """Yield the messages of some channels: as they were written, or those of a .bag in the order of time."""
        with self._explained():
            yield from self._read(wanted)

    def _open(self, stack: ExitStack) -> None:
        """Open the file, and fill the channels as far as they are known without reading the messages."""

    def _index(self) -> Iterator[tuple[int, int]]:
        """Yield the channel and the time of each message."""
        return ((owner, time) for owner, time, _ in self._read(None))

    def _read(self, wanted: Collection[int] | None) -> Iterator[Message]:
        """Yield the messages of some channels, or all."""
        raise NotImplementedError

    @contextmanager
    def _explained(self) -> Iterator[None]:
        """Turn whatever a library raises into one line that says how to recover the file."""
        try:
            yield
        except Exception as error:  # of bytes that are not what the format says
            reason = " ".join(f"{type(error).__name__} {error}".split()).rstrip(".")
            recover = self.RECOVER.format(name=self.shown.name, stem=self.shown.name.split(".")[0])
            raise BagError(
                f"{self.shown}: is unfinished or damaged ({reason}); accepted: a whole file, as `{recover}` makes one"
            ) from error


def open_storage(path: Path, stack: ExitStack) -> Storage:
    """Return the messages of a file, whichever of the formats it has; BagError: none, or unfinished or damaged."""
    shown, begin = path, _first_bytes(path)
    if begin.startswith(_ZSTD):  # one file compressed as a whole, by rosbag2 or by hand
        import zstandard

        path = Path(stack.enter_context(tempfile.TemporaryDirectory())) / path.stem
        with shown.open("rb") as source, path.open("wb") as target:
            zstandard.ZstdDecompressor().copy_stream(source, target)
        begin = _first_bytes(path)
    for storage in _STORAGES:
        if begin.startswith(storage.MAGIC):
            return storage(path, shown, stack)
    what = "is empty" if not begin else "is no file of a bag"
    raise BagError(f"{shown}: cannot be read: it {what}; accepted: {ACCEPTED}")


def is_storage(path: Path) -> bool:
    """Return whether a file begins as one of a bag does."""
    begin = _first_bytes(path) if path.is_file() else b""
    compressed = begin.startswith(_ZSTD) and path.suffix in (".zstd", ".zst")
    return compressed or any(begin.startswith(storage.MAGIC) for storage in _STORAGES)


def uncompressed(data: bytes) -> bytes:
    """Return a message; rosbag2 compresses them one by one where it is asked to, and CDR never begins so."""
    if data[:4] != _ZSTD:
        return data
    import zstandard

    return zstandard.ZstdDecompressor().decompressobj().decompress(data)


class _Mcap(Storage):
    MAGIC = b"\x89MCAP0\r\n"
    RECOVER = "mcap recover {name} -o {stem}_whole.mcap"

    def _read(self, wanted: Collection[int] | None) -> Iterator[Message]:
        from mcap import records
        from mcap.stream_reader import StreamReader

        schemas: dict[int, records.Schema] = {}
        with self.path.open("rb") as file:
            limit = self.path.stat().st_size
            for record in StreamReader(file, validate_crcs=True, record_size_limit=limit).records:
                if isinstance(record, records.Message):
                    if (wanted is None or record.channel_id in wanted) and record.channel_id in self.channels:
                        yield record.channel_id, record.log_time, record.data
                elif isinstance(record, records.Schema):
                    schemas[record.id] = record
                elif isinstance(record, records.Channel):
                    schema = schemas.get(record.schema_id)
                    self.channels[record.id] = Channel(
                        topic=record.topic,
                        kind=_normal(schema.name if schema else ""),
                        definition=schema.data.decode() if schema else "",
                        language=schema.encoding if schema else "",
                        encoding=record.message_encoding,
                    )


class _Ros1(Storage):
    MAGIC = b"#ROSBAG V2.0\n"
    RECOVER = "rosbag reindex {name}"

    def _open(self, stack: ExitStack) -> None:
        from rosbags.rosbag1 import Reader

        self._reader = stack.enter_context(Reader(self.path))
        for each in self._reader.connections:
            self.channels[each.id] = Channel(
                topic=each.topic,
                kind=_normal(each.msgtype),
                definition=each.msgdef.data,
                language="ros1msg",
                encoding="ros1",
            )

    def _read(self, wanted: Collection[int] | None) -> Iterator[Message]:
        found = [each for each in self._reader.connections if wanted is None or each.id in wanted]
        for each, time, data in self._reader.messages(found) if found else ():
            yield each.id, time, data


class _Sqlite(Storage):
    MAGIC = b"SQLite format 3\0"
    RECOVER = "sqlite3 {name} .recover | sqlite3 {stem}_whole.db3"

    def _open(self, stack: ExitStack) -> None:
        log = self.path.with_name(f"{self.path.name}-wal")  # holds the last messages until the recorder closes the file
        immutable = "" if log.is_file() and log.stat().st_size else "&immutable=1"
        self._base = sqlite3.connect(f"file:{quote(str(self.path))}?mode=ro{immutable}", uri=True)
        stack.callback(self._base.close)
        tables = {name for (name,) in self._base.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if not {"topics", "messages"} <= tables:
            raise ValueError("it has no topics and messages")
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

    def _index(self) -> Iterator[tuple[int, int]]:
        for owner, time in self._base.execute("SELECT topic_id, timestamp FROM messages ORDER BY id"):
            if owner in self.channels:
                yield owner, time

    def _read(self, wanted: Collection[int] | None) -> Iterator[Message]:
        numbers = ",".join(str(number) for number in (self.channels if wanted is None else wanted))
        yield from self._base.execute(
            f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({numbers}) ORDER BY id"
        )


_STORAGES: tuple[type[Storage], ...] = (_Mcap, _Ros1, _Sqlite)


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
