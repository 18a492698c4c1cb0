"""The messages of a bag, of one file or several, in the order of their time.

A bag is a file, or the folder of one or of several that follow each other, with its metadata.yaml or without. The types
of messages are those that the bag holds, each by itself, so that one that nobody here knows is no obstacle; where it
holds none, those of the package rosbags by the distribution of ROS that wrote it. What is wrong with a bag, and can be
lived with, is said in a warning of one line.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Collection, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.course.files import read_text
from fg_mujoco.errors import BagError, FgMujocoError

from .bag_frames import FrameTree
from .bag_messages import (
    DRIVE,
    IMU,
    MAP_FRAME,
    MOTOR,
    ODOMETRY,
    SCAN,
    TRANSFORMS,
    USUAL,
    from_cdr,
    measures,
    require_ros_extra,
    type_store,
)
from .bag_scans import mount_of, to_scan
from .bag_signs import SignFinder, Signs, turn_round
from .bag_storage import ACCEPTED, Channel, Storage, is_storage, open_storage, uncompressed
from .composed_topics import composed_topics

Topic = tuple[str, str]
"""Type and name of a topic."""

FIRST_TRANSFORMS = 1000
"""Messages of /tf that are read ahead for how the sensors sit on the car."""

_METADATA = "metadata.yaml"
_SET_BACK = 500_000_000  # [ns] that a topic's times go back by where the recorder's clock was set, and not late
_GOES_ON = 25_000_000  # [ns] after a clock was set back
_MOST_METADATA = 2**24  # bytes
_FILES = re.compile(r"^ *relative_file_paths:[ \t]*\n((?:[ \t]*-[ \t].*(?:\n|\Z))+)", re.MULTILINE)
_ITEM = re.compile(r"^[ \t]*-[ \t]+(.+?)[ \t\r]*$", re.MULTILINE)
_DISTRIBUTION = re.compile(r"^ *ros_distro: *[\"']?(\w+)", re.MULTILINE)
_RIGHT = Signs()
_NUMBERED = re.compile(r"(?P<stem>.*?)_(?P<number>\d+)$")


@dataclass(frozen=True, kw_only=True, eq=False)
class Heard:
    """A message as it was recorded."""

    topic: Topic
    received: int  # [ns] by the recorder's clock
    time: int  # [ns] the same, but growing: where the clock was set back it goes on
    message: Any


class Recording:
    """A bag, open for reading in a `with` statement.

    `counts` has how many messages each topic has that can be chosen, with the topics that are composed of several.
    Raises MissingExtraError: the extra `ros`; BagError: on entry, a bag that cannot be read.
    """

    def __init__(self, path: str | Path) -> None:
        require_ros_extra()
        self.path = Path(path)
        self.counts: dict[Topic, int] = {}

    def __enter__(self) -> Recording:
        with ExitStack() as stack, self.blame():
            self._distribution = ""
            self._files: list[Storage] = []
            for path in self._paths():
                self._files.append(open_storage(path, stack))
            self._order()
            self._recorded = dict(self.counts)
            self._composed = composed_topics(self.counts)
            hidden = frozenset[Topic]().union(*(each.hides for each in self._composed.values()))
            made = {topic: each.count for topic, each in self._composed.items()}
            self.counts = {**{topic: count for topic, count in self.counts.items() if topic not in hidden}, **made}
            self._decoders: dict[Channel, Callable[[bytes], Any]] = {}
            self._signs: dict[Topic, Signs] = {}
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def warn(self, said: str) -> None:
        """Say in a line what is wrong with the bag and can be lived with."""
        warnings.warn(f"{self.path}: {said}", stacklevel=2)

    def held(self) -> str:
        """Return the topics of the bag with their types, in words."""
        held = sorted((topic, kind) for kind, topic in self._recorded)
        return ", ".join(f"{topic} ({kind})" for topic, kind in held) or "no messages"

    def table(self) -> list[str]:
        """Return the duration of the bag, and its topics with their types and counts, one line each."""
        rows = [f"{self.path}: {self.span:.1f} s, {sum(self._recorded.values())} messages"]
        for (kind, topic), count in sorted(self._recorded.items(), key=lambda row: row[0][1]):
            if kind in (ODOMETRY, MOTOR):
                self.signs_of((kind, topic))  # which says what is wrong with them
            rows.append(f"  {topic:<32} {kind:<40} {count:>8}")
        for (kind, topic), each in sorted(self._composed.items(), key=lambda row: row[0][1]):
            names = ", ".join(sorted(name.rpartition("/")[2] for _, name in each.sources))
            rows.append(f"  {topic:<32} {kind:<40} composed of {names}")
        return rows

    @property
    def span(self) -> float:
        """From the first message to the last [s]."""
        return float(np.ptp(self._times)) / 1e9 if len(self._times) else 0.0

    def choose(
        self,
        kinds: Collection[str],
        *,
        wanted: str | None = None,
        option: str | None = None,
        sparse: bool = True,
        measuring: str = "",
    ) -> Topic | None:
        """Return the topic of these types: the `wanted` one, a usual one, or the only one; None: there is none.

        Beside topics that are not usual only the first of USUAL is, and composed ones count where there is no other.
        Without an option that asks for one, several are none. Not `sparse`: topics of less than a message in two
        seconds, as goals are, do not count. An IMU has to be `measuring` a quantity. Raises BagError: there is none of
        that name; there are several, and none is usual.
        """
        there = sorted((name, kind) for kind, name in self.counts if kind in kinds)
        names = ", ".join(name for name, _ in there)
        if wanted is not None:
            named = f"/{wanted.lstrip('/')}"
            found = [(kind, name) for name, kind in there if name in (wanted, named)]
            if not found:
                raise BagError(
                    f"{self.path}: has no {' or '.join(kinds)} on {wanted}; accepted: {names or self.held()}"
                )
            return found[0]
        if not sparse:
            least = max(2.0, 0.5 * self.span)
            there = [(name, kind) for name, kind in there if self.counts[kind, name] >= least]
        if measuring:
            there = [(name, kind) for name, kind in there if self._measures((kind, name), measuring)]
        there = [each for each in there if each[::-1] not in self._composed] or there
        names = ", ".join(name for name, _ in there)
        usual = [(kind, name) for kind in kinds for name in USUAL.get(kind, ()) if (name, kind) in there]
        first = [name for kind in kinds for name in USUAL.get(kind, ())[:1]]
        found = [each for each in usual if len(usual) == len(there) or each[1] in first][:1]
        if found or len(there) == 1:
            chosen = found[0] if found else (there[0][1], there[0][0])
            others = ", ".join(name for name, _ in there if name != chosen[1])
            if others:
                self.warn(f"{chosen[1]} is read, and not {others}{f'; {option} chooses' if option else ''}")
            return chosen
        if there and option is not None:
            raise BagError(f"{self.path}: has {there[0][1]} on {names}; accepted: one, by {option}")
        if there:
            self.warn(f"has {there[0][1]} on {names}: none of them is read")
        return None

    def choose_imus(self, *, wanted: str | None = None, option: str | None = None) -> tuple[Topic | None, Topic | None]:
        """Return the topics of the gyro and of the accelerometer, which may be one; arguments as those of `choose`."""
        gyro = self.choose((IMU,), wanted=wanted, option=option, measuring="angular_velocity")
        if wanted is not None or (gyro is not None and self._measures(gyro, "linear_acceleration")):
            return gyro, gyro
        return gyro, self.choose((IMU,), option=option, measuring="linear_acceleration")

    def _measures(self, topic: Topic, quantity: str) -> bool:
        """Return whether the first message of an IMU measures a quantity."""
        found = True
        with suppress(BagError), self.blame():  # of what cannot be read, which is said where it is read
            found = all(measures(heard.message, quantity) for heard in self._as_recorded({topic}, 1))
        return found

    def messages(self, wanted: Collection[Topic], most: int | None = None) -> Iterator[Heard]:
        """Yield the messages of topics, `most` at most; of one time in the order in which they were written.

        Odometry and motors that are negative where the car drives forward are turned round, which is said.
        """
        signs = {topic: self.signs_of(topic) for topic in wanted if topic[0] in (ODOMETRY, MOTOR)}
        for heard in self._as_recorded(wanted, most):
            if signs.get(heard.topic, _RIGHT) != _RIGHT:
                turn_round(heard.message, signs[heard.topic])
            yield heard

    @property
    def transform_topics(self) -> set[Topic]:
        """The topics that have transforms."""
        return {topic for topic in self.counts if topic[0] == TRANSFORMS}

    def mounting_frames(self, *, static: bool = True) -> FrameTree:
        """Return the frames as they were first heard, of /tf_static, too: how the sensors sit on the car."""
        frames = FrameTree()
        fixed = {topic for topic in self.transform_topics if topic[1].endswith("tf_static")}
        for topics, most in ((self.transform_topics - fixed, FIRST_TRANSFORMS), (fixed if static else (), None)):
            for heard in self._as_recorded(topics, most):
                frames.hear(heard.message)
        return frames

    def signs_of(self, topic: Topic) -> Signs:
        """Return the signs of an Odometry or a motor, by the commands and the scans; wrong ones are said, once."""
        if topic not in self._signs:
            self._signs[topic] = _RIGHT
            if topic not in self._composed:
                with suppress(BagError), self.blame():  # of what cannot be read, which is said where it is read
                    self._signs[topic] = self._found_signs(topic)
        return self._signs[topic]

    def _found_signs(self, topic: Topic) -> Signs:
        witnesses = [
            min((each for each in self.counts if each[0] == kind), key=_rank, default=None) for kind in (SCAN, DRIVE)
        ]
        if not any(witnesses):
            return _RIGHT
        finder, frames, frame = SignFinder(), self.mounting_frames(), ""
        with warnings.catch_warnings():  # which are given where these messages are read
            warnings.simplefilter("ignore")
            for heard in self._as_recorded({topic, *(each for each in witnesses if each is not None)}, None):
                time = heard.time / 1e9
                if heard.topic == topic:
                    finder.hear_odometry(time, heard.message)
                    frame = heard.message.header.frame_id
                elif heard.topic[0] == DRIVE:
                    finder.hear_command(time, heard.message)
                else:
                    finder.hear_scan(time, to_scan(heard.message, mount_of(frames, heard.message.header.frame_id)))
                if finder.knows:
                    break
        found, told = finder.signs(turns=topic[0] == ODOMETRY)
        if told:
            self.warn(f"{topic[1]}: {told}")
        if found.in_pose and self.mounting_frames(static=False).find(frame, MAP_FRAME) is not None:
            found = replace(found, in_pose=False)  # a localisation's correction is of the poses as they are
        return found

    def _as_recorded(self, wanted: Collection[Topic], most: int | None) -> Iterator[Heard]:
        composing = {topic: self._composed[topic].begin() for topic in wanted if topic in self._composed}
        if not composing:
            yield from self._written(wanted, most)
            return
        sources = frozenset[Topic]().union(*(self._composed[topic].sources for topic in composing))
        count = 0
        for heard in self._written({*wanted} - {*composing} | sources, None):
            found = [heard] if heard.topic in wanted else []
            for topic, compose in composing.items():
                if heard.topic in self._composed[topic].sources:
                    message = compose(heard.topic, heard.message, heard.received)
                    found += [] if message is None else [replace(heard, topic=topic, message=message)]
            for each in found:
                if most is not None and count >= most:
                    return
                count += 1
                yield each

    def _written(self, wanted: Collection[Topic], most: int | None) -> Iterator[Heard]:
        lost: dict[Topic, int] = {}
        count = 0
        with self.blame():
            for time, (channel, received, data) in self._in_time(wanted):
                topic = (channel.kind, channel.topic)
                try:
                    message = self._decoder(channel)(uncompressed(data))
                except FgMujocoError:
                    raise
                except Exception:  # of bytes that are not what the type says
                    lost[topic] = lost.get(topic, 0) + 1
                    continue
                yield Heard(topic=topic, received=received, time=time, message=message)
                count += 1
                if count == most:
                    return
        for (kind, name), missing in lost.items():
            if missing == self._recorded[kind, name]:
                raise BagError(f"{self.path}: none of the messages on {name} can be read; accepted: messages of {kind}")
            self.warn(f"{missing} messages on {name} are damaged and left out")

    @contextmanager
    def blame(self) -> Iterator[None]:
        """Turn whatever reading the bag raises into one line that names it."""
        try:
            yield
        except FgMujocoError as error:
            if isinstance(error, BagError) and not str(error).startswith(str(self.path)):
                raise BagError(f"{self.path}: {error}") from error
            raise
        except Exception as error:
            reason = " ".join(f"{type(error).__name__}: {error}".split())
            raise BagError(f"{self.path}: cannot be read: {reason}; accepted: {ACCEPTED}") from error

    def _paths(self) -> list[Path]:
        """Return the files of the bag in their order."""
        if not self.path.exists():
            raise BagError(f"{self.path}: cannot be read: no such file or folder; accepted: {ACCEPTED}")
        if not self.path.is_dir():
            return [self.path]
        files = {path.name: path for path in sorted(self.path.iterdir()) if is_storage(path)}
        listed = self._metadata()
        if listed:
            missing = [name for name in listed if name not in files]
            if missing:
                self.warn(f"{_METADATA} names {', '.join(missing)}, which cannot be read or is not there")
            files = {name: files[name] for name in listed if name in files} or files
        if not files:
            raise BagError(f"{self.path}: cannot be read: it has no file of a bag; accepted: {ACCEPTED}")
        if listed or len(files) == 1:
            return list(files.values())
        stems = {name: name.split(".")[0] for name in files}
        numbers = {name: _NUMBERED.match(stem) for name, stem in stems.items()}
        if len({match["stem"] if match else name for name, match in numbers.items()}) > 1:
            raise BagError(f"{self.path}: holds several bags: {', '.join(files)}; accepted: one of them")
        return sorted(files.values(), key=lambda path: int(numbers[path.name]["number"]))  # type: ignore[index]

    def _metadata(self) -> list[str]:
        """Return the names of the files that a folder's metadata.yaml tells of, and note its distribution."""
        path = self.path / _METADATA
        if not path.is_file():
            return []
        try:
            text = read_text(path, _MOST_METADATA)
        except (OSError, ValueError) as error:
            self.warn(f"{_METADATA} cannot be read ({error}); the folder's files are")
            return []
        self._distribution = found[1] if (found := _DISTRIBUTION.search(text)) else ""
        listed = _FILES.search(text)
        return [Path(name.strip("'\" ")).name for name in _ITEM.findall(listed[1])] if listed else []

    def _order(self) -> None:
        """Note the time of each message. A clock that was set back while recording goes on."""
        self._times = np.concatenate([np.array(file.times, np.int64) for file in self._files])
        topics: dict[Topic, int] = {}
        owners = []
        for file in self._files:
            number = {
                owner: topics.setdefault((channel.kind, channel.topic), len(topics))
                for owner, channel in file.channels.items()
            }
            owners.append(np.array([number[owner] for owner in file.owners], np.int64))
        self._owners = np.concatenate(owners)
        self._topics = list(topics)
        found = np.bincount(self._owners, minlength=len(topics)).tolist()
        self.counts = {topic: count for topic, count in zip(self._topics, found, strict=True) if count}
        for begin, back in _set_back(self._times, self._owners):
            shift = self._times[:begin].max() + _GOES_ON - self._times[begin]
            self._times[begin:] += shift
            after = (self._times[begin] - self._times.min()) / 1e9
            self.warn(
                f"the recorder's clock was set back by {back / 1e9:.1f} s after {after:.1f} s; time goes on there"
            )

    def _in_time(self, wanted: Collection[Topic]) -> Iterator[tuple[int, tuple[Channel, int, bytes]]]:
        """Yield the messages of topics in the order of time, each with its time."""
        numbers = [number for number, topic in enumerate(self._topics) if topic in wanted]
        times = self._times[np.isin(self._owners, numbers)]
        found = zip(times.tolist(), self._read(wanted), strict=True)
        if (np.diff(times) >= 0).all():
            yield from found
        else:
            yield from sorted(found, key=lambda each: each[0])

    def _read(self, wanted: Collection[Topic]) -> Iterator[tuple[Channel, int, bytes]]:
        """Yield the messages of topics as the files have them, with the time at which each was recorded [ns]."""
        for file in self._files:
            owners = {owner for owner, channel in file.channels.items() if (channel.kind, channel.topic) in wanted}
            for owner, time, data in file.read(owners):
                yield file.channels[owner], time, data

    def _decoder(self, channel: Channel) -> Callable[[bytes], Any]:
        """Return the decoder of a channel's messages."""
        if channel not in self._decoders:
            store = self._store(channel)
            if channel.encoding == "ros1":
                self._decoders[channel] = lambda data: store.deserialize_ros1(data, channel.kind)
            elif channel.encoding == "cdr":
                self._decoders[channel] = lambda data: from_cdr(data, channel.kind, store)
            else:
                said = f"{self.path}: {channel.topic} is written in {channel.encoding!r}"
                raise BagError(f"{said}; accepted: 'cdr', as ROS 2 writes messages, or 'ros1'")
        return self._decoders[channel]

    def _store(self, channel: Channel) -> Any:
        """Return the types of a channel: the bag's own definition, or those of a distribution of ROS."""
        wrong = ""
        if channel.definition:
            try:
                return _types_of(channel.definition, channel.kind, idl="idl" in channel.language)
            except Exception as error:  # of whatever is written there
                wrong = f"its definition in the bag cannot be read ({type(error).__name__})"
        distribution = next((file.distribution for file in self._files if file.distribution), self._distribution)
        store = type_store(distribution)
        if channel.kind not in store.fielddefs:
            wrong = wrong or "the bag has no definition of it"
            raise BagError(f"{self.path}: {channel.kind} on {channel.topic}: {wrong}; accepted: a bag that has one")
        if wrong:
            self.warn(f"{channel.kind} on {channel.topic}: {wrong}; the usual one is taken")
        return store


