"""A participant of DDS that a graph of ROS 2 sees as a node: topics by ROS's names, and `ros_discovery_info`.

All is offered reliable and transient local, with the newest sample kept, which matches whatever a reader asks for but a
deadline or a liveliness of its own. Readers ask for reliable commands, and take best effort from a writer that offers
no more. Sources: the ROS 2 design article "Topic and Service name mapping to DDS", messages of rmw_dds_common, and
rmw_cyclonedds_cpp (user data).
"""

from __future__ import annotations

import importlib.util
import os
import re
import socket
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

import numpy as np

from fg_mujoco.addons.ros.bag_messages import type_store
from fg_mujoco.errors import SettingsError, missing_extra
from fg_mujoco.messages import shown

from .dds_types import dds_type, kind_of

HOST = "127.0.0.1"
_OLDEST, _HASHED = "foxy", "iron"
"""Distributions of ROS 2, in the order of their letters: the first, and that since which types have hashes."""

_DOMAINS = 232  # the greatest: ports are 7400 + 250 times it and more
_DISCOVERY = "ros_discovery_info"
_GRAPH = "rmw_dds_common/msg/ParticipantEntitiesInfo"
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_PARTICIPANTS = 32  # whose ports are looked at on each peer
_FATAL, _ERRORS = 1, 3  # what Cyclone DDS logs
_BLOCKED = 0.01  # [s] for which a reader that does not keep up may hold up the race
_DEPTH = 100  # samples that wait to be read
_POLICIES = {
    2: "durability", 3: "presentation", 4: "deadline", 5: "latency budget", 6: "ownership", 8: "liveliness",
    11: "reliability", 12: "destination order", 25: "data representation",
}  # fmt: skip
_TYPE = 24  # the policy that types must agree
_NS = 1_000_000_000


def require_cyclonedds() -> None:
    """Make sure that there is a middleware; MissingExtraError: with the command that installs the extra `ros2`."""
    if any(importlib.util.find_spec(name) is None for name in ("cyclonedds", "mcap", "rosbags", "scipy")):
        raise missing_extra("a node of ROS 2 needs cyclonedds, mcap, rosbags and SciPy", "ros2")


@dataclass(eq=False, kw_only=True)
class _Writer:
    """A writer of a topic."""

    kind: str
    made: Any  # class of its samples
    entity: Any
    refused: int = 0  # readers whose QoS did not match
    matched: int = 0  # readers that it has had
    told: bool = False  # that a reader is of another type
    waits: bool = False  # with telling of one whose type is not known yet


@dataclass(eq=False, kw_only=True)
class _Reader:
    """A reader of a topic."""

    topic: str
    kind: str
    entity: Any
    condition: Any  # that it has samples
    refused: int = 0  # writers whose QoS did not match
    reliable: bool = True


