"""Odometry that is negative where the car drives forward, as a stock F1TENTH car has it, is turned round and said."""

import math
import warnings

import numpy as np
import pytest

from bag_worlds import CAR, EPOCH, SECOND, header, robot_odometry, robot_scan, rotation, transforms, vector
from bag_worlds import write_bag as write
from cases import each
from fg_mujoco.addons.realcar.bag_drive import read_drives
from fg_mujoco.addons.ros.bag_messages import DRIVE, MOTOR, ODOMETRY, drive_message
from fg_mujoco.addons.ros.bag_reader import ScanBag
from fg_mujoco.addons.ros.bag_recording import Recording
from fg_mujoco.addons.ros.composed_topics import motor_message
from fg_mujoco.cli.main import main
from fg_mujoco.errors import BagError
from fg_mujoco.messages import DriveCommand
from scan_worlds import odometry_of

STEP, RADIUS, SPEED = SECOND // 20, 1.8, 1.5
BEARINGS = np.linspace(-2.0, 2.0, 201)
STOCK = {"speed": -1, "yaw_rate": -1, "pose": -1}  # of f1tenth/vesc, branch ros2


def seen(x, y, heading):
    """Ranges in a room of 9 by 7 m that is not in the middle of the circle."""
    c, s = np.cos(heading + BEARINGS), np.sin(heading + BEARINGS)
    with np.errstate(divide="ignore"):
        return np.minimum(np.where(c > 0, 5.0 - x, -4.0 - x) / c, np.where(s > 0, 4.5 - y, -2.5 - y) / s)


def motor(time, speed):
    message = motor_message(odometry_of(speed), 1.0)
    message.header = header(time, "")
    return message


def circle(folder, signs, *, direction=1, lidar=0.0, scans=True, commands=True, core=None, localised=False, ticks=50):
    """A car that goes round to the left, 1.5 m/s, or backwards, whose odometry has signs; as a bag."""
    entries = []
    for number in range(ticks):
        time, moved = EPOCH + number * STEP, direction * SPEED * number * STEP / SECOND
        heading, speed = moved / RADIUS, direction * SPEED
        x, y = RADIUS * math.sin(heading), RADIUS * (1.0 - math.cos(heading))
        sign = signs.get("pose", 1)
        entries.append(("/odom", time, robot_odometry(
            time, x=sign * x, y=y, yaw=sign * heading, speed=signs.get("speed", 1) * speed,
            yaw_rate=signs.get("yaw_rate", 1) * speed / RADIUS)))  # fmt: skip
        if core is not None:
            entries[-1] = ("/sensors/core", time, motor(time, core * speed))
        if localised:
            entries.append(("/tf", time, transforms(time, ("map", "odom", vector(1.0), rotation(0.0)))))
        ranges = seen(x, y, heading + lidar) if scans else np.full(201, math.inf)
        entries.append(("/scan", time, robot_scan(ranges, first=-2.0, step=0.02, time=time)))
        if commands:
            command = DriveCommand(steering_angle=math.atan(CAR.wheelbase / RADIUS), speed=speed)
            entries.append(("/drive", time + 1, drive_message(command, time + 1)))
    return write(folder / "bag", entries)


def odometry(bag, topic=(ODOMETRY, "/odom")):
    """What is read of a topic: x, y, twice the heading's quaternion, speed, yaw rate; and what is said."""
    with warnings.catch_warnings(record=True) as warned, Recording(bag) as recording:
        warnings.simplefilter("always")
        found = [each.message for each in recording.messages({topic})]
    return [
        (m.pose.pose.position.x, m.pose.pose.position.y, m.pose.pose.orientation.z, m.twist.twist.linear.x,
         m.twist.twist.angular.z) for m in found
    ], [str(each.message) for each in warned]  # fmt: skip


def right(direction=1, ticks=50):
    """What `odometry` returns of it."""
    speed = direction * SPEED
    heading = speed / RADIUS * np.arange(ticks) * STEP / SECOND
    place = RADIUS * np.sin(heading), RADIUS * (1.0 - np.cos(heading)), np.sin(0.5 * heading)
    return np.column_stack((*place, np.full(ticks, speed), np.full(ticks, speed / RADIUS)))


