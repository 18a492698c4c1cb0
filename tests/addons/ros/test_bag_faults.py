"""What is wrong with the bags of real cars: each fault is said in a line and lived with, or refused in a line."""

import math
import warnings

import numpy as np
import pytest

from bag_worlds import SECOND, robot_odometry, robot_scan, rotation, transforms, vector, write_bag
from case_loops import cases
from fg_mujoco.addons.ros.bag_messages import drive_message
from fg_mujoco.addons.ros.bag_reader import ScanBag
from fg_mujoco.cli.main import main
from fg_mujoco.errors import BagError
from fg_mujoco.messages import DriveCommand
from fg_mujoco.vehicle.vehicle import Vehicle

CAR = Vehicle.load().parameters
EPOCH = 1_700_000_000 * SECOND
STEP = SECOND // 40
WALLS = np.full(41, 3.0)


def read(path, said=None, **options):
    """Return what the bag delivers, and add what is said of it to `said`."""
    with warnings.catch_warnings(record=True) as warned, ScanBag(path, CAR, **options) as bag:
        warnings.simplefilter("always")
        found = list(bag)
    assert (said is None) == (not warned)
    if said is not None:
        said += [str(each.message) for each in warned]
    return found


def drive(tmp_path, times, *, stamps=None, ranges=None, odometry=None, name="bag", **scan):
    """Write scans that were recorded at times, in the order of the file, and odometry of 1 m/s along x."""
    stamps = times if stamps is None else stamps
    entries = []
    for number, (time, stamp) in enumerate(zip(times, stamps, strict=True)):
        seen = np.full(41, 2.0 + 0.125 * (number % 64)) if ranges is None else ranges(number)
        entries.append(("/scan", time, robot_scan(seen, time=stamp, **scan)))
    for time in times if odometry is None else odometry:
        entries.append(("/odom", time, robot_odometry(time, x=(time - times[0]) / SECOND, speed=1.0)))
    return write_bag(tmp_path / name, entries)


def grow(found):
    return (np.diff([delivery.scan.stamp for delivery in found]) > 0.0).all()


def ticks(count, first=EPOCH):
    return [first + number * STEP for number in range(count)]


def test_a_recorders_clock_that_is_set_back_goes_on(tmp_path):
    times = ticks(20) + ticks(20, EPOCH + 19 * STEP - 5 * SECOND)
    entries = []
    for number, time in enumerate(times):
        entries.append(("/odom", time, robot_odometry(time, speed=0.125 * number)))
        entries.append(("/scan", time, robot_scan([1.0 + 0.125 * number, 9.0], time=time)))
    said = []
    found = read(write_bag(tmp_path / "bag", entries), said)
    assert [d.scan.ranges[0] for d in found] == [1.0 + 0.125 * number for number in range(40)]  # as they were seen
    assert [d.odometry.speed for d in found] == [0.125 * number for number in range(40)]  # with what was known then
    assert [d.received for d in found] == times  # as it is in the bag
    assert grow(found)
    assert any("the recorder's clock was set back by 5.0 s after 0.5 s" in each for each in said)
    assert any("the scans' stamps go back by 5 s after 0.5 s" in each for each in said)


def test_a_clock_that_jumps_forward_leaves_a_gap_that_is_said(tmp_path):
    said = []
    found = read(drive(tmp_path, ticks(20) + ticks(20, EPOCH + 60 * SECOND)), said)
    assert len(found) == 40 and grow(found)
    assert any("no scans for 59.5 s after 0.5 s" in each for each in said)


def test_stamps_that_go_back_where_the_recorder_goes_on_still_grow_for_the_planner(tmp_path):
    times = ticks(40)
    stamps = times[:20] + [time - STEP - 3 * SECOND for time in times[20:]]
    said = []
    found = read(drive(tmp_path, times, stamps=stamps), said)
    assert [d.measured for d in found] == stamps  # the files say what the bag says
    assert np.diff([d.scan.stamp for d in found]) == pytest.approx(0.025, abs=1e-6)
    assert any("the scans' stamps go back by 3 s after 0.5 s" in each for each in said)


def test_scans_without_a_stamp_have_the_time_at_which_they_were_recorded(tmp_path):
    said = []
    found = read(drive(tmp_path, ticks(10), stamps=[0] * 10), said)
    assert [d.scan.stamp for d in found] == pytest.approx([time / 1e9 for time in ticks(10)])
    assert {d.measured for d in found} == {0}
    assert any("10 of 10 scans without a stamp" in each for each in said)