class Participant:
    """A node on a domain.

    Its topics and the node are in `namespace`, those of tf and the clock in none. `domain` None is that of
    ROS_DOMAIN_ID, else 0; `host` None is 127.0.0.1, this machine alone, unless CYCLONEDDS_URI is set; `peers` are
    addresses of machines to look for participants on, where multicast does not reach them. `distribution` is that of
    the nodes on the other side, one that rosbags knows, from foxy on: from iron on a node's ids are shorter, and types
    have hashes. `log` takes lines that say what cannot match.
    Raises MissingExtraError: the extra `ros2` is not installed; SettingsError: a domain, a name or an address that
    cannot be.
    """

    def __init__(
        self,
        name: str,
        *,
        namespace: str = "/",
        domain: int | None = None,
        host: str | None = None,
        peers: Sequence[str] = (),
        distribution: str = "humble",
        log: Callable[[str], None] = print,
    ) -> None:
        require_cyclonedds()
        from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription
        from cyclonedds.core import DDSException, WaitSet
        from cyclonedds.domain import DomainParticipant
        from cyclonedds.internal import DDS
        from cyclonedds.qos import Policy, Qos
        from rosbags.typesys import Stores

        self.domain = _domain(domain)
        self._name, self._namespace, self._log = name, _namespace(namespace), log
        names = [store.value.removeprefix("ros2_") for store in Stores if store.value.startswith("ros2_")]
        if distribution not in names or distribution < _OLDEST:
            accepted = ", ".join(name for name in names if name >= _OLDEST)
            raise SettingsError(f"distribution is {distribution!r}; accepted: {accepted}")
        self._hashed, self._distribution = distribution >= _HASHED, distribution
        self._writers: dict[str, _Writer] = {}
        self._readers: list[_Reader] = []
        self._topics: dict[str, str] = {}  # by their names on DDS
        self.listened: set[str] = set()
        if host is None and not peers and os.environ.get("CYCLONEDDS_URI"):
            self._domain = None
        else:
            self._domain = _joined(self.domain, *_addresses(HOST if host is None else host, peers))
        try:
            self._participant: Any = DomainParticipant(self.domain, qos=Qos(Policy.Userdata(b"enclave=/;")))
        except DDSException as error:
            raise SettingsError(
                f"domain {self.domain} cannot be joined; accepted: settings of Cyclone DDS in CYCLONEDDS_URI, or "
                "--host in their place"
            ) from error
        # of Cyclone DDS itself only what ends it is logged: it has a line for each sample that is not of its type
        DDS._dll_handle.dds_set_log_mask(_FATAL)
        self._waiting: Any = WaitSet(self._participant)
        self._known: dict[str, Any] = {
            "publisher": BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication),
            "reader": BuiltinDataReader(self._participant, BuiltinTopicDcpsSubscription),
        }

    @property
    def node(self) -> str:
        """Name of the node, with its namespace."""
        return f"{self._namespace.rstrip('/')}/{self._name}"

    def close(self) -> None:
        """Leave the domain."""
        self._waiting = None
        self._known.clear()
        self._readers.clear()
        self._writers.clear()
        self._participant = self._domain = None

    def is_published(self, topic: str, wait: float) -> bool:
        """Return whether another participant publishes on a topic; it is looked for so long [s]."""
        name, end = self._dds_name(topic), time.monotonic() + wait
        while all(each.topic_name != name for each in self._others(self._known["publisher"].read(N=1000))):
            if time.monotonic() >= end:
                return False
            time.sleep(0.02)
        return True

    def come(self) -> Iterator[tuple[str, str, str]]:
        """Yield topic, "publisher" or "reader", and type of who has come; log who cannot match on the topics here."""
        from cyclonedds.qos import Policy

        for who, reader in self._known.items():
            for each in self._others(reader.take(N=1000)):
                topic, kind = self._topics.get(each.topic_name), kind_of(each.type_name)
                if topic is None:
                    yield each.topic_name.removeprefix(self._dds_name("")), who, kind
                    continue
                partition, writer = each.qos[Policy.Partition], self._writers.get(topic)
                names = () if partition is None else partition.partitions
                if names and not any(fnmatchcase("", name) for name in names):
                    self._log(f"{topic} has a {who} in the partition {', '.join(names)!r}; accepted: in none")
                    continue
                if who == "reader" and writer is not None and writer.kind != kind:
                    self._log(f"{topic} has a reader of {kind}; accepted: {writer.kind}")
                    writer.told = True
                yield topic, who, kind

    def publishers(self) -> list[str]:
        """Return the topics that are read, each as often as it has publishers now."""
        counts = [(each.topic, each.entity.get_subscription_matched_status().current_count) for each in self._readers]
        return sorted(topic for topic, count in counts for _ in range(count))

    def _others(self, found: Sequence[Any]) -> list[Any]:
        here = [each for each in found if getattr(each, "qos", None) is not None]  # not those that have gone
        return [each for each in here if each.participant_key != self._participant.guid]

    def offer(self, topic: str, kind: str) -> None:
        """Publish on a topic from now on."""
        from cyclonedds.pub import DataWriter

        made = dds_type(kind, self._distribution if kind == _GRAPH else "")
        qos = self._qos(reliable=True, transient=True, depth=1, kind=kind)
        entity = DataWriter(self._participant, self._topic(topic, made), qos=qos)
        self._writers[topic] = _Writer(kind=kind, made=made, entity=entity)

    def withdraw(self, topic: str) -> None:
        """Publish no longer on a topic."""
        self._writers.pop(topic, None)
        self.listened.discard(topic)

    def read(self, topic: str, kind: str) -> None:
        """Take samples of a type from a topic from now on."""
        self._readers.append(self._make_reader(topic, kind, reliable=True))

    def unread(self, topic: str) -> None:
        """Take samples from a topic no longer."""
        for each in [each for each in self._readers if each.topic == topic]:
            self._waiting.detach(each.condition)
            self._readers.remove(each)

    def announce(self) -> None:
        """Say to the graph of ROS which node reads and publishes here."""
        types = type_store(self._distribution).types
        gid = types["rmw_dds_common/msg/Gid"]
        size = 16 if self._hashed else 24

        def gid_of(entity: Any) -> Any:
            return gid(data=np.frombuffer(entity.guid.bytes.ljust(size, b"\0"), np.uint8))

        node = types["rmw_dds_common/msg/NodeEntitiesInfo"](
            node_namespace=self._namespace, node_name=self._name,
            reader_gid_seq=[gid_of(each.entity) for each in self._readers],
            writer_gid_seq=[gid_of(each.entity) for topic, each in self._writers.items() if topic != _DISCOVERY],
        )  # fmt: skip
        message = types[_GRAPH](gid=gid_of(self._participant), node_entities_info_seq=[node])
        if _DISCOVERY not in self._writers:
            self.offer(_DISCOVERY, _GRAPH)
        self.write(_DISCOVERY, bytes(type_store(self._distribution).serialize_cdr(message, _GRAPH)))

    def write(self, topic: str, content: bytes) -> None:
        """Publish the CDR of a message, unless the topic was withdrawn; a reader that does not keep up loses it."""
        from cyclonedds.core import DDSException

        writer = self._writers.get(topic)
        if writer is None:
            return
        try:
            writer.entity.write(writer.made(content))
        except DDSException as error:
            if error.code != DDSException.DDS_RETCODE_TIMEOUT:
                raise

    def wait(self, seconds: float) -> None:
        """Wait until there are samples, at most so long."""
        self._waiting.wait(max(0, round(seconds * _NS)))

    def take(self) -> Iterator[tuple[str, str, bytes]]:
        """Yield topic, type and CDR of samples that have come, those of a topic in their order."""
        for reader in self._readers:
            for sample in reader.entity.take(_DEPTH):
                if hasattr(sample, "content"):  # not that a publisher has gone
                    yield reader.topic, reader.kind, sample.content

    def look(self) -> set[str]:
        """Find who reads and publishes now; return the topics with new readers, and log what cannot match."""
        fresh = set()
        for topic, writer in self._writers.items():
            status = writer.entity.get_publication_matched_status()
            (self.listened.add if status.current_count else self.listened.discard)(topic)
            if status.total_count != writer.matched:
                writer.matched = status.total_count
                fresh.add(topic)
            refused = writer.entity.get_offered_incompatible_qos_status()
            if refused.total_count > writer.refused:
                other_type = refused.last_policy_id == _TYPE
                if other_type and not (writer.told or writer.waits):
                    writer.waits = True  # if it came since `come`, that tells of it before the next look
                    continue
                writer.refused, writer.waits = refused.total_count, False
                if not (other_type and writer.told):
                    self._say_refused(f"{topic} has a reader", refused.last_policy_id)
        again = [reader for reader in self._readers if self._is_refused(reader)]
        for reader in again:
            self._waiting.detach(reader.condition)
            self._readers[self._readers.index(reader)] = self._make_reader(reader.topic, reader.kind, reliable=False)
        if again:
            self.announce()
        return fresh.union(reader.topic for reader in again)

    def _is_refused(self, reader: _Reader) -> bool:
        """Return whether a writer offers best effort only, and say so of anything else that cannot match."""
        status = reader.entity.get_requested_incompatible_qos_status()
        if status.total_count <= reader.refused:
            return False
        reader.refused = status.total_count
        if reader.reliable and _POLICIES.get(status.last_policy_id) == "reliability":
            return True
        if status.last_policy_id != _TYPE:  # which `come` tells
            self._say_refused(f"{reader.topic} has a publisher", status.last_policy_id)
        return False

    def _say_refused(self, who: str, policy: int) -> None:
        if policy == _TYPE:
            self._log(f"{who} of another type, or another definition of it; accepted: that of ROS 2")
            return
        name = _POLICIES.get(policy, f"policy {policy}")
        self._log(
            f"{who} whose QoS cannot match, its {name}; accepted: any reliability, volatile or transient local, "
            "and of all else the default"
        )

    def _topic(self, topic: str, made: Any) -> Any:
        from cyclonedds.topic import Topic

        name = self._dds_name(topic)
        self._topics[name] = topic
        return Topic(self._participant, name, made)

    def _make_reader(self, topic: str, kind: str, *, reliable: bool) -> _Reader:
        from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState
        from cyclonedds.sub import DataReader

        qos = self._qos(reliable=reliable, transient=False, depth=_DEPTH, kind=kind)
        reader = DataReader(self._participant, self._topic(topic, dds_type(kind)), qos=qos)
        condition = ReadCondition(reader, ViewState.Any | InstanceState.Any | SampleState.NotRead)
        self._waiting.attach(condition)
        return _Reader(topic=topic, kind=kind, entity=reader, condition=condition, reliable=reliable)

    def _qos(self, *, reliable: bool, transient: bool, depth: int, kind: str) -> Any:
        from cyclonedds.qos import Policy, Qos
        from cyclonedds.util import duration

        policies = [
            Policy.Reliability.Reliable(duration(seconds=_BLOCKED)) if reliable else Policy.Reliability.BestEffort,
            Policy.Durability.TransientLocal if transient else Policy.Durability.Volatile,
            Policy.History.KeepLast(depth),
            Policy.IgnoreLocal.Participant,
            Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False),
        ]
        if self._hashed:
            hashed = type_store(self._distribution).hash_rihs01(kind)
            policies.append(Policy.Userdata(f"typehash={hashed};".encode()))
        return Qos(*policies)

    def _dds_name(self, topic: str) -> str:
        if topic == _DISCOVERY:
            return topic
        alone = topic in ("/tf", "/tf_static", "/clock")
        return f"rt{topic}" if alone else f"rt{self._namespace.rstrip('/')}{topic}"