@lru_cache(maxsize=64)
def _types_of(definition: str, kind: str, *, idl: bool) -> Any:
    """Return the types of a definition in a bag. Their code is made once for all bags that have the same."""
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    store = get_typestore(Stores.EMPTY)
    if idl:
        for text in re.split(r"^=+\n", definition, flags=re.MULTILINE):
            body = re.sub(r"\AIDL: .*\n", "", text)
            if body.strip():
                store.register(get_types_from_idl(body))
    else:
        store.register(get_types_from_msg(definition, kind))
    _ = store.fielddefs[kind]
    return store


def _rank(topic: Topic) -> tuple[int, str]:
    """Return where a topic stands among those of its type: the usual ones first."""
    usual = USUAL[topic[0]]
    return usual.index(topic[1]) if topic[1] in usual else len(usual), topic[1]


def _set_back(times: NDArray[np.int64], owners: NDArray[np.int64]) -> list[tuple[int, int]]:
    """Return when the recorder's clock was set back, and by how much [ns]: where the times of one topic go back."""
    falls = []  # (first row after it, last row before it, by how much)
    for owner in np.unique(owners).tolist():
        rows = np.flatnonzero(owners == owner)
        back = -np.diff(times[rows])
        falls += [(int(rows[at + 1]), int(rows[at]), int(back[at])) for at in np.flatnonzero(back > _SET_BACK)]
    found: list[tuple[int, int]] = []
    for after, before, fall in sorted(falls):
        if not found or found[-1][0] <= before:
            found.append((after, fall))
    return found
