"""The files of bags, whole, split, compressed, unfinished and damaged, of ROS 1 and ROS 2."""

import shutil
import sqlite3
import struct
import warnings
from itertools import product

import pytest

from bag_worlds import CAR, EPOCH, SECOND, robot_odometry, robot_scan, write_bag
from cases import each
from fg_mujoco.addons.ros.bag_messages import type_store
from fg_mujoco.addons.ros.bag_reader import ScanBag
from fg_mujoco.cli.main import main
from fg_mujoco.errors import BagError

STEP = SECOND // 40
SCAN = "sensor_msgs/msg/LaserScan"

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")


def entries(count=40, first=0):
    found = []
    for number in range(first, first + count):
        time = EPOCH + number * STEP
        found.append(("/odom", time, robot_odometry(time, speed=1.0)))
        found.append(("/scan", time, robot_scan([1.0 + 0.125 * number, 2.0], time=time)))
    return found


def nearest(path):
    """The first range of each scan, of which no two are the same."""
    with ScanBag(path, CAR) as bag:
        return [delivery.scan.ranges[0] for delivery in bag]


EXPECTED = [1.0 + 0.125 * number for number in range(40)]


def of_ros1(path, found, *, compression=None, chunk=None):
    """Write entries as a .bag, by the library's own writer and types."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    ros1 = get_typestore(Stores.ROS1_NOETIC)
    writer = Writer(path)
    if compression:
        writer.set_compression(getattr(Writer.CompressionFormat, compression))
    if chunk:
        writer.chunk_threshold = chunk
    with writer:
        connections = {}
        for topic, time, message in found:
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=ros1)
            writer.write(connections[topic], time, ros1.serialize_ros1(as_ros1(message, ros1), kind))
    return path


def as_ros1(message, store):
    """The same message with the sequence number that headers had in ROS 1."""
    kind = message.__msgtype__
    values = {}
    for name, _ in store.fielddefs[kind][1]:
        value = getattr(message, name, 0)
        if isinstance(value, list):
            value = [as_ros1(each, store) if hasattr(each, "__msgtype__") else each for each in value]
        values[name] = as_ros1(value, store) if hasattr(value, "__msgtype__") else value
    return store.types[kind](**values)


def of_mcap(path, found, *, finish=True, compression="NONE", chunk=4096, profile="ros2"):
    """Write entries as MCAP by the format's own library; without finishing as a recorder whose power is cut."""
    from mcap.writer import CompressionType, Writer

    store = type_store()
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=chunk, compression=getattr(CompressionType, compression))
        writer.start(profile=profile)
        channels = {}
        for topic, time, message in found:
            kind = message.__msgtype__
            if topic not in channels:
                text = store.generate_msgdef(kind, ros_version=2)[0].encode()
                channels[topic] = writer.register_channel(topic, "cdr", writer.register_schema(kind, "ros2msg", text))
            writer.add_message(channels[topic], time, store.serialize_cdr(message, kind), time)
        if finish:
            writer.finish()
    return path


def split(folder, metadata=True, **options):
    """Write a bag of three files that follow each other, as `ros2 bag record --max-bag-duration` does."""
    folder.mkdir()
    names = []
    for name, first, count in (("drive_0", 0, 12), ("drive_1", 12, 1), ("drive_10", 13, 27)):  # in order of numbers
        piece = write_bag(folder.parent / f"piece_{first}", entries(count, first), **options)
        (file,) = [path for path in piece.iterdir() if path.suffix != ".yaml"]
        names.append(name + file.name[file.name.index(".") :])
        shutil.move(file, folder / names[-1])
    if metadata:
        files = "".join(f"    - {name}\n" for name in names)
        (folder / "metadata.yaml").write_text(
            f"rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: x\n  relative_file_paths:\n{files}"
        )
    return folder


@each("storage, compression, metadata", [("MCAP", None, False), *product(["SQLITE3"], [None, "FILE", "MESSAGE"], [1]),
                                         ("MCAP", None, True), ("SQLITE3", "FILE", False)])  # fmt: skip
def test_files_that_follow_each_other_are_one_bag(storage, compression, metadata, tmp_path):
    assert nearest(split(tmp_path / "drive", metadata, storage=storage, compression=compression)) == EXPECTED


def test_a_bag_is_read_however_compressed_and_in_the_order_of_time(tmp_path):
    found = sorted(entries(), key=lambda entry: entry[0])
    for compression in ("NONE", "LZ4", "ZSTD"):
        assert nearest(of_mcap(tmp_path / "drive.mcap", found, compression=compression)) == EXPECTED
    for compression in (None, "BZ2", "LZ4"):
        assert nearest(of_ros1(tmp_path / f"{compression}.bag", entries(), compression=compression)) == EXPECTED