def _joined(number: int, host: str, peers: Sequence[str]) -> Any:
    """Return a domain on a network interface; None: this process has joined it already, with the settings of then."""
    from cyclonedds.core import DDSException
    from cyclonedds.domain import Domain
    from cyclonedds.internal import DDS

    here = (HOST,) if host == HOST or peers else ()
    found = "".join(f'<Peer address="{peer}"/>' for peer in (*here, *peers))
    config = (
        f'<CycloneDDS><Domain><General><Interfaces><NetworkInterface address="{host}"/></Interfaces>'
        "<AllowMulticast>spdp</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
        f"<MaxAutoParticipantIndex>{_PARTICIPANTS}</MaxAutoParticipantIndex><SPDPInterval>500ms</SPDPInterval>"
        f"<Peers>{found}</Peers></Discovery></Domain></CycloneDDS>"
    )
    with tempfile.TemporaryFile() as told:  # Cyclone DDS tells the reason on stderr alone
        kept = os.dup(2)  # of a program without stderr, the file itself
        os.dup2(told.fileno(), 2)
        DDS._dll_handle.dds_set_log_mask(_ERRORS)
        try:
            return Domain(number, config)
        except DDSException as error:
            if error.code == DDSException.DDS_RETCODE_PRECONDITION_NOT_MET:
                return None
            told.seek(0)
            _, _, reason = told.read().decode(errors="replace").partition("]")  # time and domain
            raise SettingsError(
                f"domain {number} cannot be joined on {host}: {' '.join(reason.partition(': ')[2].split())}; accepted: "
                "the address of a network interface that is up (--host), and a domain with less than "
                f"{_PARTICIPANTS} participants on this machine (--domain)"
            ) from error
        finally:
            os.dup2(kept, 2)
            os.close(kept)


