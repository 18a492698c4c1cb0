"""A car's recording: which messages are read, and what a planner is told when a scan comes in."""

import numpy as np
import pytest

from bag_worlds import SECOND, make, robot_odometry, robot_scan, rotation, transforms, vector, write_bag
from case_loops import cases
from fg_mujoco.addons.ros.bag_messages import drive_message
from fg_mujoco.addons.ros.bag_reader import ScanBag
from fg_mujoco.cli.main import main
from fg_mujoco.errors import BagError
from fg_mujoco.messages import DriveCommand
from fg_mujoco.vehicle.vehicle import Vehicle

CAR = Vehicle.load().parameters
EPOCH = 1_700_000_000 * SECOND


def deliveries(path, **options):
    with ScanBag(path, CAR, **options) as bag:
        return list(bag)


def scans(count, topic="/scan", start=EPOCH):
    return [
        (topic, start + i * SECOND // 10, robot_scan([1.0 + i, 2.0], time=start + i * SECOND // 10))
        for i in range(count)
    ]


def test_bags_of_another_library_are_read_as_folder_and_as_file(tmp_path):
    for storage in cases("MCAP", "SQLITE3"):
        folder = write_bag(tmp_path / storage, scans(3), storage=storage)
        (file,) = [path for path in folder.iterdir() if path.suffix in (".mcap", ".db3")]
        for path in (folder, file):
            heard = deliveries(path)
            assert [d.scan.ranges.tolist() for d in heard] == [[1.0, 2.0], [2.0, 2.0], [3.0, 2.0]]
            assert [d.measured for d in heard] == [EPOCH, EPOCH + SECOND // 10, EPOCH + SECOND // 5]
            assert [d.received for d in heard] == [d.measured for d in heard]


def test_without_odometry_the_car_does_what_was_commanded_before_the_scan(tmp_path):
    command = DriveCommand(steering_angle=0.25, speed=1.5)
    entries = [*scans(2), ("/drive", EPOCH, drive_message(command, EPOCH))]
    first, second = deliveries(write_bag(tmp_path / "bag", entries))
    assert first.odometry.speed == 0.0  # the command of that moment is the answer to that scan
    assert (second.odometry.speed, second.odometry.steering_angle) == (1.5, 0.25)
    assert second.odometry.wheel_speeds.tolist() == [1.5] * 4


@pytest.mark.slow
def test_odometry_is_the_last_received_when_the_scan_came_in(tmp_path):
    late = EPOCH + SECOND // 20
    entries = [
        ("/odom", EPOCH, robot_odometry(EPOCH, speed=1.0, yaw_rate=0.5, x=3.0)),
        *scans(2),
        ("/odom", late, robot_odometry(late, speed=2.0, yaw_rate=0.25)),
    ]
    first, second = deliveries(write_bag(tmp_path / "bag", sorted(entries, key=lambda e: e[1])))
    assert (first.odometry.speed, second.odometry.speed) == (1.0, 2.0)
    assert (first.odometry.yaw_rate, second.odometry.yaw_rate) == (0.5, 0.25)
    assert second.odometry.stamp == pytest.approx(late / 1e9)
    assert np.isnan(first.odometry.pose).all()  # in a frame that nobody says is on the map


def test_messages_of_one_moment_are_heard_before_its_scan_whatever_their_order(tmp_path):
    entries = [*scans(1), ("/odom", EPOCH, robot_odometry(EPOCH, speed=3.0))]
    assert deliveries(write_bag(tmp_path / "bag", entries))[0].odometry.speed == 3.0


def test_imu_and_joints_are_told_where_the_bag_has_them(tmp_path):
    imu = make(
        "sensor_msgs/msg/Imu", header=robot_odometry(EPOCH).header, orientation=rotation(),
        orientation_covariance=np.zeros(9), angular_velocity=vector(0.1, 0.2, 0.3),
        angular_velocity_covariance=np.zeros(9),
        linear_acceleration=vector(1.0, 2.0, 9.0), linear_acceleration_covariance=np.zeros(9),
    )  # fmt: skip
    joints = make(
        "sensor_msgs/msg/JointState", header=imu.header,
        name=["rear_left_wheel", "steering", "front_left_wheel", "front_right_wheel", "rear_right_wheel"],
        position=np.array([9.0, 0.125]), velocity=np.array([3.0, 9.0, 1.0, 2.0, 4.0]), effort=np.empty(0),
    )  # fmt: skip
    entries = [
        ("/odom", EPOCH, robot_odometry(EPOCH, speed=2.0, yaw_rate=7.0)),
        ("/sensors/imu/raw", EPOCH, imu),  # the only one there is
        ("/joint_states", EPOCH, joints),
        *scans(1),
    ]
    odometry = deliveries(write_bag(tmp_path / "bag", entries))[0].odometry
    assert odometry.angular_velocity.tolist() == [0.1, 0.2, 0.3]
    assert odometry.linear_acceleration.tolist() == [1.0, 2.0, 9.0]
    assert (odometry.speed, odometry.steering_angle) == (2.0, 0.125)
    assert odometry.wheel_speeds == pytest.approx(CAR.wheel_radius * np.array([1.0, 2.0, 3.0, 4.0]))


def test_the_lidar_is_turned_as_the_transforms_say_even_where_they_come_late(tmp_path):
    links = transforms(
        EPOCH, ("mast", "laser", vector(), rotation(0.5)), ("base_link", "mast", vector(z=0.2), rotation(0.25))
    )
    entries = [*scans(1), ("/tf_static", EPOCH + SECOND, links)]
    scan = deliveries(write_bag(tmp_path / "bag", entries))[0].scan
    assert scan.angle_min == pytest.approx(-2.0 + 0.75, abs=1e-6)


def test_topics_are_the_usual_or_the_only_ones_or_those_asked_for(tmp_path):
    both = write_bag(tmp_path / "both", [*scans(1, "/front"), *scans(2, "/rear")])
    with pytest.raises(BagError, match=r"on /front, /rear; accepted: one, by --scan-topic"):
        deliveries(both)
    assert len(deliveries(both, scan_topic="/rear")) == 2
    with pytest.raises(BagError, match=r"no sensor_msgs/msg/LaserScan on /top; accepted: /front, /rear"):
        deliveries(both, scan_topic="/top")
    usual = write_bag(tmp_path / "usual", [*scans(1, "/scan"), *scans(2, "/rear")])
    assert len(deliveries(usual)) == 1
    assert len(deliveries(write_bag(tmp_path / "only", scans(3, "/rear")))) == 3


def test_a_bag_without_scans_is_refused_with_what_it_has(tmp_path, capsys):
    bag = write_bag(tmp_path / "bag", [("/odom", EPOCH, robot_odometry(EPOCH))])
    assert main(["replay-scans", str(bag), "--out", str(tmp_path / "out.csv")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "holds no scans" in error and "/odom (nav_msgs/msg/Odometry)" in error
    assert not (tmp_path / "out.csv").exists()


def test_what_is_no_bag_is_refused_in_one_line(tmp_path, capsys):
    for content in cases(None, b"", b"not a bag at all"):
        path = tmp_path / "drive.mcap"
        if content is not None:
            path.write_bytes(content)
        assert main(["replay-scans", str(path), "--out", str(tmp_path / "out.csv")]) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1
        assert "drive.mcap" in error and "accepted: an .mcap or .db3 file" in error
        assert not (tmp_path / "out.csv").exists()