def test_a_bag_that_is_not_whole_is_refused_with_the_command_that_recovers_it(tmp_path, capsys):
    def refused(path, file, command, *contents):
        for data in contents:
            file.write_bytes(data)
            assert main(["replay-scans", str(path), "--out", str(tmp_path / "out.csv")]) == 2
            said = capsys.readouterr().err
            assert said.count("\n") == 1 and f"{file}: is unfinished or damaged" in said and command in said

    for compression in ("NONE", "ZSTD"):
        path = of_mcap(tmp_path / "drive.mcap", entries(), compression=compression)
        unfinished = of_mcap(tmp_path / "other.mcap", entries(), compression=compression, finish=False, chunk=600)
        whole, recover = path.read_bytes(), "`mcap recover drive.mcap -o drive_whole.mcap`"
        refused(path, path, recover, whole[: len(whole) // 3], whole[:-1], unfinished.read_bytes())
    path = of_ros1(tmp_path / "drive.bag", entries(), chunk=2000)
    whole = path.read_bytes()
    at = whole.index(b"index_pos=") + len(b"index_pos=")
    (index,) = struct.unpack_from("<Q", whole, at)
    unfinished = whole[:at] + bytes(8) + whole[at + 8 : index]  # as `rosbag record` leaves it where it is killed
    refused(path, path, "`rosbag reindex drive.bag`", unfinished, whole[: len(whole) // 2])
    folder = write_bag(tmp_path / "drive", entries(), storage="SQLITE3")
    (file,) = folder.glob("*.db3")
    whole, recover = file.read_bytes(), "`sqlite3 drive.db3 .recover | sqlite3 drive_whole.db3`"
    refused(folder, file, recover, whole[: len(whole) // 3], whole[: 9 * len(whole) // 10])


@each("compression", ["NONE", "ZSTD"])
def test_a_bit_that_is_wrong_is_said_and_never_read_as_a_range(compression, tmp_path):
    path = of_mcap(tmp_path / "drive.mcap", entries(), compression=compression, chunk=2000)
    whole = bytearray(path.read_bytes())
    for place in range(400, len(whole), 197 * (1 + len(whole) // 4000)):
        damaged = bytearray(whole)
        damaged[place] ^= 0x40
        path.write_bytes(damaged)
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            try:
                read = nearest(path)
            except BagError as error:
                assert str(path) in str(error)
                continue
        assert set(read) <= set(EXPECTED)
        assert read == EXPECTED or said


def test_messages_that_are_in_the_log_of_a_database_are_read_and_the_files_stay_as_they_are(tmp_path):
    folder = write_bag(tmp_path / "drive", entries(20), storage="SQLITE3")
    (file,) = folder.glob("*.db3")
    base = sqlite3.connect(file)
    base.execute("PRAGMA journal_mode=WAL")
    base.execute("PRAGMA wal_autocheckpoint=0")
    store = type_store()
    topics = dict(base.execute("SELECT name, id FROM topics"))
    for topic, time, message in entries(20, 20):
        data = store.serialize_cdr(message, message.__msgtype__)
        base.execute("INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)",
                     (topics[topic], time, bytes(data)))  # fmt: skip
    base.commit()
    log = file.with_name(f"{file.name}-wal")
    assert log.stat().st_size > 0
    before = {path.name: path.read_bytes() for path in folder.iterdir() if "shm" not in path.name}
    assert nearest(folder) == EXPECTED
    assert {path.name: path.read_bytes() for path in folder.iterdir() if "shm" not in path.name} == before
    base.close()


def test_an_old_database_has_the_types_of_its_distribution(tmp_path):
    folder = write_bag(tmp_path / "drive", entries(), storage="SQLITE3")
    (file,) = folder.glob("*.db3")
    base = sqlite3.connect(file)  # as Foxy wrote them: no definitions, no schema
    columns = "id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT, offered_qos_profiles TEXT"
    base.executescript(
        f"DROP TABLE message_definitions; DROP TABLE schema; DROP TABLE metadata; CREATE TABLE t({columns});"
        "INSERT INTO t SELECT id, name, type, serialization_format, offered_qos_profiles FROM topics;"
        "DROP TABLE topics; ALTER TABLE t RENAME TO topics;"
    )
    base.close()
    (folder / "metadata.yaml").unlink()
    assert nearest(folder) == nearest(file) == EXPECTED


def test_a_message_of_ones_own_type_beside_is_no_obstacle(tmp_path):
    from mcap.writer import Writer

    path = of_mcap(tmp_path / "drive.mcap", entries())
    store = type_store()
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2")
        mine = writer.register_schema("my_msgs/msg/Plan", "ros2msg", b"not_there/Thing[<=3] what\n%%% no definition")
        for schema in (mine, 0):
            channel = writer.register_channel(f"/mine_{schema}", "cdr", schema)
            writer.add_message(channel, EPOCH, b"\x00\x01\x00\x00abc", EPOCH)
        text = store.generate_msgdef(SCAN, ros_version=2)[0].encode()
        scans = writer.register_channel("/lidar/front", "cdr", writer.register_schema(SCAN, "ros2msg", text))
        for topic, time, message in entries():
            if topic == "/scan":
                writer.add_message(scans, time, store.serialize_cdr(message, SCAN), time)
        writer.finish()
    assert nearest(path) == EXPECTED


def test_a_part_that_is_missing_is_said_and_the_others_are_read(tmp_path, recwarn):
    folder = split(tmp_path / "drive")
    (folder / "drive_1.mcap").unlink()
    assert nearest(folder) == EXPECTED[:12] + EXPECTED[13:]
    assert any("metadata.yaml names drive_1.mcap" in str(w.message) for w in recwarn)