def _domain(number: int | None) -> int:
    """Return the number of a domain, by default that of the environment."""
    value: Any = os.environ.get("ROS_DOMAIN_ID", "") or 0 if number is None else number
    name = "ROS_DOMAIN_ID" if number is None else "domain"
    try:
        found = int(value)
    except ValueError:
        found = -1
    if not 0 <= found <= _DOMAINS:
        raise SettingsError(f"{name} is {shown(value)}; accepted: a whole number from 0 to {_DOMAINS}")
    return found


def _namespace(name: str) -> str:
    """Return a namespace with a slash in front, and none at its end."""
    parts = [part for part in name.split("/") if part]
    if not all(_NAME.fullmatch(part) for part in parts):
        raise SettingsError(f"namespace is {name!r}; accepted: names of letters, digits and _ such as /car_1")
    return "/" + "/".join(parts)


def _addresses(host: str, peers: Sequence[str]) -> tuple[str, list[str]]:
    """Return the addresses of the network interface and of peers in numbers: one that is none ends Cyclone DDS."""
    found = []
    for name, text in (("host", host), *(("peer", peer) for peer in peers)):
        try:
            address = socket.gethostbyname(text)
        except (OSError, ValueError):  # of names that are unknown, too long, or contain a zero
            address = "0"
        if address.startswith("0"):
            raise SettingsError(f"{name} is {shown(text)}; accepted: the address of a machine, such as 192.168.1.7")
        found.append(address)
        if found[0] == HOST and not address.startswith("127."):
            accepted = "--host with the address of this machine's network interface, such as 192.168.1.7"
            raise SettingsError(f"peer is {text!r}, which is not reached from host {HOST}; accepted: {accepted}")
    return found[0], found[1:]