def test_scans_that_were_recorded_twice_are_taken_once(tmp_path):
    times = [time for time in ticks(20) for _ in range(2)]
    said = []
    found = read(drive(tmp_path, times, ranges=lambda number: np.full(41, 2.0 + 0.125 * (number // 2))), said)
    assert [d.scan.ranges[0] for d in found] == [2.0 + 0.125 * number for number in range(20)]
    assert any("20 of 20 scans recorded twice" in each for each in said)


def test_a_planner_goes_on_where_the_beams_change_in_the_middle(tmp_path, capsys):
    entries = []
    for number, time in enumerate(ticks(40)):
        bearings = np.linspace(-2.0, 2.0, (1081, 720, 1081, 271)[number // 10])
        seen = np.minimum(1.0 / np.maximum(np.abs(np.sin(bearings)), 1e-3), 10.0)
        entries.append(("/scan", time, robot_scan(seen, first=-2.0, step=4.0 / (len(seen) - 1), time=time)))
        entries.append(("/odom", time, robot_odometry(time, speed=1.0)))
    bag = write_bag(tmp_path / "bag", entries)
    for name in cases("gap_finder", "disparity_extender"):
        out = tmp_path / f"{name}.csv"
        assert main(["replay-scans", str(bag), "--controller", name, "--out", str(out)]) == 0
        assert "scans have 1081 beams, and 720 from number 11 on" in capsys.readouterr().err
        rows = np.loadtxt(out, delimiter=",", skiprows=1)
        assert len(rows) == 40 and np.abs(rows[:, 2]).max() < 0.2  # the corridor is straight, however it is seen


def test_an_increment_against_the_turn_is_refused(tmp_path):
    bag = drive(tmp_path, ticks(3), first=2.0, step=0.1, angle_max=-2.0)
    with pytest.raises(BagError, match=r"angle_increment is 0\.1 rad, and its beams go from 2 to -2 rad; accepted"):
        read(bag)


def test_a_range_max_below_what_is_seen_is_said(tmp_path):
    said = []
    found = read(drive(tmp_path, ticks(4), ranges=lambda _: np.linspace(1.0, 10.0, 41), range_max=4.0), said)
    assert np.isinf(found[0].scan.ranges[-1])
    assert any("4 of 4 scans see far beyond range_max, 4 m" in each for each in said)


def test_odometry_that_stops_is_said(tmp_path):
    said = []
    found = read(drive(tmp_path, ticks(80), odometry=ticks(20)), said)
    assert found[-1].odometry.speed == 1.0
    assert any("odometry more than 0.5 s old at 40 of 80 scans, at most 1.5 s" in each for each in said)


def test_a_lidar_upside_down_by_transforms_without_a_base_link_is_read_as_the_odometry_says(tmp_path):
    links = transforms(EPOCH, ("car/chassis_7", "laser", vector(x=0.2), rotation(0.0, math.pi)))
    odometry = robot_odometry(EPOCH)
    odometry.child_frame_id = "car/chassis_7"
    entries = [
        ("/tf_static", EPOCH, links), ("/odom", EPOCH, odometry),
        ("/scan", EPOCH, robot_scan(np.arange(1.0, 10.0), first=-1.0, step=0.25, time=EPOCH)),
    ]  # fmt: skip
    scan = read(write_bag(tmp_path / "bag", entries))[0].scan
    assert scan.ranges.tolist() == [9.0, 8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0]


def test_a_lidar_on_the_car_and_on_the_map_at_once_is_mounted_as_on_the_car(tmp_path):
    """The particle filter of F1TENTH says where the laser is on the map, so that it has two parents."""
    entries = [("/tf_static", EPOCH, transforms(EPOCH, ("base_link", "laser", vector(x=0.27), rotation(0.1))))]
    for number, time in enumerate(ticks(5)):
        placed = transforms(time, ("/map", "/laser", vector(x=0.1 * number, y=2.0), rotation(1.5)))
        entries += [("/tf", time, placed), ("/scan", time, robot_scan(WALLS, time=time))]
    said = []
    found = read(write_bag(tmp_path / "bag", entries), said=None)
    assert [d.scan.angle_min for d in found] == pytest.approx([-1.9] * 5, abs=1e-6)
    heading = 1.5 - 0.1
    x, y = 0.4 - 0.27 * math.cos(heading), 2.0 - 0.27 * math.sin(heading)
    assert found[-1].odometry.pose == pytest.approx((x, y, heading))
    assert said == []


def test_two_candidates_are_refused_by_name_with_the_option(tmp_path, capsys):
    entries = [(topic, EPOCH, robot_odometry(EPOCH)) for topic in ("/wheel/odom", "/pf/pose/odom")]
    entries += [("/scan", EPOCH, robot_scan(WALLS, time=EPOCH))]
    bag = write_bag(tmp_path / "bag", entries)
    assert main(["replay-scans", str(bag), "--out", str(tmp_path / "out.csv")]) == 2
    said = capsys.readouterr().err
    assert "has nav_msgs/msg/Odometry on /pf/pose/odom, /wheel/odom; accepted: one, by --odom-topic" in said
    assert said.count("\n") == 1
    assert len(read(bag, odometry_topic="/wheel/odom")) == 1
    command = drive_message(DriveCommand(steering_angle=0.1, speed=1.0), EPOCH)
    bag = write_bag(tmp_path / "other", [*entries[1:], ("/mux/a", EPOCH, command), ("/mux/b", EPOCH, command)])
    with pytest.raises(BagError, match="on /mux/a, /mux/b; accepted: one, by --drive-topic"):
        read(bag)
    assert len(read(bag, drive_topic="mux/b")) == 1