@each("signs, told, options", [
    (STOCK, "by the commands and the scans", {}),
    (STOCK, "by the scans", {"commands": False}),
    (STOCK, "by the commands", {"scans": False}),
    (STOCK, "by the commands and the scans", {"direction": -1}),
    ({"speed": -1, "pose": -1}, "by the commands and the scans", {"ticks": 1}),
    ({"speed": -1, "yaw_rate": -1}, "by the commands and the scans", {}),  # a localisation's poses are right
    ({"speed": -1}, "by the commands and the scans", {}),  # and the yaw rate a gyro's
    ({"speed": -1}, "by the commands", {"scans": False}),
    ({}, "", {}), ({}, "", {"direction": -1}), ({}, "", {"commands": False}), ({}, "", {"scans": False}),
    ({}, "", {"commands": False, "lidar": math.pi}),  # a LiDAR that looks backwards, which nobody says
    ({}, "the scans say that it is negative forward, the commands do not; its sign stays", {"lidar": math.pi}),
])  # fmt: skip
def test_odometry_that_is_negative_forward_is_turned_round_by_what_commands_or_scans_say(
    signs, told, options, tmp_path
):
    found, said = odometry(circle(tmp_path, signs, **options))
    if options.get("ticks") == 1:  # too short to say
        assert not said
        return
    assert np.allclose(found, right(options.get("direction", 1)))
    assert bool(told) == bool(said) and all(told in each and each.count("/odom") == 1 for each in said), said


@each("signs", [{"yaw_rate": 0}, {"yaw_rate": 0, "speed": -1}])  # as f1tenth_system's vesc.yaml has it
def test_a_yaw_rate_that_is_0_where_the_car_turns_is_not_read(signs, tmp_path):
    bag = circle(tmp_path, signs)
    found, said = odometry(bag)
    assert len(said) == 1 and "/odom: its yaw rate is always 0, also where the scans turn, and is not read" in said[0]
    speeds, yaw_rates = np.array(found)[:, 3:].T
    assert np.allclose(speeds, SPEED) and np.isnan(yaw_rates).all()
    with pytest.warns(UserWarning, match="its yaw rate"), pytest.raises(BagError, match="has no yaw rate"):
        read_drives(bag)


def test_poses_that_a_localisation_corrects_stay_as_they_are(tmp_path):
    found, said = odometry(circle(tmp_path, STOCK, localised=True))
    assert said and np.allclose(np.array(found)[:, 3:], right()[:, 3:])
    assert np.allclose(np.array(found)[:, 0], -right()[:, 0])


def test_every_command_that_reads_bags_turns_the_sign_round_and_says_so(tmp_path, capsys):
    bag = circle(tmp_path, {}, core=-1, ticks=110)  # f1tenth/vesc, branch main, without odometry
    told = "it is negative where the car drives forward"
    with pytest.warns(UserWarning, match=f"/sensors/core: {told}"), ScanBag(bag, CAR) as scans:
        assert [each.odometry.speed for each in scans] == pytest.approx([SPEED] * 110)
        assert scans.topics[MOTOR] == "/sensors/core" and scans.topics[DRIVE] == "/drive"
    (tmp_path / "odom").mkdir()
    bag = circle(tmp_path / "odom", STOCK, ticks=110)
    with pytest.warns(UserWarning, match=f"/odom: {told}"):
        (drive,) = read_drives(bag)
    assert np.allclose(drive.speed.values, SPEED) and np.allclose(drive.yaw_rate.values, SPEED / RADIUS)
    for command, *options in (("bag",), ("replay-scans", "--out", f"{tmp_path}/c.csv")):
        assert main([command, str(bag), *options]) == 0
        assert capsys.readouterr().err.count(f"/odom: {told}") == 1


def test_a_table_is_shown_of_a_bag_whose_scans_cannot_be_read(tmp_path, monkeypatch, capsys):
    bag = circle(tmp_path, STOCK, commands=False)
    monkeypatch.setattr("fg_mujoco.addons.ros.bag_recording.to_scan", lambda *_: object().ranges)
    assert main(["bag", str(bag)]) == 0
    assert "/scan" in capsys.readouterr().out
