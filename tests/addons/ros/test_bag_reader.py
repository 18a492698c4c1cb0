"""A car's recording: what a planner is told when a scan comes in; and faults, lived with or refused."""

import math
import re

import numpy as np
import pytest

from bag_worlds import (
    CAR,
    EPOCH,
    SECOND,
    header,
    make,
    read,
    robot_imu,
    robot_odometry,
    robot_scan,
    rotation,
    transforms,
    vector,
    write_bag,
)
from cases import each
from fg_mujoco.addons.realcar.bag_drive import read_bag_drive
from fg_mujoco.addons.ros.bag_messages import WHEEL_JOINTS, drive_message
from fg_mujoco.cli.main import main
from fg_mujoco.errors import BagError
from fg_mujoco.messages import DriveCommand
from refusals import refused

STEP = SECOND // 40


def scans(count, topic="/scan"):
    times = [EPOCH + i * SECOND // 10 for i in range(count)]
    return [(topic, time, robot_scan([1.0 + i, 2.0], time=time)) for i, time in enumerate(times)]


def ticks(count, first=EPOCH):
    return [first + number * STEP for number in range(count)]


def drive(folder, times, *, stamps=None, ranges=None, odometry=None, **scan):
    """Write scans that were recorded at times, in the order of the file, and odometry of 1 m/s along x."""
    entries = []
    for number, (time, stamp) in enumerate(zip(times, times if stamps is None else stamps, strict=True)):
        seen = np.full(41, 2.0 + 0.125 * (number % 64)) if ranges is None else ranges(number)
        entries.append(("/scan", time, robot_scan(seen, time=stamp, **scan)))
    for time in times if odometry is None else odometry:
        entries.append(("/odom", time, robot_odometry(time, x=(time - times[0]) / SECOND, speed=1.0)))
    return write_bag(folder / "bag", entries)


@each("storage", ["MCAP", "SQLITE3"])
def test_bags_of_another_library_are_read_as_folder_and_as_file(storage, tmp_path):
    folder = write_bag(tmp_path / storage, scans(3), storage=storage)
    (file,) = [path for path in folder.iterdir() if path.suffix in (".mcap", ".db3")]
    for path in (folder, file):
        heard = read(path)
        assert [d.scan.ranges.tolist() for d in heard] == [[1.0, 2.0], [2.0, 2.0], [3.0, 2.0]]
        assert [d.measured for d in heard] == [EPOCH, EPOCH + SECOND // 10, EPOCH + SECOND // 5]
        assert [d.received for d in heard] == [d.measured for d in heard]


def test_without_odometry_the_car_does_what_was_commanded_before_the_scan(tmp_path):
    command = DriveCommand(steering_angle=0.25, speed=1.5)
    entries = [*scans(2), ("/drive", EPOCH, drive_message(command, EPOCH))]
    first, second = read(write_bag(tmp_path / "bag", entries))
    assert first.odometry.speed == 0.0  # the command of that moment is the answer to that scan
    assert (second.odometry.speed, second.odometry.steering_angle) == (1.5, 0.25)
    assert second.odometry.wheel_speeds.tolist() == [1.5] * 4
    assert second.odometry.yaw_rate == pytest.approx(1.5 * math.tan(0.25) / CAR.wheelbase)


def test_odometry_is_the_last_received_when_the_scan_came_in_or_in_its_moment(tmp_path):
    late = EPOCH + SECOND // 20
    entries = [*scans(2),
               ("/odom", EPOCH, robot_odometry(EPOCH, speed=1.0, yaw_rate=0.5, x=3.0)),
               ("/odom", late, robot_odometry(late, speed=2.0, yaw_rate=0.25))]  # fmt: skip
    first, second = read(write_bag(tmp_path / "bag", sorted(entries, key=lambda entry: entry[1])))
    assert (first.odometry.speed, second.odometry.speed) == (1.0, 2.0)
    assert (first.odometry.yaw_rate, second.odometry.yaw_rate) == (0.5, 0.25)
    assert second.odometry.stamp == pytest.approx(late / 1e9)
    assert np.isnan(first.odometry.pose).all()  # in a frame that nobody says is on the map


def test_imu_and_joints_are_told_where_the_bag_has_them(tmp_path):
    imu = robot_imu(EPOCH, (0.1, 0.2, 0.3), (1.0, 2.0, 9.0))
    names = ["rear_left_wheel", "steering", "front_left_wheel", "front_right_wheel", "rear_right_wheel"]
    joints = make("sensor_msgs/msg/JointState", header=imu.header, name=names, position=np.array([9.0, 0.125]),
                  velocity=np.array([3.0, 9.0, 1.0, 2.0, 4.0]), effort=np.empty(0))  # fmt: skip
    entries = [("/odom", EPOCH, robot_odometry(EPOCH, speed=2.0, yaw_rate=7.0)), ("/sensors/imu/raw", EPOCH, imu),
               ("/joint_states", EPOCH, joints), *scans(1)]  # fmt: skip
    odometry = read(write_bag(tmp_path / "bag", entries))[0].odometry
    assert odometry.angular_velocity.tolist() == [0.1, 0.2, 0.3]
    assert odometry.linear_acceleration.tolist() == [1.0, 2.0, 9.0]
    assert (odometry.speed, odometry.steering_angle) == (2.0, 0.125)
    assert odometry.wheel_speeds == pytest.approx(CAR.wheel_radius * np.array([1.0, 2.0, 3.0, 4.0]))


def imu_of(time, *, frame="imu", lacks=(), turning=(0.0, 0.0, 0.5), accelerating=(1.0, 0.0, 9.81)):
    message = robot_imu(time, turning, accelerating)
    message.header.frame_id = frame
    for quantity in lacks:
        setattr(message, f"{quantity}_covariance", np.array([-1.0] + [0.0] * 8))
    return message


GYRO, ACCELEROMETER, ORIENTATION = "angular_velocity", "linear_acceleration", "orientation"


@each("imus, yaw_rate, ahead", [
    ({"/imu": {}}, 0.5, 1.0),
    ({"/imu": {"lacks": (GYRO,), "turning": (0.0, 0.0, 0.0)}}, 0.25, 1.0),
    ({"/imu": {"lacks": (ACCELEROMETER,), "accelerating": (7.0, 0.0, 0.0)}}, 0.5, 0.0),
    ({"/imu": {"lacks": (GYRO, ACCELEROMETER)}}, 0.25, 0.0),  # a compass
    ({"/camera/accel/sample": {"lacks": (GYRO, ORIENTATION), "turning": (0.0, 0.0, 0.0)},
      "/camera/gyro/sample": {"lacks": (ACCELEROMETER, ORIENTATION), "accelerating": (0.0, 0.0, 0.0)}}, 0.5, 1.0),
    ({"/camera/imu": {"frame": "camera_imu_optical_frame", "turning": (0.0, -0.5, 3.0),
                      "accelerating": (0.0, -9.81, 1.0)}}, 0.5, 1.0),
    ({"/imu": {"frame": "turned", "turning": (0.0, 0.0, 0.5), "accelerating": (0.0, -1.0, 9.81)}}, 0.5, 1.0),
    ({"/imu": {"turning": (0.0, 0.0, math.nan)}}, 0.25, 1.0),
])  # fmt: skip
def test_of_an_imu_is_read_what_it_measures_along_the_axes_of_the_car(imus, yaw_rate, ahead, tmp_path):
    left = transforms(EPOCH, ("base_link", "turned", vector(), rotation(yaw=math.pi / 2)))
    entries = [("/tf_static", EPOCH, left)]
    for time in ticks(20):
        entries += [(topic, time, imu_of(time, **options)) for topic, options in imus.items()]
        command = drive_message(DriveCommand(steering_angle=0.0, speed=2.0), time)
        pose = robot_odometry(time, x=2.0 * (time - EPOCH) / SECOND, speed=2.0, yaw_rate=0.25)
        entries += [("/odom", time, pose), ("/drive", time, command), ("/scan", time, robot_scan([1.0], time=time))]
    bag = write_bag(tmp_path / "bag", entries)
    odometry = read(bag)[-1].odometry
    assert (odometry.yaw_rate, odometry.linear_acceleration[0]) == pytest.approx((yaw_rate, ahead))
    assert odometry.linear_acceleration[2] == pytest.approx(9.81)
    drive = read_bag_drive(bag)
    assert np.allclose(drive.yaw_rate.values, yaw_rate)
    assert drive.acceleration is None if not ahead else np.allclose(drive.acceleration.values[:, 0], ahead)


def test_joints_that_come_by_turns_or_without_velocities_are_read_as_far_as_they_say_something(tmp_path):
    def joints(time, names, position, velocity):
        values = {"position": np.array(position), "velocity": np.array(velocity, float), "effort": np.empty(0)}
        return make("sensor_msgs/msg/JointState", header=header(time, ""), name=names, **values)

    wheels = list(WHEEL_JOINTS)
    for case, velocity in (("/all", [20.0] * 4), ("/none", []), ("/nan", [math.nan] * 4)):
        entries = []
        for time in ticks(3):
            entries += [("/joint_states", time, joints(time, ["steering"], [0.2], [])),
                        ("/joint_states", time, joints(time, wheels, [math.nan] * 4, velocity)),
                        ("/odom", time, robot_odometry(time, speed=1.5)),
                        ("/scan", time, robot_scan([1.0], time=time))]  # fmt: skip
        odometry = read(write_bag(tmp_path / case[1:], entries))[-1].odometry
        assert odometry.steering_angle == pytest.approx(0.2)
        assert odometry.wheel_speeds == pytest.approx(20.0 * CAR.wheel_radius if case == "/all" else 1.5)


def test_the_lidar_is_turned_as_the_transforms_say_even_where_they_come_late(tmp_path):
    mast = ("base_link", "mast", vector(z=0.2), rotation(0.25))
    links = transforms(EPOCH, ("mast", "laser", vector(), rotation(0.5)), mast)
    (found,) = read(write_bag(tmp_path / "bag", [*scans(1), ("/tf_static", EPOCH + SECOND, links)]))
    assert found.scan.angle_min == pytest.approx(-2.0 + 0.75, abs=1e-6)


def test_a_lidar_upside_down_by_transforms_without_a_base_link_is_read_as_the_odometry_says(tmp_path):
    links = transforms(EPOCH, ("car/chassis_7", "laser", vector(x=0.2), rotation(0.0, math.pi)))
    odometry = robot_odometry(EPOCH)
    odometry.child_frame_id = "car/chassis_7"
    scan = robot_scan(np.arange(1.0, 10.0), first=-1.0, step=0.25, time=EPOCH)
    entries = [("/tf_static", EPOCH, links), ("/odom", EPOCH, odometry), ("/scan", EPOCH, scan)]
    found = read(write_bag(tmp_path / "bag", entries))[0].scan
    assert found.ranges.tolist() == [9.0, 8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0]


def test_a_lidar_on_the_car_and_on_the_map_at_once_is_mounted_as_on_the_car(tmp_path):
    """The particle filter of F1TENTH says where the laser is on the map, so that it has two parents."""
    entries = [("/tf_static", EPOCH, transforms(EPOCH, ("base_link", "laser", vector(x=0.27), rotation(0.1))))]
    for number, time in enumerate(ticks(5)):
        placed = transforms(time, ("/map", "/laser", vector(x=0.1 * number, y=2.0), rotation(1.5)))
        entries += [("/tf", time, placed), ("/scan", time, robot_scan(np.full(41, 3.0), time=time))]
    found = read(write_bag(tmp_path / "bag", entries))
    assert [d.scan.angle_min for d in found] == pytest.approx([-1.9] * 5, abs=1e-6)
    heading = 1.5 - 0.1
    x, y = 0.4 - 0.27 * math.cos(heading), 2.0 - 0.27 * math.sin(heading)
    assert found[-1].odometry.pose == pytest.approx((x, y, heading))


# what is wrong with the bags of real cars


def test_a_recorders_clock_that_is_set_back_goes_on(tmp_path):
    times = ticks(20) + ticks(20, EPOCH + 19 * STEP - 5 * SECOND)
    entries = []
    for number, time in enumerate(times):
        entries.append(("/odom", time, robot_odometry(time, speed=0.125 * number)))
        entries.append(("/scan", time, robot_scan([1.0 + 0.125 * number, 9.0], time=time)))
    told = "the recorder's clock was set back by 5.0 s after 0.5 s", "the scans' stamps go back by 5 s after 0.5 s"
    found = read(write_bag(tmp_path / "bag", entries), *told)
    assert [d.scan.ranges[0] for d in found] == [1.0 + 0.125 * number for number in range(40)]  # as they were seen
    assert [d.odometry.speed for d in found] == [0.125 * number for number in range(40)]  # with what was known then
    assert [d.received for d in found] == times  # as it is in the bag
    assert np.all(np.diff([d.scan.stamp for d in found]) > 0.0)


BACK = ticks(20) + [time - STEP - 3 * SECOND for time in ticks(20, EPOCH + 20 * STEP)]


@each("times, options, told, holds", [
    (ticks(20) + ticks(20, EPOCH + 60 * SECOND), {}, "no scans for 59.5 s after 0.5 s", lambda found: len(found) == 40),
    (ticks(40), {"stamps": BACK}, "the scans' stamps go back by 3 s after 0.5 s", lambda found:
        [d.measured for d in found] == BACK and np.allclose(np.diff([d.scan.stamp for d in found]), 0.025, atol=1e-6)),
    (ticks(10), {"stamps": [0] * 10}, "10 of 10 scans without a stamp", lambda found:
        np.allclose([d.scan.stamp for d in found], np.array(ticks(10)) / 1e9) and {d.measured for d in found} == {0}),
    ([time for time in ticks(20) for _ in range(2)],
     {"ranges": lambda number: np.full(41, 2.0 + 0.125 * (number // 2))}, "20 of 20 scans recorded twice",
     lambda found: [d.scan.ranges[0] for d in found] == [2.0 + 0.125 * number for number in range(20)]),
    (ticks(4), {"ranges": lambda _: np.linspace(1.0, 10.0, 41), "range_max": 4.0},
     "4 of 4 scans see far beyond range_max, 4 m", lambda found: np.isinf(found[0].scan.ranges[-1])),
    (ticks(80), {"odometry": ticks(20)}, "odometry more than 0.5 s old at 40 of 80 scans, at most 1.5 s",
     lambda found: found[-1].odometry.speed == 1.0),
])  # fmt: skip
def test_a_fault_is_told_and_lived_with(times, options, told, holds, tmp_path):
    found = read(drive(tmp_path, times, **options), told)
    assert holds(found) and np.all(np.diff([d.scan.stamp for d in found]) > 0.0)


def test_a_planner_goes_on_where_the_beams_change_in_the_middle(tmp_path, capsys):
    entries = []
    for number, time in enumerate(ticks(40)):
        bearings = np.linspace(-2.0, 2.0, (1081, 720, 1081, 271)[number // 10])
        seen = np.minimum(1.0 / np.maximum(np.abs(np.sin(bearings)), 1e-3), 10.0)
        entries.append(("/scan", time, robot_scan(seen, first=-2.0, step=4.0 / (len(seen) - 1), time=time)))
        entries.append(("/odom", time, robot_odometry(time, speed=1.0)))
    bag = write_bag(tmp_path / "bag", entries)
    for name in ("gap_finder", "disparity_extender"):
        out = tmp_path / f"{name}.csv"
        assert main(["replay-scans", str(bag), "--controller", name, "--out", str(out)]) == 0
        assert "scans have 1081 beams, and 720 from number 11 on" in capsys.readouterr().err
        rows = np.loadtxt(out, delimiter=",", skiprows=1)
        assert len(rows) == 40 and np.abs(rows[:, 2]).max() < 0.2  # the corridor is straight, however it is seen


# what is refused


def test_topics_are_the_usual_or_the_only_ones_or_those_asked_for(tmp_path):
    both = write_bag(tmp_path / "both", [*scans(1, "/front"), *scans(2, "/rear")])
    with pytest.raises(BagError, match=r"on /front, /rear; accepted: one, by --scan-topic"):
        read(both)
    assert len(read(both, scan_topic="/rear")) == 2
    with pytest.raises(BagError, match=r"no sensor_msgs/msg/LaserScan on /top; accepted: /front, /rear"):
        read(both, scan_topic="/top")
    assert len(read(write_bag(tmp_path / "usual", [*scans(1, "/scan"), *scans(2, "/rear")]), "/scan is read")) == 1
    assert len(read(write_bag(tmp_path / "only", scans(3, "/rear")))) == 3
    odometry = [(topic, EPOCH, robot_odometry(EPOCH)) for topic in ("/wheel/odom", "/pf/pose/odom")]
    bag = write_bag(tmp_path / "two", [*odometry, *scans(1)])
    with pytest.raises(BagError, match=r"has nav_msgs/msg/Odometry on /pf/pose/odom, /wheel/odom; .* by --odom-topic"):
        read(bag)
    assert len(read(bag, odometry_topic="/wheel/odom")) == 1
    command = drive_message(DriveCommand(steering_angle=0.1, speed=1.0), EPOCH)
    bag = write_bag(tmp_path / "other", [*scans(1), ("/mux/a", EPOCH, command), ("/mux/b", EPOCH, command)])
    with pytest.raises(BagError, match="on /mux/a, /mux/b; accepted: one, by --drive-topic"):
        read(bag)
    assert len(read(bag, drive_topic="mux/b")) == 1


def test_an_increment_against_the_turn_is_refused(tmp_path):
    bag = drive(tmp_path, ticks(3), first=2.0, step=0.1, angle_max=-2.0)
    with pytest.raises(BagError, match=r"angle_increment is 0\.1 rad, and its beams go from 2 to -2 rad; accepted"):
        read(bag)


@each("content, said", [
    (None, "accepted: an .mcap or .db3"), (b"", "accepted: an .mcap or .db3"), (b"bag", "accepted: an .mcap or .db3"),
    ("no scans", "holds no scans.*/odom [(]nav_msgs/msg/Odom"),
])  # fmt: skip
def test_what_is_no_bag_of_scans_is_refused_in_one_line(content, said, here, capsys):
    if content == "no scans":
        write_bag("drive.mcap", [("/odom", EPOCH, robot_odometry(EPOCH))])
    elif content is not None:
        (here / "drive.mcap").write_bytes(content)
    line = refused(here, capsys, "replay-scans", "drive.mcap", "--out", "out.csv")
    assert re.search(said, line) and "drive.mcap" in line
